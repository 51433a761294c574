//! Tests of V4L2 cameras on drivers that comply, and on some that do not.

use super::abi::{
    ANALOGUE_GAIN, AUTOGAIN, EXPOSURE_ABSOLUTE, EXPOSURE_AUTO, FLAG_STAMPED_AT_BEGIN,
    FLAG_TIMESTAMP_MONOTONIC,
};
use super::camera::V4l2Camera;
use super::mode::PixelFormat;
use super::pixels::Layout;
use super::stamp::{BufferStamp, Times};
use super::stream::{ControlRange, Fault, VideoStream};
use crate::CameraError;
use crate::camera::{Camera, Capture, Limits, Settings, Taken};
use rustix::io::Errno;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

type Filled = Result<(Vec<u8>, BufferStamp), Fault>;

#[derive(Clone, Default)]
struct Odd(Arc<Mutex<OddState>>);

#[derive(Default)]
struct OddState {
    controls: Vec<(u32, ControlRange)>,
    /// Controls set, in this order.
    set: Vec<(u32, i32)>,
    /// Step to which it rounds a gain.
    gain_step: i32,
    buffers: VecDeque<Filled>,
}

impl Odd {
    fn state(&self) -> MutexGuard<'_, OddState> {
        self.0.lock().unwrap()
    }
}

impl VideoStream for Odd {
    fn range(&self, control: u32) -> Option<ControlRange> {
        self.state()
            .controls
            .iter()
            .find(|(id, _)| *id == control)
            .map(|(_, range)| *range)
    }

    fn set(&mut self, control: u32, value: i32) -> Result<i32, Errno> {
        self.range(control)
            .filter(|range| (range.min..=range.max).contains(&value))
            .ok_or(Errno::RANGE)?;
        let mut state = self.state();
        state.set.push((control, value));
        let step = if control == ANALOGUE_GAIN {
            state.gain_step.max(1)
        } else {
            1
        };
        Ok(value / step * step)
    }

    fn next<T>(
        &mut self,
        _: Duration,
        read: impl FnOnce(&[u8], BufferStamp) -> T,
    ) -> Result<Option<T>, Fault> {
        let filled = self.state().buffers.pop_front().transpose()?;
        Ok(filled.map(|(data, stamp)| read(&data, stamp)))
    }
}

/// A shutter in hundreds of microseconds, a gain in sixteenths.
fn webcam() -> Vec<(u32, ControlRange)> {
    let range = |min, max| ControlRange { min, max, step: 1 };
    vec![
        (EXPOSURE_AUTO, range(0, 3)),
        (EXPOSURE_ABSOLUTE, range(3, 2047)),
        (AUTOGAIN, range(0, 1)),
        (ANALOGUE_GAIN, range(16, 64)),
    ]
}

/// Two pixels, the second of which is the number; the exposure starts at that many milliseconds.
fn image(number: u8) -> Filled {
    let ns = u64::from(number) * 1_000_000;
    let flags = FLAG_TIMESTAMP_MONOTONIC | FLAG_STAMPED_AT_BEGIN;
    Ok((
        vec![9, number],
        BufferStamp {
            ns,
            flags,
            arrived_ns: ns + 500_000,
        },
    ))
}

/// Twice the least gain is 6.02 dB.
const SETTINGS: Settings = Settings::new(4_000, 6_021);

/// A webcam, armed.
fn camera(triggered: bool, buffers: impl IntoIterator<Item = Filled>) -> (V4l2Camera<Odd>, Odd) {
    let driver = Odd::default();
    driver.state().controls = webcam();
    driver.state().buffers.extend(buffers);
    let mut camera = unarmed(&driver, triggered);
    camera.arm(SETTINGS).unwrap();
    (camera, driver)
}

fn unarmed(driver: &Odd, triggered: bool) -> V4l2Camera<Odd> {
    let layout = Layout {
        format: PixelFormat::Grey,
        width: 2,
        height: 1,
        stride: 2,
    };
    let times = Times {
        offset_ns: 7_000_000_000,
        earliest_ns: 0,
    };
    V4l2Camera::new(
        "/dev/video9".into(),
        driver.clone(),
        layout,
        triggered,
        times,
    )
    .unwrap()
}

fn next(camera: &mut impl Camera) -> Option<Capture> {
    match camera.capture(Duration::ZERO).unwrap() {
        Some(Taken::Image(capture)) => Some(capture),
        Some(Taken::Damaged) => panic!("damaged"),
        Some(Taken::Unready) => next(camera),
        None => None,
    }
}

/// The numbers of the images.
fn numbers(camera: &mut impl Camera) -> Vec<u8> {
    std::iter::from_fn(|| next(camera))
        .map(|capture| capture.image.get(1, 0))
        .collect()
}

