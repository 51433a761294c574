//! Depth images (REP 118): 16UC1 in millimetres, 32FC1 and 64FC1 in metres, raw or compressed, and
//! disparity images.

use crate::decode::encoding::{self, Samples, metres, values};
use crate::message::MessageError::{CodedDepths, Missing, Pixels, Unsuited};
use crate::message::ros::read::RawPixels;
use crate::message::wire::decode_protobuf;
use crate::message::{MessageResult, ros};
use crate::stream::channel::{Channel, warn_once};
use foxglove::messages::{CompressedImage, RawImage};
use image::DynamicImage;
use svl_core::stereo::Plane;
use svl_files::{self as files, InverseDepth, RVL_HEADER};

/// Depths in metres; NaN for invalid pixels, and for 0 (REP 118); `+∞` for what is too far (REP
/// 117).
pub(crate) fn ros_image(channel: &Channel, data: &[u8]) -> MessageResult<Plane<f32>> {
    let image = ros::read(channel, data, ros::image)?.1;
    let depths = depths(&image)?;
    warn_of_values(channel, &depths);
    Ok(depths)
}

/// Warns of depths that are likely none, and of images of ranges.
fn warn_of_values(channel: &Channel, depths: &Plane<f32>) {
    let topic = &channel.topic;
    let words = topic
        .rsplit('/')
        .next()
        .unwrap_or_default()
        .split(|c: char| !c.is_alphabetic());
    if words.into_iter().any(|word| word == "range") {
        warn_once(format!(
            "{topic}: is named a range image, of distances along the rays, and read as depths \
             along the axis, which are shorter beside the middle: publish depths"
        ));
    }
    if let Some(words) = files::no_depth(depths) {
        warn_once(format!("{topic}: {words}"));
    }
}

/// The samples of an image of 8 bits.
pub(crate) fn codes(channel: &Channel, data: &[u8]) -> MessageResult<Plane<f32>> {
    let (_, image) = ros::read(channel, data, ros::image)?;
    let (width, step) = (image.width as usize, image.step as usize);
    if image.encoding != "mono8" || step < width || width == 0 {
        return Err(Pixels(format!(
            "its images are {}, not mono8",
            image.encoding
        )));
    }
    let rows = image.data.chunks_exact(step).take(image.height as usize);
    let samples = rows.flat_map(|row| row[..width].iter().copied().map(f32::from));
    let plane = Plane::from_vec(width, image.height as usize, samples.collect());
    Ok(plane?)
}

pub(crate) fn foxglove_image(channel: &Channel, data: &[u8]) -> MessageResult<Plane<f32>> {
    let image: RawImage = decode_protobuf(data)?;
    let depths = depths(&RawPixels {
        width: image.width,
        height: image.height,
        step: image.step,
        encoding: &image.encoding,
        big_endian: false,
        data: &image.data,
    })?;
    warn_of_values(channel, &depths);
    Ok(depths)
}

pub(crate) fn ros_compressed(channel: &Channel, data: &[u8]) -> MessageResult<Plane<f32>> {
    let message = ros::read(channel, data, ros::compressed_image)?;
    compressed(channel, message.format, message.data)
}

pub(crate) fn foxglove_compressed(channel: &Channel, data: &[u8]) -> MessageResult<Plane<f32>> {
    let message: CompressedImage = decode_protobuf(data)?;
    compressed(channel, &message.format, &message.data)
}

fn compressed(channel: &Channel, format: &str, data: &[u8]) -> MessageResult<Plane<f32>> {
    let depths = decompress(format, data)?;
    warn_of_values(channel, &depths);
    Ok(depths)
}

/// Depths by the `format` of a CompressedImage:
/// - `16UC1; compressedDepth png`, or `rvl`, or neither for PNG: behind a header of 12 bytes, of
///   ROS's compressed_depth_image_transport. `32FC1` is quantized to inverse depths.
/// - `16UC1; png compressed`, or `png`: a PNG, of ROS's compressed_image_transport and others.
fn decompress(format: &str, data: &[u8]) -> MessageResult<Plane<f32>> {
    let words = format.split([';', ' ']).filter(|word| !word.is_empty());
    let words: Vec<_> = words.collect();
    let (encoding, is_rvl) = match words[..] {
        [encoding, "compressedDepth"] | [encoding, "compressedDepth", "png", ..] => {
            (encoding, Some(false))
        }
        [encoding, "compressedDepth", "rvl", ..] => (encoding, Some(true)),
        [encoding, "png", ..] => (encoding, None),
        ["png"] => ("16UC1", None),
        _ => {
            return Err(CodedDepths(format!(
                "it is compressed as '{format}'; depths are compressedDepth in PNG or RVL, or a \
                 PNG of 16 bits"
            )));
        }
    };
    let is_inverse = is_rvl.is_some() && encoding == "32FC1";
    let samples = encoding::named(encoding).map(|encoding| encoding.samples);
    if !is_inverse && samples != Some(Samples::Grey16) {
        return Err(encoding::why_no_depths(encoding));
    }
    let header = if is_rvl.is_some() { RVL_HEADER } else { 0 };
    let split = data.split_at_checked(header);
    let (header, packed) = split.ok_or(Missing("it is shorter than its header"))?;
    let codes = if is_rvl == Some(true) {
        files::decode_rvl(packed)
            .map_err(|e| CodedDepths(format!("its RVL cannot be read: {e}")))?
    } else {
        png(packed)?
    };
    if is_inverse {
        let inverse = InverseDepth::from_header(header);
        return Ok(codes.map(|code| known(inverse.depth(code))));
    }
    Ok(codes.map(|code| known(metres(code))))
}

