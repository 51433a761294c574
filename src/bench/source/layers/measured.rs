//! Pairs with distances that another sensor or program measured, of their recording or of files.

use super::board_truth::BoardTruth;
use crate::source::frames::{BoardPlane, Source, wraps};
use crate::source::inputs::folder::map_files::MapFiles;
use svl_core::matcher::{MapPlace, MapRequest};
use svl_core::statistics::nearest_rank;
use svl_core::stereo::{
    FloorPlane, Frame, MapDensity, Plane, RecordedMap, Surface, Truth, TruthOrigin,
};
use svl_core::{Error, Result};
use svl_recording::{Reader, SensorRole, SensorSelection, SensorTopic};
use svl_report::TopicDelay;
use svl_score::losses::Losses;

/// The measurements of another sensor or program.
pub enum MeasuredMaps {
    Topic(Box<SensorTopic>),
    Files(Box<MapFiles>),
    /// A printed board in view.
    Board(Box<BoardTruth>),
}

impl MeasuredMaps {
    /// The disparities of a frame, if it has a measurement.
    fn measured(&mut self, frame: &Frame) -> Result<Option<(Plane<f32>, MapDensity)>> {
        match self {
            Self::Topic(topic) => topic.measured(frame),
            Self::Files(files) => files.measured(frame),
            Self::Board(board) => {
                let found = board.measured(frame)?;
                Ok(found.map(|disparity| (disparity, MapDensity::Sparse)))
            }
        }
    }

    /// The floor of a truth that was measured, if something tells it.
    fn floor(&self, frame: &Frame) -> Option<FloorPlane> {
        match self {
            Self::Topic(topic) => topic.floor(frame),
            Self::Files(_) | Self::Board(_) => None,
        }
    }

    /// The surfaces of a truth that was measured, if the recording has them.
    fn surfaces(
        &mut self,
        frame: &Frame,
        disparity: &Plane<f32>,
    ) -> Result<Option<Plane<Surface>>> {
        match self {
            Self::Topic(topic) => topic.surfaces(frame, disparity),
            Self::Files(_) => Ok(None),
            Self::Board(_) => Ok(Some(disparity.map(|_| Surface::Object))),
        }
    }

    /// True if something tells the floor.
    fn has_floor(&self) -> bool {
        matches!(self, Self::Topic(topic) if topic.has_floor())
    }

    /// The topic, the files, or the board.
    fn origin(&self) -> TruthOrigin {
        match self {
            Self::Topic(topic) => TruthOrigin::Sensor(topic.topic().to_owned()),
            Self::Files(files) => TruthOrigin::Sensor(files.name()),
            Self::Board(board) => TruthOrigin::Board(board.size()),
        }
    }
}

/// The maps among these that are in topics of the recording.
///
/// # Errors
/// The errors of [`Reader::sensor`]; [`Error::Usage`] for the topic of the truth.
pub(crate) fn topics_of(
    maps: &[MapRequest],
    reader: &Reader,
    truth: Option<&str>,
) -> Result<Vec<(String, MeasuredMaps)>> {
    let topic = |map: &MapRequest| {
        let MapPlace::Topic(topic) = &map.place else {
            return Ok(None);
        };
        if truth == Some(topic) {
            let cure = "name another topic, or another sensor as the truth (--truth)";
            return Err(Error::Usage(format!(
                "topic:{topic}: is the truth, too: {cure}"
            )));
        }
        let selection = SensorSelection {
            topic: topic.clone(),
            max_skew_ns: map.max_skew_ns,
            role: SensorRole::Map,
        };
        let topic = MeasuredMaps::Topic(Box::new(reader.sensor(&selection)?));
        Ok(Some((map.source.clone(), topic)))
    };
    maps.iter()
        .filter_map(|map| topic(map).transpose())
        .collect()
}

/// Refuses maps in topics for a source that is no recording.
///
/// # Errors
/// [`Error::Usage`] with the first.
pub(crate) fn refuse_topics(maps: &[MapRequest], name: &str) -> Result<()> {
    let topic = maps.iter().find_map(|map| match &map.place {
        MapPlace::Topic(topic) => Some(topic),
        MapPlace::Files { .. } => None,
    });
    match topic {
        None => Ok(()),
        Some(topic) => Err(Error::Usage(format!(
            "topic:{topic}: recordings have topics, and {name} has not: name a recording"
        ))),
    }
}

/// The delays of the topics among these; none where log times are stamps, as in svl's recordings.
pub(crate) fn delays(maps: &[(String, MeasuredMaps)]) -> Vec<TopicDelay> {
    let ranks = |delays: &[i64]| {
        let rank = |share| Some(nearest_rank(delays, share)? as f64 / 1e6);
        Some([rank(0.5)?, rank(0.99)?])
    };
    let delay = |(_, map): &(String, MeasuredMaps)| match map {
        MeasuredMaps::Files(_) | MeasuredMaps::Board(_) => None,
        MeasuredMaps::Topic(topic) => {
            let latency = topic.latency();
            let mut all = latency.topic_ns.iter().chain(&latency.images_ns);
            all.any(|delay| *delay != 0).then(|| TopicDelay {
                topic: topic.topic().to_owned(),
                run: None,
                topic_ms: ranks(&latency.topic_ns),
                images_ms: ranks(&latency.images_ns),
            })
        }
    };
    let mut delays: Vec<TopicDelay> = Vec::new();
    for delay in maps.iter().filter_map(delay) {
        // Two algorithms may read one topic.
        if delays.iter().all(|known| known.topic != delay.topic) {
            delays.push(delay);
        }
    }
    delays
}

