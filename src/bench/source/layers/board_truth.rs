//! A printed chessboard in view as truth: its disparity in a rectified pair is an affine function
//! of the pixel, whatever the size of its squares.

use crate::source::frames::{BoardPlane, Source, wraps};
use nalgebra::{Point2, Point3};
use parking_lot::Mutex;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use svl_calibrate::Board;
use svl_calibrate::choose::{Refusal, outline};
use svl_calibrate::detect::{Detection, PairDetector};
use svl_core::statistics::lower_median;
use svl_core::stereo::{Frame, Geometry, Plane, Rig, Side, StereoCalibration};
use svl_core::{Error, Result, counted};

/// Largest rms of the residuals of all corners, and mean difference of their rows, pixels.
const MAX_RMS_PX: f64 = 0.35;
const MAX_ROWS_PX: f64 = 1.0;
/// Least disparity on the board, and largest motion of a board whose two images may be of two
/// times, pixels.
const MIN_PX: f64 = 1.0;
const MAX_MOTION_PX: f64 = 1.0;
/// Part of a square that is truth around the outer corners.
const MARGIN: f64 = 0.9;

/// Detections of the last pair, by its number, before it is rectified; true of a raw one.
type SeenBoard = Arc<Mutex<Option<(u64, bool, [Detection; 2])>>>;

/// Finds the board in pairs as they were read, for [`BoardTruth`].
pub struct BoardFinder {
    detector: PairDetector,
    seen: SeenBoard,
}

/// A source whose pairs are searched for a board.
pub struct BoardSightings<'a> {
    source: Box<dyn Source + 'a>,
    finder: BoardFinder,
}

impl<'a> BoardSightings<'a> {
    pub fn new(source: Box<dyn Source + 'a>, finder: BoardFinder) -> Self {
        Self { source, finder }
    }
}

impl Source for BoardSightings<'_> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        let frame = self.source.next()?;
        if let Some(frame) = &frame {
            let seen = self.finder.detector.find(&frame.pair);
            let is_raw = matches!(frame.geometry, Geometry::Raw);
            *self.finder.seen.lock() = Some((frame.sequence, is_raw, seen));
        }
        Ok(frame)
    }
}

/// The truth of pairs that show a board.
pub struct BoardTruth {
    board: Board,
    seen: SeenBoard,
    /// The board of the last pair, if it shows it.
    pub last: Option<BoardPlane>,
    /// Left corners of the pair before.
    before: Option<Vec<Point2<f64>>>,
    /// A larger board that a pair shows: cut off by an edge, it looks like the one sought.
    larger: Option<Refusal>,
    /// Refused pairs, by reason.
    refused: BTreeMap<String, u64>,
    /// Per accepted pair the rms of its residuals.
    rms_px: Vec<f64>,
    ends_px: [f64; 2],
}

impl BoardTruth {
    pub fn new(board: Board) -> Self {
        Self {
            board,
            seen: SeenBoard::default(),
            last: None,
            before: None,
            larger: None,
            refused: BTreeMap::new(),
            rms_px: Vec::new(),
            ends_px: [f64::INFINITY, 0.0],
        }
    }

    /// The layer that finds the board before pairs are rectified.
    ///
    /// # Errors
    /// The errors of [`PairDetector::new`].
    pub fn finder(&self) -> Result<BoardFinder> {
        Ok(BoardFinder {
            detector: PairDetector::new(self.board)?,
            seen: Arc::clone(&self.seen),
        })
    }

    /// The corners along both sides, as `9x6`.
    pub fn size(&self) -> String {
        format!("{}x{}", self.board.columns(), self.board.rows())
    }

    pub fn refused(&self) -> u64 {
        self.refused.values().sum()
    }

