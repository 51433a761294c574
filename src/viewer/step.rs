//! A frame in Rerun while a person steps through a source: its left image, notes on the cells, and
//! a text.
//!
//! ```text
//! step/left   step/left/grid   step/left/cells
//! step/state  text
//! ```

use crate::blueprint::{LayoutNode, LayoutView};
use crate::overlay;
use crate::picture::gray;
use crate::target::ViewStream;
use rerun::{Boxes2D, LineStrips2D, Radius, Rgba32, TextDocument};
use svl_bench::sink::{CellNote, RerunTarget, StepView};
use svl_core::Result;
use svl_core::stereo::{Frame, GridShape};

/// Shows one frame after the other, in the order of the steps.
pub(crate) struct RerunSteps {
    view: ViewStream,
}

const PICKED: Rgba32 = Rgba32::from_rgb(255, 221, 50);
const NOTED: Rgba32 = Rgba32::from_rgb(90, 220, 120);

impl RerunSteps {
    /// Opens `target`.
    ///
    /// # Errors
    /// The errors of [`svl_bench::sink::Viewer::run`].
    pub(crate) fn new(target: RerunTarget) -> Result<Self> {
        let image = LayoutView::new("2D", "left", "step/left", ["+ $origin/**"]).into();
        let state = LayoutView::new("TextDocument", "state", "step/state", ["+ $origin"]).into();
        let root = LayoutNode::column("step", vec![image, state], &[5.0, 1.0]);
        let view = ViewStream::open(target, "step", &root)?;
        Ok(Self { view })
    }
}

impl StepView for RerunSteps {
    fn show(&self, frame: &Frame, shape: GridShape, notes: &[CellNote], state: &str) -> Result<()> {
        self.view.set_pair(frame.sequence);
        let size = frame.pair.size();
        self.view.log("step/left", &gray(frame.pair.left()))?;
        let lines = LineStrips2D::new(overlay::lines(shape, size))
            .with_colors([overlay::WHITE])
            .with_radii([Radius::new_ui_points(0.5)]);
        self.view.log("step/left/grid", &lines)?;
        let half = |range: std::ops::Range<usize>| {
            (range.start as f32, (range.end - range.start) as f32 / 2.0)
        };
        // Slightly inset, so that neighbours do not cover each other.
        let boxes = notes.iter().map(|note| {
            let (x, y) = shape.pixels(note.at, size);
            let ((left, width), (top, height)) = (half(x), half(y));
            ([left + width, top + height], [0.96 * width, 0.96 * height])
        });
        let (centers, half_sizes): (Vec<_>, Vec<_>) = boxes.unzip();
        let colors = notes
            .iter()
            .map(|note| if note.is_picked { PICKED } else { NOTED });
        let boxes = Boxes2D::from_centers_and_half_sizes(centers, half_sizes)
            .with_colors(colors)
            .with_labels(notes.iter().map(|note| note.text.as_str()))
            .with_show_labels(true);
        self.view.log("step/left/cells", &boxes)?;
        let state = TextDocument::from_markdown(state);
        self.view.log("step/state", &state)
    }

    fn finish(&self) -> Result<()> {
        self.view.flush()
    }
}
