//! A child process that matches pairs. Threads write to it and read from it, so that it can neither
//! block svl nor be blocked by a full pipe of its standard error.

use super::protocol::{Question, Reply, one_line, read_reply};
use crate::error::Error;
use std::collections::VecDeque;
use std::io::{BufReader, ErrorKind, Read, Write};
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How much of its standard error is kept, in bytes.
const STDERR_KEPT: usize = 4096;

/// How long a program that closed its output may take to end and to close its standard error.
const GRACE: Duration = Duration::from_millis(300);

/// A failure of the program, in words that follow its name.
#[derive(Debug)]
pub(super) struct ProgramFailure {
    reason: String,
    stderr: String,
}

impl ProgramFailure {
    pub(super) fn new(reason: impl Into<String>) -> Self {
        Self {
            reason: reason.into(),
            stderr: String::new(),
        }
    }

    /// The error of that command.
    pub(super) fn into_error(self, command: &str) -> Error {
        Error::Program {
            command: command.to_owned(),
            reason: self.reason,
            stderr: self.stderr,
        }
    }
}

enum ProgramEvent {
    Answered(Result<Reply, String>),
    /// The program does not take what is written to it.
    Refused(std::io::Error),
}

/// A running program. Dropping it ends it.
pub(super) struct Program {
    child: Child,
    requests: Sender<Vec<u8>>,
    questions: Sender<Question>,
    events: Receiver<ProgramEvent>,
    /// Bytes of the answer under way.
    received: Arc<AtomicUsize>,
    stderr_tail: Arc<Mutex<VecDeque<u8>>>,
    stderr_closed: Receiver<()>,
}

impl Program {
    /// The most memory that it has had, bytes, where the system tells.
    pub(super) fn memory(&self) -> Option<usize> {
        let status = format!("/proc/{}/status", self.child.id());
        let status = std::fs::read_to_string(status).ok()?;
        let peak = status
            .lines()
            .find_map(|line| line.strip_prefix("VmHWM:"))?;
        let kilobytes: usize = peak.trim().strip_suffix("kB")?.trim().parse().ok()?;
        Some(kilobytes << 10)
    }

