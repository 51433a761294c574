//! The bag of each driver, by its published source, which each one names with its commit. Late
//! messages and extra topics are those of `ros2 bag record --all`.

use super::scene::{PAIRS, message, stamp};
use crate::recording::bag::{Message, OPTICAL, PARALLEL, transforms};

/// The messages of a driver.
pub(super) struct DriverBag {
    /// A line for each message of a pair, as [`message`] reads them.
    pair: &'static str,
    /// A message after all others.
    last: &'static str,
    /// Static transforms: a line for each, with parent, child, translation in metres, and the axes
    /// of the child in its parent.
    transforms: &'static str,
    /// Number of the pair after which they are published.
    transforms_after: u64,
}

impl DriverBag {
    pub(super) fn messages(&self) -> Vec<Message> {
        let lines = |text: &'static str| text.lines().filter(|line| !line.trim().is_empty());
        let mut messages = Vec::new();
        for i in 0..PAIRS {
            messages.extend(lines(self.pair).map(|line| message(line, i)));
            if i == self.transforms_after && !self.transforms.is_empty() {
                let links = lines(self.transforms).map(|line| {
                    let words: Vec<_> = line.split_whitespace().collect();
                    let [parent, child, numbers @ .., axes] = &words[..] else {
                        panic!("{line}")
                    };
                    let number = |at: usize| numbers[at].parse().unwrap();
                    let axes = match *axes {
                        "optical" => OPTICAL,
                        _ => PARALLEL,
                    };
                    (*parent, *child, [0, 1, 2].map(number), axes)
                });
                let links: Vec<_> = links.collect();
                let transforms = transforms("/tf_static", 0, &links);
                messages.push(transforms.logged(stamp(i) + 3_000_000));
            }
        }
        messages.extend(lines(self.last).map(|line| message(line, 3)));
        messages
    }
}

const UNPLACED: DriverBag = DriverBag {
    pair: "",
    last: "",
    transforms: "",
    transforms_after: 0,
};

/// RealSense: realsense-ros 775b167, `publishFrame` (each image before its camera_info),
/// `updateStreamCalibData` and `updateExtrinsicsCalibData` (P and the frame of infra2, which is the
/// left camera's) in realsense2_camera/src/base_realsense_node.cpp, `startPublishers` (topics) in
/// src/rs_node_setup.cpp.
pub(super) const REALSENSE: DriverBag = DriverBag {
    pair: "
        /camera/camera/infra1/image_rect_raw camera_infra1_optical_frame left mono8
        /camera/camera/infra1/image_rect_raw/compressed camera_infra1_optical_frame left png
        /camera/camera/infra1/camera_info camera_infra1_optical_frame rect
        /camera/camera/infra2/image_rect_raw camera_infra2_optical_frame right mono8
        /camera/camera/infra2/image_rect_raw/compressed camera_infra2_optical_frame right png
        /camera/camera/infra2/camera_info camera_infra1_optical_frame rect-right
        /camera/camera/depth/image_rect_raw camera_depth_optical_frame depth 16UC1
        /camera/camera/depth/camera_info camera_depth_optical_frame rect
        /camera/camera/color/image_raw camera_color_optical_frame left rgb8",
    last: "/camera/camera/extrinsics/depth_to_infra1 frame other \
           realsense2_camera_msgs/msg/Extrinsics",
    transforms: "
        camera_link camera_depth_frame 0 0 0 parallel
        camera_depth_frame camera_depth_optical_frame 0 0 0 optical
        camera_link camera_infra1_frame 0 0 0 parallel
        camera_infra1_frame camera_infra1_optical_frame 0 0 0 optical
        camera_link camera_infra2_frame 0 -0.1 0 parallel
        camera_infra2_frame camera_infra2_optical_frame 0 0 0 optical",
    transforms_after: 2,
};

