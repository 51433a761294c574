//! Decides by the headers of each message's picture if a decoder can have all that it refers to.
//!
//! A decoder conceals a missing picture: it repeats the one before. So svl looks for gaps itself,
//! and omits all pictures from there to the next keyframe.

use super::headers::{self, CodecParameters, NalUnit, UnitKind};
use super::message::{Codec, CodedResult, Packet};
use crate::message::MessageError::{Keyframe, Slices, Video};
use std::sync::Arc;
use xxhash_rust::xxh3::xxh3_64;

/// The pictures of a topic so far.
#[derive(Default)]
pub(crate) struct PictureOrder {
    /// Parameters of the sequence.
    sequence: Option<CodecParameters>,
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
        let packet = packet.as_ref().map_err(Arc::clone);
        let picture = packet.and_then(|packet| self.picture(packet));
        if let (Err(reason), Some(next @ Ok(_))) = (&picture, &mut self.next) {
            *next = Err(reason.clone());
        }
        picture
    }

    fn picture(&mut self, packet: &Packet<'_>) -> CodedResult<CodedPicture> {
        let last_ns = std::mem::replace(&mut self.last_ns, packet.stamp);
        let apart_ns = packet.stamp.zip(last_ns);
        let apart_ns = apart_ns.and_then(|(stamp, last)| stamp.checked_sub(last));
        let codec = packet.codec.clone()?;
        let units = headers::units(codec, &packet.data)?;
        let slices = || units.iter().filter(|unit| unit.kind == UnitKind::Slice);
        let slice = slices().next().ok_or(Video("it contains no picture"))?;
        let is_whole = slice.is_first() && slices().filter(|slice| slice.is_first()).count() == 1;
        check(is_whole, "it does not contain one whole picture")?;
        let is_key = slice.is_key();
        let begins = || Err(Video("the video begins without one").into());
        let next = self.next.clone().unwrap_or_else(begins);
        if !is_key && let Err(reason) = next {
            return Err(Keyframe(reason).into());
        }
        let parameters = self.take_in_parameters(codec, &units, is_key)?;
        let unreadable = Video("the header of its picture cannot be read");
        let number = parameters.number(slice).ok_or(unreadable)?;
        check(
            !number.is_bidirectional,
            "it has B-frames, which refer to later messages: record without",
        )?;
        check(
            is_key || next.is_ok_and(|next| next == number.number),
            "a message before it is missing, or it has B-frames",
        )?;
        self.check_slices(slices().count(), is_key)?;
        let numbers = parameters.numbers();
        let group = self.shortest_group.unwrap_or(numbers);
        if !is_key {
            self.check_time(apart_ns, numbers.min(group))?;
        }
        self.count_in_group(is_key);
        self.next = Some(Ok(number.next));
        let is_new = std::mem::take(&mut self.is_new);
        Ok(CodedPicture {
            codec,
            is_key,
            is_new,
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
    /// them, or as a group of pictures, is seen by the stamps. Keyframes may follow a gap.
    fn check_time(&mut self, apart_ns: Option<u64>, numbers: u32) -> CodedResult<()> {
        let Some(apart_ns) = apart_ns else {
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
        let mut known = self.sequence.filter(|known| known.codec == codec);
        for unit in units {
            let parameters = match unit.kind {
                UnitKind::Sequence if known.is_some() && xxh3_64(unit.bytes) == self.hash => {
                    continue;
                }
                UnitKind::Sequence => {
                    check(is_key, "its parameters change without a keyframe")?;
                    (self.sequence, self.hash) = (None, xxh3_64(unit.bytes));
                    (self.is_new, self.slices) = (true, 0);
                    CodecParameters::read(unit)
                }
                UnitKind::Pictures => known
                    .ok_or(Video("it has no parameters of its video"))?
                    .with_pictures(unit),
                UnitKind::Slice => continue,
            };
            known = Some(parameters.ok_or(Video("its parameters cannot be read"))?);
            self.sequence = known;
        }
        let why = "it has no parameters of its video: record them with each keyframe";
        Ok(known.ok_or(Video(why))?)
    }
}

fn check(is_so: bool, why_not: &'static str) -> CodedResult<()> {
    is_so.then_some(()).ok_or_else(|| Video(why_not).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parameters of the baseline profile, with numbers of 4 bits, and of pictures.
    const SEQUENCE: [u8; 5] = [0x67, 66, 0, 10, 0xC0];
    const PICTURES: [u8; 2] = [0x68, 0xC0];
    const KEY: [u8; 3] = [0x65, 0x88, 0x80];
    const GROUP: [&[u8]; 3] = [&SEQUENCE, &PICTURES, &KEY];

    /// A picture that refers to others: P, or with `kind` 1 B.
    fn picture(reference: u8, kind: u8, number: u8) -> [u8; 3] {
        let first = 0x9A | kind << 2 | number >> 3;
        [reference << 5 | 1, first, number << 5]
    }

    fn coded(units: &[&[u8]]) -> Vec<u8> {
        units
            .iter()
            .flat_map(|unit| [&[0, 0, 0, 1], *unit].concat())
            .collect()
    }

    fn taken(
        order: &mut PictureOrder,
        codec: Codec,
        data: &[u8],
        stamp: Option<u64>,
    ) -> CodedResult<CodedPicture> {
        let (codec, data) = (Ok(codec), data.into());
        order.take_in(&Ok(Packet { stamp, codec, data }))
    }

    /// Adds a message: it is a keyframe, or not, or has words in the reason.
    fn check_taken(
        order: &mut PictureOrder,
        stamp: Option<u64>,
        units: &[&[u8]],
        expected: Result<bool, &str>,
    ) {
        let taken = taken(order, Codec::H264, &coded(units), stamp);
        match (taken.map(|coded| coded.is_key), expected) {
            (Err(reason), Err(words)) => assert!(reason.to_string().contains(words), "{reason}"),
            (taken, expected) => assert_eq!(taken.ok(), expected.ok(), "{units:?}"),
        }
    }

    #[test]
    fn a_gap_lasts_to_the_next_keyframe() {
        let mut order = PictureOrder::default();
        let mut check = |units: &[&[u8]], expected| check_taken(&mut order, None, units, expected);
        check(&[&picture(1, 0, 1)], Err("begins without"));
        check(&[&KEY], Err("no parameters"));
        check(&GROUP, Ok(true));
        check(&[&picture(1, 0, 1)], Ok(false));
        // Nothing refers to it, so its number comes again.
        check(&[&picture(0, 0, 2)], Ok(false));
        check(&[&picture(1, 0, 2)], Ok(false));
        check(&[&picture(1, 0, 4)], Err("is missing"));
        check(
            &[&picture(1, 0, 5)],
            Err("keyframe is missing: a message before it"),
        );
        check(&[&KEY], Ok(true));
        (1..40).for_each(|i| check(&[&picture(1, 0, i % 16)], Ok(false)));
        check(&[&picture(1, 1, 8)], Err("B-frames"));
    }

    #[test]
    fn missing_slices_and_long_gaps_are_seen() {
        let mut order = PictureOrder::default();
        let key = [&GROUP[..], &[&[0x65, 0x48]]].concat();
        let mut check = |units: &[&[u8]], expected| check_taken(&mut order, None, units, expected);
        check(&key, Ok(true));
        check(&[&picture(1, 0, 1), &[1 << 5 | 1, 0x40]], Ok(false));
        check(&[&picture(1, 0, 2)], Err("1 slices, those before 2"));
        check(&key, Ok(true));
        // Sixteen numbers: the seventeenth message has the expected one.
        let times = [30, 36, 2, 64, 17 * 33].map(|ms| order.check_time(Some(ms), 16).is_ok());
        assert_eq!(times, [true, true, true, true, false]);
    }

    #[test]
    fn a_missing_group_of_pictures_is_seen() {
        let mut order = PictureOrder::default();
        let mut check = |i: u64, units: &[&[u8]], expected| {
            check_taken(&mut order, Some(i * 100_000_000), units, expected);
        };
        for at in 0..10 {
            let other = picture(1, 0, at as u8 % 5);
            let is_key = at % 5 == 0;
            let units: &[&[u8]] = if is_key { &GROUP } else { &[&other] };
            check(at, units, Ok(is_key));
        }
        check(10, &GROUP, Ok(true));
        check(11, &[&picture(1, 0, 1)], Ok(false));
        // Five are missing, a keyframe among them: the next one has the expected number.
        check(17, &[&picture(1, 0, 2)], Err("may be missing"));
        check(20, &GROUP, Ok(true));
    }

    #[test]
    fn other_parameters_are_another_stream() {
        let mut order = PictureOrder::default();
        let other = [0x67, 66, 0, 11, 0xC0];
        // Unreadable ones change it too, and so does the next readable one.
        for (sequence, is_new) in [
            (&SEQUENCE[..], Some(true)),
            (&SEQUENCE, Some(false)),
            (&other[..4], None),
            (&SEQUENCE, Some(true)),
            (&other, Some(true)),
        ] {
            let data = coded(&[sequence, &PICTURES, &KEY]);
            let taken = taken(&mut order, Codec::H264, &data, None);
            assert_eq!(taken.ok().map(|coded| coded.is_new), is_new);
        }
    }

    #[test]
    fn any_bytes_are_a_picture_or_a_reason() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut orders = [PictureOrder::default(), PictureOrder::default()];
        for _ in 0..20_000 {
            let mut data = coded(&GROUP);
            (0..random.usize(..6)).for_each(|_| {
                let at = random.usize(..data.len());
                data[at] = random.u8(..);
            });
            data.truncate(random.usize(..=data.len()));
            data.extend((0..random.usize(..20)).map(|_| random.u8(..)));
            for (order, codec) in orders.iter_mut().zip([Codec::H264, Codec::H265]) {
                let _ = taken(order, codec, &data, None);
            }
        }
    }
}
