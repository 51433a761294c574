//! Cameras that hang or are unplugged.

use super::stage::{MS, NEAR, PERIOD_NS, Stage, Triggered, adds_up, lost, skews, slow};
use crate::common::assert_says;
use std::cell::RefCell;
use std::sync::atomic::{AtomicUsize, Ordering};
use svl::grab::simulated::CameraBehavior;
use svl::grab::{self, CameraError, GrabRequest, Host, Rule, TriggerSource, Unpaired};

/// Grabs by trigger until it fails; returns the pairs before and the error.
fn until_it_fails(triggered: Triggered, right: CameraBehavior) -> (usize, String) {
    until(triggered, Rule::Trigger, Stage::new(slow(1.0, 0.0), right))
}

fn until(triggered: Triggered, rule: Rule, stage: Stage) -> (usize, String) {
    let mut grabber = stage.start(triggered, rule);
    let mut pairs = 0;
    let error = loop {
        match grabber.next_pair() {
            Ok(frame) => {
                let frame = frame.expect("it fails before it ends");
                pairs += usize::from(frame.exposure.skew_ns.unwrap() < MS as i64)
            }
            Err(error) => break error,
        }
    };
    assert!(error.downcast_ref::<CameraError>().is_some(), "{error}");
    assert!(grabber.next_pair().unwrap().is_none(), "reported once");
    let tally = adds_up(grabber.stop());
    assert_eq!(tally.pairs, pairs as u64);
    if triggered == Triggered::WhenArmed && tally.unpaired[Unpaired::Damaged as usize] == 0 {
        // One for each time that it was waited for.
        let unfinished = tally.unpaired[Unpaired::Unfinished as usize];
        assert!(unfinished <= 3, "{tally}");
    }
    (pairs, error.to_string())
}

#[test]
fn pairs_before_a_camera_fails_are_kept() {
    let hangs = CameraBehavior {
        hang_at: Some(20),
        ..CameraBehavior::default()
    };
    let is_unplugged = CameraBehavior {
        disconnect_at: Some(20),
        ..CameraBehavior::default()
    };
    let silent = "silent for 3.0 s after 20 images; check its power, its cable and its trigger \
                  line, or set a longer --timeout";
    let gone = "disconnected; plug it in and record again";
    for (right, words) in [(hangs, silent), (is_unplugged, gone)] {
        for triggered in [Triggered::WhenArmed, Triggered::AtFixedRate] {
            let (pairs, error) = until_it_fails(triggered, right.clone());
            assert_eq!(pairs, 20);
            assert_eq!(error, format!("right camera, sim right: {words}"));
        }
    }
}

#[test]
fn a_damaged_image_costs_its_pair_and_is_counted() {
    for (triggered, rule, partner) in [
        (Triggered::WhenArmed, Rule::Trigger, Unpaired::Missed),
        (Triggered::AtFixedRate, Rule::Trigger, Unpaired::Missed),
        (Triggered::Never, NEAR, Unpaired::Skew),
    ] {
        let right = CameraBehavior {
            damage_at: Some(5),
            ..slow(1.0, 0.0)
        };
        let (frames, tally) = Stage::new(slow(1.0, 0.0), right).grab(triggered, rule, 20);
        // The next pair is of one moment again.
        assert_eq!(skews(&frames), [0; 20]);
        for reason in [Unpaired::Damaged, partner] {
            assert_eq!(tally.unpaired[reason as usize], 1, "{tally}");
        }
        assert_eq!(frames[19].exposure.drops, 2);
    }
}

#[test]
fn a_camera_whose_images_are_all_damaged_is_named() {
    let stage = Stage {
        damaged_from: 20,
        ..two(slow(1.0, 0.0))
    };
    let mut grabber = stage.start(Triggered::WhenArmed, Rule::Trigger);
    let pairs = (0..20).filter_map(|_| grabber.next_pair().unwrap());
    assert_eq!(pairs.count(), 20);
    let error = grabber.next_pair().unwrap_err().to_string();
    let words = "all its images arrived damaged for 3.0 s; check its cable";
    assert_eq!(error, format!("right camera, sim right: {words}"));
    adds_up(grabber.stop());
}

/// A quick left camera and this right one.
fn two(right: CameraBehavior) -> Stage {
    Stage::new(slow(1.0, 0.0), right)
}

#[test]
fn a_camera_that_is_slow_beyond_patience_is_named() {
    let (pairs, error) = until_it_fails(Triggered::WhenArmed, slow(10_000.0, 0.0));
    assert_eq!(pairs, 0);
    assert!(
        error.starts_with("right camera, sim right: silent"),
        "{error}"
    );
}

#[test]
fn a_camera_slower_than_the_timeout_slows_the_rate() {
    let transfer = CameraBehavior {
        transfer_ms: 1_100.0,
        ..slow(1.0, 0.0)
    };
    for right in [transfer, slow(500.0, 600.0), slow(2_500.0, 0.0)] {
        let (frames, tally) = two(right).grab(Triggered::WhenArmed, Rule::Trigger, 8);
        assert_eq!(skews(&frames), [0; 8], "{tally}");
        assert_eq!(lost(&tally), 0, "{tally}");
    }
}

