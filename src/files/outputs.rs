//! Output files and folders of a command: claimed before any work, set aside while new ones are
//! written, committed at the end.

use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};

/// Makes a folder, with those above it.
pub fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|e| Error::io(path, e))
}

/// The outputs of a command. Dropped before [`Outputs::commit`] or [`Outputs::keep_both`], they put
/// the earlier files back in place of new ones that are of no use.
#[must_use]
pub struct Outputs(Vec<Output>);

/// One file, or one folder of files.
#[derive(Default)]
struct Output {
    path: PathBuf,
    folder: Option<&'static FolderRule>,
    /// True if the folder did not exist before.
    created: bool,
    /// True if a file that exists may be replaced.
    may_replace: bool,
    /// Locks the folder against another svl.
    _lock: Option<File>,
    /// True if the file or folder at `path` is new.
    begun: bool,
    /// New place of the earlier file, or of the earlier files of the folder.
    aside: Option<PathBuf>,
}

/// Properties by which svl recognizes a folder of its own, which it may replace.
pub struct FolderRule {
    /// Kind of folder, with its article.
    pub kind: &'static str,
    /// True if a file of that name belongs to it.
    pub owns: fn(&str) -> bool,
    /// The folder that it may have in it.
    pub inner: Option<&'static str>,
    /// The JSON file that each such folder has.
    pub mark: &'static str,
    /// Advice on how to name another.
    pub cure: &'static str,
}

/// The folder of figures: no existing file is replaced there.
const FIGURES: FolderRule = FolderRule {
    kind: "the figures to come",
    owns: |_| false,
    inner: None,
    mark: "",
    cure: "name a new or empty folder with --figures",
};

