//! The runs of a scenario: sources with what identifies them.

use crate::source::frames::{Source, wraps};
use crate::source::layers::chain::Chain;
use crate::source::layers::registered::{PairRegister, Registration};
use crate::source::layers::stressed::Perturbation;
use crate::source::opened::open_source::Opened;
use crate::source::opened::request::Request;
use std::io::ErrorKind;
use svl_core::stereo::Frame;
use svl_core::{Error, Result};
use svl_report::TopicDelay;
use svl_score::judge::{FrameOrigin, Judge};
use svl_score::manifest::InputRecord;
use svl_score::scenario::{InputFile, Scenario};
use svl_sim::stress::Stress;
use xxhash_rust::xxh3::Xxh3Default;

/// The request of a scenario of recordings for one of its files.
///
/// # Errors
/// [`Error::Io`] where it does not exist; [`Error::Usage`] for a scenario among recordings.
pub fn run_request<'a>(scenario: &Scenario, run: &'a InputFile) -> Result<Request<'a>> {
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

/// A source whose first pair was read ahead.
struct ReadAhead {
    source: Box<dyn Source>,
    /// The pair to give out next, or the error.
    first: Option<Result<Option<Frame>>>,
}

impl ReadAhead {
    fn new(source: Box<dyn Source>, first: Option<Result<Option<Frame>>>) -> Box<Self> {
        Box::new(Self { source, first })
    }
}

impl Source for ReadAhead {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        let first = self.first.take();
        first.unwrap_or_else(|| self.source.next())
    }

    fn seek(&mut self, index: u64) -> Result<bool> {
        let sought = self.source.seek(index)?;
        if sought {
            self.first = None;
        }
        Ok(sought)
    }
}

/// A run of a scenario. Its first frame is read ahead, so that a checkpoint that no frame could
/// pass is found before the run.
pub struct RunSource {
    source: Box<ReadAhead>,
    /// Names of the layers around its source.
    pub chain: Vec<String>,
    /// Seed of an arena's run.
    pub seed: Option<u64>,
    /// The recording that it reads, where it is one.
    pub record: Option<InputRecord>,
    /// Delays of the topics that it reads maps from.
    pub latency: Vec<TopicDelay>,
    /// Scenario and seed of the simulation that a recording is of.
    simulated: Option<String>,
    /// True if its first frame has a truth, and if that is a raw pair.
    pub has_truth: bool,
    pub is_raw: bool,
    /// Width and height of the images of its first frame, pixels.
    pub size: Option<(usize, usize)>,
    start_ns: u64,
    stress: Option<Stress>,
    /// Number and stamp of the last pair that was read.
    last: Option<(u64, u64)>,
}

impl RunSource {
    /// A run that is not a recording of the user's, in these layers.
    ///
    /// # Errors
    /// The errors of [`Chain::over`].
    pub fn new(source: Box<dyn Source>, chain: Chain, seed: Option<u64>) -> Result<Self> {
        let chain_words = chain.words();
        let mut source = chain.over(source)?;
        let first = source.next();
        let stamp_ns = first.iter().flatten().map(|frame| frame.stamp_ns).next();
        Ok(Self {
            has_truth: first.iter().flatten().any(|frame| frame.truth.is_some()),
            is_raw: first
                .iter()
                .flatten()
                .any(|frame| frame.rectified().is_err()),
            size: first.iter().flatten().map(|frame| frame.pair.size()).next(),
            start_ns: source.start_ns().or(stamp_ns).unwrap_or_default(),
            source: ReadAhead::new(source, Some(first)),
            chain: chain_words,
            seed,
            record: None,
            latency: Vec::new(),
            simulated: None,
            stress: None,
            last: None,
        })
    }

    /// A recording.
    pub fn from_recording(run: &InputFile, opened: Opened) -> Result<Self> {
        Ok(Self {
            record: Some(opened.record(&run.name, &run.path)),
            simulated: opened.header.simulated(),
            latency: opened.latency,
            chain: opened.chain,
            ..Self::new(opened.source, Chain::default(), None)?
        })
    }

    /// Name of the run among the runs of a scenario.
    pub fn title(&self, scenario: &str) -> String {
        let seed = self.seed.map(|seed| format!("{scenario} seed {seed}"));
        seed.unwrap_or_else(|| self.name())
    }

