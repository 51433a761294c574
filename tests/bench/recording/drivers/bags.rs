//! The bag of each driver, by its published source, which each function names with its commit. Late
//! messages and extra topics are those of `ros2 bag record --all`.

use super::scene::{
    BASELINE_M, DEPTH_M, FOCAL_PX, Info, Link, OPTICAL, PAIRS, PARALLEL, RAW, RAW_RATIONAL,
    RECTIFIED, SIZE, UNCALIBRATED, depth, grey, image, image_at, other, stamp, tf_static,
};
use crate::recording::bag::{Message, png, ros_compressed_in};
use crate::recording::sensor::cloud_on;
use crate::recording::video::coded;
use svl::stereo::Gray;

/// The messages of all pairs, with static transforms after the pair of that number.
fn pairs(
    pair: impl Fn(u64) -> Vec<Message>,
    transforms_after: u64,
    links: &[Link],
) -> Vec<Message> {
    let mut messages = Vec::new();
    for i in 0..PAIRS {
        messages.extend(pair(i));
        if i == transforms_after && !links.is_empty() {
            messages.push(tf_static(i, links));
        }
    }
    messages
}

/// An image_transport copy of a grey image, as PNG.
fn compressed(topic: &'static str, frame: &str, (side, i): (usize, u64)) -> Message {
    let pixels: Vec<u8> = grey(side, i).pixels().collect();
    ros_compressed_in(
        frame,
        topic,
        stamp(i),
        "mono8; png compressed ",
        &png(SIZE, &pixels),
    )
}

/// RealSense: realsense-ros 775b167, `publishFrame` (each image before its camera_info),
/// `updateStreamCalibData` and `updateExtrinsicsCalibData` (P and the frame of infra2) in
/// realsense2_camera/src/base_realsense_node.cpp, `startPublishers` (topics) in
/// src/rs_node_setup.cpp.
pub(super) fn realsense() -> Vec<Message> {
    let [left, right] = ["camera_infra1_optical_frame", "camera_infra2_optical_frame"];
    let deep = "camera_depth_optical_frame";
    let pair = |i| {
        vec![
            image(
                "/camera/camera/infra1/image_rect_raw",
                left,
                (0, i),
                "mono8",
            ),
            compressed(
                "/camera/camera/infra1/image_rect_raw/compressed",
                left,
                (0, i),
            ),
            RECTIFIED.message("/camera/camera/infra1/camera_info", left, i),
            image(
                "/camera/camera/infra2/image_rect_raw",
                right,
                (1, i),
                "mono8",
            ),
            compressed(
                "/camera/camera/infra2/image_rect_raw/compressed",
                right,
                (1, i),
            ),
            // In the left camera's frame.
            RECTIFIED
                .right()
                .message("/camera/camera/infra2/camera_info", left, i),
            depth("/camera/camera/depth/image_rect_raw", deep, i, "16UC1"),
            RECTIFIED.message("/camera/camera/depth/camera_info", deep, i),
            image(
                "/camera/camera/color/image_raw",
                "camera_color_optical_frame",
                (0, i),
                "rgb8",
            ),
        ]
    };
    let mut messages = pairs(pair, 2, &realsense_links());
    let extrinsics = "realsense2_camera_msgs/msg/Extrinsics";
    messages.push(other(
        "/camera/camera/extrinsics/depth_to_infra1",
        extrinsics,
        3,
    ));
    messages
}

fn realsense_links() -> [Link; 6] {
    let [left, right] = ["camera_infra1_optical_frame", "camera_infra2_optical_frame"];
    let deep = "camera_depth_optical_frame";
    [
        ("camera_link", "camera_depth_frame", [0.0; 3], PARALLEL),
        ("camera_depth_frame", deep, [0.0; 3], OPTICAL),
        ("camera_link", "camera_infra1_frame", [0.0; 3], PARALLEL),
        ("camera_infra1_frame", left, [0.0; 3], OPTICAL),
        (
            "camera_link",
            "camera_infra2_frame",
            [0.0, -BASELINE_M, 0.0],
            PARALLEL,
        ),
        ("camera_infra2_frame", right, [0.0; 3], OPTICAL),
    ]
}

