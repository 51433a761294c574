//! NumPy's npz, a zip archive with one array, and npy, an array: a plane of numbers.

use super::{MAX_BYTES, MapFault, read_bounded};
use half::f16;
use std::io::{Cursor, Read};
use std::path::Path;
use svl_core::stereo::{MAX_SIDE, Plane};
use svl_core::{Error, Result};

/// Limit on the header's length in bytes; NumPy's own have 118.
const MAX_HEADER: usize = 4096;

/// The values of the only array of an archive like scikit-image's `motorcycle_disp.npz`, rows x
/// columns of [`NpyNumber`]s in either byte and memory order, and true if they are integers.
pub(super) fn archived(path: &Path) -> Result<(Plane<f32>, bool)> {
    parse(read_bounded(path, MAX_BYTES)?)
        .map_err(|reason| Error::format(path, format!("not an npz map: {reason}")))
}

fn parse(bytes: Vec<u8>) -> Result<(Plane<f32>, bool), MapFault> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes))?;
    // With several arrays it is unknown which of them is the map.
    match archive.len() {
        1 => array(archive.by_index(0)?),
        count => Err(MapFault::Unsupported(
            format!("it contains {count} arrays"),
            "one",
        )),
    }
}

/// The values of an array in a file of its own, and true if they are integers.
pub(super) fn alone(path: &Path) -> Result<(Plane<f32>, bool)> {
    array(Cursor::new(read_bounded(path, MAX_BYTES)?))
        .map_err(|reason| Error::format(path, format!("not an npy map: {reason}")))
}

fn array(mut file: impl Read) -> Result<(Plane<f32>, bool), MapFault> {
    let header = NpyHeader::read(&mut file)?;
    let (number, width, height) = (header.number, header.width, header.height);
    // No overflow: sides are at most MAX_SIDE.
    let item = number.bytes();
    let expected = width * height * item;
    if expected as u64 > MAX_BYTES {
        let wrong = format!(", more than the {MAX_BYTES} it may have");
        return Err(MapFault::Bytes(width, height, expected, wrong));
    }
    // One more byte, as the CRC of the archive is checked at the end of the array.
    let mut data = Vec::new();
    file.take(expected as u64 + 1).read_to_end(&mut data)?;
    if data.len() != expected {
        let wrong = ", the array does not have that many".to_owned();
        return Err(MapFault::Bytes(width, height, expected, wrong));
    }
    if header.big_endian {
        data.chunks_exact_mut(item).for_each(<[u8]>::reverse);
    }
    let values = Plane::from_fn(width, height, |x, y| {
        // Fortran order: columns are contiguous.
        let index = if header.fortran {
            x * height + y
        } else {
            y * width + x
        };
        number.value(&data[index * item..])
    });
    Ok((values?, number.is_integer()))
}

/// A number of an array.
#[derive(Clone, Copy)]
enum NpyNumber {
    Uint16,
    /// OpenCV's matchers write these.
    Int16,
    Float16,
    Float32,
    Float64,
}

