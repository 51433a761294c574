//! Bootstrap confidence intervals of a run's numbers.
//!
//! Efron, "Bootstrap Methods: Another Look at the Jackknife", 1979, percentile intervals. Pairs of
//! one drive are similar to their neighbours, so they are drawn in blocks: Politis and Romano, "A
//! Circular Block-Resampling Procedure for Stationary Data", 1992, with blocks of twice the cube
//! root of the drive's length, long enough to decorrelate the arena's pairs.

use std::ops::Range;
use svl_core::statistics::{lower_median, upper_rank};

/// Number of resamples. Equal data give equal intervals: the generator has a fixed seed.
const DRAWS: usize = 1000;
const SEED: u64 = 2007;

/// Fewest blocks for an interval.
const MIN_BLOCKS: usize = 8;

/// The level of all intervals and tests.
pub const LEVEL: &str = "95 %";

/// The method that tells a change from chance, for reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct TestMethod {
    pub name: &'static str,
    pub resamples: Option<usize>,
    pub seed: Option<u64>,
    pub level: &'static str,
    /// Block length for a run of n pairs of one drive; 1 for scenes, which are independent.
    pub block_length: Option<&'static str>,
    /// Below this number of blocks, or courses, nothing is tested.
    pub fewest_blocks: usize,
}

/// The method of all intervals.
pub const METHOD: TestMethod = TestMethod {
    name: "circular block bootstrap, percentile intervals",
    resamples: Some(DRAWS),
    seed: Some(SEED),
    level: LEVEL,
    block_length: Some("ceil(2 n^(1/3))"),
    fewest_blocks: MIN_BLOCKS,
};

/// The middle 95 % of the resamples.
pub type Interval = (f64, f64);

/// Resamples of the items `0..n`.
pub struct Resamples {
    /// Each with the items of these ranges, one after the other.
    draws: Vec<Vec<Range<usize>>>,
    /// Number of blocks in each.
    blocks: usize,
}

/// Length of the blocks drawn from a drive of `length`.
pub fn block_length(length: usize) -> usize {
    (2.0 * (length as f64).cbrt()).ceil() as usize
}

impl Resamples {
    /// `stretches`: lengths of the consecutive drives; `independent` if items are not similar to
    /// their neighbours, as with scenes.
    pub fn draw(stretches: &[usize], independent: bool) -> Self {
        let mut random = fastrand::Rng::with_seed(SEED);
        let mut draw = || {
            let mut ranges = Vec::new();
            let mut begin = 0;
            for &length in stretches {
                let block = if independent { 1 } else { block_length(length) };
                let mut left = length;
                while left > 0 {
                    let first = random.usize(0..length);
                    let taken = block.min(left);
                    let end = (first + taken).min(length);
                    ranges.push(begin + first..begin + end);
                    // Circular: a block that begins near the end continues at the start, so all
                    // items are drawn equally often.
                    ranges.push(begin..begin + taken - (end - first));
                    left -= taken;
                }
                begin += length;
            }
            ranges
        };
        let blocks = |&length: &usize| {
            if independent {
                length
            } else {
                length.div_ceil(block_length(length).max(1))
            }
        };
        Self {
            draws: (0..DRAWS).map(|_| draw()).collect(),
            blocks: stretches.iter().map(blocks).sum(),
        }
    }

    /// Number of blocks in each resample: about as many pairs are independent.
    pub fn blocks(&self) -> usize {
        self.blocks
    }

    /// The interval of a statistic of the items; `None` for too few blocks, or if it is undefined
    /// for some resample.
    pub fn interval(&self, statistic: &dyn Fn(&[usize]) -> Option<f64>) -> Option<Interval> {
        middle(self.values(&|ranges| statistic(&items(ranges).collect::<Vec<_>>()))?)
    }

