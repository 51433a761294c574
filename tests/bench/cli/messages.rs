//! Catalogue of messages: commands that fail, and a snapshot of their exit status and lines.
//!
//! Other tests assert exit status and names; the sentences and their cures are only here.

use super::fixture::{Fixture, pgm};
use svl::files::write_pfm;
use svl::stereo::Plane;

/// The catalogue: the commands by area, which run in the folder of [`inputs`], and their messages.
/// A new command is a line of it.
const CATALOGUE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/tests/bench/cli/snapshots/bench__cli__messages__catalogue.snap"
);

/// The commands of the catalogue, and its headings.
fn commands() -> Vec<String> {
    let text = std::fs::read_to_string(CATALOGUE).unwrap();
    let (_, catalogue) = text.split_once("\n---\n").unwrap();
    let lines = catalogue.lines();
    let lines = lines.filter(|line| !line.is_empty() && !line.starts_with(' '));
    lines
        .map(|line| {
            line.rsplit_once(" => ")
                .map_or(line, |(command, _)| command)
        })
        .map(str::to_owned)
        .collect()
}

/// Small inputs, most of them wrong in one way.
pub(super) fn inputs() -> Fixture {
    let fixture = Fixture::new();
    for name in ["a.mcap", "run.mcap"] {
        fixture.record(name, "--frames 2");
    }
    fixture.write("none.mcap", "");
    for name in ["text.txt", "text.mcap", "text.png", "no.mcap"] {
        let text = "this is no recording and no image, and long enough to look at";
        fixture.write(name, text);
    }
    for name in ["there.mcap", "there.pfm", "mine.toml", "mine.safetensors"] {
        fixture.write(name, "precious");
    }
    fixture.write("empty/notes.txt", "");
    fixture.write("bad.toml", "name = 3");

    fixture.write_pair("l.pgm", "r.pgm", (160, 96), 7);
    fixture.write("small.pgm", pgm(4, 4, &[0; 16]));
    fixture.write("cut.pgm", &pgm(64, 24, &[0; 64 * 24])[..200]);
    fixture.write("huge.pgm", "P5\n4000000000 4000000000\n255\n");
    fixture.write("empty.png", "");
    fixture.write("rank.toml", "rank = 50\n");
    fixture.write_pair("odd/im0.pgm", "odd/im1.pgm", (40, 20), 3);
    fixture.write("odd/im1.pgm", pgm(4, 2, &[0; 8]));
    let stamped = ["pairs/left/1700000000.pgm", "pairs/right/1700000000.pgm"];
    fixture.write_pair(stamped[0], stamped[1], (64, 48), 4);
    let stamped = stamped.map(|name| name.replace("pairs", "p"));
    fixture.write_pair(&stamped[0], &stamped[1], (64, 48), 4);

    const NO: f32 = f32::INFINITY;
    let map = |name: &str, row: &[f32]| {
        let plane = Plane::from_vec(row.len(), 1, row.to_vec()).unwrap();
        write_pfm(&fixture.path(name), &plane).unwrap();
    };
    map("truth.pfm", &[4.0, 4.0, 4.0, NO, 4.0]);
    map("d.pfm", &[4.0, 5.5, NO, 4.0, 0.5]);
    map("small.pfm", &[1.0, 2.0]);
    map("nowhere.pfm", &[NO; 5]);
    fixture.write("cut.pfm", "Pf\n5 1\n-1\nabc");
    fixture.write("cut.npz", "PK");
    fixture.write("eight.pgm", pgm(5, 1, &[8; 5]));
    fixture.write("noc.pgm", pgm(5, 1, &[255, 255, 255, 0, 128]));
    fixture.write("mask.pgm", pgm(4, 1, &[255; 4]));

    fixture.write("cv.yml", super::calibrate_convert::PAIR);
    fixture.write("other.yaml", "a: 1\n");
    let tables = [
        ("words.csv", "distance_cm,disparity_px\n10,x\n"),
        ("columns.csv", "cm,px\n10,3\n"),
        ("few.csv", "distance_cm,disparity_px\n10,3\n20,1.5\n"),
        (
            "nan.csv",
            "distance_cm,disparity_px\n10,nan\n20,1.5\n30,1\n",
        ),
        ("neither.csv", "distance_cm,disparity_px,recording\n10,,\n"),
        (
            "swapped.csv",
            "distance_cm,disparity_px\n10,100\n12,110\n14,130\n",
        ),
    ];
    for (name, text) in tables {
        fixture.write(name, text);
    }

    fixture.write_short_arena("short.toml", 2);
    let arena = include_str!("../../../scenarios/arena.toml");
    fixture.write("unknown.toml", arena.replacen("\nmust", "\nmist", 1));
    fixture.write("algorithm.toml", arena.replacen("\"v3\"", "\"v33\"", 1));
    fixture.write("binary.toml", [0xff, 0xfe, 0]);
    fixture.write(
        "bare.toml",
        "[source]\n[[checkpoint]]\nname = \"a\"\n[[gate]]\n",
    );
    fixture.write("nameless.toml", "[source]\nkind = \"arena\"\n");
    let middlebury = include_str!("../../../scenarios/middlebury.toml");
    fixture.write("middlebury.toml", middlebury);
    let courses = super::drive::courses("");
    fixture.write("small.toml", &courses);
    fixture.write("long.toml", courses.replace("frames = 280", "frames = 401"));
    let drives = [
        ("wide.toml", "radius_m = 0.2"),
        ("low.toml", "max_speed_m_per_s = 0.02"),
        ("rows.toml", "steering = { rows = [3] }"),
        ("stop.toml", "steering = { stop_m = 0.9 }"),
        ("late.toml", "latency_ms = -1"),
        ("who.toml", "latency_ms = { smg = 5 }"),
    ];
    for (name, keys) in drives {
        fixture.write(name, format!("{courses}[drive]\n{keys}\n"));
    }
    fixture.write("keys", "q");
    fixture.write("wrong", "q quit");
    fixture.write("bad", "wait nonsense");
    fixture
}

