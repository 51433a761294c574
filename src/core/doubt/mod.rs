//! Contradictions: a quantity of a recording, a calibration, a truth or a map that is not what it
//! usually is, with its likely cause.
//!
//! A finder gives numbers. The words of each kind are beside its numbers, in the module of
//! its subject; [`Doubt`] prints them and writes them as JSON.

/// A table of causes: the numbers of each, and its words, which end with the cure.
macro_rules! causes {
    ($(#[$doc:meta])* $name:ident: $(
        $(#[$kind_doc:meta])*
        $kind:ident $({ $($field:ident: $type:ty),* })? => ($($words:tt)+)
    )*) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, thiserror::Error, Serialize, Deserialize)]
        #[serde(tag = "kind", rename_all = "snake_case")]
        pub enum $name { $(
            $(#[$kind_doc])*
            #[error($($words)+)]
            $kind $({ $($field: $type),* })?,
        )* }

        impl $name {
            /// The doubt about `of`, whose quantity `name` has a value that is not usual.
            pub fn doubt(
                self,
                subject: Subject,
                name: &'static str,
                value: f64,
                usual: [f64; 2],
            ) -> Doubt {
                let (name, cure, run) = (name.into(), self.into(), None);
                Doubt { subject, name, value, usual, cure, run }
            }
        }
    };
}

mod calibration;
mod checks;
mod clock;
mod pairs;
mod truth;
mod unit;

pub use calibration::{CalibrationCure, CameraImage, PrincipalPoint};
pub use checks::{CalibrationCheck, check_size};
pub use clock::{ClockCure, ClockLag, ClockStep, CopyCure, LogTimes};
pub use pairs::{AlignmentCure, Misfit, PairCure, Repeated, Turn};
pub use truth::{Baseline, Compared, MapCure, Reading, TruthCure, are_most};
pub use unit::{TruthUnit, UnitCure, UnitOption, rounded, usual, usual_within};

use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt::{self, Display, Formatter};

/// A quantity that contradicts another. Its text is one line: the numbers, the likely cause, and
/// the option that cures it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Doubt {
    /// The thing in doubt.
    #[serde(rename = "of")]
    pub subject: Subject,
    /// Name of the quantity, with its unit at the end: `skew_ms`. Ratios have none.
    pub name: Cow<'static, str>,
    pub value: f64,
    /// Least and greatest usual value.
    pub usual: [f64; 2],
    /// The likely cause, and what cures it.
    pub cure: Cure,
    /// The recording that has it, in a report.
    #[serde(default)]
    pub run: Option<String>,
}

/// The thing in doubt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Subject {
    Calibration,
    Pairs,
    /// The topic of a clock, or of a depth camera.
    Topic(String),
    Truth,
    /// The plane that a recording or an option tells.
    Floor,
    /// The truth and every recorded map agree on nothing: either may be wrong.
    TruthOrMaps,
    /// A map of disparities, by its algorithm.
    Map(String),
    /// A file, by its path.
    File(String),
}

