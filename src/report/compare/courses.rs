//! Two reports of drives, course by course.

use super::scored_run::ScoredRun;
use super::{AlgorithmChange, Change, Comparison, Conclusion, Judgement};
use crate::drives::{DriveRow, drive_parts, drive_sample, has_driven};
use crate::table::{Table, TableCell};
use serde::Serialize;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use svl_core::{Error, Result, counted, joined};
use svl_score::judge::{Better, DriveNumber, METRICS, Metric, MetricOrigin};
use svl_score::sign_test;

/// Limit of the algorithms in the verdict, and of the courses in a line and in a table.
const MAX_ALGORITHMS: usize = 2;
const MAX_LISTED: usize = 6;
const MAX_ROWS: usize = 30;

/// The drives of an algorithm on the courses of both reports, before and after.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CourseChanges {
    /// Numbers of courses finished, of collisions, and of near misses on them.
    pub finished: [u64; 2],
    pub collisions: [u64; 2],
    pub near_misses: [u64; 2],
    /// The courses on which one of these numbers changed, more collisions first.
    pub changed: Vec<CourseChange>,
}

/// A course on which something changed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CourseChange {
    pub seed: u64,
    pub finished: [bool; 2],
    pub collisions: [u64; 2],
    pub near_misses: [u64; 2],
}

/// A property of a course.
type CourseTest = fn(&CourseChange) -> bool;

/// True if both are of drives.
///
/// # Errors
/// [`Error::Invalid`] if one of them is.
pub(super) fn are_driven(base: &ScoredRun, other: &ScoredRun) -> Result<bool> {
    match [base, other].map(|run| !run.drives.is_empty()) {
        [first, second] if first == second => Ok(first),
        [first, _] => {
            let driven = if first { base } else { other };
            Err(Error::Invalid(format!(
                "{}: is of drives, and the other report is of pairs; compare two of a kind",
                driven.folder.display()
            )))
        }
    }
}

impl AlgorithmChange {
    /// Changes that are real by an exact sign test over the courses of both reports: of the courses
    /// on which a number differs, as many become better as worse if nothing changed. How much it
    /// differs does not count, so that one bad course is one course.
    pub(super) fn from_drives(
        base: &ScoredRun,
        other: &ScoredRun,
        (label, other_label): (&str, &str),
    ) -> Self {
        let (ours, theirs) = (base.drives(label), other.drives(other_label));
        let both = ours
            .iter()
            .filter_map(|(seed, row)| Some((*row, *theirs.get(seed)?)));
        let both = both.filter(|(row, _)| base.has_course_of(other, row.seed));
        let pairs: Vec<_> = both.collect();
        let alike = pairs
            .iter()
            .filter(|(a, b)| a.track_hash == b.track_hash)
            .count();
        let metrics = METRICS.iter().filter_map(|metric| {
            let MetricOrigin::Drives(number) = metric.origin else {
                return None;
            };
            Change::from_drives(metric, number, &pairs, alike == pairs.len())
        });
        Self {
            algorithm: label.to_owned(),
            other_algorithm: other_label.to_owned(),
            same_parameters: base.parameters_hash(label) == other.parameters_hash(other_label),
            pairs: pairs.len(),
            newly_failed: 0,
            unmatched: ours.len() + theirs.len() - 2 * pairs.len(),
            other_inputs: 0,
            equal_results: alike,
            other_past: 0,
            blocks: pairs.len(),
            metrics: metrics.collect(),
            areas: BTreeMap::new(),
            checkpoints: Vec::new(),
            has_partial_checkpoints: false,
            courses: Some(CourseChanges::new(&pairs)),
        }
    }

    /// The things that are compared: pairs, or the courses of drives.
    pub fn things(&self) -> &'static str {
        match self.courses {
            Some(_) => "course",
            None => "pair",
        }
    }

    /// The courses that changed, in a line.
    pub(super) fn course_words(&self) -> Option<String> {
        let words = self.courses.as_ref()?.words();
        (!words.is_empty()).then(|| format!("{}: {words}", self.title()))
    }
}

