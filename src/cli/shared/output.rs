//! Where results may be written.

use super::usage;
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};

/// Refuses what cannot or must not be written, before any work is done: an existing file unless
/// `force`, anything that is no regular file, a folder that is not there.
pub(crate) fn may_write(path: &Path, force: bool) -> anyhow::Result<()> {
    let shown = path.display();
    match path.metadata() {
        Ok(found) if !found.is_file() => bail!("{shown}: is not a regular file; name another"),
        Ok(_) if !force => {
            bail!("{shown}: exists already; name another file, or add --force to replace it")
        }
        _ => {}
    }
    let folder = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    if !folder.is_dir() {
        bail!("{}: no such folder; create it first", folder.display());
    }
    Ok(())
}

/// Refuses outputs that would overwrite each other or an input.
pub(crate) fn distinct<'a>(paths: impl IntoIterator<Item = &'a Path>) -> anyhow::Result<()> {
    let mut seen: Vec<PathBuf> = Vec::new();
    for path in paths {
        let folder = path
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let named = || {
            folder
                .canonicalize()
                .unwrap_or_else(|_| folder.to_owned())
                .join(path.file_name().unwrap_or_default())
        };
        let real = path.canonicalize().unwrap_or_else(|_| named());
        if seen.contains(&real) {
            return Err(usage::wrong(format!(
                "{}: named twice; inputs and outputs are different files",
                path.display()
            )));
        }
        seen.push(real);
    }
    Ok(())
}

/// An earlier file, set aside while a new one of its name is made. It comes back unless something
/// new was kept.
pub(crate) struct Aside {
    path: PathBuf,
    earlier: Option<PathBuf>,
}

impl Aside {
    /// Sets aside what is at `path`, if anything.
    pub(crate) fn new(path: &Path) -> anyhow::Result<Self> {
        let mut earlier = path.as_os_str().to_owned();
        earlier.push(format!(".{}.earlier", std::process::id()));
        let earlier = PathBuf::from(earlier);
        let there = path.exists();
        if there {
            std::fs::rename(path, &earlier)
                .with_context(|| format!("{}: cannot be replaced", path.display()))?;
        }
        Ok(Self {
            path: path.to_owned(),
            earlier: there.then_some(earlier),
        })
    }

    /// The new file is whole: the earlier one goes.
    pub(crate) fn replaced(mut self) {
        if let Some(earlier) = self.earlier.take() {
            // At worst it stays, under its other name.
            let _ = std::fs::remove_file(earlier);
        }
    }

    /// The new file is only a part: both stay.
    pub(crate) fn keep_both(mut self) {
        if let Some(earlier) = self.earlier.take() {
            tracing::warn!(
                "{}: incomplete; the earlier one is {}",
                self.path.display(),
                earlier.display()
            );
        }
    }
}

impl Drop for Aside {
    fn drop(&mut self) {
        if let Some(earlier) = &self.earlier {
            // At worst it stays, under its other name.
            let _ = std::fs::rename(earlier, &self.path);
        }
    }
}

/// Prints to standard output. A reader that went away (`| head`) has read enough: no error.
pub(crate) fn print(text: &str) -> anyhow::Result<()> {
    use std::io::Write;
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("standard output"),
    }
}

/// Prints a value as JSON.
pub(crate) fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}