impl Outputs {
    /// Claims files. Refuses, before any work is done, what cannot or must not be written: an
    /// existing file unless `force`, anything that is not a regular file, a missing folder, a file
    /// that is named twice or is one of `inputs`.
    pub fn claim<'a>(
        force: bool,
        inputs: impl IntoIterator<Item = &'a Path>,
        outputs: impl IntoIterator<Item = &'a Path>,
    ) -> Result<Self> {
        let outputs: Vec<&Path> = outputs.into_iter().collect();
        distinct(outputs.iter().copied())?;
        for input in inputs {
            distinct(outputs.iter().copied().chain([input]))?;
        }
        let claim = |path: &&Path| {
            may_write(path, force)?;
            Ok(Output {
                may_replace: force,
                ..Output::new(path, None, false)
            })
        };
        outputs.iter().map(claim).collect::<Result<_>>().map(Self)
    }

    /// Claims a folder, which is created. Refuses one that holds anything but an earlier output of
    /// the same kind.
    pub fn claim_folder(path: &Path, rule: &'static FolderRule) -> Result<Self> {
        Self::claim_locked(path, rule, File::try_lock)
    }

    /// [`Outputs::claim_folder`], together with other processes that claim it so.
    pub fn claim_shared_folder(path: &Path, rule: &'static FolderRule) -> Result<Self> {
        Self::claim_locked(path, rule, File::try_lock_shared)
    }

    fn claim_locked(
        path: &Path,
        rule: &'static FolderRule,
        try_lock: fn(&File) -> std::result::Result<(), TryLockError>,
    ) -> Result<Self> {
        let created = !path.exists();
        make_folder(path)?;
        // Two runs into one folder would mistake each other's files for those of an earlier report.
        // If folders cannot be opened or locked, nothing prevents that.
        let lock = File::open(path).ok();
        if let Some(Err(TryLockError::WouldBlock)) = lock.as_ref().map(try_lock) {
            return Err(Error::Invalid(format!(
                "{}: another svl writes there; wait for it, or {}",
                path.display(),
                rule.cure
            )));
        }
        let output = Output {
            _lock: lock,
            ..Output::new(path, Some(rule), created)
        };
        let files = files(path)?;
        let has_inner = rule.has_inner(path);
        let is_own = has_inner
            || std::fs::read(path.join(rule.mark))
                .is_ok_and(|json| serde_json::from_slice::<serde_json::Value>(&json).is_ok());
        let foreign = files.iter().find(|file| !rule.holds(file));
        // Beside a folder of svl's that is written file by file, those of others stay.
        if let Some(foreign) = foreign.filter(|_| !has_inner) {
            return Err(Error::Invalid(format!(
                "{}: not part of {}; {}",
                foreign.display(),
                rule.kind,
                rule.cure
            )));
        }
        if !files.is_empty() && !is_own {
            let what = match path.join(rule.mark).exists() {
                true => "contains a damaged",
                false => "contains files but no",
            };
            return Err(Error::Invalid(format!(
                "{}: {what} {} of svl's; remove the folder, or {}",
                path.display(),
                rule.mark,
                rule.cure
            )));
        }
        Ok(Self(vec![output]))
    }

    /// Claims further outputs.
    pub fn and(mut self, mut more: Self) -> Self {
        self.0.append(&mut more.0);
        self
    }

    /// Claims also the folder of figures, if they are asked for. It is new or empty, and in none of
    /// the folders claimed before, whose files are set aside.
    pub fn and_figures(self, figures: Option<&Path>) -> Result<Self> {
        let Some(folder) = figures else {
            return Ok(self);
        };
        // The folder may not exist yet, but one above it does.
        let real = folder.ancestors().find_map(|path| {
            let path = if path == Path::new("") {
                Path::new(".")
            } else {
                path
            };
            path.canonicalize().ok()
        });
        let is_above = |output: &Output| {
            let output = output.path.canonicalize().ok();
            (real.as_ref().zip(output)).is_some_and(|(real, output)| real.starts_with(output))
        };
        if self.0.iter().any(is_above) {
            return Err(Error::Usage(format!(
                "{}: is in a folder whose files are replaced; {}",
                folder.display(),
                FIGURES.cure
            )));
        }
        let claimed = Self::claim_folder(folder, &FIGURES)?;
        Ok(self.and(claimed))
    }

    /// Moves the earlier files out of the way.
    pub fn set_aside(&mut self) -> Result<()> {
        self.0.iter_mut().try_for_each(Output::set_aside)
    }

    /// The new files are complete: the earlier ones are removed.
    pub fn commit(mut self) {
        for Output { folder, aside, .. } in self.0.drain(..) {
            let Some(aside) = aside else { continue };
            let removed = match folder {
                Some(_) => std::fs::remove_dir_all(&aside),
                None => std::fs::remove_file(&aside),
            };
            if let Err(error) = removed {
                tracing::warn!("{}: cannot be removed: {error}", aside.display());
            }
        }
    }

    /// The new files are a part of what was asked for: they stay, and so do the earlier ones.
    pub fn keep_both(mut self) {
        // A file that was not begun again comes back, as [`Drop`] sees to.
        for Output { path, aside, .. } in self.0.extract_if(.., |output| output.path.exists()) {
            if let Some(aside) = aside {
                let (path, aside) = (path.display(), aside.display());
                tracing::warn!("{path}: incomplete; the earlier one is {aside}");
            }
        }
    }
}

impl Drop for Outputs {
    fn drop(&mut self) {
        for output in &self.0 {
            if let (Err(error), Some(aside)) = (output.restore(), &output.aside) {
                // The earlier file stays under its other name, so nothing is lost.
                let (path, aside) = (output.path.display(), aside.display());
                tracing::warn!("{path}: {error}; the earlier one is {aside}");
            }
        }
    }
}

impl FolderRule {
    /// True if a file is one of such a folder.
    fn holds(&self, file: &Path) -> bool {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        match file.is_file() {
            true => (self.owns)(&name),
            false => self.inner == Some(&*name),
        }
    }

    /// True if the folder at `path` has the inner one, with folders in it, or with nothing but
    /// files that a killed run had begun.
    fn has_inner(&self, path: &Path) -> bool {
        let is_begun = |file: &PathBuf| file.extension().is_some_and(|ending| ending == "part");
        let inner = self.inner.map(|inner| files(&path.join(inner)));
        inner.is_some_and(|inner| {
            inner.is_ok_and(|within| {
                within.iter().any(|file| file.is_dir()) || within.iter().all(is_begun)
            })
        })
    }
}