impl NpyNumber {
    /// The number with NumPy's code behind that of the byte order.
    fn from_code(code: &str) -> Option<Self> {
        Some(match code {
            "u2" => Self::Uint16,
            "i2" => Self::Int16,
            "f2" => Self::Float16,
            "f4" => Self::Float32,
            "f8" => Self::Float64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::Uint16 | Self::Int16 | Self::Float16 => 2,
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }

    fn is_integer(self) -> bool {
        matches!(self, Self::Uint16 | Self::Int16)
    }

    /// The value of the first bytes, little-endian.
    fn value(self, bytes: &[u8]) -> f32 {
        fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
            *bytes.first_chunk().expect("the array has whole numbers")
        }
        match self {
            Self::Uint16 => u16::from_le_bytes(first(bytes)).into(),
            Self::Int16 => i16::from_le_bytes(first(bytes)).into(),
            Self::Float16 => f16::from_le_bytes(first(bytes)).to_f32(),
            Self::Float32 => f32::from_le_bytes(first(bytes)),
            Self::Float64 => f64::from_le_bytes(first(bytes)) as f32,
        }
    }
}

/// The header of an array: `{'descr': '<f4', 'fortran_order': False, 'shape': (500, 741), }` (NumPy
/// Enhancement Proposal 1, "A Simple File Format for NumPy Arrays").
struct NpyHeader {
    number: NpyNumber,
    big_endian: bool,
    fortran: bool,
    width: usize,
    height: usize,
}

impl NpyHeader {
    fn read(file: &mut impl Read) -> Result<Self, MapFault> {
        let mut begin = [0; 8];
        let short = |_| MapFault::Malformed("the header is truncated");
        file.read_exact(&mut begin).map_err(short)?;
        let mut length = [0; 4];
        match begin {
            [0x93, b'N', b'U', b'M', b'P', b'Y', 1, _] => file.read_exact(&mut length[..2]),
            [0x93, b'N', b'U', b'M', b'P', b'Y', 2 | 3, _] => file.read_exact(&mut length),
            _ => {
                return Err(MapFault::Malformed(
                    "its array does not begin as NumPy's do",
                ));
            }
        }
        .map_err(short)?;
        let length = u32::from_le_bytes(length) as usize;
        // Version 2 headers may claim 4 GB.
        if length > MAX_HEADER {
            return Err(MapFault::Header(length, MAX_HEADER));
        }
        let mut text = vec![0; length];
        file.read_exact(&mut text).map_err(short)?;
        let text = str::from_utf8(&text);
        Self::parse(text.map_err(|_| MapFault::Malformed("the header is not text"))?)
    }

