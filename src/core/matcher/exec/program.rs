//! A child process that matches pairs. Threads write to it and read from it, so that it can neither
//! block svl nor be blocked by a full pipe of its standard error.

use super::protocol::{Hello, Question, Reply, ReplyFault, one_line, read_reply};
use crate::error::Error;
use crate::interrupt;
use parking_lot::Mutex;
use std::collections::VecDeque;
use std::fmt::Display;
use std::io::{BufReader, ErrorKind, Read, Write};
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Bytes of its standard error that are kept.
const STDERR_KEPT: usize = 4096;

/// Time that a program which closed its output has to exit and to close its standard error.
const GRACE: Duration = Duration::from_millis(300);

/// Interval at which an interruption of svl is checked while a program works.
const GLANCE: Duration = Duration::from_millis(50);

/// Largest pipe that Linux allows without privileges: a pair then passes in few pieces.
#[cfg(target_os = "linux")]
const PIPE_BYTES: usize = 1 << 20;

/// A failure of the program, worded to follow its name.
#[derive(Debug)]
pub(super) struct ProgramFailure {
    reason: String,
    stderr: String,
    is_interrupt: bool,
}

impl ProgramFailure {
    pub(super) fn new(reason: impl Into<String>) -> Self {
        Self {
            reason: reason.into(),
            stderr: String::new(),
            is_interrupt: false,
        }
    }

    fn interrupt() -> Self {
        Self {
            is_interrupt: true,
            ..Self::new("was interrupted")
        }
    }

    /// The error for that command.
    pub(super) fn into_error(self, command: &str) -> Error {
        if self.is_interrupt {
            return Error::Interrupted;
        }
        Error::Program {
            command: command.to_owned(),
            reason: self.reason,
            stderr: self.stderr,
        }
    }
}

enum ProgramEvent {
    Answered(Result<Reply, ReplyFault>),
    /// The program does not accept its input.
    Refused(std::io::Error),
}

/// A running program. Dropping it ends it.
pub(super) struct Program {
    child: Child,
    /// Identity of the program, once reported.
    pub(super) hello: Option<Hello>,
    requests: Sender<Vec<u8>>,
    /// Buffers of requests already written,
    written: Receiver<Vec<u8>>,
    questions: Sender<Question>,
    /// and of disparities already used.
    taken: Sender<Vec<u8>>,
    events: Receiver<ProgramEvent>,
    /// Bytes received of the current answer.
    received: Arc<AtomicUsize>,
    stderr_tail: Arc<Mutex<VecDeque<u8>>>,
    stderr_closed: Receiver<()>,
}

