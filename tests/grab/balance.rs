//! The exposure balance.

use crate::stage::{Fired, Stage, slow};
use svl::grab::{Balance, Limits, Rule, Settings};
use svl::stereo::{Frame, Gray};

fn mean(image: &Gray) -> f64 {
    image.pixels().map(f64::from).sum::<f64>() / image.pixels().count() as f64
}

fn grab(light: f64, first: Settings) -> Vec<Frame> {
    let stage = Stage { light, first, balance_every: 5, ..Stage::new(slow(1.0, 0.0), slow(2.0, 4.0)) };
    stage.grab(Fired::WhenArmed, Rule::Trigger, 120).0
}

#[test]
fn too_dark_and_too_bright_become_right() {
    for (light, first_us) in [(1.0, 200), (1.0, 8_000), (8.0, 8_000), (0.3, 4_000)] {
        let frames = grab(light, Settings { shutter_us: first_us, gain_mdb: 0 });
        let last = frames.last().unwrap();
        for image in [last.pair.left(), last.pair.right()] {
            assert!((85.0..=115.0).contains(&mean(image)), "light {light}: {} at {:?}", mean(image), last.exposure);
        }
        assert_eq!(last.exposure.skew_ns, 0, "a skew of half a shutter would show that they differ");
    }
}

#[test]
fn the_gain_does_what_the_shutter_cannot() {
    let bright = grab(2.0, Settings { shutter_us: 4_000, gain_mdb: 6_000 });
    assert_eq!(bright.last().unwrap().exposure.gain_mdb, 0, "it takes the gain back first");
    let dark = grab(0.2, Settings { shutter_us: 4_000, gain_mdb: 0 });
    let exposure = dark.last().unwrap().exposure;
    assert_eq!(exposure.shutter_us, 8_000, "the rate's limit");
    assert!((10_000..=18_000).contains(&exposure.gain_mdb), "{exposure:?}");
}

const LIMITS: Limits = Limits { shutter_us: 100..=10_000, gain_mdb: 0..=12_000 };

/// Shows a balance two images again and again, as many times as it may need.
fn settle(mut balance: Balance, images: [u8; 2]) -> Settings {
    let images = images.map(|grey| Gray::filled(64, 48, grey).unwrap());
    for _ in 0..100 {
        let settings = balance.settings();
        balance.observe(&images[0], &images[1], settings);
    }
    balance.settings()
}

#[test]
fn it_stays_within_the_limits_and_still_when_all_is_well() {
    let begin = Settings { shutter_us: 1_000, gain_mdb: 0 };
    let balance = || Balance::new(LIMITS, begin, 1);
    assert_eq!(settle(balance(), [0, 0]), Settings { shutter_us: 10_000, gain_mdb: 12_000 });
    assert_eq!(settle(balance(), [255, 255]), Settings { shutter_us: 100, gain_mdb: 0 });
    assert_eq!(settle(balance(), [95, 105]), begin, "the images together are right");
}

#[test]
fn pairs_from_before_a_change_do_not_count() {
    let begin = Settings { shutter_us: 1_000, gain_mdb: 0 };
    let mut balance = Balance::new(LIMITS, begin, 1);
    let dark = Gray::filled(64, 48, 50).unwrap();
    balance.observe(&dark, &dark, begin);
    let once = balance.settings();
    assert_eq!(once, Settings { shutter_us: 2_000, gain_mdb: 0 });
    balance.observe(&dark, &dark, begin);
    assert_eq!(balance.settings(), once, "or it would overshoot");
}

#[test]
fn limits_in_common() {
    let other = Limits { shutter_us: 50..=5_000, gain_mdb: 3_000..=20_000 };
    assert_eq!(LIMITS.common(&other).unwrap(), Limits { shutter_us: 100..=5_000, gain_mdb: 3_000..=12_000 });
    assert!(LIMITS.common(&Limits { shutter_us: 20_000..=30_000, gain_mdb: 0..=0 }).is_err());
}
