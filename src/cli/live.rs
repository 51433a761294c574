//! Cameras: how they are fired, paired and queued, and which there are.

use super::progress::{interrupted, listen_for_interrupt};
use super::rectify::Recorded;
use super::source::Opened;
use anyhow::bail;
use clap::error::ErrorKind;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;
use svl::grab::simulated::{Cabled, Drive, Pictures, SimulatedCamera, SimulatedConfig, SimulatedTrigger, Wire};
use svl::grab::{Camera, Clock, Grabber, Policy, Rule, SerialTrigger, Settings, Setup, Side, Trigger, WhenFull};
use svl::recording::Header;
use svl::source::LiveSource;

/// What only cameras take.
#[derive(clap::Args)]
#[command(next_help_heading = "Cameras")]
pub(super) struct LiveArgs {
    /// What fires them: svl when both are armed, the trigger controller at DEVICE then, a fixed rate, or each itself
    /// [default: software]
    #[arg(long, value_name = "software|serial:DEVICE|fixed:HZ|free")]
    trigger: Option<TriggerChoice>,
    /// Pairs a second: at most with software and serial, exactly with free [default: 30]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, value_parser = super::positive)]
    rate: Option<f64>,
    /// What makes a pair: one trigger pulse, near stamps, or the order of arrival, which shows what goes wrong without
    /// either [default: trigger with software and serial, else stamp]
    #[arg(long, value_name = "trigger|stamp|order")]
    pairing: Option<PairingChoice>,
    /// Pairs that may wait for the disk [default: 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    queue: Option<u16>,
    /// When so many wait: let the cameras wait too, or drop pairs and count them [default: drop]
    #[arg(long, value_name = "wait|drop")]
    when_full: Option<FullChoice>,
    /// How long a camera may be silent; the third time in a row ends the recording [default: 1]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = super::positive)]
    timeout: Option<f64>,
}

const RATE_HZ: f64 = 30.0;
const MAX_RATE_HZ: f64 = 1000.0;
const QUEUE: u16 = 64;
/// What cameras begin with, before the exposure balance has seen anything.
const FIRST: Settings = Settings { shutter_us: 4_000, gain_mdb: 0 };
/// Pairs between two looks of the exposure balance.
const BALANCE_EVERY: u32 = 10;

#[derive(Clone, Debug, PartialEq)]
enum TriggerChoice {
    Software,
    Serial(String),
    Fixed(f64),
    Free,
}

impl FromStr for TriggerChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "software" => Ok(Self::Software),
            None if text == "free" => Ok(Self::Free),
            Some(("serial", device)) if !device.is_empty() => Ok(Self::Serial(device.to_owned())),
            Some(("fixed", hz)) => super::positive(hz).map(Self::Fixed),
            _ => Err("expected software, serial:DEVICE, fixed:HZ or free".to_owned()),
        }
    }
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

/// Whether a name is of cameras.
pub(super) fn is_live(name: &str) -> bool {
    ["sim", "v4l2", "genicam"].contains(&name.split(':').next().unwrap_or_default())
}

impl LiveArgs {
    /// Refuses what was given for cameras when there are none.
    pub(super) fn none_given(&self, source: &str) -> anyhow::Result<()> {
        let given = [
            (self.trigger.is_some(), "--trigger"),
            (self.rate.is_some(), "--rate"),
            (self.pairing.is_some(), "--pairing"),
            (self.queue.is_some(), "--queue"),
            (self.when_full.is_some(), "--when-full"),
            (self.timeout.is_some(), "--timeout"),
        ];
        match given.iter().find(|(given, _)| *given) {
            Some((_, option)) => bail!(clap::Error::raw(
                ErrorKind::ArgumentConflict,
                format!("{option} is for cameras, and '{source}' is none\n")
            )),
            None => Ok(()),
        }
    }

