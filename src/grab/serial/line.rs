//! The serial line to the controller: sends bytes, receives answers, counts garbled ones.

use super::answer::ControllerAnswer;
use super::trouble::{Trouble, Troubles};
use crate::camera_error;
use serial2::SerialPort;
use std::io;
use std::time::{Duration, Instant};
use svl_core::{Error, Result};

/// Longer than any answer.
const LONGEST: usize = 64;
/// Size of the system's input buffer.
const BUFFER: usize = 4096;

/// An open port and the bytes received but not yet parsed.
pub(super) struct SerialLine {
    name: String,
    port: SerialPort,
    received: Vec<u8>,
    /// True once a controller has answered.
    pub(super) heard: bool,
    /// Lines before the first answer: from a bootloader, or a device that is not a controller.
    pub(super) strange: u64,
    pub(super) troubles: Troubles,
}

impl SerialLine {
    pub(super) fn new(port: SerialPort, name: &str) -> Self {
        let name = format!("trigger {name}");
        let troubles = Troubles::new(&name);
        Self {
            name,
            port,
            received: Vec::new(),
            heard: false,
            strange: 0,
            troubles,
        }
    }

    /// The next valid answer; garbled lines are counted and skipped. After the deadline, only an
    /// answer that has already arrived.
    pub(super) fn next(&mut self, deadline: Instant) -> Result<Option<ControllerAnswer>> {
        // A last check after the deadline: an answer that has arrived is never a timeout.
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

    fn received_answer(&mut self) -> Option<ControllerAnswer> {
        while let Some(end) = self.received.iter().position(|&byte| byte == b'\n') {
            let line: Vec<u8> = self.received.drain(..=end).collect();
            match ControllerAnswer::parse(&line[..end]) {
                None if end > 0 => self.garbled(),
                None => {}
                answer => return answer,
            }
        }
        // Noise without a line end must not fill the memory.
        if self.received.len() > LONGEST {
            self.received.clear();
            self.garbled();
        }
        None
    }

    fn garbled(&mut self) {
        if self.heard {
            self.troubles.add(Trouble::Garbled, 1);
        } else {
            self.strange += 1;
        }
    }

    fn receive(&mut self, timeout: Duration) -> Result<()> {
        let mut bytes = [0; BUFFER];
        // serial2 rounds timeouts down to milliseconds, and 0 would return at once.
        let timeout = Duration::from_millis(timeout.as_micros().div_ceil(1000) as u64);
        match self
            .port
            .set_read_timeout(timeout)
            .and_then(|()| self.port.read(&mut bytes))
        {
            // End of file: the other end is closed.
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
        // EIO, ENXIO, ENODEV: unplugged.
        match cause.raw_os_error() {
            Some(5 | 6 | 19) => self.gone(),
            _ if cause.kind() == io::ErrorKind::WriteZero => self.gone(),
            _ => self.error(format!(
                "cannot be {done}: {cause}; plug it in again and record again"
            )),
        }
    }

    fn gone(&self) -> Error {
        self.error("is gone; plug it in and record again")
    }

    pub(super) fn error(&self, reason: impl Into<String>) -> Error {
        camera_error(&self.name, reason)
    }

    pub(super) fn warn(&self, what: &str) {
        tracing::warn!("{}: {what}", self.name);
    }
}
