//! `index.html`: one file that fetches nothing and is readable without its script. The answer comes
//! first, then frames as in the thesis's figure 7.3; all else is folded.

use super::{heat, plots, view};
use crate::pages::html::figures::ReportPage;
use crate::show::page::parts::fill;
use crate::show::page::plot_view::PlotView;
use std::path::Path;
use svl_core::{Error, Result};

impl ReportPage {
    /// Writes the page to a file.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        std::fs::write(path, self.render()?).map_err(|e| Error::io(path, e))
    }

    /// Writes each plot of the page as an SVG file into a folder.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn write_figures(&self, folder: &Path) -> Result<()> {
        let colors = self.colors();
        let plots = [
            plots::trade_offs,
            plots::speed,
            plots::accuracy,
            plots::reliability,
            plots::pieces,
        ];
        let plots = plots.iter().flat_map(|plots| plots(self, &colors));
        let plots = plots.chain(plots::maps(self, &colors, None));
        let heat = heat::heat_map(self);
        let heat = heat.map(|(grid, _)| PlotView::new(&grid.title, "", grid.svg()));
        let stress = plots::stress(self, &colors).into_iter();
        let groups = stress.map(|(name, _, plots)| (name, plots));
        let groups = groups.chain([("", plots.collect()), ("heat map", Vec::from_iter(heat))]);
        for (name, plots) in groups {
            plots.iter().try_for_each(|plot| plot.write(folder, name))?;
        }
        Ok(())
    }

    /// The page. All texts are escaped.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the error of the template engine.
    pub fn render(&self) -> Result<String> {
        let parts = [("headline.html", include_str!("headline.html"))];
        let (page, style) = (include_str!("index.html"), include_str!("page.css"));
        let page = fill(page, style, &parts, view::view(self))?;
        Ok(page.replacen("<!-- contents -->", &contents(&page), 1))
    }
}

/// Links to the parts of a page that have a heading for its contents.
fn contents(page: &str) -> String {
    let links = page.split(" id=\"").filter_map(|part| {
        let (id, rest) = part.split_once("\" data-contents=\"")?;
        let (title, _) = rest.split_once('"')?;
        let is_own = !id.contains('"');
        is_own.then(|| format!("<a href=\"#{id}\">{title}</a>\n"))
    });
    links.collect()
}

#[cfg(test)]
mod tests {
    use super::contents;

    #[test]
    fn contents_are_the_parts_with_a_heading() {
        let page = "<i id=\"a\" title=\"x\"><section id=\"b\" data-contents=\"B &lt;\">";
        assert_eq!(contents(page), "<a href=\"#b\">B &lt;</a>\n");
    }
}
