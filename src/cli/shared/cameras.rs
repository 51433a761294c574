//! Which cameras there are: from what a user names to two of them and what fires them.

use super::progress::{Progress, interrupted};
use super::usage;
use anyhow::bail;
use std::ops::RangeInclusive;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;
use svl::grab::simulated::{
    Cabled, Drive, Pictures, SimulatedCamera, SimulatedConfig, SimulatedTrigger, Wire,
};
use svl::grab::{Camera, Clock, Policy, SerialTrigger, Side, Trigger};
use svl::stereo::Rig;

/// Whether a name is of cameras.
pub(crate) fn is_live(name: &str) -> bool {
    ["sim", "v4l2", "genicam"].contains(&name.split(':').next().unwrap_or_default())
}

/// Whether svl can fire cameras of a kind, and then knows which pulse an image is of.
pub(crate) fn has_trigger(kind: &str) -> bool {
    kind != "v4l2"
}

/// Pairs a second that cameras can be asked for.
pub(crate) const RATES_HZ: RangeInclusive<f64> = 0.1..=1000.0;

/// What is to fire them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TriggerChoice {
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
            Some(("fixed", hz)) => usage::within(RATES_HZ)(hz)
                .map(Self::Fixed)
                .map_err(|why| format!("fixed:HZ: {why}")),
            _ => Err("expected software, serial:DEVICE, fixed:HZ or free".to_owned()),
        }
    }
}

/// Two cameras, left and right, and when they expose.
pub(crate) struct Cameras {
    pub cameras: [Box<dyn Camera>; 2],
    pub policy: Policy,
    /// From one image of a camera to its next, at least.
    pub period_ns: u64,
    pub rig: Option<Rig>,
    /// What their images were drawn from, when they are simulated.
    pub seed: Option<u64>,
}

/// What all kinds of cameras are asked for.
pub(crate) struct Wanted {
    pub trigger: TriggerChoice,
    pub rate_hz: f64,
    pub clock: Arc<Clock>,
    pub seed: Option<u64>,
    /// Without a progress bar, where it takes long until they are ready.
    pub quiet: bool,
}

impl Wanted {
    pub(crate) fn period_ns(&self) -> u64 {
        (1e9 / self.rate_hz).round() as u64
    }

    /// The cameras of a kind: what stands before the colon of a source's name, and after it.
    pub(crate) fn cameras(&self, kind: &str, settings: &str) -> anyhow::Result<Cameras> {
        match kind {
            "sim" => self.simulated(settings),
            _ if self.seed.is_some() => Err(usage::wrong(format!(
                "{kind}:{settings}: only the arena, the board and simulated cameras take a --seed"
            ))),
            "genicam" => self.genicam(settings),
            _ => self.v4l2(settings),
        }
    }

    fn simulated(&self, settings: &str) -> anyhow::Result<Cameras> {
        let config: SimulatedConfig = settings.parse().map_err(usage::of_words)?;
        let seed = self.seed.unwrap_or(1);
        let count = (!config.board).then_some(config.pictures as u64);
        let progress = Progress::new("rendering", count, self.quiet);
        let pictures = match config.board {
            true => Pictures::of_board(config.size, seed, || progress.step()),
            false => Pictures::render(config.size, self.rate_hz, config.pictures, seed, || {
                progress.step()
            }),
        };
        progress.clear();
        let pictures = pictures.map_err(usage::of_words)?;
        let Some(pictures) = pictures.map(Arc::new) else {
            bail!("stopped by Ctrl-C before the cameras began")
        };
        let wire = Wire::new(&self.clock);
        let camera = |side: Side| -> Box<dyn Camera> {
            let drive = match self.trigger {
                TriggerChoice::Free => Drive::Free {
                    period_ns: self.period_ns(),
                },
                _ => Drive::Wire(wire.clone()),
            };
            let temper = config.tempers[side as usize].clone();
            Box::new(SimulatedCamera::new(
                side,
                &self.clock,
                drive,
                &pictures,
                config.light,
                temper,
            ))
        };
        let software = Box::new(SimulatedTrigger::new(&wire));
        let policy = self.policy(software, |controller| {
            Box::new(Cabled::new(controller, &wire))
        })?;
        let period_ns = self.period_ns();
        Ok(Cameras {
            cameras: Side::BOTH.map(camera),
            policy,
            period_ns,
            rig: pictures.rig(),
            seed: Some(seed),
        })
    }

