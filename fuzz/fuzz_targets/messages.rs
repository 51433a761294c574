//! Messages of the topics and schemas svl reads, with any bytes in them, in a file that is whole:
//! pairs and truths.
//!
//! The input is a sequence of messages: a byte that chooses topic and schema, a byte of log time,
//! two bytes of length, and that many bytes. Without chunks' compression and CRC in the way, the
//! messages' own readers are what is tried.
#![no_main]

use mcap::records::MessageHeader;
use std::io::Cursor;
use svl::recording::{Reader, Recording, Selection, SensorRole, SensorSelection, truth_topics};

// Videos are read up to their decoder: no input starts ffmpeg.
// SAFETY: nothing else runs yet.
libfuzzer_sys::fuzz_target!(init: unsafe { std::env::set_var("PATH", "") }, |bytes: &[u8]| {
    let file = file_of(bytes);
    svl_fuzz::on_file("a.mcap", &file, |path| {
        let recording = Recording::open(path).expect("a file");
        let summary = recording.summary(&Selection::default()).expect("a whole file");
        assert!(summary.is_intact(), "{:?}", summary.damage);
        let named =
            [("/l", "/r"), ("/stereo/left/image", "/stereo/right/image")].map(|(left, right)| {
                Selection {
                    left: Some(left.to_owned()),
                    right: Some(right.to_owned()),
                    max_skew_ns: 3,
                    ..Selection::default()
                }
            });
        for selection in [Selection::default()].iter().chain(&named) {
            let Ok(mut reader) = Reader::new(recording.clone(), selection) else {
                continue;
            };
            // Decodes the first message of each topic that could be a truth.
            let truths = truth_topics(reader.recording(), &reader.facts().topics);
            let truths = truths.unwrap_or_default().into_iter();
            let max_skew_ns = u64::MAX;
            let truths = truths.map(|topic| SensorSelection {
                topic,
                max_skew_ns,
                role: SensorRole::Truth,
            });
            let truths = truths.filter_map(|truth| reader.sensor(&truth).ok());
            let mut truths: Vec<_> = truths.collect();
            let mut images = 2 * u64::from(reader.next_pair().is_ok());
            loop {
                match reader.next_pair() {
                    Ok(None) => break,
                    Ok(Some(frame)) => {
                        images += 2;
                        for truth in &mut truths {
                            // The reason why it has none.
                            let _ = truth.measured(&frame);
                        }
                    }
                    Err(_) => {}
                }
            }
            let messages: u64 = summary.topics.iter().map(|topic| topic.messages).sum();
            assert!(
                images + reader.facts().unpaired_ns.len() as u64 <= messages,
                "more images than messages"
            );
        }
    });
});

fn file_of(mut bytes: &[u8]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    // Where chunks have no CRC, the one that mcap 0.25 writes of the whole is wrong.
    let options = mcap::WriteOptions::new()
        .compression(None)
        .calculate_chunk_crcs(false);
    let options = options.calculate_data_section_crc(false);
    let mut writer = options.create(&mut file).expect("memory");
    while let [kind, time, low, high, rest @ ..] = bytes {
        let (data, rest) =
            rest.split_at((usize::from(*high) << 8 | usize::from(*low)).min(rest.len()));
        let (topic, schema, encoding) = svl_fuzz::KINDS[usize::from(*kind) % svl_fuzz::KINDS.len()];
        let schema = writer
            .add_schema(schema, encoding, b"")
            .expect("few schemas");
        let channel_id = writer
            .add_channel(schema, topic, encoding, &Default::default())
            .expect("few channels");
        let log_time = u64::from(*time);
        let header = MessageHeader {
            channel_id,
            sequence: 0,
            log_time,
            publish_time: log_time,
        };
        writer
            .write_to_known_channel(&header, data)
            .expect("memory");
        bytes = rest;
    }
    writer.finish().expect("memory");
    drop(writer);
    file.into_inner()
}
