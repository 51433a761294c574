//! Images of a file in the order of their stamps: a bag has them as they arrived.

use super::stamp_pairing::StampPairing;
use crate::decode::pixels::MessageImage;
use crate::message::MessageResult;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use svl_core::stereo::Side;

/// Time in the log for which an image waits for earlier ones: two messages may each be half a
/// second out of order, in opposite directions.
pub(crate) const HOLD_NS: u64 = 1_000_000_000;
/// An image that is that much earlier than the one before it is not out of order: the clock jumped.
const JUMP_NS: u64 = HOLD_NS + HOLD_NS / 2;
/// Limit on the bytes of images that wait.
const MAX_BYTES: usize = 256 << 20;

/// Sorts images by stamp. Beyond the time in the log for which they wait, beyond the limit of their
/// bytes, and where the clock jumps back, the order is that of the file.
#[derive(Clone)]
pub(crate) struct StampOrder<T> {
    waiting: BTreeMap<StampKey, HeldImage<T>>,
    /// Log time and key of those that wait, and of some that do not any more.
    by_log: BinaryHeap<Reverse<(u64, StampKey)>>,
    /// All keys up to this one are due.
    due: Option<StampKey>,
    /// The latest log time.
    log_ns: u64,
    bytes: usize,
    arrivals: u64,
    /// Jumps of the clock back.
    epoch: u64,
    /// The last stamp of each camera.
    last_ns: [Option<u64>; 2],
    ended: bool,
}

/// Jumps of the clock before it, stamp, arrivals before it.
type StampKey = (u64, u64, u64);

#[derive(Clone)]
struct HeldImage<T> {
    image: T,
    bytes: usize,
}

impl<T> StampOrder<T> {
    pub(crate) fn new() -> Self {
        Self {
            waiting: BTreeMap::new(),
            by_log: BinaryHeap::new(),
            due: None,
            log_ns: 0,
            bytes: 0,
            arrivals: 0,
            epoch: 0,
            last_ns: [None; 2],
            ended: false,
        }
    }

    /// Adds an image of a camera, of `bytes` bytes.
    pub(crate) fn push(&mut self, side: Side, stamp_ns: u64, log_ns: u64, image: T, bytes: usize) {
        let last = self.last_ns[side as usize].replace(stamp_ns);
        if last.is_some_and(|last| last.saturating_sub(stamp_ns) > JUMP_NS) {
            // Images before the jump have no later ones to wait for.
            self.due = Some((self.epoch, u64::MAX, u64::MAX));
            self.epoch += 1;
        }
        let key = (self.epoch, stamp_ns, self.arrivals);
        self.arrivals += 1;
        self.bytes += bytes;
        self.waiting.insert(key, HeldImage { image, bytes });
        self.by_log.push(Reverse((log_ns, key)));
        self.advance(log_ns);
    }

    /// Notes the log time of any message.
    pub(crate) fn advance(&mut self, log_ns: u64) {
        self.log_ns = self.log_ns.max(log_ns);
        while let Some(&Reverse((log_ns, key))) = self.by_log.peek()
            && log_ns.saturating_add(HOLD_NS) <= self.log_ns
        {
            self.by_log.pop();
            self.due = self.due.max(Some(key));
        }
    }

    /// Ends the file: there are no more images.
    pub(crate) fn end(&mut self) {
        self.ended = true;
    }

    /// The next image, if no earlier one can come.
    pub(crate) fn pop(&mut self) -> Option<T> {
        let first = *self.waiting.first_key_value()?.0;
        let is_due = self.ended || self.bytes > MAX_BYTES || Some(first) <= self.due;
        let HeldImage { image, bytes } = is_due.then(|| self.waiting.remove(&first))??;
        self.bytes -= bytes;
        Some(image)
    }
}

/// Pairs images by their stamps: those of a file in the order of their stamps, live ones, and those
/// that records join, as they arrive.
#[derive(Clone)]
pub(crate) struct ImagePairing<T> {
    order: Option<StampOrder<(Side, u64, T, usize)>>,
    pub(crate) pairing: StampPairing<T>,
    ended: bool,
}

impl<T> ImagePairing<T> {
    pub(crate) fn for_file(max_skew_ns: u64) -> Self {
        Self {
            order: Some(StampOrder::new()),
            pairing: StampPairing::new(max_skew_ns),
            ended: false,
        }
    }

    /// Pairs images in the order of the file, by records alone.
    pub(crate) fn by_records() -> Self {
        Self {
            order: None,
            pairing: StampPairing::by_records(),
            ended: false,
        }
    }

