//! Planes of 32-bit floats out of sensor_msgs/msg/Image 32FC1.

use super::ros;
use crate::stereo::Plane;

const SCHEMA: &str = "sensor_msgs/msg/Image";

/// The plane in a message of `schema`, or why there is none.
pub(super) fn decode(schema: &str, data: &[u8]) -> Result<Plane<f32>, String> {
    if schema != SCHEMA {
        return Err(format!("it is a {schema}, svl reads {SCHEMA}"));
    }
    let image = ros::read(data, ros::image)?;
    if image.encoding != "32FC1" || image.big_endian {
        return Err(format!(
            "its pixels are '{}', svl reads little-endian 32FC1",
            image.encoding
        ));
    }
    let row_bytes = image.width as usize * 4;
    let (step, height) = (image.step as usize, image.height as usize);
    if image.width == 0 || step < row_bytes || image.data.len() < step.saturating_mul(height) {
        let (width, got) = (image.width, image.data.len());
        return Err(format!(
            "a {width}x{height} 32FC1 image with rows of {step} bytes does not fit its {got} bytes"
        ));
    }
    let rows = image.data.chunks_exact(step).take(height);
    let floats = rows
        .flat_map(|row| row[..row_bytes].as_chunks::<4>().0)
        .map(|&b| f32::from_le_bytes(b))
        .collect();
    Plane::from_vec(image.width as usize, height, floats).map_err(|e| e.to_string())
}
