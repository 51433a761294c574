//! Calibrations in the files of other programs: what is read is written in every format that holds
//! it, and read again. Of a format with two files the second follows a NUL.
#![no_main]

use std::path::Path;
use svl::calibrate::files::{self, FORMATS, FileUnit, Hints};
use svl::stereo::DistortionModel;

fn read(folder: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let (first, second) = match bytes.iter().position(|b| *b == 0) {
        Some(end) => (&bytes[..end], Some(&bytes[end + 1..])),
        None => (bytes, None),
    };
    std::fs::write(folder.join("a"), first)?;
    std::fs::write(folder.join("b"), second.unwrap_or_default())?;
    let name = |names: &[&str]| {
        names
            .iter()
            .map(|n| folder.join(n).display().to_string())
            .collect::<Vec<_>>()
            .join(",")
    };
    let both = ["a", "b"];
    let named = name(&both[..1 + usize::from(second.is_some())]);
    let hints = Hints {
        format: None,
        unit: Some(FileUnit::Metres(1.0)),
        size: Some((640, 480)),
        model: Some(DistortionModel::Equidistant),
        ..Hints::default()
    };
    for hints in [Hints::default(), hints] {
        let Ok(found) = files::read_with(named.as_ref(), &hints) else {
            continue;
        };
        let c = found.calibration;
        assert!(c.baseline() > 0.0 && c.left().focal_px().0 > 0.0);
        for format in FORMATS.iter().filter(|format| format.is_written()) {
            let one = format!("c.{}", format.endings[0]);
            let names = if format.pairs == [["left.yaml", "right.yaml"]] {
                &["c", "d"][..]
            } else {
                &[one.as_str()]
            };
            let path = name(names);
            // `c,d` is two files where none is called so.
            if files::write_as(path.as_ref(), format, &c, Path::to_owned).is_ok() {
                let size = Some((640, 480)).filter(|_| format.name == "kitti");
                let again = files::read_with(
                    path.as_ref(),
                    &Hints {
                        format: Some(format),
                        size,
                        ..Hints::default()
                    },
                );
                // Numbers near the ends of what there are may leave it when they are multiplied.
                if let Ok(again) = again {
                    assert!((again.calibration.baseline() / c.baseline() - 1.0).abs() < 0.05);
                }
            }
        }
    }
    Ok(())
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    svl_fuzz::in_folder(|folder| read(folder, bytes).expect("files"));
});
