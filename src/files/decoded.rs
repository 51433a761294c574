//! Decoded images of any depth, and the 8-bit pairs made from them.

use image::DynamicImage;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use std::str::FromStr;
use svl_core::stereo::{Gray, Plane, Rgb, StereoPair};
use svl_core::{Error, Result};

/// An image as stored in its file, message or video.
#[derive(Clone, Debug, PartialEq)]
pub enum DecodedImage {
    Gray(Gray),
    Color(Rgb),
    Gray16(Plane<u16>),
    Color16(Plane<[u16; 3]>),
}

impl DecodedImage {
    /// # Errors
    /// [`Error::Dimensions`].
    pub fn new(image: DynamicImage) -> Result<Self> {
        let (width, height) = (image.width() as usize, image.height() as usize);
        match image {
            DynamicImage::ImageLuma8(grey) => {
                Plane::from_vec(width, height, grey.into_raw()).map(Self::Gray)
            }
            DynamicImage::ImageLuma16(grey) => {
                Plane::from_vec(width, height, grey.into_raw()).map(Self::Gray16)
            }
            DynamicImage::ImageRgb16(_) | DynamicImage::ImageRgba16(_) => {
                let rgb = image.into_rgb16().into_raw().as_chunks().0.to_vec();
                Plane::from_vec(width, height, rgb).map(Self::Color16)
            }
            other => Self::from_rgb(width, height, other.into_rgb8().as_raw()),
        }
    }

    /// From interleaved 8-bit RGB. If all three channels are equal everywhere, it is grey.
    ///
    /// # Errors
    /// [`Error::Dimensions`] or [`Error::Size`].
    pub fn from_rgb(width: usize, height: usize, rgb: &[u8]) -> Result<Self> {
        let pixels = rgb.as_chunks::<3>().0;
        if pixels.iter().all(|[r, g, b]| r == g && g == b) {
            let grey = pixels.iter().map(|pixel| pixel[0]).collect();
            return Plane::from_vec(width, height, grey).map(Self::Gray);
        }
        Plane::from_vec(width, height, pixels.to_vec()).map(Self::Color)
    }

    /// `(width, height)`.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Gray(image) => image.size(),
            Self::Color(image) => image.size(),
            Self::Gray16(image) => image.size(),
            Self::Color16(image) => image.size(),
        }
    }

    /// Bytes of its pixels.
    pub fn bytes(&self) -> usize {
        let (width, height) = self.size();
        let bytes = match self {
            Self::Gray(_) => 1,
            Self::Gray16(_) => 2,
            Self::Color(_) => 3,
            Self::Color16(_) => 6,
        };
        width * height * bytes
    }

    /// The largest value of a 16-bit pair; `None` for an 8-bit one.
    pub fn largest_of(pair: &[Self; 2]) -> Option<u16> {
        pair.iter().filter_map(Self::largest).max()
    }

    /// The largest value of a 16-bit image; `None` for an 8-bit one.
    pub fn largest(&self) -> Option<u16> {
        match self {
            Self::Gray16(image) => image.pixels().max(),
            Self::Color16(image) => image.pixels().flatten().max(),
            Self::Gray(_) | Self::Color(_) => None,
        }
    }

    /// The left and the right image in an image that holds both.
    ///
    /// # Errors
    /// The errors of [`SideBySide::halves`].
    pub fn halves(&self, places: SideBySide) -> Result<[Self; 2]> {
        Ok(match self {
            Self::Gray(image) => places.halves(image)?.map(Self::Gray),
            Self::Color(image) => places.halves(image)?.map(Self::Color),
            Self::Gray16(image) => places.halves(image)?.map(Self::Gray16),
            Self::Color16(image) => places.halves(image)?.map(Self::Color16),
        })
    }
}

/// Places of the left and the right image in one that holds both.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SideBySide {
    LeftRight,
    RightLeft,
    /// The left image above the right one.
    TopBottom,
}

