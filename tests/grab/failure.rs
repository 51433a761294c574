//! Cameras that hang or are unplugged.

use crate::stage::{Fired, PERIOD_NS, Stage, adds_up, slow};
use svl::Error;
use svl::grab::simulated::Temper;
use svl::grab::{Rule, Unpaired};

/// Grabs until it fails; returns the pairs before and the error.
fn until_it_fails(fired: Fired, right: Temper) -> (usize, String) {
    let mut grabber = Stage::new(slow(1.0, 0.0), right).start(fired, Rule::Trigger);
    let mut pairs = 0;
    let error = loop {
        match grabber.next_pair() {
            Ok(frame) => pairs += usize::from(frame.expect("it fails before it ends").exposure.skew_ns == 0),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, Error::Camera { .. }), "{error}");
    assert!(grabber.next_pair().unwrap().is_none(), "it is told once");
    let tally = adds_up(grabber.stop());
    assert_eq!(tally.pairs, pairs as u64);
    if fired == Fired::WhenArmed {
        assert!(tally.unpaired[Unpaired::Unfinished as usize] <= 1, "{tally}");
    }
    (pairs, error.to_string())
}

#[test]
fn what_came_before_a_camera_hangs_is_kept() {
    for fired in [Fired::WhenArmed, Fired::AtFixedRate] {
        let (pairs, error) = until_it_fails(fired, Temper { hang_at: Some(20), ..Temper::default() });
        assert_eq!(pairs, 20);
        assert_eq!(error, "right camera, sim right: silent for 3.0 s; check its power, its cable and its trigger line");
    }
}

#[test]
fn what_came_before_a_camera_is_unplugged_is_kept() {
    for fired in [Fired::WhenArmed, Fired::AtFixedRate] {
        let (pairs, error) = until_it_fails(fired, Temper { disconnect_at: Some(20), ..Temper::default() });
        assert_eq!(pairs, 20);
        assert_eq!(error, "right camera, sim right: disconnected; plug it in and record again");
    }
}

#[test]
fn a_damaged_image_costs_its_pair_and_is_counted() {
    for (fired, rule, partner) in [
        (Fired::WhenArmed, Rule::Trigger, Unpaired::Missed),
        (Fired::AtFixedRate, Rule::Trigger, Unpaired::Missed),
        (Fired::Freely, Rule::Stamp { max_skew_ns: PERIOD_NS / 4 }, Unpaired::Skew),
    ] {
        let right = Temper { damage_at: Some(5), ..slow(1.0, 0.0) };
        let (frames, tally) = Stage::new(slow(1.0, 0.0), right).grab(fired, rule, 20);
        assert_eq!(frames.len(), 20);
        assert!(frames.iter().all(|frame| frame.exposure.skew_ns == 0), "the next pair is of one moment again");
        assert_eq!(tally.unpaired[Unpaired::Damaged as usize], 1, "{tally}");
        assert_eq!(tally.unpaired[partner as usize], 1, "{tally}");
        assert_eq!(frames.last().unwrap().exposure.drops, 2);
    }
}

#[test]
fn a_camera_whose_images_are_all_damaged_is_named() {
    let stage = Stage { damaged_from: 20, ..Stage::new(slow(1.0, 0.0), slow(1.0, 0.0)) };
    let mut grabber = stage.start(Fired::WhenArmed, Rule::Trigger);
    assert_eq!((0..20).filter_map(|_| grabber.next_pair().unwrap()).count(), 20);
    let error = grabber.next_pair().unwrap_err().to_string();
    assert_eq!(error, "right camera, sim right: all its images came damaged for 3.0 s; check its cable");
    adds_up(grabber.stop());
}

#[test]
fn a_camera_that_is_slow_beyond_patience_is_named() {
    let (pairs, error) = until_it_fails(Fired::WhenArmed, slow(10_000.0, 0.0));
    assert_eq!(pairs, 0);
    assert!(error.starts_with("right camera, sim right: silent"), "{error}");
}

#[test]
fn a_grabber_that_nobody_reads_ends() {
    drop(Stage::new(slow(1.0, 0.0), slow(1.0, 0.0)).start(Fired::WhenArmed, Rule::Trigger));
    let stage = Stage { queue: 1, ..Stage::new(slow(1.0, 0.0), slow(1.0, 0.0)) };
    drop(stage.start(Fired::AtFixedRate, Rule::Trigger));
}
