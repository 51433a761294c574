//! What cameras are asked for on the command line: how they are fired, paired and queued.

use super::cameras::{Cameras, RATES_HZ, TriggerChoice, Wanted, has_trigger};
use super::progress::{interrupted, listen_for_interrupt};
use super::rectify::Recorded;
use super::source::Opened;
use super::usage;
use std::time::Duration;
use svl::grab::{Clock, Grabber, Rule, Settings, Setup, WhenFull};
use svl::recording::Header;
use svl::source::LiveSource;

/// What only cameras take.
#[derive(clap::Args)]
#[command(next_help_heading = "Cameras")]
pub(crate) struct LiveArgs {
    /// What fires them: svl when both are armed, the trigger controller at DEVICE then, a fixed
    /// rate, or each itself [default: software; with v4l2 free]
    #[arg(long, value_name = "software|serial:DEVICE|fixed:HZ|free")]
    trigger: Option<TriggerChoice>,
    /// Pairs a second: at most with software and serial, exactly with free [default: 30]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, value_parser = usage::within(RATES_HZ))]
    rate: Option<f64>,
    /// What makes a pair: one trigger pulse, near stamps, or the order of arrival, which shows what
    /// goes wrong without either [default: trigger with software and serial, else stamp; with v4l2
    /// stamp]
    #[arg(long, value_name = "trigger|stamp|order")]
    pairing: Option<PairingChoice>,
    /// Pairs that may wait for the disk [default: 64]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = usage::within(1..=4096u16))]
    queue: Option<u16>,
    /// When so many wait: let the cameras wait too, or drop pairs and count them [default: drop]
    #[arg(long, value_name = "wait|drop")]
    when_full: Option<FullChoice>,
    /// How long a camera may be silent, beyond the period of one that nobody fires; the third time
    /// in a row ends the recording [default: 1]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = usage::within(0.01..=86_400.0))]
    timeout: Option<f64>,
}

const RATE_HZ: f64 = 30.0;
const QUEUE: u16 = 64;
/// What cameras begin with, before the exposure balance has seen anything.
const FIRST: Settings = Settings {
    shutter_us: 4_000,
    gain_mdb: 0,
};
/// Pairs between two looks of the exposure balance.
const BALANCE_EVERY: u32 = 10;

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
    /// Refuses what was given for cameras when there are none.
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

    /// Starts the cameras that `name` says.
    pub(crate) fn open(
        &self,
        name: &str,
        seed: Option<u64>,
        max_skew_ms: Option<f64>,
        quiet: bool,
    ) -> anyhow::Result<Opened> {
        let (kind, settings) = name.split_once(':').unwrap_or((name, ""));
        let trigger = self.trigger(kind);
        self.check(kind, &trigger, max_skew_ms)?;
        listen_for_interrupt();
        let clock = Clock::real();
        let wanted = Wanted {
            rate_hz: self.rate_hz(&trigger),
            trigger,
            clock: clock.clone(),
            seed,
            quiet,
        };
        let Cameras {
            cameras,
            policy,
            period_ns,
            rig,
            seed,
        } = wanted.cameras(kind, settings)?;
        let rule = self.rule(kind, &wanted.trigger, period_ns, max_skew_ms);
        let grabber = Grabber::start(Setup {
            clock,
            cameras,
            policy,
            rule,
            settings: FIRST,
            // Half a period is left for arming and transfer.
            max_shutter_us: (period_ns / 2_000).min(u32::MAX.into()) as u32,
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
        let header = Header {
            seed,
            ..Header::new(name)
        };
        Ok(Opened {
            is_live: true,
            source: Box::new(source),
            header,
            scenario: None,
            stem: kind.into(),
            recorded: Recorded::default(),
        })
    }

    /// Refuses what contradicts itself.
    fn check(
        &self,
        kind: &str,
        trigger: &TriggerChoice,
        max_skew_ms: Option<f64>,
    ) -> anyhow::Result<()> {
        let wrong = match (self.pairing, trigger) {
            (_, TriggerChoice::Software | TriggerChoice::Fixed(_)) if !has_trigger(kind) => {
                "V4L2 has no way to fire a camera; leave --trigger out, or use serial:DEVICE if a \
                 controller fires both"
            }
            (Some(PairingChoice::Trigger), TriggerChoice::Free) => {
                "free-running cameras have no trigger to be paired by; use --pairing stamp"
            }
            (Some(PairingChoice::Trigger), _) if !has_trigger(kind) => {
                "V4L2 cameras do not say which pulse an image is of; use --pairing stamp"
            }
            (_, TriggerChoice::Fixed(_)) if self.rate.is_some() => {
                "--trigger fixed:HZ says the rate already; leave --rate out"
            }
            _ if max_skew_ms.is_some()
                && !matches!(self.rule(kind, trigger, 0, max_skew_ms), Rule::Stamp { .. }) =>
            {
                "--max-skew-ms is for --pairing stamp"
            }
            _ => return Ok(()),
        };
        Err(usage::wrong(wrong))
    }

    fn trigger(&self, kind: &str) -> TriggerChoice {
        let usual = if has_trigger(kind) {
            TriggerChoice::Software
        } else {
            TriggerChoice::Free
        };
        self.trigger.clone().unwrap_or(usual)
    }

    fn rate_hz(&self, trigger: &TriggerChoice) -> f64 {
        match trigger {
            TriggerChoice::Fixed(hz) => *hz,
            _ => self.rate.unwrap_or(RATE_HZ),
        }
    }

    fn rule(
        &self,
        kind: &str,
        trigger: &TriggerChoice,
        period_ns: u64,
        max_skew_ms: Option<f64>,
    ) -> Rule {
        let usual_ns = match trigger {
            // Nobody chose the moments at which free cameras began: any are to make pairs.
            TriggerChoice::Free => period_ns / 2,
            _ => period_ns / 4,
        };
        let max_skew_ns = max_skew_ms.map_or(usual_ns, |ms| (ms * 1e6) as u64);
        match (self.pairing, trigger) {
            (Some(PairingChoice::Trigger), _) => Rule::Trigger,
            (Some(PairingChoice::Stamp), _) => Rule::Stamp {
                max_skew_ns,
                period_ns,
            },
            (Some(PairingChoice::Order), _) => Rule::Arrival,
            (None, TriggerChoice::Software | TriggerChoice::Serial(_)) if has_trigger(kind) => {
                Rule::Trigger
            }
            (None, _) => Rule::Stamp {
                max_skew_ns,
                period_ns,
            },
        }
    }
}
