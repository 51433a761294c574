//! Matching of whole rows by dynamic programming (Birchfield and Tomasi, *Depth Discontinuities by
//! Pixel-to-Pixel Stereo*, 1998).

use super::Blocks;
use crate::error::Result;
use crate::kernel::{Isa, Lanes, ScanlinePaths, find_paths};
use crate::stereo::buffer;

/// Costs and rewards of a path through the pixels of a row besides its dissimilarities, in grey
/// levels.
#[derive(Clone, Copy, Debug)]
pub struct PathCosts {
    /// Cost per pixel of disparity change.
    pub occlusion: i32,
    /// Reward per pixel that keeps its disparity.
    pub reward: i32,
}

/// Matches the rows of a band of an image. It holds one thread's scratch and the band's
/// disparities.
pub struct Scanlines {
    costs: PathCosts,
    width: usize,
    paths: ScanlinePaths,
    /// Block by block, column by column.
    found: Vec<Lanes<u8>>,
}

impl Scanlines {
    /// For a band of `rows` rows of `width` pixels.
    pub fn new(width: usize, rows: usize, max_disparity: u8, costs: PathCosts) -> Result<Self> {
        Ok(Self {
            costs,
            width,
            paths: ScanlinePaths::new(width, max_disparity)?,
            found: buffer(Lanes::splat(0), width * rows.div_ceil(Blocks::ROWS))?,
        })
    }

    /// Matches the band's rows, `rows` of the image.
    pub fn search(
        &mut self,
        isa: Isa,
        left: &Blocks,
        right: &Blocks,
        rows: std::ops::Range<usize>,
    ) {
        for y in rows.clone().step_by(ScanlinePaths::ROWS) {
            let (block, first) = ((y - rows.start) / Blocks::ROWS, y % Blocks::ROWS);
            let PathCosts { occlusion, reward } = self.costs;
            find_paths(
                isa,
                left.around(y),
                right.around(y),
                first,
                occlusion,
                reward,
                &mut self.paths,
            );
            let found = &mut self.found[block * self.width..][..self.width];
            for lane in 0..ScanlinePaths::ROWS.min(rows.end - y) {
                // Block rows are lanes: a column of disparities is read as one later.
                self.paths.trace(lane, |x, d| found[x].0[first + lane] = d);
            }
        }
    }

    /// The disparities of column `x`, top to bottom, and after them those of rows below the image.
    pub fn column(&self, x: usize) -> impl Iterator<Item = u8> {
        self.found[x..]
            .iter()
            .step_by(self.width)
            .flat_map(|lanes| lanes.0)
    }
}
