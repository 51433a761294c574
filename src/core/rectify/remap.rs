//! Bilinear remapping of images through tables computed once.

use crate::doubt::check_size;
use crate::error::{Error, Result};
use crate::kernel::{Isa, remap_row};
use crate::stereo::{Gray, MAX_SIDE, reserve};
use nalgebra::Point2;
use std::ops::Range;

/// The source position of each pixel, in 1/256 of a pixel. Bilinear interpolation is in integers,
/// so the bytes are the same on every instruction set and any number of threads.
///
/// Pixels from outside the source (more than half a pixel beyond the centres of its outermost
/// pixels) are 0. Black has no texture, so texture checks reject it; replicated border pixels would
/// have texture, and be matched.
#[derive(Clone, Debug)]
pub struct Remap {
    source: (usize, usize),
    size: (usize, usize),
    /// Per pixel: index of the upper left of the four source pixels.
    places: Vec<u32>,
    /// Per pixel: offset from it to the right and below, in 1/256 pixel.
    right: Vec<u8>,
    below: Vec<u8>,
    /// Runs of pixels from outside the source: row, columns.
    outside: Vec<(usize, Range<usize>)>,
}

impl Remap {
    /// The table for images of `size`, whose pixel `(x, y)` comes from `from(x, y)` in an image of
    /// size `source`, or from outside (`None`).
    ///
    /// # Errors
    /// [`Error::Invalid`] for a source of less than 2x2 pixels; [`Error::Dimensions`] for invalid
    /// image sizes.
    pub fn new(
        source: (usize, usize),
        size: (usize, usize),
        from: impl Fn(Point2<f64>) -> Option<Point2<f64>>,
    ) -> Result<Self> {
        let (width, height) = source;
        if width < 2 || height < 2 {
            return Err(Error::Invalid(format!(
                "an image of {width}x{height} pixels is too small to interpolate in"
            )));
        }
        for (width, height) in [source, size] {
            if width.max(height) > MAX_SIDE {
                return Err(Error::Dimensions {
                    width,
                    height,
                    max: MAX_SIDE,
                });
            }
        }
        let pixels = size.0 * size.1;
        let mut remap = Self {
            source,
            size,
            places: reserve(pixels)?,
            right: reserve(pixels)?,
            below: reserve(pixels)?,
            outside: Vec::new(),
        };
        for y in 0..size.1 {
            for x in 0..size.0 {
                let at = from(Point2::new(x as f64, y as f64));
                let inside =
                    at.and_then(|at| Some((between(at.x, width)?, between(at.y, height)?)));
                let ((column, right), (row, below)) = inside.unwrap_or_default();
                remap.places.push((row * width + column) as u32);
                remap.right.push(right);
                remap.below.push(below);
                if inside.is_none() {
                    match remap.outside.last_mut() {
                        Some((row, run)) if *row == y && run.end == x => run.end = x + 1,
                        _ => remap.outside.push((y, x..x + 1)),
                    }
                }
            }
        }
        Ok(remap)
    }

    /// Width and height of the source images.
    pub fn source(&self) -> (usize, usize) {
        self.source
    }

    /// Width and height of the remapped images.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Number of pixels from outside the source.
    pub fn outside(&self) -> usize {
        self.outside.iter().map(|(_, run)| run.len()).sum()
    }

    /// Writes the rows `rows` of the remapped image into `out`, contiguously. `image`: the source's
    /// pixels, contiguous.
    pub(super) fn rows(&self, isa: Isa, image: &[u8], rows: Range<usize>, out: &mut [u8]) {
        let width = self.size.0;
        let pixels = rows.start * width..rows.end * width;
        let parts = [&self.right[pixels.clone()], &self.below[pixels.clone()]];
        remap_row(isa, image, self.source.0, &self.places[pixels], parts, out);
        // The kernel reads some source pixel for every output, also for those from outside; blacken
        // these afterwards, which keeps branches out of the kernel.
        let first = self.outside.partition_point(|(row, _)| *row < rows.start);
        for (row, run) in self.outside[first..]
            .iter()
            .take_while(|(row, _)| *row < rows.end)
        {
            out[(row - rows.start) * width..][run.clone()].fill(0);
        }
    }

    /// The remapped image.
    ///
    /// # Errors
    /// [`Error::Invalid`] for an image of another size than the table's source.
    pub fn apply(&self, isa: Isa, image: &Gray) -> Result<Gray> {
        self.check(image)?;
        let mut out = Gray::filled(self.size.0, self.size.1, 0)?;
        let gapless = |image: &Gray| image.pixels().collect::<Vec<_>>();
        // `Gray::filled` makes contiguous rows.
        self.rows(
            isa,
            &gapless(image),
            0..self.size.1,
            out.as_mut_slice().expect("gapless"),
        );
        Ok(out)
    }

