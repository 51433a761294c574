//! The thesis's experiments, repeated: each with its figure, its numbers next to the thesis's, and
//! a verdict on its claim.
//!
//! ```text
//! EXPERIMENTS ──run(Context)──▶ Finding: conditions, quantities, tables, plots, pictures
//!                                  └──▶ FindingsPage: HTML, Markdown, JSON
//! ```
//!
//! An experiment measures scenes built from the arena's parts, with exact truth, and real scenes if
//! a folder of data sets is given. Its verdict follows from its [`Condition`]s.

mod checks;
mod closeness;
mod distance;
mod filters;
mod finding;
mod hashing;
mod measure;
mod page;
mod points;
mod situations;
mod smoothing;
mod speed;
mod stage;
mod stressed;
mod texture;
mod validity;

pub use finding::{ClaimVerdict, Condition, Exhibit, Finding, FindingTable, Quantity};
pub use page::{ExperimentFinding, FindingsPage};

use std::path::Path;
use svl_bench::pass::{self, Matchers, Monitor, Pace};
use svl_bench::sink::{self, Outbox, PassStart, Sink, WatchSink};
use svl_bench::source::Source;
use svl_bench::source::dataset::Scene;
use svl_core::stereo::Frame;
use svl_core::{Error, Result, did_you_mean, joined};
use svl_score::judge::{Judge, Judged};
use svl_score::manifest::Manifest;
use svl_score::scenario::Scenario;

/// One of the thesis's figures or tables, and svl's experiment for it.
pub struct Experiment {
    /// Name on the command line, then other figures of the same experiment.
    pub figures: &'static [&'static str],
    /// Place in the thesis, as a heading.
    pub place: &'static str,
    pub title: &'static str,
    /// The thesis's claim, with its section.
    pub claim: &'static str,
    /// The method here, and its departures from the thesis.
    pub method: &'static str,
    /// Measures and concludes.
    run: fn(&mut Context<'_>, &mut Finding) -> Result<()>,
}

/// The experiments of the thesis that svl repeats, in the thesis's order.
pub const EXPERIMENTS: &[Experiment] = &[
    distance::EXPERIMENT,
    situations::EXPERIMENT,
    smoothing::EXPERIMENT,
    texture::EXPERIMENT,
    closeness::EXPERIMENT,
    validity::EXPERIMENT,
    hashing::EXPERIMENT,
    stressed::LIGHT,
    stressed::MISALIGNMENT,
    points::EXPERIMENT,
    speed::EXPERIMENT,
    filters::spectrum::EXPERIMENT,
    filters::training::EXPERIMENT,
    filters::hidden::EXPERIMENT,
    filters::motion::EXPERIMENT,
];

/// The experiment for that figure.
///
/// # Errors
/// [`Error::Invalid`] with the nearest figure.
pub fn find(figure: &str) -> Result<&'static Experiment> {
    let found = EXPERIMENTS.iter().find(|e| e.figures.contains(&figure));
    found.ok_or_else(|| {
        let guess = did_you_mean(figure, EXPERIMENTS.iter().flat_map(|e| e.figures).copied());
        let known = joined(EXPERIMENTS.iter().map(Experiment::figure));
        Error::Invalid(format!(
            "unknown figure '{figure}'{guess}; known are {known}"
        ))
    })
}

impl Experiment {
    /// Name on the command line.
    pub fn figure(&self) -> &'static str {
        self.figures[0]
    }

    /// True if it needs a run of the arena, [`Context::recording`].
    pub fn records(&self) -> bool {
        self.figure() == points::EXPERIMENT.figure()
    }

    /// Repeats it.
    ///
    /// # Errors
    /// The errors of its scenes and algorithms; [`Error::Invalid`] if the monitor ends the work.
    pub fn run(&self, context: &mut Context<'_>) -> Result<Finding> {
        let mut finding = Finding::default();
        (self.run)(context, &mut finding)?;
        Ok(finding)
    }
}

/// The input of experiments.
pub struct Context<'a> {
    /// Real scenes; empty if no folder of data sets was given.
    pub scenes: &'a [Scene],
    /// The processor, in words.
    pub machine: &'a str,
    /// A run of the scenario's arena, for the experiment that needs one.
    pub recording: Option<(Scenario, Box<dyn Source>)>,
    monitor: &'a mut dyn Monitor,
    done: u64,
}

/// The folders of the real scenes of experiments, below the folder of data sets:
/// Middlebury 2001, 2003, 2005, 2006 and 2014 in quarter size.
const SCENES: &[&str] = &[
    "tsukuba",
    "venus",
    "teddy",
    "cones",
    "middlebury2006/Art",
    "middlebury2006/Baby1",
    "middlebury2006/Books",
    "middlebury2006/Reindeer",
    "middlebury2014q/Adirondack",
    "middlebury2014q/Motorcycle",
];

