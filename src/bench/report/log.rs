//! The rows of an unfinished report as a log: results that `svl score --resume` need not match
//! again.

use super::rows::{CellRow, CsvCells, FailureRow, Record, Row, hash_words};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::time::Duration;
use svl_core::depth::GridSettings;
use svl_core::stereo::{Cell, CellDepth, CellState, DepthGrid, Frame};
use svl_core::timing::{Stage, StageTimes};
use svl_core::{Error, Result};
use svl_data::files::ColumnPlaces;
use svl_data::manifest::{Manifest, Purpose};
use svl_data::score::{MatchFailure, RunPart};

/// The run that a killed or interrupted `svl score` left in a folder.
pub struct EarlierRun {
    /// The folders `folder.earlier-N` that the same run left when it was resumed and killed again.
    pub others: Vec<PathBuf>,
}

impl EarlierRun {
    /// Opens the run of a folder that `manifest` resumes: run id and beginning become those of the
    /// earlier one. None without a report there.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the differences if the report is of another run: its times and
    /// results would not be comparable. [`Error::Io`].
    pub fn open(folder: &Path, manifest: &mut Manifest) -> Result<Option<Self>> {
        if !folder.join("manifest.json").is_file() {
            return Ok(None);
        }
        let earlier = Manifest::read(folder)?;
        let differences = earlier.differences(manifest, Purpose::Resume)?;
        if !differences.is_empty() {
            return Err(Error::Invalid(format!(
                "{}: cannot be resumed, as it was another run: {}; without --resume it is scored \
                 again",
                folder.display(),
                differences.join("; ")
            )));
        }
        let mut others = set_aside(folder);
        others.retain(|other| Manifest::read(other).is_ok_and(|of| of.run_id == earlier.run_id));
        let resumed = std::mem::replace(&mut manifest.began, earlier.began);
        manifest.run_id = earlier.run_id;
        manifest.resumed = earlier.resumed;
        manifest.warnings = earlier.warnings;
        manifest.resumed.push(resumed);
        for (own, before) in manifest.algorithms.iter_mut().zip(earlier.algorithms) {
            // They are written again, from all parts.
            let of_part: Vec<_> = before.warnings().collect();
            manifest
                .warnings
                .retain(|warning| !of_part.contains(warning));
            own.program = before.program;
        }
        Ok(Some(Self { others }))
    }
}

/// Results of an earlier run, by run, seed, pair and algorithm.
#[derive(Default)]
pub struct ResultLog {
    results: HashMap<PairKey, HashMap<String, LoggedResult>>,
    /// The folders that contain it besides the report's own.
    others: Vec<PathBuf>,
}

/// A pair: name of its recording, seed of its arena, its number, its perturbation.
type PairKey = (Option<String>, Option<u64>, u64, Option<String>);

/// Results of the algorithms for a pair.
pub struct LoggedPair<'a> {
    results: Option<&'a HashMap<String, LoggedResult>>,
    /// The input hash of the frame as it is read now.
    input_hash: String,
}

impl<'a> LoggedPair<'a> {
    /// The result of that algorithm, if pixels, geometry and truth were the same.
    pub fn get(&self, algorithm: &str) -> Option<&'a LoggedResult> {
        let result = self.results?.get(algorithm)?;
        (result.row.input_hash == self.input_hash).then_some(result)
    }
}

/// Result of an algorithm for a pair.
pub struct LoggedResult {
    pub row: Row,
    pub grid: DepthGrid,
    /// Hash of the disparity map, and of own cells.
    pub hash: u128,
}

impl ResultLog {
    /// Reads the results of the run that `manifest` resumes from its folder, and notes that in the
    /// manifest. Incomplete lines are dropped, and results without all their cells. Without a
    /// report there the log is empty.
    ///
    /// # Errors
    /// As [`EarlierRun::open`]; [`Error::Format`].
    pub fn read(folder: &Path, manifest: &mut Manifest, grid: GridSettings) -> Result<Self> {
        let Some(earlier) = EarlierRun::open(folder, manifest)? else {
            return Ok(Self::default());
        };
        let mut log = Self::default();
        log.take(folder, grid)?;
        for other in &earlier.others {
            log.take(other, grid)?;
        }
        log.others = earlier.others;
        // The pairs that failed are matched again, and those that fail again are reported again.
        let failures = whole_rows::<FailureRow>(&folder.join("failures.csv"))?;
        let words = |row: FailureRow| {
            let (algorithm, reason) = (row.algorithm, row.reason);
            MatchFailure { algorithm, reason }.words(row.sequence)
        };
        let told: HashSet<_> = failures.into_iter().map(words).collect();
        manifest.warnings.retain(|warning| !told.contains(warning));
        Ok(log)
    }

    fn take(&mut self, folder: &Path, grid: GridSettings) -> Result<()> {
        let mut cells: HashMap<(PairKey, String), Vec<CellRow>> = HashMap::new();
        for cell in whole_rows::<CellRow>(&folder.join("cells.csv"))? {
            let pair = pair_key(&cell.run, cell.seed, cell.sequence, &cell.stress);
            cells
                .entry((pair, cell.algorithm.clone()))
                .or_default()
                .push(cell);
        }
        for row in whole_rows::<Row>(&folder.join("rows.csv"))? {
            let pair = pair_key(&row.run, row.seed, row.sequence, &row.stress);
            let algorithm = row.algorithm.clone();
            let own = cells.remove(&(pair.clone(), algorithm.clone()));
            let grid = own.and_then(|own| depth_grid(&own, grid));
            let hash = u128::from_str_radix(&row.result_hash, 16).ok();
            if let Some((grid, hash)) = grid.zip(hash) {
                let of_pair = self.results.entry(pair).or_default();
                of_pair.insert(algorithm, LoggedResult { row, grid, hash });
            }
        }
        Ok(())
    }

