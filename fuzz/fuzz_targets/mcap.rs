//! Whole MCAP files through everything that reads them, and what is saved of them.
#![no_main]

use std::path::Path;
use svl::Error;
use svl::recording::{Reader, Selection, Summary, attachment, header, recover, results};

fn read(path: &Path, selection: &Selection) {
    let Ok(mut reader) = Reader::open_selection(path, selection) else { return };
    loop {
        match reader.next_pair() {
            Ok(None) | Err(Error::Damaged { .. }) => break,
            Ok(Some(_)) | Err(_) => {}
        }
    }
    let _ = reader.remarks();
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    svl_fuzz::on_file("a.mcap", bytes, |path| {
        let _ = (Summary::of(path), header(path), attachment(path, "scenario.toml"), results(path));
        read(path, &Selection::default());
        let saved = path.with_file_name("saved.mcap");
        let _ = std::fs::remove_file(&saved);
        if recover(path, &saved).is_ok() {
            assert!(Summary::of(&saved).expect("it was just written").is_whole());
            read(&saved, &Selection::default());
        }
    });
});
