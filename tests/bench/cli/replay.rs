//! `svl replay`.

use super::fixture::{Fixture, assert_says};
use super::transcript::assert_words;
use std::fs;

fn recorded(frames: u64) -> Fixture {
    let fixture = Fixture::new();
    fixture.record("a.mcap", &format!("--frames {frames}"));
    fixture
}

/// A recording without its last part.
fn write_cut(fixture: &Fixture) {
    let bytes = fixture.bytes("a.mcap");
    fixture.write("cut.mcap", &bytes[..bytes.len() * 3 / 4]);
}

#[test]
fn same_hashes_on_any_number_of_threads_and_any_instruction_set() {
    let fixture = recorded(3);
    let hashes = |name: &str, options: &str, variables: &[(&str, &str)]| {
        let line = format!("replay a.mcap --rows {name}.csv {options}");
        fixture.svl_with(&line, variables).done();
        fixture.column(&format!("{name}.csv"), "result_hash")
    };
    let one = hashes("one", "--threads 1", &[]);
    assert_eq!(one.len(), 3);
    assert_ne!(one[0], one[2], "frames differ, so should their results");
    assert_eq!(one, hashes("two", "--threads 2", &[]));
    for isa in svl::kernel::Isa::available() {
        let name = isa.name();
        assert_eq!(one, hashes(name, "", &[("SVL_ISA", name)]), "{name}");
    }
}

#[test]
fn several_algorithms_share_one_run() {
    let fixture = recorded(2);
    fixture.transcript(
        "replay a.mcap --algo v3 --algo v3:max_disparity=40 \
        => v3:max_disparity=40 | a.mcap: 2 pairs
        replay a.mcap --algo v3 --rerun run.rrd -o result.mcap --rows r.parquet --json \
        => /algorithms/0/pairs = 2
        info result.mcap => /algo/v3/disparity",
    );
    for file in ["run.rrd", "result.mcap", "r.parquet"] {
        assert!(fixture.bytes(file).len() > 1000, "{file}");
    }
}

#[test]
fn without_a_recording_it_takes_the_newest() {
    let fixture = Fixture::new();
    fixture.transcript(
        "record --frames 2
        replay => recordings/arena-seed1-1.mcap: 2 pairs",
    );
}

#[test]
fn a_cut_recording_is_replayed_as_far_as_it_goes() {
    let fixture = recorded(6);
    write_cut(&fixture);
    let ran = fixture.svl("replay cut.mcap --rows rows.csv");
    let rows = fixture.text("rows.csv").lines().count() - 1;
    assert!((1..6).contains(&rows), "{rows} pairs are whole");
    assert_says(&ran.stdout, &[&format!("cut.mcap: {rows} pair")]);
    ran.failed(1, &["cut.mcap"]);
}

#[test]
fn without_any_recording_it_records_the_arena_first() {
    Fixture::new()
        .transcript("replay --json => 0~ recording the arena first => /algorithms/0/pairs = 280");
}

#[test]
fn force_replaces_what_is_there_only_by_something_whole() {
    let fixture = recorded(6);
    fixture.write("rows.csv", "precious");
    fixture.write("bad.mcap", "not a recording");
    fixture.fails("replay bad.mcap --rows rows.csv --force => 1: bad.mcap");
    assert_eq!(fixture.bytes("rows.csv"), b"precious");
    fixture.run("replay a.mcap --rows rows.csv --force");
    assert!(fixture.text("rows.csv").starts_with("scenario"));
    let left = fs::read_dir(fixture.path("")).unwrap().count();
    assert_eq!(left, 3, "nothing is left over");

    // The rows of a recording that ends early are partial: they are kept beside the earlier file.
    write_cut(&fixture);
    fixture.write("rows.csv", "precious");
    let ran = fixture.svl("replay cut.mcap --rows rows.csv --force");
    assert_eq!(ran.code, Some(1));
    assert_eq!(fixture.bytes("rows.csv"), b"precious");
    let partial = fixture.text("rows.csv.unfinished/rows.csv");
    assert!(partial.starts_with("scenario"));
}

#[test]
fn verify_proves_equal_results() {
    let fixture = recorded(3);
    fixture.run("replay a.mcap --algo v3 --algo bm -o result.mcap --rows rows.csv");
    let text = fixture.run("replay result.mcap --verify");
    let end = "verified: 6 results equal those of result.mcap\n\n3 pairs replayed through v3, bm; \
               none lost.\nnext     svl score result.mcap  # a report with its frames\n";
    assert!(text.ends_with(end), "{text}");
    fixture.transcript(
        "replay a.mcap --algo bm --verify=rows.csv --json => /verification/equal = 3 \
        | /algorithms/0/pairs = 3",
    );
}

