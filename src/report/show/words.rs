//! Number formats of tables and texts.

use svl_score::judge::MetricUnit;

/// Shown for a number that does not exist.
pub const NONE: &str = "–";

/// A value in a table, whose heading has the unit.
pub(crate) fn number(unit: MetricUnit, value: f64) -> String {
    match unit {
        MetricUnit::Share => format!("{:.1}", 100.0 * value),
        MetricUnit::Count => format!("{value:.0}"),
        MetricUnit::Px => format!("{value:.2}"),
        MetricUnit::M => format!("{value:.3}"),
        MetricUnit::Per100M => format!("{value:.1}"),
        MetricUnit::Ms => ms(value),
    }
}

/// A fraction as a percentage with one decimal.
pub(crate) fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| NONE.to_owned(), |s| format!("{:.1}", 100.0 * s))
}

/// A time: two digits that count, at most three decimals.
pub(crate) fn ms(time_ms: f64) -> String {
    let decimals = match time_ms {
        ..0.1 => 3,
        ..0.995 => 2,
        ..99.95 => 1,
        _ => 0,
    };
    format!("{time_ms:.decimals$}")
}

/// A time, if there is one.
pub(crate) fn time(time_ms: Option<f64>) -> String {
    time_ms.map_or_else(|| NONE.to_owned(), ms)
}

/// Three digits that count.
pub(crate) fn digits(number: Option<f64>) -> String {
    let Some(number) = number else {
        return NONE.to_owned();
    };
    // Digits before the decimal point; negative for leading zeros behind it.
    let whole = if number > 0.0 {
        number.log10().floor() as i32 + 1
    } else {
        1
    };
    format!("{number:.*}", (3 - whole).clamp(0, 6) as usize)
}

/// A mark for a frame that passed or failed.
pub(crate) fn mark(passed: bool) -> char {
    if passed { '✓' } else { '✗' }
}

/// A word of a command line, in quotes where a shell would split it.
pub fn shell_word(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./:=,+@%".contains(c);
    if word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_splits_no_word() {
        let words = ["a/b-1.mcap", "my run.mcap", "it's"].map(shell_word);
        assert_eq!(words, ["a/b-1.mcap", "'my run.mcap'", r"'it'\''s'"]);
    }
}
