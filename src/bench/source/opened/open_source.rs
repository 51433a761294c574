//! An open source, with all that a recording of it contains.

use super::calibration;
use super::calibration::{Calib, CalibrationFiles};
use super::request::Request;
use crate::source::frames::Source;
use crate::source::layers::board_truth::BoardTruth;
use crate::source::layers::chain::Chain;
use crate::source::layers::floored::{LevelCamera, ToldFloor};
use crate::source::layers::measured::{MeasuredMaps, SourceMaps, delays};
use crate::source::layers::rectified::AppliedCalibration;
use parking_lot::Mutex;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use svl_core::doubt::CalibrationCheck;
use svl_core::stereo::{LengthUnit, Rig};
use svl_core::{Error, Result};
use svl_recording::warn_of;
use svl_recording::{
    CALIBRATION, Header, Recording, RecordingFormat, SCENARIO, StampOrigin, StreamFacts, Writer,
};
use svl_report::TopicDelay;
use svl_score::losses::Losses;
use svl_score::manifest::{InputRecord, Manifest, hash, hash_bytes};
use svl_score::scenario::{Scenario, SourceOptions};
use tempfile::TempDir;

/// A source, and the contents of a recording of it besides its pairs.
pub struct Opened {
    pub source: Box<dyn Source>,
    /// Names of the layers around it.
    pub chain: Vec<String>,
    pub header: Header,
    /// Text of the scenario file it came from.
    pub scenario: Option<String>,
    /// Names and contents of the calibration files by which its pairs were rectified, or can be.
    pub calibration: CalibrationFiles,
    /// A file stem for its recording.
    pub stem: String,
    /// True if frames come in real time.
    pub is_live: bool,
    /// Losses of live topics so far.
    pub losses: Option<Arc<Mutex<Losses>>>,
    /// The recording that it reads.
    pub recording: Option<Recording>,
    /// Delays of the topics that maps are read from.
    pub latency: Vec<TopicDelay>,
    /// Notes for the user that are no warnings.
    pub notes: Vec<String>,
    /// Facts of a folder, or of a recording that svl did not write.
    pub(crate) facts: StreamFacts,
    /// The truth of another sensor and the maps of topics that were requested.
    pub(crate) measured: SourceMaps,
}

/// Messages of live topics, received within some seconds.
#[derive(Serialize)]
pub struct Heard {
    /// Seconds of listening.
    pub seconds: f64,
    /// Topics without a message, each with the number of its publishers.
    pub silent: BTreeMap<String, usize>,
    /// Messages lost, by topic.
    pub lost: BTreeMap<String, u64>,
    /// Type of each other topic, of which no message was requested.
    pub others: BTreeMap<String, String>,
    /// The two topics that the user named.
    #[serde(skip)]
    pub named: Option<[String; 2]>,
    #[serde(skip)]
    pub(crate) folder: TempDir,
}

impl Heard {
    /// The bag of the messages.
    pub fn bag(&self) -> PathBuf {
        self.folder.path().join("heard.mcap")
    }
}

impl Opened {
    pub(crate) fn new(
        source: impl Source + 'static,
        header: Header,
        stem: impl Into<String>,
    ) -> Self {
        Self {
            source: Box::new(source),
            chain: Vec::new(),
            header,
            scenario: None,
            calibration: CalibrationFiles::new(),
            stem: stem.into(),
            is_live: false,
            losses: None,
            recording: None,
            latency: Vec::new(),
            notes: Vec::new(),
            facts: StreamFacts::default(),
            measured: SourceMaps::default(),
        }
    }

    /// The requested pairs, rectified, cropped and shrunk as requested.
    pub(crate) fn prepared(mut self, request: &Request<'_>) -> Result<Self> {
        let (range, window) = (request.options.range(), request.options.window());
        let changes = [range.words(), window.words()];
        let changes: Vec<_> = changes.into_iter().flatten().collect();
        if !changes.is_empty() {
            self.header.changes = Some(changes.join(", "));
        }
        let named_m = request.options.camera_height_m;
        self.header.camera_height_m = named_m.or(self.header.camera_height_m);
        self.latency = delays(&self.measured.maps);
        if let Some(board) = request.board()? {
            self.measured.truth = Some(MeasuredMaps::Board(Box::new(BoardTruth::new(board))));
        }
        let sight = match &self.measured.truth {
            Some(MeasuredMaps::Board(board)) => Some(board.finder()?),
            _ => None,
        };
        let declare = self.declared_rig(request);
        let rectify = self.rectification(request)?;
        let checks = self.facts.camera.checks.iter().filter(|_| !request.raw);
        let doubts = checks.filter_map(CalibrationCheck::doubt);
        for doubt in doubts.chain(self.facts.doubts.iter().cloned()) {
            warn_of(&self.source.name(), &doubt);
        }
        let options = Chain::for_options(&request.options, request.raw);
        let floor = self.told_floor(&request.options);
        let chain = Chain {
            distinct: options.distinct.filter(|()| !self.is_live),
            sight,
            rectify,
            declare,
            measure: std::mem::take(&mut self.measured).with_files(&request.maps)?,
            floor,
            ..options
        };
        self.over(chain)
    }

    /// The source of the floor plane, if there is one.
    fn told_floor(&self, options: &SourceOptions) -> Option<ToldFloor> {
        let level = self.header.camera_height_m.map(|height_m| LevelCamera {
            height_m,
            is_named: options.camera_height_m.is_some(),
        });
        let has_floor = self.measured.have_floor();
        (level.is_some() || has_floor).then_some(ToldFloor {
            level,
            is_live: self.is_live,
        })
    }

