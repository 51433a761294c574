//! Stereo pairs: any synchronized pair, and the rectified pair that matchers require.

use super::Gray;
use crate::error::{Error, Result};

/// One of the two cameras of a rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Side {
    Left,
    Right,
}

impl Side {
    pub const BOTH: [Side; 2] = [Side::Left, Side::Right];

    pub fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }

    /// `left` or `right`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// A synchronized pair: two images of equal size, raw or rectified.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoPair {
    left: Gray,
    right: Gray,
}

/// Texture: more than this many per cent of neighbours differ by more grey levels than noise makes.
const MIN_EDGES: usize = 1;
const MIN_EDGE: u8 = 8;

impl StereoPair {
    /// # Errors
    /// [`Error::PairSize`] if the sizes differ.
    pub fn new(left: Gray, right: Gray) -> Result<Self> {
        if left.size() == right.size() {
            Ok(Self { left, right })
        } else {
            Err(Error::PairSize {
                left: left.size(),
                right: right.size(),
            })
        }
    }

    /// The reference image.
    pub fn left(&self) -> &Gray {
        &self.left
    }

    pub fn right(&self) -> &Gray {
        &self.right
    }

    /// Both images, left and right.
    pub fn into_images(self) -> [Gray; 2] {
        [self.left, self.right]
    }

    /// True if both images have the same pixels, and texture, which two cameras never see alike.
    #[doc(hidden)]
    pub fn is_one_picture(&self) -> bool {
        let (width, height) = self.size();
        let edges = |row: &[u8]| {
            let steps = row.windows(2).map(|two| two[0].abs_diff(two[1]));
            steps.filter(|step| *step > MIN_EDGE).count()
        };
        self.left == self.right
            && 100 * self.left.rows().map(edges).sum::<usize>() > MIN_EDGES * width * height
    }

    /// Hash of size and pixels: equal pairs have equal hashes on every machine.
    pub fn hash(&self) -> u128 {
        let (width, height) = self.size();
        let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
        hasher.update(&(width as u32).to_le_bytes());
        hasher.update(&(height as u32).to_le_bytes());
        self.left
            .rows()
            .chain(self.right.rows())
            .for_each(|row| hasher.update(row));
        hasher.digest128()
    }

    /// `(width, height)` of both images.
    pub fn size(&self) -> (usize, usize) {
        self.left.size()
    }
}

/// A pair whose epipolar lines are the image rows: a left pixel `(x, y)` matches `(x - d, y)`.
///
/// Only rectified pairs can be matched, so [`crate::matcher::Matcher`] requires this type.
/// [`super::Frame::rectified`] returns it; a caller that knows its pair is rectified uses
/// [`RectifiedPair::assume`].
#[derive(Clone, Copy, Debug)]
pub struct RectifiedPair<'a>(&'a StereoPair);

impl<'a> RectifiedPair<'a> {
    /// Assumes, without a check, that the pair is rectified.
    pub fn assume(pair: &'a StereoPair) -> Self {
        Self(pair)
    }
}

impl std::ops::Deref for RectifiedPair<'_> {
    type Target = StereoPair;

    fn deref(&self) -> &StereoPair {
        self.0
    }
}
