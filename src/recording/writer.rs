//! Writes recordings that survive a crash.

use super::sync::StereoSync;
use super::{
    AlgorithmResult, Camera, Encoded, Header, ImageFormat, Kind, MANIFEST, PROFILE, Stamp, float_image, geometry,
    gray_image, truth,
};
use crate::error::{Error, Result};
use crate::manifest::Manifest;
use crate::stereo::{Estimate, Frame, Gray, Truth};
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, McapResult, WriteOptions};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How much of a recording a crash may cost.
const SYNC_PERIOD: Duration = Duration::from_secs(1);
/// Chunks close when they grow beyond this, at the latest after [`SYNC_PERIOD`]: two pairs of 320x240 with truth.
const CHUNK_BYTES: u64 = 1 << 20;

/// Writes one recording.
///
/// Only whole chunks reach the file, in order and without seeking back, so that at every moment it is the beginning of
/// a recording; about once a second they are synced to the disk. Dropping the writer finishes the file and discards
/// errors; call [`Writer::finish`] to see them.
pub struct Writer {
    path: PathBuf,
    file: File,
    images: ImageFormat,
    /// mcap writes into memory, where it cannot fail: its writer panics when it is dropped after some failures.
    mcap: mcap::Writer<NoSeek<Memory>>,
    memory: Memory,
    channels: HashMap<String, u16>,
    synced: Instant,
    /// Bytes in the file.
    written: u64,
    open: bool,
}

