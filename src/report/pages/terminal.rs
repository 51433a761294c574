//! A summary on the terminal: the answer first.

use crate::results::summary::Results;
use crate::show::table::model::TableCell;
use crate::show::table::terminal::{TerminalStyle, wrapped};
use svl_core::stereo::TruthOrigin;
use svl_core::{counted, joined};
use svl_score::judge::{ColumnChoice, Metric, TruthLevel};

/// Largest number of algorithms that are all shown, and the number of the first ones shown of
/// more.
const MAX_ALGORITHMS: usize = 15;
const FIRST_ALGORITHMS: usize = 12;

/// Head of a caution, below whose words it continues.
const CAUTION: &str = "warning: ";

impl Results {
    /// The extent of the run, the answer, the headline table and the cautions; the tables of
    /// perturbations. `explain`: the meanings of the columns, too.
    pub fn terminal(&self, title: &str, style: TerminalStyle, explain: bool) -> String {
        let head = format!("{title}: {}", self.scope_words());
        let mut text = wrapped(&head, 2, style.width);
        let answer = self.answer().join(" ");
        if !answer.is_empty() {
            text.push('\n');
            text.push_str(&wrapped(&answer, 0, style.width));
        }
        let mut table = self.headline();
        let is_all = self.shown.columns == ColumnChoice::All;
        if table.rows.is_empty() {
            if self.ending.is_whole() {
                text.push_str("no pairs\n");
            }
        } else {
            let count = table.rows.len();
            let has_few = count <= MAX_ALGORITHMS || is_all;
            let best = self.best.iter().map(|best| &best.algorithm);
            let kept = best.chain(self.references.iter().map(|own| &own.algorithm));
            let kept = kept.map(|label| TableCell::Text(label.clone()));
            let kept: Vec<_> = kept.collect();
            let mut places = 0..;
            let is_first = |place: Option<usize>| place < Some(FIRST_ALGORITHMS);
            table
                .rows
                .retain(|row| is_first(places.next()) || has_few || kept.contains(&row[0]));
            text.push('\n');
            text.push_str(&table.terminal(style));
            match count - table.rows.len() {
                0 => {}
                more => text += &format!("and {more} more: see the page, or --columns all\n"),
            }
            let legend = self.legend().into_iter();
            text.extend(legend.map(|line| wrapped(&line, 2, style.width)));
        }
        let absent = self.absent_columns();
        if !absent.is_empty() {
            let names = joined(absent.iter().map(|metric| metric.name));
            // A source of the truth is named once, for all of them.
            let cure = if self.truth.is_empty() && absent.iter().any(|m| m.against_truth) {
                "; to compare with ground truth, name a sensor, or a board in view, by --truth"
            } else {
                ""
            };
            let words = format!("not measured in this run: {names}{cure}");
            text.push_str(&wrapped(&words, 2, style.width));
        }
        let detailed = self.drive_table().into_iter().chain(self.accuracy_tables());
        let detailed = detailed.filter(|_| is_all);
        let more = detailed
            .chain(self.latency_table())
            .chain(self.piece_table());
        let more = more.chain(self.stress_tables());
        let tables: Vec<_> = [table].into_iter().chain(more).collect();
        for table in &tables[1..] {
            text.push_str(&format!("\n{}\n{}", table.title, table.terminal(style)));
        }
        if explain {
            text.push('\n');
            for (term, meaning) in tables.iter().flat_map(|table| &table.notes) {
                let indent = term.chars().count() + 2;
                text.push_str(&wrapped(&format!("{term}: {meaning}"), indent, style.width));
            }
        }
        let cautions = self.cautions();
        text.push_str(if cautions.is_empty() { "" } else { "\n" });
        let cautions = cautions.iter().map(|caution| format!("{CAUTION}{caution}"));
        text.extend(cautions.map(|line| wrapped(&line, CAUTION.len(), style.width)));
        text
    }

    /// The columns that were asked for and that no algorithm has.
    fn absent_columns(&self) -> Vec<&'static Metric> {
        let ColumnChoice::Named(metrics) = &self.shown.columns else {
            return Vec::new();
        };
        let has = |metric: &&&Metric| {
            let mut algorithms = self.algorithms.iter();
            algorithms.any(|a| self.value(&a.algorithm, metric, None).is_some())
        };
        metrics.iter().filter(|m| !has(m)).copied().collect()
    }

    /// The numbers of scored pairs and cells, if they are not all.
    fn scored_words(&self) -> Option<String> {
        let (pairs, cells) = self.basis.scope.scored.filter(|_| self.drives.is_empty())?;
        if pairs < self.basis.scope.pairs {
            return Some(format!("{pairs} scored with {}", counted(cells, "cell")));
        }
        let all = pairs * self.basis.scope.cells_of_pair;
        (cells < all).then(|| format!("{cells} of {all} cells scored"))
    }

    /// The extent of the run in words: pairs, size, runs, origin of the truth.
    pub fn scope_words(&self) -> String {
        let scope = &self.basis.scope;
        if self.algorithms.is_empty() && !self.ending.is_whole() {
            return "no results yet".to_owned();
        }
        let size = match scope.sizes[..] {
            [] => String::new(),
            [(width, height)] => format!(" of {width} x {height}"),
            _ => format!(" of {} sizes", scope.sizes.len()),
        };
        let runs = (scope.runs > 1).then(|| counted(scope.runs, "run"));
        let courses = self.drives.iter().map(|drive| drive.courses).max();
        let courses = courses.map(|courses| counted(courses, "course"));
        let exact = TruthOrigin::Exact.to_string();
        let truth = match &self.truth[..] {
            // All failed.
            [] if scope.pairs == 0 => String::new(),
            [] => "no ground truth".to_owned(),
            [one] if *one == exact && self.kind() == TruthLevel::Disparities => {
                "truth of the data set".to_owned()
            }
            [one] if *one == exact => "exact truth".to_owned(),
            _ => self.caution().unwrap_or_default(),
        };
        let pairs = format!("{}{size}", counted(scope.pairs, "pair"));
        let (scored, area) = (self.scored_words(), self.area_words());
        let near = self.near_words();
        let parts = [
            Some(pairs),
            scored,
            area,
            near,
            courses.or(runs),
            Some(truth),
        ];
        joined(parts.into_iter().flatten().filter(|part| !part.is_empty()))
    }
}
