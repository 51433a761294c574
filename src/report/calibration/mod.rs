//! What a calibration leaves to read: one HTML file without scripts or anything to fetch.

mod view;

use crate::calibrate::Solution;
use crate::error::{Error, Result};
use std::path::Path;

/// Everything the page shows.
pub struct Page<'a> {
    pub title: String,
    pub solution: &'a Solution,
    /// What each view is called, such as its file or frame; their numbers where there are none.
    pub names: Vec<String>,
    /// What identifies the run: names and values.
    pub identity: Vec<(String, String)>,
}

impl Page<'_> {
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
            .add_template("page.html", include_str!("page.html"))
            .and_then(|()| templates.add_template("style.css", include_str!("../html/style.css")))
            .and_then(|()| templates.add_template("page.css", include_str!("page.css")))
            .and_then(|()| templates.get_template("page.html")?.render(view::View::of(self)))
            .map_err(|e| Error::Invalid(format!("calibration page: {e:#}")))
    }
}
