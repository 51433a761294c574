//! One drive: a course with an algorithm at the wheel, through the loop of [`crate::pass`].

use super::course::Course;
use super::source::DriveSource;
use crate::pass::{Matchers, Monitor, Pace, run};
use crate::sink::{
    Outbox, PassStart, RecordingSink, RowIdentity, Sink, Wanted, finish, frame_shot,
};
use crate::source::{ArenaSource, Chain, Perturbation};
use parking_lot::Mutex;
use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;
use svl_core::Result;
use svl_core::matcher::Algorithm;
use svl_recording::{Header, SCENARIO, Writer};
use svl_report::html::{CheckpointFigure, Rank};
use svl_report::{CellRow, CoursePlan, DriveRow, FailureRow, Row, TrackRow};
use svl_score::drive::{DriveEvent, DriveLog};
use svl_score::judge::{FrameOrigin, Judge, Judged};
use svl_score::manifest::{Manifest, hash};
use svl_score::scenario::Scenario;
use svl_sim::stress::Stress;

/// The plan of a drive.
pub struct DrivePlan<'a> {
    pub scenario: &'a Scenario,
    pub manifest: &'a Manifest,
    pub course: &'a Arc<Course>,
    pub algorithm: &'a Algorithm,
    /// The algorithm's latency, milliseconds; without it a command takes effect at the next pair.
    pub latency_ms: Option<f64>,
    /// The perturbation of its pairs, if any.
    pub stress: Option<Stress>,
    /// Recording of the drive, if it is recorded; the file is new.
    pub recording: Option<&'a Path>,
}

/// The result of a drive.
#[derive(Default)]
pub struct DriveResult {
    pub drives: Vec<DriveRow>,
    pub track: Vec<TrackRow>,
    pub rows: Vec<Row>,
    pub cells: Vec<CellRow>,
    /// The last two seconds before the collision at the highest speed, with that speed, m/s.
    pub worst: Option<(f64, CheckpointFigure)>,
    /// True if the monitor ended the drive, so that it is not counted.
    pub interrupted: bool,
    /// The pairs that the algorithm failed on.
    pub failures: Vec<FailureRow>,
}

/// Time before a collision that is shown, and the frames of it.
const SHOWN_S: f64 = 2.0;
const SHOTS: usize = 5;

