//! Calibrations of data sets: Middlebury's and ETH3D's directly, KITTI's through a scene.
#![no_main]

use std::path::Path;
use svl::calibrate::files::read_calib;
use svl::source::dataset::Scene;
use svl::stereo::Side;

fn read_kitti(folder: &Path, bytes: &[u8]) -> std::io::Result<()> {
    for camera in ["image_2", "image_3"] {
        let image = folder.join(camera).join("000000_10.png");
        if !image.exists() {
            std::fs::create_dir_all(folder.join(camera))?;
            svl::files::write_png(&image, 2, 2, &[9; 4]).map_err(std::io::Error::other)?;
        }
    }
    std::fs::create_dir_all(folder.join("calib_cam_to_cam"))?;
    std::fs::write(folder.join("calib_cam_to_cam/000000.txt"), bytes)?;
    for scene in Scene::all_in(folder, "").map_err(std::io::Error::other)? {
        let _ = scene.read(0);
    }
    Ok(())
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    svl_fuzz::on_file("calib.txt", bytes, |path| {
        if let Ok(rig) = read_calib(path, (640, 480)) {
            assert!(
                rig.focal_px() > 0.0
                    && rig.baseline_m() > 0.0
                    && rig.projection(Side::Right).iter().all(|v| !v.is_nan())
            );
        }
    });
    if bytes.starts_with(b"P") {
        svl_fuzz::in_folder(|folder| read_kitti(&folder.join("kitti"), bytes).expect("a scene"));
    }
});
