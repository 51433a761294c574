//! `svl eval`.

use super::fixture::{Fixture, assert_says, datasets, pgm};
use crate::common::python;
use serde_json::Value;
use std::path::Path;
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

/// A truth of 4 with estimates next to it, and a mask that excludes the last pixel.
fn scene() -> Fixture {
    let fixture = Fixture::new();
    write_map(&fixture, "truth.pfm", &[&[4.0, 4.0, 4.0, NO, 4.0]]);
    write_map(&fixture, "d.pfm", &[&[4.0, 5.5, NO, 4.0, 0.5]]);
    fixture.write("noc.pgm", pgm(5, 1, &[255, 255, 255, 0, 128]));
    fixture
}

#[test]
fn help_explains_the_protocols() {
    insta::assert_snapshot!(Fixture::new().run("eval --help"));
}

#[test]
fn every_protocol_prints_its_table() {
    let fixture = scene();
    let mut text = String::new();
    for protocol in ["middeval3", "middlebury-v2", "eth3d", "kitti12", "kitti15"] {
        text += &fixture.run(&format!("eval d.pfm truth.pfm --protocol {protocol}"));
        text.push('\n');
    }
    insta::assert_snapshot!(text);
}

#[test]
fn json_has_the_contracts_keys() {
    let fixture = scene();
    let keys = |protocol: &str| {
        let line = format!("eval d.pfm truth.pfm --protocol {protocol} --json");
        let found = fixture.json(&line);
        let keys: Vec<String> = found.as_object().unwrap().keys().cloned().collect();
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
    insta::assert_snapshot!(fixture.run("eval d.pfm truth.pfm --protocol middeval3 --json"));
}

#[test]
fn masks_stand_side_by_side() {
    let fixture = scene();
    fixture.write("disc.pgm", pgm(5, 1, &[0, 255, 0, 0, 0]));
    let args = "eval d.pfm truth.pfm --protocol middlebury-v2 --mask noc.pgm --mask disc.pgm";
    insta::assert_snapshot!(fixture.run(args));
    let found = fixture.json(&format!("{args} --json"));
    assert_eq!(
        (&found["pixels"], &found["bad1.0"]),
        (&3.into(), &found["masks"]["noc"]["bad1.0"])
    );
    assert_eq!(found["masks"]["disc"]["bad1.0"], 100.0);
}

#[test]
fn options_change_the_numbers() {
    let fixture = scene();
    let value = |protocol: &str, key: &str| {
        let line = format!("eval d.pfm truth.pfm --json --protocol {protocol}");
        fixture.json(&line)[key].clone()
    };
    assert_eq!(value("middeval3", "avgerr"), 5.0 / 3.0);
    assert_eq!(value("middeval3 --max-disparity 4.5", "avgerr"), 4.0 / 3.0);
    // All leave the right image at the left, except the last, which meets another disparity there.
    write_map(&fixture, "right.pfm", &[&[10.0, NO, NO, NO, NO]]);
    write_map(&fixture, "near.pfm", &[&[0.0, 1.0, 0.0, NO, 0.0]]);
    write_map(&fixture, "near-right.pfm", &[&[9.0, 0.0, 0.5, 0.0, 0.0]]);
    let near = "eval near.pfm near.pfm --json --protocol eth3d --right-truth near-right.pfm";
    let near = fixture.json(near);
    assert_eq!((&near["pixels"], &near["bad0.5"]), (&2.into(), &0.0.into()));
    fixture
        .svl("eval d.pfm truth.pfm --protocol eth3d --right-truth right.pfm")
        .failed(1, &["nothing to score"]);
    fixture.write("objects.pgm", pgm(5, 1, &[0, 0, 3, 0, 1]));
    let objects = "kitti15 --object-map objects.pgm";
    assert_eq!(
        (value(objects, "d1_bg"), value(objects, "d1_fg")),
        (0.0.into(), 100.0.into())
    );
    // 8-bit files, both of one scale.
    fixture.write("d.pgm", pgm(2, 1, &[40, 48]));
    fixture.write("truth.pgm", pgm(2, 1, &[40, 0]));
    let grey = fixture.json("eval d.pgm truth.pgm --protocol middeval3 --disparity-scale 4 --json");
    assert_eq!((&grey["pixels"], &grey["avgerr"]), (&1.into(), &0.0.into()));
}

#[test]
fn the_error_map_has_the_truths_size() {
    let fixture = scene();
    let args = "eval d.pfm truth.pfm --protocol eth3d --error-map e.png";
    fixture.run(args);
    let picture = image::open(fixture.path("e.png")).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (5, 1));
    // Right; no estimate; no truth; off by 3.5 px, which is between one and two thresholds.
    let colours = [0, 2, 3, 4].map(|x| picture.get_pixel(x, 0).0);
    assert_eq!(colours, [[49, 54, 149], [128; 3], [0; 3], [254, 224, 144]]);
    fixture
        .svl(args)
        .failed(1, &["e.png: exists already", "--force"]);
    fixture.run(&format!("{args} --force"));
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
    fixture.write("truth/._000000_10.pgm", "of macOS");
    fixture.write("d/._000000_10.pfm", "of macOS");
    let args = |protocol: &str| format!("eval d truth --disparity-scale 1 --protocol {protocol}");
    insta::assert_snapshot!(fixture.run(&args("kitti12")));
    let mean = fixture.json(&args("kitti12 --json"));
    assert_eq!((&mean["out3"], &mean["pixels"]), (&50.0.into(), &4.into()));
    assert_eq!(mean["images"]["000001_10"]["out3"], 100.0);
    let pooled = fixture.json(&args("kitti15 --json --object-map objects"));
    assert_eq!(
        (&pooled["d1_all"], &pooled["d1_fg"], &pooled["d1_bg"]),
        (&25.0.into(), &25.0.into(), &Value::Null)
    );

    let wrong = "
        eval d truth/000000_10.pgm --protocol kitti12 => 1: d: is a folder
        eval d truth --protocol kitti12 --error-map e.png => 2: --error-map draws one image
        eval d truth --disparity-scale 1 --protocol kitti12 --mask d => 1: 10.pfm | not a readable
    ";
    fixture.fails(wrong);
    // More estimates than truths: reported, and scored without the surplus.
    write_map(&fixture, "d/000002_10.pfm", &[&[1.0]]);
    let more = fixture.svl(&args("kitti12"));
    assert_says(&more.stderr, &["d/000002_10.pfm: has no truth in truth"]);
    assert_says(&more.done(), &["2 images"]);
    fixture.write("truth/000003_10.pgm", pgm(1, 1, &[10]));
    fixture
        .svl(&args("kitti15"))
        .failed(1, &["d: has no file named 000003_10"]);
    fixture.write("d/000003_10.tif", "");
    fixture.svl(&args("kitti15")).failed(
        1,
        &["which has a truth; d/000003_10.tif is not read: convert it"],
    );
    fixture.write("truth/000003_10.png", "");
    fixture
        .svl(&args("kitti15"))
        .failed(1, &["000003_10.pgm", "000003_10.png", "keep one"]);
    std::fs::create_dir(fixture.path("empty")).unwrap();
    fixture.fails("eval d empty --protocol eth3d => 1: empty: holds no .pfm");
}

