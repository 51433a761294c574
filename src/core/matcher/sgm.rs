//! Semi-global matching of censuses.
//!
//! Hirschmüller, "Stereo Processing by Semiglobal Matching and Mutual Information", PAMI 2008, with
//! the census of Zabih & Woodfill, "Non-parametric Local Transforms for Computing Visual
//! Correspondence", ECCV 1994, instead of mutual information: eight paths, a penalty P1 for steps
//! of one disparity and P2, less at edges, for others; then the median of three by three,
//! uniqueness, the left/right check and the speckle filter.
//!
//! Departures from Hirschmüller: the right image's disparities use the same sums (his section
//! 2.3 allows it); P2 falls with the gradient only where that exceeds a threshold; the fraction of
//! a pixel is the equiangular one, which suits Hamming distances, in 16ths; nothing is
//! interpolated; speckles are *inconsistent*. Left pixels near the edge try the disparities that
//! stay inside the right image.

use super::method::{Method, matcher};
use super::parameter::at_scale;
use super::stage::{
    Aggregation, Chosen, CostVolume, DisparityRange, OnePassCheck, Speckles, uniqueness,
};
use super::{MatchOutput, MatcherKind, MatcherSpec, Parameter, Parameters, Range};
use crate::error::{Error, Result};
use crate::kernel::{ChosenRow, Isa, PathBlock, Penalties, VolumeShape, median_row};
use crate::stereo::{ExtraPlanes, Reason, RowMut, StereoPair};
use crate::timing::Stage;

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "sgm",
    kind: MatcherKind::Images,
    aliases: &[],
    summary: "semi-global matching of census transforms along eight paths: dense, exact, slow",
    about: "",
    paper: "Hirschmüller, Stereo Processing by Semiglobal Matching and Mutual Information, PAMI \
            30(2), 2008",
    parameters: &[
        DisparityRange::MIN,
        DisparityRange::MAX,
        Parameter {
            name: "p1",
            unit: "",
            range: Range::int(14, 0..=PathBlock::LARGEST_PENALTY),
            description: "cost of a step of disparity by one, in bits of the census: slopes",
        },
        Parameter {
            name: "p2",
            unit: "",
            range: Range::int(80, 0..=PathBlock::LARGEST_PENALTY),
            description: "cost of any other step, at least p1: edges of objects",
        },
        Parameter {
            name: "edge",
            unit: "grey levels",
            range: Range::int(10, 1..=256),
            description: "difference of neighbours beyond which p2 falls in proportion, 256 = \
                          never",
        },
        uniqueness(5),
        OnePassCheck::tolerance(1),
        Parameter {
            name: "median",
            unit: "",
            range: Range::Flag { default: true },
            description: "take the median of three by three disparities",
        },
        Speckles::size(4),
        Speckles::RANGE,
    ],
    cells: None,
    build: |parameters, isa| Ok(matcher(Sgm::new(parameters, isa)?)),
};

struct Sgm {
    isa: Isa,
    range: DisparityRange,
    penalties: Penalties,
    uniqueness: u32,
    tolerance: i32,
    median: bool,
    speckles: (i32, f64),
}

/// Memory for pairs of one size.
struct Scratch {
    costs: CostVolume,
    aggregation: Aggregation,
    chosen: Chosen,
    band_rows: usize,
    /// A row of medians per band.
    medians: Vec<Vec<i16>>,
    speckles: Option<Speckles>,
}

impl Sgm {
    /// Largest memory for costs and sums of a pair, bytes.
    const MEMORY: usize = 4 << 30;

    fn new(parameters: &Parameters, isa: Isa) -> Result<Self> {
        let [p1, p2, edge] = ["p1", "p2", "edge"].map(|name| parameters.int(name));
        if p2 < p1 {
            return Err(Error::Usage(format!(
                "sgm: p2={p2} is below p1={p1}: a large step costs at least a small one"
            )));
        }
        // P2 is divided by the gradient (Hirschmüller, equation 13), but only from `edge` on, and
        // never falls below P1.
        let large = |difference: i32| p1.max(p2 * edge / edge.max(difference)) as u8;
        Ok(Self {
            isa,
            range: DisparityRange::from_parameters(parameters)?,
            penalties: Penalties {
                small: p1 as u8,
                large: std::array::from_fn(|difference| large(difference as i32)),
            },
            uniqueness: parameters.int("uniqueness") as u32,
            tolerance: parameters.int("symmetry_tolerance"),
            median: parameters.flag("median"),
            speckles: (
                parameters.int("speckle_size"),
                parameters.real("speckle_range"),
            ),
        })
    }

