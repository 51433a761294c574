//! OpenCV 1.0's `CV_DISPARITY_BIRCHFIELD`, the thesis's first attempt (section 5.2 and appendix A):
//! dynamic programming along each row, then reliable disparities are propagated along columns and
//! rows.
//!
//! The thesis abandoned it: it minimises a global error by local assumptions, finds no gap between
//! obstacles, and is wrong throughout in the dark and on uniform texture. It gives a disparity for
//! every pixel. Here it is the baseline, and equals OpenCV's own code on every pixel.
//!
//! Departures of OpenCV from Birchfield and Tomasi: the dissimilarity is one-sided, left pixels
//! against the right image's half-pixel means but not the reverse; an occlusion costs per pixel
//! rather than once; the whole table is searched, while the paper prunes it; and the ends of a row
//! are free, its first three columns for a disparity to rise, its last three for it to fall, its
//! last column at no cost.
//!
//! OpenCV's public documentation names its parameters 3 and 5 the wrong way round, "highly" and
//! "slightly reliable". In the code, and here, parameter 3 (12) is the run length at which a
//! *slightly* reliable disparity withstands a larger one, and parameter 5 (25) that at which a
//! disparity is *highly* reliable and is propagated even over one that is larger by one.

use super::method::{Method, matcher};
use super::stage::{
    Blocks, PathCosts, Propagation, PropagationPixel, Scanlines, both, bridge, each_band, each_row,
};
use super::{MatchOutput, MatcherKind, MatcherSpec, Parameter, Parameters, Range};
use crate::error::Result;
use crate::kernel::{Isa, edge, edge_before};
use crate::stereo::{DisparityMap, ExtraPlanes, Gray, StereoPair, buffer};
use crate::timing::Stage;

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "dp",
    kind: MatcherKind::Images,
    aliases: &[],
    summary: "dynamic programming along rows: dense and often wrong; the first matcher of the \
              2007 thesis",
    about: "",
    paper: "Birchfield and Tomasi, Depth Discontinuities by Pixel-to-Pixel Stereo, ICCV 1998; \
            OpenCV 1.0, cvaux",
    parameters: &[
        Parameter {
            name: "max_disparity",
            unit: "px",
            range: Range::int(80, 0..=255),
            description: "highest disparity tried, from 0 on: the nearest obstacle that can be \
                          seen",
        },
        Parameter {
            name: "occlusion",
            unit: "",
            range: Range::int(25, 0..=1000),
            description: "cost of a change of disparity by one pixel, in grey levels (OpenCV's \
                          parameter 1)",
        },
        Parameter {
            name: "reward",
            unit: "",
            range: Range::int(5, 0..=1000),
            description: "reward of a pixel that keeps its disparity, in grey levels (OpenCV's \
                          parameter 2)",
        },
        run(
            "slightly_reliable",
            12,
            "run that a larger disparity does not overwrite (OpenCV's parameter 3)",
        ),
        run(
            "moderately_reliable",
            15,
            "run whose disparity is propagated (OpenCV's parameter 4)",
        ),
        run(
            "highly_reliable",
            25,
            "run whose disparity is propagated over one larger by one (OpenCV's parameter 5)",
        ),
    ],
    cells: None,
    build: |parameters, isa| Ok(matcher(Dp::new(parameters, isa))),
};

const fn run(name: &'static str, default: i32, description: &'static str) -> Parameter {
    Parameter {
        name,
        unit: "px",
        range: Range::int(default, 0..=16_384),
        description,
    }
}

struct Dp {
    isa: Isa,
    max_disparity: u8,
    costs: PathCosts,
    propagation: Propagation,
}

/// Memory for pairs of one size.
struct Scratch {
    size: (usize, usize),
    left: Blocks,
    right: Blocks,
    band_rows: usize,
    /// One per band, as `rows`.
    scanlines: Vec<Scanlines>,
    rows: Vec<Vec<PropagationPixel>>,
    columns: Vec<PropagationPixel>,
    column_band: usize,
    /// Per band of columns, edges up and down in one column and in both adjacent ones.
    steep: Vec<[Vec<bool>; 3]>,
}

impl Dp {
    fn new(parameters: &Parameters, isa: Isa) -> Self {
        let reliability = |name| parameters.int(name) as u16;
        Self {
            isa,
            max_disparity: parameters.int("max_disparity") as u8,
            costs: PathCosts {
                occlusion: parameters.int("occlusion"),
                reward: parameters.int("reward"),
            },
            propagation: Propagation {
                slightly_reliable: reliability("slightly_reliable"),
                moderately_reliable: reliability("moderately_reliable"),
                highly_reliable: reliability("highly_reliable"),
            },
        }
    }
}

