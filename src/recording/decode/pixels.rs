//! Decodes ROS and Foxglove pixel encodings.

use super::bayer::Tile;
use super::encoding::{Samples, samples, u16_of};
use super::{bayer, encoding};
use crate::message::MessageResult;
use crate::message::ros::read::RawPixels;
use svl_core::stereo::Plane;
use svl_files::{BitDepth, DecodedImage, every_byte};

/// An image as in its message: a mosaic is not interpolated yet, as its bit depth comes first.
pub(crate) struct MessageImage {
    pub image: DecodedImage,
    pub mosaic: Option<Tile>,
}

impl MessageImage {
    /// The demosaiced image.
    pub(crate) fn demosaiced(self, depth: &mut BitDepth) -> DecodedImage {
        match self.mosaic {
            Some(tile) => DecodedImage::Color(bayer::color(&depth.grey(self.image).0, tile)),
            None => self.image,
        }
    }
}

/// # Errors
/// The reason why it cannot be read.
pub(crate) fn decode(raw: &RawPixels<'_>) -> MessageResult<MessageImage> {
    let why_no_image = || encoding::why_no_image(raw.encoding);
    let encoding = encoding::named(raw.encoding).ok_or_else(why_no_image)?;
    let rows = encoding.rows(raw)?;
    let (width, height) = (raw.width as usize, raw.height as usize);
    let grey8 = |pixels| Plane::from_vec(width, height, pixels).map(DecodedImage::Gray);
    let grey16 = |pixels| Plane::from_vec(width, height, pixels).map(DecodedImage::Gray16);
    let image = match encoding.samples {
        // Row by row: most images are of these.
        Samples::Grey8(1, _) | Samples::Bayer8(_) => grey8(rows.collect::<Vec<_>>().concat()),
        Samples::Grey8(bytes, at) => grey8(every_byte(rows, bytes, at)),
        Samples::Grey16 | Samples::Bayer16(_) => grey16(samples(rows, u16_of(raw))),
        Samples::Color8(bytes, rgb) => {
            let pixels = rows.flat_map(|row| row.chunks_exact(bytes));
            let pixels: Vec<u8> = pixels.flat_map(|pixel| rgb.map(|at| pixel[at])).collect();
            DecodedImage::from_rgb(width, height, &pixels)
        }
        Samples::Color16(channels, rgb) => {
            let value = u16_of(raw);
            let pixels = rows.flat_map(|row| row.chunks_exact(2 * channels));
            let pixels =
                pixels.map(|pixel| rgb.map(|at| value([pixel[2 * at], pixel[2 * at + 1]])));
            Plane::from_vec(width, height, pixels.collect()).map(DecodedImage::Color16)
        }
        Samples::Float32 | Samples::Float64 => return Err(why_no_image()),
    };
    Ok(MessageImage {
        image: image?,
        mosaic: encoding.mosaic(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(
        encoding: &str,
        (width, height): (u32, u32),
        step: u32,
        data: &[u8],
    ) -> MessageResult<Vec<u8>> {
        let raw = RawPixels {
            width,
            height,
            step,
            encoding,
            big_endian: false,
            data,
        };
        decode(&raw).map(|image| grey(image).pixels().collect())
    }

    fn grey(image: MessageImage) -> svl_core::stereo::Gray {
        let mut depth = BitDepth::FULL;
        let image = image.demosaiced(&mut depth);
        depth.grey(image).0
    }

    #[test]
    fn every_encoding_gives_its_grey() {
        let check = |(encoding, size, step, data): (&str, (u32, u32), u32, &[u8]), grey: &[u8]| {
            assert_eq!(
                read(encoding, size, step, data),
                Ok(grey.to_vec()),
                "{encoding}"
            );
        };
        // Grey 10 and 200 in all encodings, in rows with one byte of padding.
        let bgr = [99, 10, 99, 10, 99, 10, 99, 200, 99, 200, 99, 200];
        check(("mono8", (2, 1), 3, &[10, 200]), &[10, 200]);
        check(("mono16", (2, 1), 4, &[99, 10, 99, 200]), &[10, 200]);
        check(("16UC1", (2, 1), 5, &[99, 10, 99, 200, 0]), &[10, 200]);
        check(("uyvy", (2, 1), 4, &[128, 10, 128, 200]), &[10, 200]);
        check(("yuv422", (2, 1), 5, &[128, 10, 128, 200]), &[10, 200]);
        check(("yuyv", (2, 1), 4, &[10, 128, 200, 128]), &[10, 200]);
        check(("yuv422_yuy2", (2, 1), 4, &[10, 128, 200, 128]), &[10, 200]);
        check(
            ("rgb8", (2, 1), 6, &[10, 10, 10, 200, 200, 200]),
            &[10, 200],
        );
        check(("bgr16", (2, 1), 12, &bgr), &[10, 200]);
        let below = [10, 10, 10, 0, 0, 200, 200, 200, 0];
        check(
            ("rgb8", (1, 2), 4, &[10, 10, 10, 0, 200, 200, 200]),
            &[10, 200],
        );
        check(("bgra8", (1, 2), 5, &below), &[10, 200]);
        // The chroma below is not looked at.
        for (encoding, chroma) in [("nv12", 4), ("NV21", 4), ("nv24", 12)] {
            let data = [&[10, 200, 0, 30, 40, 0][..], &vec![255; chroma]].concat();
            check((encoding, (2, 2), 3, &data), &[10, 200, 30, 40]);
        }
        check(("bayer_rggb8", (2, 2), 2, &[50; 4]), &[50; 4]);
        check(
            ("bayer_gbrg16", (2, 2), 4, &[9, 50, 9, 50, 9, 50, 9, 50]),
            &[50; 4],
        );
    }

    #[test]
    fn colours_and_bytes_are_in_their_order() {
        // Pure red, of 8 and of 16 bits.
        let red = [255, 255, 0, 0, 0, 0, 9, 9];
        let blue_first = [0, 0, 0, 0, 255, 255, 9, 9];
        assert_eq!(read("rgb8", (1, 1), 3, &red[1..4]), Ok(vec![76]));
        assert_eq!(read("bgr8", (1, 1), 3, &[0, 0, 255]), Ok(vec![76]));
        assert_eq!(read("rgba8", (1, 1), 4, &[255, 0, 0, 255]), Ok(vec![76]));
        assert_eq!(read("rgb16", (1, 1), 6, &red), Ok(vec![76]));
        assert_eq!(read("bgr16", (1, 1), 6, &blue_first), Ok(vec![76]));
        assert_eq!(read("rgba16", (1, 1), 8, &red), Ok(vec![76]));
        assert_eq!(read("bgra16", (1, 1), 8, &blue_first), Ok(vec![76]));
        let big = |encoding, data: &[u8]| {
            let raw = RawPixels {
                width: 1,
                height: 1,
                step: data.len() as u32,
                encoding,
                big_endian: true,
                data,
            };
            grey(decode(&raw).unwrap()).get(0, 0)
        };
        assert_eq!(big("mono16", &[77, 0]), 77);
        assert_eq!(big("rgb16", &[77, 0, 77, 0, 77, 0]), 77);
    }

    #[test]
    fn more_data_than_padding_is_another_encoding() {
        let padded = |bytes: usize| read("mono8", (2, 2), 2, &vec![7; 4 + bytes]);
        assert_eq!(padded(4096), Ok(vec![7; 4]));
        let long = padded(4097).unwrap_err().to_string();
        assert!(long.contains("is shorter than its 4101 bytes"), "{long}");
    }

    #[test]
    fn pixels_that_are_no_image_are_refused() {
        assert!(read("mono8", (2, 0), 2, &[0; 9]).is_err());
        assert!(read("bgra8", (u32::MAX, u32::MAX), u32::MAX, &[0; 9]).is_err());
        let depths = read("32FC1", (1, 1), 4, &[0; 4]).unwrap_err().to_string();
        assert!(depths.contains("'32FC1', which are depths"), "{depths}");
        let unknown = read("bayer_rgbg8", (1, 1), 1, &[0]).unwrap_err();
        let words = "'bayer_rgbg8', svl reads mono8";
        assert!(unknown.to_string().contains(words), "{unknown}");
    }
}
