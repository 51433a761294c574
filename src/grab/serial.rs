//! The trigger controller at the end of a serial line. Its protocol is told in firmware/README.md.

use super::clock::Clock;
use super::trigger::{Pulse, Trigger};
use crate::error::{Error, Result};
use serial2::SerialPort;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

const BAUD: u32 = 500_000;
const VERSION: u32 = 1;
/// A board that was reset by opening its port may be in its bootloader so long.
const BOOT: Duration = Duration::from_secs(3);
/// Within this a request for a pulse is answered; what nobody waits for with armed cameras may take longer.
const PULSE: Duration = Duration::from_millis(100);
const ANSWER: Duration = Duration::from_secs(1);
/// Requests for one pulse, after which there is no use in another.
const ATTEMPTS: u32 = 3;
/// Pulse lengths that the controller takes.
const SHORTEST: Duration = Duration::from_micros(100);
const LONGEST: Duration = Duration::from_micros(20_000);
/// Longer than any answer.
const LINE: usize = 64;

/// A controller that gives pulses.
pub struct SerialTrigger {
    name: String,
    port: SerialPort,
    clock: Arc<Clock>,
    received: Vec<u8>,
    length: Duration,
    last: Option<Instant>,
    /// The controller's count of pulses, and what it had counted before it was reset.
    pulses: u32,
    before: u64,
}

/// A line from the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Answer {
    letter: u8,
    first: u32,
    second: u32,
}

impl SerialTrigger {
    /// Opens the controller at `device`, whose pulses are to fit into a period.
    ///
    /// # Errors
    /// [`Error::Camera`] when there is none, or not one that this svl understands.
    pub fn open(device: &Path, period_ns: u64, clock: &Arc<Clock>) -> Result<Self> {
        let port = SerialPort::open(device, BAUD).map_err(|e| {
            Error::camera(
                device.display().to_string(),
                format!("cannot be opened: {e}; check the name and who may use it"),
            )
        })?;
        Self::on(port, &device.display().to_string(), period_ns, clock)
    }

    /// Begins to talk with the controller on an open port.
    ///
    /// # Errors
    /// As [`SerialTrigger::open`].
    pub fn on(port: SerialPort, name: &str, period_ns: u64, clock: &Arc<Clock>) -> Result<Self> {
        let length = Duration::from_nanos(period_ns / 2).clamp(SHORTEST, LONGEST);
        let (name, clock) = (name.to_owned(), clock.clone());
        let mut trigger = Self { name, port, clock, received: Vec::new(), length, last: None, pulses: 0, before: 0 };
        match trigger.answer(b'R', BOOT)? {
            Some(reset) if reset.second != VERSION => {
                let reason = format!("speaks version {} of the protocol, svl {VERSION}; flash firmware/", reset.second);
                return Err(trigger.error(reason));
            }
            Some(_) => {}
            // It was not reset by opening its port.
            None => trigger.pulses = trigger.status()?,
        }
        trigger.set_length()?;
        Ok(trigger)
    }

    fn set_length(&mut self) -> Result<()> {
        let length_us = self.length.as_micros() as u32;
        self.send(format!("L{length_us}\n").as_bytes())?;
        match self.answer(b'L', ANSWER)? {
            Some(Answer { first, .. }) if first == length_us => Ok(()),
            Some(Answer { first, .. }) => {
                Err(self.error(format!("gives pulses of {first} µs instead of {length_us} µs")))
            }
            None => Err(self.error("does not answer; check its cable")),
        }
    }

    /// How many pulses it has given.
    fn status(&mut self) -> Result<u32> {
        self.send(b"S")?;
        let status = self.answer(b'S', ANSWER)?;
        status.map(|s| s.first).ok_or_else(|| self.error("does not answer; is it the trigger controller, and flashed?"))
    }

