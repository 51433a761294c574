//! The folder of a report.

use anyhow::{Context, bail};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Makes the folder, or lists the files of the report that is there, which are among `names`;
/// refuses a folder that holds anything else, or has not the JSON file `mark` by which svl knows
/// its own.
pub(crate) fn earlier_report(
    folder: &Path,
    names: &[&str],
    mark: &str,
) -> anyhow::Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let paths = entries
        .map(|entry| entry.map(|e| e.path()))
        .collect::<Result<Vec<_>, _>>();
    let paths = paths.with_context(|| folder.display().to_string())?;
    let foreign = |path: &&PathBuf| {
        !names
            .iter()
            .any(|name| path.file_name() == Some(name.as_ref()))
    };
    if let Some(path) = paths.iter().find(foreign) {
        bail!(
            "{}: not part of a report; name another folder with --out",
            path.display()
        );
    }
    let marked = std::fs::read(folder.join(mark))
        .is_ok_and(|json| serde_json::from_slice::<Value>(&json).is_ok());
    if !paths.is_empty() && !marked {
        bail!(
            "{}: holds files but no {mark} of svl's; name another folder with --out",
            folder.display()
        );
    }
    Ok(paths)
}

/// An earlier report, set aside in a folder beside its own while a new one is made. It stays there
/// unless that is whole.
pub(crate) struct Aside(Option<PathBuf>);

impl Aside {
    /// Moves the `files` of the report in `folder`.
    pub(crate) fn of(folder: &Path, files: Vec<PathBuf>) -> anyhow::Result<Self> {
        if files.is_empty() {
            return Ok(Self(None));
        }
        let name = folder
            .file_name()
            .unwrap_or(folder.as_os_str())
            .to_string_lossy();
        let beside = |n: u32| folder.with_file_name(format!("{name}.earlier-{n}"));
        let aside = (1..)
            .map(beside)
            .find(|path| !path.exists())
            .unwrap_or_else(|| beside(0));
        std::fs::create_dir(&aside)
            .with_context(|| format!("{}: cannot make the folder", aside.display()))?;
        for path in files {
            let to = aside.join(path.file_name().unwrap_or_default());
            std::fs::rename(&path, to)
                .with_context(|| format!("{}: cannot replace it", path.display()))?;
        }
        Ok(Self(Some(aside)))
    }

    /// The new report is whole: the earlier one goes.
    pub(crate) fn replaced(mut self) -> anyhow::Result<()> {
        let Some(aside) = self.0.take() else {
            return Ok(());
        };
        std::fs::remove_dir_all(&aside)
            .with_context(|| format!("{}: cannot be removed", aside.display()))
    }
}

impl Drop for Aside {
    fn drop(&mut self) {
        if let Some(aside) = &self.0 {
            tracing::warn!("the earlier report is kept in {}", aside.display());
        }
    }
}

/// Writes a file of a report as JSON.
pub(crate) fn write_json(
    folder: &Path,
    name: &str,
    value: &impl serde::Serialize,
) -> anyhow::Result<()> {
    write(folder, name, serde_json::to_string_pretty(value)? + "\n")
}

/// Writes a file of a report.
pub(crate) fn write(folder: &Path, name: &str, text: String) -> anyhow::Result<()> {
    let path = folder.join(name);
    std::fs::write(&path, text).with_context(|| path.display().to_string())
}
