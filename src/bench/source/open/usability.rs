//! The answer to "can svl use this?": pairs, calibration and truth of a source, and what is
//! missing.

use super::facts::{SourceFacts, TruthFacts};
use serde::Serialize;
use std::fmt;
use svl_core::doubt::{Cure, Doubt, PairCure};
use svl_core::{counted, joined};
use svl_recording::PairGeometry;

/// Largest misalignment of pairs that can be used: beyond it, windows of a few rows hardly match.
const MAX_MISALIGNED_PX: f64 = 2.0;

/// The answer for a source. Its text is one line.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Usability {
    /// True if its pairs can be matched: they are rectified, or their calibration rectifies them.
    pub is_usable: bool,
    /// Number of pairs, if it is known without reading all of them.
    pub pairs: Option<u64>,
    /// `None` without a pair, and if nothing in the source tells whether it is rectified.
    pub geometry: Option<PairGeometry>,
    /// Distortion model of the left camera, if its images are distorted.
    pub distortion_model: Option<String>,
    /// True if distances are known.
    pub is_calibrated: bool,
    /// Topics, or patterns of a folder's files, of the truths that score some pixels.
    pub truths: Vec<String>,
    /// Missing parts, each with its cure.
    pub missing: Vec<String>,
    /// Numbers of the calibration and the pairs that cannot be right.
    pub doubts: Vec<Doubt>,
}

impl Usability {
    /// A source without a pair, for that reason.
    pub fn without_pairs(reason: &str) -> Self {
        Self {
            missing: vec![reason.to_owned()],
            ..Self::default()
        }
    }

    /// A source of so many pairs, by the facts of its first ones.
    pub fn from_facts(pairs: Option<u64>, facts: &SourceFacts) -> Self {
        let is_calibrated = facts.rig.is_some();
        let is_rectified = facts.geometry == PairGeometry::Rectified;
        let truths = facts.truths.iter().filter(|truth| truth.has_pixels());
        let truths: Vec<_> = truths.map(|truth| truth.name().to_owned()).collect();
        Self {
            is_usable: (is_rectified || is_calibrated) && !facts.doubts.iter().any(denies_matches),
            pairs,
            geometry: facts.is_geometry_known.then_some(facts.geometry),
            distortion_model: facts.camera.distortion_model.clone(),
            is_calibrated,
            missing: missing(facts, is_rectified, &truths),
            doubts: facts.all_doubts().cloned().collect(),
            truths,
        }
    }
}

/// True for images of different moments, and for rows that do not correspond.
fn denies_matches(doubt: &Doubt) -> bool {
    use PairCure::{Misaligned, Skew, Vertical};
    match doubt.cure {
        Cure::Pairs(Skew { .. }) => true,
        Cure::Pairs(Misaligned { .. } | Vertical { .. }) => doubt.value > MAX_MISALIGNED_PX,
        _ => false,
    }
}

/// The missing parts of a source with pairs, each with its cure.
fn missing(facts: &SourceFacts, is_rectified: bool, truths: &[String]) -> Vec<String> {
    let mut missing = Vec::new();
    if facts.rig.is_none() {
        let what = match &facts.camera.calibration_fault {
            Some(fault) => format!("no calibration ({fault})"),
            None => "no calibration".to_owned(),
        };
        let file = facts.kept_calibration.as_deref().unwrap_or("FILE");
        let cure = format!("add --calib {file}");
        missing.push(if is_rectified {
            format!("{what}, so taken as rectified and without distances: {cure}")
        } else if facts.is_geometry_known {
            format!("{what}: {cure}")
        } else {
            format!("{what}: {cure}, or --calib none if they are rectified")
        });
    }
    let unread = facts.truths.iter().filter(|truth| !truth.has_pixels());
    let unread: Vec<_> = unread.map(TruthFacts::name).collect();
    // Without distances no truth can be used; that is said above.
    if truths.is_empty() && facts.rig.is_some() && !unread.is_empty() {
        let topics = joined(unread);
        missing.push(format!(
            "no pixel of a truth from {topics}: its line says why"
        ));
    }
    missing
}

impl fmt::Display for Usability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.answer(), self.words())
    }
}

