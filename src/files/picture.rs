//! Small image files for HTML pages and Rerun: palette PNG and JPEG.

use flate2::Compression;
use flate2::write::ZlibEncoder;
use image::codecs::jpeg::JpegEncoder;
use image::{ImageBuffer, Luma, Pixel, PixelWithColorType, imageops};
use std::io::Write as _;
use svl_core::stereo::{Gray, Plane, Rgb};
use svl_core::{Error, Result};

/// JPEG quality: grey noise looks unchanged, at a fifth of a PNG's bytes.
const QUALITY: u8 = 78;

/// A PNG of at most 256 colours: `codes` are indices into `palette`, which is RGB.
///
/// # Errors
/// [`Error::Invalid`] for an empty or too large palette, or a code beyond it.
pub fn encode_palette_png(codes: &Plane<u8>, palette: &[[u8; 3]]) -> Result<Vec<u8>> {
    if palette.is_empty()
        || palette.len() > 256
        || codes.pixels().any(|c| usize::from(c) >= palette.len())
    {
        return Err(Error::Invalid(format!(
            "PNG encoder: codes beyond a palette of {} colours",
            palette.len()
        )));
    }
    // Level 9 takes twenty times as long for a tenth fewer bytes.
    indexed_png(codes, palette.as_flattened(), None, 4)
}

/// A PNG of classes, compressed quickly: `codes` are indices into `colors`, whose last channel is
/// opacity.
///
/// # Errors
/// [`Error::Invalid`] with the encoder's message.
pub fn encode_classes_png(codes: &Plane<u8>, colors: &[[u8; 4]]) -> Result<Vec<u8>> {
    let palette: Vec<u8> = colors.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
    let opacities = colors.iter().map(|color| color[3]).collect();
    indexed_png(codes, &palette, Some(opacities), 1)
}

/// A PNG of codes, deflated at `level`: in the fewest bits that hold all indices into `palette`.
fn indexed_png(
    codes: &Plane<u8>,
    palette: &[u8],
    opacities: Option<Vec<u8>>,
    level: u32,
) -> Result<Vec<u8>> {
    let (depth, bits) = match palette.len() / 3 {
        ..=2 => (png::BitDepth::One, 1),
        3..=16 => (png::BitDepth::Four, 4),
        _ => (png::BitDepth::Eight, 8),
    };
    let (width, height) = codes.size();
    let mut rows = Vec::with_capacity(height * (1 + (width * bits).div_ceil(8)));
    for row in codes.rows() {
        // No filter: codes are indices, not amounts, whose differences tell nothing.
        rows.push(0);
        // Each row begins at a byte, with its first pixel in the highest bits.
        match bits {
            8 => rows.extend_from_slice(row),
            _ => rows.extend(row.chunks(8 / bits).map(|codes| {
                let codes = codes.iter().enumerate();
                codes.fold(0, |byte, (i, code)| byte | code << (8 - bits * (i + 1)))
            })),
        }
    }
    let wrong = |e: png::EncodingError| Error::Invalid(format!("PNG encoder: {e}"));
    let mut file = Vec::new();
    // Sides are at most MAX_SIDE, so they fit in 32 bits.
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(depth);
    encoder.set_palette(palette);
    if let Some(opacities) = opacities {
        encoder.set_trns(opacities);
    }
    let mut writer = encoder.write_header().map_err(wrong)?;
    // In one piece: `write_image_data` clears a buffer of 32 KB for each row.
    let mut deflate = ZlibEncoder::new(Vec::new(), Compression::new(level));
    let deflated = deflate.write_all(&rows).and_then(|()| deflate.finish());
    let deflated = deflated.map_err(|e| wrong(e.into()))?;
    writer
        .write_chunk(png::chunk::IDAT, &deflated)
        .and_then(|()| writer.finish())
        .map_err(wrong)?;
    Ok(file)
}

/// A JPEG of `image`, scaled down to at most `width` columns; 0 means no limit.
///
/// # Errors
/// [`Error::Invalid`] with the encoder's message.
pub fn encode_jpeg(image: &Gray, width: usize) -> Result<Vec<u8>> {
    jpeg::<Luma<u8>>(image.size(), image.pixels().collect(), width, QUALITY)
}

