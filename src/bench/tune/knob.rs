//! Knobs that can be turned: the parameters of an algorithm, the filters behind it, the depth grid
//! and the rule by which its cells are scored, each with its range.

use serde::Serialize;
use serde::de::DeserializeOwned;
use std::sync::Arc;
use svl_core::depth::GridSettings;
use svl_core::filter::FilterModel;
use svl_core::matcher::{Algorithm, Parameter, Range, Value};
use svl_core::stereo::CellRule;
use svl_core::{Error, Result};
use svl_score::scenario::MAX_GRID;

/// An algorithm with all its parameters, and how its cells are made and scored.
#[derive(Clone, Debug)]
pub struct TunedSetting {
    pub algorithm: Algorithm,
    pub grid: GridSettings,
    pub cells: CellRule,
    /// The filters that can be switched on.
    pub filters: Vec<Arc<FilterModel>>,
}

/// Something of a [`TunedSetting`] that has a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knob {
    pub part: KnobPart,
    pub name: &'static str,
    /// Unit of the value, empty for a plain number.
    pub unit: &'static str,
    pub range: Range,
    pub description: &'static str,
}

/// The part that a knob belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnobPart {
    Algorithm,
    /// A filter behind the algorithm, on or off.
    Filter,
    /// `[grid]` of a scenario.
    Grid,
    /// `[cells]` of a scenario.
    Cells,
}

impl KnobPart {
    /// Heading of its knobs.
    pub fn words(self) -> &'static str {
        match self {
            Self::Algorithm => "algorithm",
            Self::Filter => "filters",
            Self::Grid => "[grid]",
            Self::Cells => "[cells]",
        }
    }
}

const GRID: [Parameter; 4] = [
    Parameter {
        name: "columns",
        unit: "",
        range: Range::int(5, 1..=MAX_GRID as i32),
        description: "cells of the depth grid in a row",
    },
    Parameter {
        name: "rows",
        unit: "",
        range: Range::int(3, 1..=MAX_GRID as i32),
        description: "rows of the depth grid",
    },
    Parameter {
        name: "min_valid",
        unit: "",
        range: Range::real(0.2, 0.0..=1.0),
        description: "least fraction of a cell's pixels with a disparity for the cell to be known",
    },
    Parameter {
        name: "decision",
        unit: "",
        range: Range::Choice {
            default: "median",
            options: &["median", "safe"],
        },
        description: "what a cell reports: its median, or what is safe",
    },
];

const DISTANCE: [Parameter; 4] = [
    Parameter {
        name: "tolerance_m",
        unit: "m",
        range: Range::real(0.1, 0.001..=10.0),
        description: "a cell is right within this distance, or within tolerance_percent",
    },
    Parameter {
        name: "tolerance_percent",
        unit: "%",
        range: Range::real(20.0, 0.1..=100.0),
        description: "a cell is right within this percentage of the true distance, or tolerance_m",
    },
    Parameter {
        name: "obstacle_m",
        unit: "m",
        range: Range::real(0.5, 0.01..=100.0),
        description: "anything nearer is an obstacle",
    },
    Parameter {
        name: "clear_m",
        unit: "m",
        range: Range::real(0.75, 0.01..=100.0),
        description: "anything farther need not be avoided yet",
    },
];

const DISPARITY: [Parameter; 1] = [Parameter {
    name: "tolerance_px",
    unit: "px",
    range: Range::real(2.0, 0.01..=100.0),
    description: "a cell is right within this difference of disparities",
}];

/// Distance that values are sought in the direction of a step: some algorithms accept only odd
/// ones.
const STEPS: i32 = 16;

impl Knob {
    fn new(part: KnobPart, parameter: &Parameter) -> Self {
        Self {
            part,
            name: parameter.name,
            unit: parameter.unit,
            range: parameter.range,
            description: parameter.description,
        }
    }

    /// A sensible step from `value`: a twentieth of it, or of the default, of whole numbers a
    /// fiftieth, rounded down to 1, 2 or 5 times a power of ten; a coarse one is ten times that.
    /// None for values without an order.
    fn step(&self, value: f64, coarse: bool) -> Option<f64> {
        let ([default, low, high], least, part) = match self.range {
            Range::Int { default, min, max } => ([default, min, max].map(f64::from), 1.0, 50.0),
            Range::Real { default, min, max } => ([default, min, max], 0.0, 20.0),
            _ => return None,
        };
        let size = value.abs().max(default.abs()).max((high - low) / 1000.0);
        let fine = rounded_down(size / part).max(least);
        Some(if coarse { 10.0 * fine } else { fine })
    }

