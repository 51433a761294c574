//! Software trigger against fixed rate: figures 4.2 and 4.3 of the thesis.

use super::stage::{MS, NEAR, PERIOD_NS, Stage, Triggered, lost, skews, slow};
use svl::grab::simulated::CameraBehavior;
use svl::grab::{Rule, Unpaired};

#[test]
fn a_slow_camera_slows_the_rate_and_never_shifts_the_phase() {
    for rule in [Rule::Trigger, NEAR, Rule::Arrival] {
        let stage = Stage::new(slow(1.0, 0.0), slow(20.0, 50.0));
        let (frames, tally) = stage.grab(Triggered::WhenArmed, rule, 300);
        assert_eq!(skews(&frames), [0; 300]);
        let ids = frames.iter().map(|frame| frame.exposure.trigger_id);
        assert!(ids.eq(0..300));
        assert_eq!(tally.skew_ns.max(), 0);
        assert_eq!(lost(&tally), 0, "{tally}");
        // 20 ms and 0 to 50 more, shutter, transfer.
        let mean_ms = frames[299].stamp_ns as f64 / 1e6 / 300.0;
        assert!((40.0..60.0).contains(&mean_ms), "{mean_ms} ms a pair");
    }
}

#[test]
fn quick_cameras_keep_the_rate() {
    let stage = Stage::new(slow(1.0, 2.0), slow(3.0, 3.0));
    let (frames, _) = stage.grab(Triggered::WhenArmed, Rule::Trigger, 100);
    let periods = frames
        .windows(2)
        .map(|two| two[1].stamp_ns - two[0].stamp_ns);
    assert_eq!(periods.collect::<Vec<_>>(), [PERIOD_NS; 99]);
}

#[test]
fn at_a_fixed_rate_a_late_camera_shifts_the_phase_for_good() {
    // The right camera is ready in time except for about every tenth pulse: each time the pairs by
    // arrival shift by a period.
    let stage = || Stage::new(slow(1.0, 0.0), slow(1.0, 10.0));
    let (frames, tally) = stage().grab(Triggered::AtFixedRate, Rule::Arrival, 100);
    let skews_ns = skews(&frames);
    assert_eq!(skews_ns[0], 0, "both begin with one pulse");
    assert!(skews_ns.is_sorted(), "it never comes back: {skews_ns:?}");
    let mut whole = skews_ns.iter().map(|skew| skew % PERIOD_NS as i64);
    assert!(
        whole.all(|rest| rest == 0),
        "by whole periods: {skews_ns:?}"
    );
    assert!(skews_ns[99] >= 3 * PERIOD_NS as i64, "{skews_ns:?}");
    assert!(tally.pulses >= tally.frames[1] + 3);

    // A pulse's number or the stamps would have shown:
    for (rule, reason) in [(Rule::Trigger, Unpaired::Missed), (NEAR, Unpaired::Skew)] {
        let (frames, tally) = stage().grab(Triggered::AtFixedRate, rule, 100);
        assert_eq!(skews(&frames), [0; 100]);
        assert!(tally.unpaired[reason as usize] >= 3, "{tally}");
        // The recording itself contains the number of missing ones.
        assert!(frames[99].exposure.drops >= 3);
        assert!(frames.is_sorted_by_key(|frame| frame.exposure.drops));
    }
}

#[test]
fn the_phase_goes_on_shifting() {
    let stage = Stage::new(slow(1.0, 0.0), slow(1.0, 10.0));
    let (frames, tally) = stage.grab(Triggered::AtFixedRate, Rule::Arrival, 600);
    let last = skews(&frames)[599];
    assert!(last > 30 * PERIOD_NS as i64, "{last}");
    assert_eq!(tally.unpaired[Unpaired::Overdue as usize], 0, "{tally}");
}

#[test]
fn by_stamp_the_nearest_are_paired_however_much_may_be_between() {
    let rule = Rule::Stamp {
        max_skew_ns: 20 * MS,
        period_ns: PERIOD_NS,
    };
    let stage = Stage::new(slow(1.0, 0.0), slow(1.0, 10.0));
    let (frames, tally) = stage.grab(Triggered::AtFixedRate, rule, 200);
    assert!(tally.unpaired[Unpaired::Skew as usize] > 10, "{tally}");
    assert_eq!(skews(&frames), [0; 200]);
}

#[test]
fn at_twice_the_rate_a_camera_answers_every_other_pulse() {
    let stage = Stage::new(slow(1.0, 0.0), slow(18.0, 0.0));
    let (frames, tally) = stage.grab(Triggered::AtFixedRate, Rule::Trigger, 100);
    let ids: Vec<_> = frames
        .iter()
        .map(|frame| frame.exposure.trigger_id)
        .collect();
    assert!(ids.windows(2).all(|two| two[1] - two[0] == 2), "{ids:?}");
    let missed = tally.unpaired[Unpaired::Missed as usize];
    assert!(missed.abs_diff(tally.pairs) <= 1, "{tally}");
}

#[test]
fn free_running_cameras_drift_apart() {
    let right = CameraBehavior {
        phase_ms: 1.0,
        drift_ppm: 2000.0,
        ..CameraBehavior::default()
    };
    let stage = || Stage::new(CameraBehavior::default(), right.clone());
    let (frames, _) = stage().grab(Triggered::Never, Rule::Arrival, 100);
    let skews_ns = skews(&frames);
    let first = MS as i64 + 32_000;
    assert_eq!(skews_ns[0], first, "a phase of 1 ms, and the first period");
    // 2000 ppm of 99 periods are 3.2 ms.
    let drift = skews_ns[99] - skews_ns[0] - 3_168_000;
    assert!(drift.abs() < 1_000, "{skews_ns:?}");

    let (frames, tally) = stage().grab(Triggered::Never, NEAR, 400);
    let mut skews_ns = skews(&frames).into_iter().map(i64::unsigned_abs);
    assert!(skews_ns.all(|skew| skew <= PERIOD_NS / 4));
    assert!(tally.unpaired[Unpaired::Skew as usize] > 0, "{tally}");
}

#[test]
fn a_scripted_run_is_the_same_every_time() {
    let run = || {
        let stage = Stage::new(slow(2.0, 20.0), slow(2.0, 20.0));
        stage.grab(Triggered::WhenArmed, Rule::Trigger, 50).0
    };
    assert_eq!(run(), run());
}
