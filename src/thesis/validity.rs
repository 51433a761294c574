//! Figures 5.8 and 5.9: the self check compared with the symmetric check in front of a close
//! object.

use super::checks::Correlated;
use super::measure::{MeanMedian, gray_picture, percent, right, ssdpi_picture, valid};
use super::{Context, Experiment, Finding, TableValue, stage};
use svl_core::Result;
use svl_core::stereo::{DisparityMap, Frame};
use svl_report::plot::{Axis, Chart, Series, SeriesStyle};
use svl_sim::arena::ArenaConfig;

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["5.9", "5.8"],
    place: "Figure 5.9",
    title: "Self check against symmetric check",
    claim: "In front of a close object, the symmetric check drops 55 % of all matches and the \
            self check 35 %. The mean and median SSDPI are comparable (section 5.3.3).",
    method: "The close object is a block turned by 35° with a ball beside it, 0.2 m in front of \
             the arena's stereo head (the thesis held a hand there), with a forest wall 1.5 m \
             away. Both checks get the same matches, v3's. The symmetric check allows the right \
             image's disparity to be 1 px off, as in v1. To the letter of the thesis both \
             disparities are equal, and right pixels that the texture filter drops are not \
             matched back. SSDPI is ln(SSDPI + 1) of what each check keeps; comparable means \
             within 0.5, a factor of 1.65. The truth says which matches are right, within 2 px; \
             the thesis could not know.",
    records: false,
    run,
};

/// Distance of the close object.
const CLOSE_M: f64 = 0.2;
/// Distances of the approach, the farthest first.
const APPROACH_M: [f64; 7] = [1.0, 0.7, 0.5, 0.4, 0.3, 0.25, 0.2];
/// Other interpretations of the symmetric check: equal disparities; right pixels matched back only
/// if they are textured; both, which is the thesis to the letter.
const VARIANTS: [&str; 3] = [
    "symmetric check, 0 px",
    "symmetric check, texture on both sides",
    "symmetric check to the letter",
];
const LETTER: usize = 2;
/// Difference of ln SSDPIs that counts as comparable.
const MAX_COMPARABLE_DIFFERENCE: f64 = 0.5;

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let mut finding = Finding::default();
    let frame = context.still(&close_object(CLOSE_M))?;
    let close = Checked::new(&frame)?;
    let dropped = close.comparison.dropped();
    finding.quantity("matches that the self check drops", "%", "35", dropped[0]);
    finding.quantity(
        "matches that the symmetric check drops, as in v1",
        "%",
        "55",
        dropped[1],
    );
    finding.quantity(
        "matches that it drops, to the letter",
        "%",
        "55",
        dropped[2],
    );
    conditions("Before the close object", &close.comparison, &mut finding);
    let mut why = format!("Before the close object {}", close.comparison.words());
    let mut rows = close.comparison.rows("close object");
    let approach = approach(context, &mut finding)?;

    let (real, shares) = real_scenes(context)?;
    if real.matches > 0 {
        conditions("In the real scenes", &real, &mut finding);
        why += &format!("; in the real scenes {}", real.words());
        rows.extend(real.rows("real scenes"));
    }
    finding.why = why + ".";
    let table = finding.table([
        "view, check",
        "matches dropped, %",
        "mean ln SSDPI of the rest",
        "median ln SSDPI of the rest",
        "right matches dropped, %",
        "wrong among the rest, %",
    ]);
    rows.into_iter()
        .for_each(|(name, values)| table.row(name, values));
    finding.plot(&approach);
    finding.plot(&both_checks(shares, dropped));
    finding.show(gray_picture("the left image", frame.pair.left())?);
    for (what, map) in [
        ("all matches", &close.matches),
        ("what the self check keeps", &close.own),
        ("what the symmetric check keeps", &close.symmetric),
    ] {
        finding.show(ssdpi_picture(format!("ln SSDPI of {what}"), map)?);
    }
    Ok(finding)
}

/// The real scenes, pooled: each match counts once, regardless of the size of its scene; and the
/// fractions that each drops.
fn real_scenes(context: &mut Context<'_>) -> Result<(CheckComparison, Vec<[f64; 3]>)> {
    let mut real = CheckComparison::default();
    let mut shares = Vec::new();
    for frame in context.real() {
        let frame = frame?;
        context.step()?;
        let scene = Checked::new(&frame)?.comparison;
        shares.push(scene.dropped());
        real.add(scene);
    }
    Ok((real, shares))
}

/// A block rotated by 35°, a ball next to it and a wall behind.
fn close_object(ahead_m: f64) -> ArenaConfig {
    let mut config = stage::empty();
    config.world.blocks = vec![
        stage::block(ahead_m, 0.03, [0.12, 0.08, 0.14], 35.0),
        stage::block(1.5, 0.0, [3.0, 0.1, 0.8], 0.0),
    ];
    config.world.balls = vec![stage::ball(ahead_m + 0.02, -0.06, 0.035)];
    config
}