impl FromStr for SideBySide {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let read = Self::deserialize(text.into_deserializer());
        read.map_err(|e: serde::de::value::Error| Error::Usage(e.to_string()))
    }
}

impl SideBySide {
    /// The left and the right image.
    ///
    /// # Errors
    /// [`Error::Invalid`] for an odd width or height.
    pub fn halves<T: Copy>(self, image: &Plane<T>) -> Result<[Plane<T>; 2]> {
        let (width, height) = image.size();
        let odd = |px: usize, way: &str, place: &str| {
            let what = format!("is {px} pixels {way}: two images {place} have an even number");
            Err(Error::Invalid(what))
        };
        let (w, h) = match self {
            Self::TopBottom if height % 2 != 0 => {
                return odd(height, "high", "one above the other");
            }
            Self::TopBottom => (width, height / 2),
            _ if width % 2 != 0 => return odd(width, "wide", "side by side"),
            _ => (width / 2, height),
        };
        let half = |x: usize, y: usize| {
            let rows = image.rows().skip(y).take(h);
            let pixels = rows.flat_map(|row| &row[x..x + w]);
            Plane::from_vec(w, h, pixels.copied().collect())
        };
        let (first, second) = (half(0, 0)?, half(width - w, height - h)?);
        Ok(match self {
            Self::RightLeft => [second, first],
            Self::LeftRight | Self::TopBottom => [first, second],
        })
    }

    /// The size of an image that holds both of that size.
    pub fn whole(self, (width, height): (usize, usize)) -> (usize, usize) {
        match self {
            Self::TopBottom => (width, 2 * height),
            Self::LeftRight | Self::RightLeft => (2 * width, height),
        }
    }
}

/// Number of pairs that decide the bit depth of a source.
pub const DECIDING_PAIRS: usize = 16;

/// Number of bits that the 16-bit images of a source use; the upper 8 of these become grey.
///
/// Sensors of 10, 12 and 14 bits leave the upper ones of 16 at 0. It is decided once for a source,
/// by its first pairs, so that the brightness of a scene changes neither during it nor with the
/// range that is read.
#[derive(Clone, Debug)]
pub struct BitDepth {
    /// `None` if the first pair has 8 bits.
    bits: Option<u8>,
    /// The largest value that decided.
    largest: Option<u16>,
    warned: bool,
}

impl BitDepth {
    /// All 16 bits, for single images.
    pub const FULL: Self = Self {
        bits: None,
        largest: None,
        warned: false,
    };

    /// Decides by the largest value of each of the first [`DECIDING_PAIRS`] pairs of a source,
    /// unless `asked` gives the number. For a source of 8-bit images one pair is read.
    ///
    /// # Errors
    /// [`Error::Usage`] if `asked` does not apply.
    pub fn decide(
        asked: Option<u8>,
        largest: impl IntoIterator<Item = Option<u16>>,
    ) -> Result<Self> {
        let largest = largest.into_iter().take(DECIDING_PAIRS);
        let largest = largest.take_while(Option::is_some).flatten().max();
        let bits = match (asked, largest) {
            (Some(_), None) => {
                let why = "is for 16-bit images; these have 8 bits";
                return Err(Error::Usage(format!("--bits {why}")));
            }
            (Some(asked), Some(_)) => Some(asked),
            (None, largest) => largest.map(used),
        };
        Ok(Self {
            bits,
            largest: largest.filter(|_| asked.is_none()),
            warned: false,
        })
    }

    /// The bits used by 16-bit images.
    pub fn bits(&self) -> Option<u8> {
        self.bits
    }

    /// A line for the user, if fewer than 16 bits are used.
    pub fn note(&self) -> Option<String> {
        let (bits, largest) = (self.bits.filter(|bits| *bits < 16)?, self.largest?);
        Some(format!(
            "16-bit images that use {bits} bits: the largest value of the first {DECIDING_PAIRS} \
             pairs is {largest}; --bits N overrides"
        ))
    }

