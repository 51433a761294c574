//! The features of hypotheses, from measurements at their pixels.

use super::super::pairs::Group;
use super::{HYPOTHESES, HYPOTHESIS_FEATURES, PIXEL_FEATURES};

const LANES: usize = Group::ROWS;

/// Inputs of two neighbouring features in each lane.
pub(super) type Inputs<const N: usize> = [Group<[i16; 2]>; N];

/// Pairs of the features, the last with a zero.
pub(super) const HYPOTHESIS_PAIRS: usize = HYPOTHESIS_FEATURES.div_ceil(2);
pub(super) const PIXEL_PAIRS: usize = PIXEL_FEATURES.div_ceil(2);

/// Measurements of the hypotheses of a pixel in each lane. Disparities are bins of 1/8 pixel, grey
/// levels quarters.
#[derive(Clone, Default)]
pub struct GapCandidates {
    pub exists: [[bool; LANES]; HYPOTHESES],
    pub bin: [[i32; LANES]; HYPOTHESES],
    /// Pixels to where it was seen.
    pub distance: [[i32; LANES]; HYPOTHESES],
    /// Greatest step of grey on the way, and the difference of both ends.
    pub barrier: [[i32; LANES]; HYPOTHESES],
    pub grey: [[i32; LANES]; HYPOTHESES],
    /// Sum of path costs above the pixel's least, at half and at quarter size.
    pub excess: [[i32; LANES]; HYPOTHESES],
    pub quarter_excess: [[i32; LANES]; HYPOTHESES],
    /// 1 if it leads out of the right image; else the right image's winner there, less the
    /// hypothesis.
    pub leads_out: [[i32; LANES]; HYPOTHESES],
    pub right: [[i32; LANES]; HYPOTHESES],
    /// Quality where it was seen: seen pixels of the 25 around, uniqueness 0..=127, cost in bits.
    pub seen: [[i32; LANES]; HYPOTHESES],
    pub unique: [[i32; LANES]; HYPOTHESES],
    pub own: [[i32; LANES]; HYPOTHESES],
    /// Difference of the ends of an interpolation.
    pub ends: [[i32; LANES]; HYPOTHESES],
    /// Gap filled along the row.
    pub filled: [i32; LANES],
    /// Features of the pixel. Those of the hypotheses' spread and number are added here, and
    /// logarithms made of the sums of grey steps and of the difference of the quarter's winner.
    pub pixel: [[i32; LANES]; PIXEL_FEATURES],

    pub(super) inputs: [Inputs<HYPOTHESIS_PAIRS>; HYPOTHESES],
    pub(super) pixel_inputs: Inputs<PIXEL_PAIRS>,
}

/// Places among the pixel's features.
const STEPS: [usize; 2] = [6, 7];
const SPREAD: usize = 10;
const COUNT: usize = 11;
const QUARTER: usize = 16;

impl<T: Copy + Default> Default for Group<T> {
    fn default() -> Self {
        Self::splat(T::default())
    }
}

/// `⌊16·log2(x)⌋` by chords between powers of two, for `x >= 1`: the float's exponent and the first
/// four digits after its point.
#[inline(always)]
fn log(x: i32) -> i32 {
    ((x as f32).to_bits() >> 19) as i32 - (127 << 4)
}

/// The logarithm of a difference of bins, with its sign.
#[inline(always)]
fn signed_log(bins: i32) -> i32 {
    let size = log(4 + bins.abs()) - 32;
    if bins < 0 { -size } else { size }
}

impl GapCandidates {
    /// Feature `i` of hypothesis `k`, and of the pixel, in a lane.
    pub fn feature(&self, k: usize, i: usize, lane: usize) -> i8 {
        self.inputs[k][i / 2].0[lane][i % 2] as i8
    }

    pub fn pixel_feature(&self, i: usize, lane: usize) -> i8 {
        self.pixel_inputs[i / 2].0[lane][i % 2] as i8
    }
}

