//! Results of the algorithms so far, below the progress bar of `svl score`.

use super::Sink;
use parking_lot::Mutex;
use std::fmt::Write;
use std::sync::Arc;
use std::time::Duration;
use svl_core::Result;
use svl_score::judge::{Judged, Metric, MetricSource as _, MetricValues};

/// Largest number of algorithms that are shown.
const MAX_SHOWN: usize = 12;

/// A sink that sums up results, and shows them as text. Clones share them.
#[derive(Clone, Default)]
pub struct RunningTable(Arc<Mutex<Vec<LiveLine>>>);

#[derive(Default)]
struct LiveLine {
    algorithm: String,
    pairs: u32,
    sums: MetricValues,
    /// Absent for a map that others computed.
    time: Option<Duration>,
}

impl RunningTable {
    /// A line per algorithm, each after a line break.
    pub fn text(&self) -> String {
        let lines = self.0.lock();
        let names = lines.iter().map(|line| line.algorithm.chars().count());
        let width = names.take(MAX_SHOWN).max().unwrap_or(0).min(40);
        let mut text = String::new();
        for line in lines.iter().take(MAX_SHOWN) {
            let name: String = line.algorithm.chars().take(width).collect();
            let _ = write!(text, "\n{name:<width$}{}", line.words());
        }
        if let Some(more) = lines.len().checked_sub(MAX_SHOWN).filter(|more| *more > 0) {
            let _ = write!(text, "\nand {more} more");
        }
        text
    }
}

impl LiveLine {
    fn words(&self) -> String {
        let mut text = String::new();
        let judged = ["right", "wrong"].map(|name| (name, self.share(name)));
        let known = self.sums.get("known");
        let known = known.map(|sum| sum / f64::from(self.pairs));
        let shown = match judged[0].1 {
            Some(_) => &judged[..],
            None => &[("known", known)],
        };
        for (name, share) in shown {
            if let Some(share) = share {
                let _ = write!(text, "  {name} {:5.1} %", 100.0 * share);
            }
        }
        if let Some(time) = self.time {
            let ms = time.as_secs_f64() * 1e3 / f64::from(self.pairs);
            let _ = write!(text, "  {ms:7.2} ms per pair");
        }
        text
    }

    fn share(&self, name: &str) -> Option<f64> {
        self.sums.value(Metric::find(name)?)
    }
}

impl Sink for RunningTable {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        let mut lines = self.0.lock();
        for scored in &judged.estimates {
            let algorithm = &scored.estimate.algorithm;
            let place = match lines.iter().position(|line| line.algorithm == *algorithm) {
                Some(place) => place,
                None => {
                    lines.push(LiveLine {
                        algorithm: algorithm.clone(),
                        ..LiveLine::default()
                    });
                    lines.len() - 1
                }
            };
            let line = &mut lines[place];
            line.pairs += 1;
            if let Some(times) = scored.estimate.times {
                *line.time.get_or_insert_default() += times.total();
            }
            let before = std::mem::take(&mut line.sums);
            line.sums = MetricValues::from_fn(|metric| {
                let [sum, value] = [&before, &scored.metrics].map(|values| values.get(metric.name));
                match (sum, value) {
                    (Some(sum), Some(value)) => Some(sum + value),
                    (one, None) | (None, one) => one,
                }
            });
        }
        Ok(())
    }
}