/// The samples of a PNG of one channel of 16 bits.
fn png(bytes: &[u8]) -> MessageResult<Plane<u16>> {
    let image = files::decode_bytes(bytes)
        .map_err(|e| CodedDepths(format!("its PNG cannot be read: {e}")))?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    match image {
        DynamicImage::ImageLuma16(samples) => {
            Ok(Plane::from_vec(width, height, samples.into_raw())?)
        }
        _ => Err(Unsuited("its PNG is not of one channel of 16 bits")),
    }
}

/// stereo_msgs/DisparityImage: depths by its own focal length and baseline. Disparities below its
/// smallest one are invalid.
pub(crate) fn disparity_image(channel: &Channel, data: &[u8]) -> MessageResult<Plane<f32>> {
    let message = ros::read(channel, data, ros::disparity_image)?;
    if message.image.encoding != "32FC1" {
        let encoding = message.image.encoding;
        return Err(Pixels(format!(
            "its pixels are '{encoding}'; disparities are 32FC1"
        )));
    }
    let (scale, min) = (message.focal_px * message.baseline_m, message.min_disparity);
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(Missing("it has no focal length or no baseline"));
    }
    // Disparities of invalid pixels are 0 or less, which `depths` makes NaN too.
    let disparities = depths(&message.image)?;
    let is_below = |d: f32| 0.0 < d && d < min;
    let depth = disparities.map(|d| if is_below(d) { f32::NAN } else { scale / d });
    Ok(files::known_depths(&depth))
}

fn depths(raw: &RawPixels<'_>) -> MessageResult<Plane<f32>> {
    values(raw).map(|depths| files::known_depths(&depths))
}

/// The depth if it is valid.
fn known(depth: f32) -> f32 {
    if depth > 0.0 { depth } else { f32::NAN }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(
            format in prop::sample::select(&[
                "16UC1; compressedDepth png",
                "16UC1; compressedDepth rvl",
                "32FC1; compressedDepth rvl",
                "png",
                "; ;png",
                "",
            ][..]),
            size in prop::option::weighted(0.5, (0_u32..9, 0_u32..9)),
            mut data in prop::collection::vec(any::<u8>(), 0..200),
        ) {
            if let (Some((width, height)), [_, ..]) = (size, &mut data[..]) {
                let sides = [width, height].map(u32::to_le_bytes).concat();
                data.splice(..0, [&[0; RVL_HEADER], &sides[..]].concat());
            }
            if let Ok(depths) = decompress(format, &data) {
                let is_valid = |z: f32| z.is_nan() || (z > 0.0 && z.is_finite());
                prop_assert!(depths.pixels().all(is_valid));
            }
        }
    }

    fn read(encoding: &str, big_endian: bool, data: &[u8]) -> MessageResult<Vec<f32>> {
        let image = RawPixels {
            width: 2,
            height: 1,
            step: data.len() as u32,
            encoding,
            big_endian,
            data,
        };
        depths(&image).map(|depths| depths.pixels().collect())
    }

    #[test]
    fn millimetres_and_metres() {
        let floats = |values: [f32; 2]| values.map(f32::to_le_bytes).concat();
        let doubles = |values: [f64; 2]| values.map(f64::to_le_bytes).concat();
        let big_doubles = [0.5, 2.0].map(f64::to_be_bytes).concat();
        let big_floats = [0.5, 2.0_f32].map(f32::to_be_bytes).concat();
        for (encoding, big_endian, data, expected) in [
            ("16UC1", false, vec![0xE8, 3, 1, 0], [1.0, 0.001]),
            ("16UC1", true, vec![3, 0xE8, 0, 1], [1.0, 0.001]),
            ("mono16", false, vec![0xE8, 3, 1, 0], [1.0, 0.001]),
            ("64FC1", false, doubles([0.5, 2.0]), [0.5, 2.0]),
            ("64FC1", true, big_doubles, [0.5, 2.0]),
            ("32FC1", true, big_floats, [0.5, 2.0]),
            ("32FC1", false, floats([0.5, 2.0]), [0.5, 2.0]),
            (
                "32FC1",
                false,
                floats([f32::INFINITY, 2.0]),
                [f32::INFINITY, 2.0],
            ),
            // Most are of a wrong sign.
            ("32FC1", false, floats([-0.5, -2.0]), [-0.5, -2.0]),
        ] {
            assert_eq!(read(encoding, big_endian, &data), Ok(expected.to_vec()));
        }
        // Beyond the range of 32 bits.
        let far = read("64FC1", false, &doubles([1e300, -1e300])).unwrap();
        assert!(far[0] == f32::INFINITY && far[1].is_nan());
        for none in [0.0, -1.0, f32::NAN, f32::NEG_INFINITY] {
            let read = read("32FC1", false, &floats([none, 2.0])).unwrap();
            assert!(read[0].is_nan() && read[1] == 2.0, "{none}");
        }
        let zeros = read("16UC1", false, &[0; 4]).unwrap();
        assert!(zeros.iter().all(|z| z.is_nan()));
        for (encoding, data, words) in [
            ("16UC1", &[0; 3][..], "does not fit"),
            ("mono8", &[0; 2], "16UC1"),
        ] {
            let error = read(encoding, false, data).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
