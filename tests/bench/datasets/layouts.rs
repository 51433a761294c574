//! Layouts of data sets on disk.

use super::tree::{DISPARITY, Tree, WIDTH, expect_truth};
use crate::common::assert_says;
use svl::stereo::{Frame, MapDensity, Visibility};

const CALIB: &str = "cam0=[1000 0 11; 0 1000 2; 0 0 1]\ncam1=[1000 0 13; 0 1000 2; 0 0 \
                     1]\ndoffs=2\nbaseline=160\nwidth=24\nheight=6\nndisp=16\n";

#[track_caller]
fn expect_rig(frame: &Frame, focal_px: f64, baseline_m: f64, doffs_px: f64) {
    let rig = frame.rig().unwrap();
    assert_eq!((rig.focal_px(), rig.doffs_px()), (focal_px, doffs_px));
    assert!(
        (rig.baseline_m() - baseline_m).abs() < 1e-9,
        "{}",
        rig.baseline_m()
    );
}

#[test]
fn middlebury_2001() {
    let tree = Tree::new();
    tree.pair(
        "middlebury2001/venus/im2.ppm",
        "middlebury2001/venus/im6.ppm",
    );
    tree.scaled(
        "middlebury2001/venus/disp2.pgm",
        "middlebury2001/venus/disp6.pgm",
        8.0,
    );
    tree.pair("middlebury2001/map/im0.pgm", "middlebury2001/map/im1.pgm");
    tree.scaled(
        "middlebury2001/map/disp0.pgm",
        "middlebury2001/map/disp1.pgm",
        8.0,
    );
    for column in 1..=5 {
        let name = format!("middlebury2001/tsukuba/scene1.row3.col{column}.ppm");
        tree.pair(&name, &name);
    }
    let truth = "middlebury2001/tsukuba/truedisp.row3.col3.pgm";
    tree.scaled(truth, truth, 16.0);
    let frames = tree.frames(&["middlebury2001/*"]).unwrap();
    let names: Vec<_> = frames.iter().map(|f| f.name.as_deref().unwrap()).collect();
    assert_eq!(
        names,
        [
            "middlebury2001/map",
            "middlebury2001/tsukuba",
            "middlebury2001/venus"
        ]
    );
    // Their zero is a disparity.
    expect_truth(&frames[0], false);
    expect_truth(&frames[2], false);
    let truth = frames[1].truth.as_ref().unwrap();
    assert_eq!(
        (truth.disparity.get(0, 0), truth.disparity.get(20, 1)),
        (f32::INFINITY, DISPARITY)
    );
    assert_eq!(truth.visibility, None);
}

#[test]
fn middlebury_2003_in_three_sizes() {
    let mut tree = Tree::new();
    for (folder, height, ending, scale) in [
        ("cones", 375, "png", 4.0),
        ("conesH", 750, "pgm", 2.0),
        ("conesF", 1500, "pgm", 1.0),
    ] {
        tree.height = height;
        let image = if ending == "png" { "png" } else { "ppm" };
        let file = |stem: &str, ending: &str| format!("{folder}/{stem}.{ending}");
        tree.pair(&file("im2", image), &file("im6", image));
        tree.scaled(&file("disp2", ending), &file("disp6", ending), scale);
        expect_truth(&tree.frame(folder), true);
    }
}

#[test]
fn middlebury_2005_and_2006_in_three_sizes() {
    let mut tree = Tree::new();
    for (folder, height, scale) in [
        ("ThirdSize/Art", 370, 3.0),
        ("HalfSize/Art", 555, 2.0),
        ("FullSize/Art", 1110, 1.0),
    ] {
        tree.height = height;
        tree.pair(
            &format!("{folder}/view1.png"),
            &format!("{folder}/view5.png"),
        );
        tree.scaled(
            &format!("{folder}/disp1.png"),
            &format!("{folder}/disp5.png"),
            scale,
        );
        tree.text(&format!("{folder}/dmin.txt"), "200\n");
        expect_truth(&tree.frame(folder), true);
        // The archives of seven views: other exposures, two folders down.
        tree.pair(
            &format!("{folder}/Illum2/Exp1/view1.png"),
            &format!("{folder}/Illum2/Exp1/view5.png"),
        );
        expect_truth(&tree.frame(&format!("{folder}/Illum2/Exp1")), true);
    }
}

