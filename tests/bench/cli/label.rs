//! `svl label checkpoints`, driven by scripts of keys.

use super::fixture::{Fixture, Ran, assert_says};
use super::losses::messages;
use crate::recording::bag::{self, camera_info};
use svl::scenario::{Scenario, ScenarioSource};
use svl::score::{CellExpectation, CheckpointPlace};

/// Labels with these keys.
fn label(fixture: &Fixture, args: &str, keys: &str) -> Ran {
    fixture.write("keys", keys);
    fixture.svl(&format!("label checkpoints {args} --script keys"))
}

#[test]
fn cells_are_tied_to_the_frame_at_which_they_were_labelled() {
    let fixture = Fixture::recorded();
    // The last label of a cell counts.
    let first = "g 5 enter f right f g 3 enter left f";
    label(&fixture, "run.mcap", &format!("{first} q k")).done();
    let going_on = "right right g 6 enter f n \"two\" enter w q";
    label(&fixture, "run.mcap", going_on).done();
    let scenario = Scenario::read(&fixture.path("run.toml")).unwrap();
    let pairs = &scenario.checkpoints[0].pairs;
    let frames: Vec<_> = pairs.iter().map(|pair| pair.frame).collect();
    assert_eq!(frames, [3, 5, 6]);
    assert_eq!(
        scenario.checkpoints[0].place,
        CheckpointPlace::Frames([3, 6])
    );
    fixture.run("score run.toml -o report -q");
    fixture.run("score run.toml --print-scenario=again.toml -q");
    let again = Scenario::read(&fixture.path("again.toml")).unwrap();
    assert_eq!(again.checkpoints, scenario.checkpoints);
    // Without a place of its own it has that of its pairs.
    let text = fixture.text("run.toml");
    let without: Vec<_> = text
        .lines()
        .filter(|line| !line.starts_with("frames"))
        .collect();
    assert_eq!(without.len() + 1, text.lines().count(), "{text}");
    fixture.write("without.toml", without.join("\n"));
    let without = Scenario::read(&fixture.path("without.toml")).unwrap();
    assert_eq!(without.checkpoints, scenario.checkpoints);
    // Another hash of the last one is noticed.
    let text = fixture.text("run.toml");
    let hash = &pairs[2].hash;
    fixture.write("run.toml", text.replace(hash, &pairs[0].hash));
    fixture
        .svl("score run.toml -o other -q")
        .failed(1, &["frame 6 is not the pair that was labelled", hash]);
}

#[test]
fn a_scenario_that_is_begun_accepts_the_images_that_its_recording_lost() {
    let fixture = Fixture::new();
    let images = messages(1..9, (1..9).filter(|i| ![4, 6].contains(i)), 0);
    let infos = [("/cam0/camera_info", 0.0), ("/cam1/camera_info", -10.0)];
    let infos = infos.map(|(topic, tx)| camera_info(topic, 1_000_000_000, &[], tx));
    let written = bag::write(&fixture.path(""), &[&infos[..], &images].concat());
    std::fs::rename(written, fixture.path("lossy.mcap")).unwrap();
    label(&fixture, "lossy.mcap", "f n \"one\" enter w q").done();
    assert_says(&fixture.text("lossy.toml"), &["allow_loss = 2\n"]);
    fixture.run("score lossy.toml -o report -q");
    // A limit below the losses of the recording is exceeded.
    fixture.write(
        "lossy.toml",
        fixture.text("lossy.toml").replace("= 2\n", "= 1\n"),
    );
    let words = ["allow_loss = 2", "--allow-loss 2"];
    fixture
        .svl("score lossy.toml -o other -q")
        .failed(4, &words);
}

