//! `index.html`: one file that fetches nothing and is readable without its script. The answer comes
//! first, then frames as in the thesis's figure 7.3; all else is folded.

use super::{heat, plots, shades, stored, view};
use crate::pages::html::figures::CheckpointFigure;
use crate::pages::html::figures::ParameterSweep;
use crate::pages::html::figures::SceneFigure;
use crate::results::gate::GateState;
use crate::results::summary::Results;
use crate::rows::records::{CellRow, Row};
use crate::show::page::parts::fill;
use crate::show::page::plot_view::PlotView;
use crate::show::plot::map::CourseMap;
use crate::show::plot::series::AlgorithmColors;
use crate::show::table::model::Table;
use serde::{Deserialize, Serialize};
use std::path::Path;
use svl_core::{Error, Result};
use svl_files::overlay::Mark;
use svl_score::judge::CellFinding;
use svl_score::manifest::Manifest;

/// Everything the page shows.
pub struct ReportPage {
    /// The manifest, whose scenario is the title.
    pub manifest: Manifest,
    /// The scenario's prose; an empty line begins a paragraph.
    pub description: String,
    pub summary: Results,
    /// Per algorithm the time of each pair, ms.
    pub times_ms: Vec<(String, Vec<f64>)>,
    /// The results of the scenario's limits, if they were asked for, in words.
    pub gate: Vec<(GateState, String)>,
    pub sweeps: Vec<ParameterSweep>,
    /// One figure per checkpoint, or per frame that is shown of a recording.
    pub figures: Vec<CheckpointFigure>,
    /// Scenes, if the frames are those of a data set.
    pub scenes: Vec<SceneFigure>,
    /// The results per scene or course.
    pub cases: Option<Table>,
    /// Courses that algorithms drove through.
    pub maps: Vec<CourseMap>,
}

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

    /// True for an algorithm of a sweep.
    pub(super) fn is_swept(&self, label: &str) -> bool {
        let mut points = self.sweeps.iter().flat_map(|sweep| &sweep.points);
        points.any(|(_, own)| own == label)
    }

    /// The colours of the algorithms.
    pub(super) fn colors(&self) -> AlgorithmColors<'_> {
        let shades = shades::parameter_shades(self);
        let colors = shades.iter().flat_map(|shade| shade.colors.iter().copied());
        AlgorithmColors::new(self.manifest.labels()).with_shades(colors)
    }

    /// The page. All texts are escaped.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the error of the template engine.
    pub fn render(&self) -> Result<String> {
        let parts = [
            ("headline.html", include_str!("headline.html")),
            ("page.js", include_str!("page.js")),
        ];
        let (page, style) = (include_str!("index.html"), include_str!("page.css"));
        fill(page, style, &parts, view::view(self))
    }
}
