//! Distances with their disparities, from a table or measured in recordings.

use crate::cli::shared::progress::Terminal;
use crate::cli::shared::usage;
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::io::Read;
use std::path::{Path, PathBuf};
use svl::calibrate::distance::TargetMeasurement;
use svl::console::Watch;
use svl::losses::Ending;
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::pass::{Matchers, Pace, complete, run_through};
use svl::runs::open_recording;
use svl::scenario::SourceOptions;
use svl::score::{Judge, Judged};
use svl::sink::{self, CollectSink, PassStart, Sink};
use svl::source::{Chain, FirstPairs, Request};
use svl::stereo::{DepthGrid, MAX_SIDE, Rig};

/// Largest number of measurements; more do not improve a curve.
const MAX_MEASUREMENTS: usize = 1000;

/// Largest distance, centimetres.
const MAX_DISTANCE_CM: f64 = 1e6;

/// Largest table, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Largest number of frames matched per recording; the target does not move, so a few are enough.
const MAX_FRAMES: u64 = 30;

/// A target at a known distance.
#[derive(Debug, Serialize)]
pub(super) struct Measurement {
    pub distance_cm: f64,
    pub disparity_px: f64,
    /// Present when it was measured in a recording.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub seen: Option<RecordedTarget>,
}

/// A target measured in a recording.
#[derive(Debug, Serialize)]
pub(super) struct RecordedTarget {
    pub recording: PathBuf,
    pub frames: usize,
    /// Column and row.
    pub cells: Vec<(usize, usize)>,
    pub spread_px: f64,
    /// `a` by the recording's own calibration: focal length times baseline.
    pub focal_baseline_cm_px: Option<f64>,
}

/// A row of the CSV table.
#[derive(Deserialize)]
struct TableLine {
    distance_cm: f64,
    disparity_px: Option<f64>,
    recording: Option<PathBuf>,
}

/// Options for measuring recordings.
pub(super) struct Measuring<'a> {
    pub algorithm: &'a Algorithm,
    /// Cells that show the target; none for those that agree with the middle one.
    pub cells: &'a [(usize, usize)],
    pub quiet: bool,
}

/// Reads a table, or measures recordings given with their distances.
pub(super) fn measurements(
    named: &[String],
    measuring: &Measuring<'_>,
) -> anyhow::Result<Vec<Measurement>> {
    let mut found = Vec::new();
    for text in named {
        match text.split_once('=') {
            Some((_, "")) => {
                return Err(usage::wrong(format!("{text}: name the recording after =")));
            }
            Some((distance, recording)) => {
                found.push(measuring.measure(length_cm(distance)?, recording.into())?);
            }
            None => found.extend(table(Path::new(text), measuring)?),
        }
    }
    if found.len() > MAX_MEASUREMENTS {
        bail!(
            "{} measurements: a curve accepts {MAX_MEASUREMENTS} at most",
            found.len()
        );
    }
    Ok(found)
}

fn table(path: &Path, measuring: &Measuring<'_>) -> anyhow::Result<Vec<Measurement>> {
    let shown = path.display();
    if path.extension().is_some_and(|e| e == "mcap") {
        return Err(usage::wrong(format!(
            "{shown}: at which distance? Name it before the recording, as 130cm={shown}"
        )));
    }
    let file = std::fs::File::open(path)
        .ok()
        .filter(|file| file.metadata().is_ok_and(|found| found.is_file()))
        .with_context(|| {
            format!("{shown}: no such table; name a CSV, or recordings as 130cm=a.mcap")
        })?;
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(file.take(MAX_BYTES));
    // Recordings are named relative to the table, so that both can move together.
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut found = Vec::new();
    // One row beyond the limit is read, so that the caller sees that there are too many.
    for (number, line) in reader.deserialize().take(MAX_MEASUREMENTS + 1).enumerate() {
        let line: TableLine = line.map_err(|e| {
            let cure = "expected the columns distance_cm, and disparity_px or recording";
            anyhow::anyhow!("{shown}: measurement {}: {e}; {cure}", number + 1)
        })?;
        let (distance_cm, disparity_px) = (line.distance_cm, line.disparity_px);
        if distance_cm > MAX_DISTANCE_CM || disparity_px.is_some_and(|px| px > MAX_SIDE as f64) {
            bail!(
                "{shown}: measurement {}: a distance is {MAX_DISTANCE_CM} cm at most, a disparity \
                 {MAX_SIDE} px",
                number + 1
            );
        }
        found.push(match (disparity_px, line.recording) {
            (Some(disparity_px), None) => Measurement {
                distance_cm,
                disparity_px,
                seen: None,
            },
            (None, Some(recording)) => measuring.measure(distance_cm, folder.join(recording))?,
            _ => bail!(
                "{shown}: measurement {}: give either its disparity_px or its recording",
                number + 1
            ),
        });
    }
    Ok(found)
}