    /// The known results of a frame of that run and seed.
    pub fn pair(&self, run: &RunPart, seed: Option<u64>, frame: &Frame) -> LoggedPair<'_> {
        let name = Some(run.name.clone()).filter(|name| !name.is_empty());
        let key = pair_key(&name, seed, frame.sequence, &run.stress);
        let results = self.results.get(&key);
        let input = |_| hash_words(frame.input_hash(frame.pair.hash()));
        LoggedPair {
            results,
            input_hash: results.map_or_else(String::new, input),
        }
    }

    /// The number of results.
    pub fn len(&self) -> usize {
        self.results.values().map(HashMap::len).sum()
    }

    pub fn is_empty(&self) -> bool {
        self.results.is_empty()
    }

    /// The folders that the log was read from besides the report's own.
    pub fn others(&self) -> &[PathBuf] {
        &self.others
    }
}

impl LoggedResult {
    /// The times, to the microseconds of the row.
    pub fn times(&self) -> StageTimes {
        let row = &self.row;
        let stages = [
            (Stage::Smoothing, row.smoothing_us),
            (Stage::Texture, row.texture_us),
            (Stage::Matching, row.matching_us),
            (Stage::Checks, row.checks_us),
            (Stage::Filters, row.filters_us.unwrap_or_default()),
        ];
        let whole: u64 = stages.iter().map(|(_, us)| us).sum();
        // The rounding of each stage, at most 1 us, is in their sum.
        let cut_ns = row.total_us.saturating_sub(whole) * 1000 / stages.len() as u64;
        let mut times = StageTimes::default();
        for (stage, us) in stages {
            times.add(
                stage,
                Duration::from_micros(us) + Duration::from_nanos(cut_ns),
            );
        }
        times
    }
}

fn pair_key(
    run: &Option<String>,
    seed: Option<u64>,
    sequence: u64,
    stress: &Option<String>,
) -> PairKey {
    (run.clone(), seed, sequence, stress.clone())
}

/// The grid of these rows; none unless all its cells are there.
fn depth_grid(rows: &[CellRow], settings: GridSettings) -> Option<DepthGrid> {
    let shape = settings.shape();
    let mut cells = vec![None; shape.cells()];
    for row in rows {
        let (column, line) = (row.column as usize, row.row as usize);
        if column >= shape.columns || line >= shape.rows {
            return None;
        }
        let depth = match (row.median_px, row.p20_px, row.p80_px) {
            (Some(median_px), Some(p20_px), Some(p80_px)) => Some(CellDepth {
                median_px: median_px as f32,
                p20_px: p20_px as f32,
                p80_px: p80_px as f32,
                distance_m: row.distance_m,
            }),
            _ => None,
        };
        cells[line * shape.columns + column] = Some(Cell {
            valid_share: row.valid_share,
            depth,
            probability: row.probability,
            evidence: None,
            too_close: row.state == Some(CellState::TooClose),
        });
    }
    let cells = cells.into_iter().collect::<Option<Vec<_>>>()?;
    DepthGrid::new(shape, cells).ok()
}

/// The rows of a CSV file up to the first incomplete one; none if there is no file.
///
/// # Errors
/// [`Error::Io`].
pub fn whole_rows<R: Record>(path: &Path) -> Result<Vec<R>> {
    let bytes = whole_lines(path)?;
    let mut reader = csv::Reader::from_reader(&bytes[..]);
    let Ok(places) = reader.headers().map(ColumnPlaces::new) else {
        return Ok(Vec::new());
    };
    let parse = |line: csv::Result<csv::StringRecord>| {
        let line = line.ok()?;
        let (places, line) = (&places, &line);
        R::parse(CsvCells { places, line }).ok()
    };
    Ok(reader.records().map_while(parse).collect())
}

/// The lines of a file without one that was being written when svl was killed; none if there is no
/// file.
///
/// # Errors
/// [`Error::Io`].
pub(crate) fn whole_lines(path: &Path) -> Result<Vec<u8>> {
    match std::fs::read(path) {
        Ok(mut bytes) => {
            let end = bytes.iter().rposition(|&b| b == b'\n');
            bytes.truncate(end.map_or(0, |i| i + 1));
            Ok(bytes)
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(Error::io(path, error)),
    }
}

/// The folders that earlier reports of this folder were set aside in.
fn set_aside(folder: &Path) -> Vec<PathBuf> {
    let parent = folder.parent().filter(|parent| *parent != Path::new(""));
    let mut name = folder.file_name().unwrap_or_default().to_os_string();
    name.push(".earlier-");
    let entries = std::fs::read_dir(parent.unwrap_or(Path::new(".")));
    let entries = entries.into_iter().flatten().flatten();
    let is_earlier = |path: &PathBuf| {
        let file = path.file_name().unwrap_or_default();
        file.as_encoded_bytes().starts_with(name.as_encoded_bytes())
    };
    let paths = entries.map(|entry| entry.path());
    paths.filter(is_earlier).collect()
}