    #[cfg(all(feature = "v4l2", target_os = "linux"))]
    fn v4l2(&self, settings: &str) -> anyhow::Result<Cameras> {
        let config = settings.parse().map_err(usage::of_words)?;
        let controller = match &self.trigger {
            TriggerChoice::Serial(device) => Some(self.controller(device)?),
            _ => None,
        };
        let is_fired = controller.is_some();
        let (cameras, rate_hz) =
            svl::grab::v4l2::open(&config, self.rate_hz, is_fired, &self.clock)?;
        let period_ns = if is_fired {
            self.period_ns()
        } else {
            (1e9 / rate_hz).round() as u64
        };
        let policy = match controller {
            Some(controller) => Policy::Coordinated {
                trigger: Box::new(controller),
                period_ns,
            },
            None => Policy::Free { period_ns },
        };
        Ok(Cameras {
            cameras,
            policy,
            period_ns,
            rig: None,
            seed: None,
        })
    }

    #[cfg(not(all(feature = "v4l2", target_os = "linux")))]
    fn v4l2(&self, settings: &str) -> anyhow::Result<Cameras> {
        bail!(
            "v4l2:{settings}: this svl was built without V4L2 cameras; on Linux, cargo install \
             --path . --features v4l2"
        )
    }

    #[cfg(feature = "genicam")]
    fn genicam(&self, names: &str) -> anyhow::Result<Cameras> {
        use svl::grab::genicam::{Drive, SoftwareTrigger, open};
        let drive = match self.trigger {
            TriggerChoice::Software | TriggerChoice::Fixed(_) => Drive::Software,
            TriggerChoice::Serial(_) => Drive::Line,
            TriggerChoice::Free => Drive::Free {
                rate_hz: self.rate_hz,
            },
        };
        let Some((left, right)) = two_names(names) else {
            let cure = "`svl record --list` shows what there is";
            return Err(usage::wrong(format!(
                "genicam: expected two cameras, genicam:LEFT,RIGHT, not '{names}'; {cure}"
            )));
        };
        let cameras = open([left, right], drive, &self.clock)?;
        let policy = self.policy(
            Box::new(SoftwareTrigger::new(&cameras, &self.clock)),
            |controller| controller,
        )?;
        Ok(Cameras {
            cameras: cameras.map(|camera| Box::new(camera) as Box<dyn Camera>),
            policy,
            period_ns: self.period_ns(),
            rig: None,
            seed: None,
        })
    }

    #[cfg(not(feature = "genicam"))]
    fn genicam(&self, names: &str) -> anyhow::Result<Cameras> {
        bail!(
            "genicam:{names}: this svl was built without GenICam cameras; with aravis installed \
             (Debian: libaravis-dev, libusb-1.0-0-dev), cargo install --path . --features genicam"
        )
    }

    fn controller(&self, device: &str) -> anyhow::Result<SerialTrigger> {
        Ok(SerialTrigger::open(
            Path::new(device),
            self.period_ns(),
            &self.clock,
            interrupted,
        )?)
    }

    /// When the cameras expose: `software` is svl's own way to fire them, `cabled` what the trigger
    /// controller's pulses take to reach them.
    fn policy(
        &self,
        software: Box<dyn Trigger>,
        cabled: impl FnOnce(Box<dyn Trigger>) -> Box<dyn Trigger>,
    ) -> anyhow::Result<Policy> {
        let period_ns = self.period_ns();
        Ok(match &self.trigger {
            TriggerChoice::Software => Policy::Coordinated {
                trigger: software,
                period_ns,
            },
            TriggerChoice::Serial(device) => {
                let controller = Box::new(self.controller(device)?);
                Policy::Coordinated {
                    trigger: cabled(controller),
                    period_ns,
                }
            }
            TriggerChoice::Fixed(_) => Policy::FixedRate {
                trigger: software,
                period_ns,
            },
            TriggerChoice::Free => Policy::Free { period_ns },
        })
    }
}

/// Left and right at the comma in the middle: a vendor's name, which begins an id, may have commas
/// of its own.
#[cfg(any(test, feature = "genicam"))]
fn two_names(names: &str) -> Option<(&str, &str)> {
    let commas: Vec<_> = names.match_indices(',').map(|(at, _)| at).collect();
    let middle = *commas
        .get(commas.len() / 2)
        .filter(|_| commas.len() % 2 == 1)?;
    let (left, right) = (names[..middle].trim(), names[middle + 1..].trim());
    (!left.is_empty() && !right.is_empty() && left != right).then_some((left, right))
}

#[cfg(test)]
mod tests {
    use super::two_names;

    #[test]
    fn two_cameras_are_named() {
        assert_eq!(
            two_names("192.168.0.2, 192.168.0.3"),
            Some(("192.168.0.2", "192.168.0.3"))
        );
        let ids = "Eyes, Inc.-E1-7,Eyes, Inc.-E1-8";
        assert_eq!(two_names(ids), Some(("Eyes, Inc.-E1-7", "Eyes, Inc.-E1-8")));
        for wrong in ["", "a", "a,", ",b", " , ", "a,b,c", "a,a"] {
            assert_eq!(two_names(wrong), None, "{wrong}");
        }
    }
}
