//! The trigger controller at the end of a serial line. Its protocol is told in firmware/README.md.

mod answer;
mod line;
mod port;
#[cfg(all(test, unix))]
mod tests;
mod trouble;

use super::clock::Clock;
use super::trigger::{Pulse, Trigger};
use crate::counted;
use crate::error::{Error, Result};
use answer::Answer;
use line::Line;
use serial2::SerialPort;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use trouble::Trouble;

const VERSION: u32 = 1;
/// A board that was reset may be in its bootloader so long.
const BOOT: Duration = Duration::from_secs(3);
/// One that was not, and hears for the first time, answers within this.
const PRESENCE: Duration = Duration::from_secs(1);
/// After this a request or its answer was lost.
const ANSWER: Duration = Duration::from_millis(100);
/// Requests for one pulse, after which there is no use in another.
const ATTEMPTS: u32 = 3;
/// Pulse lengths that the controller takes.
const SHORTEST: Duration = Duration::from_micros(100);
const LONGEST: Duration = Duration::from_micros(20_000);
/// A count lower than the one before, with at most so many pulses between, went past its 32 bits.
/// Else it began anew.
const WRAP: u32 = 1 << 16;

/// A controller that gives pulses.
pub struct SerialTrigger {
    line: Line,
    clock: Arc<Clock>,
    length: Duration,
    /// Whether the controller has it: after a reset it has not.
    length_is_set: bool,
    /// When the last pulse was heard of.
    last: Option<Instant>,
    /// The controller's count of pulses, 32 bits since its reset.
    count: u32,
    /// The pulses of all its counts: a number comes once.
    pulses: u64,
}

impl SerialTrigger {
    /// Opens the controller at `device`, whose pulses are to fit into a period. `stopped`: asked
    /// while it is waited for, whether to give up.
    ///
    /// # Errors
    /// [`Error::Camera`] when there is none, or not one that this svl understands, and when
    /// `stopped`.
    pub fn open(
        device: &Path,
        period_ns: u64,
        clock: &Arc<Clock>,
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

    /// Begins to talk with the controller on an open port.
    fn on(
        port: SerialPort,
        name: &str,
        period_ns: u64,
        clock: &Arc<Clock>,
        stopped: fn() -> bool,
    ) -> Result<Self> {
        let length = Duration::from_nanos(period_ns / 2).clamp(SHORTEST, LONGEST);
        let (line, clock) = (Line::new(port, name), clock.clone());
        let mut trigger = Self {
            line,
            clock,
            length,
            length_is_set: false,
            last: None,
            count: 0,
            pulses: 0,
        };
        // Opening its port resets it, or does not.
        if !trigger.is_there(b"", b'R', BOOT, stopped)?
            && !trigger.is_there(b"S", b'S', PRESENCE, stopped)?
        {
            return Err(trigger.silent());
        }
        trigger.ensure_length()?;
        Ok(trigger)
    }

    /// Whether it answers so for the first time.
    fn is_there(
        &mut self,
        request: &[u8],
        letter: u8,
        patience: Duration,
        stopped: fn() -> bool,
    ) -> Result<bool> {
        let began = Instant::now();
        while began.elapsed() < patience {
            if stopped() {
                return Err(self.line.error("stopped before it answered"));
            }
            if self.ask(request, letter, ANSWER)?.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Asks until it answers: one that hangs is reset by its watchdog, and hears nothing before its
    /// bootloader ends.
    fn ask(&mut self, request: &[u8], letter: u8, patience: Duration) -> Result<Option<Answer>> {
        let end = Instant::now() + patience;
        while Instant::now() < end {
            self.line.send(request)?;
            let deadline = end.min(Instant::now() + ANSWER);
            while let Some(answer) = self.line.next(deadline)? {
                self.hear(answer)?;
                match answer.letter {
                    found if found == letter => return Ok(Some(answer)),
                    // What was sent before is lost.
                    b'R' => break,
                    _ => {}
                }
            }
        }
        Ok(None)
    }

    /// Sets the pulse length, where a reset has undone it.
    fn ensure_length(&mut self) -> Result<()> {
        if self.length_is_set {
            return Ok(());
        }
        let length_us = self.length.as_micros() as u32;
        let answer = self.ask(format!("L{length_us}\n").as_bytes(), b'L', BOOT)?;
        let Some(Answer { first: set_us, .. }) = answer else {
            return Err(self.silent());
        };
        if set_us != length_us {
            return Err(self.line.error(format!(
                "gives pulses of {set_us} µs instead of {length_us} µs"
            )));
        }
        self.length_is_set = true;
        Ok(())
    }

    /// Asks for a pulse once, and goes on until it is known whether it was given.
    fn request(&mut self) -> Result<()> {
        let before = self.pulses;
        self.line.send(b"T")?;
        let deadline = Instant::now() + ANSWER;
        let mut refused = false;
        while let Some(answer) = self.line.next(deadline)? {
            self.hear(answer)?;
            if self.pulses > before {
                return Ok(());
            }
            refused |= answer.letter == b'B';
            if refused || answer.letter == b'R' {
                break;
            }
        }
        // The status is answered last: then the answer has come, or was lost, or this one was to an
        // earlier request.
        if self.ask(b"S", b'S', BOOT)?.is_none() {
            return Err(self.silent());
        }
        if refused {
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

    /// Takes notice of what was said.
    fn hear(&mut self, answer: Answer) -> Result<()> {
        let Answer {
            letter,
            first,
            second,
        } = answer;
        match letter {
            // Late, or what told of a reset was lost: the status will tell.
            b'P' if self.is_behind(first) => {}
            b'P' | b'S' => self.reach(first),
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

    /// It has counted so far.
    fn reach(&mut self, count: u32) {
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

    /// It counts from 1 again, and has forgotten the pulse length.
    fn was_reset(&mut self) {
        if self.pulses > 0 {
            self.line
                .warn(&format!("was reset after {}", counted(self.count, "pulse")));
        }
        (self.count, self.length_is_set) = (0, false);
    }

    /// Waits until the last pulse is over: a request before would be refused.
    fn rest(&self) {
        std::thread::sleep(self.last.map_or(Duration::ZERO, |last| {
            self.length.saturating_sub(last.elapsed())
        }));
    }

    fn silent(&self) -> Error {
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
                    "said {}, none of them a trigger controller's; is it one, and flashed?",
                    counted(n, "line")
                )
            }
        })
    }
}

impl Trigger for SerialTrigger {
    fn pulse(&mut self) -> Result<Pulse> {
        self.rest();
        // Pulses that nobody asked for, and resets: their answers must not be taken for those to
        // come.
        while let Some(answer) = self.line.next(Instant::now())? {
            self.hear(answer)?;
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
