//! Figures 5.8 and 5.9: the self check compared with the symmetric check in front of a close
//! object.

use super::checks::{Check, matches};
use super::measure::{Matches, percent};
use super::{Context, Experiment, Finding, stage};
use std::iter;
use svl_core::Result;
use svl_core::stereo::Frame;
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
const CHECKS: [(&str, Check); 5] = [
    ("self check", Check::Own),
    ("symmetric check", Check::Symmetric(1)),
    ("symmetric check, 0 px", Check::Symmetric(0)),
    ("symmetric check, texture on both sides", Check::Textured(1)),
    ("symmetric check to the letter", Check::Textured(0)),
];
/// Difference of ln SSDPIs that counts as comparable.
const MAX_COMPARABLE_DIFFERENCE: f64 = 0.5;

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let frame = context.frame(&close_object(CLOSE_M), 0)?;
    let close = values(&kept_matches(&frame)?);
    let [[own, ..], [symmetric, ..], .., [letter, ..]] = close;
    finding.quantity("matches that the self check drops", "%", "35", own);
    let as_in_v1 = "matches that the symmetric check drops, as in v1";
    finding.quantity(as_in_v1, "%", "55", symmetric);
    finding.quantity("matches that it drops, to the letter", "%", "55", letter);
    conditions("Before the close object", &close, finding);
    finding.why = format!("Before the close object {}", words(&close));
    let mut rows = named(close, "close object");
    approach(context, finding)?;
    let scenes = context.in_real_scenes(|frame| kept_matches(&frame))?;
    let views = scenes.iter().map(|(_, scene)| values(scene)).collect();
    plot_both_checks(views, close, finding);
    if !scenes.is_empty() {
        // Pooled: each match counts once, regardless of the size of its scene.
        let pooled = scenes.into_iter().map(|(_, scene)| scene);
        let real = values(&pooled.fold(KeptMatches::default(), pool));
        conditions("In the real scenes", &real, finding);
        finding.why += &format!("; in the real scenes {}", words(&real));
        rows.extend(named(real, "real scenes"));
    }
    finding.why += ".";
    finding.table(
        "view, check | matches dropped, % | mean ln SSDPI of the rest | median ln SSDPI of the \
         rest | right matches dropped, % | wrong among the rest, %",
        rows,
    );
    finding.image("the left image", frame.pair.left())?;
    for (shown, check) in [
        ("all matches", Check::Nothing),
        ("what the self check keeps", Check::Own),
        ("what the symmetric check keeps", Check::Symmetric(1)),
    ] {
        let caption = format!("ln SSDPI of {shown}");
        finding.ssdpis(caption, &matches(&frame.pair, check)?)?;
    }
    Ok(())
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
    let mut dropped = [[0.0; 3]; APPROACH_M.len()];
    for (ahead_m, dropped) in APPROACH_M.iter().zip(&mut dropped) {
        let frame = context.frame(&close_object(*ahead_m), 0)?;
        let [[own, ..], [symmetric, ..], .., [letter, ..]] = values(&kept_matches(&frame)?);
        *dropped = [own, symmetric, letter];
    }
    let ([far_m, .., near_m], [[.., far], .., [.., near]]) = (APPROACH_M, dropped);
    finding.condition(near > far).says(format!(
        "The nearer the object, the more the symmetric check drops, to the letter: {far:.1} % at \
         {far_m} m and {near:.1} % at {near_m} m."
    ));
    let names = [
        "self check",
        "symmetric check, as in v1",
        "symmetric check, to the letter",
    ];
    let x = Axis::new("distance of the object, m");
    let y = Axis::new("matches dropped, %").with_range(0.0, 80.0);
    let value = |check: usize, at: usize| dropped[at][check];
    let title = "The same object from far to near";
    finding.curves(title, [x, y], &names, &APPROACH_M, value);
    Ok(())
}

/// Plots each view by the matches that the two checks drop.
fn plot_both_checks(scenes: Vec<CheckValues>, close: CheckValues, finding: &mut Finding) {
    let points = |name: &str, views: &[CheckValues], check: usize| {
        let points = views.iter().map(|checks| (checks[check][0], checks[0][0]));
        Series::new(name, SeriesStyle::Points, points)
    };
    let thesis = [(55.0, 35.0)];
    let series = [
        points("real scenes, as in v1", &scenes, 1),
        points("real scenes, to the letter", &scenes, CHECKS.len() - 1),
        points("close object, as in v1", &[close], 1),
        points("close object, to the letter", &[close], CHECKS.len() - 1),
        Series::new("close object, thesis", SeriesStyle::Points, thesis),
        Series::new("as much", SeriesStyle::Line, [(0.0, 0.0), (80.0, 80.0)]),
    ];
    let axes = ["symmetric", "self"].map(|check| {
        let label = format!("dropped by the {check} check, %");
        Axis::new(label).with_range(0.0, 80.0)
    });
    finding.chart("What both checks drop", axes, series);
}

