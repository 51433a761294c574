//! The line to the controller: bytes out, answers in.

use super::answer::Answer;
use super::trouble::{Trouble, Troubles};
use crate::error::{Error, Result};
use serial2::SerialPort;
use std::io;
use std::time::{Duration, Instant};

/// Longer than any answer.
const LONGEST: usize = 64;
/// As much as the system keeps for a reader.
const BUFFER: usize = 4096;

/// An open port, and what came from it and was not yet looked at.
pub(super) struct Line {
    name: String,
    port: SerialPort,
    received: Vec<u8>,
    /// Whether a controller has ever answered.
    pub(super) heard: bool,
    /// Lines that were no answers before: a bootloader's, or of something that is no controller.
    pub(super) strange: u64,
    pub(super) troubles: Troubles,
}

impl Line {
    pub(super) fn new(port: SerialPort, name: &str) -> Self {
        let name = format!("trigger {name}");
        let troubles = Troubles::of(&name);
        Self {
            name,
            port,
            received: Vec::new(),
            heard: false,
            strange: 0,
            troubles,
        }
    }

    /// The next answer that is whole. What is cut off or garbled is counted and passed over. After
    /// the deadline it is one that has already come, or nothing.
    pub(super) fn next(&mut self, deadline: Instant) -> Result<Option<Answer>> {
        let mut over = false;
        loop {
            if let Some(answer) = self.received_answer() {
                self.heard = true;
                return Ok(Some(answer));
            }
            if over {
                return Ok(None);
            }
            let left = deadline.saturating_duration_since(Instant::now());
            over = left.is_zero();
            self.receive(left)?;
        }
    }

    fn received_answer(&mut self) -> Option<Answer> {
        while let Some(end) = self.received.iter().position(|&byte| byte == b'\n') {
            let line: Vec<u8> = self.received.drain(..=end).collect();
            match Answer::parse(&line[..end]) {
                None if end > 0 => self.garbled(),
                None => {}
                answer => return answer,
            }
        }
        if self.received.len() > LONGEST {
            self.received.clear();
            self.garbled();
        }
        None
    }

    fn garbled(&mut self) {
        match self.heard {
            true => self.troubles.add(Trouble::Garbled, 1),
            false => self.strange += 1,
        }
    }

    fn receive(&mut self, patience: Duration) -> Result<()> {
        let mut bytes = [0; BUFFER];
        // The port counts whole milliseconds.
        let patience = Duration::from_millis(patience.as_micros().div_ceil(1000) as u64);
        match self
            .port
            .set_read_timeout(patience)
            .and_then(|()| self.port.read(&mut bytes))
        {
            Ok(0) => Err(self.gone()),
            Ok(count) => {
                self.received.extend_from_slice(&bytes[..count]);
                Ok(())
            }
            Err(e) => match e.kind() {
                io::ErrorKind::TimedOut
                | io::ErrorKind::Interrupted
                | io::ErrorKind::WouldBlock => Ok(()),
                _ => Err(self.failed("read", &e)),
            },
        }
    }

    pub(super) fn send(&mut self, bytes: &[u8]) -> Result<()> {
        self.port
            .write_all(bytes)
            .map_err(|e| self.failed("written", &e))
    }

    fn failed(&self, done: &str, cause: &io::Error) -> Error {
        // EIO, ENXIO, ENODEV: what was plugged in is no more.
        match cause.raw_os_error() {
            Some(5 | 6 | 19) => self.gone(),
            _ if cause.kind() == io::ErrorKind::WriteZero => self.gone(),
            _ => self.error(format!(
                "cannot be {done}: {cause}; plug it in anew and record again"
            )),
        }
    }

    fn gone(&self) -> Error {
        self.error("is gone; plug it in and record again")
    }

    pub(super) fn error(&self, reason: impl Into<String>) -> Error {
        Error::camera(&self.name, reason)
    }

    pub(super) fn warn(&self, what: &str) {
        tracing::warn!("{}: {what}", self.name);
    }
}
