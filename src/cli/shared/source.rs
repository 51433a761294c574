//! From what a user names to a source of frames.

use super::live::LiveArgs;
use super::rectify::Recorded;
use super::usage;
use anyhow::{Context, bail};
use clap::builder::{NonEmptyStringValueParser, PossibleValue, TypedValueParser};
use std::path::{Path, PathBuf};
use svl::arena::{Arena, ArenaConfig};
use svl::grab::{DRIVERS, Driver};
use svl::recording::{Header, Recording, Selection, files, is_bag};
use svl::scenario::{Scenario, ScenarioSource};
use svl::source::dataset::{FolderSource, Scene, SceneSource};
use svl::source::{ArenaSource, BoardSource, RecordingSource, Source};

/// Where recordings are kept.
pub(crate) const RECORDINGS: &str = "recordings";

/// Rate given to a folder of images, which has no times of its own.
const FOLDER_RATE_HZ: f64 = 10.0;

/// A source with what a recording of it says about its origin.
pub(crate) struct Opened {
    pub source: Box<dyn Source>,
    pub header: Header,
    /// Text of the scenario it came from, if any.
    pub scenario: Option<String>,
    /// A file stem for its recording.
    pub stem: String,
    /// Whether it comes from cameras, in real time.
    pub is_live: bool,
    /// What it says of its pairs, when it is a recording.
    pub recorded: Recorded,
}

/// Which pairs to read of a recording that svl did not write.
#[derive(clap::Args, Default)]
pub(crate) struct Topics {
    /// Topic of the left images, in another program's recording [default: found by type and name]
    #[arg(long, value_name = "TOPIC", value_parser = NonEmptyStringValueParser::new())]
    left: Option<String>,
    /// Topic of the right images
    #[arg(long, value_name = "TOPIC", value_parser = NonEmptyStringValueParser::new())]
    right: Option<String>,
    /// How far the stamps of a pair may be apart [default: 5; of cameras a quarter of their period,
    /// half of it when they run freely]
    #[arg(
        long, value_name = "MS", allow_negative_numbers = true,
        value_parser = usage::within(0.0..=60_000.0)
    )]
    pub max_skew_ms: Option<f64>,
}

impl Topics {
    fn selection(&self) -> Selection {
        Selection {
            left: self.left.clone(),
            right: self.right.clone(),
            max_skew_ns: self
                .max_skew_ms
                .map_or(Selection::MAX_SKEW_NS, |ms| (ms * 1e6) as u64),
        }
    }

    /// Opens the recording at `path` and selects its topics.
    pub(crate) fn open(&self, path: &Path) -> svl::Result<RecordingSource> {
        RecordingSource::new(Recording::open(path)?, &self.selection())
    }

    /// Whether the topics of a recording are named.
    pub(crate) fn are_named(&self) -> bool {
        self.left.is_some() || self.right.is_some()
    }

    fn are_given(&self) -> bool {
        self.are_named() || self.max_skew_ms.is_some()
    }
}

/// Opens a recording whose pairs are taken as they are, and says what to know of it.
pub(crate) fn open_recording(path: &Path, topics: &Topics) -> anyhow::Result<RecordingSource> {
    let source = topics.open(path)?;
    source
        .reader()
        .remarks()
        .iter()
        .for_each(|remark| tracing::warn!("{}: {remark}", path.display()));
    Ok(source)
}

/// Refuses the name of what is to be recorded before it can be replayed.
pub(crate) fn is_recorded(path: &Path) -> anyhow::Result<()> {
    let name = path.to_string_lossy();
    if !path.exists() && (["arena", "board"].contains(&&*name) || is_live(&name)) {
        return Err(usage::wrong(format!(
            "{name}: is no recording; make one first, svl record {name} -o run.mcap"
        )));
    }
    Ok(())
}

