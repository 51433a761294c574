//! The area of a run's numbers in words: what a robot can hit, floor, or what is beyond.

use super::summary::{AlgorithmSummary, Results};
use crate::subjects::witness::EstimateRow;
use std::borrow::Cow;
use svl_core::counted;
use svl_score::judge::{AreaChoice, Metric, MetricSource as _};

/// Group of the fractions of right, wrong and unknown cells.
const CELLS: &str = "cells, %";

impl Results {
    /// True if cells have areas: they are scored by distances.
    pub(crate) fn has_areas(&self) -> bool {
        self.basis.scope.by_distance > 0
    }

    /// The cells that a metric is of; `None` where it is of all, whatever their area.
    pub(crate) fn area_of(&self, metric: &Metric) -> Option<AreaChoice> {
        (metric.by_area && self.has_areas()).then_some(self.basis.area)
    }

    /// True if the truth of some pairs does not tell what is floor.
    pub(crate) fn includes_floor(&self) -> bool {
        self.basis.scope.knowing_floor < self.basis.scope.by_distance
    }

    /// The heading above a metric's column.
    pub(crate) fn group(&self, metric: &Metric) -> Cow<'static, str> {
        if metric.estimated().is_some() {
            let is_floor = |row: &&EstimateRow| row.area == AreaChoice::Floor && row.cells > 0;
            let knows_floor = self.estimates.iter().any(|row| is_floor(&row));
            return match self.basis.area {
                AreaChoice::Obstacle if knows_floor => "estimated, obstacles, %".into(),
                AreaChoice::Obstacle => "estimated, floor included, %".into(),
                area => format!("estimated, {area}, %").into(),
            };
        }
        if !metric.by_area || metric.group != CELLS || !self.has_areas() {
            return Cow::Borrowed(metric.group);
        }
        let partly = if self.basis.scope.knowing_floor > 0 {
            "partly "
        } else {
            ""
        };
        match self.basis.area {
            AreaChoice::Obstacle if self.includes_floor() => {
                format!("cells, floor {partly}included, %").into()
            }
            AreaChoice::Obstacle => "obstacle cells, %".into(),
            AreaChoice::Floor => "floor cells, %".into(),
            AreaChoice::Beyond => format!("cells{}, %", self.beyond_words()).into(),
            AreaChoice::All => "cells of all areas, %".into(),
        }
    }

    fn beyond_words(&self) -> String {
        let beyond_m = self.shown.rule.beyond_m();
        beyond_m.map_or_else(|| " beyond".to_owned(), |m| format!(" beyond {m} m"))
    }

    /// The most cells of an area that an algorithm was scored on; `None` if there is none.
    pub(crate) fn most_cells(&self, area: AreaChoice) -> Option<u64> {
        let algorithms = self.algorithms.iter().chain(&self.references);
        let algorithms = algorithms.filter_map(|a: &AlgorithmSummary| a.cells_in(area));
        algorithms.max()
    }

    /// True if cells have areas, and none is of the one that is shown.
    pub(crate) fn is_area_empty(&self) -> bool {
        self.has_areas() && self.most_cells(self.basis.area).unwrap_or_default() == 0
    }

    /// The number of cells that the numbers are of, if these are not all.
    pub(crate) fn area_words(&self) -> Option<String> {
        let (all, own) = (
            self.most_cells(AreaChoice::All)?,
            self.most_cells(self.basis.area).unwrap_or_default(),
        );
        let words = match self.basis.area {
            AreaChoice::Obstacle => "obstacles".to_owned(),
            AreaChoice::Floor => "floor".to_owned(),
            AreaChoice::Beyond => self.beyond_words().trim_start().to_owned(),
            AreaChoice::All => return None,
        };
        let is_told = own < all && self.drives.is_empty();
        is_told.then(|| format!("{own} of {all} scored cells are {words}"))
    }

    /// The number of near obstacles: missed and found ones are of these.
    pub(crate) fn near_words(&self) -> Option<String> {
        let most = self.most_near().filter(|_| self.drives.is_empty())?;
        Some(counted(most as u64, "near obstacle"))
    }

    /// The most near obstacles of an algorithm.
    pub(crate) fn most_near(&self) -> Option<f64> {
        let all = self.algorithms.iter().chain(&self.references);
        let near = all.filter_map(|a| a.totals.get("near"));
        near.reduce(f64::max)
    }

    /// Caution where no cell is of the area.
    pub(crate) fn empty_area(&self) -> Option<String> {
        let is_empty = self.most_cells(self.basis.area).is_none();
        let others = AreaChoice::PARTS
            .into_iter()
            .filter(|area| *area != self.basis.area);
        let others = others.filter_map(|area| {
            let cells = self.most_cells(area)?;
            Some(format!("{cells} {area}"))
        });
        let others: Vec<_> = others.collect();
        (is_empty && !others.is_empty()).then(|| {
            format!(
                "no scored cell is of the area {}, so right and wrong are not measured: by the \
                 truth there are {}; --area AREA shows these",
                self.basis.area,
                others.join(" and ")
            )
        })
    }

    /// The meaning of the area, for the notes of tables.
    pub(crate) fn area_note(&self) -> Option<(Cow<'static, str>, String)> {
        let metric = Metric::find("right").filter(|_| self.has_areas())?;
        let beyond = self.shown.rule.beyond_m();
        let beyond =
            beyond.map_or_else(String::new, |m| format!(", nor with a median beyond {m} m"));
        let floor = if self.includes_floor() {
            "floor included, as nothing tells it (--camera-height M does)"
        } else {
            "cells neither half floor"
        };
        let words = match self.basis.area {
            AreaChoice::Obstacle if self.includes_floor() => format!("{floor}{beyond}"),
            AreaChoice::Obstacle => format!("{floor}{beyond}; --area AREA has the others"),
            AreaChoice::Floor => "cells of which half or more is floor".to_owned(),
            AreaChoice::Beyond => format!("cells whose median is{}", self.beyond_words()),
            AreaChoice::All => "all cells with truth".to_owned(),
        };
        Some((self.group(metric), words))
    }
}
