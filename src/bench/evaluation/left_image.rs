//! The left images of the pairs of a report, from where the report has them.

use crate::sink::left_image;
use crate::source::open::sources::{SourceKind, open_recording};
use crate::source::opened::request::Request;
use std::path::Path;
use svl_core::Error;
use svl_core::stereo::{Frame, hash_words};
use svl_recording::Reader;
use svl_report::Row;
use svl_report::units::StoredImage;
use svl_score::manifest::Manifest;
use svl_score::scenario::SourceOptions;
use svl_sim::arena::Arena;

/// Seconds behind the first pair from which on a pair is looked for by its time.
const MIN_JUMP_S: f64 = 5.0;

/// The left image of a row of a report: rendered again, or read from the recording at its original
/// path.
///
/// # Errors
/// The reason why it is not there: the recording moved, changed, or was live.
pub fn find_left(manifest: &Manifest, row: &Row) -> Result<StoredImage, String> {
    let is_own = |frame: &Frame| hash_words(frame.pair.hash()) == row.pair_hash;
    let frame = find_pair(manifest, row, &is_own)?;
    let file = left_image(&frame).map_err(|e| e.to_string())?;
    Ok((file, frame.pair.size()))
}

fn find_pair(
    manifest: &Manifest,
    row: &Row,
    is_own: &dyn Fn(&Frame) -> bool,
) -> Result<Frame, String> {
    let words = |e: Error| e.to_string();
    if let (Some(config), Some(seed)) = (manifest.part("arena").map_err(words)?, row.seed) {
        let frame = Arena::new(&config, seed).and_then(|arena| arena.frame(row.sequence));
        let frame = frame.map_err(words)?;
        return Some(frame)
            .filter(is_own)
            .ok_or_else(|| "the arena is another one".to_owned());
    }
    let mut runs = manifest.runs.iter();
    let record = runs.find(|record| Some(&record.name) == row.run.as_ref());
    let record = record.ok_or("its recording is not in the manifest")?;
    let path = &record.path;
    if SourceKind::are_topics(path) || SourceKind::are_cameras(path) {
        return Err(format!("{path} was live"));
    }
    if !Path::new(path).exists() {
        return Err(format!("{path} is not there: it moved"));
    }
    let other = || format!("{path} has other pixels there: it changed");
    // That of svl has an index; options may have changed its pairs.
    let own = Reader::open(path).and_then(|mut reader| {
        reader.seek(row.sequence)?;
        reader.next_pair()
    });
    if let Some(frame) = own.ok().flatten().filter(is_own) {
        return Ok(frame);
    }
    let options: SourceOptions = manifest.part("source").map_err(words)?.unwrap_or_default();
    let open = |from_s: Option<f64>| {
        let options = SourceOptions {
            from_s: from_s.or(options.from_s),
            ..options.clone()
        };
        let request = Request {
            options,
            ..Request::new(path)
        };
        open_recording(&request).map_err(words)
    };
    let mut opened = open(None)?;
    let first = opened.source.next().map_err(words)?.ok_or_else(other)?;
    if is_own(&first) {
        return Ok(first);
    }
    let after_s = row.stamp_ns.saturating_sub(first.stamp_ns) as f64 / 1e9;
    // A jump there, but not among the pairs that `every` chooses from the first on.
    if after_s > MIN_JUMP_S && options.from_s.is_none() && options.every.is_none() {
        opened = open(Some(after_s - 1.0))?;
    }
    while let Some(frame) = opened.source.next().map_err(words)? {
        if is_own(&frame) {
            return Ok(frame);
        }
        if frame.stamp_ns > row.stamp_ns {
            break;
        }
    }
    Err(other())
}
