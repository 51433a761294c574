//! Headers of H.264 and H.265 in Annex B: parameter sets, and the number of a picture.

use super::bits::BitReader;
use super::message::Codec::{self, H264, H265};
use crate::message::{MessageError, MessageResult};

/// Profiles of H.264 whose parameter sets contain the format of the chroma (7.3.2.1.1).
const HIGH_PROFILES: [u32; 13] = [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135];

/// The NAL units of a message.
///
/// # Errors
/// The reason why it is not in Annex B.
pub(crate) fn units(codec: Codec, data: &[u8]) -> MessageResult<Vec<NalUnit<'_>>> {
    let places = 0..data.len().saturating_sub(2);
    let starts: Vec<_> = places
        .filter(|at| data[*at..].starts_with(&[0, 0, 1]))
        .collect();
    if !matches!(starts[..], [0 | 1, ..]) || data[0] != 0 {
        let why = "its video is not in Annex B: it begins without a start code";
        return Err(MessageError::Video(why));
    }
    let ends = starts[1..].iter().copied().chain([data.len()]);
    let units = starts
        .iter()
        .zip(ends)
        .map(|(start, end)| &data[start + 3..end]);
    let units = units.filter_map(|bytes| NalUnit::new(codec, bytes));
    Ok(units.collect())
}

/// Kind of a NAL unit that svl reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnitKind {
    /// The sequence's parameters, which include the size.
    Sequence,
    /// The parameters of pictures.
    Pictures,
    /// A part of a picture.
    Slice,
}

/// A NAL unit: its type, and its bytes without and with the header that contains the type.
pub(crate) struct NalUnit<'a> {
    codec: Codec,
    number: u8,
    pub(crate) kind: UnitKind,
    payload: &'a [u8],
    pub(crate) bytes: &'a [u8],
}

impl<'a> NalUnit<'a> {
    /// `None` for other kinds, and without a byte.
    fn new(codec: Codec, bytes: &'a [u8]) -> Option<Self> {
        let (number, header) = match codec {
            H264 => (bytes.first()? & 0x1F, 1),
            H265 => (bytes.first()? >> 1 & 0x3F, 2),
        };
        let kind = match (codec, number) {
            (H264, 7) | (H265, 33) => UnitKind::Sequence,
            (H264, 8) | (H265, 34) => UnitKind::Pictures,
            (H264, 1..=5) | (H265, 0..=31) => UnitKind::Slice,
            _ => return None,
        };
        Some(Self {
            codec,
            number,
            kind,
            payload: bytes.get(header..).unwrap_or_default(),
            bytes,
        })
    }

    /// True for a slice of a keyframe.
    pub(crate) fn is_key(&self) -> bool {
        matches!((self.codec, self.number), (H264, 5) | (H265, 16..=21))
    }

    /// True for the first slice of a picture: the header begins with its position, 0, coded as 1.
    pub(crate) fn is_first(&self) -> bool {
        self.payload.first().is_some_and(|byte| byte >> 7 == 1)
    }
}

/// Fields of the parameter sets that the header of a slice depends on.
#[derive(Clone, Copy)]
pub(crate) struct CodecParameters {
    /// Bits of a picture's number.
    number_bits: u32,
    has_separate_planes: bool,
    /// H.265 only: extra bits of each slice's header, and the flag of pictures without output.
    extra_bits: usize,
    has_output_flag: bool,
}

impl CodecParameters {
    /// From the parameters of a sequence. `None` if they are cut or out of range.
    pub(crate) fn read(unit: &NalUnit<'_>) -> Option<Self> {
        let mut bits = BitReader::new(unit.payload);
        let has_separate_planes = match unit.codec {
            H264 => h264_planes(&mut bits)?,
            H265 => h265_planes(&mut bits)?,
        };
        let number_bits = bits.golomb()?.checked_add(4)?;
        (number_bits <= 16).then_some(Self {
            number_bits,
            has_separate_planes,
            extra_bits: 0,
            has_output_flag: false,
        })
    }

    /// Adds those of H.265's pictures (7.3.2.3.1).
    pub(crate) fn with_pictures(self, unit: &NalUnit<'_>) -> Option<Self> {
        if unit.codec == H264 {
            return Some(self);
        }
        let mut bits = BitReader::new(unit.payload);
        let (_id, _sequence, _dependent_slices) = (bits.golomb()?, bits.golomb()?, bits.bit()?);
        Some(Self {
            has_output_flag: bits.bit()?,
            extra_bits: bits.bits(3)? as usize,
            ..self
        })
    }

