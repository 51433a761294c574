//! Options for cameras: trigger, pairing, queue; what the drivers' table adds to help and lists.

use super::progress::{Progress, interrupted, listen_for_interrupt};
use super::rectify::Recorded;
use super::source::Opened;
use super::terminal::print;
use super::usage;
use std::fmt::Write;
use std::sync::OnceLock;
use std::time::Duration;
use svl::grab::{DRIVERS, Driver, GrabRequest, Host, PairBy, RATES_HZ, TriggerSource, WhenFull};
use svl::matcher::{Range, Value};
use svl::recording::Header;
use svl::source::LiveSource;

/// Options that only cameras take.
#[derive(clap::Args)]
#[command(next_help_heading = "Cameras")]
pub(crate) struct LiveArgs {
    /// Trigger source: svl when both cameras are armed, the trigger controller at DEVICE when both
    /// are armed, svl at a fixed rate, or none: free-running cameras [default: software where the
    /// driver can trigger, else free]
    #[arg(long, value_name = "software|serial:DEVICE|fixed:HZ|free")]
    trigger: Option<TriggerSource>,
    /// Pairs per second: at most with software and serial, exactly with free [default: 30]
    #[arg(
        long,
        value_name = "HZ",
        allow_negative_numbers = true,
        value_parser = usage::within(RATES_HZ)
    )]
    rate: Option<f64>,
    /// What makes a pair: the same trigger pulse, the nearest stamps, or the order of arrival,
    /// which shows what goes wrong without either [default: trigger with software and serial where
    /// the driver can trigger, else stamp]
    #[arg(long, value_name = "trigger|stamp|order")]
    pairing: Option<PairingChoice>,
    /// Pairs that may wait for the disk [default: 64]
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        value_parser = usage::within(1..=4096u16)
    )]
    queue: Option<u16>,
    /// When the queue is full: let the cameras wait (backpressure), or drop pairs and count them
    /// [default: drop]
    #[arg(long, value_name = "wait|drop")]
    when_full: Option<FullChoice>,
    /// Watchdog: how long a camera may be silent, beyond the period where svl does not trigger it;
    /// the third time in a row ends the recording [default: 1]
    #[arg(
        long,
        value_name = "S",
        allow_negative_numbers = true,
        value_parser = usage::within(0.01..=86_400.0)
    )]
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

impl LiveArgs {
    /// Refuses options for cameras where the source is none.
    pub(crate) fn none_given(&self, source: &str) -> anyhow::Result<()> {
        let given = [
            (self.trigger.is_some(), "--trigger"),
            (self.rate.is_some(), "--rate"),
            (self.pairing.is_some(), "--pairing"),
            (self.queue.is_some(), "--queue"),
            (self.when_full.is_some(), "--when-full"),
            (self.timeout.is_some(), "--timeout"),
        ];
        match given.iter().find(|(given, _)| *given) {
            Some((_, option)) => Err(usage::wrong(format!(
                "{option} is for cameras, and '{source}' is none"
            ))),
            None => Ok(()),
        }
    }

    /// Starts the cameras that `name` names.
    pub(crate) fn open(
        &self,
        name: &str,
        seed: Option<u64>,
        max_skew_ms: Option<f64>,
        quiet: bool,
    ) -> anyhow::Result<Opened> {
        listen_for_interrupt();
        // Most cameras begin at once and show no bar.
        let bar = OnceLock::new();
        let host = Host {
            stopped: interrupted,
            progress: &|count| {
                bar.get_or_init(|| Progress::new("rendering", count, quiet))
                    .step();
            },
        };
        let opened = LiveSource::open(name, &self.request(seed, max_skew_ms), host);
        bar.into_inner().into_iter().for_each(Progress::clear);
        let source = opened?;
        let header = Header {
            seed: source.seed(),
            ..Header::new(name)
        };
        Ok(Opened {
            is_live: true,
            source: Box::new(source),
            header,
            scenario: None,
            stem: name.split(':').next().unwrap_or(name).to_owned(),
            recorded: Recorded::default(),
        })
    }

