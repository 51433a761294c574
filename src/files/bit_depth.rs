//! Grey levels of images of 16 bits.

use super::decoded::{DecodedImage, luma};
use super::levels::{DECIDING_PAIRS, GreyLevels, MIN_LEVELS, Quantiles};
use svl_core::doubt::Doubt;
use svl_core::stereo::{Gray, Rgb, StereoPair};
use svl_core::{Error, Result};

/// How the 16-bit images of a source become 8-bit grey: the upper 8 of the bits that they use, or
/// of the range of their values if that is narrow.
///
/// Sensors of 10, 12 and 14 bits leave the upper ones of 16 at 0, and some pixels are hot. It is
/// decided once for a source, by quantiles of its first pairs, so that the brightness of a scene
/// changes neither during it nor with the range that is read.
#[derive(Clone, Debug)]
pub struct BitDepth {
    /// `None` for images of 8 bits.
    pub bits: Option<u8>,
    /// Grey is the value less `low`, shifted to the right.
    low: u16,
    shift: u32,
    /// The quantiles that decided.
    by: Option<Quantiles>,
    /// The doubts about the values of 16-bit images.
    pub doubts: Vec<Doubt>,
    warned: bool,
}

impl BitDepth {
    /// All 16 bits, for single images.
    pub const FULL: Self = Self {
        bits: None,
        low: 0,
        shift: 8,
        by: None,
        doubts: Vec::new(),
        warned: false,
    };

    /// Decides by the values of the first pairs of a source, unless `asked` gives the number of
    /// bits.
    ///
    /// # Errors
    /// [`Error::Usage`] if `asked` does not apply.
    pub fn decide(asked: Option<u8>, levels: &GreyLevels) -> Result<Self> {
        let by = levels.quantiles();
        if asked.is_some() && by.is_none() {
            let why = "is for 16-bit images; these have 8 bits";
            return Err(Error::Usage(format!("--bits {why}")));
        }
        let Some(found) = by else {
            return Ok(Self::FULL);
        };
        let bits = asked.unwrap_or_else(|| used(found.q999));
        let (mut low, mut shift) = (0, u32::from(bits) - 8);
        let range = found.q99 - found.q01;
        // Fewer levels decide nothing: a covered lens, before the scene.
        if asked.is_none() && range >= MIN_LEVELS && range >> shift < MIN_GREYS {
            let margin = (range / 2).max(1);
            low = found.q01.saturating_sub(margin);
            let most = u32::from(found.q99) + u32::from(margin) - u32::from(low);
            shift = (0..16).find(|k| most >> k <= 255).unwrap_or(8);
        }
        Ok(Self {
            bits: Some(bits),
            low,
            shift,
            by: by.filter(|_| asked.is_none()),
            doubts: levels.doubts(),
            warned: false,
        })
    }

    /// The conversion of 16-bit values to grey levels, with the reason.
    pub fn grey_words(&self) -> Option<String> {
        let (bits, low, shift) = (self.bits?, self.low, self.shift);
        let grey = format!("grey is (value - {low}) / {}", 1 << shift);
        let Some(by) = self.by else {
            return Some(format!("{grey}, by --bits {bits}"));
        };
        let pixels = format!("of the pixels of the first {DECIDING_PAIRS} pairs are");
        let (Quantiles { q01, q99, q999 }, cure) = (by, "--bits N overrides");
        Some(if (low, shift) != (0, u32::from(bits) - 8) {
            format!("{grey}, as 98 % {pixels} from {q01} to {q99}, a narrow range; {cure}")
        } else {
            format!("{grey}, as {bits} bits are used: 99.9 % {pixels} at most {q999}; {cure}")
        })
    }

    /// A line for the user, if fewer than 16 bits or a narrow range are used.
    pub fn note(&self) -> Option<String> {
        let words = self.grey_words().filter(|_| self.by.is_some());
        let words = words.filter(|_| (self.low, self.shift) != (0, 8));
        words.map(|words| format!("16-bit images: {words}"))
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
        let (low, shift) = (self.low, self.shift);
        let shifted = |v: u16| v.saturating_sub(low) >> shift;
        let is_lost = |v: u16| v < low || shifted(v) > 255;
        if !self.warned && image.share_of_deep(is_lost) > MAX_LOST {
            self.warned = true;
            tracing::warn!(
                "a later image has many values outside of {low} to {}: black or white; --bits 16 \
                 keeps all",
                u32::from(low) + (256 << shift) - 1
            );
        }
        // Saturates, like a sensor.
        let upper = |v: u16| shifted(v).min(255) as u8;
        match image {
            DecodedImage::Gray(grey) => (grey, None),
            DecodedImage::Gray16(deep) => (deep.map(upper), None),
            DecodedImage::Color(color) => (Gray::from_color(&color), Some(color)),
            // Grey first, so that equal channels give the pixels of a grey image of 16 bits.
            DecodedImage::Color16(deep) => {
                let grey = deep.map(|rgb| upper(luma(rgb)));
                // Rounded like in the image library.
                let rounded = |v: u16| ((u32::from(v) + 128) / 257) as u8;
                let color = if (low, shift) == (0, 8) {
                    deep.map(|rgb| rgb.map(rounded))
                } else {
                    deep.map(|rgb| rgb.map(upper))
                };
                (grey, Some(color))
            }
        }
    }
}

/// A range with fewer grey levels than these is narrow.
const MIN_GREYS: u16 = 64;
/// Fraction of a later image's pixels without a grey level that is told; fewer are hot.
const MAX_LOST: f64 = 0.01;

