//! An algorithm followed by filters ([`crate::filter`]): `v3+floor`.

use super::{MatchContext, MatchOutput, Matcher, ProgramRecord};
use crate::depth;
use crate::error::Result;
use crate::filter::Filters;
use crate::stereo::RectifiedPair;
use crate::timing::Stage;

/// Matches by another matcher, then drops and marks what the filters detect. Computes the grid
/// itself.
pub(super) struct FilteredMatcher {
    pub(super) matcher: Box<dyn Matcher>,
    pub(super) filters: Filters,
}

impl Matcher for FilteredMatcher {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        self.matcher.compute(pair, context, output)?;
        let (left, shape) = (pair.left(), context.grid.shape());
        let rig = context.rig.as_ref();
        let grid = |output: &MatchOutput| {
            let map = output.disparity.disparity();
            depth::cells(map, left, context.grid, context.cells, rig)
        };
        let own = output.grid.take();
        let unfiltered = own.clone().unwrap_or_else(|| grid(output));
        output
            .clock
            .lap_with(Stage::Checks, std::time::Duration::ZERO);
        self.filters.look(left, shape)?;
        self.filters.drop_floor(&mut output.disparity, shape);
        output.clock.lap(Stage::Filters);
        let mut filtered = own.unwrap_or_else(|| grid(output));
        self.filters.mark_cells(&mut filtered, rig);
        output.grid = Some(filtered);
        output.unfiltered = Some(unfiltered);
        Ok(())
    }

    fn program(&self) -> Option<ProgramRecord> {
        self.matcher.program()
    }

    fn has_run_memory(&self) -> bool {
        self.matcher.has_run_memory()
    }

    fn reset(&mut self) {
        self.matcher.reset();
    }

    fn batch(&self) -> usize {
        self.matcher.batch()
    }

    fn announce(&mut self, pairs: &[(RectifiedPair<'_>, MatchContext<'_>)]) {
        self.matcher.announce(pairs);
    }
}
