//! The HTML page.

use super::fixture::{cell, example, row};
use crate::cli::transcript::assert_words;
use svl::manifest::{AlgorithmRecord, Manifest};
use svl::overlay::{Nearness, algorithm_colors, marks};
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
    let times_ms = summary.algorithms.iter().map(|a| {
        let times_ms = [a.p50_ms, a.max_ms].map(Option::unwrap);
        (a.algorithm.clone(), times_ms.to_vec())
    });
    ReportPage {
        manifest,
        gate: Vec::new(),
        description: "A & B.\n\nC.".into(),
        times_ms: times_ms.collect(),
        summary,
        sweeps: Vec::new(),
        figures: Vec::new(),
        scenes: Vec::new(),
        timeline: Default::default(),
        replays: Default::default(),
        cases: None,
        maps: Vec::new(),
        files: Vec::new(),
    }
}

/// A page of the example with these figures.
fn with_figures(figures: Vec<CheckpointFigure>) -> ReportPage {
    ReportPage {
        figures,
        ..page(example())
    }
}

fn figure(number: u32, title: &str, shots: Vec<(Rank, FrameShot)>) -> CheckpointFigure {
    CheckpointFigure {
        checkpoint: Some(number),
        title: title.into(),
        shots,
        ..CheckpointFigure::default()
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
    let with_depth = |depth: Option<CellDepth>| Cell {
        valid_share: f64::from(u8::from(depth.is_some())),
        depth,
        ..Cell::UNKNOWN
    };
    let (known, unknown) = (with_depth(Some(depth)), with_depth(None));
    let shape = GridShape {
        columns: 3,
        rows: 1,
    };
    let drawn = |cells: [Cell; 3]| {
        let grid = DepthGrid::new(shape, cells.to_vec()).unwrap();
        marks(&grid, (30, 10), Nearness::new(40.0, 0.0))
    };
    let failure = (!passed).then(|| "(0, 0) is wrong".to_owned());
    let verdicts = [Verdict::Wrong, Verdict::Right, Verdict::Unknown];
    let cells = verdicts.into_iter().zip(0..);
    FrameShot {
        row: row("v3", 143, 5_000),
        cells: cells
            .map(|(verdict, column)| cell("v3", column, verdict))
            .collect(),
        passed: Some(passed),
        failures: failure.into_iter().collect(),
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
    let opening = vec![
        (Rank::Worst, shot(false, b"one")),
        (Rank::Best, shot(true, b"two")),
    ];
    let figures = vec![
        figure(1, "1 opening", opening),
        figure(2, "2 ball", vec![(Rank::Worst, shot(true, b"one"))]),
        figure(3, "3 bridge", vec![]),
    ];
    let html = with_figures(figures).render().unwrap();
    // "one", "two" and the maps in base64; three estimates with their maps, and two truths, as the
    // frames of the first are of one pair, show them. With a key of the errors. Besides the legend:
    // two known cells, an unknown and a wrong one per estimate, three known ones per truth. The
    // checkpoint that the first algorithm fails; frames of 4: a square and two frames.
    assert_words(
        &html,
        "5x data:image/png;base64, | 1x b25l\" | 1x dHdv\" | 1x cHJldmlldw==\" \
        | 4x href=\"#i0\" | 2x href=\"#i1\" | 3x href=\"#i2\" | 3x href=\"#i3\" | 1x href=\"#i4\" \
        | no estimate | 13x class=\"median\" | 4x class=\"dot\" | 4x href=\"#wrong\" \
        | <rect class=\"median\" x=\"2.5\" y=\"2.5\" width=\"5.0\" height=\"5.0\"/> \
        | seed 7, frame 143 | cells: 12 right, 1 wrong, 2 unknown \
        | wrong: (0, 0) 0.80 m, true 0.40 m, obstacle missed | (0, 0) is wrong \
        | 3x passes in 4 of 4 frames | 1x data-first=\"cp1\" | 1x class=\"unseen\" \
        | 2x <a class=\"cp\" | 3x data-choose= | !data-toggle= | 3x data-rank=\"worst\"",
    );
    // A square leads to the frames of its checkpoint and algorithm, if there are any.
    for square in ["cp1", "cp2"] {
        let target = format!("href=\"#{square}-0\" data-figure=\"{square}\" data-algorithm=\"v3\"");
        assert_words(&html, &format!("1x {target} | 1x id=\"{square}-0\""));
    }
}

#[test]
fn the_answer_comes_before_frames_and_all_else_is_folded() {
    let figures = vec![figure(1, "1 opening", vec![(Rank::Best, shot(true, b"x"))])];
    let mut page = with_figures(figures);
    page.gate = vec![
        (GateState::Pass, "kept".into()),
        (GateState::Fail, "broken".into()),
    ];
    page.summary.shown.sort = svl::score::Metric::find("flicker");
    let html = page.render().unwrap();
    let legend = page.summary.legend();
    let is_note = |line: &String| html.contains(&format!("<p class=\"note\">{line}</p>"));
    assert!(
        !legend.is_empty() && legend.iter().all(is_note),
        "{legend:?}"
    );
    let ids = "headline frames algorithms metrics speed gate cite made";
    let order = places(&html, &ids.split(' ').collect::<Vec<_>>());
    assert!(order.is_sorted(), "{order:?}");
    // Failed limits are not hidden. The other algorithm has no truth, and one dot is no plot.
    assert_words(
        &html,
        "7x <details | !id=\"plot\" | 1x <details id=\"gate\" data-contents=\"Gate\" open> \
        | 2x <a href=\"#gate\"> \
        | 1x <tr data-algorithm=\"v3\"> | 1x class=\"stack\" | 2x class=\"time\"",
    );
}

#[test]
fn an_algorithm_has_one_color_wherever_it_is() {
    let rows = vec![row("bm", 0, 1_000), row("v3", 0, 5_000)];
    let mut page = page(super::fixture::summary(rows, Vec::new()));
    // By the order of the run, not that of a sorted summary.
    page.summary.algorithms.reverse();
    let html = page.render().unwrap();
    let labels = ["bm", "v3"];
    for (label, [r, g, b]) in labels.into_iter().zip(algorithm_colors(&labels)) {
        let key = format!("background: rgb({r} {g} {b})\"></i>{label}");
        assert!(html.contains(&key), "{label}");
        let drawn = format!("fill=\"#{r:02X}{g:02X}{b:02X}\"");
        assert!(count(&html, &drawn) >= 3, "{label}");
    }
}

#[test]
fn the_page_shows_scenes_with_truth_and_errors() {
    let html = |scenes| {
        let rows = vec![row("v3", 0, 1), row("bm", 0, 1)];
        let summary = super::fixture::summary(rows, Vec::new());
        let page = ReportPage {
            scenes,
            ..page(summary)
        };
        page.render().unwrap()
    };
    // The key of the errors: its ends, KITTI's 3 px in its middle, and the key for pixels without
    // one.
    assert_words(
        &html(vec![scene()]),
        "6x <img  | 1x data:image/jpeg;base64,/9j/ \
        | 1x alt=\"teddy &lt;&amp;&gt;: errors of bm\" | </i>53 px | 45 × 37 pixels \
        | &lt;\u{202f}0.19< | &lt;\u{202f}3< | &lt;\u{202f}6< | ≥\u{202f}48 px< | no estimate \
        | not scored | 1x data-choose=\"f0\" | 2x data-toggle= | !id=\"pictured\"",
    );
    let one = SceneFigure {
        shots: scene().shots.split_off(1),
        ..scene()
    };
    assert_words(&html(vec![one]), "id=\"pictured\"");
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
    assert_words(&without, "!id=\"reliability\"");
    summary.reliability = vec![
        row(0.9, 0.925, 19),
        row(0.925, 0.95, 20),
        row(0.95, 0.975, 20),
    ];
    let html = page(summary).render().unwrap();
    assert_words(&html, "id=\"reliability\" | 92.5–95 | predicted right, %");
}

#[test]
fn a_page_of_no_pairs_says_so() {
    let html = page(Results::default()).render().unwrap();
    assert_words(&html, "id=\"nothing\" | !id=\"headline\"");
}

#[test]
fn a_sweep_is_a_line_with_its_values() {
    let plain = page(example()).render().unwrap();
    let point = |value: &str, label: &str| (value.to_owned(), label.to_owned());
    let sweep = ParameterSweep {
        algorithm: "v3".into(),
        parameter: "texture_sigma".into(),
        points: vec![point("0.4", "v3"), point("0.8", "v3:texture_sigma=0.8")],
    };
    let rows = vec![
        row("v3", 0, 5_000),
        row("v3:texture_sigma=0.8", 0, 2_500),
        row("bm", 0, 1_000),
    ];
    let page = ReportPage {
        sweeps: vec![sweep],
        ..page(super::fixture::summary(rows, Vec::new()))
    };
    let swept = page.render().unwrap();
    // Two plots against time, two against coverage.
    assert_words(&plain, "!\\nv3: texture_sigma = 0.4, v3\\n | !\\nbm\\n");
    assert_words(
        &swept,
        "4x \\nv3: texture_sigma = 0.4, v3\\n | 7x \\nbm\\n | 7x class=\"plot\" \
        | 1x <button type=\"button\">texture_sigma</button>",
    );
    // The plot comes first; a column has the value, and the name not.
    let order = places(&swept, &["plot", "headline"]);
    assert!(order.is_sorted(), "{order:?}");
    let named = "title=\"v3:texture_sigma=0.8\"><i class=\"key\"";
    let (_, cell) = swept.split_once(named).unwrap();
    assert!(cell.split("</th>").next().unwrap().ends_with("</i>v3"));
}

#[test]
fn long_tables_are_cut_by_the_script() {
    for (algorithms, marks) in [(15, 0), (16, 1)] {
        let rows = (0..algorithms).map(|i| row(&format!("bm:uniqueness={i}"), 0, 1_000));
        let page = page(super::fixture::summary(rows.collect(), Vec::new()));
        assert_words(
            &page.render().unwrap(),
            &format!(
                "{marks}x class=\"headline long\" | {marks}x id=\"all\" \
                 | {algorithms}x <tr data-algorithm="
            ),
        );
    }
}

#[test]
fn the_page_escapes_and_fetches_nothing() {
    let figure = CheckpointFigure {
        about: "<em>".into(),
        ..figure(1, "<u>", vec![(Rank::Best, shot(true, b"x"))])
    };
    let html = with_figures(vec![figure]).render().unwrap();
    // The name of a namespace is not an address to fetch.
    let html = html.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    assert_words(
        &html,
        "!<title><b> | !<h1><b> | !<script>alert | !<script src | !<u> | !<em> | !A & B | !http: \
        | !https: | !url( | 1x <script | <h1>&lt;b&gt;</h1> | &lt;script&gt; \
        | <h3>&lt;u&gt;</h3> | <p>A &amp; B.</p> | <p>C.</p>",
    );
}