#[test]
fn the_camera_is_taken_out_of_its_automatic_and_set() {
    let (mut camera, driver) = camera(true, []);
    assert_eq!(camera.limits(), Limits::new(300..=204_700, 0..=12_041));
    let expected = [
        (EXPOSURE_AUTO, 1),
        (AUTOGAIN, 0),
        (EXPOSURE_ABSOLUTE, 40),
        (ANALOGUE_GAIN, 32),
    ];
    assert_eq!(driver.state().set, expected);
    camera.arm(SETTINGS).unwrap();
    assert_eq!(driver.state().set.len(), 4, "only what changes is set");
}

#[test]
fn a_camera_without_a_shutter_is_left_to_itself() {
    let driver = Odd::default();
    driver.state().controls = vec![(AUTOGAIN, ControlRange::new(0, 1, 1))];
    let mut camera = unarmed(&driver, false);
    assert_eq!(camera.limits(), Limits::new(0..=0, 0..=0));
    camera.arm(Settings::new(0, 0)).unwrap();
    assert!(driver.state().set.is_empty());
}

#[test]
fn stamps_are_of_the_middle_of_the_exposure_in_the_grabbers_time() {
    let (mut camera, _) = camera(false, (1..9).map(image));
    let capture = next(&mut camera).unwrap();
    // The third began at 3 ms and was exposed for 4.
    assert_eq!(
        (capture.image.get(1, 0), capture.stamp_ns),
        (3, 7_005_000_000)
    );
    assert_eq!((capture.ordered, capture.trigger_id), (SETTINGS, None));
}

#[test]
fn settings_are_those_that_the_driver_used() {
    let (mut camera, driver) = camera(false, (1..9).map(image));
    driver.state().gain_step = 20;
    // 41.3 hundreds of microseconds, and 34 sixteenths, which the driver rounds to 20.
    let ordered = Settings::new(4_130, 6_547);
    camera.arm(ordered).unwrap();
    let capture = next(&mut camera).unwrap();
    assert_eq!(
        (capture.ordered, capture.settings),
        (ordered, Settings::new(4_100, 1_938))
    );
    // The third began at 3 ms.
    assert_eq!(capture.stamp_ns, 7_005_050_000);
}

#[test]
fn images_from_before_a_setting_are_counted_and_others_kept() {
    let (mut camera, _) = camera(false, (1..=9).map(image));
    for _ in 0..2 {
        assert_eq!(
            camera.capture(Duration::ZERO).unwrap(),
            Some(Taken::Unready)
        );
    }
    assert_eq!(next(&mut camera).unwrap().image.get(1, 0), 3);
    camera.arm(SETTINGS).unwrap();
    assert_eq!(next(&mut camera).unwrap().image.get(1, 0), 4);
    camera
        .arm(Settings {
            shutter_us: 5_000,
            ..SETTINGS
        })
        .unwrap();
    assert_eq!(numbers(&mut camera), [7, 8, 9]);
}

#[test]
fn a_camera_that_is_triggered_gives_what_came_after_it_was_armed() {
    let (mut camera, driver) = camera(true, (1..=9).map(image));
    assert!(numbers(&mut camera).is_empty());
    driver.state().buffers.push_back(image(10));
    assert_eq!(numbers(&mut camera), [10]);
}

#[test]
fn damaged_buffers_are_no_images_and_the_camera_goes_on() {
    let short = Ok((vec![9], image(3).unwrap().1));
    let damaged = [short, Err(Fault::Buffer("its driver says so"))];
    let settling = [image(1), image(2), image(5)];
    let (mut camera, _) = camera(false, damaged.into_iter().chain(settling));
    for _ in 0..2 {
        assert_eq!(
            camera.capture(Duration::ZERO).unwrap(),
            Some(Taken::Damaged)
        );
    }
    assert_eq!(numbers(&mut camera), [5]);
}

#[test]
fn a_stream_that_ends_is_an_error_with_the_cure() {
    for triggered in [true, false] {
        let (mut camera, driver) = camera(triggered, []);
        driver
            .state()
            .buffers
            .push_back(Err(Fault::Stream(Errno::NODEV)));
        let error = camera.capture(Duration::ZERO).unwrap_err();
        assert_eq!(
            error.to_string(),
            "/dev/video9: disconnected; plug it in and record again"
        );
        assert!(error.downcast_ref::<CameraError>().is_some());
    }
    let (mut camera, driver) = camera(false, []);
    driver.state().controls.clear();
    let error = camera
        .arm(Settings {
            shutter_us: 5_000,
            ..SETTINGS
        })
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("/dev/video9: cannot be set to 5000 µs and 6.0 dB: "),
        "{error}"
    );
}

#[test]
fn without_a_drivers_time_an_image_has_that_of_its_arrival() {
    let (data, stamp) = image(3).unwrap();
    let (mut camera, driver) = camera(true, []);
    driver
        .state()
        .buffers
        .push_back(Ok((data, BufferStamp { flags: 0, ..stamp })));
    assert_eq!(next(&mut camera).unwrap().stamp_ns, 7_003_500_000);
}
