//! Reads recordings.

use super::messages::{Event, Messages};
use super::pairing::Pairing;
use super::{Header, Kind};
use crate::error::{Error, Result};
use crate::stereo::Frame;
use std::path::{Path, PathBuf};

/// Reads the pairs of one recording in the order of the file, holding a few in memory at a time.
///
/// Left and right belong together as `/stereo/sync` says.
pub struct Reader {
    path: PathBuf,
    messages: Messages,
    pairing: Pairing,
    header: Option<Header>,
    pairs: Option<u64>,
    /// The first pair, read when the file was opened.
    first: Option<Frame>,
}

impl Reader {
    /// Opens a recording and reads its first pair.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for what is no recording, has no pairs, or begins with a pair that is none;
    /// [`Error::Damaged`] when it ends before its first pair does.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        let mut reader = Self {
            messages: Messages::open(&path)?,
            pairing: Pairing::default(),
            header: None,
            // Without a good summary the length is unknown; what is wrong with it, reading on will tell.
            pairs: Messages::count(&path, Kind::Sync.topic()).unwrap_or(None),
            first: None,
            path,
        };
        reader.first = reader.read()?;
        if reader.first.is_none() {
            return Err(Error::format(&reader.path, reader.pairing.why_none(&reader.messages.topics())));
        }
        Ok(reader)
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the recording says of itself; nothing when svl did not write it.
    pub fn header(&self) -> Option<&Header> {
        self.header.as_ref()
    }

    /// Number of pairs by the file's summary; nothing when it has none, as when it was never finished.
    pub fn pairs(&self) -> Option<u64> {
        self.pairs
    }

    /// Images read so far that found no partner. Complete once the end is reached.
    pub fn unpaired(&self) -> u64 {
        self.pairing.unpaired()
    }

    /// The next pair, or nothing at the end.
    ///
    /// # Errors
    /// [`Error::Format`] for a pair that is none, after which the next may be asked for. [`Error::Damaged`], once, where
    /// the file ends early or is not what its CRCs say: all pairs before it are good, and there are no more.
    pub fn next_pair(&mut self) -> Result<Option<Frame>> {
        match self.first.take() {
            Some(first) => Ok(Some(first)),
            None => self.read(),
        }
    }

    fn read(&mut self) -> Result<Option<Frame>> {
        loop {
            let event = match self.messages.next() {
                Ok(event) => event,
                Err(error) => {
                    self.pairing.end();
                    return Err(self.counted(error));
                }
            };
            match event {
                Some(Event::Message { channel, log_time, data }) => {
                    let Some(kind) = Kind::of(&channel.topic) else { continue };
                    let told = self.pairing.take_in(kind, &channel.schema, log_time, &data);
                    let bad =
                        |reason| Error::format(&self.path, format!("{} at {log_time} ns: {reason}", kind.topic()));
                    if let Some(frame) = told.map_err(bad)? {
                        return Ok(Some(frame));
                    }
                }
                Some(Event::Metadata(metadata)) => {
                    self.header = self.header.take().or_else(|| Header::from_record(&metadata));
                }
                Some(_) => {}
                None => {
                    self.pairing.end();
                    return Ok(None);
                }
            }
        }
    }

    /// The error with the number of pairs that came before it.
    fn counted(&self, error: Error) -> Error {
        match (error, self.pairing.pairs()) {
            (Error::Damaged { path, reason }, 1) => Error::damaged(path, format!("{reason}; 1 whole pair was read")),
            (Error::Damaged { path, reason }, n) => {
                Error::damaged(path, format!("{reason}; {n} whole pairs were read"))
            }
            (error, _) => error,
        }
    }
}