impl Change {
    fn from_drives(
        metric: &'static Metric,
        number: DriveNumber,
        pairs: &[(&DriveRow, &DriveRow)],
        are_alike: bool,
    ) -> Option<Self> {
        let value = |row: &DriveRow| drive_parts(number, row)[0];
        let changed = |is: fn(f64, f64) -> bool| {
            let changed = pairs.iter().filter(|(a, b)| is(value(b), value(a)));
            changed.count()
        };
        let [up, down] = [changed(|b, a| b > a), changed(|b, a| b < a)];
        let total = |rows: &mut dyn Iterator<Item = &DriveRow>| drive_sample(number, rows).total();
        let base = total(&mut pairs.iter().map(|(a, _)| *a))?;
        let other = total(&mut pairs.iter().map(|(_, b)| *b))?;
        let judgement = match metric.better {
            _ if are_alike => Judgement::Equal,
            _ if pairs.len() < sign_test::METHOD.fewest_blocks => Judgement::TooFew,
            // Even if all that differ do so in one direction, it may be chance.
            _ if (1..sign_test::METHOD.fewest_blocks).contains(&(up + down)) => Judgement::TooFew,
            _ if !sign_test::is_real([up, down]) => Judgement::Unclear,
            Better::Neither => Judgement::Differs,
            Better::More if up > down => Judgement::Better,
            // A robot that stands hits nothing.
            Better::Less if up < down && !has_driven(pairs.iter().map(|(_, b)| *b)) => {
                Judgement::Unclear
            }
            Better::Less if up < down => Judgement::Better,
            _ => Judgement::Worse,
        };
        Some(Self {
            metric,
            base,
            other,
            difference: other - base,
            interval: None,
            judgement,
        })
    }
}

impl CourseChanges {
    fn new(pairs: &[(&DriveRow, &DriveRow)]) -> Self {
        let sums = |number: fn(&DriveRow) -> u64| {
            let before = pairs.iter().map(|(a, _)| number(a)).sum();
            [before, pairs.iter().map(|(_, b)| number(b)).sum()]
        };
        let courses = pairs.iter().map(|(a, b)| CourseChange {
            seed: a.seed,
            finished: [a.finished, b.finished],
            collisions: [a.collisions, b.collisions],
            near_misses: [a.near_misses, b.near_misses],
        });
        let mut changed: Vec<_> = courses.filter(CourseChange::is_changed).collect();
        // The sort is stable.
        changed.sort_by_key(|course| (Reverse(course.more_collisions()), course.finished[1]));
        Self {
            finished: sums(|row| u64::from(row.finished)),
            collisions: sums(|row| row.collisions),
            near_misses: sums(|row| row.near_misses),
            changed,
        }
    }

    fn more_collisions(&self) -> i64 {
        self.collisions[1] as i64 - self.collisions[0] as i64
    }

    /// The sums that changed; collisions first, as they are what hurts.
    fn sums(&self) -> String {
        let sums = [
            ("collisions", self.collisions),
            ("courses finished", self.finished),
            ("near misses", self.near_misses),
        ];
        let changed = sums.iter().filter(|(_, [before, after])| before != after);
        let words = changed.map(|(name, [before, after])| format!("{name} {before} → {after}"));
        words.collect::<Vec<_>>().join(", ")
    }

    /// The courses that changed, by what changed.
    fn words(&self) -> String {
        let lists: [(&str, CourseTest); 4] = [
            ("more collisions on", |course| course.more_collisions() > 0),
            ("not finished any more:", |course| {
                course.finished == [true, false]
            }),
            ("finished now:", |course| course.finished == [false, true]),
            ("fewer collisions on", |course| course.more_collisions() < 0),
        ];
        let words = lists.iter().filter_map(|(words, is)| {
            let own = self.changed.iter().filter(|course| is(course));
            let mut seeds: Vec<_> = own.map(|course| course.seed.to_string()).collect();
            let more = seeds.len().saturating_sub(MAX_LISTED);
            let name = if seeds.len() == 1 {
                "course"
            } else {
                "courses"
            };
            seeds.truncate(MAX_LISTED);
            seeds.extend((more > 0).then(|| format!("{more} more")));
            (!seeds.is_empty()).then(|| format!("{words} {name} {}", seeds.join(", ")))
        });
        words.collect::<Vec<_>>().join("; ")
    }

