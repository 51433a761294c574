//! The folder of a report.

use anyhow::{Context, bail};
use std::path::{Path, PathBuf};

/// Makes the folder, or lists the files of the report that is there, which are among `names`; refuses a folder that holds
/// anything else.
pub(super) fn earlier_report(folder: &Path, names: &[&str]) -> anyhow::Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot make the folder", folder.display()))?;
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let paths = entries.map(|entry| entry.map(|e| e.path())).collect::<Result<Vec<_>, _>>();
    let paths = paths.with_context(|| folder.display().to_string())?;
    let foreign = |path: &&PathBuf| !names.iter().any(|name| path.file_name() == Some(name.as_ref()));
    if let Some(path) = paths.iter().find(foreign) {
        bail!("{}: not part of a report; name another folder with --out", path.display());
    }
    Ok(paths)
}

/// Takes an earlier report away.
pub(super) fn remove(earlier: Vec<PathBuf>) -> anyhow::Result<()> {
    for path in earlier {
        std::fs::remove_file(&path).with_context(|| format!("{}: cannot replace it", path.display()))?;
    }
    Ok(())
}

/// Writes a file of a report as JSON.
pub(super) fn write_json(folder: &Path, name: &str, value: &impl serde::Serialize) -> anyhow::Result<()> {
    write(folder, name, serde_json::to_string_pretty(value)? + "\n")
}

/// Writes a file of a report.
pub(super) fn write(folder: &Path, name: &str, text: String) -> anyhow::Result<()> {
    let path = folder.join(name);
    std::fs::write(&path, text).with_context(|| path.display().to_string())
}
