//! An error of the command line itself, whatever files and machines there are: one line, and
//! exit code 2.

use super::terminal::print_error;
use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::error::{ContextKind, ErrorKind};
use clap::{Command, Error};
use std::error::Error as _;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use svl::alternatives;
use svl::files::has_ending;
use svl::losses::Incomplete;
use svl::matcher::Algorithm;
pub(crate) use svl::scenario::within;
use svl::score::{Metric, MetricFault};
use svl::stereo::GridShape;

/// Names of commands in other programs, and svl's commands that do the same.
pub(crate) const SYNONYMS: &[(&str, &[&str])] = &[
    ("run", &["score", "replay"]),
    ("test", &["score", "eval"]),
    ("stats", &["info"]),
    ("version", &["--version"]),
    ("viz", &["view"]),
    ("merge", &["report"]),
    ("export", &["replay", "report"]),
    ("download", &["datasets"]),
    ("evaluate", &["score", "eval"]),
    ("diff", &["compare"]),
    ("plot", &["view", "compare"]),
    ("show", &["view", "info"]),
    ("open", &["view", "info"]),
    ("play", &["view", "replay"]),
    ("list", &["algos", "datasets", "columns"]),
    ("ls", &["algos", "datasets", "columns"]),
    ("check", &["info"]),
    ("verify", &["info", "replay"]),
    ("repair", &["recover"]),
    ("fix", &["recover"]),
    ("capture", &["record"]),
    ("sim", &["record"]),
    ("search", &["score", "tune"]),
    ("optimize", &["score", "tune"]),
    ("annotate", &["label"]),
    ("fit", &["train"]),
    ("benchmark", &["bench"]),
    ("time", &["bench"]),
    ("convert", &["calibrate", "record"]),
    ("join", &["report"]),
    ("gate", &["score --gate", "report --gate"]),
];

/// Options in other programs, or of another command, and what does the same here: the first cure of
/// a command, or of any, whose options the command has. What is in backquotes is another command.
pub(crate) const OPTION_SYNONYMS: &[(&[&str], &str, &str)] = &[
    (
        &["--algo"],
        "compare",
        "BASE#ALGORITHM in the place of BASE",
    ),
    (&["--algorithm", "--matcher", "--method"], "", "--algo"),
    (
        &["--baseline"],
        "",
        "`svl compare BASE OTHER` for a report, --calib for cameras",
    ),
    (&["--baseline"], "", "`svl compare BASE OTHER`"),
    (&["--bins"], "", "--ranges"),
    (&["--camera"], "", "--calib"),
    (&["--ci", "--gate"], "compare", "--fail-on"),
    (&["--ci"], "", "--gate, --junit FILE.xml"),
    (&["--ci", "--gate"], "", "`svl score --gate`"),
    (
        &["--dataset"],
        "",
        "the folder without an option: `svl score FOLDER`",
    ),
    (
        &["--depth"],
        "",
        "--truth for the truth, --algo topic:… for a contestant",
    ),
    (&["--end"], "", "--to"),
    (&["--format"], "", "--json, --markdown, or the ending of -o"),
    (&["--format"], "", "--json, or the ending of -o"),
    (&["--frame", "--limit", "--max-frames"], "", "--frames"),
    (
        &["--frame", "--frames", "--limit", "--max-frames"],
        "",
        "--every, --from, --to",
    ),
    (&["--grid"], "", "--cells"),
    (&["--ground-truth", "--gt"], "", "--truth"),
    (&["-j"], "score", "--jobs"),
    (&["--jobs", "-j"], "", "--threads"),
    (&["--html"], "compare", "-o COMPARISON.html"),
    (
        &["--html"],
        "score",
        "-o: index.html in that folder is the page",
    ),
    (
        &["--html"],
        "report",
        "index.html in the folder is the page",
    ),
    (&["--html"], "", "`svl score` writes a page"),
    (
        &["--left", "--right"],
        "",
        "the images without an option: `svl match LEFT RIGHT`",
    ),
    (
        &[
            "--disparities",
            "--max-disp",
            "--max-disparity",
            "--num-disparities",
        ],
        "",
        "a parameter: --algo bm:max_disparity=64",
    ),
    (&["--near"], "", "`svl score --near`"),
    (&["--out", "--outdir", "--output-dir"], "", "-o"),
    (&["--pdf"], "", "the page, printed by a browser"),
    (
        &["--ranges"],
        "",
        "`svl score --ranges` into the same folder",
    ),
    (&["--rate"], "", "--fps"),
    (&["--skip", "--start"], "", "--from"),
    (&["--step", "--stride"], "", "--every"),
    (&["--threshold"], "", "--tolerance"),
    (&["--topic", "--topics"], "", "--left, --right, --truth"),
];