    /// The board of a frame; none of one that is refused, which is counted.
    fn found(&mut self, frame: &Frame) -> Option<BoardPlane> {
        let seen = self.seen.lock().take();
        let (_, is_raw, seen) = seen.filter(|(number, ..)| *number == frame.sequence)?;
        let (columns, rows) = (self.board.columns(), self.board.rows());
        let ends = (columns.max(rows), columns.min(rows));
        for (side, own) in Side::BOTH.into_iter().zip(&seen) {
            if let Detection::Other { corners } = own
                && corners.0 >= ends.0
                && corners.1 >= ends.1
            {
                self.larger = Refusal::from_detection(side, own);
            }
        }
        let before = self.before.take();
        self.before = Some(seen[0].corners().to_vec()).filter(|own| !own.is_empty());
        match self.judged(frame, is_raw, &seen, before) {
            Ok(found) => {
                self.rms_px.push(found.rms_px);
                let [least, most] = &mut self.ends_px;
                for corner in &found.corners[0] {
                    *least = least.min(found.px(corner));
                    *most = most.max(found.px(corner));
                }
                Some(found)
            }
            Err(reason) => {
                *self.refused.entry(reason).or_default() += 1;
                None
            }
        }
    }

    fn judged(
        &self,
        frame: &Frame,
        is_raw: bool,
        seen: &[Detection; 2],
        before: Option<Vec<Point2<f64>>>,
    ) -> Result<BoardPlane, String> {
        if let Some(larger) = &self.larger {
            return Err(larger.to_string());
        }
        let sides = Side::BOTH.into_iter().zip(seen);
        for (side, seen) in sides {
            if let Some(refusal) = Refusal::from_detection(side, seen) {
                return Err(refusal.to_string());
            }
        }
        let corners = seen.each_ref().map(Detection::corners);
        // The images may be of two times, unless they are no stream: a moved board shifts the plane
        // without a residual.
        let moved_px = before.map(|before| {
            let steps = before.iter().zip(corners[0]);
            steps.map(|(a, b)| (b - a).norm()).sum::<f64>() / corners[0].len() as f64
        });
        let is_of_one_time = frame.name.is_some() || frame.exposure.skew_ns == Some(0);
        if !is_of_one_time && moved_px > Some(MAX_MOTION_PX) {
            return Err(Refusal::Moving.to_string());
        }
        if matches!(frame.geometry, Geometry::Raw) {
            return Err("not rectified: svl calibrate board".to_owned());
        }
        let by = frame.calibration.as_deref().filter(|_| is_raw);
        let rectified = Side::BOTH.map(|side| {
            let points = corners[side as usize].iter();
            let point = |at: &Point2<f64>| by.map_or(Some(*at), |by| rectified(by, side, at));
            points.map(point).collect::<Option<Vec<_>>>()
        });
        let [Some(left), Some(right)] = rectified else {
            return Err("beyond what its lens is calibrated for".to_owned());
        };
        let found = BoardPlane::new([left, right]).ok_or("bent or blurred")?;
        let [left, right] = &found.corners;
        let rows = left.iter().zip(right).map(|(l, r)| (l.y - r.y).abs());
        if rows.sum::<f64>() > MAX_ROWS_PX * left.len() as f64 {
            return Err("not rectified: its rows differ".to_owned());
        }
        if found.rms_px > MAX_RMS_PX {
            return Err("bent or blurred".to_owned());
        }
        let ends = outline(&self.board, left, MARGIN).ok_or("bent or blurred")?;
        if ends.iter().any(|end| found.px(end) < MIN_PX) {
            return Err("too far away".to_owned());
        }
        Ok(found)
    }

    /// The disparities on the board of a frame.
    pub fn measured(&mut self, frame: &Frame) -> Result<Option<Plane<f32>>> {
        self.last = self.found(frame);
        let Some(found) = &self.last else {
            return Ok(None);
        };
        let (width, height) = frame.pair.size();
        let ends = outline(&self.board, &found.corners[0], MARGIN);
        let disparity = Plane::from_fn(width, height, |x, y| {
            let at = Point2::new(x as f64, y as f64);
            let is_on = ends.as_ref().is_some_and(|ends| is_inside(ends, &at));
            if is_on {
                found.px(&at) as f32
            } else {
                f32::INFINITY
            }
        });
        disparity.map(Some)
    }

    /// The pairs with the board in words, and those without, by reason.
    pub fn words(&self) -> String {
        let (found, size) = (self.rms_px.len() as u64, self.size());
        let refused = self.refused.iter();
        let refused: Vec<_> = refused
            .map(|(why, pairs)| format!("{pairs} {why}"))
            .collect();
        let refused = match refused[..] {
            [] => String::new(),
            _ => format!(" ({})", refused.join(", ")),
        };
        let rms = lower_median(self.rms_px.iter().copied());
        let [least, most] = self.ends_px;
        let plane = rms.map(|rms| format!(", plane within {rms:.2} px, {least:.0}–{most:.0} px"));
        format!(
            "board of {size} in {found} of {} pairs{refused}{}",
            found + self.refused(),
            plane.unwrap_or_default()
        )
    }

