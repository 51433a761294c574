//! Options of sources on the command line, and the text about [`SOURCES`] in help and lists.

use super::progress::{Terminal, listen_for_interrupt};
use super::terminal::{LAST_COLUMN, print, width, wrapped};
use super::usage;
use clap::builder::{NonEmptyStringValueParser, PossibleValue, TypedValueParser};
use std::path::{Path, PathBuf};
use std::time::Duration;
use svl::grab::{self, DRIVERS, Driver, GrabRequest, PairBy, RATES_HZ, TriggerSource, WhenFull};
use svl::matcher::{Range, Value};
use svl::recording::files;
use svl::source::{Opened, Request, SOURCES, SourceKind, SourceOrigin};

/// Options of a scenario's source, which commands that open one source refuse.
pub(crate) const SCENARIO_OPTIONS: &[&str] = &["data", "scenes", "seeds"];

/// Hides an option that a command refuses from its help.
pub(crate) fn hidden(arg: clap::Arg, keys: &[&str]) -> clap::Arg {
    let is_refused = keys.contains(&arg.get_id().as_str());
    arg.hide(is_refused)
}

/// Options that only cameras accept.
#[derive(clap::Args)]
#[command(next_help_heading = "Cameras")]
pub(crate) struct CameraArgs {
    /// Trigger source: svl when both cameras are armed, the trigger controller at DEVICE when both
    /// are armed, svl at a fixed rate, or none: free-running cameras [default: software where the
    /// driver can trigger, else free]
    #[arg(long, value_name = "software|serial:DEVICE|fixed:HZ|free")]
    trigger: Option<TriggerSource>,
    /// Pairs per second: at most with software and serial, exactly with free [default: 30]
    #[arg(long, value_name = "HZ", value_parser = usage::within(RATES_HZ))]
    rate: Option<f64>,
    /// Rule that makes a pair: the same trigger pulse, the nearest stamps, or the order of arrival,
    /// which shows what goes wrong without either [default: trigger with software and serial where
    /// the driver can trigger, else stamp]
    #[arg(long, value_name = "trigger|stamp|order")]
    pairing: Option<PairingChoice>,
    /// Pairs that may wait for the disk [default: 64]
    #[arg(long, value_name = "N", value_parser = usage::within(1..=4096u16))]
    queue: Option<u16>,
    /// When the queue is full: let the cameras wait (backpressure), or drop pairs and count them
    /// [default: drop]
    #[arg(long, value_name = "wait|drop")]
    when_full: Option<FullChoice>,
    /// Watchdog: how long a camera may be silent, beyond the period where svl does not trigger it;
    /// the third time in a row ends the recording [default: 1]
    #[arg(long, value_name = "S", value_parser = usage::within(0.01..=86_400.0))]
    timeout: Option<f64>,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum PairingChoice {
    Trigger,
    Stamp,
    Order,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum FullChoice {
    Wait,
    Drop,
}

impl CameraArgs {
    pub(crate) fn fill(&self, request: &mut Request<'_>) {
        request.grab = GrabRequest {
            trigger: self.trigger.clone(),
            rate_hz: self.rate,
            pairing: self.pairing.map(|pairing| match pairing {
                PairingChoice::Trigger => PairBy::Pulse,
                PairingChoice::Stamp => PairBy::Stamp,
                PairingChoice::Order => PairBy::Order,
            }),
            queue: self.queue.map(usize::from),
            when_full: self.when_full.map(|choice| match choice {
                FullChoice::Wait => WhenFull::Wait,
                FullChoice::Drop => WhenFull::Drop,
            }),
            timeout: self.timeout.map(Duration::from_secs_f64),
            ..GrabRequest::default()
        };
    }
}

/// Opens a source, with a progress bar where that takes long.
pub(crate) fn open(request: Request<'_>, quiet: bool) -> svl::Result<Opened> {
    if SourceKind::without_files(request.name).is_some_and(SourceKind::is_live) {
        listen_for_interrupt();
    }
    svl::runs::open(request, &Terminal { quiet })
}

/// The files that a source reads, as far as it is named by a path.
pub(crate) fn inputs(name: &str) -> Vec<PathBuf> {
    files(Path::new(name)).unwrap_or_else(|_| vec![name.into()])
}

/// Names of sources that are no files; cameras have theirs after a colon.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    let cameras = DRIVERS.iter().map(|driver| driver.name);
    let simulated = SOURCES.iter().filter(|kind| kind.is_simulated());
    let topics = SOURCES.iter().filter_map(|kind| match &kind.origin {
        SourceOrigin::Topics(topics) => Some(topics.prefix),
        _ => None,
    });
    simulated.map(|kind| kind.name).chain(cameras).chain(topics)
}

/// The name of a source: any text, for which completion scripts offer [`names`].
#[derive(Clone)]
pub(crate) struct SourceParser;

impl TypedValueParser for SourceParser {
    type Value = String;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &std::ffi::OsStr,
    ) -> Result<String, clap::Error> {
        NonEmptyStringValueParser::new().parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(names().map(PossibleValue::new)))
    }
}

