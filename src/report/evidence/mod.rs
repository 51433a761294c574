//! A page of what the cells of v5 rest on: for each its disparities, the tolerance of its report,
//! the margin that is left, and what each piece of evidence is worth.

use super::page::fill;
use super::plot::{Axis, Chart, Series, SeriesStyle};
use crate::depth::decision::{
    BINS_PER_PX, Feature, Tolerance, VerdictTable, fill_empty_rows, fill_row,
};
use crate::error::Result;
use crate::files::encode_png;
use crate::stereo::{Cell, CellEvidence, CellRule, DepthGrid, Gray, Plane, Rig};
use serde::Serialize;
use std::ops::Range;

/// Everything the page shows.
pub struct EvidencePage<'a> {
    pub title: String,
    pub left: &'a Gray,
    /// Disparities of the pixels that were seen.
    pub disparity: &'a Plane<f32>,
    pub grid: &'a DepthGrid,
    pub rule: CellRule,
    pub rig: Option<&'a Rig>,
    pub table: VerdictTable,
    /// Part of the tolerance that is kept for the matcher, pixels.
    pub allowance_px: f64,
    /// How many bins of disparity there are.
    pub bins: usize,
    /// Identity of the run: names and values.
    pub identity: Vec<(String, String)>,
}

/// Ends of a gap that differ by more are of two surfaces, bins: v5's default.
const JUMP: i32 = 16;

/// The filled disparities of an image, and which of them were seen.
struct Pixels {
    width: usize,
    filled: Vec<i16>,
    seen: Vec<u8>,
}

impl EvidencePage<'_> {
    /// The page as HTML: one file without scripts, all texts escaped.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] with what the template engine or the plotting library says.
    pub fn render(&self) -> Result<String> {
        let pixels = Pixels::new(self.disparity);
        let tolerance = Tolerance::new(self.rule, self.rig, self.allowance_px, self.bins);
        let size = self.left.size();
        let cells = self.grid.iter().map(|(place, cell)| {
            let (columns, rows) = self.grid.shape().pixels(place, size);
            self.cell(place, cell, &pixels, &tolerance, (columns, rows))
        });
        let view = EvidenceView {
            title: &self.title,
            columns: self.grid.shape().columns,
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
        pixels: &Pixels,
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
            (_, Some(probability)) => format!("unknown, {:.0} % probable", 100.0 * probability),
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
                Some(evidence) => Some(plot(evidence, pixels, tolerance, columns, rows)?),
                None => None,
            },
            base: self.table.base,
            parts: evidence.map_or_else(Vec::new, |evidence| self.parts(&evidence)),
            score: evidence.map(|evidence| self.table.score(&evidence)),
        })
    }

    /// What each feature is worth, thousandths of the log odds.
    fn parts(&self, evidence: &CellEvidence) -> Vec<PartView> {
        let part = |feature: Feature| {
            let mut alone = CellEvidence {
                features: [i64::MIN; CellEvidence::FEATURES],
                ..*evidence
            };
            let value = evidence.features[feature as usize];
            alone.features[feature as usize] = value;
            PartView {
                name: feature.name(),
                value,
                unit: feature.unit(),
                score: self.table.score(&alone) - self.table.base,
            }
        };
        Feature::ALL.into_iter().map(part).collect()
    }
}

impl Pixels {
    fn new(disparity: &Plane<f32>) -> Self {
        let (width, height) = disparity.size();
        let bin = |px: f32| match px.is_finite() {
            true => (px * BINS_PER_PX as f32).round().clamp(0.0, 32_000.0) as i16,
            false => 0,
        };
        let bins: Vec<_> = disparity.pixels().map(bin).collect();
        let seen: Vec<_> = disparity
            .pixels()
            .map(|d| u8::from(d.is_finite()))
            .collect();
        let mut filled = vec![0; bins.len()];
        for y in 0..height {
            let row = y * width..(y + 1) * width;
            fill_row(
                &bins[row.clone()],
                &seen[row.clone()],
                JUMP,
                &mut filled[row],
            );
        }
        fill_empty_rows(&seen, width, &mut filled);
        Self {
            width,
            filled,
            seen,
        }
    }

    /// Disparities of the pixels in part of the image, of all or of those seen, rising.
    fn sorted(&self, columns: &Range<usize>, rows: &Range<usize>, seen: bool) -> Vec<i16> {
        let places = rows
            .clone()
            .flat_map(|y| columns.clone().map(move |x| y * self.width + x));
        let wanted = places.filter(|&at| !seen || self.seen[at] == 1);
        let mut bins: Vec<_> = wanted.map(|at| self.filled[at]).collect();
        bins.sort_unstable();
        bins
    }
}

/// How much of a cell is farther than each disparity, and where the report stands.
fn plot(
    evidence: &CellEvidence,
    pixels: &Pixels,
    tolerance: &Tolerance,
    columns: Range<usize>,
    rows: Range<usize>,
) -> Result<String> {
    let px = |bin: i64| bin as f64 / f64::from(BINS_PER_PX);
    let all = pixels.sorted(&columns, &rows, false);
    let share = |count: usize| 100.0 * count as f64 / all.len() as f64;
    let report = usize::try_from(evidence.report).unwrap_or_default();
    let [first, behind] = tolerance.within(report.min(tolerance.bins() - 1));
    let ends = [first as i64, behind as i64 - 1];
    let low = ends[0].min(i64::from(all[all.len() / 50]));
    let high = ends[1].max(i64::from(all[all.len() - 1 - all.len() / 50]));
    let room = (high - low) / 8 + 8;
    let span = (low - room).max(0)..=high + room;
    let curve = |name: &str, bins: &[i16]| {
        let below = |bin: i64| bins.partition_point(|of| i64::from(*of) < bin);
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
    let at_report = share(all.partition_point(|of| i64::from(*of) < evidence.report));
    let gap = (f64::NAN, f64::NAN);
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
            curve("seen", &pixels.sorted(&columns, &rows, true)),
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
                &[(px(*span.start()), 50.0), (px(*span.end()), 50.0)],
            ),
        ],
    }
    .svg()
}

#[derive(Serialize)]
struct EvidenceView<'a> {
    title: &'a str,
    columns: usize,
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
    base: i64,
    parts: Vec<PartView>,
    score: Option<i64>,
}

#[derive(Serialize)]
struct PartView {
    name: &'static str,
    value: i64,
    unit: &'static str,
    score: i64,
}
