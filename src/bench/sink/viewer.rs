//! Content and target of a viewer: the bench describes it, the package `svl-viewer` shows it in
//! Rerun.

use super::{ResultsSoFar, Sink};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use svl_core::stereo::{Frame, GridShape, StereoPair};
use svl_core::{Error, Result};
use svl_files::outputs::Outputs;
use svl_score::manifest::Manifest;
use svl_sim::arena::WireObject;

/// A viewer that svl can write to.
pub trait Viewer: Sync {
    /// The sink that shows a run.
    ///
    /// # Errors
    /// The file exists (it is never overwritten: remove it first) or cannot be made; no viewer to
    /// spawn, none at the URL, or one of another version. Always one line.
    fn run(
        &self,
        target: RerunTarget,
        detail: RerunDetail,
        info: &ViewedScene,
        verdicts: Option<Verdicts>,
    ) -> Result<Box<dyn Sink>>;

    /// The sink that shows frames while a person changes the first algorithm: the maps of all
    /// beside each other, in the order in which they come, whatever their numbers, and each at
    /// once. When a frame comes again, algorithms behind the first that have no estimate keep the
    /// one they had.
    ///
    /// # Errors
    /// The errors of [`Viewer::run`].
    fn tuning(&self, target: RerunTarget, info: &ViewedScene) -> Result<Box<dyn Sink>>;

    /// Pairs of a calibration board of `columns` corners in a row.
    ///
    /// # Errors
    /// The errors of [`Viewer::run`].
    fn board(&self, target: RerunTarget, columns: usize) -> Result<Box<dyn BoardView>>;

    /// The frames that a person steps through.
    ///
    /// # Errors
    /// The errors of [`Viewer::run`].
    fn steps(&self, target: RerunTarget) -> Result<Box<dyn StepView>>;

    /// Writes the layout for the recording `file` of svl with those topics to `layout`, a file
    /// `*.rbl`, and returns true if it did: a recording without svl's topics keeps the viewer's
    /// automatic layout.
    ///
    /// # Errors
    /// The layout cannot be written.
    fn save_layout(&self, file: &Path, topics: &[String], layout: &Path) -> Result<bool>;

    /// Checks that [`RerunTarget::Spawn`] can show something: a viewer listens already, or
    /// [`Viewer::find_program`].
    ///
    /// # Errors
    /// One line with the cure.
    fn find(&self) -> Result<()>;

    /// Checks that the program is on the PATH and has the version of the library.
    ///
    /// # Errors
    /// One line with the cure.
    fn find_program(&self) -> Result<()>;
}

/// Reads the results when the run is over.
pub type Verdicts = Box<dyn FnOnce() -> Option<ResultsSoFar> + Send>;

/// Shows pairs with the corners of a board.
pub trait BoardView {
    /// Shows pair `sequence`, the corners of its images row by row where they were found, in
    /// pixels, and `state`, as Markdown.
    ///
    /// # Errors
    /// The viewer is gone, or the file cannot be written.
    fn show(
        &self,
        sequence: u64,
        pair: &StereoPair,
        corners: [&[nalgebra::Point2<f64>]; 2],
        state: &str,
    ) -> Result<()>;

    /// Waits until all is written or sent.
    ///
    /// # Errors
    /// The errors of [`BoardView::show`].
    fn finish(&self) -> Result<()>;
}

/// Shows one frame after the other, in the order of the steps.
pub trait StepView {
    /// Shows the left image of `frame` with a grid, its notes, and `state`, as Markdown.
    ///
    /// # Errors
    /// The viewer is gone, or the file cannot be written.
    fn show(&self, frame: &Frame, shape: GridShape, notes: &[CellNote], state: &str) -> Result<()>;

    /// Waits until all is written or sent.
    ///
    /// # Errors
    /// The errors of [`StepView::show`].
    fn finish(&self) -> Result<()>;
}

/// Note on a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct CellNote {
    /// Column and row.
    pub at: (usize, usize),
    pub text: String,
    /// True if the user has selected the cell.
    pub is_picked: bool,
}

