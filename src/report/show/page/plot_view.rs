//! Plots of pages, on the page and as files of their own.

use serde::Serialize;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use svl_core::{Error, Result};

/// A plot of a page, with its heading and caption.
#[derive(Serialize)]
pub struct PlotView {
    pub title: String,
    pub about: &'static str,
    pub svg: String,
}

impl PlotView {
    pub fn new(title: &str, about: &'static str, svg: String) -> Self {
        Self {
            title: title.to_owned(),
            about,
            svg,
        }
    }

    /// Writes it as an SVG document on white. The file has the name of `group`, which may be empty,
    /// and of the title.
    ///
    /// # Errors
    /// [`Error::Io`] with the file, also where there is one of that name.
    pub fn write(&self, folder: &Path, group: &str) -> Result<()> {
        let path = folder.join(file_name(&format!("{group} {}", self.title)));
        let written = File::create_new(&path).and_then(|mut file| {
            let document = self.document();
            file.write_all(document.as_bytes())
        });
        written.map_err(|e| Error::io(path, e))
    }

    fn document(&self) -> String {
        let title = quick_xml::escape::escape(&self.title);
        let head = format!(
            ">\n<title>{title}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>"
        );
        self.svg.replacen('>', &head, 1)
    }
}

/// The words of `text` as the name of a file.
fn file_name(text: &str) -> String {
    let text = text.to_lowercase();
    let words = text.split(|c: char| !c.is_alphanumeric() && c != '_');
    let words: Vec<_> = words.filter(|word| !word.is_empty()).collect();
    words.join("-") + ".svg"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_has_its_title_first_and_replaces_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let plot = PlotView {
            title: "A < B, %".into(),
            about: "",
            svg: "<svg viewBox=\"0 0 1 1\"><g></g></svg>".into(),
        };
        plot.write(folder.path(), "noise_2").unwrap();
        let path = folder.path().join("noise_2-a-b.svg");
        let text = std::fs::read_to_string(path).unwrap();
        assert!(
            text.starts_with("<svg viewBox=\"0 0 1 1\">\n<title>A &lt; B, %</title>\n<rect"),
            "{text}"
        );
        plot.write(folder.path(), "noise_2").unwrap_err();
    }
}
