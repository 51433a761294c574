//! Scenario files.
#![no_main]

use std::path::Path;
use svl::scenario::Scenario;

libfuzzer_sys::fuzz_target!(|text: &str| {
    match Scenario::parse(text, Path::new("a.toml")) {
        Ok(scenario) => assert!(!scenario.labels().is_empty() || scenario.algorithms.is_empty()),
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
});
