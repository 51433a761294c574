//! The trigger controller on a serial port (protocol: firmware/README.md). Counts every pulse,
//! through lost requests, lost answers, noise on the line and resets.

mod answer;
mod line;
mod port;
#[cfg(all(test, unix))]
mod tests;
mod trouble;

use super::clock::GrabClock;
use super::trigger::{Pulse, Trigger};
use answer::ControllerAnswer;
use line::SerialLine;
pub use port::serial_ports;
use serial2::SerialPort;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use svl_core::{Error, Result, counted};
use trouble::Trouble;

const VERSION: u32 = 1;
/// Longest stay of a board in its bootloader after a reset.
const BOOT: Duration = Duration::from_secs(3);
/// Time to the first answer of a board that was not reset.
const PRESENCE: Duration = Duration::from_secs(1);
/// Time after which a request or its answer is considered lost.
const ANSWER: Duration = Duration::from_millis(100);
/// Limit on the requests for one pulse.
const ATTEMPTS: u32 = 3;
/// Range of the pulse length.
const SHORTEST: Duration = Duration::from_micros(100);
const LONGEST: Duration = Duration::from_micros(20_000);
/// A count lower than the previous one has wrapped around its 32 bits if at most this many pulses
/// lie between; else the controller was reset.
const WRAP: u32 = 1 << 16;

/// An opened trigger controller.
pub struct SerialTrigger {
    line: SerialLine,
    clock: Arc<GrabClock>,
    length: Duration,
    /// False after a reset, which clears it.
    length_is_set: bool,
    /// Time at which the last pulse was reported.
    last: Option<Instant>,
    /// The controller's count of pulses since its reset, 32 bits.
    count: u32,
    /// Pulses across all resets, so that pulse ids are unique.
    pulses: u64,
}

impl SerialTrigger {
    /// Opens the controller at `device`. Its pulses last half a period. `stopped` is polled while
    /// svl waits for the first answer.
    ///
    /// # Errors
    /// [`crate::CameraError`] if there is no controller, if it has another protocol version, and
    /// once `stopped` returns true.
    pub fn open(
        device: &Path,
        period_ns: u64,
        clock: &Arc<GrabClock>,
        stopped: fn() -> bool,
    ) -> Result<Self> {
        Self::on(
            port::open(device)?,
            &device.display().to_string(),
            period_ns,
            clock,
            stopped,
        )
    }

    /// Finds the controller on an open port.
    fn on(
        port: SerialPort,
        name: &str,
        period_ns: u64,
        clock: &Arc<GrabClock>,
        stopped: fn() -> bool,
    ) -> Result<Self> {
        let length = Duration::from_nanos(period_ns / 2).clamp(SHORTEST, LONGEST);
        let (line, clock) = (SerialLine::new(port, name), clock.clone());
        let mut trigger = Self {
            line,
            clock,
            length,
            length_is_set: false,
            last: None,
            count: 0,
            pulses: 0,
        };
        // Opening the port resets an Uno through DTR, which then announces itself; a board whose
        // reset line is cut has to be queried.
        if !trigger.answers_with(b"", b'R', BOOT, stopped)?
            && !trigger.answers_with(b"S", b'S', PRESENCE, stopped)?
        {
            return Err(trigger.silence_error());
        }
        trigger.ensure_length()?;
        Ok(trigger)
    }