    /// `limit`: that on the bytes of waiting images.
    pub(crate) fn live(max_skew_ns: u64, limit: usize) -> Self {
        Self {
            order: None,
            pairing: StampPairing::new(max_skew_ns).with_limit(limit),
            ended: false,
        }
    }

    /// Adds an image of `bytes` bytes.
    pub(crate) fn push(&mut self, side: Side, stamp_ns: u64, log_ns: u64, image: T, bytes: usize) {
        match &mut self.order {
            Some(order) => {
                order.push(
                    side,
                    stamp_ns,
                    log_ns,
                    (side, stamp_ns, image, bytes),
                    bytes,
                );
            }
            None => self.pairing.push(side, stamp_ns, image, bytes),
        }
    }

    /// Notes the log time of any message.
    pub(crate) fn advance(&mut self, log_ns: u64) {
        self.order
            .iter_mut()
            .for_each(|order| order.advance(log_ns));
    }

    pub(crate) fn pop(&mut self) -> Option<[(u64, T); 2]> {
        loop {
            let pair = self.pairing.pop();
            if pair.is_some() {
                return pair;
            }
            // One by one: equal stamps are paired in the order of the file.
            let next = self.order.as_mut().and_then(StampOrder::pop);
            match next {
                Some((side, stamp_ns, image, bytes)) => {
                    self.pairing.push(side, stamp_ns, image, bytes);
                }
                None if self.ended => {
                    self.pairing.end();
                    return self.pairing.pop();
                }
                None => return None,
            }
        }
    }

    /// Ends the source: there are no more images.
    pub(crate) fn end(&mut self) {
        self.ended = true;
        self.order.iter_mut().for_each(StampOrder::end);
    }

    pub(crate) fn pairing_mut(&mut self) -> &mut StampPairing<T> {
        &mut self.pairing
    }
}

/// An image that waits for its partner.
pub(crate) enum PairImage {
    Image(MessageImage),
    /// The picture of a video's message with that number.
    Picture(u64),
}

/// An image, or the reason why it cannot be read.
pub(crate) type ReadImage = MessageResult<PairImage>;

/// The images of a pair, left and right, with their stamps.
pub(crate) type PairImages = [(u64, ReadImage); 2];

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// The stamps as they come out, in milliseconds, of images with those stamps and log times.
    fn sorted(images: &[(u64, u64)]) -> Vec<u64> {
        let mut order = StampOrder::new();
        let mut out = Vec::new();
        for &(stamp, log) in images {
            order.push(Side::Left, stamp * MS, log * MS, stamp, 1);
            out.extend(std::iter::from_fn(|| order.pop()));
        }
        order.end();
        out.extend(std::iter::from_fn(|| order.pop()));
        assert_eq!((order.bytes, order.waiting.len()), (0, 0));
        out
    }

    #[test]
    fn images_half_a_second_out_of_order_are_sorted() {
        let mut random = fastrand::Rng::with_seed(5);
        for _ in 0..50 {
            let stamps: Vec<u64> = (0..200).map(|i| 1000 + 20 * i).collect();
            let logged = |&stamp: &u64| (stamp, stamp - 500 + random.u64(0..1000));
            let mut images: Vec<_> = stamps.iter().map(logged).collect();
            images.sort_by_key(|&(_, log)| log);
            assert_eq!(sorted(&images), stamps);
        }
    }

    #[test]
    fn a_clock_that_jumps_back_keeps_the_order_of_the_file() {
        let begins = [50_000, 0].into_iter();
        let stamps = begins.flat_map(|begin| (0..40).map(move |i| begin + 100 * i));
        let all: Vec<_> = stamps.collect();
        let logs = (0..).map(|at| 100_000 + 100 * at);
        let images: Vec<_> = all.iter().copied().zip(logs).collect();
        assert_eq!(sorted(&images), all);
        // Out of order after the jump, too.
        let mut shuffled = images;
        shuffled.swap(60, 63);
        assert_eq!(sorted(&shuffled), all);
    }

    #[test]
    fn equal_stamps_keep_the_order_of_the_file_and_memory_has_a_limit() {
        let mut order = StampOrder::new();
        for place in 0..4 {
            order.push(Side::BOTH[place % 2], 7, 7, place, MAX_BYTES / 3);
        }
        assert_eq!([order.pop(), order.pop()], [Some(0), None]);
        order.end();
        let rest = [(); 3].map(|()| order.pop());
        assert_eq!(rest, [1, 2, 3].map(Some));
    }
}
