//! Compares the scale of the reported distances with that of the truth, and warns of a factor that
//! a wrong unit or calibration explains.

use super::{RunEnd, RunStart, Sink};
use svl_core::Result;
use svl_core::statistics::lower_median;
use svl_data::score::Judged;

/// Distances of one algorithm that are compared: enough for a median, at little cost.
const CELLS: usize = 2000;
/// Fewest distances for a result.
const LEAST: usize = 20;
/// A factor matches another within this fraction of it.
const NEAR: f64 = 0.15;

/// Factors of reported to true distances, with their usual cause and its cure.
const FACTORS: [(f64, &str); 4] = [
    (
        2.0,
        "the calibration was made for images of twice the size, or its baseline is twice too long",
    ),
    (
        0.5,
        "the calibration was made for images of half the size, or its baseline is half too short",
    ),
    (
        1000.0,
        "the baseline is in millimetres where metres are expected",
    ),
    (
        0.001,
        "the truth is in millimetres where metres are expected, or the baseline in kilometres",
    ),
];

/// Collects the distances of cells that truth and algorithm know, and warns at the end of a run.
#[derive(Default)]
pub struct ScaleSink {
    run: String,
    /// Per algorithm the reported and the true distances.
    distances: Vec<(String, Vec<[f64; 2]>)>,
}

impl Sink for ScaleSink {
    fn begin_run(&mut self, start: &RunStart<'_>) -> Result<()> {
        let run = &start.judge.run.name;
        let name = if run.is_empty() {
            &start.manifest.scenario
        } else {
            run
        };
        self.run.clone_from(name);
        self.distances.clear();
        Ok(())
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        let Some(truth) = &judged.true_cells else {
            return Ok(());
        };
        for scored in &judged.estimates {
            let label = &scored.estimate.algorithm;
            let place = self.distances.iter().position(|(known, _)| known == label);
            let place = place.unwrap_or_else(|| {
                self.distances.push((label.clone(), Vec::new()));
                self.distances.len() - 1
            });
            let distances = &mut self.distances[place].1;
            let cells = scored.estimate.grid.iter().zip(truth.grid().iter());
            let both = cells.filter(|((_, cell), _)| !cell.too_close);
            let both = both.filter_map(|((_, reported), (_, truth))| {
                Some([reported.depth?.distance_m?, truth.depth?.distance_m?])
            });
            distances.extend(both.take(CELLS.saturating_sub(distances.len())));
        }
        Ok(())
    }

    fn end_run(&mut self, _: &RunEnd<'_>) -> Result<()> {
        let mut algorithms = self.distances.iter();
        let found = algorithms.find_map(|(label, distances)| Some((label, scale(distances)?)));
        // The scale is the recording's, not an algorithm's: one line.
        if let Some((label, scale)) = found {
            let DistanceScale {
                reported_m,
                true_m,
                cells,
                cause,
            } = scale;
            tracing::warn!(
                "{}: the distances of {label} have a median of {reported_m:.3} m, the truth in the \
                 same {cells} cells one of {true_m:.3} m: probably {cause}; `svl info` shows focal \
                 length and baseline, and --calib FILE replaces them",
                self.run
            );
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// A factor between reported and true distances that has a usual cause.
#[derive(Debug, PartialEq)]
struct DistanceScale {
    reported_m: f64,
    true_m: f64,
    cells: usize,
    cause: &'static str,
}

/// The scale of the distances; none if it is right, or not near a usual factor.
fn scale(distances: &[[f64; 2]]) -> Option<DistanceScale> {
    if distances.len() < LEAST {
        return None;
    }
    let median = |of: usize| lower_median(distances.iter().map(|both| both[of]));
    let (reported_m, true_m) = (median(0)?, median(1)?);
    let is_near = |ratio: f64, factor: f64| (ratio / factor - 1.0).abs() < NEAR;
    let is_usual = |(factor, _): &&(f64, &str)| {
        // Most cells agree on it: an algorithm that is wrong in many has no factor.
        let agreeing = distances.iter().filter(|[a, b]| is_near(a / b, *factor));
        is_near(reported_m / true_m, *factor) && 2 * agreeing.count() > distances.len()
    };
    FACTORS
        .iter()
        .find(is_usual)
        .map(|(_, cause)| DistanceScale {
            reported_m,
            true_m,
            cells: distances.len(),
            cause,
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distances whose reports are that much farther, but for every third cell.
    fn distances(factor: f64, wrong: f64) -> Vec<[f64; 2]> {
        let cell = |i: usize| {
            let truth = 0.3 + 0.01 * i as f64;
            let factor = if i.is_multiple_of(3) { wrong } else { factor };
            [factor * truth, truth]
        };
        (0..60).map(cell).collect()
    }

    #[test]
    fn usual_factors_are_found() {
        for (factor, cause) in FACTORS {
            for noise in [0.95, 1.0, 1.05] {
                let found = scale(&distances(noise * factor, 1.2 * factor));
                assert_eq!(found.map(|found| found.cause), Some(cause), "{factor}");
            }
        }
        for factor in [0.7, 1.0, 1.1, 1.5, 3.0, 100.0] {
            assert_eq!(scale(&distances(factor, 2.0)), None, "{factor}");
        }
    }

    #[test]
    fn cells_that_do_not_agree_and_few_of_them_are_no_scale() {
        let spread = |i: usize| [0.1 * (i % 20) as f64 + 0.05, 0.5];
        assert_eq!(scale(&(0..60).map(spread).collect::<Vec<_>>()), None);
        assert_eq!(scale(&distances(2.0, 2.0)[..LEAST - 1]), None);
    }
}
