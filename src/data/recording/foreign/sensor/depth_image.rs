//! Depth images (REP 118): 16UC1 in millimetres, 32FC1 in metres, raw or as compressedDepth, and
//! disparity images.

use crate::files;
use crate::recording::messages::Channel;
use crate::recording::ros::RawPixels;
use crate::recording::{decode_protobuf, ros};
use foxglove::messages::RawImage;
use svl_core::stereo::Plane;

/// Bytes before the PNG of compressedDepth: a code, and two quantization parameters.
const COMPRESSED_HEADER: usize = 12;

/// Depths in metres; NaN for invalid pixels. 0 is invalid (REP 118), and so is anything too far
/// (REP 117).
pub(super) fn ros_image(channel: &Channel, data: &[u8]) -> Result<Plane<f32>, String> {
    depths(&ros::read(channel, data, ros::image)?.1)
}

pub(super) fn foxglove_image(_: &Channel, data: &[u8]) -> Result<Plane<f32>, String> {
    let image: RawImage = decode_protobuf(data)?;
    depths(&RawPixels {
        width: image.width,
        height: image.height,
        step: image.step,
        encoding: &image.encoding,
        big_endian: false,
        data: &image.data,
    })
}

/// compressed_depth_image_transport: `16UC1; compressedDepth png`, and quantized inverse depths for
/// `32FC1`.
pub(super) fn compressed(channel: &Channel, data: &[u8]) -> Result<Plane<f32>, String> {
    let message = ros::read(channel, data, ros::compressed_image)?;
    let format = message.format;
    let words: Vec<_> = format
        .split([';', ' '])
        .filter(|word| !word.is_empty())
        .collect();
    let (encoding, rest) = words.split_first().unwrap_or((&"", &[]));
    if rest.first() != Some(&"compressedDepth") || rest.contains(&"rvl") {
        return Err(format!(
            "it is compressed as '{format}', svl reads compressedDepth in PNG"
        ));
    }
    let (header, png) = message
        .data
        .split_at_checked(COMPRESSED_HEADER)
        .ok_or("it is shorter than its header")?;
    let image = files::decode_bytes(png).map_err(|e| format!("its PNG cannot be read: {e}"))?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let samples = match image {
        image::DynamicImage::ImageLuma16(samples) => samples.into_raw(),
        _ => return Err("its PNG is not of one channel of 16 bits".to_owned()),
    };
    let number = |at: usize| {
        let bytes = header[at..].first_chunk::<4>().copied().unwrap_or_default();
        f32::from_le_bytes(bytes)
    };
    let (a, b) = (number(4), number(8));
    let depth = |sample: u16| match (*encoding, sample) {
        (_, 0) => f32::NAN,
        ("16UC1", millimetres) => f32::from(millimetres) / 1000.0,
        (_, step) => a / (f32::from(step) - b),
    };
    if !["16UC1", "32FC1"].contains(encoding) {
        return Err(unread(encoding));
    }
    let depths = samples.into_iter().map(depth).map(known).collect();
    Plane::from_vec(width, height, depths).map_err(|e| e.to_string())
}

/// stereo_msgs/DisparityImage: depths by its own focal length and baseline. Disparities below its
/// smallest one are invalid.
pub(super) fn disparity_image(channel: &Channel, data: &[u8]) -> Result<Plane<f32>, String> {
    let message = ros::read(channel, data, ros::disparity_image)?;
    if message.image.encoding != "32FC1" {
        let encoding = message.image.encoding;
        return Err(format!(
            "its pixels are '{encoding}'; disparities are 32FC1"
        ));
    }
    let (scale, min) = (message.focal_px * message.baseline_m, message.min_disparity);
    if !(scale > 0.0 && scale.is_finite()) {
        return Err("it has no focal length or no baseline".to_owned());
    }
    // Those of invalid pixels are 0 or less, which `depths` makes NaN too.
    let disparities = depths(&message.image)?;
    Ok(disparities.map(|d| if d < min { f32::NAN } else { known(scale / d) }))
}

fn depths(image: &RawPixels<'_>) -> Result<Plane<f32>, String> {
    let bytes = match image.encoding {
        "16UC1" | "mono16" => 2,
        "32FC1" => 4,
        other => return Err(unread(other)),
    };
    let (width, height, step) = (
        image.width as usize,
        image.height as usize,
        image.step as usize,
    );
    let row_bytes = width.saturating_mul(bytes);
    let rows = files::strided_rows(image.data, row_bytes, height, step).map_err(|_| {
        let (encoding, got) = (image.encoding, image.data.len());
        format!(
            "a {width}x{height} {encoding} image with rows of {step} bytes does not fit its {got} \
             bytes"
        )
    })?;
    let big_endian = image.big_endian;
    let depth = |sample: &[u8]| match *sample {
        [a, b] => {
            let millimetres = if big_endian {
                u16::from_be_bytes([a, b])
            } else {
                u16::from_le_bytes([a, b])
            };
            f32::from(millimetres) / 1000.0
        }
        [a, b, c, d] if big_endian => f32::from_be_bytes([a, b, c, d]),
        [a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
        _ => f32::NAN,
    };
    let depths = rows
        .flat_map(|row| row.chunks_exact(bytes))
        .map(depth)
        .map(known);
    Plane::from_vec(width, height, depths.collect()).map_err(|e| e.to_string())
}

/// The depth if it is valid.
fn known(depth: f32) -> f32 {
    if depth > 0.0 && depth.is_finite() {
        depth
    } else {
        f32::NAN
    }
}

fn unread(encoding: &str) -> String {
    format!("its pixels are '{encoding}'; depths are 16UC1 in millimetres or 32FC1 in metres")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(encoding: &str, big_endian: bool, data: &[u8]) -> Result<Vec<f32>, String> {
        let (width, step) = (2, data.len() as u32);
        let image = RawPixels {
            width,
            height: 1,
            step,
            encoding,
            big_endian,
            data,
        };
        depths(&image).map(|depths| depths.pixels().collect())
    }

    #[test]
    fn millimetres_and_metres() {
        assert_eq!(read("16UC1", false, &[0xE8, 3, 1, 0]), Ok(vec![1.0, 0.001]));
        assert_eq!(read("16UC1", true, &[3, 0xE8, 0, 1]), Ok(vec![1.0, 0.001]));
        let floats = |values: [f32; 2]| values.map(f32::to_le_bytes).concat();
        assert_eq!(
            read("32FC1", false, &floats([0.5, 2.0])),
            Ok(vec![0.5, 2.0])
        );
        for none in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let read = read("32FC1", false, &floats([none, 2.0])).unwrap();
            assert!(read[0].is_nan() && read[1] == 2.0, "{none}");
        }
        assert!(
            read("16UC1", false, &[0, 0, 0, 0])
                .unwrap()
                .iter()
                .all(|z| z.is_nan())
        );
        assert!(
            read("16UC1", false, &[0, 0, 0])
                .unwrap_err()
                .contains("does not fit")
        );
        assert!(read("mono8", false, &[0, 0]).unwrap_err().contains("16UC1"));
    }
}
