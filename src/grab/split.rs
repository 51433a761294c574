//! One device that delivers both images in one: two cameras of the halves of its images.

use super::camera::{Camera, Capture, Limits, Settings, Taken};
use parking_lot::Mutex;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;
use svl_core::Result;
use svl_core::stereo::Side;
use svl_files::SideBySide;

/// Halves that wait for the camera of the other side, at most; the earliest are lost first, and
/// their partners are counted as unpaired.
const WAITING: usize = 8;

/// The camera of the halves of one side.
struct HalfCamera {
    side: Side,
    places: SideBySide,
    device: Arc<Mutex<SharedDevice>>,
}

/// The device, and the halves that each side has not captured yet.
struct SharedDevice {
    camera: Box<dyn Camera>,
    waiting: [VecDeque<Taken>; 2],
}

/// The cameras of the left and of the right halves of a device's images.
pub(super) fn split(camera: Box<dyn Camera>, places: SideBySide) -> [Box<dyn Camera>; 2] {
    let waiting = Default::default();
    let device = Arc::new(Mutex::new(SharedDevice { camera, waiting }));
    Side::BOTH.map(|side| {
        let device = Arc::clone(&device);
        let half = HalfCamera {
            side,
            places,
            device,
        };
        Box::new(half) as Box<dyn Camera>
    })
}

impl Camera for HalfCamera {
    fn name(&self) -> String {
        self.device.lock().camera.name()
    }

    fn limits(&self) -> Limits {
        self.device.lock().camera.limits()
    }

    fn arm(&mut self, settings: Settings) -> Result<()> {
        self.device.lock().camera.arm(settings)
    }

    /// The next half; the side that comes first waits for the image of both.
    fn capture(&mut self, timeout: Duration) -> Result<Option<Taken>> {
        let SharedDevice { camera, waiting } = &mut *self.device.lock();
        if waiting[self.side as usize].is_empty()
            && let Some(taken) = camera.capture(timeout)?
        {
            let halves = match taken {
                Taken::Image(both) => self.places.halves(&both.image)?.map(|image| {
                    let both = both.clone();
                    Taken::Image(Capture { image, ..both })
                }),
                other => [other.clone(), other],
            };
            for (waiting, half) in waiting.iter_mut().zip(halves) {
                if waiting.len() == WAITING {
                    waiting.pop_front();
                }
                waiting.push_back(half);
            }
        }
        Ok(waiting[self.side as usize].pop_front())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::Gray;

    /// Images of 4 x 2 pixels, one after the other, the second damaged.
    struct Device(u64);

    impl Camera for Device {
        fn name(&self) -> String {
            "device".into()
        }

        fn limits(&self) -> Limits {
            Limits::new(0..=9, 0..=0)
        }

        fn arm(&mut self, _: Settings) -> Result<()> {
            Ok(())
        }

        fn capture(&mut self, _: Duration) -> Result<Option<Taken>> {
            self.0 += 1;
            if self.0 == 2 {
                return Ok(Some(Taken::Damaged));
            }
            let settings = Settings::new(1, 0);
            Ok(Some(Taken::Image(Capture {
                image: Gray::from_fn(4, 2, |x, y| (10 * y + x) as u8)?,
                stamp_ns: self.0,
                trigger_id: None,
                ordered: settings,
                settings,
            })))
        }
    }

    #[test]
    fn halves_of_an_image_have_its_stamp() {
        let halves = [
            (SideBySide::RightLeft, [[2, 3], [0, 1]]),
            (SideBySide::TopBottom, [[0, 1], [10, 11]]),
        ];
        for (places, pixels) in halves {
            let [mut left, mut right] = split(Box::new(Device(0)), places);
            // Whichever side comes first.
            let first = left.capture(Duration::ZERO).unwrap();
            let rights = [(); 3].map(|()| right.capture(Duration::ZERO).unwrap());
            let rest = [(); 2].map(|()| left.capture(Duration::ZERO).unwrap());
            let lefts = [&[first][..], &rest].concat();
            for ((left, right), stamp_ns) in lefts.iter().zip(&rights).zip(1..) {
                let (Some(Taken::Image(left)), Some(Taken::Image(right))) = (left, right) else {
                    assert_eq!((left, right, stamp_ns), (&Some(Taken::Damaged), left, 2));
                    continue;
                };
                assert_eq!((left.stamp_ns, right.stamp_ns), (stamp_ns, stamp_ns));
                let found = [left, right].map(|half| [0, 1].map(|x| half.image.get(x, 0)));
                assert_eq!(found, pixels);
            }
        }
    }
}