/// Names in use elsewhere, and the algorithms of that kind. OpenCV's own run as programs.
const ALGORITHM_SYNONYMS: &[(&str, &[&str])] = &[
    ("opencv", &["bm", "sgm", "exec"]),
    ("stereobm", &["bm", "exec"]),
    ("sbm", &["bm", "exec"]),
    ("sad", &["bm"]),
    ("sgbm", &["sgm", "exec"]),
    ("stereosgbm", &["sgm", "exec"]),
    ("census", &["sgm"]),
    ("onnx", &["exec"]),
    ("torch", &["exec"]),
    ("python", &["exec"]),
];

/// The name of standard output among files.
pub(crate) const STDOUT: &str = "-";

/// An error of the command line.
pub(crate) fn wrong(words: impl Display) -> anyhow::Error {
    svl::Error::Usage(words.to_string()).into()
}

/// Prints an error and its causes in one line. Returns 2 for wrong usage, 3 for a limit that failed
/// or was not measured, 4 for a result that is incomplete, else 1.
pub(crate) fn report(error: &anyhow::Error) -> ExitCode {
    let line = with_synonyms(one_line(error), error.downcast_ref());
    let (code, cure) = match error.downcast_ref::<svl::Error>() {
        Some(error) if error.is_usage() => (2, "; see --help"),
        Some(error) if error.downcast_ref::<GateError>().is_some() => (3, ""),
        Some(error) if error.downcast_ref::<Incomplete>().is_some() => (4, ""),
        _ => (1, ""),
    };
    // For svl_bench, which raises its exception.
    let is_told = std::env::var_os("SVL_ERROR_KINDS").is_some();
    let failure = error.downcast_ref::<svl::Error>().filter(|_| is_told);
    let kind = failure
        .and_then(svl::Error::kind)
        .map(|kind| format!("[{kind}]"));
    let kind = kind.unwrap_or_default();
    print_error(format_args!("error{kind}: {line}{cure}"));
    ExitCode::from(code)
}

/// A limit is exceeded, or could not be checked.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct GateError(String);

/// The error of a gate that failed or was not measured.
pub(crate) fn gate(words: impl Display) -> anyhow::Error {
    svl::Error::other(GateError(words.to_string())).into()
}

/// The error of a command that has done its work, but for something.
pub(crate) fn incomplete(words: String) -> anyhow::Error {
    svl::Error::other(Incomplete(words)).into()
}

/// Prints clap's error in one line, without the usage that `--help` shows; help and version as they
/// are.
pub(crate) fn report_clap(error: &Error, program: &Command) -> ExitCode {
    if error.use_stderr() && error.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        let text = error.to_string();
        let marks = ["\n\nUsage:", "\n\nFor more information"];
        let end = marks.iter().filter_map(|mark| text.find(mark)).min();
        let lines = text[..end.unwrap_or(text.len())].lines().map(str::trim);
        let line = lines.filter(|line| !line.is_empty()).fold(
            String::new(),
            // clap sets tips apart by a line of their own.
            |text, line| match (text.is_empty(), line.starts_with("tip: ")) {
                (true, _) => line.to_owned(),
                // No value of svl looks like an option.
                _ if line.starts_with("tip: to pass ") => text,
                (_, true) => format!("{text}; {line}"),
                _ => format!("{text} {line}"),
            },
        );
        let cause = error.source().and_then(|cause| cause.downcast_ref());
        let line = with_synonyms(line, cause);
        match similar(error, program) {
            None => print_error(format_args!("{line}; see --help")),
            Some(similar) => {
                // clap knows only near spellings.
                let line = line.split("; tip:").next().unwrap_or_default();
                print_error(format_args!("{line} (did you mean {similar}?); see --help"));
            }
        }
    } else {
        // A closed standard output is no reason to panic.
        let _ = error.print();
    }
    ExitCode::from(error.exit_code() as u8)
}

/// The cure for an unknown command or option: its name here, or the command below that one.
fn similar(error: &Error, program: &Command) -> Option<String> {
    let context = |kind| error.get(kind).map(ToString::to_string);
    if let Some(option) = context(ContextKind::InvalidArg) {
        let option = option.split(['=', ' ']).next().unwrap_or_default();
        let is_unknown = error.kind() == ErrorKind::UnknownArgument;
        let usage = context(ContextKind::Usage).filter(|_| is_unknown)?;
        return option_cure(option, &usage, program).map(str::to_owned);
    }
    let name = context(ContextKind::InvalidSubcommand)?;
    // `Usage: svl label [OPTIONS] <COMMAND>`
    let usage = context(ContextKind::Usage)?;
    let mut words = usage.split_whitespace();
    let command = words.find(|word| *word == "svl").and(words.next())?;
    let Some(command) = program.find_subcommand(command) else {
        let found = SYNONYMS.iter().find(|(synonym, _)| *synonym == name);
        return found.map(|(_, commands)| alternatives(commands));
    };
    // A file in the place of a command.
    Path::new(&name).extension()?;
    let inner = command.get_subcommands().map(Command::get_name);
    let inner = inner.map(|inner| format!("svl {} {inner} {name}", command.get_name()));
    Some(alternatives(&inner.collect::<Vec<_>>()))
}

