//! Strict JPEG decoding: an image with missing data is an error.

use super::ImageFault;
use image::{DynamicImage, GrayImage, RgbImage, metadata::Orientation};
use svl_core::stereo::MAX_SIDE;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Markers: the first two bytes of an image, and the second ones of others.
const BEGIN: [u8; 2] = [0xFF, 0xD8];
const END: u8 = 0xD9;
const SEQUENTIAL_0: u8 = 0xC0;
const SEQUENTIAL_1: u8 = 0xC1;
const SCAN: u8 = 0xDA;
const RESTART_0: u8 = 0xD0;
const RESTART_7: u8 = 0xD7;

/// A segment that marks a frame of Motion JPEG. Many cameras omit the Huffman tables, and with this
/// segment the decoder uses the standard ones (ITU-T T.81, K.3).
const MOTION_JPEG: &[u8] = b"\xFF\xE0\0\x07AVI1\0";

/// 128 one bits, each byte with the stuffed zero that keeps it from being a marker: twice as many
/// as the decoder reads ahead.
const ONES: [u8; 32] = *b"\xFF\0\xFF\0\xFF\0\xFF\0\xFF\0\xFF\0\xFF\0\xFF\0\
    \xFF\0\xFF\0\xFF\0\xFF\0\xFF\0\xFF\0\xFF\0\xFF\0";

/// Blocks of 8x8 pixels in the largest image.
const MAX_BLOCKS: usize = (MAX_SIDE / 8).pow(2);

type Decoder = JpegDecoder<ZCursor<Vec<u8>>>;

/// The image and its EXIF orientation; grey is kept, colours become RGB.
pub(super) fn decode(jpeg: &[u8]) -> Result<(DynamicImage, Orientation), ImageFault> {
    let (mut decoder, (width, height)) = open(jpeg)?;
    let exif = decoder.exif().map(Vec::as_slice);
    let orientation = exif.and_then(Orientation::from_exif_chunk);
    let orientation = orientation.unwrap_or(Orientation::NoTransforms);
    let grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    // Sides are at most MAX_SIDE, so they fit in 32 bits.
    let [w, h] = [width, height].map(|side| side as u32);
    let image = if grey {
        GrayImage::from_raw(w, h, pixels(&mut decoder, ColorSpace::Luma)?).map(DynamicImage::from)
    } else {
        RgbImage::from_raw(w, h, pixels(&mut decoder, ColorSpace::RGB)?).map(DynamicImage::from)
    };
    let image = image.map(|image| (image, orientation));
    image.ok_or_else(|| ImageFault::Pixels(width, height, " with fewer than these".to_owned()))
}

/// The luma of a camera's image, or a short error, also for a different size.
#[cfg(target_os = "linux")]
pub fn brightness(
    jpeg: &[u8],
    (width, height): (usize, usize),
) -> Result<svl_core::stereo::Gray, ImageFault> {
    let (mut decoder, (w, h)) = open(jpeg)?;
    if (w, h) != (width, height) {
        return Err(ImageFault::Pixels(w, h, format!(", not {width}x{height}")));
    }
    let pixels = pixels(&mut decoder, ColorSpace::Luma)?;
    Ok(svl_core::stereo::Gray::from_vec(width, height, pixels)?)
}

/// A decoder that has read the headers, and the size of the image.
fn open(jpeg: &[u8]) -> Result<(Decoder, (usize, usize)), ImageFault> {
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(MAX_SIDE)
        .set_max_height(MAX_SIDE);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(guarded(jpeg)?), options);
    decoder.decode_headers()?;
    let (width, height) = decoder.dimensions().unwrap_or_default();
    // A block of 8x8 pixels takes at least a bit: memory is allocated for what the file can
    // contain, not for what it claims.
    if width * height > 64 * 8 * jpeg.len() {
        let wrong = format!(" in {} bytes", jpeg.len());
        return Err(ImageFault::Pixels(width, height, wrong));
    }
    Ok((decoder, (width, height)))
}

