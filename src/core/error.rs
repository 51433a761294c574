//! The library's error type: every variant reports the value read, the value expected and the
//! remedy.

use std::path::PathBuf;

/// Result of a fallible operation in svl, mostly with its own error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Any failure, or words.
pub type Cause = Box<dyn std::error::Error + Send + Sync>;

/// Failure with its figures. `Display` is one line for the user.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A buffer whose length does not match the image size.
    #[error("a {width}x{height} image needs {expected} bytes, got {got}")]
    Size {
        width: usize,
        height: usize,
        expected: usize,
        got: usize,
    },
    /// An image has no pixels or more than the library accepts.
    #[error("an image of {width}x{height} pixels is outside 1x1 ..= {max}x{max}")]
    Dimensions {
        width: usize,
        height: usize,
        max: usize,
    },
    /// There is no memory for what an image of that size needs.
    #[error(
        "no memory: at least {} MB more are needed; smaller images and fewer disparities need less",
        bytes.div_ceil(1_000_000)
    )]
    Memory { bytes: usize },
    /// Left and right of a pair differ in size.
    #[error(
        "left image is {}x{}, right image is {}x{}: a rectified pair has equal sizes",
        left.0, left.1, right.0, right.1
    )]
    PairSize {
        left: (usize, usize),
        right: (usize, usize),
    },
    /// No algorithm of that name.
    #[error("unknown algorithm '{name}'{}; `svl algos` lists them", hint(.similar))]
    UnknownAlgorithm { name: String, similar: Vec<String> },
    /// The algorithm has no such parameter.
    #[error(
        "{algorithm} has no parameter '{name}'{}; `svl algos {algorithm}` lists them",
        hint(.nearest.as_slice())
    )]
    UnknownParameter {
        algorithm: &'static str,
        name: String,
        nearest: Option<String>,
    },
    /// A parameter value that cannot be parsed or lies outside its range.
    #[error("{algorithm}: {name}={value} is not {expected}")]
    ParameterValue {
        algorithm: &'static str,
        name: String,
        value: String,
        expected: String,
    },
    /// Parameters that are not those of a stereo rig.
    #[error("not a stereo rig: {0}")]
    Rig(String),
    /// A file could not be opened, read or written.
    #[error("{}: {}", path.display(), words(cause))]
    Io {
        path: PathBuf,
        cause: std::io::Error,
    },
    /// A file is malformed. The reason can be downcast to the fault that a parser found.
    #[error("{}: {reason}", path.display())]
    Format { path: PathBuf, reason: Cause },
    /// A truncated or corrupt recording. Everything read from it before is valid.
    #[error(
        "{}: {reason}; `svl recover {} -o OUT.mcap` keeps what is intact",
        path.display(), path.display()
    )]
    Damaged { path: PathBuf, reason: Cause },
    /// A matcher panicked, at this pair or an earlier one.
    #[error("svl panicked; this is a bug, and the ranger can only be closed")]
    Panicked,
    /// The work was interrupted ([`crate::interrupt`]).
    #[error("interrupted")]
    Interrupted,
    /// A program that matches pairs failed; `stderr` is the end of its standard error.
    #[error("program `{command}` {reason}{}", stderr_note(.stderr))]
    Program {
        command: String,
        reason: String,
        stderr: String,
    },
    /// A request that contradicts itself, or an option that does not apply to what it is given for.
    #[error("{0}")]
    Usage(String),
    /// A scenario or setting that contradicts itself.
    #[error("{0}")]
    Invalid(String),
    /// A failure that another package knows, such as a camera's.
    #[error(transparent)]
    Other(Cause),
}

impl Error {
    /// True if the request itself is wrong, regardless of files and machines. The program then
    /// exits with its code for wrong usage.
    pub fn is_usage(&self) -> bool {
        use Error::{ParameterValue, UnknownAlgorithm, UnknownParameter, Usage};
        matches!(
            self,
            Usage(_) | ParameterValue { .. } | UnknownAlgorithm { .. } | UnknownParameter { .. }
        )
    }