impl Writer {
    /// Begins a recording at `path`.
    ///
    /// # Errors
    /// [`Error::Io`] when the file exists already or cannot be made.
    pub fn create(path: impl Into<PathBuf>, header: &Header, images: ImageFormat) -> Result<Self> {
        let path = path.into();
        let file = File::create_new(&path).map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists => {
                let cure = "exists already, and a recording is never overwritten: remove it or choose another name";
                Error::io(&path, io::Error::new(e.kind(), cure))
            }
            _ => Error::io(&path, e),
        })?;
        let memory = Memory::default();
        let mcap = WriteOptions::new()
            .profile(PROFILE)
            .library(concat!("svl ", env!("CARGO_PKG_VERSION")))
            // Of the arena's pairs with truth (539 kB) level 1 makes 390 kB, lz4 465, level 3 378 at half the speed.
            .compression(Some(Compression::Zstd))
            .compression_level(1)
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(NoSeek::new(memory.clone()))
            .map_err(|e| refused(&path, e))?;
        let (channels, synced) = (HashMap::new(), Instant::now());
        let mut writer = Self { path, file, images, mcap, memory, channels, synced, written: 0, open: true };
        writer.tell(|mcap| mcap.write_metadata(&header.to_record()))?;
        Ok(writer)
    }

    /// Keeps a file beside the pairs: the scenario, the calibration.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn attach(&mut self, name: &str, media_type: &str, data: &[u8]) -> Result<()> {
        let (name, media_type) = (name.to_owned(), media_type.to_owned());
        let attachment = Attachment { log_time: 0, create_time: 0, name, media_type, data: Cow::Borrowed(data) };
        self.tell(|mcap| mcap.attach(&attachment))
    }

    /// Keeps the identity of the run that writes this.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn identify(&mut self, manifest: &Manifest) -> Result<()> {
        // Strings and numbers under fixed keys always serialise.
        let json = serde_json::to_vec_pretty(manifest).expect("plain data");
        self.attach(MANIFEST, "application/json", &json)
    }

    /// Writes a pair and all that is known about it.
    ///
    /// # Errors
    /// [`Error::Io`], after which the file keeps the chunks written before and takes no more;
    /// [`Error::Invalid`] for stamps outside 1970 ..= 2038.
    pub fn write(&mut self, frame: &Frame) -> Result<()> {
        let left = Stamp::new(frame.stamp_ns)?;
        let skew_ns = frame.exposure.skew_ns;
        let right_ns = left.ns().checked_add_signed(skew_ns).ok_or_else(|| {
            Error::Invalid(format!("a skew of {skew_ns} ns puts the right stamp of {} ns before 1970", left.ns()))
        })?;
        let right = Stamp::new(right_ns)?;
        let sequence = frame.sequence as u32;
        let size = frame.pair.size();
        if let Some(rig) = &frame.rig {
            for (camera, stamp) in [(Camera::Left, left), (Camera::Right, right)] {
                let calibration = geometry::encode_calibration(rig, size, camera, stamp);
                self.put(Kind::Calibration(camera).topic(), stamp, sequence, calibration)?;
            }
            self.put(Kind::Baseline.topic(), left, sequence, geometry::encode_baseline(rig, left))?;
        }
        if let Some(pose) = &frame.pose {
            self.put(Kind::Pose.topic(), left, sequence, geometry::encode_pose(pose, left))?;
        }
        for (camera, image, stamp) in
            [(Camera::Left, frame.pair.left(), left), (Camera::Right, frame.pair.right(), right)]
        {
            let message = gray_image::encode(image, self.images, stamp, camera.frame_id())?;
            self.put(Kind::Image(camera).topic(), stamp, sequence, message)?;
        }
        if let Some(truth) = &frame.truth {
            self.write_truth(frame, truth, left)?;
        }
        self.put(Kind::Sync.topic(), left, sequence, StereoSync::new(frame, right_ns).encode())?;
        if self.synced.elapsed() >= SYNC_PERIOD { self.sync() } else { Ok(()) }
    }

    fn write_truth(&mut self, frame: &Frame, truth: &Truth, stamp: Stamp) -> Result<()> {
        let sequence = frame.sequence as u32;
        let left = Camera::Left.frame_id();
        match frame.rig.as_ref().and_then(|rig| truth::depths(&truth.disparity, rig)) {
            Some(depth) => self.put(Kind::Depth.topic(), stamp, sequence, float_image::encode(&depth, stamp, left))?,
            None => {
                let disparity = truth::to_file(&truth.disparity);
                self.put(Kind::Disparity.topic(), stamp, sequence, float_image::encode(&disparity, stamp, ""))?;
            }
        }
        if let Some(visibility) = &truth.visibility {
            let codes: Gray = visibility.map(|v| v as u8);
            let message = gray_image::encode(&codes, ImageFormat::Raw, stamp, left)?;
            self.put(Kind::Visibility.topic(), stamp, sequence, message)?;
        }
        Ok(())
    }

    /// Writes an algorithm's disparities of `frame`.
    ///
    /// # Errors
    /// As [`Writer::write`].
    pub fn write_estimate(&mut self, frame: &Frame, estimate: &Estimate) -> Result<()> {
        let stamp = Stamp::new(frame.stamp_ns)?;
        let topic = |what: &str| format!("/algo/{}/{what}", estimate.algorithm.replace('/', "_"));
        let disparity = truth::to_file(estimate.disparity.disparity());
        let sequence = frame.sequence as u32;
        self.put(&topic("disparity"), stamp, sequence, float_image::encode(&disparity, stamp, ""))?;
        self.put(&topic("result"), stamp, sequence, AlgorithmResult::of(frame, estimate).encode())
    }

    /// Closes the chunk and brings it to the disk.
    ///
    /// # Errors
    /// [`Error::Io`], also when the file is gone from its folder.
    pub fn sync(&mut self) -> Result<()> {
        self.tell(mcap::Writer::flush)?;
        self.file.sync_data().map_err(|e| self.failed(e))?;
        // A file whose folder was removed takes bytes without complaint, and they are lost.
        self.path.metadata().map_err(|e| self.failed(e))?;
        self.synced = Instant::now();
        Ok(())
    }

    /// Completes the file. A second call does nothing.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(&mut self) -> Result<()> {
        if self.open {
            self.tell(|mcap| mcap.finish().map(drop))?;
            self.open = false;
            self.file.sync_all().map_err(|e| Error::io(&self.path, e))?;
            self.path.metadata().map_err(|e| Error::io(&self.path, e))?;
        }
        Ok(())
    }

    fn put(&mut self, topic: &str, stamp: Stamp, sequence: u32, message: Encoded) -> Result<()> {
        self.check_open()?;
        let channel_id = match self.channels.get(topic) {
            Some(&id) => id,
            None => {
                let Encoded { schema, schema_encoding, definition, encoding, .. } = &message;
                let schema = self.mcap.add_schema(schema, schema_encoding, definition);
                let channel = schema.and_then(|id| self.mcap.add_channel(id, topic, encoding, &BTreeMap::new()));
                let id = channel.map_err(|e| refused(&self.path, e))?;
                self.channels.insert(topic.to_owned(), id);
                id
            }
        };
        let header = MessageHeader { channel_id, sequence, log_time: stamp.ns(), publish_time: stamp.ns() };
        self.tell(|mcap| mcap.write_to_known_channel(&header, &message.data))
    }

    /// Tells mcap to do something, and brings what that wrote into the file.
    fn tell(&mut self, act: impl FnOnce(&mut mcap::Writer<NoSeek<Memory>>) -> McapResult<()>) -> Result<()> {
        self.check_open()?;
        act(&mut self.mcap).map_err(|e| refused(&self.path, e))?;
        let bytes = self.memory.take();
        self.file.write_all(&bytes).map_err(|e| self.failed(e))?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// mcap panics when it is told to write into a finished file.
    fn check_open(&self) -> Result<()> {
        let closed = || Error::format(&self.path, "takes no more pairs: it is finished, or writing to it failed");
        self.open.then_some(()).ok_or_else(closed)
    }

    /// Gives up: the file keeps what is whole of it.
    fn failed(&mut self, error: io::Error) -> Error {
        self.open = false;
        // Half a chunk may have been written. Where it cannot be cut off, readers stop before it.
        let _ = self.file.set_len(self.written);
        Error::io(&self.path, error)
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        let _ = self.finish();
    }
}

/// What mcap refuses though it writes to memory: more topics than a file can have.
fn refused(path: &Path, error: McapError) -> Error {
    Error::format(path, error.to_string())
}

/// Bytes on their way from mcap to the file.
#[derive(Clone, Default)]
struct Memory(Arc<Mutex<Vec<u8>>>);

impl Memory {
    fn take(&self) -> Vec<u8> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl io::Write for Memory {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
