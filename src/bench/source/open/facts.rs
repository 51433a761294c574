//! Facts of a source by its first pairs: size, cameras, range, truth.

use super::sources::{open, open_recording};
use crate::source::frames::Source;
use crate::source::inputs::folder::map_files::MapFiles;
use crate::source::layers::alignment_monitor::PairAlignment;
use crate::source::opened::calibration::Calib;
use crate::source::opened::open_source::Opened;
use crate::source::opened::request::Request;
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant};
use svl_core::depth::GridSettings;
use svl_core::doubt::{CalibrationCheck, Doubt, PairCure, Subject};
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, Matcher};
use svl_core::rectify::{Alignment, RectificationMeter};
use svl_core::statistics::{lower_median, nearest_rank};
use svl_core::stereo::{CellRule, Frame, Geometry, GridShape, Intrinsics, RectifiedPair, Rig};
use svl_core::{Error, Result, counted};
use svl_recording::{CameraFacts, PairGeometry, RawCamera, truth_topics};
use svl_score::judge::TrueCells;
use svl_score::plausibility::{Spread, TruthScales, TruthSpread};
use svl_score::scenario::SourceOptions;

/// Largest number of pairs that are read for each truth, and the time after which no further
/// one is.
const MAX_PAIRS: u64 = 20;
const MAX_TIME: Duration = Duration::from_secs(2);
/// Pairs are measured for vertical misalignment until that many points have matched; misaligned
/// ones, whose cause is sought, to that many at least.
const MAX_POINTS: usize = 500;
const MISALIGNED_PAIRS: usize = 5;
/// The matcher whose disparities a truth is compared with, and the pairs that it matches.
const MATCHER: &str = "bm";
const MATCHED_PAIRS: u64 = 8;
/// Largest median skew of pairs that can be used, however far apart they are.
const MAX_SKEW_NS: f64 = 100e6;

/// Facts of a source, as its first pairs show them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SourceFacts {
    /// Width and height of an image, pixels.
    pub size_px: (usize, usize),
    /// Number of pairs, if it is known without reading all of them.
    pub pairs: Option<u64>,
    /// Names of the layers around the source.
    pub chain: Vec<String>,
    /// The conversion of 16-bit values to grey levels, with the reason.
    pub grey: Option<String>,
    pub geometry: PairGeometry,
    /// False if nothing in another program's recording says that its pairs are raw or rectified;
    /// they count as raw.
    pub is_geometry_known: bool,
    #[serde(flatten)]
    pub camera: CameraFacts,
    /// The source itself, as an argument of `--calib`, if it keeps a calibration that it does not
    /// use.
    pub kept_calibration: Option<String>,
    /// The rig by which distances are computed; of raw images after rectification.
    pub rig: Option<Rig>,
    /// True if size and rig are those of all pairs that were looked at.
    pub is_constant: bool,
    /// Vertical misalignment of the first pairs, of raw pairs after rectification; none if too few
    /// points matched.
    pub vertical_misalignment: Option<Alignment>,
    /// The same of raw pairs before rectification.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unrectified_misalignment: Option<Alignment>,
    /// Numbers of the calibration beside their usual values.
    pub calibration_checks: Vec<CalibrationCheck>,
    /// Contradictions between the calibration and the pairs.
    #[serde(skip)]
    pub doubts: Vec<Doubt>,
    pub nearest: Option<NearestDistance>,
    pub truths: Vec<TruthFacts>,
}

/// The nearest distance that an algorithm can report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NearestDistance {
    pub algorithm: String,
    pub max_disparity_px: i32,
    pub distance_m: f64,
}

/// A ground truth, and the number of first pairs and cells that it would score.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TruthFacts {
    /// Topic of the truth, or the pattern of its files in a folder; none of a truth that the source
    /// has.
    pub topic: Option<String>,
    /// True if it has to be asked for (`--truth TOPIC`).
    pub is_asked_for: bool,
    /// Pairs that were looked at, and of them those with a cell that is scored.
    pub pairs: u64,
    pub scored_pairs: u64,
    /// Pairs with a measurement of their time.
    #[serde(skip)]
    pub(crate) measured_pairs: u64,
    /// Cells of the default grid in the pairs that were looked at, and of them those scored.
    pub cells: u64,
    pub scored_cells: u64,
    /// Least, middle and greatest disparity and distance of these pairs.
    pub disparity_px: Option<Spread>,
    pub distance_m: Option<Spread>,
    /// Pixels that are impossible, or zeros in place of none, and not used.
    pub impossible_pixels: u64,
    /// False if the floor that is told is not to be seen in it; none if none is told.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shows_floor: Option<bool>,
    /// Reason why it cannot be a truth.
    pub error: Option<String>,
    /// The same, where its pixels are impossible, and what a matcher says of it.
    #[serde(skip)]
    pub doubts: Vec<Doubt>,
}