/// OAK-D: depthai-ros 9132443 (humble), topics and order in
/// depthai_ros_driver/src/dai_nodes/sensors/img_pub.cpp and stereo.cpp, camera_info in
/// `calibrationToCameraInfo` of depthai_bridge/src/ImageConverter.cpp, frames in TFPublisher.cpp.
/// Depth is aligned to the colour camera.
///
/// The right P has the sign of DepthAI, whose first camera is the right one, unless
/// `i_reverse_stereo_socket_order` is set (depthai-ros issue 597).
pub(super) const DEPTHAI: DriverBag = DriverBag {
    pair: "
        /oak/rgb/image_raw oak_rgb_camera_optical_frame left bgr8
        /oak/left/image_raw oak_left_camera_optical_frame left mono8
        /oak/left/camera_info oak_left_camera_optical_frame rational
        /oak/right/image_raw oak_right_camera_optical_frame right mono8
        /oak/right/camera_info oak_right_camera_optical_frame reversed
        /oak/stereo/image_raw oak_rgb_camera_optical_frame depth 16UC1
        /oak/stereo/camera_info oak_rgb_camera_optical_frame rect",
    transforms: "
        oak oak_rgb_camera_frame 0 0 0 parallel
        oak_rgb_camera_frame oak_rgb_camera_optical_frame 0 0 0 optical
        oak oak_left_camera_frame 0 0.05 0 parallel
        oak_left_camera_frame oak_left_camera_optical_frame 0 0 0 optical
        oak oak_right_camera_frame 0 -0.05 0 parallel
        oak_right_camera_frame oak_right_camera_optical_frame 0 0 0 optical",
    transforms_after: 1,
    ..UNPLACED
};

/// ZED: zed-ros2-wrapper 33dfefa, `initVideoDepthPublishers` (topics), `publishImageWithInfo` (two
/// camera_info before each image) and `fillCamInfo` in
/// zed_components/src/zed_camera/src/zed_camera_component_video_depth.cpp, encodings in
/// src/tools/src/sl_tools.cpp, with `publish_raw` and `publish_gray`. The raw P of a camera are its
/// own intrinsics; the map of confidence is in per cent.
pub(super) const ZED: DriverBag = DriverBag {
    pair: "
        /zed/zed_node/left/color/rect/camera_info zed_left_camera_frame_optical rect
        /zed/zed_node/left/color/rect/image/camera_info zed_left_camera_frame_optical rect
        /zed/zed_node/left/color/rect/image zed_left_camera_frame_optical left bgra8
        /zed/zed_node/right/color/rect/camera_info zed_right_camera_frame_optical rect-right
        /zed/zed_node/right/color/rect/image/camera_info zed_right_camera_frame_optical rect-right
        /zed/zed_node/right/color/rect/image zed_right_camera_frame_optical right bgra8
        /zed/zed_node/left/gray/rect/camera_info zed_left_camera_frame_optical rect
        /zed/zed_node/left/gray/rect/image/camera_info zed_left_camera_frame_optical rect
        /zed/zed_node/left/gray/rect/image zed_left_camera_frame_optical left mono8
        /zed/zed_node/right/gray/rect/camera_info zed_right_camera_frame_optical rect-right
        /zed/zed_node/right/gray/rect/image/camera_info zed_right_camera_frame_optical rect-right
        /zed/zed_node/right/gray/rect/image zed_right_camera_frame_optical right mono8
        /zed/zed_node/left/color/raw/camera_info zed_left_camera_frame_optical rational
        /zed/zed_node/left/color/raw/image/camera_info zed_left_camera_frame_optical rational
        /zed/zed_node/left/color/raw/image zed_left_camera_frame_optical left bgra8
        /zed/zed_node/right/color/raw/camera_info zed_right_camera_frame_optical own-right
        /zed/zed_node/right/color/raw/image/camera_info zed_right_camera_frame_optical own-right
        /zed/zed_node/right/color/raw/image zed_right_camera_frame_optical right bgra8
        /zed/zed_node/left/gray/raw/camera_info zed_left_camera_frame_optical rational
        /zed/zed_node/left/gray/raw/image/camera_info zed_left_camera_frame_optical rational
        /zed/zed_node/left/gray/raw/image zed_left_camera_frame_optical left mono8
        /zed/zed_node/right/gray/raw/camera_info zed_right_camera_frame_optical own-right
        /zed/zed_node/right/gray/raw/image/camera_info zed_right_camera_frame_optical own-right
        /zed/zed_node/right/gray/raw/image zed_right_camera_frame_optical right mono8
        /zed/zed_node/rgb/color/rect/image zed_left_camera_frame_optical left bgra8
        /zed/zed_node/depth/camera_info zed_left_camera_frame_optical rect
        /zed/zed_node/depth/depth_registered/camera_info zed_left_camera_frame_optical rect
        /zed/zed_node/depth/depth_registered zed_left_camera_frame_optical depth 32FC1
        /zed/zed_node/confidence/confidence_map zed_left_camera_frame_optical depth 32FC1",
    transforms: "
        zed_camera_center zed_left_camera_frame 0 0.05 0 parallel
        zed_left_camera_frame zed_left_camera_frame_optical 0 0 0 optical
        zed_camera_center zed_right_camera_frame 0 -0.05 0 parallel
        zed_right_camera_frame zed_right_camera_frame_optical 0 0 0 optical",
    transforms_after: 2,
    ..UNPLACED
};

