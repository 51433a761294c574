//! Identity and performance of an external matching program.

use crate::words::joined;
use serde::{Deserialize, Serialize};

/// The program behind an algorithm: its reported identity, and svl's measurements.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ProgramRecord {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// Compute device, such as `CPU` or `cuda:0`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threads: Option<usize>,
    /// Instruction set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub isa: Option<String>,
    /// Hash of its model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// True if it uses colour.
    pub color: bool,
    /// Number of pairs it accepts at once.
    pub batch: usize,
    /// Number of timed pairs: all but the first of each size, which may set up memory.
    pub pairs: u64,
    /// Median of its self-reported times per pair, microseconds.
    pub reported_us: u64,
    /// The part of it that prepared images, if reported.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preparing_us: Option<u64>,
    /// Median of the times from request to answer, per pair of a batch, microseconds.
    pub waited_us: u64,
    /// Disparities it returned, in all matchings,
    pub disparities: u64,
    /// and those outside its range, which count as invalid.
    pub out_of_range: u64,
    /// Peak memory, bytes, if the system reports it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_bytes: Option<usize>,
}

/// Largest difference between the times that the transfer may explain, microseconds.
const ODD_US: u64 = 20_000;

/// Fewest pairs for a meaningful median.
const MIN_MEDIAN_PAIRS: u64 = 3;

impl ProgramRecord {
    /// Identity and times of the program, in words.
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
                let preparing = self
                    .preparing_us
                    .map(|us| format!("{} of it preparing, ", ms(us)));
                let preparing = preparing.unwrap_or_default();
                format!("reports {reported} a pair, {preparing}answers after {waited}")
            }),
        ];
        joined(parts.into_iter().flatten())
    }

    /// Name, version and model, as far as reported.
    pub fn identity(&self) -> String {
        let parts = [&self.name, &self.version, &self.model];
        let said: Vec<_> = parts.into_iter().flatten().map(String::as_str).collect();
        if said.is_empty() {
            "a program that does not identify itself".to_owned()
        } else {
            said.join(" ")
        }
    }

    /// Combined with the counts of an earlier process. The times are those of the process with more
    /// pairs.
    #[must_use]
    pub fn after(self, earlier: &Self) -> Self {
        let timed = if earlier.pairs > self.pairs {
            earlier
        } else {
            &self
        };
        Self {
            reported_us: timed.reported_us,
            preparing_us: timed.preparing_us,
            waited_us: timed.waited_us,
            pairs: self.pairs + earlier.pairs,
            disparities: self.disparities + earlier.disparities,
            out_of_range: self.out_of_range + earlier.out_of_range,
            memory_bytes: self.memory_bytes.max(earlier.memory_bytes),
            ..self
        }
    }

    /// True if its self-reported time leaves out work: it answers much later.
    pub fn is_time_doubtful(&self) -> bool {
        let limit_us = self.reported_us + self.reported_us / 4 + ODD_US;
        self.waited_us > limit_us && self.pairs >= MIN_MEDIAN_PAIRS
    }

    /// Warnings about its numbers, for the user.
    pub fn warnings(&self) -> Vec<String> {
        let (reported, waited) = (self.reported_us as f64 / 1e3, self.waited_us as f64 / 1e3);
        let mut warnings = Vec::new();
        if self.is_time_doubtful() {
            warnings.push(format!(
                "reports {reported:.1} ms a pair but answers after {waited:.1} ms: its own time \
                 may omit work, for example on a device that it does not wait for; it is not \
                 ranked by time"
            ));
        }
        let is_long = self.reported_us > self.waited_us + self.waited_us / 20;
        if is_long && self.pairs >= MIN_MEDIAN_PAIRS {
            warnings.push(format!(
                "reports {reported:.1} ms a pair but answers after {waited:.1} ms, which is used"
            ));
        }
        if self.out_of_range > 0 {
            warnings.push(format!(
                "{} of the {} disparities that it gave are outside min_disparity to max_disparity \
                 and are discarded",
                self.out_of_range, self.disparities
            ));
        }
        warnings
    }
}
