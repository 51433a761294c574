//! Maps of the courses that algorithms drove through.

use crate::show::plot::map::{CameraSector, CourseMap, MapWay};
use crate::subjects::drives::{CoursePlan, DriveRow, TrackRow};

/// Limit of the courses with a map in the page: those with the most collisions.
const MAX_MAPS: usize = 12;

/// The maps of the courses with their unperturbed drives, first those that a candidate did not
/// finish; if there are too many, those with the most collisions.
pub fn maps(
    plans: &[CoursePlan],
    drives: &[DriveRow],
    track: &[TrackRow],
    candidates: &[&str],
) -> Vec<CourseMap> {
    let plain_drives = |plan: &CoursePlan| {
        let seed = plan.seed;
        let plain = drives.iter().filter(|row| row.stress.is_none());
        plain.filter(move |row| row.seed == seed)
    };
    let hits = |plan: &CoursePlan| plain_drives(plan).map(|row| row.collisions).sum::<u64>();
    // The last course of an interrupted run may have no drive.
    let shown = plans.iter();
    let shown = shown.filter(|plan| plain_drives(plan).next().is_some());
    let mut shown: Vec<_> = shown.collect();
    let is_failed = |plan: &CoursePlan| {
        let mut failed = plain_drives(plan).filter(|row| !row.finished);
        failed.any(|row| candidates.contains(&row.algorithm.as_str()))
    };
    if shown.len() > MAX_MAPS {
        shown.sort_by_key(|plan| (!is_failed(plan), std::cmp::Reverse(hits(plan))));
        shown.truncate(MAX_MAPS);
    }
    shown.sort_by_key(|plan| !is_failed(plan));
    let way = |row: &DriveRow| {
        let is_own = |at: &&TrackRow| {
            at.seed == row.seed && at.algorithm == row.algorithm && at.stress == row.stress
        };
        let own: Vec<_> = track.iter().filter(is_own).collect();
        let places = |event: &str| {
            let events = own.iter().filter(|at| at.event.as_deref() == Some(event));
            events.map(|at| [at.x_m, at.y_m]).collect()
        };
        let mut all = own.iter();
        let hit = all.find(|at| at.event.as_deref() == Some("collision"));
        let stretches = own.chunk_by(|_, next| !next.placed);
        MapWay {
            name: row.algorithm.clone(),
            stretches: stretches
                .map(|stretch| stretch.iter().map(|at| [at.x_m, at.y_m]).collect())
                .collect(),
            collisions: places("collision"),
            stuck: places("stuck"),
            sector: hit.map(|at| CameraSector {
                at: [at.x_m, at.y_m],
                heading: at.heading,
            }),
        }
    };
    let map = |plan: &CoursePlan| CourseMap {
        title: format!("course {}", plan.seed),
        size_m: (plan.width_m, plan.length_m),
        goal_m: plan.goal_m,
        field_of_view_deg: plan.field_of_view_deg,
        is_failed: is_failed(plan),
        outlines: plan.outlines.clone(),
        ways: plain_drives(plan).map(way).collect(),
    };
    shown.into_iter().map(map).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::csv_rows::rows_from_text;
    use crate::subjects::drives::tests::drive;

    #[test]
    fn courses_that_a_candidate_fails_come_first_with_its_view() {
        let plans = [1, 2].map(|seed| CoursePlan {
            seed,
            field_of_view_deg: 60.0,
            ..CoursePlan::default()
        });
        let mut drives = [drive(1, "v3"), drive(1, "blind"), drive(2, "v3")];
        (drives[1].finished, drives[2].finished) = (false, false);
        let track = "scenario,seed,algorithm,sequence,x_m,y_m,heading,speed_m_per_s,clearance_m,\
                     placed,skipped,event,with,stress\n\
                     d,2,v3,0,1,2,0.5,0,0,false,false,collision,ball,\n";
        let track = rows_from_text(track).unwrap();
        let maps = maps(&plans, &drives, &track, &["v3"]);
        let order: Vec<_> = maps
            .iter()
            .map(|m| (m.title.as_str(), m.is_failed))
            .collect();
        assert_eq!(order, [("course 2", true), ("course 1", false)]);
        let sector = CameraSector {
            at: [1.0, 2.0],
            heading: 0.5,
        };
        assert_eq!(maps[0].ways[0].sector, Some(sector));
        assert_eq!(maps[1].ways[0].sector, None);
    }
}
