//! The result of an experiment: conditions, quantities, tables, plots, pictures.

use serde::Serialize;
use serde_json::Value;
use svl_files::overlay::Mark;
use svl_report::plot::{Axis, Bars, Chart, Series, SeriesStyle};

/// Result of an experiment.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Finding {
    /// The result in one sentence, with its numbers.
    pub why: String,
    /// Conditions of the claim.
    pub conditions: Vec<Condition>,
    /// Numbers next to those of the thesis.
    pub quantities: Vec<Quantity>,
    pub tables: Vec<FindingTable>,
    /// Plots as SVG.
    #[serde(skip)]
    pub plots: Vec<String>,
    #[serde(skip)]
    pub pictures: Vec<Exhibit>,
}

/// A condition of the claim, met or not.
#[derive(Clone, Debug, Serialize)]
pub struct Condition {
    /// The rule with its thresholds, and the measured numbers.
    pub says: String,
    pub met: bool,
}

/// A measured number next to that of the thesis.
#[derive(Clone, Debug, Serialize)]
pub struct Quantity {
    pub name: String,
    pub unit: &'static str,
    /// Number in the thesis; `None` if it gives none.
    pub thesis: Option<&'static str>,
    /// NaN, in JSON null, if there was nothing to measure.
    pub ours: f64,
}

/// Quantities under the conditions in which they were measured.
#[derive(Clone, Debug, Serialize)]
pub struct FindingTable {
    /// Headings of the columns; the first is that of the row names.
    pub heads: Vec<String>,
    /// Name of the conditions, and numbers or texts; null if there was nothing to measure.
    pub rows: Vec<(String, Vec<Value>)>,
}

/// Result for the thesis's claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClaimVerdict {
    /// Every condition is met.
    Holds,
    /// Some conditions are met and some are not.
    HoldsInPart,
    /// No condition is met.
    DoesNotHold,
    /// No condition could be tested.
    Undetermined,
}

/// A picture, with a depth grid drawn on it.
#[derive(Clone, Debug)]
pub struct Exhibit {
    pub caption: String,
    pub png: Vec<u8>,
    pub size: (usize, usize),
    /// Cells of the grid; true if a cell is crossed out.
    pub marks: Vec<(Mark, bool)>,
}

impl Finding {
    /// The verdict that follows from the conditions.
    pub fn verdict(&self) -> ClaimVerdict {
        let met = self.conditions.iter().filter(|c| c.met).count();
        match (met, self.conditions.len()) {
            (_, 0) => ClaimVerdict::Undetermined,
            (0, _) => ClaimVerdict::DoesNotHold,
            (met, all) if met == all => ClaimVerdict::Holds,
            _ => ClaimVerdict::HoldsInPart,
        }
    }

    /// Adds a condition of the claim, for [`Condition::says`].
    pub(super) fn condition(&mut self, met: bool) -> &mut Condition {
        let place = self.conditions.len();
        let says = String::new();
        self.conditions.push(Condition { says, met });
        &mut self.conditions[place]
    }

    /// Adds a number; `thesis` is empty if the thesis gives none.
    pub(super) fn quantity(
        &mut self,
        name: impl Into<String>,
        unit: &'static str,
        thesis: &'static str,
        ours: f64,
    ) {
        self.quantities.push(Quantity {
            name: name.into(),
            unit,
            thesis: Some(thesis).filter(|thesis| !thesis.is_empty()),
            ours,
        });
    }

    /// Adds a table; its headings, the first that of the row names, are separated by ` | `.
    pub(super) fn table<V: IntoIterator<Item: Into<Value>>>(
        &mut self,
        heads: &str,
        rows: impl IntoIterator<Item = (String, V)>,
    ) {
        let heads: Vec<_> = heads.split(" | ").map(str::to_owned).collect();
        let row = |(name, values): (String, V)| {
            let values: Vec<_> = values.into_iter().map(Into::into).collect();
            debug_assert_eq!(values.len() + 1, heads.len(), "{name}");
            (name, values)
        };
        let rows = rows.into_iter().map(row).collect();
        self.tables.push(FindingTable { heads, rows });
    }

    pub(super) fn chart(
        &mut self,
        title: &str,
        [x, y]: [Axis; 2],
        series: impl IntoIterator<Item = Series>,
    ) {
        let chart = Chart {
            title: title.to_owned(),
            x,
            y,
            series: series.into_iter().collect(),
        };
        self.plots.push(chart.svg());
    }

    /// Adds a chart of a quantity at the levels of a condition, which are at the points of the
    /// curves: `value` gets the places of curve and level.
    pub(super) fn curves(
        &mut self,
        title: &str,
        axes: [Axis; 2],
        names: &[&str],
        levels: &[f64],
        value: impl Fn(usize, usize) -> f64,
    ) {
        let curve = |(curve, name): (usize, &&str)| {
            let points = levels.iter().enumerate();
            let points = points.map(|(i, level)| (*level, value(curve, i)));
            Series::new(name, SeriesStyle::Both, points)
        };
        self.chart(title, axes, names.iter().enumerate().map(curve));
    }

    /// Adds bars with named lengths of each part.
    pub(super) fn bars(
        &mut self,
        title: &str,
        label: &str,
        parts: &[&str],
        bars: Vec<(String, Vec<f64>)>,
    ) {
        let bars = Bars {
            title: title.to_owned(),
            label: label.to_owned(),
            parts: parts.iter().copied().map(str::to_owned).collect(),
            bars,
        };
        self.plots.push(bars.svg());
    }
}

impl Condition {
    pub(super) fn says(&mut self, rule: impl Into<String>) {
        self.says = rule.into();
    }
}

impl ClaimVerdict {
    /// All verdicts, the best first, in words for one claim and for several.
    pub const WORDS: [(Self, [&str; 2]); 4] = [
        (Self::Holds, ["holds", "hold"]),
        (Self::HoldsInPart, ["holds in part", "hold in part"]),
        (Self::DoesNotHold, ["does not hold", "do not hold"]),
        (Self::Undetermined, ["is undetermined", "are undetermined"]),
    ];

    /// In words.
    pub fn words(self) -> &'static str {
        Self::WORDS[self as usize].1[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_follows_from_the_conditions() {
        let verdict = |met: &[bool]| {
            let mut finding = Finding::default();
            for &met in met {
                finding.condition(met).says("");
            }
            finding.verdict()
        };
        assert_eq!(verdict(&[]), ClaimVerdict::Undetermined);
        assert_eq!(verdict(&[true, true]), ClaimVerdict::Holds);
        assert_eq!(verdict(&[false, true]), ClaimVerdict::HoldsInPart);
        assert_eq!(verdict(&[false, false]), ClaimVerdict::DoesNotHold);
    }
}