    /// The number of the picture that a slice begins: 7.3.3 of H.264, 7.3.6.1 of H.265.
    pub(crate) fn number(&self, unit: &NalUnit<'_>) -> Option<PictureNumber> {
        let mut bits = BitReader::new(unit.payload);
        let mut is_bidirectional = false;
        match unit.codec {
            H264 => {
                let (_first, slice, _pictures) = (bits.golomb()?, bits.golomb()?, bits.golomb()?);
                is_bidirectional = slice % 5 == 1;
            }
            // Encoders of low delay use B slices that refer to the past alone: the number tells.
            H265 => {
                bits.skip(if (16..=23).contains(&unit.number) {
                    2
                } else {
                    1
                });
                let _pictures = bits.golomb()?;
                bits.skip(self.extra_bits);
                let _slice = bits.golomb()?;
                bits.skip(self.has_output_flag.into());
            }
        }
        bits.skip(if self.has_separate_planes { 2 } else { 0 });
        let number = match (unit.codec, unit.number) {
            (H265, 19 | 20) => 0,
            _ => bits.bits(self.number_bits)?,
        };
        // H.264 counts references only.
        let is_counted = unit.codec == H265 || unit.bytes[0] >> 5 & 3 > 0;
        Some(PictureNumber {
            number,
            next: (number + u32::from(is_counted)) % self.numbers(),
            is_bidirectional,
        })
    }

    /// Number of different numbers: a gap of that many pictures is not visible in them.
    pub(crate) fn numbers(&self) -> u32 {
        1 << self.number_bits
    }
}

/// Number of a picture: `frame_num` in H.264, the low bits of the order of output in H.265.
pub(crate) struct PictureNumber {
    pub(crate) number: u32,
    /// That of the next picture, if none is missing.
    pub(crate) next: u32,
    /// True if it may refer to later pictures.
    pub(crate) is_bidirectional: bool,
}

/// The flag of separate colour planes, and all up to the bits of `frame_num`.
fn h264_planes(bits: &mut BitReader) -> Option<bool> {
    let profile = bits.bits(8)?;
    bits.skip(16);
    let _id = bits.golomb()?;
    if !HIGH_PROFILES.contains(&profile) {
        return Some(false);
    }
    let chroma = bits.golomb()?;
    let is_separate = chroma == 3 && bits.bit()?;
    let (_luma_bits, _chroma_bits) = (bits.golomb()?, bits.golomb()?);
    bits.skip(1);
    if bits.bit()? {
        for list in 0..if chroma == 3 { 12 } else { 8 } {
            if bits.bit()? {
                skip_scaling(bits, if list < 6 { 16 } else { 64 })?;
            }
        }
    }
    Some(is_separate)
}

/// 7.3.2.1.1.1 of H.264.
fn skip_scaling(bits: &mut BitReader, numbers: usize) -> Option<()> {
    let mut scale = 8;
    for _ in 0..numbers {
        scale = (scale + bits.signed()?).rem_euclid(256);
        // The others are equal to the last one.
        if scale == 0 {
            break;
        }
    }
    Some(())
}

/// The flag of separate colour planes, and all up to the bits of the order of output: 7.3.2.2.1 of
/// H.265.
fn h265_planes(bits: &mut BitReader) -> Option<bool> {
    bits.skip(4);
    let layers = bits.bits(3)?;
    // Nesting, then profile and level: 88 bits and 8.
    bits.skip(1 + 96);
    if layers > 0 {
        // Two flags for each of eight layers: has it a profile, a level?
        let flags = bits.bits(16)? >> (16 - 2 * layers);
        let profiles = (flags & 0xAAAA).count_ones();
        let levels = (flags & 0x5555).count_ones();
        bits.skip((88 * profiles + 8 * levels) as usize);
    }
    let _id = bits.golomb()?;
    let is_separate = bits.golomb()? == 3 && bits.bit()?;
    let (_width, _height) = (bits.golomb()?, bits.golomb()?);
    // The sides of the window, then the bits of luma and chroma.
    for _ in 0..if bits.bit()? { 6 } else { 2 } {
        bits.golomb()?;
    }
    Some(is_separate)
}
