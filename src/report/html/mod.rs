//! `index.html`: one file without scripts or anything to fetch, with the thesis's figure 7.3 as vector graphics.

mod view;

use super::rows::{CellRow, Row};
use super::summary::Summary;
use crate::error::{Error, Result};
use crate::overlay::Mark;
use std::path::Path;

/// Everything the page shows.
pub struct Page {
    pub title: String,
    /// The scenario's prose; an empty line begins a paragraph.
    pub description: String,
    /// What identifies the run: names and values of its manifest.
    pub identity: Vec<(String, String)>,
    pub summary: Summary,
    /// One per checkpoint, or one per scene.
    pub figures: Vec<Figure>,
}

/// A row of shots under one heading.
pub struct Figure {
    /// The checkpoint's or the scene's name.
    pub title: String,
    /// What is to be seen, may be empty.
    pub about: String,
    pub shots: Vec<Shot>,
}

/// One frame through one algorithm: its overlay, beside it the truth's, and the disparities.
#[derive(Clone)]
pub struct Shot {
    pub row: Row,
    /// The frame's cells, from which the caption tells the wrong ones.
    pub cells: Vec<CellRow>,
    /// Why this frame stands here; nothing where there is no choice.
    pub rank: Option<Rank>,
    /// Whether the checkpoint passes in this frame.
    pub passed: Option<bool>,
    /// The left image as a PNG file. The page holds it once, however many shots show it.
    pub left_png: Vec<u8>,
    /// Width and height of the left image, pixels.
    pub size: (usize, usize),
    pub estimate: Vec<Mark>,
    pub truth: Option<Vec<Mark>>,
    /// The disparities as colours, a PNG file.
    pub preview_png: Option<Vec<u8>>,
}

/// Place of a frame among those of its checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rank {
    Worst,
    Best,
}

impl Page {
    /// The page as a file.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        std::fs::write(path, self.render()?).map_err(|e| Error::io(path, e))
    }

    /// The page. All texts are escaped.
    ///
    /// # Errors
    /// [`Error::Invalid`] with what the template engine says.
    pub fn render(&self) -> Result<String> {
        let mut templates = minijinja::Environment::new();
        templates.set_trim_blocks(true);
        templates.set_lstrip_blocks(true);
        templates.set_undefined_behavior(minijinja::UndefinedBehavior::Strict);
        templates
            .add_template("index.html", include_str!("index.html"))
            .and_then(|()| templates.add_template("style.css", include_str!("style.css")))
            .and_then(|()| templates.get_template("index.html")?.render(view::View::of(self)))
            .map_err(|e| Error::Invalid(format!("report page: {e:#}")))
    }
}
