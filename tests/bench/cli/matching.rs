//! `svl match`.

use super::fixture::{Fixture, datasets, pgm};

#[test]
fn finds_the_shift_and_writes_what_was_asked_for() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (64, 24), 7);
    let json = fixture
        .svl(&[
            "match",
            "l.pgm",
            "r.pgm",
            "-o",
            "d.pfm",
            "--why",
            "w.png",
            "--preview",
            "p.png",
            "--json",
        ])
        .done();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(json["coverage"].as_f64().unwrap() > 0.5);
    let disparities = svl::files::read_pfm(&fixture.path("d.pfm")).unwrap();
    let mut valid: Vec<f32> = disparities.pixels().filter(|d| d.is_finite()).collect();
    valid.sort_by(f32::total_cmp);
    assert_eq!(valid[valid.len() / 2], 7.0);
    let why = svl::files::read_gray(&fixture.path("w.png")).unwrap();
    assert!(
        why.pixels()
            .zip(disparities.pixels())
            .all(|(why, d)| (why == 0) == d.is_finite())
    );
    assert_eq!(
        svl::files::read_gray(&fixture.path("p.png"))
            .unwrap()
            .size(),
        (64, 24)
    );
}

#[test]
fn v4_reports_the_vertical_misalignment() {
    let fixture = Fixture::new();
    let (width, height) = (80, 40);
    let noise = |x: usize, y: usize| ((x * x + 7 * y) * (y * y + 3 * x) % 251) as u8;
    let image = |lower: usize, shift: usize| -> Vec<u8> {
        let pixels = (0..width * height).map(|i| (i % width + shift, (i / width + 2 - lower)));
        pixels.map(|(x, y)| noise(x, y)).collect()
    };
    fixture.write("l.pgm", pgm(width, height, &image(0, 0)));
    fixture.write("r.pgm", pgm(width, height, &image(2, 5)));
    let run = |algorithm: &str, json: &[&str]| {
        let args = [
            "match", "l.pgm", "r.pgm", "-o", "d.pfm", "--force", "--algo", algorithm,
        ];
        fixture.svl(&[&args[..], json].concat()).done()
    };
    let text = run("v4", &[]);
    assert!(
        text.contains("vertical misalignment: right image +2 px lower"),
        "{text}"
    );
    let json = |algorithm| serde_json::from_str::<serde_json::Value>(&run(algorithm, &["--json"]));
    assert_eq!(json("v4").unwrap()["median_row_offset"], 2);
    assert!(json("v3").unwrap().get("median_row_offset").is_none());
}

#[test]
fn png_output_is_kittis() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (64, 24), 7);
    fixture
        .svl(&["match", "l.pgm", "r.pgm", "-o", "d.pfm"])
        .done();
    fixture
        .svl(&["match", "l.pgm", "r.pgm", "-o", "d.png"])
        .done();
    let pfm = svl::files::read_pfm(&fixture.path("d.pfm")).unwrap();
    let png = svl::files::read_scaled_disparity(&fixture.path("d.png"), 256.0, true).unwrap();
    assert!(
        pfm.pixels()
            .zip(png.pixels())
            .all(|(a, b)| a == b || (a == 0.0 && b == 1.0 / 256.0))
    );
}

#[test]
fn images_smaller_than_the_window_are_all_border() {
    let fixture = Fixture::new();
    fixture.write("l.pgm", pgm(5, 4, &[7; 20]));
    fixture.write("r.pgm", pgm(5, 4, &[7; 20]));
    let text = fixture
        .svl(&["match", "l.pgm", "r.pgm", "-o", "d.pfm"])
        .done();
    assert!(text.contains("border       100.00 %"), "{text}");
}

