//! 8-bit images as foxglove.RawImage (mono8) or foxglove.CompressedImage (png).

use super::{Encoded, Stamp, decode_protobuf};
use crate::error::Error;
use crate::files;
use crate::stereo::Gray;
use foxglove::messages::{CompressedImage, RawImage};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

const RAW: &str = "foxglove.RawImage";
const COMPRESSED: &str = "foxglove.CompressedImage";

/// How the images of the cameras are kept. Both are lossless.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ImageFormat {
    /// Pixels as they are: fast to write and to read.
    #[default]
    Raw,
    /// PNG: smaller, at several times the work.
    Png,
}

pub(super) fn encode(image: &Gray, format: ImageFormat, stamp: Stamp, frame_id: &str) -> Result<Encoded, Error> {
    let (width, height) = image.size();
    let pixels = match image.as_slice() {
        Some(pixels) => pixels.to_vec(),
        None => image.pixels().collect(),
    };
    // Sides of a plane are at most MAX_SIDE, so they fit.
    let (width, height) = (width as u32, height as u32);
    let frame_id = frame_id.to_owned();
    let timestamp = stamp.foxglove();
    match format {
        ImageFormat::Raw => {
            let encoding = "mono8".to_owned();
            let data = pixels.into();
            Ok(Encoded::protobuf(RAW, &RawImage { timestamp, frame_id, width, height, encoding, step: width, data }))
        }
        ImageFormat::Png => {
            let mut png = Vec::new();
            PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Adaptive)
                .write_image(&pixels, width, height, ExtendedColorType::L8)
                .map_err(|e| Error::Invalid(format!("cannot compress a {width}x{height} image: {e}")))?;
            let format = "png".to_owned();
            Ok(Encoded::protobuf(COMPRESSED, &CompressedImage { timestamp, frame_id, data: png.into(), format }))
        }
    }
}

/// The image in a message of `schema`, or why there is none.
pub(super) fn decode(schema: &str, data: &[u8]) -> Result<Gray, String> {
    match schema {
        RAW => {
            let RawImage { width, height, encoding, step, data, .. } = decode_protobuf(data)?;
            if encoding != "mono8" && encoding != "8UC1" {
                return Err(format!("its pixels are '{encoding}', svl reads mono8"));
            }
            Gray::from_strided(width as usize, height as usize, step as usize, data.into()).map_err(|e| e.to_string())
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
