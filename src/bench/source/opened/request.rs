//! A user's request for a source: its name and its options.

use super::calibration::Calib;
use crate::source::inputs::folder::pairs::FolderRequest;
use svl_calibrate::Board;
use svl_core::matcher::{Algorithm, MapRequest};
use svl_core::{Error, Result};
use svl_grab::{GrabRequest, Host};
use svl_recording::{Selection, SensorRole, SensorSelection, StampUnit};
use svl_score::scenario::{SourceOptions, StampSource};

/// Prefix of the size of a board that is the truth.
const BOARD: &str = "board:";

/// A source to open, with its options.
#[derive(Clone, Default)]
pub struct Request<'a> {
    /// A name in the syntax of [`crate::source::open::sources::SOURCES`], or a path.
    pub name: &'a str,
    /// Seed of a simulated source [default: 1].
    pub seed: Option<u64>,
    /// Options of reading; seeds, files and scenes are those of scenarios.
    pub options: SourceOptions,
    /// Maps that the source has to have besides its images.
    pub maps: Vec<MapRequest>,
    /// The pairs stay raw, to calibrate cameras with.
    pub raw: bool,
    /// Longest time of live topics by this machine's clock, seconds from the first pair on: their
    /// stamps may stop.
    pub live_s: Option<f64>,
    /// Options of cameras; their skew and their seed are those of this request.
    pub grab: GrabRequest,
    pub host: Host<'a>,
}

impl<'a> Request<'a> {
    /// Opens `name` with all defaults.
    pub fn new(name: &'a str) -> Self {
        Self {
            name,
            ..Self::default()
        }
    }

    /// The same with the maps that these algorithms report.
    #[must_use]
    pub fn with_maps(self, algorithms: &[Algorithm]) -> Self {
        let mut maps: Vec<MapRequest> = Vec::new();
        for map in algorithms.iter().filter_map(Algorithm::recorded) {
            // Two labels of one map read it once.
            if !maps.contains(&map) {
                maps.push(map);
            }
        }
        Self { maps, ..self }
    }

    /// The topics of a recording, and the rules by which they are paired.
    pub fn selection(&self) -> Selection {
        let options = &self.options;
        Selection {
            left: options.left.clone(),
            right: options.right.clone(),
            infos: [options.left_info.clone(), options.right_info.clone()],
            side_by_side: options.side_by_side,
            max_skew_ns: self.max_skew_ns().unwrap_or(Selection::MAX_SKEW_NS),
            bits: options.bits,
            stamps: options.stamps.map(|stamps| match stamps {
                StampSource::Ms => StampUnit::Milliseconds,
                StampSource::Us => StampUnit::Microseconds,
                StampSource::Log => StampUnit::Log,
            }),
            right_offset_ns: options.right_offset_ms.map(|ms| (ms * 1e6).round() as i64),
            // Messages may be logged a second late.
            to_ns: options.range().to_s.map(|s| nanoseconds(1e3 * (s + 1.0))),
        }
    }

    pub(crate) fn max_skew_ns(&self) -> Option<u64> {
        self.options.max_skew_ms.map(nanoseconds)
    }

    /// The board in view that is the truth.
    ///
    /// # Errors
    /// [`Error::Usage`] for one that svl cannot look for.
    pub(crate) fn board(&self) -> Result<Option<Board>> {
        let named = self.options.truth.as_deref();
        let size = named.and_then(|truth| truth.strip_prefix(BOARD));
        let board = size.map(|size| {
            let wrong = |e| Error::Usage(format!("--truth {BOARD}{size}: {e}"));
            size.parse().map_err(wrong)
        });
        board.transpose()
    }

    /// The other sensor that measures the truth.
    pub(crate) fn truth(&self) -> Option<SensorSelection> {
        let max_skew_ns = self.options.truth_skew_ms.map(nanoseconds);
        let named = self.options.truth.as_ref();
        Some(SensorSelection {
            topic: named.filter(|truth| !truth.starts_with(BOARD))?.clone(),
            max_skew_ns: max_skew_ns.unwrap_or(SensorSelection::MAX_SKEW_NS),
            role: SensorRole::Truth,
        })
    }

    /// The calibration that rectifies the pairs.
    pub fn calib(&self) -> Calib {
        match &self.options.calib {
            _ if self.raw => Calib::Raw,
            Some(calib) => calib.parse().unwrap_or_default(),
            None => Calib::Own,
        }
    }

    pub(crate) fn topics(&self) -> [Option<String>; 2] {
        [self.options.left.clone(), self.options.right.clone()]
    }

    pub(crate) fn folder_request(&self) -> FolderRequest {
        FolderRequest {
            images: self.topics(),
            side_by_side: self.options.side_by_side,
            fps: self.options.fps,
            bits: self.options.bits,
        }
    }
}

fn nanoseconds(ms: f64) -> u64 {
    (ms * 1e6) as u64
}