    /// The value `steps` on, within the range; the next option of a choice.
    fn stepped(&self, value: &Value, steps: i32, coarse: bool) -> Option<Value> {
        match (&self.range, value) {
            (Range::Flag { .. }, Value::Flag(is)) => Some(Value::Flag(is ^ (steps % 2 != 0))),
            (Range::Choice { options, .. }, Value::Choice(option)) => {
                let at = options.iter().position(|o| o == option)? as i32;
                let next = (at + steps).rem_euclid(options.len() as i32);
                Some(Value::Choice(options[next as usize]))
            }
            (Range::Int { min, max, .. }, Value::Int(v)) => {
                let step = self.step(f64::from(*v), coarse)?;
                let to = f64::from(*v) + f64::from(steps) * step;
                Some(Value::Int(to.clamp(f64::from(*min), f64::from(*max)) as i32))
            }
            (Range::Real { min, max, .. }, Value::Real(v)) => {
                let step = self.step(*v, coarse)?;
                // On the grid of the steps, with as many decimals as they have.
                let decimals = (-step.log10().floor()).max(0.0) as usize;
                let on_grid = if steps > 0 {
                    (v / step + 1e-6).floor()
                } else {
                    (v / step - 1e-6).ceil()
                };
                let to = (on_grid + f64::from(steps)) * step;
                let to: f64 = format!("{to:.decimals$}").parse().ok()?;
                Some(Value::Real(to.clamp(*min, *max)))
            }
            _ => None,
        }
    }
}

/// 1, 2 or 5 times a power of ten.
fn rounded_down(value: f64) -> f64 {
    let power = 10_f64.powf(value.log10().floor());
    let digit = [5.0, 2.0, 1.0].into_iter().find(|d| value >= d * power);
    digit.unwrap_or(1.0) * power
}

/// The field of `[grid]` or `[cells]` that a knob is called after.
fn field(table: impl Serialize, knob: &Knob) -> Value {
    let table = serde_json::to_value(table).unwrap_or_default();
    let field = &table[knob.name];
    match knob.range {
        Range::Int { .. } => Value::Int(field.as_i64().unwrap_or_default() as i32),
        Range::Choice { default, options } => {
            let found = options.iter().find(|option| *field == ***option);
            Value::Choice(found.unwrap_or(&default))
        }
        _ => Value::Real(field.as_f64().unwrap_or_default()),
    }
}

/// `[grid]` or `[cells]` with another value of the field that a knob is called after.
fn with_field<T: Serialize + DeserializeOwned>(table: T, knob: &Knob, value: &Value) -> Result<T> {
    let wrong = |_| Error::Invalid(format!("{}={value}: expected {}", knob.name, knob.range));
    let mut table = serde_json::to_value(table).map_err(wrong)?;
    table[knob.name] = match value {
        Value::Int(number) => (*number).into(),
        Value::Real(number) => (*number).into(),
        other => other.to_string().into(),
    };
    serde_json::from_value(table).map_err(wrong)
}

impl TunedSetting {
    /// All that can be turned: the algorithm's parameters in the order of its table, then filters,
    /// grid and cells.
    pub fn knobs(&self) -> Vec<Knob> {
        let filters = self.filters.iter().map(|filter| Parameter {
            name: filter.kind.spec().name,
            unit: "",
            range: Range::Flag { default: false },
            description: "run the algorithm behind this filter",
        });
        let filters: Vec<_> = filters.collect();
        let cells: &[Parameter] = match self.cells {
            CellRule::Distance { .. } => &DISTANCE,
            CellRule::Disparity { .. } => &DISPARITY,
        };
        let parts: [(_, &[Parameter]); 4] = [
            (KnobPart::Algorithm, self.algorithm.spec().parameters),
            (KnobPart::Filter, &filters),
            (KnobPart::Grid, &GRID),
            (KnobPart::Cells, cells),
        ];
        let knobs = parts.into_iter().flat_map(|(part, parameters)| {
            let knob = move |parameter| Knob::new(part, parameter);
            parameters.iter().map(knob)
        });
        knobs.collect()
    }

    /// The value of one of its knobs.
    pub fn value(&self, knob: &Knob) -> Value {
        match knob.part {
            KnobPart::Algorithm => {
                let mut parameters = self.algorithm.parameters().iter();
                let found = parameters.find(|(name, _)| *name == knob.name);
                found.map_or_else(|| knob.range.default(), |(_, value)| value.clone())
            }
            KnobPart::Filter => {
                let mut filters = self.algorithm.filters().iter();
                Value::Flag(filters.any(|filter| filter.kind.spec().name == knob.name))
            }
            KnobPart::Grid => field(self.grid, knob),
            KnobPart::Cells => field(self.cells, knob),
        }
    }

    /// The same with another value of a knob.
    ///
    /// # Errors
    /// The reason why the algorithm or the rule rejects the value beside the others.
    pub fn with(&self, knob: &Knob, value: &Value) -> Result<Self> {
        let mut changed = self.clone();
        match knob.part {
            KnobPart::Algorithm => {
                changed.algorithm = self.algorithm.with(knob.name, value)?;
                changed.algorithm.check()?;
            }
            KnobPart::Filter => {
                let is_on = |filter: &&Arc<FilterModel>| {
                    let mut before = self.algorithm.filters().iter();
                    if filter.kind.spec().name == knob.name {
                        *value == Value::Flag(true)
                    } else {
                        before.any(|other| other.kind == filter.kind)
                    }
                };
                let filters: Vec<_> = self.filters.iter().filter(is_on).cloned().collect();
                let bare = self.algorithm.written();
                changed.algorithm = bare.parse::<Algorithm>()?.filtered(&filters);
            }
            KnobPart::Grid => changed.grid = with_field(self.grid, knob, value)?,
            KnobPart::Cells => {
                changed.cells = with_field(self.cells, knob, value)?;
                changed.cells.validate()?;
            }
        }
        Ok(changed)
    }