fn pixels(decoder: &mut Decoder, colours: ColorSpace) -> Result<Vec<u8>, ImageFault> {
    decoder.set_options(decoder.options().jpeg_set_out_colorspace(colours));
    Ok(decoder.decode()?)
}

/// The image up to its end marker, with ones inserted before each marker that ends coded data
/// finally. Some cameras omit the end marker: the end of the file is taken for it behind the only
/// scan of an image.
///
/// If a marker comes too early, the decoder invents the rest, strict or not. No Huffman code
/// consists of ones (ITU-T T.81, annex C), so a decoder that continues to read fails at them.
/// Between the scans of an image none are inserted: there the decoder expects the marker right
/// after the last code.
fn guarded(jpeg: &[u8]) -> Result<Vec<u8>, ImageFault> {
    let cut = || ImageFault::Cut(jpeg.len());
    if !jpeg.starts_with(&BEGIN) {
        return Err(ImageFault::NoJpeg(jpeg.len()));
    }
    let mut guarded = [&BEGIN, MOTION_JPEG].concat();
    let (mut taken, mut at) = (BEGIN.len(), BEGIN.len());
    // Number of the components of an image of one scan, and true within that.
    let (mut components, mut is_in_scan) = (None, false);
    loop {
        let Some(marker) = jpeg.get(at..).and_then(to_marker).map(|next| at + next) else {
            // Zeros are the rest of a buffer: an image ended before.
            let rest = jpeg
                .get(taken..)
                .filter(|rest| is_in_scan && !rest.ends_with(&[0, 0]));
            let rest = rest.ok_or_else(cut)?;
            let rest = rest.strip_suffix(&[0xFF]).unwrap_or(rest);
            return Ok([&guarded, rest, &ONES, &[0xFF, END]].concat());
        };
        match jpeg[marker + 1] {
            RESTART_0..=RESTART_7 => {
                if guarded.len() > marker + ONES.len() * MAX_BLOCKS {
                    return Err(ImageFault::Restarts);
                }
                guarded.extend([&jpeg[taken..marker], &ONES].concat());
                (taken, at) = (marker, marker + 2);
            }
            END => {
                let (last, end) = (&jpeg[taken..marker], &jpeg[marker..marker + 2]);
                return Ok([&guarded, last, &ONES, end].concat());
            }
            // A segment with its length; markers inside, such as those of a thumbnail, are ignored.
            kind => {
                let length = jpeg.get(marker + 2..marker + 4).ok_or_else(cut)?;
                match kind {
                    SEQUENTIAL_0 | SEQUENTIAL_1 => components = jpeg.get(marker + 9),
                    SCAN => is_in_scan = components.is_some() && jpeg.get(marker + 4) == components,
                    _ => {}
                }
                at = marker + 2 + usize::from(u16::from_be_bytes([length[0], length[1]]));
            }
        }
    }
}

