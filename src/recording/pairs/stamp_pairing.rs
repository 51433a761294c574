//! Pairs the images of two topics, in any order of arrival: by nearest stamps, or as svl's own
//! records join them.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Bound;
use svl_core::stereo::Side::{self, Left, Right};
use svl_files::pairing::{Nearest, WaitingStamps};

/// Limit on the bytes of waiting images: more than half a minute of two cameras, in a file that has
/// all images of one camera before those of the other.
const WAITING_BYTES: usize = 1 << 30;
/// Least memory of a waiting image besides its pixels.
const ENTRY_BYTES: usize = 128;
/// Number of later images of the other camera after which an image is unpaired: an unordered file
/// does not have that many in order by chance.
const MAX_LATER_IMAGES: usize = 8;
/// Factor by which an image may be farther out of order than any before it.
const REORDER_FACTOR: usize = 8;

/// Images without a partner, by their position in the recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct UnpairedImages {
    /// Before the other camera's first image: one camera started earlier.
    pub before: u64,
    /// Between the other camera's images.
    pub inside: u64,
    /// After the other camera's last image: one camera stopped later.
    pub after: u64,
}

impl UnpairedImages {
    pub fn total(self) -> u64 {
        self.before + self.inside + self.after
    }
}

/// Images of two cameras waiting for their partners.
///
/// An image is paired with the nearest of the other camera only when no nearer one can arrive:
/// nearest first, so that a late image does not take the partner of the next. How long that takes
/// is learned from the order so far (`slack`): files in order need no wait, and unordered ones
/// wait no longer than their own disorder. Images outside the span of the other camera are no
/// losses, as one camera began earlier; those within it are.
#[derive(Clone)]
pub(crate) struct StampPairing<T> {
    max_skew_ns: u64,
    /// The right stamp of each left one, by the records; `None` if the nearest stamps decide.
    joined: Option<BTreeMap<u64, u64>>,
    /// Limit on the bytes of waiting images.
    limit: usize,
    waiting: [BTreeMap<u64, (T, usize)>; 2],
    /// Number of later images of each camera after which no earlier one can arrive: 0 if all
    /// arrived in order.
    slack: [usize; 2],
    bytes: usize,
    ended: bool,
    /// Stamps of the images without a partner.
    pub(crate) unpaired_ns: Vec<u64>,
    /// First and last stamp of each camera.
    spans: [Option<(u64, u64)>; 2],
    /// Stamps of the unpaired images of each camera that are outside the span of the other.
    outside: [BTreeSet<u64>; 2],
    /// The smallest skew above the limit.
    pub(crate) nearest_miss_ns: Option<u64>,
    /// Stamp of the latest image of each camera that was dropped for lack of memory.
    crowded_out: [Option<u64>; 2],
    /// Images that arrived after those of their time had been dropped for lack of memory.
    pub(crate) late: u64,
}

impl<T> StampPairing<T> {
    pub(crate) fn new(max_skew_ns: u64) -> Self {
        Self {
            max_skew_ns,
            joined: None,
            limit: WAITING_BYTES,
            waiting: [BTreeMap::new(), BTreeMap::new()],
            slack: [0; 2],
            bytes: 0,
            ended: false,
            unpaired_ns: Vec::new(),
            spans: [None; 2],
            outside: [BTreeSet::new(), BTreeSet::new()],
            nearest_miss_ns: None,
            crowded_out: [None; 2],
            late: 0,
        }
    }

    /// Pairs images by records alone.
    pub(crate) fn by_records() -> Self {
        Self {
            joined: Some(BTreeMap::new()),
            ..Self::new(0)
        }
    }

    /// Adds a record: the images with these stamps, left and right, are a pair.
    pub(crate) fn join(&mut self, [left_ns, right_ns]: [u64; 2]) {
        if let Some(joined) = &mut self.joined {
            joined.insert(left_ns, right_ns);
            if joined.len() > MAX_WAITING {
                joined.pop_first();
            }
        }
    }

    /// The same with another limit on the bytes of waiting images.
    pub(crate) fn with_limit(self, limit: usize) -> Self {
        Self { limit, ..self }
    }

    /// Images without a partner so far, by position.
    pub(crate) fn unpaired_images(&self) -> UnpairedImages {
        let mut images = UnpairedImages {
            inside: self.unpaired_ns.len() as u64,
            ..UnpairedImages::default()
        };
        for (camera, stamps) in self.outside.iter().enumerate() {
            let first = self.spans[1 - camera].map_or(u64::MAX, |(first, _)| first);
            let before = stamps.range(..first).count();
            images.before += before as u64;
            images.after += (stamps.len() - before) as u64;
        }
        images
    }

