//! Latencies: the time from the stamp of a pair until its answer arrives, or until the command of a
//! drive takes effect.

use super::{Scenario, ScenarioSource};
use crate::judge::RobotSize;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::str::FromStr;
use svl_core::matcher::{self, Algorithm, MatcherKind, MatcherSpec};
use svl_core::stereo::CellRule;
use svl_core::{Error, Result};

/// `latency_ms` of a scenario's `[drive]` or `[cells]`, milliseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected milliseconds, or a table of them by algorithm, or in [cells] \"measured\""
)]
pub enum Latency {
    /// One latency of all algorithms.
    All(f64),
    /// By an algorithm's label or name; the others have none.
    Each(BTreeMap<String, f64>),
    /// The latencies that were measured; of `[cells]` alone.
    Measured(MeasuredLatency),
}

/// The longest latency, milliseconds.
const MAX_MS: f64 = 10_000.0;

impl Latency {
    /// The latency of a driver, milliseconds: one of all is not that of the ends of the scale,
    /// `truth` and `blind`.
    pub fn ms_for(&self, driver: &Algorithm) -> Option<f64> {
        let spec = driver.spec();
        let is_end = matches!(spec.kind, MatcherKind::Truth | MatcherKind::Blind);
        let is_of_all = matches!(self, Self::All(_));
        self.ms(driver.label(), spec)
            .filter(|_| !is_end || !is_of_all)
    }

    /// The latency of an algorithm, milliseconds. The one of its label comes before that of its
    /// name.
    pub fn ms(&self, label: &str, spec: &MatcherSpec) -> Option<f64> {
        match self {
            Self::Measured(_) => None,
            Self::All(ms) => Some(*ms),
            Self::Each(table) => {
                let by_label = table.get(label).copied();
                by_label.or_else(|| {
                    let mut named = table.iter();
                    named.find_map(|(name, ms)| {
                        spec.names().any(|own| own == name.as_str()).then_some(*ms)
                    })
                })
            }
        }
    }

    /// # Errors
    /// [`Error::Invalid`] for a number out of range, and for a name that is neither an algorithm
    /// nor a label of these.
    pub(super) fn validate(&self, key: &str, algorithms: &[Algorithm]) -> Result<()> {
        let check = |place: &str, ms: f64| match (0.0..=MAX_MS).contains(&ms) {
            true => Ok(()),
            false => Err(Error::Invalid(format!(
                "{key}{place} = {ms} is outside 0 ..= {MAX_MS}"
            ))),
        };
        let table = match self {
            Self::Measured(_) => return Ok(()),
            Self::All(ms) => return check("", *ms),
            Self::Each(table) => table,
        };
        table.iter().try_for_each(|(name, ms)| {
            if algorithms.iter().all(|own| own.label() != name) {
                matcher::find(name).map_err(|error| Error::Invalid(format!("{key}: {error}")))?;
            }
            check(&format!(".{name}"), *ms)
        })
    }
}

/// The word for latencies that were measured: of a topic on the robot, of a matcher its median time
/// here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MeasuredLatency {
    Measured,
}

impl FromStr for Latency {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let ms = text.strip_suffix("ms").and_then(|ms| ms.parse().ok());
        match ms.filter(|ms| (0.0..=MAX_MS).contains(ms)) {
            Some(ms) => Ok(Self::All(ms)),
            None if text == "measured" => Ok(Self::Measured(MeasuredLatency::Measured)),
            None => Err(format!(
                "expected `measured`, or 0 to {MAX_MS} milliseconds, as 80ms"
            )),
        }
    }
}

/// `[cells]` of a scenario.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CellKeys {
    #[serde(flatten)]
    pub rule: CellRule,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency_ms: Option<Latency>,
}