/// Starts the cameras that `name` says, or opens what [`open`] does.
pub(crate) fn open_any(
    name: &str,
    seed: Option<u64>,
    topics: &Topics,
    live: &LiveArgs,
    quiet: bool,
) -> anyhow::Result<Opened> {
    if !is_live(name) {
        live.none_given(name)?;
        if name.starts_with("/dev/video") {
            let cure = "name the left and the right camera, as v4l2:/dev/video0,/dev/video2";
            return Err(usage::wrong(format!("{name}: is no source; {cure}")));
        }
        return open(name, seed, topics, &sources());
    }
    if topics.are_named() {
        return Err(usage::wrong(format!(
            "{name}: --left and --right choose topics of a recording (.mcap)"
        )));
    }
    live.open(name, seed, topics.max_skew_ms, quiet)
}

/// Whether a name is of cameras.
fn is_live(name: &str) -> bool {
    svl::grab::driver(name).is_some()
}

/// What can be recorded.
fn sources() -> String {
    let cameras: Vec<_> = DRIVERS.iter().map(Driver::source).collect();
    format!(
        "arena, board, a scenario (.toml), a folder of images, a recording (.mcap), the folder of \
         a ROS 2 bag, or cameras: {}",
        cameras.join(" or ")
    )
}

/// Names of sources that are no files; cameras have theirs after a colon.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    let cameras = DRIVERS.iter().map(|driver| driver.name);
    ["arena", "board"].into_iter().chain(cameras)
}

/// The name of a source: any text, for which completion scripts offer [`names`].
#[derive(Clone)]
pub(crate) struct SourceParser;

impl TypedValueParser for SourceParser {
    type Value = String;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &std::ffi::OsStr,
    ) -> Result<String, clap::Error> {
        NonEmptyStringValueParser::new().parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(names().map(PossibleValue::new)))
    }
}

/// The files that a source named so reads, as far as it is one.
pub(crate) fn inputs(source: &Path) -> Vec<PathBuf> {
    files(source).unwrap_or_else(|_| vec![source.to_owned()])
}

/// Opens `arena`, `board`, a scenario file of the arena, a scene or image folder, or a recording;
/// `expected` are those to be offered where the name is of none.
pub(crate) fn open(
    name: &str,
    seed: Option<u64>,
    topics: &Topics,
    expected: &str,
) -> anyhow::Result<Opened> {
    let path = Path::new(name);
    // A scene may have a recording beside its images.
    let is_bag = is_bag(path) && Scene::find(path, name).is_none();
    if topics.are_given() && !is_bag && path.extension().is_none_or(|e| e != "mcap") {
        let words = "--left, --right and --max-skew-ms choose topics of a recording (.mcap, or \
                     the folder of a bag)";
        return Err(usage::wrong(format!("{name}: {words}")));
    }
    if name == "arena" {
        return arena(&Scenario::arena()?, seed.unwrap_or(1));
    }
    if name == "board" {
        return board(seed.unwrap_or(1));
    }
    if !path.exists() {
        bail!("{name}: no such source; expected {expected}");
    }
    let scenario = path.extension().is_some_and(|e| e == "toml");
    if seed.is_some() && !scenario {
        return Err(usage::wrong(format!(
            "{name}: only the arena, the board and simulated cameras take a --seed"
        )));
    }
    if is_bag {
        return recording(path, topics);
    }
    if path.is_dir() {
        return folder(path);
    }
    match path.extension().and_then(|e| e.to_str()) {
        Some("toml") => arena(&Scenario::read(path)?, seed.unwrap_or(1)),
        // Bags in other containers: the reader says what makes one of them that it reads.
        Some("mcap" | "db3" | "zstd" | "zst") => recording(path, topics),
        _ => bail!("{name}: not a source; expected {expected}"),
    }
}

/// The arena of a scenario with one of its seeds, or another.
pub(crate) fn arena(scenario: &Scenario, seed: u64) -> anyhow::Result<Opened> {
    let ScenarioSource::Arena { config, .. } = &scenario.source else {
        bail!(
            "scenario '{}' reads scene folders; name one of them to record it",
            scenario.name
        );
    };
    Ok(Opened {
        source: Box::new(ArenaSource::new(Arena::new(config, seed)?, seed)),
        stem: format!("{}-seed{seed}", scenario.name),
        header: Header {
            scenario: Some(scenario.name.clone()),
            seed: Some(seed),
            hash: Some(arena_hash(config, seed)),
            ..Header::new("arena")
        },
        scenario: Some(scenario.text.clone()),
        is_live: false,
        recorded: Recorded::default(),
    })
}