    fn request(&self, seed: Option<u64>, max_skew_ms: Option<f64>) -> GrabRequest {
        let default = GrabRequest::default();
        GrabRequest {
            trigger: self.trigger.clone(),
            rate_hz: self.rate,
            pairing: self.pairing.map(|pairing| match pairing {
                PairingChoice::Trigger => PairBy::Pulse,
                PairingChoice::Stamp => PairBy::Stamp,
                PairingChoice::Order => PairBy::Order,
            }),
            max_skew_ns: max_skew_ms.map(|ms| (ms * 1e6) as u64),
            queue: self.queue.map_or(default.queue, usize::from),
            when_full: match self.when_full {
                Some(FullChoice::Wait) => WhenFull::Wait,
                Some(FullChoice::Drop) => WhenFull::Drop,
                None => default.when_full,
            },
            timeout: self
                .timeout
                .map_or(default.timeout, Duration::from_secs_f64),
            seed,
        }
    }
}

/// Prints the cameras of this machine, and the serial ports where a trigger controller may be.
pub(crate) fn list() -> anyhow::Result<()> {
    let mut text = String::new();
    for driver in DRIVERS {
        match &driver.functions {
            Ok(functions) => {
                let cameras = (functions.list)();
                if cameras.is_empty() {
                    writeln!(text, "{:<22}  no camera found", driver.name)?;
                }
                for camera in cameras {
                    writeln!(text, "{:<22}  camera: {}", camera.name, camera.description)?;
                    for mode in &camera.modes {
                        writeln!(text, "{:<22}  {mode}", "")?;
                    }
                }
            }
            Err(cure) => writeln!(text, "{:<22}  not built in; {cure}", driver.name)?,
        }
    }
    for port in serial2::SerialPort::available_ports().unwrap_or_default() {
        writeln!(text, "serial:{:<15}  serial port", port.display())?;
    }
    print(&text)
}

/// Where the explanation of a source begins in the help of `svl record`, that of an option, and the
/// last column of a line.
const COLUMN: usize = 18;
const OPTION_COLUMN: usize = 38;
const LAST_COLUMN: usize = 78;

/// The drivers with their options, as lines of the help of `svl record`.
pub(crate) fn drivers_help() -> String {
    DRIVERS.iter().map(driver_help).collect()
}

fn driver_help(driver: &Driver) -> String {
    let has_options = !(driver.options.is_empty() && driver.camera_options.is_empty());
    let options = match (has_options, driver.cameras) {
        (false, _) => "",
        (true, "") => "[:OPTION=VALUE,…]",
        (true, _) => "[,OPTION=VALUE,…]",
    };
    let mut text = format!("  {}{options}\n", driver.source());
    let missing = driver.functions.as_ref().err();
    let missing = missing.map_or(String::new(), |cure| format!("; not built in: {cure}"));
    text += &wrapped("", COLUMN, &format!("{}{missing}", driver.help));
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
        text += &wrapped(&head, OPTION_COLUMN, &words);
    }
    if let Some(option) = driver.camera_options.first() {
        let words = format!("from {0} on also of one camera, as right.{0}", option.name);
        text += &wrapped("", COLUMN, &words);
    }
    text
}

/// `head`, and from a column on the words of `text`, broken at the last column.
fn wrapped(head: &str, column: usize, text: &str) -> String {
    let mut lines = vec![format!("{head:<column$}")];
    for word in text.split(' ') {
        let line = lines.last_mut().expect("one to begin with");
        let used = line.chars().count();
        if used > column && used + 1 + word.chars().count() > LAST_COLUMN {
            lines.push(format!("{:column$}{word}", ""));
        } else {
            line.push_str(if used > column { " " } else { "" });
            line.push_str(word);
        }
    }
    lines.join("\n") + "\n"
}
