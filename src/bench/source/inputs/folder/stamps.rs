//! Stamps of the images in a folder: from files beside them, or from their names.

use super::layout::{Layout, stem};
use super::pairs::PairFiles;
use std::collections::HashMap;
use std::path::Path;
use svl_core::{Error, Result, inputs};
use svl_files::{IMAGE_ENDINGS, read_text};

/// Limit of the size of a file of stamps, in bytes: some million lines.
const MAX_BYTES: u64 = 1 << 28;
const SECOND_NS: u64 = 1_000_000_000;
/// The stamps that a recording can have, and that names are read as: 2001 to 2038.
const EPOCH_S: std::ops::Range<u64> = 1_000_000_000..i32::MAX as u64;

/// Stamp of the left image and skew of the right one, nanoseconds.
pub(crate) type Stamp = (u64, Option<i64>);

/// The stamps of all pairs; none if they are not known.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for a malformed file of stamps.
pub(crate) fn stamps(
    folder: &Path,
    layout: Option<&Layout>,
    pairs: &[PairFiles],
) -> Result<Option<Vec<Stamp>>> {
    if let Some(files) = layout.and_then(|layout| layout.stamps) {
        let [left, right] = files.map(|name| folder.join(name));
        let lefts = StampFile::read(&left)?;
        // One file for both cameras does not give the time of the right image.
        let rights = if left == right {
            None
        } else {
            StampFile::read(&right)?
        };
        if let Some(lefts) = lefts {
            let stamp = |pair: &PairFiles| {
                let stamp = lefts.stamp(&pair.key, &pair.left)?;
                let right = rights.as_ref().zip(pair.right.as_ref());
                let right = right.and_then(|(rights, image)| rights.stamp(&pair.key, image));
                Some((
                    stamp,
                    right.map(|right| right.wrapping_sub(stamp).cast_signed()),
                ))
            };
            let Some(missing) = pairs.iter().find(|pair| stamp(pair).is_none()) else {
                return Ok(Some(pairs.iter().filter_map(stamp).collect()));
            };
            let image = missing
                .left
                .file_name()
                .unwrap_or_default()
                .to_string_lossy();
            tracing::warn!(
                "{}: has no stamp of {image}, so it is left out",
                left.display()
            );
        }
    }
    let named: Option<Vec<_>> = pairs.iter().map(|pair| epoch_ns(&pair.key)).collect();
    let named = named.filter(|stamps| stamps.is_sorted_by(|a, b| a < b));
    // One name for both images does not give it either.
    Ok(named.map(|stamps| stamps.into_iter().map(|ns| (ns, None)).collect()))
}

/// The time in a file name, nanoseconds: seconds, milli-, micro- or nanoseconds since 1970, by the
/// number of digits, or seconds with a fraction.
pub(crate) fn epoch_ns(key: &[u8]) -> Option<u64> {
    let text = std::str::from_utf8(key).ok()?;
    let text = text.trim_matches(|c: char| !c.is_ascii_digit());
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let ns = match text.split_once(['.', '_', '-']) {
        Some((whole, part)) if whole.len() == 10 && (1..=9).contains(&part.len()) => {
            (digits(whole) && digits(part)).then(|| format!("{whole}{part:0<9}"))?
        }
        None if [10, 13, 16, 19].contains(&text.len()) && digits(text) => format!("{text:0<19}"),
        _ => return None,
    };
    let ns = ns.parse().ok()?;
    EPOCH_S.contains(&(ns / SECOND_NS)).then_some(ns)
}

/// A file of stamps.
enum StampFile {
    /// EuRoC's `data.csv`: nanoseconds by the names of the images.
    ByName(HashMap<String, u64>),
    /// KITTI's `timestamps.txt` and `times.txt`: a line for each image, by their numbers.
    ByNumber(Vec<u64>),
}

