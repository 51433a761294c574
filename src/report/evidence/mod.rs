//! Page of the evidence for the cells of v5: for each its disparities, the tolerance of its report,
//! the remaining margin, and the weight of each piece of evidence.

use super::page::fill;
use super::plot::{Axis, Chart, Series, SeriesStyle};
use super::table::Table;
use serde::Serialize;
use std::ops::Range;
use svl_core::Result;
use svl_core::depth::decision::{BINS_PER_PX, Feature, FilledMap, SafeChoice, Tolerance};
use svl_core::stereo::{Cell, CellEvidence, CellRule, DepthGrid, Gray, Plane, Rig};
use svl_files::encode_png;

/// Everything the page shows.
pub struct EvidencePage<'a> {
    pub title: String,
    pub left: &'a Gray,
    /// Disparities of the pixels that were seen.
    pub disparity: &'a Plane<f32>,
    pub grid: &'a DepthGrid,
    pub rule: CellRule,
    pub rig: Option<&'a Rig>,
    /// The decision on the cells.
    pub choice: SafeChoice,
    /// Identity of the run: names and values.
    pub identity: Vec<(String, String)>,
}

impl EvidencePage<'_> {
    /// The page as HTML: one file without scripts, all texts escaped.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the template engine or of the plotting
    /// library.
    pub fn render(&self) -> Result<String> {
        let SafeChoice {
            table,
            jump,
            allowance_px,
            ..
        } = &self.choice;
        let pixels = FilledMap::new(self.disparity, *jump);
        let reports = self.grid.iter().filter_map(|(_, cell)| cell.evidence);
        let most = reports.map(|evidence| evidence.report).max().unwrap_or(0);
        let tolerance = Tolerance::new(self.rule, self.rig, *allowance_px, most as usize + 1);
        let size = self.left.size();
        let cells = self.grid.iter().map(|(place, cell)| {
            let (columns, rows) = self.grid.shape().pixels(place, size);
            self.cell(place, cell, &pixels, &tolerance, (columns, rows))
        });
        let view = EvidenceView {
            title: &self.title,
            rank: table.rank,
            cells: cells.collect::<Result<_>>()?,
            images: [],
            identity: &self.identity,
            incomplete: None,
        };
        fill(include_str!("page.html"), include_str!("page.css"), view)
    }

    fn cell(
        &self,
        (column, row): (usize, usize),
        cell: &Cell,
        pixels: &FilledMap,
        tolerance: &Tolerance,
        (columns, rows): (Range<usize>, Range<usize>),
    ) -> Result<EvidenceCellView> {
        let crop: Vec<_> = rows
            .clone()
            .flat_map(|y| self.left.row(y)[columns.clone()].iter().copied())
            .collect();
        let image = encode_png(columns.len(), rows.len(), &crop)?;
        let answer = match (&cell.depth, cell.probability) {
            (Some(depth), Some(probability)) => {
                let metres = depth.distance_m.map(|m| format!(", {m:.2} m"));
                let metres = metres.unwrap_or_default();
                let percent = 100.0 * probability;
                format!("{} px{metres}, {percent:.0} % probable", depth.median_px)
            }
            (_, Some(probability)) => match cell.near {
                Some(near) => format!("near, {:.0} % probable", 100.0 * near),
                None => format!("unknown, {:.0} % probable", 100.0 * probability),
            },
            (_, None) => "unknown, nothing seen".to_owned(),
        };
        let evidence = cell
            .evidence
            .filter(|_| !columns.is_empty() && !rows.is_empty());
        Ok(EvidenceCellView {
            place: format!("column {column}, row {row}"),
            answer,
            is_known: cell.depth.is_some(),
            image: super::page::data_url(&image),
            plot: match &evidence {
                Some(evidence) => Some(self.plot(evidence, pixels, tolerance, (columns, rows))?),
                None => None,
            },
            table: evidence.map(|evidence| self.table(&evidence)),
        })
    }

    /// Fraction of a cell that is farther than each disparity, with the report marked.
    fn plot(
        &self,
        evidence: &CellEvidence,
        pixels: &FilledMap,
        tolerance: &Tolerance,
        (columns, rows): (Range<usize>, Range<usize>),
    ) -> Result<String> {
        let px = |bin: i64| bin as f64 / f64::from(BINS_PER_PX);
        let all = sorted(pixels, &columns, &rows, false);
        let share = |count: usize| 100.0 * count as f64 / all.len() as f64;
        // A tolerance that reaches to nearly no distance would hide the rest of the plot.
        let last = i64::from(*all.last().expect("a cell with pixels"));
        let farthest = 2 * evidence.report.max(last) + 8;
        let ends = tolerance.ends(usize::try_from(evidence.report).unwrap_or_default());
        let ends = ends.map(|end| i64::from(end).clamp(0, farthest));
        let low = ends[0].min(i64::from(all[all.len() / 50]));
        let high = ends[1].max(i64::from(all[all.len() - 1 - all.len() / 50]));
        let room = (high - low) / 8 + 8;
        let span = (low - room).max(0)..=high + room;
        let curve = |name: &str, bins: &[i16]| {
            let below = |bin: i64| bins.partition_point(|score| i64::from(*score) < bin);
            let points = span.clone().map(|bin| (px(bin), share(below(bin))));
            Series {
                name: name.to_owned(),
                form: SeriesStyle::Line,
                points: points.collect(),
            }
        };
        let line = |name: &str, form, points: &[(f64, f64)]| Series {
            name: name.to_owned(),
            form,
            points: points.to_vec(),
        };
        let [left, right] = ends.map(px);
        let at_report = share(all.partition_point(|score| i64::from(*score) < evidence.report));
        let gap = (f64::NAN, f64::NAN);
        let rank = self.choice.table.rank as f64;
        Chart {
            title: String::new(),
            x: Axis {
                range: Some((px(*span.start()), px(*span.end()))),
                ..Axis::new("disparity, px")
            },
            y: Axis {
                range: Some((0.0, 100.0)),
                ..Axis::share("farther, % of the cell")
            },
            series: vec![
                curve("all, gaps filled", &all),
                curve("seen", &sorted(pixels, &columns, &rows, true)),
                line(
                    "tolerance",
                    SeriesStyle::Line,
                    &[
                        (left, 0.0),
                        (left, 100.0),
                        gap,
                        (right, 0.0),
                        (right, 100.0),
                    ],
                ),
                line(
                    "report",
                    SeriesStyle::Points,
                    &[(px(evidence.report), at_report)],
                ),
                line(
                    "",
                    SeriesStyle::Line,
                    &[(px(*span.start()), rank), (px(*span.end()), rank)],
                ),
            ],
        }
        .svg()
    }

    /// Weight of each feature in the log odds.
    fn table(&self, evidence: &CellEvidence) -> Table {
        let decision = &self.choice.table;
        let odds = |score: i64| format!("{:+.2}", score as f64 / 1000.0);
        let mut table = Table::new("", "evidence").with_columns(["value", "log odds"]);
        table.push("base", [String::new(), odds(decision.base)]);
        for feature in Feature::ALL {
            let mut alone = CellEvidence {
                features: [CellEvidence::NOT_MEASURED; CellEvidence::FEATURES],
                ..*evidence
            };
            let value = evidence.features[feature as usize];
            if value == CellEvidence::NOT_MEASURED {
                continue;
            }
            alone.features[feature as usize] = value;
            let score = decision.score(&alone) - decision.base;
            table.push(
                feature.name(),
                [format!("{value} {}", feature.unit()), odds(score)],
            );
        }
        table.push("sum", [String::new(), odds(decision.score(evidence))]);
        table
    }
}

/// Disparities of the pixels in part of the image, of all or of those seen, rising.
fn sorted(map: &FilledMap, columns: &Range<usize>, rows: &Range<usize>, seen: bool) -> Vec<i16> {
    let places = rows
        .clone()
        .flat_map(|y| columns.clone().map(move |x| y * map.width + x));
    let wanted = places.filter(|&at| !seen || map.seen[at] == 1);
    let mut bins: Vec<_> = wanted.map(|at| map.bins[at]).collect();
    bins.sort_unstable();
    bins
}

#[derive(Serialize)]
struct EvidenceView<'a> {
    title: &'a str,
    /// The requested percentile.
    rank: i64,
    cells: Vec<EvidenceCellView>,
    images: [(); 0],
    identity: &'a [(String, String)],
    incomplete: Option<String>,
}

#[derive(Serialize)]
struct EvidenceCellView {
    place: String,
    answer: String,
    is_known: bool,
    image: String,
    plot: Option<String>,
    table: Option<Table>,
}
