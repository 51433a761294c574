//! svl for C and C++. `include/svl.h` is the interface and describes every function.
//!
//! A handle is a [`Ranger`] with the cells of its last pair in C's layout.

mod errors;
mod options;

pub use errors::Status;
pub use options::Options;

use errors::{Failure, guarded};
use parking_lot::Mutex;
use std::ffi::{CString, c_char, c_void};
use std::sync::LazyLock;
use svl_core::Error;
use svl_core::ranger::{Cells, ImageFormat, ImageRef, RangedCell, Ranger};
use svl_core::stereo::{CellState, NearSurface, Reason};

/// `svl_handle`. Locked: two threads at once are a mistake of the caller, and no crash.
pub struct Handle(Mutex<OpenHandle>);

struct OpenHandle {
    ranger: Ranger,
    cells: Vec<CCell>,
}

/// `svl_image`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct CImage {
    pub pixels: *const c_void,
    pub width: u32,
    pub height: u32,
    pub stride: usize,
    pub format: u32,
}

/// `svl_format`: the formats in the order of their numbers.
const FORMATS: [ImageFormat; 9] = [
    ImageFormat::Gray8,
    ImageFormat::Gray16 { bits: 10 },
    ImageFormat::Gray16 { bits: 12 },
    ImageFormat::Gray16 { bits: 14 },
    ImageFormat::Gray16 { bits: 16 },
    ImageFormat::Rgb8,
    ImageFormat::Bgr8,
    ImageFormat::Rgba8,
    ImageFormat::Bgra8,
];

/// `svl_cell`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct CCell {
    pub distance_m: f32,
    pub disparity_px: f32,
    pub probability: f32,
    pub valid_fraction: f32,
    pub state: u8,
    pub reason: u8,
    pub level: u8,
    reserved: u8,
    pub near_distance_m: f32,
    pub near_px: f32,
    pub surface_probability: f32,
}

impl From<&RangedCell> for CCell {
    fn from(cell: &RangedCell) -> Self {
        let surface =
            |value: fn(&NearSurface) -> f32| cell.surface.as_ref().map_or(f32::NAN, value);
        Self {
            distance_m: cell.distance_m.map_or(f32::NAN, |m| m as f32),
            disparity_px: cell.disparity_px.unwrap_or(f32::NAN),
            probability: cell.probability.map_or(f32::NAN, |p| p as f32),
            valid_fraction: cell.valid_share as f32,
            state: match cell.state {
                // The distance tells it.
                CellState::Far => CellState::Known.code(),
                state => state.code(),
            },
            reason: cell.reason as u8,
            level: cell.level,
            reserved: 0,
            near_distance_m: surface(|surface| surface.distance_m as f32),
            near_px: surface(|surface| surface.px),
            surface_probability: surface(|surface| surface.probability as f32),
        }
    }
}

impl CImage {
    /// # Safety
    /// `image` is null or valid as the header says, as long as `'a`.
    unsafe fn read<'a>(image: *const Self, side: &str) -> Result<ImageRef<'a>, Error> {
        let wrong = |what: &str| Error::Invalid(format!("the {side} image {what}"));
        // SAFETY: as the caller promised.
        let image = unsafe { image.as_ref() }.ok_or_else(|| wrong("is a null pointer"))?;
        if image.pixels.is_null() {
            return Err(wrong("has a null pointer as its pixels"));
        }
        let format = FORMATS.get(image.format as usize).copied();
        let format = format
            .ok_or_else(|| wrong(&format!("has the format {}, no svl_format", image.format)))?;
        let (width, height) = (image.width as usize, image.height as usize);
        let row_bytes = width * format.bytes();
        let stride = match image.stride {
            0 => row_bytes,
            stride => stride,
        };
        // Before memory of that size is assumed: what no caller has.
        let bytes = stride
            .checked_mul(height.saturating_sub(1))
            .and_then(|bytes| bytes.checked_add(row_bytes))
            .filter(|bytes| isize::try_from(*bytes).is_ok())
            .ok_or_else(|| wrong("has an impossible size"))?;
        // SAFETY: the caller has `height` rows of `width` pixels, `stride` bytes apart.
        let bytes = unsafe { std::slice::from_raw_parts(image.pixels.cast(), bytes) };
        ImageRef::new(bytes, (width, height), stride, format)
    }
}

/// # Safety
/// `options` is null or valid as the header says; `out` is null or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn svl_open(options: *const Options, out: *mut *mut Handle) -> Status {
    guarded(|| {
        // SAFETY: as the caller promised.
        let Some(out) = (unsafe { out.as_mut() }) else {
            return Err(Error::Invalid("handle is a null pointer".into()).into());
        };
        *out = std::ptr::null_mut();
        // SAFETY: as the caller promised.
        let ranger = unsafe { options::read(options)?.open()? };
        let cells = Vec::new();
        let opened = Handle(Mutex::new(OpenHandle { ranger, cells }));
        *out = Box::into_raw(Box::new(opened));
        Ok(())
    })
}

