//! Distances with their disparities, from a table or measured in recordings.

use crate::cli::shared::source::{Topics, open_recording};
use crate::cli::shared::usage;
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::io::Read;
use std::path::{Path, PathBuf};
use svl::calibrate::distance::TargetMeasurement;
use svl::depth;
use svl::depth::GridSettings;
use svl::matcher::{Algorithm, MatchContext, MatchOutput};
use svl::source::Source;
use svl::stereo::{MAX_SIDE, RectifiedPair};

/// Most measurements; more make no better curve.
const MOST: usize = 1000;

/// Largest distance, centimetres.
const MOST_CM: f64 = 1e6;

/// Largest table, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Frames matched per recording; the target stands still, so a few are enough.
const FRAMES: usize = 30;

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

/// Reads a table, or measures recordings given with their distances.
pub(super) fn measurements(
    named: &[String],
    algorithm: &Algorithm,
    cells: &[(usize, usize)],
) -> anyhow::Result<Vec<Measurement>> {
    let mut found = Vec::new();
    for text in named {
        match text.split_once('=') {
            Some((_, "")) => {
                return Err(usage::wrong(format!("{text}: name the recording after =")));
            }
            Some((distance, recording)) => found.push(measure(
                length_cm(distance)?,
                recording.into(),
                algorithm,
                cells,
            )?),
            None => found.extend(table(Path::new(text), algorithm, cells)?),
        }
    }
    if found.len() > MOST {
        bail!("{} measurements: a curve takes {MOST} at most", found.len());
    }
    Ok(found)
}

fn table(
    path: &Path,
    algorithm: &Algorithm,
    cells: &[(usize, usize)],
) -> anyhow::Result<Vec<Measurement>> {
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
    for (number, line) in reader.deserialize().take(MOST + 1).enumerate() {
        let TableLine {
            distance_cm,
            disparity_px,
            recording,
        } = line.map_err(|e| {
            let cure = "expected the columns distance_cm, and disparity_px or recording";
            anyhow::anyhow!("{shown}: measurement {}: {e}; {cure}", number + 1)
        })?;
        if distance_cm > MOST_CM || disparity_px.is_some_and(|px| px > MAX_SIDE as f64) {
            bail!(
                "{shown}: measurement {}: a distance is {MOST_CM} cm at most, a disparity \
                 {MAX_SIDE} px",
                number + 1
            );
        }
        found.push(match (disparity_px, recording) {
            (Some(disparity_px), None) => Measurement {
                distance_cm,
                disparity_px,
                seen: None,
            },
            (None, Some(recording)) => {
                measure(distance_cm, folder.join(recording), algorithm, cells)?
            }
            _ => bail!(
                "{shown}: measurement {}: give its disparity_px or its recording, one of both",
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
        .filter(|cm| *cm > 0.0 && *cm <= MOST_CM)
        .ok_or_else(|| {
            usage::wrong(format!(
                "'{text}' is not a distance up to 10 km; write it as 130cm, 1.3m or 1300mm before ="
            ))
        })
}

fn measure(
    distance_cm: f64,
    recording: PathBuf,
    algorithm: &Algorithm,
    cells: &[(usize, usize)],
) -> anyhow::Result<Measurement> {
    let mut source = open_recording(&recording, &Topics::default())?;
    let mut matcher = algorithm.build()?;
    let settings = GridSettings::default();
    let (mut grids, mut rig, mut output) = (Vec::new(), None, MatchOutput::new()?);
    while let Some(frame) = source.next()?.filter(|_| grids.len() < FRAMES) {
        matcher.compute(
            RectifiedPair::assume(&frame.pair),
            &MatchContext::default(),
            &mut output,
        )?;
        grids.push(depth::grid(output.disparity.disparity(), settings, None));
        rig = frame.rig().copied().or(rig);
    }
    let target = TargetMeasurement::measure(&grids, cells)
        .with_context(|| recording.display().to_string())?;
    let TargetMeasurement {
        disparity_px,
        cells,
        spread_px,
    } = target;
    let focal_baseline_cm_px = rig.map(|rig| 100.0 * rig.focal_px() * rig.baseline_m());
    let seen = Some(RecordedTarget {
        recording,
        frames: grids.len(),
        cells,
        spread_px,
        focal_baseline_cm_px,
    });
    Ok(Measurement {
        distance_cm,
        disparity_px,
        seen,
    })
}
