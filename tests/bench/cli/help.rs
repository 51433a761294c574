//! Help, completions and the man page.

use super::fixture::{Fixture, assert_says};

#[test]
fn help_tells_what_svl_is_for() {
    insta::assert_snapshot!(Fixture::new().run("--help"));
}

/// The commands below `command`, with their words.
fn commands(fixture: &Fixture, command: &str) -> Vec<String> {
    let text = fixture.run(&format!("{command} --help"));
    let line = |line: &str| {
        let name = line.strip_prefix("  ")?.split_once("  ")?.0.trim();
        let is_name = name.chars().all(|c| c.is_ascii_lowercase());
        (is_name && !name.is_empty()).then(|| format!("{command} {name}").trim().to_owned())
    };
    let below = text.split("Options:").next().unwrap_or_default();
    below.lines().filter_map(line).collect()
}

/// A screen has 80 columns; an option without a heading was never assigned one.
#[test]
fn short_help_fits_a_screen_and_options_have_headings() {
    let fixture = Fixture::new();
    let mut all = commands(&fixture, "");
    for command in ["calibrate", "label", "train", "datasets", "generate"] {
        all.extend(commands(&fixture, command));
    }
    assert!(all.len() >= 30, "{all:?}");
    for command in all {
        let words: Vec<_> = command.split(' ').collect();
        for (flag, most) in [("-h", 60), ("--help", usize::MAX)] {
            let line = [&words[..], &[flag]].concat();
            let text = fixture.svl_with(&line, &[("COLUMNS", "80")]).done();
            let lines = text.lines().count();
            assert!(lines <= most, "svl {command} {flag}: {lines} lines");
            let long: Vec<_> = text
                .lines()
                .filter(|line| line.chars().count() > 80 && !line.starts_with("Usage:"))
                .collect();
            assert!(long.is_empty(), "svl {command} {flag}: {long:#?}");
            assert!(!text.contains("\nOptions:"), "svl {command} {flag}");
            let places = ["Input", "Scoring", "Output", "Run"].map(|heading| {
                let line = format!("\n{heading}:\n");
                text.find(&line)
            });
            let places: Vec<_> = places.into_iter().flatten().collect();
            assert!(places.is_sorted(), "svl {command} {flag}:\n{text}");
            assert_defaults_stand_once(&text);
        }
    }
    let front = fixture.svl_with(&["-h"], &[("COLUMNS", "80")]).done();
    assert!(front.lines().count() <= 46, "{front}");
}

/// Pages that a new user reads first.
const FIRST_PAGES: [&str; 4] = [
    "README.md",
    "docs/own-data.md",
    "docs/tutorials/first-number.md",
    "docs/tutorials/network.md",
];

/// The options that a page uses, each with its command.
fn options_used(page: &str, commands: &[String]) -> Vec<(String, String)> {
    let lines = page.replace("\\\n", " ");
    let lines = lines.split(['\n', '`']);
    let calls = lines.filter_map(|line| line.split_once("svl ").map(|(_, call)| call));
    let options = calls.flat_map(|call| {
        let call = call.trim_start_matches("-q ");
        let takes =
            |command: &&String| call == **command || call.starts_with(&format!("{command} "));
        let command = commands.iter().filter(takes).max_by_key(|name| name.len());
        let options = call.split(' ').filter(|word| word.starts_with('-'));
        let names = options.filter_map(|word| word.split(['=', ',', ';', ')']).next());
        let named = names.map(|name| Some((command?.clone(), name.to_owned())));
        named.flatten().collect::<Vec<_>>()
    });
    options.collect()
}

#[test]
fn short_help_has_the_options_of_the_first_pages() {
    let fixture = Fixture::new();
    let mut all = commands(&fixture, "");
    for command in ["calibrate", "label", "train", "datasets", "generate"] {
        all.extend(commands(&fixture, command));
    }
    let pages = FIRST_PAGES.map(|page| {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(page);
        std::fs::read_to_string(path).unwrap()
    });
    let used = pages.iter().flat_map(|page| options_used(page, &all));
    let used: std::collections::BTreeSet<_> = used.collect();
    assert!(used.len() >= 25, "{used:?}");
    let mut help = std::collections::BTreeMap::new();
    for (command, option) in used {
        let help = help
            .entry(command.clone())
            .or_insert_with(|| fixture.run(&format!("{command} -h")));
        let is_shown = help
            .split([' ', ',', '[', '=', '\n'])
            .any(|word| word == option);
        assert!(is_shown, "svl {command} -h lacks {option}:\n{help}");
    }
}