/// A calibration board that is moved before two cameras.
fn board(seed: u64) -> anyhow::Result<Opened> {
    Ok(Opened {
        source: Box::new(BoardSource::new(seed)?),
        stem: format!("board-seed{seed}"),
        header: Header {
            seed: Some(seed),
            ..Header::new("board")
        },
        scenario: None,
        is_live: false,
        recorded: Recorded::default(),
    })
}

/// What tells one simulated run from another: everything that its pixels depend on.
fn arena_hash(config: &ArenaConfig, seed: u64) -> String {
    // A configuration is plain numbers and text: JSON can say them all.
    let config = serde_json::to_string(config).unwrap_or_default();
    let said = format!(
        "svl {} arena {} seed {seed} {config}",
        env!("CARGO_PKG_VERSION"),
        svl::arena::REVISION
    );
    format!("{:032x}", xxhash_rust::xxh3::xxh3_128(said.as_bytes()))
}

fn folder(path: &Path) -> anyhow::Result<Opened> {
    let stem = path
        .canonicalize()
        .ok()
        .and_then(|p| Some(p.file_name()?.to_str()?.to_owned()))
        .unwrap_or("pairs".into());
    let scenes = match Scene::find(path, &stem) {
        Some(scene) => vec![scene],
        None => Scene::all_in(path, "")?,
    };
    let source: Box<dyn Source> = if scenes.is_empty() {
        Box::new(FolderSource::new(path, FOLDER_RATE_HZ)?)
    } else {
        Box::new(SceneSource::new(scenes))
    };
    let header = Header {
        scenario: Some(stem.clone()),
        ..Header::new(path.display().to_string())
    };
    Ok(Opened {
        source,
        header,
        scenario: None,
        stem,
        is_live: false,
        recorded: Recorded::default(),
    })
}

fn recording(path: &Path, topics: &Topics) -> anyhow::Result<Opened> {
    let source = topics.open(path)?;
    let recorded = Recorded::of(&source)?;
    let header = source
        .reader()
        .header()
        .cloned()
        .unwrap_or_else(|| Header::new(path.display().to_string()));
    let stem = path
        .file_stem()
        .and_then(|s| s.to_str())
        .unwrap_or("recording")
        .to_owned();
    let scenario = source.scenario()?;
    Ok(Opened {
        source: Box::new(source),
        header,
        scenario,
        stem,
        is_live: false,
        recorded,
    })
}

/// The folder of the data sets: the one named, or what `SVL_DATASETS` names.
pub(crate) fn data_folder(named: Option<&Path>) -> Option<PathBuf> {
    let variable = || std::env::var_os("SVL_DATASETS").filter(|folder| !folder.is_empty());
    named
        .map(Path::to_owned)
        .or_else(|| variable().map(PathBuf::from))
}

/// Makes the folder where recordings are kept.
pub(crate) fn make_recordings_folder() -> anyhow::Result<()> {
    std::fs::create_dir_all(RECORDINGS)
        .with_context(|| format!("{RECORDINGS}: cannot make the folder"))
}

/// The newest recording in `recordings/`.
pub(crate) fn newest_recording() -> Option<PathBuf> {
    let entries = std::fs::read_dir(RECORDINGS)
        .ok()?
        .filter_map(Result::ok)
        .map(|e| e.path());
    let recordings = entries.filter(|p| p.extension().is_some_and(|e| e == "mcap"));
    recordings.max_by_key(|p| p.metadata().and_then(|m| m.modified()).ok())
}

/// `folder/stem-N.mcap` with the first number that is free.
pub(crate) fn free_name(folder: &Path, stem: &str) -> PathBuf {
    let name = |n: u32| folder.join(format!("{stem}-{n}.mcap"));
    (1..)
        .map(name)
        .find(|p| !p.exists())
        .unwrap_or_else(|| name(0))
}
