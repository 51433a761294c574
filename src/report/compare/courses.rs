//! Two reports of drives, course by course.

use crate::results::change::{Change, Judgement, NotMeasured};
use crate::show::table::model::{Table, TableCell};
use crate::subjects::drives::{self, DriveRow, drive_parts, has_driven};
use serde::Serialize;
use std::cmp::Reverse;
use svl_score::holm::MAX_P;
use svl_score::judge::{Better, Metric, MetricOrigin, signs};

/// Limit of the courses in a line and in a table.
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
    /// The goal was not reached before the pairs ended.
    pub late: [bool; 2],
    pub collisions: [u64; 2],
    pub near_misses: [u64; 2],
}

/// A property of a course.
type CourseTest = fn(&CourseChange) -> bool;

pub(super) fn is_alike([a, b]: &[&DriveRow; 2]) -> bool {
    a.track_hash == b.track_hash
}

impl Change {
    /// The change of a metric of drives over the courses of both, as one of `tests`.
    pub(crate) fn from_drives(
        metric: &'static Metric,
        courses: &[[&DriveRow; 2]],
        tests: usize,
    ) -> Result<Self, NotMeasured> {
        let rows = |side: usize| courses.iter().map(move |pair| pair[side]);
        let measured = [0, 1].map(|side| drives::measured(metric, rows(side)));
        let cases = measured.map(|own| own.map(|own| own.cases));
        let values = measured.map(|own| metric.value_of(own?));
        let ([Some(base), Some(other)], [Some(a), Some(b)], MetricOrigin::Drives(number)) =
            (values, cases, metric.origin)
        else {
            return Err(NotMeasured { metric, cases });
        };
        let value = |row: &DriveRow| drive_parts(number, row)[0];
        let changed = |is: fn(f64, f64) -> bool| {
            let changed = courses.iter().filter(|[a, b]| is(value(b), value(a)));
            changed.count()
        };
        let [up, down] = [changed(|b, a| b > a), changed(|b, a| b < a)];
        let fewest = signs::fewest_changes(tests);
        // Even if all that differ do so in one direction, it may be chance.
        let is_tested = courses.len() >= fewest && !(1..fewest).contains(&(up + down));
        // A robot that stands hits nothing.
        let stands = metric.better == Better::Less && up < down && !has_driven(rows(1));
        let p = if stands {
            1.0
        } else {
            signs::p_value([up, down])
        };
        let is_real = is_tested.then_some(p <= MAX_P);
        Ok(Self {
            checkpoint: None,
            metric,
            base,
            other,
            difference: other - base,
            interval: None,
            p: Some(p),
            cases: Some([a, b]),
            exact: None,
            judgement: if courses.iter().all(is_alike) {
                Judgement::Equal
            } else {
                Judgement::new(metric.better, is_real, up > down)
            },
        })
    }
}

impl CourseChanges {
    pub(super) fn new(courses: &[[&DriveRow; 2]]) -> Self {
        let sums = |number: fn(&DriveRow) -> u64| {
            [0, 1].map(|side| courses.iter().map(|pair| number(pair[side])).sum())
        };
        let changes = courses.iter().map(|pair| CourseChange {
            seed: pair[0].seed,
            finished: pair.map(|row| row.finished),
            late: pair.map(|row| !row.arrived),
            collisions: pair.map(|row| row.collisions),
            near_misses: pair.map(|row| row.near_misses),
        });
        let mut changed: Vec<_> = changes.filter(CourseChange::is_changed).collect();
        // The sort is stable.
        changed.sort_by_key(|course| (Reverse(course.more_collisions()), course.finished[1]));
        Self {
            finished: sums(|row| u64::from(row.finished)),
            collisions: sums(|row| row.collisions),
            near_misses: sums(|row| row.near_misses),
            changed,
        }
    }

    /// The sums that changed, collisions first, as they are what hurts; then the courses, by what
    /// changed.
    pub(super) fn words(&self) -> String {
        let sums = [
            ("collisions", self.collisions),
            ("courses finished", self.finished),
            ("near misses", self.near_misses),
        ];
        let sums = sums.iter().filter(|(_, [before, after])| before != after);
        let sums = sums.map(|(name, [before, after])| format!("{name} {before} → {after}"));
        let sums = sums.collect::<Vec<_>>().join(", ");
        let lists: [(&str, CourseTest); 4] = [
            ("more collisions on", |course| course.more_collisions() > 0),
            ("not finished any more:", |course| {
                course.finished == [true, false]
            }),
            ("finished now:", |course| course.finished == [false, true]),
            ("fewer collisions on", |course| course.more_collisions() < 0),
        ];
        let lists = lists.iter().filter_map(|(words, is)| {
            let own = self.changed.iter().filter(|course| is(course));
            let mut seeds: Vec<_> = own.map(|course| course.seed.to_string()).collect();
            let name = if seeds.len() == 1 {
                "course"
            } else {
                "courses"
            };
            let more = seeds.len().saturating_sub(MAX_LISTED);
            seeds.truncate(MAX_LISTED);
            seeds.extend((more > 0).then(|| format!("{more} more")));
            (!seeds.is_empty()).then(|| format!("{words} {name} {}", seeds.join(", ")))
        });
        let parts = Some(sums)
            .filter(|sums| !sums.is_empty())
            .into_iter()
            .chain(lists);
        parts.collect::<Vec<_>>().join("; ")
    }

