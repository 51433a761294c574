//! `svl replay`.

use super::fixture::{Fixture, assert_says};
use std::fs;

fn recorded(frames: &str) -> Fixture {
    let fixture = Fixture::new();
    fixture.run(&format!("record --frames {frames} -o a.mcap"));
    fixture
}

fn hashes(fixture: &Fixture, rows: &str, threads: u32) -> Vec<String> {
    let line = format!("replay a.mcap --rows {rows} --threads {threads}");
    fixture.run(&line);
    column(fixture, rows)
}

fn column(fixture: &Fixture, rows: &str) -> Vec<String> {
    let mut reader = csv::Reader::from_path(fixture.path(rows)).unwrap();
    let column = reader
        .headers()
        .unwrap()
        .iter()
        .position(|h| h == "result_hash")
        .unwrap();
    reader
        .records()
        .map(|r| r.unwrap()[column].to_owned())
        .collect()
}

#[test]
fn same_hashes_on_any_number_of_threads_and_any_instruction_set() {
    let fixture = recorded("3");
    let one = hashes(&fixture, "one.csv", 1);
    assert_eq!(one.len(), 3);
    assert_ne!(one[0], one[2], "frames differ, so should their results");
    assert_eq!(one, hashes(&fixture, "two.csv", 2));
    for isa in svl::kernel::Isa::available() {
        let rows = format!("{}.csv", isa.name());
        fixture
            .svl_with(
                &["replay", "a.mcap", "--rows", &rows],
                &[("SVL_ISA", isa.name())],
            )
            .done();
        assert_eq!(one, column(&fixture, &rows), "{}", isa.name());
    }
}

#[test]
fn several_algorithms_share_one_run() {
    let fixture = recorded("2");
    let text = fixture.run("replay a.mcap --algo v3 --algo v3:max_disparity=40");
    assert_says(&text, &["v3:max_disparity=40", "a.mcap: 2 pairs"]);
    let args = "replay a.mcap --algo v3 --rerun run.rrd -o result.mcap --rows r.parquet --json";
    let json = fixture.json(args);
    assert_eq!(json["algorithms"][0]["pairs"], 2);
    for file in ["run.rrd", "result.mcap", "r.parquet"] {
        assert!(
            fixture.path(file).metadata().unwrap().len() > 1000,
            "{file}"
        );
    }
    assert_says(&fixture.run("info result.mcap"), &["/algo/v3/disparity"]);
}

#[test]
fn without_a_recording_it_takes_the_newest() {
    let fixture = Fixture::new();
    fixture.run("record --frames 2");
    let text = fixture.run("replay");
    assert_says(&text, &["recordings/arena-seed1-1.mcap: 2 pairs"]);
}

#[test]
fn a_cut_recording_is_replayed_as_far_as_it_goes() {
    let fixture = recorded("6");
    let bytes = fixture.bytes("a.mcap");
    fixture.write("cut.mcap", &bytes[..bytes.len() * 3 / 4]);
    let ran = fixture.svl("replay cut.mcap --rows rows.csv");
    let rows = fixture.text("rows.csv").lines().count() - 1;
    assert!((1..6).contains(&rows), "{rows} pairs are whole");
    assert!(
        ran.stdout.contains(&format!("cut.mcap: {rows} pair")),
        "{}",
        ran.stdout
    );
    ran.failed(1, &["cut.mcap"]);
}

#[test]
fn without_any_recording_it_records_the_arena_first() {
    let fixture = Fixture::new();
    let ran = fixture.svl("replay --json");
    assert_says(&ran.stderr, &["recording the arena first"]);
    let json: serde_json::Value = serde_json::from_str(&ran.done()).unwrap();
    assert_eq!(json["algorithms"][0]["pairs"], 280);
}

#[test]
fn force_replaces_what_is_there_only_by_something_whole() {
    let fixture = recorded("6");
    fixture.write("rows.csv", "precious");
    fixture.write("bad.mcap", "not a recording");
    fixture.fails("replay bad.mcap --rows rows.csv --force => 1: bad.mcap");
    assert_eq!(fixture.bytes("rows.csv"), b"precious");
    fixture.run("replay a.mcap --rows rows.csv --force");
    assert!(fixture.text("rows.csv").starts_with("scenario"));
    assert_eq!(
        fs::read_dir(fixture.path("")).unwrap().count(),
        3,
        "nothing is left over"
    );

    // The rows of a recording that ends early are partial: they are kept beside the earlier file.
    let bytes = fixture.bytes("a.mcap");
    fixture.write("cut.mcap", &bytes[..bytes.len() * 3 / 4]);
    fixture.write("rows.csv", "precious");
    assert_eq!(
        fixture.svl("replay cut.mcap --rows rows.csv --force").code,
        Some(1)
    );
    assert_eq!(fixture.bytes("rows.csv"), b"precious");
    let partial = fixture.text("rows.csv.unfinished/rows.csv");
    assert!(partial.starts_with("scenario"));
}