    /// Fails where no pair shows the board, or one shows a larger board.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the reasons.
    pub fn check_any(&self, name: &str) -> Result<()> {
        let is_any = self.refused.is_empty() || !self.rms_px.is_empty();
        if is_any && self.larger.is_none() {
            return Ok(());
        }
        Err(Error::Invalid(format!(
            "{name}: --truth: {}; it has to be seen whole, flat and still by both cameras",
            self.words()
        )))
    }
}

/// Ratios of distances on a board by the rig to the printed ones.
#[derive(Default)]
pub struct BoardScale {
    /// Per pair the scale, and that along rows over that along columns.
    pairs: Vec<(f64, f64)>,
}

/// The scale of a rig, by a board.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RigScale {
    /// Number of pairs with the board.
    pub pairs: usize,
    /// Measured over printed distance: the median over the pairs, with its 95 % interval.
    pub scale: f64,
    pub interval: [f64; 2],
    /// The same along rows over that along columns.
    pub stretch: f64,
}

impl BoardScale {
    /// Adds the board of a pair.
    pub fn add(&mut self, board: &Board, found: &BoardPlane, rig: &Rig) {
        let point = |corner: &Point2<f64>| {
            let z = rig.depth_m(found.px(corner))?;
            Some(Point3::from(rig.point_m((corner.x, corner.y), z)))
        };
        let points = found.corners[0].iter().map(point);
        let Some(points) = points.collect::<Option<Vec<_>>>() else {
            return;
        };
        let columns = board.columns();
        let apart = |step: usize| -> Vec<f64> {
            let pairs = (step..points.len()).filter(|i| step > 1 || i % columns > 0);
            pairs
                .map(|i| (points[i] - points[i - step]).norm() / board.side())
                .collect()
        };
        let (along, down) = (apart(1), apart(columns));
        let scale = lower_median([&along[..], &down].concat());
        let sides = lower_median(along).zip(lower_median(down));
        let stretch = sides.map(|(along, down)| along / down);
        self.pairs.extend(scale.zip(stretch));
    }

    /// The scale by all pairs; `None` without any.
    pub fn scale(mut self) -> Option<RigScale> {
        let pairs = self.pairs.len();
        let stretch = lower_median(self.pairs.iter().map(|own| own.1))?;
        self.pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Ranks between which the median is in 95 % of the samples.
        let half = 0.98 * (pairs as f64).sqrt();
        let middle = (pairs - 1) as f64 / 2.0;
        let at = |place: f64| self.pairs[place.clamp(0.0, (pairs - 1) as f64) as usize].0;
        Some(RigScale {
            pairs,
            scale: at(middle),
            interval: [at((middle - half).floor()), at((middle + half).ceil())],
            stretch,
        })
    }
}

impl RigScale {
    /// Largest error of a rig that is in order, and largest difference of a print's two sides.
    const MAX_ERROR: f64 = 0.02;
    const MAX_STRETCH: f64 = 0.01;

    /// True if distances are wrong by too much.
    pub fn is_off(&self) -> bool {
        (self.scale - 1.0).abs() > Self::MAX_ERROR
    }

    /// The scale in words.
    pub fn words(&self) -> String {
        // To a tenth, and never -0.
        let percent = |scale: f64| (1000.0 * (scale - 1.0)).round() / 10.0 + 0.0;
        let off = percent(self.scale).abs();
        let than = if self.scale > 1.0 { "long" } else { "short" };
        let mut ends = self
            .interval
            .map(|end| percent(end) * (self.scale - 1.0).signum() + 0.0);
        ends.sort_by(f64::total_cmp);
        let stretched = (self.stretch - 1.0).abs() > Self::MAX_STRETCH;
        let stretched = stretched.then(|| {
            let stretch = percent(self.stretch);
            format!(
                "; its rows are {stretch:+.1} % longer than its columns: the print is stretched"
            )
        });
        let scale = if off < 0.1 {
            "right within 0.1 %".to_owned()
        } else {
            format!("{off:.1} % too {than}")
        };
        let cause = (off >= 0.1).then_some(": baseline, focal length or the print");
        format!(
            "distances are {scale} ({:.1}–{:.1}, {}){}{}",
            ends[0],
            ends[1],
            counted(self.pairs as u64, "pair"),
            cause.unwrap_or_default(),
            stretched.unwrap_or_default()
        )
    }
}