    /// A row for each course that changed, and the number of those without one.
    pub(super) fn table(&self) -> (Table, usize) {
        let heads = ["finished", "collisions", "near misses"];
        let mut table = Table::new("", "course").with_columns(heads);
        for course in self.changed.iter().take(MAX_ROWS) {
            let yes = |is: bool| if is { "yes" } else { "no" };
            let finished = course.finished.map(yes);
            let cell = |[before, after]: [String; 2], is_worse: bool| {
                let text = if before == after {
                    before
                } else {
                    format!("{before} → {after}")
                };
                if is_worse {
                    TableCell::Alert(text)
                } else {
                    TableCell::Text(text)
                }
            };
            let [collisions, near] =
                [course.collisions, course.near_misses].map(|counts| counts.map(|n| n.to_string()));
            table.rows.push(vec![
                TableCell::Text(course.seed.to_string()),
                cell(
                    finished.map(str::to_owned),
                    course.finished == [true, false],
                ),
                cell(collisions, course.more_collisions() > 0),
                cell(near, false),
            ]);
        }
        (table, self.changed.len().saturating_sub(MAX_ROWS))
    }
}

impl CourseChange {
    fn is_changed(&self) -> bool {
        let is = |[before, after]: [u64; 2]| before != after;
        self.finished[0] != self.finished[1] || is(self.collisions) || is(self.near_misses)
    }

    fn more_collisions(&self) -> i64 {
        self.collisions[1] as i64 - self.collisions[0] as i64
    }
}

impl Comparison {
    /// True if drives are compared.
    pub(super) fn is_driven(&self) -> bool {
        self.algorithms.iter().any(|own| own.courses.is_some())
    }

    /// The changes of the drives, the algorithm with the most new collisions first, with the result
    /// of the test.
    pub(super) fn drive_reason(&self, conclusion: Conclusion) -> String {
        let changed = self.algorithms.iter().filter_map(|own| {
            let courses = own.courses.as_ref()?;
            let sums = Some(courses.sums()).filter(|sums| !sums.is_empty())?;
            Some((courses.more_collisions(), self.name(own, &sums)))
        });
        let mut changed: Vec<_> = changed.collect();
        changed.sort_by_key(|(more, _)| Reverse(*more));
        let more = changed.len().saturating_sub(MAX_ALGORITHMS);
        let mut parts: Vec<_> = changed.into_iter().map(|(_, words)| words).collect();
        parts.truncate(MAX_ALGORITHMS);
        if parts.is_empty() {
            parts.push("as many collisions, near misses and finished courses".to_owned());
        }
        parts.extend((more > 0).then(|| format!("{} more changed", counted(more, "algorithm"))));
        let tested = self.tested_words();
        parts.push(match conclusion {
            Conclusion::TooFewCourses => format!(
                "an exact sign test needs {} courses of both reports that differ",
                self.method.fewest_blocks
            ),
            Conclusion::NoChange => format!("nothing of that is real {tested}, by a sign test"),
            _ => format!("real {tested}: {}", self.real_words()),
        });
        parts.join("; ")
    }