impl SourceFacts {
    /// Reads the first pairs of a source; `is_recording`: as a recording.
    ///
    /// # Errors
    /// The errors of [`open`] and [`open_recording`]; the error of the first pair.
    pub fn read(request: &Request<'_>, is_recording: bool) -> Result<Self> {
        let name = request.name;
        let open = if is_recording { open_recording } else { open };
        let mut opened = open(request)?;
        let (mut own, mut has_truth) = (TruthLook::new(TruthFacts::default())?, false);
        let mut pairs = PairAlignment::default();
        let (mut skews_ns, mut stamps_ns) = (Vec::new(), Vec::new());
        let mut first: Option<(Frame, bool)> = None;
        // Damage of later pairs is reported with the recording.
        look(&mut *opened.source, |frame| {
            let is_sought = pairs.is_off() && stamps_ns.len() < MISALIGNED_PAIRS;
            if pairs.meter.matches.len() < MAX_POINTS || is_sought {
                pairs.add(&frame);
                pairs.keep(Some(&frame));
            }
            skews_ns.extend(frame.exposure.skew_ns);
            stamps_ns.push(frame.stamp_ns);
            own.add(&frame);
            has_truth |= frame.truth.is_some();
            let (first, is_constant) = first.get_or_insert_with(|| (frame.clone(), true));
            *is_constant &= first.pair.size() == frame.pair.size() && first.rig() == frame.rig();
        })?;
        let mut own = own.facts(&mut *opened.source);
        let none = || Error::format(name, "has no pairs");
        let (first, is_constant) = first.ok_or_else(none)?;
        let (rig, raw) = (first.rig().copied(), RawCamera::from_frame(&first));
        let mut camera = opened.facts.camera.clone();
        let has_calibration =
            camera.distortion_model.is_some() || camera.calibration_fault.is_some();
        camera.distortion_model = camera
            .distortion_model
            .or(raw.and_then(|raw| model(&raw.intrinsics)));
        let raw_px = raw.map(|raw| raw.intrinsics.focal_px());
        let rig_px = rig.map(|rig| (rig.focal_px(), rig.focal_px()));
        // The rig of scaled images, which are rectified, is scaled with them.
        let scaled_px = rig_px.filter(|_| request.options.scale.is_some());
        camera.focal_px = scaled_px.or(raw_px).or(camera.focal_px).or(rig_px);
        let recording = opened.recording.as_ref();
        let is_foreign = recording.is_some_and(|recording| recording.header().is_err());
        let topics = match recording {
            Some(recording) => truth_topics(recording, &opened.facts.topics)?,
            None => MapFiles::usual(Path::new(name)),
        };
        let rectification = opened.source.rectification();
        let checks = calibration_checks(&opened, &first);
        let doubts = checks.iter().filter_map(CalibrationCheck::doubt);
        let doubts = opened.facts.doubts.iter().cloned().chain(doubts);
        let doubts = skew_doubt(skews_ns, &stamps_ns).into_iter().chain(doubts);
        let doubts = doubts.chain(pairs.meter.doubt(rig.as_ref(), 0..=i32::MAX));
        // The user's word that the pairs are rectified.
        let is_assumed = request.calib() == Calib::None;
        let is_raw = rig.is_none() && first.geometry == Geometry::Raw && !is_assumed;
        let misaligned = pairs.doubt(&*opened.source).filter(|_| !is_raw);
        Ok(Self {
            size_px: first.pair.size(),
            chain: opened.chain.clone(),
            grey: opened.facts.grey.clone(),
            is_geometry_known: !is_foreign || !is_raw || has_calibration,
            pairs: opened.source.pairs(),
            camera,
            kept_calibration: kept_calibration(&opened, &first),
            geometry: match raw {
                Some(_) => PairGeometry::Raw,
                None if is_assumed => PairGeometry::Rectified,
                None => PairGeometry::from(&first.geometry),
            },
            rig,
            is_constant,
            vertical_misalignment: pairs.meter.alignment(),
            unrectified_misalignment: rectification.and_then(RectificationMeter::before),
            doubts: doubts.chain(misaligned).collect(),
            calibration_checks: checks,
            nearest: rig
                .as_ref()
                .and_then(NearestDistance::for_default_algorithm),
            truths: if has_truth {
                own.topic = topics
                    .into_iter()
                    .find(|topic| topic.starts_with("/truth/"));
                vec![own]
            } else {
                topics
                    .into_iter()
                    .map(|topic| {
                        TruthFacts::from_topic(request, topic, rig.is_some(), is_recording)
                    })
                    .collect()
            },
        })
    }

