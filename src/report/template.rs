//! How every page is made of its template.

use serde::Serialize;

/// What pages share: the style, and how the marks of a grid are drawn.
const PARTS: [(&str, &str); 2] = [
    ("style.css", include_str!("html/style.css")),
    ("marks.html", include_str!("html/marks.html")),
];

/// The page `text` filled with `view`; `own` are files that it includes besides, by name. All texts
/// are escaped, and a name that `view` lacks is an error.
///
/// # Errors
/// What the template engine says.
pub(crate) fn fill(
    text: &'static str,
    own: &[(&'static str, &'static str)],
    view: impl Serialize,
) -> Result<String, minijinja::Error> {
    let mut templates = minijinja::Environment::new();
    templates.set_trim_blocks(true);
    templates.set_lstrip_blocks(true);
    templates.set_undefined_behavior(minijinja::UndefinedBehavior::Strict);
    for (name, part) in PARTS.iter().chain(own) {
        templates.add_template(name, part)?;
    }
    // By its ending texts are escaped as in HTML.
    templates.add_template("page.html", text)?;
    templates.get_template("page.html")?.render(view)
}
