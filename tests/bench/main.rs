//! Tests of the bench: sources, recordings, scoring, reports, Rerun and the `svl` program.
//!
//! One area alone: `cargo test --release --test bench recording::`.

/// Declares a test per part of a check that takes long as one, so that the parts run side by side.
macro_rules! parts {
    (|$part:ident| $check:expr; $($name:ident = $number:literal,)*) => {$(
        #[test]
        fn $name() {
            let $part: usize = $number;
            $check;
        }
    )*};
}

mod action;
mod arena;
mod cli;
#[path = "../common/mod.rs"]
mod common;
mod datasets;
mod documents;
mod examples;
mod grab;
mod protocol;
mod recording;
mod release;
mod report;
#[cfg(feature = "rerun")]
mod rerun;
#[cfg(feature = "ros2")]
mod ros2;