#[test]
fn a_part_of_a_run_is_not_proved_where_results_depend_on_earlier_pairs() {
    let fixture = Fixture::new();
    fixture.record("a.mcap", "arena --seed 5 --frames 12");
    fixture.transcript(
        "-q replay a.mcap --algo v5 --algo v3 -o both.mcap
        -q replay both.mcap --verify
        -q replay both.mcap --algo v3 --from 0.5 --verify \
        => 1~ 5 of its results none here; 7 are equal | !depends
        -q replay both.mcap --algo v5 --from 0.5 --verify => 1: results differ from those of \
        both.mcap | v5 depends on earlier pairs: verify the whole run",
    );
}

#[test]
fn verify_tells_what_differs() {
    let fixture = recorded(3);
    fixture.run("replay a.mcap --rows rows.csv");
    let rows = fixture.text("rows.csv");
    let hash = fixture.column("rows.csv", "result_hash")[1].clone();
    let lines: Vec<_> = rows.lines().collect();
    let [parameters, pair] = [7, 5].map(|at| lines[1].split(',').nth(at).unwrap());
    fixture.write("other.csv", rows.replace(&hash, "0"));
    fixture.write("short.csv", lines[..3].join("\n"));
    // A table of v5 under the name of another range: equal labels, other parameters.
    fixture.write("set.csv", rows.replace(parameters, "0"));
    // The content of a file starts no program.
    fixture.write(
        "evil.csv",
        rows.replace(",v5,", ",exec:command=touch pwned,"),
    );
    fixture.write("pairs.csv", rows.replace(pair, "0"));
    fixture.write("bad.csv", "scenario\nx\n");
    fixture.transcript(
        "replay a.mcap --verify=other.csv \
        => 1: error: v5: 1 results differ from those of other.csv, the first on pair 1
        replay a.mcap --verify=short.csv => 1: 1 results have no counterpart in short.csv
        replay a.mcap --verify=evil.csv => 1: names a program, which is not started unasked
        test ! -e pwned
        replay a.mcap --verify=pairs.csv => 1: is of other pairs than these; pair 0 differs
        replay a.mcap --verify=set.csv => 1: its parameters are not those of set.csv
        replay a.mcap --verify => 1: holds no results
        replay a.mcap --verify=a.txt \
        => 1: expected RESULT.mcap, ROWS.csv or the folder of a report
        replay a.mcap --verify=bad.csv => 1: bad.csv",
    );
}

#[test]
fn live_results_are_joined_by_stamp_and_pair() {
    let fixture = recorded(120);
    fixture.run("replay a.mcap --algo bm --rows rows.csv");
    let rows = fixture.text("rows.csv");
    let mut lines = rows.lines();
    let names: Vec<_> = lines.next().unwrap().split(',').collect();
    let place = |name: &str| names.iter().position(|known| *known == name).unwrap();
    let [sequence, run, pair, result] = ["sequence", "run", "pair_hash", "result_hash"].map(place);
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
    // One pair was not matched and is not replayed, and one has another partner: 108 of 110.
    let mut lossy = live.clone();
    lossy[50][pair] = "0".to_owned();
    lossy.remove(20);
    write("lossy.csv", &lossy);
    write("one.csv", &[&live[..20], &live[21..]].concat());
    let mut other = live.clone();
    other[50][result] = "0".to_owned();
    write("other.csv", &other);
    fixture.transcript(
        "replay a.mcap --verify=live.csv => verified: 110 results equal; 110 common pairs; while \
        both were running 0 only here and 0 only in live.csv; 0 before or after that\\n
        replay a.mcap --verify=lossy.csv \
        => 4: 108 common pairs | 1 only here, the first at | 1 only in lossy.csv
        replay a.mcap --verify=one.csv
        replay a.mcap --verify=other.csv => 1: bm: 1 results differ from those of other.csv",
    );
}

