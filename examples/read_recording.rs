//! Read a recording, svl's or a ROS 2 bag: what every pair holds.
//!
//! `cargo run --release --example read_recording -- run.mcap`

use std::path::Path;
use svl::source::{RecordingSource, Source};
use svl::stereo::Geometry;

/// Returns the number of pairs.
pub fn read(recording: &Path) -> svl::Result<u64> {
    let mut source = RecordingSource::open(recording)?;
    let mut pairs = 0;
    while let Some(frame) = source.next()? {
        let (width, height) = frame.pair.size();
        let geometry = match frame.geometry {
            Geometry::Raw => "raw",
            Geometry::Rectified(None) => "rectified",
            Geometry::Rectified(Some(_)) => "rectified, calibrated",
        };
        let truth = if frame.truth.is_some() {
            ", with truth"
        } else {
            ""
        };
        let skew = frame.exposure.skew_ns;
        let skew = skew.map_or("not known".to_owned(), |ns| {
            format!("{:.1} µs", ns as f64 / 1e3)
        });
        println!(
            "{:.3} s: {width}x{height}, {geometry}{truth}, skew {skew}",
            frame.stamp_ns as f64 / 1e9
        );
        pairs += 1;
    }
    let losses = source.finish(pairs);
    println!("{pairs} pairs; {} could not be read", losses.unreadable);
    Ok(pairs)
}

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let recording = std::env::args()
        .nth(1)
        .ok_or("usage: read_recording FILE.mcap")?;
    read(recording.as_ref())?;
    Ok(())
}