#[test]
fn scenes_of_middlebury_have_weights_masks_and_ranges() {
    let fixture = Fixture::new();
    for (scene, estimate) in [("Adirondack", 4.0), ("PianoL", 9.0), ("Teddy", 99.0)] {
        write_map(
            &fixture,
            &format!("t/{scene}/disp0GT.pfm"),
            &[&[4.0, 4.0, NO, 4.0]],
        );
        fixture.write(
            &format!("t/{scene}/mask0nocc.png"),
            pgm(4, 1, &[255, 128, 0, 255]),
        );
        fixture.write(&format!("t/{scene}/calib.txt"), "ndisp=8\n");
        write_map(
            &fixture,
            &format!("r/{scene}/disp0mine.pfm"),
            &[&[estimate; 4]],
        );
    }
    let args = "eval r t --protocol middeval3";
    let ran = fixture.svl(args);
    assert_says(
        &ran.stderr,
        &["not that of the benchmark: it lacks ArtL, Jadeplant, Motorcycle"],
    );
    assert_says(
        &ran.done(),
        &["3 images, their weighted mean, by mask0nocc.png"],
    );
    // Errors of 0, 4 (9 clipped to 8) and 4 px, of which the second counts half.
    let found = fixture.json(&format!("{args} --json"));
    assert_eq!(
        (&found["avgerr"], &found["pixels"]),
        (&2.4.into(), &6.into())
    );
    let wider = fixture.json(&format!("{args} --json --max-disparity 9"));
    assert_eq!(wider["images"]["PianoL"]["avgerr"], 5.0);
    let mask = fixture.path("t/Teddy/mask0nocc.png");
    std::fs::rename(&mask, fixture.path("mask")).unwrap();
    fixture
        .svl(args)
        .failed(1, &["Adirondack has mask0nocc.png and Teddy has none"]);
    std::fs::rename(fixture.path("mask"), &mask).unwrap();
    write_map(&fixture, "r/Teddy/disp0other.pfm", &[&[4.0]]);
    let wrong = "
        eval r t --protocol middeval3 => 1: disp0mine.pfm and | belong to the same scene; keep one
        eval r t --protocol middeval3 --mask m.png => 2: the folders of scenes have mask0nocc.png
        eval t t --protocol middeval3 => 1: t: has no SCENE/disp0NAME.pfm
    ";
    fixture.fails(wrong);
}

