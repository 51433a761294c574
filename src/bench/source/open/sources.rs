//! [`open`]: from a user's name to a source of frames, by the table [`SOURCES`].

use crate::source::inputs::arena::ArenaSource;
use crate::source::inputs::board::BoardSource;
use crate::source::inputs::cameras::CameraSource;
use crate::source::inputs::dataset::scene::{Scene, SceneSource};
use crate::source::inputs::folder::map_files::MapFiles;
use crate::source::inputs::folder::source::FolderSource;
use crate::source::inputs::image_pair::ImagePair;
use crate::source::inputs::recording::RecordingSource;
use crate::source::inputs::video::source::{VideoSource, is_video};
use crate::source::layers::measured::{MeasuredMaps, SourceMaps, refuse_topics, topics_of};
use crate::source::live::live_topics;
use crate::source::live::live_topics::LiveTopics;
use crate::source::opened::calibration::{Calib, CalibrationFiles};
use crate::source::opened::open_source::Opened;
use crate::source::opened::request::Request;
use std::io;
use std::path::Path;
use svl_core::stereo::StereoCalibration;
use svl_core::{Error, Result, joined};
use svl_grab::{self as grab, DRIVERS, Driver, GrabRequest};
use svl_recording::{
    CameraFacts, Header, Recording, StampOrigin, StreamFacts, TRUTH_DEPTH, is_bag, is_recording,
};
use svl_score::scenario::{Scenario, ScenarioSource, flag};
use svl_sim::arena::Arena;

/// A kind of source that a user can name.
pub struct SourceKind {
    /// Syntax of the source on the command line.
    pub name: &'static str,
    /// Name in a sentence.
    pub noun: &'static str,
    /// Description for help texts.
    pub help: &'static str,
    pub origin: SourceOrigin,
    /// Keys of the options that it accepts, besides those that all accept.
    options: &'static [&'static str],
    recognizes: fn(&str) -> bool,
    open: fn(&Request<'_>) -> Result<Opened>,
}

/// Origin of the frames of a source.
pub enum SourceOrigin {
    /// Rendered by svl; scored if a scenario describes it.
    Simulated {
        scenario: Option<fn() -> Result<Scenario>>,
    },
    /// Cameras of this machine, by one of [`DRIVERS`]: they are recorded first.
    Cameras,
    /// Topics that another program publishes: opened like a recording, but they have no end.
    Topics(LiveTopics),
    Recording,
    Folder,
    /// Another file.
    File,
}

impl SourceKind {
    /// The source without files of that name; the file system is not read.
    pub fn without_files(name: &str) -> Option<&'static Self> {
        let mut kinds = SOURCES.iter().filter(|kind| !kind.is_path());
        kinds.find(|kind| (kind.recognizes)(name))
    }

    /// True if the frames of that name are rendered, or in a file that is no recording.
    pub fn is_unrecorded(name: &str) -> bool {
        let kind = SOURCES.iter().find(|kind| (kind.recognizes)(name));
        kind.is_some_and(|kind| kind.is_simulated() || matches!(kind.origin, SourceOrigin::File))
    }

    /// True if `name` names cameras.
    pub fn are_cameras(name: &str) -> bool {
        Self::without_files(name).is_some_and(Self::is_cameras)
    }

    /// The live topics that `name` names, over DDS or through a bridge.
    pub fn topics(name: &str) -> Option<&'static LiveTopics> {
        match &Self::without_files(name)?.origin {
            SourceOrigin::Topics(topics) => Some(topics),
            _ => None,
        }
    }

    /// True if `name` names live topics.
    pub fn are_topics(name: &str) -> bool {
        Self::topics(name).is_some()
    }

    /// The cure of a build that lacks it; none of one that has it.
    pub fn cure(&self) -> Option<&'static str> {
        match self.origin {
            SourceOrigin::Topics(_) => live_topics::CURE,
            _ => None,
        }
    }

    /// True if its frames are captured while they are read: it has neither an end nor a past.
    pub fn is_live(&self) -> bool {
        matches!(self.origin, SourceOrigin::Cameras | SourceOrigin::Topics(_))
    }

    /// True for the row that represents all [`DRIVERS`].
    pub fn is_cameras(&self) -> bool {
        matches!(self.origin, SourceOrigin::Cameras)
    }

    /// True if it needs neither file nor camera.
    pub fn is_simulated(&self) -> bool {
        matches!(self.origin, SourceOrigin::Simulated { .. })
    }

    /// True if a scenario can have its frames.
    pub fn is_scored(&self) -> bool {
        match self.origin {
            SourceOrigin::Simulated { scenario } => scenario.is_some(),
            _ => !self.is_live(),
        }
    }

    /// True if it is named by a path, which must exist.
    fn is_path(&self) -> bool {
        !self.is_simulated() && !self.is_live()
    }

    fn is_recording(&self) -> bool {
        matches!(self.origin, SourceOrigin::Recording)
    }
}

