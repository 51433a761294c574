//! Cameras that hang or are unplugged.

use super::stage::{MS, PERIOD_NS, Stage, Triggered, adds_up, slow};
use std::cell::RefCell;
use std::sync::atomic::{AtomicUsize, Ordering};
use svl::grab::simulated::CameraBehavior;
use svl::grab::{self, CameraError, GrabRequest, Host, Rule, TriggerSource, Unpaired};

const NEAR: Rule = Rule::Stamp {
    max_skew_ns: PERIOD_NS / 4,
    period_ns: PERIOD_NS,
};

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
                pairs += usize::from(
                    frame
                        .expect("it fails before it ends")
                        .exposure
                        .skew_ns
                        .unwrap()
                        < MS as i64,
                )
            }
            Err(error) => break error,
        }
    };
    assert!(error.downcast_ref::<CameraError>().is_some(), "{error}");
    assert!(grabber.next_pair().unwrap().is_none(), "reported once");
    let tally = adds_up(grabber.stop());
    assert_eq!(tally.pairs, pairs as u64);
    if triggered == Triggered::WhenArmed && tally.unpaired[Unpaired::Damaged as usize] == 0 {
        assert!(
            tally.unpaired[Unpaired::Unfinished as usize] <= 3,
            "one for each time that it was waited for: {tally}"
        );
    }
    (pairs, error.to_string())
}

#[test]
fn pairs_before_a_camera_hangs_are_kept() {
    for triggered in [Triggered::WhenArmed, Triggered::AtFixedRate] {
        let (pairs, error) = until_it_fails(
            triggered,
            CameraBehavior {
                hang_at: Some(20),
                ..CameraBehavior::default()
            },
        );
        assert_eq!(pairs, 20);
        assert_eq!(
            error,
            "right camera, sim right: silent for 3.0 s after 20 images; check its power, its \
             cable and its trigger line, or set a longer --timeout"
        );
    }
}

#[test]
fn pairs_before_a_camera_is_unplugged_are_kept() {
    for triggered in [Triggered::WhenArmed, Triggered::AtFixedRate] {
        let (pairs, error) = until_it_fails(
            triggered,
            CameraBehavior {
                disconnect_at: Some(20),
                ..CameraBehavior::default()
            },
        );
        assert_eq!(pairs, 20);
        assert_eq!(
            error,
            "right camera, sim right: disconnected; plug it in and record again"
        );
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
        assert_eq!(frames.len(), 20);
        assert!(
            frames
                .iter()
                .all(|frame| frame.exposure.skew_ns.unwrap() == 0),
            "the next pair is of one moment again"
        );
        assert_eq!(tally.unpaired[Unpaired::Damaged as usize], 1, "{tally}");
        assert_eq!(tally.unpaired[partner as usize], 1, "{tally}");
        assert_eq!(frames.last().unwrap().exposure.drops, 2);
    }
}

#[test]
fn a_camera_whose_images_are_all_damaged_is_named() {
    let stage = Stage {
        damaged_from: 20,
        ..Stage::new(slow(1.0, 0.0), slow(1.0, 0.0))
    };
    let mut grabber = stage.start(Triggered::WhenArmed, Rule::Trigger);
    assert_eq!(
        (0..20).filter_map(|_| grabber.next_pair().unwrap()).count(),
        20
    );
    let error = grabber.next_pair().unwrap_err().to_string();
    assert_eq!(
        error,
        "right camera, sim right: all its images arrived damaged for 3.0 s; check its cable"
    );
    adds_up(grabber.stop());
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
        let (frames, tally) =
            Stage::new(slow(1.0, 0.0), right).grab(Triggered::WhenArmed, Rule::Trigger, 8);
        assert_eq!(frames.len(), 8, "{tally}");
        assert!(
            frames
                .iter()
                .all(|frame| frame.exposure.skew_ns.unwrap() == 0)
        );
        let unpaired =
            tally.unpaired.iter().sum::<u64>() - tally.unpaired[Unpaired::Unfinished as usize];
        assert_eq!(unpaired, 0, "{tally}");
    }
}

