//! The HTML page.

use super::fixture::{cell, example, row};
use crate::common::assert_says;
use svl::manifest::{AlgorithmRecord, Manifest};
use svl::overlay::{Nearness, algorithm_color, marks};
use svl::report::html::{
    CheckpointFigure, FrameShot, ParameterSweep, Rank, ReportPage, SceneFigure, SceneResult,
};
use svl::report::{GateState, ReliabilityRow, Results};
use svl::score::Verdict;
use svl::stereo::{Cell, CellDepth, DepthGrid, GridShape};

/// A page whose title and texts would be HTML.
fn page(summary: Results) -> ReportPage {
    let mut manifest = Manifest::new("<b>", &["v3".parse().unwrap()]).unwrap();
    let record = manifest.algorithms.remove(0);
    let records = summary.algorithms.iter().map(|a| AlgorithmRecord {
        label: a.algorithm.clone(),
        ..record.clone()
    });
    manifest.algorithms = records.collect();
    manifest.machine.processor = "<script>alert(1)</script>".into();
    manifest.pairs_hash = Some("58d0".into());
    ReportPage {
        manifest,
        gate: Vec::new(),
        description: "A & B.\n\nC.".into(),
        times_ms: summary
            .algorithms
            .iter()
            .map(|a| {
                (
                    a.algorithm.clone(),
                    vec![a.p50_ms.unwrap(), a.max_ms.unwrap()],
                )
            })
            .collect(),
        summary,
        sweeps: Vec::new(),
        figures: Vec::new(),
        scenes: Vec::new(),
        cases: None,
        maps: Vec::new(),
    }
}

fn figure(number: u32, title: &str, shots: Vec<(Rank, FrameShot)>) -> CheckpointFigure {
    CheckpointFigure {
        checkpoint: Some(number),
        title: title.into(),
        at_s: None,
        about: String::new(),
        shots,
    }
}

fn count(html: &str, text: &str) -> usize {
    html.matches(text).count()
}

/// The positions of fields in the page, by their ids.
fn places(html: &str, ids: &[&str]) -> Vec<usize> {
    let place = |id: &&str| html.find(&format!("id=\"{id}\"")).expect(id);
    ids.iter().map(place).collect()
}

/// A frame with a wrong cell, a right one and an unknown one.
fn shot(passed: bool, left: &[u8]) -> FrameShot {
    let depth = CellDepth {
        median_px: 20.0,
        p20_px: 18.0,
        p80_px: 22.0,
        distance_m: Some(0.8),
        infinity_px: Some(0.0),
    };
    let known = Cell {
        valid_share: 1.0,
        depth: Some(depth),
        ..Cell::UNKNOWN
    };
    let unknown = Cell {
        valid_share: 0.0,
        depth: None,
        ..Cell::UNKNOWN
    };
    let drawn = |cells: [Cell; 3]| {
        let grid = DepthGrid::new(
            GridShape {
                columns: 3,
                rows: 1,
            },
            cells.to_vec(),
        )
        .unwrap();
        marks(&grid, (30, 10), Nearness::new(40.0, 0.0))
    };
    let verdicts = [Verdict::Wrong, Verdict::Right, Verdict::Unknown];
    FrameShot {
        row: row("v3", 143, 5_000),
        cells: verdicts
            .into_iter()
            .zip(0..)
            .map(|(verdict, column)| cell("v3", column, verdict))
            .collect(),
        passed: Some(passed),
        failures: if passed {
            Vec::new()
        } else {
            vec!["(0, 0) is wrong".into()]
        },
        findings: Vec::new(),
        left: left.to_vec(),
        size: (30, 10),
        estimate: drawn([known, known, unknown]),
        truth: Some(drawn([known; 3])),
        preview: Some(b"preview".to_vec()),
        true_preview: Some(b"true preview".to_vec()),
        errors: Some(b"errors".to_vec()),
    }
}

fn scene() -> SceneFigure {
    let shot = |algorithm: &str| SceneResult {
        row: row(algorithm, 0, 5_000),
        disparities: b"disparities".to_vec(),
        errors: Some(b"errors".to_vec()),
    };
    SceneFigure {
        title: "teddy <&>".into(),
        size: (45, 37),
        left: vec![0xff, 0xd8, 0xff],
        max_px: 53.4,
        truth: Some(b"truth".to_vec()),
        shots: vec![shot("v3"), shot("bm")],
    }
}

