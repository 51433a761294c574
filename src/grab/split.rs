//! One device that delivers both images in one: two cameras of the halves of its images.

use super::camera::{Camera, Capture, Limits, Settings, Taken};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;
use svl_core::Result;
use svl_files::SideBySide;

/// Right halves that may wait, more than the pairing needs; later ones are lost, and their left
/// ones are counted as unpaired.
const WAITING: usize = 8;

/// The camera of the left halves, which drives the device.
struct LeftHalf {
    device: Box<dyn Camera>,
    places: SideBySide,
    rights: SyncSender<Taken>,
}

/// The camera of the right halves, which come with the left ones.
struct RightHalf {
    name: String,
    limits: Limits,
    rights: Receiver<Taken>,
    /// True if a controller triggers the device: halves of earlier pulses are stale.
    is_triggered: bool,
}

/// The cameras of the left and of the right halves of a device's images.
pub(super) fn split(
    device: Box<dyn Camera>,
    places: SideBySide,
    is_triggered: bool,
) -> [Box<dyn Camera>; 2] {
    let (sender, rights) = sync_channel(WAITING);
    let (name, limits) = (device.name(), device.limits());
    let left = LeftHalf {
        device,
        places,
        rights: sender,
    };
    let right = RightHalf {
        name,
        limits,
        rights,
        is_triggered,
    };
    [Box::new(left), Box::new(right)]
}

impl Camera for LeftHalf {
    fn name(&self) -> String {
        self.device.name()
    }

    fn limits(&self) -> Limits {
        self.device.limits()
    }

    fn arm(&mut self, settings: Settings) -> Result<()> {
        self.device.arm(settings)
    }

    fn capture(&mut self, timeout: Duration) -> Result<Option<Taken>> {
        let Some(taken) = self.device.capture(timeout)? else {
            return Ok(None);
        };
        let [left, right] = match taken {
            Taken::Image(whole) => {
                let halves = self.places.halves(&whole.image)?;
                halves.map(|image| {
                    Taken::Image(Capture {
                        image,
                        ..whole.clone()
                    })
                })
            }
            Taken::Damaged => [Taken::Damaged, Taken::Damaged],
            Taken::Unready => [Taken::Unready, Taken::Unready],
        };
        // Lost if full or if the other camera has ended, which is reported there.
        let _ = self.rights.try_send(right);
        Ok(Some(left))
    }
}

impl Camera for RightHalf {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn limits(&self) -> Limits {
        self.limits.clone()
    }

    fn arm(&mut self, _: Settings) -> Result<()> {
        if self.is_triggered {
            self.rights.try_iter().for_each(drop);
        }
        Ok(())
    }

    fn capture(&mut self, timeout: Duration) -> Result<Option<Taken>> {
        Ok(self.rights.recv_timeout(timeout).ok())
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
            for is_triggered in [false, true] {
                let [mut left, mut right] = split(Box::new(Device(0)), places, is_triggered);
                let wait = Duration::ZERO;
                assert_eq!(right.capture(wait).unwrap(), None);
                let lefts = [(); 3].map(|()| left.capture(wait).unwrap());
                let rights = [(); 3].map(|()| right.capture(wait).unwrap());
                for ((left, right), stamp_ns) in lefts.iter().zip(&rights).zip(1..) {
                    let (Some(Taken::Image(left)), Some(Taken::Image(right))) = (left, right)
                    else {
                        assert_eq!((left, right, stamp_ns), (&Some(Taken::Damaged), left, 2));
                        continue;
                    };
                    assert_eq!((left.stamp_ns, right.stamp_ns), (stamp_ns, stamp_ns));
                    let found = [left, right].map(|half| [0, 1].map(|x| half.image.get(x, 0)));
                    assert_eq!(found, pixels);
                }
                left.capture(wait).unwrap();
                right.arm(Settings::new(1, 0)).unwrap();
                assert_eq!(right.capture(wait).unwrap().is_none(), is_triggered);
            }
        }
    }
}
