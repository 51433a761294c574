//! KITTI's raw data: a synchronized drive in the folders of its archives, whole and in parts.

use super::fixture::Fixture;
use crate::recording::bag::png;
use std::fmt::Write;

const SIZE: (usize, usize) = (160, 96);
const PAIRS: usize = 6;
/// Disparity of the wall; the focal length is 100 px, the baseline 0.54 m.
const DISPARITY: usize = 6;
const SCANS: &str = "velodyne_points/data/*.bin";
const DAY: &str = "raw/2011_09_26";
const DRIVE: &str = "raw/2011_09_26/2011_09_26_drive_0001_sync";

/// A day with a drive, as its two archives unpack.
fn unpack(fixture: &Fixture) {
    let stamps: String = (0..PAIRS)
        .map(|i| format!("2011-09-26 13:02:25.{i}64389445\n"))
        .collect();
    for folder in [
        "image_00",
        "image_01",
        "image_02",
        "image_03",
        "oxts",
        "velodyne_points",
    ] {
        fixture.write(&format!("{DRIVE}/{folder}/timestamps.txt"), &stamps);
    }
    for file in ["timestamps_start", "timestamps_end"] {
        fixture.write(&format!("{DRIVE}/velodyne_points/{file}.txt"), &stamps);
    }
    fixture.write(
        &format!("{DRIVE}/oxts/dataformat.txt"),
        "lat: latitude (deg)\n",
    );
    // x forward, y left, z up; the scanner is 0.27 m behind the camera, and 0.08 m above it.
    let x = 100.0 * 0.54 / DISPARITY as f32 + 0.27;
    let steps = |n: i32| (-n..n).map(|i| i as f32 / 10.0);
    let points = steps(80).flat_map(|y| steps(50).map(move |z| [x, y, z, 0.4]));
    let points: Vec<u8> = points.flatten().flat_map(f32::to_le_bytes).collect();
    let (width, height) = SIZE;
    for i in 0..PAIRS {
        let texture = |x: usize, y: usize| {
            let mixed = (x * 7919 + y * 104_729 + i * 31) as u64;
            (mixed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as u8
        };
        for (camera, shift) in [("00", 0), ("01", DISPARITY), ("02", 0), ("03", DISPARITY)] {
            let pixels: Vec<u8> = (0..width * height)
                .map(|at| texture(at % width + shift, at / width))
                .collect();
            let name = format!("{DRIVE}/image_{camera}/data/{i:010}.png");
            fixture.write(&name, png(SIZE, &pixels));
        }
        fixture.write(
            &format!("{DRIVE}/velodyne_points/data/{i:010}.bin"),
            &points,
        );
        let place = format!("49.0 8.4 112.8{}\n", " 0".repeat(27));
        fixture.write(&format!("{DRIVE}/oxts/data/{i:010}.txt"), place);
    }
    let mut cameras = "calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.950000e-02\n".to_owned();
    for (i, x) in [0.0, -54.0, 6.0, -48.0].into_iter().enumerate() {
        let one = "1 0 0 0 1 0 0 0 1";
        let _ = write!(
            cameras,
            "S_0{i}: 170 104\nK_0{i}: 103 0 85 0 103 52 0 0 1\nD_0{i}: -0.3 0.1 0 0 0\n\
             R_0{i}: {one}\nT_0{i}: {} 0 0\nS_rect_0{i}: {width} {height}\nR_rect_0{i}: {one}\n\
             P_rect_0{i}: 100 0 80 {x} 0 100 48 0 0 0 1 0\n",
            x / 100.0
        );
    }
    fixture.write(&format!("{DAY}/calib_cam_to_cam.txt"), cameras);
    let moved = "calib_time: today\nR: 0 -1 0 0 0 -1 1 0 0\nT: 0 -0.08 -0.27\n";
    fixture.write(&format!("{DAY}/calib_velo_to_cam.txt"), moved);
    fixture.write(&format!("{DAY}/calib_imu_to_velo.txt"), moved);
}

#[test]
fn a_drive_is_scored_by_its_laser_scanner() {
    let fixture = Fixture::new();
    unpack(&fixture);
    fixture.transcript(&format!(
        "info {DRIVE} => 6 rectified pairs, calibrated, truth from {SCANS}"
    ));
    let line = [
        "score", DRIVE, "--truth", SCANS, "--algo", "bm", "-o", "r", "--json",
    ];
    let summary = fixture.json(&line);
    let bm = &summary["algorithms"][0];
    assert_eq!(bm["pairs"], 6);
    assert!(bm["cells_right"].as_f64().unwrap() > 50.0, "{bm}");
    assert_eq!(bm["cells_wrong"], 0.0);
    // Pairs beside a range are not asked for, and their files are no surplus.
    for range in ["--every 2", "--to 0.25"] {
        let ran = fixture.svl(&format!("info {DRIVE} {range}"));
        assert!(
            !ran.stderr.contains("used by no pair"),
            "{range}: {}",
            ran.stderr
        );
    }
    fixture.write(
        &format!("{DRIVE}/velodyne_points/data/0000000009.bin"),
        [0; 16],
    );
    fixture.transcript(&format!("info {DRIVE} => 0~ 1 file used by no pair"));
}

#[test]
fn the_folders_above_name_the_drive() {
    let fixture = Fixture::new();
    unpack(&fixture);
    for above in ["raw", DAY] {
        let error = fixture.svl(&format!("score {above}")).failed(1, &[DRIVE]);
        assert!(error.chars().count() < 160, "{error}");
    }
    fixture.write(
        "raw/2011_09_26/2011_09_26_drive_0002_sync/image_00/data/0.png",
        [0],
    );
    fixture.write(
        "raw/2011_09_26/2011_09_26_drive_0002_sync/image_01/data/0.png",
        [0],
    );
    fixture.fails(&format!(
        "score {DAY} => 1: drive_0001_sync, | drive_0002_sync"
    ));
}

#[test]
fn a_missing_part_is_named() {
    let part = |gone: &str, expected: &str| {
        let fixture = Fixture::new();
        unpack(&fixture);
        for gone in gone.split(' ') {
            let path = fixture.path(gone);
            if path.is_dir() {
                std::fs::remove_dir_all(path).unwrap();
            } else {
                std::fs::remove_file(path).unwrap();
            }
        }
        for line in expected.lines() {
            fixture.transcript(line);
        }
    };
    part(
        &format!("{DRIVE}/image_01 {DRIVE}/image_03"),
        &format!("score {DRIVE} => 1: has image_00/data/*, and image_01/data/* is missing"),
    );
    // Two cameras are enough.
    part(
        &format!("{DRIVE}/image_01"),
        &format!("info {DRIVE} => 6 rectified pairs, calibrated"),
    );
    part(
        &format!("{DAY}/calib_cam_to_cam.txt"),
        &format!(
            "score {DRIVE} -o r => 0~ no calib_cam_to_cam.txt in it or the two folders above
             score {DRIVE} -o s --truth {SCANS} => 1: calib_velo_to_cam.txt and calib_cam_to_cam.txt
             info {DRIVE} => no calibration"
        ),
    );
    part(
        &format!("{DAY}/calib_velo_to_cam.txt"),
        &format!("score {DRIVE} --truth {SCANS} => 1: calib_velo_to_cam.txt"),
    );
    part(
        &format!("{DRIVE}/velodyne_points"),
        &format!("score {DRIVE} --truth {SCANS} => 1: no such file"),
    );
    part(
        &format!("{DRIVE}/image_00/timestamps.txt {DRIVE}/oxts"),
        &format!("score {DRIVE} -o r --truth {SCANS} => against the | {SCANS}"),
    );
}