impl StampFile {
    /// None without such a file.
    fn read(path: &Path) -> Result<Option<Self>> {
        if !inputs::is_file(path) {
            return Ok(None);
        }
        let text = read_text(path, MAX_BYTES)?;
        let is_csv = path.extension().is_some_and(|ending| ending == "csv");
        let lines = text
            .lines()
            .enumerate()
            .map(|(i, line)| (i + 1, line.trim()));
        let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let wrong = |i: usize, line: &str, what: &str| {
            let line: String = line.chars().take(60).collect();
            Error::format(path, format!("line {i}, '{line}': expected {what}"))
        };
        if is_csv {
            let entry = |(i, line): (usize, &str)| {
                let (ns, name) = line.split_once(',').unwrap_or_default();
                let ns = ns.trim().parse();
                let ns = ns.map_err(|_| wrong(i, line, "nanoseconds, a comma and a file name"))?;
                Ok((name.trim().to_owned(), ns))
            };
            let stamps = lines.map(entry).collect::<Result<_>>()?;
            return Ok(Some(Self::ByName(stamps)));
        }
        let stamp = |(i, line): (usize, &str)| {
            time_ns(line).ok_or_else(|| wrong(i, line, "seconds, or a date and time"))
        };
        let stamps = lines.map(stamp).collect::<Result<_>>()?;
        Ok(Some(Self::ByNumber(stamps)))
    }

    fn stamp(&self, key: &[u8], image: &Path) -> Option<u64> {
        match self {
            Self::ByName(stamps) => {
                let name = image.file_name()?;
                let listed = name.to_str().and_then(|name| stamps.get(name));
                // Images may have been converted to another format.
                let stem = || stem(name.as_encoded_bytes(), IMAGE_ENDINGS);
                let stem = || String::from_utf8(stem()?.to_owned()).ok();
                listed
                    .or_else(|| stamps.get(&format!("{}.png", stem()?)))
                    .copied()
            }
            Self::ByNumber(stamps) => {
                let number: usize = std::str::from_utf8(key).ok()?.parse().ok()?;
                stamps.get(number).copied()
            }
        }
    }
}

/// Seconds, as 1.036224e-01, or KITTI's 2011-09-26 13:02:25.964389445.
fn time_ns(text: &str) -> Option<u64> {
    if let Ok(seconds) = text.parse::<f64>() {
        let is_stamp = (0.0..EPOCH_S.end as f64).contains(&seconds);
        return is_stamp.then(|| (seconds * 1e9).round() as u64);
    }
    let time: jiff::civil::DateTime = text.parse().ok()?;
    // The time zone does not matter: it is the same for all.
    let since = time.to_zoned(jiff::tz::TimeZone::UTC).ok()?.timestamp();
    u64::try_from(since.as_nanosecond()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_are_times_are_parsed() {
        let ns = 1_403_715_273_262_142_976;
        for (name, expected) in [
            ("1403715273262142976", Some(ns)),
            ("1403715273262142", Some(1_403_715_273_262_142_000)),
            ("1403715273262", Some(1_403_715_273_262_000_000)),
            ("_1403715273", Some(1_403_715_273_000_000_000)),
            ("1403715273.262142976", Some(ns)),
            ("frame_1403715273_5", Some(1_403_715_273_500_000_000)),
            ("0000000012", None),
            ("00000012", None),
            ("9403715273", None),
            ("14037152732621429760", None),
            ("1403715273.x1", None),
            ("", None),
        ] {
            assert_eq!(epoch_ns(name.as_bytes()), expected, "{name}");
        }
    }

    #[test]
    fn times_of_kitti_are_parsed() {
        assert_eq!(time_ns("1.036224e-01"), Some(103_622_400));
        let date = time_ns("2011-09-26 13:02:25.964389445").unwrap();
        assert_eq!(date, 1_317_042_145_964_389_445);
        assert_eq!(time_ns("-1"), None);
        assert_eq!(time_ns("yesterday"), None);
        assert_eq!(time_ns("nan"), None);
    }
}
