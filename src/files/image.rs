//! Image files: PNG, JPEG, PNM, TIFF, BMP, WebP.

use super::{BitDepth, DecodedImage, ImageFault, MAX_BYTES, jpeg, read_bounded};
use image::{
    ColorType, DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat,
    ImageReader, codecs::png::PngEncoder, metadata::Orientation,
};
use std::io::Cursor;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicU16, Ordering};
use svl_core::stereo::{Gray, MAX_SIDE, Plane, Visibility};
use svl_core::{Error, Result};

/// Image formats by file extension, the usual one first; those of the last two name a cure.
pub const IMAGE_ENDINGS: &[&str] = &[
    "png", "ppm", "pgm", "jpg", "jpeg", "tif", "tiff", "bmp", "webp", "heic", "heif",
];

/// The kinds of HEIC files, behind their length.
const HEIC: [&[u8]; 5] = [
    b"ftypheic",
    b"ftypheix",
    b"ftyphevc",
    b"ftypmif1",
    b"ftypmsf1",
];

/// Reads an image of any format and depth; its sides are at most [`MAX_SIDE`].
pub(super) fn decode(path: &Path) -> Result<DynamicImage> {
    let bytes = read_bounded(path, MAX_BYTES)?;
    let wrong = |e| Error::format(path, format!("not a readable image: {e}"));
    decode_named(&path.display().to_string(), &bytes).map_err(wrong)
}

/// Reads an image; its sides are at most [`MAX_SIDE`].
///
/// # Errors
/// [`Error::Io`], [`Error::Format`].
pub fn read_image(path: &Path) -> Result<DecodedImage> {
    // Not being an image is reported already: a failure here concerns its size.
    let wrong = |e| Error::format(path, format!("not a readable image: {e}"));
    DecodedImage::new(decode(path)?).map_err(wrong)
}

/// Reads an image whose values are steps of a map, not grey levels of a scale.
///
/// # Errors
/// [`Error::Io`], [`Error::Format`].
pub(super) fn read_steps(path: &Path) -> Result<DecodedImage> {
    let bytes = read_bounded(path, MAX_BYTES)?;
    // `image` multiplies values of 8 bits by 255 / the largest.
    let bytes = with_largest(&bytes, 1..255, b"255").unwrap_or(bytes);
    let image = decode_named(&path.display().to_string(), &bytes);
    let image = image.map_err(|e| Error::format(path, format!("not a readable image: {e}")))?;
    DecodedImage::new(image)
}

/// Decodes the image of a file in memory; it is turned as its EXIF orientation says.
///
/// # Errors
/// The reason why it cannot be read.
pub fn decode_bytes(bytes: &[u8]) -> Result<DynamicImage, ImageFault> {
    decode_named("an image", bytes)
}

fn decode_named(name: &str, bytes: &[u8]) -> Result<DynamicImage, ImageFault> {
    /// The orientations that were told.
    static TOLD: AtomicU16 = AtomicU16::new(0);
    let (mut image, orientation) = decode_unturned(bytes)?;
    let bit = 1 << orientation.to_exif();
    if orientation != Orientation::NoTransforms && TOLD.fetch_or(bit, Ordering::Relaxed) & bit == 0
    {
        let number = orientation.to_exif();
        tracing::warn!("{name}: is turned as its EXIF orientation, {number}, and all such are");
    }
    image.apply_orientation(orientation);
    Ok(image)
}

/// A PNM whose largest value, by its header, is one of `others`, with that of its bits instead.
fn with_largest(bytes: &[u8], others: Range<u32>, of_bits: &[u8]) -> Option<Vec<u8>> {
    if !matches!(bytes, [b'P', b'2' | b'3' | b'5' | b'6', ..]) {
        return None;
    }
    let run = |from: usize, is_in: fn(u8) -> bool| {
        let rest = bytes[from..].iter();
        from + rest.take_while(|byte| is_in(**byte)).count()
    };
    let (mut start, mut end) = (0, 2);
    for _ in ["width", "height", "largest value"] {
        start = run(end, |byte| byte.is_ascii_whitespace());
        while bytes.get(start) == Some(&b'#') {
            start = run(start, |byte| byte != b'\n');
            start = run(start, |byte| byte.is_ascii_whitespace());
        }
        end = run(start, |byte| byte.is_ascii_digit());
    }
    let largest: u32 = str::from_utf8(&bytes[start..end]).ok()?.parse().ok()?;
    let is_other = others.contains(&largest);
    is_other.then(|| [&bytes[..start], of_bits, &bytes[end..]].concat())
}

fn decode_unturned(bytes: &[u8]) -> Result<(DynamicImage, Orientation), ImageFault> {
    // `image` multiplies values of 16 bits by 65535 / the largest.
    let unscaled = with_largest(bytes, 256..65535, b"65535");
    let bytes = unscaled.as_deref().unwrap_or(bytes);
    let kind = bytes.get(4..).unwrap_or_default();
    if HEIC.iter().any(|heic| kind.starts_with(heic)) {
        return Err(ImageFault::Heic);
    }
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    // `image` accepts truncated JPEGs and invents the missing part.
    if reader.format() == Some(ImageFormat::Jpeg) {
        return jpeg::decode(bytes);
    }
    let mut limits = image::Limits::default();
    // Checked by the decoder before it allocates.
    limits.max_image_width = Some(MAX_SIDE as u32);
    limits.max_image_height = Some(MAX_SIDE as u32);
    reader.limits(limits.clone());
    let mut decoder = reader.into_decoder()?;
    limits.reserve(decoder.total_bytes())?;
    let orientation = decoder.orientation()?;
    Ok((DynamicImage::from_decoder(decoder)?, orientation))
}

