//! The extension module `svl_bench._svl`: matching, below the Python of `svl_bench/`.

mod calibration;
mod image;
mod ranger;

use pyo3::exceptions::{
    PyFileNotFoundError, PyKeyboardInterrupt, PyMemoryError, PyOSError, PyRuntimeError,
    PyValueError,
};
use pyo3::prelude::*;
use svl_core::Error;

/// svl's message as the exception that Python has for it.
fn exception(error: Error) -> PyErr {
    let words = error.to_string();
    match error {
        error if error.kind() == Some("missing") => PyFileNotFoundError::new_err(words),
        Error::Io { .. } | Error::Damaged { .. } => PyOSError::new_err(words),
        Error::Memory { .. } => PyMemoryError::new_err(words),
        Error::Panicked => PyRuntimeError::new_err(words),
        Error::Interrupted => PyKeyboardInterrupt::new_err(words),
        _ => PyValueError::new_err(words),
    }
}

#[pymodule]
mod _svl {
    #[pymodule_export]
    use crate::calibration::CalibrationHandle;
    #[pymodule_export]
    use crate::ranger::RangerHandle;

    use super::*;
    use svl_core::kernel::isa;
    use svl_core::stereo::Reason;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("REASONS", Reason::ALL.map(Reason::name).to_vec())?;
        Ok(())
    }

    /// The instruction set in use: avx512, avx2, portable or neon.
    #[pyfunction]
    fn instruction_set() -> PyResult<&'static str> {
        Ok(isa().map_err(exception)?.name())
    }
}
