//! Output files and folders of a command: claimed before any work. Where earlier ones exist, the
//! new ones are written beside them, and take their names once they are whole.

use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use svl_core::{Error, Result};

/// Makes a folder, with those above it.
pub fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|e| Error::io(path, e))
}

/// The outputs of a command. Dropped before [`Outputs::commit`] or [`Outputs::keep_both`], they
/// remove the new files, which are of no use, and the earlier ones stay.
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
    /// Locks the folder, or that of the new files, against another svl.
    lock: Option<File>,
    /// True once new files are written.
    begun: bool,
    /// The folder of the new files, where earlier ones exist.
    beside: Option<PathBuf>,
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
            lock,
            ..Output::new(path, Some(rule), created)
        };
        let files = files(path)?;
        let has_inner = rule.has_inner(path);
        let is_marked = has_inner
            || std::fs::read(path.join(rule.mark))
                .is_ok_and(|json| serde_json::from_slice::<serde_json::Value>(&json).is_ok());
        let is_own = |file: &&PathBuf| rule.holds(file) || file.ends_with(UNFINISHED);
        let foreign = files.iter().find(|file| !is_own(file));
        // Beside a folder of svl's that is written file by file, those of others stay.
        if let Some(foreign) = foreign.filter(|_| !has_inner) {
            return Err(Error::Invalid(format!(
                "{}: not part of {}; {}",
                foreign.display(),
                rule.kind,
                rule.cure
            )));
        }
        if !files.is_empty() && !is_marked {
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

    /// Claims a folder of which some files are made again, and the others stay.
    pub fn remake(folder: &Path, rule: &'static FolderRule) -> Self {
        Self(vec![Output::new(folder, Some(rule), false)])
    }

    /// Makes the places of the new files.
    pub fn begin(&mut self) -> Result<()> {
        self.0.iter_mut().try_for_each(Output::begin)
    }

    /// The place where a file or a folder is written that was claimed as `path`.
    pub fn place(&self, path: &Path) -> PathBuf {
        let claimed = self.0.iter().find(|output| output.path == path);
        claimed.map_or_else(|| path.to_owned(), Output::place)
    }

    /// The new files are whole: they replace the earlier ones.
    pub fn commit(mut self) -> Result<()> {
        self.0.drain(..).try_for_each(|output| output.commit())
    }

    /// The new files are a part of what was asked for: they stay, and so do the earlier ones.
    pub fn keep_both(mut self) {
        // A place where nothing was written is removed, as [`Drop`] sees to.
        for output in self.0.extract_if(.., |output| output.place().exists()) {
            if output.beside.is_some() {
                let (path, new) = (output.path.display(), output.place());
                let new = new.display();
                tracing::warn!("{path}: the earlier one; the new one is incomplete: {new}");
            }
        }
    }
}

