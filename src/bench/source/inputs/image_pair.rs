//! Two image files as a source of one pair.

use super::folder::stamps::epoch_ns;
use crate::source::frames::Source;
use std::path::Path;
use svl_core::stereo::{Exposure, Frame, Geometry};
use svl_core::{Error, Result};
use svl_files::{BitDepth, GreyLevels, read_image};

/// The pair of two image files, with the stamps that their names are.
pub(crate) struct ImagePair {
    name: String,
    pub depth: BitDepth,
    frame: Option<Frame>,
}

impl ImagePair {
    /// For 16-bit images the upper 8 of the `bits` used are kept [default: decided by their
    /// values].
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`]; [`Error::Invalid`] for images of two sizes;
    /// [`Error::Usage`] for `bits` of 8-bit images.
    pub(crate) fn read(files: [&Path; 2], bits: Option<u8>) -> Result<Self> {
        let name = files.map(|file| file.display().to_string()).join(" and ");
        let images = [read_image(files[0])?, read_image(files[1])?];
        let mut depth = BitDepth::decide(bits, &GreyLevels::from_pairs([images.clone()]))?;
        let pair = depth.pair(images);
        let (pair, color) = pair.map_err(|e| Error::Invalid(format!("{name}: {e}")))?;
        let [left, right] = files.map(|file| epoch_ns(file.file_stem()?.as_encoded_bytes()));
        let skew_ns = left.zip(right);
        let skew_ns = skew_ns.map(|(left, right)| right.wrapping_sub(left).cast_signed());
        let frame = Frame {
            stamp_ns: left.unwrap_or_default(),
            color,
            exposure: Exposure {
                skew_ns,
                ..Exposure::default()
            },
            ..Frame::new(pair, Geometry::Rectified(None))
        };
        Ok(Self {
            name,
            depth,
            frame: Some(frame),
        })
    }
}

impl Source for ImagePair {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        Ok(self.frame.take())
    }

    fn pairs(&self) -> Option<u64> {
        Some(1)
    }
}