    /// The contradictions of calibration, pairs and truths.
    pub(super) fn all_doubts(&self) -> impl Iterator<Item = &Doubt> {
        let truths = self.truths.iter().flat_map(|truth| &truth.doubts);
        self.doubts.iter().chain(truths)
    }
}

/// The median skew, if it is above half a period or [`MAX_SKEW_NS`].
fn skew_doubt(mut skews_ns: Vec<i64>, stamps_ns: &[u64]) -> Option<Doubt> {
    skews_ns.sort_unstable();
    let skew_ns = nearest_rank(&skews_ns, 0.5)?;
    let periods = stamps_ns.windows(2).map(|two| two[1].abs_diff(two[0]));
    let period_ns = lower_median(periods.map(|ns| ns as f64)).unwrap_or(f64::INFINITY);
    let limit_ns = (period_ns / 2.0).min(MAX_SKEW_NS);
    let (skew_ms, limit_ms) = (skew_ns as f64 / 1e6, limit_ns / 1e6);
    let cure = PairCure::Skew { skew_ms, limit_ms };
    let usual = [-limit_ms, limit_ms];
    let doubt = cure.doubt(Subject::Pairs, "skew_ms", skew_ms, usual);
    (skew_ns.unsigned_abs() as f64 > limit_ns).then_some(doubt)
}

/// The checks of the calibration of a source, else those of the rig of its pairs.
fn calibration_checks(opened: &Opened, first: &Frame) -> Vec<CalibrationCheck> {
    let own = &opened.facts.camera.checks;
    let mut checks = match (first.rig(), &first.calibration) {
        _ if !own.is_empty() => own.clone(),
        (Some(rig), None) => rig.checks(first.pair.size()),
        (_, Some(calibration)) => calibration.checks(),
        (None, None) => Vec::new(),
    };
    // The principal point of a crop is where it was.
    let changes = opened.header.changes.as_deref().unwrap_or_default();
    if changes.contains("crop") {
        let centers = checks
            .iter_mut()
            .filter(|check| check.name.contains("center"));
        centers.for_each(|check| check.cure = None);
    }
    checks
}

/// A recording of raw pairs that keeps the files of their calibration.
fn kept_calibration(opened: &Opened, first: &Frame) -> Option<String> {
    let recording = opened
        .recording
        .as_ref()
        .filter(|_| first.rig().is_none())?;
    (!opened.calibration.is_empty()).then(|| recording.path().display().to_string())
}

/// Name of a camera's distortion model, if it has distortion.
fn model(camera: &Intrinsics) -> Option<String> {
    let lens = camera.distortion();
    (!lens.is_none()).then(|| lens.model().to_string())
}

/// Reads as many of the first pairs as the time allows; the error of one behind the first, which
/// ends it.
fn look(source: &mut dyn Source, mut see: impl FnMut(Frame)) -> Result<Option<Error>> {
    let begin = Instant::now();
    for done in 0..MAX_PAIRS {
        match source.next() {
            Ok(Some(frame)) => see(frame),
            Ok(None) => break,
            Err(error) if done == 0 => return Err(error),
            Err(error) => return Ok(Some(error)),
        }
        if begin.elapsed() > MAX_TIME {
            break;
        }
    }
    Ok(None)
}

impl NearestDistance {
    /// Range of the default algorithm with its default disparities.
    fn for_default_algorithm(rig: &Rig) -> Option<Self> {
        let algorithm = Algorithm::default();
        let max_disparity_px = algorithm.max_disparity()?;
        Some(Self {
            distance_m: rig.depth_m(f64::from(max_disparity_px))?,
            algorithm: algorithm.label().to_owned(),
            max_disparity_px,
        })
    }
}

impl TruthFacts {
    /// Topic or pattern of the truth, or where it is.
    pub fn name(&self) -> &str {
        self.topic.as_deref().unwrap_or("the folder")
    }