/// # Safety
/// `handle` is of [`svl_open`]; the images are as the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn svl_match(
    handle: *mut Handle,
    left: *const CImage,
    right: *const CImage,
    stamp_ns: u64,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promised.
        let mut handle = unsafe { borrow(handle)? }.0.lock();
        let OpenHandle { ranger, cells } = &mut *handle;
        cells.clear();
        // SAFETY: as the caller promised.
        let [left, right] = unsafe { [CImage::read(left, "left")?, CImage::read(right, "right")?] };
        let found = match stamp_ns {
            0 => ranger.cells(left, right)?,
            stamp_ns => ranger.cells_at(left, right, stamp_ns)?,
        };
        cells.extend(found.iter().map(CCell::from));
        Ok(())
    })
}

/// # Safety
/// `handle` is of [`svl_open`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn svl_reset(handle: *mut Handle) -> Status {
    guarded(|| {
        // SAFETY: as the caller promised.
        unsafe { borrow(handle)? }.0.lock().ranger.reset();
        Ok(())
    })
}

/// # Safety
/// `handle` is of [`svl_open`]; the other pointers are null or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn svl_cells(
    handle: *mut Handle,
    cells: *mut *const CCell,
    columns: *mut u32,
    rows: *mut u32,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promised.
        let handle = unsafe { borrow(handle)? }.0.lock();
        // A pair that failed leaves no result of an earlier one.
        if handle.cells.is_empty() {
            return Err(Failure::no_result());
        }
        let shape = handle.ranger.last_cells().map(Cells::shape);
        let shape = shape.ok_or_else(Failure::no_result)?;
        // SAFETY: as the caller promised.
        unsafe {
            put(cells, handle.cells.as_ptr());
            put(columns, shape.columns as u32);
            put(rows, shape.rows as u32);
        }
        Ok(())
    })
}

/// # Safety
/// The conditions of [`svl_cells`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn svl_disparities(
    handle: *mut Handle,
    disparities: *mut *const f32,
    reasons: *mut *const u8,
    width: *mut u32,
    height: *mut u32,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promised.
        let handle = unsafe { borrow(handle)? }.0.lock();
        let map = handle
            .ranger
            .disparity()
            .filter(|_| !handle.cells.is_empty());
        let map = map.ok_or_else(Failure::no_result)?;
        let size = map.size();
        // A map's planes have no gaps between rows.
        let pixels = map.disparity().as_slice().map_or(&[][..], |pixels| pixels);
        let codes = map.why().as_slice().map_or(&[][..], |reasons| reasons);
        // SAFETY: as the caller promised; a reason is its code.
        unsafe {
            put(disparities, pixels.as_ptr());
            put(reasons, codes.as_ptr().cast());
            put(width, size.0 as u32);
            put(height, size.1 as u32);
        }
        Ok(())
    })
}

/// # Safety
/// `handle` is null or of [`svl_open`], and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn svl_close(handle: *mut Handle) {
    if !handle.is_null() {
        // SAFETY: as the caller promised.
        drop(unsafe { Box::from_raw(handle) });
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn svl_error() -> *const c_char {
    errors::last()
}

#[unsafe(no_mangle)]
pub extern "C" fn svl_reason_name(reason: u8) -> *const c_char {
    static NAMES: LazyLock<Vec<CString>> =
        LazyLock::new(|| Reason::ALL.map(|reason| owned(reason.name())).into());
    let name = NAMES.get(usize::from(reason)).map(CString::as_c_str);
    name.unwrap_or_default().as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn svl_version() -> *const c_char {
    static VERSION: LazyLock<CString> = LazyLock::new(|| owned(env!("CARGO_PKG_VERSION")));
    VERSION.as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn svl_instruction_set() -> *const c_char {
    static NAME: LazyLock<CString> =
        LazyLock::new(|| owned(svl_core::kernel::isa().map_or("", |isa| isa.name())));
    NAME.as_ptr()
}

fn owned(text: &str) -> CString {
    CString::new(text).unwrap_or_default()
}

/// # Safety
/// `handle` is null or of [`svl_open`].
unsafe fn borrow<'a>(handle: *mut Handle) -> Result<&'a Handle, Error> {
    // SAFETY: as the caller promised.
    unsafe { handle.as_ref() }.ok_or_else(|| Error::Invalid("handle is a null pointer".into()))
}

/// # Safety
/// `place` is null or may be written.
unsafe fn put<T>(place: *mut T, value: T) {
    if !place.is_null() {
        // SAFETY: as the caller promised.
        unsafe { place.write(value) };
    }
}
