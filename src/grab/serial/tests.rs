//! Tests of the trigger controller on a scripted peer.

use super::*;
use answer::crc8;
use std::thread;

/// A controller that handles the n-th request for a pulse according to `script`, and sends a pulse
/// for every later one.
struct Fake {
    port: SerialPort,
    pulses: u32,
    length: String,
}

impl Fake {
    /// Opened after a reset or, if it has sent pulses, without one.
    fn open(script: &'static [&'static str], pulses: u32) -> Result<SerialTrigger> {
        opened_on(
            || false,
            move |port| {
                let mut fake = Self {
                    port,
                    pulses,
                    length: String::new(),
                };
                if pulses == 0 {
                    fake.say("R 1 1");
                }
                let mut script = script.iter();
                while let Some(byte) = fake.hear() {
                    match byte {
                        b'T' => match *script.next().unwrap_or(&"pulse") {
                            "unplugged" => return,
                            "unplugged after a pulse" => {
                                fake.pulse();
                                // Not before it was read.
                                thread::sleep(Duration::from_millis(50));
                                return;
                            }
                            request => {
                                assert_eq!(fake.length, "100", "after a reset it has none");
                                fake.requested(request);
                            }
                        },
                        other => fake.other(other),
                    }
                }
            },
        )
    }

    fn hear(&mut self) -> Option<u8> {
        let mut byte = [0];
        self.port
            .read(&mut byte)
            .is_ok_and(|count| count == 1)
            .then_some(byte[0])
    }

    fn say(&mut self, text: &str) {
        self.port
            .write_all(format!("{text} {:02x}\n", crc8(text.as_bytes())).as_bytes())
            .unwrap();
    }

    fn pulse(&mut self) {
        self.pulses = self.pulses.wrapping_add(1);
        self.say(&format!("P {} 77", self.pulses));
    }

    fn forget(&mut self) {
        self.pulses = 0;
        self.length.clear();
    }

    fn reset(&mut self) {
        self.forget();
        self.say("R 8 1");
    }

    fn other(&mut self, byte: u8) {
        match byte {
            b'S' => self.say(&format!("S {} 78", self.pulses)),
            b'L' => self.length.clear(),
            b'\n' => self.say(&format!("L {0} {0}", self.length)),
            digit => self.length.push(char::from(digit)),
        }
    }

    fn requested(&mut self, what: &str) {
        match what {
            "pulse" => self.pulse(),
            "lost request" => {}
            "lost answer" => self.pulses = self.pulses.wrapping_add(1),
            "garbled" => {
                self.pulses += 1;
                self.port.write_all(b"P 1 7\xff 00\n").unwrap();
            }
            "late" => {
                thread::sleep(ANSWER + Duration::from_millis(20));
                self.pulse();
            }
            "busy" => self.say(&format!("B 1 {}", self.pulses)),
            "trouble" => {
                for said in ["F 1 0", "O 2 1", "U 1 65"] {
                    self.say(said);
                }
                self.pulse();
            }
            // Noise on the line is mistaken for another request: later, at once, and before a
            // reset.
            "pulse, stray" => {
                self.pulse();
                self.pulse();
            }
            "pulse, stray, reset" => {
                self.requested("pulse, stray");
                self.reset();
            }
            "pulse, busy" => {
                self.pulse();
                self.requested("busy");
            }
            "busy, pulse" => {
                self.requested("busy");
                self.pulse();
            }
            "reset" => self.reset(),
            "reset, pulse" => {
                self.reset();
                self.pulse();
            }
            "silent reset, pulse" => {
                self.forget();
                self.pulse();
            }
            // Until its watchdog resets it.
            "hang" => {
                self.requested("deaf");
                self.reset();
            }
            // The status request is lost too.
            "deaf" => while self.hear() != Some(b'S') {},
            "dead" => while self.hear().is_some() {},
            other => panic!("{other}"),
        }
    }
}

/// Result of opening the port whose other end is `peer`.
fn opened_on(
    stopped: fn() -> bool,
    peer: impl FnOnce(SerialPort) + Send + 'static,
) -> Result<SerialTrigger> {
    let (mut theirs, ours) = SerialPort::pair().unwrap();
    theirs.set_read_timeout(Duration::from_secs(60)).unwrap();
    thread::spawn(move || peer(theirs));
    SerialTrigger::on(ours, "pty", 200_000, &GrabClock::real(), stopped)
}

fn ids(script: &'static [&'static str], count: usize) -> Vec<u64> {
    let mut trigger = Fake::open(script, 0).unwrap();
    (0..count).map(|_| trigger.pulse().unwrap().id).collect()
}

/// Lost requests, lost answers, garbled lines, overruns, framing errors, unknown bytes.
fn troubles(script: &'static [&'static str]) -> [u64; 6] {
    let mut trigger = Fake::open(script, 0).unwrap();
    for _ in 0..=script.len() {
        trigger.pulse().unwrap();
    }
    trigger.line.troubles.counts
}

fn failure(script: &'static [&'static str]) -> String {
    let mut trigger = Fake::open(script, 0).unwrap();
    loop {
        if let Err(error) = trigger.pulse() {
            return error.to_string();
        }
    }
}

