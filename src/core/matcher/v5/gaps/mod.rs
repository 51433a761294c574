//! Learned gaps: a network weighs a few disparities for each gap and each doubtful pixel, and its
//! weights are the pixel's votes in its cell (docs/v5.md).

mod candidates;
mod lines;

use super::level::MatchLevel;
use crate::error::Result;
use crate::kernel::{GapCandidates, GapNetwork, GapVotes, HYPOTHESES, Isa, weigh_hypotheses};
use crate::stereo::buffer;
use candidates::{Band, GapStep, LANES, Measured, Quality, measure_row};
use lines::{Line, NearestSeen};
use rayon::prelude::*;
use std::ops::Range;

/// Votes of a pixel that keeps its own disparity.
const ALL: u8 = 64;

/// Rows of the lattice that one task weighs.
const BAND: usize = 4;

/// The votes of a pixel of the lattice.
#[derive(Clone, Copy)]
pub(super) struct PixelVotes {
    pub(super) bins: [i16; HYPOTHESES],
    /// Votes of each bin, then of none of them.
    pub(super) votes: [u8; HYPOTHESES + 1],
    /// Votes for bins that agree with the best.
    pub(super) agreed: u8,
}

/// Memory for the gaps of pairs of one size.
pub(super) struct Gaps {
    /// Columns and rows of the half image of which the lattice has one, as powers of two.
    steps: [u32; 2],
    /// Hypotheses this close to a pixel's best agree with it, bins.
    agreeing_bins: u16,
    quality: Vec<Quality>,
    /// The nearest seen pixels of the lattice's, by row and by column.
    along_rows: Vec<NearestSeen>,
    along_columns: Vec<NearestSeen>,
    /// In raster order of the lattice.
    votes: Vec<PixelVotes>,
    bands: Vec<Band>,
    /// Columns of the lattice.
    width: usize,
}

/// Lattice places within a range of half pixels; of a shorter range the one before it.
fn places(range: &Range<usize>, step: u32) -> Range<usize> {
    let last = (range.end - 1) >> step;
    range.start.div_ceil(1 << step).min(last)..last + 1
}

impl Gaps {
    /// For half images of `size`, at least 2 x 2, and a lattice of those steps; hypotheses within
    /// `agreeing_bins` of a pixel's best agree with it.
    pub(super) fn new(size: (usize, usize), steps: [u32; 2], agreeing_bins: u16) -> Result<Self> {
        let width = size.0.div_ceil(1 << steps[0]);
        let height = size.1.div_ceil(1 << steps[1]);
        let none = PixelVotes {
            bins: [0; HYPOTHESES],
            votes: [0; HYPOTHESES + 1],
            agreed: 0,
        };
        let pixels = width * height;
        Ok(Self {
            steps,
            agreeing_bins,
            quality: buffer(Quality::default(), size.0 * size.1)?,
            along_rows: buffer(NearestSeen::default(), pixels)?,
            along_columns: buffer(NearestSeen::default(), pixels)?,
            votes: buffer(none, pixels)?,
            bands: (0..height.div_ceil(BAND))
                .map(|_| Band::new(size.0))
                .collect(),
            width,
        })
    }

    /// Measures the parts of the hypotheses, at half size.
    pub(super) fn measure(&mut self, half: &MatchLevel) {
        let (map, image) = (half.map.pixels(), &half.images[0]);
        let (width, height) = map.size;
        let [across, down] = self.steps;
        let rows = self.quality.par_chunks_exact_mut(width);
        rows.enumerate()
            .for_each(|(y, out)| measure_row(&map, y, out));
        let rows = self.along_rows.par_chunks_exact_mut(self.width);
        rows.enumerate().for_each(|(row, out)| {
            let line = Line {
                first: (row << down) * width,
                step: 1,
                count: width,
            };
            let grey = image.row(row << down);
            line.scan(across, map.bins, map.seen, |x| grey[x], out);
        });
        let rows = height.div_ceil(1 << down);
        let columns = self.along_columns.par_chunks_exact_mut(rows);
        columns.enumerate().for_each(|(column, out)| {
            let line = Line {
                first: column << across,
                step: width,
                count: height,
            };
            let grey = |y| image.at(column << across, y);
            line.scan(down, map.bins, map.seen, grey, out);
        });
    }

    /// Weighs the hypotheses of all pixels, measured before.
    pub(super) fn weigh(&mut self, isa: Isa, levels: [&MatchLevel; 2], network: &GapNetwork) {
        let agreeing_bins = self.agreeing_bins;
        let (measured, votes, bands) = self.parts(levels);
        let pixels = BAND * measured.lattice.0;
        let bands = votes.par_chunks_mut(pixels).zip(bands);
        bands.enumerate().for_each(|(i, (out, band))| {
            let first = i * pixels;
            let mut block_votes: GapVotes = [[0; LANES]; HYPOTHESES + 1];
            measured.each(
                isa,
                first..first + out.len(),
                band,
                &mut |step| match step {
                    GapStep::Sure(place, bin) => out[place - first] = PixelVotes::from_bin(bin),
                    GapStep::Block(candidates, places) => {
                        weigh_hypotheses(isa, network, candidates, &mut block_votes);
                        for (lane, place) in places.iter().enumerate() {
                            out[place - first] =
                                PixelVotes::new(candidates, &block_votes, lane, agreeing_bins);
                        }
                    }
                },
            );
        });
    }

