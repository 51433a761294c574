//! Invariants of pairing, for any images.

use proptest::prelude::*;
use svl::grab::{Capture, Pairing, Rule, Settings, Unpaired, WAITING};
use svl::stereo::{Gray, Side};

const NEAR_NS: u64 = 10;
const NEAR: Rule = Rule::Stamp {
    max_skew_ns: NEAR_NS,
    period_ns: 100,
};

fn capture(stamp_ns: u64, trigger_id: Option<u64>, shutter_us: u32) -> Capture {
    let settings = Settings {
        shutter_us,
        gain_mdb: 0,
    };
    Capture {
        image: Gray::filled(1, 1, 0).unwrap(),
        stamp_ns,
        trigger_id,
        ordered: settings,
        settings,
    }
}

/// The pairs as they are formed, and those formed at the end.
fn paired(
    pairing: &mut Pairing,
    arrivals: impl IntoIterator<Item = (Side, Capture)>,
) -> [Vec<[Capture; 2]>; 2] {
    let mut pairs = Vec::new();
    for (side, capture) in arrivals {
        pairing.push(side, capture);
        pairs.extend(std::iter::from_fn(|| pairing.pair()));
    }
    [pairs, std::iter::from_fn(|| pairing.finish()).collect()]
}

/// Images of both cameras in the order of arrival, each camera's in the order of time.
fn arrivals() -> impl Strategy<Value = Vec<(Side, Capture)>> {
    let one = (
        any::<bool>(),
        1u64..40,
        0u64..3,
        prop::bool::weighted(0.95),
        prop::bool::weighted(0.95),
    );
    prop::collection::vec(one, 0..200).prop_map(|steps| {
        let (mut stamps, mut ids) = ([0; 2], [0; 2]);
        let step = |(right, stamp, id, known, usual): (bool, u64, u64, bool, bool)| {
            let side = if right { Side::Right } else { Side::Left };
            stamps[side as usize] += stamp;
            ids[side as usize] += id;
            let id = known.then_some(ids[side as usize]);
            (
                side,
                capture(stamps[side as usize], id, if usual { 100 } else { 200 }),
            )
        };
        steps.into_iter().map(step).collect()
    })
}

#[test]
fn cameras_that_round_differently_still_make_pairs() {
    for rule in [Rule::Trigger, NEAR, Rule::Arrival] {
        let left = capture(0, Some(1), 100);
        let right = Capture {
            settings: Settings::new(90, 0),
            ..left.clone()
        };
        let [pairs, _] = paired(
            &mut Pairing::new(rule),
            [(Side::Left, left), (Side::Right, right)],
        );
        assert_eq!(pairs.len(), 1);
    }
}

