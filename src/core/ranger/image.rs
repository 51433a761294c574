//! Images of a caller, in the layouts that cameras have.

use crate::error::{Error, Result};
use crate::stereo::{Gray, Rgb, luma};

/// Layout of a pixel. Colours become grey as everywhere in svl ([`Gray::from_color`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    Gray8,
    /// In the machine's byte order. `bits` of 16 are used, 8 to 16 (12 of a sensor with values up
    /// to 4095); the upper eight of them are matched, and larger values are white.
    Gray16 {
        bits: u8,
    },
    Rgb8,
    Bgr8,
    /// The fourth byte is ignored.
    Rgba8,
    Bgra8,
}

impl ImageFormat {
    /// Bytes of a pixel.
    pub fn bytes(self) -> usize {
        match self {
            Self::Gray8 => 1,
            Self::Gray16 { .. } => 2,
            Self::Rgb8 | Self::Bgr8 => 3,
            Self::Rgba8 | Self::Bgra8 => 4,
        }
    }

    fn copy(self, row: &[u8], out: &mut [u8]) {
        match self {
            Self::Gray8 => out.copy_from_slice(row),
            Self::Gray16 { bits } => {
                let upper = |bytes| (u16::from_ne_bytes(bytes) >> (bits - 8)).min(255) as u8;
                each(row, out, upper);
            }
            Self::Rgb8 => each(row, out, luma),
            Self::Bgr8 => each(row, out, |[b, g, r]| luma([r, g, b])),
            Self::Rgba8 => each(row, out, |[r, g, b, _]| luma([r, g, b])),
            Self::Bgra8 => each(row, out, |[b, g, r, _]| luma([r, g, b])),
        }
    }
}

fn each<const N: usize>(row: &[u8], out: &mut [u8], grey: impl Fn([u8; N]) -> u8) {
    for (pixel, out) in row.as_chunks().0.iter().zip(out) {
        *out = grey(*pixel);
    }
}

/// An image in the caller's memory.
#[derive(Clone, Copy, Debug)]
pub struct ImageRef<'a> {
    bytes: &'a [u8],
    size: (usize, usize),
    /// Bytes from a row to the next.
    stride: usize,
    format: ImageFormat,
}

impl<'a> ImageRef<'a> {
    /// An image of that width and height over `bytes`, whose row `y` begins at `y * stride`, in
    /// bytes.
    ///
    /// # Errors
    /// [`Error::Invalid`] for rows that overlap, bits other than 8 to 16, or too few bytes.
    pub fn new(
        bytes: &'a [u8],
        (width, height): (usize, usize),
        stride: usize,
        format: ImageFormat,
    ) -> Result<Self> {
        if let ImageFormat::Gray16 { bits } = format
            && !(8..=16).contains(&bits)
        {
            let expected = "expected 8 to 16 of them to be used";
            return Err(Error::Invalid(format!(
                "an image of 16 bits: {bits}; {expected}"
            )));
        }
        let row_bytes = width.saturating_mul(format.bytes());
        if stride < row_bytes {
            return Err(Error::Invalid(format!(
                "stride {stride} is less than the {row_bytes} bytes of a row of {width} pixels"
            )));
        }
        let expected = stride
            .saturating_mul(height.saturating_sub(1))
            .saturating_add(row_bytes);
        if bytes.len() < expected {
            let got = bytes.len();
            return Err(Error::Invalid(format!(
                "a {width}x{height} image with rows of {stride} bytes needs {expected} bytes, got \
                 {got}"
            )));
        }
        Ok(Self {
            bytes,
            size: (width, height),
            stride,
            format,
        })
    }

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Writes the image into `out` as grey, which keeps its memory if it has the size.
    ///
    /// # Errors
    /// [`Error::Dimensions`], [`Error::Memory`].
    pub fn copy(&self, out: &mut Gray) -> Result<()> {
        let (width, height) = self.size;
        if out.size() != self.size {
            *out = Gray::filled(width, height, 0)?;
        }
        for y in 0..height {
            let row = &self.bytes[y * self.stride..][..width * self.format.bytes()];
            self.format.copy(row, out.row_mut(y));
        }
        Ok(())
    }
}