    /// The kind of failure for programs that call svl, if it has one: `missing` (a file), `io`,
    /// `memory`.
    pub fn kind(&self) -> Option<&'static str> {
        let cause = match self {
            Self::Io { cause, .. } => Some(cause),
            Self::Memory { .. } => return Some("memory"),
            _ => self.downcast_ref::<std::io::Error>(),
        };
        let is_missing = cause?.kind() == std::io::ErrorKind::NotFound;
        Some(if is_missing { "missing" } else { "io" })
    }

    /// An I/O error at `path`.
    pub fn io(path: impl Into<PathBuf>, cause: std::io::Error) -> Self {
        let path = path.into();
        Self::Io { path, cause }
    }

    /// A malformed file at `path`.
    pub fn format(path: impl Into<PathBuf>, reason: impl Into<Cause>) -> Self {
        let (path, reason) = (path.into(), reason.into());
        Self::Format { path, reason }
    }

    /// A failure that another package knows.
    pub fn other(failure: impl Into<Cause>) -> Self {
        Self::Other(failure.into())
    }

    /// The failure that another package knows, if it is an `E`.
    pub fn downcast_ref<E: std::error::Error + 'static>(&self) -> Option<&E> {
        match self {
            Self::Other(cause)
            | Self::Format { reason: cause, .. }
            | Self::Damaged { reason: cause, .. } => cause.downcast_ref(),
            _ => None,
        }
    }

    /// A recording at `path` that is valid only up to here.
    pub fn damaged(path: impl Into<PathBuf>, reason: impl Into<Cause>) -> Self {
        let (path, reason) = (path.into(), reason.into());
        Self::Damaged { path, reason }
    }
}

fn stderr_note(stderr: &str) -> String {
    match stderr {
        "" => String::new(),
        said => format!("; it said: {said}"),
    }
}

/// The cause of an I/O error, with the remedy if there is one.
fn words(cause: &std::io::Error) -> String {
    use std::io::ErrorKind::{
        AlreadyExists, IsADirectory, NotADirectory, NotFound, PermissionDenied, ReadOnlyFilesystem,
        StorageFull,
    };
    let words = match cause.kind() {
        NotFound => "no such file or folder; check the name",
        AlreadyExists if cause.raw_os_error().is_some() => {
            "exists already, as something else; name another"
        }
        IsADirectory => "is a folder; name a file",
        NotADirectory => "part of it is a file, not a folder; check the name",
        PermissionDenied => "permission denied; name another place or change its permissions",
        ReadOnlyFilesystem => "cannot be written on a read-only file system; name another place",
        StorageFull => "no space left on the device; free some or name another place",
        // Rarer causes: the system's own message, without its number.
        _ => {
            let words = cause.to_string();
            let words = words.split(" (os error").next().unwrap_or_default();
            return words.to_lowercase();
        }
    };
    words.to_owned()
}

/// A hint at the candidate nearest to an unknown `name`, to be appended to a message; empty without
/// one.
pub fn did_you_mean<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    hint(nearest(name, candidates).as_slice())
}

fn hint(similar: &[String]) -> String {
    match similar {
        [] => String::new(),
        names => format!(" (did you mean {}?)", alternatives(names)),
    }
}

/// `'a', 'b' or 'c'`.
pub fn alternatives(names: &[impl std::fmt::Display]) -> String {
    let quoted: Vec<_> = names.iter().map(|name| format!("'{name}'")).collect();
    match &quoted[..] {
        [] => String::new(),
        [one] => one.clone(),
        [others @ .., last] => format!("{} or {last}", others.join(", ")),
    }
}

/// The candidate nearest to `name` by edit distance, if it is close enough to be a typo.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    candidates
        .into_iter()
        .map(|c| (strsim::damerau_levenshtein(&name.to_lowercase(), c), c))
        // With more than half of its letters changed it is a different word.
        .filter(|(distance, c)| *distance <= (c.len() / 2).max(1))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, c)| c.to_owned())
}
