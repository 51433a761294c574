//! `svl eval`.

use super::fixture::{Fixture, datasets, pgm};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use svl::files::{read_gray, write_pfm};
use svl::stereo::Plane;

const NO: f32 = f32::INFINITY;

fn write_map(fixture: &Fixture, name: &str, rows: &[&[f32]]) {
    let path = fixture.path(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_pfm(
        &path,
        &Plane::from_vec(rows[0].len(), rows.len(), rows.concat()).unwrap(),
    )
    .unwrap();
}

/// A truth of 4 with estimates beside it, and a mask that leaves the last pixel out.
fn scene() -> Fixture {
    let fixture = Fixture::new();
    write_map(&fixture, "truth.pfm", &[&[4.0, 4.0, 4.0, NO, 4.0]]);
    write_map(&fixture, "d.pfm", &[&[4.0, 5.5, NO, 4.0, 0.5]]);
    fixture.write("noc.pgm", pgm(5, 1, &[255, 255, 255, 0, 128]));
    fixture
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn help_explains_the_protocols() {
    insta::assert_snapshot!(Fixture::new().svl(&["eval", "--help"]).done());
}

#[test]
fn every_protocol_prints_its_table() {
    let fixture = scene();
    let mut text = String::new();
    for protocol in ["middeval3", "middlebury-v2", "eth3d", "kitti12", "kitti15"] {
        text += &fixture
            .svl(&["eval", "d.pfm", "truth.pfm", "--protocol", protocol])
            .done();
        text.push('\n');
    }
    insta::assert_snapshot!(text);
}

#[test]
fn json_has_the_contracts_keys() {
    let fixture = scene();
    let keys = |protocol: &str| {
        let text = fixture
            .svl(&[
                "eval",
                "d.pfm",
                "truth.pfm",
                "--protocol",
                protocol,
                "--json",
            ])
            .done();
        let keys: Vec<String> = json(&text).as_object().unwrap().keys().cloned().collect();
        keys
    };
    let table =
        "bad0.5 bad1.0 bad2.0 bad4.0 invalid totbad2.0 avgerr rms a50 a90 a95 a99 coverage pixels";
    let kitti12 = "out1 out2 out3 out4 out5 avgerr density";
    let kitti15 = "d1_bg d1_fg d1_all density";
    for (protocol, contract, dense) in [
        ("middeval3", table, false),
        ("middlebury-v2", table, false),
        ("eth3d", table, false),
        ("kitti12", kitti12, true),
        ("kitti15", kitti15, true),
    ] {
        let found = keys(protocol);
        for key in contract.split(' ') {
            assert!(found.contains(&key.to_owned()), "{protocol}: {key}");
            assert!(
                !dense || found.contains(&format!("{key}_dense")),
                "{protocol}: {key}_dense"
            );
        }
    }
    insta::assert_snapshot!(
        fixture
            .svl(&[
                "eval",
                "d.pfm",
                "truth.pfm",
                "--protocol",
                "middeval3",
                "--json"
            ])
            .done()
    );
}

#[test]
fn masks_stand_side_by_side() {
    let fixture = scene();
    fixture.write("disc.pgm", pgm(5, 1, &[0, 255, 0, 0, 0]));
    let args = [
        "eval",
        "d.pfm",
        "truth.pfm",
        "--protocol",
        "middlebury-v2",
        "--mask",
        "noc.pgm",
        "--mask",
        "disc.pgm",
    ];
    insta::assert_snapshot!(fixture.svl(&args).done());
    let found = json(&fixture.svl(&[&args[..], &["--json"]].concat()).done());
    assert_eq!(
        (&found["pixels"], &found["bad1.0"]),
        (&3.into(), &found["masks"]["noc"]["bad1.0"])
    );
    assert_eq!(found["masks"]["disc"]["bad1.0"], 100.0);
}

#[test]
fn options_count() {
    let fixture = scene();
    let value = |more: &[&str], key: &str| {
        json(
            &fixture
                .svl(&[&["eval", "d.pfm", "truth.pfm", "--json"], more].concat())
                .done(),
        )[key]
            .clone()
    };
    assert_eq!(value(&["--protocol", "middeval3"], "avgerr"), 5.0 / 3.0);
    assert_eq!(
        value(
            &["--protocol", "middeval3", "--max-disparity", "4.5"],
            "avgerr"
        ),
        4.0 / 3.0
    );
    // All leave the right image on the left, but the last, which meets another disparity there.
    write_map(&fixture, "right.pfm", &[&[10.0, NO, NO, NO, NO]]);
    write_map(&fixture, "near.pfm", &[&[0.0, 1.0, 0.0, NO, 0.0]]);
    write_map(&fixture, "near-right.pfm", &[&[9.0, 0.0, 0.5, 0.0, 0.0]]);
    let right = ["--protocol", "eth3d", "--right-truth", "near-right.pfm"];
    let near = json(
        &fixture
            .svl(&[&["eval", "near.pfm", "near.pfm", "--json"], &right[..]].concat())
            .done(),
    );
    assert_eq!((&near["pixels"], &near["bad0.5"]), (&2.into(), &0.0.into()));
    fixture
        .svl(
            &[
                &["eval", "d.pfm", "truth.pfm"],
                &["--protocol", "eth3d", "--right-truth", "right.pfm"][..],
            ]
            .concat(),
        )
        .failed(1, &["nothing to score"]);
    fixture.write("objects.pgm", pgm(5, 1, &[0, 0, 3, 0, 1]));
    let objects = ["--protocol", "kitti15", "--object-map", "objects.pgm"];
    assert_eq!(
        (value(&objects, "d1_bg"), value(&objects, "d1_fg")),
        (0.0.into(), 100.0.into())
    );
    // 8-bit files, both of one scale.
    fixture.write("d.pgm", pgm(2, 1, &[40, 48]));
    fixture.write("truth.pgm", pgm(2, 1, &[40, 0]));
    let grey = [
        "eval",
        "d.pgm",
        "truth.pgm",
        "--protocol",
        "middeval3",
        "--scale",
        "4",
        "--json",
    ];
    let grey = json(&fixture.svl(&grey).done());
    assert_eq!((&grey["pixels"], &grey["avgerr"]), (&1.into(), &0.0.into()));
}

#[test]
fn the_error_map_has_the_truths_size() {
    let fixture = scene();
    let args = [
        "eval",
        "d.pfm",
        "truth.pfm",
        "--protocol",
        "eth3d",
        "--error-map",
        "e.png",
    ];
    fixture.svl(&args).done();
    let picture = image::open(fixture.path("e.png")).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (5, 1));
    // Right; no estimate; no truth; off by 3.5 px, which is between one and two thresholds.
    let colours = [0, 2, 3, 4].map(|x| picture.get_pixel(x, 0).0);
    assert_eq!(colours, [[49, 54, 149], [128; 3], [0; 3], [254, 224, 144]]);
    fixture
        .svl(&args)
        .failed(1, &["e.png: exists already", "--force"]);
    fixture.svl(&[&args[..], &["--force"]].concat()).done();
    assert_eq!(read_gray(&fixture.path("e.png")).unwrap().size(), (5, 1));
}

#[test]
fn folders_are_averaged_or_pooled_as_the_protocol_does() {
    let fixture = Fixture::new();
    for (name, estimate) in [
        ("000000_10", &[10.0, 10.0, 10.0][..]),
        ("000001_10", &[50.0]),
    ] {
        write_map(&fixture, &format!("d/{name}.pfm"), &[estimate]);
        fixture.write(
            &format!("truth/{name}.pgm"),
            pgm(estimate.len(), 1, &vec![10; estimate.len()]),
        );
        fixture.write(
            &format!("objects/{name}.pgm"),
            pgm(estimate.len(), 1, &vec![1; estimate.len()]),
        );
    }
    fixture.write("truth/notes.txt", "not a map");
    let args = |protocol| ["eval", "d", "truth", "--scale", "1", "--protocol", protocol];
    insta::assert_snapshot!(fixture.svl(&args("kitti12")).done());
    let run = |protocol, more: &[&str]| {
        json(
            &fixture
                .svl(&[&args(protocol)[..], &["--json"], more].concat())
                .done(),
        )
    };
    let mean = run("kitti12", &[]);
    assert_eq!((&mean["out3"], &mean["pixels"]), (&50.0.into(), &4.into()));
    assert_eq!(mean["images"]["000001_10"]["out3"], 100.0);
    let pooled = run("kitti15", &["--object-map", "objects"]);
    assert_eq!(
        (&pooled["d1_all"], &pooled["d1_fg"], &pooled["d1_bg"]),
        (&25.0.into(), &25.0.into(), &Value::Null)
    );

    fixture
        .svl(&["eval", "d", "truth/000000_10.pgm", "--protocol", "kitti12"])
        .failed(1, &["d: is a folder"]);
    let map = ["--error-map", "e.png"];
    fixture
        .svl(&[&args("kitti12")[..], &map].concat())
        .failed(2, &["--error-map draws one image"]);
    fixture
        .svl(&[&args("kitti12")[..], &["--mask", "d"]].concat())
        .failed(1, &["d/000000_10.pfm", "not a readable"]);
    // More estimates than truths: said, and judged without.
    write_map(&fixture, "d/000002_10.pfm", &[&[1.0]]);
    let more = fixture.svl(&args("kitti12"));
    assert!(
        more.stderr
            .contains("d/000002_10.pfm: has no truth in truth"),
        "{}",
        more.stderr
    );
    assert!(more.done().contains("2 images"));
    fixture.write("truth/000003_10.pgm", pgm(1, 1, &[10]));
    fixture
        .svl(&args("kitti15"))
        .failed(1, &["d: holds nothing called 000003_10"]);
    fixture.write("truth/000003_10.png", "");
    fixture
        .svl(&args("kitti15"))
        .failed(1, &["000003_10.pgm", "000003_10.png", "which of the two"]);
    std::fs::create_dir(fixture.path("empty")).unwrap();
    fixture
        .svl(&["eval", "d", "empty", "--protocol", "eth3d"])
        .failed(1, &["empty: holds no .pfm"]);
}

#[test]
fn bad_input_is_one_line_that_names_it() {
    let fixture = scene();
    write_map(&fixture, "small.pfm", &[&[1.0, 2.0]]);
    write_map(&fixture, "nan.pfm", &[&[1.0, f32::NAN, 1.0, 1.0, 1.0]]);
    write_map(&fixture, "nowhere.pfm", &[&[NO; 5]]);
    fixture.write("cut.pfm", "Pf\n5 1\n-1\nabc");
    fixture.write("cut.npz", "PK");
    fixture.write("eight.pgm", pgm(5, 1, &[8; 5]));
    fixture.write("mask.pgm", pgm(4, 1, &[255; 4]));
    let run = |d: &str, truth: &str, protocol: &str, more: &[&str]| {
        fixture.svl(&[&["eval", d, truth, "--protocol", protocol], more].concat())
    };
    run("small.pfm", "truth.pfm", "eth3d", &[]).failed(
        1,
        &[
            "small.pfm and truth.pfm",
            "estimate is 2x1, the truth 5x1",
            "one size",
        ],
    );
    run("small.pfm", "truth.pfm", "middeval3", &[]).failed(1, &["2x1", "5x1", "1, 2 or 4 times"]);
    run("nan.pfm", "truth.pfm", "middeval3", &[])
        .failed(1, &["nan.pfm: holds NaN at (1, 0)", "+inf"]);
    run("d.pfm", "nan.pfm", "middeval3", &[]).done();
    run("d.pfm", "nowhere.pfm", "kitti12", &[]).failed(1, &["nowhere.pfm", "nothing to score"]);
    run("d.pfm", "cut.pfm", "kitti12", &[]).failed(1, &["cut.pfm", "got 3"]);
    run("d.pfm", "cut.npz", "kitti12", &[]).failed(1, &["cut.npz: not an npz map"]);
    run("d.pfm", "missing.npz", "kitti12", &[]).failed(1, &["missing.npz: no such file"]);
    run("d.pfm", "eight.pgm", "eth3d", &[])
        .failed(1, &["eight.pgm: has 8 bits", "--scale", "2003: 4"]);
    run("eight.pgm", "truth.pfm", "eth3d", &[]).failed(1, &["eight.pgm: has 8 bits", "--scale"]);
    run("d.pfm", "truth.pfm", "eth3d", &["--mask", "mask.pgm"])
        .failed(1, &["mask is 4x1, the truth 5x1"]);
    run(
        "d.pfm",
        "truth.pfm",
        "eth3d",
        &["--right-truth", "small.pfm"],
    )
    .failed(1, &["small.pfm", "5x1", "2x1"]);
    run(
        "d.pfm",
        "truth.pfm",
        "kitti15",
        &["--object-map", "mask.pgm"],
    )
    .failed(1, &["object map is 4x1"]);
    run("d.pfm", "truth.pfm", "kitti13", &[])
        .failed(2, &["unknown protocol 'kitti13' (did you mean 'kitti12'?)"]);
    run(
        "d.pfm",
        "truth.pfm",
        "kitti12",
        &["--object-map", "noc.pgm"],
    )
    .failed(2, &["--object-map belongs to kitti15"]);
    run("d.pfm", "truth.pfm", "eth3d", &["--max-disparity", "9"])
        .failed(2, &["--max-disparity belongs to middeval3"]);
    run("d.pfm", "truth.pfm", "eth3d", &["--scale", "0"]).failed(2, &["--scale", "0.001 to 65536"]);
    run("d.pfm", "truth.pfm", "eth3d", &["--scale", "4"]).failed(2, &["--scale belongs to images"]);
    run("d.pfm", "truth.pfm", "eth3d", &["--error-map", "e.jpg"]).failed(2, &["must end in .png"]);
    run(
        "d.pfm",
        "truth.pfm",
        "eth3d",
        &["--mask", "noc.pgm", "--right-truth", "d.pfm"],
    )
    .failed(2, &["cannot be used"]);
    assert_eq!(fixture.svl(&["eval", "d.pfm", "truth.pfm"]).code, Some(2));
}

/// Runs tests/python/protocols.py, where there is a Python that can; `None`, with a word, where
/// there is none.
fn in_numpy(args: &[&str]) -> Option<Value> {
    let python = std::env::var("SVL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let can = Command::new(&python)
        .args(["-c", "import cv2, numpy"])
        .output();
    if !can.is_ok_and(|output| output.status.success()) {
        println!(
            "skipped: `{python}` has no cv2 or numpy; set SVL_PYTHON to a Python with \
             opencv-python-headless"
        );
        return None;
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/protocols.py");
    let output = Command::new(python)
        .arg(script)
        .args(args)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

/// Every number of `expected` is in `found`, to nine digits.
#[track_caller]
fn assert_equal(found: &Value, expected: &Value, what: &str) {
    for (name, expected) in expected.as_object().unwrap() {
        let (a, b) = (
            found[name].as_f64().unwrap_or(f64::NAN),
            expected.as_f64().unwrap(),
        );
        assert!(
            (a - b).abs() <= 1e-9 * b.abs().max(1.0),
            "{what} {name}: {a} found, {b} expected"
        );
    }
}

#[test]
fn quarter_size_scenes_score_as_numpy_computes() {
    let Some(root) = datasets().map(|root| root.join("middlebury2014q")) else {
        return;
    };
    let fixture = Fixture::new();
    let shown = |path: &Path| path.display().to_string();
    for name in ["Adirondack", "ArtL", "MotorcycleE", "Piano", "Playroom"] {
        let scene = root.join(name);
        let [left, right, truth, mask] = ["im0.png", "im1.png", "disp0GT.pfm", "mask0nocc.png"]
            .map(|file| shown(&scene.join(file)));
        // The range is small for some scenes, so that clipping shows.
        for algorithm in ["v3:max_disparity=64", "sgm:max_disparity=64"] {
            fixture
                .svl(&[
                    "match", &left, &right, "--algo", algorithm, "-o", "d.pfm", "--force",
                ])
                .done();
            let Some(expected) = in_numpy(&[
                "middeval3",
                &shown(&fixture.path("d.pfm")),
                &truth,
                &mask,
                "48",
            ]) else {
                return;
            };
            let options = [
                "--protocol",
                "middeval3",
                "--mask",
                &mask,
                "--max-disparity",
                "48",
                "--json",
            ];
            let found = json(
                &fixture
                    .svl(&[&["eval", "d.pfm", &truth], &options[..]].concat())
                    .done(),
            );
            assert_equal(&found, &expected, &format!("{name} {algorithm}"));
        }
    }
}

#[test]
fn kittis_map_scores_as_numpy_computes() {
    let Some(folder) = datasets().map(|root| root.join("kitti2012-devkit-scoring")) else {
        return;
    };
    let file = |name: &str| folder.join(name).display().to_string();
    let (estimate, truth) = (file("disp_est.png"), file("disp_gt.png"));
    let Some(expected) = in_numpy(&["kitti", &estimate, &truth]) else {
        return;
    };
    let fixture = Fixture::new();
    let found = |protocol| {
        json(
            &fixture
                .svl(&["eval", &estimate, &truth, "--protocol", protocol, "--json"])
                .done(),
        )
    };
    let (kitti12, kitti15) = (found("kitti12"), found("kitti15"));
    let (d1, out): (Vec<_>, Vec<_>) = expected
        .as_object()
        .unwrap()
        .clone()
        .into_iter()
        .partition(|(name, _)| name.starts_with("d1"));
    assert_equal(&kitti12, &Value::Object(out.into_iter().collect()), "2012");
    assert_equal(&kitti15, &Value::Object(d1.into_iter().collect()), "2015");
}