/// Prints the cameras of this machine, and the serial ports where a trigger controller may be.
pub(crate) fn list() -> anyhow::Result<()> {
    let mut text = String::new();
    let last = width();
    let mut line = |head: &str, words: &str| text += &wrapped(head, LIST_COLUMN, words, last);
    for driver in DRIVERS {
        match &driver.functions {
            Ok(functions) => {
                let cameras = (functions.list)();
                if cameras.is_empty() {
                    line(driver.name, "no camera found");
                }
                for camera in cameras {
                    line(&camera.name, &format!("camera: {}", camera.description));
                    camera.modes.iter().for_each(|mode| line("", mode));
                }
            }
            Err(cure) => line(driver.name, &format!("not built in; {cure}")),
        }
    }
    for port in grab::serial_ports() {
        line(&format!("serial:{}", port.display()), "serial port");
    }
    print(&text)
}

/// Columns where the explanation of a source begins in `svl help sources`, and that of an
/// option.
const COLUMN: usize = 18;
const OPTION_COLUMN: usize = 38;
/// Column where the description of a camera begins in `svl record --list`.
const LIST_COLUMN: usize = 24;

/// The sources with their options, as lines of `svl help sources`.
pub(super) fn sources_help() -> String {
    let help = SOURCES.iter().map(|kind| {
        if kind.is_cameras() {
            DRIVERS.iter().map(driver_help).collect()
        } else {
            let head = format!("  {}", kind.name);
            let help = format!("{}{}", kind.help, missing(kind.cure()));
            wrapped(&head, COLUMN, &help, LAST_COLUMN)
        }
    });
    help.fold("Sources:\n".to_owned(), |text, help| text + &help)
}

/// The end of a description of what this build lacks.
fn missing(cure: Option<&str>) -> String {
    cure.map_or_else(String::new, |cure| format!("; not built in: {cure}"))
}

fn driver_help(driver: &Driver) -> String {
    let has_options = !(driver.options.is_empty() && driver.camera_options.is_empty());
    let options = match (has_options, driver.cameras) {
        (false, _) => "",
        (true, "") => "[:OPTION=VALUE,…]",
        (true, _) => "[,OPTION=VALUE,…]",
    };
    let mut text = format!("  {}{options}\n", driver.source());
    let missing = missing(driver.functions.as_ref().err().copied());
    text += &wrapped(
        "",
        COLUMN,
        &format!("{}{missing}", driver.help),
        LAST_COLUMN,
    );
    for option in driver.options.iter().chain(driver.camera_options) {
        let default = match option.range.default() {
            Value::Text(text) => text,
            default => default.to_string(),
        };
        let head = format!("{:COLUMN$}{}={default}", "", option.name);
        let values = match option.range {
            Range::Choice { options, .. } => format!(" ({})", options.join(", ")),
            _ => String::new(),
        };
        let words = format!("{}{values}", option.description);
        text += &wrapped(&head, OPTION_COLUMN, &words, LAST_COLUMN);
    }
    if let Some(option) = driver.camera_options.first() {
        let words = format!(
            "{0} and later options also for one camera, as right.{0}",
            option.name
        );
        text += &wrapped("", COLUMN, &words, LAST_COLUMN);
    }
    text
}