    fn parse(text: &str) -> Result<Self, MapFault> {
        let field = |name| {
            let found = text.split_once(&format!("'{name}':"));
            let found = found.map(|(_, rest)| rest.trim_start());
            found.ok_or(MapFault::NoEntry(name))
        };
        let kind = field("descr")?.split('\'').nth(1).unwrap_or_default();
        let (order, code) = kind.split_at_checked(1).unwrap_or_default();
        let number = NpyNumber::from_code(code).filter(|_| matches!(order, "<" | ">"));
        let number = number.ok_or_else(|| {
            MapFault::Unsupported(
                format!("its values are '{kind}'"),
                "floats or 16-bit integers",
            )
        })?;
        let shape = field("shape")?.strip_prefix('(');
        let sides = shape.and_then(|sides| sides.split_once(')'));
        let sides = sides.map_or("", |(sides, _)| sides).split(',');
        let sides: Vec<usize> = sides.map(|s| s.trim().parse().unwrap_or(0)).collect();
        match sides[..] {
            [height @ 1..=MAX_SIDE, width @ 1..=MAX_SIDE] => Ok(Self {
                number,
                big_endian: order == ">",
                fortran: field("fortran_order")?.starts_with("True"),
                width,
                height,
            }),
            _ => Err(MapFault::Sides("its shape is not (rows, columns)")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MapScale, read_disparities};
    use proptest::prelude::*;
    use std::io::Write;
    use zip::write::SimpleFileOptions;

    const HEADER: &str = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n";

    fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        let length = (header.len() as u16).to_le_bytes();
        let begin = [&b"\x93NUMPY\x01\x00"[..], &length].concat();
        [&begin, header.as_bytes(), data].concat()
    }

    fn npz(arrays: &[Vec<u8>]) -> Vec<u8> {
        let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default();
        let stored = options.compression_method(zip::CompressionMethod::Stored);
        for (i, array) in arrays.iter().enumerate() {
            archive.start_file(format!("arr_{i}.npy"), stored).unwrap();
            archive.write_all(array).unwrap();
        }
        archive.finish().unwrap().into_inner()
    }

    fn le(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    /// A file of one array of two rows of these.
    fn float_archive(values: [f32; 6]) -> Vec<u8> {
        npz(&[npy(HEADER, &le(&values))])
    }

    #[test]
    fn either_byte_and_memory_order() {
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, f32::INFINITY];
        let steps = [-16.0, 0.0, 24.0, 1.0, 2.0, 3.0];
        let columns = [1.0, 4.0, 2.0, 5.0, 3.0, f32::INFINITY];
        let big = values.map(|v| f64::from(v).to_be_bytes()).concat();
        let halves = values.map(|v| f16::from_f32(v).to_le_bytes()).concat();
        let integers = steps.map(|v| (v as i16).to_be_bytes()).concat();
        for (from, to, data, expected) in [
            ("", "", le(&values), values),
            ("<f4", ">f8", big, values),
            ("<f4", "<f2", halves, values),
            ("<f4", ">i2", integers, steps),
            ("False", "True", le(&columns), values),
        ] {
            let header = HEADER.replacen(from, to, 1);
            let (map, _) = parse(npz(&[npy(&header, &data)])).unwrap();
            assert_eq!(map.pixels().collect::<Vec<_>>(), expected, "{to}");
        }
    }

    #[test]
    fn unknown_disparities_are_infinite() {
        let file = tempfile::Builder::new().suffix(".npz").tempfile().unwrap();
        let inf = f32::INFINITY;
        let values = [1.0, f32::NAN, -inf, 0.0, -1.0, inf];
        std::fs::write(file.path(), float_archive(values)).unwrap();
        let read = read_disparities(file.path(), MapScale::same(None)).unwrap();
        let read: Vec<_> = read.pixels().collect();
        assert_eq!(read, [1.0, inf, inf, 0.0, -1.0, inf]);
    }

    #[test]
    fn faults_are_named() {
        let data = le(&[0.0; 6]);
        let with = |from, to| vec![npy(&HEADER.replace(from, to), &data)];
        let version_2 = [&b"\x93NUMPY\x02\x00"[..], &u32::MAX.to_le_bytes()].concat();
        for (arrays, words) in [
            (vec![], "contains 0 arrays"),
            (vec![npy(HEADER, &data); 2], "contains 2 arrays"),
            (vec![b"\x93NUM".to_vec()], "truncated"),
            (vec![vec![0; 99]], "does not begin"),
            (vec![npy(HEADER, &data[1..])], "needs 24 bytes"),
            (vec![npy(HEADER, &[0; 25])], "needs 24 bytes"),
            (vec![version_2], "4294967295"),
            (with("(2, 3)", "(2, 3, 1)"), "shape"),
            (with("(2, 3)", "(18446744073709551615, 3)"), "shape"),
            (with("(2, 3)", "(16384, 16384)"), "1073741824 bytes"),
            (with("<f4", "|O"), "'|O'"),
            (vec![npy("{}", &data)], "no 'descr'"),
        ] {
            let error = parse(npz(&arrays)).unwrap_err().to_string();
            assert!(error.contains(words), "{words}: {error}");
        }
    }

    #[test]
    fn a_flipped_bit_is_found_by_the_check_sum() {
        let mut bytes = float_archive([7.0; 6]);
        let at = bytes.windows(4).position(|w| w == 7f32.to_le_bytes());
        bytes[at.unwrap()] ^= 1;
        let error = parse(bytes).unwrap_err().to_string();
        assert!(error.contains("checksum"), "{error}");
    }

    proptest! {
        #[test]
        fn damage_is_an_error_or_a_map(cut in 0usize..400, at in 0usize..400, value: u8) {
            let mut bytes = float_archive([7.0, 1.5, 0.25, 3.0, 2.0, 1.0]);
            let length = bytes.len();
            bytes[at % length] = value;
            bytes.truncate(length - cut % length);
            let _ = parse(bytes);
        }
    }
}
