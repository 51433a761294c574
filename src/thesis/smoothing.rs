//! Figure 5.3: effect of vertical smoothing on the matches of a misaligned pair.

use super::measure::{MeanMedian, percent, right, ssdpi, ssdpi_picture, valid};
use super::{Context, Experiment, Finding, TableValue};
use svl_core::Result;
use svl_core::stereo::{DisparityMap, Frame, Gray, StereoPair};
use svl_report::plot::{Axis, Chart, Series, SeriesStyle};
use svl_score::judge::Judge;
use svl_sim::arena::{Arena, ArenaConfig};

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
    records: false,
    run,
};

const OFFSETS_PX: [f64; 4] = [0.0, 0.5, 1.0, 2.0];
/// Index in [`OFFSETS_PX`] of the offset in the conditions.
const ONE_PX: usize = 2;
/// Frames of the arena's run: the opening, the close border, the corner, the bridge.
const VIEWS: [u64; 4] = [20, 62, 117, 262];
const SMOOTH: &str = "v3";
const SHARP: &str = "v3:smoothing_sigma=0";

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let mut finding = Finding::default();
    let outcomes = arena_outcomes(context, &mut finding)?;
    let (_, sharp, smooth) = outcomes[ONE_PX];
    let lower = [sharp, smooth].map(|o| o.ssdpi.median);
    add_conditions([sharp, smooth], &mut finding);
    let rows = finding.table(HEADS);
    for (offset_px, sharp, smooth) in &outcomes {
        rows.row(format!("arena, {offset_px} px, without"), sharp.values());
        rows.row(format!("arena, {offset_px} px, with"), smooth.values());
    }
    finding.why = format!(
        "With the right image 1 px too low, smoothing lowers the median ln SSDPI from {:.2} to \
         {:.2} and the fraction of wrong matches from {:.1} % to {:.1} %; an aligned pair's goes \
         from {:.2} to {:.2} and from {:.1} % to {:.1} %.",
        lower[0],
        lower[1],
        sharp.wrong_percent,
        smooth.wrong_percent,
        outcomes[0].1.ssdpi.median,
        outcomes[0].2.ssdpi.median,
        outcomes[0].1.wrong_percent,
        outcomes[0].2.wrong_percent
    );
    plot(&outcomes, &mut finding);
    real(context, &mut finding)?;
    Ok(finding)
}

/// Row offset, px, and the outcomes without and with smoothing.
type OffsetOutcome = (f64, MatchOutcome, MatchOutcome);

/// The arena's views at every row offset.
fn arena_outcomes(context: &mut Context<'_>, finding: &mut Finding) -> Result<Vec<OffsetOutcome>> {
    let mut outcomes = Vec::new();
    for offset_px in OFFSETS_PX {
        let mut config = ArenaConfig::default();
        config.rig.right_row_offset_px = offset_px;
        // A rolled camera would add its own misalignment, which grows towards the sides.
        config.rig.right_roll_deg = 0.0;
        let arena = Arena::new(&config, 1)?;
        let frames = VIEWS
            .iter()
            .map(|&view| arena.frame(view))
            .collect::<Result<Vec<_>>>()?;
        let [sharp, smooth] = both(context, &frames)?;
        outcomes.push((
            offset_px,
            MatchOutcome::new(&frames, &sharp),
            MatchOutcome::new(&frames, &smooth),
        ));
        if offset_px == OFFSETS_PX[ONE_PX] {
            for (with, maps) in [("without", &sharp), ("with", &smooth)] {
                let caption = format!("ln SSDPI, 1 px too low, {with} smoothing");
                finding.show(ssdpi_picture(caption, &maps[0])?);
            }
        }
    }
    Ok(outcomes)
}

/// The conditions of a pair that is misaligned by 1 px, without and with smoothing.
fn add_conditions([sharp, smooth]: [MatchOutcome; 2], finding: &mut Finding) {
    let lower = [sharp, smooth].map(|o| o.ssdpi.median);
    finding.condition(
        lower[1] < lower[0],
        format!(
            "1 px too low, smoothing lowers the median ln SSDPI: from {:.2} to {:.2}.",
            lower[0], lower[1]
        ),
    );
    finding.condition(
        smooth.right_percent > sharp.right_percent,
        format!(
            "1 px too low, smoothing finds more right matches: {:.1} % of all pixels without, \
             {:.1} % with.",
            sharp.right_percent, smooth.right_percent
        ),
    );
    finding.condition(
        smooth.wrong_percent < sharp.wrong_percent,
        format!(
            "1 px too low, smoothing makes fewer of the matches wrong: {:.1} % without, {:.1} % \
             with.",
            sharp.wrong_percent, smooth.wrong_percent
        ),
    );
}

