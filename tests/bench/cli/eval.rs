//! `svl eval`.

use super::fixture::{Fixture, assert_says, datasets, pgm};
use crate::common::python;
use serde_json::Value;
use std::path::Path;
use svl::files::{read_gray, write_pfm};
use svl::stereo::Plane;

const NO: f32 = f32::INFINITY;

fn write_map(fixture: &Fixture, name: &str, rows: &[&[f32]]) {
    let path = fixture.write(name, "");
    let map = Plane::from_vec(rows[0].len(), rows.len(), rows.concat());
    write_pfm(&path, &map.unwrap()).unwrap();
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
    let print = |protocol| fixture.run(&format!("eval d.pfm truth.pfm --protocol {protocol}"));
    let tables = ["middeval3", "middlebury-v2", "eth3d", "kitti12", "kitti15"].map(print);
    insta::assert_snapshot!(tables.join("\n") + "\n");
}

#[test]
fn json_has_the_contracts_keys() {
    let fixture = scene();
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
        let line = format!("eval d.pfm truth.pfm --protocol {protocol} --json");
        let found = fixture.json(&line);
        for key in contract.split(' ') {
            assert!(found.get(key).is_some(), "{protocol}: {key}");
            let is_there = !dense || found.get(format!("{key}_dense")).is_some();
            assert!(is_there, "{protocol}: {key}_dense");
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
    assert_eq!(found["pixels"], 3);
    assert_eq!(found["bad1.0"], found["masks"]["noc"]["bad1.0"]);
    assert_eq!(found["masks"]["disc"]["bad1.0"], 100.0);
}

#[test]
fn options_change_the_numbers() {
    let fixture = scene();
    // All leave the right image at the left, except the last, which meets another disparity there.
    write_map(&fixture, "right.pfm", &[&[10.0, NO, NO, NO, NO]]);
    write_map(&fixture, "near.pfm", &[&[0.0, 1.0, 0.0, NO, 0.0]]);
    write_map(&fixture, "near-right.pfm", &[&[9.0, 0.0, 0.5, 0.0, 0.0]]);
    fixture.write("objects.pgm", pgm(5, 1, &[0, 0, 3, 0, 1]));
    // 8-bit files, both of one scale.
    fixture.write("d.pgm", pgm(2, 1, &[40, 48]));
    fixture.write("truth.pgm", pgm(2, 1, &[40, 0]));
    fixture.transcript(
        "eval near.pfm near.pfm --json --protocol eth3d --right-truth near-right.pfm \
        => /pixels = 2 | /bad0.5 = 0.0
        eval d.pfm truth.pfm --protocol eth3d --right-truth right.pfm => 1: nothing to score
        eval d.pfm truth.pfm --json --protocol kitti15 --object-map objects.pgm \
        => /d1_bg = 0.0 | /d1_fg = 100.0
        eval d.pgm truth.pgm --protocol middeval3 --disparity-scale 4 --json \
        => /pixels = 1 | /avgerr = 0.0",
    );
    for (options, error) in [("", 5.0 / 3.0), (" --max-disparity 4.5", 4.0 / 3.0)] {
        let line = format!("eval d.pfm truth.pfm --json --protocol middeval3{options}");
        assert_eq!(fixture.json(&line)["avgerr"], error);
    }
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
    fixture.transcript(&format!(
        "{args} => 1: e.png: exists already | --force
        {args} --force"
    ));
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
        for (folder, value) in [("truth", 10), ("objects", 1)] {
            let image = pgm(estimate.len(), 1, &vec![value; estimate.len()]);
            fixture.write(&format!("{folder}/{name}.pgm"), image);
        }
    }
    fixture.write("truth/notes.txt", "not a map");
    fixture.write("truth/._000000_10.pgm", "of macOS");
    fixture.write("d/._000000_10.pfm", "of macOS");
    let eval = "eval d truth --disparity-scale 1";
    insta::assert_snapshot!(fixture.run(&format!("{eval} --protocol kitti12")));
    fixture.transcript(&format!(
        "{eval} --protocol kitti12 --json => /out3 = 50.0 | /pixels = 4 \
        | /images/000001_10/out3 = 100.0
        {eval} --protocol kitti15 --json --object-map objects => /d1_all = 25.0 | /d1_fg = 25.0 \
        | /d1_bg = null
        eval d truth/000000_10.pgm --protocol kitti12 => 1: d: is a folder
        eval d truth --protocol kitti12 --error-map e.png => 2: --error-map draws one image
        {eval} --protocol kitti12 --mask d => 1: 10.pfm | not a readable"
    ));
    // More estimates than truths: reported, and scored without the surplus.
    write_map(&fixture, "d/000002_10.pfm", &[&[1.0]]);
    fixture.transcript(&format!(
        "{eval} --protocol kitti12 => 0~ d/000002_10.pfm: has no truth in truth => 2 images"
    ));
    fixture.write("truth/000003_10.pgm", pgm(1, 1, &[10]));
    let fails = |words: &str| fixture.fails(&format!("{eval} --protocol kitti15 => 1: {words}"));
    fails("d: has no file named 000003_10");
    fixture.write("d/000003_10.tif", "");
    fails("which has a truth; d/000003_10.tif is not read: convert it");
    fixture.write("truth/000003_10.png", "");
    fails("000003_10.pgm | 000003_10.png | keep one");
    fixture.transcript(
        "mkdir empty
        eval d empty --protocol eth3d => 1: empty: holds no .pfm",
    );
}

