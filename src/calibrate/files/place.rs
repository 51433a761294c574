//! Where a calibration's file lies, or its two.

use super::{FORMATS, Format};
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Both of `left.yaml,right.yaml`, unless a file is called so.
pub(super) fn two_of(path: &Path) -> Option<[PathBuf; 2]> {
    let (first, second) = path.to_str()?.split_once(',')?;
    (!path.exists()).then(|| [first.into(), second.into()])
}

/// The files to read: one or two.
///
/// # Errors
/// [`Error::Format`] for a folder without a known pair of files.
pub fn inputs(path: &Path) -> Result<Vec<PathBuf>> {
    if let Some(both) = two_of(path) {
        return Ok(both.into());
    }
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let pairs = || FORMATS.iter().flat_map(|format| format.pairs);
    let found = pairs()
        .map(|pair| pair.map(|name| path.join(name)))
        .find(|both| both.iter().all(|p| p.is_file()));
    found.map(Vec::from).ok_or_else(|| {
        let names = pairs()
            .map(|[left, right]| format!("{left} and {right}"))
            .collect::<Vec<_>>()
            .join("; ");
        Error::format(
            path,
            format!("is a folder without a calibration's two files: {names}; name the file itself"),
        )
    })
}

/// The files that writing `path` in that format makes.
///
/// # Errors
/// [`Error::Format`] when the format takes two files and one is named, or the reverse.
pub fn outputs(path: &Path, format: &Format) -> Result<Vec<PathBuf>> {
    match (two_of(path), format.single) {
        (Some(both), false) => Ok(both.into()),
        (None, true) if !path.is_dir() => Ok(vec![path.to_owned()]),
        (None, false) if path.is_dir() => Ok(format
            .pairs
            .iter()
            .take(1)
            .flatten()
            .map(|name| path.join(name))
            .collect()),
        (_, true) => Err(Error::format(
            path,
            format!("{} is one file; name it", format.title),
        )),
        (_, false) => {
            let reason = format!(
                "{} is two files; name both, `left.yaml,right.yaml`, or a folder",
                format.title
            );
            Err(Error::format(path, reason))
        }
    }
}