/// Bumblebee 2 and XB3: pointgrey_camera_driver cc88014 (ROS 1), topics, frames (one for both) and
/// order in pointgrey_camera_driver/src/stereo_nodelet.cpp.
pub(super) const BUMBLEBEE: DriverBag = DriverBag {
    pair: "
        /camera/left/image_raw camera left bayer_gbrg8
        /camera/left/camera_info camera raw
        /camera/right/image_raw camera right bayer_gbrg8
        /camera/right/camera_info camera raw-right",
    ..UNPLACED
};

/// FLIR cameras on one trigger: flir_camera_driver d417363, topics of
/// spinnaker_synchronized_camera_driver/launch/synchronized_driver_node.launch.py, frames (the
/// node's name for both) and order in spinnaker_camera_driver/src/camera.cpp.
pub(super) const FLIR: DriverBag = DriverBag {
    pair: "
        /cam_sync/cam_1/image_raw cam_sync right bayer_rggb8
        /cam_sync/cam_1/camera_info cam_sync raw-right
        /cam_sync/cam_1/meta frame other flir_camera_msgs/msg/ImageMetaData
        /cam_sync/cam_0/image_raw cam_sync left bayer_rggb8
        /cam_sync/cam_0/camera_info cam_sync raw
        /cam_sync/cam_0/meta frame other flir_camera_msgs/msg/ImageMetaData",
    ..UNPLACED
};

/// Argus: isaac_ros_argus_camera ec75c57, topics and frames in
/// isaac_ros_argus_camera/src/argus_camera_stereo_node.cpp, `ArgusStereoCameraInfoCallback`
/// (transforms, with the first camera_info) in argus_camera_node.cpp; nv12 by `nitros_image.cpp` of
/// isaac_ros_nitros 4fbeb11.
pub(super) const ARGUS: DriverBag = DriverBag {
    pair: "
        /left/image_raw stereo_camera_left_optical left nv12
        /right/image_raw stereo_camera_right_optical right nv12
        /left/camera_info stereo_camera_left_optical rational
        /right/camera_info stereo_camera_right_optical rational-right",
    transforms: "
        stereo_camera stereo_camera_left 0 0.05 0 parallel
        stereo_camera_left stereo_camera_left_optical 0 0 0 optical
        stereo_camera stereo_camera_right 0 -0.05 0 parallel
        stereo_camera_right stereo_camera_right_optical 0 0 0 optical",
    transforms_after: 3,
    ..UNPLACED
};

/// Isaac ROS's rectified images beside the raw ones, which are of twice the size: topics of
/// isaac_ros_argus_camera/launch/isaac_ros_argus_camera_depth_core.launch.py, ec75c57, whose
/// `camera_info_rect` is that of `image_rect`.
pub(super) const ISAAC_RECTIFIED: DriverBag = DriverBag {
    pair: "
        /left/image_raw stereo_camera_left_optical left rgb8
        /left/camera_info stereo_camera_left_optical twice
        /right/image_raw stereo_camera_right_optical right rgb8
        /right/camera_info stereo_camera_right_optical twice-right
        /left/image_rect stereo_camera_left_optical left rgb8
        /right/image_rect stereo_camera_right_optical right rgb8
        /left/camera_info_rect stereo_camera_left_optical rect
        /right/camera_info_rect stereo_camera_right_optical rect-right",
    ..ARGUS
};