/// Matches dropped by the checks as the object approaches.
fn approach(context: &mut Context<'_>, finding: &mut Finding) -> Result<Chart> {
    let mut dropped = Vec::new();
    for ahead_m in APPROACH_M {
        let frame = context.still(&close_object(ahead_m))?;
        dropped.push((ahead_m, Checked::new(&frame)?.comparison.dropped()));
    }
    // The approach is not empty.
    if let (Some((far_m, far)), Some((near_m, near))) = (dropped.first(), dropped.last()) {
        finding.condition(
            near[2] > far[2],
            format!(
                "The nearer the object, the more the symmetric check drops, to the letter: {:.1} \
                 % at {far_m} m and {:.1} % at {near_m} m.",
                far[2], near[2]
            ),
        );
    }
    let curve = |name: &str, check: usize| {
        let points = dropped
            .iter()
            .map(|(ahead_m, dropped)| (*ahead_m, dropped[check]));
        Series::new(name, SeriesStyle::Both, points)
    };
    Ok(Chart {
        title: "The same object from far to near".into(),
        x: Axis::new("distance of the object, m"),
        y: Axis::new("matches dropped, %").with_range(0.0, 80.0),
        series: vec![
            curve("self check", 0),
            curve("symmetric check, as in v1", 1),
            curve("symmetric check, to the letter", 2),
        ],
    })
}

/// Each view by the matches that the two checks drop.
fn both_checks(real: Vec<[f64; 3]>, close: [f64; 3]) -> Chart {
    let points =
        |name: &str, points: Vec<(f64, f64)>| Series::new(name, SeriesStyle::Points, points);
    let real = |check: usize| {
        real.iter()
            .map(|dropped| (dropped[check], dropped[0]))
            .collect()
    };
    Chart {
        title: "What both checks drop".into(),
        x: Axis::new("dropped by the symmetric check, %").with_range(0.0, 80.0),
        y: Axis::new("dropped by the self check, %").with_range(0.0, 80.0),
        series: vec![
            points("real scenes, as in v1", real(1)),
            points("real scenes, to the letter", real(2)),
            points("close object, as in v1", vec![(close[1], close[0])]),
            points("close object, to the letter", vec![(close[2], close[0])]),
            points("close object, thesis", vec![(55.0, 35.0)]),
            Series::new("as much", SeriesStyle::Line, [(0.0, 0.0), (80.0, 80.0)]),
        ],
    }
}

struct Checked {
    matches: DisparityMap,
    own: DisparityMap,
    symmetric: DisparityMap,
    comparison: CheckComparison,
}

impl Checked {
    fn new(frame: &Frame) -> Result<Self> {
        let correlated = Correlated::new(&frame.pair)?;
        // v1 tolerates a pixel of difference.
        let (own, symmetric) = (correlated.self_checked(), correlated.symmetric(1));
        let kept = |map: &DisparityMap| {
            let judged: Vec<bool> = frame
                .truth
                .iter()
                .flat_map(|truth| valid(map).filter_map(|v| right(truth, &v)))
                .collect();
            KeptMatches {
                matches: map.valid(),
                known: judged.len(),
                good: judged.iter().filter(|right| **right).count(),
                // Stored one by one, as the median of pooled scenes does not follow from the
                // scenes' medians.
                ln_ssdpi: valid(map).map(|v| v.ln_ssdpi).collect(),
            }
        };
        let comparison = CheckComparison {
            matches: correlated.matches.valid(),
            good: kept(&correlated.matches).good,
            own: kept(&own),
            symmetric: kept(&symmetric),
            variants: [
                kept(&correlated.symmetric(0)),
                kept(&correlated.symmetric_on_texture(1)),
                kept(&correlated.symmetric_on_texture(0)),
            ],
        };
        Ok(Self {
            matches: correlated.matches,
            own,
            symmetric,
            comparison,
        })
    }
}

/// The two checks on the same matches.
#[derive(Clone, Debug, Default)]
struct CheckComparison {
    matches: usize,
    /// Matches that are right.
    good: usize,
    own: KeptMatches,
    symmetric: KeptMatches,
    /// By other interpretations of the symmetric check: see [`VARIANTS`].
    variants: [KeptMatches; 3],
}

/// Matches kept by a check.
#[derive(Clone, Debug, Default)]
struct KeptMatches {
    matches: usize,
    /// Matches whose truth is known.
    known: usize,
    /// Matches that are right.
    good: usize,
    ln_ssdpi: Vec<f64>,
}

impl KeptMatches {
    fn spread(&self) -> Option<MeanMedian> {
        MeanMedian::from_values(self.ln_ssdpi.iter().copied())
    }

    fn wrong_percent(&self) -> Option<f64> {
        percent(self.known - self.good, self.known)
    }