impl<'a> From<&'a Gray> for ImageRef<'a> {
    fn from(image: &'a Gray) -> Self {
        let (bytes, stride) = image.strided();
        Self {
            bytes,
            size: image.size(),
            stride,
            format: ImageFormat::Gray8,
        }
    }
}

impl<'a> From<&'a Rgb> for ImageRef<'a> {
    fn from(image: &'a Rgb) -> Self {
        let (pixels, stride) = image.strided();
        Self {
            bytes: pixels.as_flattened(),
            size: image.size(),
            stride: 3 * stride,
            format: ImageFormat::Rgb8,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(bytes: &[u8], width: usize, stride: usize, format: ImageFormat) -> Vec<u8> {
        let height = bytes.len().div_ceil(stride);
        let image = ImageRef::new(bytes, (width, height), stride, format).unwrap();
        let mut out = Gray::filled(1, 1, 0).unwrap();
        image.copy(&mut out).unwrap();
        out.pixels().collect()
    }

    #[test]
    fn every_layout_becomes_grey() {
        let color = [10, 20, 30, 255, 0, 0];
        assert_eq!(grey(&color, 2, 6, ImageFormat::Rgb8), [18, 76]);
        assert_eq!(grey(&color, 2, 6, ImageFormat::Bgr8), [22, 29]);
        assert_eq!(grey(&[10, 20, 30, 9], 1, 4, ImageFormat::Rgba8), [18]);
        assert_eq!(grey(&[30, 20, 10, 9], 1, 4, ImageFormat::Bgra8), [18]);
        let deep = [0_u16, 4095, 2048, 5000].map(u16::to_ne_bytes);
        let deep = deep.as_flattened();
        let twelve = ImageFormat::Gray16 { bits: 12 };
        assert_eq!(grey(deep, 4, 8, twelve), [0, 255, 128, 255]);
        let sixteen = ImageFormat::Gray16 { bits: 16 };
        assert_eq!(grey(deep, 4, 8, sixteen), [0, 15, 8, 19]);
    }

    #[test]
    fn gaps_between_rows_are_skipped() {
        let bytes = [1, 2, 99, 3, 4];
        assert_eq!(grey(&bytes, 2, 3, ImageFormat::Gray8), [1, 2, 3, 4]);
        let plane = Gray::from_strided(2, 2, 3, bytes.to_vec()).unwrap();
        let mut out = Gray::filled(1, 1, 0).unwrap();
        ImageRef::from(&plane).copy(&mut out).unwrap();
        assert!(out.pixels().eq(plane.pixels()));
    }

    #[test]
    fn colours_are_those_of_the_library() {
        let color = Rgb::from_strided(1, 2, 2, vec![[10, 20, 30], [0; 3], [255, 0, 0]]).unwrap();
        let mut out = Gray::filled(1, 1, 0).unwrap();
        ImageRef::from(&color).copy(&mut out).unwrap();
        assert!(out.pixels().eq(Gray::from_color(&color).pixels()));
    }

    #[test]
    fn images_that_do_not_fit_are_refused() {
        let error = |size, stride, format| {
            let refused = ImageRef::new(&[0; 12], size, stride, format);
            refused.unwrap_err().to_string()
        };
        assert!(error((4, 4), 4, ImageFormat::Gray8).contains("needs 16 bytes, got 12"));
        assert!(error((4, 3), 3, ImageFormat::Gray8).contains("stride 3 is less"));
        assert!(error((4, 1), 11, ImageFormat::Rgb8).contains("the 12 bytes of a row"));
        let huge = (usize::MAX, usize::MAX);
        assert!(error(huge, usize::MAX, ImageFormat::Rgb8).contains("got 12"));
        let bits = ImageFormat::Gray16 { bits: 17 };
        assert!(error((1, 1), 2, bits).contains("17; expected 8 to 16"));
        let none = ImageRef::new(&[], (0, 0), 0, ImageFormat::Gray8).unwrap();
        let mut out = Gray::filled(1, 1, 0).unwrap();
        assert!(matches!(none.copy(&mut out), Err(Error::Dimensions { .. })));
    }
}