    /// A row for each course that changed, and the number of those without one.
    pub(super) fn table(&self) -> (Table, usize) {
        let heads = ["finished", "collisions", "near misses"];
        let mut table = Table::new("", "course").with_columns(heads);
        for course in self.changed.iter().take(MAX_ROWS) {
            let cell = |[before, after]: [String; 2], is_worse: bool| {
                if before == after {
                    TableCell::Text(before)
                } else if is_worse {
                    TableCell::Alert(format!("{before} → {after}"))
                } else {
                    TableCell::Text(format!("{before} → {after}"))
                }
            };
            let finished = [0, 1].map(|side| match (course.finished[side], course.late[side]) {
                (true, _) => "yes".to_owned(),
                (_, true) => "late".to_owned(),
                _ => "no".to_owned(),
            });
            let [collisions, near] =
                [course.collisions, course.near_misses].map(|own| own.map(|n| n.to_string()));
            table.rows.push(vec![
                TableCell::Text(course.seed.to_string()),
                cell(finished, course.finished == [true, false]),
                cell(collisions, course.more_collisions() > 0),
                cell(near, false),
            ]);
        }
        (table, self.changed.len().saturating_sub(MAX_ROWS))
    }
}

impl CourseChange {
    fn is_changed(&self) -> bool {
        let side = |i: usize| {
            let ends = (self.finished[i], self.late[i]);
            (ends, self.collisions[i], self.near_misses[i])
        };
        side(0) != side(1)
    }

    fn more_collisions(&self) -> i64 {
        self.collisions[1] as i64 - self.collisions[0] as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::comparison::AlgorithmChange;
    use crate::subjects::drives::tests::drive;

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
        let pairs: Vec<_> = before.iter().zip(after).map(<[_; 2]>::from).collect();
        let change = Change::from_drives(Metric::find(name).unwrap(), &pairs, 1);
        change.unwrap().judgement
    }

    #[test]
    fn a_change_is_real_by_the_courses_and_not_by_the_worst() {
        let one_course = [0, 0, 0, 0, 0, 0, 0, 90];
        let five_of_six = [[0, 0, 0, 0, 0, 1, 90, 0], [1, 1, 1, 1, 1, 0, 90, 0]];
        for (before, after, judgement) in [
            (&[0; 8][..], &[1; 8][..], Judgement::Worse),
            (&[1; 8], &[0; 8], Judgement::Better),
            (&[0; 8], &[0; 8], Judgement::Equal),
            (&[0; 5], &[1; 5], Judgement::TooFew),
            (&[0; 8], &one_course, Judgement::TooFew),
            (&five_of_six[0], &five_of_six[1], Judgement::Unclear),
        ] {
            assert_eq!(judged(before, after, "collisions"), judgement);
        }
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
    fn a_rate_over_less_than_a_metre_is_not_compared() {
        let (before, mut after) = (drives(&[1; 8]), drives(&[0; 8]));
        after.iter_mut().for_each(|row| row.driven_m = 0.1);
        let pairs: Vec<_> = before.iter().zip(&after).map(<[_; 2]>::from).collect();
        let own = AlgorithmChange::default().with_courses(&pairs, 3);
        let names = |metrics: &[Change]| metrics.iter().map(|own| own.metric.name).collect();
        let names: Vec<_> = names(&own.metrics);
        assert_eq!(names, ["finished", "late", "driven"]);
        let cases = own.not_measured[0].cases.map(|cases| cases.unwrap().items);
        assert_eq!((own.not_measured.len(), cases), (2, [48, 0]));
    }

    #[test]
    fn the_courses_that_changed_are_named() {
        let (before, after) = (drives(&[0, 0, 2, 1, 1]), drives(&[0, 1, 0, 3, 1]));
        let pairs: Vec<_> = before.iter().zip(&after).map(<[_; 2]>::from).collect();
        let changes = CourseChanges::new(&pairs);
        let words = "collisions 4 → 5; more collisions on courses 3, 1; not finished any more: \
                     course 1; finished now: course 2; fewer collisions on course 2";
        assert_eq!(changes.words(), words);
        let (table, more) = changes.table();
        assert_eq!((table.rows.len(), more), (3, 0));
        let mut late = drives(&[1]);
        late[0].arrived = false;
        let sound = drives(&[0]);
        let (late, _) = CourseChanges::new(&[[&sound[0], &late[0]]]).table();
        assert_eq!(late.rows[0][1], TableCell::Alert("yes → late".to_owned()));
        let many = (drives(&[0; 40]), drives(&[1; 40]));
        let pairs: Vec<_> = many.0.iter().zip(&many.1).map(<[_; 2]>::from).collect();
        let changes = CourseChanges::new(&pairs);
        let words = "courses 0, 1, 2, 3, 4, 5, 34 more";
        assert!(changes.words().contains(words));
        assert_eq!(changes.table().1, 10);
    }
}