impl Program {
    /// Peak memory of the program, bytes, if the system reports it.
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
        // Ctrl-C is for svl, which ends the run in order, and the program with it.
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
        // All three were requested above.
        let (Some(stdin), Some(stdout), Some(stderr)) = pipes else {
            unreachable!("pipes")
        };
        #[cfg(target_os = "linux")]
        {
            // If the system refuses, the pipes work as they are.
            let _ = rustix::pipe::fcntl_setpipe_size(&stdin, PIPE_BYTES);
            let _ = rustix::pipe::fcntl_setpipe_size(&stdout, PIPE_BYTES);
        }
        let (requests, to_write) = channel();
        let (back, written) = channel();
        let (questions, to_read) = channel();
        let (taken, memory) = channel();
        let (event, events) = channel();
        let (open, stderr_closed) = channel();
        let received = Arc::new(AtomicUsize::new(0));
        let stderr_tail = Arc::new(Mutex::new(VecDeque::with_capacity(STDERR_KEPT)));
        let stdout = Counted {
            from: stdout,
            count: Arc::clone(&received),
        };
        let (writing, kept) = (event.clone(), Arc::clone(&stderr_tail));
        // One thread per pipe: a program may answer before it has read the whole request, and may
        // write to standard error at any time, so svl would wait for it while it waits for svl. The
        // question is sent before its request, so that the reader expects an answer before the
        // program can give it. Buffers return to where they are filled again: no allocation per
        // pair. The threads end with the pipes or with the channels, whichever closes first.
        thread::spawn(move || write(stdin, &to_write, &back, &writing));
        thread::spawn(move || read(stdout, &to_read, &memory, &event));
        thread::spawn(move || keep_stderr(stderr, &kept, open));
        Ok(Self {
            child,
            hello: None,
            requests,
            written,
            questions,
            taken,
            events,
            received,
            stderr_tail,
            stderr_closed,
        })
    }

    /// A buffer for a request.
    pub(super) fn memory_for_request(&self) -> Vec<u8> {
        self.written.try_recv().unwrap_or_default()
    }

    /// Returns a buffer of disparities for reuse.
    pub(super) fn take_back(&self, disparities: Vec<u8>) {
        let _ = self.taken.send(disparities);
    }

    /// Sends a request; its answer comes from [`Program::answer`].
    pub(super) fn send(&mut self, request: Vec<u8>, question: Question) {
        self.received.store(0, Ordering::Relaxed);
        // If the thread is gone, it has left an event, which tells more.
        let _ = self.questions.send(question);
        let _ = self.requests.send(request);
    }

    /// Waits for the answer to the oldest request that has none.
    pub(super) fn answer(
        &mut self,
        (width, height): (usize, usize),
        timeout: Duration,
    ) -> Result<Reply, ProgramFailure> {
        let deadline = Instant::now() + timeout;
        let event = loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.events.recv_timeout(left.min(GLANCE)) {
                Err(RecvTimeoutError::Timeout) if interrupt::requested() => {
                    return Err(ProgramFailure::interrupt());
                }
                Err(RecvTimeoutError::Timeout) if left > GLANCE => {}
                event => break event,
            }
        };
        match event {
            Ok(ProgramEvent::Answered(Ok(reply))) => Ok(reply),
            Ok(ProgramEvent::Answered(Err(fault))) => Err(self.failed(&fault)),
            Ok(ProgramEvent::Refused(error)) => {
                Err(self.failed(&format_args!("does not read its input: {error}")))
            }
            Err(RecvTimeoutError::Timeout) => {
                let expected = width * height * 4;
                let received = match self.received.load(Ordering::Relaxed) {
                    0 => "nothing received".to_owned(),
                    bytes => format!("{bytes} bytes received, its line and {expected} expected"),
                };
                let reason = format!("timed out after {timeout:?}: {received}");
                Err(ProgramFailure {
                    stderr: self.stderr_end(),
                    ..ProgramFailure::new(reason)
                })
            }
            Err(RecvTimeoutError::Disconnected) => Err(self.failed(&"closed its input and output")),
        }
    }

    /// The failure: first of all that the program exited, if it did.
    fn failed(&mut self, reason: &dyn Display) -> ProgramFailure {
        let deadline = Instant::now() + GRACE;
        let mut ended: Option<ExitStatus> = None;
        // Polled, as `wait` would block on a program that closed its output but keeps running.
        while ended.is_none() && Instant::now() < deadline {
            ended = self.child.try_wait().ok().flatten();
            thread::sleep(Duration::from_millis(5));
        }
        let reason = match ended {
            Some(status) if self.received.load(Ordering::Relaxed) == 0 => {
                format!("ended ({status}) before it answered")
            }
            Some(status) => format!("ended ({status}): it {reason}"),
            None => reason.to_string(),
        };
        // The program's remaining output arrives once it is gone.
        self.kill();
        // The channel closes when the thread that reads standard error ends.
        let _ = self.stderr_closed.recv_timeout(GRACE);
        ProgramFailure {
            reason,
            stderr: self.stderr_end(),
            is_interrupt: false,
        }
    }

    /// Kills it with everything it started in its process group.
    fn kill(&mut self) {
        #[cfg(unix)]
        {
            use rustix::process::{Pid, Signal, kill_process_group};
            // The program has a group of its own, by `process_group(0)`. If all of the group has
            // ended, its number is not reused before all others have been.
            if let Some(group) = Pid::from_raw(self.child.id().cast_signed()) {
                let _ = kill_process_group(group, Signal::KILL);
            }
        }
        // It may have exited already, which is fine.
        let _ = self.child.kill();
    }

    /// The last lines of its standard error, as one.
    fn stderr_end(&self) -> String {
        let mut tail = self.stderr_tail.lock();
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
        self.kill();
        let _ = self.child.wait();
    }
}

/// A reader that counts the bytes it reads.
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

fn write(
    mut stdin: ChildStdin,
    requests: &Receiver<Vec<u8>>,
    written: &Sender<Vec<u8>>,
    events: &Sender<ProgramEvent>,
) {
    for request in requests {
        if let Err(error) = stdin.write_all(&request).and_then(|()| stdin.flush()) {
            let _ = events.send(ProgramEvent::Refused(error));
            return;
        }
        let _ = written.send(request);
    }
}

fn read(
    stdout: Counted,
    questions: &Receiver<Question>,
    memory: &Receiver<Vec<u8>>,
    events: &Sender<ProgramEvent>,
) {
    let mut stdout = BufReader::new(stdout);
    for question in questions {
        let memory = memory.try_recv().unwrap_or_default();
        let answered = ProgramEvent::Answered(read_reply(&mut stdout, question, memory));
        if events.send(answered).is_err() {
            return;
        }
    }
}

/// Keeps the end of the program's standard error; `_open` is dropped when that closes.
fn keep_stderr(mut stderr: ChildStderr, kept: &Mutex<VecDeque<u8>>, _open: Sender<()>) {
    let mut bytes = [0; STDERR_KEPT];
    while let Ok(count @ 1..) = stderr.read(&mut bytes) {
        let mut kept = kept.lock();
        kept.extend(&bytes[..count]);
        // The end is the most useful part: an error message comes last.
        let surplus = kept.len().saturating_sub(STDERR_KEPT);
        kept.drain(..surplus);
    }
}
