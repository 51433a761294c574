//! Test pieces: from where on an algorithm always sees them.

use super::fixture::Fixture;
use std::collections::BTreeMap;
use svl::report::{CellRow, PieceRow, Record, SightRow, read_rows};
use svl::stereo::CellState;

/// Approaches to pieces of 10 and 20 cm, six pairs each.
const SCENARIO: &str = r#"
name = "approach"
algorithms = ["v5", "sgm"]
[grid]
columns = 24
rows = 12
[piece]
sizes_m = [[0.1, 0.2], [0.2, 0.2]]
[source]
kind = "arena"
seeds = [1, 2, 3]
[arena]
frames = 6
rate_hz = 1.0
[arena.robot]
path = [{ at_m = [1.0, 1.4], heading_deg = 90.0 }, { at_m = [1.0, 3.0], heading_deg = 90.0 }]
[arena.world]
width_m = 2.0
length_m = 5.0
blocks = []
balls = []
"#;

fn rows<R: Record>(fixture: &Fixture, table: &str) -> Vec<R> {
    read_rows(&fixture.path(table)).unwrap()
}

/// The pairs that see the piece, by the cells of a report: its `piece_m` marks those that show it.
fn seen_by_cells(fixture: &Fixture, report: &str) -> BTreeMap<(String, Option<u64>, u64), bool> {
    let mut seen = BTreeMap::new();
    for cell in rows::<CellRow>(fixture, &format!("{report}/cells.csv")) {
        let own = seen.entry((cell.algorithm.clone(), cell.seed, cell.sequence));
        let own: &mut bool = own.or_default();
        let Some(piece_m) = cell.piece_m else {
            continue;
        };
        let is_close = |m: f64| (m - piece_m).abs() <= f64::max(0.1, 0.2 * piece_m);
        let is_flagged = [Some(CellState::Near), Some(CellState::TooClose)].contains(&cell.state);
        let distances = [cell.distance_m, cell.near_distance_m];
        *own |= distances.into_iter().flatten().any(is_close) || is_flagged && piece_m < 0.5;
    }
    seen
}

#[test]
fn reaches_are_those_of_the_cells() {
    let fixture = Fixture::new();
    fixture.write("a.toml", SCENARIO);
    fixture.transcript(
        "score a.toml --rerun none -o a => Test pieces | 10 x 20 cm | 20 x 20 cm | exact \
        | needs 59 approaches, there are 1
        cat a/index.html => Pairs that see the piece
        cat a/summary.md => ## Test pieces
        score a.toml --rerun none --algo v5 --seeds 1..2 -o b -q
        score a.toml --rerun none --algo v5 --seeds 1..3 -o b -q
        score a.toml --rerun none --algo v5 -o c -q --shard 1/2
        score a.toml --rerun none --algo v5 -o d -q --shard 2/2
        report c d -o e -q
        score a.toml --rerun none --algo bm:max_disparity=16 --seeds 1..2 -o f -q
        cat f/index.html => : 20 x 20 cm at 0.5 | : 10 x 20 cm at 0.5 | m is not seen \
        | worst frame | !2nd worst frame",
    );
    assert!(!fixture.path("recordings").exists());
    let seen = seen_by_cells(&fixture, "a");
    let sights: Vec<SightRow> = rows(&fixture, "a/sights.csv");
    assert_eq!(sights.len(), 2 * 3 * 6);
    for row in &sights {
        let key = (row.algorithm.clone(), row.seed, row.sequence);
        assert_eq!(row.seen, seen[&key], "{row:?}");
    }
    // The piece comes nearer, and is seen when it is near.
    let own = sights
        .iter()
        .filter(|row| row.algorithm == "v5" && row.seed == Some(2));
    let distances: Vec<_> = own.clone().map(|row| row.piece_m.unwrap()).collect();
    assert!(distances.is_sorted_by(|a, b| a > b), "{distances:?}");
    assert!((distances[0] - 1.9).abs() < 0.1, "{distances:?}");
    let pieces: Vec<PieceRow> = rows(&fixture, "a/pieces.csv");
    let names: Vec<_> = pieces.iter().map(|row| row.algorithm.as_str()).collect();
    assert_eq!(names, ["v5", "v5", "sgm", "sgm", "exact", "exact"]);
    for piece in &pieces[..4] {
        let seeds = if piece.width_m < 0.15 { 2..=2 } else { 1..=3 };
        let reach = |seed: u64| {
            let own = sights.iter().filter(|row| row.algorithm == piece.algorithm);
            let own = own.filter(|row| row.seed == Some(seed) && row.piece_m > Some(0.5));
            let near_first = own.rev().map(|row| (row.piece_m.unwrap(), row.seen));
            near_first
                .take_while(|own| own.1)
                .last()
                .map_or(0.0, |own| own.0)
        };
        let mut reaches: Vec<_> = seeds.step_by(2).map(reach).collect();
        reaches.sort_by(f64::total_cmp);
        assert_eq!(
            piece.median_m,
            Some(reaches[(reaches.len() - 1) / 2]),
            "{piece:?}"
        );
        assert_eq!(piece.reach_m, None);
    }
    // The same by parts, and grown.
    let of_v5 = |table: &str| -> Vec<_> {
        let text = fixture.text(table);
        text.lines()
            .filter(|line| line.starts_with("v5,"))
            .map(str::to_owned)
            .collect()
    };
    assert_eq!(of_v5("a/pieces.csv"), of_v5("e/pieces.csv"));
    assert_eq!(of_v5("a/pieces.csv"), of_v5("b/pieces.csv"));
}

