//! `[source] kind = "recording"`: files and patterns, a run for each file.

use super::pairs::{CropScale, PairRange};
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};

/// Limit of the skews that may be allowed, milliseconds.
const MAX_SKEW_MS: f64 = 60_000.0;

/// Recordings, bags and folders of pairs, and what is taken of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingRuns {
    /// Paths and patterns (`*`, `?`, `[a-z]`, `**`), relative to `folder`.
    pub files: Vec<String>,
    /// The scenario file's folder.
    pub folder: PathBuf,
    /// Topics of the left and right images in a recording that svl did not write, or patterns in
    /// a folder.
    pub topics: [Option<String>; 2],
    /// Whether each image holds the left and the right one, side by side.
    pub side_by_side: bool,
    /// Pairs per second of images or videos [default: by their stamps].
    pub fps: Option<f64>,
    /// How many of 16 bits the images use [default: decided by the first pairs].
    pub bits: Option<u8>,
    /// Largest skew of a pair that is made by stamp.
    pub max_skew_ms: Option<f64>,
    /// Topic of another sensor that measures the truth.
    pub truth: Option<String>,
    /// Largest difference of the stamps of a pair and its measurement.
    pub truth_skew_ms: Option<f64>,
    /// As `--calib` takes it; a path is relative to `folder`. `own` is the default.
    pub calib: Option<String>,
    pub range: PairRange,
    pub window: CropScale,
}

/// One file of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingRun {
    /// As much of the end of its path as no other run has.
    pub name: String,
    pub path: PathBuf,
}

impl RecordingRuns {
    /// # Errors
    /// [`Error::Invalid`] for what takes nothing.
    pub(super) fn validate(&self) -> Result<()> {
        let wrong = |what: String| Err(Error::Invalid(format!("source.{what}")));
        if self.files.is_empty() || self.files.iter().any(String::is_empty) {
            return wrong("files: at least one path or pattern".into());
        }
        let unpaired = self.topics.iter().filter(|topic| topic.is_some()).count() == 1;
        if unpaired {
            return wrong("left and source.right belong together: name both topics".into());
        }
        if self.truth_skew_ms.is_some() && self.truth.is_none() {
            return wrong("truth_skew_ms is for source.truth".into());
        }
        let within = |value: Option<f64>, least, most| {
            value.is_none_or(|value| (least..=most).contains(&value))
        };
        for (name, value, least, most) in [
            ("fps", self.fps, 0.001, 100_000.0),
            ("bits", self.bits.map(f64::from), 8.0, 16.0),
            ("max_skew_ms", self.max_skew_ms, 0.0, MAX_SKEW_MS),
            ("truth_skew_ms", self.truth_skew_ms, 0.0, MAX_SKEW_MS),
        ] {
            if !within(value, least, most) {
                return wrong(format!("{name}: {least} to {most}"));
            }
        }
        self.range
            .validate()
            .and_then(|()| self.window.validate())
            .or_else(|error| wrong(error.to_string()))
    }

    /// The files, those of a pattern in natural order (2 before 10), each once.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming a pattern that is malformed or matches nothing; [`Error::Io`].
    pub fn runs(&self) -> Result<Vec<RecordingRun>> {
        let mut paths: Vec<PathBuf> = Vec::new();
        for file in &self.files {
            for path in self.matches(file)? {
                if !paths.contains(&path) {
                    paths.push(path);
                }
            }
        }
        let run = |path: &PathBuf| RecordingRun {
            name: unique_end(path, &paths),
            path: path.clone(),
        };
        Ok(paths.iter().map(run).collect())
    }

    fn matches(&self, file: &str) -> Result<Vec<PathBuf>> {
        let path = self.folder.join(file);
        // A name that exists is no pattern, whatever brackets it has.
        if !file.contains(['*', '?', '[']) || path.exists() {
            return Ok(vec![path]);
        }
        let wrong = |what: &str| Error::Invalid(format!("source.files: '{file}' {what}"));
        let folder = glob::Pattern::escape(&self.folder.to_string_lossy());
        let pattern = Path::new(&folder).join(file);
        let found = glob::glob(&pattern.to_string_lossy());
        let found = found.map_err(|e| wrong(&format!("is no pattern: {}", e.msg)))?;
        let mut paths = Vec::new();
        for path in found {
            paths.push(path.map_err(|e| Error::io(e.path().to_owned(), e.into()))?);
        }
        if paths.is_empty() {
            let folder = match self.folder.as_os_str().is_empty() {
                true => "here".to_owned(),
                false => format!("in {}", self.folder.display()),
            };
            return Err(wrong(&format!("matches nothing {folder}")));
        }
        paths.sort_by(|a, b| natord::compare(&a.to_string_lossy(), &b.to_string_lossy()));
        Ok(paths)
    }
}

/// The shortest end of `path` that no other of `paths` has.
fn unique_end(path: &Path, paths: &[PathBuf]) -> String {
    let parts: Vec<_> = path.components().collect();
    let ends = (1..=parts.len()).map(|n| parts[parts.len() - n..].iter().collect::<PathBuf>());
    let is_alone = |end: &PathBuf| paths.iter().filter(|other| other.ends_with(end)).count() == 1;
    let end = ends.into_iter().find(is_alone);
    end.unwrap_or_else(|| path.to_owned()).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(folder: &Path, files: &[&str]) -> Result<Vec<String>> {
        let runs = RecordingRuns {
            files: files.iter().map(|file| (*file).to_owned()).collect(),
            folder: folder.to_owned(),
            ..RecordingRuns::default()
        };
        runs.runs()
            .map(|runs| runs.into_iter().map(|run| run.name).collect())
    }

    #[test]
    fn patterns_are_sorted_naturally_and_each_file_is_one_run() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("a [day]");
        for file in [
            "run2.mcap",
            "run10.mcap",
            "run1.mcap",
            "night/run2.mcap",
            "x[1].mcap",
        ] {
            let path = folder.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let all = runs(&folder, &["run10.mcap", "run*.mcap"]).unwrap();
        assert_eq!(all, ["run10.mcap", "run1.mcap", "run2.mcap"]);
        let both = runs(&folder, &["run2.mcap", "night/*.mcap"]).unwrap();
        assert_eq!(both[1], "night/run2.mcap");
        assert!(both[0].ends_with("a [day]/run2.mcap"), "{both:?}");
        assert_eq!(runs(&folder, &["x[1].mcap"]).unwrap(), ["x[1].mcap"]);
        assert_eq!(runs(&folder, &["**/run2.mcap"]).unwrap().len(), 2);
    }

    #[test]
    fn a_pattern_that_matches_nothing_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = runs(folder.path(), &["*.bag"]).unwrap_err().to_string();
        assert!(error.contains("'*.bag' matches nothing in "), "{error}");
        let error = runs(folder.path(), &["[a"]).unwrap_err().to_string();
        assert!(error.contains("'[a' is no pattern"), "{error}");
    }
}