/// Offset of the next marker: 0xFF followed neither by 0, as in coded data, nor by another 0xFF.
fn to_marker(bytes: &[u8]) -> Option<usize> {
    bytes
        .windows(2)
        .position(|two| two[0] == 0xFF && !matches!(two[1], 0 | 0xFF))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::jpeg::JpegEncoder;
    use image::{ExtendedColorType, load_from_memory};

    fn decode(jpeg: &[u8]) -> Result<DynamicImage, ImageFault> {
        super::decode(jpeg).map(|(image, _)| image)
    }

    /// 40x40 of noise, with a restart after every row of blocks, and with ten scans.
    const RESTARTS: &[u8] = include_bytes!("restarts.jpg");
    const PROGRESSIVE: &[u8] = include_bytes!("progressive.jpg");

    fn encoded(
        width: u32,
        height: u32,
        colours: ExtendedColorType,
        pixel: impl Fn(usize) -> u8,
    ) -> Vec<u8> {
        let bytes = (width * height) as usize * usize::from(colours.bits_per_pixel() / 8);
        let pixels: Vec<u8> = (0..bytes).map(pixel).collect();
        let mut jpeg = Vec::new();
        JpegEncoder::new_with_quality(&mut jpeg, 90)
            .encode(&pixels, width, height, colours)
            .unwrap();
        jpeg
    }

    fn noise() -> impl Fn(usize) -> u8 {
        |i| (i.wrapping_mul(2_654_435_761) >> 11) as u8
    }

    fn whole() -> Vec<Vec<u8>> {
        let (grey, rgb) = (ExtendedColorType::L8, ExtendedColorType::Rgb8);
        let mut images = vec![RESTARTS.to_vec(), PROGRESSIVE.to_vec()];
        // The last rows of flat and of narrow images take fewer bits than the decoder reads ahead.
        for (width, height) in [(1, 1), (8, 8), (5, 70), (64, 48)] {
            images.extend([grey, rgb].map(|colours| encoded(width, height, colours, noise())));
            images.extend([grey, rgb].map(|colours| encoded(width, height, colours, |_| 90)));
        }
        images
    }

    #[test]
    fn whole_images_are_what_the_lenient_decoder_makes_of_them() {
        for jpeg in whole() {
            let expected = load_from_memory(&jpeg).unwrap();
            assert_eq!(decode(&jpeg).unwrap(), expected);
            // Cameras and other programs append data after the end, perhaps a second image.
            let longer = [&jpeg[..], &[0; 9], &jpeg].concat();
            assert_eq!(decode(&longer).unwrap(), expected);
            // A thumbnail in the headers has its own end marker.
            let small = [0xFF, 0xE1, 0, 8, 0xFF, 0xD8, 1, 2, 0xFF, 0xD9];
            let with_small = [&jpeg[..2], &small, &jpeg[2..]].concat();
            assert_eq!(decode(&with_small).unwrap(), expected);
        }
    }

    #[test]
    fn the_end_marker_may_be_missing_where_nothing_else_can_be() {
        for jpeg in whole() {
            let cut = [2, 1].map(|bytes| decode(&jpeg[..jpeg.len() - bytes]));
            if jpeg == PROGRESSIVE {
                assert!(cut.iter().all(Result::is_err));
            } else {
                let whole = decode(&jpeg).unwrap();
                assert!(cut.into_iter().all(|cut| cut.unwrap() == whole));
            }
        }
    }

    #[test]
    fn an_image_that_is_cut_off_is_none() {
        for jpeg in whole() {
            for length in 0..jpeg.len() - 3 {
                let cut = decode(&jpeg[..length]);
                assert!(cut.is_err(), "{length} of {} bytes", jpeg.len());
            }
        }
    }

    #[test]
    fn an_image_that_ends_early_is_none() {
        let noisy = encoded(64, 48, ExtendedColorType::Rgb8, noise());
        for jpeg in [RESTARTS, &noisy] {
            let scan = jpeg.windows(2).position(|two| two == [0xFF, 0xDA]).unwrap() + 12;
            for length in scan..jpeg.len() - 4 {
                let ended = [&jpeg[..length], &[0xFF, 0xD9]].concat();
                assert!(decode(&ended).is_err(), "{length} of {}", jpeg.len());
            }
        }
        // The data of one restart interval are missing.
        let is_restart = |at: &usize| RESTARTS[*at] == 0xFF && RESTARTS[at + 1] & 0xF8 == 0xD0;
        let at: Vec<_> = (0..RESTARTS.len() - 1).filter(is_restart).collect();
        for kept in [0, 12] {
            let holed = [&RESTARTS[..at[1] + kept], &RESTARTS[at[2]..]].concat();
            assert!(decode(&holed).is_err() && load_from_memory(&holed).is_ok());
        }
    }

    #[test]
    fn no_room_is_made_for_what_a_file_cannot_hold() {
        let mut jpeg = encoded(64, 48, ExtendedColorType::L8, noise());
        let size = jpeg.windows(2).position(|two| two == [0xFF, 0xC0]).unwrap() + 5;
        jpeg[size..size + 4].copy_from_slice(&[0x3F, 0xFF, 0x3F, 0xFF]);
        let error = decode(&jpeg).unwrap_err().to_string();
        assert!(error.contains("a JPEG of 16383x16383 pixels in"), "{error}");
    }
}