    /// Asks for a pulse once. Nothing when none was given.
    fn request(&mut self) -> Result<Option<Pulse>> {
        let stamp_ns = self.clock.now_ns();
        self.send(b"T")?;
        let deadline = Instant::now() + PULSE;
        while let Some(answer) = self.next_answer(deadline)? {
            match answer.letter {
                // Else it is late, and the count told of it before.
                b'P' if answer.first != self.pulses => return Ok(Some(self.given(answer.first, stamp_ns))),
                b'B' => {
                    std::thread::sleep(self.length);
                    return Ok(None);
                }
                b'R' => {
                    self.was_reset();
                    self.set_length()?;
                    return Ok(None);
                }
                b'O' | b'F' | b'U' => {
                    tracing::warn!("{}: trouble on the line ({})", self.name, char::from(answer.letter));
                }
                _ => {}
            }
        }
        // Request or answer was lost: the count tells which.
        let pulses = self.status()?;
        if pulses < self.pulses {
            self.was_reset();
            self.set_length()?;
        }
        Ok((pulses != self.pulses).then(|| self.given(pulses, stamp_ns)))
    }

    fn given(&mut self, pulses: u32, stamp_ns: u64) -> Pulse {
        if pulses < self.pulses {
            self.was_reset();
        }
        self.pulses = pulses;
        self.last = Some(Instant::now());
        Pulse { id: self.before + u64::from(pulses), stamp_ns }
    }

    /// It counts from 1 again; the numbers of svl's pulses go on.
    fn was_reset(&mut self) {
        tracing::warn!("{}: was reset after {} pulses", self.name, self.pulses);
        self.before += u64::from(std::mem::take(&mut self.pulses));
    }

    /// The next answer of a kind; others are passed over.
    fn answer(&mut self, letter: u8, patience: Duration) -> Result<Option<Answer>> {
        let deadline = Instant::now() + patience;
        loop {
            match self.next_answer(deadline)? {
                Some(answer) if answer.letter != letter => {}
                found => return Ok(found),
            }
        }
    }

    /// The next answer that is whole. What is cut off or garbled is passed over.
    fn next_answer(&mut self, deadline: Instant) -> Result<Option<Answer>> {
        loop {
            while let Some(end) = self.received.iter().position(|&byte| byte == b'\n') {
                let line: Vec<u8> = self.received.drain(..=end).collect();
                match Answer::parse(&line[..end]) {
                    None if end > 0 => tracing::warn!("{}: said what is no answer", self.name),
                    None => {}
                    answer => return Ok(answer),
                }
            }
            if self.received.len() > LINE {
                self.received.clear();
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            let mut bytes = [0; LINE];
            let read = self.port.set_read_timeout(left).and_then(|()| self.port.read(&mut bytes));
            match read {
                Ok(0) => return Err(self.error("is gone; plug it in and record again")),
                Ok(count) => self.received.extend_from_slice(&bytes[..count]),
                Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock) => {}
                Err(e) => return Err(self.error(format!("cannot be read: {e}"))),
            }
        }
    }

    fn send(&mut self, bytes: &[u8]) -> Result<()> {
        self.port.write_all(bytes).map_err(|e| self.error(format!("cannot be written: {e}")))
    }

    fn error(&self, reason: impl Into<String>) -> Error {
        Error::camera(format!("trigger {}", self.name), reason)
    }
}

impl Trigger for SerialTrigger {
    fn fire(&mut self) -> Result<Pulse> {
        for _ in 0..ATTEMPTS {
            // A request while a pulse is up is refused.
            let rest = self.last.map_or(Duration::ZERO, |last| self.length.saturating_sub(last.elapsed()));
            std::thread::sleep(rest);
            if let Some(pulse) = self.request()? {
                return Ok(pulse);
            }
        }
        Err(self.error(format!("gave no pulse in {ATTEMPTS} attempts; check its cable")))
    }
}

impl Answer {
    /// `<letter> <number> <number> <crc>`.
    fn parse(line: &[u8]) -> Option<Self> {
        let line = std::str::from_utf8(line).ok()?;
        let (said, crc) = line.rsplit_once(' ')?;
        if crc.len() != 2 || u8::from_str_radix(crc, 16).ok()? != crc8(said.as_bytes()) {
            return None;
        }
        let mut words = said.split(' ');
        let &[letter] = words.next()?.as_bytes() else { return None };
        let answer = Self { letter, first: words.next()?.parse().ok()?, second: words.next()?.parse().ok()? };
        words.next().is_none().then_some(answer)
    }
}

