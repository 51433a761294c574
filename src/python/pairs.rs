//! Pairs of everything that svl reads, for Python.

use crate::exception;
use crate::image::{array, pixels};
use parking_lot::Mutex;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use svl_bench::source::{self, Request, Source, SourceKind};
use svl_core::stereo::{Frame, Geometry, Rgb};
use svl_core::{Error, Result};
use svl_score::losses::Missing;
use svl_score::scenario::SourceOptions;

/// The pairs of a source, one after another.
#[pyclass(frozen, module = "svl_bench._svl")]
pub(crate) struct PairReader {
    /// None after it was closed.
    reading: Mutex<Option<Reading>>,
    /// Remarks on the source.
    #[pyo3(get)]
    notes: Vec<String>,
}

struct Reading {
    source: Box<dyn Source>,
    taken: u64,
}

#[pymethods]
impl PairReader {
    /// `options`: those of a scenario's source, as a JSON object.
    #[new]
    fn new(py: Python<'_>, name: &str, seed: Option<u64>, raw: bool, options: &str) -> PyResult<Self> {
        let options: SourceOptions = serde_json::from_str(options)
            .map_err(|error| PyValueError::new_err(format!("{name}: {error}")))?;
        let opened = py.detach(|| open(name, seed, raw, options));
        let opened = opened.map_err(exception)?;
        let source = opened.source;
        Ok(Self {
            reading: Mutex::new(Some(Reading { source, taken: 0 })),
            notes: opened.notes,
        })
    }

    /// The number of pairs, if it is known.
    fn pairs(&self) -> Option<u64> {
        self.reading.lock().as_ref()?.source.pairs()
    }

    /// The next pair as a dictionary; none at the end.
    fn next<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let read = || {
            let mut reading = self.reading.lock();
            let closed = || Error::Usage("these pairs are closed".into());
            let Reading { source, taken } = reading.as_mut().ok_or_else(closed)?;
            let frame = source.next()?;
            *taken += u64::from(frame.is_some());
            Ok(frame)
        };
        let frame = py.detach(read).map_err(exception)?;
        frame.map(|frame| fields(py, frame)).transpose()
    }

    /// What was in no pair, in words; none if nothing is missing.
    fn losses(&self, py: Python<'_>) -> Option<String> {
        py.detach(|| {
            let mut reading = self.reading.lock();
            let Reading { source, taken } = reading.as_mut()?;
            let missing = Missing {
                pairs: *taken,
                losses: source.finish(*taken),
                ..Missing::default()
            };
            missing.words()
        })
    }

    fn close(&self, py: Python<'_>) {
        py.detach(|| drop(self.reading.lock().take()));
    }
}

fn open(
    name: &str,
    seed: Option<u64>,
    raw: bool,
    options: SourceOptions,
) -> Result<source::Opened> {
    if SourceKind::without_files(name).is_some_and(SourceKind::is_live) {
        let cure = "record it first: svl_bench.record";
        return Err(Error::Usage(format!("{name}: is live, without an end; {cure}")));
    }
    source::open(&Request {
        seed,
        raw,
        options,
        ..Request::new(name)
    })
}

fn fields(py: Python<'_>, frame: Frame) -> PyResult<Bound<'_, PyDict>> {
    let (width, height) = frame.pair.size();
    let shape = [height, width];
    let fields = PyDict::new(py);
    fields.set_item("sequence", frame.sequence)?;
    fields.set_item("stamp_ns", frame.stamp_ns)?;
    for (name, image) in [("left", frame.pair.left()), ("right", frame.pair.right())] {
        fields.set_item(name, array(py, pixels(image), shape)?)?;
    }
    fields.set_item("name", &frame.name)?;
    fields.set_item("is_rectified", frame.geometry != Geometry::Raw)?;
    let rig = frame.rig().map(|rig| {
        let (cx_px, cy_px) = rig.center_px();
        (rig.focal_px(), rig.baseline_m(), cx_px, cy_px, rig.doffs_px())
    });
    fields.set_item("rig", rig)?;
    let color = |image: &Rgb| {
        let bytes = pixels(image).into_flattened();
        array(py, bytes, [height, width, 3])
    };
    let [left, right] = match &frame.color {
        Some([left, right]) => [Some(color(left)?), Some(color(right)?)],
        None => [None, None],
    };
    fields.set_item("left_color", left)?;
    fields.set_item("right_color", right)?;
    let truth = frame.truth.as_ref().map(|truth| {
        let size = truth.disparity.size();
        array(py, pixels(&truth.disparity), [size.1, size.0])
    });
    fields.set_item("true_disparity", truth.transpose()?)?;
    let pose = frame.pose.map(|pose| {
        // Row by row.
        let matrix = pose.to_homogeneous().transpose();
        array(py, matrix.as_slice().to_vec(), [4, 4])
    });
    fields.set_item("pose", pose.transpose()?)?;
    Ok(fields)
}
