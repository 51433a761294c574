//! Software trigger against fixed rate: figures 4.2 and 4.3 of the thesis.

use super::stage::{MS, PERIOD_NS, Stage, Triggered, slow};
use svl::grab::simulated::CameraBehavior;
use svl::grab::{Rule, Unpaired};

const NEAR: Rule = Rule::Stamp {
    max_skew_ns: PERIOD_NS / 4,
    period_ns: PERIOD_NS,
};

#[test]
fn a_slow_camera_slows_the_rate_and_never_shifts_the_phase() {
    for rule in [Rule::Trigger, NEAR, Rule::Arrival] {
        let (frames, tally) =
            Stage::new(slow(1.0, 0.0), slow(20.0, 50.0)).grab(Triggered::WhenArmed, rule, 300);
        assert_eq!(frames.len(), 300);
        assert!(
            frames
                .iter()
                .all(|frame| frame.exposure.skew_ns.unwrap() == 0)
        );
        assert!(
            frames
                .iter()
                .enumerate()
                .all(|(i, frame)| frame.exposure.trigger_id == i as u64)
        );
        assert_eq!(tally.skew_ns.max(), 0);
        let unpaired =
            tally.unpaired.iter().sum::<u64>() - tally.unpaired[Unpaired::Unfinished as usize];
        assert_eq!(unpaired, 0, "{tally}");
        // 20 ms and 0 to 50 more, shutter, transfer.
        let mean_ms = frames[299].stamp_ns as f64 / 1e6 / 300.0;
        assert!((40.0..60.0).contains(&mean_ms), "{mean_ms} ms a pair");
    }
}

#[test]
fn quick_cameras_keep_the_rate() {
    let (frames, _) =
        Stage::new(slow(1.0, 2.0), slow(3.0, 3.0)).grab(Triggered::WhenArmed, Rule::Trigger, 100);
    let periods: Vec<_> = frames
        .windows(2)
        .map(|two| two[1].stamp_ns - two[0].stamp_ns)
        .collect();
    assert!(
        periods.iter().all(|&period| period == PERIOD_NS),
        "{periods:?}"
    );
}

#[test]
fn at_a_fixed_rate_a_late_camera_shifts_the_phase_for_good() {
    // The right camera is ready in time except for about every tenth pulse: each time the pairs by
    // arrival shift by a period.
    let stage = || Stage::new(slow(1.0, 0.0), slow(1.0, 10.0));
    let (frames, tally) = stage().grab(Triggered::AtFixedRate, Rule::Arrival, 100);
    let skews: Vec<_> = frames
        .iter()
        .map(|frame| frame.exposure.skew_ns.unwrap())
        .collect();
    assert_eq!(skews[0], 0, "both begin with one pulse");
    assert!(
        skews.windows(2).all(|two| two[0] <= two[1]),
        "it never comes back: {skews:?}"
    );
    assert!(
        skews.iter().all(|skew| skew % PERIOD_NS as i64 == 0),
        "by whole periods: {skews:?}"
    );
    assert!(*skews.last().unwrap() >= 3 * PERIOD_NS as i64, "{skews:?}");
    assert!(tally.pulses >= tally.frames[1] + 3);

    // A pulse's number or the stamps would have shown:
    for (rule, reason) in [(Rule::Trigger, Unpaired::Missed), (NEAR, Unpaired::Skew)] {
        let (frames, tally) = stage().grab(Triggered::AtFixedRate, rule, 100);
        assert!(
            frames
                .iter()
                .all(|frame| frame.exposure.skew_ns.unwrap() == 0)
        );
        assert!(tally.unpaired[reason as usize] >= 3, "{tally}");
        // The recording itself contains the number of missing ones.
        assert!(frames.last().unwrap().exposure.drops >= 3);
        assert!(
            frames
                .windows(2)
                .all(|two| two[0].exposure.drops <= two[1].exposure.drops)
        );
    }
}

#[test]
fn the_phase_goes_on_shifting() {
    let (frames, tally) = Stage::new(slow(1.0, 0.0), slow(1.0, 10.0)).grab(
        Triggered::AtFixedRate,
        Rule::Arrival,
        600,
    );
    let last = frames.last().unwrap().exposure.skew_ns.unwrap();
    assert!(last > 30 * PERIOD_NS as i64, "{last}");
    assert_eq!(tally.unpaired[Unpaired::Overdue as usize], 0, "{tally}");
}

#[test]
fn by_stamp_the_nearest_are_paired_however_much_may_be_between() {
    let rule = Rule::Stamp {
        max_skew_ns: 20 * MS,
        period_ns: PERIOD_NS,
    };
    let (frames, tally) =
        Stage::new(slow(1.0, 0.0), slow(1.0, 10.0)).grab(Triggered::AtFixedRate, rule, 200);
    assert!(tally.unpaired[Unpaired::Skew as usize] > 10, "{tally}");
    assert!(
        frames
            .iter()
            .all(|frame| frame.exposure.skew_ns.unwrap() == 0)
    );
}

#[test]
fn at_twice_the_rate_a_camera_answers_every_other_pulse() {
    let (frames, tally) = Stage::new(slow(1.0, 0.0), slow(18.0, 0.0)).grab(
        Triggered::AtFixedRate,
        Rule::Trigger,
        100,
    );
    let ids: Vec<_> = frames
        .iter()
        .map(|frame| frame.exposure.trigger_id)
        .collect();
    assert!(ids.windows(2).all(|two| two[1] - two[0] == 2), "{ids:?}");
    assert!(
        tally.unpaired[Unpaired::Missed as usize].abs_diff(tally.pairs) <= 1,
        "{tally}"
    );
}

#[test]
fn free_running_cameras_drift_apart() {
    let stage = || {
        Stage::new(
            CameraBehavior::default(),
            CameraBehavior {
                phase_ms: 1.0,
                drift_ppm: 2000.0,
                ..CameraBehavior::default()
            },
        )
    };
    let (frames, _) = stage().grab(Triggered::Never, Rule::Arrival, 100);
    let skews: Vec<_> = frames
        .iter()
        .map(|frame| frame.exposure.skew_ns.unwrap())
        .collect();
    assert_eq!(
        skews[0],
        MS as i64 + 32_000,
        "a phase of 1 ms, and the first period"
    );
    // 2000 ppm of 99 periods are 3.2 ms.
    assert!(
        (skews[99] - skews[0] - 3_168_000).abs() < 1_000,
        "{skews:?}"
    );

    let (frames, tally) = stage().grab(Triggered::Never, NEAR, 400);
    assert!(
        frames
            .iter()
            .all(|frame| frame.exposure.skew_ns.unwrap().unsigned_abs() <= PERIOD_NS / 4)
    );
    assert!(tally.unpaired[Unpaired::Skew as usize] > 0, "{tally}");
}

#[test]
fn a_scripted_run_is_the_same_every_time() {
    let run = || {
        Stage::new(slow(2.0, 20.0), slow(2.0, 20.0))
            .grab(Triggered::WhenArmed, Rule::Trigger, 50)
            .0
    };
    assert_eq!(run(), run());
}
