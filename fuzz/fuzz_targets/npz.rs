//! NumPy's npz.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    svl_fuzz::on_file("a.npz", bytes, |path| {
        let _ = svl::files::read_npz(path);
    });
});
