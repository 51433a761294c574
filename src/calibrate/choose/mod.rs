//! Which pairs to calibrate from: those that show the whole board in both images, sharp and still,
//! in a pose that adds something to the poses that are there.

mod lacks;
mod pose;

pub use lacks::Lacks;

use super::detect::{Edge, Seen, Sighting};
use super::{Board, View};
use lacks::Shown;
use nalgebra::Point2;
use pose::RoughPose;
use std::fmt::{Display, Formatter};

/// Chooses views of one board.
pub struct Chooser {
    board: Board,
    size: (usize, usize),
    views: Vec<View>,
    /// Those of the views, and those that somebody did not want.
    known: Vec<RoughPose>,
    shown: Shown,
    /// Stamp and left corners of the pair before.
    before: Option<(u64, Vec<Point2<f64>>)>,
}

/// Why a pair is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Refusal {
    /// In the left image or the right, as in the others.
    NoBoard(Side),
    /// Another number of corners, along the longer and the shorter side.
    OtherBoard(Side, (usize, usize)),
    CutOff(Side, Edge),
    /// Some corners are not seen though they are in the image.
    Hidden(Side),
    Blurred(Side),
    /// Dark and bright squares hardly differ.
    Faint(Side),
    Moving,
    NothingNew,
}

/// One of two cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Side {
    Left,
    Right,
}

/// Views that are enough, if they lack nothing.
pub const ENOUGH: usize = 20;
/// Views that are enough, whatever they lack.
pub const MOST: usize = 60;

/// Blur that still gives good corners: pixels, or parts of the image's width.
const BLUR: (f64, f64) = (2.0, 0.003);
/// Least difference of dark and bright, grey levels.
const FAINT: f64 = 25.0;
/// A board that moves by less from pair to pair is held still: pixels, or parts of the image's
/// width.
const STILL: (f64, f64) = (1.0, 0.0025);
/// Pairs whose boards are farther apart, in widths of the image, do not follow each other ...
const JUMP: f64 = 0.08;
/// ... nor do those farther apart in time.
const FOLLOWING_NS: u64 = 300_000_000;

/// How different unrelated pictures are from each other, of what pairs of a stream are: somebody
/// chose them, and each makes the result a little surer.
const ANOTHER: f64 = 0.3;

impl Chooser {
    /// For images of `size`, width and height.
    pub fn new(board: Board, size: (usize, usize)) -> Self {
        Self {
            board,
            size,
            views: Vec::new(),
            known: Vec::new(),
            shown: Shown::default(),
            before: None,
        }
    }

    /// Whether the next pair adds a view. `stamp_ns`: when it was taken, for pairs of a stream;
    /// unrelated pictures have none, and are not asked whether the board moves.
    ///
    /// # Errors
    /// The [`Refusal`].
    pub fn judge(&mut self, stamp_ns: Option<u64>, seen: &[Seen; 2]) -> Result<View, Refusal> {
        let before = self.before.take();
        if let (Some(stamp), Seen::Whole(left)) = (stamp_ns, &seen[0]) {
            self.before = Some((stamp, left.corners.clone()));
        }
        let [left, right] = [(Side::Left, &seen[0]), (Side::Right, &seen[1])]
            .map(|(side, seen)| self.whole(side, seen));
        let (left, right) = (left?, right?);
        if let (Some(stamp), Some((earlier, corners))) = (stamp_ns, before)
            && stamp.saturating_sub(earlier) < FOLLOWING_NS
            && self.moves(&corners, &left.corners)
        {
            return Err(Refusal::Moving);
        }
        let pose = RoughPose::new(&self.board, self.size, &left.corners)
            .ok_or(Refusal::Hidden(Side::Left))?;
        let new = if stamp_ns.is_some() { 1.0 } else { ANOTHER };
        if self.known.iter().any(|known| known.difference(&pose) < new) {
            return Err(Refusal::NothingNew);
        }
        Ok(View {
            left: left.corners.clone(),
            right: right.corners.clone(),
        })
    }

    /// Takes a view that [`Chooser::judge`] found.
    pub fn keep(&mut self, view: View) {
        if let Some(pose) = RoughPose::new(&self.board, self.size, &view.left) {
            self.known.push(pose);
            self.shown
                .add(self.size, [&view.left, &view.right], pose.tilt());
            self.views.push(view);
        }
    }

    /// Leaves a view out, and others like it.
    pub fn decline(&mut self, view: &View) {
        self.known
            .extend(RoughPose::new(&self.board, self.size, &view.left));
    }