/// All sources, in the order in which a name is looked for. A new one is one entry here.
pub const SOURCES: &[SourceKind] = &[
    SourceKind {
        name: "arena",
        noun: "the arena",
        help: "the simulated arena, the thesis's test",
        origin: SourceOrigin::Simulated {
            scenario: Some(Scenario::arena),
        },
        options: &["seed"],
        recognizes: |name| name == "arena",
        open: |request| open_arena(&Scenario::arena()?, request.seed.unwrap_or(1)),
    },
    SourceKind {
        name: "board",
        noun: "the board",
        help: "a simulated chessboard that is moved before two cameras with distortion: for `svl \
               calibrate board`",
        origin: SourceOrigin::Simulated { scenario: None },
        options: &["seed"],
        recognizes: |name| name == "board",
        open: board,
    },
    // The syntax is that of the rows of DRIVERS.
    SourceKind {
        name: "cameras",
        noun: "cameras",
        help: "two cameras",
        origin: SourceOrigin::Cameras,
        options: &[
            "seed",
            "side_by_side",
            "max_skew_ms",
            "trigger",
            "rate",
            "pairing",
            "queue",
            "when_full",
            "timeout",
            "camera_height_m",
        ],
        recognizes: |name| grab::driver(name).is_some(),
        open: cameras,
    },
    SourceKind {
        name: "ros2:[LEFT,RIGHT]",
        noun: "topics of ROS 2",
        help: "live topics of ROS 2, found by type and name, or the two that are named; options: \
               domain=N [default: ROS_DOMAIN_ID, else 0], interface=ADDRESS of the network to use \
               [default: all]",
        origin: SourceOrigin::Topics(LiveTopics {
            prefix: "ros2:",
            listen: live_topics::listen,
        }),
        options: live_topics::OPTIONS,
        recognizes: |name| name.starts_with("ros2:"),
        open: live_topics::open,
    },
    SourceKind {
        name: "SCENARIO.toml",
        noun: "a scenario",
        help: "the arena with other parameters",
        origin: SourceOrigin::File,
        options: &["seed"],
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
        name: "FILE.mcap, BAG",
        noun: "a recording",
        help: "a recording: svl's, a ROS 2 bag (its folder or a file of it), a ROS 1 bag, the \
               RealSense SDK's, Foxglove's; raw, compressed or Bayer images of two topics",
        origin: SourceOrigin::Recording,
        options: &[
            "left",
            "right",
            "left_info",
            "right_info",
            "side_by_side",
            "bits",
            "max_skew_ms",
            "stamps",
            "right_offset_ms",
            "truth",
            "camera_height_m",
        ],
        // Bags in other containers are among them: their reader says which it reads.
        recognizes: |name| {
            let path = Path::new(name);
            // A scene may have a recording beside its images.
            is_file(
                name,
                &[
                    "mcap", "db3", "zstd", "zst", "bag", "active", "svo", "svo2", "tar", "gz",
                ],
            ) || is_recording(path)
                || is_bag(path) && Scene::find(path, name).is_none()
        },
        open: recorded,
    },
    SourceKind {
        name: "FILE.mp4",
        noun: "a video",
        help: "a video of both images, with --side-by-side; two are named by their folder: svl \
               record . --left a.mp4 --right b.mp4; the program ffmpeg decodes them",
        origin: SourceOrigin::File,
        options: &["side_by_side", "fps", "camera_height_m"],
        recognizes: |name| is_video(name) && !Path::new(name).is_dir(),
        open: video,
    },
    SourceKind {
        name: "FOLDER",
        noun: "a folder",
        help: "a data-set scene (im0.png, im1.png, truth, calib.txt), a folder of such scenes, \
               KITTI's training/ (the pairs with truth), or many pairs: left/ and right/ with \
               images of equal names, EuRoC's and KITTI's sequences, 00_left.png and 00_right.png, \
               or the images that --left and --right name",
        origin: SourceOrigin::Folder,
        options: &[
            "left",
            "right",
            "side_by_side",
            "fps",
            "bits",
            "right_offset_ms",
            "truth",
            "camera_height_m",
        ],
        recognizes: |name| Path::new(name).is_dir(),
        open: folder,
    },
];

