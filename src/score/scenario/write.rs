//! A scenario written as a file, and for a manifest.

use super::file::File;
use super::source::calib_with_paths;
use super::{CellKeys, Scenario, ScenarioFilter, ScenarioSource, SourceOptions};
use std::path::{Path, PathBuf};
use svl_core::matcher::{Algorithm, with_paths};
use svl_core::{Error, Result};
use svl_files::relative_path;
use svl_sim::arena::ArenaConfig;

impl Scenario {
    /// The scenario as the text of a file in `folder`, with the files that its patterns match.
    /// Reading it gives an equal scenario; filters and limits are copied unchanged.
    ///
    /// # Errors
    /// The errors of [`Scenario::recordings`]; [`Error::Invalid`] for a path that is not UTF-8.
    #[inline]
    pub fn to_toml(&self, folder: &Path) -> Result<String> {
        let file = self.file(&|path| relative_path(path, folder))?;
        toml::to_string(&file).map_err(|e| self.unwritten(&e))
    }

    /// The scenario for a manifest: that of [`Scenario::to_toml`] in the working folder.
    ///
    /// # Errors
    /// The errors of [`Scenario::to_toml`].
    #[inline]
    pub fn to_json(&self) -> Result<serde_json::Value> {
        let file = self.file(&|path| path.to_owned())?;
        // Through TOML, in which absent keys are absent.
        let table = toml::Table::try_from(&file).map_err(|e| self.unwritten(&e))?;
        serde_json::to_value(table).map_err(|e| self.unwritten(&e))
    }

    fn unwritten(&self, why: &dyn std::fmt::Display) -> Error {
        Error::Invalid(format!("scenario '{}' cannot be written: {why}", self.name))
    }

    /// The options of the source, with its files, and with paths replaced.
    fn source_options(&self, replaced: &dyn Fn(&Path) -> PathBuf) -> Result<SourceOptions> {
        let runs = self.recordings()?;
        let files = runs.iter().map(|run| replaced(&run.path));
        let options = self.options.clone();
        let calib = options.calib;
        Ok(SourceOptions {
            files: files.map(|path| path.display().to_string()).collect(),
            calib: calib.map(|calib| calib_with_paths(&calib, replaced)),
            data: options.data.map(|data| replaced(&data)),
            ..options
        })
    }

    /// The file with its paths replaced.
    fn file(&self, replaced: &dyn Fn(&Path) -> PathBuf) -> Result<File> {
        let path = |path: &str| replaced(Path::new(path)).display().to_string();
        let word = |word: &str| {
            if Path::new(word).is_file() {
                path(word)
            } else {
                word.to_owned()
            }
        };
        let rewritten = |text: &str| with_paths(text, &path, &word);
        let (arena, drive) = match &self.source {
            ScenarioSource::Arena { config, .. } => (Some(config), None),
            ScenarioSource::Drive { config, drive, .. } => (Some(config), Some(drive)),
            ScenarioSource::Dataset { .. } | ScenarioSource::Recording(_) => (None, None),
        };
        let filters = self.filters.iter().map(|filter| ScenarioFilter {
            file: filter.file.as_deref().map(replaced),
            scenario: filter.scenario.iter().map(|path| replaced(path)).collect(),
            ..filter.clone()
        });
        // Filters are added to each algorithm when a scenario is run.
        let algorithms = self.algorithms.iter();
        let algorithms = algorithms.filter(|algorithm| algorithm.filters().is_empty());
        let algorithms = algorithms.map(|algorithm| rewritten(&written(algorithm)));
        let gate = self
            .gate
            .iter()
            .map(|limit| limit.clone().renamed(&rewritten));
        Ok(File {
            name: self.name.clone(),
            description: self.description.clone(),
            algorithms: algorithms.collect(),
            columns: self.columns.clone(),
            ranges: self.ranges.clone(),
            grid: self.grid,
            cells: CellKeys {
                rule: self.cells,
                latency_ms: self.latency.clone(),
            },
            piece: self.piece.clone(),
            robot: self.robot,
            source: self.source_options(replaced)?,
            arena: arena.map(|config| ArenaConfig {
                pieces_m: Vec::new(),
                ..(**config).clone()
            }),
            drive: drive.map(|drive| (**drive).clone()),
            checkpoint: self.checkpoints.clone(),
            filter: filters.collect(),
            stress: self.stress.iter().map(Into::into).collect(),
            gate: gate.map(|limit| toml::Spanned::new(0..0, limit)).collect(),
        })
    }
}

