//! Writes images as messages: 8-bit grey and colour as foxglove.RawImage (mono8, rgb8) or
//! foxglove.CompressedImage (png).

use super::wire::{Encoded, RosStamp};
use foxglove::messages::{CompressedImage, RawImage};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};
use std::borrow::Cow;
use svl_core::Error;
use svl_core::stereo::Plane;

const RAW: &str = "foxglove.RawImage";
const COMPRESSED: &str = "foxglove.CompressedImage";

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
pub(crate) trait Pixel: Copy {
    /// Name in ROS and Foxglove.
    const ENCODING: &'static str;
    const BYTES: u32;
    const PNG: ExtendedColorType;
    /// The last part of its topic in svl's own dialect.
    const NAME: &'static str;
    /// The suffix of its topic in ROS.
    const ROS_ENDING: &'static str;
    fn flat(pixels: &[Self]) -> &[u8];
}

impl Pixel for u8 {
    const ENCODING: &'static str = "mono8";
    const BYTES: u32 = 1;
    const PNG: ExtendedColorType = ExtendedColorType::L8;
    const NAME: &'static str = "image";
    const ROS_ENDING: &'static str = "";
    fn flat(pixels: &[Self]) -> &[u8] {
        pixels
    }
}

impl Pixel for [u8; 3] {
    const ENCODING: &'static str = "rgb8";
    const BYTES: u32 = 3;
    const PNG: ExtendedColorType = ExtendedColorType::Rgb8;
    const NAME: &'static str = "color";
    const ROS_ENDING: &'static str = "_color";
    fn flat(pixels: &[Self]) -> &[u8] {
        pixels.as_flattened()
    }
}

pub(crate) fn encode_image<P: Pixel>(
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
pub(crate) fn png<P: Pixel>(image: &Plane<P>) -> Result<Vec<u8>, Error> {
    let (width, height) = image.size();
    let mut png = Vec::new();
    // Fast, as recording has to keep up with the cameras.
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&pixels(image), width as u32, height as u32, P::PNG)
        .map_err(|e| Error::Invalid(format!("cannot compress a {width}x{height} image: {e}")))?;
    Ok(png)
}

/// The pixels row by row, without row padding.
pub(crate) fn pixels<P: Pixel>(image: &Plane<P>) -> Cow<'_, [u8]> {
    match image.as_slice() {
        Some(pixels) => Cow::Borrowed(P::flat(pixels)),
        None => Cow::Owned(image.rows().flat_map(P::flat).copied().collect()),
    }
}
