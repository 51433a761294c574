//! Help: the groups of the front page, and the order of the headings that options declare.

use super::source::{CameraArgs, sources_help};
use super::terminal::{LAST_COLUMN, wrapped};
use clap::builder::{StyledStr, ValueParser};
use clap::{Arg, ArgAction, Args, Command, value_parser};
use svl::scenario::SourceOptions;

/// Commands on the front page.
const GROUPS: &[(&str, &[&str])] = &[
    (
        "Record and replay",
        &["record", "replay", "view", "info", "recover"],
    ),
    (
        "Score and compare",
        &["score", "report", "compare", "match", "eval", "bench"],
    ),
    ("Tune and train", &["tune", "label", "train"]),
    ("Calibrate", &["calibrate"]),
    (
        "Lists and help",
        &["algos", "columns", "datasets", "generate", "help"],
    ),
    ("Thesis", &["reproduce"]),
];

/// Headings in their order. clap shows them in the order of their first arguments; one of a command
/// alone comes behind the first.
const HEADINGS: [&str; 5] = ["Input", "Scoring", "Training", "Output", "Run"];

/// The headings of options that commands share, which one page explains.
const SHARED: [&str; 2] = ["Source", "Cameras"];

/// Options of sources that `-h` of a command shows, too: those of the first pages of the
/// documentation.
const IN_SHORT_HELP: [(&str, &[&str]); 3] = [
    (
        "svl record",
        &["left", "right", "side_by_side", "fps", "calib"],
    ),
    ("svl replay", &["calib", "every", "from_s"]),
    ("svl score", &["data", "truth", "every"]),
];

/// The command whose page has the options of sources, which others name.
const SOURCES_PAGE: &str = "svl help sources";

/// Largest number of lines that `-h` shows below the options.
const MAX_LINES: usize = 7;

/// The command line with its help arranged.
pub(crate) fn arranged(program: Command) -> Command {
    let groups = groups(&program);
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{groups}\n\
         Options:\n{{options}}{{after-help}}"
    );
    with_headings(program.help_template(template), "svl")
}

/// The commands in their groups.
fn groups(program: &Command) -> String {
    let about = |name: &&str| {
        let command = program.find_subcommand(name);
        let about = command.and_then(Command::get_about);
        format!("  {name:<10} {}\n", about.cloned().unwrap_or_default())
    };
    let group = |(title, names): &(&str, &[&str])| {
        let lines: String = names.iter().map(about).collect();
        format!("{title}:\n{lines}")
    };
    GROUPS.iter().map(group).collect::<Vec<_>>().join("\n")
}

/// An option with a number, for which a negative one is outside its range, not another option.
fn accepting_negative_numbers(arg: Arg) -> Arg {
    let numbers: [ValueParser; 5] = [
        value_parser!(f64).into(),
        value_parser!(u8).into(),
        value_parser!(u16).into(),
        value_parser!(u64).into(),
        value_parser!(usize).into(),
    ];
    let kind = arg.get_value_parser().type_id();
    let is_number = numbers.iter().any(|number| number.type_id() == kind);
    let is_allowed = is_number || arg.is_allow_negative_numbers_set();
    arg.allow_negative_numbers(is_allowed)
}

/// An option whose default is at the end of the first paragraph of its help, also where the whole
/// help has several: clap would give it a paragraph of its own.
fn with_default_in_help(arg: Arg) -> Arg {
    let values = arg.get_default_values().iter();
    let values: Vec<_> = values
        .map(|value| value.to_string_lossy().into_owned())
        .collect();
    if values.is_empty() || !arg.get_action().takes_values() {
        return arg;
    }
    let with_default = |help: &StyledStr| {
        let help = help.to_string();
        let (first, rest) = match help.split_once("\n\n") {
            Some((first, rest)) => (first, format!("\n\n{rest}")),
            None => (help.as_str(), String::new()),
        };
        format!("{first} [default: {}]{rest}", values.join(" "))
    };
    let [help, long_help] =
        [arg.get_help(), arg.get_long_help()].map(|help| help.map(with_default));
    let arg = arg.hide_default_value(true);
    match (help, long_help) {
        (Some(help), Some(long_help)) => arg.help(help).long_help(long_help),
        (Some(help), None) => arg.help(help),
        _ => arg,
    }
}

/// True for an option that commands share.
fn is_shared(arg: &Arg) -> bool {
    arg.get_help_heading()
        .is_some_and(|own| SHARED.contains(&own))
}

/// The command with its options in the order of their headings, and with what `-h` shows of them.
fn with_headings(command: Command, path: &str) -> Command {
    let own = IN_SHORT_HELP.iter().find(|(command, _)| *command == path);
    let common = own.map_or(&[][..], |(_, options)| options);
    let command = command.mut_args(|arg| {
        let arg = with_default_in_help(accepting_negative_numbers(arg));
        if arg.is_positional() {
            // Not that of options flattened before it.
            return arg.help_heading(None);
        }
        if is_shared(&arg) {
            let is_common = common.contains(&arg.get_id().as_str());
            arg.hide_short_help(!is_common)
                .hide_long_help(path != SOURCES_PAGE)
        } else {
            arg
        }
    });
    let place = |arg: &Arg| {
        let own = arg.get_help_heading()?;
        Some(
            HEADINGS
                .iter()
                .position(|heading| own == *heading)
                .unwrap_or(1),
        )
    };
    let mut sorted: Vec<_> = command.get_arguments().cloned().collect();
    sorted.sort_by_key(place);
    let mut sorted = sorted.into_iter();
    let command = command.mut_args(|arg| sorted.next().unwrap_or(arg));
    let below = command.get_after_help().map(StyledStr::to_string);
    let mut below = below.unwrap_or_default();
    let mut short = String::new();
    let shared = command
        .get_arguments()
        .filter(|arg| is_shared(arg) && !arg.is_hide_set());
    let names = shared.filter_map(|arg| Some(format!("--{}", arg.get_long()?)));
    let names = names.collect::<Vec<_>>().join(" ");
    if !names.is_empty() && path != SOURCES_PAGE {
        short += "More source options: svl help sources\n";
        let names = wrapped("", 2, &names, LAST_COLUMN);
        below = format!("Source, as svl help sources explains:\n{names}\n{below}");
    }
    short += &if below.lines().count() > MAX_LINES {
        format!("Examples: {path} --help")
    } else {
        below.clone()
    };
    let command = command.after_long_help(below).after_help(short);
    command.mut_subcommands(|command| {
        let path = format!("{path} {}", command.get_name());
        with_headings(command, &path)
    })
}

/// The page of `svl help sources`.
pub(crate) fn sources_page() -> Command {
    let help = Arg::new("help").long("help").action(ArgAction::Help);
    let page = Command::new("svl")
        .disable_help_flag(true)
        .arg(help.hide(true))
        .max_term_width(100);
    let page = CameraArgs::augment_args(SourceOptions::augment_args(page));
    let page = page
        .about("The options of sources, equal in every command that opens one")
        .long_about(None)
        .help_template("{about-with-newline}\n{all-args}{after-help}")
        .after_help(sources_help());
    with_headings(page, SOURCES_PAGE)
}
