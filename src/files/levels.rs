//! The values of a source's first 16-bit images, which decide how they become grey levels.

use super::DecodedImage;
use super::decoded::luma;
use svl_core::doubt::{Doubt, PairCure, Subject};
use svl_core::stereo::Plane;

/// Number of images per camera that decide.
pub const DECIDING_PAIRS: usize = 16;

/// Values of each camera's first images of 16 bits; a camera of 8 bits has none.
#[derive(Clone, Debug, Default)]
pub struct GreyLevels {
    cameras: [CameraLevels; 2],
}

#[derive(Clone, Debug, Default)]
struct CameraLevels {
    /// Images that were taken in, and of them those of 16 bits.
    images: usize,
    deep: usize,
    /// Number of pixels of each value.
    counts: Vec<u64>,
    /// Sums of the differences of neighbours, as read and with exchanged bytes, for each of
    /// [`NEIGHBOURS`].
    steps: [[u64; 2]; 3],
}

/// Quantiles of the values of both cameras: the least 1 %, the greatest 99 % and 99.9 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Quantiles {
    pub(crate) q01: u16,
    pub(crate) q99: u16,
    pub(crate) q999: u16,
}

/// Columns and rows between neighbours: along stripes of one pixel, and across every second one,
/// values are smooth; with exchanged bytes they are smooth nowhere.
const NEIGHBOURS: [[usize; 2]; 3] = [[1, 0], [2, 0], [0, 1]];
/// Values with fewer levels than these between their 1 % and 99 % quantiles are few.
pub(super) const MIN_LEVELS: u16 = 32;
/// Bytes are exchanged if neighbours differ by this factor more than they do with the others.
const EXCHANGED: f64 = 2.0;
/// Cameras whose 99 % quantiles differ by this factor have two depths.
const DEPTHS: f64 = 3.0;

impl GreyLevels {
    /// The values of the first pairs; of pairs of 8 bits only the first is read.
    pub fn from_pairs(pairs: impl IntoIterator<Item = [DecodedImage; 2]>) -> Self {
        let mut levels = Self::default();
        for images in pairs.into_iter().take(DECIDING_PAIRS) {
            let deep = [0, 1].map(|side| levels.add(side, &images[side]));
            if deep == [false; 2] {
                break;
            }
        }
        levels
    }

    /// Adds an image of a camera, 0 for the left one; false if it has 8 bits. Those after the first
    /// `DECIDING_PAIRS` are only counted.
    pub fn add(&mut self, side: usize, image: &DecodedImage) -> bool {
        let camera = &mut self.cameras[side];
        camera.images += 1;
        let is_added = camera.images <= DECIDING_PAIRS;
        match image {
            DecodedImage::Gray16(deep) if is_added => camera.add(deep),
            DecodedImage::Color16(deep) if is_added => camera.add(&deep.map(luma)),
            DecodedImage::Gray16(_) | DecodedImage::Color16(_) => {}
            DecodedImage::Gray(_) | DecodedImage::Color(_) => return false,
        }
        true
    }

    /// True if both cameras have enough images, or images of 8 bits, or one has many more.
    pub fn are_enough(&self) -> bool {
        let is_enough = |own: &CameraLevels| own.images > own.deep || own.images >= DECIDING_PAIRS;
        let has_many = |own: &CameraLevels| own.images >= 4 * DECIDING_PAIRS;
        self.cameras.iter().all(is_enough) || self.cameras.iter().any(has_many)
    }

    fn deep(&self) -> impl Iterator<Item = &CameraLevels> {
        self.cameras.iter().filter(|own| own.deep > 0)
    }

    /// The quantiles; `None` for images of 8 bits.
    pub(crate) fn quantiles(&self) -> Option<Quantiles> {
        let greatest = |share| self.deep().map(|own| own.quantile(share)).max();
        Some(Quantiles {
            q01: self.deep().map(|own| own.quantile(0.01)).min()?,
            q99: greatest(0.99)?,
            q999: greatest(0.999)?,
        })
    }

    /// The doubts about the values of 16 bits.
    pub fn doubts(&self) -> Vec<Doubt> {
        let Some(Quantiles { q01, q99, .. }) = self.quantiles() else {
            return Vec::new();
        };
        let few = (q99 - q01 < MIN_LEVELS).then(|| {
            let usual = [f64::from(MIN_LEVELS), 65_535.0];
            let levels = (q99 - q01).into();
            let cure = PairCure::FewLevels { from: q01, to: q99 };
            cure.doubt(Subject::Pairs, "grey_levels", levels, usual)
        });
        let doubts = [few, self.exchanged(), self.two_depths()];
        doubts.into_iter().flatten().collect()
    }

    /// The doubt about the order of the bytes, if both cameras look smoother with the other in all
    /// directions.
    fn exchanged(&self) -> Option<Doubt> {
        let steps = self.cameras.iter().map(CameraLevels::relative_steps);
        let steps = steps.collect::<Option<Vec<_>>>()?;
        let ratios = steps.iter().flatten().map(|[read, other]| read / other);
        let ratio = ratios.reduce(f64::min)?;
        let [as_read, exchanged] = steps[0][0];
        let cure = PairCure::ByteOrder { as_read, exchanged };
        let doubt = cure.doubt(Subject::Pairs, "roughness", ratio, [0.0, EXCHANGED]);
        (ratio > EXCHANGED).then_some(doubt)
    }

