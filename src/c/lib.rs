//! svl for C and C++. `include/svl.h` is the interface and describes every function.
//!
//! ```text
//! svl_match ── copies the pair ──▶ worker (in a thread pool of its own) ──▶ Engine ──▶ svl_cells
//! ```

mod engine;
mod errors;
mod worker;

pub use engine::CCell;
pub use errors::Status;

use engine::{Engine, Image};
use errors::guarded;
use std::ffi::{CStr, CString, c_char};
use std::path::PathBuf;
use std::sync::LazyLock;
use svl_core::Error;
use svl_core::stereo::{Reason, Rig};
use worker::PairWorker;

/// `svl_handle`.
pub struct Handle {
    worker: PairWorker,
}

/// `svl_options`.
#[repr(C)]
pub struct Options {
    pub algorithm: *const c_char,
    pub calibration: *const c_char,
    pub filters: *const *const c_char,
    pub filter_count: usize,
    pub focal_px: f64,
    pub baseline_m: f64,
    pub cx_px: f64,
    pub cy_px: f64,
    pub doffs_px: f64,
    pub columns: u32,
    pub rows: u32,
    pub threads: u32,
}

impl Default for Options {
    /// As a C program's zeroes.
    fn default() -> Self {
        Self {
            algorithm: std::ptr::null(),
            calibration: std::ptr::null(),
            filters: std::ptr::null(),
            filter_count: 0,
            focal_px: 0.0,
            baseline_m: 0.0,
            cx_px: 0.0,
            cy_px: 0.0,
            doffs_px: 0.0,
            columns: 0,
            rows: 0,
            threads: 0,
        }
    }
}

const MAX_THREADS: u32 = 1024;
/// Limit of filters per handle: one of each kind would do.
const MAX_FILTERS: usize = 16;

/// The text at `text`; none for a null pointer.
///
/// # Safety
/// `text` is null or a C string that lives as long as `'a`.
unsafe fn text<'a>(text: *const c_char, name: &str) -> Result<Option<&'a str>, Error> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: as the caller promised.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str()
        .map(Some)
        .map_err(|_| Error::Invalid(format!("{name} is not UTF-8")))
}

impl Options {
    /// # Safety
    /// The pointers are null or valid C strings, and `filters` has `filter_count` of them.
    unsafe fn engine(&self) -> Result<Engine, Error> {
        // SAFETY: as the caller promised.
        let (algorithm, calibration) = unsafe {
            (
                text(self.algorithm, "algorithm")?,
                text(self.calibration, "calibration")?,
            )
        };
        if self.filter_count > MAX_FILTERS || (self.filter_count > 0 && self.filters.is_null()) {
            let count = self.filter_count;
            return Err(Error::Invalid(format!(
                "filters: {count} of them; expected at most {MAX_FILTERS} and no null pointer"
            )));
        }
        let mut filters = Vec::new();
        for i in 0..self.filter_count {
            // SAFETY: as the caller promised.
            let path = unsafe { text(*self.filters.add(i), "a filter")? };
            let path = path.ok_or_else(|| Error::Invalid("a filter is a null pointer".into()))?;
            filters.push(PathBuf::from(path));
        }
        let rig = if self.focal_px == 0.0 {
            None
        } else {
            let center_px = (self.cx_px, self.cy_px);
            let rig = Rig::new(self.focal_px, center_px, self.baseline_m, self.doffs_px)?;
            Some(rig)
        };
        let cells = match (self.columns, self.rows) {
            (0, 0) => None,
            cells => Some(cells),
        };
        Engine::new(
            algorithm,
            calibration.map(PathBuf::from),
            &filters,
            rig,
            cells,
        )
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
        let defaults = Options::default();
        // SAFETY: as the caller promised.
        let options = unsafe { options.as_ref() }.unwrap_or(&defaults);
        // SAFETY: as the caller promised.
        let engine = unsafe { options.engine()? };
        if options.threads > MAX_THREADS {
            let count = options.threads;
            let words = format!("{count} threads: expected at most {MAX_THREADS}, or 0 for all");
            return Err(Error::Invalid(words).into());
        }
        let worker = PairWorker::start(engine, options.threads as usize)?;
        *out = Box::into_raw(Box::new(Handle { worker }));
        Ok(())
    })
}

/// # Safety
/// `handle` is of [`svl_open`]; the images have `height` rows of `width` bytes, `stride` apart.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn svl_match(
    handle: *mut Handle,
    left: *const u8,
    right: *const u8,
    width: u32,
    height: u32,
    stride: usize,
    stamp_ns: u64,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promised.
        let handle = unsafe { borrow(handle)? };
        let stamp_ns = (stamp_ns != 0).then_some(stamp_ns);
        let stride = if stride == 0 { width as usize } else { stride };
        let image = |pixels| Image::new(pixels, width as usize, height as usize, stride);
        handle.worker.run(image(left)?, image(right)?, stamp_ns)
    })
}

/// # Safety
/// `handle` is of [`svl_open`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn svl_reset(handle: *mut Handle) -> Status {
    guarded(|| {
        // SAFETY: as the caller promised.
        let handle = unsafe { borrow(handle)? };
        handle.worker.reset()
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
        let handle = unsafe { borrow(handle)? };
        handle.worker.result(|engine| {
            let shape = engine.shape();
            // SAFETY: as the caller promised.
            unsafe {
                put(cells, engine.cells().as_ptr());
                put(columns, shape.columns as u32);
                put(rows, shape.rows as u32);
            }
        })
    })
}

/// # Safety
/// As [`svl_cells`].
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
        let handle = unsafe { borrow(handle)? };
        handle.worker.result(|engine| {
            let map = engine.map();
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
        })
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
