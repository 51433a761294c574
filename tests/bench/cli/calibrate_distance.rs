//! `svl calibrate distance`.

use super::fixture::Fixture;

const TABLE: &str = include_str!("../../../scenarios/annex-b.csv");

#[test]
fn annex_b_is_the_table_of_the_library() {
    let pairs = TABLE.lines().skip(1).map(|line| {
        let (cm, px) = line.split_once(',').unwrap();
        (cm.parse().unwrap(), px.parse().unwrap())
    });
    assert_eq!(
        pairs.collect::<Vec<(f64, f64)>>(),
        svl::depth::DistanceCurve::TABLE_B1
    );
}

#[test]
fn annex_b_has_residuals_ranges_a_figure_and_a_table() {
    let fixture = Fixture::new();
    fixture.write("b.csv", TABLE);
    let text = fixture.run("calibrate distance b.csv --figure curve.svg --table curve.csv");
    insta::assert_snapshot!(text);
    let svg = fixture.text("curve.svg");
    assert!(
        svg.starts_with("<svg") && svg.matches("<circle").count() == 13,
        "{svg}"
    );
    insta::assert_snapshot!("the_table", fixture.text("curve.csv"));
    let json = fixture.json("calibrate distance b.csv --json");
    assert_eq!(json["measurements"].as_array().unwrap().len(), 13);
    assert_eq!(
        json["polynomial"]["usable_px"],
        serde_json::json!([[11.0, 38.0]])
    );
    assert!(json["pinhole"]["farthest_cm"].as_f64().unwrap() > 130.0);
}

/// A target of 0.8 m x 1 m at this distance in front of the arena's stereo head.
fn scenario(distance_m: f64) -> String {
    format!(
        "name = \"target\"\ndescription = \"a target\"\nalgorithms = [\"v3\"]\n[cells]\njudge = \
         \"distance\"\n[source]\nkind = \"arena\"\n[arena]\nframes = 3\nrate_hz = \
         3.0\n[arena.rig]\nabove_floor_m = 0.5\n[arena.robot]\nhalf_width_m = 0.0\nyaw_sway_deg = \
         0.0\nroll_sway_deg = 0.0\npitch_sway_deg = 0.0\ndeviation_m = 0.0\npath = [{{ at_m = \
         [2.0, 1.0], heading_deg = 90.0 }}, {{ at_m = [2.0, 1.002], heading_deg = 90.0 \
         }}]\n[arena.world]\nwidth_m = 4.0\nlength_m = 8.0\nballs = []\nblocks = [{{ name = \
         \"target\", at_m = [2.0, {}], size_m = [0.8, 0.1, 1.0] }}]\n",
        1.0 + distance_m + 0.05
    )
}

#[test]
fn a_simulated_target_gives_the_cameras_own_product() {
    let fixture = Fixture::new();
    let mut recordings = Vec::new();
    for cm in [120, 100, 85, 70, 60, 50, 40, 30, 25] {
        let (toml, mcap) = (format!("{cm}.toml"), format!("{cm}.mcap"));
        fixture.write(&toml, scenario(f64::from(cm) / 100.0));
        fixture.run(&format!("record {toml} -o {mcap}"));
        recordings.push(format!("{cm}cm={mcap}"));
    }
    let all = format!("calibrate distance {}", recordings.join(" "));
    let json = fixture.json(&format!("{all} --json"));
    let number = |pointer: &str| json.pointer(pointer).unwrap().as_f64().unwrap();
    let off = number("/pinhole/a_cm_px") / number("/focal_baseline_cm_px") - 1.0;
    println!(
        "a is {:.2} % off, b {:.3} px",
        100.0 * off,
        number("/pinhole/b_px")
    );
    assert!(off.abs() < 0.01, "{off}");
    assert!(
        json["measurements"]
            .as_array()
            .unwrap()
            .iter()
            .all(|m| m["cells"].as_array().unwrap().len() >= 3)
    );
    println!("{}", fixture.run(&all));

    // The same from a table that names the recordings.
    let lines: String = recordings
        .iter()
        .map(|r| r.replace("cm=", ",") + "\n")
        .collect();
    fixture.write("target.csv", format!("distance_cm,recording\n{lines}"));
    let table = fixture.json("calibrate distance target.csv --json");
    assert_eq!(table["pinhole"], json["pinhole"]);

    let wrong = "
        calibrate distance 120cm=120.mcap --target 1,1 2,1 => 1: 120.mcap | in 2 cells, at least 3
        calibrate distance 120cm=120.mcap --target 1,1 2,1 9,1 => 2: --target | 9,1 | 5x3 cells
    ";
    fixture.fails(wrong);
}
