//! Ranges of the numbers of a configuration, as a table.

use crate::{Error, Result};

/// A number of a `T`: its key, its value, and the least and the largest valid value.
pub type NumberRange<T> = (&'static str, fn(&T) -> f64, f64, f64);

/// A table of [`NumberRange`]s, a line each: the path of a field, and its range.
#[macro_export]
macro_rules! number_ranges {
    ($config:ty: $($($field:ident).+ $([$i:literal])? in $from:literal, $to:literal;)+) => {
        &[$((
            stringify!($($field).+),
            |config: &$config| config.$($field).+$([$i])? as f64,
            $from,
            $to,
        )),+]
    };
}
pub use number_ranges;

/// # Errors
/// [`Error::Invalid`] with `prefix` and the key of the first number that is out of its range.
pub fn check_ranges<T>(prefix: &str, numbers: &T, ranges: &[NumberRange<T>]) -> Result<()> {
    ranges
        .iter()
        .try_for_each(|(key, value, from, to)| check_range(prefix, key, value(numbers), *from, *to))
}

/// # Errors
/// The errors of [`check_ranges`].
pub fn check_range(prefix: &str, key: &str, value: f64, from: f64, to: f64) -> Result<()> {
    if (from..=to).contains(&value) {
        Ok(())
    } else {
        let words = format!("{prefix}{key} = {value} is outside {from} ..= {to}");
        Err(Error::Invalid(words))
    }
}
