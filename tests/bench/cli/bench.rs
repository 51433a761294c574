//! `svl bench`.

use super::fixture::Fixture;

#[test]
fn figures_are_complete_and_in_order() {
    let text = Fixture::new().run("bench --algo v3 --size 96x64 --max-disparity 20 --json");
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let v3 = &json[0];
    assert_eq!(
        (&v3["algo"], &v3["disparities"]),
        (&"v3:max_disparity=20".into(), &21.into())
    );
    assert_eq!(
        (&v3["width"], &v3["height"], &v3["threads"]),
        (&96.into(), &64.into(), &1.into())
    );
    let ms = ["min_ms", "median_ms", "p95_ms", "p99_ms"].map(|key| v3[key].as_f64().unwrap());
    assert!(ms.is_sorted() && ms[0] > 0.0, "{ms:?}");
    let mde_per_s = 96.0 * 64.0 * 21.0 / ms[1] / 1e3;
    assert!((v3["mde_per_s"].as_f64().unwrap() / mde_per_s - 1.0).abs() < 1e-9);
}

#[test]
fn numbers_of_threads_are_compared() {
    Fixture::new().transcript(
        "bench --algo v3 --algo bm --size 64x48 --max-disparity 8 --threads 1,2 \
        => 1 thread | 2 threads | times as fast | !p99
        bench --threads 1,0 => 2: --threads
        algos --threads 1,2 => 2: compared by `svl bench` alone",
    );
}

#[test]
fn bad_sizes_are_wrong_usage() {
    Fixture::new().svl("bench --size 0x9").failed(2, &["WxH"]);
    Fixture::new()
        .svl("bench --algo dp --max-disparity 1000")
        .failed(2, &["max_disparity=1000"]);
}

#[test]
fn a_named_algorithm_keeps_its_name_and_its_own_range() {
    // 80 is also the default.
    let line = "bench --algo v3small=v3:smoothing_sigma=0 --algo wide=bm:max_disparity=80 \
                --algo bm --size 96x64 --max-disparity 20 --json";
    let json: serde_json::Value = serde_json::from_str(&Fixture::new().run(line)).unwrap();
    let figures = json.as_array().unwrap().iter();
    let figures: Vec<_> = figures
        .map(|figures| {
            (
                figures["algo"].as_str().unwrap(),
                figures["disparities"].as_u64(),
            )
        })
        .collect();
    assert_eq!(
        figures,
        [
            ("v3small", Some(21)),
            ("wide", Some(81)),
            ("bm:max_disparity=20", Some(21))
        ]
    );
}