#[test]
fn an_unknown_scale_is_refused() {
    let tree = Tree::new();
    tree.pair("cropped/view1.png", "cropped/view5.png");
    tree.scaled("cropped/disp1.png", "cropped/disp5.png", 3.0);
    let error = tree.frames(&["cropped"]).unwrap_err().to_string();
    assert_says(
        &error,
        &["disp1.png: the scale of disparities 6 rows high is unknown"],
    );
}

#[test]
fn middlebury_2014_and_2021() {
    let tree = Tree::new();
    for folder in [
        "middlebury2014/Piano-perfect",
        "middlebury2021/data/artroom1",
    ] {
        tree.pair(&format!("{folder}/im0.png"), &format!("{folder}/im1.png"));
        tree.pair(&format!("{folder}/im1E.png"), &format!("{folder}/im1L.png"));
        tree.pfm(
            &format!("{folder}/disp0.pfm"),
            &format!("{folder}/disp1.pfm"),
        );
        tree.text(&format!("{folder}/calib.txt"), CALIB);
        tree.text(&format!("{folder}/ambient/L0/notes.txt"), "");
    }
    for names in ["middlebury2014/*", "middlebury2021/data/*"] {
        let frame = tree.frame(names);
        expect_truth(&frame, true);
        expect_rig(&frame, 1000.0, 0.16, 2.0);
    }
}

#[test]
fn middeval3_has_masks_and_tests_without_truth() {
    let tree = Tree::new();
    for folder in ["MiddEval3/trainingQ/Teddy", "MiddEval3/testQ/Plants"] {
        tree.pair(&format!("{folder}/im0.png"), &format!("{folder}/im1.png"));
        tree.text(&format!("{folder}/calib.txt"), CALIB);
    }
    let (left, right) = (
        "MiddEval3/trainingQ/Teddy/disp0GT.pfm",
        "MiddEval3/trainingQ/Teddy/disp1GT.pfm",
    );
    tree.pfm(left, right);
    expect_truth(&tree.frame("MiddEval3/trainingQ/*"), true);
    tree.mask("MiddEval3/trainingQ/Teddy/mask0nocc.png");
    let frame = tree.frame("MiddEval3/trainingQ/*");
    let visibility = frame.truth.unwrap().visibility.unwrap();
    // The mask takes precedence.
    assert_eq!(
        (visibility.get(0, 0), visibility.get(9, 0)),
        (Visibility::Occluded, Visibility::Visible)
    );
    let frame = tree.frame("MiddEval3/testQ/*");
    assert_eq!(frame.truth, None);
    expect_rig(&frame, 1000.0, 0.16, 2.0);
}

#[test]
fn kitti_2012() {
    let tree = Tree::new();
    for number in ["000000", "000001"] {
        for frame in ["10", "11"] {
            let file = |folder: &str| format!("kitti2012/training/{folder}/{number}_{frame}.png");
            tree.pair(&file("image_0"), &file("image_1"));
            tree.pair(&file("colored_0"), &file("colored_1"));
        }
        let truth = |folder: &str| format!("kitti2012/training/{folder}/{number}_10.png");
        tree.kitti(&truth("disp_occ"), &truth("disp_noc"));
        let matrices = "P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP1: 700 0 600 -350 0 700 180 0 0 0 1 \
                        0\nP2: 700 0 600 35 0 700 180 0 0 0 1 0\nP3: 700 0 600 -280 0 700 180 0 0 \
                        0 1 0\n";
        tree.text(&format!("kitti2012/training/calib/{number}.txt"), matrices);
    }
    let frames = tree.frames(&["kitti2012/training/*"]).unwrap();
    assert_eq!(frames.len(), 2);
    assert_eq!(frames[1].name.as_deref(), Some("kitti2012/training/000001"));
    // By number, or by the names of result files.
    for name in ["kitti2012/training/000001", "kitti2012/training/000001_10"] {
        assert_eq!(tree.frames(&[name]).unwrap()[0].name, frames[1].name);
    }
    let folder = tree.frames(&["kitti2012/training"]).unwrap_err();
    assert_says(&folder.to_string(), &["'kitti2012/training/*' names all"]);
    for frame in &frames {
        expect_truth(frame, true);
        let density = frame.truth.as_ref().unwrap().kind.density;
        assert_eq!(density, MapDensity::Sparse);
        // The grey cameras, not the coloured ones.
        expect_rig(frame, 700.0, 0.5, 0.0);
    }
    for folder in ["image_0", "image_1"] {
        std::fs::remove_dir_all(tree.root().join("kitti2012/training").join(folder)).unwrap();
    }
    let frames = tree.frames(&["kitti2012/training/*"]).unwrap();
    expect_rig(&frames[0], 700.0, 0.45, 0.0);
}

