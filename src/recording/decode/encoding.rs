//! Pixel encodings of image messages, by the names of ROS's sensor_msgs/image_encodings.hpp and of
//! Foxglove's RawImage.

use super::bayer::Tile;
use crate::message::ros::read::RawPixels;
use crate::message::{MessageError, MessageResult, ros};
use crate::stream::channel::Channel;
use Chroma::{Full, Half, Interleaved};
use Samples::{Bayer8, Bayer16, Color8, Color16, Float32, Float64, Grey8, Grey16};
use svl_core::joined;
use svl_core::stereo::Plane;
use svl_files as files;

/// A pixel encoding.
pub(crate) struct PixelEncoding {
    /// The usual name first. Case does not count.
    names: &'static [&'static str],
    pub(crate) samples: Samples,
    chroma: Chroma,
}

/// The samples of a pixel, and those that svl uses: as an image, as a depth (REP 118), or as both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Samples {
    /// An image. `Grey8(n, i)`: byte `i` of every `n`, the Y of YUV.
    Grey8(usize, usize),
    /// An image, or depths in millimetres.
    Grey16,
    /// An image: a mosaic of one sample per pixel.
    Bayer8(Tile),
    Bayer16(Tile),
    /// An image. `Color8(n, rgb)`: red, green and blue are these of every `n` samples.
    Color8(usize, [usize; 3]),
    Color16(usize, [usize; 3]),
    /// Depths in metres.
    Float32,
    Float64,
}

/// Place of the chroma, which svl does not use.
#[derive(Clone, Copy, PartialEq)]
enum Chroma {
    /// Among the samples of a pixel, if there is any.
    Interleaved,
    /// A plane below the luma, with half as many rows of the same length.
    Half,
    /// A plane below the luma, with two bytes per pixel.
    Full,
}

const RGB: [usize; 3] = [0, 1, 2];
const BGR: [usize; 3] = [2, 1, 0];

/// All encodings. 8UC1, 16UC3 and the like are OpenCV's names, which cv_bridge writes if it knows
/// no other: grey, BGR, BGRA.
const ENCODINGS: &[PixelEncoding] = &[
    packed(&["mono8", "8UC1"], Grey8(1, 0)),
    packed(&["mono16", "16UC1"], Grey16),
    packed(&["rgb8"], Color8(3, RGB)),
    packed(&["rgba8"], Color8(4, RGB)),
    packed(&["bgr8", "8UC3"], Color8(3, BGR)),
    packed(&["bgra8", "8UC4"], Color8(4, BGR)),
    packed(&["rgb16"], Color16(3, RGB)),
    packed(&["rgba16"], Color16(4, RGB)),
    packed(&["bgr16", "16UC3"], Color16(3, BGR)),
    packed(&["bgra16", "16UC4"], Color16(4, BGR)),
    packed(&["uyvy", "yuv422"], Grey8(2, 1)),
    packed(&["yuyv", "yuv422_yuy2"], Grey8(2, 0)),
    packed(&["nv12", "nv21"], Grey8(1, 0)).with_chroma(Half),
    packed(&["nv24"], Grey8(1, 0)).with_chroma(Full),
    packed(&["bayer_rggb8"], Bayer8([0, 1, 1, 2])),
    packed(&["bayer_bggr8"], Bayer8([2, 1, 1, 0])),
    packed(&["bayer_gbrg8"], Bayer8([1, 2, 0, 1])),
    packed(&["bayer_grbg8"], Bayer8([1, 0, 2, 1])),
    packed(&["bayer_rggb16"], Bayer16([0, 1, 1, 2])),
    packed(&["bayer_bggr16"], Bayer16([2, 1, 1, 0])),
    packed(&["bayer_gbrg16"], Bayer16([1, 2, 0, 1])),
    packed(&["bayer_grbg16"], Bayer16([1, 0, 2, 1])),
    packed(&["32FC1"], Float32),
    packed(&["64FC1"], Float64),
];

const fn packed(names: &'static [&'static str], samples: Samples) -> PixelEncoding {
    PixelEncoding {
        names,
        samples,
        chroma: Interleaved,
    }
}

/// The encoding of that name.
pub(crate) fn named(name: &str) -> Option<&'static PixelEncoding> {
    ENCODINGS.iter().find(|encoding| {
        let mut names = encoding.names.iter();
        names.any(|known| known.eq_ignore_ascii_case(name))
    })
}

/// The reason why pixels of an encoding are no image.
pub(crate) fn why_no_image(name: &str) -> MessageError {
    if named(name).is_some() {
        return MessageError::Pixels(format!(
            "its pixels are '{name}', which are depths: name its topic with --truth, and topics \
             of images with --left and --right"
        ));
    }
    let images = ENCODINGS.iter().filter(|encoding| encoding.is_image());
    let known = joined(images.map(|encoding| encoding.names[0]));
    MessageError::Pixels(format!(
        "its pixels are '{name}', svl reads {known}: record one of them"
    ))
}

