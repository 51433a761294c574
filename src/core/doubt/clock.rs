//! Causes of clocks that cannot be right.

use super::{Doubt, Subject};
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display, Formatter};

causes! {
    /// A cause of a topic's clock that cannot be right.
    ClockCure:

    Offset { lag: ClockLag, log: LogTimes } => (
        "by the log times its clock is {}: correct its stamps, or {log} takes log times for all \
         stamps",
        lag.words(LEFT))
    /// The clock of the right images, which `--right-offset-ms` shifts.
    RightOffset { lag: ClockLag, right_ms: f64 } => (
        "by the log times its clock is {}, and pairs by stamp are of different moments: \
         `--right-offset-ms {right_ms:.1}` corrects its stamps; 0 leaves them, if its images come \
         late",
        lag.words(LEFT))
    /// The clock of the left images, alone against all others.
    LeftOffset {
        lag: ClockLag, others: Vec<String>, right: String, right_ms: f64, log: LogTimes
    } => (
        "by the log times its clock is {}, and pairs by stamp are of different moments: {log} \
         takes log times for all stamps; `--right-offset-ms {right_ms:.1}` moves the right stamps \
         to this clock, for pairs alone; 0 leaves them",
        lag.words(&format!("those of {} and {right}", others.join(", "))))
    Step { step: ClockStep, log: LogTimes } => (
        "{}: correct its stamps, or {log} takes log times for all stamps", step.words("messages"))
    /// A step of a camera's clock against the other's.
    CameraStep { step: ClockStep, log: LogTimes } => (
        "{}: pairs by stamp are of different moments; {log} takes log times for all stamps, \
         `--right-offset-ms 0` leaves them",
        step.words("images"))
    Unit { unit: String, option: String, stamps_hz: f64, log_hz: f64 } => (
        "{stamps_hz:.0} messages a second by its stamps, {log_hz:.1} by the log times: its stamps \
         are {unit}, written as nanoseconds; `--stamps {option}` reads them so")
    /// The stamps count something.
    NoTime { stamps_hz: f64, log_hz: f64, log: LogTimes } => (
        "{stamps_hz:.0} messages a second by its stamps, {log_hz:.1} by the log times: its stamps \
         are no time, as those that count images; {log} takes log times for all stamps")
    /// Stamps are later than their log times.
    Early { topics: Vec<(String, ClockLag)>, log: LogTimes } => (
        "stamps are later than their log times, so that their clock is not the recorder's: {}; \
         {log} takes log times for all stamps",
        early_words(topics))
    /// `--stamps` names a unit in which they are beyond all times.
    BeyondAllTimes => (
        "in the unit that --stamps names its stamps are beyond the year 2554: leave it out")
    NoSuchUnit => (
        "--stamps names a unit that neither its stamps nor those of another topic have, by the log \
         times of 10 messages or more: leave it out")
    Copies { copies: usize, first: usize, distinct: usize, cure: CopyCure } => (
        "every message comes {}: the first {first} are {distinct} and copies of them; {cure}",
        if *copies == 2 { "twice".to_owned() } else { format!("{copies} times") })
    /// Some messages are copies, with stamps of their own.
    SomeCopies { copies: usize, first: usize } => (
        "{copies} of the first {first} messages are copies of the one before, with stamps of their \
         own: a copy is older than it says; record again without the node that repeats them")
}

/// The clock that others are compared with.
const LEFT: &str = "that of the left images";

/// The lag of a clock behind another, nanoseconds; negative if it is ahead.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClockLag {
    pub median_ns: i64,
    pub spread_ns: i64,
}

/// A step of a clock against that of the images of the other side, or a drift.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClockStep {
    /// True for the clock of the left images.
    pub is_left: bool,
    /// Stamps of the right images, or of another topic, less those of the left ones, before and
    /// after it, nanoseconds.
    pub from_ns: i64,
    pub to_ns: i64,
    /// Seconds after the beginning.
    pub after_s: f64,
}

/// The option that takes log times for all stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LogTimes {
    /// The largest skew of such pairs, if it is above the one that is permitted.
    pub max_skew_ms: Option<u64>,
}

/// The cure for messages that come several times.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum CopyCure {
    /// They are measurements.
    #[error("leave it out as a truth, or keep the first of each: a copy is as old as that")]
    LeaveOut,
    /// They have equal stamps.
    #[error("copies without partners are lost, which `--allow-loss {percent}%` allows")]
    AllowLoss { percent: usize },
    /// Messages of the cameras differ in number.
    #[error(
        "with a copy, a pair is of different moments: `{}--every {copies}` leaves those out",
        from_s.map_or(String::new(), |s| format!("--from {s:.3} "))
    )]
    Unequal { from_s: Option<f64>, copies: usize },
    #[error(
        "those of the two cameras alternate, so that no pair is of one moment: record again \
         without the node that repeats them"
    )]
    Alternate,
    #[error("`--every {copies}` takes each once")]
    Every { copies: usize },
}

impl ClockLag {
    fn words(self, whose: &str) -> String {
        let direction = if self.median_ns > 0 {
            "behind"
        } else {
            "ahead of"
        };
        format!(
            "{} s {direction} {whose} (median; spread {} s)",
            seconds(self.median_ns.saturating_abs()),
            seconds(self.spread_ns)
        )
    }
}

impl ClockStep {
    fn words(self, what: &str) -> String {
        let offset = |ns: i64| {
            let behind_ns = if self.is_left { -ns } else { ns };
            let direction = match behind_ns {
                ..-500_000 => "ahead",
                500_000.. => "behind",
                _ => return "none".to_owned(),
            };
            format!("{:.3} s {direction}", ns.unsigned_abs() as f64 / 1e9)
        };
        format!(
            "by the log times its clock steps or drifts against that of the {} images, from {} to \
             {}, {:.0} s after the beginning, unless the {what} come late from there",
            if self.is_left { "right" } else { "left" },
            offset(self.from_ns),
            offset(self.to_ns),
            self.after_s
        )
    }
}

impl Display for LogTimes {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.max_skew_ms {
            Some(ms) => write!(f, "`--stamps log --max-skew-ms {ms}`"),
            None => f.write_str("`--stamps log`"),
        }
    }
}

fn early_words(topics: &[(String, ClockLag)]) -> String {
    let words = topics.iter().map(|(topic, lag)| {
        let median = seconds(lag.median_ns.saturating_neg());
        let spread = seconds(lag.spread_ns);
        format!("{topic} by {median} s (median; spread {spread} s)")
    });
    words.collect::<Vec<_>>().join(", ")
}

fn seconds(ns: i64) -> String {
    format!("{:.3}", ns as f64 / 1e9)
}