/// Removes links, pipes and other special files in the place of files of a folder: the target of a
/// link is not written.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_special_files(folder: &Path, rule: &FolderRule) -> Result<()> {
    for file in files(folder)? {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let is_special = file.is_symlink() || !(file.is_file() || file.is_dir());
        if is_special && (rule.owns)(&name) {
            std::fs::remove_file(&file).map_err(|e| Error::io(&file, e))?;
        }
    }
    Ok(())
}

impl Output {
    fn new(path: &Path, folder: Option<&'static FolderRule>, created: bool) -> Self {
        Self {
            path: path.to_owned(),
            folder,
            created,
            ..Self::default()
        }
    }

    fn set_aside(&mut self) -> Result<()> {
        let refused = |error: std::io::Error| {
            Error::Invalid(format!(
                "{}: cannot be replaced: {error}",
                self.path.display()
            ))
        };
        if self.folder.is_none() {
            if self.path.exists() {
                // The file may have appeared since it was claimed.
                may_write(&self.path, self.may_replace)?;
                let aside = free_file(&self.path);
                std::fs::rename(&self.path, &aside).map_err(refused)?;
                self.aside = Some(aside);
            }
        } else {
            // The files move, not the folder, which may be a mount point.
            let earlier = files(&self.path)?;
            if !earlier.is_empty() {
                let aside = free_name(&self.path);
                std::fs::create_dir(&aside).map_err(refused)?;
                self.aside = Some(aside.clone());
                earlier
                    .iter()
                    .try_for_each(|file| into(&aside, file))
                    .map_err(refused)?;
            }
        }
        // Set only now: a file that could not be moved is not new.
        self.begun = true;
        Ok(())
    }

    /// Removes what is new and puts back what was earlier.
    fn restore(&self) -> std::io::Result<()> {
        let Some(rule) = self.folder else {
            return match &self.aside {
                Some(aside) => std::fs::rename(aside, &self.path),
                // A file that holds something is not removed: it may be another program's by now.
                None if self.begun && self.path.metadata()?.len() == 0 => {
                    std::fs::remove_file(&self.path)
                }
                None => Ok(()),
            };
        };
        if self.begun {
            // A file that cannot be removed is replaced by the earlier file of its name, or stays.
            let files = files(&self.path).unwrap_or_default();
            files
                .iter()
                .filter(|file| rule.holds(file))
                .for_each(|file| drop(std::fs::remove_file(file)));
        }
        if let Some(aside) = &self.aside {
            let files = files(aside).unwrap_or_default();
            files.iter().try_for_each(|file| into(&self.path, file))?;
            std::fs::remove_dir(aside)?;
        }
        if self.created {
            // Fails if the folder is not empty, as it should.
            std::fs::remove_dir(&self.path)?;
        }
        Ok(())
    }
}

/// `FILE.PID.earlier`, or with a number where that exists: in containers the process id is often 1.
fn free_file(file: &Path) -> PathBuf {
    let pid = std::process::id();
    let beside = |n: u32| {
        let mut name = file.as_os_str().to_owned();
        name.push(match n {
            1 => format!(".{pid}.earlier"),
            n => format!(".{pid}-{n}.earlier"),
        });
        PathBuf::from(name)
    };
    (1..)
        .map(beside)
        .find(|path| !path.exists())
        .unwrap_or_else(|| beside(0))
}

/// `FOLDER.earlier-N` with the first number that is free.
fn free_name(folder: &Path) -> PathBuf {
    let name = folder.file_name().unwrap_or(folder.as_os_str());
    let beside = |n: u32| {
        let mut name = name.to_owned();
        name.push(format!(".earlier-{n}"));
        folder.with_file_name(name)
    };
    (1..)
        .map(beside)
        .find(|path| !path.exists())
        .unwrap_or_else(|| beside(0))
}

fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect())
        .map_err(|e| Error::io(folder, e))
}

/// Moves a file into a folder.
fn into(folder: &Path, file: &Path) -> std::io::Result<()> {
    std::fs::rename(file, folder.join(file.file_name().unwrap_or_default()))
}

