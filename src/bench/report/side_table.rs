//! Tables beside those of the algorithms' metrics: drives, stress. One form for terminal, Markdown
//! and page.

use super::drives::DriveSummary;
use super::stress::{StressSummary, kinds};
use super::summary::Summary;
use super::words::{NONE, percent};
use serde::Serialize;
use svl_data::bootstrap::Interval;
use svl_data::stress::StressKind;

/// A table of texts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct SideTable {
    pub(super) title: String,
    /// Head of the first column.
    pub(super) first: &'static str,
    /// Heads of the others.
    pub(super) heads: Vec<String>,
    /// The first column, and the others.
    pub(super) lines: Vec<(String, Vec<String>)>,
    /// Terms and meanings, below it.
    pub(super) notes: Vec<(&'static str, String)>,
}

impl Summary {
    /// The tables beside that of the metrics.
    pub(super) fn side_tables(&self) -> Vec<SideTable> {
        let drives = drives(&self.drives).into_iter();
        drives.chain(stress(&self.stress)).collect()
    }
}

/// The table of the drives; nothing where there were none.
fn drives(drives: &[DriveSummary]) -> Option<SideTable> {
    let interval = |interval: Option<Interval>, scale: f64, digits: usize| {
        interval.map_or_else(String::new, |(low, high)| {
            format!(" ({:.digits$}–{:.digits$})", scale * low, scale * high)
        })
    };
    let line = |drive: &DriveSummary| {
        let share = 100.0 * drive.finished as f64 / drive.courses as f64;
        let rate = |value: f64, of: Option<Interval>| format!("{value:.1}{}", interval(of, 1.0, 1));
        let cells = vec![
            drive.courses.to_string(),
            format!("{share:.0}{}", interval(drive.finished_interval, 100.0, 0)),
            rate(drive.collisions_per_100m, drive.collisions_interval),
            rate(drive.near_misses_per_100m, drive.near_misses_interval),
            match drive.collisions {
                0 => NONE.to_owned(),
                _ => rate(drive.first_collision_m, drive.first_collision_interval),
            },
            drive.stuck.to_string(),
            format!("{:.2}", drive.speed_m_per_s),
            format!("{:.0}", 100.0 * drive.stood_share),
        ];
        (drive.algorithm.clone(), cells)
    };
    let heads = [
        "courses",
        "finished, %",
        "hits/100 m",
        "near/100 m",
        "first hit, m",
        "stuck",
        "m/s",
        "stood, %",
    ];
    let notes = [
        (
            "finished",
            "courses whose goal was reached without a collision and without help; in brackets the \
             interval over the courses, 95 %",
        ),
        (
            "hits, near",
            "collisions and near misses for 100 m driven; after a collision the robot is set back \
             on the route of the driver with perfect sight, 0.3 m farther on",
        ),
        (
            "first hit",
            "mean distance to the first collision; a drive without one counts with all of its \
             distance",
        ),
        (
            "stuck",
            "how often the robot came no farther and was set back on the route",
        ),
    ];
    (!drives.is_empty()).then(|| SideTable {
        title: "Drives".to_owned(),
        first: "algorithm",
        heads: heads.map(str::to_owned).to_vec(),
        lines: drives.iter().map(line).collect(),
        notes: notes.map(|(term, text)| (term, text.to_owned())).to_vec(),
    })
}

/// A table per kind: right cells against the level, and where each algorithm breaks.
fn stress(stress: &[StressSummary]) -> Vec<SideTable> {
    let mut tables: Vec<_> = kinds(stress)
        .into_iter()
        .map(|kind| stress_table(kind, stress))
        .collect();
    if let Some(last) = tables.last_mut() {
        let words = "the least level at which a checkpoint that passed in half of its frames does \
                     not any more, or a tenth of the right cells is lost (without truth: of the \
                     known ones), or of the courses that were finished";
        last.notes.push(("breaks at", words.to_owned()));
    }
    tables
}

fn stress_table(kind: &'static StressKind, stress: &[StressSummary]) -> SideTable {
    let own: Vec<_> = stress.iter().filter(|s| s.kind == kind.name).collect();
    let mut levels: Vec<f64> = own.iter().map(|s| s.level).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let mut algorithms: Vec<&str> = Vec::new();
    for s in &own {
        if !algorithms.contains(&s.algorithm.as_str()) {
            algorithms.push(&s.algorithm);
        }
    }
    let has_truth = own.iter().any(|s| s.right.is_some());
    let is_driven = own.iter().any(|s| s.collisions.is_some());
    let line = |algorithm: &str| {
        let at = |level: f64| {
            own.iter()
                .find(|s| s.algorithm == algorithm && s.level == level)
        };
        let share = |s: &&&StressSummary| if has_truth { s.right } else { s.known };
        let cells = levels.iter().map(|level| match (at(*level), is_driven) {
            (Some(s), true) => s.collisions.map_or(NONE.to_owned(), |v| format!("{v:.1}")),
            (s, _) => percent(s.as_ref().and_then(share)),
        });
        // By size: a perturbation to either side breaks at its smallest.
        let mut by_size = levels.clone();
        by_size.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let breaks = by_size.iter().filter_map(|level| at(*level));
        let breaks = breaks
            .map(|s| Some((s.level, s.broken.as_ref()?)))
            .find_map(|found| found);
        let breaks = match breaks {
            Some((level, why)) => format!("{level}: {why}"),
            None => NONE.to_owned(),
        };
        (algorithm.to_owned(), cells.chain([breaks]).collect())
    };
    let what = match (is_driven, has_truth) {
        (true, _) => "collisions per 100 m",
        (_, true) => "right cells, %",
        (_, false) => "known cells, %",
    };
    let heads = levels.iter().map(|level| match level {
        0.0 => "as it is".to_owned(),
        level => level.to_string(),
    });
    let words = format!(
        "{}; numbers: {what}, by level, {}: {}",
        kind.summary, kind.unit, kind.formula
    );
    SideTable {
        title: format!("Stress: {}, {}", kind.name, kind.unit),
        first: "algorithm",
        heads: heads.chain(["breaks at".to_owned()]).collect(),
        lines: algorithms.into_iter().map(line).collect(),
        notes: vec![(kind.name, words)],
    }
}
