//! Grab pairs from two simulated cameras in real time, the right one up to 10 ms late.
//!
//! `cargo run --release --example simulated_cameras`. With `v4l2:/dev/video0,/dev/video2` in place
//! of `sim:…` the cameras are real.

use svl::grab::{GrabRequest, Host};
use svl::source::{CameraSource, Source};

const CAMERAS: &str = "sim:size=320x240,pictures=4,right.jitter_ms=10";

pub fn main() -> svl::Result<()> {
    let request = GrabRequest {
        rate_hz: Some(60.0),
        ..GrabRequest::default()
    };
    let mut source = CameraSource::open(CAMERAS, &request, Host::default())?;
    let mut pairs = 0;
    while pairs < 20 {
        let Some(frame) = source.next()? else { break };
        let skew_us = frame.exposure.skew_ns.unwrap_or(0) as f64 / 1e3;
        println!("pulse {}: skew {skew_us:.1} µs", frame.exposure.trigger_id);
        pairs += 1;
    }
    let losses = source.finish(pairs);
    println!("{pairs} pairs; {} images unpaired", losses.unpaired);
    Ok(())
}
