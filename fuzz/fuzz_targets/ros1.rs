//! Whole ROS 1 bags through everything that reads them, with the truth of every topic that has one.
#![no_main]

use svl::Error;
use svl::recording::{Reader, Recording, Selection, SensorRole, SensorSelection, truth_topics};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    svl_fuzz::on_file("a.bag", bytes, |path| {
        let Ok(recording) = Recording::open(path) else {
            return;
        };
        let _ = recording.summary(&Selection::default());
        let Ok(mut reader) = Reader::new(recording, &Selection::default()) else {
            return;
        };
        let truths = truth_topics(reader.recording(), &reader.facts().topics)
            .unwrap_or_default()
            .into_iter();
        let truths = truths.filter_map(|topic| {
            reader
                .sensor(&SensorSelection {
                    topic,
                    max_skew_ns: u64::MAX,
                    role: SensorRole::Map,
                })
                .ok()
        });
        let mut truths: Vec<_> = truths.collect();
        loop {
            match reader.next_pair() {
                Ok(None) | Err(Error::Damaged { .. }) => break,
                Ok(Some(frame)) => truths.iter_mut().for_each(|truth| {
                    let _ = truth.measured(&frame);
                }),
                Err(_) => {}
            }
        }
        let _ = reader.facts();
    });
});
