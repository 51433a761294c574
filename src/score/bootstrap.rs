//! Confidence intervals and tests of a run's numbers.
//!
//! Pairs of one drive are similar to their neighbours, so the standard error is that of blocks:
//! Politis and Romano, "A Circular Block-Resampling Procedure for Stationary Data", 1992. Of a sum
//! over the pairs it is that of the circular sums of a block, without resamples; ratios, roots and
//! medians are linearized. Intervals and probabilities are those of Student's t, whose degrees of
//! freedom are fewer where few blocks carry the difference.

use crate::holm::MAX_P;
use svl_core::statistics::{lower_median, upper_rank};

/// Fewest blocks for an interval.
const MIN_BLOCKS: usize = 8;

/// The level of all intervals and tests.
pub const LEVEL: &str = "95 %";

/// The method that tells a change from chance, for reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct TestMethod {
    pub name: &'static str,
    pub level: &'static str,
    /// Block length of n pairs; 1 for scenes, which are independent.
    pub block_length: Option<&'static str>,
    /// Below this number of blocks, or courses, nothing is tested.
    pub fewest_blocks: usize,
}

/// The method of all intervals.
pub const METHOD: TestMethod = TestMethod {
    name: "Student's t on the standard error of the circular block bootstrap",
    level: LEVEL,
    block_length: Some(
        "3 times the first lag with an autocorrelation below 2/√n, from ceil(2 n^(1/3)) to n/8",
    ),
    fewest_blocks: MIN_BLOCKS,
};

/// An interval at [`LEVEL`].
pub type Interval = (f64, f64);

/// Least length of the blocks of a drive of `length`.
pub fn block_length(length: usize) -> usize {
    (2.0 * (length as f64).cbrt()).ceil() as usize
}

/// The runs that items are of, one after the other.
pub struct RunLengths {
    lengths: Vec<usize>,
    are_independent: bool,
}

impl RunLengths {
    /// `lengths`: numbers of items; `are_independent` if items are not similar to their neighbours,
    /// as with scenes.
    pub fn new(lengths: &[usize], are_independent: bool) -> Self {
        Self {
            lengths: lengths.to_vec(),
            are_independent,
        }
    }

    fn least_length(&self, run: usize) -> usize {
        if self.are_independent {
            1
        } else {
            block_length(run).max(1)
        }
    }

    /// The number of the least block of each item.
    pub fn block_numbers(&self) -> Vec<usize> {
        let mut numbers: Vec<usize> = Vec::new();
        for &run in &self.lengths {
            let first = numbers.last().map_or(0, |last| last + 1);
            numbers.extend((0..run).map(|i| first + i / self.least_length(run)));
        }
        numbers
    }

    /// Number of blocks: about as many items are independent.
    pub fn blocks(&self) -> usize {
        self.block_numbers().last().map_or(0, |last| last + 1)
    }

    /// The uncertainty of the sum of these parts; `None` if fewer blocks than
    /// [`METHOD`] needs have an item with a value.
    fn uncertainty(&self, parts: &[f64], has_value: impl Fn(usize) -> bool) -> Option<Uncertainty> {
        let numbers = self.block_numbers();
        let mut with_value: Vec<_> = (0..numbers.len()).filter(|i| has_value(*i)).collect();
        with_value.dedup_by_key(|i| numbers[*i]);
        if with_value.len() < MIN_BLOCKS {
            return None;
        }
        let count = parts.len() as f64;
        let mean = parts.iter().sum::<f64>() / count;
        let centred: Vec<_> = parts.iter().map(|part| part - mean).collect();
        let runs = self.split(&centred);
        let longest = (3 * self.first_uncorrelated_lag(&runs)).min(parts.len() / 8);
        // The number of blocks, and the sums of their second and fourth powers.
        let [mut blocks, mut squares, mut fourths] = [0.0; 3];
        for run in runs.iter().filter(|run| !run.is_empty()) {
            let length = self.least_length(run.len()).max(longest).min(run.len());
            let in_run = run.len() as f64 / length as f64;
            blocks += in_run;
            let mut sum: f64 = run[..length].iter().sum();
            for i in 0..run.len() {
                squares += sum.powi(2) * in_run / run.len() as f64;
                fourths += sum.powi(4) * in_run / run.len() as f64;
                sum += run[(i + length) % run.len()] - run[i];
            }
        }
        // Three for a normal distribution: then all blocks count.
        let carrying = if fourths > 0.0 {
            3.0 * squares.powi(2) / fourths
        } else {
            blocks
        };
        let freedom = blocks.min(with_value.len() as f64).min(carrying) - 1.0;
        Some(Uncertainty {
            // Blocks vary about their own mean, so one degree of freedom is lost.
            error: (squares * blocks / (blocks - 1.0)).sqrt(),
            freedom: freedom.max(1.0) as usize,
        })
    }

