//! PFM; what was read is written and read again as the same.
#![no_main]

use svl::files::{read_pfm, write_pfm};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    svl_fuzz::on_file("a.pfm", bytes, |path| {
        if let Ok(plane) = read_pfm(path) {
            write_pfm(path, &plane).expect("it was written before");
            assert_eq!(read_pfm(path).expect("it was just written"), plane);
        }
    });
});