/// OAK-D: depthai-ros 9132443 (humble), topics and order in
/// depthai_ros_driver/src/dai_nodes/sensors/img_pub.cpp and stereo.cpp, camera_info in
/// `calibrationToCameraInfo` of depthai_bridge/src/ImageConverter.cpp, frames in TFPublisher.cpp.
///
/// The right P has the sign of DepthAI, whose first camera is the right one, unless
/// `i_reverse_stereo_socket_order` is set (depthai-ros issue 597).
pub(super) fn depthai() -> Vec<Message> {
    let [left, right] = [
        "oak_left_camera_optical_frame",
        "oak_right_camera_optical_frame",
    ];
    let colour = "oak_rgb_camera_optical_frame";
    let pair = |i| {
        vec![
            image("/oak/rgb/image_raw", colour, (0, i), "bgr8"),
            image("/oak/left/image_raw", left, (0, i), "mono8"),
            RAW_RATIONAL.message("/oak/left/camera_info", left, i),
            image("/oak/right/image_raw", right, (1, i), "mono8"),
            Info {
                tx: FOCAL_PX * BASELINE_M,
                ..RAW_RATIONAL
            }
            .message("/oak/right/camera_info", right, i),
            // Aligned to the colour camera.
            depth("/oak/stereo/image_raw", colour, i, "16UC1"),
            RECTIFIED.message("/oak/stereo/camera_info", colour, i),
        ]
    };
    let half = BASELINE_M / 2.0;
    let links = [
        ("oak", "oak_rgb_camera_frame", [0.0; 3], PARALLEL),
        ("oak_rgb_camera_frame", colour, [0.0; 3], OPTICAL),
        ("oak", "oak_left_camera_frame", [0.0, half, 0.0], PARALLEL),
        ("oak_left_camera_frame", left, [0.0; 3], OPTICAL),
        ("oak", "oak_right_camera_frame", [0.0, -half, 0.0], PARALLEL),
        ("oak_right_camera_frame", right, [0.0; 3], OPTICAL),
    ];
    pairs(pair, 1, &links)
}

/// ZED: zed-ros2-wrapper 33dfefa, `initVideoDepthPublishers` (topics), `publishImageWithInfo` (two
/// camera_info before each image) and `fillCamInfo` in
/// zed_components/src/zed_camera/src/zed_camera_component_video_depth.cpp, encodings in
/// src/tools/src/sl_tools.cpp, with `publish_raw` and `publish_gray`.
pub(super) fn zed() -> Vec<Message> {
    let [left, right] = [
        "zed_left_camera_frame_optical",
        "zed_right_camera_frame_optical",
    ];
    // The raw P of a camera are its own intrinsics: they do not rectify the pair.
    let raw = Info {
        focal_px: [FOCAL_PX - 1.0; 2],
        ..RAW_RATIONAL
    };
    let pair = |i| {
        let rectified = [RECTIFIED, RECTIFIED.right()];
        let raw = [RAW_RATIONAL, raw.right()];
        let topics = ZED_TOPICS.iter().zip([rectified, rectified, raw, raw]);
        let mut messages: Vec<_> = topics
            .flat_map(|((encoding, names), infos)| {
                let sides = names.iter().zip(infos).zip([left, right]).zip(0..);
                sides.flat_map(move |(((names, info), frame), side)| {
                    let [topic, beside, below] = *names;
                    [
                        info.message(beside, frame, i),
                        info.message(below, frame, i),
                        image(topic, frame, (side, i), encoding),
                    ]
                })
            })
            .collect();
        messages.extend([
            image("/zed/zed_node/rgb/color/rect/image", left, (0, i), "bgra8"),
            RECTIFIED.message("/zed/zed_node/depth/camera_info", left, i),
            RECTIFIED.message("/zed/zed_node/depth/depth_registered/camera_info", left, i),
            depth("/zed/zed_node/depth/depth_registered", left, i, "32FC1"),
            // Per cent, not metres.
            depth("/zed/zed_node/confidence/confidence_map", left, i, "32FC1"),
        ]);
        messages
    };
    let links = [
        (
            "zed_camera_center",
            "zed_left_camera_frame",
            [0.0, 0.05, 0.0],
            PARALLEL,
        ),
        ("zed_left_camera_frame", left, [0.0; 3], OPTICAL),
        (
            "zed_camera_center",
            "zed_right_camera_frame",
            [0.0, -0.05, 0.0],
            PARALLEL,
        ),
        ("zed_right_camera_frame", right, [0.0; 3], OPTICAL),
    ];
    pairs(pair, 2, &links)
}

