//! Counts of a run: pulses, images, pairs, drops by reason, skew and latency.

use super::pairing::{Unpaired, UnpairedCounts};
use hdrhistogram::Histogram;
use std::collections::BTreeMap;
use std::fmt;
use svl_core::counted;

/// Counts of a run. They cover every image and pair: `frames` = 2 · `pairs` + `unpaired`, and
/// `pairs` = written + `dropped` + `unread`.
#[derive(Clone, Debug)]
pub struct Tally {
    /// Pulses sent to the cameras.
    pub pulses: u64,
    /// Pulses counted by the trigger but not requested by svl.
    pub stray_pulses: u64,
    /// Images of the left and of the right camera.
    pub frames: [u64; 2],
    pub pairs: u64,
    /// Unpaired images by reason, in the order of [`Unpaired::ALL`].
    pub unpaired: UnpairedCounts,
    /// Pairs dropped because the queue was full.
    pub dropped: u64,
    /// Number of times the grabber waited for the writer (backpressure).
    pub waited: u64,
    /// Pairs grabbed after the writer's last.
    pub unread: u64,
    /// Skew of the pairs, |right − left stamp|, nanoseconds.
    pub skew_ns: Histogram<u64>,
    /// Latency of the pairs, from the middle of the exposure until written, nanoseconds.
    pub latency_ns: Histogram<u64>,
}

/// Three digits of values up to an hour: 50 kB, however long the run.
fn histogram() -> Histogram<u64> {
    // The constants are within the bounds of its documentation.
    Histogram::new_with_bounds(1, 3_600_000_000_000, 3).expect("valid bounds")
}

impl Default for Tally {
    fn default() -> Self {
        let (skew_ns, latency_ns) = (histogram(), histogram());
        Self {
            pulses: 0,
            stray_pulses: 0,
            frames: [0; 2],
            pairs: 0,
            unpaired: Default::default(),
            dropped: 0,
            waited: 0,
            unread: 0,
            skew_ns,
            latency_ns,
        }
    }
}

impl Tally {
    /// Images that are in no recording: unpaired, or in a dropped pair.
    pub fn drops(&self) -> u64 {
        self.unpaired.iter().sum::<u64>() + 2 * self.dropped
    }

    /// Images that are unpaired for such reasons.
    pub fn count(&self, is: impl Fn(Unpaired) -> bool) -> u64 {
        let counts = self.reasons().filter(|(reason, _)| is(*reason));
        counts.map(|(_, n)| n).sum()
    }

    /// The reasons that left images unpaired, with their numbers.
    fn reasons(&self) -> impl Iterator<Item = (Unpaired, u64)> {
        let counts = Unpaired::ALL.into_iter().zip(self.unpaired);
        counts.filter(|(_, n)| *n > 0)
    }

    /// The counts by name, and all of them in one line as `counts`.
    pub fn facts(&self) -> BTreeMap<String, String> {
        let [left, right] = self.frames;
        let counts = [
            ("pulses", self.pulses),
            ("stray_pulses", self.stray_pulses),
            ("left_images", left),
            ("right_images", right),
            ("pairs", self.pairs),
            ("dropped_pairs", self.dropped),
            ("unread_pairs", self.unread),
            ("waits", self.waited),
        ];
        let counts = counts
            .into_iter()
            .map(|(name, n)| (name.to_owned(), n.to_string()));
        // Reasons that did not occur are omitted; the counts above are always there.
        let unpaired = self
            .reasons()
            .map(|(reason, n)| (format!("unpaired_{}", reason.name()), n.to_string()));
        counts
            .chain(unpaired)
            .chain([("counts".to_owned(), self.to_string())])
            .collect()
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.pulses > 0 {
            write!(f, "{}, ", counted(self.pulses, "pulse"))?;
        }
        if self.stray_pulses > 0 {
            write!(f, "{} more that svl did not request, ", self.stray_pulses)?;
        }
        let [left, right] = self.frames;
        write!(
            f,
            "{left} left and {}, {}; ",
            counted(right, "right image"),
            counted(self.pairs, "pair")
        )?;
        let unpaired: Vec<_> = self
            .reasons()
            .map(|(reason, n)| format!("{n} {}", reason.words()))
            .collect();
        if unpaired.is_empty() {
            write!(f, "none unpaired; ")?;
        } else {
            write!(f, "unpaired: {}; ", unpaired.join(", "))?;
        }
        write!(
            f,
            "{} dropped by a full queue, {} for the writer",
            counted(self.dropped, "pair"),
            counted(self.waited, "wait")
        )?;
        if self.unread > 0 {
            write!(f, ", {} grabbed beyond the end", self.unread)?;
        }
        for (name, times) in [("skew", &self.skew_ns), ("latency", &self.latency_ns)] {
            if !times.is_empty() {
                write!(f, "; {name} {}", Percentiles(times))?;
            }
        }
        Ok(())
    }
}

/// In milliseconds.
struct Percentiles<'a>(&'a Histogram<u64>);

impl fmt::Display for Percentiles<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |quantile| self.0.value_at_quantile(quantile) as f64 / 1e6;
        write!(
            f,
            "p50 {:.3} p99 {:.3} max {:.3} ms",
            ms(0.5),
            ms(0.99),
            ms(1.0)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_nothing_are_not_shown() {
        let mut tally = Tally::default();
        assert!(
            tally.to_string().ends_with("0 waits for the writer"),
            "{tally}"
        );
        tally.skew_ns.saturating_record(1_000_000);
        assert!(
            tally.to_string().contains("; skew p50 1.000")
                && !tally.to_string().contains("latency"),
            "{tally}"
        );
    }
}
