//! Matching costs by the census transform (Zabih & Woodfill 1994): which of a pixel's 62 neighbours in 9 x 7 are darker.
//! It is indifferent to gain and offset of the cameras. At the edges of the image the nearest pixels stand for what is
//! outside.

use super::each_row;
use crate::kernel::{CENSUS_BYTES, CENSUS_REACH, Costs, DISPARITIES, Isa, census_costs, census_row};
use crate::stereo::Gray;
use std::ops;

/// The cost of every disparity of every pixel.
pub struct CostVolume {
    size: (usize, usize),
    first: i32,
    chunks: usize,
    left: Census,
    right: Census,
    outside: Vec<u8>,
    tail: Vec<Costs>,
    costs: Vec<Costs>,
}

/// The censuses of an image, mirrored.
struct Census {
    /// Pixels left out at the beginning of each mirrored row, and the place of the first that is not.
    skip: usize,
    place: usize,
    /// Pixels kept per row, and places there are.
    count: usize,
    stride: usize,
    /// The mirrored image with as many pixels around it as the census needs at the sides.
    mirrored: Vec<u8>,
    bytes: Vec<u8>,
}

impl CostVolume {
    /// For images of that size. Some disparity of `range` leads into the image.
    pub fn new((width, height): (usize, usize), range: ops::RangeInclusive<i32>) -> Self {
        let count = (range.end() - range.start() + 1) as usize;
        let chunks = count.div_ceil(DISPARITIES);
        let stride = width + chunks * DISPARITIES;
        let (skip, place) = ((*range.start()).max(0) as usize, (-range.start()).max(0) as usize);
        let right = Census::new((width, height), skip, place, stride);
        let mut outside = vec![Costs::OUTSIDE; stride];
        outside[place..][..right.count].fill(0);
        let mut tail = vec![Costs([0; DISPARITIES]); chunks];
        tail[chunks - 1].0[count - (chunks - 1) * DISPARITIES..].fill(Costs::OUTSIDE);
        Self {
            size: (width, height),
            first: *range.start(),
            chunks,
            left: Census::new((width, height), 0, 0, width),
            right,
            outside,
            tail,
            costs: vec![Costs([0; DISPARITIES]); width * height * chunks],
        }
    }

    /// Bytes per pixel and disparity, of this and of the sums over paths.
    pub const BYTES: usize = 3;

    /// Takes the costs of a pair.
    pub fn load(&mut self, isa: Isa, left: &Gray, right: &Gray) {
        self.left.load(isa, left);
        self.right.load(isa, right);
        let Self { size, first, chunks, left, right, outside, tail, costs } = self;
        each_row(costs, size.0 * *chunks, 4, |y, row| {
            census_costs(isa, left.row(y), right.row(y), outside, *first, tail, row)
        });
    }

    /// The costs of row `y`, [`CostVolume::chunks`] per pixel.
    pub fn row(&self, y: usize) -> &[Costs] {
        let stride = self.size.0 * self.chunks;
        &self.costs[y * stride..][..stride]
    }

    /// [`Costs`] per pixel.
    pub fn chunks(&self) -> usize {
        self.chunks
    }

    /// The first disparity of the first [`Costs`].
    pub fn first(&self) -> i32 {
        self.first
    }

    pub fn size(&self) -> (usize, usize) {
        self.size
    }
}

impl Census {
    fn new((width, height): (usize, usize), skip: usize, place: usize, stride: usize) -> Self {
        let count = width.saturating_sub(skip).min(stride.saturating_sub(place));
        let [reach, _] = CENSUS_REACH;
        Self {
            skip,
            place,
            count,
            stride,
            mirrored: vec![0; (width + 2 * reach) * height],
            bytes: vec![0; stride * CENSUS_BYTES * height],
        }
    }

    fn load(&mut self, isa: Isa, image: &Gray) {
        let ([reach_x, reach_y], (width, height)) = (CENSUS_REACH, image.size());
        let Self { skip, place, count, stride, mirrored, bytes } = self;
        let padded = width + 2 * reach_x;
        each_row(mirrored, padded, 16, |y, out| {
            let row = image.row(y);
            out[..reach_x].fill(row[width - 1]);
            out[reach_x..][..width].iter_mut().zip(row.iter().rev()).for_each(|(out, &pixel)| *out = pixel);
            out[reach_x + width..].fill(row[0]);
        });
        each_row(bytes, *stride * CENSUS_BYTES, 4, |y, out| {
            let rows = std::array::from_fn(|k| {
                let y = (y + k).saturating_sub(reach_y).min(height - 1);
                &mirrored[y * padded + *skip..][..*count + 2 * reach_x]
            });
            census_row(isa, rows, *stride, &mut out[*place..]);
        });
    }

    /// Of row `y`, plane after plane.
    fn row(&self, y: usize) -> &[u8] {
        &self.bytes[y * self.stride * CENSUS_BYTES..][..self.stride * CENSUS_BYTES]
    }
}
