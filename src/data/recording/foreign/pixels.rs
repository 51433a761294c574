//! Decodes ROS and Foxglove pixel encodings.

use super::bayer::{self, Tile};
use crate::files::{BitDepth, DecodedImage, every_byte, strided_rows};
use crate::recording::ros::RawPixels;
use svl_core::stereo::Plane;

/// An image as in its message: a mosaic is not interpolated yet, as its bit depth comes first.
pub(super) struct MessageImage {
    pub image: DecodedImage,
    pub mosaic: Option<Tile>,
}

impl MessageImage {
    /// The demosaiced image.
    pub(super) fn demosaiced(self, depth: &mut BitDepth) -> DecodedImage {
        match self.mosaic {
            Some(tile) => DecodedImage::Color(bayer::color(&depth.grey(self.image).0, tile)),
            None => self.image,
        }
    }
}

/// Layout of one pixel's bytes.
enum PixelLayout {
    /// Grey is byte `at` of every `bytes`: the Y of YUV.
    Grey { bytes: usize, at: usize },
    /// Grey of 16 bits.
    Grey16,
    /// Red, green and blue are these bytes of every `bytes`.
    Colour { bytes: usize, rgb: [usize; 3] },
}

/// # Errors
/// The reason why it cannot be read.
pub(super) fn decode(raw: &RawPixels<'_>) -> Result<MessageImage, String> {
    let (layout, mosaic) = match bayer::tile(raw.encoding) {
        Some((tile, 8)) => (PixelLayout::Grey { bytes: 1, at: 0 }, Some(tile)),
        Some((tile, _)) => (PixelLayout::Grey16, Some(tile)),
        None => (layout(raw.encoding)?, None),
    };
    let bytes = match layout {
        PixelLayout::Grey { bytes, .. } | PixelLayout::Colour { bytes, .. } => bytes,
        PixelLayout::Grey16 => 2,
    };
    let (width, height, step) = (raw.width as usize, raw.height as usize, raw.step as usize);
    // Saturating: the sizes are untrusted numbers from a message.
    let row_bytes = width.saturating_mul(bytes);
    let rows = strided_rows(raw.data, row_bytes, height, step).map_err(|_| {
        let (encoding, got) = (raw.encoding, raw.data.len());
        format!(
            "a {width}x{height} {encoding} image with rows of {step} bytes does not fit its {got} \
             bytes"
        )
    })?;
    let image = match layout {
        PixelLayout::Grey { at, .. } => {
            Plane::from_vec(width, height, every_byte(rows, bytes, at)).map(DecodedImage::Gray)
        }
        PixelLayout::Grey16 => {
            let value = if raw.big_endian {
                u16::from_be_bytes
            } else {
                u16::from_le_bytes
            };
            let values = rows.flat_map(|row| row.as_chunks().0).copied().map(value);
            Plane::from_vec(width, height, values.collect()).map(DecodedImage::Gray16)
        }
        PixelLayout::Colour { rgb, .. } => {
            let pixels = rows.flat_map(|row| row.chunks_exact(bytes));
            let pixels: Vec<u8> = pixels.flat_map(|pixel| rgb.map(|at| pixel[at])).collect();
            DecodedImage::from_rgb(width, height, &pixels)
        }
    };
    let image = image.map_err(|e| e.to_string())?;
    Ok(MessageImage { image, mosaic })
}

fn layout(encoding: &str) -> Result<PixelLayout, String> {
    Ok(match encoding {
        // 8UC1 and 8UC3 are OpenCV's names, which cv_bridge writes if the encoding is unknown: grey
        // and BGR.
        "mono8" | "8UC1" => PixelLayout::Grey { bytes: 1, at: 0 },
        "mono16" => PixelLayout::Grey16,
        // ROS's yuv422 is UYVY: the luma is the second byte.
        "yuv422" | "uyvy" | "UYVY" => PixelLayout::Grey { bytes: 2, at: 1 },
        "yuv422_yuy2" | "yuyv" | "YUYV" => PixelLayout::Grey { bytes: 2, at: 0 },
        "rgb8" => PixelLayout::Colour {
            bytes: 3,
            rgb: [0, 1, 2],
        },
        "bgr8" | "8UC3" => PixelLayout::Colour {
            bytes: 3,
            rgb: [2, 1, 0],
        },
        "rgba8" => PixelLayout::Colour {
            bytes: 4,
            rgb: [0, 1, 2],
        },
        "bgra8" | "8UC4" => PixelLayout::Colour {
            bytes: 4,
            rgb: [2, 1, 0],
        },
        _ => {
            let known =
                "mono8, mono16, rgb8, rgba8, bgr8, bgra8, bayer_*8, bayer_*16, uyvy and yuyv";
            return Err(format!("its pixels are '{encoding}', svl reads {known}"));
        }
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
    ) -> Result<Vec<u8>, String> {
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
        // Grey 10 and 200 in all encodings, in rows with one byte of padding.
        assert_eq!(read("mono8", (2, 1), 3, &[10, 200]), Ok(vec![10, 200]));
        assert_eq!(
            read("mono16", (2, 1), 4, &[99, 10, 99, 200]),
            Ok(vec![10, 200])
        );
        assert_eq!(
            read("uyvy", (2, 1), 4, &[128, 10, 128, 200]),
            Ok(vec![10, 200])
        );
        assert_eq!(
            read("yuv422_yuy2", (2, 1), 4, &[10, 128, 200, 128]),
            Ok(vec![10, 200])
        );
        assert_eq!(
            read("rgb8", (1, 2), 4, &[10, 10, 10, 0, 200, 200, 200]),
            Ok(vec![10, 200])
        );
        assert_eq!(
            read("bgra8", (1, 2), 5, &[10, 10, 10, 0, 0, 200, 200, 200, 0]),
            Ok(vec![10, 200])
        );
        let big = RawPixels {
            width: 1,
            height: 1,
            step: 2,
            encoding: "mono16",
            big_endian: true,
            data: &[77, 0],
        };
        assert_eq!(grey(decode(&big).unwrap()).get(0, 0), 77);
        // Pure red, in both orders.
        assert_eq!(read("rgb8", (1, 1), 3, &[255, 0, 0]), Ok(vec![76]));
        assert_eq!(read("bgr8", (1, 1), 3, &[0, 0, 255]), Ok(vec![76]));
        assert_eq!(read("rgba8", (1, 1), 4, &[255, 0, 0, 255]), Ok(vec![76]));
        assert_eq!(read("bayer_rggb8", (2, 2), 2, &[50; 4]), Ok(vec![50; 4]));
        assert_eq!(
            read("bayer_gbrg16", (2, 2), 4, &[9, 50, 9, 50, 9, 50, 9, 50]),
            Ok(vec![50; 4])
        );
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert!(
            read("mono8", (2, 2), 2, &[0; 3])
                .unwrap_err()
                .contains("2x2 mono8 image with rows of 2 bytes")
        );
        assert!(read("mono8", (2, 2), 1, &[0; 9]).is_err());
        assert!(read("mono8", (0, 2), 0, &[0; 9]).is_err());
        assert!(read("mono8", (2, 0), 2, &[0; 9]).is_err());
        assert!(read("bgra8", (u32::MAX, u32::MAX), u32::MAX, &[0; 9]).is_err());
        assert!(
            read("16UC1", (1, 1), 2, &[0; 2])
                .unwrap_err()
                .contains("'16UC1', svl reads mono8")
        );
        assert!(read("bayer_rgbg8", (1, 1), 1, &[0]).is_err());
    }
}
