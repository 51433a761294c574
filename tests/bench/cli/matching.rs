//! `svl match`.

use super::fixture::{Fixture, assert_says, datasets, pgm};
use super::own_data::frames;
use super::transcript::{assert_words, plain};
use ::image::codecs::jpeg::JpegEncoder;
use svl::files::{read_disparity_steps, read_gray, read_pfm};
use svl::stereo::Gray;

#[test]
fn finds_the_shift_and_writes_what_was_asked_for() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (64, 24), 7);
    fixture.transcript(
        "match l.pgm r.pgm --algo v3 -o d.pfm --why w.png --preview p.png --json \
        => /coverage > 0.5",
    );
    let disparities = read_pfm(&fixture.path("d.pfm")).unwrap();
    let mut valid: Vec<f32> = disparities.pixels().filter(|d| d.is_finite()).collect();
    valid.sort_by(f32::total_cmp);
    assert_eq!(valid[valid.len() / 2], 7.0);
    let why = read_gray(&fixture.path("w.png")).unwrap();
    let mut pixels = why.pixels().zip(disparities.pixels());
    assert!(pixels.all(|(why, d)| (why == 0) == d.is_finite()));
    let preview = read_gray(&fixture.path("p.png")).unwrap();
    assert_eq!(preview.size(), (64, 24));
}

#[test]
fn doubts_about_the_pair_are_in_its_json() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (320, 240), 7);
    fixture.transcript(
        "match l.pgm r.pgm --algo v3 -o d.pfm --json => /doubts absent
        match r.pgm l.pgm --algo v3 -o e.pfm --json => /doubts/0/of = pairs \
        | /doubts/0/cure/kind = exchanged | /doubts/0/value < 0",
    );
}

#[test]
fn a_cloud_has_the_points_of_the_disparities() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (64, 24), 7);
    let calib = "cam0=[50 0 31.5; 0 50 11.5; 0 0 1]\ncam1=[50 0 31.5; 0 50 11.5; 0 0 1]\n\
                 doffs=0\nbaseline=140\nwidth=64\nheight=24\n";
    fixture.write("calib.txt", calib);
    fixture.transcript(
        "match l.pgm r.pgm -o c.ply => 2: needs --calib
        match l.pgm r.pgm --algo v3 --calib calib.txt -o d.pfm
        match l.pgm r.pgm --algo v3 --calib calib.txt -o c.ply",
    );
    let map = read_pfm(&fixture.path("d.pfm")).unwrap();
    let left = read_gray(&fixture.path("l.pgm")).unwrap();
    let bytes = fixture.bytes("c.ply");
    let end = b"end_header\n";
    let mut places = bytes.windows(end.len());
    let start = places.position(|words| words == end).unwrap();
    let (header, points) = bytes.split_at(start + end.len());
    let header = std::str::from_utf8(header).unwrap();
    let valid: Vec<_> = (0..24 * 64)
        .map(|i| (i % 64, i / 64))
        .filter(|&(x, y)| map.get(x, y).is_finite())
        .collect();
    let vertices = format!("element vertex {}\n", valid.len());
    assert_says(header, &["format binary_little_endian 1.0", &vertices]);
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
    fixture.transcript(
        "match l.pgm r.pgm -o d.pfm --algo v4 => vertical misalignment: right image +2 px lower
        match l.pgm r.pgm -o e.pfm --algo v4 --json => /median_row_offset = 2
        match l.pgm r.pgm -o f.pfm --algo v3 --json => !median_row_offset",
    );
}

#[test]
fn png_output_is_kittis() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (64, 24), 7);
    fixture.transcript(
        "match l.pgm r.pgm -o d.pfm
        match l.pgm r.pgm -o d.png",
    );
    let pfm = read_pfm(&fixture.path("d.pfm")).unwrap();
    let png = read_disparity_steps(&fixture.path("d.png"), 256.0, false).unwrap();
    let mut pixels = pfm.pixels().zip(png.pixels());
    assert!(pixels.all(|(a, b)| a == b || (a == 0.0 && b == 1.0 / 256.0)));
}

