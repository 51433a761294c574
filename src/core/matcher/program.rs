//! What is known of a program that matches.

use crate::words::joined;
use serde::{Deserialize, Serialize};

/// A program behind an algorithm: what it says that it is, and what svl saw of it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ProgramRecord {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// What it computes on, as `CPU` or `cuda:0`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threads: Option<usize>,
    /// Its instruction set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub isa: Option<String>,
    /// Hash of its model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Whether it takes colour.
    pub color: bool,
    /// How many pairs it takes at once.
    pub batch: usize,
    /// Pairs of which the times are: without the first of each size, which may set up memory.
    pub pairs: u64,
    /// Median of the times that it reports for a pair, microseconds.
    pub reported_us: u64,
    /// Median of the times from the request to the answer, of a batch by pair, microseconds.
    pub waited_us: u64,
    /// Disparities that it gave, in all matchings,
    pub disparities: u64,
    /// and of these the ones outside its range, which count as none.
    pub out_of_range: u64,
    /// The most memory that it had, bytes, where the system tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_bytes: Option<usize>,
}

/// Difference of the times that is no matter of the transfer, microseconds.
const ODD_US: u64 = 20_000;

/// Fewer pairs say nothing of a median.
const ENOUGH_PAIRS: u64 = 3;

impl ProgramRecord {
    /// What it is and how long it took, in words.
    pub fn words(&self) -> String {
        let ms = |us: u64| format!("{:.1} ms", us as f64 / 1e3);
        let name = self.name.clone().map(|name| match &self.version {
            Some(version) => format!("{name} {version}"),
            None => name,
        });
        let several = |n: usize| if n == 1 { "" } else { "s" };
        let threads = self.threads.map(|n| format!("{n} thread{}", several(n)));
        let parts = [
            name,
            self.device.clone(),
            threads,
            self.isa.clone(),
            self.model.as_ref().map(|model| format!("model {model}")),
            self.color.then(|| "in colour".to_owned()),
            (self.batch > 1).then(|| format!("{} pairs at once", self.batch)),
            (self.pairs > 0).then(|| {
                let (reported, waited) = (ms(self.reported_us), ms(self.waited_us));
                format!("reports {reported} a pair, answers after {waited}")
            }),
        ];
        joined(parts.into_iter().flatten())
    }

    /// Name, version and model, as far as it says them.
    pub fn identity(&self) -> String {
        let parts = [&self.name, &self.version, &self.model];
        let said: Vec<_> = parts.into_iter().flatten().map(String::as_str).collect();
        if said.is_empty() {
            "a program that does not say what it is".to_owned()
        } else {
            said.join(" ")
        }
    }

    /// With the counts of an earlier process. The times are of the one with more pairs.
    #[must_use]
    pub fn after(self, earlier: &Self) -> Self {
        let timed = if earlier.pairs > self.pairs {
            earlier
        } else {
            &self
        };
        Self {
            reported_us: timed.reported_us,
            waited_us: timed.waited_us,
            pairs: self.pairs + earlier.pairs,
            disparities: self.disparities + earlier.disparities,
            out_of_range: self.out_of_range + earlier.out_of_range,
            memory_bytes: self.memory_bytes.max(earlier.memory_bytes),
            ..self
        }
    }

    /// True if the time that it reports leaves out work: it answers far later.
    pub fn is_time_doubtful(&self) -> bool {
        let limit_us = self.reported_us + self.reported_us / 4 + ODD_US;
        self.waited_us > limit_us && self.pairs >= ENOUGH_PAIRS
    }

    /// What its user should know before its numbers are believed.
    pub fn warnings(&self) -> Vec<String> {
        let (reported, waited) = (self.reported_us as f64 / 1e3, self.waited_us as f64 / 1e3);
        let mut warnings = Vec::new();
        if self.is_time_doubtful() {
            warnings.push(format!(
                "reports {reported:.1} ms a pair but answers after {waited:.1} ms: its own time \
                 may leave out work, as that of a device that was not waited for; it is not ranked \
                 by time"
            ));
        }
        let is_long = self.reported_us > self.waited_us + self.waited_us / 20;
        if is_long && self.pairs >= ENOUGH_PAIRS {
            warnings.push(format!(
                "reports {reported:.1} ms a pair but answers after {waited:.1} ms, which counts"
            ));
        }
        if self.out_of_range > 0 {
            warnings.push(format!(
                "{} of the {} disparities that it gave lie outside min_disparity to \
                 max_disparity and count as none",
                self.out_of_range, self.disparities
            ));
        }
        warnings
    }
}
