//! Headers of H.264 and H.265 in Annex B: parameter sets, and the number of a picture.

use super::bits::BitReader;
use super::message::Codec;
use crate::message::{MessageError, MessageResult};

/// Profiles of H.264 whose parameter sets contain the format of the chroma (7.3.2.1.1).
const HIGH_PROFILES: [u32; 13] = [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135];

/// The NAL units of a message.
///
/// # Errors
/// The reason why it is not in Annex B.
pub(crate) fn units(data: &[u8]) -> MessageResult<Vec<&[u8]>> {
    let starts: Vec<_> = data
        .windows(3)
        .enumerate()
        .filter_map(|(at, bytes)| (bytes == [0, 0, 1]).then_some(at))
        .collect();
    let begins = starts
        .first()
        .is_some_and(|&first| first <= 1 && data[0] == 0);
    if !begins {
        let why = "its video is not in Annex B: it begins without a start code";
        return Err(MessageError::Video(why));
    }
    let ends = starts[1..].iter().copied().chain([data.len()]);
    let units = starts.iter().zip(ends);
    Ok(units
        .map(|(start, end)| &data[start + 3..end])
        .filter(|unit| !unit.is_empty())
        .collect())
}

/// Kind of a NAL unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnitKind {
    /// The sequence's parameters, which include the size.
    Sequence,
    /// The parameters of pictures.
    Pictures,
    /// A part of a picture.
    Slice {
        is_key: bool,
        is_first: bool,
    },
    Other,
}

pub(crate) fn kind(codec: Codec, unit: &[u8]) -> UnitKind {
    // A slice's header begins with the position of the slice: a 1 at the picture's start.
    let begins = |payload: usize| unit.get(payload).is_some_and(|byte| byte >> 7 == 1);
    match (codec, unit[0] & 0x1F, unit[0] >> 1 & 0x3F) {
        (Codec::H264, 7, _) | (Codec::H265, _, 33) => UnitKind::Sequence,
        (Codec::H264, 8, _) | (Codec::H265, _, 34) => UnitKind::Pictures,
        (Codec::H264, kind @ 1..=5, _) => UnitKind::Slice {
            is_key: kind == 5,
            is_first: begins(1),
        },
        (Codec::H265, _, kind @ 0..=31) => UnitKind::Slice {
            is_key: (16..=21).contains(&kind),
            is_first: begins(2),
        },
        _ => UnitKind::Other,
    }
}