/// The pixel of a raw image in the rectified one.
fn rectified(
    calibration: &StereoCalibration,
    side: Side,
    pixel: &Point2<f64>,
) -> Option<Point2<f64>> {
    let rectification = calibration.rectification()?;
    let (camera, rotation) = match side {
        Side::Left => (calibration.left(), rectification.left),
        Side::Right => (calibration.right(), rectification.right),
    };
    let direction = rotation * camera.direction(*pixel)?.push(1.0);
    let projected = rectification.rig.intrinsics(side) * direction;
    (direction.z > 0.0).then(|| Point2::from(projected.xy() / projected.z))
}

/// True inside a convex quadrangle.
fn is_inside(ends: &[Point2<f64>; 4], at: &Point2<f64>) -> bool {
    let sides = [0, 1, 2, 3].map(|i| (ends[(i + 1) % 4] - ends[i]).perp(&(at - ends[i])));
    sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::inputs::board::BoardSource;
    use crate::source::layers::chain::Chain;
    use crate::source::layers::measured::{MeasuredMaps, SourceMaps};
    use crate::source::layers::rectified::AppliedCalibration;
    use svl_calibrate::simulated::MovingBoard;
    use svl_core::rectify::{Framing, bouguet};

    /// The board of a simulation, rectified by its own calibration.
    #[test]
    fn the_plane_is_that_of_the_true_corners() {
        let moving = MovingBoard::new(1).unwrap();
        let framed = bouguet(&moving.truth, &Framing::default()).unwrap();
        let calibration = moving.truth.clone().with_rectification(framed);
        let truth = BoardTruth::new(moving.board);
        let chain = Chain {
            sight: Some(truth.finder().unwrap()),
            rectify: Some(AppliedCalibration {
                calibration: calibration.clone(),
                follows_pairs: false,
            }),
            measure: Some(SourceMaps {
                truth: Some(MeasuredMaps::Board(Box::new(truth))),
                ..SourceMaps::default()
            }),
            ..Chain::default()
        };
        let mut source = chain.over(Box::new(BoardSource::new(1).unwrap())).unwrap();
        let (mut close, mut found) = (0, 0);
        let mut scale = BoardScale::default();
        for _ in 0..64 {
            let frame = source.next().unwrap().unwrap();
            // Three pairs of eight show a board that is held still.
            if frame.sequence % 8 > 2 {
                continue;
            }
            let Some((board, view)) = source.board().zip(moving.view(frame.sequence)) else {
                continue;
            };
            scale.add(&moving.board, board, frame.rig().unwrap());
            let corners = view.left.iter().zip(&view.right);
            let errors = corners.map(|(left, right)| {
                let left = rectified(&calibration, Side::Left, left).unwrap();
                let right = rectified(&calibration, Side::Right, right).unwrap();
                (board.px(&left) - (left.x - right.x)).abs()
            });
            let worst = errors.fold(0.0, f64::max);
            assert!(worst < 0.35, "pair {}: {worst} px", frame.sequence);
            found += 1;
            close += u32::from(worst < 0.1);
        }
        assert!(
            found >= 20 && close * 20 >= found * 19,
            "{close} of {found}"
        );
        let scale = scale.scale().unwrap();
        assert!((scale.scale - 1.0).abs() < 0.003, "{scale:?}");
        assert!(
            (scale.stretch - 1.0).abs() < 0.003 && !scale.is_off(),
            "{scale:?}"
        );
    }

    #[test]
    fn a_rig_that_is_off_is_told_by_how_much() {
        let scale = RigScale {
            pairs: 9,
            scale: 0.97,
            interval: [0.969, 0.971],
            stretch: 1.02,
        };
        assert!(scale.is_off());
        let words = scale.words();
        assert!(
            words.contains("3.0 % too short (2.9–3.1, 9 pairs)"),
            "{words}"
        );
        assert!(words.contains("the print is stretched"), "{words}");
    }
}