impl Scenario {
    /// Checks that answers can be late, and that a body can drive.
    ///
    /// # Errors
    /// [`Error::Invalid`] for drives and scenes, for a number out of range, and for a name of no
    /// algorithm.
    pub fn check_motion(&self) -> Result<()> {
        let asked = [
            ("cells.latency_ms", self.latency.is_some()),
            ("robot", self.robot.is_some()),
        ];
        let asked = asked.into_iter().find(|(_, is_asked)| *is_asked);
        let why = match self.source {
            ScenarioSource::Drive { .. } => {
                "drives have drive.latency_ms, by which they steer, and their recordings a way"
            }
            _ if self.has_separate_pairs() => "each pair shows another scene: omit it",
            _ => {
                self.robot.iter().try_for_each(RobotSize::validate)?;
                let mut latency = self.latency.iter();
                return latency
                    .try_for_each(|own| own.validate("cells.latency_ms", &self.algorithms));
            }
        };
        asked.map_or(Ok(()), |(key, _)| {
            Err(Error::Invalid(format!("{key}: {why}")))
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::scenario::{Scenario, ScenarioSource};
    use std::path::Path;
    use svl_core::Result;

    const HEAD: &str = "name = \"m\"\nalgorithms = [\"v3\", \"bm\", \"truth\", \"blind\", \
                        \"slow=v3:max_disparity=48\"]\n[source]\nkind = \"drive\"\n[arena]\n\
                        frames = 280\nrate_hz = 4.0\n";

    fn scenario(drive: &str) -> Result<Scenario> {
        Scenario::parse(&format!("{HEAD}{drive}"), Path::new("s.toml"))
    }

    /// The latencies of the algorithms, in their order.
    fn latencies(drive: &str) -> Vec<Option<f64>> {
        let scenario = scenario(drive).unwrap();
        // Written and read again it is the same.
        let again = Scenario::parse(&scenario.to_toml(Path::new("")).unwrap(), Path::new("s"));
        assert_eq!(again.unwrap().source, scenario.source);
        let ScenarioSource::Drive { drive, .. } = &scenario.source else {
            panic!("no drives");
        };
        let latency = |algorithm| drive.latency_ms.as_ref()?.ms_for(algorithm);
        scenario.algorithms.iter().map(latency).collect()
    }

    #[test]
    fn a_latency_is_of_all_but_the_ends_of_the_scale_or_of_those_named() {
        assert_eq!(latencies(""), [None; 5]);
        let all = Some(250.0);
        let of_all = [all, all, None, None, all];
        assert_eq!(latencies("[drive]\nlatency_ms = 250\n"), of_all);
        let table = "[drive.latency_ms]\nv3 = 20\nslow = 400.5\ntruth = 0\n";
        let of_each = [Some(20.0), None, Some(0.0), None, Some(400.5)];
        assert_eq!(latencies(table), of_each);
        // Without its label it has that of its name; another name of the algorithm is as good.
        let table = "[drive.latency_ms]\nv3 = 20\nsvs = 30\n";
        let of_names = [Some(20.0), Some(30.0), None, None, Some(20.0)];
        assert_eq!(latencies(table), of_names);
    }

    #[test]
    fn wrong_latencies_are_named() {
        for (drive, words) in [
            (
                "[drive]\nlatency_ms = -1",
                "drive.latency_ms = -1 is outside 0 ..= 10000",
            ),
            (
                "[drive]\nlatency_ms = nan",
                "drive.latency_ms = NaN is outside",
            ),
            (
                "[drive]\nlatency_ms = inf",
                "drive.latency_ms = inf is outside",
            ),
            (
                "[drive]\nlatency_ms = 1e9",
                "drive.latency_ms = 1000000000 is outside",
            ),
            (
                "[drive]\nlatency_ms = \"20\"",
                "expected milliseconds, or a table of them",
            ),
            (
                "[drive]\nlatency_ms = [20]",
                "expected milliseconds, or a table of them",
            ),
            (
                "[drive.latency_ms]\nv3 = true",
                "expected milliseconds, or a table of them",
            ),
            (
                "[drive.latency_ms]\nv3 = -0.5",
                "drive.latency_ms.v3 = -0.5 is outside",
            ),
            (
                "[drive.latency_ms]\nsmg = 5",
                "drive.latency_ms: unknown algorithm 'smg' (did you mean 'sgm'?)",
            ),
        ] {
            let error = scenario(&format!("{drive}\n")).unwrap_err().to_string();
            assert!(error.starts_with("s.toml: "), "{drive}: {error}");
            assert!(
                error.contains(words) && !error.contains('\n'),
                "{drive}: {error}"
            );
        }
    }
}
