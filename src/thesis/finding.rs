//! The result of an experiment: conditions, quantities, tables, pictures.

use serde::Serialize;
use svl_files::overlay::Mark;
use svl_report::plot::Chart;

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
    #[serde(skip)]
    pub exhibits: Vec<Exhibit>,
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
    pub thesis: Option<String>,
    /// `None` if there was nothing to measure.
    pub ours: Option<f64>,
}

/// A table of numbers.
#[derive(Clone, Debug, Serialize)]
pub struct FindingTable {
    /// Headings of the columns; the first is that of the row names.
    pub heads: Vec<String>,
    pub rows: Vec<(String, Vec<TableValue>)>,
}

/// A cell of a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum TableValue {
    Number(f64),
    Text(String),
    Nothing,
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

/// A plot or a picture.
#[derive(Clone, Debug)]
pub enum Exhibit {
    /// A plot as SVG.
    Plot(String),
    /// A picture, with a depth grid drawn on it.
    Picture {
        caption: String,
        png: Vec<u8>,
        size: (usize, usize),
        marks: Vec<DrawnCell>,
    },
}

/// A cell of the depth grid, drawn on a picture.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DrawnCell {
    #[serde(flatten)]
    pub mark: Mark,
    /// True if the cell is crossed out.
    pub wrong: bool,
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

    pub(super) fn condition(&mut self, met: bool, says: impl Into<String>) {
        self.conditions.push(Condition {
            says: says.into(),
            met,
        });
    }

    /// `thesis` is empty if the thesis gives no number.
    pub(super) fn quantity(
        &mut self,
        name: impl Into<String>,
        unit: &'static str,
        thesis: &str,
        ours: impl Into<Option<f64>>,
    ) {
        let thesis = (!thesis.is_empty()).then(|| thesis.to_owned());
        // NaN means a fraction with denominator 0; JSON has no NaN.
        let ours = ours.into().filter(|v| v.is_finite());
        self.quantities.push(Quantity {
            name: name.into(),
            unit,
            thesis,
            ours,
        });
    }

    pub(super) fn table<const N: usize>(&mut self, heads: [&str; N]) -> &mut FindingTable {
        self.tables.push(FindingTable {
            heads: heads.map(str::to_owned).to_vec(),
            rows: Vec::new(),
        });
        // The table is filled by the caller, row by row.
        let last = self.tables.len() - 1;
        &mut self.tables[last]
    }

    pub(super) fn plot(&mut self, chart: &Chart) {
        self.show(Exhibit::Plot(chart.svg()));
    }

    pub(super) fn show(&mut self, exhibit: Exhibit) {
        self.exhibits.push(exhibit);
    }
}

impl FindingTable {
    pub(super) fn row(
        &mut self,
        name: impl Into<String>,
        values: impl IntoIterator<Item = TableValue>,
    ) {
        self.rows.push((name.into(), values.into_iter().collect()));
        debug_assert!(
            self.rows
                .last()
                .is_some_and(|(_, row)| row.len() + 1 == self.heads.len())
        );
    }
}

impl<V: Into<Option<f64>>> From<V> for TableValue {
    fn from(value: V) -> Self {
        value
            .into()
            .filter(|v| v.is_finite())
            .map_or(Self::Nothing, Self::Number)
    }
}

impl ClaimVerdict {
    /// All verdicts, the best first.
    pub const ALL: [Self; 4] = [
        Self::Holds,
        Self::HoldsInPart,
        Self::DoesNotHold,
        Self::Undetermined,
    ];

    /// In words, for several claims.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Holds => "hold",
            Self::HoldsInPart => "hold in part",
            Self::DoesNotHold => "do not hold",
            Self::Undetermined => "are undetermined",
        }
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::HoldsInPart => "holds in part",
            Self::DoesNotHold => "does not hold",
            Self::Undetermined => "is undetermined",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_follows_from_the_conditions() {
        let verdict = |met: &[bool]| {
            let mut finding = Finding::default();
            met.iter().for_each(|&met| finding.condition(met, ""));
            finding.verdict()
        };
        assert_eq!(verdict(&[]), ClaimVerdict::Undetermined);
        assert_eq!(verdict(&[true, true]), ClaimVerdict::Holds);
        assert_eq!(verdict(&[false, true]), ClaimVerdict::HoldsInPart);
        assert_eq!(verdict(&[false, false]), ClaimVerdict::DoesNotHold);
    }
}