#[test]
fn scenes_of_middlebury_have_weights_masks_and_ranges() {
    let fixture = Fixture::new();
    for (scene, estimate) in [("Adirondack", 4.0), ("PianoL", 9.0), ("Teddy", 99.0)] {
        let truth = format!("t/{scene}/disp0GT.pfm");
        write_map(&fixture, &truth, &[&[4.0, 4.0, NO, 4.0]]);
        let mask = pgm(4, 1, &[255, 128, 0, 255]);
        fixture.write(&format!("t/{scene}/mask0nocc.png"), mask);
        fixture.write(&format!("t/{scene}/calib.txt"), "ndisp=8\n");
        write_map(
            &fixture,
            &format!("r/{scene}/disp0mine.pfm"),
            &[&[estimate; 4]],
        );
    }
    write_map(&fixture, "other.pfm", &[&[4.0]]);
    // Errors of 0, 4 (9 clipped to 8) and 4 px, of which the second counts half.
    fixture.transcript(
        "eval r t --protocol middeval3 \
        => 0~ not that of the benchmark: it lacks ArtL, Jadeplant, Motorcycle \
        => 3 images, their weighted mean, by mask0nocc.png
        eval r t --protocol middeval3 --json => /avgerr = 2.4 | /pixels = 6
        eval r t --protocol middeval3 --json --max-disparity 9 => /images/PianoL/avgerr = 5.0
        mv t/Teddy/mask0nocc.png mask
        eval r t --protocol middeval3 => 1: Adirondack has mask0nocc.png and Teddy has none
        mv mask t/Teddy/mask0nocc.png
        mv other.pfm r/Teddy/disp0other.pfm
        eval r t --protocol middeval3 => 1: disp0mine.pfm and | belong to the same scene; keep one
        eval r t --protocol middeval3 --mask m.png => 2: the folders of scenes have mask0nocc.png
        eval t t --protocol middeval3 => 1: t: has no SCENE/disp0NAME.pfm",
    );
}

#[test]
fn maps_say_what_they_are() {
    let fixture = scene();
    let truth = fixture.bytes("truth.pfm");
    let windows = String::from_utf8_lossy(&truth[..10]).replace('\n', "\r\n");
    fixture.write("windows.pfm", [windows.as_bytes(), &truth[10..]].concat());
    fixture.write("longer.pfm", [&truth[..], b"ab"].concat());
    fixture.write("three.pfm", [&truth[..10], &truth[10..].repeat(3)].concat());
    fixture.write("page.pfm", "<!DOCTYPE html>");
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0";
    fixture.write("pointer.png", pointer);
    for factor in [1.0, 16.0] {
        let row: Vec<_> = (0..1000).map(|x| factor * (8 + x / 100) as f32).collect();
        write_map(&fixture, &format!("{factor}.pfm"), &[&row]);
    }
    // 16-bit images of 100 times the disparity, against themselves.
    let steps = [4000u16, 0, 8250].map(u16::to_be_bytes).concat();
    fixture.write("d.pgm", [b"P5\n3 1\n65535\n".to_vec(), steps].concat());
    fixture.write("odd.pgm", pgm(5, 1, &[255, 255, 1, 1, 255]));
    let same = "eval d.pgm d.pgm --protocol kitti15 --disparity-scale 100 --json";
    fixture.transcript(&format!(
        "eval windows.pfm truth.pfm --protocol middeval3 --json => /avgerr = 0.0 | /pixels = 4
        eval longer.pfm truth.pfm --protocol eth3d => 1: 5x1 needs 20 bytes of pixels, got 22
        eval three.pfm truth.pfm --protocol eth3d => 1: got 60: three channels
        eval page.pfm truth.pfm --protocol eth3d => 1: page.pfm: is a web page (HTML)
        eval pointer.png truth.pfm --protocol eth3d => 1: `git lfs pull`
        eval 16.pfm 1.pfm --protocol eth3d \
        => 0~ 16.pfm: its disparities are 16 times those of the truth
        {same} --estimate-scale 100 => /d1_all = 0.0
        {same} => /d1_all = 100.0
        eval d.pfm truth.pfm --protocol middeval3 --mask odd.pgm \
        => 0~ odd.pgm: 2 pixels of the mask are not 0, 128 or 255"
    ));
}