#[test]
fn labelled_cells_are_scored() {
    let fixture = Fixture::recorded();
    let keys = "> [ , , , [ . . ] right down = \">0.05\" enter right f
                n \"ahead:\" space \"far\" enter w q";
    let written = label(&fixture, "run.mcap", keys).done();
    assert_eq!(
        written,
        "run.toml: checkpoint 1 'ahead: far': frames 7 to 9, 2 cells\n"
    );
    assert!(!fixture.path("run.toml.draft").exists());
    let scenario = Scenario::read(&fixture.path("run.toml")).unwrap();
    let [checkpoint] = &scenario.checkpoints[..] else {
        panic!("{:?}", scenario.checkpoints)
    };
    assert_eq!(
        (&*checkpoint.name, &*checkpoint.description),
        ("ahead", "far")
    );
    assert_eq!(checkpoint.place, CheckpointPlace::Frames([7, 9]));
    let expected = checkpoint.expected.iter().map(|c| (c.at, c.expectation));
    let far = ([1, 1], CellExpectation::Farther(0.05));
    assert_eq!(
        expected.collect::<Vec<_>>(),
        [far, ([2, 1], CellExpectation::Free)]
    );

    fixture.run("score run.toml -o report -q");
    let rows = fixture.text("report/checkpoints.csv");
    assert_says(&rows, &["1,ahead,v3,3,3,1.0,7,true"]);

    // Text written by a person is kept byte by byte.
    let edited = "# mine\n".to_owned() + fixture.text("run.toml").trim_end() + " # last";
    fixture.write("run.toml", &edited);
    let keys = "g 3 enter \"1.5+-0.2\" enter n \"wall\" enter enter q";
    label(&fixture, "run.mcap", keys).done();
    let extended = fixture.text("run.toml");
    let added = extended.strip_prefix(edited.as_str()).unwrap();
    let pair = scored_pair(&fixture, 3);
    let expected = format!(
        "\n\n[[checkpoint]]\nnumber = 2\nname = \"wall\"\nframes = [3, \
         3]\n\n[checkpoint.pair]\nframe = 3\nhash = \"{pair}\"\n\n[[checkpoint.cell]]\nat = [0, \
         0]\ndistance_m = 1.5\ntolerance_m = 0.2\n"
    );
    assert_eq!(added, expected);
    fixture.run("score run.toml -o report -q");
    assert_says(&fixture.text("report/checkpoints.csv"), &["2,wall,v3"]);
    // Perturbations do not change the scene of a pair.
    fixture.run("score run.toml -o report -q --stress noise");

    fixture.run("record --frames 12 --seed 2 -o run.mcap --force");
    let words = [
        "checkpoint 2 (wall): frame 3 is not the pair that was labelled",
        &pair,
        "label it again",
    ];
    fixture.svl("score run.toml -o other -q").failed(1, &words);
}

/// The hash of a pair in the report's rows.
fn scored_pair(fixture: &Fixture, sequence: u64) -> String {
    let rows = fixture.text("report/rows.csv");
    let column = |name| {
        let head = rows.lines().next().unwrap();
        head.split(',').position(|column| column == name).unwrap()
    };
    let (sequences, hashes) = (column("sequence"), column("pair_hash"));
    let mut rows = rows.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let row = rows.find(|row| row[sequences] == sequence.to_string());
    row.unwrap()[hashes].to_owned()
}