    /// True if it answers with `letter` in time.
    fn answers_with(
        &mut self,
        request: &[u8],
        letter: u8,
        timeout: Duration,
        stopped: fn() -> bool,
    ) -> Result<bool> {
        let began = Instant::now();
        while began.elapsed() < timeout {
            if stopped() {
                return Err(self.line.error("stopped before it answered"));
            }
            if self.ask(request, letter, ANSWER)?.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Repeats a request until it is answered: a hanging controller is reset by its watchdog, and
    /// its bootloader swallows requests.
    fn ask(
        &mut self,
        request: &[u8],
        letter: u8,
        timeout: Duration,
    ) -> Result<Option<ControllerAnswer>> {
        let end = Instant::now() + timeout;
        while Instant::now() < end {
            self.line.send(request)?;
            let deadline = end.min(Instant::now() + ANSWER);
            while let Some(answer) = self.line.next(deadline)? {
                self.apply(answer)?;
                match answer.letter {
                    found if found == letter => return Ok(Some(answer)),
                    // A reset: requests from before it are lost.
                    b'R' => break,
                    _ => {}
                }
            }
        }
        Ok(None)
    }

    /// Sets the pulse length after a reset.
    fn ensure_length(&mut self) -> Result<()> {
        if self.length_is_set {
            return Ok(());
        }
        let length_us = self.length.as_micros() as u32;
        let answer = self.ask(format!("L{length_us}\n").as_bytes(), b'L', BOOT)?;
        let Some(ControllerAnswer { first: set_us, .. }) = answer else {
            return Err(self.silence_error());
        };
        if set_us != length_us {
            return Err(self.line.error(format!(
                "set a pulse length of {set_us} µs instead of {length_us} µs"
            )));
        }
        self.length_is_set = true;
        Ok(())
    }

    /// Requests a pulse once, and returns once it is certain if the lines rose.
    fn request(&mut self) -> Result<()> {
        let before = self.pulses;
        self.line.send(b"T")?;
        let deadline = Instant::now() + ANSWER;
        let mut refused = false;
        while let Some(answer) = self.line.next(deadline)? {
            self.apply(answer)?;
            if self.pulses > before {
                return Ok(());
            }
            refused |= answer.letter == b'B';
            if refused || answer.letter == b'R' {
                break;
            }
        }
        // The controller answers the status last. So once that arrives, the answer to the request
        // has arrived or is lost, and the count tells if there was a pulse.
        if self.ask(b"S", b'S', BOOT)?.is_none() {
            return Err(self.silence_error());
        }
        if refused {
            // Busy: noise on the line caused a pulse of its own, which has to end first.
            std::thread::sleep(self.length);
        } else if self.length_is_set {
            self.line.troubles.add(
                if self.pulses > before {
                    Trouble::Answer
                } else {
                    Trouble::Request
                },
                1,
            );
        }
        self.ensure_length()
    }

    /// Applies an answer to the counts.
    fn apply(&mut self, answer: ControllerAnswer) -> Result<()> {
        let (first, second) = (answer.first, answer.second);
        match answer.letter {
            // A late answer, or a reset whose announcement was lost: the status decides.
            b'P' if self.is_behind(first) => {}
            b'P' | b'S' => self.set_count(first),
            b'R' if second != VERSION => {
                let reason = format!(
                    "speaks version {second} of the protocol, svl {VERSION}; flash firmware/"
                );
                return Err(self.line.error(reason));
            }
            b'R' => self.was_reset(),
            b'O' => self.line.troubles.add(Trouble::Overrun, first.into()),
            b'F' => self.line.troubles.add(Trouble::Framing, first.into()),
            b'U' => self.line.troubles.add(Trouble::Unknown, first.into()),
            _ => {}
        }
        Ok(())
    }

    /// Adopts the controller's count.
    fn set_count(&mut self, count: u32) {
        if self.is_behind(count) {
            self.was_reset();
        }
        let further = count.wrapping_sub(self.count);
        if further > 0 {
            self.pulses += u64::from(further);
            self.last = Some(Instant::now());
        }
        self.count = count;
    }

    fn is_behind(&self, count: u32) -> bool {
        count < self.count && count.wrapping_sub(self.count) > WRAP
    }

    /// After a reset the count starts at 0 and the pulse length is the default.
    fn was_reset(&mut self) {
        if self.pulses > 0 {
            self.line
                .warn(&format!("was reset after {}", counted(self.count, "pulse")));
        }
        (self.count, self.length_is_set) = (0, false);
    }

    fn silence_error(&self) -> Error {
        self.line.error(match (self.line.heard, self.line.strange) {
            (true, _) => {
                format!(
                    "stopped answering after {}; check its supply and its cable",
                    counted(self.pulses, "pulse")
                )
            }
            (false, 0) => "does not answer; is it the trigger controller, and flashed?".to_owned(),
            (false, n) => {
                format!(
                    "sent {}, none of them a trigger controller's; is it one, and flashed?",
                    counted(n, "line")
                )
            }
        })
    }
}

impl Trigger for SerialTrigger {
    fn pulse(&mut self) -> Result<Pulse> {
        // Before the end of the last pulse a request would be refused.
        if let Some(last) = self.last {
            std::thread::sleep(self.length.saturating_sub(last.elapsed()));
        }
        // Answers to stray pulses and resets still in the buffer must not be mistaken for the
        // answer to the next request.
        while let Some(answer) = self.line.next(Instant::now())? {
            self.apply(answer)?;
        }
        self.ensure_length()?;
        let before = self.pulses;
        for _ in 0..ATTEMPTS {
            let stamp_ns = self.clock.now_ns();
            self.request()?;
            if self.pulses > before {
                return Ok(Pulse {
                    id: self.pulses,
                    stamp_ns,
                });
            }
        }
        Err(self.line.error(format!(
            "gave no pulse in {}; check its cable",
            counted(ATTEMPTS, "attempt")
        )))
    }
}
