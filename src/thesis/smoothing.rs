//! Figure 5.3: effect of vertical smoothing on the matches of a misaligned pair.

use super::measure::{Matches, percent};
use super::{Context, Experiment, Finding, stage};
use svl_core::Result;
use svl_core::stereo::{Frame, Gray, StereoPair};
use svl_report::plot::Axis;
use svl_score::judge::{Judge, Judged};

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["5.3"],
    place: "Figure 5.3",
    title: "Vertical smoothing",
    claim: "If the rows of a pair are not aligned, smoothing both images vertically lowers the \
            median SSDPI, and so gives a better disparity map (section 5.3.1).",
    method: "Four views of the arena of chapter 7, with the right image rendered 0, 0.5, 1 and 2 \
             px too low, through v3 with its vertical Gaussian (σ 1 px) and without it. Real \
             scenes: the right image is moved down by 1 px. SSDPI is of valid pixels, as ln(SSDPI \
             + 1). Smoothing lowers it in any case, as the row at 0 px shows, so matches are also \
             compared with the truth: a match is wrong when it is off by more than 2 px.",
    run,
};

const OFFSETS_PX: [f64; 4] = [0.0, 0.5, 1.0, 2.0];
/// Index in [`OFFSETS_PX`] of the offset in the conditions.
const ONE_PX: usize = 2;
/// Frames of the arena's run: the opening, the close border, the corner, the bridge.
const VIEWS: [u64; 4] = [20, 62, 117, 262];
/// Without and with smoothing.
const ALGORITHMS: [&str; 2] = ["v3:smoothing_sigma=0", "v3"];
const WITH: [&str; 2] = ["without smoothing", "with smoothing"];
const HEADS: &str = "right image too low by, smoothing | median ln SSDPI | mean ln SSDPI | \
                     valid pixels, % | right matches, % of all pixels | \
                     wrong matches, % of the matches";

/// Values under [`HEADS`].
type MatchValues = [f64; 5];

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let (mut outcomes, mut rows) = (Vec::new(), Vec::new());
    for offset_px in OFFSETS_PX {
        let arena = stage::aligned(offset_px)?;
        let frames = VIEWS.iter().map(|&view| arena.frame(view));
        let frames = frames.collect::<Result<_>>()?;
        let judged = context.judged(frames, &ALGORITHMS, &Judge::default())?;
        if offset_px == OFFSETS_PX[ONE_PX] {
            for (with, scored) in WITH.iter().zip(&judged[0].estimates) {
                let caption = format!("ln SSDPI, 1 px too low, {with}");
                finding.ssdpis(caption, &scored.estimate.disparity)?;
            }
        }
        outcomes.push(both(&judged, &format!("arena, {offset_px} px"), &mut rows));
    }
    conclude(outcomes[0], outcomes[ONE_PX], finding);
    for (title, label, column) in [
        ("SSDPI of a misaligned pair", "median ln SSDPI", 0),
        ("Wrong matches of a misaligned pair", "wrong matches, %", 4),
    ] {
        let axes = ["right image too low by, px", label].map(Axis::new);
        let value = |with: usize, offset: usize| outcomes[offset][with][column];
        finding.curves(title, axes, &WITH, &OFFSETS_PX, value);
    }
    let real = context.in_real_scenes(lowered)?.into_iter();
    let real: Vec<_> = real.map(|(_, frame)| frame).collect();
    if !real.is_empty() {
        let judged = context.judged(real, &ALGORITHMS, &Judge::default())?;
        let outcome = both(&judged, "real scenes, 1 px", &mut rows);
        conclude_real(judged.len(), outcome, finding);
    }
    finding.table(HEADS, rows);
    Ok(())
}

/// Adds the values of the matches without and with smoothing, and returns them.
fn both(judged: &[Judged], place: &str, rows: &mut Vec<(String, MatchValues)>) -> [MatchValues; 2] {
    let values = [0, 1].map(|algorithm| {
        let mut matches = Matches::default();
        for judged in judged {
            let map = &judged.estimates[algorithm].estimate.disparity;
            matches.add(Matches::new(&judged.frame, map));
        }
        let [mean, median] = matches.spread();
        let valid = percent(matches.count(), matches.pixels);
        let right = percent(matches.right, matches.pixels);
        [median, mean, valid, right, matches.wrong_percent()]
    });
    let names = ["without", "with"].map(|with| format!("{place}, {with}"));
    rows.extend(names.into_iter().zip(values));
    values
}

/// Adds the results of an aligned pair and of one that is misaligned by 1 px, each without and
/// with smoothing.
fn conclude(aligned: [MatchValues; 2], lower: [MatchValues; 2], finding: &mut Finding) {
    let [
        [sharp, .., sharp_right, sharp_wrong],
        [smooth, .., smooth_right, smooth_wrong],
    ] = lower;
    finding.condition(smooth < sharp).says(format!(
        "1 px too low, smoothing lowers the median ln SSDPI: from {sharp:.2} to {smooth:.2}."
    ));
    finding.condition(smooth_right > sharp_right).says(format!(
        "1 px too low, smoothing finds more right matches: {sharp_right:.1} % of all pixels \
         without, {smooth_right:.1} % with."
    ));
    finding.condition(smooth_wrong < sharp_wrong).says(format!(
        "1 px too low, smoothing makes fewer of the matches wrong: {sharp_wrong:.1} % without, \
         {smooth_wrong:.1} % with."
    ));
    let [[from, .., from_wrong], [to, .., to_wrong]] = aligned;
    finding.why = format!(
        "With the right image 1 px too low, smoothing lowers the median ln SSDPI from {sharp:.2} \
         to {smooth:.2} and the fraction of wrong matches from {sharp_wrong:.1} % to \
         {smooth_wrong:.1} %; an aligned pair's goes from {from:.2} to {to:.2} and from \
         {from_wrong:.1} % to {to_wrong:.1} %."
    );
}

/// Adds the condition of real scenes misaligned by one row.
fn conclude_real(scenes: usize, [sharp, smooth]: [MatchValues; 2], finding: &mut Finding) {
    let ([sharp, .., sharp_wrong], [smooth, .., smooth_wrong]) = (sharp, smooth);
    let is_better = smooth < sharp && smooth_wrong < sharp_wrong;
    finding.condition(is_better).says(format!(
        "So it is on {scenes} real scenes moved by 1 px: median ln SSDPI {sharp:.2} without and \
         {smooth:.2} with smoothing, wrong matches {sharp_wrong:.1} % and {smooth_wrong:.1} %."
    ));
}

/// The frame with the right image one row lower.
fn lowered(frame: Frame) -> Result<Frame> {
    let right = frame.pair.right();
    let lower = Gray::from_fn(right.width(), right.height(), |x, y| {
        // The top row is repeated. The true disparities remain those of the left image.
        right.get(x, y.saturating_sub(1))
    })?;
    Ok(Frame {
        pair: StereoPair::new(frame.pair.left().clone(), lower)?,
        ..frame
    })
}
