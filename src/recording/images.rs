//! Images in messages: 8-bit grey and colour as foxglove.RawImage (mono8, rgb8) or
//! foxglove.CompressedImage (png), floats from sensor_msgs/msg/Image 32FC1.

use super::{Encoded, RosStamp, TopicKind, decode_protobuf, ros};
use foxglove::messages::{CompressedImage, RawImage};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};
use std::borrow::Cow;
use svl_core::Error;
use svl_core::stereo::{Gray, Plane, Rgb, Side};
use svl_files as files;

const RAW: &str = "foxglove.RawImage";
const COMPRESSED: &str = "foxglove.CompressedImage";
pub(super) const FLOATS: &str = "sensor_msgs/msg/Image";

/// Compression of the camera images. Both are lossless.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ImageFormat {
    /// Uncompressed: fast to write and to read.
    #[default]
    Raw,
    /// PNG: smaller, several times slower.
    Png,
}

/// Pixel type of an image.
pub(super) trait Pixel: Copy {
    /// Name in ROS and Foxglove.
    const ENCODING: &'static str;
    const BYTES: u32;
    const PNG: ExtendedColorType;
    /// The topic of a camera's image in svl's own dialect.
    const KIND: fn(Side) -> TopicKind;
    /// The suffix of its topic in ROS.
    const ROS_ENDING: &'static str;
    fn flat(pixels: &[Self]) -> &[u8];
}

impl Pixel for u8 {
    const ENCODING: &'static str = "mono8";
    const BYTES: u32 = 1;
    const PNG: ExtendedColorType = ExtendedColorType::L8;
    const KIND: fn(Side) -> TopicKind = TopicKind::Image;
    const ROS_ENDING: &'static str = "";
    fn flat(pixels: &[Self]) -> &[u8] {
        pixels
    }
}

impl Pixel for [u8; 3] {
    const ENCODING: &'static str = "rgb8";
    const BYTES: u32 = 3;
    const PNG: ExtendedColorType = ExtendedColorType::Rgb8;
    const KIND: fn(Side) -> TopicKind = TopicKind::Color;
    const ROS_ENDING: &'static str = "_color";
    fn flat(pixels: &[Self]) -> &[u8] {
        pixels.as_flattened()
    }
}

pub(super) fn encode_image<P: Pixel>(
    image: &Plane<P>,
    format: ImageFormat,
    stamp: RosStamp,
    frame_id: &str,
) -> Result<Encoded, Error> {
    let (width, height) = image.size();
    // Sides of a plane are at most MAX_SIDE, so they fit.
    let (width, height) = (width as u32, height as u32);
    let frame_id = frame_id.to_owned();
    let timestamp = stamp.foxglove();
    match format {
        ImageFormat::Raw => {
            let encoding = P::ENCODING.to_owned();
            let data = pixels(image).into_owned().into();
            Ok(Encoded::protobuf(
                RAW,
                &RawImage {
                    timestamp,
                    frame_id,
                    width,
                    height,
                    encoding,
                    step: P::BYTES * width,
                    data,
                },
            ))
        }
        ImageFormat::Png => {
            let data = png(image)?.into();
            let format = "png".to_owned();
            Ok(Encoded::protobuf(
                COMPRESSED,
                &CompressedImage {
                    timestamp,
                    frame_id,
                    data,
                    format,
                },
            ))
        }
    }
}

/// The image as a PNG file.
pub(super) fn png<P: Pixel>(image: &Plane<P>) -> Result<Vec<u8>, Error> {
    let (width, height) = image.size();
    let mut png = Vec::new();
    // Fast, as recording has to keep up with the cameras.
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&pixels(image), width as u32, height as u32, P::PNG)
        .map_err(|e| Error::Invalid(format!("cannot compress a {width}x{height} image: {e}")))?;
    Ok(png)
}

/// The pixels row by row, without row padding.
pub(super) fn pixels<P: Pixel>(image: &Plane<P>) -> Cow<'_, [u8]> {
    match image.as_slice() {
        Some(pixels) => Cow::Borrowed(P::flat(pixels)),
        None => Cow::Owned(image.rows().flat_map(P::flat).copied().collect()),
    }
}

/// The colour image in a message of `schema`, or the reason why there is none.
pub(super) fn decode_color(schema: &str, data: &[u8]) -> Result<Rgb, String> {
    let (width, height, rgb) = match schema {
        RAW => {
            let m: RawImage = decode_protobuf(data)?;
            let (width, height, row) = (m.width as usize, m.height as usize, 3 * m.width);
            if m.encoding != "rgb8" || m.step != row {
                let (encoding, step) = (m.encoding, m.step);
                return Err(format!(
                    "its pixels are '{encoding}' in rows of {step}, not rgb8"
                ));
            }
            (width, height, m.data.to_vec())
        }
        COMPRESSED => {
            let CompressedImage { data, .. } = decode_protobuf(data)?;
            let image = files::decode_bytes(&data)?.into_rgb8();
            (
                image.width() as usize,
                image.height() as usize,
                image.into_raw(),
            )
        }
        other => return Err(format!("it is a {other}, svl reads {RAW} and {COMPRESSED}")),
    };
    Rgb::from_vec(width, height, rgb.as_chunks().0.to_vec()).map_err(|e| e.to_string())
}

/// The image in a message of `schema`, or the reason why there is none.
pub(super) fn decode_gray(schema: &str, data: &[u8]) -> Result<Gray, String> {
    match schema {
        RAW => {
            let RawImage {
                width,
                height,
                encoding,
                step,
                data,
                ..
            } = decode_protobuf(data)?;
            // 8UC1: OpenCV's name for the same pixels.
            if encoding != "mono8" && encoding != "8UC1" {
                return Err(format!("its pixels are '{encoding}', svl reads mono8"));
            }
            Gray::from_strided(width as usize, height as usize, step as usize, data.into())
                .map_err(|e| e.to_string())
        }
        COMPRESSED => {
            let CompressedImage { data, format, .. } = decode_protobuf(data)?;
            if format != "png" {
                return Err(format!("it is compressed as '{format}', svl reads png"));
            }
            files::gray_of(&data)
        }
        other => Err(format!("it is a {other}, svl reads {RAW} and {COMPRESSED}")),
    }
}

/// The plane in a message of `schema`, or the reason why there is none.
pub(super) fn decode_floats(schema: &str, data: &[u8]) -> Result<Plane<f32>, String> {
    if schema != FLOATS {
        return Err(format!("it is a {schema}, svl reads {FLOATS}"));
    }
    let (_, image) = ros::read_cdr(data, ros::image)?;
    if image.encoding != "32FC1" || image.big_endian {
        return Err(format!(
            "its pixels are '{}', svl reads little-endian 32FC1",
            image.encoding
        ));
    }
    let row_bytes = image.width as usize * 4;
    let (step, height) = (image.step as usize, image.height as usize);
    // Also rejects step 0, for which chunks_exact would panic.
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