    /// A statistic in each resample; `None` for too few blocks, or if it is undefined for one.
    fn values(&self, statistic: &dyn Fn(&[Range<usize>]) -> Option<f64>) -> Option<Vec<f64>> {
        let values = self.draws.iter().map(|ranges| statistic(ranges));
        (self.blocks >= MIN_BLOCKS).then(|| values.collect())?
    }

    /// The probability that a difference from 0 is as large by chance, two-sided: Student's t of
    /// the difference over its standard error in the resamples. Of few blocks that is nearer to the
    /// truth than the share of the resamples beyond 0, and tells small probabilities apart.
    pub fn p_value(&self, difference: f64, draws: &[f64]) -> f64 {
        let (count, blocks) = (draws.len() as f64, self.blocks as f64);
        let mean = draws.iter().sum::<f64>() / count;
        let squares = draws
            .iter()
            .map(|value| (value - mean).powi(2))
            .sum::<f64>();
        // Resamples vary as the sample does, without the correction by a degree of freedom.
        let error = (squares / count * blocks / (blocks - 1.0)).sqrt();
        if difference == 0.0 {
            1.0
        } else {
            two_sided_t(difference / error, self.blocks - 1)
        }
    }
}

fn items(ranges: &[Range<usize>]) -> impl Iterator<Item = usize> {
    ranges.iter().cloned().flatten()
}

/// The sums of the rows of these items, in their order.
fn sums<const N: usize>(rows: &[[f64; N]], ranges: &[Range<usize>]) -> [f64; N] {
    let mut sums = [0.0; N];
    for range in ranges {
        for row in &rows[range.clone()] {
            sums = std::array::from_fn(|i| sums[i] + row[i]);
        }
    }
    sums
}

/// The values of a metric for the items to be resampled.
pub enum Sample {
    /// Numerator and denominator; the value is the ratio of their sums.
    Ratio(Vec<[f64; 2]>),
    /// Numerator and denominator; the value is the square root of the ratio of their sums.
    Root(Vec<[f64; 2]>),
    /// The value is the sum.
    Count(Vec<f64>),
    /// The numbers of each item; the value is the median of all by nearest rank.
    Median(Vec<Vec<f64>>),
}

fn ratio([numerator, denominator]: [f64; 2]) -> Option<f64> {
    (denominator > 0.0).then(|| numerator / denominator)
}

impl Sample {
    /// Number of items.
    pub fn items(&self) -> usize {
        match self {
            Self::Ratio(parts) | Self::Root(parts) => parts.len(),
            Self::Count(values) => values.len(),
            Self::Median(values) => values.len(),
        }
    }

    /// The metric over all items.
    pub fn total(&self) -> Option<f64> {
        self.value(std::slice::from_ref(&(0..self.items())))
    }

    /// The metric over these items, with their multiplicities.
    fn value(&self, ranges: &[Range<usize>]) -> Option<f64> {
        match self {
            Self::Ratio(parts) => ratio(sums(parts, ranges)),
            Self::Root(parts) => ratio(sums(parts, ranges)).map(f64::sqrt),
            Self::Count(values) => Some(items(ranges).map(|i| values[i]).sum()),
            Self::Median(values) => {
                lower_median(items(ranges).flat_map(|i| values[i].iter().copied()))
            }
        }
    }

    /// The interval of the metric.
    pub fn interval(&self, resamples: &Resamples) -> Option<Interval> {
        middle(self.draws(resamples)?)
    }

    /// The metric in each resample; `None` for too few blocks, or if it is undefined for one.
    pub fn draws(&self, resamples: &Resamples) -> Option<Vec<f64>> {
        resamples.values(&|ranges| self.value(ranges))
    }