#[test]
fn the_page_shows_every_figure_and_holds_every_image_once() {
    let figures = vec![
        figure(
            1,
            "1 opening",
            vec![
                (Rank::Worst, shot(false, b"one")),
                (Rank::Best, shot(true, b"two")),
            ],
        ),
        figure(2, "2 ball", vec![(Rank::Worst, shot(true, b"one"))]),
        figure(3, "3 bridge", vec![]),
    ];
    let html = ReportPage {
        figures,
        ..page(example())
    }
    .render()
    .unwrap();
    let count = |text: &str| count(&html, text);
    // "one", "two" and the maps in base64; six overlays and three maps of each kind show them.
    assert_eq!(
        [
            "data:image/png;base64,",
            "b25l\"",
            "dHdv\"",
            "cHJldmlldw==\""
        ]
        .map(count),
        [5, 1, 1, 1]
    );
    let shown = (0..5).map(|i| count(&format!("href=\"#i{i}\"")));
    assert_eq!(shown.collect::<Vec<_>>(), [4, 3, 3, 3, 2]);
    // With a key of the errors.
    assert!(html.contains("no estimate"));
    // Besides the legend: two known cells, an unknown and a wrong one per estimate, three known
    // ones per truth.
    assert_eq!(
        ["class=\"median\"", "class=\"dot\"", "href=\"#wrong\""].map(count),
        [16, 4, 4]
    );
    assert!(
        html.contains("<rect class=\"median\" x=\"2.5\" y=\"2.5\" width=\"5.0\" height=\"5.0\"/>")
    );
    assert!(
        html.contains("seed 7, frame 143") && html.contains("cells: 12 right, 1 wrong, 2 unknown")
    );
    assert!(html.contains("wrong: (0, 0) 0.80 m, true 0.40 m, obstacle missed"));
    assert!(html.contains("(0, 0) is wrong"));
    assert_eq!(count("passes in 4 of 4 frames"), 3, "a square, two frames");
    // The checkpoint that the first algorithm fails.
    assert_eq!(count("data-first=\"cp1\""), 1);
    assert_eq!(count("class=\"unseen\""), 1);
    // A square leads to the frames of its checkpoint and algorithm, if there are any.
    for square in ["cp1", "cp2"] {
        let target = format!("href=\"#{square}-0\" data-figure=\"{square}\" data-algorithm=\"v3\"");
        assert_eq!(
            [target, format!(" id=\"{square}-0\"")].map(|text| count(&text)),
            [1, 1]
        );
    }
    assert_eq!(
        [
            "<a class=\"cp\"",
            "data-choose=",
            "data-toggle=",
            "data-rank=\"worst\""
        ]
        .map(count),
        [2, 3, 0, 3]
    );
}

#[test]
fn the_answer_comes_before_frames_and_all_else_is_folded() {
    let html = ReportPage {
        figures: vec![figure(1, "1 opening", vec![(Rank::Best, shot(true, b"x"))])],
        gate: vec![
            (GateState::Pass, "kept".into()),
            (GateState::Fail, "broken".into()),
        ],
        ..page(example())
    }
    .render()
    .unwrap();
    let ids = [
        "headline",
        "plot",
        "frames",
        "algorithms",
        "metrics",
        "speed",
        "gate",
        "cite",
        "made",
    ];
    let order = places(&html, &ids);
    assert!(order.is_sorted(), "{order:?}");
    assert_eq!(count(&html, "<details"), ids.len() - 3 + 2);
    // Failed limits are not hidden.
    assert_eq!(count(&html, "<details id=\"gate\" open>"), 1);
    assert_eq!(count(&html, "<a href=\"#gate\">"), 1);
    let own = |label: &str| format!("<tr data-algorithm=\"{label}\">");
    assert_eq!(count(&html, &own("v3")), 1);
    assert_eq!(count(&html, "class=\"stack\""), 1, "the other has no truth");
    assert_eq!(count(&html, "class=\"time\""), 2);
}

#[test]
fn an_algorithm_has_one_color_wherever_it_is() {
    let rows = vec![row("bm", 0, 1_000), row("v3", 0, 5_000)];
    let mut page = page(super::fixture::summary(rows, Vec::new()));
    // By the order of the run, not that of a sorted summary.
    page.summary.algorithms.reverse();
    let html = page.render().unwrap();
    for (label, [r, g, b]) in [("bm", algorithm_color(0)), ("v3", algorithm_color(1))] {
        let key = format!("background: rgb({r} {g} {b})\"></i>{label}");
        assert!(html.contains(&key), "{label}");
        let drawn = format!("fill=\"#{r:02X}{g:02X}{b:02X}\"");
        assert!(count(&html, &drawn) >= 3, "{label}");
    }
}

#[test]
fn the_page_shows_scenes_with_truth_and_errors() {
    let summary = super::fixture::summary(vec![row("v3", 0, 1), row("bm", 0, 1)], Vec::new());
    let html = ReportPage {
        scenes: vec![scene()],
        ..page(summary.clone())
    }
    .render()
    .unwrap();
    let count = |text: &str| count(&html, text);
    assert_eq!(
        [
            "<img ",
            "data:image/jpeg;base64,/9j/",
            "alt=\"teddy &lt;&amp;&gt;: errors of bm\""
        ]
        .map(count),
        [6, 1, 1]
    );
    assert!(html.contains("</i>53 px") && html.contains("45 × 37 pixels"));
    // The key of the errors: its ends, KITTI's 3 px in its middle, and the key for pixels without
    // one.
    assert_says(
        &html,
        &[
            "&lt;\u{202f}0.19<",
            "&lt;\u{202f}3<",
            "&lt;\u{202f}6<",
            "≥\u{202f}48 px<",
            "no estimate",
            "not scored",
        ],
    );
    assert_eq!(
        ["data-choose=\"f0\"", "data-toggle=", "id=\"pictured\""].map(count),
        [1, 2, 0]
    );
    let one = SceneFigure {
        shots: scene().shots.split_off(1),
        ..scene()
    };
    let html = ReportPage {
        scenes: vec![one],
        ..page(summary)
    }
    .render()
    .unwrap();
    assert!(html.contains("id=\"pictured\""));
}

