//! Writes recordings, crash-safe to about a second.

use super::dialect::{Dialect, RecordingFormat};
use crate::bags::header::Header;
use crate::mcap::append_file::AppendFile;
use crate::mcap::synced_file::SyncedFile;
use crate::message::ros;
use crate::message::ros::result_message::ResultOptions;
use crate::message::sync::StereoSync;
use crate::message::wire::{Encoded, LIBRARY, MANIFEST, RosStamp, frame_id, topic};
use crate::pairs::truth;
use crate::results::result::PairResult;
use crate::results::{ros_messages, scan};
use mcap::records::{AttachmentHeader, MessageHeader, Metadata};
use serde::Serialize;
use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use svl_core::stereo::{Frame, Geometry, Side, Truth};
use svl_core::{Error, Result};

const TF_STATIC: &str = "/tf_static";

/// Writes one recording.
///
/// Only complete chunks are appended, without seeking back, so that the file is a valid prefix of a
/// recording at every moment; it is synced about once a second. Dropping the writer finishes the
/// file and discards errors; call [`Writer::finish`] to see them.
pub struct Writer {
    file: SyncedFile,
    format: RecordingFormat,
    channels: HashMap<String, u16>,
    camera_height_m: Option<f64>,
}

impl Writer {
    /// Creates the file and writes its header.
    ///
    /// # Errors
    /// [`Error::Io`] if the file exists already or cannot be created.
    pub fn create(
        path: impl Into<PathBuf>,
        header: &Header,
        format: impl Into<RecordingFormat>,
    ) -> Result<Self> {
        let format = format.into();
        let path = path.into();
        let mut file = AppendFile::create(path.clone(), format.dialect.profile(), LIBRARY)?;
        file.metadata(&header.to_record())?;
        let file = SyncedFile::new(file).map_err(|e| Error::io(&path, e))?;
        Ok(Self {
            file,
            format,
            channels: HashMap::new(),
            camera_height_m: header.camera_height_m,
        })
    }

