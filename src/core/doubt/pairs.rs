//! Causes of pairs that no algorithm can match, or only wrong.

use super::{Doubt, Subject};
use crate::counted;
use serde::{Deserialize, Serialize};

causes! {
    /// A cause of pairs that no algorithm can match, or only wrong.
    PairCure:

    /// Their rectification misaligns them.
    Misaligned { before_px: f64, after_px: f64, points: [usize; 2], pairs: usize } => (
        "vertical misalignment of {before_px:.2} px without rectification and {after_px:.2} px \
         with it (medians of {} and {} points in {pairs} pairs): if the images are rectified \
         already, --calib none uses them as they are; if they are raw, the calibration is not, or \
         no longer, that of these cameras: calibrate again, --calib FILE",
        points[0], points[1])
    /// Their rows do not correspond.
    Vertical {
        median_abs_px: f64, median_px: f64, points: usize, pairs: usize, misfit: Misfit,
        cure: AlignmentCure
    } => (
        "vertical misalignment of {median_abs_px:.1} px (median of {points} points in {}; {}), \
         which costs matches: {cure}; `svl calibrate check` shows more",
        counted(*pairs as u64, "pair"), misfit.words(*median_px))
    Turned { turn: Turn, if_turned: usize, points: usize } => (
        "one camera's images look {}: {if_turned} points match once they are turned back, \
         {points} as they are; `ffmpeg -i IN -vf {filter} OUT` turns an image or a video",
        turn.name(), filter = turn.filter())
    OnePicture { share: f64, points: usize, within_px: f64, nearest_m: Option<f64> } => (
        "left and right look like one picture twice, or nothing is {}: {:.0} % of {points} points \
         are within {within_px} px of the same place; name images of two cameras (--left and \
         --right, or the files of match)",
        nearest_m.map_or("near".to_owned(), |m| format!("nearer than {m:.1} m")), 100.0 * share)
    Exchanged { share: f64, points: usize, reach_px: f64, is_calibrated: bool } => (
        "left and right look exchanged, or the cameras converge: {share:.0} % of {points} points \
         are farther right in the right image; if exchanged (and not both upside down), name them \
         the other way round (--left and --right, the files of match, or \
         --side-by-side=right-left, or bottom-top, for halves of one image){}; if the cameras \
         converge, `min_disparity=-{reach_px}` of v1 to v4, bm and sgm covers them, and v5 and dp \
         have none",
        if *is_calibrated {
            ", and as the calibrations are not exchanged, --calib FILE gives theirs"
        } else {
            ""
        })
    BeyondRange {
        share: f64, points: usize, highest_px: f64, reach_px: f64, scale: Option<f64>
    } => (
        "{share:.0} % of {points} points have disparities above {highest_px} px, the range that is \
         searched: `max_disparity={reach_px}`{} covers them{}",
        if *reach_px > SHORT_PX { " of v1 to v4, bm and sgm" } else { "" },
        scale.map_or(String::new(), |scale| format!(", or --scale {scale:.2}")))
    /// A part of them repeats while the images change.
    Repeated { part: Repeated, pairs: u64, seconds: f64 } => (
        "the {part} the same in {pairs} pairs or more, from {seconds:.3} s on, and the images \
         change: {}",
        part.cure(*seconds), part = part.words())
    /// No camera has halves of that shape.
    Halves { width: usize, height: usize } => (
        "the halves of an image have {width}x{height} pixels, a shape that cameras hardly have: if \
         it shows left and right {}",
        if width < height {
            "one above the other, --side-by-side=top-bottom, or =bottom-top"
        } else {
            "beside each other, --side-by-side=left-right, or =right-left"
        })
    /// The header of a video names other places of the halves than the user.
    Places { stated: String, named: String } => (
        "its header says {stated}, and --side-by-side says {named}: --side-by-side={stated}, \
         unless the header is wrong")
    /// Images of 16 bits whose values hardly differ.
    FewLevels { from: u16, to: u16 } => (
        "98 % of the pixels of 16-bit images are from {from} to {to}, which are few levels: a \
         longer exposure, or a conversion to 16 bits that keeps more")
    ByteOrder { as_read: f64, exchanged: f64 } => (
        "the bytes of 16-bit values look exchanged: neighbours differ by {as_read:.2} of the range \
         as read, and by {exchanged:.2} with the bytes exchanged: correct is_bigendian, or write \
         the values in the other order")
    /// One camera has 8 bits, or values on another scale.
    TwoDepths { left: Option<u16>, right: Option<u16> } => (
        "left and right images have two depths: the left ones {}, the right ones {}: give both \
         cameras the same number of bits and the same exposure",
        depth_words(*left), depth_words(*right))
    /// Left and right images are of different moments.
    Skew { skew_ms: f64, limit_ms: f64 } => (
        "a median skew of {skew_ms:.1} ms is above {limit_ms:.1} ms, half a period or the most \
         that is usable: if only the clocks differ, `--right-offset-ms {:.1}` corrects that of a \
         recording; else pairs need a smaller --max-skew-ms, or a common trigger",
        -skew_ms)
}

