//! Planes of pixels.

use crate::error::{Error, Result};

/// Longest side of an image that svl accepts, in pixels.
pub const MAX_SIDE: usize = 16_384;

/// A row-major plane of pixels whose rows are `stride` elements apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane<T> {
    width: usize,
    height: usize,
    stride: usize,
    data: Vec<T>,
}

/// An 8-bit grey image.
pub type Gray = Plane<u8>;

/// An 8-bit colour image: red, green, blue.
pub type Rgb = Plane<[u8; 3]>;

/// `n` times `value`, in memory of its own. All memory whose size grows with an image's comes from
/// here or from [`reserve`]: a host does not end because there is none.
///
/// # Errors
/// [`Error::Memory`].
pub fn buffer<T: Clone>(value: T, n: usize) -> Result<Vec<T>> {
    let mut values = reserve(n)?;
    values.resize(n, value);
    Ok(values)
}

/// Memory for `n` values.
///
/// # Errors
/// [`Error::Memory`].
pub fn reserve<T>(n: usize) -> Result<Vec<T>> {
    let mut values = Vec::new();
    let bytes = n.saturating_mul(size_of::<T>());
    match values.try_reserve_exact(n) {
        Ok(()) => Ok(values),
        Err(_) => Err(Error::Memory { bytes }),
    }
}

impl<T: Copy> Plane<T> {
    /// A plane filled with `value`.
    ///
    /// # Errors
    /// [`Error::Dimensions`] if a side is 0 or above [`MAX_SIDE`]; [`Error::Memory`].
    pub fn filled(width: usize, height: usize, value: T) -> Result<Self> {
        check_size(width, height)?;
        Ok(Self {
            width,
            height,
            stride: width,
            data: buffer(value, width * height)?,
        })
    }

    /// A plane over `data`, `width * height` pixels without gaps.
    ///
    /// # Errors
    /// [`Error::Dimensions`] or [`Error::Size`].
    pub fn from_vec(width: usize, height: usize, data: Vec<T>) -> Result<Self> {
        Self::from_strided(width, height, width, data)
    }

    /// A plane over `data` whose row `y` begins at `y * stride`.
    ///
    /// # Errors
    /// [`Error::Dimensions`], or [`Error::Size`] if `stride < width` or `data` is too short.
    pub fn from_strided(width: usize, height: usize, stride: usize, data: Vec<T>) -> Result<Self> {
        check_size(width, height)?;
        let expected = stride
            .max(width)
            .saturating_mul(height - 1)
            .saturating_add(width);
        if stride < width || data.len() < expected {
            return Err(Error::Size {
                width,
                height,
                expected,
                got: data.len(),
            });
        }
        Ok(Self {
            width,
            height,
            stride,
            data,
        })
    }

    /// A plane whose pixel `(x, y)` is `f(x, y)`.
    ///
    /// # Errors
    /// [`Error::Dimensions`], [`Error::Memory`].
    pub fn from_fn(width: usize, height: usize, f: impl Fn(usize, usize) -> T) -> Result<Self> {
        check_size(width, height)?;
        let mut data = reserve(width * height)?;
        // Row by row: an iterator over all pixels does not know its length.
        (0..height).for_each(|y| data.extend((0..width).map(|x| f(x, y))));
        Ok(Self {
            width,
            height,
            stride: width,
            data,
        })
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.height
    }

    /// `(width, height)`.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Row `y`, `width` pixels.
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.stride..][..self.width]
    }

    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        &mut self.data[y * self.stride..][..self.width]
    }

    /// All rows, top to bottom.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[T]> {
        (0..self.height).map(|y| self.row(y))
    }

    /// All pixels in raster order, without the gaps between rows.
    pub fn pixels(&self) -> impl Iterator<Item = T> {
        self.rows().flatten().copied()
    }

    pub fn get(&self, x: usize, y: usize) -> T {
        self.row(y)[x]
    }

    pub fn set(&mut self, x: usize, y: usize, value: T) {
        self.row_mut(y)[x] = value;
    }

    /// The pixels as one slice, if there are no gaps between rows; only [`Plane::from_strided`]
    /// leaves gaps.
    pub fn as_slice(&self) -> Option<&[T]> {
        (self.stride == self.width).then(|| &self.data[..self.width * self.height])
    }

    /// [`Plane::as_slice`], mutable.
    pub fn as_mut_slice(&mut self) -> Option<&mut [T]> {
        (self.stride == self.width).then(|| &mut self.data[..self.width * self.height])
    }

    /// The pixels with their gaps, and the elements from a row to the next.
    pub(crate) fn strided(&self) -> (&[T], usize) {
        (&self.data, self.stride)
    }

    /// A plane of the same size with `f` applied to every pixel.
    pub fn map<U: Copy>(&self, f: impl Fn(T) -> U) -> Plane<U> {
        let mut data = Vec::with_capacity(self.width * self.height);
        // Row by row, which the compiler vectorizes; a chain of all pixels it does not.
        self.rows()
            .for_each(|row| data.extend(row.iter().map(|&value| f(value))));
        Plane {
            width: self.width,
            height: self.height,
            stride: self.width,
            data,
        }
    }
}

impl Gray {
    /// The luma of a colour image: `(299 R + 587 G + 114 B + 500) / 1000`.
    pub fn from_color(image: &Rgb) -> Self {
        image.map(luma)
    }
}

/// The luma of red, green and blue, as of [`Gray::from_color`].
pub(crate) fn luma([r, g, b]: [u8; 3]) -> u8 {
    let weigh = |value: u8, weight: u32| weight * u32::from(value);
    ((weigh(r, 299) + weigh(g, 587) + weigh(b, 114) + 500) / 1000) as u8
}

fn check_size(width: usize, height: usize) -> Result<()> {
    if (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height) {
        Ok(())
    } else {
        Err(Error::Dimensions {
            width,
            height,
            max: MAX_SIDE,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strided_rows_skip_the_gap() {
        let plane = Plane::from_strided(2, 2, 3, vec![1, 2, 99, 3, 4]).unwrap();
        assert_eq!(plane.row(1), [3, 4]);
        assert_eq!(plane.pixels().collect::<Vec<_>>(), [1, 2, 3, 4]);
        assert!(plane.as_slice().is_none());
    }

    #[test]
    fn sizes_are_checked() {
        assert!(matches!(
            Gray::filled(0, 4, 0),
            Err(Error::Dimensions { .. })
        ));
        assert!(matches!(
            Gray::from_vec(2, 2, vec![0; 3]),
            Err(Error::Size {
                expected: 4,
                got: 3,
                ..
            })
        ));
        assert!(matches!(
            Gray::from_strided(4, 2, 3, vec![0; 99]),
            Err(Error::Size { .. })
        ));
    }

    #[test]
    fn grey_is_rounded() {
        let color = Rgb::from_vec(2, 1, vec![[255; 3], [10, 20, 30]]).unwrap();
        assert_eq!(Gray::from_color(&color).row(0), [255, 18]);
    }
}
