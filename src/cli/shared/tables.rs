//! Lines that several commands print of a recording.

use std::collections::BTreeMap;
use svl::counted;
use svl::recording::Loss;

/// Gaps and losses that are listed one by one.
pub(crate) const LISTED: usize = 5;

/// What cannot be read of a file, a line each.
pub(crate) fn losses(losses: &[Loss]) -> Vec<String> {
    let part = |Loss {
                    at_byte,
                    bytes,
                    reason,
                }: &Loss| match bytes {
        0 => format!("lost       at byte {at_byte}: {reason}"),
        1..1000 => format!(
            "lost       {} at byte {at_byte}: {reason}",
            counted(*bytes, "byte")
        ),
        _ => format!("lost       {} at byte {at_byte}: {reason}", size(*bytes)),
    };
    let mut lines: Vec<_> = losses.iter().take(LISTED).map(part).collect();
    if losses.len() > LISTED {
        lines.push(format!(
            "           and {} more; --json lists them",
            losses.len() - LISTED
        ));
    }
    lines
}

/// What the file's own summary promises and it does not hold.
pub(crate) fn missing(missing: &BTreeMap<String, u64>) -> Vec<String> {
    missing
        .iter()
        .map(|(topic, n)| format!("missing    {} of {topic}", counted(*n, "message")))
        .collect()
}

pub(crate) fn size(bytes: u64) -> String {
    match bytes {
        ..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000.. => format!("{:.1} MB", bytes as f64 / 1e6),
    }
}
