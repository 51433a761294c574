//! A calibration for Python.

use crate::exception;
use crate::image::{array, pixels, with_pair};
use crate::ranger::{RigTuple, rig_tuple};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use std::path::PathBuf;
use svl_core::rectify::Rectifier;
use svl_core::stereo::Gray;

/// The cameras of a calibration file, and tables that rectify their images.
#[pyclass(frozen, module = "svl_bench._svl")]
pub(crate) struct CalibrationHandle(Rectifier);

#[pymethods]
impl CalibrationHandle {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = || Rectifier::new(&svl_calibrate::files::read(&path)?);
        py.detach(read).map(Self).map_err(exception)
    }

    /// The rig of rectified images, if it is known.
    fn rig(&self) -> Option<RigTuple> {
        self.0.rig().map(rig_tuple)
    }

    /// Width and height of the rectified images.
    fn size(&self) -> (usize, usize) {
        self.0.size()
    }

    /// A pair in grey, rectified, while other threads of Python run.
    fn rectify<'py>(
        &self,
        py: Python<'py>,
        left: &Bound<'py, PyAny>,
        right: &Bound<'py, PyAny>,
        bits: Option<i64>,
    ) -> PyResult<[Bound<'py, PyArrayDyn<u8>>; 2]> {
        let rectified = with_pair([left, right], bits, false, |pair| {
            let rectify = || {
                let mut raw = [Gray::filled(1, 1, 0)?, Gray::filled(1, 1, 0)?];
                let mut both = pair.iter().zip(&mut raw);
                both.try_for_each(|(image, out)| image.copy(out))?;
                let [left, right] = self.0.apply_alone(raw.each_ref())?;
                Ok([pixels(&left, |own| own)?, pixels(&right, |own| own)?])
            };
            py.detach(rectify).map_err(exception)
        })?;
        let (width, height) = self.size();
        let [left, right] = rectified.map(|pixels| array(py, pixels, [height, width]));
        Ok([left?, right?])
    }
}
