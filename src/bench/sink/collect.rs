//! Passes frames to a function, and keeps its results.

use super::{Outbox, Sink};
use svl_core::Result;
use svl_score::judge::Judged;

/// A sink that keeps what a function returns for each frame.
///
/// ```
/// use svl_bench::sink::CollectSink;
///
/// let sink = CollectSink::new(|judged| judged.estimates.len());
/// let counts = sink.outbox();
/// assert!(counts.take().is_empty(), "filled when the sink is finished");
/// ```
pub struct CollectSink<T, F> {
    look: F,
    values: Vec<T>,
    outbox: Outbox<Vec<T>>,
}

impl<T, F: FnMut(&Judged) -> T> CollectSink<T, F> {
    pub fn new(look: F) -> Self {
        Self {
            look,
            values: Vec::new(),
            outbox: Outbox::default(),
        }
    }

    /// The outbox that has the values once the sink is finished.
    pub fn outbox(&self) -> Outbox<Vec<T>> {
        self.outbox.clone()
    }
}

impl<T: Send, F: FnMut(&Judged) -> T + Send> Sink for CollectSink<T, F> {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        self.values.push((self.look)(judged));
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.outbox.put(self.values);
        Ok(())
    }
}

/// A sink that shows each frame to a function, and keeps nothing.
pub struct WatchSink<F>(pub F);

impl<F: FnMut(&Judged) + Send> Sink for WatchSink<F> {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        (self.0)(judged);
        Ok(())
    }
}