#[test]
fn verify_proves_equal_results() {
    let fixture = recorded("3");
    let args = "replay a.mcap --algo v3 --algo bm -o result.mcap --rows rows.csv";
    fixture.run(args);
    let text = fixture.run("replay result.mcap --verify");
    let end = "verified: 6 results equal those of result.mcap\n\n3 pairs replayed through v3, bm; \
               none lost.\nnext     svl score result.mcap  # a report with its frames\n";
    assert!(text.ends_with(end), "{text}");
    let json = fixture.json("replay a.mcap --algo bm --verify=rows.csv --json");
    assert_eq!(
        (
            json["verification"]["equal"].as_u64(),
            json["algorithms"][0]["pairs"].as_u64()
        ),
        (Some(3), Some(3))
    );
}

#[test]
fn a_part_of_a_run_is_not_proved_where_results_depend_on_earlier_pairs() {
    let fixture = Fixture::new();
    fixture.run("-q record arena --seed 5 --frames 12 -o a.mcap");
    fixture.run("-q replay a.mcap --algo v5 --algo v3 -o both.mcap");
    fixture.run("-q replay both.mcap --verify");
    let ran = fixture.svl("-q replay both.mcap --algo v3 --from 0.5 --verify");
    assert_says(&ran.stderr, &["5 of its results none here; 7 are equal"]);
    assert!(!ran.stderr.contains("depends"), "{}", ran.stderr);
    fixture.fails(
        "-q replay both.mcap --algo v5 --from 0.5 --verify => 1: results differ from those of \
         both.mcap | v5 depends on earlier pairs: verify the whole run",
    );
}

#[test]
fn verify_tells_what_differs() {
    let fixture = recorded("3");
    fixture.run("replay a.mcap --rows rows.csv");
    let rows = fixture.text("rows.csv");
    let hash = column(&fixture, "rows.csv")[1].clone();
    fs::write(fixture.path("other.csv"), rows.replace(&hash, "0")).unwrap();
    let fails = |verify: &str, words: &str| {
        fixture
            .svl(&format!("replay a.mcap {verify}"))
            .failed(1, &[words])
    };
    fails(
        "--verify=other.csv",
        "error: v5: 1 results differ from those of other.csv, the first on pair 1",
    );
    let lines: Vec<_> = rows.lines().collect();
    fs::write(fixture.path("short.csv"), lines[..3].join("\n")).unwrap();
    fails(
        "--verify=short.csv",
        "1 results have no counterpart in short.csv",
    );
    // A table of v5 under the name of another range: equal labels, other parameters.
    let parameters = lines[1].split(',').nth(7).unwrap();
    fs::write(fixture.path("set.csv"), rows.replace(parameters, "0")).unwrap();
    // The content of a file starts no program.
    fs::write(
        fixture.path("evil.csv"),
        rows.replace(",v5,", ",exec:command=touch pwned,"),
    )
    .unwrap();
    fails(
        "--verify=evil.csv",
        "names a program, which is not started unasked",
    );
    assert!(!fixture.path("pwned").exists());
    let pair = lines[1].split(',').nth(5).unwrap();
    fs::write(fixture.path("pairs.csv"), rows.replace(pair, "0")).unwrap();
    fails(
        "--verify=pairs.csv",
        "is of other pairs than these; pair 0 differs",
    );
    fails(
        "--verify=set.csv",
        "its parameters are not those of set.csv",
    );
    fails("--verify", "holds no results");
    fails(
        "--verify=a.txt",
        "expected RESULT.mcap, ROWS.csv or the folder of a report",
    );
    fs::write(fixture.path("bad.csv"), "scenario\nx\n").unwrap();
    fails("--verify=bad.csv", "bad.csv");
}

