//! PFM, the float maps of Middlebury and ETH3D: a `Pf` header, then rows bottom-up.

use super::{MAX_BYTES, MapFault, known, read_bounded};
use std::borrow::Cow;
use std::path::Path;
use svl_core::stereo::{MAX_SIDE, Plane};
use svl_core::{Error, Result};

/// Reads a one-channel PFM of either byte order. The magnitude of the scale line is not a
/// multiplier (Middlebury's convention); non-finite values become `+∞`, "unknown". Line ends of
/// Windows are read: in the header alone, or in all of a file that was written as text.
///
/// # Errors
/// [`Error::Io`], or [`Error::Format`] with the missing or superfluous part.
pub fn read_pfm(path: &Path) -> Result<Plane<f32>> {
    Ok(known(&values(path)?))
}

/// The values in the file, unchanged.
pub(super) fn values(path: &Path) -> Result<Plane<f32>> {
    parse(&read_bounded(path, MAX_BYTES)?)
        .map_err(|reason| Error::format(path, format!("not a PFM map: {reason}")))
}

fn parse(bytes: &[u8]) -> Result<Plane<f32>, MapFault> {
    let mut rest = bytes;
    let mut word = || -> Result<&str, MapFault> {
        let short = MapFault::Malformed("the header is truncated");
        let begin = rest.trim_ascii_start();
        // No number is longer; without a limit a binary file would be searched to its end.
        let length = begin.iter().take(32).position(u8::is_ascii_whitespace);
        let length = length.ok_or(short)?;
        let word = str::from_utf8(&begin[..length]);
        let word = word.map_err(|_| MapFault::Malformed("the header is not text"))?;
        // One whitespace after the scale, then pixels, whose first byte may look like whitespace.
        rest = &begin[length + 1..];
        Ok(word)
    };
    match word()? {
        "Pf" => {}
        "PF" => {
            let found = "it has three channels (PF)".to_owned();
            return Err(MapFault::Unsupported(found, "one (Pf)"));
        }
        other => {
            return Err(MapFault::Unsupported(
                format!("it begins with '{other}'"),
                "'Pf'",
            ));
        }
    }
    let mut side = |wrong| match word()?.parse() {
        Ok(side @ 1..=MAX_SIDE) => Ok(side),
        _ => Err(MapFault::Sides(wrong)),
    };
    let width = side("the width is not a number")?;
    let height = side("the height is not a number")?;
    let scale = word()?.parse::<f32>();
    let scale = scale.map_err(|_| MapFault::Malformed("the scale is not a number"))?;
    if scale == 0.0 || !scale.is_finite() {
        return Err(MapFault::Scale(scale));
    }
    let expected = width * height * 4;
    let of_windows = bytes[bytes.len() - rest.len() - 1..].strip_prefix(b"\r\n");
    // A header with such ends has one here, too, and no line feed as the first pixel's first byte.
    let mut header = bytes[..bytes.len() - rest.len() - 1].windows(2);
    let of_windows =
        of_windows.filter(|_| rest.len() != expected || header.any(|ends| ends == b"\r\n"));
    let untranslated = of_windows.map(|pixels| without_carriage_returns(pixels, expected));
    let pixels = untranslated.as_deref().unwrap_or(rest);
    if pixels.len() != expected {
        let channels = if pixels.len() == 3 * expected {
            ": three channels, whose header is PF"
        } else {
            ""
        };
        let wrong = format!(" of pixels, got {}{channels}", pixels.len());
        return Err(MapFault::Bytes(width, height, expected, wrong));
    }
    let read = if scale < 0.0 {
        f32::from_le_bytes
    } else {
        f32::from_be_bytes
    };
    let mut plane = Plane::filled(width, height, f32::INFINITY)?;
    for (i, row) in pixels.chunks_exact(width * 4).enumerate() {
        for (pixel, bytes) in plane
            // PFM stores rows bottom-up.
            .row_mut(height - 1 - i)
            .iter_mut()
            .zip(row.as_chunks::<4>().0)
        {
            *pixel = read(*bytes);
        }
    }
    Ok(plane)
}

