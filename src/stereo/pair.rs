//! A rectified pair.

use super::Gray;
use crate::error::{Error, Result};

/// A rectified stereo pair: both images of one size, rows aligned.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoPair {
    left: Gray,
    right: Gray,
}

impl StereoPair {
    /// # Errors
    /// [`Error::PairSize`] when the sizes differ.
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
