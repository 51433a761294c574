//! The runs of a scenario: sources with what identifies them.

use super::opened::Opened;
use super::request::Request;
use super::{Limited, PairRegister, RegisteredSource, Source, StressedSource};
use std::io::ErrorKind;
use svl_core::stereo::Frame;
use svl_core::{Error, Result};
use svl_report::TopicDelay;
use svl_score::judge::{Judge, RunPart};
use svl_score::manifest::RunRecord;
use svl_score::scenario::{PairRange, RecordingRun, Scenario};
use svl_sim::stress::Stress;
use xxhash_rust::xxh3::Xxh3Default;

/// The request of a scenario of recordings for one of its files.
///
/// # Errors
/// [`Error::Io`] where it does not exist; [`Error::Usage`] for a scenario among recordings.
pub fn run_request<'a>(scenario: &Scenario, run: &'a RecordingRun) -> Result<Request<'a>> {
    let path = &run.path;
    if !path.exists() {
        return Err(Error::io(path, ErrorKind::NotFound.into()));
    }
    let shown = path.display();
    if path
        .extension()
        .is_some_and(|extension| extension == "toml")
    {
        let cure = "name either a scenario or recordings";
        return Err(Error::Usage(format!("{shown}: is a scenario; {cure}")));
    }
    let name = path.to_str();
    let name = name.ok_or_else(|| Error::Invalid(format!("{shown}: its name is not in UTF-8")))?;
    let request = Request {
        options: scenario.options.clone(),
        ..Request::new(name)
    };
    Ok(request.with_maps(&scenario.algorithms))
}

/// A run of a scenario. Its first frame is read ahead, so that a checkpoint that no frame could
/// pass is found before the run.
pub struct RunSource {
    source: Limited,
    /// Seed of an arena's run.
    pub seed: Option<u64>,
    /// The recording that it reads, where it is one.
    pub record: Option<RunRecord>,
    /// Delays of the topics that it reads maps from.
    pub latency: Vec<TopicDelay>,
    /// Scenario and seed of the simulation that a recording is of.
    simulated: Option<String>,
    start_ns: u64,
    stress: Option<Stress>,
    /// Number and stamp of the last pair that was read.
    last: Option<(u64, u64)>,
}

impl RunSource {
    /// A run that is not a recording of the user's.
    pub fn new(source: Box<dyn Source>, seed: Option<u64>) -> Self {
        Self::ahead(source, seed, None, None)
    }

    /// A recording.
    pub fn from_recording(run: &RecordingRun, opened: Opened) -> Self {
        let record = opened.record(&run.name, &run.path);
        let simulated = opened.header.simulated();
        Self {
            simulated,
            latency: opened.latency,
            ..Self::ahead(opened.source, None, Some(record), opened.start_ns)
        }
    }

    fn ahead(
        source: Box<dyn Source>,
        seed: Option<u64>,
        record: Option<RunRecord>,
        start_ns: Option<u64>,
    ) -> Self {
        let mut source = Limited::new(source, PairRange::default(), None);
        source.first();
        let first_ns = source.start_ns().unwrap_or_default();
        Self {
            source,
            seed,
            record,
            start_ns: start_ns.unwrap_or(first_ns),
            latency: Vec::new(),
            simulated: None,
            stress: None,
            last: None,
        }
    }

    /// Its name among the runs of a scenario.
    pub fn title(&self, scenario: &str) -> String {
        let seed = self.seed.map(|seed| format!("{scenario} seed {seed}"));
        seed.unwrap_or_else(|| self.name())
    }

    /// The run without the pairs that runs before it have. `seeks`: false if all its pairs have to
    /// be registered.
    #[must_use]
    pub fn registered(self, scenario: &str, register: &PairRegister, seeks: bool) -> Self {
        let name = self.title(scenario);
        let simulated = self
            .seed
            .map(|_| name.clone())
            .or_else(|| self.simulated.clone());
        let run = (name, simulated);
        self.around(|source| Box::new(RegisteredSource::new(source, register, run, seeks)))
    }

    /// The run with a source around its own.
    fn around(self, wrap: impl FnOnce(Box<dyn Source>) -> Box<dyn Source>) -> Self {
        let mut source = Limited::new(wrap(Box::new(self.source)), PairRange::default(), None);
        source.first();
        Self { source, ..self }
    }

    /// Warns of checkpoints that end after the last pair, once all pairs were read.
    pub fn warn_beyond(&self, judge: &Judge) {
        if let Some(last) = self.last.filter(|_| self.stress.is_none()) {
            let checkpoints = judge.checkpoints.iter();
            checkpoints.for_each(|checkpoint| checkpoint.warn_beyond(last, &judge.run));
        }
    }

    /// The run with perturbed pairs.
    #[must_use]
    pub fn stressed(self, stress: Stress) -> Self {
        let mut hasher = Xxh3Default::new();
        let name = self.record.as_ref().map_or("", |record| &record.name);
        hasher.update(name.as_bytes());
        let seed = self.seed.unwrap_or(hasher.digest());
        let run = self.around(|source| Box::new(StressedSource::new(source, stress, seed)));
        Self {
            stress: Some(stress),
            ..run
        }
    }

    /// The judge of its frames.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a checkpoint that no frame of it could pass, with the cure; the error
    /// of its first frame.
    pub fn judge(&mut self, judge: &Judge) -> Result<Judge> {
        let name = self.record.as_ref().map(|record| record.name.clone());
        let run = RunPart {
            name: name.unwrap_or_default(),
            start_ns: self.start_ns,
            stress: self.stress.map(|stress| stress.to_string()),
        };
        match self.source.first().cloned() {
            Some(frame) => {
                let why_no_pose = || self.source.why_no_pose();
                let mut checkpoints = judge.checkpoints.iter();
                checkpoints.try_for_each(|checkpoint| {
                    checkpoint.check_frame(&frame, &run, &why_no_pose)
                })?;
            }
            // Nothing can be scored: the reason is reported before a report is begun.
            None => drop(self.source.next()?),
        }
        Ok(Judge {
            run,
            ..judge.clone()
        })
    }
}

impl Source for RunSource {
    fn wrapped(&self) -> Option<&dyn Source> {
        Some(&self.source)
    }

    fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
        Some(&mut self.source)
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let frame = self.source.next()?;
        let pair = frame.as_ref().map(|frame| (frame.sequence, frame.stamp_ns));
        self.last = pair.or(self.last);
        Ok(frame)
    }
}