    fn split<'a>(&self, parts: &'a [f64]) -> Vec<&'a [f64]> {
        let mut left = parts;
        let mut next = |length: &usize| left.split_off(..*length).unwrap_or_default();
        self.lengths.iter().map(&mut next).collect()
    }

    /// The first lag at which items are hardly correlated, over all runs; 0 of independent ones.
    fn first_uncorrelated_lag(&self, runs: &[&[f64]]) -> usize {
        let count: usize = self.lengths.iter().sum();
        let products = |lag: usize| -> f64 {
            let all = runs.iter().filter(|run| run.len() > lag);
            let products = all.flat_map(|run| run.iter().zip(&run[lag..]));
            products.map(|(a, b)| a * b).sum()
        };
        let limit = 2.0 / (count as f64).sqrt() * products(0);
        let mut lags = 1..=count / 24;
        if self.are_independent {
            return 0;
        }
        lags.find(|lag| products(*lag) <= limit)
            .unwrap_or(count / 24 + 1)
    }
}

/// The uncertainty of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// Standard error.
    error: f64,
    /// Degrees of freedom of Student's t.
    freedom: usize,
}

impl Uncertainty {
    pub fn interval(self, value: f64) -> Interval {
        // The probability falls with t.
        let (mut low, mut high) = (0.0, 13.0);
        for _ in 0..50 {
            let middle = f64::midpoint(low, high);
            let is_within = two_sided_t(middle, self.freedom) > MAX_P;
            *(if is_within { &mut low } else { &mut high }) = middle;
        }
        (value - high * self.error, value + high * self.error)
    }

    /// The probability that a difference from 0 is as large by chance, two-sided.
    pub fn p_value(self, difference: f64) -> f64 {
        if difference == 0.0 {
            1.0
        } else {
            two_sided_t(difference / self.error, self.freedom)
        }
    }
}

/// The values of a metric for the items of runs.
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

