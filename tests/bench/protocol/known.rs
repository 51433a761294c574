//! Real maps: scores computed by other programs, and files of several formats with the same map.

use super::{assert_numbers, image, numbers};
use crate::common;
use svl::files::{MapScale, read_disparities, read_pfm};
use svl::score::protocol::Protocol;

/// The numbers of SOURCE.txt next to the map, computed there with numpy.
#[test]
fn the_development_kits_map_scores_as_known() {
    let Some(folder) = common::datasets().map(|folder| folder.join("kitti2012-devkit-scoring"))
    else {
        return;
    };
    let estimate = read_disparities(&folder.join("disp_est.png"), MapScale::default()).unwrap();
    let truth = read_disparities(&folder.join("disp_gt.png"), MapScale::default()).unwrap();
    let image = image(&estimate, &truth);
    let rounded = |protocol: Protocol, name: &str| {
        let value = numbers(protocol, &image).get(name).unwrap();
        (value * 1e6).round() / 1e6
    };
    for (name, known) in [
        ("out2", 10.519550),
        ("out3", 7.894429),
        ("out4", 6.694427),
        ("out5", 5.830868),
    ] {
        assert_eq!(rounded(Protocol::Kitti12, name), known, "{name}");
    }
    assert_eq!(rounded(Protocol::Kitti15, "d1_all"), 7.893814);
    assert_eq!(rounded(Protocol::Kitti12, "avgerr"), 0.697183);
    assert_eq!(rounded(Protocol::Eth3d, "rms"), 1.417195);
    assert_eq!(rounded(Protocol::Eth3d, "a50"), 0.328125);
    let pixels = [
        ("pixels", Some(162_583.0)),
        ("density", Some(100.0 * 156_628.0 / 162_583.0)),
    ];
    assert_numbers(&numbers(Protocol::Kitti12, &image), &pixels);
    assert_numbers(&numbers(Protocol::Kitti15, &image), &pixels);
}

#[test]
fn one_truth_in_several_files() {
    let Some(folder) = common::datasets() else {
        return;
    };
    let motorcycle = folder.join("motorcycle-skimage");
    let npz = motorcycle.join("motorcycle_disp.npz");
    let npz = read_disparities(&npz, MapScale::same(None)).unwrap();
    assert_eq!(npz, read_pfm(&motorcycle.join("disp0.pfm")).unwrap());
    let tsukuba = folder.join("tsukuba");
    let palette = read_disparities(
        &tsukuba.join("groundtruth_v2.png"),
        MapScale::same(Some(16.0)),
    )
    .unwrap();
    assert_eq!(
        palette,
        read_disparities(&tsukuba.join("truedisp.pgm"), MapScale::same(Some(16.0))).unwrap()
    );
}
