//! Finds the pairs of a folder.

use super::layout::{Images, LAYOUTS, LETTERS, Layout, entries, find, known, natural, stem};
use crate::source::inputs::dataset::scene::is_of_one_camera;
use std::path::{Path, PathBuf};
use svl_core::{Error, Result, counted, listed};
use svl_files::{IMAGE_ENDINGS, SideBySide};
use svl_report::units::REPORT_LIST;

/// The pairs of a folder in natural order.
pub(crate) struct FoundPairs {
    /// The layout; none if the user named the images.
    pub layout: Option<&'static Layout>,
    pub pairs: Vec<PairFiles>,
    /// Images without a partner.
    pub unpaired: u64,
}

/// The images of a pair.
pub(crate) struct PairFiles {
    /// The part that the names of both have in common.
    pub key: Vec<u8>,
    pub left: PathBuf,
    /// The right image; none if the left one shows both side by side.
    pub right: Option<PathBuf>,
}

/// # Errors
/// [`Error::Io`]; [`Error::Usage`] for patterns that contradict each other; [`Error::Format`] if
/// there is no pair, with the folder's contents.
pub(crate) fn pairs(folder: &Path, request: &FolderRequest) -> Result<FoundPairs> {
    match (&request.images, request.side_by_side.is_some()) {
        ([_, Some(_)], true) => Err(Error::Usage(
            "--side-by-side reads one image for both: leave --right out".to_owned(),
        )),
        ([pattern, None], true) => side_by_side(folder, pattern.as_deref().unwrap_or("*")),
        ([Some(left), Some(right)], false) => named(folder, [left, right]),
        ([None, None], false) => as_laid_out(folder),
        ([Some(_), None] | [None, Some(_)], false) => Err(Error::Usage(
            "--left and --right name the images of a folder together".to_owned(),
        )),
    }
}

fn as_laid_out(folder: &Path) -> Result<FoundPairs> {
    for layout in LAYOUTS {
        let mut images = [Images::new(), Images::new()];
        for (images, pattern) in images.iter_mut().zip(layout.images) {
            *images = find(folder, pattern)?;
            let is_word = |key: &[u8]| key.first().is_some_and(u8::is_ascii_alphabetic);
            images.retain(|key, _| layout.images != LETTERS || !is_word(key));
        }
        let [left, right] = images;
        let found = paired(left, right);
        if !found.pairs.is_empty() {
            return Ok(FoundPairs {
                layout: Some(layout),
                ..found
            });
        }
    }
    if is_of_one_camera(folder) {
        let cure = "has the images of one camera: name the folder above, which has both";
        return Err(Error::format(folder, cure));
    }
    if folder.join(REPORT_LIST).is_file() {
        let shown = folder.display();
        let cure = format!(
            "is a report: `svl report {shown}` builds it again, `svl view {shown}` shows it"
        );
        return Err(Error::format(folder, cure));
    }
    if let Some(reason) = half(folder) {
        return Err(Error::format(folder, reason));
    }
    let below = with_pairs(folder.to_owned(), MAX_LEVELS);
    if !below.is_empty() {
        let names = listed(below.iter().map(|path| path.display()));
        let cure = "has no images itself; name a folder of pairs in it";
        return Err(Error::format(folder, format!("{cure}: {names}")));
    }
    let cure = "--left and --right name other patterns, --side-by-side reads images of both";
    Err(Error::format(
        folder,
        format!(
            "contains no stereo pair; it has {}; svl looks for im0.png and im1.png, or {}; {cure}",
            contents(folder)?,
            known()
        ),
    ))
}

/// Layouts with a folder for each camera.
fn with_folders() -> impl Iterator<Item = &'static Layout> {
    LAYOUTS
        .iter()
        .filter(|layout| layout.images[0].contains('/'))
}

/// Reason of a folder that has the images of one side.
fn half(folder: &Path) -> Option<String> {
    with_folders().find_map(|Layout { name, images, .. }| {
        let (there, missing) = match images.map(|pattern| has_images(folder, pattern)) {
            [true, false] => (images[0], images[1]),
            [false, true] => (images[1], images[0]),
            _ => return None,
        };
        let words = "is missing or empty: both make the pairs";
        Some(format!("has {there}, and {missing} {words} ({name})"))
    })
}

fn has_images(folder: &Path, pattern: &str) -> bool {
    find(folder, pattern).is_ok_and(|images| !images.is_empty())
}

/// Levels below a folder in which pairs are looked for, and the folders that are opened in each.
const MAX_LEVELS: usize = 2;
const MAX_FOLDERS: usize = 200;

/// The folders at and below this one that have pairs, as those of a day of KITTI's.
fn with_pairs(folder: PathBuf, levels: usize) -> Vec<PathBuf> {
    let has = |pattern| has_images(&folder, pattern);
    if with_folders().any(|layout| layout.images.into_iter().all(has)) {
        return vec![folder];
    }
    let entries = entries(&folder).unwrap_or_default().into_iter();
    let folders = entries.filter(|path| path.is_dir() && levels > 0);
    let folders = folders.take(MAX_FOLDERS);
    let mut found: Vec<_> = folders
        .flat_map(|own| with_pairs(own, levels - 1))
        .collect();
    found.sort_unstable();
    found
}