fn may_write(path: &Path, force: bool) -> Result<()> {
    let shown = path.display();
    match path.metadata() {
        Ok(found) if !found.is_file() => {
            return Err(Error::Invalid(format!(
                "{shown}: is not a regular file; name another"
            )));
        }
        Ok(_) if !force => {
            return Err(Error::Invalid(format!(
                "{shown}: exists already; name another file, or add --force to replace it"
            )));
        }
        Ok(_) if is_being_written(path) => {
            return Err(Error::Invalid(format!(
                "{shown}: another svl is writing it; name another file"
            )));
        }
        _ => {}
    }
    if !parent(path).is_dir() {
        return Err(Error::Invalid(format!(
            "{}: no such folder; create it first",
            parent(path).display()
        )));
    }
    Ok(())
}

/// True if a recorder has locked the file.
fn is_being_written(path: &Path) -> bool {
    let lock = File::open(path).ok().map(|file| file.try_lock());
    matches!(lock, Some(Err(TryLockError::WouldBlock)))
}

/// Refuses a file that is named twice.
pub fn distinct<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let mut seen: Vec<PathBuf> = Vec::new();
    for path in paths {
        // A file that does not exist yet has no canonical name, but its folder has.
        let real = path.canonicalize().unwrap_or_else(|_| {
            let folder = parent(path);
            let real = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
            real.join(path.file_name().unwrap_or_default())
        });
        if seen.contains(&real) {
            return Err(Error::Usage(format!(
                "{}: named twice; inputs and outputs are different files",
                path.display()
            )));
        }
        seen.push(real);
    }
    Ok(())
}

fn parent(path: &Path) -> &Path {
    path.parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// Removes a file, or a link, if it is there.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_file(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(Error::io(path, error)),
        _ => Ok(()),
    }
}

/// Writes a file of a report.
pub fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<()> {
    std::fs::write(path, content).map_err(|e| Error::io(path, e))
}

/// Writes a scenario and, beside it, the page that describes it; replaces nothing. Returns their
/// names in words.
///
/// # Errors
/// The errors of [`Outputs::claim`]; [`Error::Io`].
pub fn write_with_page(path: &Path, toml: &str, markdown: &str) -> Result<String> {
    let page = path.with_extension("md");
    if let Some(there) = [path, page.as_path()]
        .into_iter()
        .find(|path| path.exists())
    {
        let words = format!("{}: exists already; name another file", there.display());
        return Err(Error::Invalid(words));
    }
    let mut outputs = Outputs::claim(false, [], [path, &page])?;
    outputs.set_aside()?;
    write(path, toml)?;
    write(&page, markdown)?;
    outputs.commit();
    Ok(format!(
        "written  {} and {}",
        path.display(),
        page.display()
    ))
}

/// Writes a file of a report as JSON.
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<()> {
    let json = serde_json::to_string_pretty(value).map_err(|e| Error::format(path, e))?;
    write(path, json + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: FolderRule = FolderRule {
        kind: "a report",
        owns: |name| name == "a.json",
        inner: None,
        mark: "a.json",
        cure: "name another",
    };

    fn claim(path: &Path) -> Outputs {
        Outputs::claim(false, [], [path]).unwrap()
    }

    #[test]
    fn a_folder_is_one_run_s_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let first = Outputs::claim_folder(folder.path(), &RULE).unwrap();
        let second = Outputs::claim_folder(folder.path(), &RULE).err().unwrap();
        assert!(second.to_string().contains("another svl writes there"));
        drop(first);
        Outputs::claim_folder(folder.path(), &RULE)
            .unwrap()
            .commit();
    }

    #[test]
    fn a_file_that_appeared_since_the_claim_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        let mut outputs = claim(&path);
        std::fs::write(&path, "another's").unwrap();
        outputs.set_aside().unwrap_err();
        drop(outputs);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "another's");
    }

    #[test]
    fn a_drop_without_commit_removes_only_an_empty_file() {
        let folder = tempfile::tempdir().unwrap();
        for (text, stays) in [("", false), ("data", true)] {
            let path = folder.path().join("out");
            let mut outputs = claim(&path);
            outputs.set_aside().unwrap();
            std::fs::write(&path, text).unwrap();
            drop(outputs);
            assert_eq!(path.exists(), stays, "{text:?}");
        }
    }
}