/// Reads an image as 8-bit grey: grey unchanged (the upper 8 of 16 bits), colour by
/// [`Gray::from_color`].
///
/// # Errors
/// [`Error::Io`], [`Error::Format`], [`Error::Dimensions`].
pub fn read_gray(path: &Path) -> Result<Gray> {
    gray(decode(path)?)
}

fn gray(image: DynamicImage) -> Result<Gray> {
    let image = DecodedImage::new(image)?;
    Ok(BitDepth::FULL.clone().grey(image).0)
}

/// Reads a mask with Middlebury's codes: 255 visible in both cameras, 128 occluded, else unknown.
///
/// # Errors
/// The errors of [`read_gray`].
pub fn read_mask(path: &Path) -> Result<Plane<Visibility>> {
    let codes = read_gray(path)?;
    let mut others = codes.pixels().filter(|code| !matches!(code, 0 | 128 | 255));
    if let Some(first) = others.next() {
        tracing::warn!(
            "{}: {} pixels of the mask are not 0, 128 or 255, the first is {first}; they are not \
             scored",
            path.display(),
            others.count() + 1
        );
    }
    Ok(codes.map(Visibility::from_code))
}

/// Reads KITTI's object map: true for pixels of an object; 0 is the background.
///
/// # Errors
/// The errors of [`read_gray`].
pub fn read_object_map(path: &Path) -> Result<Plane<bool>> {
    let image = decode(path)?.into_luma16();
    let (width, height) = (image.width() as usize, image.height() as usize);
    let objects = image.into_raw().into_iter().map(|object| object > 0);
    Plane::from_vec(width, height, objects.collect())
}

/// A PNG from interleaved `rgb` (3 bytes per pixel) or grey (1 byte), `width` x `height`.
///
/// # Errors
/// [`Error::Size`] for another number of bytes.
pub fn encode_png(width: usize, height: usize, pixels: &[u8]) -> Result<Vec<u8>> {
    let color = if pixels.len() == width * height {
        ColorType::L8
    } else {
        ColorType::Rgb8
    };
    encode(width, height, pixels, color.into())
}

pub(super) fn encode(
    width: usize,
    height: usize,
    pixels: &[u8],
    color: ExtendedColorType,
) -> Result<Vec<u8>> {
    let expected = width * height * usize::from(color.bits_per_pixel() / 8);
    if pixels.len() != expected {
        return Err(Error::Size {
            width,
            height,
            expected,
            got: pixels.len(),
        });
    }
    let mut png = Vec::new();
    // Sides are at most MAX_SIDE, so they fit in 32 bits.
    let written = PngEncoder::new(&mut png).write_image(pixels, width as u32, height as u32, color);
    written.map_err(|e| Error::Invalid(format!("PNG encoder: {e}")))?;
    Ok(png)
}

/// Writes [`encode_png`] to `path`.
///
/// # Errors
/// The errors of [`encode_png`]; [`Error::Io`].
pub fn write_png(path: &Path, width: usize, height: usize, pixels: &[u8]) -> Result<()> {
    std::fs::write(path, encode_png(width, height, pixels)?).map_err(|e| Error::io(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode_jpeg;

    fn gray_of(bytes: &[u8]) -> Result<Gray, ImageFault> {
        Ok(gray(decode_bytes(bytes)?)?)
    }

    #[test]
    fn files_cut_off_are_no_images() {
        let image = Gray::from_fn(40, 30, |x, y| (x * x + 7 * y) as u8).unwrap();
        let pixels: Vec<u8> = image.pixels().collect();
        let (png, jpeg) = (
            encode_png(40, 30, &pixels).unwrap(),
            encode_jpeg(&image, 40).unwrap(),
        );
        let pgm = [b"P5 40 30 255\n", &pixels[..]].concat();
        for (bytes, end) in [
            (&pgm, pgm.len()),
            // The end marker may be missing; its last byte of data may be of padding alone.
            (&jpeg, jpeg.len() - 3),
            (&png, png.len() - END_CHUNK),
        ] {
            for length in 0..end {
                assert!(
                    gray_of(&bytes[..length]).is_err(),
                    "{length} of {} bytes",
                    bytes.len()
                );
            }
            assert!(gray_of(bytes).is_ok());
        }
        for at in 0..png.len() - END_CHUNK {
            let mut flipped = png.clone();
            flipped[at] ^= 1 << (at % 8);
            let read = gray_of(&flipped);
            assert!(
                read.is_err() || read.is_ok_and(|read| read == image),
                "byte {at} changed"
            );
        }
    }

    /// Length of the end of a PNG after all pixels: the checksum of their chunk, and the chunk
    /// IEND.
    const END_CHUNK: usize = 16;
}