/// Encodings of the kinds of ZED's images, and per camera the topics of the image and of its two
/// camera_info.
const ZED_TOPICS: [(&str, [[&str; 3]; 2]); 4] = [
    (
        "bgra8",
        [
            [
                "/zed/zed_node/left/color/rect/image",
                "/zed/zed_node/left/color/rect/camera_info",
                "/zed/zed_node/left/color/rect/image/camera_info",
            ],
            [
                "/zed/zed_node/right/color/rect/image",
                "/zed/zed_node/right/color/rect/camera_info",
                "/zed/zed_node/right/color/rect/image/camera_info",
            ],
        ],
    ),
    (
        "mono8",
        [
            [
                "/zed/zed_node/left/gray/rect/image",
                "/zed/zed_node/left/gray/rect/camera_info",
                "/zed/zed_node/left/gray/rect/image/camera_info",
            ],
            [
                "/zed/zed_node/right/gray/rect/image",
                "/zed/zed_node/right/gray/rect/camera_info",
                "/zed/zed_node/right/gray/rect/image/camera_info",
            ],
        ],
    ),
    (
        "bgra8",
        [
            [
                "/zed/zed_node/left/color/raw/image",
                "/zed/zed_node/left/color/raw/camera_info",
                "/zed/zed_node/left/color/raw/image/camera_info",
            ],
            [
                "/zed/zed_node/right/color/raw/image",
                "/zed/zed_node/right/color/raw/camera_info",
                "/zed/zed_node/right/color/raw/image/camera_info",
            ],
        ],
    ),
    (
        "mono8",
        [
            [
                "/zed/zed_node/left/gray/raw/image",
                "/zed/zed_node/left/gray/raw/camera_info",
                "/zed/zed_node/left/gray/raw/image/camera_info",
            ],
            [
                "/zed/zed_node/right/gray/raw/image",
                "/zed/zed_node/right/gray/raw/camera_info",
                "/zed/zed_node/right/gray/raw/image/camera_info",
            ],
        ],
    ),
];

/// Bumblebee 2 and XB3: pointgrey_camera_driver cc88014 (ROS 1), topics, frames (one for both) and
/// order in pointgrey_camera_driver/src/stereo_nodelet.cpp.
pub(super) fn bumblebee() -> Vec<Message> {
    let pair = |i| {
        vec![
            image("/camera/left/image_raw", "camera", (0, i), "bayer_gbrg8"),
            RAW.message("/camera/left/camera_info", "camera", i),
            image("/camera/right/image_raw", "camera", (1, i), "bayer_gbrg8"),
            RAW.right()
                .message("/camera/right/camera_info", "camera", i),
        ]
    };
    pairs(pair, 0, &[])
}

/// FLIR cameras on one trigger: flir_camera_driver d417363, topics of
/// spinnaker_synchronized_camera_driver/launch/synchronized_driver_node.launch.py, frames (the
/// node's name for both) and order in spinnaker_camera_driver/src/camera.cpp.
pub(super) fn flir() -> Vec<Message> {
    let meta = "flir_camera_msgs/msg/ImageMetaData";
    let pair = |i| {
        vec![
            image(
                "/cam_sync/cam_1/image_raw",
                "cam_sync",
                (1, i),
                "bayer_rggb8",
            ),
            RAW.right()
                .message("/cam_sync/cam_1/camera_info", "cam_sync", i),
            other("/cam_sync/cam_1/meta", meta, i),
            image(
                "/cam_sync/cam_0/image_raw",
                "cam_sync",
                (0, i),
                "bayer_rggb8",
            ),
            RAW.message("/cam_sync/cam_0/camera_info", "cam_sync", i),
            other("/cam_sync/cam_0/meta", meta, i),
        ]
    };
    pairs(pair, 0, &[])
}

const ARGUS_FRAMES: [&str; 2] = ["stereo_camera_left_optical", "stereo_camera_right_optical"];