/// The sources that [`open`] accepts, in a line.
pub fn expected() -> String {
    let kinds = SOURCES.iter().filter(|kind| !kind.is_cameras());
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
    let is_topic = topics[0]
        .as_deref()
        .is_some_and(|left| left.starts_with('/'));
    let names_files = request.options.side_by_side.is_some() && !is_topic
        || topics.iter().flatten().any(are_files);
    let is_bag = |kind: &SourceKind| kind.is_recording() && path.is_dir();
    let mut kinds = SOURCES.iter().filter(|kind| !(names_files && is_bag(kind)));
    let kind = kinds.find(|kind| (kind.recognizes)(name));
    let Some(kind) = kind.filter(|kind| !kind.is_path() || path.exists()) else {
        let expected = expected();
        return Err(if path.exists() {
            Error::Invalid(format!("{name}: not a source; expected {expected}"))
        } else {
            let words = format!("{name}: no such source; expected {expected}");
            Error::other(io::Error::new(io::ErrorKind::NotFound, words))
        });
    };
    refuse_options(request, kind)?;
    if !kind.is_recording() {
        refuse_topics(&request.maps, name)?;
    }
    (kind.open)(request)?.prepared(request)
}

/// Opens two image files as the request's source, of one pair; it is rectified as requested.
///
/// # Errors
/// The errors of the images and of the calibration.
pub fn open_pair(files: [&Path; 2], request: &Request<'_>) -> Result<Opened> {
    let source = ImagePair::read(files, request.options.bits)?;
    let facts = StreamFacts::from_images(&source.depth, None, (0, 0));
    let opened = Opened::new(source, Header::new("pair"), "pair");
    opened.with_facts(facts).prepared(request)
}

/// Opens a recording, or live topics; the pairs are rectified as requested.
///
/// # Errors
/// The errors of [`open`].
pub fn open_recording(request: &Request<'_>) -> Result<Opened> {
    refuse_others(request)?;
    if SourceKind::are_topics(request.name) {
        return open(request);
    }
    if let Some(kind) = SOURCES.iter().find(|kind| kind.is_recording()) {
        refuse_options(request, kind)?;
    }
    recorded(request)?.prepared(request)
}