#[test]
fn an_image_is_of_the_pulse_that_triggered_it_however_late_it_comes() {
    // The camera has been armed and triggered again meanwhile.
    for on_its_way_ms in [1, 1_050, 1_500, 1_900] {
        let stage = Stage {
            on_its_way_ms,
            ..Stage::new(slow(1.0, 0.0), slow(5.0, 0.0))
        };
        let (frames, tally) = stage.grab(Triggered::WhenArmed, Rule::Trigger, 6);
        assert_eq!(frames.len(), 6, "{tally}");
        assert!(
            frames
                .iter()
                .all(|frame| frame.exposure.skew_ns.unwrap() == 0),
            "{on_its_way_ms} ms: {tally}"
        );
        assert_eq!(
            tally.unpaired[Unpaired::Unready as usize],
            1,
            "the one of no pulse: {tally}"
        );
    }
    let stage = Stage {
        on_its_way_ms: 5_000,
        ..Stage::new(slow(1.0, 0.0), slow(5.0, 0.0))
    };
    let (pairs, error) = until(Triggered::WhenArmed, Rule::Trigger, stage);
    assert_eq!(pairs, 0);
    assert!(
        error.contains("silent for 3.0 s after 1 image; ") && error.ends_with("a longer --timeout"),
        "{error}"
    );
}

#[test]
fn a_low_rate_is_no_silence() {
    let period_ns = 4_000 * MS;
    for (triggered, rule) in [
        (Triggered::AtFixedRate, Rule::Trigger),
        (Triggered::Never, NEAR),
        (Triggered::WhenArmed, Rule::Trigger),
    ] {
        let stage = Stage {
            period_ns,
            ..Stage::new(slow(1.0, 0.0), slow(1.0, 0.0))
        };
        assert_eq!(stage.grab(triggered, rule, 5).0.len(), 5);
        // Nor do two damaged images count as all.
        let stage = Stage {
            period_ns,
            damaged_from: 2,
            ..Stage::new(slow(1.0, 0.0), slow(1.0, 0.0))
        };
        let (pairs, error) = until(triggered, rule, stage);
        assert_eq!(pairs, 2);
        assert_eq!(
            error,
            "right camera, sim right: all its images arrived damaged for 16.0 s; check its cable"
        );
    }
}

#[test]
fn cameras_that_never_make_a_pair_fail_with_the_reason() {
    let rule = Rule::Stamp {
        max_skew_ns: MS / 10,
        period_ns: PERIOD_NS,
    };
    let apart = |phase_ms, drift_ppm| {
        Stage::new(
            CameraBehavior::default(),
            CameraBehavior {
                phase_ms,
                drift_ppm,
                ..CameraBehavior::default()
            },
        )
    };
    let (pairs, error) = until(Triggered::Never, rule, apart(8.0, 0.0));
    assert_eq!(pairs, 0);
    assert!(
        error.starts_with("the cameras: no pair for 3.0 s of 18")
            && error.contains("too far apart in time; "),
        "{error}"
    );
    assert!(error.ends_with("allow more with --max-skew-ms"), "{error}");
    // If there were some, there may be more.
    let (pairs, error) = until(Triggered::Never, rule, apart(0.0, 100.0));
    assert!(
        pairs > 0 && error.starts_with("the cameras: no pair for 30.0 s"),
        "{error}"
    );
}

#[test]
fn a_period_without_end_is_one_pulse() {
    for triggered in [Triggered::WhenArmed, Triggered::AtFixedRate] {
        let stage = Stage {
            period_ns: u64::MAX,
            ..Stage::new(slow(1.0, 0.0), slow(1.0, 0.0))
        };
        let (frames, tally) = stage.grab(triggered, Rule::Trigger, 1);
        assert_eq!((frames.len(), tally.pulses), (1, 1));
    }
}

#[test]
fn a_grabber_without_a_reader_ends() {
    drop(Stage::new(slow(1.0, 0.0), slow(1.0, 0.0)).start(Triggered::WhenArmed, Rule::Trigger));
    let stage = Stage {
        queue: 1,
        ..Stage::new(slow(1.0, 0.0), slow(1.0, 0.0))
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