/// The image compressed as JPEG of that quality, 1..=100, and decoded again.
///
/// # Errors
/// [`Error::Invalid`] with the message of the encoder or the decoder.
pub fn through_jpeg(image: &Gray, quality: u8) -> Result<Gray> {
    let file = jpeg::<Luma<u8>>(image.size(), image.pixels().collect(), 0, quality)?;
    let decoded = super::jpeg::decode(&file);
    let (decoded, _) = decoded.map_err(|fault| Error::Invalid(fault.to_string()))?;
    let (width, height) = image.size();
    Gray::from_vec(width, height, decoded.into_luma8().into_raw())
}

/// Same as [`encode_jpeg`], in colour.
///
/// # Errors
/// The errors of [`encode_jpeg`].
pub fn encode_color_jpeg(image: &Rgb, width: usize) -> Result<Vec<u8>> {
    jpeg::<image::Rgb<u8>>(
        image.size(),
        image.pixels().flatten().collect(),
        width,
        QUALITY,
    )
}

fn jpeg<P>((w, h): (usize, usize), pixels: Vec<u8>, width: usize, quality: u8) -> Result<Vec<u8>>
where
    P: PixelWithColorType + Pixel<Subpixel = u8> + 'static,
{
    let image = ImageBuffer::<P, _>::from_raw(w as u32, h as u32, pixels);
    let mut image = image.ok_or_else(|| Error::Invalid(format!("JPEG encoder: {w}x{h} pixels")))?;
    if w > width && width > 0 {
        let height = (h * width / w).max(1);
        image = imageops::resize(
            &image,
            width as u32,
            height as u32,
            imageops::FilterType::Triangle,
        );
    }
    let mut file = Vec::new();
    let encoded = JpegEncoder::new_with_quality(&mut file, quality).encode_image(&image);
    encoded.map_err(|e| Error::Invalid(format!("JPEG encoder: {e}")))?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(png: &[u8]) -> Vec<[u8; 3]> {
        image::load_from_memory(png)
            .unwrap()
            .into_rgb8()
            .pixels()
            .map(|p| p.0)
            .collect()
    }

    #[test]
    fn classes_have_their_colours_and_opacities() {
        let colors = [[0, 0, 0, 0], [9, 8, 7, 255], [1, 2, 3, 100]];
        for classes in [2, 3] {
            let codes: Vec<u8> = (0..22).map(|i| i * i / 3 % classes).collect();
            let codes = Plane::from_vec(11, 2, codes).unwrap();
            let colors = &colors[..usize::from(classes)];
            let png = encode_classes_png(&codes, colors).unwrap();
            let image = image::load_from_memory(&png).unwrap().into_rgba8();
            let expected = codes.pixels().map(|code| colors[usize::from(code)]);
            assert!(image.pixels().map(|p| p.0).eq(expected));
        }
    }

    #[test]
    fn colours_survive_in_half_and_in_whole_bytes() {
        let codes = Plane::from_vec(3, 2, vec![0, 1, 2, 2, 1, 0]).unwrap();
        for colors in [3, 16, 17] {
            let palette: Vec<_> = (0..colors).map(|i| [i, 2 * i, 255 - i]).collect();
            let expected: Vec<_> = codes
                .pixels()
                .map(|code| palette[usize::from(code)])
                .collect();
            assert_eq!(
                decoded(&encode_palette_png(&codes, &palette).unwrap()),
                expected
            );
        }
        assert!(
            encode_palette_png(&codes, &[[0; 3]; 2]).is_err()
                && encode_palette_png(&codes, &[]).is_err()
        );
    }

    #[test]
    fn a_jpeg_is_no_wider_than_asked() {
        let image = Gray::from_fn(40, 30, |x, _| 5 * x as u8).unwrap();
        let size = |width| {
            let grey = image::load_from_memory(&encode_jpeg(&image, width).unwrap()).unwrap();
            let color = encode_color_jpeg(&image.map(|v| [v, 0, 0]), width).unwrap();
            let color = image::load_from_memory(&color).unwrap();
            assert_eq!(
                (grey.width(), grey.height()),
                (color.width(), color.height())
            );
            (grey.width(), grey.height())
        };
        assert_eq!(
            (size(40), size(20), size(99)),
            ((40, 30), (20, 15), (40, 30))
        );
    }
}
