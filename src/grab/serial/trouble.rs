//! Faults on the serial line that lose no pulse, counted by kind.

use svl_core::counted;

/// A kind of fault.
#[derive(Clone, Copy)]
pub(super) enum Trouble {
    /// A request did not reach the controller.
    Request,
    /// A pulse was sent, but its answer did not arrive in time.
    Answer,
    Garbled,
    Overrun,
    Framing,
    Unknown,
}

/// In the order of the kinds.
const NAMES: [&str; 6] = [
    "lost request",
    "lost answer",
    "garbled line",
    "overrun",
    "framing error",
    "unknown byte",
];

/// Counts by kind. Warns of the first of each kind, and of all counts when dropped.
pub(super) struct Troubles {
    name: String,
    pub(super) counts: [u64; NAMES.len()],
    warned: u64,
}

impl Troubles {
    /// No faults yet, on the line of that name.
    pub(super) fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            counts: [0; NAMES.len()],
            warned: 0,
        }
    }

    pub(super) fn add(&mut self, kind: Trouble, n: u64) {
        let count = &mut self.counts[kind as usize];
        if *count == 0 {
            tracing::warn!(
                "{}: trouble on the line: {}",
                self.name,
                counted(n, NAMES[kind as usize])
            );
            self.warned += n;
        }
        *count += n;
    }
}

impl Drop for Troubles {
    fn drop(&mut self) {
        // The first of each kind has been reported already.
        if self.counts.iter().sum::<u64>() > self.warned {
            let seen = NAMES.iter().zip(self.counts).filter(|(_, n)| *n > 0);
            let seen: Vec<_> = seen.map(|(name, n)| counted(n, name)).collect();
            tracing::warn!(
                "{}: trouble on the line, in all: {}",
                self.name,
                seen.join(", ")
            );
        }
    }
}
