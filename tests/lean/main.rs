//! Tests of what a robot links: `svl-core` with `exec`, and `svl-calibrate`.
//!
//! One area alone: `cargo test --release --test lean sgm::`.

mod bm;
mod calibration_files;
mod claims;
#[path = "../common/mod.rs"]
mod common;
mod contract;
mod distortion;
mod dp;
mod exec;
mod expected;
mod gaps;
mod matchers;
mod oracle;
mod ranger;
mod rectify;
mod sgm;
mod solve;
mod thesis;
mod v3;
mod v5;
mod v5_levels;
mod v5_time;
