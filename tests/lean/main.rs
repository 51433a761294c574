//! Tests of the library without default features, and of calibration and `exec` where they are on.
//!
//! One area alone: `cargo test --release --test lean sgm::`.

mod bm;
#[cfg(feature = "calibrate")]
mod calibration_files;
mod claims;
#[path = "../common/mod.rs"]
mod common;
mod contract;
mod dp;
#[cfg(feature = "exec")]
mod exec;
mod expected;
mod matchers;
mod oracle;
mod rectify;
mod sgm;
#[cfg(feature = "calibrate")]
mod solve;
mod thesis;
mod v3;
mod v5;