/// A default ends a line of its option, once. Possible values that are not all are not listed.
fn assert_defaults_stand_once(help: &str) {
    let is_name = |line: &str| {
        let indent = line.len() - line.trim_start().len();
        indent <= 6 && line.trim_start().starts_with(['-', '<', '['])
    };
    let mut defaults = 0;
    for (before, line) in help.lines().zip(help.lines().skip(1)) {
        defaults = if is_name(line) { 0 } else { defaults };
        defaults += line.matches("[default:").count();
        assert!(defaults <= 1, "two defaults: {line}\n{help}");
        let is_alone = before.trim().is_empty() && line.trim().starts_with("[default:");
        assert!(!is_alone, "a default alone: {line}\n{help}");
        assert!(!line.contains("\\\""), "{line}");
    }
}

#[test]
fn options_of_sources_are_listed_once() {
    let fixture = Fixture::new();
    assert_says(
        &fixture.run("help sources"),
        &["--side-by-side", "--trigger", "v4l2:"],
    );
    let hint = "svl help sources";
    for command in ["record", "replay", "score", "tune", "train filter"] {
        let short = fixture.run(&format!("{command} -h"));
        assert!(
            short.contains(hint) && !short.contains("--max-skew-ms"),
            "{short}"
        );
        assert_says(
            &fixture.run(&format!("{command} --help")),
            &["--max-skew-ms", "svl help sources"],
        );
    }
    assert_eq!(fixture.run("help score"), fixture.run("score --help"));
    fixture.fails("help nosuch => 2: nosuch");
}

/// Lines broken by hand in the help stay as they are, at any width.
#[test]
fn no_terminal_breaks_the_text_below_the_options() {
    let fixture = Fixture::new();
    for command in ["record", "replay", "score", "match", "eval", "tune"] {
        let below = |columns: &str| {
            let text = fixture
                .svl_with(&[command, "--help"], &[("COLUMNS", columns)])
                .done();
            text.split("Examples:\n").nth(1).map(str::to_owned)
        };
        assert!(
            below("80").is_some() && below("80") == below("100"),
            "{command}"
        );
    }
}

#[test]
fn no_arguments_is_wrong_usage() {
    assert_eq!(Fixture::new().svl("").code, Some(2));
}

#[test]
fn completions_and_the_man_page_are_printed() {
    let fixture = Fixture::new();
    let scripts = ["bash", "zsh", "fish"].map(|shell| {
        let script = fixture.run(&format!("generate completions {shell}"));
        assert_says(&script, &["sgm", "median_error", "svl generate topics --"]);
        assert!(!script.contains("svl-topics"), "{shell}");
        script
    });
    assert_says(&scripts[0], &["_svl"]);
    fixture.record("a.mcap", "--frames 1");
    let topics = fixture.run("generate topics -- svl score a.mcap none.mcap --truth /");
    assert_says(&topics, &["/truth/depth\n"]);
    // bash itself completes.
    let svl = assert_cmd::cargo::cargo_bin!("svl");
    let complete = |line: &str| {
        let words = format!("COMP_WORDS=({line}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))");
        let (last, before) = ("${COMP_WORDS[COMP_CWORD]}", "${COMP_WORDS[COMP_CWORD-1]}");
        let code = format!(
            "{}\n{words}\n_svl svl \"{last}\" \"{before}\"\necho \"${{COMPREPLY[@]}}\"",
            scripts[0]
        );
        let path = std::env::var("PATH").unwrap_or_default();
        let output = std::process::Command::new("bash")
            .args(["-c", &code])
            .current_dir(fixture.path(""))
            .env(
                "PATH",
                format!("{}:{path}", svl.parent().unwrap().display()),
            )
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    if cfg!(unix) {
        assert_eq!(complete("svl score a.mcap --algo s"), "sgm\n");
        assert_says(
            &complete("svl score a.mcap --columns med"),
            &["median_error"],
        );
        assert_says(&complete("svl score a.mcap --truth /tr"), &["/truth/depth"]);
        assert_eq!(complete("svl score --truth a.m"), "a.mcap\n");
    }
    assert_says(&fixture.run("generate man"), &[".TH svl"]);
    fixture.run("generate man -o man1");
    let page = fixture.text("man1/svl-calibrate-board.1");
    assert_says(&page, &["svl\\-calibrate\\-board", "side\\-by\\-side"]);
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    let svl = assert_cmd::cargo::cargo_bin!("svl").display().to_string();
    for command in [
        "algos",
        "algos --json",
        "generate completions bash",
        "generate man",
        "--help",
        "help sources",
    ] {
        let shell = format!("{svl} {command} | true; exit ${{PIPESTATUS[0]}}");
        let output = std::process::Command::new("bash")
            .args(["-c", &shell])
            .output()
            .unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.success() && stderr.is_empty(),
            "{command}: {stderr}"
        );
    }
}