fn plot(outcomes: &[OffsetOutcome], finding: &mut Finding) {
    type Value = fn(&MatchOutcome) -> f64;
    let charts: [(&str, &str, Value); 2] = [
        ("SSDPI", "median ln SSDPI", |o| o.ssdpi.median),
        ("Wrong matches", "wrong matches, %", |o| o.wrong_percent),
    ];
    for (what, label, value) in charts {
        let sharp = outcomes.iter().map(|(px, sharp, _)| (*px, value(sharp)));
        let smooth = outcomes.iter().map(|(px, _, smooth)| (*px, value(smooth)));
        finding.plot(&Chart {
            title: format!("{what} of a misaligned pair"),
            x: Axis::new("right image too low by, px"),
            y: Axis::new(label),
            series: vec![
                Series::new("without smoothing", SeriesStyle::Both, sharp),
                Series::new("with smoothing", SeriesStyle::Both, smooth),
            ],
        });
    }
}

/// Real scenes misaligned by one row.
fn real(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let frames = context
        .real()
        .map(|frame| lowered(frame?))
        .collect::<Result<Vec<_>>>()?;
    if frames.is_empty() {
        return Ok(());
    }
    let [sharp, smooth] = both(context, &frames)?.map(|maps| MatchOutcome::new(&frames, &maps));
    finding.condition(
        smooth.ssdpi.median < sharp.ssdpi.median && smooth.wrong_percent < sharp.wrong_percent,
        format!(
            "So it is on {} real scenes moved by 1 px: median ln SSDPI {:.2} without and {:.2} \
             with smoothing, wrong matches {:.1} % and {:.1} %.",
            frames.len(),
            sharp.ssdpi.median,
            smooth.ssdpi.median,
            sharp.wrong_percent,
            smooth.wrong_percent
        ),
    );
    for rows in &mut finding.tables {
        rows.row("real scenes, 1 px, without", sharp.values());
        rows.row("real scenes, 1 px, with", smooth.values());
    }
    Ok(())
}

const HEADS: [&str; 6] = [
    "right image too low by, smoothing",
    "median ln SSDPI",
    "mean ln SSDPI",
    "valid pixels, %",
    "right matches, % of all pixels",
    "wrong matches, % of the matches",
];

/// Maps of the frames without and with smoothing.
fn both(context: &mut Context<'_>, frames: &[Frame]) -> Result<[Vec<DisparityMap>; 2]> {
    let judged = context.judged(frames.to_vec(), &[SHARP, SMOOTH], &Judge::default())?;
    let maps = |i: usize| {
        let maps = judged
            .iter()
            .map(|judged| &judged.estimates[i].estimate.disparity);
        maps.cloned().collect()
    };
    Ok([maps(0), maps(1)])
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

/// Matches of several maps, counted over all their pixels.
#[derive(Clone, Copy, Debug)]
struct MatchOutcome {
    ssdpi: MeanMedian,
    valid_percent: f64,
    /// Per cent of all pixels.
    right_percent: f64,
    /// Per cent of the matches with known truth.
    wrong_percent: f64,
}

impl MatchOutcome {
    fn values(&self) -> [TableValue; 5] {
        let [median, mean] = [self.ssdpi.median, self.ssdpi.mean];
        let [valid, right] = [self.valid_percent, self.right_percent];
        [median, mean, valid, right, self.wrong_percent].map(TableValue::from)
    }

    fn new(frames: &[Frame], maps: &[DisparityMap]) -> Self {
        let (mut pixels, mut matches, mut known, mut good) = (0, 0, 0, 0);
        for (frame, map) in frames.iter().zip(maps) {
            pixels += map.size().0 * map.size().1;
            matches += map.valid();
            let judged = frame
                .truth
                .iter()
                .flat_map(|truth| valid(map).filter_map(|v| right(truth, &v)));
            for right in judged {
                // Pixels without truth are matches but neither right nor wrong.
                known += 1;
                good += usize::from(right);
            }
        }
        Self {
            ssdpi: ssdpi(maps),
            valid_percent: percent(matches, pixels).unwrap_or(f64::NAN),
            right_percent: percent(good, pixels).unwrap_or(f64::NAN),
            wrong_percent: percent(known - good, known).unwrap_or(f64::NAN),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{ExtraPlanes, Geometry, Plane, Truth};

    #[test]
    fn outcomes_pool_pixels() {
        let image = Gray::filled(4, 1, 0).unwrap();
        let frame = Frame {
            truth: Some(Truth::exact(Plane::filled(4, 1, 3.0).unwrap(), None)),
            ..Frame::new(
                StereoPair::new(image.clone(), image).unwrap(),
                Geometry::Rectified(None),
            )
        };
        let mut map = DisparityMap::with_planes(4, 1, ExtraPlanes::SSDPI).unwrap();
        let mut row = map.rows_mut().next().unwrap();
        row.accept(0, 3.0);
        row.accept(1, 5.5);
        row.set_ssdpi(0, 0);
        row.set_ssdpi(1, 6);
        let outcome = MatchOutcome::new(&[frame], &[map]);
        assert_eq!(
            (
                outcome.valid_percent,
                outcome.right_percent,
                outcome.wrong_percent
            ),
            (50.0, 25.0, 50.0)
        );
    }
}
