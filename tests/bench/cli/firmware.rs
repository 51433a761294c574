//! The trigger controller's firmware, on the simulated board of firmware/, triggers simulated
//! cameras.
#![cfg(target_os = "linux")]

use super::fixture::{Fixture, assert_says};
use std::io::{BufRead, BufReader, Lines};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use svl::source::{RecordingSource, Source};

/// A board that runs the firmware, and counts pulses on its pins.
struct Board {
    process: Child,
    said: Lines<BufReader<ChildStdout>>,
    port: String,
}

impl Board {
    /// Started with these faults. `None`, with a note, if it was not built.
    fn start(faults: &[&str]) -> Option<Self> {
        let firmware = Path::new(env!("CARGO_MANIFEST_DIR")).join("firmware");
        let sim = firmware.join("build/sim");
        if !sim.is_file() {
            crate::common::skip("no simulated board; `make -C firmware check` builds it");
            return None;
        }
        let mut command = Command::new(sim);
        let mut process = command
            .args(faults)
            .arg(firmware.join("trigger.hex"))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(process.stdout.take().unwrap()).lines();
        let port = said.next().unwrap().unwrap();
        Some(Self {
            process,
            said,
            port,
        })
    }

    /// Ends it, and returns the number of pulses on its pins.
    fn pulses(mut self) -> u64 {
        assert!(
            Command::new("kill")
                .arg(self.process.id().to_string())
                .status()
                .unwrap()
                .success()
        );
        let pulses = self.said.next().unwrap().unwrap();
        self.process.wait().unwrap();
        pulses.strip_prefix("pulses ").unwrap().parse().unwrap()
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        // It fails once the board has ended.
        let _ = self.process.kill();
    }
}

/// Results of a recording.
struct Recorded {
    /// The pulse ids of its pairs.
    ids: Vec<u64>,
    /// Pulses counted by svl, including stray ones, and pulses on the board's pins.
    counted: u64,
    strays: u64,
    on_pins: u64,
    warnings: String,
}

fn record(faults: &[&str], rate: &str, frames: &str) -> Option<Recorded> {
    let board = Board::start(faults)?;
    let fixture = Fixture::new();
    let trigger = format!("serial:{}", board.port);
    let sim = "sim:size=64x48,pictures=2";
    let ran = fixture.svl(&format!(
        "record {sim} --trigger {trigger} --rate {rate} --frames {frames} --allow-loss 100% -o \
         a.mcap"
    ));
    let warnings = ran.stderr.clone();
    let text = ran.done();
    let number = |words: &str| {
        text.split(", ")
            .find_map(|part| part.strip_suffix(words)?.rsplit(' ').next()?.parse().ok())
    };
    let strays = number(" more that svl did not request").unwrap_or(0);
    let counted = strays + number(" pulses").unwrap_or_else(|| panic!("no pulses in: {text}"));
    let mut source = RecordingSource::open(fixture.path("a.mcap")).unwrap();
    let frames = std::iter::from_fn(|| source.next().unwrap());
    let ids = frames.map(|frame| frame.exposure.trigger_id).collect();
    Some(Recorded {
        ids,
        counted,
        strays,
        on_pins: board.pulses(),
        warnings,
    })
}

#[test]
fn every_pulse_on_the_pins_is_counted_and_every_pair_of_the_next() {
    let Some(recorded) = record(&[], "30", "60") else {
        return;
    };
    assert_eq!(recorded.ids, (1..=60).collect::<Vec<_>>());
    assert_eq!((recorded.counted, recorded.strays), (recorded.on_pins, 0));
}

#[test]
fn a_board_that_hung_goes_on() {
    let Some(recorded) = record(&["--hang", "20"], "30", "60") else {
        return;
    };
    assert_eq!(recorded.ids, (1..=60).collect::<Vec<_>>());
    assert_eq!((recorded.counted, recorded.strays), (recorded.on_pins, 0));
    assert_says(&recorded.warnings, &["was reset after 19 pulses"]);
}

#[test]
fn a_pulse_of_noise_is_counted() {
    let Some(recorded) = record(&["--noise", "10"], "10", "20") else {
        return;
    };
    assert_eq!(
        recorded.counted, recorded.on_pins,
        "of them {} that nobody asked for",
        recorded.strays
    );
    assert!(
        recorded.ids.len() == 20 && recorded.ids.is_sorted_by(|a, b| a < b),
        "{:?}",
        recorded.ids
    );
}
