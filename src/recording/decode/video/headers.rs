//! Headers of H.264 and H.265 in Annex B: parameter sets, and the number of a picture.
//!
//! Both codecs have the same fields in the same order, as far as svl reads them. A field that a
//! codec or a profile does not have has 0 bits there.

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
    if !data.starts_with(&[0, 0, 1]) && !data.starts_with(&[0, 0, 0, 1]) {
        let why = "its video is not in Annex B: it begins without a start code";
        return Err(MessageError::Video(why));
    }
    let mut units = Vec::new();
    let mut rest = data;
    while let Some(at) = rest.array_windows().rposition(|mark| *mark == [0, 0, 1]) {
        units.extend(NalUnit::new(codec, &rest[at + 3..]));
        rest = &rest[..at];
    }
    units.reverse();
    Ok(units)
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
        let payload = bytes.get(header..).unwrap_or_default();
        Some(Self {
            codec,
            number,
            kind,
            payload,
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
    pub(crate) codec: Codec,
    /// Bits of a picture's number.
    number_bits: u32,
    has_separate_planes: bool,
    /// H.265 only: extra bits of each slice's header, and the flag of pictures without output.
    extra_bits: u32,
    has_output_flag: bool,
}

impl CodecParameters {
    /// From the parameters of a sequence (7.3.2.1.1 of H.264, 7.3.2.2.1 of H.265). `None` if they
    /// are cut or out of range.
    pub(crate) fn read(unit: &NalUnit<'_>) -> Option<Self> {
        let bits = &mut BitReader::new(unit.payload);
        let is_h265 = unit.codec == H265;
        let has_chroma = if is_h265 {
            skip_layers(bits)?;
            true
        } else {
            let profile = bits.bits(8)?;
            bits.bits(16)?;
            HIGH_PROFILES.contains(&profile)
        };
        let _id = bits.golomb()?;
        let chroma = if has_chroma { bits.golomb()? } else { 1 };
        let has_separate_planes = chroma == 3 && bits.flag()?;
        if is_h265 {
            // Width and height, then the sides of the window.
            bits.skip_golombs(2)?;
            let has_window = bits.flag()?;
            bits.skip_golombs(if has_window { 4 } else { 0 })?;
        }
        // Bits of luma and chroma.
        bits.skip_golombs(if has_chroma { 2 } else { 0 })?;
        if has_chroma && !is_h265 {
            skip_scaling(bits, if chroma == 3 { 12 } else { 8 })?;
        }
        let number_bits = bits.golomb()?.checked_add(4)?;
        (number_bits <= 16).then_some(Self {
            codec: unit.codec,
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
        let (_id, _sequence, _dependent_slices) = (bits.golomb()?, bits.golomb()?, bits.flag()?);
        Some(Self {
            has_output_flag: bits.flag()?,
            extra_bits: bits.bits(3)?,
            ..self
        })
    }

    /// The number of the picture that a slice begins: 7.3.3 of H.264, 7.3.6.1 of H.265.
    pub(crate) fn number(&self, unit: &NalUnit<'_>) -> Option<PictureNumber> {
        let mut bits = BitReader::new(unit.payload);
        let _first = match (unit.codec, unit.number) {
            (H264, _) => bits.golomb()?,
            (H265, 16..=23) => bits.bits(2)?,
            (H265, _) => bits.bits(1)?,
        };
        // The kind of the slice and the parameters of pictures; in H.265 the other way round.
        let kind = bits.golomb()?;
        bits.bits(self.extra_bits)?;
        bits.golomb()?;
        let number = if matches!((unit.codec, unit.number), (H265, 19 | 20)) {
            0
        } else {
            bits.bits(u32::from(self.has_output_flag) + 2 * u32::from(self.has_separate_planes))?;
            bits.bits(self.number_bits)?
        };
        // H.264 counts references only.
        let is_counted = unit.codec == H265 || unit.bytes[0] >> 5 & 3 > 0;
        Some(PictureNumber {
            number,
            next: (number + u32::from(is_counted)) % self.numbers(),
            // H.265's B slices may refer to the past alone, for a low delay: the number tells.
            is_bidirectional: unit.codec == H264 && kind % 5 == 1,
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

/// Reads the scaling lists of H.264 and two flags before them (7.3.2.1.1.1).
fn skip_scaling(bits: &mut BitReader, lists: usize) -> Option<()> {
    let (_bypass, has_lists) = (bits.flag()?, bits.flag()?);
    for list in 0..if has_lists { lists } else { 0 } {
        let mut numbers = if list < 6 { 16 } else { 64 };
        let mut scale = if bits.flag()? { 8 } else { 0 };
        // The others are equal to the last one before 0.
        while scale != 0 && numbers > 0 {
            scale = (scale + bits.signed()?).rem_euclid(256);
            numbers -= 1;
        }
    }
    Some(())
}

/// Reads the profiles and levels of H.265's layers, and all before them.
fn skip_layers(bits: &mut BitReader) -> Option<()> {
    bits.bits(4)?;
    let layers = bits.bits(3)?;
    // Nesting, then profile and level: 88 bits and 8.
    bits.bits(1 + 96)?;
    if layers > 0 {
        // Two flags for each of eight layers: has it a profile, a level?
        let flags = bits.bits(16)? >> (16 - 2 * layers);
        let profiles = (flags & 0xAAAA).count_ones();
        let levels = (flags & 0x5555).count_ones();
        bits.bits(88 * profiles + 8 * levels)?;
    }
    Some(())
}
