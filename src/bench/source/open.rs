//! [`open`]: from a user's name to a source of frames, by the table [`SOURCES`].

use super::calibration::CalibrationFiles;
use super::dataset::{Scene, SceneSource};
use super::live_topics::{self, are_live_topics};
use super::opened::Opened;
use super::request::Request;
use super::video::is_video;
use super::{
    ArenaSource, BoardSource, FolderSource, FolderTruth, LiveSource, RecordingSource, SensorTruth,
    VideoSource,
};
use std::path::Path;
use svl_core::{Error, Result, joined};
use svl_data::arena::Arena;
use svl_data::grab::{self, DRIVERS, Driver, GrabRequest};
use svl_data::recording::{Header, Recording, is_bag};
use svl_data::scenario::{Scenario, ScenarioSource, flag};

/// A kind of source that a user can name.
pub struct SourceKind {
    /// Its syntax.
    pub name: &'static str,
    /// Its name in a sentence.
    pub noun: &'static str,
    /// Its description, for help texts.
    pub help: &'static str,
    /// Keys of the options that it accepts, besides those that all accept.
    options: &'static [&'static str],
    /// True if it is named by a path, which must exist.
    is_path: bool,
    recognizes: fn(&str) -> bool,
    open: fn(&Request<'_>) -> Result<Opened>,
}

impl SourceKind {
    /// True if it needs neither file nor camera.
    pub fn is_simulated(&self) -> bool {
        !self.is_path && self.name != CAMERAS && !are_live_topics(self.name)
    }
}

/// All sources, in the order in which a name is looked for. A new one is one entry here.
pub const SOURCES: &[SourceKind] = &[
    SourceKind {
        name: "arena",
        noun: "the arena",
        help: "the simulated arena, the thesis's test",
        options: &["seed"],
        is_path: false,
        recognizes: |name| name == "arena",
        open: |request| open_arena(&Scenario::arena()?, request.seed.unwrap_or(1)),
    },
    SourceKind {
        name: "board",
        noun: "the board",
        help: "a simulated chessboard that is moved before two cameras with distortion: for `svl \
               calibrate board`",
        options: &["seed"],
        is_path: false,
        recognizes: |name| name == "board",
        open: board,
    },
    // The syntax is that of the rows of DRIVERS.
    SourceKind {
        name: CAMERAS,
        noun: "cameras",
        help: "two cameras",
        options: &[
            "seed",
            "max_skew_ms",
            "trigger",
            "rate",
            "pairing",
            "queue",
            "when_full",
            "timeout",
        ],
        is_path: false,
        recognizes: |name| grab::driver(name).is_some(),
        open: cameras,
    },
    SourceKind {
        name: "ros2:[LEFT,RIGHT]",
        noun: "topics of ROS 2",
        help: "live topics of ROS 2, found by type and name, or the two that are named; options: \
               domain=N [default: ROS_DOMAIN_ID, else 0], interface=ADDRESS of the network to use \
               [default: all]",
        options: live_topics::OPTIONS,
        is_path: false,
        recognizes: |name| name.starts_with("ros2:"),
        open: live_topics::open,
    },
    SourceKind {
        name: "foxglove:ws://HOST:PORT[/LEFT,RIGHT]",
        noun: "topics of a Foxglove bridge",
        help: "the same through a running foxglove_bridge, where DDS does not reach",
        options: live_topics::OPTIONS,
        is_path: false,
        recognizes: |name| name.starts_with("foxglove:"),
        open: live_topics::open,
    },
    SourceKind {
        name: "SCENARIO.toml",
        noun: "a scenario",
        help: "the arena with other parameters",
        options: &["seed"],
        is_path: true,
        recognizes: |name| is_file(name, &["toml"]),
        open: |request| {
            let scenario = Scenario::read(Path::new(request.name))?;
            let first = match &scenario.source {
                ScenarioSource::Arena { seeds, .. } => seeds.first().copied(),
                _ => None,
            };
            open_arena(&scenario, request.seed.or(first).unwrap_or(1))
        },
    },
    SourceKind {
        name: RECORDING,
        noun: "a recording",
        help: "a recording: svl's, a ROS 2 bag (its folder or a file of it), a ROS 1 bag, the \
               RealSense SDK's, Foxglove's; raw, compressed or Bayer images of two topics",
        options: &["left", "right", "bits", "max_skew_ms", "truth"],
        is_path: true,
        // Bags in other containers are among them: their reader says which it reads.
        recognizes: |name| {
            let path = Path::new(name);
            // A scene may have a recording beside its images.
            is_file(
                name,
                &[
                    "mcap", "db3", "zstd", "zst", "bag", "svo", "svo2", "tar", "gz",
                ],
            ) || is_bag(path) && Scene::find(path, name).is_none()
        },
        open: recorded,
    },
    SourceKind {
        name: "FILE.mp4",
        noun: "a video",
        help: "a video of both images, with --side-by-side; two are named by their folder: svl \
               record . --left a.mp4 --right b.mp4; the program ffmpeg decodes them",
        options: &["side_by_side", "fps"],
        is_path: true,
        recognizes: |name| is_video(name) && !Path::new(name).is_dir(),
        open: video,
    },
    SourceKind {
        name: FOLDER,
        noun: "a folder",
        help: "a data-set scene (im0.png, im1.png, truth, calib.txt), a folder of such scenes, \
               KITTI's training/ (the pairs with truth), or many pairs: left/ and right/ with \
               images of equal names, EuRoC's and KITTI's sequences, 00_left.png and 00_right.png, \
               or the images that --left and --right name",
        options: &["left", "right", "side_by_side", "fps", "bits", "truth"],
        is_path: true,
        recognizes: |name| Path::new(name).is_dir(),
        open: folder,
    },
];