/// The reason why pixels of an encoding are no depths.
pub(crate) fn why_no_depths(name: &str) -> MessageError {
    MessageError::Pixels(format!(
        "its pixels are '{name}'; depths are 16UC1 in millimetres, 32FC1 or 64FC1 in metres"
    ))
}

/// Bytes behind an image that are padding, as of a page of memory.
const MAX_PADDING_BYTES: usize = 4096;

impl PixelEncoding {
    /// The mosaic of its samples, if they are one.
    pub(crate) fn mosaic(&self) -> Option<Tile> {
        match self.samples {
            Bayer8(tile) | Bayer16(tile) => Some(tile),
            _ => None,
        }
    }

    const fn with_chroma(mut self, chroma: Chroma) -> Self {
        self.chroma = chroma;
        self
    }

    fn is_image(&self) -> bool {
        !matches!(self.samples, Float32 | Float64)
    }

    /// Bytes of a pixel in its row.
    fn bytes(&self) -> usize {
        match self.samples {
            Bayer8(_) => 1,
            Grey16 | Bayer16(_) => 2,
            Grey8(bytes, _) | Color8(bytes, _) => bytes,
            Color16(channels, _) => 2 * channels,
            Float32 => 4,
            Float64 => 8,
        }
    }

    /// The rows of an image of this encoding, without padding and without planes of chroma. They
    /// are within its data, so memory for its pixels is in proportion to that.
    ///
    /// # Errors
    /// The reason why size, step and data do not fit.
    pub(crate) fn rows<'a>(
        &self,
        raw: &RawPixels<'a>,
    ) -> MessageResult<impl Iterator<Item = &'a [u8]>> {
        let (width, height) = (raw.width as usize, raw.height as usize);
        let (encoding, got) = (raw.encoding, raw.data.len());
        if width == 0 || height == 0 || raw.data.is_empty() {
            return Err(MessageError::NoPixel(width, height, encoding.to_owned()));
        }
        if self.chroma == Half && (width % 2, height % 2) != (0, 0) {
            return Err(MessageError::OddSides(width, height, encoding.to_owned()));
        }
        // Saturating: the sizes are untrusted numbers from a message.
        let row_bytes = width.saturating_mul(self.bytes());
        // A step that was never set: rows without padding.
        let step = Some(raw.step as usize).filter(|step| *step > 0);
        let step = step.unwrap_or(row_bytes);
        let (all_rows, chroma) = match self.chroma {
            Interleaved => (height, ""),
            Half => (height.saturating_add(height / 2), " and its chroma"),
            Full => (height.saturating_mul(3), " and its chroma"),
        };
        let what =
            || format!("a {width}x{height} {encoding} image with rows of {step} bytes{chroma}");
        // A payload of another encoding, as three channels said to be one.
        let whole = all_rows.saturating_mul(step.max(row_bytes));
        if got > whole.saturating_add(MAX_PADDING_BYTES) {
            return Err(MessageError::Surplus(what(), got));
        }
        let rows = files::strided_rows(raw.data, row_bytes, all_rows, step)
            .map_err(|_| MessageError::Length(what(), got))?;
        Ok(rows.take(height))
    }
}

/// The samples of `N` bytes in the rows.
pub(crate) fn samples<'a, const N: usize, T>(
    rows: impl Iterator<Item = &'a [u8]>,
    value: impl Fn([u8; N]) -> T,
) -> Vec<T> {
    let mut samples = Vec::new();
    for row in rows {
        let bytes = row.as_chunks().0.iter();
        samples.extend(bytes.map(|bytes| value(*bytes)));
    }
    samples
}

/// Reads a number of 16 bits in the byte order of an image.
pub(crate) fn u16_of(raw: &RawPixels<'_>) -> fn([u8; 2]) -> u16 {
    if raw.big_endian {
        u16::from_be_bytes
    } else {
        u16::from_le_bytes
    }
}

/// The samples of an image of floats, as they are.
pub(crate) fn floats(channel: &Channel, data: &[u8]) -> MessageResult<Plane<f32>> {
    values(&ros::read(channel, data, ros::image)?.1)
}

/// The samples of an image of depths, in metres, before invalid ones are removed.
pub(crate) fn values(raw: &RawPixels<'_>) -> MessageResult<Plane<f32>> {
    let encoding = named(raw.encoding).ok_or_else(|| why_no_depths(raw.encoding))?;
    let rows = encoding.rows(raw)?;
    let number = u16_of(raw);
    let depths = match (encoding.samples, raw.big_endian) {
        (Grey16, _) => samples(rows, |bytes| metres(number(bytes))),
        (Float32, false) => samples(rows, f32::from_le_bytes),
        (Float32, true) => samples(rows, f32::from_be_bytes),
        (Float64, false) => samples(rows, |bytes| f64::from_le_bytes(bytes) as f32),
        (Float64, true) => samples(rows, |bytes| f64::from_be_bytes(bytes) as f32),
        _ => return Err(why_no_depths(raw.encoding)),
    };
    let (width, height) = (raw.width as usize, raw.height as usize);
    Ok(Plane::from_vec(width, height, depths)?)
}