/// The sums of numerators and denominators; `None` if the ratio is undefined.
fn sums(parts: &[[f64; 2]]) -> Option<[f64; 2]> {
    let add = |sum: [f64; 2], part: &[f64; 2]| [sum[0] + part[0], sum[1] + part[1]];
    let sums = parts.iter().fold([0.0; 2], add);
    (sums[1] > 0.0).then_some(sums)
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
        match self {
            Self::Ratio(parts) => sums(parts).map(|[a, b]| a / b),
            Self::Root(parts) => sums(parts).map(|[a, b]| (a / b).sqrt()),
            Self::Count(values) => Some(values.iter().sum()),
            Self::Median(values) => lower_median(values.iter().flatten().copied()),
        }
    }

    fn has_value(&self, item: usize) -> bool {
        match self {
            Self::Ratio(parts) | Self::Root(parts) => parts[item][1] > 0.0,
            Self::Count(_) => true,
            Self::Median(values) => !values[item].is_empty(),
        }
    }

    /// The part of each item in the deviation of the metric from its expectation.
    fn parts(&self) -> Option<Vec<f64>> {
        let total = self.total()?;
        let of_ratio = |parts: &[[f64; 2]], ratio: f64, slope: f64| {
            let [_, whole] = sums(parts)?;
            let part = |[a, b]: &[f64; 2]| slope * (a - ratio * b) / whole;
            Some(parts.iter().map(part).collect())
        };
        match self {
            Self::Ratio(parts) => of_ratio(parts, total, 1.0),
            Self::Root(parts) if total > 0.0 => of_ratio(parts, total.powi(2), 0.5 / total),
            Self::Root(parts) => Some(vec![0.0; parts.len()]),
            Self::Count(values) => Some(values.clone()),
            Self::Median(values) => {
                let mut all: Vec<_> = values.iter().flatten().copied().collect();
                all.sort_by(f64::total_cmp);
                let count = all.len() as f64;
                // The inverse of the density: M. Siddiqui, "Distribution of Quantiles in Samples
                // from a Bivariate Population", 1960.
                let width = count.cbrt().recip().min(0.25);
                let [low, high] = [0.5 - width, 0.5 + width].map(|rank| upper_rank(&all, rank));
                let slope = (high? - low?) / (2.0 * width * count);
                let below = |own: &Vec<f64>| own.iter().filter(|v| **v <= total).count() as f64;
                let part = |own: &Vec<f64>| slope * (own.len() as f64 / 2.0 - below(own));
                Some(values.iter().map(part).collect())
            }
        }
    }

    /// The interval of the metric; `None` for too few blocks.
    pub fn interval(&self, runs: &RunLengths) -> Option<Interval> {
        let own = runs.uncertainty(&self.parts()?, |i| self.has_value(i))?;
        let (low, high) = own.interval(self.total()?);
        // A mean lies among what it is of.
        Some(match self {
            Self::Ratio(parts) => {
                let ratios = parts.iter().filter(|own| own[1] > 0.0);
                let ratios = ratios.map(|[a, b]| a / b);
                let least = ratios.clone().fold(f64::INFINITY, f64::min);
                (
                    low.max(least),
                    high.min(ratios.fold(f64::NEG_INFINITY, f64::max)),
                )
            }
            Self::Root(_) | Self::Count(_) => (low.max(0.0), high),
            Self::Median(_) => (low, high),
        })
    }

    /// The uncertainty of a function of two metrics of the same items, of these derivatives;
    /// `None` for too few blocks.
    pub fn uncertainty_between(
        [base, other]: [&Self; 2],
        slopes: [f64; 2],
        runs: &RunLengths,
    ) -> Option<Uncertainty> {
        let both = base.parts()?.into_iter().zip(other.parts()?);
        let parts: Vec<_> = both.map(|(a, b)| slopes[0] * a + slopes[1] * b).collect();
        runs.uncertainty(&parts, |i| base.has_value(i) && other.has_value(i))
    }
}