impl DrivePlan<'_> {
    /// Drives.
    ///
    /// # Errors
    /// The errors of the algorithm's build, of rendering, and of the recording.
    pub fn drive(&self, monitor: &mut dyn Monitor) -> Result<DriveResult> {
        let latency_s = self.latency_ms.map(|ms| 1.0e-3 * ms);
        let source = DriveSource::new(
            self.course,
            latency_s.unwrap_or_else(|| self.course.frame_s()),
        );
        let log = source.log();
        let seed = self.course.seed;
        let chain = Chain {
            perturb: self.stress.map(|stress| Perturbation { stress, seed }),
            ..Chain::default()
        };
        let mut source = chain.over(Box::new(source))?;
        let mut matchers = Matchers::new(std::slice::from_ref(self.algorithm))?;
        let judge = Judge {
            checkpoints: Vec::new(),
            run: FrameOrigin {
                stress: self.stress_text(),
                ..FrameOrigin::default()
            },
            ..self.scenario.judge()
        };
        let taken = FreeAlgorithm(Arc::clone(&log));
        let start = PassStart {
            wanted: Some(&taken),
            ..PassStart::new(self.manifest, Some(self.course.seed), &judge)
        };
        let mut sinks: Vec<Box<dyn Sink>> = Vec::new();
        if let Some(writer) = self.writer()? {
            sinks.push(Box::new(RecordingSink::new(writer, None)));
        }
        let kept = Outbox::default();
        sinks.push(Box::new(DriveSink {
            identity: RowIdentity::default(),
            log: Arc::clone(&log),
            last: VecDeque::new(),
            kept: DriveResult::default(),
            outbox: kept.clone(),
        }));
        let (outcome, ran) = run(
            &mut *source,
            &mut matchers,
            &start,
            Pace::Asap,
            &mut sinks,
            monitor,
        );
        ran.and(finish(sinks))?;
        let log = log.lock().clone();
        let mut result = kept.take();
        result.interrupted = outcome.interrupted;
        result.track = self.track(&log);
        result.drives = vec![self.row(&log, outcome.failures.values().sum(), &result.track)];
        Ok(result)
    }

    fn stress_text(&self) -> Option<String> {
        self.stress.map(|stress| stress.to_string())
    }

    fn writer(&self) -> Result<Option<Writer>> {
        let Some(path) = self.recording else {
            return Ok(None);
        };
        let seed = self.course.seed;
        let header = Header {
            scenario: Some(self.scenario.name.clone()),
            seed: Some(seed),
            // Perturbed pairs are not the arena's.
            hash: (self.stress.is_none())
                .then(|| ArenaSource::hash(self.course.world.config(), seed)),
            camera_height_m: Some(self.course.world.config().rig.above_floor_m),
            ..Header::new("drive")
        };
        let mut writer = Writer::create(path, &header, svl_recording::ImageFormat::Raw)?;
        writer.identify(self.manifest)?;
        let text = self.scenario.text.as_bytes();
        writer.attach(SCENARIO, "application/toml", text)?;
        Ok(Some(writer))
    }

    fn track(&self, log: &DriveLog) -> Vec<TrackRow> {
        let row = |point: &svl_score::drive::TrackPoint| {
            let (event, with) = match &point.event {
                None => (None, None),
                Some(DriveEvent::Collision { with, .. }) => (Some("collision"), Some(with)),
                Some(DriveEvent::NearMiss { to, .. }) => (Some("near_miss"), Some(to)),
                Some(DriveEvent::Stuck { .. }) => (Some("stuck"), None),
            };
            TrackRow {
                scenario: self.manifest.scenario.clone(),
                seed: self.course.seed,
                algorithm: self.algorithm.label().to_owned(),
                sequence: point.sequence,
                x_m: point.at_m[0],
                y_m: point.at_m[1],
                heading: point.heading,
                speed_m_per_s: point.speed_m_per_s,
                clearance_m: point.clearance_m,
                placed: point.is_placed,
                skipped: point.is_skipped,
                event: event.map(str::to_owned),
                with: with.cloned(),
                stress: self.stress_text(),
            }
        };
        log.track.iter().map(row).collect()
    }

    fn row(&self, log: &DriveLog, failures: u64, track: &[TrackRow]) -> DriveRow {
        let [collisions, near_misses, stuck] = log.counts();
        let place = |row: &TrackRow| format!("{:?} {:?} {:?}", row.x_m, row.y_m, row.heading);
        let places: Vec<_> = track.iter().map(place).collect();
        let name = |path: &Path| Some(path.file_name()?.to_str()?.to_owned());
        DriveRow {
            scenario: self.manifest.scenario.clone(),
            seed: self.course.seed,
            algorithm: self.algorithm.label().to_owned(),
            finished: log.finished(),
            arrived: log.arrived,
            collisions,
            near_misses,
            stuck,
            driven_m: log.driven_m(),
            route_m: log.route_m,
            course_m: self.course.length_m(),
            first_collision_m: log.first_collision_m(),
            duration_s: log.duration_s(),
            stood_s: log.stood_s(),
            frames: log.track.len() as u64,
            failures,
            skipped: log.skipped(),
            latency_ms: self.latency_ms,
            track_hash: hash(&places.join("\n")),
            recording: self.recording.and_then(name),
            stress: self.stress_text(),
        }
    }
}