/// The pixels behind a header with line ends of Windows. Where they were written as text, too, each
/// line feed among them has a carriage return before it, which is removed.
fn without_carriage_returns(pixels: &[u8], expected: usize) -> Cow<'_, [u8]> {
    if pixels.len() <= expected {
        return pixels.into();
    }
    let is_return = |at: usize| pixels[at] == b'\r' && pixels.get(at + 1) == Some(&b'\n');
    let kept: Vec<u8> = (0..pixels.len())
        .filter(|at| !is_return(*at))
        .map(|at| pixels[at])
        .collect();
    if kept.len() == expected {
        kept.into()
    } else {
        pixels.into()
    }
}

/// Writes a little-endian PFM; `+∞` means invalid.
///
/// # Errors
/// [`Error::Io`].
pub fn write_pfm(path: &Path, plane: &Plane<f32>) -> Result<()> {
    let (width, height) = plane.size();
    let mut bytes = format!("Pf\n{width} {height}\n-1\n").into_bytes();
    (0..height).rev().for_each(|y| {
        plane
            .row(y)
            .iter()
            .for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()))
    });
    std::fs::write(path, bytes).map_err(|e| Error::io(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_byte_orders_and_upside_down() {
        let values = [7.5f32, f32::NAN].map(f32::to_be_bytes).concat();
        let big = [&b"Pf\n1 2\n1.0\n"[..], &values].concat();
        let read = known(&parse(&big).unwrap());
        assert_eq!(read.pixels().collect::<Vec<_>>(), [f32::INFINITY, 7.5]);
        let little = [&b"Pf 1 1 -0.0039\n"[..], &7.5f32.to_le_bytes()].concat();
        assert_eq!(parse(&little).unwrap().get(0, 0), 7.5);
    }

    #[test]
    fn line_ends_of_windows() {
        let little = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect();
        // The bytes of the first value are a line end, those of the second a line feed.
        let pixels: Vec<u8> = little(&[f32::from_le_bytes(*b"\r\n\r\n"), 9e-33, 7.5]);
        let read = |pixels: &[u8]| {
            let file = [b"Pf\r\n3 1\r\n-1\r\n", pixels].concat();
            let plane = parse(&file).map_err(|fault| fault.to_string())?;
            Ok::<Vec<_>, String>(plane.pixels().flat_map(f32::to_le_bytes).collect())
        };
        assert_eq!(read(&pixels).as_ref(), Ok(&pixels), "the header alone");
        let text = pixels.iter().flat_map(|byte| match byte {
            b'\n' => vec![b'\r', b'\n'],
            other => vec![*other],
        });
        let text: Vec<u8> = text.collect();
        assert!(text.len() > pixels.len());
        assert_eq!(read(&text).as_ref(), Ok(&pixels), "all of it");
        let cut = read(&pixels[..pixels.len() - 1]).unwrap_err();
        assert!(cut.contains("needs 12 bytes of pixels, got 11"));
        let longer = read(&[&pixels[..], b"abc"].concat());
        assert!(longer.unwrap_err().contains("got 15"));
    }

    #[test]
    fn round_trip() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let plane = vec![0.0, f32::INFINITY, 2.0, 10.0, f32::INFINITY, 12.0];
        let plane = Plane::from_vec(3, 2, plane).unwrap();
        write_pfm(path.path(), &plane).unwrap();
        assert_eq!(read_pfm(path.path()).unwrap(), plane);
    }

    #[test]
    fn faults_are_named() {
        for (bytes, word) in [
            (&b"P6\n1 1\n255\n..."[..], "P6"),
            (b"PF\n1 1\n-1\n", "three channels"),
            (b"Pf\n1 1\n-1\nabc", "got 3"),
            (b"Pf\n1 1\n-1\nabcde", "needs 4 bytes of pixels, got 5"),
            (b"Pf\n1 1\n-1\nabcdabcdabcd", "got 12: three channels"),
            (b"Pf\n99999999 1\n-1\nabc", "width"),
            (b"Pf\n1 1\n0\nabcd", "scale"),
            (b"Pf\n1", "truncated"),
        ] {
            let error = parse(bytes).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
