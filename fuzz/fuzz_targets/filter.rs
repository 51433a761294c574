//! Files of filters, and tables of labels; what was read is written and read again as the same.
#![no_main]

use svl::filter::{FILTERS, FilterModel};
use svl::fit::filter::FrameLabels;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(model) = FilterModel::from_bytes(bytes) {
        let again = FilterModel::from_bytes(&model.to_bytes()).expect("it was just written");
        assert_eq!(again.hash(), model.hash());
    }
    svl_fuzz::on_file("run.csv", bytes, |path| {
        for spec in FILTERS {
            if let Ok(labels) = FrameLabels::read(path, spec.kind) {
                std::fs::write(path, labels.to_text()).expect("it was written before");
                let again = FrameLabels::read(path, spec.kind).expect("it was just written");
                assert_eq!(again, labels);
            }
        }
    });
});