/// Names and contents of the files of a folder and of those below it.
fn files(folder: &std::path::Path) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut found: Vec<_> = entries
        .flat_map(|entry| {
            let path = entry.unwrap().path();
            if path.is_dir() {
                files(&path)
            } else {
                vec![(path.clone(), std::fs::read(path).unwrap())]
            }
        })
        .collect();
    found.sort();
    found
}

/// A command with the lines of its message, as the catalogue shows it.
fn message(fixture: &Fixture, command: &str) -> String {
    if command.starts_with('#') {
        return format!("\n{command}\n\n");
    }
    let ran = fixture.svl_with(command, &[("SVL_DATASETS", "")]);
    let code = ran.code.unwrap();
    let lines = ran.stderr.lines().filter(|line| !line.is_empty());
    let lines: Vec<_> = lines.map(|line| format!("    {line}\n")).collect();
    let errors = lines.iter().filter(|line| line.starts_with("    error: "));
    let errors = errors.count();
    assert_eq!(errors, usize::from(code != 0), "{command}: {}", ran.stderr);
    format!("{command} => {code}\n{}", lines.concat())
}

#[test]
fn every_message_is_one_line_with_its_cure_and_no_file_is_touched() {
    let fixture = inputs();
    let before = files(&fixture.path(""));
    let commands = commands();
    let catalogue = std::thread::scope(|scope| {
        let parts = commands.chunks(commands.len().div_ceil(4));
        let workers: Vec<_> = parts
            .map(|part| {
                let fixture = &fixture;
                let messages = move |command: &String| message(fixture, command);
                scope.spawn(move || part.iter().map(messages).collect::<String>())
            })
            .collect();
        let messages = workers.into_iter().map(|worker| worker.join().unwrap());
        messages.collect::<String>()
    });
    insta::assert_snapshot!("catalogue", catalogue);
    let is_untouched = files(&fixture.path("")) == before;
    assert!(is_untouched, "a file was written or changed");
}