    /// The pair of two images, with their colours if both have them.
    ///
    /// # Errors
    /// [`Error::PairSize`].
    pub fn pair(
        &mut self,
        [left, right]: [DecodedImage; 2],
    ) -> Result<(StereoPair, Option<[Rgb; 2]>)> {
        let ((left, left_color), (right, right_color)) = (self.grey(left), self.grey(right));
        let color = left_color.zip(right_color).map(<[Rgb; 2]>::from);
        Ok((StereoPair::new(left, right)?, color))
    }

    /// The image as 8-bit grey, with the original colours.
    pub fn grey(&mut self, image: DecodedImage) -> (Gray, Option<Rgb>) {
        let bits = u32::from(self.bits.unwrap_or(16));
        if let Some(largest) = image.largest().filter(|v| u32::from(*v) >> bits > 0)
            && !std::mem::replace(&mut self.warned, true)
        {
            tracing::warn!(
                "a later image has the value {largest}, more than {bits} bits: such pixels are \
                 white; --bits 16 keeps all"
            );
        }
        // Saturates, like a sensor.
        let upper = |v: u16| (v >> (bits - 8)).min(255) as u8;
        match image {
            DecodedImage::Gray(grey) => (grey, None),
            DecodedImage::Gray16(deep) => (deep.map(upper), None),
            DecodedImage::Color(color) => (Gray::from_color(&color), Some(color)),
            // Grey first, so that equal channels give the pixels of a grey image of 16 bits.
            DecodedImage::Color16(deep) => {
                let grey = deep.map(|rgb| upper(luma(rgb)));
                // Rounded like in the image library.
                let rounded = |v: u16| ((u32::from(v) + 128) / 257) as u8;
                let color = if bits == 16 {
                    deep.map(|rgb| rgb.map(rounded))
                } else {
                    deep.map(|rgb| rgb.map(upper))
                };
                (grey, Some(color))
            }
        }
    }
}

/// The luma of a pixel of 16 bits, as of [`Gray::from_color`].
fn luma(rgb: [u16; 3]) -> u16 {
    let [r, g, b] = rgb.map(u32::from);
    ((299 * r + 587 * g + 114 * b + 500) / 1000) as u16
}

