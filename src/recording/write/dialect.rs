//! The message types of a recording: svl's own or ROS 2's.

use crate::message::images::ImageFormat;
use crate::message::wire::{Encoded, PROFILE, RosStamp, frame_id, topic};
use crate::message::{geometry, images, ros};
use images::Pixel;
use std::borrow::Cow;
use svl_core::Result;
use svl_core::stereo::{Gray, Plane, Pose, Rig, Side};

/// The message types of a recording. Both dialects contain the same data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    /// Foxglove messages, JSON, and ROS 2's float images: svl reads back everything.
    #[default]
    Svl,
    /// ROS 2 messages only, in CDR: a bag for its tools and for rosbags.
    ///
    /// | topic | message |
    /// |---|---|
    /// | `/stereo/{left,right}/image_rect`, raw `image_raw` | sensor_msgs/msg/Image mono8 |
    /// | `…/image_rect_color`, raw `image_raw_color`, of a source in colour | Image rgb8 |
    /// | the same with `/compressed` | sensor_msgs/msg/CompressedImage |
    /// | `/stereo/{left,right}/camera_info` | sensor_msgs/msg/CameraInfo: rectified K, R = I, P |
    /// | `/tf` | tf2_msgs/msg/TFMessage: world → left camera |
    /// | `/tf_static` | TFMessage: left camera → frame of the scans, base_footprint, if known |
    /// | `/truth/{depth,disparity}`, `/algo/<name>/depth` | sensor_msgs/msg/Image 32FC1 |
    /// | `/algo/<name>/points` | sensor_msgs/msg/PointCloud2, a point per known cell |
    /// | `/algo/<name>/scan` | sensor_msgs/msg/LaserScan |
    /// | `/algo/<name>/disparity` | stereo_msgs/msg/DisparityImage; without a rig Image 32FC1 |
    /// | `/truth/{visibility,surface}` | sensor_msgs/msg/Image mono8 |
    /// | `/stereo/sync`, `/algo/<name>/{cells,result}` | std_msgs/msg/String: their JSON |
    ///
    /// svl reads it like any other bag: images and calibrations, paired by stamp.
    Ros2,
}

/// Message types and image compression of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordingFormat {
    pub dialect: Dialect,
    pub images: ImageFormat,
}

impl From<ImageFormat> for RecordingFormat {
    fn from(images: ImageFormat) -> Self {
        Self {
            images,
            ..Self::default()
        }
    }
}

/// A topic and one message of it.
pub(crate) type TopicMessage = (Cow<'static, str>, Encoded);

impl Dialect {
    /// MCAP's profile.
    pub(crate) fn profile(self) -> &'static str {
        match self {
            Self::Svl => PROFILE,
            Self::Ros2 => "ros2",
        }
    }

    pub(crate) fn calibration(
        self,
        rig: &Rig,
        size: (usize, usize),
        camera: Side,
        stamp: RosStamp,
    ) -> TopicMessage {
        match self {
            Self::Svl => {
                let message = geometry::encode_calibration(rig, size, camera, stamp);
                (topic::camera(camera, "calibration").into(), message)
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

    /// The right camera in the frame of the left one; `None` in ROS 2, where P contains the
    /// baseline.
    pub(crate) fn baseline(self, rig: &Rig, stamp: RosStamp) -> Option<TopicMessage> {
        // Rectified cameras differ only by a translation along x.
        let right = Pose::translation(rig.baseline_m(), 0.0, 0.0);
        let frames = [frame_id(Side::Left), frame_id(Side::Right)];
        let message = || {
            (
                topic::BASELINE.into(),
                geometry::encode_transform(&right, frames, stamp),
            )
        };
        (self == Self::Svl).then(message)
    }

    /// The pose of the left camera in the world.
    pub(crate) fn pose(self, pose: &Pose, stamp: RosStamp) -> TopicMessage {
        let frames = [geometry::WORLD, frame_id(Side::Left)];
        match self {
            Self::Svl => (
                topic::POSE.into(),
                geometry::encode_transform(pose, frames, stamp),
            ),
            // ROS tools look for transforms on /tf, whatever the frames.
            Self::Ros2 => (
                "/tf".into(),
                ros::encode_transforms(&[(*pose, frames)], stamp),
            ),
        }
    }

    /// The image of a camera, or its colours: svl's own readers use the image, which is their luma.
    /// In ROS the topic name tells if the pair is rectified.
    pub(crate) fn image<P: Pixel>(
        self,
        image: &Plane<P>,
        camera: Side,
        rectified: bool,
        format: ImageFormat,
        stamp: RosStamp,
    ) -> Result<TopicMessage> {
        if self == Self::Svl {
            let message = images::encode_image(image, format, stamp, frame_id(camera))?;
            return Ok((topic::camera(camera, P::NAME).into(), message));
        }
        // The frame of both calibrations.
        let frame_id = frame_id(Side::Left);
        let name = if rectified { "image_rect" } else { "image_raw" };
        let topic = format!("/stereo/{}/{name}{}", camera.name(), P::ROS_ENDING);
        Ok(match format {
            // ROS viewers use mono8 for grey; Rerun shows it as depth, which is why svl's own
            // dialect uses RawImage.
            ImageFormat::Raw => (topic.into(), ros::encode_8bit(image, stamp, frame_id)),
            ImageFormat::Png => {
                let png = images::png(image)?;
                (
                    format!("{topic}/compressed").into(),
                    ros::encode_png(&png, P::ENCODING, stamp, frame_id),
                )
            }
        })
    }

    /// Codes of the left image's pixels.
    pub(crate) fn codes(
        self,
        topic: &'static str,
        codes: &Gray,
        stamp: RosStamp,
    ) -> Result<TopicMessage> {
        let frame_id = frame_id(Side::Left);
        let message = match self {
            Self::Svl => images::encode_image(codes, ImageFormat::Raw, stamp, frame_id)?,
            Self::Ros2 => ros::encode_8bit(codes, stamp, frame_id),
        };
        Ok((topic.into(), message))
    }

    /// A JSON message.
    pub(crate) fn json(self, message: Encoded) -> Encoded {
        match self {
            Self::Svl => message,
            // serde_json writes only UTF-8.
            Self::Ros2 => ros::encode_string(&String::from_utf8_lossy(&message.data)),
        }
    }
}
