//! Counts of what a source has in no frame.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Everything from a source that is in no frame, by reason.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Losses {
    /// Images without a partner, while both cameras had images.
    pub unpaired: u64,
    /// The stamps of these, where the source knows them.
    #[serde(skip)]
    pub unpaired_ns: Vec<u64>,
    /// Images before the other camera's first or after its last: not a loss.
    pub outside: u64,
    /// Images that arrived after those of their time had been dropped: the file is not ordered by
    /// stamp.
    pub late: u64,
    /// Pairs that cannot be read.
    pub unreadable: u64,
    /// Unreadable messages other than images, by topic: their pairs are used without them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub broken: BTreeMap<String, u64>,
    /// Pairs that a full queue dropped.
    #[serde(default)]
    pub dropped: u64,
    /// Pairs in whose place a newer one was matched: not a loss.
    #[serde(default)]
    pub replaced: u64,
    /// Images that the network lost, by the numbers of their publishers.
    #[serde(default)]
    pub lost_images: u64,
    /// Pairs of which it lost both images.
    #[serde(default)]
    pub lost_pairs: u64,
    /// Frames for which the requested truth has no measurement, if it has any.
    pub without_truth: u64,
    /// Frames whose measurement is of another time and cannot be moved to theirs, as the poses
    /// jump in between.
    pub jumped: u64,
    /// Pairs that an earlier recording of the run has too, by its name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub copies: BTreeMap<String, u64>,
    /// Pixels of the truth that are impossible, and dropped.
    pub impossible: u64,
    /// Frames of a truncated or corrupt video.
    pub cut: u64,
    /// Pairs that were not requested.
    pub skipped: u64,
    /// Counts of a synchronized grabber.
    #[serde(skip)]
    pub grabber: Option<GrabberReport>,
}

impl Losses {
    /// Number of pairs lost; an image without a partner counts as one.
    pub fn lost(&self) -> u64 {
        // A late image has no partner, either, nor has that of a lost one.
        let alone = self.lost_images.saturating_sub(2 * self.lost_pairs);
        let unpaired = self.unpaired.max(self.late).max(alone);
        unpaired + self.unreadable + self.cut + self.dropped + self.lost_pairs
    }

    /// Adds those of another run; the last grabber report is kept.
    pub fn add(&mut self, other: Self) {
        let Self {
            unpaired,
            unpaired_ns,
            outside,
            late,
            unreadable,
            broken,
            dropped,
            replaced,
            lost_images,
            lost_pairs,
            without_truth,
            jumped,
            copies,
            impossible,
            cut,
            skipped,
            grabber,
        } = other;
        self.unpaired += unpaired;
        self.unpaired_ns.extend(unpaired_ns);
        self.outside += outside;
        self.late += late;
        self.unreadable += unreadable;
        for (topic, messages) in broken {
            *self.broken.entry(topic).or_default() += messages;
        }
        self.dropped += dropped;
        self.replaced += replaced;
        self.lost_images += lost_images;
        self.lost_pairs += lost_pairs;
        self.without_truth += without_truth;
        self.jumped += jumped;
        for (run, pairs) in copies {
            *self.copies.entry(run).or_default() += pairs;
        }
        self.impossible += impossible;
        self.cut += cut;
        self.skipped += skipped;
        self.grabber = grabber.or(self.grabber.take());
    }
}

/// Final counts of a synchronized grabber.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GrabberReport {
    /// For the metadata of a recording.
    pub facts: BTreeMap<String, String>,
    /// For the terminal.
    pub text: String,
}