/// Refuses a source that is neither a recording nor live topics, nor missing.
fn refuse_others(request: &Request<'_>) -> Result<()> {
    let name = request.name;
    let kind = SOURCES.iter().find(|kind| (kind.recognizes)(name));
    let is_other = kind.is_some_and(|kind| match kind.origin {
        SourceOrigin::Recording | SourceOrigin::Topics(_) => false,
        // A folder may have no images either; then its error as a bag is reported.
        SourceOrigin::Folder => folder(request).is_ok(),
        _ => Path::new(name).exists() == kind.is_path(),
    });
    if !is_other {
        return Ok(());
    }
    let cure = match Scenario::read(Path::new(name)).map(|scenario| scenario.source) {
        Ok(ScenarioSource::Drive { .. }) => format!("svl score {name} drives and records it"),
        Ok(ScenarioSource::Recording(_)) => {
            format!("name one of its files, or score all: svl score {name}")
        }
        Ok(ScenarioSource::Dataset { .. }) => format!("its scenes are scored: svl score {name}"),
        Ok(ScenarioSource::Arena { .. }) | Err(_) => {
            format!("make one first, svl record {name} -o run.mcap")
        }
    };
    Err(Error::Usage(format!("{name}: is not a recording; {cure}")))
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
    let arena = Arena::new(config, seed)?;
    let header = Header {
        camera_height_m: arena.above_floor_m(),
        scenario: Some(scenario.name.clone()),
        seed: Some(seed),
        hash: Some(ArenaSource::hash(config, seed)),
        ..Header::new("arena")
    };
    Ok(Opened {
        scenario: Some(scenario.text.clone()),
        ..Opened::new(
            ArenaSource::new(arena, seed),
            header,
            format!("{}-seed{seed}", scenario.name),
        )
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
        side_by_side: request.options.side_by_side,
        ..request.grab.clone()
    };
    let source = CameraSource::open(name, &grab, request.host)?;
    let header = Header {
        seed: source.seed,
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
    let reader = &source.reader;
    let (facts, truth) = (reader.facts(), request.truth());
    // A recording of svl's has its own truth, unless another is named.
    let own = reader.header().map(|_| TRUTH_DEPTH);
    let truth_topic = truth.as_ref().map(|truth| truth.topic.as_str()).or(own);
    let maps = topics_of(&request.maps, reader, truth_topic)?;
    let truth = truth
        .as_ref()
        .map(|truth| reader.sensor(truth))
        .transpose()?;
    let measured = SourceMaps {
        truth: truth.map(|truth| MeasuredMaps::Topic(Box::new(truth))),
        maps,
    };
    let calibration = match reader.recording().calibration_files() {
        // Damage is reported with the pairs.
        Err(Error::Damaged { .. }) => CalibrationFiles::new(),
        files => files?,
    };
    let header = reader.header().cloned();
    let header = header.unwrap_or_else(|| Header::new(path.display().to_string()));
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    Ok(Opened {
        scenario: source.scenario()?,
        recording: Some(reader.recording().clone()),
        calibration,
        measured,
        ..Opened::new(source, header, stem.unwrap_or("recording"))
    }
    .with_facts(facts))
}

fn video(request: &Request<'_>) -> Result<Opened> {
    let path = Path::new(request.name);
    let Some(places) = request.options.side_by_side else {
        return Err(Error::Usage(format!(
            "{}: is one video: --side-by-side if it shows both images, or name the folder of two, \
             with --left and --right",
            request.name
        )));
    };
    let source = VideoSource::side_by_side(path, places, request.options.fps)?;
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    Ok(opened_video(source, request, stem.unwrap_or("video")))
}

fn opened_video(source: VideoSource, request: &Request<'_>, stem: &str) -> Opened {
    let header = Header {
        stamps: source.stamps(),
        ..Header::new(request.name)
    };
    let facts = source.facts(request.options.side_by_side);
    Opened::new(source, header, stem).with_facts(facts)
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
    let folder = request.folder_request();
    if let [Some(left), Some(right)] = &folder.images
        && is_video(left)
        && is_video(right)
    {
        if folder.bits.is_some() || folder.side_by_side.is_some() {
            let why = "is not for two videos, which are decoded to 8 bits, one for each camera";
            return Err(Error::Usage(format!("--bits or --side-by-side {why}")));
        }
        let offset_ns = request.selection().right_offset_ns;
        let (left, right) = (path.join(left), path.join(right));
        let source = VideoSource::pair(&left, &right, folder.fps, offset_ns)?;
        return Ok(opened_video(source, request, stem));
    }
    if request.options.right_offset_ms.is_some() {
        let what = "--right-offset-ms is for recordings and two videos, not for images";
        return Err(Error::Usage(format!("{}: {what}", request.name)));
    }
    // A user that names the images does not mean a scene of a data set.
    let scenes = if folder.images == [None, None] && folder.side_by_side.is_none() {
        match Scene::find(path, stem) {
            Some(scene) => vec![scene],
            None => Scene::all_in(path, "")?,
        }
    } else {
        Vec::new()
    };
    if !scenes.is_empty() {
        return opened_scenes(scenes, request, header, stem);
    }
    let source = FolderSource::new(path, &folder)?;
    let truth = request.truth().map(|truth| source.truth(&truth));
    let truth = truth.transpose()?;
    let header = Header {
        stamps: source.stamps,
        ..header
    };
    let truth_note = truth.as_ref().and_then(MapFiles::note);
    let is_open = request.calib() == Calib::Own;
    let lacking = source.lacks_cameras().filter(|_| is_open);
    let (calibration, unread) = match &source.calibration {
        Ok(own) => (own.clone(), None),
        Err(reason) => (None, Some(reason)),
    };
    let lacks = |reason| format!("raw images, which cannot be rectified: {reason}");
    let checks = calibration.as_ref().map(StereoCalibration::checks);
    let facts = StreamFacts {
        calibration,
        remarks: unread.map(lacks).into_iter().collect(),
        camera: CameraFacts {
            calibration_fault: unread.cloned(),
            checks: checks.unwrap_or_default(),
            ..CameraFacts::default()
        },
        ..StreamFacts::from_images(&source.depth, folder.side_by_side, source.size)
    };
    Ok(Opened {
        notes: truth_note.into_iter().chain(lacking).collect(),
        measured: SourceMaps {
            truth: truth.map(|files| MeasuredMaps::Files(Box::new(files))),
            ..SourceMaps::default()
        },
        ..Opened::new(source, header, stem)
    }
    .with_facts(facts))
}

fn opened_scenes(
    scenes: Vec<Scene>,
    request: &Request<'_>,
    header: Header,
    stem: &str,
) -> Result<Opened> {
    let folder = request.folder_request();
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
    let facts = StreamFacts::from_images(&source.depth, None, (0, 0));
    let header = Header {
        stamps: Some(StampOrigin::UNKNOWN),
        ..header
    };
    Ok(Opened::new(source, header, stem).with_facts(facts))
}

fn is_file(name: &str, extensions: &[&str]) -> bool {
    let path = Path::new(name);
    let extension = path.extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|extension| extensions.contains(&extension)) && !path.is_dir()
}

/// Refuses options that the source does not accept: they would have no effect.
fn refuse_options(request: &Request<'_>, kind: &SourceKind) -> Result<()> {
    let grab = &request.grab;
    let camera_options = [
        ("seed", request.seed.is_some()),
        ("trigger", grab.trigger.is_some()),
        ("rate", grab.rate_hz.is_some()),
        ("pairing", grab.pairing.is_some()),
        ("queue", grab.queue.is_some()),
        ("when_full", grab.when_full.is_some()),
        ("timeout", grab.timeout.is_some()),
    ];
    let given = camera_options.iter().filter(|(_, given)| *given);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_random_world_tells_the_height_of_its_own_cameras() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        let scenario = Scenario::read(&folder.join("worlds.toml")).unwrap();
        for seed in [1001, 1002, 1003] {
            let mut opened = open_arena(&scenario, seed).unwrap();
            let told_m = opened.header.camera_height_m.unwrap();
            let frame = opened.source.next().unwrap().unwrap();
            let camera_m = frame.pose.unwrap().translation.z;
            assert!((told_m - camera_m).abs() < 0.01, "{told_m} {camera_m}");
        }
    }

    /// The sources without files, each with a name.
    fn without_files() -> impl Iterator<Item = (&'static SourceKind, &'static str)> {
        SOURCES.iter().filter_map(|kind| match &kind.origin {
            SourceOrigin::Simulated { .. } => Some((kind, kind.name)),
            SourceOrigin::Cameras => Some((kind, DRIVERS[0].name)),
            SourceOrigin::Topics(topics) => Some((kind, topics.prefix)),
            SourceOrigin::Recording | SourceOrigin::Folder | SourceOrigin::File => None,
        })
    }

    #[test]
    fn sources_without_files_are_found_by_their_names() {
        for (kind, name) in without_files() {
            let found = SourceKind::without_files(name).unwrap();
            assert_eq!(found.name, kind.name);
            assert_eq!(SourceKind::are_cameras(name), kind.is_cameras());
        }
        for name in [".", "run.mcap", "arena.toml", "ros2", "a/ros2:"] {
            assert!(SourceKind::without_files(name).is_none(), "{name}");
        }
    }

    #[test]
    fn live_sources_have_no_scenario() {
        for (kind, name) in without_files().filter(|(kind, _)| kind.is_live()) {
            assert!(!kind.is_scored() && !kind.is_simulated(), "{name}");
        }
    }

    #[test]
    fn simulated_sources_are_scored_if_they_have_a_scenario() {
        for (kind, name) in without_files() {
            if let SourceOrigin::Simulated { scenario } = kind.origin {
                assert_eq!(kind.is_scored(), scenario.is_some(), "{name}");
                assert!(!kind.is_live(), "{name}");
            }
        }
    }

    #[test]
    fn topics_replace_a_recording_and_other_sources_without_files_do_not() {
        for (_, name) in without_files() {
            let refused = refuse_others(&Request::new(name));
            assert_eq!(refused.is_ok(), SourceKind::are_topics(name), "{name}");
        }
    }

    #[test]
    fn opened_cameras_are_live() {
        let (_, name) = without_files().find(|(kind, _)| kind.is_cameras()).unwrap();
        assert!(open(&Request::new(name)).unwrap().is_live);
    }
}