/// Fields of the parameter sets that the header of a slice depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    pub(crate) fn read(codec: Codec, unit: &[u8]) -> Option<Self> {
        let (number_bits, has_separate_planes) = match codec {
            Codec::H264 => h264_sequence(unit.get(1..)?)?,
            Codec::H265 => h265_sequence(unit.get(2..)?)?,
        };
        (4..=16).contains(&number_bits).then_some(Self {
            number_bits,
            has_separate_planes,
            extra_bits: 0,
            has_output_flag: false,
        })
    }

    /// Adds those of H.265's pictures.
    pub(crate) fn with_pictures(self, codec: Codec, unit: &[u8]) -> Option<Self> {
        if codec == Codec::H264 {
            return Some(self);
        }
        let mut bits = BitReader::new(unit.get(2..)?);
        let (_id, _sequence) = (bits.golomb()?, bits.golomb()?);
        let _dependent_slices = bits.bit()?;
        Some(Self {
            has_output_flag: bits.bit()?,
            extra_bits: bits.bits(3)? as usize,
            ..self
        })
    }

    /// The number of a picture's first slice, and the next one's.
    pub(crate) fn number(&self, codec: Codec, unit: &[u8]) -> Option<PictureNumber> {
        match codec {
            Codec::H264 => self.h264_number(unit),
            Codec::H265 => self.h265_number(unit),
        }
    }

    /// 7.3.3 of H.264.
    fn h264_number(&self, unit: &[u8]) -> Option<PictureNumber> {
        let is_reference = unit.first()? >> 5 & 3 > 0;
        let mut bits = BitReader::new(unit.get(1..)?);
        let (_first, slice, _pictures) = (bits.golomb()?, bits.golomb()?, bits.golomb()?);
        bits.skip(if self.has_separate_planes { 2 } else { 0 });
        let number = bits.bits(self.number_bits)?;
        Some(PictureNumber {
            number,
            // Only references are counted.
            next: self.wrapped(number + u32::from(is_reference)),
            is_bidirectional: slice % 5 == 1,
        })
    }

    /// 7.3.6.1 of H.265.
    fn h265_number(&self, unit: &[u8]) -> Option<PictureNumber> {
        let kind = unit.first()? >> 1 & 0x3F;
        let mut bits = BitReader::new(unit.get(2..)?);
        bits.skip(if (16..=23).contains(&kind) { 2 } else { 1 });
        let _pictures = bits.golomb()?;
        bits.skip(self.extra_bits);
        let _slice = bits.golomb()?;
        bits.skip(if self.has_output_flag { 1 } else { 0 });
        bits.skip(if self.has_separate_planes { 2 } else { 0 });
        let number = match kind {
            19 | 20 => 0,
            _ => bits.bits(self.number_bits)?,
        };
        Some(PictureNumber {
            number,
            next: self.wrapped(number + 1),
            // Encoders of low delay use B slices that refer to the past alone: the number tells.
            is_bidirectional: false,
        })
    }

    fn wrapped(&self, number: u32) -> u32 {
        number & (self.numbers() - 1)
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

/// Bits of `frame_num`, and the flag of separate colour planes.
fn h264_sequence(payload: &[u8]) -> Option<(u32, bool)> {
    let mut bits = BitReader::new(payload);
    let profile = bits.bits(8)?;
    bits.skip(16);
    let _id = bits.golomb()?;
    let mut is_separate = false;
    if HIGH_PROFILES.contains(&profile) {
        let chroma = bits.golomb()?;
        is_separate = chroma == 3 && bits.bit()?;
        let (_luma_bits, _chroma_bits) = (bits.golomb()?, bits.golomb()?);
        bits.skip(1);
        if bits.bit()? {
            for list in 0..if chroma == 3 { 12 } else { 8 } {
                if bits.bit()? {
                    skip_scaling(&mut bits, if list < 6 { 16 } else { 64 })?;
                }
            }
        }
    }
    Some((bits.golomb()?.checked_add(4)?, is_separate))
}

/// 7.3.2.1.1.1 of H.264.
fn skip_scaling(bits: &mut BitReader, numbers: usize) -> Option<()> {
    let (mut last, mut next) = (8, 8);
    for _ in 0..numbers {
        if next != 0 {
            next = (last + bits.signed()?).rem_euclid(256);
        }
        last = if next == 0 { last } else { next };
    }
    Some(())
}

/// Bits of the order of output, and the flag of separate colour planes: 7.3.2.2.1 of H.265.
fn h265_sequence(payload: &[u8]) -> Option<(u32, bool)> {
    let mut bits = BitReader::new(payload);
    bits.skip(4);
    let layers = bits.bits(3)?;
    // Nesting, then profile and level: 88 bits and 8.
    bits.skip(1 + 96);
    if layers > 0 {
        let mut present = Vec::new();
        for _ in 0..layers {
            present.push((bits.bit()?, bits.bit()?));
        }
        bits.skip(2 * (8 - layers as usize));
        for (profile, level) in present {
            bits.skip(if profile { 88 } else { 0 } + if level { 8 } else { 0 });
        }
    }
    let _id = bits.golomb()?;
    let is_separate = bits.golomb()? == 3 && bits.bit()?;
    let (_width, _height) = (bits.golomb()?, bits.golomb()?);
    if bits.bit()? {
        for _side_of_window in 0..4 {
            bits.golomb()?;
        }
    }
    let (_luma_bits, _chroma_bits) = (bits.golomb()?, bits.golomb()?);
    Some((bits.golomb()?.checked_add(4)?, is_separate))
}