    /// Images without a partner before the other camera's first image or after its last.
    pub(crate) fn outside(&self) -> u64 {
        self.outside.iter().map(|stamps| stamps.len() as u64).sum()
    }

    /// Adds an image of `bytes` bytes; a second one with the same stamp replaces the first.
    pub(crate) fn push(&mut self, camera: Side, stamp: u64, image: T, bytes: usize) {
        let bytes = bytes.saturating_add(ENTRY_BYTES);
        let camera = camera as usize;
        self.widen_span(camera, stamp);
        let given_up = self.crowded_out[1 - camera];
        self.late += u64::from(
            given_up.is_some_and(|given_up| given_up >= stamp.saturating_sub(self.max_skew_ns)),
        );
        // Overtaken by that many, the file has no order at all, and everything waits for the end.
        let overtaken = self.waiting[camera]
            .range((Bound::Excluded(stamp), Bound::Unbounded))
            .take(4 * MAX_LATER_IMAGES)
            .count();
        let slack = if overtaken < 4 * MAX_LATER_IMAGES {
            // Jitter may be larger the next time; waiting longer costs memory, not pairs.
            REORDER_FACTOR * overtaken
        } else {
            usize::MAX
        };
        self.slack[camera] = self.slack[camera].max(slack);
        self.bytes += bytes;
        if let Some((_, replaced)) = self.waiting[camera].insert(stamp, (image, bytes)) {
            self.bytes -= replaced;
            self.unpaired_ns.push(stamp);
        }
    }

    /// Gives up the waiting images of a camera with later stamps than this one, as its clock jumped
    /// back: none of them would have a partner before the old time comes again.
    pub(crate) fn forget_later(&mut self, camera: Side, stamp: u64) {
        let camera = camera as usize;
        let later = (Bound::Excluded(stamp), Bound::Unbounded);
        while let Some((&later, _)) = self.waiting[camera].range(later).next() {
            self.give_up(camera, later);
        }
    }

    /// Ends the recording: there are no more images.
    pub(crate) fn end(&mut self) {
        self.ended = true;
    }

    /// The next pair that no later image can change, with both stamps, left and right.
    ///
    /// Without records, two images are a pair if each is the nearest to the other and they are at
    /// most the maximal skew apart.
    pub(crate) fn pop(&mut self) -> Option<[(u64, T); 2]> {
        if self.joined.is_some() {
            return self.pop_joined();
        }
        loop {
            let (camera, stamp) = self.earliest()?;
            let (own, other) = (&self.waiting[camera], &self.waiting[1 - camera]);
            let forced = self.ended || self.bytes > self.limit;
            let Some(&partner) = other.keys().next() else {
                if !forced {
                    return None;
                }
                self.give_up(camera, stamp);
                continue;
            };
            let settled = own.len() > self.slack[camera] && other.len() > self.slack[1 - camera];
            if !settled && !forced {
                return None;
            }
            let waiting = WaitingStamps {
                earliest_ns: stamp,
                next_ns: own.keys().nth(1).copied(),
                other_ns: partner,
            };
            match waiting.nearest(self.max_skew_ns, 0) {
                // A nearer one may still arrive out of order, until enough later ones rule that
                // out.
                Nearest::TooFar if !forced && other.len() < MAX_LATER_IMAGES => return None,
                Nearest::TooFar => {
                    let skew = waiting.skew_ns();
                    self.nearest_miss_ns =
                        Some(self.nearest_miss_ns.map_or(skew, |miss| miss.min(skew)));
                    self.give_up(camera, stamp);
                }
                Nearest::Overtaken => self.give_up(camera, stamp),
                Nearest::Unknown if !forced => return None,
                Nearest::Pair | Nearest::Unknown => {
                    let first = (stamp, self.take(camera, stamp)?);
                    let second = (partner, self.take(1 - camera, partner)?);
                    return Some(match camera {
                        0 => [first, second],
                        _ => [second, first],
                    });
                }
            }
        }
    }