    /// `difference(base, other)` in each resample.
    pub fn draws_between(
        base: &Self,
        other: &Self,
        difference: fn(f64, f64) -> f64,
        resamples: &Resamples,
    ) -> Option<Vec<f64>> {
        // Sums wait for their last addition: both together take the time of one.
        match (base, other) {
            (Self::Ratio(a), Self::Ratio(b)) => {
                let both = a.iter().zip(b).map(|(&[a, b], &[c, d])| [a, b, c, d]);
                let both: Vec<_> = both.collect();
                resamples.values(&|ranges| {
                    let [a, b, c, d] = sums(&both, ranges);
                    Some(difference(ratio([a, b])?, ratio([c, d])?))
                })
            }
            (Self::Count(a), Self::Count(b)) => {
                let both: Vec<_> = a.iter().zip(b).map(|(&a, &b)| [a, b]).collect();
                resamples.values(&|ranges| {
                    let [a, b] = sums(&both, ranges);
                    Some(difference(a, b))
                })
            }
            _ => resamples
                .values(&|ranges| Some(difference(base.value(ranges)?, other.value(ranges)?))),
        }
    }
}

/// The interval of the difference of a metric from another, both in the same resamples.
pub fn difference_interval(base: &[f64], other: &[f64]) -> Option<Interval> {
    middle(base.iter().zip(other).map(|(a, b)| b - a).collect())
}

/// The interval of the difference of two fractions, each `passed` of `frames`, drawn independently.
///
/// Only sums are known, so as many frames are drawn as there are blocks of neighbours, with a
/// probability kept from 0 and 1 by half a block on either side. `None` for too few blocks.
pub fn shares(a: (u64, u64), b: (u64, u64)) -> Option<Interval> {
    let mut random = fastrand::Rng::with_seed(SEED);
    let blocks = |frames: u64| (frames as usize).div_ceil(block_length(frames as usize).max(1));
    let mut share = |(passed, frames): (u64, u64)| {
        let blocks = blocks(frames) as f64;
        // Half a block added on either side: a fraction of 0 or 1 over few frames is not certain.
        let expected = (blocks * passed as f64 / frames as f64 + 0.5) / (blocks + 1.0);
        (0..blocks as usize)
            .filter(|_| random.f64() < expected)
            .count() as f64
            / blocks
    };
    (blocks(a.1).min(blocks(b.1)) >= MIN_BLOCKS)
        .then(|| (0..DRAWS).map(|_| share(b) - share(a)).collect())
        .and_then(middle)
}

/// The probability of Student's t beyond `t` on either side, of that many degrees of freedom:
/// Abramowitz and Stegun, Handbook of Mathematical Functions, 26.7.3 and 26.7.4.
fn two_sided_t(t: f64, freedom: usize) -> f64 {
    let angle = (t.abs() / (freedom as f64).sqrt()).atan();
    let (sine, cosine) = angle.sin_cos();
    let is_odd = freedom % 2 == 1;
    let (mut sum, mut term) = (0.0, if is_odd { cosine } else { 1.0 });
    for i in (1 + usize::from(is_odd)..freedom).step_by(2) {
        sum += term;
        term *= i as f64 / (i + 1) as f64 * cosine * cosine;
    }
    let within = if is_odd {
        (angle + sine * sum) * std::f64::consts::FRAC_2_PI
    } else {
        sine * sum
    };
    (1.0 - within).max(0.0)
}

