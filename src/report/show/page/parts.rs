//! Common parts of all HTML pages: each is one file that fetches nothing.
//!
//! A page extends `base.html` (head, style, images, identity of the run) and fills its blocks
//! `title`, `style`, `header` and `main`.

use crate::show::words::{ms, percent};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use minijinja::{HtmlEscape, Value, context};
use serde::Serialize;
use svl_core::{Error, Result, printable};
use svl_files::overlay::Mark;

const PARTS: [(&str, &str); 7] = [
    ("base.html", include_str!("base.html")),
    ("frames.css", include_str!("frames.css")),
    ("frames.html", include_str!("frames.html")),
    ("page.js", include_str!("page.js")),
    ("kit.html", include_str!("kit.html")),
    ("tables.html", include_str!("tables.html")),
    ("style.css", include_str!("style.css")),
];

/// The template `page` with the values of `view`; `style` is its own CSS, `page.css`, and `parts`
/// are further templates that it includes, by their names. All texts are escaped, and a name that
/// `view` does not have is an error.
///
/// # Errors
/// [`Error::Invalid`] with the error of the template engine.
pub fn fill(
    page: &'static str,
    style: &'static str,
    parts: &[(&'static str, &'static str)],
    view: impl Serialize,
) -> Result<String> {
    let filled = || {
        let mut templates = minijinja::Environment::new();
        templates.set_trim_blocks(true);
        templates.set_lstrip_blocks(true);
        // A misspelt name in a template fails the tests instead of leaving a gap in a page.
        templates.set_undefined_behavior(minijinja::UndefinedBehavior::Strict);
        templates.add_filter("ms", ms);
        templates.add_filter("percent", |share: f64| percent(Some(share)));
        templates.add_filter("log_place", log_place);
        templates.add_filter("prose", prose);
        templates.add_filter("breaks", breaks);
        // The extension .html makes the engine escape texts.
        for (name, part) in PARTS
            .into_iter()
            .chain([("page.css", style), ("page.html", page)])
            .chain(parts.iter().copied())
        {
            templates.add_template(name, part)?;
        }
        templates.get_template("page.html")?.render(view)
    };
    let filled =
        filled().map_err(|e: minijinja::Error| Error::Invalid(format!("HTML page: {e:#}")))?;
    // The engine escapes what is HTML, not what controls a terminal.
    Ok(printable(&filled))
}

/// A text with code in backticks.
fn prose(text: &str) -> Value {
    let parts = text.split('`').enumerate().map(|(i, part)| {
        let part = HtmlEscape(part);
        match i % 2 {
            0 => part.to_string(),
            _ => format!("<code>{part}</code>"),
        }
    });
    Value::from_safe_string(parts.collect())
}

/// A list that breaks behind its commas, also where no space follows.
fn breaks(text: &str) -> Value {
    let broken = HtmlEscape(text).to_string().replace(',', ",<wbr>");
    Value::from_safe_string(broken.replace("<wbr> ", " "))
}

/// The place of a value between the ends of a logarithmic scale, percent of its length.
fn log_place(value: f64, low: f64, high: f64) -> f64 {
    if low < high && value > 0.0 {
        100.0 * (value / low).ln() / (high / low).ln()
    } else {
        0.0
    }
}

/// A colour in CSS.
pub(crate) fn css_color([r, g, b]: [u8; 3]) -> String {
    format!("rgb({r} {g} {b})")
}

/// An image file, PNG or JPEG, as a URL that holds it.
pub fn data_url(file: &[u8]) -> String {
    let kind = if file.starts_with(&[0xff, 0xd8]) {
        "jpeg"
    } else {
        "png"
    };
    format!("data:image/{kind};base64,{}", STANDARD.encode(file))
}

/// The image files of a page, each held once however often it is shown.
#[derive(Default)]
pub struct PageImages<'a>(Vec<(&'a [u8], (usize, usize))>);

/// A cell of a depth grid, drawn.
#[derive(Serialize)]
pub struct MarkView {
    #[serde(flatten)]
    mark: Mark,
    center: (f64, f64),
    radius: f64,
    /// Words of the cell, for pointer and screen reader; may be empty.
    words: String,
    /// True if it is crossed out.
    wrong: bool,
    /// True if it is outlined: it is not as it was before.
    pub(crate) changed: bool,
}

impl<'a> PageImages<'a> {
    /// The file, drawn at `size`, with marks over it.
    pub fn picture(
        &mut self,
        label: &str,
        file: &'a [u8],
        size: (usize, usize),
        marks: Vec<MarkView>,
    ) -> Value {
        let known = self.0.iter().position(|image| *image == (file, size));
        let image = known.unwrap_or(self.0.len());
        self.0.extend(known.is_none().then_some((file, size)));
        context! { label, image, width => size.0, height => size.1, marks }
    }

    /// The images for the template.
    pub fn into_views(self) -> Vec<Value> {
        let images = self.0.into_iter();
        let view = |(file, (width, height))| context! { url => data_url(file), width, height };
        images.map(view).collect()
    }
}

impl MarkView {
    pub fn new(mark: Mark, words: String, wrong: bool) -> Self {
        Self {
            mark,
            center: mark.cell.center(),
            radius: mark.cell.width.min(mark.cell.height) / 16.0,
            words,
            wrong,
            changed: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{breaks, prose};

    #[test]
    fn texts_are_escaped_once() {
        let code = prose("a < b: `svl & co`");
        assert_eq!(code.to_string(), "a &lt; b: <code>svl &amp; co</code>");
        assert_eq!(breaks("a=1,b=<, c").to_string(), "a=1,<wbr>b=&lt;, c");
    }
}