#[test]
fn an_unknown_name_has_suggestions_by_its_meaning() {
    Fixture::new().fails(
        "
        run => 2: error: unrecognized subcommand 'run' (did you mean 'score' or 'replay'?); see
        diff => 2: (did you mean 'compare'?)
        plot => 2: (did you mean 'view' or 'compare'?)
        play => 2: (did you mean 'view' or 'replay'?)
        list => 2: (did you mean 'algos', 'datasets' or 'columns'?)
        replai => 2: tip: some similar subcommands exist: 'train', 'replay'; see --help
        calibrate list => 2: unrecognized subcommand 'list'; tip: a similar subcommand exists: \
         'distance'; see
        algos sgbm => 2: unknown algorithm 'sgbm' (did you mean 'sgm' or 'exec'?)
        algos OpenCV => 2: unknown algorithm 'OpenCV' (did you mean 'bm', 'sgm' or 'exec'?)
        gate r => 2: (did you mean 'score --gate' or 'report --gate'?)
        label run.mcap => 2: 'svl label checkpoints run.mcap' or 'svl label windows run.mcap'
        label nothing => 2: unrecognized subcommand 'nothing'; see
        label --near 1 => 2: (did you mean `svl score --near`?)
        score r --gt x => 2: unexpected argument '--gt' found (did you mean --truth?); see
        score r --html=x => 2: index.html in that folder is the page
        score r --pdf => 2: printed by a browser
        score r --depth /d => 2: --truth for the truth, --algo topic:
        score r --topic /a => 2: (did you mean --left, --right, --truth?)
        score r --frames 5 => 2: (did you mean --every, --from, --to?)
        score r --max-disparity 64 => 2: --algo bm:max_disparity=64
        score --dataset kitti => 2: the folder without an option
        score r --ci => 2: (did you mean --gate, --junit FILE.xml?)
        score r --output-dir d => 2: (did you mean -o?)
        score r --matcher bm => 2: (did you mean --algo?)
        score r --baseline b => 2: `svl compare BASE OTHER` for a report, --calib
        score r --rate 10 => 2: (did you mean --fps?)
        score r --unknown => 2: unexpected argument '--unknown' found; see
        compare a b --format json => 2: (did you mean --json, --markdown,
        match --left l.png --right r.png => 2: `svl match LEFT RIGHT`
        compare a b --baseline c => 2: (did you mean `svl compare BASE OTHER`?)
        compare a b --html => 2: (did you mean -o COMPARISON.html?)
        compare a b --gate => 2: (did you mean --fail-on?)
        compare a b --algo v3 => 2: BASE#ALGORITHM
        replay a.mcap --html => 2: `svl score` writes a page
        replay a.mcap --ci => 2: `svl score --gate`
        record --frame 5 => 2: (did you mean --frames?)
        report r --ranges 1,2 => 2: `svl score --ranges`
        score r --grid 5x3 => 2: (did you mean --cells?)
        merge a b => 2: (did you mean 'report'?)
        eval a.mcap => 2: is a recording: `svl score a.mcap` scores it; see
        score r --algo v5,sgm => 2: each has its own option: --algo v5 --algo sgm; see
        score r --algo v5,nothing => 2: unknown algorithm 'v5,nothing'
        ",
    );
}
