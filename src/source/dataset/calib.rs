//! Middlebury's and ETH3D's `calib.txt`.

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
}