/// A kind of likely cause with its numbers. Its text ends with the cure.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Serialize, Deserialize)]
#[serde(untagged)]
#[error(transparent)]
pub enum Cure {
    Calibration(#[from] CalibrationCure),
    Pairs(#[from] PairCure),
    Clock(#[from] ClockCure),
    Truth(#[from] TruthCure),
    Map(#[from] MapCure),
}

impl Subject {
    /// True for the topic of that name.
    pub fn is_topic(&self, name: &str) -> bool {
        matches!(self, Self::Topic(topic) if topic == name)
    }
}

impl Doubt {
    /// True if the value is not one of the usual ones, as that of a doubt has to be.
    #[doc(hidden)]
    pub fn is_unusual(&self) -> bool {
        !(self.usual[0]..=self.usual[1]).contains(&self.value)
    }

    /// The usual values: `0 to 0.25`.
    pub fn usual_words(&self) -> String {
        let [least, most] = self.usual.map(rounded);
        match self.usual {
            [min, f64::MAX] if min > f64::MIN => format!("{least} or more"),
            [f64::MIN, max] if max < f64::MAX => format!("{most} or less"),
            _ => format!("{least} to {most}"),
        }
    }
}

impl Display for Doubt {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let cure = &self.cure;
        match (&self.subject, cure) {
            (Subject::Truth, Cure::Truth(truth)) if truth.is_refusal() => write!(f, "{cure}"),
            (Subject::Calibration | Subject::Pairs | Subject::Floor, _) => write!(f, "{cure}"),
            (Subject::Topic(name) | Subject::File(name), _) => write!(f, "{name}: {cure}"),
            (Subject::Truth, _) => write!(f, "the truth is doubtful: {cure}"),
            (Subject::TruthOrMaps, _) => write!(
                f,
                "the truth is doubtful: {cure}, or the unit of the recorded map is wrong"
            ),
            (Subject::Map(map), _) => write!(f, "the map of {map} is doubtful: {cure}"),
        }
    }
}

impl std::error::Error for Doubt {}

/// Reads doubts from JSON, without those of which a number is infinite.
///
/// # Errors
/// The errors of the deserializer.
pub fn read_doubts<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Doubt>, D::Error> {
    let values = Vec::<serde_json::Value>::deserialize(deserializer)?;
    let doubts = values.into_iter().map(serde_json::from_value);
    Ok(doubts.filter_map(Result::ok).collect())
}

/// The fields, and the text as `words`; `run` where it is known.
impl Serialize for Doubt {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_struct("Doubt", 7)?;
        fields.serialize_field("of", &self.subject)?;
        fields.serialize_field("name", &self.name)?;
        fields.serialize_field("value", &self.value)?;
        fields.serialize_field("usual", &self.usual)?;
        fields.serialize_field("cure", &self.cure)?;
        fields.serialize_field("words", &self.to_string())?;
        if let Some(run) = &self.run {
            fields.serialize_field("run", run)?;
        }
        fields.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::TruthOrigin;

    fn doubts() -> Vec<Doubt> {
        let lag = ClockLag {
            median_ns: -300_000_000,
            spread_ns: 1_000_000,
        };
        let log = LogTimes::default();
        let topic = || Subject::Topic("/points".to_owned());
        let unit = TruthUnit::Depth(0.5);
        let origin = TruthOrigin::Sensor("/depth".to_owned());
        let reading = Reading {
            px: 4000.0,
            metres: Some(0.01),
        };
        let limit_s = [-0.1, 0.1];
        vec![
            CalibrationCheck::focal(100.0, 500.0).doubt().unwrap(),
            CalibrationCheck::depth_center((0.0, 0.0), (64, 48))
                .doubt()
                .unwrap(),
            PairCure::Skew {
                skew_ms: 30.0,
                limit_ms: 10.0,
            }
            .doubt(Subject::Pairs, "skew_ms", 30.0, [-10.0, 10.0]),
            ClockCure::Offset { lag, log }.doubt(topic(), "clock_lag_s", -0.3, limit_s),
            ClockCure::NoSuchUnit.doubt(topic(), "topics_of_the_unit", 0.0, [1.0, f64::MAX]),
            TruthCure::Impossible {
                origin,
                median: reading,
                near: reading,
                width_px: 640,
                baseline: None,
                unit: None,
            }
            .doubt(Subject::Truth, "disparity_px", 4000.0, [0.0, 640.0]),
            TruthCure::OppositeSign {
                algorithms: vec!["v3".to_owned()],
            }
            .doubt(Subject::TruthOrMaps, "scale", 2.0, [f64::MIN, 1.5]),
            TruthCure::Place {
                ratio: 0.5,
                baselines: 1.0,
                aside_m: None,
            }
            .doubt(Subject::Truth, "differences", 0.5, [0.88, f64::MAX]),
            TruthCure::Moment {
                ratio: 0.5,
                apart_s: 0.2,
            }
            .doubt(Subject::Truth, "differences", 0.5, [0.88, f64::MAX]),
            TruthCure::Floor {
                told_m: 0.5,
                fitted_m: 0.25,
                tilt_deg: 0.3,
                is_level: true,
            }
            .doubt(Subject::Floor, "off_m", 0.25, [0.0, 0.05]),
            MapCure::OppositeSign.doubt(Subject::Map("z".to_owned()), "scale", 2.0, [0.5, 1.5]),
            MapCure::Files { unit }.doubt(Subject::Map("z".to_owned()), "scale", 2.0, [0.5, 1.5]),
        ]
    }

    #[test]
    fn json_of_a_doubt_is_read_back() {
        for doubt in doubts() {
            assert!(doubt.is_unusual(), "{doubt:?}");
            let json = serde_json::to_value(&doubt).unwrap();
            assert_eq!(json["words"], doubt.to_string());
            assert!(json["cure"]["kind"].is_string(), "{json}");
            assert_eq!(serde_json::from_value::<Doubt>(json).unwrap(), doubt);
        }
        // JSON has no infinite numbers: such a doubt is left out, and the others are read.
        let infinite = CalibrationCheck::focal(f64::INFINITY, 500.0)
            .doubt()
            .unwrap();
        let own = doubts().remove(0);
        let json = serde_json::to_value([infinite, own.clone()]).unwrap();
        assert_eq!(read_doubts(json).unwrap(), [own]);
    }

    #[test]
    fn the_thing_in_doubt_is_named() {
        let said: Vec<_> = doubts().iter().map(Doubt::to_string).collect();
        for (place, begin) in [
            (0, "the focal length is 100.0 px in P"),
            (3, "/points: by the log times its clock is 0.300 s ahead of"),
            (5, "the truth (sensor /depth) is impossible"),
            (
                6,
                "the truth is doubtful: its disparities have the opposite sign",
            ),
            (
                7,
                "the truth is doubtful: as depths of the right camera it explains the images",
            ),
            (
                8,
                "the truth is doubtful: it is 0.200 s behind the images: that of later pairs",
            ),
            (9, "the floor is not 0.5 m below the camera by the truth"),
            (10, "the map of z is doubtful: its disparities are negative"),
        ] {
            assert!(said[place].starts_with(begin), "{}", said[place]);
        }
        assert!(said[6].ends_with("or the unit of the recorded map is wrong"));
    }

    #[test]
    fn usual_values_are_printed_as_a_range() {
        let usual: Vec<_> = doubts().iter().map(Doubt::usual_words).collect();
        assert_eq!(
            [&*usual[0], &*usual[4], &*usual[6]],
            ["0.5 to 1.5", "1 or more", "1.5 or less"]
        );
    }
}