#[test]
fn an_image_is_of_the_pulse_that_triggered_it_however_late_it_comes() {
    let stage = |on_its_way_ms| Stage {
        on_its_way_ms,
        ..two(slow(5.0, 0.0))
    };
    // The camera has been armed and triggered again meanwhile.
    for ms in [1, 1_050, 1_500, 1_900] {
        let (frames, tally) = stage(ms).grab(Triggered::WhenArmed, Rule::Trigger, 6);
        assert_eq!(skews(&frames), [0; 6], "{ms} ms: {tally}");
        // The one of no pulse.
        assert_eq!(tally.unpaired[Unpaired::Unready as usize], 1, "{tally}");
    }
    let (pairs, error) = until(Triggered::WhenArmed, Rule::Trigger, stage(5_000));
    assert_eq!(pairs, 0);
    assert_says(&error, &["silent for 3.0 s after 1 image; "]);
    assert!(error.ends_with("a longer --timeout"), "{error}");
}

#[test]
fn a_low_rate_is_no_silence() {
    let stage = |damaged_from| Stage {
        period_ns: 4_000 * MS,
        damaged_from,
        ..two(slow(1.0, 0.0))
    };
    for (triggered, rule) in [
        (Triggered::AtFixedRate, Rule::Trigger),
        (Triggered::Never, NEAR),
        (Triggered::WhenArmed, Rule::Trigger),
    ] {
        assert_eq!(stage(u64::MAX).grab(triggered, rule, 5).0.len(), 5);
        // Nor do two damaged images count as all.
        let (pairs, error) = until(triggered, rule, stage(2));
        assert_eq!(pairs, 2);
        let words = "all its images arrived damaged for 16.0 s; check its cable";
        assert_eq!(error, format!("right camera, sim right: {words}"));
    }
}

#[test]
fn cameras_that_never_make_a_pair_fail_with_the_reason() {
    let rule = Rule::Stamp {
        max_skew_ns: MS / 10,
        period_ns: PERIOD_NS,
    };
    let fail = |phase_ms, drift_ppm| {
        let right = CameraBehavior {
            phase_ms,
            drift_ppm,
            ..CameraBehavior::default()
        };
        let stage = Stage::new(CameraBehavior::default(), right);
        until(Triggered::Never, rule, stage)
    };
    let (pairs, error) = fail(8.0, 0.0);
    assert_eq!(pairs, 0);
    let (first, last) = (
        "the cameras: no pair for 3.0 s of 18",
        "allow more with --max-skew-ms",
    );
    assert!(error.starts_with(first) && error.ends_with(last), "{error}");
    assert_says(&error, &["too far apart in time; "]);
    // If there were some, there may be more.
    let (pairs, error) = fail(0.0, 100.0);
    let first = "the cameras: no pair for 30.0 s";
    assert!(pairs > 0 && error.starts_with(first), "{error}");
}

#[test]
fn a_period_without_end_is_one_pulse() {
    for triggered in [Triggered::WhenArmed, Triggered::AtFixedRate] {
        let stage = Stage {
            period_ns: u64::MAX,
            ..two(slow(1.0, 0.0))
        };
        let (frames, tally) = stage.grab(triggered, Rule::Trigger, 1);
        assert_eq!((frames.len(), tally.pulses), (1, 1));
    }
}

#[test]
fn a_grabber_without_a_reader_ends() {
    drop(two(slow(1.0, 0.0)).start(Triggered::WhenArmed, Rule::Trigger));
    let stage = Stage {
        queue: 1,
        ..two(slow(1.0, 0.0))
    };
    drop(stage.start(Triggered::AtFixedRate, Rule::Trigger));
}

#[test]
fn a_missing_controller_is_reported_before_pictures_are_rendered() {
    let request = GrabRequest {
        trigger: Some(TriggerSource::Serial("/dev/nowhere".into())),
        ..GrabRequest::default()
    };
    let host = Host {
        progress: &|_| panic!("renders first"),
        ..Host::default()
    };
    let error = grab::open("sim", &request, host).map(drop).unwrap_err();
    assert!(error.downcast_ref::<CameraError>().is_some(), "{error}");
}

#[test]
fn as_many_pictures_are_rendered_as_pairs_are_taken() {
    for (pairs, duration_s, expected) in [(Some(3), None, 3), (None, Some(0.1), 4)] {
        let request = GrabRequest {
            pairs,
            duration_s,
            ..GrabRequest::default()
        };
        let (rendered, said) = (AtomicUsize::new(0), RefCell::new(Vec::new()));
        let host = Host {
            preparing: &|line| said.borrow_mut().push(line.to_owned()),
            progress: &|count| {
                assert_eq!(count, Some(expected));
                rendered.fetch_add(1, Ordering::Relaxed);
            },
            ..Host::default()
        };
        let grabber = grab::open("sim:size=640x480,pictures=9", &request, host).unwrap();
        drop(grabber);
        assert_eq!(rendered.into_inner() as u64, expected);
        assert_eq!(
            said.take(),
            [format!("sim: renders {expected} pictures first")]
        );
    }
}