/// The row of [`SOURCES`] that represents all [`DRIVERS`].
pub const CAMERAS: &str = "cameras";

/// The row of [`SOURCES`] that recordings are opened by.
const RECORDING: &str = "FILE.mcap, BAG";
const FOLDER: &str = "FOLDER";

/// The sources that [`open`] accepts, in a line.
pub fn expected() -> String {
    let kinds = SOURCES.iter().filter(|kind| kind.name != CAMERAS);
    let kinds = joined(kinds.map(|kind| kind.name));
    let drivers: Vec<_> = DRIVERS.iter().map(Driver::source).collect();
    format!("{kinds}, or cameras: {}", drivers.join(" or "))
}

/// Opens the source that a user names; its pairs are rectified as requested.
///
/// # Errors
/// [`Error::Usage`] for a request that contradicts itself, or an option that the source does not
/// accept; [`Error::Invalid`] for an unknown name, with the known ones; those of the source.
pub fn open(request: &Request<'_>) -> Result<Opened> {
    let (name, path) = (request.name, Path::new(request.name));
    if name.starts_with("/dev/video") {
        let cure = "name the left and the right camera, as v4l2:/dev/video0,/dev/video2";
        return Err(Error::Usage(format!("{name}: is not a source; {cure}")));
    }
    // Recordings may lie in a folder of images or videos.
    let are_files = |side: &String| side.contains('*') || is_video(side);
    let topics = request.topics();
    let of_files = request.options.side_by_side || topics.iter().flatten().any(are_files);
    let is_bag = |kind: &SourceKind| kind.name == RECORDING && path.is_dir();
    let mut kinds = SOURCES.iter().filter(|kind| !(of_files && is_bag(kind)));
    let kind = kinds.find(|kind| (kind.recognizes)(name));
    let Some(kind) = kind.filter(|kind| !kind.is_path || path.exists()) else {
        let what = if path.exists() {
            "not a source"
        } else {
            "no such source"
        };
        let expected = expected();
        return Err(Error::Invalid(format!(
            "{name}: {what}; expected {expected}"
        )));
    };
    refuse_options(request, kind)?;
    (kind.open)(request)?.prepared(request)
}

/// Opens a recording, or live topics; the pairs are rectified as requested.
///
/// # Errors
/// As [`open`].
pub fn open_recording(request: &Request<'_>) -> Result<Opened> {
    let name = request.name;
    let exists = Path::new(name).exists();
    let kind = SOURCES.iter().find(|kind| (kind.recognizes)(name));
    if are_live_topics(name) {
        return open(request);
    }
    // A folder may have no images either; then its error as a bag is reported.
    let is_other = kind.is_some_and(|kind| match kind.name {
        RECORDING => false,
        FOLDER => folder(request).is_ok(),
        _ => exists == kind.is_path,
    });
    if is_other {
        let cure = format!("make one first, svl record {name} -o run.mcap");
        return Err(Error::Usage(format!("{name}: is not a recording; {cure}")));
    }
    if let Some(kind) = SOURCES.iter().find(|kind| kind.name == RECORDING) {
        refuse_options(request, kind)?;
    }
    recorded(request)?.prepared(request)
}