    /// The run without the pairs that runs before it have.
    ///
    /// # Errors
    /// The errors of [`Chain::over`].
    pub fn registered(self, scenario: &str, register: &PairRegister) -> Result<Self> {
        let name = self.title(scenario);
        let simulated = self.seed.map(|_| name.clone());
        let registration = Registration {
            register: register.clone(),
            simulated: simulated.or_else(|| self.simulated.clone()),
            name,
        };
        self.over(Chain {
            register: Some(registration),
            ..Chain::default()
        })
    }

    /// The run in layers around those that its first pair came through.
    fn over(mut self, chain: Chain) -> Result<Self> {
        self.chain.extend(chain.words());
        self.source = ReadAhead::new(chain.over(self.source)?, None);
        Ok(self)
    }

    /// Warns of checkpoints that end after the last pair, once all pairs were read.
    pub fn warn_beyond(&self, judge: &Judge) {
        if let Some(last) = self.last.filter(|_| self.stress.is_none()) {
            let checkpoints = judge.checkpoints.iter();
            checkpoints.for_each(|checkpoint| checkpoint.warn_beyond(last, &judge.run));
        }
    }

    /// The run with perturbed pairs.
    ///
    /// # Errors
    /// The errors of [`Chain::over`].
    pub fn stressed(self, stress: Stress) -> Result<Self> {
        let mut hasher = Xxh3Default::new();
        let name = self.record.as_ref().map_or("", |record| &record.name);
        hasher.update(name.as_bytes());
        let seed = self.seed.unwrap_or(hasher.digest());
        let chain = Chain {
            perturb: Some(Perturbation { stress, seed }),
            ..Chain::default()
        };
        Ok(Self {
            stress: Some(stress),
            ..self.over(chain)?
        })
    }

    /// The judge of its frames, before they are perturbed.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a checkpoint that no frame of it could pass, with the cure; the error
    /// of its first frame.
    pub fn judge(&mut self, judge: &Judge) -> Result<Judge> {
        let record = self.record.as_ref();
        let run = FrameOrigin {
            name: record.map(|record| record.name.clone()).unwrap_or_default(),
            is_untimed: record.is_some_and(|record| record.is_untimed),
            start_ns: self.start_ns,
            stress: None,
            seed: self.seed,
        };
        let judge = Judge {
            run: run.clone(),
            ..judge.clone()
        };
        match &self.source.first {
            Some(Ok(Some(frame))) => {
                if let Some(piece) = judge.piece() {
                    piece.check(frame)?;
                    let floor = frame.floor.map(|floor| floor.camera_height_m());
                    if floor.is_some_and(|height_m| 6.0 * piece.size_m[1] < height_m) {
                        tracing::warn!(
                            "the test piece is lower than a sixth of the camera's height: the \
                             floor behind its top is within the tolerance"
                        );
                    }
                }
                let why_no_pose = || self.source.why_no_pose();
                let mut checkpoints = judge.checkpoints.iter();
                checkpoints
                    .try_for_each(|checkpoint| checkpoint.check_frame(frame, &run, &why_no_pose))?;
            }
            // Nothing can be scored: the reason is reported before a report is begun.
            _ => drop(self.source.next()?),
        }
        Ok(judge)
    }
}

impl Source for RunSource {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        let frame = self.source.next()?;
        let pair = frame.as_ref().map(|frame| (frame.sequence, frame.stamp_ns));
        self.last = pair.or(self.last);
        Ok(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{Geometry, Gray, StereoPair};

    /// Pairs of which none is asked for again.
    struct Counted(u64);

    impl Source for Counted {
        fn name(&self) -> String {
            "counted".into()
        }

        fn next(&mut self) -> Result<Option<Frame>> {
            self.0 += 1;
            let image = Gray::from_fn(40, 20, |x, y| (7 * x + 3 * y + self.0 as usize) as u8)?;
            Ok(Some(Frame {
                sequence: self.0,
                ..Frame::new(StereoPair::new(image.clone(), image)?, Geometry::Raw)
            }))
        }

        fn pairs(&self) -> Option<u64> {
            Some(self.0)
        }
    }

    #[test]
    fn the_first_pair_is_looked_at_once_and_given_to_all_layers() {
        let chain = Chain {
            check: Some(()),
            ..Chain::default()
        };
        let run = RunSource::new(Box::new(Counted(0)), chain, Some(3)).unwrap();
        let run = run.registered("arena", &PairRegister::default()).unwrap();
        let mut run = run.stressed("noise=1".parse().unwrap()).unwrap();
        assert_eq!(run.pairs(), Some(1));
        assert_eq!(run.chain, ["check", "register", "perturb"]);
        let sequences = [(); 3].map(|()| run.next().unwrap().unwrap().sequence);
        assert_eq!(sequences, [1, 2, 3]);
    }
}