    /// Starts the program `words[0]`.
    pub(super) fn start(words: &[String]) -> Result<Self, ProgramFailure> {
        let mut command = Command::new(&words[0]);
        command
            .args(&words[1..])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // Ctrl-C is svl's: it ends the run orderly, and the program with it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|error| {
            let why = match error.kind() {
                ErrorKind::NotFound => "no such program; check its name and the PATH".to_owned(),
                _ => error.to_string(),
            };
            ProgramFailure::new(format!("cannot be started: {why}"))
        })?;
        let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        // All three were asked for above.
        let (Some(stdin), Some(stdout), Some(stderr)) = pipes else {
            unreachable!("pipes")
        };
        let (requests, to_write) = channel();
        let (questions, to_read) = channel();
        let (event, events) = channel();
        let (open, stderr_closed) = channel();
        let received = Arc::new(AtomicUsize::new(0));
        let stderr_tail = Arc::new(Mutex::new(VecDeque::with_capacity(STDERR_KEPT)));
        let stdout = Counted {
            from: stdout,
            count: Arc::clone(&received),
        };
        let (writing, kept) = (event.clone(), Arc::clone(&stderr_tail));
        // The threads end with the pipes or with the channels, whichever closes first.
        thread::spawn(move || write(stdin, &to_write, &writing));
        thread::spawn(move || read(stdout, &to_read, &event));
        thread::spawn(move || keep_stderr(stderr, &kept, open));
        Ok(Self {
            child,
            requests,
            questions,
            events,
            received,
            stderr_tail,
            stderr_closed,
        })
    }

    /// Sends a request and waits for its answer.
    pub(super) fn ask(
        &mut self,
        request: Vec<u8>,
        question: Question,
        timeout: Duration,
    ) -> Result<Reply, ProgramFailure> {
        self.received.store(0, Ordering::Relaxed);
        // A thread that is gone has left an event, which says more.
        let _ = self.questions.send(question);
        let _ = self.requests.send(request);
        let size = question.size;
        match self.events.recv_timeout(timeout) {
            Ok(ProgramEvent::Answered(Ok(reply))) => Ok(reply),
            Ok(ProgramEvent::Answered(Err(reason))) => Err(self.failed(reason)),
            Ok(ProgramEvent::Refused(error)) => {
                Err(self.failed(format!("does not read its input: {error}")))
            }
            Err(RecvTimeoutError::Timeout) => {
                let received = match self.received.load(Ordering::Relaxed) {
                    0 => "nothing received".to_owned(),
                    bytes => format!(
                        "{bytes} bytes received, its line and {} expected",
                        size.0 * size.1 * 4
                    ),
                };
                let reason = format!("timed out after {timeout:?}: {received}");
                Err(ProgramFailure {
                    reason,
                    stderr: self.stderr_end(),
                })
            }
            Err(RecvTimeoutError::Disconnected) => {
                Err(self.failed("closed its input and output".to_owned()))
            }
        }
    }

    /// The failure, which is first of all that it ended, if it did.
    fn failed(&mut self, reason: String) -> ProgramFailure {
        let deadline = Instant::now() + GRACE;
        let mut ended: Option<ExitStatus> = None;
        // Polled, as `wait` would block for a program that closed its output and goes on.
        while ended.is_none() && Instant::now() < deadline {
            ended = self.child.try_wait().ok().flatten();
            thread::sleep(Duration::from_millis(5));
        }
        let reason = match ended {
            Some(status) if self.received.load(Ordering::Relaxed) == 0 => {
                format!("ended ({status}) before it answered")
            }
            Some(status) => format!("ended ({status}): it {reason}"),
            None => reason,
        };
        // What it still has to say comes through once it is gone.
        let _ = self.child.kill();
        // The channel closes when the thread that reads standard error is done.
        let _ = self.stderr_closed.recv_timeout(GRACE);
        ProgramFailure {
            reason,
            stderr: self.stderr_end(),
        }
    }

    /// The last lines of its standard error, as one.
    fn stderr_end(&self) -> String {
        let tail = self.stderr_tail.lock();
        let mut tail = tail.unwrap_or_else(PoisonError::into_inner);
        let text = String::from_utf8_lossy(tail.make_contiguous());
        let lines: Vec<_> = text
            .lines()
            .filter(|line| !line.trim().is_empty())
            .collect();
        one_line(&lines[lines.len().saturating_sub(3)..].join(" | "))
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // It may have ended by itself, which is as good.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Counts what is read.
struct Counted {
    from: ChildStdout,
    count: Arc<AtomicUsize>,
}

impl Read for Counted {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let count = self.from.read(bytes)?;
        self.count.fetch_add(count, Ordering::Relaxed);
        Ok(count)
    }
}

fn write(mut stdin: ChildStdin, requests: &Receiver<Vec<u8>>, events: &Sender<ProgramEvent>) {
    for request in requests {
        if let Err(error) = stdin.write_all(&request).and_then(|()| stdin.flush()) {
            let _ = events.send(ProgramEvent::Refused(error));
            return;
        }
    }
}

fn read(stdout: Counted, questions: &Receiver<Question>, events: &Sender<ProgramEvent>) {
    let mut stdout = BufReader::new(stdout);
    for question in questions {
        let answered = ProgramEvent::Answered(read_reply(&mut stdout, question));
        if events.send(answered).is_err() {
            return;
        }
    }
}

/// Keeps the end of the program's standard error; `_open` is dropped where that ends.
fn keep_stderr(mut stderr: ChildStderr, kept: &Mutex<VecDeque<u8>>, _open: Sender<()>) {
    let mut bytes = [0; STDERR_KEPT];
    while let Ok(count @ 1..) = stderr.read(&mut bytes) {
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.extend(&bytes[..count]);
        // The end says most: an error message follows what led to it.
        let surplus = kept.len().saturating_sub(STDERR_KEPT);
        kept.drain(..surplus);
    }
}