    fn add(&mut self, other: Self) {
        self.matches += other.matches;
        self.known += other.known;
        self.good += other.good;
        self.ln_ssdpi.extend(other.ln_ssdpi);
    }
}

impl CheckComparison {
    fn add(&mut self, other: Self) {
        self.matches += other.matches;
        self.good += other.good;
        self.variants
            .iter_mut()
            .zip(other.variants)
            .for_each(|(sum, other)| sum.add(other));
        self.own.add(other.own);
        self.symmetric.add(other.symmetric);
    }

    /// Fractions of the matches dropped by the self check, and by the symmetric check as in v1 and
    /// to the letter, per cent.
    fn dropped(&self) -> [f64; 3] {
        [&self.own, &self.symmetric, &self.variants[LETTER]]
            .map(|kept| percent(self.matches - kept.matches, self.matches).unwrap_or(f64::NAN))
    }

    /// Medians of ln SSDPI of the matches that the two keep.
    fn medians(&self) -> [f64; 2] {
        [&self.own, &self.symmetric].map(|kept| kept.spread().map_or(f64::NAN, |s| s.median))
    }

    fn words(&self) -> String {
        let [own, symmetric, letter] = self.dropped();
        let wrong = [&self.own, &self.symmetric, &self.variants[LETTER]];
        let wrong = wrong.map(|kept| kept.wrong_percent().unwrap_or(f64::NAN));
        format!(
            "the self check drops {own:.0} % of the matches, the symmetric check {symmetric:.0} % \
             as in v1 and {letter:.0} % to the letter; of the rest {:.0} %, {:.0} % and {:.0} \
             % are wrong",
            wrong[0], wrong[1], wrong[2]
        )
    }

    /// A line per check: matches dropped, mean and median of the rest, right ones dropped, wrong
    /// ones kept.
    fn rows(&self, place: &str) -> Vec<(String, [TableValue; 5])> {
        let line = |(name, kept): (&str, &KeptMatches)| {
            let spread = kept.spread();
            let values = [
                percent(self.matches - kept.matches, self.matches),
                spread.map(|s| s.mean),
                spread.map(|s| s.median),
                percent(self.good - kept.good, self.good),
                kept.wrong_percent(),
            ];
            (format!("{place}, {name}"), values.map(TableValue::from))
        };
        let checks = [
            ("self check", &self.own),
            ("symmetric check", &self.symmetric),
        ];
        checks
            .into_iter()
            .chain(VARIANTS.into_iter().zip(&self.variants))
            .map(line)
            .collect()
    }
}

fn conditions(place: &str, comparison: &CheckComparison, finding: &mut Finding) {
    let ([own, symmetric, letter], medians) = (comparison.dropped(), comparison.medians());
    for (check, dropped) in [("as in v1", symmetric), ("to the letter", letter)] {
        finding.condition(
            own < dropped,
            format!(
                "{place} the self check drops fewer matches than the symmetric check {check}: \
                 {own:.1} % and {dropped:.1} %."
            ),
        );
    }
    finding.condition(
        (medians[0] - medians[1]).abs() <= MAX_COMPARABLE_DIFFERENCE,
        format!(
            "{place} the median ln SSDPIs of what they keep are within \
             {MAX_COMPARABLE_DIFFERENCE}: {:.2} and {:.2}.",
            medians[0], medians[1]
        ),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClaimVerdict;

    fn comparison(own: usize, symmetric: usize, letter: usize, ssdpi: [f64; 2]) -> CheckComparison {
        let kept = |matches: usize, ln_ssdpi: f64| KeptMatches {
            matches,
            known: matches,
            good: matches,
            ln_ssdpi: vec![ln_ssdpi],
        };
        CheckComparison {
            matches: 100,
            good: 80,
            own: kept(own, ssdpi[0]),
            symmetric: kept(symmetric, ssdpi[1]),
            variants: std::array::from_fn(|_| kept(letter, 6.0)),
        }
    }

    #[test]
    fn the_thesis_s_numbers_hold() {
        let mut finding = Finding::default();
        conditions("There", &comparison(65, 55, 45, [6.0, 6.4]), &mut finding);
        assert_eq!(finding.verdict(), ClaimVerdict::Holds);
        conditions("There", &comparison(45, 65, 40, [6.0, 6.6]), &mut finding);
        assert_eq!(
            finding.conditions.iter().map(|c| c.met).collect::<Vec<_>>(),
            [true, true, true, false, true, false]
        );
    }

    #[test]
    fn scenes_are_pooled_by_matches() {
        let mut sum = comparison(65, 55, 45, [6.0, 6.4]);
        sum.add(comparison(85, 35, 25, [7.0, 8.0]));
        assert_eq!(sum.dropped(), [25.0, 55.0, 65.0]);
        assert_eq!((sum.good, sum.own.ln_ssdpi.len()), (160, 2));
    }
}