/// The truth of another sensor, and maps by [`RecordedMap::source`].
#[derive(Default)]
pub struct SourceMaps {
    pub truth: Option<MeasuredMaps>,
    pub maps: Vec<(String, MeasuredMaps)>,
}

impl SourceMaps {
    /// These with the requested maps that are in files; none without any.
    ///
    /// # Errors
    /// The errors of [`MapFiles::for_maps`].
    pub fn with_files(mut self, maps: &[MapRequest]) -> Result<Option<Self>> {
        for map in maps {
            if let MapPlace::Files {
                pattern,
                unit_m,
                scale,
            } = &map.place
            {
                let files = MapFiles::for_maps(pattern, (*unit_m, *scale), map.max_skew_ns)?;
                let files = MeasuredMaps::Files(Box::new(files));
                self.maps.push((map.source.clone(), files));
            }
        }
        let is_any = self.all().next().is_some();
        Ok(is_any.then_some(self))
    }

    /// True if something tells the floor.
    pub fn have_floor(&self) -> bool {
        let maps = self.maps.iter().map(|(_, map)| map);
        maps.chain(&self.truth).any(MeasuredMaps::has_floor)
    }

    fn all(&mut self) -> impl Iterator<Item = &mut MeasuredMaps> {
        let maps = self.maps.iter_mut().map(|(_, map)| map);
        self.truth.iter_mut().chain(maps)
    }
}

/// A source whose frames get the maps of other sensors and programs, and the truth of one in place
/// of their own.
pub struct MeasuredSource<'a> {
    source: Box<dyn Source + 'a>,
    measured: SourceMaps,
    /// The floor of the last truth.
    floor: Option<FloorPlane>,
    /// True once all pairs were read.
    has_ended: bool,
}

impl<'a> MeasuredSource<'a> {
    pub fn new(source: Box<dyn Source + 'a>, mut measured: SourceMaps) -> Self {
        for map in measured.all() {
            if let MeasuredMaps::Files(files) = map {
                files.count_pairs(source.numbers());
            }
        }
        Self {
            source,
            measured,
            floor: None,
            has_ended: false,
        }
    }
}

impl Source for MeasuredSource<'_> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        let Some(mut frame) = self.source.next()? else {
            if let Some(MeasuredMaps::Board(board)) = &self.measured.truth {
                board.check_any(&self.source.name())?;
            }
            self.has_ended = true;
            return Ok(None);
        };
        if let Some(truth) = &mut self.measured.truth {
            let own = frame.truth.take().and_then(|own| own.surface);
            if let Some((disparity, density)) = truth.measured(&frame)? {
                // Surfaces of the recording's own truth are of the same pixels.
                let surface = match own.filter(|own| own.size() == disparity.size()) {
                    Some(own) => Some(own),
                    None => truth.surfaces(&frame, &disparity)?,
                };
                self.floor = truth.floor(&frame);
                frame.truth = Some(Truth {
                    surface,
                    ..Truth::measured(disparity, density, truth.origin())
                });
            }
        }
        for (source, map) in &mut self.measured.maps {
            if let Some((disparity, density)) = map.measured(&frame)? {
                if frame.truth.is_none() {
                    self.floor = map.floor(&frame).or(self.floor);
                }
                frame.maps.push(RecordedMap {
                    source: source.clone(),
                    disparity,
                    density,
                });
            }
        }
        Ok(Some(frame))
    }

    fn floor(&self) -> Option<FloorPlane> {
        self.floor
    }

    fn board(&self) -> Option<&BoardPlane> {
        match &self.measured.truth {
            Some(MeasuredMaps::Board(board)) => board.last.as_ref(),
            _ => self.source.board(),
        }
    }

    fn finish(&mut self, taken: u64) -> Losses {
        // Files are unused once all pairs were read, and not those of pairs beside a range.
        let is_whole = self.has_ended && self.source.start_ns().is_none();
        for map in self.measured.all().filter(|_| is_whole) {
            if let MeasuredMaps::Files(files) = map {
                files.warn_of_unused();
            }
        }
        let (without_truth, jumped) = match &self.measured.truth {
            None => return self.source.finish(taken),
            Some(MeasuredMaps::Topic(truth)) => (truth.without, truth.jumped),
            Some(MeasuredMaps::Files(truth)) => (truth.without, 0),
            Some(MeasuredMaps::Board(truth)) => {
                if self.has_ended {
                    tracing::warn!("{}: {}", self.source.name(), truth.words());
                }
                (truth.refused(), 0)
            }
        };
        Losses {
            without_truth,
            jumped,
            ..self.source.finish(taken)
        }
    }
}