#[test]
fn pairs_that_cannot_be_read_are_left_out_and_counted() {
    let fixture = recorded(12);
    // The left images of pairs 4, 5 and 9 are truncated.
    let bytes = fixture.bytes("a.mcap");
    let file = fs::File::create(fixture.path("bad.mcap")).unwrap();
    let mut writer = mcap::Writer::new(file).unwrap();
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
    let why = "3 pairs could not be read; --allow-loss 3, or allow_loss = 3 of a scenario's \
               [source], accepts that";
    let error = format!("error: {why}; all else is kept\n");
    // The first of the pairs is told.
    for (line, words) in [
        (
            "replay bad.mcap --threads 1 --json --rows r.csv",
            format!("/incomplete = {why} | /algorithms/0/pairs = 9"),
        ),
        (
            "replay bad.mcap --threads 2 --json --rows r.csv --force",
            format!("/incomplete = {why} | /algorithms/0/pairs = 9"),
        ),
        (
            "record bad.mcap -o good.mcap",
            "good.mcap: 9 pairs".to_owned(),
        ),
    ] {
        let ran = fixture.svl(line);
        assert!(
            ran.code == Some(4) && ran.stderr.ends_with(&error),
            "{}",
            ran.stderr
        );
        assert_words(&ran.stdout, &words);
        if line.starts_with("replay") {
            let told = "1x this pair is dropped | 3 pairs dropped: cannot be read";
            assert_words(&ran.stderr, told);
            assert_eq!(fixture.text("r.csv").lines().count(), 10);
        }
    }
    fixture.transcript("info good.mcap => missing pairs   3\\n");
}

#[test]
fn the_folder_of_a_bag_is_a_recording() {
    let fixture = Fixture::new();
    fixture.record("bag/a.mcap", "--frames 2 --ros2");
    fixture.write("old.db3", "SQLite format 3\0");
    let named = "1: bag: is a folder of recordings | name one of bag/a.mcap, bag/b.mcap";
    fixture.transcript(&format!(
        "record bag -o b.mcap --max-skew-ms 1
        info bag --json => a.mcap
        recover bag -o c.mcap
        record bag -o bag/a.mcap --force => 2: bag/a.mcap: named twice
        record old.db3 => 1: old.db3: is not a rosbag2 bag in SQLite
        replay bag => ^bag: 2 pairs
        cp bag/a.mcap bag/b.mcap
        info bag => {named}
        record bag => {named}
        replay bag => {named}
        view bag => {named}
        recover bag -o d.mcap => {named}"
    ));
}

#[test]
fn a_recording_that_is_being_written_is_not_replaced() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 3);
    fixture.record_short_arena("run.mcap", 3, 1);
    // Locked as by the recorder.
    let file = fs::File::open(fixture.path("run.mcap")).unwrap();
    file.try_lock().unwrap();
    fixture
        .fails("record short.toml -o run.mcap --force => 1: run.mcap: another svl is writing it");
    drop(file);
    fixture.run("record short.toml -o run.mcap --force");
}

/// The short arena's recordings in the cache.
fn cached(fixture: &Fixture) -> Vec<String> {
    let cached = fs::read_dir(fixture.path("recordings")).unwrap();
    let names = cached.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut cached: Vec<_> = names.map(|name| format!("recordings/{name}")).collect();
    cached.sort();
    cached
}

#[test]
fn another_recording_in_the_cache_is_neither_scored_nor_replaced() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 3);
    let cached = cached(&fixture);
    let [first, _] = &cached[..] else {
        panic!("{cached:?}")
    };
    fixture.edit(
        "short.toml",
        "other.toml",
        &[["height_px = 240", "height_px = 200"]],
    );
    let name = first.strip_prefix("recordings/").unwrap();
    fixture.record_short_arena("two.mcap", 3, 2);
    fixture.write("mine.mcap", "mine");
    fixture.transcript(
        "record short.toml --scale 0.5 -o half.mcap
        record other.toml --seed 1 -o other.mcap",
    );
    for (file, words) in [
        ("two.mcap", "is of seed 2, not of 'arena' with seed 1"),
        ("half.mcap", "is of changed pairs (scaled"),
        (
            "other.mcap",
            "is of other parameters, not of 'arena' with seed 1",
        ),
        ("mine.mcap", "mcap"),
    ] {
        fixture.transcript(&format!(
            "cp {file} {first}
            score short.toml --force \
            => 1: {name} | {words} | move or remove it, and it is recorded again"
        ));
        assert_eq!(fixture.bytes(first), fixture.bytes(file));
    }
    fs::remove_file(fixture.path(first)).unwrap();
    fixture.run("score short.toml --algo v3 --rerun none");
}

#[test]
fn an_incomplete_recording_of_the_cache_is_made_again() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 3);
    fixture.run("score short.toml --algo v3 --rerun none");
    let rows = || fixture.text("reports/arena/rows.csv").lines().count();
    let whole = rows();
    let cached = &cached(&fixture)[0];
    let bytes = fixture.bytes(cached);
    fixture.write(cached, &bytes[..bytes.len() / 2]);
    // Not by its size: chunk boundaries depend on the machine's speed.
    fixture.transcript(&format!(
        "score short.toml --algo v3 --rerun none --force => 0~ recorded again
        info {cached} => intact          yes | pairs           3\\n"
    ));
    assert_eq!(rows(), whole);
}
