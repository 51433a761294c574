//! Whole MCAP files through everything that reads them, and what is saved of them.
#![no_main]

use svl::Error;
use svl::recording::{Reader, Recording, Selection};

fn read(recording: Recording) {
    let Ok(mut reader) = Reader::new(recording, &Selection::default()) else {
        return;
    };
    loop {
        match reader.next_pair() {
            Ok(None) | Err(Error::Damaged { .. }) => break,
            Ok(Some(_)) | Err(_) => {}
        }
    }
    let _ = reader.facts();
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    svl_fuzz::on_file("a.mcap", bytes, |path| {
        let Ok(recording) = Recording::open(path) else {
            return;
        };
        let _ = (
            recording.summary(&Selection::default()),
            recording.header(),
            recording.results(),
        );
        let _ = recording.attachment("scenario.toml");
        read(recording.clone());
        let saved = path.with_file_name("saved.mcap");
        let _ = std::fs::remove_file(&saved);
        if recording.recover(&saved).is_ok() {
            let saved = Recording::open(saved).expect("it was just written");
            assert!(
                saved
                    .summary(&Selection::default())
                    .expect("it was just written")
                    .is_intact()
            );
            read(saved);
        }
    });
});
