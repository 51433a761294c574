//! An open recording: all readers share one handle per file.

use super::bag::{files, several_files};
use super::container::{Container, UnpackedMessages};
use super::header::{Header, RECORD};
use super::index::Index;
use super::ros1_bag::Ros1Messages;
use crate::mcap::messages::Messages;
use crate::mcap::records::attachment;
use crate::message::wire::CALIBRATION;
use crate::stream::channel::{Channel, EventReader};
use crate::stream::restamped::{Restamped, StampRules};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use svl_core::{Error, Result};

/// Limit on files of a bag that are all kept open. Most systems allow a process 1024.
const MAX_OPEN: usize = 256;

/// An open recording: one file, or those of a ROS 2 bag. Clones share the open files.
#[derive(Clone)]
pub struct Recording {
    path: PathBuf,
    parts: Arc<[RecordingFile]>,
    /// The rules by which its stamps are read.
    rules: StampRules,
}

/// A file of a recording, with the rules by which its stamps are read.
pub(crate) struct RestampedFile<'a> {
    part: &'a RecordingFile,
    rules: &'a StampRules,
}

/// One file, with its index once needed.
struct RecordingFile {
    file: Container,
    index: OnceLock<Index>,
    channels: OnceLock<Vec<Channel>>,
}

impl Recording {
    /// Opens the file, or the files of the bag, at `path`. Reads nothing yet, so that a corrupt
    /// file can be opened too.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a folder that is not a bag, for anything but a regular
    /// file, and for an empty one.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        let files = files(&path)?;
        // Bags of a day in pieces of a minute have 1440 files.
        let keep = files.len() <= MAX_OPEN;
        let open = |file: &PathBuf| {
            Container::open(file, keep).map(|file| RecordingFile {
                file,
                index: OnceLock::new(),
                channels: OnceLock::new(),
            })
        };
        let parts = files.iter().map(open).collect::<Result<_>>()?;
        Ok(Self {
            path,
            parts,
            rules: StampRules::default(),
        })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The metadata record `svl`, which precedes the first pair.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a recording that svl did not write;
    /// [`Error::Damaged`].
    pub fn header(&self) -> Result<Header> {
        for part in self.parts.iter() {
            let index = part.index()?;
            if let Some(header) = index.metadata.iter().find_map(Header::from_record) {
                return Ok(header);
            }
            // There may be one after the damage; only a complete index proves its absence.
            index.check_complete(part.file.path())?;
        }
        let reason = format!("is not a recording of svl: it has no metadata record '{RECORD}'");
        Err(Error::format(&self.path, reason))
    }

    /// The attachment `name`, if there is one.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`], [`Error::Damaged`].
    pub fn attachment(&self, name: &str) -> Result<Option<Vec<u8>>> {
        for part in self.parts.iter() {
            let index = part.index()?;
            if let Some((_, start)) = index.attachments.iter().find(|(known, _)| known == name) {
                return part.attachment(*start).map(Some);
            }
            index.check_complete(part.file.path())?;
        }
        Ok(None)
    }

    /// Names and contents of the attached calibration files, with which the pairs were rectified or
    /// can be.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`], [`Error::Damaged`].
    pub fn calibration_files(&self) -> Result<Vec<(String, Vec<u8>)>> {
        let mut found = Vec::new();
        for part in self.parts.iter() {
            let index = part.index()?;
            for (name, start) in &index.attachments {
                if let Some(name) = name.strip_prefix(CALIBRATION) {
                    found.push((name.to_owned(), part.attachment(*start)?));
                }
            }
            index.check_complete(part.file.path())?;
        }
        Ok(found)
    }

    /// The path of the only file.
    ///
    /// # Errors
    /// [`Error::Format`] for a bag of several files, which it lists.
    pub fn only_path(&self) -> Result<&Path> {
        self.only_part().map(|part| part.file.path())
    }

