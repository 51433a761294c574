//! Layouts of folders of image pairs on disk: [`LAYOUTS`].

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl_core::{Error, Result, inputs};
use svl_files::IMAGE_ENDINGS;

/// A folder of many pairs.
pub(crate) struct Layout {
    /// Program or data set that uses it.
    pub name: &'static str,
    /// The left and the right images: patterns as for [`find`].
    pub images: [&'static str; 2],
    /// Files with the stamps of the left and the right images.
    pub stamps: Option<[&'static str; 2]>,
    pub cameras: Cameras,
}

/// The cameras of a layout, besides a `calib.txt` of Middlebury's.
pub(crate) enum Cameras {
    /// No file: the images count as rectified.
    Rectified,
    /// A `sensor.yaml` of each camera in these folders: the images are raw if it exists.
    Sensors([&'static str; 2]),
    /// [`Cameras::Sensors`], but raw without a `sensor.yaml` too.
    RawSensors([&'static str; 2]),
    /// Named projections in `calib.txt`.
    Projections([&'static str; 2]),
    /// Named projections in `calib_cam_to_cam.txt`, here or in the folder of the day above: the
    /// images are rectified if they have its rectified size.
    CamToCam([&'static str; 2]),
}

/// All layouts; the first that fits is used. A new one is one entry here.
pub(crate) const LAYOUTS: &[Layout] = &[
    Layout {
        name: "EuRoC",
        images: ["cam0/data/*", "cam1/data/*"],
        stamps: Some(["cam0/data.csv", "cam1/data.csv"]),
        cameras: Cameras::RawSensors(["cam0", "cam1"]),
    },
    Layout {
        name: "EuRoC",
        images: ["mav0/cam0/data/*", "mav0/cam1/data/*"],
        stamps: Some(["mav0/cam0/data.csv", "mav0/cam1/data.csv"]),
        cameras: Cameras::RawSensors(["mav0/cam0", "mav0/cam1"]),
    },
    Layout {
        name: "KITTI raw, grey",
        images: ["image_00/data/*", "image_01/data/*"],
        stamps: Some(["image_00/timestamps.txt", "image_01/timestamps.txt"]),
        cameras: Cameras::CamToCam(["P_rect_00", "P_rect_01"]),
    },
    Layout {
        name: "KITTI raw, colour",
        images: ["image_02/data/*", "image_03/data/*"],
        stamps: Some(["image_02/timestamps.txt", "image_03/timestamps.txt"]),
        cameras: Cameras::CamToCam(["P_rect_02", "P_rect_03"]),
    },
    Layout {
        name: "KITTI, colour",
        images: ["image_2/*", "image_3/*"],
        stamps: Some(["times.txt", "times.txt"]),
        cameras: Cameras::Projections(["P2", "P3"]),
    },
    Layout {
        name: "KITTI 2012, colour",
        images: ["colored_0/*", "colored_1/*"],
        stamps: None,
        cameras: Cameras::Projections(["P2", "P3"]),
    },
    Layout {
        name: "KITTI, grey",
        images: ["image_0/*", "image_1/*"],
        stamps: Some(["times.txt", "times.txt"]),
        cameras: Cameras::Projections(["P0", "P1"]),
    },
    plain(["left/*", "right/*"]),
    plain(["left/left*", "right/right*"]),
    plain(["left/*left", "right/*right"]),
    plain(["left/*_l", "right/*_r"]),
    Layout {
        name: "cam0 and cam1",
        images: ["cam0/*", "cam1/*"],
        stamps: Some(["cam0/data.csv", "cam1/data.csv"]),
        cameras: Cameras::Sensors(["cam0", "cam1"]),
    },
    booster(["camera_00/*", "camera_02/*"]),
    booster(["camera_00/*", "camera_01/*"]),
    plain(["left*", "right*"]),
    // MRPT's 0_left.jpg, and 00_left.png.
    plain(["*left", "*right"]),
    plain(["*_l", "*_r"]),
    // L1.jpg and L_1.jpg; see as_laid_out.
    plain(LETTERS),
];

/// Letters that are sides if no word begins with them.
pub(crate) const LETTERS: [&str; 2] = ["l*", "r*"];

/// Name of layouts of no data set.
const PLAIN: &str = "left and right";

const fn plain(images: [&'static str; 2]) -> Layout {
    Layout {
        name: PLAIN,
        images,
        stamps: None,
        cameras: Cameras::Rectified,
    }
}

/// Images of one view in several lights, rectified.
const fn booster(images: [&'static str; 2]) -> Layout {
    Layout {
        name: "Booster",
        ..plain(images)
    }
}

/// All layouts, in a line: those of data sets by their names.
pub(crate) fn known() -> String {
    let is_plain = |layout: &&Layout| layout.name == PLAIN;
    let (plain, others): (Vec<_>, Vec<_>) = LAYOUTS.iter().partition(is_plain);
    let patterns = plain.iter().map(|layout| layout.images.join(" and "));
    let mut names: Vec<_> = others.iter().map(|layout| layout.name).collect();
    names.dedup();
    format!(
        "{}; the folders of {}",
        patterns.collect::<Vec<_>>().join("; "),
        names.join("; ")
    )
}

/// Image files by what stands for `*` in their pattern: bytes, as names need not be UTF-8.
pub(crate) type Images = BTreeMap<Vec<u8>, PathBuf>;

/// The images below `folder` that a pattern names: a path with one `*` in one of its parts, in any
/// case; without an extension it matches any image. None if folders are missing.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for two files whose names differ only by extension.
pub(crate) fn find(folder: &Path, pattern: &str) -> Result<Images> {
    find_ending(folder, pattern, IMAGE_ENDINGS)
}

/// Same as [`find`], for files with other extensions.
pub(crate) fn find_ending(folder: &Path, pattern: &str, endings: &[&str]) -> Result<Images> {
    let mut parts = pattern.split('/').filter(|part| !["", "."].contains(part));
    let mut folder = folder.to_owned();
    let mut images = Images::new();
    while let Some(part) = parts.next() {
        if !part.contains('*') {
            match child(&folder, part, endings)? {
                Some(found) => folder = found,
                None => return Ok(images),
            }
            continue;
        }
        let rest: Vec<_> = parts.collect();
        for entry in entries(&folder)? {
            let Some(key) = key(&entry, part, rest.is_empty().then_some(endings)) else {
                continue;
            };
            let Some(image) = below(entry, &rest, endings)? else {
                continue;
            };
            if let Some(other) = images.insert(key, image.clone()) {
                let both = format!("and {} have one name; leave one of them", other.display());
                return Err(Error::format(image, both));
            }
        }
        return Ok(images);
    }
    // Without a `*` it is one image.
    if inputs::is_file(&folder) {
        images.insert(Vec::new(), folder);
    }
    Ok(images)
}

/// The file below `path` at the parts of a path.
fn below(mut path: PathBuf, parts: &[&str], endings: &[&str]) -> Result<Option<PathBuf>> {
    for part in parts {
        match path
            .is_dir()
            .then(|| child(&path, part, endings))
            .transpose()?
        {
            Some(Some(found)) => path = found,
            _ => return Ok(None),
        }
    }
    Ok(inputs::is_file(&path).then_some(path))
}

/// The entry of that name, in any case, an image also without its extension.
fn child(folder: &Path, name: &str, endings: &[&str]) -> Result<Option<PathBuf>> {
    let exact = folder.join(name);
    if exact.exists() {
        return Ok(Some(exact));
    }
    if !folder.is_dir() {
        return Ok(None);
    }
    let fits = |path: &PathBuf| {
        let found = path.file_name().unwrap_or_default().as_encoded_bytes();
        found.eq_ignore_ascii_case(name.as_bytes())
            || stem(found, endings).is_some_and(|stem| stem.eq_ignore_ascii_case(name.as_bytes()))
    };
    Ok(entries(folder)?.into_iter().find(fits))
}

/// Text in place of `*`, if the name of `path` fits `part`: without extension, unless `part` has
/// one or names a folder, which has no `endings`.
fn key(path: &Path, part: &str, endings: Option<&[&str]>) -> Option<Vec<u8>> {
    let name = path.file_name()?.as_encoded_bytes();
    // The pattern matches only files of these kinds.
    let name = match endings {
        None => name,
        Some(endings) if stem(part.as_bytes(), endings).is_some() => {
            stem(name, endings).map(|_| name)?
        }
        Some(endings) => stem(name, endings)?,
    };
    let (before, after) = part.split_once('*')?;
    let (before, after) = (before.as_bytes(), after.as_bytes());
    let end = name.len().checked_sub(after.len())?;
    let key = name.get(before.len()..end)?;
    let fits = name[..before.len()].eq_ignore_ascii_case(before)
        && name[end..].eq_ignore_ascii_case(after);
    fits.then(|| key.to_owned())
}

/// The name of a file without its extension, if it is one of these.
pub(crate) fn stem<'a>(name: &'a [u8], endings: &[&str]) -> Option<&'a [u8]> {
    let dot = name.iter().rposition(|&byte| byte == b'.')?;
    let ending = &name[dot + 1..];
    let is_image = |known: &&str| known.as_bytes().eq_ignore_ascii_case(ending);
    // A name that begins with a dot is that of a hidden file: macOS has a `._left.png` beside each
    // left.png.
    (endings.iter().any(is_image) && !name.starts_with(b".")).then(|| &name[..dot])
}

/// Entries of a folder, in the order of the names.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    inputs::list(folder).map_err(|e| Error::io(folder, e))
}

/// Natural order: runs of digits by their number, 8 before 13.
pub(crate) fn natural(a: &[u8], b: &[u8]) -> Ordering {
    let (mut i, mut j) = (0, 0);
    while i < a.len() && j < b.len() {
        let (x, y) = (digits(&a[i..]), digits(&b[j..]));
        let order = match (x.is_empty(), y.is_empty()) {
            (false, false) => {
                let [x, y] = [x, y].map(significant);
                x.len().cmp(&y.len()).then(x.cmp(y))
            }
            _ => a[i].cmp(&b[j]),
        };
        if order.is_ne() {
            return order;
        }
        i += x.len().max(1);
        j += y.len().max(1);
    }
    // Equal but for leading zeros: by their bytes, so that the order is total.
    (a.len() - i).cmp(&(b.len() - j)).then_with(|| a.cmp(b))
}

fn digits(text: &[u8]) -> &[u8] {
    let end = text.iter().position(|byte| !byte.is_ascii_digit());
    &text[..end.unwrap_or(text.len())]
}

fn significant(digits: &[u8]) -> &[u8] {
    let zeros = digits.iter().take_while(|&&digit| digit == b'0').count();
    &digits[zeros..]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_counted() {
        let mut names = ["18", "8", "013", "a10", "a9", "a", "8b2", "8b10", "0", ""];
        names.sort_by(|a, b| natural(a.as_bytes(), b.as_bytes()));
        assert_eq!(
            names,
            ["", "0", "8", "8b2", "8b10", "013", "18", "a", "a9", "a10"]
        );
        assert_eq!(natural(b"1", b"01"), Ordering::Greater);
        assert_eq!(
            natural(b"99999999999999999999999", b"100000000000000000000000"),
            Ordering::Less
        );
    }

    #[test]
    fn a_pattern_is_matched_in_any_case() {
        let key = |name: &str, part: &str, is_file: bool| {
            let key = key(Path::new(name), part, is_file.then_some(IMAGE_ENDINGS))?;
            Some(String::from_utf8(key).unwrap())
        };
        assert_eq!(key("Left_07.PNG", "left*", true).unwrap(), "_07");
        assert_eq!(key("00_L.png", "*_l", true).unwrap(), "00");
        assert_eq!(key("7.png", "*.png", true).unwrap(), "7");
        assert_eq!(key("seq7", "seq*", false).unwrap(), "7");
        for (name, part) in [
            ("7.jpg", "*.png"),
            ("left.txt", "left*"),
            ("._left1.png", "*left1"),
            ("l.png", "*_l"),
            ("le.png", "left*"),
            ("abba.png", "abb*bba"),
        ] {
            assert_eq!(key(name, part, true), None, "{name} {part}");
        }
    }
}
