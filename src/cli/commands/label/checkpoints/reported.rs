//! An algorithm's report of the cells of the frame that is shown.

use svl::depth::{self, GridSettings};
use svl::matcher::{Algorithm, MatchContext, MatchOutput, Matcher};
use svl::stereo::{CellRule, DepthGrid, Frame};

/// An algorithm, and its depth grid of the last frame.
pub(super) struct Reported {
    label: String,
    matcher: Box<dyn Matcher>,
    output: MatchOutput,
    grid: Option<DepthGrid>,
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

    pub(super) fn label(&self) -> &str {
        &self.label
    }

    /// Grid of the last frame; none where the algorithm failed on it.
    pub(super) fn grid(&self) -> Option<&DepthGrid> {
        self.grid.as_ref()
    }

    pub(super) fn match_frame(
        &mut self,
        frame: &Frame,
        grid: GridSettings,
        cells: CellRule,
    ) -> svl::Result<()> {
        self.grid = None;
        let context = MatchContext::for_frame(frame, grid, cells);
        self.output.begin();
        self.matcher
            .compute(frame.rectified()?, &context, &mut self.output)?;
        let own = self
            .output
            .grid
            .take()
            .filter(|own| own.shape() == grid.shape());
        let disparity = self.output.disparity.disparity();
        self.grid = Some(own.unwrap_or_else(|| {
            depth::cells(disparity, frame.pair.left(), grid, cells, frame.rig())
        }));
        Ok(())
    }

    /// The report of a cell: a distance, or that it is unknown.
    pub(super) fn words(&self, (column, row): (usize, usize)) -> String {
        let cell = self.grid.as_ref().map(|grid| grid.cell(column, row));
        match cell
            .and_then(|cell| cell.depth)
            .map(|depth| depth.distance_m)
        {
            None => "?".to_owned(),
            Some(None) => "far".to_owned(),
            Some(Some(metres)) => format!("{metres:.2}"),
        }
    }
}
