//! The exposure balance.

use super::stage::{Stage, Triggered, slow};
use crate::common::assert_says;
use proptest::prelude::*;
use svl::grab::{Balance, Limits, Rule, Settings};
use svl::stereo::{Frame, Gray};

fn mean(image: &Gray) -> f64 {
    image.pixels().map(f64::from).sum::<f64>() / image.pixels().count() as f64
}

fn grab(light: f64, first: Settings) -> Vec<Frame> {
    let stage = Stage {
        light,
        first,
        balance_every: 5,
        ..Stage::new(slow(1.0, 0.0), slow(2.0, 4.0))
    };
    stage.grab(Triggered::WhenArmed, Rule::Trigger, 120).0
}

#[test]
fn too_dark_and_too_bright_become_right() {
    for (light, first_us) in [(1.0, 200), (1.0, 8_000), (8.0, 8_000), (0.3, 4_000)] {
        let frames = grab(light, Settings::new(first_us, 0));
        let last = frames.last().unwrap();
        for image in [last.pair.left(), last.pair.right()] {
            let (mean, exposure) = (mean(image), &last.exposure);
            let is_right = (85.0..=115.0).contains(&mean);
            assert!(is_right, "light {light}: {mean} at {exposure:?}");
        }
        // A skew of half a shutter would show that they differ.
        assert_eq!(last.exposure.skew_ns, Some(0));
    }
}

#[test]
fn the_gain_does_what_the_shutter_cannot() {
    // It takes the gain back first.
    let bright = grab(2.0, Settings::new(4_000, 6_000));
    assert_eq!(bright.last().unwrap().exposure.gain_mdb, 0);
    let dark = grab(0.2, Settings::new(4_000, 0));
    let exposure = dark.last().unwrap().exposure;
    assert_eq!(exposure.shutter_us, 8_000, "the rate's limit");
    let is_used = (10_000..=18_000).contains(&exposure.gain_mdb);
    assert!(is_used, "{exposure:?}");
}

const LIMITS: Limits = Limits::new(100..=10_000, 0..=12_000);

/// Shows a balance two images repeatedly, as often as it may need.
fn settle(mut balance: Balance, images: [u8; 2]) -> Settings {
    let images = images.map(|grey| Gray::filled(64, 48, grey).unwrap());
    for _ in 0..100 {
        let settings = balance.settings;
        balance.observe(&images[0], &images[1], settings);
    }
    balance.settings
}

#[test]
fn it_stays_within_the_limits_and_still_when_all_is_well() {
    let begin = Settings::new(1_000, 0);
    let balance = || Balance::new(LIMITS, begin, 1);
    assert_eq!(settle(balance(), [0, 0]), Settings::new(10_000, 12_000));
    assert_eq!(settle(balance(), [255, 255]), Settings::new(100, 0));
    // The images together are right.
    assert_eq!(settle(balance(), [95, 105]), begin);
}

/// A camera in front of a scene: one radiance for each sampled pixel, as its grey value at 8 ms.
#[derive(Clone, Debug)]
struct Before {
    scene: Vec<f64>,
    /// Grey values follow this power of the light; 0.45 is that of a webcam.
    gamma: f64,
    /// The camera rounds its shutter to this many microseconds.
    step_us: u32,
}

const WIDE_LIMITS: Limits = Limits::new(100..=16_666, 0..=18_000);

impl Before {
    fn greys(&self, settings: Settings) -> Vec<u8> {
        let shutter_us = (settings.shutter_us + self.step_us / 2) / self.step_us * self.step_us;
        let light =
            f64::from(shutter_us) / 8_000.0 * 10f64.powf(f64::from(settings.gain_mdb) / 20_000.0);
        let grey =
            |radiance: &f64| (255.0 * (radiance * light / 255.0).powf(self.gamma) + 0.5) as u8;
        self.scene.iter().map(grey).collect()
    }

    /// Runs until it converges, and longer; returns the changes over the last 40 images.
    fn settle(&self, balance: &mut Balance) -> Vec<Settings> {
        let mut settings = Vec::new();
        for _ in 0..100 {
            let asked = balance.settings;
            let pixels: Vec<_> = self
                .greys(asked)
                .into_iter()
                .flat_map(|grey| [grey; 4])
                .collect();
            let image = Gray::from_vec(pixels.len(), 1, pixels).unwrap();
            balance.observe(&image, &image, asked);
            settings.push(asked);
        }
        let mut last = settings.split_off(60);
        last.dedup();
        last.split_off(1)
    }