    /// Writes the pixels of row `y` that pass the left-right check: the chosen `disparities`, or
    /// their medians.
    fn write(&self, chosen: &Chosen, y: usize, disparities: &[i16], row: &mut RowMut<'_>) {
        let right = chosen.right(y);
        for (x, (&disparity, &why)) in disparities.iter().zip(chosen.why(y)).enumerate() {
            let consistent = || {
                // Sixteenths, rounded to the nearest pixel of the right image, whose disparities
                // are whole.
                let match_x = x as i32 - (i32::from(disparity) + 8).div_euclid(16);
                let agrees = |&right: &i16| {
                    right != ChosenRow::NONE
                        && (16 * i32::from(right) - i32::from(disparity)).abs()
                            <= 16 * self.tolerance
                };
                self.tolerance < 0
                    || usize::try_from(match_x).is_ok_and(|x| right.get(x).is_some_and(agrees))
            };
            match why {
                Reason::Valid if consistent() => row.accept(x, f32::from(disparity) / 16.0),
                Reason::Valid => row.reject(x, Reason::Inconsistent),
                why => row.reject(x, why),
            }
        }
    }
}

impl Method for Sgm {
    /// `None` if no disparity leads into an image of that size.
    type Scratch = Option<Scratch>;
    const PLANES: ExtraPlanes = ExtraPlanes::NONE;

    fn scratch(&self, (width, height): (usize, usize)) -> Result<Option<Scratch>> {
        // Disparities beyond the width lead outside the image and would only cost memory.
        let farthest = width as i32 - 1;
        let range = self.range.min().max(-farthest)..=self.range.max().min(farthest);
        if range.is_empty() {
            return Ok(None);
        }
        let (first, count) = (*range.start(), range.count());
        let shape = VolumeShape {
            width,
            height,
            first,
            count,
        };
        let bytes = shape.stride() * height * Aggregation::BYTES;
        // Checked here: the allocation itself may succeed, and the machine would swap.
        if bytes > Self::MEMORY {
            // Both sides and the range are scaled; a little less, as all are rounded.
            let most = 0.98 * (Self::MEMORY as f64 / bytes as f64).cbrt();
            return Err(Error::Invalid(format!(
                "sgm: {width}x{height} pixels by {count} disparities take {} MiB, more than {}: \
                 narrow the range; {}",
                bytes >> 20,
                Self::MEMORY >> 20,
                at_scale(most, f64::from(self.range.max()))
            )));
        }
        let costs = CostVolume::new(shape)?;
        // More bands than threads, so that a thread that finishes early finds another.
        let band_rows = height.div_ceil(4 * rayon::current_num_threads());
        Ok(Some(Scratch {
            aggregation: Aggregation::new(shape)?,
            chosen: Chosen::new(shape)?,
            costs,
            band_rows,
            medians: (0..height.div_ceil(band_rows))
                .map(|_| vec![0; width])
                .collect(),
            speckles: Speckles::new(width * height, self.speckles.0, self.speckles.1)?,
        }))
    }

    fn compute(&self, scratch: &mut Option<Scratch>, pair: &StereoPair, output: &mut MatchOutput) {
        let (map, clock) = (&mut output.disparity, &mut output.clock);
        let Some(scratch) = scratch else {
            return map.rows_mut().for_each(|mut row| row.clear(Reason::Border));
        };
        let (isa, last) = (self.isa, pair.size().1 - 1);
        scratch.costs.load(isa, pair.left(), pair.right());
        clock.lap(Stage::Matching);

        scratch.aggregation.choose(
            isa,
            &scratch.costs,
            pair.left(),
            &self.penalties,
            self.uniqueness,
            &mut scratch.chosen,
        );
        clock.lap(Stage::Matching);

        let chosen = &scratch.chosen;
        map.each_row_mut(
            scratch.band_rows,
            &mut scratch.medians,
            |y, row, medians| {
                if self.median {
                    let rows = [y.saturating_sub(1), y, last.min(y + 1)].map(|y| chosen.left(y));
                    median_row(isa, rows, medians);
                    self.write(chosen, y, medians, row);
                } else {
                    self.write(chosen, y, chosen.left(y), row);
                }
            },
        );
        if let Some(speckles) = &mut scratch.speckles {
            speckles.remove(map);
        }
        clock.lap(Stage::Checks);
    }
}
