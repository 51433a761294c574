//! A run case by case: a row per scene of a data set, or per course, and a column per algorithm.

use super::choice::{answer_metrics, better_first};
use super::summary::Results;
use crate::rows::held::{RowRef, Rows};
use crate::rows::samples::{grouped, total};
use crate::show::table::model::{Table, TableCell, TextColumn};
use crate::show::words::{NONE, number};
use crate::subjects::drives::DriveRow;
use crate::subjects::recordings::RecordingSummary;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use svl_core::counted;
use svl_score::judge::{Metric, TruthLevel};

/// Limit of the rows: the tables of the report have all cases.
const MAX_CASES: usize = 40;

const OUTCOMES: [TextColumn<DriveRow>; 8] = [
    ("", "course", |own| format!("course {}", own.seed)),
    ("", "algorithm", |own| own.algorithm.clone()),
    ("", "outcome", |own| drive_words(own)),
    ("", "near misses", |own| own.near_misses.to_string()),
    ("", "first hit, m", |own| {
        let first = own.first_collision_m;
        first.map_or_else(|| NONE.to_owned(), |m| format!("{m:.1}"))
    }),
    ("", "driven, m", |own| format!("{:.1}", own.route_m)),
    ("", "of, m", |own| format!("{:.1}", own.course_m)),
    ("", "time, s", |own| format!("{:.1}", own.duration_s)),
];

/// A scene or a recording, and of each algorithm the value and the outcome in words.
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
    pub fn case_table(&self, rows: &Rows, drives: &[DriveRow]) -> Option<Table> {
        if self.kind() == TruthLevel::Courses {
            return self.drive_cases(drives);
        }
        let metric = *answer_metrics(self.kind()).first()?;
        let title = format!("Scenes: {}, %", metric.words);
        self.table_by_case(metric, title, "scene", scenes(metric, rows))
    }

    /// A row per course and algorithm; none for a single course.
    fn drive_cases(&self, drives: &[DriveRow]) -> Option<Table> {
        let mut drives: Vec<_> = drives.iter().filter(|own| own.stress.is_none()).collect();
        let ranked = self.ranked_algorithms();
        let place = |own: &DriveRow| ranked.iter().position(|a| a.algorithm == own.algorithm);
        let best = self.cited()?;
        let own = drives.iter().filter(|own| own.algorithm == best);
        // A drive that did not finish without a collision is worse than a finished one.
        let own = own.map(|own| (own.seed, (own.collisions, !own.finished)));
        let own: BTreeMap<_, _> = own.collect();
        drives.sort_by_key(|drive| (Reverse(own.get(&drive.seed)), drive.seed, place(drive)));
        let mut table = Table::from_items("Outcome of each drive", &OUTCOMES, drives.clone());
        table.columns[1].is_text = true;
        table.columns[2].is_text = true;
        for (row, drive) in table.rows.iter_mut().zip(&drives) {
            if !drive.finished {
                row[2] = TableCell::Alert(drive_words(drive));
            }
        }
        let table = table.with_notes(&[
            "✓: the goal was reached without a collision and without help",
            "stuck: the robot got stuck and was set back on the route",
            "late: the goal was not reached in time",
        ]);
        drives
            .iter()
            .any(|own| own.seed != drives[0].seed)
            .then_some(table)
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
        let best = self.cited()?;
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
fn scenes(metric: &Metric, rows: &Rows) -> Vec<Case> {
    let rows = rows.iter();
    let rows = rows.filter(|row| row.stress().is_none() && row.origin().is_scene());
    let outcome = |row: &RowRef<'_>| {
        let value = total(metric, &[*row]);
        let words = value.map_or_else(|| NONE.to_owned(), |value| number(metric.unit, value));
        (row.algorithm().to_owned(), (value, words))
    };
    let case = |own: &[RowRef<'_>]| Case {
        name: own[0].name().to_owned(),
        outcomes: own.iter().map(outcome).collect(),
    };
    grouped(&rows.collect::<Vec<_>>(), |row| row.name(), case)
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
    use crate::results::summary::{ReportTables, ResultParts, Shown};
    use crate::rows::held::{Row, Rows};
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
        let scenes = [
            scene("a", "worse", Some(0.3)),
            scene("a", "best", Some(0.1)),
            scene("b", "worse", Some(0.2)),
            scene("b", "best", Some(0.2)),
            scene("c", "worse", Some(0.5)),
            scene("c", "best", None),
        ];
        let first: Rows = scenes[..2].iter().cloned().collect();
        let rows: Rows = scenes.into_iter().collect();
        let summary = Results::from_rows(&rows, &[], None);
        let table = summary.case_table(&rows, &[]).unwrap();
        let expected = [
            ["c", "–", "50.0"],
            ["b", "20.0", "20.0"],
            ["a", "10.0", "30.0"],
        ];
        assert_eq!(texts(&table), expected);
        assert_eq!(summary.case_table(&first, &[]), None);
    }

    #[test]
    fn each_drive_is_a_row_and_the_worst_course_is_first() {
        let mut drives = [drive(1, "a"), drive(1, "b"), drive(2, "a"), drive(2, "b")];
        (drives[2].finished, drives[2].collisions) = (false, 2);
        (drives[3].finished, drives[3].collisions) = (false, 5);
        drives[2].first_collision_m = Some(1.25);
        let rows = drives.iter().map(|own| Row {
            algorithm: own.algorithm.clone(),
            ..row(1000, (64, 48), None)
        });
        let tables = ReportTables {
            rows: rows.collect(),
            drives: drives.to_vec(),
            ..ReportTables::default()
        };
        let own = Results::new(&tables, ResultParts::default(), Shown::default()).unwrap();
        assert_eq!(own.cited(), Some("a"));
        let table = own.case_table(&Rows::default(), &drives).unwrap();
        let names = table.rows.iter().map(|row| [row[0].text(), row[1].text()]);
        let names: Vec<_> = names.map(|own| own.join(" ")).collect();
        let expected = ["course 2 a", "course 2 b", "course 1 a", "course 1 b"];
        assert_eq!(names, expected);
        let hit = TableCell::Alert("2 hits".to_owned());
        let row = table.rows.iter().find(|row| row[2] == hit).unwrap();
        assert_eq!(row[4].text(), "1.2");
        assert_eq!(own.case_table(&Rows::default(), &drives[..2]), None);
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
