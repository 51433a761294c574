//! `svl match`.

use super::fixture::{Fixture, assert_says, datasets, pgm};

#[test]
fn finds_the_shift_and_writes_what_was_asked_for() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (64, 24), 7);
    let json =
        fixture.json("match l.pgm r.pgm --algo v3 -o d.pfm --why w.png --preview p.png --json");
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
fn a_cloud_has_the_points_of_the_disparities() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (64, 24), 7);
    fixture.fails("match l.pgm r.pgm -o c.ply => 2: needs --calib");
    let calib = "cam0=[50 0 31.5; 0 50 11.5; 0 0 1]\ncam1=[50 0 31.5; 0 50 11.5; 0 0 1]\n\
                 doffs=0\nbaseline=140\nwidth=64\nheight=24\n";
    fixture.write("calib.txt", calib);
    let line = "match l.pgm r.pgm --algo v3 --calib calib.txt";
    fixture.run(&format!("{line} -o d.pfm"));
    fixture.run(&format!("{line} -o c.ply"));
    let map = svl::files::read_pfm(&fixture.path("d.pfm")).unwrap();
    let left = svl::files::read_gray(&fixture.path("l.pgm")).unwrap();
    let bytes = std::fs::read(fixture.path("c.ply")).unwrap();
    let end = b"end_header\n";
    let start = bytes
        .windows(end.len())
        .position(|words| words == end)
        .unwrap();
    let (header, points) = bytes.split_at(start + end.len());
    let header = std::str::from_utf8(header).unwrap();
    let valid: Vec<_> = (0..24 * 64)
        .map(|i| (i % 64, i / 64))
        .filter(|&(x, y)| map.get(x, y).is_finite())
        .collect();
    assert_says(header, &["format binary_little_endian 1.0"]);
    assert_says(header, &[&format!("element vertex {}\n", valid.len())]);
    assert_eq!(points.len(), 15 * valid.len());
    for (point, (x, y)) in points.chunks_exact(15).zip(valid) {
        let [px, py, z] =
            [0, 4, 8].map(|at| f32::from_le_bytes(*point[at..].first_chunk().unwrap()));
        // 50 px · 0.14 m / disparity.
        assert!((z - 7.0 / map.get(x, y)).abs() < 1e-5);
        assert!((px - (x as f32 - 31.5) / 50.0 * z).abs() < 1e-5);
        assert!((py - (y as f32 - 11.5) / 50.0 * z).abs() < 1e-5);
        assert_eq!(point[12..], [left.get(x, y); 3]);
    }
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
    let line = |more: &str| format!("match l.pgm r.pgm -o d.pfm --force --algo {more}");
    let text = fixture.run(&line("v4"));
    assert_says(&text, &["vertical misalignment: right image +2 px lower"]);
    assert_eq!(fixture.json(&line("v4 --json"))["median_row_offset"], 2);
    assert!(
        fixture
            .json(&line("v3 --json"))
            .get("median_row_offset")
            .is_none()
    );
}

#[test]
fn png_output_is_kittis() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (64, 24), 7);
    fixture.run("match l.pgm r.pgm -o d.pfm");
    fixture.run("match l.pgm r.pgm -o d.png");
    let pfm = svl::files::read_pfm(&fixture.path("d.pfm")).unwrap();
    let png = svl::files::read_disparity_steps(&fixture.path("d.png"), 256.0, false).unwrap();
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
    let text = fixture.run("match l.pgm r.pgm --algo v3 -o d.pfm");
    assert_says(&text, &["border       100.00 %"]);
}

#[test]
fn real_scenes_equal_the_expected_output() {
    let Some(datasets) = datasets() else { return };
    let fixture = Fixture::new();
    for scene in ["tsukuba", "cones", "oakd-stereodemo/toy"] {
        let image = |name: &str| datasets.join(scene).join(name).display().to_string();
        fixture.run(&[
            "match",
            &image("im0.png"),
            &image("im1.png"),
            "--algo",
            "v3",
            "-o",
            "d.pfm",
            "--why",
            "w.png",
            "--force",
        ]);
        let expected = datasets
            .join("../expected/v3")
            .join(scene.replace('/', "_"));
        let file =
            |ending: &str| expected.with_file_name(format!("{}.{ending}", scene.replace('/', "_")));
        // Expected files hold d + 1, 0 = none.
        let truth = svl::files::read_disparity_steps(&file("disp.png"), 1.0, false).unwrap();
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

#[test]
fn each_cell_has_the_parts_of_its_score() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (320, 200), 7);
    let json = fixture.json("match l.pgm r.pgm --algo v5 -o d.pfm --json");
    let cells = json["cells"].as_array().unwrap();
    assert_eq!(cells.len(), 15);
    let mut known = 0;
    for cell in cells {
        let parts = cell["score"].as_array().unwrap();
        let names: Vec<_> = parts.iter().map(|part| part["name"].as_str()).collect();
        assert_eq!(names[..2], [Some("base"), Some("margin")]);
        let score: f64 = parts
            .iter()
            .filter_map(|part| part["log_odds"].as_f64())
            .sum();
        let probability = 1.0 / (1.0 + (-score).exp());
        assert!(
            (probability - cell["probability"].as_f64().unwrap()).abs() < 1e-5,
            "{cell}"
        );
        let is_known = cell["state"] == "known";
        known += usize::from(is_known);
        let reason = cell.get("reason").and_then(|reason| reason.as_str());
        assert!(
            reason.is_none_or(|reason| !is_known && reason != "valid"),
            "{cell}"
        );
    }
    assert!((1..15).contains(&known), "{known} known");
    // Other algorithms give no probability, so there is nothing to take apart.
    let json = fixture.json("match l.pgm r.pgm --algo v3 -o e.pfm --json");
    let cells = json["cells"].as_array().unwrap();
    assert!(cells.iter().all(|cell| cell.get("score").is_none()));
    fixture.write("flat.pgm", pgm(160, 96, &[7; 160 * 96]));
    let json = fixture.json("match flat.pgm flat.pgm --algo v3 -o f.pfm --json");
    assert_eq!(json["cells"][7]["reason"], "untextured");
}