    /// Attaches a file, e.g. the scenario or a calibration.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn attach(&mut self, name: &str, media_type: &str, data: &[u8]) -> Result<()> {
        let header = AttachmentHeader {
            log_time: 0,
            create_time: 0,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
        };
        self.file.with(|file| {
            file.begin_attachment(data.len() as u64, header)?;
            file.attachment_piece(data)?;
            file.finish_attachment()
        })
    }

    /// Attaches the manifest of the run that writes the recording.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Invalid`] if JSON cannot express it.
    pub fn identify(&mut self, manifest: &impl Serialize) -> Result<()> {
        let json = serde_json::to_vec_pretty(manifest)
            .map_err(|error| Error::Invalid(format!("{MANIFEST}: {error}")))?;
        self.attach(MANIFEST, "application/json", &json)
    }

    /// Writes a metadata record.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remember(&mut self, name: &str, facts: BTreeMap<String, String>) -> Result<()> {
        self.file.with(|file| {
            file.metadata(&Metadata {
                name: name.to_owned(),
                metadata: facts,
            })
        })
    }

    /// Writes a pair with its geometry, pose, truth and exposure.
    ///
    /// # Errors
    /// [`Error::Io`], after which the file keeps the chunks written before and accepts no more;
    /// [`Error::Invalid`] for stamps outside 1970 ..= 2038.
    pub fn write(&mut self, frame: &Frame) -> Result<()> {
        let left = RosStamp::new(frame.stamp_ns)?;
        // If the skew of an image is unknown, its stamp is that of its partner.
        let skew_ns = frame.exposure.skew_ns.unwrap_or(0);
        // The right stamp is not in a frame; it is the left one plus the skew.
        let right_ns = left.ns().checked_add_signed(skew_ns).ok_or_else(|| {
            Error::Invalid(format!(
                "a skew of {skew_ns} ns puts the right stamp of {} ns before 1970",
                left.ns()
            ))
        })?;
        let right = RosStamp::new(right_ns)?;
        let sequence = frame.sequence as u32;
        let size = frame.pair.size();
        let RecordingFormat { dialect, images } = self.format;
        let cameras = [(Side::Left, left), (Side::Right, right)];
        if let Some(rig) = frame.rig() {
            for (camera, stamp) in cameras {
                let message = dialect.calibration(rig, size, camera, stamp);
                self.put(message, stamp, sequence)?;
            }
            // Calibration first: a truncated recording with the images then also has their
            // calibration.
            if let Some(message) = dialect.baseline(rig, left) {
                self.put(message, left, sequence)?;
            }
        }
        if self.camera_height_m.is_some() {
            self.write_static_transforms(left, sequence)?;
        }
        if let Some(pose) = &frame.pose {
            self.put(dialect.pose(pose, left), left, sequence)?;
        }
        let rectified = frame.geometry != Geometry::Raw;
        if let Some(colors) = &frame.color {
            for ((camera, stamp), color) in cameras.into_iter().zip(colors) {
                let message = dialect.image(color, camera, rectified, images, stamp)?;
                self.put(message, stamp, sequence)?;
            }
        }
        let pair = [frame.pair.left(), frame.pair.right()];
        for ((camera, stamp), image) in cameras.into_iter().zip(pair) {
            let message = dialect.image(image, camera, rectified, images, stamp)?;
            self.put(message, stamp, sequence)?;
        }
        if let Some(truth) = &frame.truth {
            self.write_truth(frame, truth, left)?;
        }
        // Last message of the pair: a reader that has it has everything of the pair.
        let sync = dialect.json(StereoSync::new(frame, right_ns).encode());
        self.put((topic::SYNC, sync), left, sequence)
    }

    fn write_truth(&mut self, frame: &Frame, truth: &Truth, stamp: RosStamp) -> Result<()> {
        let sequence = frame.sequence as u32;
        let rig = frame.rig();
        let said = match rig.and_then(|rig| truth::depths(&truth.disparity, rig)) {
            Some(depth) => (
                topic::DEPTH,
                ros::encode_32fc1(&depth, stamp, frame_id(Side::Left)),
            ),
            // Without a frame id: viewers interpret a float image in a frame as depths in metres.
            None => (
                topic::DISPARITY,
                ros::encode_32fc1(&truth::to_file(&truth.disparity), stamp, ""),
            ),
        };
        self.put(said, stamp, sequence)?;
        let visibility = truth.visibility.as_ref();
        let visibility = visibility.map(|plane| plane.map(|v| v as u8));
        let surface = truth.surface.as_ref().map(|plane| plane.map(|s| s as u8));
        for (kind, codes) in [(topic::VISIBILITY, visibility), (topic::SURFACE, surface)] {
            if let Some(codes) = codes {
                let message = self.format.dialect.codes(kind, &codes, stamp)?;
                self.put(message, stamp, sequence)?;
            }
        }
        Ok(())
    }

    /// Writes the static transforms of a ROS 2 bag, once.
    fn write_static_transforms(&mut self, stamp: RosStamp, sequence: u32) -> Result<()> {
        if self.format.dialect != Dialect::Ros2 || self.channels.contains_key(TF_STATIC) {
            return Ok(());
        }
        let left = frame_id(Side::Left);
        let transforms = scan::static_transforms(left, self.camera_height_m, stamp.ns())?;
        let transforms = transforms.map(|said| (TF_STATIC, said.message));
        transforms.map_or(Ok(()), |said| self.put(said, stamp, sequence))
    }

    /// Writes the result of an algorithm for `frame`: disparities, cells, hash; in ROS 2 also what
    /// live topics have.
    ///
    /// # Errors
    /// The errors of [`Writer::write`].
    pub fn write_result(&mut self, frame: &Frame, result: &PairResult) -> Result<()> {
        let stamp = RosStamp::new(frame.stamp_ns)?;
        // Labels may contain paths (exec), and slashes would create namespaces.
        let algorithm = result.result.algorithm.replace('/', "_");
        let topic = |what: &str| format!("/algo/{algorithm}/{what}");
        let sequence = frame.sequence as u32;
        let dialect = self.format.dialect;
        if dialect == Dialect::Ros2 && frame.rig().is_some() {
            self.write_static_transforms(stamp, sequence)?;
            let left = frame_id(Side::Left);
            let options = ResultOptions::new(left);
            for said in ros_messages::result_messages(frame, result, &options, |_| true)? {
                self.put((topic(said.topic), said.message), stamp, sequence)?;
            }
        } else {
            let disparity = truth::to_file(&result.disparity);
            let disparity = ros::encode_32fc1(&disparity, stamp, "");
            self.put((topic("disparity"), disparity), stamp, sequence)?;
        }
        let cells = dialect.json(result.cells.encode());
        self.put((topic("cells"), cells), stamp, sequence)?;
        let hash = dialect.json(result.result.encode());
        self.put((topic("result"), hash), stamp, sequence)
    }

    /// Closes the chunk and syncs the file (fsync).
    ///
    /// # Errors
    /// [`Error::Io`], also if the file has disappeared from its folder.
    pub fn sync(&mut self) -> Result<()> {
        self.file.with(AppendFile::sync)
    }

    /// Completes the file. A second call does nothing.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(&mut self) -> Result<()> {
        self.file.with(AppendFile::finish)
    }

    fn put(
        &mut self,
        (topic, message): (impl AsRef<str>, Encoded),
        stamp: RosStamp,
        sequence: u32,
    ) -> Result<()> {
        let topic = topic.as_ref();
        let channel_id = match self.channels.get(topic) {
            Some(&id) => id,
            None => {
                let schema = (
                    message.schema,
                    message.schema_encoding,
                    &*message.definition,
                );
                let (encoding, none) = (message.encoding, BTreeMap::new());
                let declare =
                    |file: &mut AppendFile| file.channel(topic, Some(schema), encoding, &none);
                let id = self.file.with(declare)?;
                self.channels.insert(topic.to_owned(), id);
                id
            }
        };
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: stamp.ns(),
            publish_time: stamp.ns(),
        };
        self.file.with(|file| file.message(&header, &message.data))
    }
}
