//! The clock of each topic, by the proof beside its stamps: the log times.
//!
//! Offsets are compared with those of the left images at equal log times, so that a log clock that
//! runs at another speed, as that of a slowed simulation, is not taken for an offset.

use super::faults::{ClockCheck, ClockFault, copies, is_of_unit, wrong_option};
use super::measure::TopicClock;
use super::pixels;
use super::scan::ClockScan;
use crate::bags::opened::Recording;
use crate::cameras::topics::{self, Selection, choose};
use crate::cameras::transforms::Transforms;
use crate::pairs::steps::StepWatch;
use crate::stream::channel::{Channel, warn_of};
use crate::stream::restamped::StampRules;
use crate::stream::stamp_rule::{StampReading, StampRule};
use std::collections::BTreeMap;
use svl_core::Result;
use svl_core::doubt::Doubt;
use svl_core::stereo::Side;

/// The clocks of a source's topics.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct ClockTable {
    /// By name, as their stamps are read.
    pub topics: Vec<TopicClock>,
    /// The faults of them, each with its cure.
    pub faults: Vec<ClockFault>,
    #[serde(skip)]
    rules: BTreeMap<String, StampRule>,
    #[serde(skip)]
    watch: Option<StepWatch>,
}

impl ClockTable {
    /// The clocks of a recording that svl did not write; `None` if no two topics are its cameras.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`], [`svl_core::Error::Format`].
    pub(crate) fn read(recording: &Recording, selection: &Selection) -> Result<Option<Self>> {
        let channels = recording.channels()?;
        let Ok(images) = choose(&channels, selection) else {
            return Ok(None);
        };
        let scan = ClockScan::read(recording, &images, selection.to_ns)?;
        Ok(Some(Self::proved(
            &scan,
            &channels,
            selection,
            Some(recording),
        )))
    }

    /// The clocks of what was scanned, with the repairs that the user asked for.
    pub(crate) fn new(scan: &ClockScan, channels: &[&Channel], selection: &Selection) -> Self {
        Self::proved(scan, channels, selection, None)
    }

    /// The same, with the pixels of a recording where stamps and log times leave a doubt.
    fn proved(
        scan: &ClockScan,
        channels: &[&Channel],
        selection: &Selection,
        recording: Option<&Recording>,
    ) -> Self {
        let images = scan.images.each_ref().map(String::as_str);
        // A wrong name of one is told as the pairs are opened.
        let infos = topics::calibrations(channels, images, selection);
        let [_, info] = infos.unwrap_or_default();
        let right = [Some(images[Side::Right as usize].to_owned()), info.clone()];
        let mut rules = BTreeMap::new();
        for (name, topic) in &scan.topics {
            let rule = StampRule {
                reading: topic.reading(selection.stamps),
                begins_at_0: topic.begins_at_0(),
                shift_ns: if right.iter().flatten().any(|right| right == name) {
                    selection.right_offset_ns.unwrap_or_default()
                } else {
                    0
                },
            };
            if rule != StampRule::default() {
                rules.insert(name.clone(), rule);
            }
        }
        let clocks = scan.measured(&rules, info.as_deref());
        let are_late = |shift_ns, from_ns| {
            pixels::are_late(recording?, selection, &rules, (shift_ns, from_ns))
        };
        let check = ClockCheck::new(scan, &clocks, info.as_deref(), selection, &are_late);
        let mut faults = check.faults();
        let watch = check.watch();
        faults.extend(copies(scan));
        if selection.stamps.is_some() {
            faults.extend(wrong_option(scan, &clocks, &rules));
        }
        for topic in Transforms::other_robots(channels, images) {
            rules.entry(topic).or_default().reading = StampReading::Unread;
        }
        Self {
            topics: clocks,
            faults,
            rules,
            watch,
        }
    }

    /// The rules by which the stamps are read.
    pub(crate) fn rules(&self) -> StampRules {
        self.rules.clone().into()
    }

    /// A watch for steps of the right clock behind what was looked at.
    pub(crate) fn watch(&self) -> Option<StepWatch> {
        self.watch.clone()
    }

    /// Adds a step of a camera's clock, unless a fault of it is known.
    pub(crate) fn add_step(&mut self, step: Doubt) {
        if self
            .faults
            .iter()
            .all(|fault| fault.doubt.subject != step.subject)
        {
            self.faults.push(step.into());
        }
    }

    /// False if a fault permits no pair.
    pub(crate) fn permits_pairs(&self) -> bool {
        self.faults.iter().all(|fault| !fault.denies_pairs)
    }

    /// Warns of the faults of a source called `name`.
    ///
    /// # Errors
    /// The first that permits no pair.
    pub(crate) fn check(&self, name: &str) -> std::result::Result<(), &Doubt> {
        if let Some(fault) = self.faults.iter().find(|fault| fault.denies_pairs) {
            return Err(&fault.doubt);
        }
        for fault in &self.faults {
            warn_of(name, &fault.doubt);
        }
        Ok(())
    }

    /// Refuses a topic whose measurements are used, if its stamps cannot be.
    ///
    /// # Errors
    /// The fault of its stamps.
    pub(crate) fn check_measurements(&self, topic: &str) -> std::result::Result<(), &Doubt> {
        let mut doubts = self.faults.iter().map(|fault| &fault.doubt);
        match doubts.find(|doubt| doubt.subject.is_topic(topic) && is_of_unit(doubt)) {
            Some(fault) => Err(fault),
            None => Ok(()),
        }
    }
}