/// Bit depth of a sensor with that largest value.
fn used(largest: u16) -> u8 {
    let all = [10, 12, 14].into_iter();
    all.into_iter()
        .find(|bits| largest >> bits == 0)
        .unwrap_or(16)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deep(value: u16) -> [DecodedImage; 2] {
        [0, value].map(|v| DecodedImage::Gray16(Plane::filled(2, 1, v).unwrap()))
    }

    fn gray(value: u8) -> DecodedImage {
        DecodedImage::Gray(Plane::filled(2, 1, value).unwrap())
    }

    #[test]
    fn the_first_pairs_decide_once() {
        for (largest, bits, grey) in [
            (1023, 10, 255),
            (1024, 12, 64),
            (4095, 12, 255),
            (16_383, 14, 255),
            (16_384, 16, 64),
            (65_535, 16, 255),
        ] {
            let pairs = (0..16).map(|i| Some(if i == 15 { largest } else { 7 }));
            let mut depth = BitDepth::decide(None, pairs).unwrap();
            assert_eq!(depth.bits(), Some(bits), "{largest}");
            assert_eq!(depth.note().is_some(), bits < 16);
            let (pair, _) = depth.pair(deep(largest)).unwrap();
            assert_eq!(pair.right().get(0, 0), grey, "{largest}");
        }
        // Later images change nothing, and saturate.
        let late = (0..17).map(|i| Some(if i == 16 { 60_000 } else { 4000 }));
        let mut depth = BitDepth::decide(None, late).unwrap();
        assert_eq!(depth.bits(), Some(12));
        assert_eq!(depth.pair(deep(60_000)).unwrap().0.right().get(1, 0), 255);
    }

    #[test]
    fn the_user_overrides_and_8_bits_need_no_decision() {
        let depth = BitDepth::decide(Some(16), [DecodedImage::largest_of(&deep(100))]).unwrap();
        assert_eq!((depth.bits(), depth.note()), (Some(16), None));
        // Endless: only the first pair is read.
        let eight = || DecodedImage::largest_of(&[gray(3), gray(4)]);
        let endless = std::iter::repeat_with(eight);
        assert_eq!(BitDepth::decide(None, endless).unwrap().bits(), None);
        let refused = BitDepth::decide(Some(12), [eight()]);
        assert!(refused.unwrap_err().to_string().contains("8 bits"));
    }

    #[test]
    fn colour_is_kept_where_it_is_one() {
        let color = DecodedImage::from_rgb(2, 1, &[255, 0, 0, 9, 9, 9]).unwrap();
        let (grey, rgb) = BitDepth::FULL.clone().grey(color.clone());
        assert_eq!(grey.row(0), [76, 9]);
        assert_eq!(rgb.unwrap().row(0), [[255, 0, 0], [9, 9, 9]]);
        let same = DecodedImage::from_rgb(2, 1, &[8, 8, 8, 9, 9, 9]).unwrap();
        assert_eq!(
            same,
            DecodedImage::Gray(Plane::from_vec(2, 1, vec![8, 9]).unwrap())
        );
        let (_, none) = BitDepth::FULL.clone().pair([color, same]).unwrap();
        assert!(none.is_none(), "one grey image of two");
    }

    #[test]
    fn grey_of_deep_colour_is_that_of_its_16_bits() {
        let grey = |bits, rgb: [u16; 3]| {
            let image = DecodedImage::Color16(Plane::filled(1, 1, rgb).unwrap());
            let mut depth = BitDepth::decide(Some(bits), [image.largest()]).unwrap();
            depth.grey(image).0.get(0, 0)
        };
        let mono = |bits, value| {
            let image = DecodedImage::Gray16(Plane::filled(1, 1, value).unwrap());
            let mut depth = BitDepth::decide(Some(bits), [image.largest()]).unwrap();
            depth.grey(image).0.get(0, 0)
        };
        for value in [0, 255, 256, 511, 4095] {
            assert_eq!(grey(16, [value; 3]), mono(16, value));
            assert_eq!(grey(12, [value; 3]), mono(12, value));
        }
        // 0.299 · 65535 = 19595 = 76 · 256 + 139, and 0.299 · 4095 = 1224 = 76 · 16 + 8.
        assert_eq!((grey(16, [65_535, 0, 0]), grey(12, [4095, 0, 0])), (76, 76));
    }

    #[test]
    fn halves_are_left_and_right() {
        let wide = Plane::from_vec(4, 2, vec![1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
        let wide = DecodedImage::Gray(wide);
        let halves = |places: &str| wide.halves(places.parse().unwrap()).unwrap();
        let image =
            |w, h, data: [u8; 4]| DecodedImage::Gray(Plane::from_vec(w, h, data.into()).unwrap());
        let (left, right) = (image(2, 2, [1, 2, 5, 6]), image(2, 2, [3, 4, 7, 8]));
        assert_eq!(halves("left-right"), [left.clone(), right.clone()]);
        assert_eq!(halves("right-left"), [right, left]);
        let rows = [image(4, 1, [1, 2, 3, 4]), image(4, 1, [5, 6, 7, 8])];
        assert_eq!(halves("top-bottom"), rows);
        let odd = DecodedImage::Gray(Plane::filled(3, 1, 0).unwrap());
        for (places, words) in [
            (SideBySide::LeftRight, "3 pixels wide"),
            (SideBySide::TopBottom, "1 pixels high"),
        ] {
            let error = odd.halves(places).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
