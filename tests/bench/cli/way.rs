//! Phantoms on the way that a robot drove: `svl score --robot`.

use super::fixture::Fixture;

/// Maps of two disparities in turns, one for each pair: a cell that never changes is the robot's
/// own body.
pub fn write_near(fixture: &Fixture, (width, height): (usize, usize), px: [f32; 2]) {
    for i in 0..24 {
        let row = px[i % 2].to_le_bytes().repeat(width * height);
        let head = format!("Pf\n{width} {height}\n-1\n").into_bytes();
        fixture.write(&format!("out/{i:06}.pfm"), [head, row].concat());
    }
}

/// Phantoms, those of cells of the own body, and reports on the way.
#[track_caller]
pub fn counts(fixture: &Fixture, report: &str, label: &str) -> [f64; 3] {
    let summary = fixture.json_file(&format!("{report}/summary.json"));
    let mut own = summary["algorithms"].as_array().unwrap().iter();
    let own = own.find(|own| own["algorithm"] == label).unwrap();
    ["phantoms", "phantoms_of_body", "way_cells"].map(|key| own[key].as_f64().unwrap_or(-1.0))
}

/// A report nearer than what the body drove through later is a phantom, exact distances are none;
/// the poses of a bag are those of svl's own recording.
#[test]
fn reports_before_a_free_way_are_phantoms() {
    let fixture = Fixture::new();
    fixture.record_short_arena("own.mcap", 24, 1);
    fixture.run("record own.mcap --ros2 -q -o bag.mcap");
    // 0.24 and 0.18 m.
    write_near(&fixture, (320, 240), [60.0, 80.0]);
    let score = |bag: &str| format!("score {bag} --algo near=files:out/*.pfm --rerun none");
    let [own, bag] = ["own.mcap --algo truth", "bag.mcap"].map(score);
    fixture.transcript(&format!(
        "{own} --robot 0.08x0.11 -o a => truth: phantoms in 0 of | near: phantoms in
        cat a/report.json => /witness absent
        {own} --robot 0.08x0.02 -o b => 0~ own.mcap: no phantoms | outside a body of 0.08x0.02 m
        {own} --robot 0.08 => 2: expected WIDTHxHEIGHT
        {bag} --robot 0.08x0.11 -o c => near: phantoms in
        score bag.mcap --algo v5 --robot 0.08x0.11 --rerun none -o d => v5: phantoms in 0 of
        cat d/report.json => /witness absent"
    ));
    let ([phantoms, on_body, reports], exact) = (
        counts(&fixture, "a", "near"),
        counts(&fixture, "a", "truth"),
    );
    assert!(
        phantoms > 0.0 && phantoms < 0.2 * reports,
        "{phantoms} of {reports}"
    );
    assert_eq!((on_body, exact[0]), (0.0, 0.0));
    assert!(exact[2] > 0.0, "{exact:?}");
    assert_eq!(counts(&fixture, "c", "near"), [phantoms, on_body, reports]);
}

/// Tables of a way are kept as others, and what is doubtful of it is told again.
#[test]
fn a_doubtful_way_stays_doubtful() {
    let fixture = Fixture::new();
    fixture.record_short_arena("own.mcap", 24, 1);
    let score = "score own.mcap --algo blind --robot 0.6x0.5 --rerun none -o a";
    let changed = || {
        let metadata = std::fs::metadata(fixture.path("a/cells.csv"));
        metadata.unwrap().modified().unwrap()
    };
    let told = "cat a/summary.json => /warnings has poses, tf, or --robot are wrong";
    fixture.transcript(&format!(
        "{score} => 0~ poses, tf, or --robot are wrong\n{told}"
    ));
    let first = changed();
    for line in [score, "report a"] {
        fixture.transcript(&format!(
            "{line} => 0~ poses, tf, or --robot are wrong\n{told}"
        ));
        assert_eq!(changed(), first, "{line}");
    }
}

/// KITTI's poses need the floor below the camera, and times; what v5 sees of still images, which
/// contradict them, is told.
#[test]
fn a_way_in_a_folder_needs_a_floor() {
    let fixture = Fixture::new();
    let (mut poses, mut times) = (String::new(), String::new());
    for i in 0..24 {
        let image = |camera: &str| format!("07/{camera}/{i:06}.pgm");
        fixture.write_pair(&image("image_0"), &image("image_1"), (40, 24), 1);
        let far = [
            b"Pf\n40 24\n-1\n",
            &5.0_f32.to_le_bytes().repeat(40 * 24)[..],
        ]
        .concat();
        fixture.write(&format!("07/tru/{i:06}.pfm"), far);
        poses += &format!("1 0 0 0 0 1 0 0 0 0 1 {}\n", 0.1 * f64::from(i));
        times += &format!("{}\n", 0.1 * f64::from(i));
    }
    let calib = "P0: 50 0 20 0 0 50 12 0 0 0 1 0\nP1: 50 0 20 -5 0 50 12 0 0 0 1 0\n";
    fixture.write("07/calib.txt", calib);
    fixture.write("07/poses.txt", &poses);
    // 0.25 and 0.2 m.
    write_near(&fixture, (40, 24), [20.0, 25.0]);
    let score = "score 07 --algo near=files:out/*.pfm --robot 0.5x0.6 --rerun none --force";
    fixture.transcript(&format!(
        "{score} -o a => 0~ no pair has a pose with a calibration and a base
        {score} -o b --camera-height 0.3 => 0~ its poses go nowhere
        {score} -o c --camera-height 0.7 => 0~ the camera is 0.70 m above the base"
    ));
    fixture.write("07/times.txt", times);
    fixture.transcript(&format!(
        "{score} -o d --camera-height 0.3 => 0~ something moved, or poses | !needs a ground truth
        {score} -o d --camera-height 0.3 --truth tru/*.pfm => near: phantoms in"
    ));
    let [phantoms, _, reports] = counts(&fixture, "d", "near");
    assert!(
        phantoms > 0.5 * reports && phantoms > 10.0,
        "{phantoms} of {reports}"
    );
}