impl Drop for Outputs {
    fn drop(&mut self) {
        for output in &self.0 {
            if let (Err(error), Some(beside)) = (output.discard(), &output.beside) {
                tracing::warn!("{}: {error}", beside.display());
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

    /// True if a file is one of this output.
    fn holds(&self, file: &Path) -> bool {
        match self.folder {
            Some(rule) => rule.holds(file),
            None => file.file_name() == self.path.file_name() && !file.is_dir(),
        }
    }

    fn begin(&mut self) -> Result<()> {
        let (has_earlier, beside) = match self.folder {
            // Within the folder, which may be a mount point.
            Some(_) => (!files(&self.path)?.is_empty(), self.path.join(UNFINISHED)),
            None => (self.path.exists(), beside(&self.path)),
        };
        if has_earlier {
            if self.folder.is_none() {
                // The file may have appeared since it was claimed.
                may_write(&self.path, self.may_replace)?;
            }
            // A killed svl may have left files there.
            let made = self
                .clear(&beside)
                .and_then(|()| std::fs::create_dir(&beside));
            made.map_err(|e| self.refused(&e))?;
            if let Ok(folder) = File::open(&beside)
                && self.folder.is_none()
            {
                let _ = folder.try_lock();
                self.lock = Some(folder);
            }
            self.beside = Some(beside);
        }
        self.begun = true;
        Ok(())
    }

    fn place(&self) -> PathBuf {
        match (&self.beside, self.folder) {
            (None, _) => self.path.clone(),
            (Some(beside), Some(_)) => beside.clone(),
            (Some(beside), None) => beside.join(self.path.file_name().unwrap_or_default()),
        }
    }

    fn refused(&self, error: &std::io::Error) -> Error {
        let path = self.path.display();
        Error::Invalid(format!("{path}: cannot be replaced: {error}"))
    }

    fn commit(&self) -> Result<()> {
        let Some(beside) = &self.beside else {
            return Ok(());
        };
        let new = files(beside)?;
        let folder = self
            .folder
            .map_or_else(|| parent(&self.path), |_| &self.path);
        let place = |file: &PathBuf| folder.join(file.file_name().unwrap_or_default());
        if let Some(path) = new.iter().map(place).find(|path| path.is_dir()) {
            let shown = path.display();
            return Err(Error::Invalid(format!(
                "{shown}: is a folder in the place of a file; remove or rename it"
            )));
        }
        let moved = new.iter();
        let mut moved = moved.map(|file| std::fs::rename(file, place(file)));
        moved.try_for_each(|moved| moved.map_err(|e| self.refused(&e)))?;
        if self.folder.is_some_and(|rule| rule.inner.is_none()) {
            let is_new = |file: &PathBuf| new.iter().any(|new| new.file_name() == file.file_name());
            let earlier = files(folder)?.into_iter().filter(|file| self.holds(file));
            let mut stale = earlier.filter(|file| !is_new(file));
            stale.try_for_each(|file| remove_file(&file))?;
        }
        std::fs::remove_dir(beside).map_err(|e| Error::io(beside, e))
    }

    /// Removes what is new.
    fn discard(&self) -> std::io::Result<()> {
        match (&self.beside, self.folder) {
            (Some(beside), _) => return self.clear(beside),
            // A file that holds something is not removed: it may be another program's by now.
            (None, None) if self.begun && self.path.metadata()?.len() == 0 => {
                return std::fs::remove_file(&self.path);
            }
            (None, Some(_)) if self.begun => self.remove_own(&self.path)?,
            _ => {}
        }
        if self.created {
            // Fails if the folder is not empty, as it should.
            std::fs::remove_dir(&self.path)?;
        }
        Ok(())
    }

    /// Removes the folder of new files, if it is there and has no others.
    fn clear(&self, beside: &Path) -> std::io::Result<()> {
        if !beside.exists() {
            return Ok(());
        }
        self.remove_own(beside)?;
        std::fs::remove_dir(beside)
    }

    fn remove_own(&self, folder: &Path) -> std::io::Result<()> {
        let files = files(folder).unwrap_or_default();
        let mut own = files.iter().filter(|file| self.holds(file));
        own.try_for_each(std::fs::remove_file)
    }
}

/// The end of the name of a folder of new files.
const UNFINISHED: &str = ".unfinished";

/// The folder of a new file, which has its name there: a pattern of names does not find it beside
/// the earlier one.
fn beside(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(UNFINISHED);
    path.with_file_name(name)
}

/// The new file that a killed svl left beside the one at `path`.
pub fn unfinished(path: &Path) -> Option<PathBuf> {
    let file = beside(path).join(path.file_name()?);
    file.is_file().then_some(file)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect())
        .map_err(|e| Error::io(folder, e))
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
        Ok(_) if is_being_written(path) || is_being_written(&beside(path)) => {
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

/// True if another svl has locked the file, or the folder of new files.
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

/// Writes a file of a report. An earlier one is replaced at once.
pub fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<()> {
    if !path.is_file() {
        return std::fs::write(path, content).map_err(|e| Error::io(path, e));
    }
    let mut outputs = Outputs::claim(true, [], [path])?;
    outputs.begin()?;
    write(&outputs.place(path), content)?;
    outputs.commit()
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
    outputs.begin()?;
    write(path, toml)?;
    write(&page, markdown)?;
    outputs.commit()?;
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
        let third = Outputs::claim_folder(folder.path(), &RULE).unwrap();
        third.commit().unwrap();
    }

    #[test]
    fn a_file_that_appeared_since_the_claim_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        let mut outputs = claim(&path);
        std::fs::write(&path, "another's").unwrap();
        outputs.begin().unwrap_err();
        drop(outputs);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "another's");
    }

    #[test]
    fn a_folder_in_the_place_of_a_file_is_named_and_nothing_is_moved() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("b.csv")).unwrap();
        let mut outputs = Outputs::remake(folder.path(), &RULE);
        outputs.begin().unwrap();
        let place = outputs.place(folder.path());
        for name in ["a.json", "b.csv"] {
            std::fs::write(place.join(name), "new").unwrap();
        }
        let error = outputs.commit().unwrap_err().to_string();
        let words = format!("{}: is a folder in the place", path("b.csv").display());
        assert!(error.starts_with(&words), "{error}");
        assert!(!path("a.json").exists());
    }

    #[test]
    fn a_new_file_stands_beside_the_earlier_one_until_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.txt");
        let text = || std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, "earlier").unwrap();
        let begun = |text: &str| {
            let mut outputs = Outputs::claim(true, [], [path.as_path()]).unwrap();
            outputs.begin().unwrap();
            std::fs::write(outputs.place(&path), text).unwrap();
            outputs
        };
        // Another svl does not write it meanwhile, and an error leaves the earlier one alone.
        let outputs = begun("dropped");
        let other = Outputs::claim(true, [], [path.as_path()]).err().unwrap();
        assert!(other.to_string().contains("another svl is writing it"));
        drop(outputs);
        assert_eq!((text(), unfinished(&path)), ("earlier".to_owned(), None));
        begun("incomplete").keep_both();
        let left = unfinished(&path).unwrap();
        assert_eq!(std::fs::read_to_string(&left).unwrap(), "incomplete");
        // The file of a killed svl is replaced, but nothing beside it.
        begun("whole").commit().unwrap();
        assert_eq!((text(), left.exists()), ("whole".to_owned(), false));
        begun("again").keep_both();
        std::fs::write(left.with_file_name("mine"), "").unwrap();
        let mut outputs = Outputs::claim(true, [], [path.as_path()]).unwrap();
        assert!(outputs.begin().is_err());
        drop(outputs);
        assert!(left.with_file_name("mine").exists() && text() == "whole");
        write(&folder.path().join("new"), "1").unwrap();
        write(&folder.path().join("new"), "2").unwrap();
        assert_eq!(std::fs::read(folder.path().join("new")).unwrap(), b"2");
    }

    #[test]
    fn the_files_of_a_folder_are_replaced_together() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let begun = |names: &[&str]| {
            let mut outputs = Outputs::claim_folder(folder.path(), &RULE).unwrap();
            outputs.begin().unwrap();
            for name in names {
                std::fs::write(outputs.place(folder.path()).join(name), "[2]").unwrap();
            }
            outputs
        };
        std::fs::write(path("a.json"), "[1]").unwrap();
        begun(&["a.json"]).keep_both();
        assert!(path(UNFINISHED).is_dir());
        drop(begun(&["a.json"]));
        assert_eq!(std::fs::read_to_string(path("a.json")).unwrap(), "[1]");
        begun(&["b"]).commit().unwrap();
        assert!(
            path("b").exists() && !path("a.json").exists(),
            "the rest is stale"
        );
        assert!(!path(UNFINISHED).exists());
    }

    #[test]
    fn a_drop_without_commit_removes_only_an_empty_file() {
        let folder = tempfile::tempdir().unwrap();
        for (text, stays) in [("", false), ("data", true)] {
            let path = folder.path().join("out");
            let mut outputs = claim(&path);
            outputs.begin().unwrap();
            std::fs::write(&path, text).unwrap();
            drop(outputs);
            assert_eq!(path.exists(), stays, "{text:?}");
        }
    }
}
