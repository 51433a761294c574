//! Prefilters of block matching: capped edges instead of grey levels, so that cameras may differ in
//! brightness (Konolige 1997, section 3, uses the Laplacian of a Gaussian; OpenCV's StereoBM
//! x-Sobel).

use super::each_row;
use crate::error::Result;
use crate::kernel::{Isa, PREFILTER_CAP, Sads, log_row, sobel_row};
use crate::matcher::{Parameter, Range};
use crate::stereo::{Gray, buffer};

/// Edge operator of the prefilter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Prefilter {
    /// x-Sobel, three rows. The response in the last row of an image of odd height is 0, as in
    /// OpenCV, which filters rows in twos.
    Sobel,
    /// A Laplacian of a Gaussian, five rows, isotropic.
    Log,
}

impl Prefilter {
    /// The choice, as a parameter of the matchers.
    pub const CHOICE: Parameter = Parameter {
        name: "prefilter",
        unit: "",
        range: Range::Choice {
            default: "xsobel",
            options: &["xsobel", "log"],
        },
        description: "images to match: horizontal gradients (vertical edges), or the Laplacian of \
                      a Gaussian of the Small Vision System",
    };

    /// The prefilter that an option of [`Prefilter::CHOICE`] names.
    pub fn new(choice: &str) -> Self {
        if choice == "log" {
            Self::Log
        } else {
            Self::Sobel
        }
    }
}

/// A filtered image. Its rows are padded, for kernels that compare whole [`Sads`].
pub struct EdgeImage {
    width: usize,
    stride: usize,
    data: Vec<u8>,
}

impl EdgeImage {
    /// For images of that size.
    pub fn new(width: usize, height: usize) -> Result<Self> {
        let stride = width + Sads::COUNT;
        Ok(Self {
            width,
            stride,
            data: buffer(PREFILTER_CAP as u8, stride * height)?,
        })
    }

    /// Filters `image`, which must have this object's size.
    pub fn load(&mut self, isa: Isa, prefilter: Prefilter, image: &Gray) {
        let (width, last) = (self.width, image.height() - 1);
        each_row(&mut self.data, self.stride, 16, |y, row| {
            let out = &mut row[..width];
            // Rows outside the image are mirrored for x-Sobel, and clamped for the Laplacian.
            match prefilter {
                Prefilter::Sobel if y == last && last % 2 == 0 => out.fill(PREFILTER_CAP as u8),
                Prefilter::Sobel => {
                    let above = if y == 0 { 1 } else { y - 1 };
                    let below = if y == last { y - 1 } else { y + 1 };
                    sobel_row(isa, [above, y, below].map(|y| image.row(y)), out);
                }
                Prefilter::Log => {
                    let rows = [y.saturating_sub(2), y.saturating_sub(1), y, y + 1, y + 2];
                    log_row(isa, rows.map(|y| image.row(y.min(last))), out);
                }
            }
        });
    }

    /// Row `y` with its padding.
    pub fn row(&self, y: usize) -> &[u8] {
        &self.data[y * self.stride..][..self.stride]
    }
}