/// The middle 95 % of the values in resamples.
pub fn middle(mut values: Vec<f64>) -> Option<Interval> {
    values.sort_by(f64::total_cmp);
    Some((upper_rank(&values, 0.025)?, upper_rank(&values, 0.975)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(values: &[f64]) -> impl Fn(&[usize]) -> Option<f64> {
        |items| Some(items.iter().map(|&i| values[i]).sum::<f64>() / items.len() as f64)
    }

    #[test]
    fn resamples_stay_in_their_stretch() {
        let Resamples { draws, blocks } = Resamples::draw(&[3, 1, 10], false);
        assert_eq!(blocks, 1 + 1 + 2);
        assert_eq!(draws.len(), DRAWS);
        for draw in draws {
            let draw: Vec<_> = items(&draw).collect();
            assert!(
                draw[..3].iter().all(|&i| i < 3)
                    && draw[3] == 3
                    && draw[4..].iter().all(|&i| (4..14).contains(&i))
            );
            assert_eq!(draw.len(), 14);
        }
    }

    #[test]
    fn as_wide_as_the_theory_says() {
        // 400 independent values of standard deviation 0.5: the mean's is 0.025, its interval ±
        // 0.049.
        let values: Vec<f64> = (0..400).map(|i| f64::from(i % 2)).collect();
        let (low, high) = Resamples::draw(&[400], true)
            .interval(&mean(&values))
            .unwrap();
        assert!(
            (0.43..0.47).contains(&low) && (0.53..0.57).contains(&high),
            "{low} {high}"
        );
        // The same values with equal neighbours carry less information.
        let alike: Vec<f64> = (0..400).map(|i| f64::from(i / 40 % 2)).collect();
        let (low, high) = Resamples::draw(&[400], false)
            .interval(&mean(&alike))
            .unwrap();
        assert!(high - low > 0.15, "{low} {high}");
    }

    #[test]
    fn roots_and_medians_are_of_all_numbers() {
        let root = Sample::Root(vec![[9.0, 1.0], [7.0, 3.0]]);
        assert_eq!((root.items(), root.total()), (2, Some(2.0)));
        // An item without a number remains one.
        let median = Sample::Median(vec![vec![5.0, 1.0], vec![], vec![2.0]]);
        assert_eq!((median.items(), median.total()), (3, Some(2.0)));
        assert_eq!(Sample::Median(vec![vec![]]).total(), None);
    }

    #[test]
    fn t_is_as_tables_say() {
        let tables = [
            (12.706, 1, 0.05),
            (4.303, 2, 0.05),
            (3.182, 3, 0.05),
            (2.365, 7, 0.05),
            (2.093, 19, 0.05),
            (2.845, 20, 0.01),
            (3.883, 19, 0.001),
            (1.96, 100_000, 0.05),
        ];
        for (t, freedom, p) in tables {
            let own = two_sided_t(t, freedom);
            assert!((own / p - 1.0).abs() < 2e-3, "{t} {freedom}: {own}");
        }
        assert_eq!(
            (two_sided_t(0.0, 5), two_sided_t(f64::INFINITY, 4)),
            (1.0, 0.0)
        );
    }

    #[test]
    fn a_difference_is_as_probable_as_the_t_test_of_its_values() {
        // 40 independent values of mean 0.3: the t test has 0.3 / (1.0198 / √40) = 1.86.
        let values: Vec<f64> = (0..40)
            .map(|i| 0.3 + if i % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        let resamples = Resamples::draw(&[40], true);
        let sample = Sample::Ratio(values.iter().map(|value| [*value, 1.0]).collect());
        let draws = sample.draws(&resamples).unwrap();
        let p = resamples.p_value(0.3, &draws);
        assert!((p - two_sided_t(1.873, 39)).abs() < 0.01, "{p}");
        assert_eq!(resamples.p_value(0.0, &draws), 1.0);
    }

    #[test]
    fn too_little_says_nothing() {
        assert_eq!(Resamples::draw(&[7], true).interval(&|_| Some(1.0)), None);
        assert_eq!(Resamples::draw(&[20], false).interval(&|_| Some(1.0)), None);
        assert!(
            Resamples::draw(&[8], true)
                .interval(&|_| Some(1.0))
                .is_some()
        );
    }

    #[test]
    fn shares_of_few_frames_have_no_interval() {
        // 57 frames are eight blocks of eight, the last one of one.
        let (low, high) = shares((30, 57), (35, 57)).unwrap();
        assert!(low < -0.3 && high > 0.3, "{low} {high}");
        // Blocks that all agree may still be chance.
        let (low, high) = shares((64, 64), (0, 64)).unwrap();
        assert!(low == -1.0 && high > -0.9, "{low} {high}");
        for few in [0, 1, 7, 20, 56] {
            assert_eq!(shares((0, few), (64, 64)), None);
            assert_eq!(shares((64, 64), (0, few)), None);
        }
    }
}
