//! Converts a driver's buffer to a grey image.

use super::mode::PixelFormat;
use svl_core::stereo::Gray;
use svl_files::{ImageFault, brightness, every_byte, strided_rows};

/// Layout of an image in a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub format: PixelFormat,
    pub width: usize,
    pub height: usize,
    /// Bytes from one row to the next; unused for MJPEG.
    pub stride: usize,
}

impl Layout {
    /// The luma of an image, or its damage.
    pub(super) fn read(&self, data: &[u8]) -> Result<Gray, ImageFault> {
        match self.format {
            PixelFormat::Grey | PixelFormat::Yuyv => self.unpack(data, 0),
            PixelFormat::Uyvy => self.unpack(data, 1),
            PixelFormat::Mjpeg => brightness(data, (self.width, self.height)),
        }
    }

    /// Byte `luma` of each pixel.
    fn unpack(&self, data: &[u8], luma: usize) -> Result<Gray, ImageFault> {
        let (width, height, step) = (self.width, self.height, self.format.bytes());
        let rows = strided_rows(data, width * step, height, self.stride)
            .map_err(|expected| ImageFault::Short(data.len(), expected))?;
        let pixels = every_byte(rows, step, luma);
        Ok(Gray::from_vec(width, height, pixels)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (64, 48);

    /// From a webcam, 4:2:2; its brightness is [`grey`], with colours over it.
    const WEBCAM: &[u8] = include_bytes!("webcam.jpg");

    fn grey(x: usize, y: usize) -> u8 {
        (20 + 2 * x + 2 * y) as u8
    }

    fn layout(format: PixelFormat, stride: usize) -> Layout {
        Layout {
            format,
            width: SIZE.0,
            height: SIZE.1,
            stride,
        }
    }

    /// The JPEG without its segments of one kind.
    fn without(marker: u8, jpeg: &[u8]) -> Vec<u8> {
        let (mut kept, mut rest) = (jpeg[..2].to_vec(), &jpeg[2..]);
        while rest[1] != 0xDA {
            let (segment, others) =
                rest.split_at(2 + usize::from(u16::from_be_bytes([rest[2], rest[3]])));
            if segment[1] != marker {
                kept.extend(segment);
            }
            rest = others;
        }
        [&kept, rest].concat()
    }

    #[track_caller]
    fn shows_the_picture(image: &Gray, tolerance: u8) {
        assert_eq!(image.size(), SIZE);
        for y in 0..SIZE.1 {
            for (x, &pixel) in image.row(y).iter().enumerate() {
                assert!(
                    pixel.abs_diff(grey(x, y)) <= tolerance,
                    "{pixel} at ({x}, {y})"
                );
            }
        }
    }

    #[test]
    fn padded_rows_of_grey() {
        let row = |y: usize| (0..SIZE.0).map(move |x| grey(x, y)).chain([255; 16]);
        let data: Vec<u8> = (0..SIZE.1).flat_map(row).collect();
        shows_the_picture(&layout(PixelFormat::Grey, 80).read(&data).unwrap(), 0);
        // Only the last row's padding may be missing.
        shows_the_picture(
            &layout(PixelFormat::Grey, 80)
                .read(&data[..data.len() - 16])
                .unwrap(),
            0,
        );
        let error = layout(PixelFormat::Grey, 80)
            .read(&data[..data.len() - 17])
            .unwrap_err();
        assert_eq!(error.to_string(), "3823 of 3824 bytes");
        assert!(layout(PixelFormat::Grey, 80).read(&[]).is_err());
    }

    #[test]
    fn brightness_of_yuyv() {
        let row = |y: usize| {
            (0..SIZE.0)
                .flat_map(move |x| [grey(x, y), 200])
                .chain([255; 32])
        };
        let data: Vec<u8> = (0..SIZE.1).flat_map(row).collect();
        shows_the_picture(&layout(PixelFormat::Yuyv, 160).read(&data).unwrap(), 0);
        assert!(
            layout(PixelFormat::Yuyv, 160)
                .read(&data[..data.len() - 33])
                .is_err()
        );
    }

    #[test]
    fn brightness_of_uyvy() {
        let row = |y: usize| (0..SIZE.0).flat_map(move |x| [200, grey(x, y)]);
        let data: Vec<u8> = (0..SIZE.1).flat_map(row).collect();
        shows_the_picture(&layout(PixelFormat::Uyvy, 128).read(&data).unwrap(), 0);
    }

    #[test]
    fn brightness_of_mjpeg_with_and_without_huffman_tables() {
        let layout = layout(PixelFormat::Mjpeg, 64);
        shows_the_picture(&layout.read(WEBCAM).unwrap(), 3);
        let bare = without(0xC4, WEBCAM);
        assert!(bare.len() + 400 < WEBCAM.len());
        shows_the_picture(&layout.read(&bare).unwrap(), 3);
        // Without a JFIF segment, and with bytes after the end.
        let padded = [without(0xE0, &bare), vec![0; 100]].concat();
        shows_the_picture(&layout.read(&padded).unwrap(), 3);
    }

    #[test]
    fn a_jpeg_that_is_cut_off_or_of_another_size_is_no_image() {
        let right = layout(PixelFormat::Mjpeg, 64);
        for length in 0..WEBCAM.len() {
            // The end marker may be missing; its last byte of data may be of padding alone.
            assert!(
                length + 3 >= WEBCAM.len() || right.read(&WEBCAM[..length]).is_err(),
                "{length} of {} bytes",
                WEBCAM.len()
            );
            // The end of the buffer's previous content.
            let mut stale = WEBCAM[..length].to_vec();
            stale.resize(WEBCAM.len() + 3, 0);
            assert!(
                length + 2 > WEBCAM.len() || right.read(&stale).is_err(),
                "{length} bytes and zeros"
            );
        }
        for size in [(32, 48), (128, 48), (64, 40), (64, 64)] {
            let other = Layout {
                width: size.0,
                height: size.1,
                ..right
            };
            assert!(other.read(WEBCAM).is_err(), "{size:?}");
        }
    }

    #[test]
    fn a_jpeg_with_a_hole_is_hardly_ever_an_image() {
        let layout = layout(PixelFormat::Mjpeg, 64);
        let scan = WEBCAM
            .windows(2)
            .position(|two| two == [0xFF, 0xDA])
            .unwrap()
            + 14;
        let (mut holes, mut missed) = (0, 0);
        for begin in scan..WEBCAM.len() - 20 {
            for length in 8..WEBCAM.len() - 2 - begin {
                let holed = [&WEBCAM[..begin], &WEBCAM[begin + length..]].concat();
                holes += 1;
                missed += usize::from(layout.read(&holed).is_ok());
            }
        }
        // Cases in which the following bytes happen to decode like the missing ones. Drivers mark
        // most such images.
        assert!(missed * 50 < holes, "{missed} of {holes}");
    }

    #[test]
    fn no_bytes_make_it_panic() {
        let layout = layout(PixelFormat::Mjpeg, 64);
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..2_000 {
            let mut jpeg = WEBCAM.to_vec();
            for _ in 0..random.usize(1..8) {
                let place = random.usize(..jpeg.len());
                jpeg[place] = random.u8(..);
            }
            let _ = layout.read(&jpeg);
        }
    }
}