/// Target of a viewer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RerunTarget {
    /// A new file `*.rrd`.
    File(PathBuf),
    /// A viewer: the one listening on Rerun's default port, else a new one.
    Spawn,
    /// A running viewer, e.g. `rerun+http://127.0.0.1:9876/proxy`.
    Url(String),
}

impl RerunTarget {
    /// The file to write, if it is one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Spawn | Self::Url(_) => None,
        }
    }

    /// The same with the place where its file is written.
    #[must_use]
    pub fn placed(&self, outputs: &Outputs) -> Self {
        let place = self.file().map(|path| Self::File(outputs.place(path)));
        place.unwrap_or_else(|| self.clone())
    }
}

impl FromStr for RerunTarget {
    type Err = Error;

    /// `spawn`, a URL (`rerun+http://HOST:PORT/proxy`, or `http://HOST:PORT` for short), or a file
    /// ending in `.rrd`.
    fn from_str(text: &str) -> Result<Self> {
        if text == "spawn" {
            return Ok(Self::Spawn);
        }
        let Some((scheme, address)) = text.split_once("://") else {
            return match text {
                file if file.ends_with(".rrd") => Ok(Self::File(file.into())),
                other => Err(Error::Invalid(format!(
                    "'{other}' is not a Rerun destination; use spawn, a viewer's URL or a FILE.rrd"
                ))),
            };
        };
        let scheme = scheme.trim_start_matches("rerun+");
        let address = address.trim_end_matches('/').trim_end_matches("/proxy");
        if !matches!(scheme, "http" | "https") || address.is_empty() {
            return Err(Error::Invalid(format!(
                "{text}: a viewer's URL looks like rerun+http://127.0.0.1:9876/proxy"
            )));
        }
        Ok(Self::Url(format!("rerun+{scheme}://{address}/proxy")))
    }
}

impl std::fmt::Display for RerunTarget {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(path) => write!(f, "{}", path.display()),
            Self::Spawn => f.write_str("the spawned viewer"),
            Self::Url(url) => f.write_str(url),
        }
    }
}

/// Frames whose maps and point clouds are logged. Images, overlays and numbers are logged for all
/// frames, and SSDPI for some, as no other map is as large.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RerunDetail {
    /// Maps of every 30th frame, of every 10th of those that show a checkpoint, and of the first
    /// 64 scenes.
    Light,
    /// Maps of all frames.
    #[default]
    Full,
}

/// The algorithms of a run and the true geometry of its scene.
#[derive(Clone, Debug, Default)]
pub struct ViewedScene {
    /// One for all algorithms of a run.
    pub recording_id: String,
    /// Name of the scenario or source, shown as the recording's name.
    pub scenario: String,
    /// Labels of the algorithms, each with its parameters as text.
    pub algorithms: Vec<(String, String)>,
    /// True geometry, empty where unknown.
    pub wireframe: Vec<WireObject>,
}

impl ViewedScene {
    pub fn new(manifest: &Manifest, wireframe: Vec<WireObject>) -> Self {
        let algorithms = manifest.algorithms.iter();
        Self {
            recording_id: manifest.run_id.clone(),
            scenario: manifest.scenario.clone(),
            algorithms: algorithms
                .map(|a| (a.label.clone(), a.parameters.clone()))
                .collect(),
            wireframe,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_distinguished() {
        let url = |text: &str| Ok(RerunTarget::Url(text.to_owned()));
        let parse = |text: &str| text.parse::<RerunTarget>().map_err(|e| e.to_string());
        assert_eq!(parse("spawn"), Ok(RerunTarget::Spawn));
        assert_eq!(
            parse("out/run.rrd"),
            Ok(RerunTarget::File("out/run.rrd".into()))
        );
        assert_eq!(
            parse("http://host:9876"),
            url("rerun+http://host:9876/proxy")
        );
        assert_eq!(
            parse("rerun+https://host:1/proxy"),
            url("rerun+https://host:1/proxy")
        );
        assert!(parse("ftp://host").is_err() && parse("").is_err());
    }
}
