//! Encodes ROS 2 messages as CDR, with the definitions that allow reading a bag without ROS.

use super::message::CdrWriter;
use crate::message::images;
use crate::message::wire::{Encoded, RosStamp, frame_id};
use std::borrow::Cow;
use svl_core::stereo::{Plane, Pose, Rig, Side};

/// A sensor_msgs/msg/Image of grey pixels.
pub(crate) fn encode_8bit<P: images::Pixel>(
    image: &Plane<P>,
    stamp: RosStamp,
    frame_id: &str,
) -> Encoded {
    encode_image(
        image.size(),
        P::ENCODING,
        &images::pixels(image),
        stamp,
        frame_id,
    )
}

/// A sensor_msgs/msg/Image of 32-bit floats. If `frame_id` is a known frame, Rerun shows it as a
/// depth image in metres.
pub(crate) fn encode_32fc1(plane: &Plane<f32>, stamp: RosStamp, frame_id: &str) -> Encoded {
    let pixels: Vec<u8> = plane
        .rows()
        .flatten()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    encode_image(plane.size(), "32FC1", &pixels, stamp, frame_id)
}

fn encode_image(
    size: (usize, usize),
    encoding: &str,
    pixels: &[u8],
    stamp: RosStamp,
    frame_id: &str,
) -> Encoded {
    encode(
        "sensor_msgs/msg/Image",
        include_str!("Image.msg"),
        pixels.len(),
        |cdr| {
            header_fields(cdr, stamp, frame_id);
            image_fields(cdr, size, encoding, pixels);
        },
    )
}

/// The fields of a sensor_msgs/msg/Image after its header.
pub(crate) fn image_fields(
    cdr: &mut CdrWriter,
    (width, height): (usize, usize),
    encoding: &str,
    pixels: &[u8],
) {
    // Sides of a plane are 1 ..= MAX_SIDE, so sizes in bytes fit 32 bits.
    cdr.u32(height as u32);
    cdr.u32(width as u32);
    cdr.str(encoding);
    cdr.u8(0);
    cdr.u32((pixels.len() / height) as u32);
    cdr.bytes(pixels);
}

/// A sensor_msgs/msg/CompressedImage of pixels in that encoding, with the format string of
/// image_transport.
pub(crate) fn encode_png(png: &[u8], encoding: &str, stamp: RosStamp, frame_id: &str) -> Encoded {
    let body = |cdr: &mut CdrWriter| {
        header_fields(cdr, stamp, frame_id);
        cdr.str(&format!("{encoding}; png compressed "));
        cdr.bytes(png);
    };
    encode(
        "sensor_msgs/msg/CompressedImage",
        include_str!("CompressedImage.msg"),
        png.len(),
        body,
    )
}

/// The sensor_msgs/msg/CameraInfo of a rectified camera. Both are in the frame of the left one, as
/// ROS's stereo tools require: P contains the offset of the right one.
pub(crate) fn encode_camera_info(
    rig: &Rig,
    (width, height): (usize, usize),
    camera: Side,
    stamp: RosStamp,
) -> Encoded {
    let body = |cdr: &mut CdrWriter| {
        header_fields(cdr, stamp, frame_id(Side::Left));
        cdr.u32(height as u32);
        cdr.u32(width as u32);
        cdr.str("plumb_bob");
        cdr.length(5);
        let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        // Row-major in the message, column-major in nalgebra.
        let k = rig.intrinsics(camera).transpose();
        let p = rig.projection(camera).transpose();
        [0.0; 5]
            .iter()
            .chain(k.as_slice())
            .chain(&identity)
            .chain(p.as_slice())
            .for_each(|&v| cdr.f64(v));
        // No binning and no region of interest.
        (0..6).for_each(|_| cdr.u32(0));
        cdr.u8(0);
    };
    encode(
        "sensor_msgs/msg/CameraInfo",
        include_str!("CameraInfo.msg"),
        256,
        body,
    )
}

/// A tf2_msgs/msg/TFMessage: the poses of children in the frames of parents, `[parent, child]`.
pub(crate) fn encode_transforms(transforms: &[(Pose, [&str; 2])], stamp: RosStamp) -> Encoded {
    let body = |cdr: &mut CdrWriter| {
        cdr.length(transforms.len());
        for (pose, [parent, child]) in transforms {
            let (t, q) = (pose.translation.vector, pose.rotation.coords);
            header_fields(cdr, stamp, parent);
            cdr.str(child);
            [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
                .into_iter()
                .for_each(|v| cdr.f64(v));
        }
    };
    encode(
        "tf2_msgs/msg/TFMessage",
        include_str!("TFMessage.msg"),
        64,
        body,
    )
}

/// A std_msgs/msg/String.
pub(crate) fn encode_string(text: &str) -> Encoded {
    encode(
        "std_msgs/msg/String",
        include_str!("String.msg"),
        text.len(),
        |cdr| cdr.str(text),
    )
}

/// `bytes`: approximate length of the largest field.
pub(crate) fn encode(
    schema: &'static str,
    definition: &'static str,
    bytes: usize,
    body: impl FnOnce(&mut CdrWriter),
) -> Encoded {
    // 256 bytes for the headers and the fixed fields.
    let mut cdr = CdrWriter::with_capacity(bytes + 256);
    body(&mut cdr);
    Encoded {
        schema,
        schema_encoding: "ros2msg",
        definition: Cow::Borrowed(definition.as_bytes()),
        encoding: "cdr",
        data: cdr.finish(),
    }
}

pub(crate) fn header_fields(cdr: &mut CdrWriter, stamp: RosStamp, frame_id: &str) {
    let (seconds, nanoseconds) = stamp.parts();
    // Stamps end before 2038, so the signed field stays positive.
    cdr.u32(seconds);
    cdr.u32(nanoseconds);
    cdr.str(frame_id);
}
