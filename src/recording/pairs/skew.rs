//! Statistics of the skew: right stamp minus left stamp.

use svl_core::nanoseconds;
use svl_core::statistics::upper_rank;

/// Skew over the pairs of a recording.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct SkewSummary {
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub min_ns: i64,
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub median_ns: i64,
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub max_ns: i64,
    /// At most twelve bins of equal width, in ascending order; empty bins are omitted.
    pub histogram: Vec<SkewBin>,
}

/// Pairs whose skew is at least `from_ns` and less than `to_ns`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct SkewBin {
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub from_ns: i64,
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub to_ns: i64,
    pub pairs: u64,
}

const MAX_BINS: i128 = 12;

impl SkewSummary {
    /// From the skews of all pairs, which are sorted in place; `None` without pairs.
    pub(crate) fn from_skews(skews_ns: &mut [i64]) -> Option<Self> {
        skews_ns.sort_unstable();
        let (&[min_ns, ..], &[.., max_ns]) = (&*skews_ns, &*skews_ns) else {
            return None;
        };
        let median_ns = upper_rank(skews_ns, 0.5)?;
        let width = bin_width(i128::from(min_ns), i128::from(max_ns));
        // Corrupt stamps may be as far apart as the number type allows.
        let edge = |ns: i128| ns.clamp(i64::MIN.into(), i64::MAX.into()) as i64;
        // Euclidean, so that bins left of zero have the same width as the others.
        let number = |ns: i64| i128::from(ns).div_euclid(width);
        let bin = |bin: &[i64]| SkewBin {
            from_ns: edge(number(bin[0]) * width),
            to_ns: edge((number(bin[0]) + 1) * width),
            pairs: bin.len() as u64,
        };
        let histogram = skews_ns
            .chunk_by(|&a, &b| number(a) == number(b))
            .map(bin)
            .collect();
        Some(Self {
            min_ns,
            median_ns,
            max_ns,
            histogram,
        })
    }
}

/// The smallest of 1, 2, 5, 10, … ns that divides the range into at most twelve bins.
fn bin_width(min_ns: i128, max_ns: i128) -> i128 {
    let mut decade = 1;
    // Ends at the latest when one bin covers the whole range.
    loop {
        for width in [decade, 2 * decade, 5 * decade] {
            if max_ns.div_euclid(width) - min_ns.div_euclid(width) < MAX_BINS {
                return width;
            }
        }
        decade *= 10;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bins(skews_ns: &mut [i64]) -> Vec<(i64, i64, u64)> {
        let skew = SkewSummary::from_skews(skews_ns).unwrap();
        skew.histogram
            .iter()
            .map(|bin| (bin.from_ns, bin.to_ns, bin.pairs))
            .collect()
    }

    #[test]
    fn every_pair_is_in_one_bin() {
        assert_eq!(bins(&mut [0, 0, 0]), [(0, 1, 3)]);
        assert_eq!(
            bins(&mut [-3, 11, 0, 1]),
            [(-4, -2, 1), (0, 2, 2), (10, 12, 1)]
        );
        assert_eq!(
            bins(&mut [250_000_000, 0, 283_000_000]),
            [(0, 50_000_000, 1), (250_000_000, 300_000_000, 2)]
        );
    }

    #[test]
    fn the_median_is_one_of_them() {
        let skew = SkewSummary::from_skews(&mut [4, 1, 3, 2]).unwrap();
        assert_eq!((skew.min_ns, skew.median_ns, skew.max_ns), (1, 3, 4));
        assert_eq!(SkewSummary::from_skews(&mut []), None);
    }

    #[test]
    fn the_farthest_stamps_fit() {
        assert_eq!(
            bins(&mut [i64::MIN, i64::MAX])
                .iter()
                .map(|bin| bin.2)
                .sum::<u64>(),
            2
        );
    }
}