impl Scratch {
    fn new((width, height): (usize, usize), max_disparity: u8, costs: PathCosts) -> Result<Self> {
        let (bands, band_rows) = Blocks::bands(height);
        let rows = band_rows.min(height);
        // Disparities propagate differently far in each column: more bands than threads.
        let column_band = match rayon::current_num_threads() {
            1 => width,
            threads => width.div_ceil(4 * threads),
        };
        Ok(Self {
            size: (width, height),
            left: Blocks::new(width, height)?,
            right: Blocks::new(width, height)?,
            band_rows,
            scanlines: (0..bands)
                .map(|_| Scanlines::new(width, rows, max_disparity, costs))
                .collect::<Result<_>>()?,
            rows: (0..bands)
                .map(|_| buffer(PropagationPixel::default(), width))
                .collect::<Result<_>>()?,
            columns: buffer(PropagationPixel::default(), width * height)?,
            column_band,
            steep: (0..width.div_ceil(column_band))
                .map(|_| [(); 3].map(|()| vec![false; height]))
                .collect(),
        })
    }

    fn match_rows(&mut self, isa: Isa, pair: &StereoPair) {
        both(
            || self.left.load(isa, pair.left()),
            || self.right.load(isa, pair.right()),
        );
        each_row(&mut self.scanlines, 1, 1, |band, scanlines| {
            let top = band * self.band_rows;
            let rows = top..(top + self.band_rows).min(self.size.1);
            scanlines[0].search(isa, &self.left, &self.right, rows);
        });
    }

    fn refine_columns(&mut self, propagation: Propagation) {
        let ((width, height), left) = (self.size, &self.left);
        each_band(
            &mut self.columns,
            self.column_band * height,
            &mut self.steep,
            |band, columns, [before, here, after]| {
                let first = band * self.column_band;
                mark_steep(left.column(first.saturating_sub(1)), here);
                mark_steep(left.column(first), after);
                for (x, column) in (first..).zip(columns.chunks_exact_mut(height)) {
                    // The marks of three columns are rotated, so that each column is marked once.
                    std::mem::swap(before, here);
                    std::mem::swap(here, after);
                    mark_steep(left.column((x + 1).min(width - 1)), after);
                    // An edge counts if it continues to both sides, as far as there are columns.
                    let inner = x > 0 && x + 1 < width;
                    let disparities = self.scanlines.iter().flat_map(|band| band.column(x));
                    for ((y, pixel), disparity) in column.iter_mut().enumerate().zip(disparities) {
                        *pixel = PropagationPixel {
                            disparity,
                            edge: here[y] & (!inner | (before[y] & after[y])),
                            run: 0,
                        };
                    }
                    bridge(column);
                    propagation.apply(column);
                }
            },
        );
    }

    fn refine_rows(&mut self, propagation: Propagation, image: &Gray, map: &mut DisparityMap) {
        let (width, height) = self.size;
        map.each_row_mut(self.band_rows, &mut self.rows, |y, row, line| {
            let grey = image.row(y);
            for (x, pixel) in line.iter_mut().enumerate() {
                let [edge] = edge_before(x, width, |x| [u16::from(grey[x])]);
                *pixel = PropagationPixel {
                    // The result of the columns, which are contiguous, transposed.
                    disparity: self.columns[x * height + y].disparity,
                    edge,
                    run: 0,
                };
            }
            propagation.apply(line);
            for (x, pixel) in line.iter().enumerate() {
                row.accept(x, f32::from(pixel.disparity));
            }
        });
    }
}

impl Method for Dp {
    type Scratch = Scratch;
    const PLANES: ExtraPlanes = ExtraPlanes::NONE;

    fn scratch(&self, size: (usize, usize)) -> Result<Scratch> {
        Scratch::new(size, self.max_disparity, self.costs)
    }

    fn compute(&self, scratch: &mut Scratch, pair: &StereoPair, output: &mut MatchOutput) {
        let (map, clock) = (&mut output.disparity, &mut output.clock);
        scratch.match_rows(self.isa, pair);
        clock.lap(Stage::Matching);
        scratch.refine_columns(self.propagation);
        scratch.refine_rows(self.propagation, pair.left(), map);
        clock.lap(Stage::Checks);
    }
}

/// Marks the three pixels of every window of a column that contains an edge. The window directly
/// below a marked one is skipped.
fn mark_steep(column: impl Iterator<Item = u16>, steep: &mut [bool]) {
    steep.fill(false);
    let (mut window, mut marked) = ([0; 3], false);
    for (y, pixel) in column.take(steep.len()).enumerate() {
        window = [window[1], window[2], pixel];
        // OpenCV advances by two after a window that contains an edge.
        marked = y >= 2 && !marked && edge(window.map(|v| [v])) == [true];
        if marked {
            steep[y - 2..=y].fill(true);
        }
    }
}
