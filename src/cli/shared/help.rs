//! Help: the groups of the front page, the headings of options, and the options that only `--help`
//! shows.

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

/// Headings in their order, and the options of those that declare none, by their names.
const HEADINGS: &[(&str, &str)] = &[
    (
        "Input",
        "algo sample filter kind data seed frames duration bits calib size from unit scenario \
         model target squares square_m object_map mask right_truth disparity_scale map list test \
         grid from_truth pairs",
    ),
    (
        "Scoring",
        "near_m beyond_m shape tolerance stress repeat check gate fail_on allow_loss protocol \
         max_disparity verify",
    ),
    ("Training", "tables_only fit_seed epochs hidden"),
    (
        "Output",
        "output force rows cells why preview error_map figure figures table \
         compress ros2 publish dense near rerun drives area \
         sort columns explain junit print_scenario to rectify example web markdown json",
    ),
    (
        "Run",
        "times prune shard script speed yes threads verbose quiet help version",
    ),
];

/// Options that only `--help` shows, not `-h`.
const LONG_OPTIONS: &str = "\
    sample beyond_m shape tolerance area figures publish dense near drives times \
    prune junit print_scenario script epochs pairs";

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

/// True for an id that is one of these words.
fn is_named(ids: &str, id: &clap::Id) -> bool {
    ids.split(' ').any(|own| id == own)
}

/// The names of an argument group's options.
fn ids<A: Args>() -> Vec<clap::Id> {
    let command = A::augment_args(Command::new(""));
    command
        .get_arguments()
        .map(|arg| arg.get_id().clone())
        .collect()
}

/// The command with a heading for each option, and with what `-h` shows of it.
fn with_headings(command: Command, path: &str) -> Command {
    let shared = [
        ("Source", ids::<SourceOptions>()),
        ("Cameras", ids::<CameraArgs>()),
    ];
    // A name of one group may be another option of a command without that group.
    let has = |ids: &[clap::Id]| {
        ids.iter()
            .all(|id| command.get_arguments().any(|arg| arg.get_id() == id))
    };
    let shared: Vec<_> = shared.into_iter().filter(|(_, ids)| has(ids)).collect();
    let has_sources = !shared.is_empty();
    let command = command.mut_args(|arg| {
        let arg = with_default_in_help(accepting_negative_numbers(arg));
        let id = arg.get_id();
        if let Some((heading, _)) = shared.iter().find(|(_, ids)| ids.contains(id)) {
            let arg = arg.help_heading(*heading).hide_short_help(true);
            return arg.hide_long_help(path != SOURCES_PAGE);
        }
        let is_long = is_named(LONG_OPTIONS, id);
        let heading = HEADINGS.iter().find(|(_, ids)| is_named(ids, id));
        let heading = heading.filter(|_| !arg.is_positional() && arg.get_help_heading().is_none());
        let arg = match heading {
            Some((heading, _)) => arg.help_heading(*heading),
            None => arg,
        };
        arg.hide_short_help(is_long)
    });
    // clap shows headings in the order of their first arguments; a command's own are in the middle.
    let place = |arg: &Arg| {
        let own = arg.get_help_heading()?;
        let place = HEADINGS.iter().position(|(heading, _)| own == *heading);
        Some(place.unwrap_or(1))
    };
    let mut sorted: Vec<_> = command.get_arguments().cloned().collect();
    sorted.sort_by_key(place);
    let mut sorted = sorted.into_iter();
    let command = command.mut_args(|arg| sorted.next().unwrap_or(arg));
    let below = command.get_after_help().map(StyledStr::to_string);
    let mut below = below.unwrap_or_default();
    let mut short = String::new();
    if has_sources && path != SOURCES_PAGE {
        short += "Source options: svl help sources\n";
        let shown = command.get_arguments().filter(|arg| !arg.is_hide_set());
        let own = shown.filter(|arg| shared.iter().any(|(_, ids)| ids.contains(arg.get_id())));
        let names = own.filter_map(|arg| Some(format!("--{}", arg.get_long()?)));
        let names = names.collect::<Vec<_>>().join(" ");
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