    /// The views that were kept.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    pub fn lacks(&self) -> Lacks {
        self.shown.lacks()
    }

    /// Whether there are enough views.
    pub fn is_done(&self) -> bool {
        self.views.len() >= MOST || (self.views.len() >= ENOUGH && self.lacks().is_nothing())
    }

    /// A whole, sharp board.
    fn whole<'a>(&self, side: Side, seen: &'a Seen) -> Result<&'a Sighting, Refusal> {
        match seen {
            Seen::Whole(sighting) if sighting.contrast < FAINT => Err(Refusal::Faint(side)),
            Seen::Whole(sighting) if sighting.blur_px > self.limit(BLUR) => {
                Err(Refusal::Blurred(side))
            }
            Seen::Whole(sighting) => Ok(sighting),
            Seen::Other { corners } => Err(Refusal::OtherBoard(side, *corners)),
            Seen::Part { beyond: Some(edge) } => Err(Refusal::CutOff(side, *edge)),
            Seen::Part { beyond: None } => Err(Refusal::Hidden(side)),
            Seen::Nothing => Err(Refusal::NoBoard(side)),
        }
    }

    /// Whether a board moves rather than being held, or being another picture.
    fn moves(&self, before: &[Point2<f64>], now: &[Point2<f64>]) -> bool {
        let steps = before
            .iter()
            .zip(now)
            .map(|(before, now)| (now - before).norm());
        let mean = steps.sum::<f64>() / now.len() as f64;
        mean > self.limit(STILL) && mean < JUMP * self.size.0 as f64
    }

    fn limit(&self, (pixels, widths): (f64, f64)) -> f64 {
        pixels.max(widths * self.size.0 as f64)
    }
}

impl Display for Refusal {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoBoard(side) => write!(f, "no board {side}"),
            Self::OtherBoard(side, (long, short)) => write!(f, "a board of {long}x{short} {side}"),
            Self::CutOff(side, edge) => write!(f, "cut off {side}, {edge}"),
            Self::Hidden(side) => write!(f, "half hidden {side}"),
            Self::Blurred(side) => write!(f, "blurred {side}"),
            Self::Faint(side) => write!(f, "faint {side}"),
            Self::Moving => f.write_str("moving"),
            Self::NothingNew => f.write_str("nothing new"),
        }
    }
}

impl Display for Side {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

impl Display for Edge {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Left => "at its left edge",
            Self::Right => "at its right edge",
            Self::Top => "at its top",
            Self::Bottom => "at its bottom",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::simulated::MovingBoard;

    fn sighting(corners: &[Point2<f64>]) -> Seen {
        Seen::Whole(Sighting {
            corners: corners.to_vec(),
            blur_px: 0.8,
            contrast: 150.0,
        })
    }

    fn seen(view: &View) -> [Seen; 2] {
        [sighting(&view.left), sighting(&view.right)]
    }

    fn chooser(moving: &MovingBoard) -> Chooser {
        Chooser::new(*moving.board(), (640, 480))
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
            chooser.views().len(),
            chooser.lacks()
        );
        assert!(
            refused[&Refusal::NothingNew] > 20 && refused[&Refusal::Moving] > 30,
            "{refused:?}"
        );
        assert!(
            (15..=40).contains(&chooser.views().len()),
            "{}",
            chooser.views().len()
        );
    }

    #[test]
    fn unrelated_pictures_do_not_move() {
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
            View {
                left: shift(&view.left),
                right: shift(&view.right),
            }
        };
        assert!(chooser.judge(Some(0), &seen(&view)).is_ok());
        assert_eq!(
            chooser.judge(Some(100_000_000), &seen(&shifted(20.0))),
            Err(Refusal::Moving)
        );
        // Held again; long after; another picture; no stamp.
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
    fn each_refusal_has_its_word() {
        let moving = MovingBoard::new(1).unwrap();
        let mut chooser = chooser(&moving);
        let view = moving.view(0).unwrap();
        let whole = || sighting(&view.left);
        let worse = |blur_px, contrast| {
            Seen::Whole(Sighting {
                corners: view.right.clone(),
                blur_px,
                contrast,
            })
        };
        let cases = [
            ([Seen::Nothing, whole()], "no board left"),
            (
                [
                    whole(),
                    Seen::Part {
                        beyond: Some(Edge::Top),
                    },
                ],
                "cut off right, at its top",
            ),
            ([Seen::Part { beyond: None }, whole()], "half hidden left"),
            (
                [Seen::Other { corners: (7, 5) }, whole()],
                "a board of 7x5 left",
            ),
            ([whole(), worse(2.5, 150.0)], "blurred right"),
            ([whole(), worse(0.8, 12.0)], "faint right"),
        ];
        for (seen, word) in cases {
            assert_eq!(chooser.judge(None, &seen).unwrap_err().to_string(), word);
        }
        // What somebody did not want is not offered again.
        let offered = chooser.judge(None, &seen(&view)).unwrap();
        chooser.decline(&offered);
        assert_eq!(chooser.judge(None, &seen(&view)), Err(Refusal::NothingNew));
        assert!(chooser.views().is_empty());
    }

    #[test]
    fn it_is_done_when_nothing_is_missing() {
        let moving = MovingBoard::new(1).unwrap();
        let mut chooser = chooser(&moving);
        let all = [
            "upper left",
            "top",
            "upper right",
            "left",
            "middle",
            "right",
            "lower left",
            "bottom",
            "lower right",
        ];
        assert_eq!(chooser.lacks().left, all);
        assert_eq!(chooser.lacks().tilted, ["left", "right", "up", "down"]);
        chooser.keep(moving.view(0).unwrap());
        assert!(chooser.lacks().left.len() < 9 && !chooser.is_done());
        for _ in 1..MOST {
            chooser.keep(moving.view(0).unwrap());
        }
        assert!(chooser.is_done());
    }
}
