//! Images and disparities in them, as every reader takes them.
#![no_main]

use svl::files::{read_estimate, read_gray, read_mask, read_object_map, read_truth};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    svl_fuzz::on_file("a.png", bytes, |path| {
        if read_gray(path).is_ok() {
            let _ = (read_mask(path), read_object_map(path));
            let _ = (
                read_truth(path, Some(16.0)),
                read_truth(path, None),
                read_estimate(path, None),
            );
        }
    });
});