    /// The same with the value that a person typed.
    ///
    /// # Errors
    /// The errors of [`TunedSetting::with`]; what the range expects.
    pub fn typed(&self, knob: &Knob, text: &str) -> Result<Self> {
        let value = knob.range.parse(text).ok_or_else(|| {
            let (name, range) = (knob.name, knob.range);
            Error::Invalid(format!("{name}={text}: expected {range}"))
        })?;
        self.with(knob, &value)
    }

    /// The same a step up or down, to the next value that the algorithm accepts beside the others.
    ///
    /// # Errors
    /// No further value in this direction, or a knob without steps.
    pub fn stepped(&self, knob: &Knob, up: bool, coarse: bool) -> Result<Self> {
        let before = self.value(knob);
        let steps = (1..=STEPS).map(|n| if up { n } else { -n });
        let values = steps.filter_map(|steps| knob.stepped(&before, steps, coarse));
        let mut refused = None;
        for value in values.filter(|value| *value != before) {
            match self.with(knob, &value) {
                Ok(setting) => return Ok(setting),
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        let (name, range) = (knob.name, knob.range);
        Err(refused.unwrap_or_else(|| match knob.step(0.0, false) {
            Some(_) => Error::Invalid(format!("{name}={before} is the end: {range}")),
            None => Error::Invalid(format!("{name}: type a value; expected {range}")),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::matcher::MATCHERS;

    fn setting(algorithm: &str) -> TunedSetting {
        TunedSetting {
            algorithm: algorithm.parse().unwrap(),
            grid: GridSettings::default(),
            cells: CellRule::default(),
            filters: Vec::new(),
        }
    }

    fn knob(setting: &TunedSetting, name: &str) -> Knob {
        let knobs = setting.knobs();
        *knobs.iter().find(|knob| knob.name == name).unwrap()
    }

    /// The values that the steps visit.
    fn walk(algorithm: &str, name: &str, up: bool, coarse: bool, steps: usize) -> Vec<String> {
        let mut now = setting(algorithm);
        let knob = knob(&now, name);
        let next = |_| {
            now = now.stepped(&knob, up, coarse).ok()?;
            Some(now.value(&knob).to_string())
        };
        (0..steps).map_while(next).collect()
    }

    #[test]
    fn a_step_is_sensible() {
        assert_eq!(
            walk("v3", "texture_delta", true, false, 3),
            ["3.4", "3.5", "3.6"]
        );
        assert_eq!(
            walk("v3", "texture_delta", false, true, 9),
            ["3", "2", "1", "0.1"]
        );
        assert_eq!(walk("v3", "max_disparity", true, true, 2), ["90", "100"]);
        assert_eq!(
            walk("bm", "block_size", true, false, 20).last().unwrap(),
            "31"
        );
        assert_eq!(walk("bm", "block_size", false, false, 9), ["7", "5"]);
        assert_eq!(walk("bm", "prefilter", false, false, 2), ["log", "xsobel"]);
        assert_eq!(walk("v3", "subpixel", true, true, 2), ["true", "false"]);
        assert_eq!(walk("v3", "decision", true, false, 1), ["safe"]);
    }

    #[test]
    fn every_knob_of_every_algorithm_keeps_and_takes_its_value() {
        for spec in MATCHERS.iter().filter(|spec| !spec.is_recorded()) {
            let setting = setting(spec.name);
            for knob in setting.knobs() {
                let value = setting.value(&knob);
                let same = setting.with(&knob, &value).unwrap();
                assert_eq!(same.value(&knob), value, "{} {}", spec.name, knob.name);
                assert_eq!(same.algorithm.written(), spec.name);
                for up in [true, false] {
                    if let Ok(next) = setting.stepped(&knob, up, false) {
                        assert_ne!(next.value(&knob), value, "{} {}", spec.name, knob.name);
                        let others = setting.knobs().into_iter().filter(|other| *other != knob);
                        for other in others {
                            assert_eq!(next.value(&other), setting.value(&other));
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn invalid_values_are_refused_with_the_valid_ones() {
        let bm = setting("bm");
        let refused = |name: &str, text: &str| {
            let typed = bm.typed(&knob(&bm, name), text);
            typed.unwrap_err().to_string()
        };
        let says = |error: String, words: &str| assert!(error.contains(words), "{error}");
        says(refused("block_size", "8"), "is even");
        says(refused("block_size", "99"), "a whole number in 5..=31");
        says(refused("clear_m", "0.1"), "must be below");
        says(refused("decision", "mean"), "median, safe");
        let refused = bm.stepped(&knob(&setting("exec"), "command"), true, false);
        says(refused.unwrap_err().to_string(), "type a value");
    }
}
