//! What always holds of pairing, whatever the cameras send.

use proptest::prelude::*;
use svl::grab::{Capture, Pairing, Rule, Settings, Side, Unpaired, WAITING};
use svl::stereo::Gray;

const NEAR_NS: u64 = 10;

fn capture(stamp_ns: u64, trigger_id: Option<u64>, shutter_us: u32) -> Capture {
    let settings = Settings { shutter_us, gain_mdb: 0 };
    Capture { image: Gray::filled(1, 1, 0).unwrap(), stamp_ns, trigger_id, settings }
}

/// Images of both cameras in the order of arrival, each camera's in the order of time.
fn arrivals() -> impl Strategy<Value = Vec<(Side, Capture)>> {
    let one = (any::<bool>(), 1u64..40, 0u64..3, prop::bool::weighted(0.95), prop::bool::weighted(0.95));
    prop::collection::vec(one, 0..200).prop_map(|steps| {
        let (mut stamps, mut ids) = ([0; 2], [0; 2]);
        let step = |(right, stamp, id, known, usual): (bool, u64, u64, bool, bool)| {
            let side = if right { Side::Right } else { Side::Left };
            stamps[side as usize] += stamp;
            ids[side as usize] += id;
            let id = known.then_some(ids[side as usize]);
            (side, capture(stamps[side as usize], id, if usual { 100 } else { 200 }))
        };
        steps.into_iter().map(step).collect()
    })
}

proptest! {
    #[test]
    fn every_image_is_in_one_pair_or_counted(arrivals in arrivals(), rule in 0..3) {
        let rule = [Rule::Trigger, Rule::Stamp { max_skew_ns: NEAR_NS }, Rule::Arrival][rule as usize];
        let mut pairing = Pairing::new(rule);
        let count = arrivals.len() as u64;
        let pairs: Vec<_> = arrivals.into_iter().filter_map(|(side, capture)| pairing.push(side, capture)).collect();
        let waiting = count - 2 * pairs.len() as u64 - pairing.unpaired().iter().sum::<u64>();
        prop_assert!(waiting <= WAITING as u64, "only one side can wait: {waiting}");
        pairing.finish();
        prop_assert_eq!(pairing.unpaired()[Unpaired::Unfinished as usize], waiting);
        prop_assert_eq!(2 * pairs.len() as u64 + pairing.unpaired().iter().sum::<u64>(), count);
        for [left, right] in &pairs {
            prop_assert_eq!(left.settings, right.settings);
            match rule {
                Rule::Trigger => prop_assert!(left.trigger_id.is_some() && left.trigger_id == right.trigger_id),
                Rule::Stamp { max_skew_ns } => prop_assert!(left.stamp_ns.abs_diff(right.stamp_ns) <= max_skew_ns),
                Rule::Arrival => {}
            }
        }
        for two in pairs.windows(2) {
            prop_assert!(two[0][0].stamp_ns < two[1][0].stamp_ns && two[0][1].stamp_ns < two[1][1].stamp_ns);
        }
    }

    /// Pulses that either camera may miss, heard in any order: all that both have are paired, and by number and by
    /// stamp alike, as long as neither camera is too far behind.
    #[test]
    fn what_both_have_is_paired(missed in prop::collection::vec((any::<bool>(), any::<bool>()), 0..100), lag in 0..WAITING / 2) {
        let sent = |right: bool| {
            let has = move |(id, missed): (usize, &(bool, bool))| {
                (!if right { missed.1 } else { missed.0 }).then_some(id as u64)
            };
            missed.iter().enumerate().filter_map(has).collect::<Vec<_>>()
        };
        let both: Vec<_> = sent(false).into_iter().filter(|id| sent(true).contains(id)).collect();
        for rule in [Rule::Trigger, Rule::Stamp { max_skew_ns: NEAR_NS }] {
            let mut pairing = Pairing::new(rule);
            // The right camera's images come so many pulses later.
            let mut events: Vec<_> = sent(false).into_iter().map(|id| (id, Side::Left, id)).collect();
            events.extend(sent(true).into_iter().map(|id| (id + lag as u64, Side::Right, id)));
            events.sort_by_key(|(when, side, _)| (*when, *side as usize));
            let pairs = events.into_iter().filter_map(|(_, side, id)| {
                pairing.push(side, capture(100 * id + side as u64, Some(id), 100)).map(|[left, _]| left.trigger_id.unwrap())
            });
            prop_assert_eq!(&pairs.collect::<Vec<_>>(), &both);
        }
    }
}