/// Bit depth of a sensor whose values are hardly above that.
fn used(largest: u16) -> u8 {
    let all = [10, 12, 14].into_iter();
    all.into_iter()
        .find(|bits| largest >> bits == 0)
        .unwrap_or(16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::Plane;

    fn deep(value: u16) -> [DecodedImage; 2] {
        [0, value].map(|v| DecodedImage::Gray16(Plane::filled(2, 1, v).unwrap()))
    }

    fn gray(value: u8) -> DecodedImage {
        DecodedImage::Gray(Plane::filled(2, 1, value).unwrap())
    }

    /// Decides by one pair of two equal images.
    fn decided_by(asked: Option<u8>, image: &DecodedImage) -> BitDepth {
        let levels = GreyLevels::from_pairs([[image.clone(), image.clone()]]);
        BitDepth::decide(asked, &levels).unwrap()
    }

    /// Decides by images that have values spread from 0 to `most`, and some of `hot`.
    fn decided(asked: Option<u8>, most: u16, hot: &[u16]) -> BitDepth {
        let value = |x: usize, y: usize| match hot.get(x + 100 * y) {
            Some(hot) => *hot,
            None => (usize::from(most) * (x + 100 * y) / 9999) as u16,
        };
        let image = Plane::from_fn(100, 100, value).unwrap();
        decided_by(asked, &DecodedImage::Gray16(image))
    }

    #[test]
    fn the_first_pairs_decide_once() {
        for (largest, bits, grey) in [
            (1023, 10, 255),
            (1200, 12, 75),
            (4095, 12, 255),
            (16_383, 14, 255),
            (20_000, 16, 78),
            (65_535, 16, 255),
        ] {
            let mut depth = decided(None, largest, &[]);
            assert_eq!(depth.bits, Some(bits), "{largest}");
            assert_eq!(depth.note().is_some(), bits < 16);
            assert!(depth.doubts.is_empty());
            let (pair, _) = depth.pair(deep(largest)).unwrap();
            assert_eq!(pair.right().get(0, 0), grey, "{largest}");
        }
        // Later images change nothing, and saturate.
        let (pair, _) = decided(None, 4000, &[]).pair(deep(60_000)).unwrap();
        assert_eq!(pair.right().get(1, 0), 255);
    }

    #[test]
    fn hot_pixels_decide_nothing_and_a_narrow_range_is_spread() {
        let mut depth = decided(None, 1000, &[65_535; 5]);
        let (grey, _) = depth.grey(deep(1000)[1].clone());
        assert_eq!((depth.bits, grey.get(0, 0)), (Some(10), 250));
        // 98 % of 7000 to 7509, and a margin of half of that range on each side.
        let thermal = |x: usize, y: usize| 7000 + ((x + 100 * y) * 510 / 10_000) as u16;
        let image = DecodedImage::Gray16(Plane::from_fn(100, 100, thermal).unwrap());
        let mut depth = decided_by(None, &image);
        let note = depth.note().unwrap();
        assert!(note.contains("grey is (value - 6756) / 4"), "{note}");
        let (grey, _) = depth.grey(image.clone());
        assert_eq!((grey.get(0, 0), grey.get(99, 99)), (61, 188));
        let (asked, _) = decided_by(Some(16), &image).grey(image);
        assert_eq!((asked.get(0, 0), asked.get(99, 99)), (27, 29));
    }

    #[test]
    fn the_user_overrides_and_8_bits_need_no_decision() {
        let depth = decided(Some(16), 100, &[]);
        assert_eq!((depth.bits, depth.note()), (Some(16), None));
        // Endless: only the first pair is read.
        let endless = || GreyLevels::from_pairs(std::iter::repeat_with(|| [gray(3), gray(4)]));
        assert_eq!(BitDepth::decide(None, &endless()).unwrap().bits, None);
        let refused = BitDepth::decide(Some(12), &endless());
        assert!(refused.unwrap_err().to_string().contains("8 bits"));
    }

    #[test]
    fn colour_is_kept_where_it_is_one() {
        let color = DecodedImage::from_rgb(2, 1, &[255, 0, 0, 9, 9, 9]).unwrap();
        let (grey, rgb) = BitDepth::FULL.clone().grey(color.clone());
        assert_eq!(grey.row(0), [76, 9]);
        assert_eq!(rgb.unwrap().row(0), [[255, 0, 0], [9, 9, 9]]);
        let same = DecodedImage::from_rgb(2, 1, &[8, 8, 8, 9, 9, 9]).unwrap();
        let grey = DecodedImage::Gray(Plane::from_vec(2, 1, vec![8, 9]).unwrap());
        assert_eq!(same, grey);
        let (_, none) = BitDepth::FULL.clone().pair([color, same]).unwrap();
        assert!(none.is_none(), "one grey image of two");
    }

    #[test]
    fn grey_of_deep_colour_is_that_of_its_16_bits() {
        let grey_by = |bits, image: DecodedImage| {
            let (grey, _) = decided_by(Some(bits), &image).grey(image);
            grey.get(0, 0)
        };
        let grey = |bits, rgb: [u16; 3]| {
            grey_by(
                bits,
                DecodedImage::Color16(Plane::filled(1, 1, rgb).unwrap()),
            )
        };
        let mono = |bits, value| {
            grey_by(
                bits,
                DecodedImage::Gray16(Plane::filled(1, 1, value).unwrap()),
            )
        };
        for value in [0, 255, 256, 511, 4095] {
            assert_eq!(grey(16, [value; 3]), mono(16, value));
            assert_eq!(grey(12, [value; 3]), mono(12, value));
        }
        // 0.299 · 65535 = 19595 = 76 · 256 + 139, and 0.299 · 4095 = 1224 = 76 · 16 + 8.
        assert_eq!((grey(16, [65_535, 0, 0]), grey(12, [4095, 0, 0])), (76, 76));
    }
}