    /// True if it scores pixels.
    pub fn has_pixels(&self) -> bool {
        self.error.is_none() && self.disparity_px.is_some()
    }

    /// The truth of another sensor of a recording or a folder.
    fn from_topic(request: &Request<'_>, topic: String, has_rig: bool, is_recording: bool) -> Self {
        let named = Self {
            topic: Some(topic.clone()),
            is_asked_for: true,
            ..Self::default()
        };
        let refused = |reason: String, doubts| Self {
            error: Some(reason),
            doubts,
            ..named.clone()
        };
        // Disparities in the files of a folder need no calibration.
        if !has_rig && is_recording {
            let cure = "needs a calibration of the pairs: --calib FILE";
            return refused(cure.to_owned(), Vec::new());
        }
        let request = Request {
            options: SourceOptions {
                truth: Some(topic.clone()),
                ..request.options.clone()
            },
            ..request.clone()
        };
        let open = if is_recording { open_recording } else { open };
        let looked = open(&request).and_then(|mut opened| {
            let mut truth = TruthLook::new(named.clone())?;
            let later = look(&mut *opened.source, |frame| truth.add(&frame))?;
            // Damage of a recording is reported with it.
            let later = later.filter(|_| !is_recording);
            later.map_or_else(|| Ok(truth.facts(&mut *opened.source)), Err)
        });
        let mut facts = looked.unwrap_or_else(|error| {
            let doubt = error.downcast_ref().cloned();
            refused(error.to_string(), doubt.into_iter().collect())
        });
        for doubt in &mut facts.doubts {
            doubt.subject = Subject::Topic(topic.clone());
        }
        facts
    }
}

/// A truth, as the first pairs show it.
struct TruthLook {
    facts: TruthFacts,
    spread: TruthSpread,
    scales: TruthScales,
    matcher: Box<dyn Matcher>,
    output: MatchOutput,
}

impl TruthLook {
    fn new(facts: TruthFacts) -> Result<Self> {
        Ok(Self {
            facts,
            spread: TruthSpread::default(),
            scales: TruthScales::default(),
            matcher: MATCHER.parse::<Algorithm>()?.build()?,
            output: MatchOutput::new()?,
        })
    }

    /// The facts, with the pixels that the source dropped; the reason if there are none.
    fn facts(self, source: &mut dyn Source) -> TruthFacts {
        let mut facts = self.facts;
        [facts.disparity_px, facts.distance_m] = self.spread.spreads();
        facts.shows_floor = source.sees_floor();
        facts.impossible_pixels = source.finish(facts.pairs).impossible;
        facts.doubts = self.scales.measured().doubts();
        let pairs = counted(facts.pairs, "pair");
        facts.error = match (facts.measured_pairs, facts.disparity_px) {
            (_, Some(_)) => None,
            (0, None) => Some(format!(
                "none of its measurements is of the time of the first {pairs}: its clock is another"
            )),
            (_, None) => Some(format!(
                "none of its pixels at the first {pairs} is a distance: 0, negative values and NaN \
                 are none"
            )),
        };
        facts
    }

    fn add(&mut self, frame: &Frame) {
        self.spread.add(frame);
        self.compare(frame);
        let shape = GridShape::default();
        let facts = &mut self.facts;
        facts.pairs += 1;
        facts.measured_pairs += u64::from(frame.truth.is_some());
        facts.cells += shape.cells() as u64;
        let rule = CellRule::default().for_rig(frame.rig().is_some());
        let truth = TrueCells::new(frame, shape, rule);
        let known = truth.map_or(0, |truth| {
            let cells = truth.grid().iter();
            cells.filter(|(_, cell)| cell.depth.is_some()).count() as u64
        });
        facts.scored_pairs += u64::from(known > 0);
        facts.scored_cells += known;
    }

    /// Compares the truth with the disparities of a matcher.
    fn compare(&mut self, frame: &Frame) {
        let is_rectified = matches!(frame.geometry, Geometry::Rectified(_));
        if frame.truth.is_none() || !is_rectified || self.facts.measured_pairs >= MATCHED_PAIRS {
            return;
        }
        let context = MatchContext::for_frame(frame, GridSettings::default(), CellRule::default());
        let pair = RectifiedPair::assume(&frame.pair);
        self.output.begin();
        if (self.matcher.compute(pair, &context, &mut self.output)).is_ok() {
            let map = self.output.disparity.disparity();
            self.scales.compare(frame, MATCHER, map);
        }
    }
}
