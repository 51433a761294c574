//! A run case by case: a row per scene of a data set, or per course, and a column per algorithm.

use super::choice::{answer_metrics, better_first};
use super::summary::Results;
use crate::rows::records::Row;
use crate::rows::samples::{grouped, is_scene, total};
use crate::show::table::model::Table;
use crate::show::words::{NONE, number};
use crate::subjects::drives::DriveRow;
use crate::subjects::recordings::RecordingSummary;
use std::collections::BTreeMap;
use svl_core::counted;
use svl_score::judge::{Metric, TruthLevel};

/// Limit of the rows: the tables of the report have all cases.
const MAX_CASES: usize = 40;

/// A scene or a course, and of each algorithm the value and the outcome in words.
struct Case {
    name: String,
    outcomes: BTreeMap<String, (Option<f64>, String)>,
}

impl Results {
    /// The metric of the answer per recording, the worst of the first candidate of the ranking
    /// first; none for a single one.
    pub fn recording_table(&self) -> Option<Table> {
        let metric = *answer_metrics(self.kind()).first()?;
        let outcome = |own: &RecordingSummary| {
            let value = own.metrics.get(metric.name).copied();
            let words = value.map_or_else(|| NONE.to_owned(), |value| number(metric.unit, value));
            (own.algorithm.clone(), (value, words))
        };
        let case = |own: &[&RecordingSummary]| Case {
            name: own[0].run.clone(),
            outcomes: own.iter().map(|own| outcome(own)).collect(),
        };
        let all: Vec<_> = self.recordings.iter().collect();
        let cases = grouped(&all, |own| &own.run, case);
        let title = format!("Recordings: {}, %", metric.words);
        self.table_by_case(metric, title, "recording", cases)
    }

    /// The metric of the answer per scene, or the outcome of each drive; first the case in which
    /// the first candidate of the ranking is worst. `rows` and `drives`: those that the summary is
    /// of. None for other runs and for a single case.
    pub fn case_table(&self, rows: &[Row], drives: &[DriveRow]) -> Option<Table> {
        let is_driven = self.kind() == TruthLevel::Courses;
        let (metric, cases) = if is_driven {
            (Metric::find("collisions")?, courses(drives))
        } else {
            let metric = *answer_metrics(self.kind()).first()?;
            (metric, scenes(metric, rows))
        };
        let (title, head) = if is_driven {
            ("Outcome of each drive".to_owned(), "course")
        } else {
            (format!("Scenes: {}, %", metric.words), "scene")
        };
        let table = self.table_by_case(metric, title, head, cases)?;
        let meanings: &[&str] = &[
            "✓: the goal was reached without a collision and without help",
            "stuck: the robot got stuck and was set back on the route",
            "late: the goal was not reached in time",
        ];
        Some(table.with_notes(if is_driven { meanings } else { &[] }))
    }

    /// A row per case, the worst of the first candidate first; none for a single case.
    fn table_by_case(
        &self,
        metric: &Metric,
        title: String,
        head: &str,
        mut cases: Vec<Case>,
    ) -> Option<Table> {
        let ranked = self.ranked_algorithms();
        let fit = ranked.iter().find(|a| self.may_be_best(a));
        let best = &fit.or(ranked.first())?.algorithm;
        let value = |case: &Case| case.outcomes.get(best)?.0;
        // Stable: equal cases keep their order.
        cases.sort_by(|a, b| better_first(metric, value(b), value(a)));
        let labels = || ranked.iter().map(|a| a.algorithm.as_str());
        let mut table = Table::new(title, head).with_columns(labels());
        for case in cases.iter().take(MAX_CASES) {
            let words = |label| case.outcomes.get(label).map_or(NONE, |(_, words)| words);
            table.push(&case.name, labels().map(words).map(str::to_owned));
        }
        let more = cases.len().saturating_sub(MAX_CASES);
        let more = (more > 0).then(|| format!("; {more} more are in the report's tables"));
        let more = more.unwrap_or_default();
        table.note("order", format!("by {best}, the worst first{more}"));
        (cases.len() > 1).then_some(table)
    }
}

