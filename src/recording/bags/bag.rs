//! A ROS 2 bag: a folder of MCAP or SQLite files that form one recording.

use std::path::{Path, PathBuf};
use svl_calibrate::yaml::{self, YamlNode};
use svl_core::{Error, Result, counted, inputs, listed};
use svl_files::read_text;

/// The file that rosbag2 writes next to the MCAP files at the end.
const METADATA: &str = "metadata.yaml";
/// Top-level key of the metadata.
const BAG: &str = "rosbag2_bagfile_information";
/// Limit on its size in bytes: thousands of files and topics.
const MAX_BYTES: u64 = 1 << 22;
/// Command that converts a bag svl cannot read; only the ROS that wrote it has its plugins.
const CONVERT: &str = "`ros2 bag convert` of the ROS 2 that recorded it makes an mcap bag, which \
                       svl reads";

/// True if `path` is the folder of a bag: with its metadata, or with its files and no subfolders.
pub fn is_bag(path: &Path) -> bool {
    let holds_no_folder = || {
        path.read_dir()
            // A folder with subfolders is a data set or a project, even if it contains MCAP files.
            .is_ok_and(|mut entries| !entries.any(|e| e.is_ok_and(|e| e.path().is_dir())))
    };
    read_text(&path.join(METADATA), MAX_BYTES).is_ok_and(|text| text.contains(BAG))
        || holds_no_folder() && bag_files(path).is_ok_and(|files| !files.is_empty())
}

/// The files of the recording at `path`, in order: the file itself, or those of a ROS 2 bag.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for a folder that is not a bag, or a bag that svl cannot read,
/// with the remedy.
pub fn files(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let metadata = path.join(METADATA);
    if inputs::is_file(&metadata) {
        let names = names(&metadata)?;
        return Ok(names.into_iter().map(|name| path.join(name)).collect());
    }
    // No metadata: rosbag2 was killed, or the folder is not a bag.
    let files = bag_files(path)?;
    match files.len() {
        0 => Err(Error::format(
            path,
            "is a folder, not a recording, nor a ROS 2 bag: it contains no metadata.yaml, no \
             .mcap and no .db3",
        )),
        1 => Ok(files),
        _ => {
            let shown = path.display();
            let cure = format!("`ros2 bag reindex {shown}` writes it for the files of one bag");
            let reason = format!(
                "is a folder of recordings, without a bag's metadata.yaml: {}; {cure}",
                name_one(&files)
            );
            Err(Error::format(path, reason))
        }
    }
}

/// The only file of the recording at `path`.
///
/// # Errors
/// The errors of [`files`]; also [`Error::Format`] for a bag of several files, which lists them.
pub fn only_file(path: &Path) -> Result<PathBuf> {
    match &files(path)?[..] {
        [file] => Ok(file.clone()),
        files => Err(several_files(path, files)),
    }
}

/// The error if one file is required, but `path` is a bag of several.
pub(crate) fn several_files(path: &Path, files: &[PathBuf]) -> Error {
    let count = counted(files.len() as u64, "file");
    Error::format(path, format!("is a bag of {count}: {}", name_one(files)))
}

/// The names of a bag's files, from its metadata.
fn names(metadata: &Path) -> Result<Vec<String>> {
    let wrong = |reason: String| Error::format(metadata, reason);
    let text = yaml::parse(&read_text(metadata, MAX_BYTES)?);
    let YamlNode::Table(mut root) = text.map_err(|fault| Error::format(metadata, fault))? else {
        return Err(wrong("is not that of a ROS 2 bag".to_owned()));
    };
    let Some(YamlNode::Table(bag)) = root.remove(BAG) else {
        return Err(wrong(format!(
            "is not that of a ROS 2 bag: it has no {BAG}"
        )));
    };
    // rosbag2 writes modes in upper case.
    let text = |key: &str| match bag.get(key) {
        Some(YamlNode::Value(text)) => text.to_lowercase(),
        _ => String::new(),
    };
    match text("storage_identifier").as_str() {
        // Without one, as some converters write it, the files tell.
        "mcap" | "sqlite3" | "" => {}
        other => {
            return Err(wrong(format!(
                "the bag is in '{other}', svl reads mcap and sqlite3; {CONVERT}"
            )));
        }
    }
    let (mode, format) = (text("compression_mode"), text("compression_format"));
    if (mode == "file" || mode == "message") && format != "zstd" {
        return Err(wrong(format!(
            "the bag is compressed {mode} by {mode} in '{format}', svl reads zstd; {CONVERT}"
        )));
    }
    let Some(YamlNode::List(paths)) = bag.get("relative_file_paths") else {
        return Err(wrong("has no list of relative_file_paths".to_owned()));
    };
    // Only the file name: rosbag2 used to write the folder too, and a bag must not refer to other
    // folders.
    let name = |path: &YamlNode| match path {
        YamlNode::Value(path) => Path::new(path).file_name()?.to_str().map(str::to_owned),
        _ => None,
    };
    let names: Option<Vec<_>> = paths.iter().map(name).collect();
    names
        .filter(|names| !names.is_empty())
        .ok_or_else(|| wrong("its relative_file_paths name no files".to_owned()))
}

/// The MCAP and SQLite files in a folder, sorted by name.
fn bag_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = inputs::list(folder).map_err(|e| Error::io(folder, e))?;
    files.retain(|path| {
        let ending = path.extension();
        ending.is_some_and(|ending| ending == "mcap" || ending == "db3")
    });
    Ok(files)
}

fn name_one(files: &[PathBuf]) -> String {
    format!(
        "name one of {}",
        listed(files.iter().map(|file| file.display()))
    )
}