/// The matches of some views: all, then those that each of [`CHECKS`] keeps.
type KeptMatches = [Matches; 1 + CHECKS.len()];

/// Percentages and ln SSDPIs of each of [`CHECKS`]: matches dropped, mean and median of the rest,
/// right ones dropped, wrong ones kept.
type CheckValues = [[f64; 5]; CHECKS.len()];

fn kept_matches(frame: &Frame) -> Result<KeptMatches> {
    let checks = CHECKS.map(|(_, check)| check);
    let mut all = KeptMatches::default();
    for (check, kept) in iter::once(Check::Nothing).chain(checks).zip(&mut all) {
        *kept = Matches::new(frame, &matches(&frame.pair, check)?);
    }
    Ok(all)
}

fn pool(mut sum: KeptMatches, other: KeptMatches) -> KeptMatches {
    let pairs = sum.iter_mut().zip(other);
    pairs.for_each(|(sum, other)| sum.add(other));
    sum
}

fn values([all, kept @ ..]: &KeptMatches) -> CheckValues {
    kept.each_ref().map(|kept| {
        let dropped = percent(all.count() - kept.count(), all.count());
        let [mean, median] = kept.spread();
        let right = percent(all.right - kept.right, all.right);
        [dropped, mean, median, right, kept.wrong_percent()]
    })
}

/// The rows of a view.
fn named(values: CheckValues, view: &str) -> Vec<(String, [f64; 5])> {
    let names = CHECKS.iter().map(|(check, _)| format!("{view}, {check}"));
    names.zip(values).collect()
}

fn words(values: &CheckValues) -> String {
    let [
        [own, .., own_wrong],
        [symmetric, .., symmetric_wrong],
        ..,
        [letter, .., letter_wrong],
    ] = values;
    format!(
        "the self check drops {own:.0} % of the matches, the symmetric check {symmetric:.0} % as \
         in v1 and {letter:.0} % to the letter; of the rest {own_wrong:.0} %, \
         {symmetric_wrong:.0} % and {letter_wrong:.0} % are wrong"
    )
}

fn conditions(place: &str, values: &CheckValues, finding: &mut Finding) {
    let [
        [own, _, own_median, ..],
        [symmetric, _, median, ..],
        ..,
        [letter, ..],
    ] = values;
    for (check, dropped) in [("as in v1", symmetric), ("to the letter", letter)] {
        finding.condition(own < dropped).says(format!(
            "{place} the self check drops fewer matches than the symmetric check {check}: \
             {own:.1} % and {dropped:.1} %."
        ));
    }
    let are_comparable = (own_median - median).abs() <= MAX_COMPARABLE_DIFFERENCE;
    finding.condition(are_comparable).says(format!(
        "{place} the median ln SSDPIs of what they keep are within {MAX_COMPARABLE_DIFFERENCE}: \
         {own_median:.2} and {median:.2}."
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClaimVerdict;

    fn comparison(own: usize, symmetric: usize, letter: usize, ssdpi: [f64; 2]) -> KeptMatches {
        let kept = |matches: usize, ln_ssdpi: f64| Matches {
            pixels: 100,
            known: matches,
            right: matches,
            ln_ssdpis: vec![ln_ssdpi; matches],
        };
        let [own, symmetric] = [kept(own, ssdpi[0]), kept(symmetric, ssdpi[1])];
        let letter = || kept(letter, 6.0);
        [kept(100, 6.0), own, symmetric, letter(), letter(), letter()]
    }

    #[test]
    fn the_thesis_s_numbers_hold() {
        let mut finding = Finding::default();
        let found = values(&comparison(65, 55, 45, [6.0, 6.4]));
        conditions("There", &found, &mut finding);
        assert_eq!(finding.verdict(), ClaimVerdict::Holds);
        let found = values(&comparison(45, 65, 40, [6.0, 6.6]));
        conditions("There", &found, &mut finding);
        assert_eq!(
            finding.conditions.iter().map(|c| c.met).collect::<Vec<_>>(),
            [true, true, true, false, true, false]
        );
    }

    #[test]
    fn scenes_are_pooled_by_matches() {
        let sum = pool(
            comparison(65, 55, 45, [6.0, 6.4]),
            comparison(85, 35, 25, [7.0, 8.0]),
        );
        let [[own, ..], [symmetric, ..], .., [letter, ..]] = values(&sum);
        assert_eq!([own, symmetric, letter], [25.0, 55.0, 65.0]);
        assert_eq!((sum[0].right, sum[1].count()), (200, 150));
    }
}