#[test]
fn images_smaller_than_the_window_are_all_border() {
    let fixture = Fixture::new();
    fixture.write("l.pgm", pgm(5, 4, &[7; 20]));
    fixture.write("r.pgm", pgm(5, 4, &[7; 20]));
    fixture.transcript("match l.pgm r.pgm --algo v3 -o d.pfm => border       100.00 %");
}

#[test]
fn real_scenes_equal_the_expected_output() {
    let Some(datasets) = datasets() else { return };
    let fixture = Fixture::new();
    for scene in ["tsukuba", "cones", "oakd-stereodemo/toy"] {
        let [left, right] = ["im0.png", "im1.png"]
            .map(|name| datasets.join(scene).join(name).display().to_string());
        fixture.run(&format!(
            "match '{left}' '{right}' --algo v3 -o d.pfm --why w.png --force"
        ));
        let file = |ending: &str| {
            let name = format!("{}.{ending}", scene.replace('/', "_"));
            datasets.join("../expected/v3").join(name)
        };
        // Expected files hold d + 1, 0 = none.
        let truth = read_disparity_steps(&file("disp.png"), 1.0, false).unwrap();
        let ours = read_pfm(&fixture.path("d.pfm")).unwrap();
        assert_eq!(ours.size(), truth.size());
        let pixels = ours.pixels().zip(truth.pixels());
        let unequal = pixels.filter(|(d, code)| d + 1.0 != *code);
        assert_eq!(unequal.count(), 0, "{scene}: disparities");
        let reasons = read_gray(&file("reason.png")).unwrap();
        let own = read_gray(&fixture.path("w.png")).unwrap();
        assert_eq!(own, reasons, "{scene}: reasons");
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
        let scores = parts.iter().filter_map(|part| part["log_odds"].as_f64());
        let probability = 1.0 / (1.0 + (-scores.sum::<f64>()).exp());
        let off = probability - cell["probability"].as_f64().unwrap();
        assert!(off.abs() < 1e-5, "{cell}");
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
    fixture.write("flat.pgm", pgm(160, 96, &[7; 160 * 96]));
    fixture.transcript(
        "match l.pgm r.pgm --algo v3 -o e.pfm --json => /cells/*/score absent
        match flat.pgm flat.pgm --algo v3 -o f.pfm --json => /cells/7/reason = untextured",
    );
}

/// A pair of the arena.
fn arena_pair(fixture: &Fixture) -> [Gray; 2] {
    fixture.record("arena.mcap", "arena --frames 1");
    frames(fixture, "arena.mcap").remove(0).pair.into_images()
}

fn write_gray(fixture: &Fixture, name: &str, image: &Gray) {
    let (width, height) = image.size();
    let pixels: Vec<_> = image.pixels().collect();
    fixture.write(name, pgm(width, height, &pixels));
}

/// An image whose pixels are at these places of another.
fn moved(image: &Gray, place: impl Fn(f64, f64) -> (f64, f64)) -> Gray {
    let (width, height) = image.size();
    let pixel = |x: usize, y: usize| {
        let (u, v) = place(x as f64, y as f64);
        let (i, j) = (u.floor(), v.floor());
        let at = |dx: f64, dy: f64| {
            let (x, y) = ((i + dx).max(0.0) as usize, (j + dy).max(0.0) as usize);
            f64::from(image.get(x.min(width - 1), y.min(height - 1)))
        };
        let rows = [0.0, 1.0].map(|dy| at(0.0, dy) * (1.0 + i - u) + at(1.0, dy) * (u - i));
        (rows[0] * (1.0 + j - v) + rows[1] * (v - j)).round() as u8
    };
    Gray::from_fn(width, height, pixel).unwrap()
}

#[test]
fn a_pair_that_is_off_is_named_with_the_number() {
    let fixture = Fixture::new();
    let [left, right] = arena_pair(&fixture);
    let (sin, cos) = 3_f64.to_radians().sin_cos();
    let roll = |x: f64, y: f64| {
        let (x, y) = (x - 159.5, y - 119.5);
        (cos * x + sin * y + 159.5, cos * y - sin * x + 119.5)
    };
    let noise = |x: usize, y: usize| {
        let mixed = ((x * 7919 + y * 104_729) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        left.get(x, y).saturating_add((mixed >> 62) as u8)
    };
    for (name, image) in [
        ("l", &left),
        ("r", &right),
        ("low", &moved(&right, |x, y| (x, y - 6.0))),
        ("rolled", &moved(&right, roll)),
        ("noisy", &Gray::from_fn(320, 240, noise).unwrap()),
        ("flat", &Gray::filled(320, 240, 7).unwrap()),
        ("1700000000.000", &left),
        ("1700000000.433", &right),
    ] {
        write_gray(&fixture, &format!("{name}.pgm"), image);
    }
    let said = |images: &str, more: &str| {
        let ran = fixture.svl(&format!("match {images} --algo v3{more} -o d.pfm --force"));
        let said = plain(&ran.stderr);
        ran.done();
        said
    };
    assert_eq!(said("l.pgm r.pgm", ""), "");
    for (images, words) in [
        (
            "l.pgm low.pgm",
            "misalignment of 6. | the right image is 6. | --calib FILE",
        ),
        (
            "l.pgm rolled.pgm",
            "vertical misalignment | rolled by +3.0°",
        ),
        (
            "r.pgm l.pgm",
            "look exchanged, or the cameras converge:  | v5 and dp have none",
        ),
        ("l.pgm noisy.pgm", "one picture twice, or nothing is near"),
        ("flat.pgm flat.pgm", "alignment not measured (0 points)"),
        (
            "1700000000.000.pgm 1700000000.433.pgm",
            "names are 433.0 ms apart",
        ),
    ] {
        assert_words(&said(images, ""), words);
    }
    // The cure that is named covers the points.
    let exchanged = said("r.pgm l.pgm", "");
    let cure = exchanged.split('`').nth(1).unwrap();
    assert!(cure.starts_with("min_disparity=-"), "{exchanged}");
    assert_eq!(said("r.pgm l.pgm", &format!(":{cure}")), "");
    let near = said("l.pgm r.pgm", ":max_disparity=4");
    assert_says(&near, &["disparities above 4 px", "--scale 0."]);
    let cure = near.split('`').nth(1).unwrap();
    assert_eq!(said("l.pgm r.pgm", &format!(":{cure}")), "");
    fixture.fails(
        "match l.pgm l.pgm -o d.pfm --force \
        => 1: l.pgm and l.pgm: left and right are one picture twice | first 1 pair",
    );
}

#[test]
fn a_scale_shrinks_the_map_and_keeps_the_distances() {
    let fixture = Fixture::new();
    fixture.write_pair("l.pgm", "r.pgm", (640, 480), 20);
    let calib = "cam0=[500 0 320; 0 500 240; 0 0 1]\ncam1=[500 0 320; 0 500 240; 0 0 1]\n\
                 doffs=0\nbaseline=100\nwidth=640\nheight=480\n";
    fixture.write("calib.txt", calib);
    let distance = |more: &str| {
        let line = format!("match l.pgm r.pgm --calib calib.txt -o d.pfm --algo v3 --json {more}");
        let json = fixture.json(&format!("{line} --force"));
        let (width, height) = read_pfm(&fixture.path("d.pfm")).unwrap().size();
        let told = json["width"].as_u64().unwrap() as usize;
        assert_eq!((told, height * 4), (width, width * 3));
        (width, json["distances_m"][1][2].as_f64().unwrap())
    };
    assert_eq!(distance(""), (640, 2.5));
    let (width, distance_m) = distance("--scale 0.5");
    assert!(
        width == 320 && (distance_m - 2.5).abs() < 0.05,
        "{width} {distance_m}"
    );
    fixture.fails(
        "match l.pgm r.pgm -o e.pfm --scale 1.5 => 2: scale
         match l.pgm r.pgm -o e.pfm --algo v5:max_disparity=400 => 2: --scale 0.63 | =252",
    );
    fixture.write_pair("big.pgm", "bigr.pgm", (4000, 3000), 20);
    let line =
        |more: &str| format!("match big.pgm bigr.pgm -o big.pfm --algo sgm:max_disparity={more}");
    let ran = fixture.svl(&line("511"));
    assert_eq!(ran.code, Some(1));
    let refused = ran.stderr.lines().last().unwrap_or_default();
    assert_says(refused, &["sgm: 4000x3000 pixels"]);
    let scale = refused
        .split_whitespace()
        .find(|word| word.starts_with("0."));
    let scale = scale.unwrap().trim_matches('`');
    let px = refused.rsplit("max_disparity=").next().unwrap().trim();
    assert!(scale.parse::<f64>().unwrap() > 0.5, "{refused}");
    fixture.run(&line(&format!("{px} --scale {scale}")));
}

/// A JPEG with an EXIF orientation.
fn oriented_jpeg(image: &Gray, orientation: u8) -> Vec<u8> {
    let (width, height) = image.size();
    let pixels: Vec<_> = image.pixels().collect();
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, 100)
        .encode(
            &pixels,
            width as u32,
            height as u32,
            ::image::ExtendedColorType::L8,
        )
        .unwrap();
    let tiff = [
        &b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0"[..],
        &[orientation],
        &[0; 6],
    ];
    let tiff = tiff.concat();
    let segment = [&b"\xFF\xE1\0"[..], &[tiff.len() as u8 + 2], &tiff].concat();
    [&jpeg[..2], &segment, &jpeg[2..]].concat()
}

#[test]
fn the_orientation_of_photographs_is_applied_and_said() {
    let fixture = Fixture::new();
    let [left, right] = arena_pair(&fixture);
    let turned = |image: &Gray| Gray::from_fn(320, 240, |x, y| image.get(319 - x, 239 - y));
    // Orientation 6: the camera was upright, and its rows are columns from right to left.
    let upright = |image: &Gray| Gray::from_fn(240, 320, |x, y| image.get(y, 239 - x));
    for (folder, image, orientation) in [
        ("plain", right.clone(), 1),
        ("turned", turned(&right).unwrap(), 3),
        ("upright", upright(&right).unwrap(), 8),
    ] {
        let photograph = oriented_jpeg(&image, orientation);
        fixture.write(&format!("{folder}/right/1.jpg"), photograph);
        fixture.write(&format!("{folder}/left/1.jpg"), oriented_jpeg(&left, 1));
        let no = if orientation > 1 { "" } else { "!" };
        let said = format!(
            "0~ {no}{folder}/right/1.jpg: is turned as its EXIF orientation, {orientation} \
             | !exchanged"
        );
        fixture.transcript(&format!(
            "match {folder}/left/1.jpg {folder}/right/1.jpg -o {folder}.pfm => {said}
            record {folder} -o {folder}.mcap => {said}"
        ));
        let read = frames(&fixture, &format!("{folder}.mcap")).remove(0).pair;
        let differences = read.right().pixels().zip(right.pixels());
        let most = differences.map(|(a, b)| a.abs_diff(b)).max();
        assert!(most < Some(40), "{folder}: {most:?}");
    }
    fixture.write("a.heic", b"\0\0\0\x18ftypheic\0\0\0\0mif1heic");
    fixture.write("phone/left/1.heic", fixture.bytes("a.heic"));
    fixture.write("phone/right/1.heic", fixture.bytes("a.heic"));
    fixture.fails(
        "match a.heic a.heic -o a.pfm => 1: a.heic | HEIC | heif-convert
         record phone -o phone.mcap => 1: left/1.heic | HEIC | heif-convert",
    );
}