#[test]
fn kitti_2015() {
    let tree = Tree::new();
    let file = |folder: &str, end: &str| format!("kitti2015/training/{folder}/000007{end}");
    tree.pair(&file("image_2", "_10.png"), &file("image_3", "_10.png"));
    tree.kitti(
        &file("disp_occ_0", "_10.png"),
        &file("disp_noc_0", "_10.png"),
    );
    let matrices = "P_rect_00: 1 0 0 0 0 1 0 0 0 0 1 0\nP_rect_02: 720 0 600 36 0 720 170 0 0 0 1 \
                    0\nP_rect_03: 720 0 600 -360 0 720 170 0 0 0 1 0\n";
    tree.text(&file("calib_cam_to_cam", ".txt"), matrices);
    let frame = tree.frame("kitti2015/training/*");
    expect_truth(&frame, true);
    expect_rig(&frame, 720.0, 0.55, 0.0);
    // Without the archive of calibrations.
    tree.remove(&file("calib_cam_to_cam", ".txt"));
    assert_eq!(tree.frame("kitti2015/training/*").rig(), None);
    tree.remove(&file("image_3", "_10.png"));
    let error = tree
        .frames(&["kitti2015/training/*"])
        .unwrap_err()
        .to_string();
    assert_says(
        &error,
        &["image_3/000007_10: no such image; its partner exists"],
    );
}

#[test]
fn eth3d_has_its_truth_in_a_folder_beside() {
    let tree = Tree::new();
    let images = |name: &str| format!("eth3d/two_view_training/forest_1s/{name}");
    let truth = |name: &str| format!("eth3d/two_view_training_gt/forest_1s/{name}");
    tree.pair(&images("im0.png"), &images("im1.png"));
    tree.text(&images("calib.txt"), CALIB);
    tree.pfm(&truth("disp0GT.pfm"), &truth("unused.pfm"));
    tree.mask(&truth("mask0nocc.png"));
    let frame = tree.frame("eth3d/two_view_training/*");
    expect_rig(&frame, 1000.0, 0.16, 2.0);
    let truth = frame.truth.unwrap();
    assert_eq!(
        (truth.disparity.get(0, 0), truth.disparity.get(WIDTH - 1, 5)),
        (f32::INFINITY, DISPARITY)
    );
    assert_eq!(truth.visibility.unwrap().get(0, 3), Visibility::Occluded);
}

#[test]
fn truth_of_another_size_is_named() {
    let mut tree = Tree::new();
    tree.pair("scene/im0.png", "scene/im1.png");
    tree.height = 7;
    tree.pfm("scene/disp0.pfm", "scene/disp1.pfm");
    let error = tree.frames(&["scene"]).unwrap_err().to_string();
    assert_says(&error, &["disp0.pfm: is 24x7, the left image is 24x6"]);
}

#[test]
fn missing_files_are_named_with_the_cure() {
    let tree = Tree::new();
    tree.text("kitti2015/readme.txt", "");
    for (name, words) in [
        (
            "kitti2012/training/*",
            [
                "no such scene",
                "benchmark=stereo as docs/data-sets.md says",
            ],
        ),
        ("kitti2015/*", ["stereo pair", "`svl datasets --data"]),
        (
            "elsewhere",
            ["no such scene", "the folder of the data sets?"],
        ),
    ] {
        let error = tree.frames(&[name]).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    }
}