#[test]
fn bad_input_is_one_line_that_names_it() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (64, 24), 7);
    fixture.write("small.pgm", pgm(4, 4, &[0; 16]));
    fixture.write("empty.png", "");
    fixture.write("text.png", "hello");
    fixture.write("cut.pgm", &pgm(64, 24, &[0; 64 * 24])[..200]);
    fixture.write("huge.pgm", "P5\n4000000000 4000000000\n255\n");
    let run = |right: &str, more: &[&str]| {
        fixture.svl(&[&["match", "l.pgm", right, "-o", "d.pfm"], more].concat())
    };
    run("small.pgm", &[]).failed(1, &["small.pgm", "left image is 64x24, right image is 4x4"]);
    run("missing.png", &[]).failed(1, &["missing.png: no such file"]);
    run("empty.png", &[]).failed(1, &["empty.png: is empty"]);
    run("text.png", &[]).failed(1, &["text.png", "not a readable"]);
    run("cut.pgm", &[]).failed(1, &["cut.pgm"]);
    run("huge.pgm", &[]).failed(1, &["huge.pgm"]);
    run(".", &[]).failed(1, &["is a folder"]);
    run("r.pgm", &["--calib", "text.png"]).failed(1, &["text.png", "calib.txt", "cam0"]);
    run("r.pgm", &["--algo", "v33"]).failed(2, &["unknown algorithm 'v33'", "did you mean 'v3'?"]);
    run("r.pgm", &["--algo", "v3:max_disparty=4"])
        .failed(2, &["no parameter 'max_disparty'", "'max_disparity'"]);
    run("r.pgm", &["--algo", "v3:max_disparity=x"])
        .failed(2, &["max_disparity=x is not a whole number in"]);
    run("r.pgm", &["--algo", "v3:max_disparity=99999"]).failed(2, &["99999"]);
    run("r.pgm", &["--algo", "v3:min_disparity=9,max_disparity=3"]).failed(2, &["min_disparity"]);
    fixture
        .svl(&["match", "l.pgm", "r.pgm", "-o", "d.jpg"])
        .failed(2, &["d.jpg: must end in .pfm or .png"]);
    fixture
        .svl(&["match", "l.pgm", "r.pgm", "-o", "no/where.pfm"])
        .failed(1, &["no: no such folder"]);
    fixture
        .svl(&["match", "l.pgm", "r.pgm", "-o", "d.png", "--why", "./d.png"])
        .failed(2, &["d.png: named twice"]);
    fixture
        .svl(&["match", "l.pgm", "r.pgm", "-o", "/dev/null"])
        .failed(2, &["/dev/null: must end in"]);
    fixture
        .svl(&[
            "match",
            "l.pgm",
            "r.pgm",
            "-o",
            "d.pfm",
            "--calib",
            "/dev/zero",
        ])
        .failed(1, &["/dev/zero", "regular"]);
    fixture.write("there.pfm", "");
    fixture
        .svl(&["match", "l.pgm", "r.pgm", "-o", "there.pfm"])
        .failed(1, &["there.pfm: exists already", "--force"]);
}

#[test]
fn real_scenes_equal_the_expected_output() {
    let Some(datasets) = datasets() else { return };
    let fixture = Fixture::new();
    for scene in ["tsukuba", "cones", "oakd-stereodemo/toy"] {
        let image = |name: &str| datasets.join(scene).join(name).display().to_string();
        fixture
            .svl(&[
                "match",
                &image("im0.png"),
                &image("im1.png"),
                "-o",
                "d.pfm",
                "--why",
                "w.png",
                "--force",
            ])
            .done();
        let expected = datasets
            .join("../expected/v3")
            .join(scene.replace('/', "_"));
        let file =
            |ending: &str| expected.with_file_name(format!("{}.{ending}", scene.replace('/', "_")));
        // Expected files hold d + 1, 0 = none.
        let truth = svl::files::read_scaled_disparity(&file("disp.png"), 1.0, true).unwrap();
        let ours = svl::files::read_pfm(&fixture.path("d.pfm")).unwrap();
        assert_eq!(ours.size(), truth.size());
        let unequal = ours
            .pixels()
            .zip(truth.pixels())
            .filter(|(d, code)| d + 1.0 != *code)
            .count();
        assert_eq!(unequal, 0, "{scene}: disparities");
        let reasons = svl::files::read_gray(&file("reason.png")).unwrap();
        assert_eq!(
            svl::files::read_gray(&fixture.path("w.png")).unwrap(),
            reasons,
            "{scene}: reasons"
        );
    }
}