pub(crate) fn metres(millimetres: u16) -> f32 {
    f32::from(millimetres) / 1000.0
}

#[cfg(test)]
mod tests {
    use super::super::pixels;
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn an_image_is_of_its_size_or_an_error(
            encoding in 0..ENCODINGS.len(),
            (width, height, padding) in (0_u32..9, 0_u32..9, -3_i32..9),
            (more, big_endian) in (-9_i32..20, any::<bool>()),
            noise in prop::collection::vec(any::<u8>(), 1800),
        ) {
            let encoding = &ENCODINGS[encoding];
            let step = (width * encoding.bytes() as u32).saturating_add_signed(padding);
            let rows = match encoding.chroma {
                Interleaved => height,
                Half => height + height / 2,
                Full => 3 * height,
            };
            let length = (step * rows).saturating_add_signed(more) as usize;
            let name = encoding.names[0];
            let data = &noise[..length.min(noise.len())];
            let raw = RawPixels { width, height, step, encoding: name, big_endian, data };
            let read = pixels::decode(&raw);
            let fits = width > 0 && height > 0 && padding >= 0 && more >= 0;
            let is_even = encoding.chroma != Half || (width % 2, height % 2) == (0, 0);
            let is_whole = data.len() == length;
            if fits && is_even && is_whole && encoding.is_image() {
                let image = read.map_err(|e| TestCaseError::fail(e.to_string()))?;
                prop_assert_eq!(image.image.size(), (width as usize, height as usize));
            } else if let Ok(image) = read {
                // Missing padding of the last row alone.
                prop_assert!(is_even && padding >= -more);
                prop_assert_eq!(image.image.size(), (width as usize, height as usize));
            }
        }
    }

    #[test]
    fn each_name_is_of_one_encoding() {
        let names: Vec<_> = ENCODINGS
            .iter()
            .flat_map(|encoding| encoding.names)
            .map(|name| name.to_ascii_lowercase())
            .collect();
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len());
        assert_eq!(named("YUV422").unwrap().samples, Grey8(2, 1));
        assert!(named("16SC1").is_none() && named("").is_none());
    }

    #[test]
    fn a_wrong_encoding_is_named_with_the_cure() {
        let unknown = why_no_image("h264").to_string();
        let words = ["'h264'", "mono8", "nv12", "bayer_grbg16", "record one"];
        words
            .iter()
            .for_each(|word| assert!(unknown.contains(word), "{unknown}"));
        assert!(!unknown.contains("32FC1"), "{unknown}");
        let depths = why_no_image("64FC1").to_string();
        assert!(depths.contains("'64FC1', which are depths: name its topic with --truth"));
        let image = why_no_depths("nv12").to_string();
        assert!(image.contains("'nv12'; depths are 16UC1 in millimetres"));
    }

    #[test]
    fn sizes_that_lie_are_refused() {
        let rows = |encoding: &str, (width, height, step): (u32, u32, u32), bytes: usize| {
            let raw = RawPixels {
                width,
                height,
                step,
                encoding,
                big_endian: false,
                data: &vec![0; bytes],
            };
            let rows = named(encoding).unwrap().rows(&raw);
            rows.map(|rows| rows.map(<[u8]>::len).collect::<Vec<_>>())
        };
        assert_eq!(rows("mono8", (2, 2, 3), 5), Ok(vec![2, 2]));
        assert_eq!(rows("mono8", (2, 2, 0), 4), Ok(vec![2, 2]));
        // Chroma: half as many rows, and rows of two bytes per pixel.
        assert_eq!(rows("nv12", (4, 2, 6), 16), Ok(vec![4, 4]));
        assert_eq!(rows("nv24", (2, 2, 2), 12), Ok(vec![2, 2]));
        for (encoding, size, bytes, words) in [
            ("mono8", (0, 0, 0), 0, "image without a pixel"),
            ("mono8", (2, 2, 2), 0, "image without a pixel"),
            ("mono8", (2, 2, 3), 4, "2x2 mono8 image with rows of 3"),
            ("nv21", (4, 2, 6), 15, "and its chroma does not fit"),
            ("nv12", (3, 2, 4), 99, "are odd, which nv12 cannot have"),
            ("nv12", (4, 3, 4), 99, "are odd, which nv12 cannot have"),
        ] {
            let error = rows(encoding, size, bytes).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        assert!(rows("nv24", (2, 2, 2), 11).is_err());
        // The height of a matrix of OpenCV's, with the rows of the chroma.
        assert!(rows("nv12", (4, 6, 4), 24).is_err());
        let large = u32::MAX - 1;
        for encoding in ENCODINGS {
            let name = encoding.names[0];
            assert!(rows(name, (large, large, u32::MAX), 9).is_err(), "{name}");
            for size in [(2, large, 0), (0, 2, 8), (2, 2, 1)] {
                assert!(rows(name, size, 99).is_err(), "{name}");
            }
        }
    }
}
