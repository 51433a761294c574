//! Matchers as a method and its scratch memory, which is kept as long as the pairs keep their size.

use super::{MatchContext, MatchOutput, Matcher};
use crate::error::Result;
use crate::stereo::{ExtraPlanes, RectifiedPair, StereoPair};

/// An algorithm without its memory.
pub(super) trait Method: Send + 'static {
    /// Memory for pairs of one size.
    type Scratch: Send;

    /// Planes it fills besides disparities and reasons.
    const PLANES: ExtraPlanes;

    /// Memory for pairs of `size`, width and height.
    ///
    /// # Errors
    /// If the algorithm cannot match pairs of that size.
    fn scratch(&self, size: (usize, usize)) -> Result<Self::Scratch>;

    /// Matches `pair` and writes every pixel of the map of `output`, which has its size and
    /// [`Self::PLANES`].
    fn compute(&self, scratch: &mut Self::Scratch, pair: &StereoPair, output: &mut MatchOutput);
}

/// A matcher of `method`.
pub(super) fn matcher<M: Method>(method: M) -> Box<dyn Matcher> {
    Box::new(MethodMatcher {
        method,
        scratch: None,
    })
}

struct MethodMatcher<M: Method> {
    method: M,
    /// With the pair size that it was made for.
    scratch: Option<((usize, usize), M::Scratch)>,
}

impl<M: Method> Matcher for MethodMatcher<M> {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        _: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let size = pair.size();
        output.disparity.resize(size.0, size.1, M::PLANES)?;
        // Freed before the new memory is allocated, so that both sizes are never held at once.
        self.scratch.take_if(|(fits, _)| *fits != size);
        let (_, scratch) = match &mut self.scratch {
            Some(scratch) => scratch,
            none => none.insert((size, self.method.scratch(size)?)),
        };
        self.method.compute(scratch, &pair, output);
        Ok(())
    }
}
