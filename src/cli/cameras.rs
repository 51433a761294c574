//! Which cameras there are: from what a user names to two of them and what fires them.

use anyhow::bail;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;
use svl::grab::simulated::{Cabled, Drive, Pictures, SimulatedCamera, SimulatedConfig, SimulatedTrigger, Wire};
use svl::grab::{Camera, Clock, Policy, SerialTrigger, Side, Trigger};
use svl::stereo::Rig;

/// Whether a name is of cameras.
pub(super) fn is_live(name: &str) -> bool {
    ["sim", "v4l2", "genicam"].contains(&name.split(':').next().unwrap_or_default())
}

/// What is to fire them.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TriggerChoice {
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

/// Two cameras, left and right, and when they expose.
pub(super) struct Cameras {
    pub cameras: [Box<dyn Camera>; 2],
    pub policy: Policy,
    pub rig: Option<Rig>,
    /// What their images were drawn from, when they are simulated.
    pub seed: Option<u64>,
}

/// What all kinds of cameras are asked for.
pub(super) struct Wanted {
    pub trigger: TriggerChoice,
    pub rate_hz: f64,
    pub clock: Arc<Clock>,
    pub seed: Option<u64>,
}

impl Wanted {
    pub(super) fn period_ns(&self) -> u64 {
        (1e9 / self.rate_hz).round() as u64
    }

    /// The cameras of a kind: what stands before the colon of a source's name, and after it.
    pub(super) fn cameras(&self, kind: &str, settings: &str) -> anyhow::Result<Cameras> {
        match kind {
            "sim" => self.simulated(settings),
            _ if self.seed.is_some() => bail!("{kind}:{settings}: only the arena and simulated cameras take a --seed"),
            _ => {
                bail!("{kind}:{settings}: this svl drives no such cameras yet; `svl record --list` shows what there is")
            }
        }
    }

    fn simulated(&self, settings: &str) -> anyhow::Result<Cameras> {
        let config: SimulatedConfig = settings.parse()?;
        let seed = self.seed.unwrap_or(1);
        let pictures = Arc::new(match config.board {
            true => Pictures::of_board(config.size, seed)?,
            false => Pictures::render(config.size, self.rate_hz, config.pictures, seed)?,
        });
        let wire = Wire::new(&self.clock);
        let camera = |side: Side| -> Box<dyn Camera> {
            let drive = match self.trigger {
                TriggerChoice::Free => Drive::Free { period_ns: self.period_ns() },
                _ => Drive::Wire(wire.clone()),
            };
            let temper = config.tempers[side as usize].clone();
            Box::new(SimulatedCamera::new(side, &self.clock, drive, &pictures, config.light, temper))
        };
        let software = Box::new(SimulatedTrigger::new(&wire));
        let policy = self.policy(software, |controller| Box::new(Cabled::new(controller, &wire)))?;
        Ok(Cameras { cameras: Side::BOTH.map(camera), policy, rig: pictures.rig(), seed: Some(seed) })
    }

    /// When the cameras expose: `software` is svl's own way to fire them, `cabled` what the trigger controller's pulses
    /// take to reach them.
    fn policy(
        &self,
        software: Box<dyn Trigger>,
        cabled: impl FnOnce(Box<dyn Trigger>) -> Box<dyn Trigger>,
    ) -> anyhow::Result<Policy> {
        let period_ns = self.period_ns();
        Ok(match &self.trigger {
            TriggerChoice::Software => Policy::Coordinated { trigger: software, period_ns },
            TriggerChoice::Serial(device) => {
                let controller = Box::new(SerialTrigger::open(Path::new(device), period_ns, &self.clock)?);
                Policy::Coordinated { trigger: cabled(controller), period_ns }
            }
            TriggerChoice::Fixed(_) => Policy::FixedRate { trigger: software, period_ns },
            TriggerChoice::Free => Policy::Free,
        })
    }
}