/// Transforms that the Argus node publishes with its first camera_info.
fn argus_links() -> [Link; 4] {
    let [left, right] = ARGUS_FRAMES;
    [
        (
            "stereo_camera",
            "stereo_camera_left",
            [0.0, 0.05, 0.0],
            PARALLEL,
        ),
        ("stereo_camera_left", left, [0.0; 3], OPTICAL),
        (
            "stereo_camera",
            "stereo_camera_right",
            [0.0, -0.05, 0.0],
            PARALLEL,
        ),
        ("stereo_camera_right", right, [0.0; 3], OPTICAL),
    ]
}

/// Argus: isaac_ros_argus_camera ec75c57, topics and frames in
/// isaac_ros_argus_camera/src/argus_camera_stereo_node.cpp, `ArgusStereoCameraInfoCallback`
/// (transforms) in argus_camera_node.cpp; nv12 by `nitros_image.cpp` of isaac_ros_nitros 4fbeb11.
pub(super) fn argus() -> Vec<Message> {
    let [left, right] = ARGUS_FRAMES;
    let pair = |i| {
        vec![
            image("/left/image_raw", left, (0, i), "nv12"),
            image("/right/image_raw", right, (1, i), "nv12"),
            RAW_RATIONAL.message("/left/camera_info", left, i),
            RAW_RATIONAL.right().message("/right/camera_info", right, i),
        ]
    };
    pairs(pair, 3, &argus_links())
}

/// Isaac ROS's rectified images beside the raw ones: topics of
/// isaac_ros_argus_camera/launch/isaac_ros_argus_camera_depth_core.launch.py, ec75c57, whose
/// `camera_info_rect` is that of `image_rect`.
pub(super) fn isaac_rectified() -> Vec<Message> {
    let [left, right] = ARGUS_FRAMES;
    // The raw images are of twice the size.
    let whole = Info {
        size: (2 * SIZE.0, 2 * SIZE.1),
        focal_px: [2.0 * FOCAL_PX; 2],
        r: turned(0.01),
        ..RAW_RATIONAL
    };
    let pair = |i| {
        vec![
            image("/left/image_raw", left, (0, i), "rgb8"),
            whole.message("/left/camera_info", left, i),
            image("/right/image_raw", right, (1, i), "rgb8"),
            whole.right().message("/right/camera_info", right, i),
            image("/left/image_rect", left, (0, i), "rgb8"),
            image("/right/image_rect", right, (1, i), "rgb8"),
            RECTIFIED.message("/left/camera_info_rect", left, i),
            RECTIFIED
                .right()
                .message("/right/camera_info_rect", right, i),
        ]
    };
    pairs(pair, 3, &argus_links())
}

/// A rotation about y, radians.
fn turned(angle: f64) -> [f64; 9] {
    let (sin, cos) = angle.sin_cos();
    [cos, 0.0, sin, 0.0, 1.0, 0.0, -sin, 0.0, cos]
}

/// Isaac ROS's encoder: isaac_ros_compression a12267f, `image_compressed` in
/// isaac_ros_h264_encoder/launch; its messages are CompressedImage of format `h264` by
/// `nitros_compressed_image.cpp` of isaac_ros_nitros 4fbeb11.
pub(super) fn isaac_h264() -> Vec<Message> {
    let [left, right] = [
        "front_stereo_camera_left_optical",
        "front_stereo_camera_right_optical",
    ];
    let video = |side| {
        let images: Vec<Gray> = (0..PAIRS).map(|i| grey(side, i)).collect();
        coded(SIZE, "h264", &images, 0)
    };
    let videos = [video(0), video(1)];
    let pair = |i: u64| {
        let [lefts, rights] = &videos;
        let coded = |topic, frame, pictures: &[Vec<u8>]| {
            ros_compressed_in(frame, topic, stamp(i), "h264", &pictures[i as usize])
        };
        vec![
            coded("/front_stereo_camera/left/image_compressed", left, lefts),
            coded("/front_stereo_camera/right/image_compressed", right, rights),
            RAW_RATIONAL.message("/front_stereo_camera/left/camera_info", left, i),
            RAW_RATIONAL
                .right()
                .message("/front_stereo_camera/right/camera_info", right, i),
        ]
    };
    pairs(pair, 0, &[])
}