proptest! {
    #[test]
    fn every_image_is_in_one_pair_or_counted(arrivals in arrivals(), rule in 0..3) {
        let rule = [Rule::Trigger, NEAR, Rule::Arrival][rule as usize];
        let mut pairing = Pairing::new(rule);
        let count = arrivals.len() as u64;
        let pairs = paired(&mut pairing, arrivals).concat();
        prop_assert_eq!(2 * pairs.len() as u64 + pairing.unpaired.iter().sum::<u64>(), count);
        if rule == Rule::Arrival {
            prop_assert_eq!(pairing.unpaired[Unpaired::Overdue as usize], 0, "there is room");
        } else {
            prop_assert!(pairing.unpaired[Unpaired::Unfinished as usize] <= WAITING as u64 + 1);
        }
        for [left, right] in &pairs {
            prop_assert_eq!(left.ordered, right.ordered);
            match rule {
                Rule::Trigger => {
                    prop_assert!(left.trigger_id.is_some());
                    prop_assert_eq!(left.trigger_id, right.trigger_id);
                }
                Rule::Stamp { max_skew_ns, .. } => {
                    prop_assert!(left.stamp_ns.abs_diff(right.stamp_ns) <= max_skew_ns);
                }
                Rule::Arrival => {}
            }
        }
        for two in pairs.windows(2) {
            for side in Side::BOTH.map(|side| side as usize) {
                prop_assert!(two[0][side].stamp_ns < two[1][side].stamp_ns);
            }
        }
    }

    /// Pulses that either camera may miss, in any order of arrival: all that both have are paired,
    /// equally by number and by stamp, as long as neither camera is too far behind.
    #[test]
    fn stamps_of_both_cameras_are_paired(
        missed in prop::collection::vec((any::<bool>(), any::<bool>()), 0..100),
        lag in 0..WAITING / 2,
    ) {
        let sent = |right: bool| {
            let has = move |(id, missed): (usize, &(bool, bool))| {
                (!if right { missed.1 } else { missed.0 }).then_some(id as u64)
            };
            missed.iter().enumerate().filter_map(has).collect::<Vec<_>>()
        };
        let both: Vec<_> = sent(false).into_iter().filter(|id| sent(true).contains(id)).collect();
        for rule in [Rule::Trigger, NEAR] {
            let mut pairing = Pairing::new(rule);
            // The right camera's images come `lag` pulses later.
            let left = sent(false).into_iter().map(|id| (id, Side::Left, id));
            let right = sent(true).into_iter().map(|id| (id + lag as u64, Side::Right, id));
            let mut events: Vec<_> = left.chain(right).collect();
            events.sort_by_key(|(when, side, _)| (*when, *side as usize));
            let events = events.into_iter().map(|(_, side, id)| {
                (side, capture(100 * id + side as u64, Some(id), 100))
            });
            let [pairs, late] = paired(&mut pairing, events);
            let ids: Vec<_> = pairs.iter().map(|[left, _]| left.trigger_id.unwrap()).collect();
            prop_assert_eq!(ids, both.clone());
            prop_assert!(late.is_empty(), "so near, none waits for its next");
        }
    }

    /// Two cameras whose images are at least half a period of 100 apart, in two orders of arrival,
    /// neither too far behind: the same pairs, and no image after the previous pair is nearer to
    /// one of them.
    #[test]
    fn the_nearest_are_paired_in_any_order_of_arrival(
        steps in prop::collection::vec((50u64..300, 50u64..300), 1..60),
        max_skew_ns in 0u64..250,
        lag_ns in 0u64..1200,
    ) {
        let mut at = [0; 2];
        let stamps: Vec<_> = steps
            .iter()
            .map(|(left, right)| {
                at = [at[0] + left, at[1] + right];
                at
            })
            .collect();
        let stamps_of = |side: Side| -> Vec<_> {
            stamps.iter().map(|both| both[side as usize]).collect()
        };
        let pairs_of = |sides: Vec<Side>| {
            let mut next = Side::BOTH.map(|side| stamps_of(side).into_iter());
            let arrivals: Vec<_> = sides
                .into_iter()
                .filter_map(|side| Some((side, next[side as usize].next()?)))
                .map(|(side, stamp)| (side, capture(stamp, None, 100)))
                .collect();
            let mut pairing = Pairing::new(Rule::Stamp { max_skew_ns, period_ns: 100 });
            let pairs = paired(&mut pairing, arrivals).concat();
            let stamps = |pair: &[Capture; 2]| pair.each_ref().map(|capture| capture.stamp_ns);
            pairs.iter().map(stamps).collect::<Vec<_>>()
        };
        let arriving = |lag_ns: u64| {
            let taken = |side: Side| {
                let latency_ns = if side == Side::Right { lag_ns } else { 600 };
                stamps_of(side).into_iter().map(move |at| (at + latency_ns, side))
            };
            let mut arrivals: Vec<_> = taken(Side::Left).chain(taken(Side::Right)).collect();
            arrivals.sort_by_key(|(at, _)| *at);
            arrivals.into_iter().map(|(_, side)| side).collect()
        };
        let pairs = pairs_of(arriving(600));
        prop_assert_eq!(&pairs_of(arriving(lag_ns)), &pairs);
        let is_near = |[left, right]: [u64; 2]| left.abs_diff(right) <= max_skew_ns;
        for (i, &[left, right]) in pairs.iter().enumerate() {
            prop_assert!(is_near([left, right]));
            let skew = left.abs_diff(right);
            let is_free = |side: usize, at: u64| pairs[..i].iter().all(|pair| pair[side] < at);
            for (side, partner) in [(Side::Left, right), (Side::Right, left)] {
                let nearer = |at: u64| at.abs_diff(partner) < skew && is_free(side as usize, at);
                prop_assert!(!stamps_of(side).into_iter().any(nearer));
            }
        }
        // Two images that are uniquely the nearest to each other are a pair.
        for &left in &stamps_of(Side::Left) {
            for &right in &stamps_of(Side::Right) {
                let skew = left.abs_diff(right);
                let farther = |at: u64, own: u64, partner: u64| {
                    at == own || at.abs_diff(partner) > skew
                };
                let nearest = stamps_of(Side::Left).iter().all(|&at| farther(at, left, right))
                    && stamps_of(Side::Right).iter().all(|&at| farther(at, right, left));
                let is_pair = pairs.contains(&[left, right]);
                prop_assert!(is_pair || !nearest || !is_near([left, right]));
            }
        }
    }
}