impl Usability {
    /// The answer alone.
    pub fn answer(&self) -> &'static str {
        match self.is_usable {
            true => "usable",
            false => "not usable yet",
        }
    }

    /// The parts that are there, and those that are missing, in words.
    pub fn words(&self) -> String {
        let mut parts = Vec::new();
        if self.geometry.is_some() || self.pairs.is_some() {
            parts.push(self.pair_words());
        }
        if self.is_calibrated {
            parts.push("calibrated".to_owned());
        }
        match &self.truths[..] {
            [] if self.is_usable && self.missing.is_empty() => parts.push("no truth".to_owned()),
            [] => {}
            truths => parts.push(format!("truth from {}", joined(truths))),
        }
        parts.extend(self.missing.iter().cloned());
        parts.extend(self.doubts.iter().map(Doubt::to_string));
        parts.join(", ")
    }

    /// Number, geometry and distortion model of its pairs: `120 raw pairs (plumb_bob)`.
    fn pair_words(&self) -> String {
        let geometry = self.geometry.map_or("", PairGeometry::name);
        let kind = [geometry, "pair"];
        let kind = kind.into_iter().filter(|word| !word.is_empty());
        let kind = kind.collect::<Vec<_>>().join(" ");
        let pairs = match self.pairs {
            Some(pairs) => counted(pairs, &kind),
            None => format!("{kind}s"),
        };
        let model = self
            .distortion_model
            .as_ref()
            .filter(|name| !name.is_empty());
        let model = model.map(|model| format!(" ({model})"));
        format!("{pairs}{}", model.unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::doubt::{AlignmentCure, Misfit, Subject};
    use svl_core::stereo::Rig;
    use svl_recording::CameraFacts;
    use svl_score::plausibility::Spread;

    /// Facts of raw pairs with distortion, a rig and one truth.
    fn facts() -> SourceFacts {
        let spread = Spread {
            min: 1.0,
            median: 2.0,
            max: 3.0,
        };
        SourceFacts {
            size_px: (640, 480),
            chain: Vec::new(),
            grey: None,
            pairs: None,
            geometry: PairGeometry::Raw,
            is_geometry_known: true,
            camera: CameraFacts {
                distortion_model: Some("plumb_bob".to_owned()),
                ..CameraFacts::default()
            },
            kept_calibration: None,
            rig: Rig::new(300.0, (320.0, 240.0), 0.1, 0.0).ok(),
            is_constant: true,
            vertical_misalignment: None,
            unrectified_misalignment: None,
            calibration_checks: Vec::new(),
            doubts: Vec::new(),
            nearest: None,
            truths: vec![TruthFacts {
                topic: Some("/velodyne_points".to_owned()),
                disparity_px: Some(spread),
                ..TruthFacts::default()
            }],
        }
    }

    #[track_caller]
    fn says(pairs: Option<u64>, facts: &SourceFacts, expected: &str) {
        assert_eq!(Usability::from_facts(pairs, facts).to_string(), expected);
    }

    #[test]
    fn a_usable_source_names_pairs_calibration_and_truth() {
        let calibrated = "usable: 120 raw pairs (plumb_bob), calibrated";
        let with_truth = format!("{calibrated}, truth from /velodyne_points");
        says(Some(120), &facts(), &with_truth);
        let truths = Vec::new();
        let without_truth = SourceFacts { truths, ..facts() };
        says(
            Some(120),
            &without_truth,
            &format!("{calibrated}, no truth"),
        );
        let rectified = SourceFacts {
            geometry: PairGeometry::Rectified,
            camera: CameraFacts::default(),
            ..without_truth
        };
        says(
            Some(1),
            &rectified,
            "usable: 1 rectified pair, calibrated, no truth",
        );
        says(
            None,
            &rectified,
            "usable: rectified pairs, calibrated, no truth",
        );
        let uncalibrated = SourceFacts {
            rig: None,
            ..rectified
        };
        let cure = "no calibration, so taken as rectified and without distances: add --calib FILE";
        says(
            Some(3),
            &uncalibrated,
            &format!("usable: 3 rectified pairs, {cure}"),
        );
    }

    #[test]
    fn misaligned_pairs_are_doubted_and_beyond_two_pixels_not_usable() {
        let cure = AlignmentCure::Rectify;
        for (px, answer) in [(1.2, "usable: "), (6.0, "not usable yet: ")] {
            let cure = PairCure::Vertical {
                median_abs_px: px,
                median_px: px,
                points: 90,
                pairs: 3,
                misfit: Misfit::Shift,
                cure,
            };
            let mut facts = facts();
            facts.doubts = vec![cure.doubt(Subject::Pairs, "rows_px", px, [0.0, 0.5])];
            let usability = Usability::from_facts(Some(9), &facts);
            let words = usability.to_string();
            assert!(words.starts_with(answer), "{words}");
            let misaligned = format!(
                ", vertical misalignment of {px:.1} px (median of 90 points in 3 pairs; the right \
                 image is {px:.1} px lower), which costs matches: rectify with --calib FILE"
            );
            assert!(words.contains(&misaligned), "{words}");
            let json = serde_json::to_value(&usability).unwrap();
            assert_eq!(json["doubts"][0]["cure"]["cure"]["kind"], "rectify");
        }
    }

    #[test]
    fn a_missing_part_has_its_cure() {
        let mut facts = facts();
        facts.truths[0].error = Some("no transform".to_owned());
        let why = "no pixel of a truth from /velodyne_points: its line says why";
        let expected = format!("usable: 9 raw pairs (plumb_bob), calibrated, {why}");
        says(Some(9), &facts, &expected);
        facts.rig = None;
        facts.camera.calibration_fault = Some("its K has 8 numbers".to_owned());
        let cure = "add --calib FILE";
        let fault = "no calibration (its K has 8 numbers)";
        let expected = format!("not usable yet: 9 raw pairs (plumb_bob), {fault}: {cure}");
        says(Some(9), &facts, &expected);
        (
            facts.camera.calibration_fault,
            facts.camera.distortion_model,
        ) = (None, None);
        facts.is_geometry_known = false;
        let cure = "add --calib FILE, or --calib none if they are rectified";
        says(
            Some(120),
            &facts,
            &format!("not usable yet: 120 pairs, no calibration: {cure}"),
        );
        let ambiguous = Usability::without_pairs("which images are the pair?");
        assert_eq!(
            ambiguous.to_string(),
            "not usable yet: which images are the pair?"
        );
    }
}
