//! A ranger for Python.

use crate::exception;
use crate::image::{array, number, pixels, with_pair};
use parking_lot::Mutex;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use svl_core::filter::FilterModel;
use svl_core::ranger::{Cells, ImageRef, Optics, RangedCell, Ranger, RangerOptions};
use svl_core::stereo::{GridShape, Rig};
use svl_core::{Error, Result};

/// A rig's numbers: focal_px, baseline_m, cx_px, cy_px, doffs_px.
pub(crate) type RigTuple = (f64, f64, f64, f64, f64);

/// Arrays of cells (distance_m, disparity_px, probability, valid_fraction, state, reason,
/// level, near_distance_m, near_px, surface_probability), then of pixels (disparities, reasons).
type MatchArrays<'py> = [Bound<'py, PyAny>; 12];

/// A ranger, which several threads may use in turns.
#[pyclass(frozen, module = "svl_bench._svl")]
pub(crate) struct RangerHandle {
    /// None after it was closed.
    ranger: Mutex<Option<Ranger>>,
    rig: Option<RigTuple>,
    /// A lock that a fork copied may never open.
    process: u32,
}

/// What a pair gave, in memory of its own.
struct RangedPair {
    cells: Cells,
    disparities: Vec<f32>,
    reasons: Vec<u8>,
    size: (usize, usize),
}

#[pymethods]
impl RangerHandle {
    #[new]
    #[pyo3(signature = (algorithm, rig, calibration, filters, columns, rows, threads))]
    #[expect(clippy::too_many_arguments, reason = "Python's keywords")]
    fn new(
        py: Python<'_>,
        algorithm: &str,
        rig: Option<RigTuple>,
        calibration: Option<PathBuf>,
        filters: Vec<PathBuf>,
        columns: i64,
        rows: i64,
        threads: i64,
    ) -> PyResult<Self> {
        let cells = GridShape {
            columns: number("columns", columns, "1 to 64")?,
            rows: number("rows", rows, "1 to 64")?,
        };
        let threads = number("threads", threads, "0 or more")?;
        let open = || {
            let filters = filters.iter().map(|path| FilterModel::read(path));
            let options = RangerOptions {
                cells,
                filters: filters
                    .map(|read| read.map(Arc::new))
                    .collect::<Result<_>>()?,
                threads,
            };
            let optics = match (rig, calibration) {
                (None, None) => Optics::Unknown,
                (Some((focal_px, baseline_m, cx_px, cy_px, doffs_px)), None) => {
                    Rig::new(focal_px, (cx_px, cy_px), baseline_m, doffs_px)?.into()
                }
                (None, Some(path)) => svl_calibrate::files::read(&path)?.into(),
                (Some(_), Some(_)) => {
                    let words = "a rig and a calibration: the latter contains a rig, name one";
                    return Err(Error::Usage(words.into()));
                }
            };
            Ranger::open(algorithm, optics, &options)
        };
        let ranger = py.detach(open).map_err(exception)?;
        Ok(Self {
            rig: ranger.rig().map(rig_tuple),
            ranger: Mutex::new(Some(ranger)),
            process: std::process::id(),
        })
    }

    /// Matches a pair, while other threads of Python run.
    fn match_pair<'py>(
        &self,
        py: Python<'py>,
        left: &Bound<'py, PyAny>,
        right: &Bound<'py, PyAny>,
        stamp_ns: Option<i64>,
        bits: Option<i64>,
        is_bgr: bool,
    ) -> PyResult<MatchArrays<'py>> {
        self.check_process()?;
        let stamp_ns = stamp_ns.map(|stamp_ns| number("stamp_ns", stamp_ns, "0 or more"));
        let stamp_ns = stamp_ns.transpose()?;
        let answer = with_pair([left, right], bits, is_bgr, |pair| {
            py.detach(|| self.answer(pair, stamp_ns))
        })?;
        answer.arrays(py)
    }

    /// The rig of rectified images, if it is known.
    fn rig(&self) -> Option<RigTuple> {
        self.rig
    }

    /// Forgets the earlier pairs.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        self.check_process()?;
        py.detach(|| {
            let mut ranger = self.ranger.lock();
            ranger.as_mut().ok_or_else(closed)?.reset();
            Ok(())
        })
    }

    /// Ends its threads.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.check_process()?;
        py.detach(|| drop(self.ranger.lock().take()));
        Ok(())
    }
}

