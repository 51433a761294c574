//! The HTML page.

use super::fixture::{cell, example, row};
use crate::common::assert_says;
use svl::overlay::{Nearness, marks};
use svl::report::Summary;
use svl::report::html::{
    CheckpointFigure, FrameShot, ParameterSweep, Rank, ReportPage, SceneFigure, SceneResult,
};
use svl::score::Verdict;
use svl::stereo::{Cell, CellDepth, DepthGrid, GridShape};

/// A page under a title and with texts that would be HTML.
fn page(summary: Summary) -> ReportPage {
    ReportPage {
        gate: Vec::new(),
        title: "<b>".into(),
        description: "A & B.\n\nC.".into(),
        identity: vec![("CPU".into(), "<script>alert(1)</script>".into())],
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
        maps: Vec::new(),
        parts: Vec::new(),
    }
}

/// A frame with a wrong cell, a right one and an unknown one.
fn shot(passed: bool, left: &[u8]) -> FrameShot {
    let depth = CellDepth {
        median_px: 20.0,
        p20_px: 18.0,
        p80_px: 22.0,
        distance_m: Some(0.8),
    };
    let known = Cell {
        valid_share: 1.0,
        probability: None,
        evidence: None,
        too_close: false,
        depth: Some(depth),
    };
    let unknown = Cell {
        valid_share: 0.0,
        probability: None,
        evidence: None,
        too_close: false,
        depth: None,
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
        findings: Vec::new(),
        left: left.to_vec(),
        size: (30, 10),
        estimate: drawn([known, known, unknown]),
        truth: Some(drawn([known; 3])),
        preview: b"preview".to_vec(),
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
    let figure = |title: &str, shots| CheckpointFigure {
        title: title.into(),
        about: String::new(),
        shots,
    };
    let figures = vec![
        figure(
            "1. opening",
            vec![
                (Rank::Worst, shot(false, b"one")),
                (Rank::Best, shot(true, b"two")),
            ],
        ),
        figure("2. ball", vec![(Rank::Worst, shot(true, b"one"))]),
        figure("3. bridge", vec![]),
    ];
    let html = ReportPage {
        figures,
        ..page(example())
    }
    .render()
    .unwrap();
    let count = |text: &str| html.matches(text).count();
    // "one", "two" and "preview" in base64; six overlays and three previews show them.
    assert_eq!(
        [
            "data:image/png;base64,",
            "b25l\"",
            "dHdv\"",
            "cHJldmlldw==\""
        ]
        .map(count),
        [3, 1, 1, 1]
    );
    assert_eq!(
        ["href=\"#i0\"", "href=\"#i1\"", "href=\"#i2\""].map(count),
        [4, 3, 2]
    );
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
    assert!(html.contains("wrong: (0, 0) 0.80 m, truly 0.40 m, obstacle missed"));
    assert_eq!(count("Never seen: no frame shows it."), 1);
}

#[test]
fn the_page_shows_scenes_with_truth_and_errors() {
    let html = ReportPage {
        scenes: vec![scene()],
        maps: Vec::new(),
        parts: Vec::new(),
        ..page(example())
    }
    .render()
    .unwrap();
    let count = |text: &str| html.matches(text).count();
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
    // The key of the errors: its ends, KITTI's 3 px in its middle, and what is none.
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
    assert!(!html.contains("Pictures of"));
    let one = SceneFigure {
        shots: scene().shots.split_off(1),
        ..scene()
    };
    let html = ReportPage {
        scenes: vec![one],
        maps: Vec::new(),
        parts: Vec::new(),
        ..page(example())
    }
    .render()
    .unwrap();
    assert!(html.contains("Pictures of 1 of the 2 algorithms"));
}

#[test]
fn a_page_of_no_pairs_says_so() {
    assert!(
        ReportPage {
            scenes: vec![],
            maps: Vec::new(),
            parts: Vec::new(),
            ..page(Summary::default())
        }
        .render()
        .unwrap()
        .contains("No pairs.")
    );
}

#[test]
fn a_sweep_is_a_line_with_its_values() {
    let plain = page(example()).render().unwrap();
    let point = |value: &str, label: &str| (value.to_owned(), label.to_owned());
    let points = vec![point("0.4", "v3"), point("0.8", "v3:texture_sigma=0.8")];
    let sweep = ParameterSweep {
        name: "v3: texture_sigma".into(),
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
    let count = |html: &str, text: &str| html.matches(text).count();
    // Two plots of accuracy, two of coverage.
    assert_eq!(
        [&plain, &swept].map(|html| count(html, "\nv3: texture_sigma = 0.4, v3\n")),
        [0, 4]
    );
    assert_eq!([&plain, &swept].map(|html| count(html, "\nbm\n")), [0, 7]);
    assert_eq!(count(&swept, "class=\"plot\""), 7);
}

#[test]
fn the_page_escapes_and_fetches_nothing() {
    let figure = CheckpointFigure {
        title: "<u>".into(),
        about: "<em>".into(),
        shots: vec![(Rank::Best, shot(true, b"x"))],
    };
    let html = ReportPage {
        figures: vec![figure],
        scenes: vec![scene()],
        maps: Vec::new(),
        parts: Vec::new(),
        ..page(example())
    }
    .render()
    .unwrap();
    // A name of a namespace is no address that anyone fetches.
    let html = html.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    for raw in [
        "<title><b>",
        "<h1><b>",
        "<script",
        "<u>",
        "<em>",
        "A & B",
        "http:",
        "https:",
        "url(",
    ] {
        assert!(!html.contains(raw), "{raw}");
    }
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
