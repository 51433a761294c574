//! An algorithm's report of the cells of the frame that is shown.

use svl::depth::{self, GridSettings};
use svl::matcher::{Algorithm, MatchContext, MatchOutput, Matcher};
use svl::stereo::{CellRule, DepthGrid, Frame};

/// An algorithm, and its depth grid of the last frame.
pub(super) struct Reported {
    pub(super) label: String,
    matcher: Box<dyn Matcher>,
    output: MatchOutput,
    /// None where the algorithm failed on the last frame.
    pub(super) grid: Option<DepthGrid>,
}

impl Reported {
    pub(super) fn new(algorithm: &Algorithm) -> svl::Result<Self> {
        Ok(Self {
            label: algorithm.label().to_owned(),
            matcher: algorithm.build()?,
            output: MatchOutput::new()?,
            grid: None,
        })
    }

    pub(super) fn match_frame(
        &mut self,
        frame: &Frame,
        grid: GridSettings,
        cells: CellRule,
    ) -> svl::Result<()> {
        self.grid = None;
        let context = MatchContext::for_frame(frame, grid, cells);
        let output = &mut self.output;
        output.begin();
        self.matcher.compute(frame.rectified()?, &context, output)?;
        let own = output.grid.take();
        let own = own.filter(|own| own.shape() == grid.shape());
        let (map, left) = (output.disparity.disparity(), frame.pair.left());
        let decided = || depth::cells(map, left, grid, cells, frame.rig());
        self.grid = Some(own.unwrap_or_else(decided));
        Ok(())
    }

    /// The report of a cell: a distance, or that it is unknown.
    pub(super) fn words(&self, (column, row): (usize, usize)) -> String {
        let depth = self.grid.as_ref().map(|grid| grid.cell(column, row).depth);
        match depth.flatten().map(|depth| depth.distance_m) {
            None => "?".to_owned(),
            Some(None) => "far".to_owned(),
            Some(Some(metres)) => format!("{metres:.2}"),
        }
    }
}
