//! `--figures DIR`: each plot of a page as an SVG file.

use super::fixture::{Fixture, assert_says};
use quick_xml::Reader;
use quick_xml::events::Event;

const SCORE: &str = "score bag.mcap --algo bm:max_disparity=48 --algo v3:max_disparity=48 --stress \
                     noise=4/8 -q --rerun none";

/// A bag of the arena whose truth is named only on demand.
fn bag() -> Fixture {
    let fixture = Fixture::new();
    fixture.record("run.mcap", "arena --frames 24 --seed 7");
    fixture.run("record run.mcap --ros2 -q -o bag.mcap");
    fixture
}

/// The names of the figures in a folder; each is a whole SVG document that fetches nothing.
fn figures(fixture: &Fixture, folder: &str) -> Vec<String> {
    let entries = std::fs::read_dir(fixture.path(folder)).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.collect();
    names.sort();
    for name in &names {
        let text = fixture.text(&format!("{folder}/{name}"));
        assert_says(
            &text,
            &["viewBox=", "<title>", "font-family=\"sans-serif\""],
        );
        assert!(!text.contains("href") && !text.contains("<style"), "{name}");
        let mut reader = Reader::from_str(&text);
        let mut elements = 0;
        loop {
            match reader
                .read_event()
                .unwrap_or_else(|e| panic!("{name}: {e}"))
            {
                Event::Start(start) if elements == 0 => assert_eq!(start.name().as_ref(), "svg"),
                Event::Eof => break,
                _ => {}
            }
            elements += 1;
        }
        assert!(elements > 10, "{name}");
    }
    names
}

#[test]
fn every_plot_of_the_page_is_a_file() {
    let fixture = bag();
    fixture.run(&format!("{SCORE} -o r --figures out/figures"));
    let names = figures(&fixture, "out/figures");
    let expected = [
        "estimated-right-cells-against-time.svg",
        "fraction-of-each-stage.svg",
        "latency.svg",
        "noise-changed.svg",
        "noise-gone.svg",
        "noise-same.svg",
        "time-by-stage.svg",
    ];
    assert_eq!(names, expected);
    let page = fixture.text("r/index.html");
    assert_eq!(page.matches("<svg class=\"plot\"").count(), names.len());
    let plot = fixture.text("out/figures/estimated-right-cells-against-time.svg");
    // Points of equal times share a title.
    assert_says(&plot, &["bm:max_disparity=48", "\nmedian ms per pair: "]);

    // A merged page has its own.
    for i in 1..=2 {
        fixture.run(&format!("{SCORE} --shard {i}/2 -o p{i}"));
    }
    fixture.run("report p1 p2 -o all -q --figures merged");
    assert_eq!(figures(&fixture, "merged"), expected);
    // Figures are not replaced.
    fixture
        .fails("report p1 p2 -o again --figures merged => 1: merged/ | name a new or empty folder");
    assert!(!fixture.path("again").exists());
}

#[test]
fn a_sweep_of_two_parameters_has_its_heat_map() {
    let fixture = bag();
    let grid = "bm:max_disparity=4/8,block_size=5/7/9";
    fixture.run(&format!(
        "score run.mcap --algo {grid} -q --rerun none -o r --figures f"
    ));
    let names = figures(&fixture, "f");
    let heat = names.iter().find(|name| name.starts_with("heat-map-bm"));
    let heat = fixture.text(&format!(
        "f/{}",
        heat.unwrap_or_else(|| panic!("{names:?}"))
    ));
    assert_says(&heat, &["\nblock_size\n", "\nmax_disparity\n", "\n9\n"]);
}

#[test]
fn a_folder_of_others_is_refused_before_the_run() {
    let fixture = bag();
    fixture.write("full/notes.txt", "mine");
    fixture.write("file", "mine");
    fixture.fails(&format!(
        "{SCORE} -o r --figures full => 1: full/notes.txt | name a new or empty folder
         {SCORE} -o r --figures file => 1: file
         {SCORE} -o r --figures r/figures => 2: r/figures | name a new or empty folder
         {SCORE} -o r --figures ./r => 2: ./r: is in a folder | name a new or empty folder"
    ));
    assert!(!fixture.path("r").exists());
    assert_eq!(
        fixture.text("full/notes.txt") + &fixture.text("file"),
        "minemine"
    );
}
