//! The log of a search, which a later one resumes.

use super::held::HeldRun;
use super::{Known, LoggedTrial, TrialValues};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use svl_core::filter::FilterModel;
use svl_core::matcher::Algorithm;
use svl_core::{Error, Result};
use svl_report::outputs::Outputs;
use svl_score::judge::{METRICS, Metric};
use svl_score::manifest::{Manifest, Purpose, hash};

/// The log of the trials: a row for each setting and number of pairs, written as it is known.
pub struct TrialLog {
    writer: csv::Writer<std::fs::File>,
    /// Hash of all that the values depend on: the pairs, and how they are scored.
    key: String,
    /// Values of an earlier search, by algorithm, setting and pairs.
    known: BTreeMap<(String, String, usize), Option<TrialValues>>,
}

const HEAD: [&str; 5] = ["data", "algorithm", "generation", "pairs", "setting"];

impl TrialLog {
    /// Opens the log of a search on `training`; with `resume` the one at `path` is continued.
    ///
    /// # Errors
    /// [`Error::Invalid`] for the log of another search; [`Error::Io`], [`Error::Format`].
    pub fn open(
        path: &Path,
        training: &[HeldRun],
        filters: &[Arc<FilterModel>],
        resume: bool,
        logs: Outputs,
    ) -> Result<Self> {
        let manifest = Manifest::new("tune", &[])?;
        // Times belong to a machine.
        let mut words = manifest.identity_hash(Purpose::Keep)? + &format!("{:?}", manifest.machine);
        let filters = filters.iter().map(|filter| filter.hash());
        filters.for_each(|hash| words += &format!(" {hash:x}"));
        for part in training {
            words += &format!("{:?} {:?}", part.judge().grid, part.judge().cells);
            for frame in &part.frames {
                words += &format!(" {:x}", frame.input_hash(frame.pair.hash()));
            }
        }
        let key = hash(&words)[..12].to_owned();
        let text = if resume {
            whole_lines(path)?
        } else {
            Vec::new()
        };
        let mut known = BTreeMap::new();
        if !text.is_empty() {
            let mut reader = csv::Reader::from_reader(&text[..]);
            for record in reader.deserialize() {
                let record: BTreeMap<String, String> =
                    record.map_err(|e| Error::format(path, format!("is not a log: {e}")))?;
                let Some((place, values)) = entry(&record, &key) else {
                    return Err(Error::Invalid(format!(
                        "{}: is the log of a search on other pairs, or by another svl or machine; \
                         remove it, or name another -o",
                        path.display()
                    )));
                };
                known.insert(place, values);
            }
            // The log is continued.
            std::fs::OpenOptions::new()
                .write(true)
                .open(path)
                .and_then(|file| file.set_len(text.len() as u64))
                .map_err(|e| Error::io(path, e))?;
            logs.keep_both();
        } else {
            if resume {
                tracing::warn!("{}: there is no log to resume from", path.display());
            }
            let mut logs = logs;
            logs.set_aside()?;
            logs.commit();
        }
        let file = std::fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(path)
            .map_err(|e| Error::io(path, e))?;
        let mut log = Self {
            writer: csv::Writer::from_writer(file),
            key,
            known,
        };
        if text.is_empty() {
            let metrics = METRICS.iter().map(|metric| metric.name);
            let written = log.writer.write_record(HEAD.into_iter().chain(metrics));
            written.map_err(|e| Error::io(path, e.into()))?;
        }
        Ok(log)
    }

    /// The trials of an algorithm that are known.
    pub fn known(&self, base: &Algorithm) -> Known {
        let own = self.known.iter();
        let own = own.filter(|((algorithm, _, _), _)| *algorithm == base.written());
        own.map(|((_, setting, pairs), values)| ((setting.clone(), *pairs), values.clone()))
            .collect()
    }

    /// Writes a trial.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&mut self, base: &Algorithm, trial: &LoggedTrial<'_>) -> Result<()> {
        let head = [
            self.key.clone(),
            base.written(),
            trial.generation.to_string(),
            trial.pairs.to_string(),
            trial.setting.to_owned(),
        ];
        let value = |metric| trial.values.and_then(|values| values.get(metric));
        let metrics = METRICS
            .iter()
            .map(|metric| value(metric).map_or(String::new(), |v| v.to_string()));
        let written = self.writer.write_record(head.into_iter().chain(metrics));
        let written = written
            .map_err(std::io::Error::from)
            .and_then(|()| self.writer.flush());
        written.map_err(|error| Error::io("the log of the search", error))
    }
}

/// A row of a log with that key.
fn entry(
    record: &BTreeMap<String, String>,
    key: &str,
) -> Option<((String, String, usize), Option<TrialValues>)> {
    let text = |name: &str| record.get(name).map(String::as_str);
    if text("data")? != key {
        return None;
    }
    let place = (
        text("algorithm")?.to_owned(),
        text("setting")?.to_owned(),
        text("pairs")?.parse().ok()?,
    );
    let value = |metric: &'static Metric| text(metric.name)?.parse().ok();
    let values = TrialValues::from_fn(value);
    let is_failed = values == TrialValues::default();
    Some((place, (!is_failed).then_some(values)))
}

/// The lines of a file without one that was being written when svl was killed; none if there is no
/// file.
///
/// # Errors
/// [`Error::Io`].
fn whole_lines(path: &Path) -> Result<Vec<u8>> {
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
