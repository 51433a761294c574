//! Figures 5.8 and 5.9: the self check compared with the symmetric check in front of a close
//! object.

use super::checks::Correlated;
use super::measure::{Matches, percent};
use super::{Context, Experiment, Finding, stage};
use svl_core::Result;
use svl_core::stereo::{DisparityMap, Frame};
use svl_report::plot::{Axis, Series, SeriesStyle};
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
    run,
};

/// Distance of the close object.
const CLOSE_M: f64 = 0.2;
/// Distances of the approach, the farthest first.
const APPROACH_M: [f64; 7] = [1.0, 0.7, 0.5, 0.4, 0.3, 0.25, 0.2];
/// The self check, and interpretations of the symmetric check: as in v1; equal disparities; right
/// pixels matched back only if they are textured; both, which is the thesis to the letter.
const CHECKS: [&str; 5] = [
    "self check",
    "symmetric check",
    "symmetric check, 0 px",
    "symmetric check, texture on both sides",
    "symmetric check to the letter",
];
/// Indices of the self check, and of the symmetric check as in v1 and to the letter.
const COMPARED: [usize; 3] = [0, 1, 4];
/// Difference of ln SSDPIs that counts as comparable.
const MAX_COMPARABLE_DIFFERENCE: f64 = 0.5;

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let frame = context.still(&close_object(CLOSE_M))?;
    let (close, maps) = CheckComparison::new(&frame)?;
    let dropped = close.dropped();
    let [own, symmetric, letter] = dropped;
    finding.quantity("matches that the self check drops", "%", "35", own);
    let as_in_v1 = "matches that the symmetric check drops, as in v1";
    finding.quantity(as_in_v1, "%", "55", symmetric);
    finding.quantity("matches that it drops, to the letter", "%", "55", letter);
    conditions("Before the close object", &close, finding);
    let mut why = format!("Before the close object {}", close.words());
    let mut rows = close.rows("close object");
    approach(context, finding)?;
    let scenes = context.in_real_scenes(|frame| Ok(CheckComparison::new(&frame)?.0))?;
    let scenes_drop = scenes.iter().map(|(_, scene)| scene.dropped()).collect();
    // Pooled: each match counts once, regardless of the size of its scene.
    let mut real = CheckComparison::default();
    scenes.into_iter().for_each(|(_, scene)| real.add(scene));
    if real.all.count() > 0 {
        conditions("In the real scenes", &real, finding);
        why += &format!("; in the real scenes {}", real.words());
        rows.extend(real.rows("real scenes"));
    }
    finding.why = why + ".";
    finding.table(
        "view, check | matches dropped, % | mean ln SSDPI of the rest | median ln SSDPI of the \
         rest | right matches dropped, % | wrong among the rest, %",
        rows,
    );
    plot_both_checks(scenes_drop, dropped, finding);
    finding.image("the left image", frame.pair.left())?;
    let [all, own, symmetric] = &maps;
    finding.ssdpis("ln SSDPI of all matches", all)?;
    finding.ssdpis("ln SSDPI of what the self check keeps", own)?;
    finding.ssdpis("ln SSDPI of what the symmetric check keeps", symmetric)
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

/// Adds a condition and a plot of the matches dropped by the checks as the object approaches.
fn approach(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let names = [
        "self check",
        "symmetric check, as in v1",
        "symmetric check, to the letter",
    ];
    let mut curves = names.map(|name| Series::new(name, SeriesStyle::Both, []));
    for ahead_m in APPROACH_M {
        let frame = context.still(&close_object(ahead_m))?;
        let dropped = CheckComparison::new(&frame)?.0.dropped();
        for (curve, dropped) in curves.iter_mut().zip(dropped) {
            curve.points.push((ahead_m, dropped));
        }
    }
    // The approach is not empty.
    if let [(far_m, far), .., (near_m, near)] = curves[2].points[..] {
        finding.condition(near > far).says(format!(
            "The nearer the object, the more the symmetric check drops, to the letter: {far:.1} % \
             at {far_m} m and {near:.1} % at {near_m} m."
        ));
    }
    let x = Axis::new("distance of the object, m");
    let y = Axis::new("matches dropped, %").with_range(0.0, 80.0);
    finding.chart("The same object from far to near", [x, y], curves);
    Ok(())
}

/// Plots each view by the matches that the two checks drop.
fn plot_both_checks(scenes: Vec<[f64; 3]>, close: [f64; 3], finding: &mut Finding) {
    let points = |name: &str, views: &[[f64; 3]], check: usize| {
        let points = views.iter().map(|dropped| (dropped[check], dropped[0]));
        Series::new(name, SeriesStyle::Points, points)
    };
    let series = [
        points("real scenes, as in v1", &scenes, 1),
        points("real scenes, to the letter", &scenes, 2),
        points("close object, as in v1", &[close], 1),
        points("close object, to the letter", &[close], 2),
        points("close object, thesis", &[[35.0, 55.0, 55.0]], 1),
        Series::new("as much", SeriesStyle::Line, [(0.0, 0.0), (80.0, 80.0)]),
    ];
    let axes = ["symmetric", "self"].map(|check| {
        let label = format!("dropped by the {check} check, %");
        Axis::new(label).with_range(0.0, 80.0)
    });
    finding.chart("What both checks drop", axes, series);
}

