//! Nearest-stamp pairing: decides which waiting images of two cameras form a pair.

/// Decision on the earliest waiting image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nearest {
    /// It and the earliest image of the other camera are a pair.
    Pair,
    /// The nearest image of the other camera exceeds the largest skew.
    TooFar,
    /// The nearest image of the other camera is nearer to the next image of this camera.
    Overtaken,
    /// The next image of its own camera, which has not arrived, may be nearer.
    Unknown,
}

/// Stamps of waiting images, in nanoseconds.
pub struct WaitingStamps {
    /// The earliest image of both cameras.
    pub earliest_ns: u64,
    /// The next image of the same camera, if it has arrived.
    pub next_ns: Option<u64>,
    /// The earliest image of the other camera.
    pub other_ns: u64,
}

impl WaitingStamps {
    /// Right stamp minus left stamp, absolute value.
    pub fn skew_ns(&self) -> u64 {
        self.other_ns.abs_diff(self.earliest_ns)
    }

    /// Two images are a pair if each is the nearest to the other and they are at most `max_skew_ns`
    /// apart. Up to `certain_ns` apart, no later image can be nearer.
    pub fn nearest(&self, max_skew_ns: u64, certain_ns: u64) -> Nearest {
        // The earliest of the other camera's images is the nearest to `earliest_ns`: all others are
        // later. Only an image of its own camera can still be nearer to that one.
        let skew_ns = self.skew_ns();
        if skew_ns > max_skew_ns {
            return Nearest::TooFar;
        }
        match self.next_ns {
            Some(next) if next.abs_diff(self.other_ns) < skew_ns => Nearest::Overtaken,
            None if skew_ns > certain_ns => Nearest::Unknown,
            _ => Nearest::Pair,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_is_nearest_on_both_sides() {
        let nearest = |next_ns, other_ns| {
            let waiting = WaitingStamps {
                earliest_ns: 100,
                next_ns,
                other_ns,
            };
            waiting.nearest(30, 5)
        };
        assert_eq!(nearest(None, 105), Nearest::Pair);
        assert_eq!(nearest(None, 106), Nearest::Unknown);
        assert_eq!(nearest(Some(133), 106), Nearest::Pair);
        assert_eq!(nearest(Some(133), 120), Nearest::Overtaken);
        assert_eq!(
            nearest(Some(140), 120),
            Nearest::Pair,
            "the earlier of two as near"
        );
        assert_eq!(nearest(Some(140), 131), Nearest::TooFar);
    }
}