    /// Starts the cameras that `name` says.
    pub(super) fn open(&self, name: &str, seed: u64, max_skew_ms: Option<f64>) -> anyhow::Result<Opened> {
        let Some(settings) = name.strip_prefix("sim").map(|rest| rest.strip_prefix(':').unwrap_or(rest)) else {
            bail!("{name}: this svl drives no such cameras yet; `svl record --list` shows what there is");
        };
        self.check(max_skew_ms)?;
        listen_for_interrupt();
        let config: SimulatedConfig = settings.parse()?;
        let rate_hz = self.rate_hz()?;
        let period_ns = (1e9 / rate_hz).round() as u64;
        let clock = Clock::real();
        let pictures = Arc::new(Pictures::render(config.size, rate_hz, config.pictures, seed)?);
        let rig = pictures.rig();
        let wire = Wire::new(&clock);
        let camera = |side: Side| -> Box<dyn Camera> {
            let drive = match self.trigger() {
                TriggerChoice::Free => Drive::Free { period_ns },
                _ => Drive::Wire(wire.clone()),
            };
            let temper = config.tempers[side as usize].clone();
            Box::new(SimulatedCamera::new(side, &clock, drive, &pictures, config.light, temper))
        };
        let cameras = Side::BOTH.map(camera);
        let trigger = || -> Box<dyn Trigger> { Box::new(SimulatedTrigger::new(&wire)) };
        let policy = match self.trigger() {
            TriggerChoice::Software => Policy::Coordinated { trigger: trigger(), period_ns },
            TriggerChoice::Serial(device) => {
                let controller = SerialTrigger::open(Path::new(&device), period_ns, &clock)?;
                Policy::Coordinated { trigger: Box::new(Cabled::new(Box::new(controller), &wire)), period_ns }
            }
            TriggerChoice::Fixed(_) => Policy::FixedRate { trigger: trigger(), period_ns },
            TriggerChoice::Free => Policy::Free,
        };
        let grabber = Grabber::start(Setup {
            clock,
            cameras,
            policy,
            rule: self.rule(period_ns, max_skew_ms),
            settings: FIRST,
            // Half a period is left for arming and transfer.
            max_shutter_us: (period_ns / 2_000) as u32,
            balance_every: BALANCE_EVERY,
            timeout: Duration::from_secs_f64(self.timeout.unwrap_or(1.0)),
            queue: self.queue.unwrap_or(QUEUE).into(),
            when_full: match self.when_full {
                Some(FullChoice::Wait) => WhenFull::Wait,
                _ => WhenFull::Drop,
            },
            rig,
        })?;
        let source = LiveSource::new(name, grabber, interrupted);
        let header = Header { seed: Some(seed), ..Header::new(name) };
        let (live, recorded) = (Some(source.tally()), Recorded::default());
        Ok(Opened { live, source: Box::new(source), header, scenario: None, stem: "sim".into(), recorded })
    }

    /// Refuses what contradicts itself.
    fn check(&self, max_skew_ms: Option<f64>) -> anyhow::Result<()> {
        let wrong = match (self.pairing, self.trigger()) {
            (Some(PairingChoice::Trigger), TriggerChoice::Free) => {
                "free-running cameras have no trigger to be paired by; use --pairing stamp"
            }
            (_, TriggerChoice::Fixed(_)) if self.rate.is_some() => {
                "--trigger fixed:HZ says the rate already; leave --rate out"
            }
            _ if max_skew_ms.is_some() && !matches!(self.rule(0, max_skew_ms), Rule::Stamp { .. }) => {
                "--max-skew-ms is for --pairing stamp"
            }
            _ => return Ok(()),
        };
        bail!(clap::Error::raw(ErrorKind::ArgumentConflict, format!("{wrong}\n")))
    }

    fn trigger(&self) -> TriggerChoice {
        self.trigger.clone().unwrap_or(TriggerChoice::Software)
    }

    fn rate_hz(&self) -> anyhow::Result<f64> {
        let hz = match self.trigger() {
            TriggerChoice::Fixed(hz) => hz,
            _ => self.rate.unwrap_or(RATE_HZ),
        };
        if hz > MAX_RATE_HZ {
            bail!("{hz} pairs a second: at most {MAX_RATE_HZ}");
        }
        Ok(hz)
    }

    fn rule(&self, period_ns: u64, max_skew_ms: Option<f64>) -> Rule {
        let max_skew_ns = max_skew_ms.map_or(period_ns / 4, |ms| (ms * 1e6) as u64);
        match (self.pairing, self.trigger()) {
            (Some(PairingChoice::Trigger), _) => Rule::Trigger,
            (Some(PairingChoice::Stamp), _) => Rule::Stamp { max_skew_ns },
            (Some(PairingChoice::Order), _) => Rule::Arrival,
            (None, TriggerChoice::Software | TriggerChoice::Serial(_)) => Rule::Trigger,
            (None, TriggerChoice::Fixed(_) | TriggerChoice::Free) => Rule::Stamp { max_skew_ns },
        }
    }
}
