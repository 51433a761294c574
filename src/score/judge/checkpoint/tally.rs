//! A checkpoint over many frames: number passed, best and worst frame.

use super::CheckpointFrame;

/// A checkpoint over the frames of one or more runs.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckpointTally<F> {
    pub frames: usize,
    pub passed: usize,
    /// The best frame: the first among equals.
    pub best: Option<(F, CheckpointFrame)>,
    /// The worst frame: the first among equals.
    pub worst: Option<(F, CheckpointFrame)>,
}

impl<F> Default for CheckpointTally<F> {
    fn default() -> Self {
        Self {
            frames: 0,
            passed: 0,
            best: None,
            worst: None,
        }
    }
}

impl<F> CheckpointTally<F> {
    /// True for a frame with that score that would become the best, the worst.
    pub fn would_lead(&self, frame: &CheckpointFrame) -> (bool, bool) {
        let best = self
            .best
            .as_ref()
            // Strictly better: among equal frames the first stays, so the result does not depend on
            // how a run is split.
            .is_none_or(|(_, b)| frame.badness(b).is_lt());
        let worst = self
            .worst
            .as_ref()
            .is_none_or(|(_, w)| frame.badness(w).is_gt());
        (best, worst)
    }

    /// Counts a frame; `keep` returns what is stored of it if it leads.
    pub fn add(&mut self, frame: CheckpointFrame, keep: impl Fn() -> F) {
        let (best, worst) = self.would_lead(&frame);
        if best {
            self.best = Some((keep(), frame));
        }
        if worst {
            self.worst = Some((keep(), frame));
        }
        self.frames += 1;
        self.passed += usize::from(frame.passed);
    }

    /// Fraction of the frames that passed; `None` without frames.
    pub fn share(&self) -> Option<f64> {
        (self.frames > 0).then(|| self.passed as f64 / self.frames as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tally_keeps_the_first_best_and_worst() {
        let frame = |wrong, error| CheckpointFrame {
            passed: wrong == 0,
            missing: 0,
            wrong,
            order_holds: true,
            error,
        };
        let frames = [
            frame(1, 0.9),
            frame(0, 0.2),
            frame(3, 0.1),
            frame(0, 0.1),
            frame(3, 0.1),
            frame(0, 0.1),
        ];
        let mut tally = CheckpointTally::default();
        for (sequence, verdict) in frames.into_iter().enumerate() {
            tally.add(verdict, || sequence);
        }
        assert_eq!(
            (tally.frames, tally.passed, tally.share()),
            (6, 3, Some(0.5))
        );
        assert_eq!((tally.best.unwrap().0, tally.worst.unwrap().0), (3, 2));
    }
}