    pub(super) fn check(&self, image: &Gray) -> Result<()> {
        check_size(self.source, image.size())
    }
}

/// The last of `count` pixels in a row or column at or before `at`, and the offset from it in 1/256
/// pixel; `None` outside.
fn between(at: f64, count: usize) -> Option<(usize, u8)> {
    if !(-0.5..count as f64 - 0.5).contains(&at) {
        return None;
    }
    // Interpolation needs a next pixel, so the last one is reached up to 1/256 from the one before.
    let parts = ((at * 256.0).round().max(0.0) as usize).min((count - 1) * 256 - 1);
    Some((parts / 256, (parts % 256) as u8))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Value of a pixel by the definition, written as plainly as possible.
    fn oracle(image: &Gray, at: Point2<f64>) -> u8 {
        let (width, height) = image.size();
        if !(-0.5..width as f64 - 0.5).contains(&at.x)
            || !(-0.5..height as f64 - 0.5).contains(&at.y)
        {
            return 0;
        }
        let x = ((at.x * 256.0).round() as i64).clamp(0, (width as i64 - 1) * 256 - 1);
        let y = ((at.y * 256.0).round() as i64).clamp(0, (height as i64 - 1) * 256 - 1);
        let mut sum = 1 << 15;
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight = |part: i64, far: i64| {
                if far == 1 {
                    part % 256
                } else {
                    256 - part % 256
                }
            };
            let pixel = image.get((x / 256 + dx) as usize, (y / 256 + dy) as usize);
            sum += weight(x, dx) * weight(y, dy) * i64::from(pixel);
        }
        (sum >> 16) as u8
    }

    proptest! {
        #[test]
        fn every_instruction_set_makes_the_oracles_bytes(
            source in (2usize..80, 2usize..40),
            size in (1usize..150, 1usize..20),
            matrix in prop::array::uniform4(-1.5f64..1.5),
            shift in (-20.0f64..60.0, -20.0f64..40.0),
            seed: u64,
        ) {
            let mixed = |i: u64| (i ^ seed).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56;
            let noise = |x: usize, y: usize| mixed((y * 997 + x) as u64) as u8;
            let image = Gray::from_fn(source.0, source.1, noise).unwrap();
            let [a, b, c, d] = matrix;
            let from = |p: Point2<f64>| {
                Point2::new(a * p.x + b * p.y + shift.0, c * p.x + d * p.y + shift.1)
            };
            let remap = Remap::new(source, size, |p| Some(from(p))).unwrap();
            let pixel = |x, y| oracle(&image, from(Point2::new(x as f64, y as f64)));
            let expected = Gray::from_fn(size.0, size.1, pixel).unwrap();
            for isa in Isa::available() {
                prop_assert_eq!(&remap.apply(isa, &image).unwrap(), &expected, "{}", isa);
            }
        }
    }

    #[test]
    fn the_identity_changes_nothing() {
        let image = Gray::from_fn(100, 40, |x, y| (x * 7 + y * 13) as u8).unwrap();
        let shifted = Remap::new((100, 40), (98, 38), |p| {
            Some(p + nalgebra::Vector2::new(1.0, 1.0))
        })
        .unwrap();
        let seen = shifted.apply(Isa::BASELINE, &image).unwrap();
        assert!((0..38).all(|y| seen.row(y)[..97] == image.row(y + 1)[1..98]));
        assert_eq!(shifted.outside(), 0);
    }

    #[test]
    fn pixels_from_outside_are_black_and_wrong_sizes_refused() {
        assert!(Remap::new((1, 40), (10, 10), Some).is_err());
        assert!(
            Remap::new((20, 10), (1 << 40, 10), Some).is_err()
                && Remap::new((1 << 40, 2), (10, 10), Some).is_err()
        );
        let nowhere = Remap::new((20, 10), (5, 4), |p| (p.x != 2.0).then_some(p)).unwrap();
        assert_eq!(nowhere.outside(), 4);
        let seen = nowhere
            .apply(Isa::BASELINE, &Gray::filled(20, 10, 9).unwrap())
            .unwrap();
        assert_eq!(seen.row(3), [9, 9, 0, 9, 9]);
        let error = nowhere
            .apply(Isa::BASELINE, &Gray::filled(10, 20, 9).unwrap())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("10x20") && error.contains("20x10"),
            "{error}"
        );
        for at in [f64::NAN, f64::INFINITY, -1e300] {
            assert_eq!(
                Remap::new((20, 10), (1, 1), |_| Some(Point2::new(at, 0.0)))
                    .unwrap()
                    .outside(),
                1
            );
        }
    }
}