/// Opens a run of the arena in a scenario.
///
/// # Errors
/// [`Error::Invalid`] for a scenario that reads scenes.
pub fn open_arena(scenario: &Scenario, seed: u64) -> Result<Opened> {
    if let ScenarioSource::Drive { .. } = &scenario.source {
        return Err(Error::Invalid(format!(
            "scenario '{}' is driven by algorithms: `svl score` drives and records it",
            scenario.name
        )));
    }
    let ScenarioSource::Arena { config, .. } = &scenario.source else {
        return Err(Error::Invalid(format!(
            "scenario '{}' reads files; name one of them to record it",
            scenario.name
        )));
    };
    let source = ArenaSource::new(Arena::new(config, seed)?, seed);
    let header = Header {
        scenario: Some(scenario.name.clone()),
        seed: Some(seed),
        hash: Some(ArenaSource::hash(config, seed)),
        ..Header::new("arena")
    };
    Ok(Opened {
        scenario: Some(scenario.text.clone()),
        ..Opened::new(source, header, format!("{}-seed{seed}", scenario.name))
    })
}

fn board(request: &Request<'_>) -> Result<Opened> {
    let seed = request.seed.unwrap_or(1);
    let header = Header {
        seed: Some(seed),
        ..Header::new("board")
    };
    let stem = format!("board-seed{seed}");
    Ok(Opened::new(BoardSource::new(seed)?, header, stem))
}

fn cameras(request: &Request<'_>) -> Result<Opened> {
    let name = request.name;
    let grab = GrabRequest {
        seed: request.seed,
        max_skew_ns: request.max_skew_ns(),
        ..request.grab.clone()
    };
    let source = LiveSource::open(name, &grab, request.host)?;
    let header = Header {
        seed: source.seed(),
        ..Header::new(name)
    };
    let driver = name.split(':').next().unwrap_or(name);
    Ok(Opened {
        is_live: true,
        ..Opened::new(source, header, driver)
    })
}

fn recorded(request: &Request<'_>) -> Result<Opened> {
    let path = Path::new(request.name);
    let source = RecordingSource::new(Recording::open(path)?, &request.selection())?;
    let reader = source.reader();
    let truth = request.truth();
    let truth = truth.map(|truth| reader.truth(&truth)).transpose()?;
    let truth = truth.map(|truth| SensorTruth::Topic(Box::new(truth)));
    let calibration = match reader.recording().calibration_files() {
        // Damage is reported with the pairs.
        Err(Error::Damaged { .. }) => CalibrationFiles::new(),
        files => files?,
    };
    let header = reader.header().cloned();
    let header = header.unwrap_or_else(|| Header {
        bits: reader.bits(),
        frame_id: reader.frame_id().map(str::to_owned),
        ..Header::new(path.display().to_string())
    });
    let note = reader
        .note()
        .map(|note| format!("{}: {note}", request.name));
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    Ok(Opened {
        scenario: source.scenario()?,
        recording: Some(reader.recording().clone()),
        calibration,
        own_calibration: reader.calibration(),
        truth,
        remarks: reader.remarks(),
        notes: note.into_iter().collect(),
        ..Opened::new(source, header, stem.unwrap_or("recording"))
    })
}

fn video(request: &Request<'_>) -> Result<Opened> {
    let path = Path::new(request.name);
    if !request.options.side_by_side {
        return Err(Error::Usage(format!(
            "{}: is one video: --side-by-side if it shows both images, or name the folder of two, \
             with --left and --right",
            request.name
        )));
    }
    let source = VideoSource::side_by_side(path, request.options.fps)?;
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    Ok(of_video(source, request, stem.unwrap_or("video")))
}

fn of_video(source: VideoSource, request: &Request<'_>, stem: &str) -> Opened {
    let header = Header {
        stamps: source.stamps(),
        ..Header::new(request.name)
    };
    Opened::new(source, header, stem)
}