    /// The files, in the order of the recording.
    pub(crate) fn files(&self) -> impl Iterator<Item = RestampedFile<'_>> {
        self.parts.iter().map(|part| RestampedFile {
            part,
            rules: &self.rules,
        })
    }

    /// The same, as they are.
    pub(crate) fn containers(&self) -> impl Iterator<Item = &Container> {
        self.parts.iter().map(|part| &part.file)
    }

    /// The same recording, with its stamps read by rules.
    pub(crate) fn restamped(&self, rules: StampRules) -> Self {
        Self {
            rules,
            ..self.clone()
        }
    }

    /// The only file.
    ///
    /// # Errors
    /// [`Error::Format`] for a bag of several files, which it lists.
    pub(crate) fn only_file(&self) -> Result<&Container> {
        self.only_part().map(|part| &part.file)
    }

    fn only_part(&self) -> Result<&RecordingFile> {
        match &*self.parts {
            [part] => Ok(part),
            _ => {
                let files = self.parts.iter().map(|part| part.file.path().to_owned());
                let paths: Vec<_> = files.collect();
                Err(several_files(&self.path, &paths))
            }
        }
    }

    /// MCAP's profile from the header of the first file; `None` if that cannot be read.
    pub(crate) fn profile(&self) -> Result<Option<&str>> {
        let Some(first) = self.parts.first() else {
            return Ok(None);
        };
        Ok(first
            .index()?
            .header
            .as_ref()
            .map(|header| header.profile.as_str()))
    }

    /// Names of the topics of all files, sorted.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`], [`Error::Damaged`].
    pub fn topics(&self) -> Result<BTreeSet<String>> {
        let channels = self.channels()?.into_iter();
        Ok(channels.map(|channel| channel.topic.clone()).collect())
    }

    /// The channels of all files: those in the summary, or else those found in reading the file up
    /// to its end or damage.
    pub(crate) fn channels(&self) -> Result<Vec<&Channel>> {
        let mut channels = Vec::new();
        for part in self.parts.iter() {
            channels.extend(part.channels()?);
        }
        Ok(channels)
    }

    /// Messages of `topic`; `None` if a file has no intact summary that counts them.
    pub(crate) fn count(&self, topic: &str) -> Result<Option<u64>> {
        let mut sum = 0_u64;
        for part in self.parts.iter() {
            match part.index()?.declared.count(topic) {
                Some(count) => sum = sum.saturating_add(count),
                None => return Ok(None),
            }
        }
        Ok(Some(sum))
    }
}

impl RestampedFile<'_> {
    /// Messages from the start.
    ///
    /// # Errors
    /// The errors of [`Container::messages`].
    pub(crate) fn messages(&self) -> Result<Box<dyn EventReader>> {
        let messages = self.part.file.messages()?;
        Ok(Restamped::over(messages, self.rules))
    }

    /// Messages from `places` places on, all over the file; none if it has no index.
    ///
    /// # Errors
    /// The errors of [`Container::messages`].
    pub(crate) fn places(&self, places: usize) -> Result<Vec<Box<dyn EventReader>>> {
        let boxed = |messages: Box<dyn EventReader>| Restamped::over(messages, self.rules);
        Ok(match &self.part.file {
            Container::Sqlite(file) => {
                let places = file.places(places)?.into_iter();
                places
                    .map(|place| boxed(Box::new(UnpackedMessages(place))))
                    .collect()
            }
            Container::Ros1(file) => {
                let places = Ros1Messages::places(file, places)?.into_iter();
                places.map(|place| boxed(Box::new(place))).collect()
            }
            Container::Mcap(file) => {
                let index = self.part.index()?;
                let chunk = |place| index.chunks.get(index.chunks.len() * place / (places + 1));
                let mut starts: Vec<_> = (1..=places).filter_map(chunk).collect();
                starts.dedup();
                let place = |start: &u64| {
                    let messages = Messages::from(file, *start, index.declared.clone())?;
                    Ok(boxed(Box::new(UnpackedMessages(messages))))
                };
                starts.into_iter().map(place).collect::<Result<_>>()?
            }
        })
    }
}

impl RecordingFile {
    fn index(&self) -> Result<&Index> {
        match self.index.get() {
            Some(index) => Ok(index),
            None => {
                let index = match &self.file {
                    Container::Mcap(file) => Index::read(file)?,
                    Container::Sqlite(_) | Container::Ros1(_) => Index::default(),
                };
                // Another thread may have been first; both read the same.
                Ok(self.index.get_or_init(|| index))
            }
        }
    }

    fn channels(&self) -> Result<&[Channel]> {
        if let Some(channels) = self.channels.get() {
            return Ok(channels);
        }
        let channels = match &self.file {
            Container::Sqlite(file) => file.channels()?,
            Container::Ros1(file) => Ros1Messages::open(file)?.channels(),
            Container::Mcap(_) => self.index()?.declared.channels(),
        };
        Ok(self.channels.get_or_init(|| channels))
    }

    /// The contents of the attachment whose record begins at `start`.
    fn attachment(&self, start: u64) -> Result<Vec<u8>> {
        let data = match &self.file {
            Container::Mcap(file) => attachment(file, start)?,
            Container::Sqlite(_) | Container::Ros1(_) => None,
        };
        let bad = || {
            let reason = format!("the attachment at byte {start} cannot be read");
            Error::damaged(self.file.path(), reason)
        };
        data.ok_or_else(bad)
    }
}
