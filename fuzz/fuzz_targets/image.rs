//! Images and disparities in them, as every reader takes them.
#![no_main]

use svl::files::{MapScale, read_disparities, read_gray, read_mask, read_object_map};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    svl_fuzz::on_file("a.png", bytes, |path| {
        if read_gray(path).is_ok() {
            let _ = (read_mask(path), read_object_map(path));
            let read = |scale| read_disparities(path, MapScale::same(scale));
            let _ = (read(Some(16.0)), read(None));
        }
    });
});
