//! Arrays of numpy as images, without a copy, and images as arrays.

use numpy::PyUntypedArrayMethods;
use numpy::{Element, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use svl_core::Result;
use svl_core::ranger::{ImageFormat, ImageRef};
use svl_core::stereo::{Plane, reserve};

/// An array that is an image, and borrowed as long as this lives.
enum ImageArray<'py> {
    Eight(PyReadonlyArrayDyn<'py, u8>),
    Sixteen(PyReadonlyArrayDyn<'py, u16>),
}

/// What an array does not say of its image.
#[derive(Clone, Copy)]
struct PixelLayout {
    /// Bits in use, of arrays of uint16.
    bits: Option<u8>,
    /// True if the first channel is blue.
    is_bgr: bool,
}

impl<'py> ImageArray<'py> {
    fn new(array: &Bound<'py, PyAny>, side: &str) -> PyResult<Self> {
        if let Ok(array) = array.cast::<PyArrayDyn<u8>>() {
            return Ok(Self::Eight(array.try_readonly()?));
        }
        if let Ok(array) = array.cast::<PyArrayDyn<u16>>() {
            return Ok(Self::Sixteen(array.try_readonly()?));
        }
        let expected = "expected a numpy array of uint8 or uint16";
        Err(PyTypeError::new_err(format!("{side}: {expected}")))
    }

    fn image(&self, side: &str, layout: PixelLayout) -> PyResult<ImageRef<'_>> {
        match self {
            Self::Eight(array) => image(array, side, layout),
            Self::Sixteen(array) => image(array, side, layout),
        }
    }
}

fn image<'a, T: Element>(
    array: &'a PyReadonlyArrayDyn<'_, T>,
    side: &str,
    layout: PixelLayout,
) -> PyResult<ImageRef<'a>> {
    let wrong = |what: String| PyValueError::new_err(format!("{side}: {what}"));
    let item = size_of::<T>();
    let (height, width, channels) = match *array.shape() {
        [height, width] => (height, width, 1),
        [height, width, channels] if item == 1 && [3, 4].contains(&channels) => {
            (height, width, channels)
        }
        _ => {
            return Err(wrong(format!(
                "an array of shape {:?} is no image; expected (height, width), or (height, width, \
                 3 or 4) of uint8",
                array.shape()
            )));
        }
    };
    if width == 0 || height == 0 {
        return Err(wrong(format!("an image of {width}x{height} pixels")));
    }
    let format = match (item, channels, layout.is_bgr) {
        (1, 1, _) => ImageFormat::Gray8,
        (1, 3, false) => ImageFormat::Rgb8,
        (1, 3, true) => ImageFormat::Bgr8,
        (1, _, false) => ImageFormat::Rgba8,
        (1, _, true) => ImageFormat::Bgra8,
        _ => {
            let missing = "uint16 needs bits=N, those in use of its 16: 10 of a mono10 camera";
            let bits = layout.bits.ok_or_else(|| wrong(missing.to_owned()))?;
            ImageFormat::Gray16 { bits }
        }
    };
    let strides = array.strides();
    let row_bytes = width * format.bytes();
    let is_packed = (width == 1 || strides[1] == format.bytes() as isize)
        && strides.get(2).is_none_or(|stride| *stride == item as isize);
    let stride = match usize::try_from(strides[0]) {
        _ if height == 1 => row_bytes,
        Ok(stride) if stride >= row_bytes => stride,
        _ => 0,
    };
    if !is_packed || stride == 0 {
        let cure = "rows may have gaps, pixels may not, and neither go backwards";
        return Err(wrong(format!("strides of {strides:?} bytes: {cure}")));
    }
    let bytes = stride * (height - 1) + row_bytes;
    // SAFETY: the array has `height` rows of `row_bytes` bytes, `stride` apart, and lives as long
    // as its borrow. As with every library that releases the GIL, a thread of Python that writes
    // to it meanwhile gets a result of mixed pixels.
    let bytes = unsafe { std::slice::from_raw_parts(array.data().cast::<u8>(), bytes) };
    ImageRef::new(bytes, (width, height), stride, format).map_err(|error| wrong(error.to_string()))
}

/// An array of a shape, over the memory of `values`.
pub(super) fn array<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: impl Into<Vec<usize>>,
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    PyArray1::from_vec(py, values).reshape(shape.into())
}

/// Left and right as images, while `work` is done.
pub(super) fn with_pair<R>(
    [left, right]: [&Bound<'_, PyAny>; 2],
    bits: Option<i64>,
    is_bgr: bool,
    work: impl FnOnce([ImageRef<'_>; 2]) -> PyResult<R>,
) -> PyResult<R> {
    let bits = bits.map(|bits| number("bits", bits, "8 to 16"));
    let bits = bits.transpose()?;
    let layout = PixelLayout { bits, is_bgr };
    let [left, right] = [
        ImageArray::new(left, "left")?,
        ImageArray::new(right, "right")?,
    ];
    work([left.image("left", layout)?, right.image("right", layout)?])
}

/// A number of Python that has to fit into `T`.
pub(super) fn number<T: TryFrom<i64>>(name: &str, value: i64, expected: &str) -> PyResult<T> {
    let wrong = |_| PyValueError::new_err(format!("{name}={value}: expected {expected}"));
    T::try_from(value).map_err(wrong)
}

/// The pixels of a plane, row by row, each changed by `value`.
pub(super) fn pixels<T: Copy, U>(plane: &Plane<T>, value: impl Fn(T) -> U) -> Result<Vec<U>> {
    let (width, height) = plane.size();
    let mut pixels = reserve(width * height)?;
    let rows = plane.rows();
    rows.for_each(|row| pixels.extend(row.iter().map(|pixel| value(*pixel))));
    Ok(pixels)
}
