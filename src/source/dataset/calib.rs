//! Middlebury's and ETH3D's `calib.txt`, and KITTI's projection matrices.

use crate::error::{Error, Result};
use crate::files::read_text;
use crate::stereo::Rig;
use std::path::Path;

/// Longest `calib.txt` that is read, bytes.
const MAX_BYTES: u64 = 1 << 16;

/// Reads `cam0=[f 0 cx; 0 f cy; 0 0 1]`, `doffs` in pixels and `baseline` in millimetres.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the missing or malformed entry.
pub fn read_calib(path: &Path) -> Result<Rig> {
    let text = read_text(path, MAX_BYTES)?;
    parse(&text).map_err(|reason| Error::format(path, format!("not a Middlebury calib.txt: {reason}")))
}

fn parse(text: &str) -> std::result::Result<Rig, String> {
    let entry = |key: &str| {
        let found = text.lines().find_map(|line| line.split_once('=').filter(|(k, _)| k.trim() == key));
        found.map(|(_, value)| value.trim()).ok_or(format!("no '{key}='"))
    };
    let number = |key: &str| entry(key)?.parse::<f64>().map_err(|_| format!("{key} is not a number"));
    let inner = entry("cam0")?.trim_start_matches('[').trim_end_matches(']');
    let cam0: Vec<f64> = inner
        .split(|c: char| c.is_whitespace() || c == ';')
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().map_err(|_| format!("cam0 holds '{word}', expected a number")))
        .collect::<std::result::Result<_, _>>()?;
    let [focal, _, cx, _, _, cy, ..] = cam0[..] else {
        return Err(format!("cam0 has {} numbers, expected 9", cam0.len()));
    };
    Rig::new(focal, (cx, cy), number("baseline")? / 1000.0, number("doffs")?).map_err(|e| e.to_string())
}

/// Reads KITTI's calibration, lines `NAME: ` and the twelve numbers of a 3 x 4 projection matrix, row by row: the rig of
/// the cameras `left` and `right`.
///
/// Both matrices are relative to camera 0, whose fourth column is 0: the baseline is `(P_left(0,3) − P_right(0,3)) / f`
/// metres (KITTI development kit, readme).
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the missing or malformed matrix.
pub(super) fn read_projections(path: &Path, left: &str, right: &str) -> Result<Rig> {
    let text = read_text(path, MAX_BYTES)?;
    projections(&text, left, right).map_err(|reason| Error::format(path, format!("not a KITTI calibration: {reason}")))
}

fn projections(text: &str, left: &str, right: &str) -> std::result::Result<Rig, String> {
    let matrix = |name: &str| {
        let found = text.lines().find_map(|line| line.split_once(':').filter(|(k, _)| k.trim() == name));
        let (_, numbers) = found.ok_or(format!("no '{name}:'"))?;
        let number = |word: &str| word.parse::<f64>().map_err(|_| format!("{name} holds '{word}', expected a number"));
        let numbers = numbers.split_whitespace().map(number).collect::<std::result::Result<Vec<_>, _>>()?;
        <[f64; 12]>::try_from(numbers).map_err(|n| format!("{name} has {} numbers, expected 12", n.len()))
    };
    let (l, r) = (matrix(left)?, matrix(right)?);
    let [focal, _, cx, tx, _, _, cy, ..] = l;
    Rig::new(focal, (cx, cy), (tx - r[3]) / focal, r[2] - cx).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middlebury_form() {
        let text = "cam0=[ 1038.018 0 322.037 ; 0 1038.018 243.393 ; 0 0 1 ] \n doffs= 53.271 \nbaseline= 176.252\n";
        let rig = parse(text).unwrap();
        assert_eq!((rig.focal_px(), rig.doffs_px()), (1038.018, 53.271));
        assert!((rig.baseline_m() - 0.176252).abs() < 1e-12);
    }

    #[test]
    fn what_is_missing_is_named() {
        assert_eq!(parse("cam0=[1 0 2; 0 1 3; 0 0 1]\ndoffs=0").unwrap_err(), "no 'baseline='");
        assert_eq!(parse("cam0=[1 0]\nbaseline=1\ndoffs=0").unwrap_err(), "cam0 has 2 numbers, expected 9");
        assert!(parse("cam0=[x]\nbaseline=1\ndoffs=0").unwrap_err().contains("'x'"));
        assert!(parse("cam0=[1 0 2; 0 1 3; 0 0 1]\nbaseline=0\ndoffs=0").is_err());
    }

    #[test]
    fn kitti_form() {
        let text = "P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP2: 7e2 0 600 35 0 7e2 180 0 0 0 1 0\n\
                    P3: 700 0 602 -350 0 700 180 0 0 0 1 0\n";
        let rig = projections(text, "P2", "P3").unwrap();
        assert_eq!((rig.focal_px(), rig.center_px(), rig.doffs_px()), (700.0, (600.0, 180.0), 2.0));
        assert!((rig.baseline_m() - 0.55).abs() < 1e-12);
        assert_eq!(projections(text, "P0", "P1").unwrap_err(), "no 'P1:'");
        assert_eq!(projections("P0: 1 2\nP1: 3", "P0", "P1").unwrap_err(), "P0 has 2 numbers, expected 12");
        assert!(projections("P0: x", "P0", "P1").unwrap_err().contains("'x'"));
        // Left and right taken for each other: a negative baseline.
        assert!(projections(text, "P3", "P2").is_err());
    }
}