/// Azure Kinect beside a rectified pair: Azure_Kinect_ROS_Driver 6ffb95a (humble), topics and order
/// in src/k4a_ros_device.cpp, frames and transforms in src/k4a_calibration_transform_data.cpp. Who
/// mounts it publishes its place.
pub(super) fn azure_kinect() -> Vec<Message> {
    let [left, right] = ["stereo_left_optical", "stereo_right_optical"];
    let [deep, colour] = ["depth_camera_link", "rgb_camera_link"];
    let points: Vec<_> = (0..40)
        .flat_map(|y| (0..40).map(move |x| [x as f32 / 20.0 - 1.0, y as f32 / 20.0 - 1.0]))
        .map(|[x, y]| [x, y, DEPTH_M as f32])
        .collect();
    let pair = |i| {
        vec![
            image("/stereo/left/image_rect", left, (0, i), "mono8"),
            image("/stereo/right/image_rect", right, (1, i), "mono8"),
            RECTIFIED.message("/stereo/left/camera_info", left, i),
            RECTIFIED
                .right()
                .message("/stereo/right/camera_info", right, i),
            image("/ir/image_raw", deep, (0, i), "mono16"),
            RAW_RATIONAL.message("/ir/camera_info", deep, i),
            depth("/depth/image_raw", deep, i, "16UC1"),
            RAW_RATIONAL.message("/depth/camera_info", deep, i),
            depth("/depth_to_rgb/image_raw", colour, i, "16UC1"),
            RAW_RATIONAL.message("/depth_to_rgb/camera_info", colour, i),
            image("/rgb/image_raw", colour, (0, i), "bgra8"),
            RAW_RATIONAL.message("/rgb/camera_info", colour, i),
            cloud_on("/points2", deep, stamp(i), &points),
        ]
    };
    let links = [
        ("camera_base", deep, [0.0; 3], OPTICAL),
        (deep, colour, [-0.032, -0.002, 0.004], PARALLEL),
        ("rig", left, [0.0; 3], OPTICAL),
        ("rig", "camera_base", [0.0, -0.02, 0.04], PARALLEL),
    ];
    pairs(pair, 2, &links)
}

/// EuRoC's rig: topics of its ROS 1 bags (Burri et al., IJRR 2016, and the data set's page): no
/// camera_info.
pub(super) fn euroc() -> Vec<Message> {
    let pair = |i| {
        vec![
            image("/cam0/image_raw", "cam0", (0, i), "mono8"),
            image("/cam1/image_raw", "cam1", (1, i), "mono8"),
        ]
    };
    pairs(pair, 0, &[])
}

/// Two webcams, free-running: usb_cam 772b25f, config/params_1.yaml and params_2.yaml (frames,
/// pixels), src/usb_cam_node.cpp (order, the camera_info of a camera without a calibration).
pub(super) fn webcams() -> Vec<Message> {
    let pair = |i| {
        let late_ns = stamp(i) + 8_000_000;
        vec![
            image("/camera1/image_raw", "camera", (0, i), "rgb8"),
            UNCALIBRATED.message("/camera1/camera_info", "camera", i),
            image_at("/camera2/image_raw", "camera2", (1, i), "rgb8", late_ns),
            UNCALIBRATED.message_at("/camera2/camera_info", "camera2", late_ns),
        ]
    };
    pairs(pair, 0, &[])
}

/// GMSL cameras: ros2_v4l2_camera 1029edd, src/v4l2_camera.cpp (order, one camera_info each, of a
/// single camera) and src/v4l2_camera_device.cpp (UYVY is yuv422). The rig's description has the
/// baseline.
pub(super) fn gmsl() -> Vec<Message> {
    let [left, right] = ["camera_left_optical", "camera_right_optical"];
    let pair = |i| {
        vec![
            image("/camera/left/image_raw", left, (0, i), "yuv422"),
            RAW.message("/camera/left/camera_info", left, i),
            image("/camera/right/image_raw", right, (1, i), "yuv422"),
            RAW.message("/camera/right/camera_info", right, i),
        ]
    };
    let links = [
        ("base_link", left, [0.0, BASELINE_M, 0.0], OPTICAL),
        ("base_link", right, [0.0; 3], OPTICAL),
    ];
    pairs(pair, 4, &links)
}
