//! Selection of views for calibration: pairs that show the complete board in both images, sharp and
//! still, in a new pose.

mod coverage;
mod pose;

pub use coverage::MissingCoverage;
pub use pose::outline;

use super::detect::{Detection, Edge, Sighting};
use super::{Board, StereoView};
use coverage::ViewCoverage;
use nalgebra::Point2;
use pose::RoughPose;
use std::fmt::{Display, Formatter};
use svl_core::stereo::Side;

/// Selects views of one board.
pub struct Chooser {
    board: Board,
    size: (usize, usize),
    /// The accepted views.
    pub views: Vec<StereoView>,
    /// Poses of the accepted and of the declined views.
    known: Vec<RoughPose>,
    coverage: ViewCoverage,
    /// Stamp and left corners of the previous pair.
    before: Option<(u64, Vec<Point2<f64>>)>,
}

/// Reason why a pair is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Refusal {
    /// The side is that of the image, here and below.
    NoBoard(Side),
    /// A board with another number of corners, along the longer and the shorter side.
    OtherBoard(Side, (usize, usize)),
    CutOff(Side, Edge),
    /// Some corners within the image are not found.
    Hidden(Side),
    Blurred(Side),
    /// Too little contrast between dark and bright squares.
    Faint(Side),
    Moving,
    NothingNew,
}

/// Number of views that suffices if no coverage is missing.
pub const SUFFICIENT_VIEWS: usize = 20;
/// Number of views that suffices whatever coverage is missing.
pub const MAX_VIEWS: usize = 60;

/// Largest blur that still gives good corners: pixels, or fraction of the image's width.
const MAX_BLUR: (f64, f64) = (2.0, 0.003);
/// Least difference of dark and bright squares, grey levels.
const MIN_CONTRAST: f64 = 25.0;
/// Largest motion from pair to pair of a board that is held still: pixels, or fraction of the
/// image's width.
const MAX_HELD_MOTION: (f64, f64) = (1.0, 0.0025);
/// Largest motion of the board between consecutive pairs, in widths of the image.
const MAX_STEP: f64 = 0.08;
/// Longest interval between consecutive pairs.
const MAX_INTERVAL_NS: u64 = 300_000_000;

/// Least difference of unrelated images, as a fraction of that for pairs of a stream: they were
/// selected already, and each lowers the standard deviations a little.
const UNRELATED_FRACTION: f64 = 0.3;

impl Chooser {
    /// For images of `size`, width and height.
    pub fn new(board: Board, size: (usize, usize)) -> Self {
        Self {
            board,
            size,
            views: Vec::new(),
            known: Vec::new(),
            coverage: ViewCoverage::default(),
            before: None,
        }
    }

    /// The view of the next pair, if it is useful. `stamp_ns`: its time, for pairs of a stream;
    /// unrelated images have none and are not checked for motion.
    ///
    /// # Errors
    /// The [`Refusal`].
    pub fn judge(
        &mut self,
        stamp_ns: Option<u64>,
        seen: &[Detection; 2],
    ) -> Result<StereoView, Refusal> {
        // Stored even if this pair is refused: motion is measured between consecutive pairs.
        let before = self.before.take();
        if let (Some(stamp), Detection::Whole(left)) = (stamp_ns, &seen[0]) {
            self.before = Some((stamp, left.corners.clone()));
        }
        let [left, right] = [(Side::Left, &seen[0]), (Side::Right, &seen[1])]
            .map(|(side, seen)| self.whole(side, seen));
        let (left, right) = (left?, right?);
        if let (Some(stamp), Some((earlier, corners))) = (stamp_ns, before)
            && stamp.saturating_sub(earlier) < MAX_INTERVAL_NS
            && self.moves(&corners, &left.corners)
        {
            return Err(Refusal::Moving);
        }
        // Only the left image: the right one shows the same board from almost the same direction.
        let pose = RoughPose::new(&self.board, self.size, &left.corners)
            .ok_or(Refusal::Hidden(Side::Left))?;
        let new = if stamp_ns.is_some() {
            1.0
        } else {
            UNRELATED_FRACTION
        };
        if self.known.iter().any(|known| known.difference(&pose) < new) {
            return Err(Refusal::NothingNew);
        }
        Ok(StereoView {
            left: left.corners.clone(),
            right: right.corners.clone(),
        })
    }

