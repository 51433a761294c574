//! `svl_options`, and what they open.

use crate::errors::Failure;
use std::ffi::{CStr, c_char};
use std::mem::offset_of;
use std::path::Path;
use std::sync::Arc;
use svl_calibrate::files::{self, Hints};
use svl_core::Error;
use svl_core::filter::FilterModel;
use svl_core::ranger::{Optics, Ranger, RangerOptions};
use svl_core::stereo::{GridShape, Rig, StereoCalibration};

/// `svl_options`. A new field is appended, and its 0 means what was before.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Options {
    pub size: usize,
    pub algorithm: *const c_char,
    pub calibration: *const c_char,
    pub calibration_texts: *const *const c_char,
    pub calibration_text_count: usize,
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
    /// Values of `SVL_OPTIONS` in the header.
    fn default() -> Self {
        Self {
            size: size_of::<Self>(),
            algorithm: std::ptr::null(),
            calibration: std::ptr::null(),
            calibration_texts: std::ptr::null(),
            calibration_text_count: 0,
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

/// The `count` texts at `texts`, at most `most`.
///
/// # Safety
/// `texts` is null or has `count` C strings that live as long as `'a`.
unsafe fn list<'a>(
    texts: *const *const c_char,
    count: usize,
    most: usize,
    name: &str,
) -> Result<Vec<&'a str>, Error> {
    if count > most || (count > 0 && texts.is_null()) {
        return Err(Error::Invalid(format!(
            "{name}: {count} of them; expected at most {most} and no null pointer"
        )));
    }
    (0..count)
        .map(|i| {
            // SAFETY: as the caller promised.
            let text = unsafe { text(*texts.add(i), name)? };
            text.ok_or_else(|| Error::Invalid(format!("{name}: one is a null pointer")))
        })
        .collect()
}

/// The ends of the fields of the options.
const FIELD_ENDS: [usize; 15] = [
    offset_of!(Options, algorithm),
    offset_of!(Options, calibration),
    offset_of!(Options, calibration_texts),
    offset_of!(Options, calibration_text_count),
    offset_of!(Options, filters),
    offset_of!(Options, filter_count),
    offset_of!(Options, focal_px),
    offset_of!(Options, baseline_m),
    offset_of!(Options, cx_px),
    offset_of!(Options, cy_px),
    offset_of!(Options, doffs_px),
    offset_of!(Options, columns),
    offset_of!(Options, rows),
    offset_of!(Options, threads),
    size_of::<Options>(),
];

/// The options at `options`; those of an older header are completed by zeroes.
///
/// # Safety
/// `options` is null, or has as many bytes as its first field says.
pub unsafe fn read(options: *const Options) -> Result<Options, Error> {
    if options.is_null() {
        return Ok(Options::default());
    }
    let (size, known) = (
        // SAFETY: as the caller promised; the size is the first field.
        unsafe { options.cast::<usize>().read() },
        size_of::<Options>(),
    );
    let what = format!("svl_options.size is {size}, the library's is {known}");
    if size < size_of::<usize>() {
        let cure = "begin with `svl_options options = SVL_OPTIONS;`";
        return Err(Error::Invalid(format!("{what}: {cure}")));
    }
    if size > known {
        let cure = "the header is of a newer svl than the library; take both of one";
        return Err(Error::Invalid(format!("{what}: {cure}")));
    }
    if !FIELD_ENDS.contains(&size) {
        let cure = "use sizeof(svl_options)";
        return Err(Error::Invalid(format!(
            "{what} and ends within a field: {cure}"
        )));
    }
    let mut read = Options::default();
    // SAFETY: the caller has `size` bytes, which are not more than an `Options` has. All fields
    // may have any bits, and those behind `size` remain 0.
    unsafe {
        let into = std::ptr::from_mut(&mut read).cast::<u8>();
        std::ptr::copy_nonoverlapping(options.cast::<u8>(), into, size);
    }
    Ok(read)
}

impl Options {
    /// # Safety
    /// The pointers are null or valid C strings, and the lists have as many as their counts say.
    pub unsafe fn open(&self) -> Result<Ranger, Failure> {
        let (filter_files, count) = (self.filters, self.filter_count);
        // SAFETY: as the caller promised.
        let (algorithm, optics, filter_files) = unsafe {
            (
                text(self.algorithm, "algorithm")?.unwrap_or("v5"),
                self.optics()?,
                list(filter_files, count, MAX_FILTERS, "filters")?,
            )
        };
        let filters = filter_files
            .into_iter()
            .map(|path| FilterModel::read(Path::new(path)).map(Arc::new))
            .collect::<Result<_, _>>()?;
        let default = GridShape::default();
        let given = |n: u32, default| if n == 0 { default } else { n as usize };
        let cells = GridShape {
            columns: given(self.columns, default.columns),
            rows: given(self.rows, default.rows),
        };
        let options = RangerOptions {
            cells,
            filters,
            threads: self.threads as usize,
        };
        Ok(Ranger::open(algorithm, optics, &options)?)
    }

    /// # Safety
    /// The conditions of [`Options::open`].
    unsafe fn optics(&self) -> Result<Optics, Error> {
        // SAFETY: as the caller promised.
        let calibration = unsafe { self.calibration()? };
        let others = [self.baseline_m, self.cx_px, self.cy_px, self.doffs_px];
        if self.focal_px == 0.0 && others != [0.0; 4] {
            let words = "a rig without focal_px: set it, or leave baseline_m and the rest 0, too";
            return Err(Error::Invalid(words.into()));
        }
        match (calibration, self.focal_px == 0.0) {
            (Some(calibration), true) => Ok(calibration.into()),
            (None, true) => Ok(Optics::Unknown),
            (None, false) => {
                let center_px = (self.cx_px, self.cy_px);
                let rig = Rig::new(self.focal_px, center_px, self.baseline_m, self.doffs_px)?;
                Ok(rig.into())
            }
            (Some(_), false) => {
                let words = "a calibration and a rig: the former contains a rig, set focal_px to 0";
                Err(Error::Invalid(words.into()))
            }
        }
    }

    /// # Safety
    /// The conditions of [`Options::open`].
    unsafe fn calibration(&self) -> Result<Option<StereoCalibration>, Error> {
        let (texts, count) = (self.calibration_texts, self.calibration_text_count);
        // SAFETY: as the caller promised.
        let (path, texts) = unsafe {
            (
                text(self.calibration, "calibration")?,
                list(texts, count, 2, "calibration_texts")?,
            )
        };
        match (path, &texts[..]) {
            (None, []) => Ok(None),
            (Some(path), []) => files::read(Path::new(path)).map(Some),
            (None, texts) => {
                files::parse(texts, &Hints::default()).map(|found| Some(found.calibration))
            }
            (Some(_), _) => {
                let words = "calibration and calibration_texts: set one of the two";
                Err(Error::Invalid(words.into()))
            }
        }
    }
}