/// `bright`: what 99 % of the pixels are at most; `None` for 8 bits.
fn depth_words(bright: Option<u16>) -> String {
    match bright {
        None => "have 8 bits".to_owned(),
        Some(most) => format!("have 16 bits, 99 % of them up to {most}"),
    }
}

/// Longest range that every algorithm has, pixels.
const SHORT_PX: f64 = 255.0;

/// The simplest model that explains most of a vertical misalignment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Misfit {
    /// One image is shifted vertically.
    Shift,
    /// One image is rotated against the other (positive: the right one clockwise) or scaled (the
    /// right one relative to the left).
    Rotation { degrees: f64, scale: f64 },
    /// Anything else: lens distortion, or converging cameras.
    Distortion,
}

impl Misfit {
    /// The look of a misalignment with that median.
    fn words(self, median_px: f64) -> String {
        match self {
            Self::Shift => {
                let place = if median_px < 0.0 { "higher" } else { "lower" };
                format!("the right image is {:.1} px {place}", median_px.abs())
            }
            Self::Rotation { degrees, scale } => {
                format!("the right image is rolled by {degrees:+.1}° and {scale:.3} times as large")
            }
            Self::Distortion => "lens distortion, or converging cameras".to_owned(),
        }
    }
}

/// The cure for vertical misalignment.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum AlignmentCure {
    #[error("rectify with --calib FILE, or synchronize the cameras if it comes with motion")]
    Rectify,
    /// They are rectified.
    #[error("the calibration is not, or no longer, that of these cameras: calibrate again")]
    Calibrate,
    /// The left images are aligned with the right ones of the pair after or before.
    #[error(
        "with the right image of the pair {} they are aligned, so the cameras are a pair apart, \
         which `--right-offset-ms {right_ms:.1}` corrects in a recording of another program",
        if *right_ms < 0.0 { "after" } else { "before" }
    )]
    PairApart { right_ms: f64 },
}

/// A way in which one camera's images differ from the other's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Turn {
    UpsideDown,
    Mirrored,
}

impl Turn {
    pub const ALL: [Self; 2] = [Self::UpsideDown, Self::Mirrored];

    /// Where a pixel of an image of that size is once the image is turned back.
    pub fn place(self, (x, y): (usize, usize), (width, height): (usize, usize)) -> (usize, usize) {
        match self {
            Self::UpsideDown => (width - 1 - x, height - 1 - y),
            Self::Mirrored => (width - 1 - x, y),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::UpsideDown => "upside down",
            Self::Mirrored => "mirrored",
        }
    }

    /// The filter of ffmpeg that turns images back.
    fn filter(self) -> &'static str {
        match self {
            Self::UpsideDown => "hflip,vflip",
            Self::Mirrored => "hflip",
        }
    }
}

/// A part of pairs that repeats.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Repeated {
    LeftImages,
    RightImages,
    Truth,
    /// The farthest distance of the truth.
    Farthest,
}

impl Repeated {
    pub const ALL: [Self; 4] = [
        Self::LeftImages,
        Self::RightImages,
        Self::Truth,
        Self::Farthest,
    ];

    fn words(self) -> &'static str {
        match self {
            Self::LeftImages => "left images are",
            Self::RightImages => "right images are",
            Self::Truth => "truth is",
            Self::Farthest => "farthest distance of the truth is",
        }
    }

    fn cure(self, seconds: f64) -> String {
        if self == Self::Farthest {
            "it is the limit of a sensor, not a distance: write 0 or NaN there".to_owned()
        } else if seconds == 0.0 {
            "stuck, and of another moment: record again".to_owned()
        } else {
            format!("stuck, and of another moment: `--to {seconds:.3}` ends before")
        }
    }
}