/// The real scenes that exist below `data`.
///
/// # Errors
/// [`Error::Invalid`] if there is none.
pub fn scenes(data: &Path) -> Result<Vec<Scene>> {
    let scene = |name: &&str| Scene::find(&data.join(name), name);
    let scenes: Vec<_> = SCENES.iter().filter_map(scene).collect();
    if scenes.is_empty() {
        let (data, wanted) = (data.display(), joined(SCENES));
        let why = format!("{data}: contains none of the scenes {wanted}");
        return Err(Error::Invalid(why));
    }
    Ok(scenes)
}

impl<'a> Context<'a> {
    /// The monitor is called after every pair and may end the work.
    pub fn new(
        machine: &'a str,
        scenes: &'a [Scene],
        recording: Option<(Scenario, Box<dyn Source>)>,
        monitor: &'a mut dyn Monitor,
    ) -> Self {
        Self {
            machine,
            scenes,
            recording,
            monitor,
            done: 0,
        }
    }

    /// Counts a pair.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the monitor ends the work.
    fn step(&mut self) -> Result<()> {
        self.go_on(1).then_some(()).ok_or_else(stopped)
    }

    /// Runs a source through the algorithms, `NAME[:key=value,...]`, and adds its scored frames to
    /// a sum.
    ///
    /// # Errors
    /// The errors of the run; [`Error::Invalid`] if an algorithm fails or the monitor ends the
    /// work.
    fn fold<T: Default + Send + 'static>(
        &mut self,
        source: &mut dyn Source,
        algorithms: &[&str],
        judge: &Judge,
        sum: T,
        add: fn(&mut T, &Judged),
    ) -> Result<T> {
        let algorithms = algorithms.iter().map(|a| a.parse());
        let algorithms = algorithms.collect::<Result<Vec<_>>>()?;
        let manifest = Manifest::new("reproduce", &algorithms)?;
        let start = PassStart::new(&manifest, None, judge);
        let mut matchers = Matchers::new(&algorithms)?;
        let outbox = Outbox::default();
        let sums = outbox.clone();
        sums.put(sum);
        let sink = WatchSink(move |judged: &Judged| {
            let mut sum = sums.take();
            add(&mut sum, judged);
            sums.put(sum);
        });
        let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(sink)];
        // Called also with one core: the run is then sequential.
        let (outcome, ran) = pass::run(source, &mut matchers, &start, Pace::Asap, &mut sinks, self);
        ran?;
        if outcome.interrupted {
            return Err(stopped());
        }
        if outcome.failures.values().any(|failed| *failed > 0) {
            return Err(Error::Invalid("an algorithm failed, as warned".into()));
        }
        sink::finish(sinks)?;
        Ok(outbox.take())
    }

    /// The frames with their scored estimates, in the order of the algorithms.
    ///
    /// # Errors
    /// The errors of [`Context::fold`].
    fn judged(
        &mut self,
        frames: Vec<Frame>,
        algorithms: &[&str],
        judge: &Judge,
    ) -> Result<Vec<Judged>> {
        let frames = &mut Frames(frames.into_iter());
        let add = |all: &mut Vec<_>, judged: &Judged| all.push(judged.clone());
        self.fold(frames, algorithms, judge, Vec::new(), add)
    }

    /// The findings of `look` in each real scene, under the scene's name.
    fn in_real_scenes<T>(&mut self, look: impl Fn(Frame) -> Result<T>) -> Result<Vec<(String, T)>> {
        let mut found = Vec::new();
        for (i, scene) in self.scenes.iter().enumerate() {
            self.step()?;
            let frame = scene.read(i as u64)?;
            found.push((frame.name.clone().unwrap_or_default(), look(frame)?));
        }
        Ok(found)
    }
}

fn stopped() -> Error {
    Error::Invalid("stopped".into())
}

/// Counts pairs over all runs of an experiment.
impl Monitor for Context<'_> {
    fn go_on(&mut self, _: u64) -> bool {
        self.done += 1;
        self.monitor.go_on(self.done)
    }
}

/// Frames made by an experiment.
struct Frames(std::vec::IntoIter<Frame>);

impl Source for Frames {
    fn next(&mut self) -> Result<Option<Frame>> {
        Ok(self.0.next())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_unique_and_slips_are_guessed() {
        let mut figures: Vec<_> = EXPERIMENTS.iter().flat_map(|e| e.figures).collect();
        let all = figures.len();
        figures.sort_unstable();
        figures.dedup();
        assert_eq!(figures.len(), all);
        let error = find("5.12").err().unwrap().to_string();
        assert!(
            error.starts_with("unknown figure '5.12' (did you mean '5.1"),
            "{error}"
        );
    }
}
