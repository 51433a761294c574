//! Kendall's tau-b within strata.
//!
//! Kendall, "The Treatment of Ties in Ranking Problems", Biometrika 33, 1945.

use std::iter::Sum;

/// Counts over pairs of observations (x, y). Counts of several strata add up, so that only pairs
/// within a stratum count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Concordance {
    /// Pairs ordered alike by x and y, minus those ordered oppositely.
    net: i64,
    /// Pairs that differ in x, and in y.
    differ: [i64; 2],
}

impl Concordance {
    /// Counts of the observations of one stratum, which are sorted in place.
    pub fn of(observations: &mut [(f64, f64)]) -> Self {
        observations.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let couples = |n: usize| (n * n.saturating_sub(1) / 2) as i64;
        // Among equal neighbours, pair by pair: each with those before it.
        let tied = |equal: fn(&(f64, f64), &(f64, f64)) -> bool| {
            let groups = observations.chunk_by(equal);
            groups.map(|group| couples(group.len())).sum::<i64>()
        };
        let (tied_x, tied_both) = (tied(|a, b| a.0 == b.0), tied(|a, b| a == b));
        let mut ys = Vec::with_capacity(observations.len());
        let mut discordant = 0;
        for &(_, y) in observations.iter() {
            // For equal x, y ascends, so none before it is greater.
            let place = ys.partition_point(|&before| before <= y);
            discordant += (ys.len() - place) as i64;
            ys.insert(place, y);
        }
        let groups = ys.chunk_by(|a, b| a == b);
        let tied_y = groups.map(|group| couples(group.len())).sum::<i64>();
        let all = couples(ys.len());
        Self {
            net: all - tied_x - tied_y + tied_both - 2 * discordant,
            differ: [all - tied_x, all - tied_y],
        }
    }

    /// −1 to 1; `None` if no pair differs in x or none in y.
    pub fn tau_b(&self) -> Option<f64> {
        let whole = self.differ.map(|n| n as f64).iter().product::<f64>();
        (whole > 0.0).then(|| self.net as f64 / whole.sqrt())
    }

    /// Pairs that differ in x, y or both.
    pub fn couples(&self) -> i64 {
        self.differ[0].max(self.differ[1])
    }
}

impl Sum for Concordance {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Self::default(), |sum, part| Self {
            net: sum.net + part.net,
            differ: [0, 1].map(|i| sum.differ[i] + part.differ[i]),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tau(observations: &[(f64, f64)]) -> Option<f64> {
        Concordance::of(&mut observations.to_vec()).tau_b()
    }

    #[test]
    fn by_hand() {
        assert_eq!(tau(&[(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]), Some(1.0));
        assert_eq!(tau(&[(1.0, 3.0), (2.0, 2.0), (3.0, 1.0)]), Some(-1.0));
        // Five concordant couples, one discordant: 4/6.
        let one_off = [(1.0, 1.0), (2.0, 3.0), (3.0, 2.0), (4.0, 4.0)];
        assert_eq!(tau(&one_off), Some(4.0 / 6.0));
        // Couples 12, 13 tie in x or y; two of six differ in no more: concordant 4, x differs in 5,
        // y in 5.
        let ties = [(1.0, 1.0), (1.0, 2.0), (2.0, 2.0), (3.0, 3.0)];
        assert_eq!(tau(&ties), Some(4.0 / 5.0));
        assert_eq!(tau(&[(1.0, 1.0), (1.0, 2.0)]), None);
        assert_eq!(tau(&[]), None);
    }

    #[test]
    fn as_couple_by_couple() {
        let mut random = fastrand::Rng::with_seed(1);
        for n in 0..60 {
            let mut value = || f64::from(random.u8(0..6));
            let mut observations: Vec<_> = (0..n).map(|_| (value(), value())).collect();
            let mut expected = Concordance::default();
            for (i, a) in observations.iter().enumerate() {
                for b in &observations[..i] {
                    let sign = |d: f64| if d == 0.0 { 0 } else { d.signum() as i64 };
                    let (x, y) = (sign(a.0 - b.0), sign(a.1 - b.1));
                    expected.net += x * y;
                    expected.differ[0] += x.abs();
                    expected.differ[1] += y.abs();
                }
            }
            assert_eq!(Concordance::of(&mut observations), expected);
        }
    }

    #[test]
    fn couples_of_two_strata_do_not_count() {
        // Concordant within, discordant between.
        let strata = [[(5.0, 1.0), (6.0, 2.0)], [(1.0, 8.0), (2.0, 9.0)]];
        let of = |mut stratum: [(f64, f64); 2]| Concordance::of(&mut stratum);
        let sum: Concordance = strata.map(of).into_iter().sum();
        assert_eq!((sum.tau_b(), sum.couples()), (Some(1.0), 2));
    }
}
