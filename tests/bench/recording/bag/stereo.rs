//! The messages of two cameras beside each other.

use super::{Bag, CAMERA, Camera, Message, camera_info_of, ros_image_in};
use crate::recording::frames::{image, stamp};
use svl::stereo::{Frame, Gray};

/// Two cameras: topics of images and of calibrations, size of the images, and calibrations.
#[derive(Clone, Copy)]
pub(crate) struct Stereo<'a> {
    pub(crate) images: [&'static str; 2],
    pub(crate) infos: [&'static str; 2],
    pub(crate) size: (usize, usize),
    pub(crate) cameras: [Camera<'a>; 2],
}

/// Size of the images of [`STEREO`].
pub(crate) const SIZE: (usize, usize) = (24, 16);

/// Rectified images.
pub(crate) const STEREO: Stereo<'_> = Stereo {
    images: ["/cam0/image_rect", "/cam1/image_rect"],
    infos: ["/cam0/camera_info", "/cam1/camera_info"],
    size: SIZE,
    cameras: [CAMERA, Camera { tx: -FB, ..CAMERA }],
};

/// The same cameras, whose images are not rectified.
pub(crate) const RAW: Stereo<'_> = Stereo {
    images: ["/cam0/image_raw", "/cam1/image_raw"],
    ..STEREO
};

/// Focal length times baseline of [`STEREO`], pixels times metres.
pub(crate) const FB: f64 = 14.432;

impl<'a> Stereo<'a> {
    /// The cameras in these frames.
    pub(crate) fn in_frames(mut self, frames: [&'a str; 2]) -> Self {
        [self.cameras[0].frame, self.cameras[1].frame] = frames;
        self
    }

    /// Each camera's calibration, changed.
    pub(crate) fn with(mut self, change: impl Fn(&mut Camera<'a>)) -> Self {
        self.cameras.iter_mut().for_each(change);
        self
    }

    /// The calibrations with these fourth columns of P.
    pub(crate) fn offsets(mut self, tx: [f64; 2]) -> Self {
        [self.cameras[0].tx, self.cameras[1].tx] = tx;
        self
    }

    /// The images at a time, of any size.
    pub(crate) fn shown(&self, stamp: u64, images: [&Gray; 2]) -> [Message; 2] {
        [0, 1].map(|side| {
            let pixels: Vec<u8> = images[side].pixels().collect();
            let (frame, topic) = (self.cameras[side].frame, self.images[side]);
            ros_image_in(frame, topic, stamp, images[side].size(), ("mono8", &pixels))
        })
    }

    /// The images of pair `i`, as those of [`bare`](crate::recording::frames::bare).
    pub(crate) fn images(&self, i: u64) -> [Message; 2] {
        self.images_at(i, stamp(i))
    }

    /// The images of pair `i` at another time.
    pub(crate) fn images_at(&self, i: u64, stamp: u64) -> [Message; 2] {
        let [left, right] = [2 * i, 2 * i + 1].map(|seed| image(self.size, seed));
        self.shown(stamp, [&left, &right])
    }

    pub(crate) fn infos(&self, stamp: u64) -> [Message; 2] {
        [0, 1].map(|side| camera_info_of(self.infos[side], stamp, &self.cameras[side]))
    }

    /// Pair `i`: calibrations, then images.
    pub(crate) fn pair(&self, i: u64) -> [Message; 4] {
        let [[a, b], [c, d]] = [self.infos(stamp(i)), self.images(i)];
        [a, b, c, d]
    }

    /// The messages of these frames, each camera's calibration before its image.
    pub(crate) fn record(&self, frames: &[Frame], stamp: impl Fn(u64) -> u64) -> Vec<Message> {
        let pair = |(frame, i): (&Frame, u64)| {
            let images = self.shown(stamp(i), [frame.pair.left(), frame.pair.right()]);
            let [[a, b], [c, d]] = [self.infos(stamp(i)), images];
            [a, c, b, d]
        };
        frames.iter().zip(0..).flat_map(pair).collect()
    }
}

impl Bag {
    /// Rectified pairs with a rig, in frame `cam`.
    pub(crate) fn pairs(count: u64) -> Self {
        Self::new((0..count).flat_map(|i| STEREO.pair(i)))
    }
}