    /// The next pair by the records. Of images without one, few wait.
    fn pop_joined(&mut self) -> Option<[(u64, T); 2]> {
        let is_there = |side: Side, stamp: &u64| self.waiting[side as usize].contains_key(stamp);
        let mut joined = self.joined.iter().flatten();
        let found = joined.find(|(left, right)| is_there(Left, left) && is_there(Right, right));
        if let Some((&left_ns, &right_ns)) = found {
            self.joined.as_mut()?.remove(&left_ns);
            let (left, right) = (self.take(0, left_ns)?, self.take(1, right_ns)?);
            return Some([(left_ns, left), (right_ns, right)]);
        }
        let limit = if self.ended { 0 } else { MAX_WAITING };
        for camera in 0..2 {
            while self.waiting[camera].len() > limit
                && let Some((&stamp, _)) = self.waiting[camera].first_key_value()
            {
                self.give_up(camera, stamp);
            }
        }
        None
    }

    /// The earliest waiting image of both cameras.
    fn earliest(&self) -> Option<(usize, u64)> {
        let first = |camera: usize| {
            self.waiting[camera]
                .keys()
                .next()
                .map(|&stamp| (stamp, camera))
        };
        [first(0), first(1)]
            .into_iter()
            .flatten()
            .min()
            .map(|(stamp, camera)| (camera, stamp))
    }

    fn take(&mut self, camera: usize, stamp: u64) -> Option<T> {
        let (image, bytes) = self.waiting[camera].remove(&stamp)?;
        self.bytes -= bytes;
        Some(image)
    }

    fn give_up(&mut self, camera: usize, stamp: u64) {
        // At the end of a file images are unpaired, not dropped for lack of memory.
        if !self.ended && self.bytes > self.limit {
            self.crowded_out[camera] = self.crowded_out[camera].max(Some(stamp));
        }
        if self.take(camera, stamp).is_none() {
            return;
        }
        let is_inside = |(first, last)| (first..=last).contains(&stamp);
        // A recorder of both cameras has no image outside.
        let is_outside = self.joined.is_none() && !self.spans[1 - camera].is_some_and(is_inside);
        // A second image with the same stamp is a surplus, wherever it is.
        if !(is_outside && self.outside[camera].insert(stamp)) {
            self.unpaired_ns.push(stamp);
        }
    }

    /// Extends a camera's span by a stamp. Images of the other that were outside it may be inside
    /// now: they are losses.
    fn widen_span(&mut self, camera: usize, stamp: u64) {
        let (first, last) = self.spans[camera].unwrap_or((stamp, stamp));
        let (first, last) = (first.min(stamp), last.max(stamp));
        self.spans[camera] = Some((first, last));
        let outside = &mut self.outside[1 - camera];
        while let Some(&inside) = outside.range(first..=last).next() {
            outside.remove(&inside);
            self.unpaired_ns.push(inside);
        }
    }
}

