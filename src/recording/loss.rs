//! What of a file cannot be read.

/// A part of a file that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Loss {
    pub at_byte: u64,
    /// How long the part is; 0 where something was never written, or is only noticed here.
    pub bytes: u64,
    pub reason: String,
}

impl std::fmt::Display for Loss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "the recording is incomplete or damaged at byte {}: {}",
            self.at_byte, self.reason
        )
    }
}
