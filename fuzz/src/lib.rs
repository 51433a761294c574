//! What the targets share.

use std::cell::OnceCell;
use std::path::Path;
use tempfile::TempDir;

thread_local! {
    static FOLDER: OnceCell<TempDir> = const { OnceCell::new() };
}

/// Gives `read` a folder that stays the same from call to call, in memory where the system has a
/// place there.
///
/// # Panics
/// When there is no such folder.
pub fn in_folder(read: impl FnOnce(&Path)) {
    let make = || {
        tempfile::tempdir_in("/dev/shm")
            .or_else(|_| tempfile::tempdir())
            .expect("a folder")
    };
    FOLDER.with(|folder| read(folder.get_or_init(make).path()));
}

/// Gives `read` a file of these bytes.
///
/// # Panics
/// When it cannot be written.
pub fn on_file(name: &str, bytes: &[u8], read: impl FnOnce(&Path)) {
    in_folder(|folder| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).expect("a file");
        read(&path);
    });
}

/// Topics, schemas and encodings of the messages that svl reads.
pub const KINDS: [(&str, &str, &str); 35] = [
    ("/l", "sensor_msgs/msg/Image", "cdr"),
    ("/r", "sensor_msgs/msg/Image", "cdr"),
    ("/l", "sensor_msgs/msg/CompressedImage", "cdr"),
    ("/r", "sensor_msgs/msg/CompressedImage", "cdr"),
    ("/l", "foxglove.RawImage", "protobuf"),
    ("/r", "foxglove.RawImage", "protobuf"),
    ("/l", "foxglove.CompressedImage", "protobuf"),
    ("/l", "foxglove.RawImage", "json"),
    ("/r", "foxglove.CompressedImage", "json"),
    ("/info", "sensor_msgs/msg/CameraInfo", "cdr"),
    ("/info", "foxglove.CameraCalibration", "protobuf"),
    ("/info", "foxglove.CameraCalibration", "json"),
    ("/stereo/left/image", "foxglove.RawImage", "protobuf"),
    ("/stereo/right/image", "foxglove.RawImage", "protobuf"),
    (
        "/stereo/left/calibration",
        "foxglove.CameraCalibration",
        "protobuf",
    ),
    (
        "/stereo/right/calibration",
        "foxglove.CameraCalibration",
        "protobuf",
    ),
    ("/rig/pose", "foxglove.FrameTransform", "protobuf"),
    ("/truth/depth", "sensor_msgs/msg/Image", "cdr"),
    ("/truth/disparity", "sensor_msgs/msg/Image", "cdr"),
    ("/stereo/sync", "svl.StereoSync", "json"),
    ("/l", "sensor_msgs/Image", "ros1"),
    ("/r", "sensor_msgs/CompressedImage", "ros1"),
    ("/info", "sensor_msgs/CameraInfo", "ros1"),
    ("/tf_static", "tf2_msgs/TFMessage", "ros1"),
    (
        "/device_0/sensor_0/Infrared_1/camera_info",
        "std_msgs/msg/String",
        "cdr",
    ),
    (
        "/device_0/sensor_0/Infrared_1/tf/ref_0",
        "std_msgs/msg/String",
        "cdr",
    ),
    ("/l", "foxglove.CompressedVideo", "protobuf"),
    ("/l", "foxglove_msgs/msg/CompressedVideo", "cdr"),
    ("/r", "ffmpeg_image_transport_msgs/msg/FFMPEGPacket", "cdr"),
    ("/tf", "tf2_msgs/msg/TFMessage", "cdr"),
    ("/odom", "nav_msgs/msg/Odometry", "cdr"),
    ("/depth", "sensor_msgs/msg/Image", "cdr"),
    ("/depth/ros", "sensor_msgs/msg/CompressedImage", "cdr"),
    ("/depth/raw", "foxglove.RawImage", "protobuf"),
    ("/depth/packed", "foxglove.CompressedImage", "protobuf"),
];