#[test]
fn live_results_are_joined_by_stamp_and_pair() {
    let fixture = recorded("120");
    fixture.run("replay a.mcap --algo bm --rows rows.csv");
    let rows = fixture.text("rows.csv");
    let mut lines = rows.lines();
    let names: Vec<_> = lines.next().unwrap().split(',').collect();
    let place = |name: &str| names.iter().position(|known| *known == name).unwrap();
    let (sequence, run, pair) = (place("sequence"), place("run"), place("pair_hash"));
    let result = place("result_hash");
    // A program that began 10 pairs later, and numbers them from its own first one.
    let live: Vec<Vec<String>> = lines
        .skip(10)
        .enumerate()
        .map(|(i, line)| {
            let mut cells: Vec<_> = line.split(',').map(str::to_owned).collect();
            (cells[sequence], cells[run]) = (i.to_string(), "ros2:".to_owned());
            cells
        })
        .collect();
    let write = |name: &str, rows: &[Vec<String>]| {
        let rows = rows.iter().map(|cells| cells.join(","));
        let lines: Vec<_> = std::iter::once(names.join(",")).chain(rows).collect();
        fixture.write(name, lines.join("\n") + "\n");
    };
    write("live.csv", &live);
    let text = fixture.run("replay a.mcap --verify=live.csv");
    let expected = "verified: 110 results equal; 110 common pairs; while both were running 0 only \
                    here and 0 only in live.csv; 10 before or after that\n";
    assert!(text.contains(expected), "{text}");
    // One pair is lost, and one has another partner: 108 of 111.
    let mut lossy = live.clone();
    lossy[50][pair] = "0".to_owned();
    lossy.remove(20);
    write("lossy.csv", &lossy);
    let ran = fixture.svl("replay a.mcap --verify=lossy.csv");
    ran.failed(
        4,
        &[
            "108 common pairs",
            "2 only here, the first at",
            "1 only in lossy.csv",
        ],
    );
    write("one.csv", &[&live[..20], &live[21..]].concat());
    fixture.run("replay a.mcap --verify=one.csv");
    let mut other = live.clone();
    other[50][result] = "0".to_owned();
    write("other.csv", &other);
    let ran = fixture.svl("replay a.mcap --verify=other.csv");
    ran.failed(1, &["bm: 1 results differ from those of other.csv"]);
}

#[test]
fn pairs_that_cannot_be_read_are_left_out_and_counted() {
    let fixture = Fixture::new();
    fixture.run("record --frames 12 -o a.mcap");
    // The left images of pairs 4, 5 and 9 are truncated.
    let bytes = fixture.bytes("a.mcap");
    let mut writer =
        mcap::Writer::new(fs::File::create(fixture.path("bad.mcap")).unwrap()).unwrap();
    let mut lefts = 0;
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let mut message = message.unwrap();
        if message.channel.topic == "/stereo/left/image" {
            if [4, 5, 9].contains(&lefts) {
                message.data = message.data[..message.data.len() / 2].to_vec().into();
            }
            lefts += 1;
        }
        writer.write(&message).unwrap();
    }
    writer.finish().unwrap();
    let error = "error: 3 pairs could not be read; --allow-loss 3, or allow_loss = 3 of a \
                 scenario's [source], accepts that; all else is kept\n";
    for threads in ["1", "2"] {
        let ran = fixture.svl(&format!(
            "replay bad.mcap --threads {threads} --json --rows r.csv --force"
        ));
        assert!(
            ran.code == Some(4) && ran.stderr.ends_with(error),
            "{}",
            ran.stderr
        );
        let told = ran
            .stderr
            .lines()
            .filter(|line| line.contains("this pair is dropped"));
        assert_eq!(told.count(), 1, "the first of them: {}", ran.stderr);
        assert_says(&ran.stderr, &["3 pairs dropped: cannot be read"]);
        let answer = ran.json();
        let why = error.strip_prefix("error: ").unwrap();
        let why = why.strip_suffix("; all else is kept\n").unwrap();
        assert_eq!(
            (&answer["incomplete"], &answer["algorithms"][0]["pairs"]),
            (&why.into(), &9.into())
        );
        assert_eq!(fixture.text("r.csv").lines().count(), 10);
    }
    let ran = fixture.svl("record bad.mcap -o good.mcap");
    assert!(
        ran.code == Some(4)
            && ran.stderr.ends_with(error)
            && ran.stdout.contains("good.mcap: 9 pairs"),
        "{}",
        ran.stderr
    );
    assert_says(&fixture.run("info good.mcap"), &["missing pairs   3\n"]);
}

