//! A protocol's numbers by name, in the order of its table.

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// Named numbers. In JSON an object of them, `null` for missing ones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Numbers(Vec<Number>);

/// One number of a protocol; `None` if its denominator is 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number {
    pub name: &'static str,
    pub value: Option<f64>,
    pub unit: NumberUnit,
}

/// Unit of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumberUnit {
    /// Per cent of the scored pixels, or as the protocol defines it.
    Percent,
    /// Disparity.
    Px,
    /// Number of pixels; the sum over several images.
    Count,
}

impl Numbers {
    pub(super) fn add(&mut self, name: &'static str, unit: NumberUnit, value: Option<f64>) {
        self.0.push(Number { name, value, unit });
    }

    /// Adds `100 part / whole`.
    pub(super) fn add_share(&mut self, name: &'static str, part: usize, whole: usize) {
        self.add(name, NumberUnit::Percent, percent(part, whole));
    }

    pub fn iter(&self) -> impl Iterator<Item = &Number> {
        self.0.iter()
    }

    /// The value of that name; `None` also if it has no value.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.iter().find(|number| number.name == name)?.value
    }

    /// The weighted mean of one protocol's numbers over images, counts summed; `None` if an image
    /// has no value.
    pub(super) fn mean(images: &[(f64, Self)]) -> Self {
        let first = images.first().map_or(&[][..], |(_, numbers)| &numbers.0);
        let over = |(i, number): (usize, &Number)| {
            let is_count = number.unit == NumberUnit::Count;
            let weight = |weight: f64| if is_count { 1.0 } else { weight };
            let parts = images.iter().map(|(w, numbers)| {
                let value = numbers.0[i].value?;
                Some(weight(*w) * value)
            });
            // One image without the number leaves the mean without one, as in the kits.
            let sum: Option<f64> = parts.sum();
            let weights: f64 = images.iter().map(|(weight, _)| weight).sum();
            Number {
                value: sum.map(|sum| if is_count { sum } else { sum / weights }),
                ..*number
            }
        };
        Self(first.iter().enumerate().map(over).collect())
    }
}

/// `100 part / whole`.
pub(super) fn percent(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| 100.0 * part as f64 / whole as f64)
}

impl Serialize for Numbers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for Number { name, value, unit } in self.iter() {
            match (unit, value) {
                // 12 rather than 12.0, as pixels are counted.
                (NumberUnit::Count, Some(count)) => map.serialize_entry(name, &(*count as u64))?,
                _ => map.serialize_entry(name, value)?,
            }
        }
        map.end()
    }
}
