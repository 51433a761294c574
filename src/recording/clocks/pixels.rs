//! The pixels of pairs: images that come late are told from a clock that is off.

use crate::bags::opened::Recording;
use crate::cameras::topics::Selection;
use crate::pairs::pair_reader::PairReader;
use crate::stream::channel::FileEvent;
use crate::stream::stamp_rule::StampRule;
use std::collections::BTreeMap;
use svl_core::rectify::AlignmentMeter;
use svl_core::{Error, Result};

/// One in this many pairs is measured, up to this many in all: a robot may stand at first.
const EVERY: usize = 8;
const MAX_MEASURED: usize = 25;

/// True if the pairs logged from `from_ns` on are aligned by their stamps, and not with the right
/// ones shifted by `shift_ns`; false for the reverse; `None` if the pixels tell neither, as of
/// cameras that stand.
pub(crate) fn are_late(
    recording: &Recording,
    selection: &Selection,
    rules: &BTreeMap<String, StampRule>,
    (shift_ns, from_ns): (i64, u64),
) -> Option<bool> {
    let measured = |shift_ns| measure(recording, selection, rules, (shift_ns, from_ns)).ok();
    let (as_written, shifted) = (measured(0)?, measured(shift_ns)?);
    if as_written.is_better_than(&shifted) {
        return Some(true);
    }
    shifted.is_better_than(&as_written).then_some(false)
}

fn measure(
    recording: &Recording,
    selection: &Selection,
    rules: &BTreeMap<String, StampRule>,
    (shift_ns, from_ns): (i64, u64),
) -> Result<AlignmentMeter> {
    let channels = recording.channels()?;
    let images = crate::cameras::topics::choose(&channels, selection).map_err(Error::other)?;
    let mut rules = rules.clone();
    let rule = rules.entry(images[1].clone()).or_default();
    rule.shift_ns = rule.shift_ns.saturating_add(shift_ns);
    let recording = recording.restamped(rules.into());
    let cameras = channels
        .into_iter()
        .filter(|channel| images.contains(&channel.topic));
    let cameras: Vec<_> = cameras.collect();
    let pairs = PairReader::new(String::new(), &cameras, selection, false);
    let mut pairs = pairs.map_err(Error::other)?;
    pairs.warned.extend(["stamps", "equal stamps"]);
    let (mut meter, mut taken) = (AlignmentMeter::new(), 0);
    for file in recording.files() {
        let mut messages = file.messages()?;
        while taken < EVERY * MAX_MEASURED
            && let Some(event) = messages.next()?
        {
            if let FileEvent::Message(channel, log_ns, data) = event
                && log_ns >= from_ns
            {
                // Messages that cannot be read are reported with the pairs.
                drop(pairs.take_in(channel, log_ns, &data));
            }
            while let Some(pair) = pairs.pop() {
                if taken % EVERY == 0
                    && let Ok(frame) = pair
                {
                    meter.add(&frame.pair);
                }
                taken += 1;
            }
        }
    }
    Ok(meter)
}
