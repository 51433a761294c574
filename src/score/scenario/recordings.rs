//! `[source] kind = "recording"`: files and patterns, a run for each file.

use std::path::{Path, PathBuf};
use svl_core::{Error, Result};

/// Recordings, bags and folders of pairs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InputFiles {
    /// Paths and patterns (`*`, `?`, `[a-z]`, `**`), relative to `folder`.
    pub files: Vec<String>,
    /// The scenario file's folder.
    pub folder: PathBuf,
}

/// One of the files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputFile {
    /// Shortest end of its path that is unique among the runs.
    pub name: String,
    pub path: PathBuf,
}

impl InputFiles {
    /// The files, those of a pattern in natural order (2 before 10), each once.
    ///
    /// # Errors
    /// [`Error::Invalid`] with a pattern that is malformed or matches nothing; [`Error::Io`].
    pub fn runs(&self) -> Result<Vec<InputFile>> {
        let mut paths: Vec<PathBuf> = Vec::new();
        for file in &self.files {
            for path in self.matches(file)? {
                if !paths.contains(&path) {
                    paths.push(path);
                }
            }
        }
        let run = |path: &PathBuf| InputFile {
            name: unique_end(path, &paths),
            path: path.clone(),
        };
        Ok(paths.iter().map(run).collect())
    }

    fn matches(&self, file: &str) -> Result<Vec<PathBuf>> {
        let path = self.folder.join(file);
        // A name that exists is not a pattern, even with brackets in it.
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
            let folder = if self.folder.as_os_str().is_empty() {
                "here".to_owned()
            } else {
                format!("in {}", self.folder.display())
            };
            return Err(wrong(&format!("matches nothing {folder}")));
        }
        paths.sort_by(|a, b| natord::compare(&a.to_string_lossy(), &b.to_string_lossy()));
        Ok(paths)
    }
}

/// The shortest end of `path` that is unique among `paths`.
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
        let runs = InputFiles {
            files: files.iter().map(|file| (*file).to_owned()).collect(),
            folder: folder.to_owned(),
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
