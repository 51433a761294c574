//! Decides by the headers of each message's picture if a decoder can have all that it refers to.
//!
//! A decoder conceals a missing picture: it repeats the one before. So svl looks for gaps itself,
//! and omits all pictures from there to the next keyframe.

use super::headers::{self, CodecParameters, NalUnit, UnitKind};
use super::message::{Codec, CodedResult, Packet};
use crate::message::MessageError::{Keyframe, Slices, Video};
use xxhash_rust::xxh3::xxh3_64;

/// The pictures of a topic so far.
#[derive(Default)]
pub(crate) struct PictureOrder {
    /// Codec and parameters of the sequence.
    sequence: Option<(Codec, CodecParameters)>,
    /// Hash of the sequence's parameters: they are repeated with each keyframe.
    hash: u64,
    /// True if they changed since the last picture that can be decoded.
    is_new: bool,
    /// The number of the next picture, or the reason to wait for a keyframe; `None` before the
    /// first one.
    next: Option<CodedResult<u32>>,
    /// Slices of a picture.
    slices: usize,
    /// Stamp of the last message.
    last_ns: Option<u64>,
    /// Sum and number of the times between two pictures.
    periods_ns: (u64, u64),
    /// Pictures since the last keyframe, and the shortest way so far from one to the next: numbers
    /// begin anew there.
    since_key: u32,
    shortest_group: Option<u32>,
}

/// A picture that can be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CodedPicture {
    pub(crate) codec: Codec,
    /// True if it refers to no other.
    pub(crate) is_key: bool,
    /// True if codec or size may differ from those before.
    pub(crate) is_new: bool,
}

impl PictureOrder {
    /// Adds the next message.
    ///
    /// # Errors
    /// The reason why its picture cannot be decoded.
    pub(crate) fn take_in(
        &mut self,
        packet: &CodedResult<Packet<'_>>,
    ) -> CodedResult<CodedPicture> {
        let picture = match packet {
            Ok(packet) => self.picture(packet),
            Err(reason) => Err(reason.clone()),
        };
        if let (Err(reason), Some(Ok(_))) = (&picture, &self.next) {
            self.next = Some(Err(reason.clone()));
        }
        picture
    }

    fn picture(&mut self, packet: &Packet<'_>) -> CodedResult<CodedPicture> {
        let last_ns = std::mem::replace(&mut self.last_ns, packet.stamp);
        let apart_ns = packet.stamp.zip(last_ns);
        let apart_ns = apart_ns.and_then(|(stamp, last)| stamp.checked_sub(last));
        let codec = packet.codec.clone()?;
        let units = headers::units(codec, &packet.data)?;
        let slices = units.iter().filter(|unit| unit.kind == UnitKind::Slice);
        let slices: Vec<_> = slices.collect();
        let slice = *slices.first().ok_or(Video("it contains no picture"))?;
        let pictures = slices.iter().filter(|slice| slice.is_first()).count();
        let is_whole = slice.is_first() && pictures == 1;
        check(is_whole, "it does not contain one whole picture")?;
        let is_key = slice.is_key();
        let begins = || Err(Video("the video begins without one").into());
        let next = self.next.clone().unwrap_or_else(begins);
        if !is_key && let Err(reason) = &next {
            return Err(Keyframe(reason.clone()).into());
        }
        let parameters = self.take_in_parameters(codec, &units, is_key)?;
        let number = parameters.number(slice);
        let number = number.ok_or(Video("the header of its picture cannot be read"))?;
        check(
            !number.is_bidirectional,
            "it has B-frames, which refer to later messages: record without",
        )?;
        let is_next = next.is_ok_and(|next| next == number.number);
        check(
            is_key || is_next,
            "a message before it is missing, or it has B-frames",
        )?;
        self.check_slices(slices.len(), is_key)?;
        let numbers = parameters.numbers();
        let group = self.shortest_group.unwrap_or(numbers);
        self.check_time(apart_ns, is_key, numbers.min(group))?;
        self.count_in_group(is_key);
        self.next = Some(Ok(number.next));
        Ok(CodedPicture {
            codec,
            is_key,
            is_new: std::mem::take(&mut self.is_new),
        })
    }

    /// Counts the pictures from one keyframe to the next.
    fn count_in_group(&mut self, is_key: bool) {
        self.since_key += 1;
        if is_key {
            let group = std::mem::take(&mut self.since_key);
            // From the first one on, and where nothing is missing.
            if let Some(Ok(_)) = self.next {
                let shortest = self.shortest_group.unwrap_or(group);
                self.shortest_group = Some(shortest.min(group));
            }
        }
    }

