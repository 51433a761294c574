//! Speckle filter: small regions whose disparity differs from their surroundings are outliers
//! (Hirschmüller 2008, section 2.5.1).

use crate::error::Result;
use crate::matcher::{Parameter, Range};
use crate::stereo::{DisparityMap, Reason, buffer};

/// Removes small regions of a map, with its scratch.
///
/// A region consists of runs: neighbours in a row. Regions are found by joining runs, of which
/// there are far fewer than pixels.
pub struct Speckles {
    size: u32,
    range_px: f32,
    /// The run of each pixel.
    runs: Vec<u32>,
    /// The first pixel of each run.
    starts: Vec<u32>,
    /// The region of each run: a run of it, or itself.
    parents: Vec<u32>,
    /// Pixels of the region, at its root.
    sizes: Vec<u32>,
}

impl Speckles {
    /// Largest region removed, as a parameter of the matchers.
    pub const fn size(default: i32) -> Parameter {
        Parameter {
            name: "speckle_size",
            unit: "pixels",
            range: Range::int(default, 0..=100_000),
            description: "largest island of disparity that is removed, 0 = none",
        }
    }

    /// Largest step within a region, as a parameter of the matchers.
    pub const RANGE: Parameter = Parameter {
        name: "speckle_range",
        unit: "px",
        range: Range::real(1.0, 0.0..=1024.0),
        description: "largest step of disparity between neighbours of one island",
    };

    /// For maps of that many pixels; `None` if `size` is 0.
    pub fn new(pixels: usize, size: i32, range_px: f64) -> Result<Option<Self>> {
        if size <= 0 {
            return Ok(None);
        }
        let scratch = || buffer(0, pixels);
        Ok(Some(Self {
            size: size as u32,
            range_px: range_px as f32,
            runs: scratch()?,
            starts: scratch()?,
            parents: scratch()?,
            sizes: scratch()?,
        }))
    }

    /// Rejects the valid pixels of regions that are too small.
    pub fn remove(&mut self, map: &mut DisparityMap) {
        let width = map.size().0;
        let count = self.join(map);
        let mut run = 0;
        for (y, mut row) in map.rows_mut().enumerate() {
            let end = (y + 1) * width;
            while run < count && (self.starts[run] as usize) < end {
                let next = self.starts[..count].get(run + 1);
                let next = next.map_or(end, |&next| end.min(next as usize));
                let root = self.root(run as u32);
                if self.sizes[root as usize] <= self.size {
                    for x in self.starts[run] as usize - y * width..next - y * width {
                        if row.at(x).is_ok() {
                            row.reject(x, Reason::Inconsistent);
                        }
                    }
                }
                run += 1;
            }
        }
    }

    /// Joins neighbours of nearly equal disparity, and returns the number of runs.
    fn join(&mut self, map: &DisparityMap) -> usize {
        let (width, range_px) = (map.size().0, self.range_px);
        // For an invalid pixel the difference is infinite or NaN.
        let joined = |a: f32, b: f32| (a - b).abs() <= range_px;
        let mut count = 0;
        for (y, row) in map.disparity().rows().enumerate() {
            let first = count;
            let runs = &mut self.runs[y * width..][..width];
            let mut before = f32::NAN;
            for (x, (&disparity, run)) in row.iter().zip(runs).enumerate() {
                // Without a branch: in a noisy map none is predicted.
                self.starts[count] = (y * width + x) as u32;
                count += usize::from(!joined(disparity, before));
                *run = count as u32 - 1;
                before = disparity;
            }
            for run in first..count {
                let next = self.starts[..count].get(run + 1);
                let end = next.map_or((y + 1) * width, |&next| next as usize);
                self.parents[run] = run as u32;
                self.sizes[run] = end as u32 - self.starts[run];
            }
            if y > 0 {
                self.join_rows(map.disparity().row(y - 1), row, y * width);
            }
        }
        count
    }

    /// Joins the runs of a row, the pixels from `start` on, with those of the row above.
    fn join_rows(&mut self, above: &[f32], row: &[f32], start: usize) {
        let range_px = self.range_px;
        let width = row.len();
        let mut last = [u32::MAX; 2];
        for x in 0..width {
            if (row[x] - above[x]).abs() <= range_px {
                let pair = [self.runs[start + x], self.runs[start + x - width]];
                if pair != last {
                    self.unite(pair[0], pair[1]);
                    last = pair;
                }
            }
        }
    }

    fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            // The smaller index is the root, so that regions do not depend on the order of unions.
            let (root, child) = (a.min(b), a.max(b));
            self.parents[child as usize] = root;
            self.sizes[root as usize] += self.sizes[child as usize];
        }
    }

    /// The root of a run's region; halves the path for later look-ups.
    fn root(&mut self, mut run: u32) -> u32 {
        while self.parents[run as usize] != run {
            let parent = self.parents[run as usize];
            // Path halving (van Leeuwen and Tarjan): nearly linear without a second pass.
            self.parents[run as usize] = self.parents[parent as usize];
            run = parent;
        }
        run
    }
}