    /// Accepts a view that [`Chooser::judge`] returned.
    pub fn keep(&mut self, view: StereoView) {
        if let Some(pose) = RoughPose::new(&self.board, self.size, &view.left) {
            self.known.push(pose);
            self.coverage
                .add(self.size, [&view.left, &view.right], pose.tilt());
            self.views.push(view);
        }
    }

    /// Declines a view; similar ones are refused from now on.
    pub fn decline(&mut self, view: &StereoView) {
        self.known
            .extend(RoughPose::new(&self.board, self.size, &view.left));
    }

    pub fn missing(&self) -> MissingCoverage {
        self.coverage.missing()
    }

    /// True if there are enough views.
    pub fn is_done(&self) -> bool {
        self.views.len() >= MAX_VIEWS
            || (self.views.len() >= SUFFICIENT_VIEWS && self.missing().is_empty())
    }

    /// The sighting of a complete, sharp board.
    fn whole<'a>(&self, side: Side, seen: &'a Detection) -> Result<&'a Sighting, Refusal> {
        match seen {
            Detection::Whole(sighting) if sighting.contrast < MIN_CONTRAST => {
                Err(Refusal::Faint(side))
            }
            Detection::Whole(sighting) if sighting.blur_px > self.limit(MAX_BLUR) => {
                Err(Refusal::Blurred(side))
            }
            Detection::Whole(sighting) => Ok(sighting),
            other => Err(Refusal::from_detection(side, other).unwrap_or(Refusal::NoBoard(side))),
        }
    }

    /// True if the board moves; false if it is held still or in an unrelated image.
    fn moves(&self, before: &[Point2<f64>], now: &[Point2<f64>]) -> bool {
        let steps = before
            .iter()
            .zip(now)
            .map(|(before, now)| (now - before).norm());
        let mean = steps.sum::<f64>() / now.len() as f64;
        mean > self.limit(MAX_HELD_MOTION) && mean < MAX_STEP * self.size.0 as f64
    }

    fn limit(&self, (pixels, widths): (f64, f64)) -> f64 {
        pixels.max(widths * self.size.0 as f64)
    }
}

impl Refusal {
    /// Why an image does not show the complete board; `None` if it does.
    pub fn from_detection(side: Side, seen: &Detection) -> Option<Self> {
        match seen {
            Detection::Whole(_) => None,
            Detection::Other { corners } => Some(Self::OtherBoard(side, *corners)),
            Detection::Part { beyond: Some(edge) } => Some(Self::CutOff(side, *edge)),
            Detection::Part { beyond: None } => Some(Self::Hidden(side)),
            Detection::Nothing => Some(Self::NoBoard(side)),
        }
    }
}