/// Limit on stamps that wait for the rest of their pair. svl's writer needs one of each camera.
pub(crate) const MAX_WAITING: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;

    /// The stamps of all pairs that are complete.
    fn popped<T>(partners: &mut StampPairing<T>) -> Vec<(u64, u64)> {
        let pairs = std::iter::from_fn(|| partners.pop());
        pairs.map(|[(left, _), (right, _)]| (left, right)).collect()
    }

    /// The numbers of images without a partner, and outside the overlap.
    fn others<T>(partners: &StampPairing<T>) -> [u64; 2] {
        [partners.unpaired_ns.len() as u64, partners.outside()]
    }

    /// The stamps of the pairs from images in this order, and the numbers of the others.
    fn pairs(max_skew_ns: u64, images: &[(Side, u64)]) -> (Vec<(u64, u64)>, [u64; 2]) {
        let mut partners = StampPairing::new(max_skew_ns);
        let mut pairs = Vec::new();
        for &(camera, stamp) in images {
            partners.push(camera, stamp, (), 1);
            pairs.extend(popped(&mut partners));
        }
        partners.end();
        pairs.extend(popped(&mut partners));
        (pairs, others(&partners))
    }

    /// Images in words: `L100 R103`.
    fn images(words: &str) -> Vec<(Side, u64)> {
        let image = |word: &str| {
            let side = if word.starts_with('L') { Left } else { Right };
            (side, word[1..].parse().unwrap())
        };
        words.split(' ').map(image).collect()
    }

    #[test]
    fn images_lost_at_the_edges_are_counted_apart() {
        let mut partners = StampPairing::new(5);
        // The right camera starts two periods later, misses one, and stops a period earlier.
        (0..10).for_each(|i| partners.push(Left, 100 * i, (), 1));
        let rights = (2..9).filter(|i| *i != 5);
        rights.for_each(|i| partners.push(Right, 100 * i + 1, (), 1));
        partners.end();
        assert_eq!(popped(&mut partners).len(), 6);
        let expected = UnpairedImages {
            before: 2,
            inside: 1,
            after: 1,
        };
        assert_eq!(partners.unpaired_images(), expected);
    }

    #[test]
    fn a_clock_that_jumps_back_costs_what_waits_and_delays_nothing() {
        let mut partners = StampPairing::new(5);
        let mut paired = 0;
        for at in [10_000, 10_100, 10_200, 100, 200, 300] {
            for side in Side::BOTH {
                // The right camera has no partner for the left one's last image of the old time.
                if (side, at) != (Right, 10_200) {
                    partners.forget_later(side, at);
                    partners.push(side, at, (), 1);
                }
                paired += popped(&mut partners).len();
            }
        }
        assert_eq!((paired, partners.bytes), (5, 0));
        assert_eq!(others(&partners).iter().sum::<u64>(), 1);
    }

    #[test]
    fn the_nearest_within_the_skew_is_the_partner() {
        let images = images("L100 R103 L200 R196 R306 L300");
        let mut expected = vec![(100, 103), (200, 196)];
        assert_eq!(pairs(5, &images), (expected.clone(), [1, 1]));
        expected.push((300, 306));
        assert_eq!(pairs(6, &images), (expected, [0, 0]));
    }

    #[test]
    fn records_join_images_whatever_their_stamps() {
        let mut partners = StampPairing::by_records();
        let mut found = Vec::new();
        // The records come before, between and after the images; the pair of 500 has none.
        partners.join([100, 90]);
        for (side, stamp) in images("L100 L500 R90 R700 L200") {
            partners.push(side, stamp, stamp, 1);
            found.extend(std::iter::from_fn(|| partners.pop()));
        }
        assert_eq!(found, [[(100, 100), (90, 90)]]);
        partners.join([200, 700]);
        assert_eq!(partners.pop(), Some([(200, 200), (700, 700)]));
        partners.end();
        assert_eq!((partners.pop(), &partners.unpaired_ns), (None, &vec![500]));
        assert_eq!((partners.outside(), partners.bytes), (0, 0));
    }

    #[test]
    fn few_images_wait_for_a_record() {
        let mut partners = StampPairing::by_records();
        for stamp in 0..100 {
            partners.push(Left, stamp, (), 1);
            assert_eq!(partners.pop(), None);
            assert!(partners.waiting[0].len() <= MAX_WAITING);
        }
        partners.push(Right, 5, (), 1);
        // That image waits no more.
        partners.join([5, 5]);
        assert_eq!(partners.pop(), None);
        assert_eq!(partners.unpaired_ns.len(), 100 - MAX_WAITING);
    }

    #[test]
    fn an_image_is_left_to_a_nearer_one() {
        let found = pairs(30, &images("L100 R120 L133 R153 L166"));
        assert_eq!(found, (vec![(133, 120), (166, 153)], [0, 1]));
    }

    #[test]
    fn a_missing_image_costs_its_partner_alone() {
        let lefts = (0..20).map(|i| (Left, i * 100));
        let rights = (0..20).filter(|i| i % 7 != 3).map(|i| (Right, i * 100 + 1));
        let mut images: Vec<_> = lefts.chain(rights).collect();
        images.sort_by_key(|&(_, stamp)| stamp);
        let (found, left_over) = pairs(5, &images);
        assert_eq!((found.len(), left_over), (17, [3, 0]));
        assert!(found.iter().all(|(left, right)| left + 1 == *right));
    }

    #[test]
    fn images_outside_the_overlap_are_known_in_any_order() {
        // Left from 0 on, right to 1900; the right one pauses, and loses one image.
        let lefts = (0..150).map(|i| (Left, i * 10));
        let rights = (50..190).filter(|i| !(60..80).contains(i) && *i != 100);
        let mut images: Vec<_> = lefts.chain(rights.map(|i| (Right, i * 10))).collect();
        let mut random = fastrand::Rng::with_seed(9);
        for order in 0..9 {
            match order {
                0 => images.sort_by_key(|&(_, stamp)| stamp),
                1 => images.sort_by_key(|&(camera, stamp)| (camera == Right, stamp)),
                2 => images.reverse(),
                _ => random.shuffle(&mut images),
            }
            let (found, left_over) = pairs(2, &images);
            assert_eq!((found.len(), left_over), (79, [20 + 1, 50 + 40]), "{order}");
        }
    }

    #[test]
    fn messages_may_come_out_of_order() {
        let found = pairs(0, &images("R200 R100 L200 L300 L100 R300"));
        let expected = vec![(100, 100), (200, 200), (300, 300)];
        assert_eq!(found, (expected, [0, 0]));
    }

    #[test]
    fn as_many_wait_as_there_is_room_for() {
        let mut partners = StampPairing::new(5);
        let mut push = |camera, stamps: std::ops::Range<u64>| {
            let mut found = 0;
            for stamp in stamps.step_by(10) {
                partners.push(camera, stamp, (), WAITING_BYTES / 100 - ENTRY_BYTES);
                found += popped(&mut partners).len();
            }
            let waiting = partners.waiting[0].len();
            (found, waiting, others(&partners), partners.late)
        };
        assert_eq!(push(Left, 0..1500), (0, 100, [0, 50], 0));
        // The first fifty are reported as late.
        assert_eq!(push(Right, 0..1500), (100, 0, [100, 0], 50));
        // No image is late where no partner comes.
        assert_eq!(push(Left, 5000..6500), (0, 100, [100, 50], 50));
        assert_eq!(push(Right, 6500..6510), (0, 99, [151, 0], 50));
    }

    #[test]
    fn one_camera_after_the_other_and_no_order_at_all_lose_no_pair() {
        let mut random = fastrand::Rng::with_seed(3);
        let lefts = (0..300).map(|i| (Left, 100 * i));
        let rights = (0..300).map(|i| (Right, 100 * i + i % 4));
        let mut images: Vec<_> = lefts.chain(rights).collect();
        let all: Vec<_> = (0..300).map(|i| (100 * i, 100 * i + i % 4)).collect();
        assert_eq!(pairs(5, &images), (all.clone(), [0, 0]));
        for _ in 0..100 {
            random.shuffle(&mut images);
            assert_eq!(pairs(5, &images), (all.clone(), [0, 0]));
            images.reverse();
            assert_eq!(pairs(5, &images).1, [0, 0]);
        }
    }

    #[test]
    fn images_in_order_wait_for_few() {
        // Every third right image is missing, and messages are up to three positions out of order,
        // as in bags.
        for jitter in [0, 25] {
            let lefts = (0..1000).map(|i| (Left, i * 10, i * 10 + i * 7 % (jitter + 1)));
            let rights = (0..1000)
                .filter(|i| i % 3 > 0)
                .map(|i| (Right, i * 10 + 1, i * 10 + 1 + i * 11 % (jitter + 1)));
            let mut images: Vec<_> = lefts.chain(rights).collect();
            images.sort_by_key(|&(_, _, logged)| logged);
            let (mut partners, mut found, mut most) = (StampPairing::new(2), 0, 0);
            for (camera, stamp, _) in images {
                partners.push(camera, stamp, (), 1);
                found += popped(&mut partners).len();
                most = most.max(partners.waiting[0].len());
            }
            partners.end();
            found += popped(&mut partners).len();
            assert_eq!((found, others(&partners)), (666, [332, 2]));
            assert!(most < 20 + 40 * usize::from(jitter > 0), "{most}");
        }
    }

    #[test]
    fn any_order_and_any_stamps_lose_no_image() {
        let mut random = fastrand::Rng::with_seed(7);
        for _ in 0..200 {
            let camera = |left| if left { Left } else { Right };
            let images: Vec<_> = (0..60)
                .map(|_| (camera(random.bool()), random.u64(0..500)))
                .collect();
            let (found, left_over) = pairs(random.u64(0..40), &images);
            assert_eq!(2 * found.len() as u64 + left_over.iter().sum::<u64>(), 60);
            let stamps = |side: Side| images.iter().filter(move |(c, _)| *c == side).map(|i| i.1);
            let first = stamps(Left).min().max(stamps(Right).min()).unwrap();
            let last = stamps(Left).max().min(stamps(Right).max()).unwrap();
            let beyond: BTreeSet<_> = images
                .iter()
                .filter(|(_, stamp)| !(first..=last).contains(stamp))
                .collect();
            assert!(left_over[1] <= beyond.len() as u64);
        }
        let ends = [(Left, 0), (Right, u64::MAX), (Left, u64::MAX)];
        assert_eq!(pairs(u64::MAX, &ends).0, [(u64::MAX, u64::MAX)]);
    }
}