#[test]
fn maps_say_what_they_are() {
    let fixture = scene();
    let truth = fixture.bytes("truth.pfm");
    let windows = String::from_utf8_lossy(&truth[..10]).replace('\n', "\r\n");
    fixture.write("windows.pfm", [windows.as_bytes(), &truth[10..]].concat());
    let same = fixture.json("eval windows.pfm truth.pfm --protocol middeval3 --json");
    assert_eq!((&same["avgerr"], &same["pixels"]), (&0.0.into(), &4.into()));
    fixture.write("longer.pfm", [&truth[..], b"ab"].concat());
    fixture.write("three.pfm", [&truth[..10], &truth[10..].repeat(3)].concat());
    fixture.write("page.pfm", "<!DOCTYPE html>");
    fixture.write(
        "pointer.png",
        "version https://git-lfs.github.com/spec/v1\noid sha256:0",
    );
    let wrong = "
        eval longer.pfm truth.pfm --protocol eth3d => 1: 5x1 needs 20 bytes of pixels, got 22
        eval three.pfm truth.pfm --protocol eth3d => 1: got 60: three channels
        eval page.pfm truth.pfm --protocol eth3d => 1: page.pfm: is a web page (HTML)
        eval pointer.png truth.pfm --protocol eth3d => 1: `git lfs pull`
    ";
    fixture.fails(wrong);
    let scaled = |factor: f32| {
        let row: Vec<_> = (0..1000).map(|x| factor * (8 + x / 100) as f32).collect();
        write_map(&fixture, &format!("{factor}.pfm"), &[&row]);
    };
    scaled(1.0);
    scaled(16.0);
    let ran = fixture.svl("eval 16.pfm 1.pfm --protocol eth3d");
    assert_says(
        &ran.stderr,
        &["16.pfm: its disparities are 16 times those of the truth"],
    );
    // 16-bit images of 100 times the disparity, against themselves.
    let steps = [4000u16, 0, 8250].map(u16::to_be_bytes).concat();
    fixture.write("d.pgm", [b"P5\n3 1\n65535\n".to_vec(), steps].concat());
    let same = "eval d.pgm d.pgm --protocol kitti15 --disparity-scale 100 --json";
    assert_eq!(
        fixture.json(&format!("{same} --estimate-scale 100"))["d1_all"],
        0.0
    );
    assert_eq!(fixture.json(same)["d1_all"], 100.0);
    fixture.write("odd.pgm", pgm(5, 1, &[255, 255, 1, 1, 255]));
    let ran = fixture.svl("eval d.pfm truth.pfm --protocol middeval3 --mask odd.pgm");
    assert_says(
        &ran.stderr,
        &["odd.pgm: 2 pixels of the mask are not 0, 128 or 255"],
    );
}