/// The least and the greatest bin of the hypotheses that exist, and their number.
struct BinSpread {
    least: [i32; LANES],
    most: [i32; LANES],
    count: [i32; LANES],
}

/// See [`super::super::describe_hypotheses`].
#[inline(always)]
pub(in super::super) fn describe(candidates: &mut GapCandidates) {
    let mut spread = BinSpread {
        least: [i32::MAX; LANES],
        most: [-1; LANES],
        count: [0; LANES],
    };
    for (bin, exists) in candidates.bin.iter().zip(&candidates.exists) {
        for l in 0..LANES {
            spread.least[l] = spread.least[l].min(if exists[l] { bin[l] } else { i32::MAX });
            spread.most[l] = spread.most[l].max(if exists[l] { bin[l] } else { -1 });
            spread.count[l] += i32::from(exists[l]);
        }
    }
    for k in 0..HYPOTHESES {
        describe_hypothesis(candidates, k, &spread);
    }
    describe_pixel(candidates, &spread);
}

#[inline(always)]
fn describe_hypothesis(candidates: &mut GapCandidates, k: usize, spread: &BinSpread) {
    let mut agree = [0; LANES];
    for (bin, exists) in candidates.bin.iter().zip(&candidates.exists) {
        for l in 0..LANES {
            let near = (bin[l] - candidates.bin[k][l]).abs() <= 12;
            agree[l] += i32::from(near & exists[l]);
        }
    }
    let mut features = [[0; LANES]; HYPOTHESIS_FEATURES + 1];
    for l in 0..LANES {
        let bin = candidates.bin[k][l];
        features[0][l] = log(1 + candidates.distance[k][l]);
        features[1][l] = signed_log(bin - spread.least[l]);
        features[2][l] = signed_log(spread.most[l] - bin);
        features[3][l] = signed_log(bin - candidates.filled[l]);
        features[4][l] = log(8 + candidates.barrier[k][l]) - 48;
        features[5][l] = log(8 + candidates.grey[k][l]) - 48;
        features[6][l] = 2 * candidates.excess[k][l];
        features[7][l] = 64 * candidates.leads_out[k][l];
        features[8][l] = signed_log(candidates.right[k][l]);
        features[9][l] = (5 * candidates.seen[k][l]) >> 1;
        features[10][l] = 2 * candidates.unique[k][l];
        features[11][l] = (85 * candidates.own[k][l]) >> 4;
        features[12][l] = (85 * agree[l]) >> 3;
        features[13][l] = signed_log(candidates.ends[k][l]);
        features[14][l] = 2 * candidates.quarter_excess[k][l];
    }
    for (i, input) in candidates.inputs[k].iter_mut().enumerate() {
        for (l, input) in input.0.iter_mut().enumerate() {
            let is = i32::from(candidates.exists[k][l]);
            let at = |i: usize| (features[i][l].clamp(-127, 127) * is) as i16;
            *input = [at(2 * i), at(2 * i + 1)];
        }
    }
}

#[inline(always)]
fn describe_pixel(candidates: &mut GapCandidates, spread: &BinSpread) {
    let mut pixel = candidates.pixel;
    for i in STEPS {
        for value in &mut pixel[i] {
            *value = log(50 + *value) - log(50);
        }
    }
    for (l, value) in pixel[SPREAD].iter_mut().enumerate() {
        *value = signed_log(spread.most[l] - spread.least[l]);
    }
    for (value, count) in pixel[COUNT].iter_mut().zip(&spread.count) {
        *value = (85 * count) >> 3;
    }
    for value in &mut pixel[QUARTER] {
        *value = signed_log(*value);
    }
    for (i, input) in candidates.pixel_inputs.iter_mut().enumerate() {
        for l in 0..LANES {
            let at = |i: usize| {
                pixel
                    .get(i)
                    .map_or(0, |values| values[l].clamp(-127, 127) as i16)
            };
            input.0[l] = [at(2 * i), at(2 * i + 1)];
        }
    }
}
