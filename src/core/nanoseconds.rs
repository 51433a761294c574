//! Nanoseconds in JSON that is printed and in reports: text, as numbers of JavaScript and of many
//! readers of JSON are exact up to 2⁵³ alone, 104 days of nanoseconds.

use serde::Serializer;

/// Serializes a field: `#[serde(serialize_with = "nanoseconds::as_text")]`.
///
/// # Errors
/// The errors of the serializer.
pub fn as_text<S: Serializer>(value: &impl Nanoseconds, to: S) -> Result<S::Ok, S::Error> {
    match value.nanoseconds() {
        Some(ns) => to.collect_str(&ns),
        None => to.serialize_none(),
    }
}

/// A number of nanoseconds, or none.
pub trait Nanoseconds {
    fn nanoseconds(&self) -> Option<i128>;
}

impl Nanoseconds for u64 {
    fn nanoseconds(&self) -> Option<i128> {
        Some((*self).into())
    }
}

impl Nanoseconds for i64 {
    fn nanoseconds(&self) -> Option<i128> {
        Some((*self).into())
    }
}

impl<T: Nanoseconds> Nanoseconds for Option<T> {
    fn nanoseconds(&self) -> Option<i128> {
        self.as_ref()?.nanoseconds()
    }
}