impl Course {
    /// The drive's track, for the map.
    pub fn plan(&self) -> CoursePlan {
        let world = &self.world.config().world;
        CoursePlan {
            seed: self.seed,
            width_m: world.width_m,
            length_m: world.length_m,
            goal_m: self.goal_m(),
            field_of_view_deg: self.world.config().rig.field_of_view_deg,
            outlines: (self.outlines().iter())
                .map(|outline| outline.iter().map(|at| rounded(*at)).collect())
                .collect(),
            route: self.route().map(rounded).collect(),
            rejected: self.rejected,
        }
    }
}

/// Rounds to a tenth of a millimetre: invisible on a map, and short in a file.
fn rounded(at: [f64; 2]) -> [f64; 2] {
    at.map(|v| (1.0e4 * v).round() / 1.0e4)
}

/// The pairs that the algorithm is not too busy for.
struct FreeAlgorithm(Arc<Mutex<DriveLog>>);

impl Wanted for FreeAlgorithm {
    fn wants(&self, _: u64, _: &str) -> bool {
        // The pair at hand is the last one of the track.
        self.0
            .lock()
            .track
            .last()
            .is_none_or(|point| !point.is_skipped)
    }
}

/// Keeps the rows of a drive, and the frames before its worst collision.
struct DriveSink {
    identity: RowIdentity,
    log: Arc<Mutex<DriveLog>>,
    /// The last frames, as long as they may be shown.
    last: VecDeque<Judged>,
    kept: DriveResult,
    outbox: Outbox<DriveResult>,
}

impl Sink for DriveSink {
    fn begin_pass(&mut self, start: &PassStart<'_>) -> Result<()> {
        self.identity = RowIdentity::new(start);
        Ok(())
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        self.kept.failures.extend(self.identity.failures(judged));
        for scored in &judged.estimates {
            self.kept.cells.extend(self.identity.cells(judged, scored));
            self.kept.rows.push(self.identity.row(judged, scored));
        }
        let (limit, hit) = {
            let log = self.log.lock();
            let limit = (SHOWN_S * log.rate_hz) as usize + 1;
            let hit = log.track.last().and_then(|point| match &point.event {
                Some(DriveEvent::Collision { with, .. }) => {
                    Some((point.speed_m_per_s, with.clone()))
                }
                _ => None,
            });
            (limit, hit)
        };
        self.last.push_back(judged.clone());
        while self.last.len() > limit {
            self.last.pop_front();
        }
        let worst_so_far = self.kept.worst.as_ref().map_or(-1.0, |(speed, _)| *speed);
        match hit {
            Some((speed, with)) if speed > worst_so_far => {
                self.kept.worst = Some((speed, self.figure(speed, &with)?));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.outbox.put(self.kept);
        Ok(())
    }
}

impl DriveSink {
    /// The last two seconds before a collision.
    fn figure(&self, speed: f64, with: &str) -> Result<CheckpointFigure> {
        let seed = self.identity.seed.unwrap_or_default();
        let last = self.last.len().saturating_sub(1);
        let mut places: Vec<_> = (0..SHOTS).map(|i| i * last / (SHOTS - 1)).collect();
        places.dedup();
        let algorithm = |judged: &Judged| {
            let scored = judged.estimates.first()?;
            Some(scored.estimate.algorithm.clone())
        };
        // The algorithm may have skipped the last.
        let name = self.last.iter().rev().find_map(algorithm);
        let name = name.unwrap_or_default();
        let shot = |place: usize| {
            let judged = &self.last[place];
            let scored = judged.estimates.first()?;
            let shot = frame_shot(&self.identity, judged, scored);
            Some(shot.map(|shot| (Rank::Sample, shot)))
        };
        let shots = places.into_iter().filter_map(shot);
        Ok(CheckpointFigure {
            title: format!("{name}, course {seed}"),
            about: format!(
                "The two seconds before it hit '{with}' at {speed:.2} m/s, its fastest collision."
            ),
            is_film: true,
            shots: shots.collect::<Result<_>>()?,
            ..CheckpointFigure::default()
        })
    }
}