    /// The doubt about cameras of two depths.
    fn two_depths(&self) -> Option<Doubt> {
        let bright = |own: &CameraLevels| (own.deep > 0).then(|| own.quantile(0.99));
        let bright = self.cameras.each_ref().map(bright);
        let has_all = self.cameras.iter().all(|own| own.images > 0);
        let [left, right] = bright;
        let cure = PairCure::TwoDepths { left, right };
        let (Some(left), Some(right)) = (left, right) else {
            let is_mixed = has_all && left != right;
            return is_mixed.then(|| cure.doubt(Subject::Pairs, "bits_apart", 8.0, [0.0, 0.0]));
        };
        let [left, right] = [left, right].map(|own| f64::from(own.max(1)));
        let ratio = (left / right).max(right / left);
        let doubt = cure.doubt(Subject::Pairs, "brightness_ratio", ratio, [1.0, DEPTHS]);
        (ratio > DEPTHS).then_some(doubt)
    }
}

impl CameraLevels {
    fn add(&mut self, image: &Plane<u16>) {
        self.deep += 1;
        self.counts.resize(1 << 16, 0);
        for row in image.rows() {
            row.iter()
                .for_each(|value| self.counts[usize::from(*value)] += 1);
        }
        for (steps, [columns, rows]) in self.steps.iter_mut().zip(NEIGHBOURS) {
            for (row, next) in image.rows().zip(image.rows().skip(rows)) {
                for (a, b) in row.iter().zip(next.iter().skip(columns)) {
                    steps[0] += u64::from(a.abs_diff(*b));
                    steps[1] += u64::from(a.swap_bytes().abs_diff(b.swap_bytes()));
                }
            }
        }
    }

    fn quantile(&self, share: f64) -> u16 {
        quantile(share, |value| self.counts[value])
    }

    /// Differences of neighbours, as a fraction of the range from the 1 % to the 99 % quantile; as
    /// read, and with exchanged bytes. A constant factor of both is left out.
    fn relative_steps(&self) -> Option<[[f64; 2]; 3]> {
        let exchanged = |value: usize| self.counts[usize::from((value as u16).swap_bytes())];
        let range = |least: u16, most: u16| f64::from((most - least).max(1));
        let ranges = (self.deep > 0).then(|| {
            let [least, most] = [0.01, 0.99].map(|share| quantile(share, exchanged));
            [
                range(self.quantile(0.01), self.quantile(0.99)),
                range(least, most),
            ]
        })?;
        let pixels: u64 = self.counts.iter().sum();
        let mean = |sum: u64, range: f64| sum as f64 / pixels.max(1) as f64 / range;
        let both = |[read, other]: [u64; 2]| [mean(read, ranges[0]), mean(other, ranges[1])];
        Some(self.steps.map(both))
    }
}

/// Nearest rank of values with those counts.
fn quantile(share: f64, count: impl Fn(usize) -> u64) -> u16 {
    let all: u64 = (0..1 << 16).map(&count).sum();
    let rank = ((share * all as f64).ceil() as u64).max(1);
    let mut below = 0;
    let reaches = |value: &usize| {
        below += count(*value);
        below >= rank
    };
    (0..1 << 16).find(reaches).unwrap_or_default() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(value: impl Fn(usize, usize) -> u16) -> DecodedImage {
        DecodedImage::Gray16(Plane::from_fn(60, 40, value).unwrap())
    }

    fn doubts(left: DecodedImage, right: DecodedImage) -> Vec<String> {
        let levels = GreyLevels::from_pairs([[left, right]]);
        levels.doubts().iter().map(Doubt::to_string).collect()
    }

    /// A scene of 12 bits.
    fn scene(x: usize, y: usize) -> u16 {
        (x * 37 + y * 41) as u16
    }

    #[test]
    fn quantiles_are_those_of_both_cameras() {
        let levels = GreyLevels::from_pairs([[image(scene), image(|x, y| 2 * scene(x, y))]]);
        let Quantiles { q01, q99, q999 } = levels.quantiles().unwrap();
        assert!(q01 < 300 && (6000..2 * 3782).contains(&q99) && q99 <= q999);
        let narrow = DecodedImage::Gray(Plane::filled(60, 40, 9).unwrap());
        assert_eq!(
            GreyLevels::from_pairs([[narrow.clone(), narrow]]).quantiles(),
            None
        );
    }

    #[test]
    fn values_that_cannot_be_right_are_named() {
        let sound = || image(scene);
        assert_eq!(doubts(sound(), image(|x, y| scene(x, y) * 4 / 3)), [""; 0]);
        let few = |x: usize, y: usize| 7000 + scene(x, y) % 20;
        let few = doubts(image(few), image(few));
        assert!(few[0].contains("7000 to 7019"), "{few:?}");
        let swapped = |x, y| scene(x, y).swap_bytes();
        let swapped = doubts(image(swapped), image(swapped));
        assert!(
            swapped.iter().any(|words| words.contains("look exchanged")),
            "{swapped:?}"
        );
        // Stripes and chequers of one pixel are no order of bytes.
        let slope = |x: usize, y: usize| (4 * x + y / 4) as u16;
        for is_odd in [|x, _| x % 2, |x, y| (x + y) % 2, |_, y| y % 2] {
            let is_odd: fn(usize, usize) -> usize = is_odd;
            let stripes = |x, y| 256 + 3584 * is_odd(x, y) as u16 + slope(x, y);
            assert_eq!(doubts(image(stripes), image(stripes)), [""; 0]);
        }
        let brighter = doubts(sound(), image(|x, y| 4 * scene(x, y)));
        assert!(brighter[0].contains("left and right"), "{brighter:?}");
        let eight = DecodedImage::Gray(Plane::from_fn(60, 40, |x, _| x as u8).unwrap());
        let mixed = doubts(eight, sound());
        assert!(mixed[0].contains("8 bits"), "{mixed:?}");
    }
}
