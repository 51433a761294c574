//! Whether the stamps of pairs and measurements are of one clock.

use super::{FileEvent, Recording, kind};
use svl_core::Result;

/// A measurement that is farther from its pair may be of another clock: then all stamps are looked
/// at, once.
pub(super) const SUSPICIOUS_NS: u64 = 1_000_000_000;

/// Compares the stamps of the left images and of the measurements, the two topics.
///
/// # Errors
/// [`svl_core::Error::Io`]. Inner: both ranges, where they do not overlap.
pub(super) fn check(
    recording: &Recording,
    topics: [&str; 2],
    limit_ns: u64,
) -> Result<std::result::Result<(), String>> {
    let mut ranges: [Option<(u64, u64)>; 2] = [None; 2];
    for file in recording.files() {
        let mut messages = file.messages()?;
        // Damage is reported with the pairs.
        while let Ok(Some(event)) = messages.next() {
            let FileEvent::Message {
                channel,
                log_time,
                data,
            } = event
            else {
                continue;
            };
            let Some(which) = topics.iter().position(|topic| *topic == channel.topic) else {
                continue;
            };
            let Ok((stamp, _)) = kind::head(channel, &data) else {
                continue;
            };
            let stamp = stamp.unwrap_or(log_time);
            let (first, last) = ranges[which].unwrap_or((stamp, stamp));
            ranges[which] = Some((first.min(stamp), last.max(stamp)));
        }
    }
    let [Some(images), Some(measured)] = ranges else {
        return Ok(Ok(()));
    };
    let apart = |a: (u64, u64), b: (u64, u64)| a.1.saturating_add(limit_ns) < b.0;
    if !apart(images, measured) && !apart(measured, images) {
        return Ok(Ok(()));
    }
    let range = |(first, last): (u64, u64)| {
        format!("{:.3} to {:.3} s", first as f64 / 1e9, last as f64 / 1e9)
    };
    Ok(Err(format!(
        "its stamps are of another time: the left images are from {}, the measurements from {}",
        range(images),
        range(measured)
    )))
}