#[test]
fn an_interrupted_session_goes_on() {
    let fixture = Fixture::recorded();
    let args = "run.mcap -o own.toml";
    let stopped = label(&fixture, args, ". . . \"0.43\" enter [ right right");
    stopped.failed(1, &["stopped; own.toml.draft keeps 1 labelled cell"]);
    assert!(!fixture.path("own.toml").exists());
    let screen = label(&fixture, args, "screen ctrl-c");
    assert_says(&screen.stdout, &["resumed at frame 3 with 1 labelled cell"]);
    assert_eq!(screen.code, Some(1));
    // Quitting asks; the draft is kept or discarded.
    let kept = label(&fixture, args, "q esc q k").done();
    let words = "own.toml.draft: 1 labelled cell: the same command resumes there\n";
    assert_eq!(kept, words);
    fixture.run("record --frames 2 -o other.mcap");
    let words = "own.toml.draft: is of run.mcap, and frame 3 of other.mcap is another pair; finish";
    label(&fixture, "other.mcap -o own.toml", "q").failed(1, &[words]);
    // Another recording of that name, and the same one by another name.
    std::fs::rename(fixture.path("run.mcap"), fixture.path("kept.mcap")).unwrap();
    fixture.run("record --frames 12 --seed 2 -o run.mcap");
    let words = "own.toml.draft: is of run.mcap, and frame 3 of run.mcap is another pair";
    label(&fixture, args, "q d").failed(1, &[words]);
    let screen = label(&fixture, "kept.mcap -o own.toml", "screen q k").done();
    assert_says(&screen, &["resumed at frame 3 with 1 labelled cell"]);
    let ended = label(&fixture, "kept.mcap -o own.toml", "q d").done();
    assert_eq!(ended, "");
    assert!(!fixture.path("own.toml.draft").exists() && !fixture.path("own.toml").exists());
}

#[test]
fn a_draft_without_cells_is_of_its_recording_too() {
    let fixture = Fixture::recorded();
    label(&fixture, "run.mcap -o own.toml", ". n \"shelf\" enter q k").done();
    fixture.run("record --frames 12 --seed 2 -o run.mcap --force");
    let words = "own.toml.draft: is of run.mcap, and frame 1 of run.mcap is another pair";
    label(&fixture, "run.mcap -o own.toml", "q d").failed(1, &[words]);
}

#[test]
fn a_replaced_recording_is_refused_before_the_first_key() {
    let fixture = Fixture::recorded();
    label(&fixture, "run.mcap", "g 3 enter f n \"a\" enter w q").done();
    fixture.run("record --frames 12 --seed 2 -o run.mcap --force");
    let words = "run.toml: checkpoint 1 (a) was labelled at another frame 3 than this source has";
    label(&fixture, "run.mcap", "f").failed(1, &[words]);
    // A shorter one, too.
    fixture.run("record --frames 2 -o run.mcap --force");
    label(&fixture, "run.mcap", "f").failed(1, &[words]);
    assert!(!fixture.path("run.toml.draft").exists());
}

#[test]
fn a_label_outside_of_the_checkpoint_is_not_written() {
    let fixture = Fixture::recorded();
    let keys = "g 9 enter f g 2 enter [ g 5 enter ] n \"a\" enter w screen q d";
    let screen = label(&fixture, "run.mcap", keys).done();
    let words = "frame 9 has a label, and lies outside 2 to 5: move [ or ], or x";
    assert_says(&screen, &[words]);
    assert!(!fixture.path("run.toml").exists());
    // Nor is it scored.
    label(&fixture, "run.mcap", "g 9 enter f n \"a\" enter w q").done();
    let text = fixture.text("run.toml").replace("[9, 9]", "[2, 5]");
    fixture.write("run.toml", &text);
    let words = "checkpoint 1 (a): frame 9 was labelled, and its frames are 2 to 5: extend them";
    fixture.svl("score run.toml -o r").failed(1, &[words]);
}

#[test]
fn a_label_that_may_have_lost_its_first_key_is_not_taken() {
    let fixture = Fixture::recorded();
    let said = |keys: &str| label(&fixture, "run.mcap", &format!("{keys} screen q d")).done();
    for (keys, doubt) in [
        (". \"5\" enter", "is it 5 or .5? . has moved"),
        (", \"5\" enter", "is it 5 or ,5? , has moved"),
        ("> \"1.2\" enter", "is it 1.2 or >1.2? > has moved"),
        ("< \"0.5\" enter", "is it 0.5 or <0.5? < has moved"),
    ] {
        assert_says(&said(keys), &["not labelled: ", doubt]);
    }
    for keys in [
        ". \"0.43\" enter",
        ". right \"5\" enter",
        "\"5\" enter",
        "> = \"1.2\" enter",
        ". = \"5\" enter",
    ] {
        let screen = said(keys);
        assert!(!screen.contains("not labelled: "), "{keys}: {screen}");
    }
}

