//! What goes wrong on the line and costs no pulse.

use crate::counted;

/// A kind of trouble.
#[derive(Clone, Copy)]
pub(super) enum Trouble {
    /// A pulse was asked for, and the controller never heard of it.
    Request,
    /// A pulse was given, and its answer did not come in time.
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

/// How much of each there was. A kind is told when it begins, and all of them at the end.
pub(super) struct Troubles {
    name: String,
    pub(super) counts: [u64; NAMES.len()],
    told: u64,
}

impl Troubles {
    /// Of a line of this name, none so far.
    pub(super) fn of(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            counts: [0; NAMES.len()],
            told: 0,
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
            self.told += n;
        }
        *count += n;
    }
}

impl Drop for Troubles {
    fn drop(&mut self) {
        if self.counts.iter().sum::<u64>() > self.told {
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
