//! Figure 8.1: the amplitude spectrum of a normal view and of a too close object.

use super::super::measure::{mean_and_median, percent};
use super::super::{Context, Experiment, Finding};
use svl_core::Result;
use svl_core::filter::{FilterKind, FilterWindows, Spectrum};
use svl_core::stereo::{Gray, GridShape, Plane};
use svl_sim::arena::Arena;
use svl_train::TrainSettings;
use svl_train::fit::filter::true_label;

pub(crate) const EXPERIMENT: Experiment = Experiment {
    figures: &["8.1"],
    place: "Figure 8.1",
    title: "Spectra of a normal view and of a too close object",
    claim: "What is too close is out of focus and homogeneous, so its spectrum has less amplitude \
            at high frequencies than that of a normal view (section 8.1).",
    method: "A robot that creeps up to walls until 4 cm, every fifth frame of a run. Of each \
             window of 128 pixels the share of the amplitude, without the mean, that lies at \
             frequencies above a quarter of the sampling rate. Windows are too close by the \
             truth.",
    run,
};

const SIDE: usize = 128;

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let kind = FilterKind::TooClose;
    let arena = Arena::new(&super::arena(kind)?, 1)?;
    let mut spectrum = Spectrum::new(SIDE);
    let mut amplitudes = vec![0.0; SIDE * SIDE / 2 + 1];
    let mut shares = [Vec::new(), Vec::new()];
    for index in (0..arena.frames()).step_by(5) {
        let frame = arena.frame(index)?;
        context.step()?;
        let left = frame.pair.left();
        let windows = FilterWindows::new(kind, SIDE, left.size(), GridShape::default())?;
        for &at in &windows.corners {
            let label = |truth| true_label(kind, truth, at, SIDE, TrainSettings::RANGE_PX);
            let Some(is) = frame.truth.as_ref().and_then(label) else {
                continue;
            };
            spectrum.amplitudes(left, at, &mut amplitudes);
            let shares = &mut shares[usize::from(is)];
            if shares.is_empty() {
                let name = if is { "too close" } else { "normal view" };
                let crop = Plane::from_fn(SIDE, SIDE, |x, y| left.get(at[0] + x, at[1] + y))?;
                finding.image(name, &crop)?;
                let caption = format!("{name}: ln(1 + amplitude), mean in the middle");
                finding.image(caption, &picture(&amplitudes)?)?;
            }
            shares.push(high_share(&amplitudes));
        }
    }
    conclude(&shares, finding);
    Ok(())
}

/// Adds the results of the shares of normal windows and of too close ones.
fn conclude([normal, close]: &[Vec<f64>; 2], finding: &mut Finding) {
    // Probability that a too close window has less than a normal one: the area under a ROC curve.
    let above = |c: &f64| normal.iter().filter(|n| c < *n).count();
    let pairs = (normal.len() * close.len()).max(1);
    let order = percent(close.iter().map(above).sum(), pairs);
    let mean = |shares: &[f64]| 100.0 * mean_and_median(shares.iter().copied())[0];
    let (normal, close) = (mean(normal), mean(close));
    finding.quantity("high frequencies, normal view", "%", "", normal);
    finding.quantity("high frequencies, too close", "%", "", close);
    let what = "a too close window has fewer than a normal one";
    finding.quantity(what, "% of pairs", "", order);
    finding.condition(close < normal).says(format!(
        "The share of high frequencies is lower in windows that are too close: {close:.1} % of \
         the amplitude, in others {normal:.1} %."
    ));
    finding.condition(order > 90.0).says(format!(
        "This share alone separates most windows (more than 90 % of pairs): {order:.1} %."
    ));
    finding.why = format!(
        "High frequencies have {close:.1} % of the amplitude of too close windows and {normal:.1} \
         % of others; {order:.1} % of pairs are in that order."
    );
}

/// The share of the amplitudes, without the mean, at frequencies above a quarter of the sampling
/// rate.
fn high_share(amplitudes: &[f32]) -> f64 {
    let frequency = |f: usize| f.min(SIDE - f);
    let is_high = |i: &usize| frequency(i % SIDE).max(frequency(i / SIDE)) > SIDE / 4;
    let places = || 1..amplitudes.len();
    let amplitude = |i: usize| f64::from(amplitudes[i]);
    let high: f64 = places().filter(is_high).map(amplitude).sum();
    high / places().map(amplitude).sum::<f64>()
}

/// The whole spectrum by its symmetry, with its mean in the centre.
fn picture(amplitudes: &[f32]) -> Result<Gray> {
    let log: Vec<_> = amplitudes.iter().map(|a| a.ln_1p()).collect();
    let most = log[1..].iter().copied().fold(1.0f32, f32::max);
    Plane::from_fn(SIDE, SIDE, |x, y| {
        let (u, v) = ((x + SIDE / 2) % SIDE, (y + SIDE / 2) % SIDE);
        let i = v * SIDE + u;
        let mirror = (SIDE - v) % SIDE * SIDE + (SIDE - u) % SIDE;
        let value = log.get(i).or(log.get(mirror)).copied().unwrap_or_default();
        (255.0 * value / most).min(255.0) as u8
    })
}