/// `130cm`, `1.3m` or `1300mm` in centimetres.
fn length_cm(text: &str) -> anyhow::Result<f64> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let factor = match &text[digits.len()..] {
        "m" => Some(100.0),
        "cm" => Some(1.0),
        "mm" => Some(0.1),
        _ => None,
    };
    let length = factor.and_then(|factor| Some(digits.parse::<f64>().ok()? * factor));
    length
        .filter(|cm| *cm > 0.0 && *cm <= MAX_DISTANCE_CM)
        .ok_or_else(|| {
            usage::wrong(format!(
                "'{text}' is not a distance up to 10 km; write it as 130cm, 1.3m or 1300mm before ="
            ))
        })
}

impl Measuring<'_> {
    fn measure(&self, distance_cm: f64, recording: PathBuf) -> anyhow::Result<Measurement> {
        let name = recording.to_string_lossy();
        let (grids, rig) = self.grids(&name)?;
        let target =
            TargetMeasurement::measure(&grids, self.cells).with_context(|| name.to_string())?;
        Ok(Measurement {
            distance_cm,
            disparity_px: target.disparity_px,
            seen: Some(RecordedTarget {
                frames: grids.len(),
                cells: target.cells,
                spread_px: target.spread_px,
                focal_baseline_cm_px: rig.map(|rig| 100.0 * rig.focal_px() * rig.baseline_m()),
                recording,
            }),
        })
    }

    /// The depth grids of the first frames of a recording, and the rig.
    fn grids(&self, name: &str) -> anyhow::Result<(Vec<DepthGrid>, Option<Rig>)> {
        let request = Request {
            options: SourceOptions {
                calib: Some("none".to_owned()),
                ..SourceOptions::default()
            },
            ..Request::new(name)
        };
        let opened = open_recording(&request, &Terminal { quiet: self.quiet })?;
        let chain = Chain {
            take: FirstPairs::new(None, Some(MAX_FRAMES)),
            ..Chain::default()
        };
        let mut source = chain.over(opened.source)?;
        let algorithms = [self.algorithm.clone()];
        let grid = |judged: &Judged| {
            let estimate = judged.estimates.first();
            let grid = estimate.map(|estimate| estimate.estimate.grid.clone());
            (grid, judged.frame.rig().copied())
        };
        let sink = CollectSink::new(grid);
        let kept = sink.outbox();
        let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(sink)];
        let (manifest, judge) = (Manifest::new(name, &algorithms)?, Judge::default());
        let start = PassStart::new(&manifest, None, &judge);
        let watch = Watch::new(&Terminal { quiet: self.quiet }, name, source.pairs(), None);
        let (outcome, ran) = run_through(
            &mut *source,
            &mut Matchers::new(&algorithms)?,
            &start,
            Pace::Asap,
            &mut sinks,
            watch,
        );
        sink::finish(sinks)?;
        ran?;
        complete(&Ending::new(outcome.missing(), None))?;
        let (grids, rigs): (Vec<_>, Vec<_>) = kept.take().into_iter().unzip();
        let rig = rigs.into_iter().flatten().next_back();
        Ok((grids.into_iter().flatten().collect(), rig))
    }
}
