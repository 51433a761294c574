//! Maps that others computed, as algorithms: depth that a camera or a node published in the
//! recording, and files of a network or a cluster.
//!
//! The source brings the map with the pair, as disparities of the left image ([`RecordedMap`]).
//! Nothing is matched, so there is no time of matching.

use super::{
    MatchContext, MatchOutput, Matcher, MatcherKind, MatcherSpec, Parameter, Parameters, Range,
};
use crate::depth::{self, GridSettings};
use crate::error::{Error, Result};
use crate::stereo::{DepthGrid, ExtraPlanes, MapDensity, Reason, RecordedMap, RectifiedPair};

/// Points below which a cell of a sparse map is unknown: as many as a sparse truth needs.
const MIN_POINTS: f64 = 10.0;
/// Metres per step of depths.
const UNIT_M: std::ops::RangeInclusive<f64> = 0.0..=1000.0;
/// Multiples of disparities.
const SCALE: std::ops::RangeInclusive<f64> = 0.0..=65_536.0;

const SKEW_MS: Parameter = Parameter {
    name: "skew_ms",
    unit: "ms",
    range: Range::real(20.0, 0.0..=60_000.0),
    description: "largest difference of the stamps of a pair and its map",
};

pub(super) const TOPIC: MatcherSpec = MatcherSpec {
    name: "topic",
    kind: MatcherKind::Recorded,
    aliases: &[],
    summary: "depth in the recording: what a camera or a node published",
    about: "A depth image, a disparity image, a point cloud or a laser scan, in its own frame and \
            of its own time: --algo zed=topic:/zed/depth/depth_registered. Each message is used \
            for one pair; a pair without one has no answer.",
    paper: "whatever published it",
    parameters: &[
        Parameter {
            name: "topic",
            unit: "",
            range: Range::Topic,
            description: "topic of the recording; the name topic= may be omitted",
        },
        SKEW_MS,
    ],
    cells: None,
    build: |parameters, _| RecordedMatcher::build(&TOPIC, parameters),
};

pub(super) const FILES: MatcherSpec = MatcherSpec {
    name: "files",
    kind: MatcherKind::Recorded,
    aliases: &[],
    summary: "disparity or depth maps in files: what a network or a cluster computed",
    about: "PFM, NPY, NPZ, PNG or TIFF of the left image's size, disparities unless unit= says \
            that they are depths: --algo net=files:'out/*.pfm'. The part at * is the pair's name \
            or number, or a time.",
    paper: "whatever computed them",
    parameters: &[
        Parameter {
            name: "pattern",
            unit: "",
            range: Range::Pattern,
            description: "files, with one * for the pair's name or number; the name pattern= may \
                          be omitted",
        },
        Parameter {
            name: "unit",
            unit: "m",
            range: Range::real(0.0, UNIT_M),
            description: "metres per step of depths; 0: the files have disparities",
        },
        Parameter {
            name: "disparity",
            unit: "",
            range: Range::real(0.0, SCALE),
            description: "multiple of the disparity; 0: 256 in PNG and TIFF, else 1",
        },
        SKEW_MS,
    ],
    cells: None,
    build: |parameters, _| RecordedMatcher::build(&FILES, parameters),
};

/// A map that a source has to have besides its images.
#[derive(Clone, Debug, PartialEq)]
pub struct MapRequest {
    /// Name in [`RecordedMap::source`]: equal for equal parameters.
    pub source: String,
    pub place: MapPlace,
    /// Largest difference between the stamps of a pair and its map.
    pub max_skew_ns: u64,
}

/// Place of a map.
#[derive(Clone, Debug, PartialEq)]
pub enum MapPlace {
    Topic(String),
    Files {
        pattern: String,
        /// Metres per step, if they are depths.
        unit_m: Option<f64>,
        /// Multiple of the disparity, if it is given.
        scale: Option<f64>,
    },
}

impl MapRequest {
    pub(super) fn new(spec: &MatcherSpec, parameters: &Parameters) -> Option<Self> {
        let given = |name| Some(parameters.real(name)).filter(|value| *value > 0.0);
        let place = match spec.name {
            name if name == TOPIC.name => MapPlace::Topic(parameters.text("topic").to_owned()),
            name if name == FILES.name => MapPlace::Files {
                pattern: parameters.text("pattern").to_owned(),
                unit_m: given("unit"),
                scale: given("disparity"),
            },
            _ => return None,
        };
        Some(Self {
            source: format!("{}:{parameters}", spec.name),
            place,
            max_skew_ns: (parameters.real("skew_ms") * 1e6) as u64,
        })
    }
}

struct RecordedMatcher {
    source: String,
    place: MapPlace,
}

impl RecordedMatcher {
    fn build(spec: &MatcherSpec, parameters: &Parameters) -> Result<Box<dyn Matcher>> {
        let usage = |why: &str| Err(Error::Usage(why.to_owned()));
        let Some(MapRequest { source, place, .. }) = MapRequest::new(spec, parameters) else {
            return usage("reports no map");
        };
        match &place {
            MapPlace::Topic(topic) if topic.is_empty() => {
                usage("name the topic, as topic:/camera/depth")
            }
            MapPlace::Files { pattern, .. } if pattern.matches('*').count() != 1 => {
                usage("name the files by one * for the pair's name or number, as files:'out/*.pfm'")
            }
            MapPlace::Files {
                unit_m: Some(_),
                scale: Some(_),
                ..
            } => usage("unit= is for depths and disparity= for disparities: omit one"),
            _ => Ok(Box::new(Self { source, place })),
        }
    }

    /// The reason why a pair has no map.
    fn why_none(&self) -> String {
        match &self.place {
            MapPlace::Topic(topic) => format!("no message of {topic} belongs to this pair"),
            MapPlace::Files { pattern, .. } => format!("no file of '{pattern}' is for this pair"),
        }
    }
}

impl Matcher for RecordedMatcher {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let map = context.maps.iter().find(|map| map.source == self.source);
        let map = map.ok_or_else(|| Error::Invalid(self.why_none()))?;
        let (width, height) = pair.size();
        if map.disparity.size() != pair.size() {
            let (w, h) = map.disparity.size();
            return Err(Error::Invalid(format!(
                "its map is {w}x{h}, the left image {width}x{height}"
            )));
        }
        output.disparity.resize(width, height, ExtraPlanes::NONE)?;
        for (mut row, disparities) in output.disparity.rows_mut().zip(map.disparity.rows()) {
            for (x, &disparity) in disparities.iter().enumerate() {
                if disparity.is_finite() {
                    row.accept(x, disparity);
                } else {
                    row.reject(x, Reason::Unmatched);
                }
            }
        }
        output.grid = (map.density == MapDensity::Sparse).then(|| sparse_grid(map, context));
        Ok(())
    }
}

/// The medians of the points of a sparse map: the thesis's fraction of pixels is for dense ones.
fn sparse_grid(map: &RecordedMap, context: &MatchContext<'_>) -> DepthGrid {
    let size = map.disparity.size();
    let any = GridSettings {
        min_valid: 0.0,
        ..context.grid
    };
    let shape = context.grid.shape();
    let mut grid = depth::grid(&map.disparity, any, context.rig.as_ref());
    for (place, cell) in shape.iter().zip(grid.cells_mut()) {
        let (columns, rows) = shape.pixels(place, size);
        let pixels = (columns.len() * rows.len()) as f64;
        if (cell.valid_share * pixels).round() < MIN_POINTS {
            cell.depth = None;
        }
    }
    grid
}
