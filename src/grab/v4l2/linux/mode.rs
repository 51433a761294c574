//! Modes of a camera, and the choice of one for two cameras.

use crate::camera_error;
use std::fmt;
use svl_core::Result;

/// Pixel formats that svl reads, simplest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum PixelFormat {
    /// 8-bit grey.
    Grey,
    /// YUV 4:2:2, luma and chroma alternating; svl uses the luma.
    Yuyv,
    /// The same with the chroma first, as of GMSL cameras.
    Uyvy,
    /// A JPEG per image.
    Mjpeg,
}

impl PixelFormat {
    const ALL: [Self; 4] = [Self::Grey, Self::Yuyv, Self::Uyvy, Self::Mjpeg];

    /// The kernel's FourCC.
    pub(super) fn code(self) -> u32 {
        u32::from_le_bytes(match self {
            Self::Grey => *b"GREY",
            Self::Yuyv => *b"YUYV",
            Self::Uyvy => *b"UYVY",
            Self::Mjpeg => *b"MJPG",
        })
    }

    /// Bytes of a pixel in its row; 1 of a JPEG, which has no rows.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Yuyv | Self::Uyvy => 2,
            Self::Grey | Self::Mjpeg => 1,
        }
    }

    pub(super) fn from_name(name: &str) -> Option<Self> {
        let mut formats = Self::ALL.into_iter();
        formats.find(|format| format.to_string() == name)
    }

    pub(super) fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.code() == code)
    }
}

impl fmt::Display for PixelFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Grey => "GREY",
            Self::Yuyv => "YUYV",
            Self::Uyvy => "UYVY",
            Self::Mjpeg => "MJPG",
        })
    }
}

/// A mode of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mode {
    pub format: PixelFormat,
    /// Columns and rows.
    pub size: (usize, usize),
    /// Highest rate, if the driver reports it.
    pub max_rate_hz: Option<f64>,
}

/// Mode requested for both cameras.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wish {
    pub size: Option<(usize, usize)>,
    pub format: Option<PixelFormat>,
    pub rate_hz: f64,
    /// If there is a choice, the size nearest to this one is used.
    pub usual: (usize, usize),
}

/// The usual size of an image.
pub(super) const USUAL: (usize, usize) = (640, 480);

/// Format and size for both cameras. Among the modes that both have and the user allows: those that
/// hold the rate or come nearest to it; among these the size nearest to the usual one; and that in
/// the simplest format.
///
/// # Errors
/// [`crate::CameraError`] if there is none.
pub(super) fn choose(wish: Wish, modes: [&[Mode]; 2]) -> Result<(PixelFormat, (usize, usize))> {
    let rate_hz = |mode: &Mode| mode.max_rate_hz.unwrap_or(wish.rate_hz);
    let common = modes[0].iter().filter_map(|left| {
        let right = modes[1]
            .iter()
            // Equal formats, as one JPEG and one raw image would differ in noise and latency.
            .find(|right| (right.format, right.size) == (left.format, left.size))?;
        let is_wanted = wish.format.is_none_or(|f| f == left.format)
            && wish.size.is_none_or(|size| size == left.size);
        // Rates are integer fractions of the camera's clock: 29.97 holds 30.
        let missing_hz = (0.99 * wish.rate_hz - rate_hz(left).min(rate_hz(right))).max(0.0);
        is_wanted.then_some((missing_hz, left.size.0 * left.size.1, *left))
    });
    let best = common.min_by(|(a_hz, a_px, a), (b_hz, b_px, b)| {
        let off = |px: &usize| px.abs_diff(wish.usual.0 * wish.usual.1);
        a_hz.total_cmp(b_hz)
            .then(off(a_px).cmp(&off(b_px)))
            .then(a.size.cmp(&b.size))
            .then(a.format.cmp(&b.format))
    });
    best.map(|(_, _, mode)| (mode.format, mode.size))
        .ok_or_else(|| {
            let size = wish.size.map_or(String::new(), |(width, height)| {
                format!(" of {width}x{height}")
            });
            let format = wish
                .format
                .map_or("GREY, YUYV, UYVY or MJPG".to_owned(), |format| {
                    format.to_string()
                });
            let cure = "`svl record --list` lists their modes";
            let reason = format!("the cameras have no {format} mode{size} in common; {cure}");
            camera_error("v4l2", reason)
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(format: PixelFormat, size: (usize, usize), rate_hz: f64) -> Mode {
        Mode {
            format,
            size,
            max_rate_hz: Some(rate_hz),
        }
    }

    const ANY: Wish = Wish {
        size: None,
        format: None,
        rate_hz: 30.0,
        usual: USUAL,
    };

    #[test]
    fn a_mode_of_both_that_holds_the_rate_is_chosen() {
        use PixelFormat::{Grey, Mjpeg, Yuyv};
        let webcam = [
            mode(Mjpeg, (640, 480), 60.0),
            mode(Yuyv, (1280, 720), 10.0),
            mode(Yuyv, (640, 480), 30.0),
            mode(Yuyv, (320, 240), 60.0),
        ];
        let both = [&webcam[..], &webcam[..]];
        assert_eq!(choose(ANY, both).unwrap(), (Yuyv, (640, 480)));
        assert_eq!(
            choose(
                Wish {
                    rate_hz: 60.0,
                    ..ANY
                },
                both
            )
            .unwrap(),
            (Mjpeg, (640, 480))
        );
        // None is that fast: the fastest.
        assert_eq!(
            choose(
                Wish {
                    rate_hz: 90.0,
                    format: Some(Yuyv),
                    ..ANY
                },
                both
            )
            .unwrap(),
            (Yuyv, (320, 240))
        );
        assert_eq!(
            choose(
                Wish {
                    size: Some((1280, 720)),
                    ..ANY
                },
                both
            )
            .unwrap(),
            (Yuyv, (1280, 720))
        );
        // The other camera is slower.
        let slow = [mode(Yuyv, (640, 480), 15.0), mode(Yuyv, (320, 240), 29.97)];
        assert_eq!(choose(ANY, [&webcam, &slow]).unwrap(), (Yuyv, (320, 240)));
        // Unknown rates count as sufficient.
        let silent = [Mode {
            max_rate_hz: None,
            ..mode(Grey, (1280, 800), 0.0)
        }];
        assert_eq!(
            choose(ANY, [&silent, &silent]).unwrap(),
            (Grey, (1280, 800))
        );
    }

    #[test]
    fn cameras_without_a_common_mode_are_an_error() {
        let (grey, yuyv) = (
            [mode(PixelFormat::Grey, (64, 48), 30.0)],
            [mode(PixelFormat::Yuyv, (64, 48), 30.0)],
        );
        let error = choose(ANY, [&grey, &yuyv]).unwrap_err().to_string();
        assert!(
            error.contains("no GREY, YUYV, UYVY or MJPG mode in common"),
            "{error}"
        );
        let wish = Wish {
            size: Some((99, 9)),
            format: Some(PixelFormat::Grey),
            ..ANY
        };
        let error = choose(wish, [&grey, &grey]).unwrap_err().to_string();
        assert!(error.contains("no GREY mode of 99x9 in common"), "{error}");
    }
}
