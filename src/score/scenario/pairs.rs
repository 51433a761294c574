//! Selected pairs of a source, and the selected part of their images.

use serde::{Deserialize, Serialize};
use svl_core::{Error, Result};

/// Selected pairs of a source. Seconds count from its first pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PairRange {
    /// Every n-th pair, including the first of the range [default: 1].
    pub every: Option<u64>,
    /// From these seconds on.
    pub from_s: Option<f64>,
    /// Before these seconds.
    pub to_s: Option<f64>,
}

impl PairRange {
    /// # Errors
    /// [`Error::Invalid`] for a range without any pair.
    pub fn validate(&self) -> Result<()> {
        let from_s = self.from_s.unwrap_or(0.0);
        let is_time = |s: f64| s.is_finite() && (0.0..=1e9).contains(&s);
        let wrong = |what: String| Err(Error::Invalid(what));
        match *self {
            Self { every: Some(0), .. } => {
                wrong("every = 0: take every n-th pair, n from 1".into())
            }
            _ if !is_time(from_s) => wrong(format!("from {from_s} s: expected 0 to 1e9")),
            Self { to_s: Some(to), .. } if !is_time(to) || to <= from_s => {
                wrong(format!("from {from_s} s to {to} s: the range is empty"))
            }
            _ => Ok(()),
        }
    }

    /// The number of pairs in the range, of pairs with these stamps: those that are read.
    pub fn count(&self, stamps_ns: &[u64]) -> u64 {
        let ns = |seconds: f64| (seconds * 1e9) as u64;
        let (from_ns, to_ns) = (self.from_s.map_or(0, ns), self.to_s.map_or(u64::MAX, ns));
        let is_timed = from_ns > 0 || self.to_s.is_some();
        let start_ns = stamps_ns.first().copied().unwrap_or_default();
        let times = stamps_ns.iter();
        let times = times.map(|stamp| (stamp.saturating_sub(start_ns), *stamp));
        let in_range = times
            .take_while(|(time, _)| *time < to_ns)
            .filter(|(time, stamp)| *time >= from_ns && !(is_timed && *stamp < start_ns));
        (in_range.count() as u64).div_ceil(self.every.unwrap_or(1).max(1))
    }

    /// The omitted pairs, in words; `None` if all are used.
    pub fn words(&self) -> Option<String> {
        let every = self.every.filter(|every| *every > 1);
        let parts = [
            every.map(|every| format!("one pair of {every}")),
            self.from_s.map(|s| format!("from {s} s")),
            self.to_s.map(|s| format!("to {s} s")),
        ];
        let parts: Vec<_> = parts.into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join(" "))
    }
}

/// Crop and scale of rectified images, equal for left and right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CropScale {
    /// `[x, y, width, height]`, pixels.
    pub crop: Option<[usize; 4]>,
    /// Size of the new image over that of the old, above 0 and at most 1; after the crop.
    pub scale: Option<f64>,
}

impl CropScale {
    /// # Errors
    /// [`Error::Invalid`] for an empty crop, and for a scale that does not shrink.
    pub fn validate(&self) -> Result<()> {
        match *self {
            Self {
                crop: Some([_, _, 0, _] | [_, _, _, 0]),
                ..
            } => Err(Error::Invalid(
                "crop = [x, y, width, height]: it has no pixels".into(),
            )),
            Self {
                scale: Some(scale), ..
            } if !(scale > 0.0 && scale <= 1.0) => Err(Error::Invalid(format!(
                "scale = {scale}: expected above 0, at most 1"
            ))),
            _ => Ok(()),
        }
    }

    /// The changes in words; `None` if the images are unchanged.
    pub fn words(&self) -> Option<String> {
        let crop = self.crop;
        let crop = crop.map(|[x, y, w, h]| format!("cropped to {w}x{h} at ({x}, {y})"));
        let scale = self.scale.filter(|scale| *scale != 1.0);
        let scale = scale.map(|scale| format!("scaled by {scale} (area average)"));
        let parts: Vec<_> = crop.into_iter().chain(scale).collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_that_take_nothing_are_refused() {
        let range = |every, from_s, to_s| PairRange {
            every,
            from_s,
            to_s,
        };
        for nothing in [
            range(Some(0), None, None),
            range(None, Some(2.0), Some(2.0)),
            range(None, None, Some(0.0)),
            range(None, Some(-1.0), None),
            range(None, Some(f64::NAN), None),
            range(None, None, Some(f64::INFINITY)),
        ] {
            assert!(nothing.validate().is_err(), "{nothing:?}");
        }
        let some = range(Some(5), Some(1.0), Some(2.5));
        some.validate().unwrap();
        assert_eq!(some.words().unwrap(), "one pair of 5 from 1 s to 2.5 s");
        assert_eq!(range(Some(1), None, None).words(), None);
    }

    #[test]
    fn images_are_cropped_and_shrunk_but_not_enlarged() {
        let window = |crop, scale| CropScale { crop, scale };
        for nothing in [
            window(Some([0, 0, 0, 4]), None),
            window(Some([0, 0, 4, 0]), None),
            window(None, Some(0.0)),
            window(None, Some(1.1)),
            window(None, Some(f64::NAN)),
        ] {
            assert!(nothing.validate().is_err(), "{nothing:?}");
        }
        let both = window(Some([1, 2, 30, 20]), Some(0.5));
        both.validate().unwrap();
        let words = "cropped to 30x20 at (1, 2), scaled by 0.5 (area average)";
        assert_eq!(both.words().unwrap(), words);
    }
}
