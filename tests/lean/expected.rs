//! Real scenes: every disparity and reason equals that of the specification's own implementation.

use crate::common;
use svl_core::kernel::Isa;
use svl_core::stereo::DisparityMap;

/// Number of pixels whose disparity or reason is not the expected one.
fn differing(algorithm: &str, scene: &str, map: &DisparityMap) -> usize {
    let folder = common::datasets()
        .unwrap()
        .join("../expected")
        .join(algorithm);
    let file = |kind: &str| folder.join(format!("{}.{kind}.png", scene.replace('/', "_")));
    let disparities = image::open(file("disp")).unwrap().into_luma16();
    // There are no reasons for v4.
    let reasons = file("reason")
        .exists()
        .then(|| image::open(file("reason")).unwrap().into_luma8().into_raw());
    assert_eq!(
        (disparities.width() as usize, disparities.height() as usize),
        map.size()
    );
    let code = |d: f32| if d.is_finite() { d as u16 + 1 } else { 0 };
    let whys = map.why().pixels().map(|why| why as u8).collect::<Vec<_>>();
    let reasons = reasons.unwrap_or_else(|| whys.clone());
    let got = map.disparity().pixels().map(code).zip(whys);
    got.zip(disparities.into_raw().into_iter().zip(reasons))
        .filter(|(got, expected)| got != expected)
        .count()
}

fn check(algorithm: &str, scene: &str) {
    let Some(pair) = common::scene(scene) else {
        return;
    };
    for isa in Isa::available() {
        assert_eq!(
            differing(algorithm, scene, &common::run(algorithm, isa, &pair)),
            0,
            "{algorithm} {scene} {isa}"
        );
    }
}

#[test]
fn v3_tsukuba() {
    check("v3", "tsukuba");
}

#[test]
fn v3_cones() {
    check("v3", "cones");
}

#[test]
fn v3_oakd_toy() {
    check("v3", "oakd-stereodemo/toy");
}

#[test]
fn v1_tsukuba() {
    check("v1", "tsukuba");
}

#[test]
fn v1_cones() {
    check("v1", "cones");
}

#[test]
fn v1_oakd_toy() {
    check("v1", "oakd-stereodemo/toy");
}

#[test]
fn v2_tsukuba() {
    check("v2", "tsukuba");
}

#[test]
fn v2_cones() {
    check("v2", "cones");
}

#[test]
fn v2_oakd_toy() {
    check("v2", "oakd-stereodemo/toy");
}

#[test]
fn v4_tsukuba() {
    check("v4", "tsukuba");
}

#[test]
fn v4_cones() {
    check("v4", "cones");
}

#[test]
fn v4_oakd_toy() {
    check("v4", "oakd-stereodemo/toy");
}