    /// A decoder conceals a missing slice as well: pictures have as many as those before.
    fn check_slices(&mut self, count: usize, is_key: bool) -> CodedResult<()> {
        let before = self.slices;
        self.slices = before.max(count);
        if count == before || before == 0 || (is_key && count > before) {
            return Ok(());
        }
        Err(Slices(count, before).into())
    }

    /// The numbers of pictures return, and begin anew at each keyframe: a gap as long as all of
    /// them, or as a group of pictures, is seen by the stamps.
    fn check_time(&mut self, apart_ns: Option<u64>, is_key: bool, numbers: u32) -> CodedResult<()> {
        // Keyframes may follow a gap.
        let Some(apart_ns) = apart_ns.filter(|_| !is_key) else {
            return Ok(());
        };
        let (total_ns, count) = self.periods_ns;
        check(
            count == 0 || apart_ns / u64::from(numbers) < total_ns / count,
            "as many messages before it may be missing as have other numbers",
        )?;
        self.periods_ns = (total_ns.saturating_add(apart_ns), count + 1);
        Ok(())
    }

    /// Stores the parameters in a message, and returns all that are known.
    fn take_in_parameters(
        &mut self,
        codec: Codec,
        units: &[NalUnit<'_>],
        is_key: bool,
    ) -> CodedResult<CodecParameters> {
        for unit in units {
            let known = self.sequence.filter(|(known, _)| *known == codec);
            let parameters = match unit.kind {
                UnitKind::Sequence => {
                    let hash = xxh3_64(unit.bytes);
                    if known.is_some() && hash == self.hash {
                        continue;
                    }
                    check(is_key, "its parameters change without a keyframe")?;
                    (self.sequence, self.hash, self.is_new) = (None, hash, true);
                    self.slices = 0;
                    CodecParameters::read(unit)
                }
                UnitKind::Pictures => {
                    let (_, known) = known.ok_or(Video("it has no parameters of its video"))?;
                    known.with_pictures(unit)
                }
                UnitKind::Slice => continue,
            };
            let parameters = parameters.ok_or(Video("its parameters cannot be read"))?;
            self.sequence = Some((codec, parameters));
        }
        let known = self.sequence.filter(|(known, _)| *known == codec);
        let why = "it has no parameters of its video: record them with each keyframe";
        Ok(known.ok_or(Video(why))?.1)
    }
}

fn check(is_so: bool, why_not: &'static str) -> CodedResult<()> {
    if is_so {
        return Ok(());
    }
    Err(Video(why_not).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CodecParameters of the baseline profile, with numbers of 4 bits, and of pictures.
    const SEQUENCE: [u8; 5] = [0x67, 66, 0, 10, 0xC0];
    const PICTURES: [u8; 2] = [0x68, 0xC0];
    const KEY: [u8; 3] = [0x65, 0x88, 0x80];

    /// A picture that refers to others: P, or with `kind` 1 B.
    fn picture(reference: u8, kind: u8, number: u8) -> [u8; 3] {
        [
            reference << 5 | 1,
            0x9A | kind << 2 | number >> 3,
            number << 5,
        ]
    }

    fn taken(order: &mut PictureOrder, units: &[&[u8]]) -> CodedResult<CodedPicture> {
        taken_at(order, units, None)
    }

    fn taken_at(
        order: &mut PictureOrder,
        units: &[&[u8]],
        stamp: Option<u64>,
    ) -> CodedResult<CodedPicture> {
        let mark: &[u8] = &[0, 0, 0, 1];
        let data: Vec<u8> = units
            .iter()
            .flat_map(|unit| [mark, unit].concat())
            .collect();
        order.take_in(&Ok(Packet {
            stamp,
            codec: Ok(Codec::H264),
            data: data.into(),
        }))
    }

    #[test]
    fn a_gap_lasts_to_the_next_keyframe() {
        let mut order = PictureOrder::default();
        let mut add = |units: &[&[u8]]| taken(&mut order, units).map(|coded| coded.is_key);
        let key: [&[u8]; 3] = [&SEQUENCE, &PICTURES, &KEY];
        assert!(
            add(&[&picture(1, 0, 1)])
                .unwrap_err()
                .to_string()
                .contains("begins without")
        );
        assert!(
            add(&[&KEY])
                .unwrap_err()
                .to_string()
                .contains("no parameters")
        );
        assert_eq!(add(&key), Ok(true));
        assert_eq!(add(&[&picture(1, 0, 1)]), Ok(false));
        // Nothing refers to it, so its number comes again.
        assert_eq!(add(&[&picture(0, 0, 2)]), Ok(false));
        assert_eq!(add(&[&picture(1, 0, 2)]), Ok(false));
        assert!(
            add(&[&picture(1, 0, 4)])
                .unwrap_err()
                .to_string()
                .contains("is missing")
        );
        let next = add(&[&picture(1, 0, 5)]).unwrap_err().to_string();
        assert!(
            next.contains("keyframe is missing: a message before it"),
            "{next}"
        );
        assert_eq!(add(&[&KEY]), Ok(true));
        for i in 1..40 {
            assert_eq!(add(&[&picture(1, 0, i % 16)]), Ok(false));
        }
        assert!(
            add(&[&picture(1, 1, 8)])
                .unwrap_err()
                .to_string()
                .contains("B-frames")
        );
    }

    #[test]
    fn missing_slices_and_long_gaps_are_seen() {
        let mut order = PictureOrder::default();
        let key: [&[u8]; 4] = [&SEQUENCE, &PICTURES, &KEY, &[0x65, 0x48]];
        let other: &[u8] = &[1 << 5 | 1, 0x40];
        assert!(taken(&mut order, &key).is_ok());
        assert!(taken(&mut order, &[&picture(1, 0, 1), other]).is_ok());
        let missing = taken(&mut order, &[&picture(1, 0, 2)])
            .unwrap_err()
            .to_string();
        assert!(missing.contains("1 slices, those before 2"), "{missing}");
        assert!(taken(&mut order, &key).is_ok());
        // Sixteen numbers: the seventeenth message has the expected one.
        let times = [30, 36, 2, 64, 17 * 33].map(|ms| order.check_time(Some(ms), false, 16));
        assert_eq!(times.iter().filter(|time| time.is_ok()).count(), 4);
        assert!(times[4].is_err());
    }

    #[test]
    fn a_missing_group_of_pictures_is_seen() {
        let mut order = PictureOrder::default();
        let key: [&[u8]; 3] = [&SEQUENCE, &PICTURES, &KEY];
        let mut add = |i: u64, units: &[&[u8]]| {
            let coded = taken_at(&mut order, units, Some(i * 100_000_000));
            coded.map(|coded| coded.is_key)
        };
        let mut at = 0;
        for _ in 0..2 {
            for i in 0..5 {
                let other = picture(1, 0, i);
                let units: &[&[u8]] = if i == 0 { &key } else { &[&other] };
                assert_eq!(add(at, units), Ok(i == 0));
                at += 1;
            }
        }
        assert_eq!(add(at, &key), Ok(true));
        assert_eq!(add(at + 1, &[&picture(1, 0, 1)]), Ok(false));
        // Five are missing, a keyframe among them: the next one has the expected number.
        let missing = add(at + 7, &[&picture(1, 0, 2)]).unwrap_err().to_string();
        assert!(missing.contains("may be missing"), "{missing}");
        assert_eq!(add(at + 10, &key), Ok(true));
    }

    #[test]
    fn other_parameters_are_another_stream() {
        let mut order = PictureOrder::default();
        let mut is_new = |sequence: &[u8]| {
            let coded = taken(&mut order, &[sequence, &PICTURES, &KEY]);
            coded.map(|coded| coded.is_new)
        };
        assert_eq!(
            [is_new(&SEQUENCE), is_new(&SEQUENCE)],
            [Ok(true), Ok(false)]
        );
        let other = [0x67, 66, 0, 11, 0xC0];
        // Unreadable ones change it too, and so does the next readable one.
        assert!(is_new(&other[..4]).is_err());
        assert_eq!([is_new(&SEQUENCE), is_new(&other)], [Ok(true), Ok(true)]);
    }

    #[test]
    fn any_bytes_are_a_picture_or_a_reason() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut orders = [PictureOrder::default(), PictureOrder::default()];
        let key = [
            &[0, 0, 1][..],
            &SEQUENCE,
            &[0, 0, 1],
            &PICTURES,
            &[0, 0, 1],
            &KEY,
        ]
        .concat();
        for _ in 0..20_000 {
            let mut data = key.clone();
            (0..random.usize(..6)).for_each(|_| {
                let at = random.usize(..data.len());
                data[at] = random.u8(..);
            });
            data.truncate(random.usize(..=data.len()));
            data.extend((0..random.usize(..20)).map(|_| random.u8(..)));
            for (order, codec) in orders.iter_mut().zip([Codec::H264, Codec::H265]) {
                let packet = Ok(Packet {
                    stamp: None,
                    codec: Ok(codec),
                    data: data.as_slice().into(),
                });
                let _ = order.take_in(&packet);
            }
        }
    }
}