#[test]
fn a_piece_is_found_in_the_truth_of_a_recording() {
    let fixture = Fixture::new();
    fixture.write("a.toml", SCENARIO);
    fixture.transcript(
        "record a.toml --seed 2 -q -o own.mcap
        score a.toml --seeds 2 --algo v5 --rerun none -o a -q
        score own.mcap --piece 0.10x0.20 --cells 24x12 --algo v5 --rerun none -o b => 10 x 20 cm
        score own.mcap --piece 0.30x0.20 --cells 24x12 --algo v5 --rerun none -o c \
        => pairs that do not show it alone
        score own.mcap --piece 0.1 --algo v5 => 2: --piece | as 0.10x0.20
        score own.mcap --piece 9x0.2 --algo v5 => 2: a side is 0.005 to 5 m
        score own.mcap --piece 0.005x0.2 --near 1 --algo v5 -o d => 1~ px wide | at least 3 px
        record own.mcap --ros2 -q -o bag.mcap
        score bag.mcap --piece 0.1x0.2 --algo v5 -o d => 1: bag.mcap: a test piece \
        | --truth with a depth image
        score arena --piece 0.1x0.2 => 2: is of recordings | sizes_m of [piece]",
    );
    let [arena, own] =
        ["a", "b"].map(|report| rows::<SightRow>(&fixture, &format!("{report}/sights.csv")));
    let alike = arena.iter().zip(&own).filter(|(a, b)| {
        let both = a.piece_m.zip(b.piece_m);
        both.is_some_and(|(a, b)| (a - b).abs() < 0.03 * a) && a.seen == b.seen
    });
    assert!(alike.count() >= 5, "{arena:?} {own:?}");
}

#[test]
fn pieces_that_cannot_be_approached_are_one_line() {
    let fixture = Fixture::new();
    let fails = |from: &str, to: &str, words: &str| {
        assert!(SCENARIO.contains(from), "{from}");
        fixture.write("a.toml", SCENARIO.replace(from, to));
        fixture.fails(&format!("score a.toml => 1: {words}"));
    };
    fails("blocks = []\n", "", "the only object of its arena");
    fails("[[0.1, 0.2], [0.2, 0.2]]", "[]", "names 1 to 100 pieces");
    fails("[[0.1, 0.2], [0.2, 0.2]]", "[[0.1, -1.0]]", "has -1");
    fails("[[0.1, 0.2], [0.2, 0.2]]", "[[0.001, 0.2]]", "has 0.001");
    fails(
        "[[0.1, 0.2], [0.2, 0.2]]",
        "[[0.006, 0.2]]\nnear_m = 1.0",
        "at least 3 px",
    );
    fails("[piece]", "[piece]\nnear_m = nan", "near_m");
    fails(
        "[piece]",
        "[cells]\njudge = \"disparity\"\ntolerance_px = 1.0\n[piece]",
        "judged by disparities",
    );
    fails(
        "frames = 6",
        "frames = 6\npieces_m = [[1.0, 1.0]]",
        "pieces_m",
    );
}