impl Display for Refusal {
    /// `no board left`: also the key under which refusals are counted in the report.
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoBoard(side) => write!(f, "no board {}", side.name()),
            Self::OtherBoard(side, (long, short)) => {
                write!(f, "a board of {long}x{short} {}", side.name())
            }
            Self::CutOff(side, edge) => write!(f, "cut off {}, {edge}", side.name()),
            Self::Hidden(side) => write!(f, "half hidden {}", side.name()),
            Self::Blurred(side) => write!(f, "blurred {}", side.name()),
            Self::Faint(side) => write!(f, "faint {}", side.name()),
            Self::Moving => f.write_str("moving"),
            Self::NothingNew => f.write_str("nothing new"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulated::MovingBoard;

    fn sighting(corners: &[Point2<f64>]) -> Detection {
        Detection::Whole(Sighting {
            corners: corners.to_vec(),
            blur_px: 0.8,
            contrast: 150.0,
        })
    }

    fn seen(view: &StereoView) -> [Detection; 2] {
        [sighting(&view.left), sighting(&view.right)]
    }

    fn chooser(moving: &MovingBoard) -> Chooser {
        Chooser::new(moving.board, (640, 480))
    }

    #[test]
    fn held_poses_are_kept_once_and_moving_ones_never() {
        let moving = MovingBoard::new(1).unwrap();
        let mut chooser = chooser(&moving);
        let mut refused = std::collections::BTreeMap::new();
        for index in 0..moving.pairs() {
            let Some(view) = moving.view(index) else {
                continue;
            };
            match chooser.judge(Some(index * 100_000_000), &seen(&view)) {
                Ok(view) => chooser.keep(view),
                Err(refusal) => *refused.entry(refusal).or_insert(0) += 1,
            }
        }
        println!(
            "{} kept, {refused:?}, lacks {}",
            chooser.views.len(),
            chooser.missing()
        );
        assert!(
            refused[&Refusal::NothingNew] > 20 && refused[&Refusal::Moving] > 30,
            "{refused:?}"
        );
        assert!(
            (15..=40).contains(&chooser.views.len()),
            "{}",
            chooser.views.len()
        );
    }

    #[test]
    fn unrelated_images_do_not_move() {
        let moving = MovingBoard::new(1).unwrap();
        let mut chooser = chooser(&moving);
        let view = moving.view(0).unwrap();
        let shifted = |off: f64| {
            let shift = |corners: &[Point2<f64>]| {
                corners
                    .iter()
                    .map(|p| Point2::new(p.x + off, p.y))
                    .collect()
            };
            StereoView {
                left: shift(&view.left),
                right: shift(&view.right),
            }
        };
        assert!(chooser.judge(Some(0), &seen(&view)).is_ok());
        assert_eq!(
            chooser.judge(Some(100_000_000), &seen(&shifted(20.0))),
            Err(Refusal::Moving)
        );
        // Held again; much later; another picture; no stamp.
        assert!(
            chooser
                .judge(Some(200_000_000), &seen(&shifted(20.5)))
                .is_ok()
        );
        assert!(
            chooser
                .judge(Some(900_000_000), &seen(&shifted(40.0)))
                .is_ok()
        );
        assert!(
            chooser
                .judge(Some(1_000_000_000), &seen(&shifted(110.0)))
                .is_ok()
        );
        assert!(chooser.judge(None, &seen(&shifted(120.0))).is_ok());
    }

    #[test]
    fn refusals_have_their_words() {
        let moving = MovingBoard::new(1).unwrap();
        let mut chooser = chooser(&moving);
        let view = moving.view(0).unwrap();
        let whole = || sighting(&view.left);
        let worse = |blur_px, contrast| {
            Detection::Whole(Sighting {
                corners: view.right.clone(),
                blur_px,
                contrast,
            })
        };
        let cases = [
            ([Detection::Nothing, whole()], "no board left"),
            (
                [
                    whole(),
                    Detection::Part {
                        beyond: Some(Edge::Top),
                    },
                ],
                "cut off right, at its top",
            ),
            (
                [Detection::Part { beyond: None }, whole()],
                "half hidden left",
            ),
            (
                [Detection::Other { corners: (7, 5) }, whole()],
                "a board of 7x5 left",
            ),
            ([whole(), worse(2.5, 150.0)], "blurred right"),
            ([whole(), worse(0.8, 12.0)], "faint right"),
        ];
        for (seen, word) in cases {
            assert_eq!(chooser.judge(None, &seen).unwrap_err().to_string(), word);
        }
        // A declined view is not offered again.
        let offered = chooser.judge(None, &seen(&view)).unwrap();
        chooser.decline(&offered);
        assert_eq!(chooser.judge(None, &seen(&view)), Err(Refusal::NothingNew));
        assert!(chooser.views.is_empty());
    }

    #[test]
    fn it_is_done_when_nothing_is_missing() {
        let moving = MovingBoard::new(1).unwrap();
        let mut chooser = chooser(&moving);
        assert_eq!(chooser.missing().left, coverage::AREAS);
        assert_eq!(chooser.missing().tilted, ["left", "right", "up", "down"]);
        chooser.keep(moving.view(0).unwrap());
        assert!(chooser.missing().left.len() < 9 && !chooser.is_done());
        for _ in 1..MAX_VIEWS {
            chooser.keep(moving.view(0).unwrap());
        }
        assert!(chooser.is_done());
    }
}