#[test]
fn the_screen_shows_frame_grid_labels_and_algorithm() {
    let fixture = Fixture::recorded();
    let keys = "right down \"0.5\" enter n \"shelf\" enter screen q d";
    insta::assert_snapshot!(label(&fixture, "run.mcap --algo v3", keys).done());
    for (keys, words) in [
        ("? screen esc q", "go to frame 120"),
        ("g \"99\" enter screen q", "frame 11 of 12"),
        (", screen q", "the first frame"),
        (
            "space tick tick screen q",
            "frame 2 of 12  0.200 s  playing",
        ),
        (
            "\"1x\" enter screen q",
            "'1x' is not a distance; type a distance",
        ),
        ("\"0\" enter screen q", "above 0 m"),
        ("\"2000\" enter screen q", "at most 1000 m"),
        (". . ] . [ screen q d", "frame 3 is behind the last one, 2"),
        ("w screen q", "no cell is labelled"),
        ("f w screen esc q d", "name of the checkpoint"),
        ("f q screen d", "1 cell not written: w write, k keep"),
        ("f x screen q", "not labelled"),
        ("z screen q", "'z' does nothing here; ? shows the keys"),
        ("click:50,20 screen q", "cell (7, 5)"),
        ("resize:40x10 screen q", "make the terminal at least"),
        ("resize:200x50 screen q", "checkpoint 1: no name yet"),
    ] {
        let text = label(&fixture, "run.mcap --grid 8x6", keys).done();
        assert!(text.contains(words), "{keys}:\n{text}");
    }
    // The arena's recording has truth.
    label(&fixture, "run.mcap", "= \"must\" enter n \"m\" enter w q").done();
    assert_says(&fixture.text("run.toml"), &["must = [[0, 0]]"]);
}

#[test]
fn the_arena_has_a_scenario_of_its_seed() {
    let fixture = Fixture::new();
    label(
        &fixture,
        "arena --seed 3 -o a.toml",
        "> > f n \"a\" enter w q",
    )
    .done();
    let scenario = Scenario::read(&fixture.path("a.toml")).unwrap();
    let ScenarioSource::Arena { seeds, .. } = &scenario.source else {
        panic!("{:?}", scenario.source)
    };
    assert_eq!((&seeds[..], scenario.checkpoints.len()), (&[3][..], 1));
    let words = "a.toml: is of another arena or seed; name another scenario with -o";
    label(&fixture, "arena --seed 4 -o a.toml", "q").failed(1, &[words]);
}

#[test]
fn a_checkpoint_names_its_recording_among_several() {
    let fixture = Fixture::recorded();
    fixture.run("record --frames 3 --seed 2 -o two.mcap");
    let text = "name = \"both\"\ndescription = \"\"\nalgorithms = [\"v3\"]\n[cells]\njudge = \
                \"distance\"\n[grid]\ncolumns = 4\nrows = 2\n[source]\nkind = \
                \"recording\"\nfiles = [\"*.mcap\"]\n";
    fixture.write("both.toml", text);
    label(&fixture, "two.mcap -o both.toml", ". f n \"a\" enter w q").done();
    let added = fixture.text("both.toml");
    let added = added.strip_prefix(text).unwrap();
    assert_says(added, &["frames = [1, 1]\nfile = \"two.mcap\"\n"]);
    let scenario = Scenario::read(&fixture.path("both.toml")).unwrap();
    scenario.recordings().unwrap();
    label(&fixture, "run.mcap -o both.toml --grid 5x3", "q")
        .failed(2, &["--grid is set by both.toml; leave it out"]);
    std::fs::create_dir(fixture.path("inner")).unwrap();
    std::fs::rename(fixture.path("run.mcap"), fixture.path("inner/run.mcap")).unwrap();
    label(&fixture, "inner/run.mcap -o both.toml", "q").failed(
        1,
        &["both.toml: inner/run.mcap is not in its source.files; add it"],
    );
}