    /// The measurements, and the memory for the votes and for tasks; of the half image and of that
    /// at quarter size.
    fn parts<'a>(
        &'a mut self,
        [half, quarter]: [&'a MatchLevel; 2],
    ) -> (Measured<'a>, &'a mut [PixelVotes], &'a mut [Band]) {
        let measured = Measured {
            lattice: (self.width, self.votes.len() / self.width),
            steps: self.steps,
            half: half.map.pixels(),
            image: &half.images[0],
            sums: &half.sums,
            quarter: quarter.map.pixels(),
            quarter_sums: &quarter.sums,
            quality: &self.quality,
            along_rows: &self.along_rows,
            along_columns: &self.along_columns,
        };
        (measured, &mut self.votes, &mut self.bands)
    }

    /// The votes within ranges of half pixels, which are not empty.
    pub(super) fn votes(
        &self,
        columns: &Range<usize>,
        rows: &Range<usize>,
    ) -> impl Iterator<Item = &PixelVotes> {
        let [columns, rows] = [(columns, self.steps[0]), (rows, self.steps[1])]
            .map(|(range, step)| places(range, step));
        rows.flat_map(move |y| &self.votes[y * self.width..][columns.clone()])
    }

    /// Shows the pixels that are weighed, with their places in the half image, to a function, by
    /// blocks.
    pub(super) fn sample(
        &mut self,
        isa: Isa,
        levels: [&MatchLevel; 2],
        take: &mut dyn FnMut(&GapCandidates, &[[usize; 2]]),
    ) {
        let [across, down] = self.steps;
        let (measured, votes, bands) = self.parts(levels);
        let (width, pixels) = (measured.lattice.0, BAND * measured.lattice.0);
        for (i, band) in bands.iter_mut().enumerate() {
            let range = i * pixels..votes.len().min((i + 1) * pixels);
            measured.each(isa, range, band, &mut |step| {
                if let GapStep::Block(candidates, places) = step {
                    let at = |place: &usize| {
                        let [column, row] = [place % width, place / width];
                        [column << across, row << down]
                    };
                    let places: Vec<_> = places.iter().map(at).collect();
                    take(candidates, &places);
                }
            });
        }
    }
}

impl PixelVotes {
    /// All for one bin.
    fn from_bin(bin: i16) -> Self {
        let (mut bins, mut votes) = ([0; HYPOTHESES], [0; HYPOTHESES + 1]);
        (bins[0], votes[0]) = (bin, ALL);
        Self {
            bins,
            votes,
            agreed: ALL,
        }
    }

    fn new(candidates: &GapCandidates, votes: &GapVotes, lane: usize, agreeing_bins: u16) -> Self {
        let bins: [i16; HYPOTHESES] = std::array::from_fn(|k| candidates.bin[k][lane] as i16);
        let votes = votes.map(|lanes| lanes[lane]);
        let mut best = 0;
        for k in 1..HYPOTHESES {
            if votes[k] > votes[best] {
                best = k;
            }
        }
        let agrees = |k: usize| u8::from(bins[k].abs_diff(bins[best]) <= agreeing_bins);
        Self {
            bins,
            votes,
            agreed: (0..HYPOTHESES).map(|k| agrees(k) * votes[k]).sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::kernel::Isa;
    use crate::matcher::{Algorithm, MatchContext, MatchOutput};
    use crate::stereo::{Gray, RectifiedPair, StereoPair};
    use xxhash_rust::xxh3::xxh3_64;

    /// A textured floor in front of a textured wall, with a plain plate and much noise.
    fn pair() -> StereoPair {
        let mixed = |x: usize, y: usize, salt: u32| {
            let mixed = (x as u32).wrapping_mul(0x9E37_79B9) ^ (y as u32).wrapping_mul(0x85EB_CA6B);
            (mixed ^ salt).wrapping_mul(0xC2B2_AE35) >> 24
        };
        let texture = |x: usize, y: usize| 40 + mixed(x / 2, y / 2, 0) / 2 + mixed(x, y, 0) / 8;
        let disparity = |y: usize| 8 + y.saturating_sub(60) / 3;
        let side = |is_right: usize| {
            Gray::from_fn(200, 120, |x, y| {
                let plate = (70 - 20 * is_right..130 - 20 * is_right).contains(&x) && y < 80;
                let surface = if plate {
                    90
                } else {
                    texture(x + is_right * disparity(y), y)
                };
                (surface + mixed(x, y, 7 + is_right as u32) % 40) as u8
            })
        };
        StereoPair::new(side(0).unwrap(), side(1).unwrap()).unwrap()
    }

    /// Known cells, and a hash of all with their evidence.
    fn cells(algorithm: &str, isa: Isa) -> (usize, u64) {
        let algorithm: Algorithm = algorithm.parse().unwrap();
        let (mut matcher, mut output) = (
            algorithm.build_on(isa).unwrap(),
            MatchOutput::new().unwrap(),
        );
        let (pair, context) = (pair(), MatchContext::default());
        matcher
            .compute(RectifiedPair::assume(&pair), &context, &mut output)
            .unwrap();
        let cells = output.grid.unwrap().into_cells();
        let known = cells.iter().filter(|cell| cell.depth.is_some()).count();
        let bytes = cells.iter().flat_map(|cell| {
            let evidence = cell.evidence.unwrap();
            let numbers = [
                evidence.report,
                evidence.target,
                cell.depth.is_some().into(),
            ];
            let numbers = numbers.into_iter().chain(evidence.features);
            numbers.flat_map(i64::to_le_bytes).collect::<Vec<_>>()
        });
        (known, xxh3_64(&bytes.collect::<Vec<_>>()))
    }

    #[test]
    fn cells_of_a_small_image_never_change() {
        let algorithms = ["v5", "v5:target=near"];
        for isa in Isa::available() {
            let expected = [(4, 0x8bfe_4d4f_3014_c98c), (7, 0xe882_06bb_bec1_f2ee)];
            assert_eq!(
                algorithms.map(|algorithm| cells(algorithm, isa)),
                expected,
                "{isa}"
            );
        }
    }
}
