//! Planes of 32-bit floats as sensor_msgs/msg/Image 32FC1 in ROS 2 CDR, which Rerun shows as depth images.

use super::ros::{self, CDR_LE};
use super::{Encoded, Stamp};
use crate::stereo::Plane;
use re_cdr::{CdrWriter, LittleEndian};
use std::borrow::Cow;

const SCHEMA: &str = "sensor_msgs/msg/Image";
const DEFINITION: &str = "\
std_msgs/Header header # Header timestamp should be acquisition time of image
uint32 height # image height, that is, number of rows
uint32 width # image width, that is, number of columns
string encoding # Encoding of pixels -- channel meaning, ordering, size
uint8 is_bigendian # is this data bigendian?
uint32 step # Full row length in bytes
uint8[] data # actual matrix data, size is (step * rows)
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";

/// `frame_id` places depth in the world; anything else has none, lest a viewer take it for metres.
pub(super) fn encode(plane: &Plane<f32>, stamp: Stamp, frame_id: &str) -> Encoded {
    let (width, height) = plane.size();
    // Sides of a plane are at most MAX_SIDE, so sizes in bytes fit 32 bits.
    let bytes = (width * height * 4) as u32;
    let mut data = Vec::with_capacity(bytes as usize + 96);
    data.extend_from_slice(&CDR_LE);
    let mut cdr = CdrWriter::<LittleEndian>::new(&mut data);
    let (seconds, nanoseconds) = stamp.parts();
    cdr.write_u32(seconds);
    cdr.write_u32(nanoseconds);
    cdr.write_string(frame_id);
    cdr.write_u32(height as u32);
    cdr.write_u32(width as u32);
    cdr.write_string("32FC1");
    cdr.write_u8(0);
    cdr.write_u32(width as u32 * 4);
    cdr.write_u32(bytes);
    for row in plane.rows() {
        data.extend(row.iter().flat_map(|value| value.to_le_bytes()));
    }
    let definition = Cow::Borrowed(DEFINITION.as_bytes());
    Encoded { schema: SCHEMA, schema_encoding: "ros2msg", definition, encoding: "cdr", data }
}

/// The plane in a message of `schema`, or why there is none.
pub(super) fn decode(schema: &str, data: &[u8]) -> Result<Plane<f32>, String> {
    if schema != SCHEMA {
        return Err(format!("it is a {schema}, svl reads {SCHEMA}"));
    }
    let image = ros::read(data, ros::image)?;
    if image.encoding != "32FC1" || image.big_endian {
        return Err(format!("its pixels are '{}', svl reads little-endian 32FC1", image.encoding));
    }
    let row_bytes = image.width as usize * 4;
    let (step, height) = (image.step as usize, image.height as usize);
    if image.width == 0 || step < row_bytes || image.data.len() < step.saturating_mul(height) {
        let (width, got) = (image.width, image.data.len());
        return Err(format!("a {width}x{height} 32FC1 image with rows of {step} bytes does not fit its {got} bytes"));
    }
    let rows = image.data.chunks_exact(step).take(height);
    let floats = rows.flat_map(|row| row[..row_bytes].as_chunks::<4>().0).map(|&b| f32::from_le_bytes(b)).collect();
    Plane::from_vec(image.width as usize, height, floats).map_err(|e| e.to_string())
}
