//! Decoded images of any depth, and the 8-bit pairs made from them.

use image::DynamicImage;
use serde::de::IntoDeserializer;
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display, Formatter};
use std::ops::RangeInclusive;
use std::str::FromStr;
use svl_core::doubt::{Doubt, PairCure, Subject};
use svl_core::stereo::{Gray, Plane, Rgb};
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

    /// The fraction of the pixels of a 16-bit image that `is_such`; 0 for 8 bits.
    pub(super) fn share_of_deep(&self, is_such: impl Fn(u16) -> bool) -> f64 {
        let count = match self {
            Self::Gray16(image) => image.pixels().filter(|v| is_such(*v)).count(),
            Self::Color16(image) => image.pixels().filter(|v| is_such(luma(*v))).count(),
            Self::Gray(_) | Self::Color(_) => 0,
        };
        let (width, height) = self.size();
        count as f64 / (width * height) as f64
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SideBySide {
    LeftRight,
    RightLeft,
    /// The left image above the right one.
    TopBottom,
    /// The left image below the right one.
    BottomTop,
}

impl FromStr for SideBySide {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let read = Self::deserialize(text.into_deserializer());
        read.map_err(|e: serde::de::value::Error| Error::Usage(e.to_string()))
    }
}

/// Width of an image as a fraction of its height: from upright ones to panoramas.
const SHAPES: RangeInclusive<f64> = 0.5..=4.0;

impl Display for SideBySide {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

impl SideBySide {
    /// The doubt about halves of that size.
    pub fn doubt(self, (width, height): (usize, usize)) -> Option<Doubt> {
        let shape = width as f64 / height as f64;
        let cure = PairCure::Halves { width, height };
        let usual = [*SHAPES.start(), *SHAPES.end()];
        let doubt = cure.doubt(Subject::Pairs, "width_of_height", shape, usual);
        (!SHAPES.contains(&shape)).then_some(doubt)
    }

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
        let (w, h) = self.part((width, height));
        if h < height && height % 2 != 0 {
            return odd(height, "high", "one above the other");
        } else if w < width && width % 2 != 0 {
            return odd(width, "wide", "side by side");
        }
        let half = |x: usize, y: usize| {
            let rows = image.rows().skip(y).take(h);
            let pixels = rows.flat_map(|row| &row[x..x + w]);
            Plane::from_vec(w, h, pixels.copied().collect())
        };
        let (first, second) = (half(0, 0)?, half(width - w, height - h)?);
        Ok(match self {
            Self::RightLeft | Self::BottomTop => [second, first],
            Self::LeftRight | Self::TopBottom => [first, second],
        })
    }

    /// The size of each image in one of that size.
    pub fn part(self, (width, height): (usize, usize)) -> (usize, usize) {
        match self {
            Self::TopBottom | Self::BottomTop => (width, height / 2),
            Self::LeftRight | Self::RightLeft => (width / 2, height),
        }
    }

    /// The size of an image that holds both of that size.
    pub fn whole(self, (width, height): (usize, usize)) -> (usize, usize) {
        match self {
            Self::TopBottom | Self::BottomTop => (width, 2 * height),
            Self::LeftRight | Self::RightLeft => (2 * width, height),
        }
    }
}

/// The luma of a pixel of 16 bits, as of [`Gray::from_color`].
pub(super) fn luma(rgb: [u16; 3]) -> u16 {
    let [r, g, b] = rgb.map(u32::from);
    ((299 * r + 587 * g + 114 * b + 500) / 1000) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let [top, bottom] = rows;
        assert_eq!(halves("bottom-top"), [bottom, top]);
        for (size, is_named) in [
            ((640, 480), false),
            ((480, 640), false),
            ((960, 1080), false),
            ((1242, 375), false),
            ((140, 380), true),
            ((1280, 180), true),
        ] {
            let doubt = SideBySide::RightLeft.doubt(size);
            assert_eq!(doubt.is_some(), is_named, "{size:?}: {doubt:?}");
        }
        assert_eq!(SideBySide::BottomTop.to_string(), "bottom-top");
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