#[test]
fn probabilities_have_a_reliability_plot() {
    let mut summary = example();
    let row = |from, to, cells| ReliabilityRow {
        algorithm: "v3".into(),
        from,
        to,
        cells,
        predicted: (from + to) / 2.0,
        right: 0.93,
    };
    let without = page(summary.clone()).render().unwrap();
    assert!(!without.contains("id=\"reliability\""));
    summary.reliability = vec![row(0.9, 0.925, 19), row(0.925, 0.95, 20)];
    let html = page(summary).render().unwrap();
    assert_says(
        &html,
        &["id=\"reliability\"", "92.5–95", "predicted right, %"],
    );
}

#[test]
fn a_page_of_no_pairs_says_so() {
    let html = page(Results::default()).render().unwrap();
    assert!(html.contains("id=\"nothing\"") && !html.contains("id=\"headline\""));
}

#[test]
fn a_sweep_is_a_line_with_its_values() {
    let plain = page(example()).render().unwrap();
    let point = |value: &str, label: &str| (value.to_owned(), label.to_owned());
    let points = vec![point("0.4", "v3"), point("0.8", "v3:texture_sigma=0.8")];
    let sweep = ParameterSweep {
        algorithm: "v3".into(),
        parameter: "texture_sigma".into(),
        points,
    };
    let rows = vec![
        row("v3", 0, 5_000),
        row("v3:texture_sigma=0.8", 0, 2_500),
        row("bm", 0, 1_000),
    ];
    let swept = ReportPage {
        sweeps: vec![sweep],
        ..page(super::fixture::summary(rows, Vec::new()))
    }
    .render()
    .unwrap();
    // Two plots against time, two against coverage.
    assert_eq!(
        [&plain, &swept].map(|html| count(html, "\nv3: texture_sigma = 0.4, v3\n")),
        [0, 4]
    );
    assert_eq!([&plain, &swept].map(|html| count(html, "\nbm\n")), [0, 7]);
    assert_eq!(count(&swept, "class=\"plot\""), 7);
    // The plot comes first; a column has the value, and the name not.
    let order = places(&swept, &["plot", "headline"]);
    assert!(order.is_sorted(), "{order:?}");
    assert_eq!(
        count(&swept, "<button type=\"button\">texture_sigma</button>"),
        1
    );
    let named = "title=\"v3:texture_sigma=0.8\"><i class=\"key\"";
    let from = swept.find(named).unwrap();
    assert!(
        swept[from..]
            .split("</th>")
            .next()
            .unwrap()
            .ends_with("</i>v3")
    );
}

#[test]
fn long_tables_are_cut_by_the_script() {
    let many = |n: u32| {
        let rows = (0..n).map(|i| row(&format!("bm:uniqueness={i}"), 0, 1_000));
        page(super::fixture::summary(rows.collect(), Vec::new()))
            .render()
            .unwrap()
    };
    let marks = [
        "class=\"headline long\"",
        "id=\"all\"",
        "<tr data-algorithm=",
    ];
    assert_eq!(marks.map(|text| count(&many(15), text)), [0, 0, 15]);
    assert_eq!(marks.map(|text| count(&many(16), text)), [1, 1, 16]);
}

#[test]
fn the_page_escapes_and_fetches_nothing() {
    let figure = CheckpointFigure {
        about: "<em>".into(),
        ..figure(1, "<u>", vec![(Rank::Best, shot(true, b"x"))])
    };
    let html = ReportPage {
        figures: vec![figure],
        ..page(example())
    }
    .render()
    .unwrap();
    // The name of a namespace is not an address to fetch.
    let html = html.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    for raw in [
        "<title><b>",
        "<h1><b>",
        "<script>alert",
        "<script src",
        "<u>",
        "<em>",
        "A & B",
        "http:",
        "https:",
        "url(",
    ] {
        assert!(!html.contains(raw), "{raw}");
    }
    assert_eq!(count(&html, "<script"), 1);
    assert_says(
        &html,
        &[
            "<h1>&lt;b&gt;</h1>",
            "&lt;script&gt;",
            "<h3>&lt;u&gt;</h3>",
            "<p>A &amp; B.</p>",
            "<p>C.</p>",
        ],
    );
}