/// The checks on the same matches.
#[derive(Clone, Debug, Default)]
struct CheckComparison {
    all: Matches,
    /// Matches that each of [`CHECKS`] keeps.
    kept: [Matches; CHECKS.len()],
}

impl CheckComparison {
    /// With the maps of all matches, and of those kept by the self check and the symmetric check.
    fn new(frame: &Frame) -> Result<(Self, [DisparityMap; 3])> {
        let correlated = Correlated::new(&frame.pair)?;
        // v1 tolerates a pixel of difference.
        let (own, symmetric) = (correlated.self_checked(), correlated.symmetric(1));
        let kept = |map: &DisparityMap| Matches::new(frame, map);
        let comparison = Self {
            all: kept(&correlated.matches),
            kept: [
                kept(&own),
                kept(&symmetric),
                kept(&correlated.symmetric(0)),
                kept(&correlated.symmetric_on_texture(1)),
                kept(&correlated.symmetric_on_texture(0)),
            ],
        };
        Ok((comparison, [correlated.matches, own, symmetric]))
    }

    fn add(&mut self, other: Self) {
        self.all.add(other.all);
        let pairs = self.kept.iter_mut().zip(other.kept);
        pairs.for_each(|(sum, other)| sum.add(other));
    }

    /// A number of each of [`COMPARED`].
    fn compared(&self, number: impl Fn(&Matches) -> f64) -> [f64; 3] {
        COMPARED.map(|check| number(&self.kept[check]))
    }

    /// Fraction of the matches that a check drops, per cent.
    fn dropped_percent(&self, kept: &Matches) -> f64 {
        percent(self.all.count() - kept.count(), self.all.count())
    }

    fn dropped(&self) -> [f64; 3] {
        self.compared(|kept| self.dropped_percent(kept))
    }

    fn words(&self) -> String {
        let [own, symmetric, letter] = self.dropped();
        let [own_wrong, symmetric_wrong, letter_wrong] = self.compared(Matches::wrong_percent);
        format!(
            "the self check drops {own:.0} % of the matches, the symmetric check {symmetric:.0} % \
             as in v1 and {letter:.0} % to the letter; of the rest {own_wrong:.0} %, \
             {symmetric_wrong:.0} % and {letter_wrong:.0} % are wrong"
        )
    }

    /// A row per check: matches dropped, mean and median of the rest, right ones dropped, wrong
    /// ones kept.
    fn rows(&self, place: &str) -> Vec<(String, [f64; 5])> {
        let row = |(check, kept): (&&str, &Matches)| {
            let (spread, right) = (kept.spread(), self.all.right);
            let values = [
                self.dropped_percent(kept),
                spread.mean,
                spread.median,
                percent(right - kept.right, right),
                kept.wrong_percent(),
            ];
            (format!("{place}, {check}"), values)
        };
        CHECKS.iter().zip(&self.kept).map(row).collect()
    }
}

fn conditions(place: &str, comparison: &CheckComparison, finding: &mut Finding) {
    let [own, symmetric, letter] = comparison.dropped();
    for (check, dropped) in [("as in v1", symmetric), ("to the letter", letter)] {
        finding.condition(own < dropped).says(format!(
            "{place} the self check drops fewer matches than the symmetric check {check}: \
             {own:.1} % and {dropped:.1} %."
        ));
    }
    let [own, symmetric, _] = comparison.compared(|kept| kept.spread().median);
    let are_comparable = (own - symmetric).abs() <= MAX_COMPARABLE_DIFFERENCE;
    finding.condition(are_comparable).says(format!(
        "{place} the median ln SSDPIs of what they keep are within {MAX_COMPARABLE_DIFFERENCE}: \
         {own:.2} and {symmetric:.2}."
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClaimVerdict;

    fn comparison(own: usize, symmetric: usize, letter: usize, ssdpi: [f64; 2]) -> CheckComparison {
        let kept = |matches: usize, ln_ssdpi: f64| Matches {
            pixels: 100,
            known: matches,
            right: matches,
            ln_ssdpis: vec![ln_ssdpi; matches],
        };
        let [own, symmetric] = [kept(own, ssdpi[0]), kept(symmetric, ssdpi[1])];
        let letter = kept(letter, 6.0);
        CheckComparison {
            all: kept(100, 6.0),
            kept: [own, symmetric, letter.clone(), letter.clone(), letter],
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
        assert_eq!((sum.all.right, sum.kept[0].count()), (200, 150));
    }
}
