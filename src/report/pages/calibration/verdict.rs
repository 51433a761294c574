//! The verdict on a calibration, by limits of three numbers.

use serde::Serialize;
use svl_calibrate::Solution;

/// The advice for a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum CalibrationGrade {
    Good,
    Acceptable,
    Repeat,
}

/// The grade of a calibration, and the numbers that decide it.
#[derive(Serialize)]
pub(crate) struct CalibrationVerdict {
    pub grade: CalibrationGrade,
    /// The numbers with their limits: all of a good calibration, else those that are not better.
    reasons: Vec<String>,
    /// The advice that improves them.
    cures: Vec<&'static str>,
}

/// The limits of a number.
struct GradeRule {
    name: &'static str,
    unit: &'static str,
    digits: usize,
    value: fn(&Solution) -> f64,
    /// Limits of a good and of an acceptable calibration: upper ones, except of a coverage.
    limits: [f64; 2],
    is_more_better: bool,
    cure: &'static str,
}

/// A misalignment of half a pixel is what `svl replay` warns about; corners of a sharp board are
/// found within a fifth of a pixel; outside the boards the distortion is extrapolated.
const RULES: [GradeRule; 3] = [
    GradeRule {
        name: "mean |Δy|",
        unit: "px",
        digits: 2,
        value: |solution| solution.epipolar.mean_px,
        limits: [0.25, 0.5],
        is_more_better: false,
        cure: "fix both cameras to each other, and let them expose at the same time",
    },
    GradeRule {
        name: "RMS",
        unit: "px",
        digits: 2,
        value: |solution| solution.rms_px,
        limits: [0.5, 1.0],
        is_more_better: false,
        cure: "hold a flat board still in a good light, or try another --model",
    },
    GradeRule {
        name: "coverage",
        unit: "%",
        digits: 0,
        value: |solution| 100.0 * solution.left.coverage.min(solution.right.coverage),
        limits: [60.0, 40.0],
        is_more_better: true,
        cure: "move the board to the edges of both images",
    },
];

impl GradeRule {
    fn grade(&self, solution: &Solution) -> CalibrationGrade {
        let value = (self.value)(solution);
        let is_within = |limit: f64| {
            if self.is_more_better {
                value >= limit
            } else {
                value <= limit
            }
        };
        match self.limits.map(is_within) {
            [true, _] => CalibrationGrade::Good,
            [_, true] => CalibrationGrade::Acceptable,
            _ => CalibrationGrade::Repeat,
        }
    }

    /// The number, with its limit for a grade, or for the next better one.
    fn words(&self, solution: &Solution, grade: CalibrationGrade) -> String {
        let Self {
            name, unit, digits, ..
        } = self;
        let value = (self.value)(solution);
        let side = if self.is_more_better {
            "at least"
        } else {
            "at most"
        };
        let (wanted, limit) = match grade {
            CalibrationGrade::Good => ("", self.limits[0]),
            CalibrationGrade::Acceptable => ("good: ", self.limits[0]),
            CalibrationGrade::Repeat => ("acceptable: ", self.limits[1]),
        };
        format!("{name} {value:.digits$} {unit} ({wanted}{side} {limit})")
    }
}

impl CalibrationGrade {
    fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Acceptable => "acceptable",
            Self::Repeat => "repeat",
        }
    }
}

impl CalibrationVerdict {
    pub(crate) fn new(solution: &Solution) -> Self {
        let grades = RULES.iter().map(|rule| (rule.grade(solution), rule));
        let grade = grades.clone().map(|(grade, _)| grade).max();
        let grade = grade.unwrap_or(CalibrationGrade::Good);
        let deciding = grades.filter(|(own, _)| *own == grade);
        let deciding: Vec<_> = deciding.map(|(_, rule)| rule).collect();
        let cures = deciding.iter().map(|rule| rule.cure);
        Self {
            grade,
            reasons: (deciding.iter())
                .map(|rule| rule.words(solution, grade))
                .collect(),
            cures: cures.filter(|_| grade != CalibrationGrade::Good).collect(),
        }
    }

    /// The grade with its reasons.
    pub(crate) fn words(&self) -> String {
        let reasons = self.reasons.join(", ");
        match self.cures[..] {
            [] => format!("{}; {reasons}", self.grade.name()),
            _ => format!(
                "{}; {reasons}; {}",
                self.grade.name(),
                self.cures.join("; ")
            ),
        }
    }
}