fn folder(request: &Request<'_>) -> Result<Opened> {
    let path = Path::new(request.name);
    // The folder's own name, also of `.` and `..`.
    let real = path.canonicalize().map_err(|e| Error::io(path, e))?;
    let stem = real.file_name().and_then(|name| name.to_str());
    let stem = stem.unwrap_or("pairs");
    let header = Header {
        scenario: Some(stem.to_owned()),
        ..Header::new(path.display().to_string())
    };
    let folder = request.of_folder();
    if let [Some(left), Some(right)] = &folder.images
        && is_video(left)
        && is_video(right)
    {
        if folder.bits.is_some() || folder.side_by_side {
            let why = "is not for two videos, which are decoded to 8 bits, one for each camera";
            return Err(Error::Usage(format!("--bits or --side-by-side {why}")));
        }
        let source = VideoSource::pair(&path.join(left), &path.join(right), folder.fps)?;
        return Ok(of_video(source, request, stem));
    }
    // A user that names the images does not mean a scene of a data set.
    let scenes = if folder.images == [None, None] && !folder.side_by_side {
        match Scene::find(path, stem) {
            Some(scene) => vec![scene],
            None => Scene::all_in(path, "")?,
        }
    } else {
        Vec::new()
    };
    if !scenes.is_empty() {
        let given = [
            ("--fps", folder.fps.is_some()),
            ("--truth", request.options.truth.is_some()),
        ];
        if let Some((option, _)) = given.iter().find(|(_, is_given)| *is_given) {
            let cure = format!("{option} is for sequences of pairs; leave it out");
            return Err(Error::Usage(format!(
                "{}: contains scenes of a data set; {cure}",
                request.name
            )));
        }
        let source = SceneSource::with_bits(scenes, folder.bits)?;
        let header = Header {
            stamps: Some(SceneSource::STAMPS),
            bits: source.bits(),
            ..header
        };
        return Ok(Opened {
            notes: source.note().into_iter().collect(),
            ..Opened::new(source, header, stem)
        });
    }
    let source = FolderSource::new(path, &folder)?;
    let truth = request.truth().map(|truth| source.truth(&truth));
    let truth = truth.transpose()?;
    let header = Header {
        stamps: source.stamps(),
        bits: source.bits(),
        ..header
    };
    let of_truth = truth.as_ref().and_then(FolderTruth::note);
    let (own_calibration, unread) = match source.calibration() {
        Ok(own) => (own.clone(), None),
        Err(reason) => (None, Some(reason)),
    };
    let lacks = |reason| format!("raw images, which cannot be rectified: {reason}");
    let note = source
        .note()
        .map(|note| format!("{}: {note}", request.name));
    Ok(Opened {
        own_calibration,
        remarks: unread.map(lacks).into_iter().collect(),
        notes: note.into_iter().chain(of_truth).collect(),
        truth: truth.map(SensorTruth::Files),
        ..Opened::new(source, header, stem)
    })
}

fn is_file(name: &str, extensions: &[&str]) -> bool {
    let path = Path::new(name);
    let extension = path.extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|extension| extensions.contains(&extension)) && !path.is_dir()
}

/// Refuses options that the source does not accept: they would have no effect.
fn refuse_options(request: &Request<'_>, kind: &SourceKind) -> Result<()> {
    let GrabRequest {
        trigger,
        rate_hz,
        pairing,
        queue,
        when_full,
        timeout,
        ..
    } = &request.grab;
    let of_cameras = [
        ("seed", request.seed.is_some()),
        ("trigger", trigger.is_some()),
        ("rate", rate_hz.is_some()),
        ("pairing", pairing.is_some()),
        ("queue", queue.is_some()),
        ("when_full", when_full.is_some()),
        ("timeout", timeout.is_some()),
    ];
    let given = of_cameras.iter().filter(|(_, given)| *given);
    let mut given: Vec<_> = given.map(|(key, _)| (*key).to_owned()).collect();
    given.extend(request.options.keys()?);
    let nouns = |key: &str| -> Vec<_> {
        let takers = SOURCES.iter().filter(|kind| kind.options.contains(&key));
        takers.map(|kind| kind.noun).collect()
    };
    let is_wrong = |key: &&String| !kind.options.contains(&key.as_str()) && !nouns(key).is_empty();
    let Some(key) = given.iter().find(is_wrong) else {
        return request.options.check();
    };
    Err(Error::Usage(format!(
        "{} is for {}, and '{}' is {}",
        flag(key),
        joined(nouns(key)),
        request.name,
        kind.noun
    )))
}