fn named(folder: &Path, patterns: [&str; 2]) -> Result<FoundPairs> {
    let images = |side: usize| {
        let (option, pattern) = (["--left", "--right"][side], patterns[side]);
        let images = find(folder, checked(option, pattern)?)?;
        if images.is_empty() {
            nothing(folder, option, pattern)
        } else {
            Ok(images)
        }
    };
    let (left, right) = (images(0)?, images(1)?);
    let first = |images: &Images| {
        let (key, path) = images.first_key_value().unzip();
        let key = String::from_utf8_lossy(key.map_or(&[], Vec::as_slice)).into_owned();
        format!(
            "'{key}' in {}",
            path.map_or(folder, PathBuf::as_path).display()
        )
    };
    let differ = format!("{}, {}", first(&left), first(&right));
    let found = paired(left, right);
    if found.pairs.is_empty() {
        let reason = format!(
            "contains no stereo pair by --left '{}' --right '{}': the part at * is equal in no two \
             images ({differ})",
            patterns[0], patterns[1]
        );
        return Err(Error::format(folder, reason));
    }
    Ok(found)
}

fn side_by_side(folder: &Path, pattern: &str) -> Result<FoundPairs> {
    let images = find(folder, checked("--left", pattern)?)?;
    if images.is_empty() {
        return nothing(folder, "--side-by-side", pattern);
    }
    let both = |(key, left)| PairFiles {
        key,
        left,
        right: None,
    };
    Ok(FoundPairs {
        layout: None,
        pairs: ordered(images.into_iter().map(both).collect()),
        unpaired: 0,
    })
}

fn nothing<T>(folder: &Path, option: &str, pattern: &str) -> Result<T> {
    let found = contents(folder)?;
    let reason = format!("{option}: no image is named '{pattern}'; the folder has {found}");
    Err(Error::format(folder, reason))
}

/// Checks that the pattern can be one of image files below a folder.
fn checked<'a>(option: &str, pattern: &'a str) -> Result<&'a str> {
    let wrong = |why: &str| Err(Error::Usage(format!("{option} {pattern}: {why}")));
    if pattern.starts_with('/') {
        return wrong(
            "is a topic, or a path from the root; for a folder it is a pattern below it, as \
             'left/*.png'",
        );
    }
    match pattern.matches('*').count() {
        0 | 1 => Ok(pattern),
        _ => wrong("has more than one *, the place of the part that is equal in left and right"),
    }
}

fn paired(left: Images, mut right: Images) -> FoundPairs {
    let (mut pairs, mut unpaired) = (Vec::new(), 0);
    for (key, left) in left {
        match right.remove(&key) {
            Some(partner) => pairs.push(PairFiles {
                key,
                left,
                right: Some(partner),
            }),
            None => unpaired += 1,
        }
    }
    FoundPairs {
        layout: None,
        pairs: ordered(pairs),
        unpaired: unpaired + right.len() as u64,
    }
}

fn ordered(mut pairs: Vec<PairFiles>) -> Vec<PairFiles> {
    pairs.sort_unstable_by(|a, b| natural(&a.key, &b.key));
    pairs
}

/// Characters of a name in a message.
const MAX_CHARACTERS: usize = 40;

/// Content of a folder, in words.
fn contents(folder: &Path) -> Result<String> {
    let (folders, files): (Vec<_>, Vec<_>) =
        entries(folder)?.into_iter().partition(|path| path.is_dir());
    let is_image = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default();
        stem(name.as_encoded_bytes(), IMAGE_ENDINGS).is_some()
    };
    let (images, others): (Vec<_>, Vec<_>) = files.into_iter().partition(is_image);
    let kinds = [
        (folders, "folder"),
        (images, "image"),
        (others, "other file"),
    ];
    let said = kinds.into_iter().filter(|(paths, _)| !paths.is_empty());
    let said: Vec<_> = said.map(|(paths, noun)| kind_words(&paths, noun)).collect();
    Ok(if said.is_empty() {
        "nothing".to_owned()
    } else {
        said.join(", ")
    })
}

/// The beginning of a name, so that several fit a screen.
fn shortened(name: &str) -> String {
    match name.char_indices().nth(MAX_CHARACTERS) {
        Some((end, _)) => format!("{}…", &name[..end]),
        None => name.to_owned(),
    }
}

fn kind_words(paths: &[PathBuf], noun: &str) -> String {
    let name = |path: &PathBuf| shortened(&path.file_name().unwrap_or_default().to_string_lossy());
    let count = counted(paths.len() as u64, noun);
    format!("{count} ({})", listed(paths.iter().map(name)))
}

/// Options of a folder.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FolderRequest {
    /// Patterns of the left and the right images below the folder, with one `*` for the part that
    /// is equal in both [default: as one of the layouts that svl knows].
    pub images: [Option<String>; 2],
    /// The places of both in each image, if it holds both.
    pub side_by_side: Option<SideBySide>,
    /// Pairs per second [default: by the stamps of the folder].
    pub fps: Option<f64>,
    /// Number of the 16 bits that are used [default: decided by the first pairs].
    pub bits: Option<u8>,
}