#[test]
fn every_pulse_is_known_whatever_happens_on_the_line() {
    assert_eq!(ids(&[], 3), [1, 2, 3]);
    assert_eq!(ids(&["pulse", "busy", "pulse"], 2), [1, 2]);
    assert_eq!(ids(&["pulse", "lost request", "pulse"], 3), [1, 2, 3]);
    assert_eq!(ids(&["pulse", "lost answer", "pulse"], 3), [1, 2, 3]);
    assert_eq!(ids(&["pulse", "garbled", "trouble"], 3), [1, 2, 3]);
    assert_eq!(ids(&["pulse", "deaf", "pulse"], 3), [1, 2, 3]);
    assert_eq!(ids(&["late", "lost request", "pulse"], 3), [1, 2, 3]);
}

#[test]
fn stray_pulses_are_counted_and_taken_for_no_others() {
    assert_eq!(
        ids(&["pulse, stray", "lost request", "pulse"], 3),
        [1, 3, 4]
    );
    assert_eq!(ids(&["pulse, busy", "pulse"], 3), [1, 2, 3]);
    assert_eq!(
        ids(&["busy, pulse", "pulse"], 3),
        [1, 2, 3],
        "refused was an earlier one"
    );
    assert_eq!(ids(&["pulse, stray, reset", "pulse"], 3), [1, 3, 4]);
}

#[test]
fn trouble_on_the_line_is_counted() {
    let [requests, answers, others @ ..] = troubles(&[
        "lost request",
        "lost answer",
        "lost answer",
        "garbled",
        "trouble",
    ]);
    // A machine that is slow loses more answers.
    assert!(requests >= 1 && answers >= 3, "{requests}, {answers}");
    assert_eq!(others, [1, 2, 1, 1]);
}

#[test]
fn numbers_go_on_after_a_reset() {
    assert_eq!(ids(&["pulse", "pulse", "reset", "pulse"], 4), [1, 2, 3, 4]);
    assert_eq!(
        ids(&["pulse", "pulse", "hang", "hang", "pulse"], 4),
        [1, 2, 3, 4]
    );
    assert_eq!(
        ids(&["pulse", "reset, pulse", "pulse"], 4),
        [1, 2, 3, 4],
        "the reset was before the request"
    );
    assert_eq!(
        ids(&["pulse", "pulse", "silent reset, pulse"], 4),
        [1, 2, 3, 4],
        "its announcement was lost"
    );
}

#[test]
fn numbers_go_on_beyond_32_bits() {
    let mut trigger = Fake::open(&["pulse", "pulse, stray"], u32::MAX - 1).unwrap();
    let end = u64::from(u32::MAX);
    assert_eq!(
        [(); 4].map(|()| trigger.pulse().unwrap().id),
        [end, end + 1, end + 3, end + 4]
    );
}

#[test]
fn lines_that_have_come_are_read_without_waiting() {
    let (theirs, ours) = SerialPort::pair().unwrap();
    let mut line = SerialLine::new(ours, "pty");
    assert_eq!(line.next(Instant::now()).unwrap(), None);
    theirs.write_all(b"P 1 49480 3a\n").unwrap();
    let began = Instant::now();
    while line.next(Instant::now()).unwrap().is_none() {
        assert!(began.elapsed() < Duration::from_secs(30), "it never came");
    }
    drop(theirs);
    let gone = "trigger pty: is gone; plug it in and record again";
    assert_eq!(line.send(b"T").unwrap_err().to_string(), gone);
    assert_eq!(line.next(Instant::now()).unwrap_err().to_string(), gone);
}

#[test]
fn a_controller_that_fails_is_named_with_the_cure() {
    assert_eq!(
        failure(&["busy"; 3]),
        "trigger pty: gave no pulse in 3 attempts; check its cable"
    );
    let gone = "trigger pty: is gone; plug it in and record again";
    assert_eq!(failure(&["pulse", "unplugged"]), gone);
    assert_eq!(failure(&["unplugged after a pulse"]), gone);
    let dead = "trigger pty: stopped answering after 2 pulses; check its supply and its cable";
    assert_eq!(failure(&["pulse", "pulse", "dead"]), dead);
}

/// Stays silent until the other end is closed.
fn listen(port: &SerialPort) {
    while port.read(&mut [0]).is_ok_and(|count| count > 0) {}
}

/// The reason why the device at the other end is rejected.
fn refused(peer: fn(&SerialPort)) -> String {
    let opened = opened_on(
        || false,
        move |port| {
            peer(&port);
            listen(&port);
        },
    );
    opened.map(drop).unwrap_err().to_string()
}

#[test]
fn silent_devices_are_refused() {
    assert_eq!(
        refused(|_| ()),
        "trigger pty: does not answer; is it the trigger controller, and flashed?"
    );
}

#[test]
fn devices_that_say_other_things_are_refused() {
    const POSITION: &[u8] =
        b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n";
    let error = refused(|port| (0..7).for_each(|_| port.write_all(POSITION).unwrap()));
    assert_eq!(
        error,
        "trigger pty: sent 7 lines, none of them a trigger controller's; is it one, and flashed?"
    );
    let error = refused(|port| port.write_all(b"R 2 2 f7\n").unwrap());
    assert_eq!(
        error,
        "trigger pty: speaks version 2 of the protocol, svl 1; flash firmware/"
    );
}

#[test]
fn opening_ends_when_stopped() {
    let error = opened_on(|| true, |port| listen(&port))
        .map(drop)
        .unwrap_err()
        .to_string();
    assert_eq!(error, "trigger pty: stopped before it answered");
}
