//! Pairs of a report, found again where they came from.

use crate::sink::left_image;
use svl_core::stereo::Frame;
use svl_recording::Reader;
use svl_report::units::StoredImage;
use svl_report::{Row, hash_words};
use svl_score::manifest::Manifest;
use svl_sim::arena::Arena;

/// The left image of a row of a report, which has its recording under the name `run`: rendered
/// again, or read from svl's recording at its original path. None if it is not there, or if the
/// pair has other pixels.
pub fn find_left(manifest: &Manifest, run: Option<&str>, row: &Row) -> Option<StoredImage> {
    let frame = find_pair(manifest, run, row)?;
    let is_same = hash_words(frame.pair.hash()) == row.pair_hash;
    let file = is_same.then(|| left_image(&frame))?.ok()?;
    Some((file, frame.pair.size()))
}

fn find_pair(manifest: &Manifest, run: Option<&str>, row: &Row) -> Option<Frame> {
    if let (Some(config), Some(seed)) = (manifest.part("arena").ok()?, row.seed) {
        return Arena::new(&config, seed).ok()?.frame(row.sequence).ok();
    }
    let mut runs = manifest.runs.iter();
    let record = runs.find(|record| Some(&*record.name) == run)?;
    let mut reader = Reader::open(&record.path).ok()?;
    reader.seek(row.sequence).ok()?;
    reader.next_pair().ok()?
}