impl RangerHandle {
    fn check_process(&self) -> PyResult<()> {
        if self.process == std::process::id() {
            return Ok(());
        }
        let cure = "open one in each process";
        let what = "this ranger was opened before a fork, which copies no threads";
        Err(PyRuntimeError::new_err(format!("{what}; {cure}")))
    }

    fn answer(
        &self,
        [left, right]: [ImageRef<'_>; 2],
        stamp_ns: Option<u64>,
    ) -> PyResult<RangedPair> {
        let mut ranger = self.ranger.lock();
        let ranger = ranger.as_mut().ok_or_else(closed)?;
        let mut signal = None;
        let cells = ranger.cells_while(left, right, stamp_ns, || {
            signal = Python::attach(|py| py.check_signals().err());
            signal.is_none()
        });
        let cells = match (cells, signal) {
            (_, Some(signal)) => return Err(signal),
            (cells, None) => cells.map_err(exception)?.clone(),
        };
        let map = ranger
            .disparity()
            .ok_or_else(|| exception(Error::Panicked))?;
        Ok(RangedPair {
            cells,
            disparities: pixels(map.disparity(), known).map_err(exception)?,
            reasons: pixels(map.why(), |why| why as u8).map_err(exception)?,
            size: map.size(),
        })
    }
}

/// NaN is none in every array of floats.
fn known(disparity: f32) -> f32 {
    Some(disparity)
        .filter(|own| own.is_finite())
        .unwrap_or(f32::NAN)
}

/// A rig as numbers.
pub(crate) fn rig_tuple(rig: &Rig) -> RigTuple {
    let (cx, cy) = rig.center_px();
    (rig.focal_px(), rig.baseline_m(), cx, cy, rig.doffs_px())
}

fn closed() -> PyErr {
    PyValueError::new_err("this ranger is closed")
}

impl RangedPair {
    fn arrays(self, py: Python<'_>) -> PyResult<MatchArrays<'_>> {
        let GridShape { columns, rows } = self.cells.shape();
        let floats = |value: fn(&RangedCell) -> f32| {
            let values = self.cells.iter().map(value).collect();
            array(py, values, [rows, columns]).map(Bound::into_any)
        };
        let codes = |value: fn(&RangedCell) -> u8| {
            let values = self.cells.iter().map(value).collect();
            array(py, values, [rows, columns]).map(Bound::into_any)
        };
        let (width, height) = self.size;
        Ok([
            floats(|cell| cell.distance_m.map_or(f32::NAN, |m| m as f32))?,
            floats(|cell| cell.disparity_px.unwrap_or(f32::NAN))?,
            floats(|cell| cell.probability.map_or(f32::NAN, |p| p as f32))?,
            floats(|cell| cell.valid_share as f32)?,
            // svl_bench.State.
            codes(|cell| cell.state.code())?,
            codes(|cell| cell.reason as u8)?,
            codes(|cell| cell.level)?,
            floats(|cell| {
                cell.surface
                    .map_or(f32::NAN, |surface| surface.distance_m as f32)
            })?,
            floats(|cell| cell.surface.map_or(f32::NAN, |surface| surface.px))?,
            floats(|cell| {
                cell.surface
                    .map_or(f32::NAN, |surface| surface.probability as f32)
            })?,
            array(py, self.disparities, [height, width])?.into_any(),
            array(py, self.reasons, [height, width])?.into_any(),
        ])
    }
}