    /// Mean, and the grey value that two per cent exceed.
    fn view(&self, settings: Settings) -> (f64, f64) {
        let mut greys = self.greys(settings);
        greys.sort_unstable_by(|a, b| b.cmp(a));
        (
            greys.iter().map(|&grey| f64::from(grey)).sum::<f64>() / greys.len() as f64,
            greys[greys.len() / 50].into(),
        )
    }

    /// It has converged, and is neither too bright nor, if it responds in proportion, too dark.
    fn is_right(&self, balance: &mut Balance) -> Result<(), String> {
        let changes = self.settle(balance);
        let settings = balance.settings;
        let (mean, bright) = self.view(settings);
        let said = format!("{settings:?}: mean {mean}, bright {bright}, {changes:?}");
        let least = settings == Settings::new(100, 0);
        let most = settings == Settings::new(16_666, 18_000);
        let is_dark_enough = least || mean <= 112.0 && bright < 250.0;
        let is_bright_enough =
            most || self.gamma != 1.0 || self.step_us > 1 || mean >= 90.0 || bright >= 204.0;
        let is_right = changes.is_empty() && is_dark_enough && is_bright_enough;
        if is_right { Ok(()) } else { Err(said) }
    }
}

#[test]
fn a_window_in_a_dark_room_does_not_make_it_pump() {
    for (room, window, share) in [
        (30.0, 600.0, 10),
        (60.0, 255.0, 4),
        (5.0, 4000.0, 50),
        (80.0, 300.0, 3),
    ] {
        let mut scene = vec![room; 100 - share];
        scene.resize(100, window);
        for first_us in [200, 4_000, 16_666] {
            let mut balance = Balance::new(WIDE_LIMITS, Settings::new(first_us, 0), 1);
            Before {
                scene: scene.clone(),
                gamma: 1.0,
                step_us: 1,
            }
            .is_right(&mut balance)
            .unwrap();
        }
    }
}

proptest! {
    /// For any scene and camera: it converges, and follows a change of light.
    #[test]
    fn it_converges_on_every_scene_and_follows_the_light(
        parts in prop::collection::vec((-1.0f64..3.7, 1usize..60), 1..7),
        gamma in prop::sample::select(vec![0.45, 1.0, 1.3]),
        step_us in prop::sample::select(vec![1, 100]),
        first_us in 100u32..16_666,
        change in -1.5f64..1.5,
    ) {
        let part = |(log, count)| vec![10f64.powf(log); count];
        let scene = parts.into_iter().flat_map(part).collect();
        let mut before = Before { scene, gamma, step_us };
        let mut balance = Balance::new(WIDE_LIMITS, Settings::new(first_us, 0), 1);
        prop_assert_eq!(before.is_right(&mut balance), Ok(()));
        before.scene.iter_mut().for_each(|radiance| *radiance *= 10f64.powf(change));
        prop_assert_eq!(before.is_right(&mut balance), Ok(()));
    }
}

#[test]
fn pairs_from_before_a_change_do_not_count() {
    let begin = Settings::new(1_000, 0);
    let mut balance = Balance::new(LIMITS, begin, 1);
    let dark = Gray::filled(64, 48, 50).unwrap();
    balance.observe(&dark, &dark, begin);
    let once = balance.settings;
    assert_eq!(once, Settings::new(2_000, 0));
    balance.observe(&dark, &dark, begin);
    assert_eq!(balance.settings, once, "or it would overshoot");
}

#[test]
fn cameras_without_common_limits_are_refused() {
    let short = Limits {
        shutter_us: 20_000..=30_000,
        ..LIMITS
    };
    let gain = Limits {
        gain_mdb: 20_500..=24_000,
        ..LIMITS
    };
    let error = |other: &Limits| LIMITS.common(other).unwrap_err().to_string();
    let words = "the cameras: no shutter time in common: left 100 to 10000 µs, right 20000 to \
                 30000 µs; use two of one model";
    assert_eq!(error(&short), words);
    assert_says(&error(&Limits::new(0..=0, 0..=0)), &["right cannot be set"]);
    let words = "no gain in common: left 0 to 12 dB, right 20.5 to 24 dB";
    assert_says(&error(&gain), &[words]);
    let other = Limits::new(50..=5_000, 3_000..=20_000);
    assert_eq!(
        LIMITS.common(&other).unwrap(),
        Limits::new(100..=5_000, 3_000..=12_000)
    );
    assert!(LIMITS.common(&Limits::new(20_000..=30_000, 0..=0)).is_err());
}