#[test]
fn the_folder_of_a_bag_is_a_recording() {
    let fixture = Fixture::new();
    fs::create_dir(fixture.path("bag")).unwrap();
    fixture.run("record --frames 2 --ros2 -o bag/a.mcap");
    fixture.run("record bag -o b.mcap --max-skew-ms 1");
    assert_says(&fixture.run("info bag --json"), &["a.mcap"]);
    assert!(fixture.run("replay bag").starts_with("bag: 2 pairs"));
    fixture.run("recover bag -o c.mcap");
    fixture.fails("record bag -o bag/a.mcap --force => 2: bag/a.mcap: named twice");
    fs::copy(fixture.path("bag/a.mcap"), fixture.path("bag/b.mcap")).unwrap();
    for command in [
        "info bag",
        "record bag",
        "replay bag",
        "view bag",
        "recover bag -o d.mcap",
    ] {
        let words = [
            "bag: is a folder of recordings",
            "name one of bag/a.mcap, bag/b.mcap",
        ];
        fixture.svl(command).failed(1, &words);
    }
    fixture.write("old.db3", "SQLite format 3\0");
    fixture.fails("record old.db3 => 1: old.db3: is not a rosbag2 bag in SQLite");
}

#[test]
fn a_recording_that_is_being_written_is_not_replaced() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 3);
    fixture.run("record short.toml -o run.mcap");
    // Locked as by the recorder.
    let file = fs::File::open(fixture.path("run.mcap")).unwrap();
    file.try_lock().unwrap();
    fixture
        .fails("record short.toml -o run.mcap --force => 1: run.mcap: another svl is writing it");
    drop(file);
    fixture.run("record short.toml -o run.mcap --force");
}

#[test]
fn another_recording_in_the_cache_is_neither_scored_nor_replaced() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 3);
    fixture.run("score short.toml");
    let cached = fs::read_dir(fixture.path("recordings")).unwrap();
    let mut cached: Vec<_> = cached.map(|entry| entry.unwrap().path()).collect();
    cached.sort();
    let [first, _] = &cached[..] else {
        panic!("{cached:?}")
    };
    let name = first.file_name().unwrap().to_str().unwrap();
    fixture.run("record short.toml --seed 2 -o two.mcap");
    fixture.run("record short.toml --scale 0.5 -o half.mcap");
    let text = fixture.text("short.toml");
    fixture.write(
        "other.toml",
        text.replacen("height_px = 240", "height_px = 200", 1),
    );
    fixture.run("record other.toml --seed 1 -o other.mcap");
    fixture.write("mine.mcap", "mine");
    for (file, words) in [
        ("two.mcap", "is of seed 2, not of 'arena' with seed 1"),
        ("half.mcap", "is of changed pairs (scaled"),
        (
            "other.mcap",
            "is of other parameters, not of 'arena' with seed 1",
        ),
        ("mine.mcap", "mcap"),
    ] {
        fs::copy(fixture.path(file), first).unwrap();
        let words = [name, words, "move or remove it, and it is recorded again"];
        fixture.svl("score short.toml --force").failed(1, &words);
        assert_eq!(fs::read(first).unwrap(), fixture.bytes(file));
    }
    fs::remove_file(first).unwrap();
    fixture.run("score short.toml");
}

#[test]
fn an_incomplete_recording_of_the_cache_is_made_again() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 3);
    fixture.run("score short.toml");
    let rows = || fixture.text("reports/arena/rows.csv").lines().count();
    let whole = rows();
    let cached = fs::read_dir(fixture.path("recordings")).unwrap();
    let cached: Vec<_> = cached.map(|entry| entry.unwrap().path()).collect();
    let bytes = fs::read(&cached[0]).unwrap();
    fs::write(&cached[0], &bytes[..bytes.len() / 2]).unwrap();
    let again = fixture.svl("score short.toml --force");
    assert_says(&again.stderr, &["recorded again"]);
    again.done();
    assert_eq!(rows(), whole);
    // Not by its size: chunk boundaries depend on the machine's speed.
    let found = fixture.run(&format!("info {}", cached[0].display()));
    assert_says(&found, &["intact          yes", "pairs           3\n"]);
}