#[test]
fn values_that_stand_for_unknown_are_counted_and_not_scored() {
    let fixture = scene();
    let line = "eval d.pfm truth.pfm --protocol middeval3 --json";
    let expected = fixture.run(line);
    let is_counted = |from: &str, to: &str, words: &str| {
        let ran = fixture.svl(&line.replace(from, to));
        assert_says(&ran.stderr, &[&format!("{to}: 1 {words} count as unknown")]);
        assert_eq!(ran.done(), expected, "{to}");
    };
    for code in [-1.0, -16.0, f32::MIN] {
        write_map(&fixture, "minus.pfm", &[&[4.0, 5.5, code, 4.0, 0.5]]);
        write_map(&fixture, "t.pfm", &[&[4.0, 4.0, 4.0, code, 4.0]]);
        for (from, to) in [("d.pfm", "minus.pfm"), ("truth.pfm", "t.pfm")] {
            is_counted(from, to, "negative disparities");
        }
    }
    write_map(&fixture, "t.pfm", &[&[4.0, 4.0, 4.0, 1e9, 4.0]]);
    is_counted("truth.pfm", "t.pfm", "disparities beyond the image's width");
    write_map(&fixture, "negated.pfm", &[&[-4.0, -4.0, -4.5, NO, -4.0]]);
    let words = "negated.pfm: its disparities are negative, of the opposite sign";
    fixture.transcript(&format!(
        "{} => 0~ {words} => /doubts/0/cure/kind = opposite_sign | /doubts/0/value = -4.0
        {} => 1: {words}",
        line.replace("d.pfm", "negated.pfm"),
        line.replace("truth.pfm", "negated.pfm")
    ));
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
    // The range is small for some scenes, so that clipping shows.
    let found = fixture.json(&format!(
        "eval r {} --protocol middeval3 --max-disparity 48 --json",
        shown(&root)
    ));
    for (scene, numbers) in &expected {
        assert_equal(&found["images"][*scene], numbers, scene);
    }
    let mean = serde_json::json!({ "avgerr": sum / weights });
    assert_equal(&found, &mean, "the weighted mean");
}

#[test]
fn files_of_other_programs_have_the_same_values() {
    let fixture = Fixture::new();
    let Some(names) = python("maps.py", "cv2, numpy, PIL", [fixture.path("")]) else {
        return;
    };
    let names = String::from_utf8(names).unwrap();
    let names: Vec<_> = names.split_whitespace().collect();
    assert_eq!(names.len(), 9);
    // 16-bit images have 256 times the disparity, arrays of integers 16 times.
    let scale = |option: &str, name: &str| match name.starts_with("integers") {
        true => format!(" --{option} 16"),
        false => String::new(),
    };
    // All estimates equal one truth, and one estimate all truths.
    let first = names[0];
    let estimates = names.iter().map(|name| (*name, first));
    for (estimate, truth) in estimates.chain(names.iter().map(|name| (first, *name))) {
        let scales = scale("estimate-scale", estimate) + &scale("disparity-scale", truth);
        fixture.transcript(&format!(
            "eval {estimate} {truth} --protocol middeval3 --json{scales} \
            => /avgerr = 0.0 | /invalid = 0.0 | /pixels = 5"
        ));
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