    /// The same, with what its pairs say of their images.
    pub(crate) fn with_facts(mut self, facts: StreamFacts) -> Self {
        let (name, header) = (self.source.name(), &mut self.header);
        header.bits = header.bits.or(facts.bits);
        header.frame_id = header.frame_id.take().or(facts.frame_id.clone());
        let note = facts.note.iter().map(|note| format!("{name}: {note}"));
        self.notes.splice(0..0, note);
        Self { facts, ..self }
    }

    /// The source in further layers.
    ///
    /// # Errors
    /// The errors of [`Chain::over`].
    pub fn over(mut self, chain: Chain) -> Result<Self> {
        self.chain.extend(chain.words());
        self.source = chain.over(self.source)?;
        Ok(self)
    }

    /// The rig of raw pairs that the user declares rectified.
    fn declared_rig(&self, request: &Request<'_>) -> Option<Rig> {
        let own = self.facts.calibration.as_ref();
        own.filter(|_| request.calib() == Calib::None)?.rig()
    }

    /// The calibration that rectifies the pairs as requested.
    fn rectification(&mut self, request: &Request<'_>) -> Result<Option<AppliedCalibration>> {
        let name = self.source.name();
        let (calib, alpha) = (request.calib(), request.options.alpha);
        let (calibration, by, files) = match (&calib, &self.facts.calibration) {
            (Calib::File(path), _) => {
                let topics = self.facts.topics.each_ref().map(String::as_str);
                let (calibration, files) = calibration::read(path, topics)?;
                // The doubts of the file were told.
                self.facts.camera.checks.clear();
                let calibration = calibration::framed(calibration, alpha)?;
                if calibration.unit() == LengthUnit::Squares {
                    let cure = "`svl calibrate convert --unit squares=SIDE_IN_METRES` sets \
                                their size";
                    tracing::warn!(
                        "{}: is in squares of its board, so there are no distances; {cure}",
                        path.display()
                    );
                }
                let names: Vec<_> = files.iter().map(|(name, _)| name.as_str()).collect();
                (calibration, names.join(", "), files)
            }
            (Calib::Own, Some(own)) => {
                self.notes.push(format!(
                    "{name}: raw images, rectified by its own calibration; --calib none uses them \
                     as they are"
                ));
                let by = match self.recording {
                    Some(_) => "the recording's own calibration",
                    None => "the folder's own calibration",
                };
                (own.clone(), by.to_owned(), CalibrationFiles::new())
            }
            (Calib::None, _) if alpha.is_some() => {
                return Err(Error::Usage(
                    "--alpha is for pairs that are rectified; omit it or --calib none".into(),
                ));
            }
            (Calib::None, Some(own)) if own.rig().is_some() => {
                self.notes.push(format!(
                    "{name}: by its calibration the images are not rectified; --calib none uses \
                     them as they are, with the focal length and baseline of its projections"
                ));
                return Ok(None);
            }
            (Calib::Own | Calib::None | Calib::Raw, own) => {
                if calib == Calib::None && !self.facts.remarks.is_empty() {
                    // They say that rectification is needed, or how it is done.
                    let why = "--calib none uses the images as they are";
                    tracing::warn!("{name}: disparities but no distances: {why}");
                } else if calib != Calib::Raw {
                    let remarks = self.facts.remarks.iter();
                    remarks.for_each(|remark| tracing::warn!("{name}: {remark}"));
                }
                // A recording of raw pairs keeps what would rectify them.
                let own = own.as_ref().map(calibration::written).transpose()?;
                self.calibration.extend(own.unwrap_or_default());
                return Ok(None);
            }
        };
        self.header.calibration = Some(by);
        self.calibration = files;
        Ok(Some(AppliedCalibration {
            calibration,
            follows_pairs: calib == Calib::Own,
        }))
    }

    /// The recording at that path, which is `name` in rows, with the way in which it was opened.
    pub fn record(&self, name: &str, path: &Path) -> InputRecord {
        let by = self.header.calibration.as_ref();
        let rectified = by.map(|by| format!("rectified by {by}"));
        let changes: Vec<_> = rectified
            .into_iter()
            .chain(self.header.changes.clone())
            .collect();
        let changes = (!changes.is_empty()).then(|| changes.join(", "));
        let files = self.calibration.iter();
        let hashes: Vec<_> = files.map(|(_, bytes)| hash_bytes(bytes)).collect();
        let scenario = self.scenario.as_ref();
        let scenario = scenario.and_then(|text| Scenario::parse(text, path).ok());
        InputRecord {
            separate_pairs: scenario.is_some_and(|scenario| scenario.has_separate_pairs()),
            is_untimed: self.header.stamps == Some(StampOrigin::UNKNOWN),
            calibration: (!hashes.is_empty()).then(|| hash(&hashes.join("\n"))),
            ..InputRecord::new(name, path, changes)
        }
    }

    /// Name of the scenario, or of the source.
    pub fn title(&self) -> &str {
        self.header.scenario.as_deref().unwrap_or(&self.stem)
    }

    /// Creates a recording of this source: header, manifest, scenario and calibration.
    ///
    /// # Errors
    /// The errors of [`Writer::create`] and [`Writer::attach`].
    pub fn writer(
        &self,
        path: &Path,
        format: impl Into<RecordingFormat>,
        manifest: &Manifest,
    ) -> Result<Writer> {
        let mut writer = Writer::create(path, &self.header, format)?;
        writer.identify(manifest)?;
        if let Some(text) = &self.scenario {
            writer.attach(SCENARIO, "application/toml", text.as_bytes())?;
        }
        for (name, bytes) in &self.calibration {
            let name = format!("{CALIBRATION}{name}");
            writer.attach(&name, "application/octet-stream", bytes)?;
        }
        Ok(writer)
    }
}