    /// The changes that are real, collisions first.
    fn real_words(&self) -> String {
        let changes = self.algorithms.iter().flat_map(|own| {
            let changes = own.metrics.iter();
            let real = changes
                .filter(|change| matches!(change.judgement, Judgement::Better | Judgement::Worse));
            real.map(|change| {
                let more = if change.difference > 0.0 {
                    "more"
                } else {
                    "fewer"
                };
                let words = format!("{more} {}", change.metric.words);
                (change.metric.name != "collisions", self.name(own, &words))
            })
        });
        let mut words: Vec<_> = changes.collect();
        // The sort is stable.
        words.sort_by_key(|(is_other, _)| *is_other);
        joined(words.into_iter().map(|(_, words)| words))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drives::tests::drive;

    /// Drives on as many courses, each with these collisions; without any it is finished.
    fn drives(collisions: &[u64]) -> Vec<DriveRow> {
        let row = |(seed, hits): (u64, &u64)| DriveRow {
            finished: *hits == 0,
            collisions: *hits,
            track_hash: format!("{seed}-{hits}"),
            ..drive(seed, "v3")
        };
        (0..).zip(collisions).map(row).collect()
    }

    fn judged(before: &[u64], after: &[u64], name: &str) -> Judgement {
        judged_rows(&drives(before), &drives(after), name)
    }

    fn judged_rows(before: &[DriveRow], after: &[DriveRow], name: &str) -> Judgement {
        let pairs: Vec<_> = before.iter().zip(after).collect();
        let alike = pairs.iter().all(|(a, b)| a.track_hash == b.track_hash);
        let metric = Metric::find(name).unwrap();
        let MetricOrigin::Drives(number) = metric.origin else {
            panic!("{name}");
        };
        let change = Change::from_drives(metric, number, &pairs, alike);
        change.unwrap().judgement
    }

    #[test]
    fn a_change_is_real_by_the_courses_and_not_by_the_worst() {
        let judged = |before: &[u64], after: &[u64]| judged(before, after, "collisions");
        assert_eq!(judged(&[0; 8], &[1; 8]), Judgement::Worse);
        assert_eq!(judged(&[1; 8], &[0; 8]), Judgement::Better);
        assert_eq!(judged(&[0; 8], &[0; 8]), Judgement::Equal);
        assert_eq!(judged(&[0; 5], &[1; 5]), Judgement::TooFew);
        let one_course = [0, 0, 0, 0, 0, 0, 0, 90];
        assert_eq!(judged(&[0; 8], &one_course), Judgement::TooFew);
        let five_of_six = [1, 1, 1, 1, 1, 0, 90, 0];
        let before = [0, 0, 0, 0, 0, 1, 90, 0];
        assert_eq!(judged(&before, &five_of_six), Judgement::Unclear);
    }

    #[test]
    fn fewer_finished_courses_are_worse() {
        assert_eq!(judged(&[0; 8], &[1; 8], "finished"), Judgement::Worse);
        assert_eq!(judged(&[1; 8], &[0; 8], "finished"), Judgement::Better);
    }

    #[test]
    fn a_robot_that_stands_is_not_better() {
        let (before, mut after) = (drives(&[1; 8]), drives(&[0; 8]));
        for (route_m, judgement) in [(0.61, Judgement::Better), (0.59, Judgement::Unclear)] {
            after.iter_mut().for_each(|row| row.route_m = route_m);
            assert_eq!(judged_rows(&before, &after, "collisions"), judgement);
        }
    }

    #[test]
    fn the_courses_that_changed_are_named() {
        let (before, after) = (drives(&[0, 0, 2, 1, 1]), drives(&[0, 1, 0, 3, 1]));
        let pairs: Vec<_> = before.iter().zip(&after).collect();
        let changes = CourseChanges::new(&pairs);
        assert_eq!(changes.sums(), "collisions 4 → 5");
        let words = "more collisions on courses 3, 1; not finished any more: course 1; finished \
                     now: course 2; fewer collisions on course 2";
        assert_eq!(changes.words(), words);
        let (table, more) = changes.table();
        assert_eq!((table.rows.len(), more), (3, 0));
        let many = (drives(&[0; 40]), drives(&[1; 40]));
        let pairs: Vec<_> = many.0.iter().zip(&many.1).collect();
        let changes = CourseChanges::new(&pairs);
        assert!(
            changes
                .words()
                .contains("courses 0, 1, 2, 3, 4, 5, 34 more")
        );
        assert_eq!(changes.table().1, 10);
    }
}
