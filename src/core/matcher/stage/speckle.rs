//! Speckle filter: small regions whose disparity differs from their surroundings are outliers
//! (Hirschmüller 2008, section 2.5.1).

use crate::matcher::{Parameter, Range};
use crate::stereo::{DisparityMap, Reason};

/// Removes small regions of a map, with its scratch.
pub struct Speckles {
    size: u32,
    range_px: f32,
    /// The region of each pixel: a pixel of it, or itself.
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
    pub fn new(pixels: usize, size: i32, range_px: f64) -> Option<Self> {
        let scratch = || vec![0; pixels];
        (size > 0).then(|| Self {
            size: size as u32,
            range_px: range_px as f32,
            parents: scratch(),
            sizes: scratch(),
        })
    }

    /// Rejects the valid pixels of regions that are too small.
    pub fn remove(&mut self, map: &mut DisparityMap) {
        let width = map.size().0;
        self.join(map);
        for (y, mut row) in map.rows_mut().enumerate() {
            for x in 0..width {
                let root = self.root((y * width + x) as u32);
                if row.at(x).is_ok() && self.sizes[root as usize] <= self.size {
                    row.reject(x, Reason::Inconsistent);
                }
            }
        }
    }

    /// Joins neighbours of nearly equal disparity.
    fn join(&mut self, map: &DisparityMap) {
        let width = map.size().0;
        self.sizes.fill(1);
        for (y, row) in map.disparity().rows().enumerate() {
            let above = map.disparity().row(y.saturating_sub(1));
            for x in 0..width {
                let pixel = (y * width + x) as u32;
                self.parents[pixel as usize] = pixel;
                // For an invalid pixel the difference is infinite or NaN.
                if x > 0 && (row[x] - row[x - 1]).abs() <= self.range_px {
                    self.unite(pixel, pixel - 1);
                }
                if y > 0 && (row[x] - above[x]).abs() <= self.range_px {
                    self.unite(pixel, pixel - width as u32);
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

    /// The root of a pixel's region; halves the path for later look-ups.
    fn root(&mut self, mut pixel: u32) -> u32 {
        while self.parents[pixel as usize] != pixel {
            let parent = self.parents[pixel as usize];
            // Path halving (van Leeuwen and Tarjan): nearly linear without a second pass.
            self.parents[pixel as usize] = self.parents[parent as usize];
            pixel = parent;
        }
        pixel
    }
}
