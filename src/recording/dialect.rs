//! In whose messages a recording is written.

use super::{Encoded, ImageFormat, Kind, PROFILE, Stamp, frame_id, geometry, gray_image, ros};
use crate::error::Result;
use crate::stereo::{Gray, Pose, Rig, Side};
use std::borrow::Cow;

/// In whose messages a recording is written. Both hold the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    /// Foxglove's, with JSON and ROS 2's float images beside them: svl reads back all of it.
    #[default]
    Svl,
    /// ROS 2's alone, in CDR: a bag for its tools and for rosbags.
    ///
    /// | topic | message |
    /// |---|---|
    /// | `/stereo/{left,right}/image_rect`, `image_raw` of raw pairs | sensor_msgs/msg/Image mono8 |
    /// | `/stereo/{left,right}/image_rect/compressed`, `image_raw/compressed` | sensor_msgs/msg/CompressedImage |
    /// | `/stereo/{left,right}/camera_info` | sensor_msgs/msg/CameraInfo: rectified K, R = I, P |
    /// | `/tf` | tf2_msgs/msg/TFMessage: world → left camera |
    /// | `/truth/depth`, `/truth/disparity`, `/algo/<name>/disparity` | sensor_msgs/msg/Image 32FC1 |
    /// | `/truth/visibility` | sensor_msgs/msg/Image mono8 |
    /// | `/stereo/sync`, `/algo/<name>/result` | std_msgs/msg/String: their JSON |
    ///
    /// svl reads it as any other bag: its images and calibrations, paired by their stamps.
    Ros2,
}

/// How a recording is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Format {
    pub dialect: Dialect,
    pub images: ImageFormat,
}

impl From<ImageFormat> for Format {
    fn from(images: ImageFormat) -> Self {
        Self {
            images,
            ..Self::default()
        }
    }
}

/// A message and the topic it belongs to.
pub(super) type Said = (Cow<'static, str>, Encoded);

impl Dialect {
    /// MCAP's profile.
    pub(super) fn profile(self) -> &'static str {
        match self {
            Self::Svl => PROFILE,
            Self::Ros2 => "ros2",
        }
    }

    pub(super) fn calibration(
        self,
        rig: &Rig,
        size: (usize, usize),
        camera: Side,
        stamp: Stamp,
    ) -> Said {
        match self {
            Self::Svl => {
                let message = geometry::encode_calibration(rig, size, camera, stamp);
                (Kind::Calibration(camera).topic().into(), message)
            }
            Self::Ros2 => {
                let topic = format!("/stereo/{}/camera_info", camera.name());
                (
                    topic.into(),
                    ros::encode_camera_info(rig, size, camera, stamp),
                )
            }
        }
    }

    /// The right camera in the frame of the left one, where the calibration alone does not say it.
    pub(super) fn baseline(self, rig: &Rig, stamp: Stamp) -> Option<Said> {
        let right = Pose::translation(rig.baseline_m(), 0.0, 0.0);
        let frames = [frame_id(Side::Left), frame_id(Side::Right)];
        let message = || {
            (
                Kind::Baseline.topic().into(),
                geometry::encode_transform(&right, frames, stamp),
            )
        };
        (self == Self::Svl).then(message)
    }

    /// The left camera in the world.
    pub(super) fn pose(self, pose: &Pose, stamp: Stamp) -> Said {
        let frames = [geometry::WORLD, frame_id(Side::Left)];
        match self {
            Self::Svl => (
                Kind::Pose.topic().into(),
                geometry::encode_transform(pose, frames, stamp),
            ),
            Self::Ros2 => ("/tf".into(), ros::encode_transform(pose, frames, stamp)),
        }
    }

    /// The image of a camera. In ROS its topic says whether the pair is rectified.
    pub(super) fn image(
        self,
        image: &Gray,
        camera: Side,
        rectified: bool,
        format: ImageFormat,
        stamp: Stamp,
    ) -> Result<Said> {
        if self == Self::Svl {
            let message = gray_image::encode(image, format, stamp, frame_id(camera))?;
            return Ok((Kind::Image(camera).topic().into(), message));
        }
        // As their calibrations have it.
        let frame_id = frame_id(Side::Left);
        let topic = format!(
            "/stereo/{}/{}",
            camera.name(),
            if rectified { "image_rect" } else { "image_raw" }
        );
        Ok(match format {
            ImageFormat::Raw => (topic.into(), ros::encode_mono8(image, stamp, frame_id)),
            ImageFormat::Png => {
                let png = gray_image::png(image)?;
                (
                    format!("{topic}/compressed").into(),
                    ros::encode_png(&png, stamp, frame_id),
                )
            }
        })
    }

    pub(super) fn visibility(self, codes: &Gray, stamp: Stamp) -> Result<Said> {
        let frame_id = frame_id(Side::Left);
        let message = match self {
            Self::Svl => gray_image::encode(codes, ImageFormat::Raw, stamp, frame_id)?,
            Self::Ros2 => ros::encode_mono8(codes, stamp, frame_id),
        };
        Ok((Kind::Visibility.topic().into(), message))
    }

    /// A message of JSON.
    pub(super) fn json(self, message: Encoded) -> Encoded {
        match self {
            Self::Svl => message,
            // serde_json writes nothing but UTF-8.
            Self::Ros2 => ros::encode_string(&String::from_utf8_lossy(&message.data)),
        }
    }
}