#[test]
fn values_that_stand_for_unknown_are_counted_and_not_scored() {
    let fixture = scene();
    let line = "eval d.pfm truth.pfm --protocol middeval3 --json";
    let expected = fixture.run(line);
    for code in [-1.0, -16.0, f32::MIN] {
        write_map(&fixture, "minus.pfm", &[&[4.0, 5.5, code, 4.0, 0.5]]);
        write_map(&fixture, "t.pfm", &[&[4.0, 4.0, 4.0, code, 4.0]]);
        for (from, to) in [("d.pfm", "minus.pfm"), ("truth.pfm", "t.pfm")] {
            let ran = fixture.svl(&line.replace(from, to));
            let words = format!("{to}: 1 negative disparities count as unknown");
            assert_says(&ran.stderr, &[&words]);
            assert_eq!(ran.done(), expected, "{to}");
        }
    }
    write_map(&fixture, "t.pfm", &[&[4.0, 4.0, 4.0, 1e9, 4.0]]);
    let ran = fixture.svl(&line.replace("truth.pfm", "t.pfm"));
    let words = "t.pfm: 1 disparities beyond the image's width count as unknown";
    assert_says(&ran.stderr, &[words]);
    assert_eq!(ran.done(), expected);
    write_map(&fixture, "negated.pfm", &[&[-4.0, -4.0, -4.5, NO, -4.0]]);
    let of_estimate = line.replace("d.pfm", "negated.pfm");
    let ran = fixture.svl(&of_estimate);
    let words = "negated.pfm: its disparities are negative, of the opposite sign";
    assert_says(&ran.stderr, &[words]);
    let printed: Value = serde_json::from_str(&ran.done()).unwrap();
    let doubts = &printed["doubts"];
    assert_eq!(doubts[0]["cure"]["kind"], "opposite_sign", "{printed}");
    assert_eq!(doubts[0]["value"], -4.0);
    fixture
        .svl(&line.replace("truth.pfm", "negated.pfm"))
        .failed(1, &[words]);
}

fn in_numpy(args: &[&str]) -> Option<Value> {
    let printed = python("protocols.py", "cv2, numpy", args)?;
    Some(serde_json::from_slice(&printed).unwrap())
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
    let (mut sum, mut weights) = (0.0, 0.0);
    // The range is small for some scenes, so that clipping shows.
    let args = ["--protocol", "middeval3", "--max-disparity", "48", "--json"];
    let mut expected = Vec::new();
    for (scene, weight) in [
        ("Adirondack", 1.0),
        ("ArtL", 1.0),
        ("Motorcycle", 1.0),
        ("MotorcycleE", 1.0),
        ("Piano", 1.0),
        ("PianoL", 0.5),
        ("Playroom", 0.5),
    ] {
        let [left, right, truth, mask] = ["im0.png", "im1.png", "disp0GT.pfm", "mask0nocc.png"]
            .map(|file| shown(&root.join(scene).join(file)));
        let estimate = format!("r/{scene}/disp0sgm.pfm");
        std::fs::create_dir_all(fixture.path(&estimate).parent().unwrap()).unwrap();
        let algorithm = "sgm:max_disparity=64";
        fixture.run(&["match", &left, &right, "--algo", algorithm, "-o", &estimate]);
        let estimate = shown(&fixture.path(&estimate));
        let Some(numbers) = in_numpy(&["middeval3", &estimate, &truth, &mask, "48"]) else {
            return;
        };
        sum += weight * numbers["avgerr"].as_f64().unwrap();
        weights += weight;
        expected.push((scene, numbers));
    }
    let found = fixture.json(&[&["eval", "r", &shown(&root)], &args[..]].concat());
    for (scene, numbers) in &expected {
        assert_equal(&found["images"][*scene], numbers, scene);
    }
    let mean = serde_json::json!({ "avgerr": sum / weights });
    assert_equal(&found, &mean, "the weighted mean");
}

#[test]
fn files_of_other_programs_have_the_same_values() {
    let fixture = Fixture::new();
    let Some(names) = python(
        "maps.py",
        "cv2, numpy, PIL",
        [&fixture.path("").display().to_string()],
    ) else {
        return;
    };
    let names = String::from_utf8(names).unwrap();
    let names: Vec<_> = names.split_whitespace().collect();
    assert_eq!(names.len(), 9);
    for estimate in &names {
        for truth in &names {
            // 16-bit images have 256 times the disparity, arrays of integers 16 times.
            let scale = |option: &str, name: &str| {
                let is_array = name.starts_with("integers");
                let scale = is_array.then(|| format!(" --{option} 16"));
                scale.unwrap_or_default()
            };
            let found = fixture.json(&format!(
                "eval {estimate} {truth} --protocol middeval3 --json{}{}",
                scale("estimate-scale", estimate),
                scale("disparity-scale", truth)
            ));
            let numbers = ["avgerr", "invalid", "pixels"].map(|key| found[key].as_f64());
            assert_eq!(
                numbers,
                [Some(0.0), Some(0.0), Some(5.0)],
                "{estimate} {truth}"
            );
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
    let found =
        |protocol| fixture.json(&["eval", &estimate, &truth, "--protocol", protocol, "--json"]);
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