/// An algorithm in a scenario, with its label.
fn written(algorithm: &Algorithm) -> String {
    let label = algorithm.label();
    let is_itself = label.parse::<Algorithm>().is_ok_and(|parsed| {
        parsed.spec().name == algorithm.spec().name && parsed.parameters() == algorithm.parameters()
    });
    if is_itself {
        return label.to_owned();
    }
    format!("{label}={}", algorithm.written())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use svl_files::SideBySide;

    fn equal(a: &Scenario, b: &Scenario) {
        assert_eq!(a.to_json().unwrap(), b.to_json().unwrap());
        assert_eq!((&a.options, &a.source), (&b.options, &b.source));
        assert_eq!(
            (&a.checkpoints, &a.filters, &a.stress),
            (&b.checkpoints, &b.filters, &b.stress)
        );
        assert_eq!((a.grid, a.cells, a.labels()), (b.grid, b.cells, b.labels()));
    }

    #[test]
    fn scenarios_of_the_project_are_equal_when_written_and_read() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        // The published crate does not include them.
        let Ok(files) = std::fs::read_dir(&folder) else {
            return;
        };
        let paths = files.map(|file| file.unwrap().path());
        for path in paths.filter(|path| path.extension().is_some_and(|end| end == "toml")) {
            let scenario = Scenario::read(&path).unwrap();
            let text = scenario.to_toml(&folder).unwrap();
            let again = Scenario::parse(&text, &path).unwrap();
            assert_eq!(text, again.to_toml(&folder).unwrap(), "{}", path.display());
            equal(&scenario, &again);
            assert_eq!(scenario.gate.len(), again.gate.len());
        }
    }

    #[test]
    fn files_of_algorithms_are_relative_to_the_scenario() {
        let folder = tempfile::tempdir().unwrap();
        let at = |path: &str| folder.path().join(path);
        for inner in ["a b", "c"] {
            std::fs::create_dir_all(at(inner)).unwrap();
        }
        for file in ["a b/net.py", "a b/own.mcap"] {
            std::fs::write(at(file), "").unwrap();
        }
        let text = "name = \"s\"\n\
                    algorithms = [\"exec:command='python3 net.py --fast',max_disparity=9\", \
                    \"net=exec:command=net.py\", \"v3\"]\n\
                    [source]\nkind = \"recording\"\nfiles = [\"*.mcap\"]\n\
                    [[gate]]\n\
                    algorithm = \"exec:command='python3 net.py --fast',max_disparity=9\"\n\
                    metric = \"wrong\"\nmax = 0.03\n";
        let scenario = Scenario::parse(text, &at("a b/s.toml")).unwrap();
        let program = at("a b/net.py").display().to_string();
        let command = scenario.algorithms[0].parameters().text("command");
        assert_eq!(command, format!("python3 \"{program}\" --fast"));
        assert_eq!(
            scenario.algorithms[1].parameters().text("command"),
            format!("\"{program}\"")
        );
        assert_eq!(scenario.algorithms[1].label(), "net");
        assert_eq!(scenario.gate[0].algorithm, scenario.algorithms[0].label());
        let beside = scenario.to_toml(&at("c")).unwrap();
        let again = Scenario::parse(&beside, &at("c/t.toml")).unwrap();
        assert_eq!(again.gate[0].algorithm, again.algorithms[0].label());
        assert!(beside.contains("../a b/net.py"), "{beside}");
        let missing = text.replace("\"v3\"", "\"v5:model=t.safetensors\"");
        let error = Scenario::parse(&missing, &at("a b/s.toml")).unwrap_err();
        assert!(
            error
                .to_string()
                .contains(&at("a b/t.safetensors").display().to_string())
        );
    }

    #[test]
    fn labels_are_kept_and_paths_follow_the_file() {
        let folder = tempfile::tempdir().unwrap();
        for inner in ["a/b", "c"] {
            std::fs::create_dir_all(folder.path().join(inner)).unwrap();
        }
        for file in ["a/own.mcap", "a/calib.xml"] {
            std::fs::write(folder.path().join(file), "").unwrap();
        }
        let text = "name = \"s\"\n\
                    algorithms = [\"fast=v3:max_disparity=48\", \"v3:max_disparity=80\", \
                    \"L:p1=20=sgm:p1=20\"]\n\
                    [source]\nkind = \"recording\"\nfiles = [\"*.mcap\"]\ncalib = \"calib.xml\"\n\
                    [[filter]]\ndetects = \"floor\"\nfile = \"b/floor.safetensors\"\n";
        let scenario = Scenario::parse(text, &folder.path().join("a/s.toml")).unwrap();
        let at = |inner: &str| scenario.to_toml(&folder.path().join(inner)).unwrap();
        let (here, below, beside) = (at("a"), at("a/b"), at("c"));
        for (text, own, calib) in [
            (&here, "own.mcap", "calib.xml"),
            (&below, "../own.mcap", "../calib.xml"),
            (&beside, "../a/own.mcap", "../a/calib.xml"),
        ] {
            assert!(text.contains(&format!("files = [\"{own}\"]")), "{text}");
            assert!(text.contains(&format!("calib = \"{calib}\"")), "{text}");
        }
        assert!(
            beside.contains("file = \"../a/b/floor.safetensors\""),
            "{beside}"
        );
        let algorithms = "[\"fast=v3:max_disparity=48\", \"v3:max_disparity=80\", \
                          \"L:p1=20=sgm:p1=20\"]";
        assert!(here.contains(algorithms), "{here}");
    }

    fn optional<S: Strategy>(values: S) -> impl Strategy<Value = Option<S::Value>> {
        prop::option::weighted(0.5, values)
    }

    prop_compose! {
        /// Command-line options that are compatible with each other.
        fn given()(
            topics in optional(("[a-z/]{1,9}", "[a-z/]{1,9}")),
            infos in (optional("[a-z/]{1,9}"), optional("[a-z/]{1,9}")),
            flags in any::<(bool, Option<u8>)>(),
            fps in optional(0.001..1e5),
            skews in (optional(0.0..6e4), optional(0.0..6e4)),
            truth in optional("[a-z/]{1,9}"),
            camera_height_m in optional(0.01..=100.0),
            rectified in optional(("estimate|none|c\\.xml", optional(0.0..=1.0))),
            crop in optional([0..99_usize, 0..99, 1..99, 1..99]),
            scale in optional(0.1..=1.0),
            range in (optional(1..1000_u64), optional((0.0..1e3, 1e3..1e9))),
            allow_loss in optional("[0-9]{1,6}|[0-9]{1,2}(\\.[0-9]{1,3})?%"),
        ) -> SourceOptions {
            let (left, right) = topics.unzip();
            let (calib, alpha) = rectified.unzip();
            let (from_s, to_s) = range.1.unzip();
            SourceOptions {
                left,
                right,
                left_info: infos.0,
                right_info: infos.1,
                side_by_side: flags.0.then_some(SideBySide::TopBottom),
                bits: flags.1.map(|bits| 8 + bits % 9),
                fps,
                max_skew_ms: skews.0,
                truth_skew_ms: skews.1.filter(|_| truth.is_some()),
                truth,
                camera_height_m,
                calib,
                alpha: alpha.flatten(),
                crop,
                scale,
                every: range.0,
                from_s,
                to_s,
                allow_loss: allow_loss.map(|text| text.parse().unwrap()),
                ..SourceOptions::default()
            }
        }
    }

    proptest! {
        #[test]
        fn a_description_comes_back_from_its_toml(given in given()) {
            let files = ["own.mcap".to_owned()];
            let scenario = Scenario::from_recordings(&files, vec!["v5".parse().unwrap()]).unwrap();
            let scenario = scenario.with(&given).unwrap();
            let text = scenario.to_toml(Path::new("")).unwrap();
            let again = Scenario::parse(&text, Path::new("s.toml")).unwrap();
            prop_assert_eq!(scenario.to_json().unwrap(), again.to_json().unwrap());
            // Setting an option again changes nothing.
            let twice = again.with(&given).unwrap();
            prop_assert_eq!(again.options, twice.options);
        }
    }
}