/// The scenes of a data set: its frames have names.
fn scenes(metric: &Metric, rows: &[Row]) -> Vec<Case> {
    let rows = rows.iter();
    let rows = rows.filter(|row| row.stress.is_none() && is_scene(row));
    let outcome = |row: &&Row| {
        let value = total(metric, &[row]);
        let words = value.map_or_else(|| NONE.to_owned(), |value| number(metric.unit, value));
        (row.algorithm.clone(), (value, words))
    };
    let case = |own: &[&Row]| Case {
        name: own[0].name.clone(),
        outcomes: own.iter().map(outcome).collect(),
    };
    grouped(&rows.collect::<Vec<_>>(), |row| &row.name, case)
}

fn courses(drives: &[DriveRow]) -> Vec<Case> {
    let drives = drives.iter().filter(|drive| drive.stress.is_none());
    let outcome = |drive: &&DriveRow| {
        // A drive that did not finish without a collision is worse than a finished one.
        let value = drive.collisions as f64 + if drive.finished { 0.0 } else { 0.5 };
        (drive.algorithm.clone(), (Some(value), drive_words(drive)))
    };
    let case = |own: &[&DriveRow]| Case {
        name: format!("course {}", own[0].seed),
        outcomes: own.iter().map(outcome).collect(),
    };
    grouped(&drives.collect::<Vec<_>>(), |drive| drive.seed, case)
}

fn drive_words(drive: &DriveRow) -> String {
    if drive.finished {
        return "✓".to_owned();
    }
    let hits = (drive.collisions > 0).then(|| counted(drive.collisions, "hit"));
    let stuck = (drive.stuck > 0).then(|| "stuck".to_owned());
    let late = (!drive.arrived).then(|| "late".to_owned());
    let words = hits.into_iter().chain(stuck).chain(late);
    words.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::show::table::model::TableCell;
    use crate::subjects::drives::tests::drive;
    use crate::subjects::speed::tests::row;

    fn texts(table: &Table) -> Vec<Vec<&str>> {
        fn text(cell: &TableCell) -> &str {
            match cell {
                TableCell::Text(text) => text,
                _ => "",
            }
        }
        let rows = table.rows.iter();
        rows.map(|row| row.iter().map(text).collect()).collect()
    }

    #[test]
    fn the_worst_scene_of_the_best_algorithm_is_first() {
        let scene = |name: &str, algorithm: &str, bad: Option<f64>| {
            let mut row = Row {
                name: name.into(),
                algorithm: algorithm.into(),
                ..row(1000, (64, 48), None)
            };
            row.metrics.set("total_bad2", bad);
            row.metrics.set("invalid", Some(0.1));
            row
        };
        let rows = [
            scene("a", "worse", Some(0.3)),
            scene("a", "best", Some(0.1)),
            scene("b", "worse", Some(0.2)),
            scene("b", "best", Some(0.2)),
            scene("c", "worse", Some(0.5)),
            scene("c", "best", None),
        ];
        let summary = Results::from_rows(&rows, &[], None);
        let table = summary.case_table(&rows, &[]).unwrap();
        let expected = [
            ["c", "–", "50.0"],
            ["b", "20.0", "20.0"],
            ["a", "10.0", "30.0"],
        ];
        assert_eq!(texts(&table), expected);
        assert_eq!(summary.case_table(&rows[..2], &[]), None);
    }

    #[test]
    fn an_outcome_is_a_mark_or_its_reasons() {
        let drive = DriveRow {
            finished: false,
            collisions: 1,
            ..drive(1, "v5")
        };
        let words = |change: fn(&mut DriveRow)| {
            let mut drive = drive.clone();
            change(&mut drive);
            drive_words(&drive)
        };
        assert_eq!(words(|_| ()), "1 hit");
        assert_eq!(words(|drive| drive.finished = true), "✓");
        assert_eq!(
            words(|drive| (drive.collisions, drive.stuck, drive.arrived) = (2, 1, false)),
            "2 hits, stuck, late"
        );
    }
}
