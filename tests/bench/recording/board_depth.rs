//! A printed board before cameras that publish depth: the page without truth tells which of two
//! depths is better, by how much, and whether the rig's scale is right.

use super::bag::{Bag, CAMERA, Camera, Stereo, float_image};
use super::says::Says;
use crate::cli::fixture::Fixture;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use svl::calibrate::simulated::MovingBoard;
use svl::matcher::Algorithm;
use svl::stereo::{Frame, Geometry, Intrinsics, LengthUnit, RectifiedPair, Rig, StereoCalibration};

const SIZE: (usize, usize) = (320, 240);
const FOCAL_PX: f64 = 260.0;
const CENTER_PX: (f64, f64) = (159.5, 119.5);
const BASELINE_M: f64 = 0.12;
/// The depth of `/node/depth` over that of `/camera/depth`.
const NODE_SCALE: f32 = 1.3;

fn stamp(i: u64) -> u64 {
    1_700_000_000_000_000_000 + i * 100_000_000
}

/// Writes `drive.mcap`: rectified pairs of a board that is held still in 24 poses, and two depths.
fn write_drive(fixture: &Fixture) {
    let sides = [(); 2].map(|()| {
        let (focal, none) = ((FOCAL_PX, FOCAL_PX), [0.0; 5]);
        Intrinsics::new((320, 240), focal, CENTER_PX, none).unwrap()
    });
    let [left, right] = sides;
    let moved = Translation3::new(-BASELINE_M, 0.0, 0.0);
    let moved = Isometry3::from_parts(moved, UnitQuaternion::identity());
    let cameras = StereoCalibration::new(left, right, moved, LengthUnit::Metres).unwrap();
    let board = MovingBoard::before(cameras, 1).unwrap();
    let rig = Rig::new(FOCAL_PX, CENTER_PX, BASELINE_M, 0.0).unwrap();
    let k = [FOCAL_PX, CENTER_PX.0, CENTER_PX.1];
    let camera = Camera {
        size: (320, 240),
        k,
        d: &[0.0; 5],
        p: k,
        ..CAMERA
    };
    let stereo = Stereo {
        images: ["/left/image_rect", "/right/image_rect"],
        infos: ["/left/camera_info", "/right/camera_info"],
        size: SIZE,
        cameras: [camera; 2],
    };
    let stereo = stereo.offsets([0.0, -FOCAL_PX * BASELINE_M]);
    let sgm: Algorithm = "sgm:min_disparity=1".parse().unwrap();
    let mut bag = Bag::default();
    // A board is held still for three pairs of eight; one more shows it moving.
    for i in (0..board.pairs()).filter(|i| i % 8 < 4) {
        let pair = board.pair(i).unwrap();
        let output = sgm.match_pair(RectifiedPair::assume(&pair), Some(rig));
        let depth = output.unwrap().disparity.disparity().map(|d| {
            let known = rig.depth_m(d.into()).filter(|_| d.is_finite());
            known.unwrap_or(0.0) as f32
        });
        let frame = Frame::new(pair, Geometry::Rectified(Some(rig)));
        bag = bag.and(stereo.record(&[frame], |_| stamp(i))).and(
            [("/camera/depth", 1.0), ("/node/depth", NODE_SCALE)].map(|(topic, scale)| {
                float_image("cam", topic, stamp(i), &depth.map(|m| m * scale))
            }),
        );
    }
    bag.write(fixture);
    std::fs::rename(fixture.path("bag.mcap"), fixture.path("drive.mcap")).unwrap();
}

/// The lines of the page run in their order.
#[test]
fn the_page_without_truth_tells_the_better_depth() {
    let fixture = Fixture::new();
    write_drive(&fixture);
    let page = crate::common::repository().join("docs/no-truth.md");
    let page = std::fs::read_to_string(page).unwrap();
    let blocks = page.split("```sh\n").skip(1);
    let lines: Vec<_> = blocks
        .flat_map(|rest| rest.split_once("```").unwrap().0.lines())
        .collect();
    let expected = [
        // The wall behind the board is plain.
        "depth estimated: | v5 is sure in | a board or labels help",
        // Which is better, by how much, and that it is sure.
        "Best: camera by right | over 10 % wrong (node | on it alone",
        "distances are right within 0.1 %",
    ];
    assert!(lines.len() >= expected.len(), "{lines:?}");
    for (line, expected) in lines.into_iter().zip(expected) {
        let line = line.replace("--square-m 0.025", "--square-m 0.03");
        let ran = fixture.svl(line.strip_prefix("svl ").unwrap());
        ran.exits(0).line().says(expected);
    }
}