/// The interval of the difference of two fractions, each `passed` of `frames`, of other frames.
///
/// Only sums are known, so as many frames are independent as there are blocks of neighbours, with a
/// fraction kept from 0 and 1 by half a block on either side. `None` for too few blocks.
pub fn shares(a: (u64, u64), b: (u64, u64)) -> Option<Interval> {
    let blocks = |frames: u64| (frames as usize).div_ceil(block_length(frames as usize).max(1));
    let fewest = blocks(a.1).min(blocks(b.1));
    let variance = |(passed, frames): (u64, u64)| {
        let blocks = blocks(frames) as f64;
        // Half a block added on either side: a fraction of 0 or 1 over few frames is not certain.
        let expected = (blocks * passed as f64 / frames as f64 + 0.5) / (blocks + 1.0);
        expected * (1.0 - expected) / blocks
    };
    let share = |(passed, frames): (u64, u64)| passed as f64 / frames as f64;
    (fewest >= MIN_BLOCKS).then(|| {
        let own = Uncertainty {
            error: (variance(a) + variance(b)).sqrt(),
            freedom: fewest - 1,
        };
        let (low, high) = own.interval(share(b) - share(a));
        (low.max(-1.0), high.min(1.0))
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    fn ratio(values: impl IntoIterator<Item = f64>) -> Sample {
        Sample::Ratio(values.into_iter().map(|value| [value, 1.0]).collect())
    }

    #[test]
    fn as_wide_as_the_theory_says() {
        // 400 independent values of standard deviation 0.5: the mean's is 0.025, its interval ±
        // 0.049.
        let values = (0..400).map(|i| f64::from(i % 2));
        let (low, high) = ratio(values)
            .interval(&RunLengths::new(&[400], true))
            .unwrap();
        assert!((low - 0.451).abs() < 1e-3 && (high - 0.549).abs() < 1e-3);
        // The same values with equal neighbours carry less information.
        let alike = (0..400).map(|i| f64::from(i / 40 % 2));
        let runs = RunLengths::new(&[400], false);
        let (low, high) = ratio(alike).interval(&runs).unwrap();
        assert!(high - low > 0.3, "{low} {high}");
    }

    #[test]
    fn medians_are_as_sure_as_normal_ones() {
        // The standard error of the median of normal values is 1.2533 / √n.
        let mut random = fastrand::Rng::with_seed(7);
        let mut normal = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
        let values = (0..2000).map(|_| vec![normal()]).collect();
        let (low, high) = Sample::Median(values)
            .interval(&RunLengths::new(&[2000], true))
            .unwrap();
        let expected = 2.0 * 1.96 * 1.2533 / 2000f64.sqrt();
        assert!(((high - low) / expected - 1.0).abs() < 0.2, "{low} {high}");
    }

    #[test]
    fn a_difference_in_one_pair_alone_proves_nothing() {
        let one = |value: f64| ratio((0..280).map(|i| if i == 99 { value } else { 0.5 }));
        let p = |base, other: f64, runs| {
            let between = [&one(base), &one(other)];
            let own = Sample::uncertainty_between(between, [-1.0, 1.0], &runs).unwrap();
            own.p_value((other - base) / 280.0)
        };
        for runs in [[280, 0], [140, 140]] {
            assert!(p(0.0, 100.0, RunLengths::new(&runs, false)) > 0.2);
        }
        assert!(p(0.0, 100.0, RunLengths::new(&[280], true)) > 0.2);
        // Nor does a metric that few pairs have.
        let few = Sample::Ratio((0..280).map(|i| [0.2, f64::from(i / 7)]).collect());
        let runs = RunLengths::new(&[280], false);
        assert!(few.interval(&runs).is_some());
        let few = Sample::Ratio((0..280).map(|i| [0.2, f64::from(i / 260)]).collect());
        assert_eq!(few.interval(&runs), None);
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
        // 40 independent values of mean 0.3: the t test has 0.3 / (1.0127 / √40) = 1.873.
        let signs = (0..40).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 });
        let samples = [ratio([0.0; 40]), ratio(signs.map(|sign| 0.3 + sign))];
        let runs = RunLengths::new(&[40], true);
        let between = [&samples[0], &samples[1]];
        let own = Sample::uncertainty_between(between, [-1.0, 1.0], &runs).unwrap();
        assert!((own.p_value(0.3) - two_sided_t(1.873, 39)).abs() < 1e-3);
        assert_eq!(own.p_value(0.0), 1.0);
        let (low, high) = own.interval(0.3);
        assert!((low - 0.3 + 2.023 * 0.1601).abs() < 1e-3 && low + high - 0.6 < 1e-9);
    }

    #[test]
    fn too_few_blocks_have_no_interval() {
        let interval = |items: usize, are_independent| {
            let runs = RunLengths::new(&[items], are_independent);
            ratio((0..items).map(|i| i as f64)).interval(&runs)
        };
        assert_eq!([interval(7, true), interval(20, false)], [None; 2]);
        assert!(interval(8, true).is_some());
    }

    #[test]
    fn shares_of_few_frames_have_no_interval() {
        // 57 frames are eight blocks of eight, the last one of one.
        let (low, high) = shares((30, 57), (35, 57)).unwrap();
        assert!(low < -0.3 && high > 0.3, "{low} {high}");
        // Blocks that all agree may still be chance.
        let (low, high) = shares((64, 64), (0, 64)).unwrap();
        assert!(low == -1.0 && high > -0.8, "{low} {high}");
        for few in [0, 1, 7, 20, 56] {
            assert_eq!(shares((0, few), (64, 64)), None);
            assert_eq!(shares((64, 64), (0, few)), None);
        }
    }
}