/// Isaac ROS's encoder: isaac_ros_compression a12267f, `image_compressed` in
/// isaac_ros_h264_encoder/launch; its messages are CompressedImage of format `h264` by
/// `nitros_compressed_image.cpp` of isaac_ros_nitros 4fbeb11.
pub(super) const ISAAC_H264: DriverBag = DriverBag {
    pair: "
        /front_stereo_camera/left/image_compressed front_stereo_camera_left_optical left h264
        /front_stereo_camera/right/image_compressed front_stereo_camera_right_optical right h264
        /front_stereo_camera/left/camera_info front_stereo_camera_left_optical rational
        /front_stereo_camera/right/camera_info front_stereo_camera_right_optical rational-right",
    ..UNPLACED
};

/// Azure Kinect beside a rectified pair: Azure_Kinect_ROS_Driver 6ffb95a (humble), topics and order
/// in src/k4a_ros_device.cpp, frames and transforms in src/k4a_calibration_transform_data.cpp. Who
/// mounts it publishes its place.
pub(super) const AZURE_KINECT: DriverBag = DriverBag {
    pair: "
        /stereo/left/image_rect stereo_left_optical left mono8
        /stereo/right/image_rect stereo_right_optical right mono8
        /stereo/left/camera_info stereo_left_optical rect
        /stereo/right/camera_info stereo_right_optical rect-right
        /ir/image_raw depth_camera_link left mono16
        /ir/camera_info depth_camera_link rational
        /depth/image_raw depth_camera_link depth 16UC1
        /depth/camera_info depth_camera_link rational
        /depth_to_rgb/image_raw rgb_camera_link depth 16UC1
        /depth_to_rgb/camera_info rgb_camera_link rational
        /rgb/image_raw rgb_camera_link left bgra8
        /rgb/camera_info rgb_camera_link rational
        /points2 depth_camera_link points",
    transforms: "
        camera_base depth_camera_link 0 0 0 optical
        depth_camera_link rgb_camera_link -0.032 -0.002 0.004 parallel
        rig stereo_left_optical 0 0 0 optical
        rig camera_base 0 -0.02 0.04 parallel",
    transforms_after: 2,
    ..UNPLACED
};

/// EuRoC's rig: topics of its ROS 1 bags (Burri et al., IJRR 2016, and the data set's page): no
/// camera_info.
pub(super) const EUROC: DriverBag = DriverBag {
    pair: "
        /cam0/image_raw cam0 left mono8
        /cam1/image_raw cam1 right mono8",
    ..UNPLACED
};

/// Two webcams, free-running: usb_cam 772b25f, config/params_1.yaml and params_2.yaml (frames,
/// pixels), src/usb_cam_node.cpp (order, the camera_info of a camera without a calibration).
pub(super) const WEBCAMS: DriverBag = DriverBag {
    pair: "
        /camera1/image_raw camera left rgb8
        /camera1/camera_info camera uncalibrated
        /camera2/image_raw camera2 right+8 rgb8
        /camera2/camera_info camera2 uncalibrated+8",
    ..UNPLACED
};

/// GMSL cameras: ros2_v4l2_camera 1029edd, src/v4l2_camera.cpp (order, one camera_info each, of a
/// single camera) and src/v4l2_camera_device.cpp (UYVY is yuv422). The rig's description has the
/// baseline.
pub(super) const GMSL: DriverBag = DriverBag {
    pair: "
        /camera/left/image_raw camera_left_optical left yuv422
        /camera/left/camera_info camera_left_optical raw
        /camera/right/image_raw camera_right_optical right yuv422
        /camera/right/camera_info camera_right_optical raw",
    transforms: "
        base_link camera_left_optical 0 0.1 0 optical
        base_link camera_right_optical 0 0 0 optical",
    transforms_after: 4,
    ..UNPLACED
};
