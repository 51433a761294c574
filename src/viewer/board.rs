//! The calibration board in Rerun: both images with the detected corners, and the state as text.
//!
//! ```text
//! board/left   board/left/rows   board/left/first
//! board/right  ...
//! board/state  text
//! ```

use crate::blueprint::{LayoutNode, LayoutView};
use crate::picture::gray;
use crate::target::ViewStream;
use nalgebra::Point2;
use rerun::{Clear, LineStrips2D, Points2D, Rgba32, TextDocument};
use svl_bench::sink::{BoardView, RerunTarget};
use svl_core::Result;
use svl_core::stereo::StereoPair;
use svl_files::overlay::viridis;

/// Shows pairs with the corners of a board.
pub(crate) struct RerunBoard {
    view: ViewStream,
    /// Corners in a row.
    columns: usize,
}

const SIDES: [&str; 2] = ["left", "right"];

impl RerunBoard {
    /// Opens `target` for boards of `columns` corners in a row.
    ///
    /// # Errors
    /// The errors of [`svl_bench::sink::Viewer::run`].
    pub(crate) fn new(target: RerunTarget, columns: usize) -> Result<Self> {
        let image = |side: &str| {
            LayoutView::new("2D", side, &format!("board/{side}"), ["+ $origin/**"]).into()
        };
        let images = LayoutNode::row("images", SIDES.map(image).into(), &[]);
        let words = LayoutView::new("TextDocument", "state", "board/state", ["+ $origin"]).into();
        let root = LayoutNode::column("board", vec![images, words], &[7.0, 1.0]);
        let view = ViewStream::open(target, "board", &root)?;
        Ok(Self { view, columns })
    }
}

impl BoardView for RerunBoard {
    fn show(
        &self,
        sequence: u64,
        pair: &StereoPair,
        corners: [&[Point2<f64>]; 2],
        state: &str,
    ) -> Result<()> {
        self.view.set_pair(sequence);
        for ((side, image), corners) in SIDES
            .into_iter()
            .zip([pair.left(), pair.right()])
            .zip(corners)
        {
            let path = |part: &str| format!("board/{side}{part}");
            self.view.log(&path(""), &gray(image))?;
            // Rerun's pixels begin at integers; svl's pixel centres are at integers.
            let points: Vec<[f32; 2]> = corners
                .iter()
                .map(|p| [p.x as f32 + 0.5, p.y as f32 + 0.5])
                .collect();
            let Some(first) = points.first() else {
                self.view.log(&path("/rows"), &Clear::flat())?;
                self.view.log(&path("/first"), &Clear::flat())?;
                continue;
            };
            let rows: Vec<_> = points.chunks(self.columns).map(<[_]>::to_vec).collect();
            let color = |row: usize| viridis(1.0 - 0.8 * row as f32 / rows.len() as f32);
            let colors: Vec<_> = (0..rows.len())
                .map(color)
                .map(|[r, g, b]| Rgba32::from_rgb(r, g, b))
                .collect();
            let lines = LineStrips2D::new(rows)
                .with_colors(colors)
                .with_radii([0.4]);
            self.view.log(&path("/rows"), &lines)?;
            let red = Rgba32::from_rgb(230, 60, 40);
            let corner = Points2D::new([*first]).with_colors([red]).with_radii([3.0]);
            self.view.log(&path("/first"), &corner)?;
        }
        let state = TextDocument::from_markdown(state);
        self.view.log("board/state", &state)
    }

    fn finish(&self) -> Result<()> {
        self.view.flush()
    }
}