/// Polynomial 0x07, initially 0, nothing reflected or inverted.
fn crc8(bytes: &[u8]) -> u8 {
    let shift = |crc: u8, _| if crc & 0x80 == 0 { crc << 1 } else { crc << 1 ^ 0x07 };
    bytes.iter().fold(0, |crc, byte| (0..8).fold(crc ^ byte, shift))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn answers_are_what_the_readme_says() {
        assert_eq!(crc8(b"123456789"), 0xf4);
        assert_eq!(Answer::parse(b"P 1 49480 3a"), Some(Answer { letter: b'P', first: 1, second: 49480 }));
        for wrong in ["", "P", "P 1 49480 3b", "P 2 49480 3a", " 1 49480 3a", "P 1 49480 +a", "PP 1 49480 3a"] {
            assert_eq!(Answer::parse(wrong.as_bytes()), None, "{wrong}");
        }
    }

    /// A controller that does with the n-th request for a pulse what `script` says, and gives pulses after that.
    fn controller(script: &'static [&'static str]) -> Result<SerialTrigger> {
        let (ours, theirs) = SerialPort::pair().unwrap();
        std::thread::spawn(move || {
            let (mut pulses, mut script) = (0, script.iter());
            let say = |text: String| theirs.write_all(format!("{text} {:02x}\n", crc8(text.as_bytes())).as_bytes());
            say("R 1 1".into()).unwrap();
            let (mut byte, mut length) = ([0], Vec::new());
            while theirs.read(&mut byte).is_ok_and(|count| count == 1) {
                let answered = match byte[0] {
                    b'T' => match *script.next().unwrap_or(&"pulse") {
                        "pulse" => (pulses += 1, say(format!("P {pulses} 77"))).1,
                        "lost answer" => (pulses += 1, Ok(())).1,
                        "garbled" => (pulses += 1, theirs.write_all(b"P 1 7\xff 00\n")).1,
                        "lost request" => Ok(()),
                        "busy" => say(format!("B 1 {pulses}")),
                        "noise" => (pulses += 1, say("F 1 0".into()).and(say(format!("P {pulses} 77")))).1,
                        "reset" => (pulses = 0, say("R 8 1".into())).1,
                        other => panic!("{other}"),
                    },
                    b'S' => say(format!("S {pulses} 78")),
                    b'\n' => {
                        let us = std::mem::take(&mut length).into_iter().map(char::from).collect::<String>();
                        say(format!("L {us} {us}"))
                    }
                    b'L' => Ok(()),
                    digit => (length.push(digit), Ok(())).1,
                };
                answered.unwrap();
            }
        });
        SerialTrigger::on(ours, "pty", 200_000, &Clock::real())
    }

    fn ids(script: &'static [&'static str], count: usize) -> Vec<u64> {
        let mut trigger = controller(script).unwrap();
        (0..count).map(|_| trigger.fire().unwrap().id).collect()
    }

    #[test]
    fn every_pulse_is_known_whatever_happens_on_the_line() {
        assert_eq!(ids(&[], 3), [1, 2, 3]);
        assert_eq!(ids(&["pulse", "busy", "pulse"], 2), [1, 2]);
        assert_eq!(ids(&["pulse", "lost request", "pulse"], 3), [1, 2, 3]);
        assert_eq!(ids(&["pulse", "lost answer", "pulse"], 3), [1, 2, 3]);
        assert_eq!(ids(&["pulse", "garbled", "noise"], 3), [1, 2, 3]);
        assert_eq!(ids(&["pulse", "pulse", "reset", "pulse"], 4), [1, 2, 3, 4], "numbers go on after a reset");
    }

    #[test]
    fn a_controller_that_gives_no_pulse_is_named() {
        let error = controller(&["busy"; 3]).unwrap().fire().unwrap_err().to_string();
        assert_eq!(error, "trigger pty: gave no pulse in 3 attempts; check its cable");
        let error =
            SerialTrigger::open(Path::new("/dev/nowhere"), 1, &Clock::real()).map(drop).unwrap_err().to_string();
        assert!(error.starts_with("/dev/nowhere: cannot be opened"), "{error}");
    }
}