/// The cure for an option that a command does not have. `usage`: its usage.
fn option_cure(option: &str, usage: &str, program: &Command) -> Option<&'static str> {
    let mut words = usage.split_whitespace().skip_while(|word| *word != "svl");
    let mut command = words.next().map(|_| program)?;
    while let Some(inner) = words.next().and_then(|word| command.find_subcommand(word)) {
        command = inner;
    }
    let options = command.get_arguments().chain(program.get_arguments());
    let options: Vec<_> = options
        .flat_map(|own| {
            let long = own.get_long().map(|long| format!("--{long}"));
            long.into_iter()
                .chain(own.get_short().map(|c| format!("-{c}")))
        })
        .collect();
    let mut synonyms = OPTION_SYNONYMS.iter();
    let found = synonyms.find(|(names, own, cure)| {
        let has = |name: &str| options.iter().any(|own| own == name);
        let is_own = own.is_empty() || *own == command.get_name();
        names.contains(&option) && is_own && cured_by(cure).all(has)
    });
    found.map(|(.., cure)| *cure)
}

/// The options that a cure names of the command itself.
pub(crate) fn cured_by(cure: &str) -> impl Iterator<Item = &str> {
    let outside = cure.split('`').step_by(2);
    let words = outside.flat_map(|part| part.split([' ', ',', ';', ':']));
    words.filter(|word| word.starts_with('-'))
}

/// The line of an error, in which the name of an algorithm elsewhere has those of its kind.
fn with_synonyms(line: String, error: Option<&svl::Error>) -> String {
    let Some(error @ svl::Error::UnknownAlgorithm { name, .. }) = error else {
        return line;
    };
    let each: Vec<_> = name.split(',').collect();
    if each.len() > 1 && each.iter().all(|own| algorithm(own).is_ok()) {
        let cure = format!("each has its own option: --algo {}", each.join(" --algo "));
        return line.replace(&error.to_string(), &cure);
    }
    let lower = name.to_lowercase();
    let mut synonyms = ALGORITHM_SYNONYMS.iter();
    let kind = synonyms.find(|(synonym, _)| *synonym == lower);
    let Some(similar) = kind.map(|(_, kind)| kind.iter().map(ToString::to_string).collect()) else {
        return line;
    };
    let name = name.clone();
    let known = svl::Error::UnknownAlgorithm { name, similar };
    line.replace(&error.to_string(), &known.to_string())
}

/// An algorithm whose parameters go together.
pub(crate) fn algorithm(text: &str) -> svl::Result<Algorithm> {
    let algorithm: Algorithm = text.parse()?;
    algorithm.check()?;
    Ok(algorithm)
}

/// Two numbers with a character between them.
pub(crate) fn two<N: FromStr>(text: &str, between: char) -> Option<(N, N)> {
    let (first, second) = text.split_once(between)?;
    Some((first.parse().ok()?, second.parse().ok()?))
}

/// Columns and rows, as 5x3, from 1 to `most` each.
pub(crate) fn grid(text: &str, most: usize) -> Option<GridShape> {
    let (columns, rows) = two(text, 'x')?;
    let fit = [columns, rows].iter().all(|side| (1..=most).contains(side));
    fit.then_some(GridShape { columns, rows })
}

/// The metric of that name that algorithms are ranked or tested by.
pub(crate) fn metric(name: &str) -> Result<&'static Metric, MetricFault> {
    Metric::named(name)?.to_judge_by()
}

/// The name of a file with one of these extensions.
pub(crate) fn ending(endings: &'static [&'static str]) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| ends_in(&path, endings).map(|()| path))
}

/// The name of a map, or of a folder of maps: a recording has pairs in place of them.
pub(crate) fn map() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        let is_recording = ["bag", "db3", "mcap"]
            .iter()
            .any(|own| has_ending(&path, own));
        let name = path.display();
        let words = || format!("is a recording: `svl score {name}` scores it");
        if is_recording { Err(words()) } else { Ok(path) }
    })
}

/// [`ending`], or `-`: standard output.
pub(crate) fn ending_or_stdout(
    endings: &'static [&'static str],
) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        if path != Path::new(STDOUT) {
            ends_in(&path, endings)?;
        }
        Ok::<_, svl::Error>(path)
    })
}

/// Refuses the name of a file with none of these extensions.
pub(crate) fn ends_in(path: &Path, endings: &[&str]) -> svl::Result<()> {
    let has = |ending: &&str| path.extension().is_some_and(|e| e == *ending);
    if endings.iter().any(has) {
        return Ok(());
    }
    let endings = endings.join(" or .");
    let words = format!("{}: must end in .{endings}", path.display());
    Err(svl::Error::Usage(words))
}

/// The error and its causes in one line.
pub(crate) fn one_line(error: &anyhow::Error) -> String {
    let text = format!("{error:#}");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
