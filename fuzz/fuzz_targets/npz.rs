//! NumPy's npz.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    svl_fuzz::on_file("a.npz", bytes, |path| {
        let _ = svl::files::read_disparities(path, svl::files::MapScale::same(Some(1.0)));
    });
});
