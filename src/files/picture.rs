//! Small image files for HTML pages and Rerun: palette PNG and JPEG.

use image::codecs::jpeg::JpegEncoder;
use image::{ImageBuffer, Luma, Pixel, PixelWithColorType, imageops};
use svl_core::stereo::{Gray, Plane, Rgb};
use svl_core::{Error, Result};

/// JPEG quality: grey noise looks unchanged, at a fifth of a PNG's bytes.
const QUALITY: u8 = 78;

/// A PNG of at most 256 colours: `codes` are indices into `palette`, which is RGB.
///
/// # Errors
/// [`Error::Invalid`] for an empty or too large palette, or a code beyond it.
pub fn encode_palette_png(codes: &Plane<u8>, palette: &[[u8; 3]]) -> Result<Vec<u8>> {
    let (width, height) = codes.size();
    if palette.is_empty()
        || palette.len() > 256
        || codes.pixels().any(|c| usize::from(c) >= palette.len())
    {
        return Err(Error::Invalid(format!(
            "PNG encoder: codes beyond a palette of {} colours",
            palette.len()
        )));
    }
    let half_bytes = palette.len() <= 16;
    // Each row of 4-bit codes begins at a byte.
    let packed = |row: &[u8]| -> Vec<u8> {
        if half_bytes {
            row.chunks(2)
                .map(|pair| pair[0] << 4 | pair.get(1).copied().unwrap_or_default())
                .collect()
        } else {
            row.to_vec()
        }
    };
    let data: Vec<u8> = codes.rows().flat_map(packed).collect();
    let wrong = |e: png::EncodingError| Error::Invalid(format!("PNG encoder: {e}"));
    let mut file = Vec::new();
    // Sides are at most MAX_SIDE, so they fit in 32 bits.
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(if half_bytes {
        png::BitDepth::Four
    } else {
        png::BitDepth::Eight
    });
    encoder.set_palette(palette.as_flattened());
    // Level 9 takes twenty times as long for a tenth fewer bytes.
    encoder.set_deflate_compression(png::DeflateCompression::Level(4));
    // Codes are indices, not amounts: a filter gains nothing from their differences.
    encoder.set_filter(png::Filter::NoFilter);
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(&data))
        .map_err(wrong)?;
    Ok(file)
}

/// A PNG of classes, compressed quickly: `codes` are indices into `colors`, whose last channel is
/// opacity.
///
/// # Errors
/// [`Error::Invalid`] with the encoder's message.
pub fn encode_classes_png(codes: &Plane<u8>, colors: &[[u8; 4]]) -> Result<Vec<u8>> {
    let (width, height) = codes.size();
    // Two classes take a bit each; each row of bits begins at a byte, with its first pixel in the
    // highest bit.
    let byte = |eight: &[u8]| {
        let bits = eight.iter().enumerate();
        bits.fold(0, |byte, (i, &bit)| byte | bit << (7 - i))
    };
    let data: Vec<u8> = match colors.len() {
        ..=2 => codes
            .rows()
            .flat_map(|row| row.chunks(8).map(byte))
            .collect(),
        _ => codes.rows().flatten().copied().collect(),
    };
    let palette: Vec<u8> = colors.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
    let opacities: Vec<u8> = colors.iter().map(|color| color[3]).collect();
    let mut file = Vec::new();
    // Sides are at most MAX_SIDE, so they fit in 32 bits.
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Indexed);
    if colors.len() <= 2 {
        encoder.set_depth(png::BitDepth::One);
    }
    encoder.set_palette(palette);
    encoder.set_trns(opacities);
    // `Compression::Fast` has one code table for all images, which does not suit classes.
    encoder.set_deflate_compression(png::DeflateCompression::Level(1));
    encoder.set_filter(png::Filter::NoFilter);
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(&data))
        .map_err(|e| Error::Invalid(format!("PNG encoder: {e}")))?;
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
