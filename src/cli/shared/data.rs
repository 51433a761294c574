//! Data as text: the values that `--json` prints, a line each, with labels and units.

use super::terminal::{size, wrapped};
use serde::Serialize;
use serde_json::Value;
use svl::report::table::{Table, TerminalStyle};

/// A field of some data: its keys in the JSON, with dots between them, and its label.
pub(crate) struct DataField {
    path: &'static str,
    label: &'static str,
    /// True for a count that is left out if it is 0.
    is_event: bool,
}

/// A field that is left out if it is empty.
pub(crate) const fn field(path: &'static str, label: &'static str) -> DataField {
    DataField {
        path,
        label,
        is_event: false,
    }
}

/// A number of events, which is left out if there are none.
pub(crate) const fn events(path: &'static str, label: &'static str) -> DataField {
    DataField {
        is_event: true,
        ..field(path, label)
    }
}

/// Column where values begin.
const COLUMN: usize = 16;
/// Largest number of entries of a list that are printed.
const MAX_LISTED: usize = 12;
/// Keys of values that need no name.
const NAMELESS: [&str; 6] = ["algorithm", "bytes", "codec", "error", "reason", "topic"];
/// Keys of an object that come first, in this order; the others follow by name.
const FIRST: [&str; 11] = [
    "topic",
    "algorithm",
    "codec",
    "frame",
    "parent",
    "at",
    "from",
    "to",
    "min",
    "median",
    "max",
];

/// The fields that the data has, in the order of `fields`: a line per value, and per entry of a
/// list. Lines are broken at the column `last`.
///
/// # Errors
/// The errors of serialization.
pub(crate) fn data_text(
    data: &impl Serialize,
    fields: &[DataField],
    last: usize,
) -> serde_json::Result<String> {
    let data = serde_json::to_value(data)?;
    let mut text = String::new();
    for field in fields {
        let mut keys = field.path.split('.');
        let value = keys.try_fold(&data, |data, key| data.get(key));
        let key = field.path.rsplit('.').next().unwrap_or_default();
        let lines = value.map_or_else(Vec::new, |value| entries(key, value, field.is_event));
        for (place, line) in lines.iter().enumerate() {
            let label = if place == 0 { field.label } else { "" };
            text += &wrapped(&format!("{label:COLUMN$}"), COLUMN, line, last);
        }
    }
    Ok(text)
}

/// The columns of a list of data, each a key and its heading.
pub(crate) struct DataColumns<'a> {
    pub name: (&'a str, &'a str),
    pub numbers: &'a [(&'a str, &'a str)],
    pub text: (&'a str, &'a str),
}

/// A table of a list of data.
///
/// # Errors
/// The errors of serialization.
pub(crate) fn data_table(
    rows: &impl Serialize,
    columns: &DataColumns<'_>,
    last: usize,
) -> serde_json::Result<String> {
    let rows = serde_json::to_value(rows)?;
    let (name, numbers, text) = (columns.name, columns.numbers, columns.text);
    let headings = numbers.iter().map(|(_, heading)| *heading);
    let table = Table::new("", name.1).with_columns(headings);
    let mut table = table.with_texts([text.1]);
    for row in rows.as_array().into_iter().flatten() {
        let cell = |key: &str| words(key, &row[key]).unwrap_or_default();
        let keys = numbers.iter().chain([&text]).map(|(key, _)| *key);
        table.push(cell(name.0), keys.map(cell));
    }
    Ok(table.terminal(TerminalStyle::plain(last)))
}

/// The lines of a value: those of a list are its entries.
fn entries(key: &str, value: &Value, is_event: bool) -> Vec<String> {
    match value {
        Value::Bool(false) => vec!["no".to_owned()],
        value if is_event && is_zero(value) => Vec::new(),
        Value::Array(all) if has_entries(value) => {
            let shown = all.iter().take(MAX_LISTED);
            let mut lines: Vec<_> = shown.filter_map(|entry| words(key, entry)).collect();
            if all.len() > MAX_LISTED {
                let more = all.len() - MAX_LISTED;
                lines.push(format!("and {more} more; --json lists them"));
            }
            lines
        }
        value => words(key, value).into_iter().collect(),
    }
}

fn is_zero(value: &Value) -> bool {
    match value {
        Value::Array(all) => all.iter().all(is_zero),
        Value::Object(fields) => fields.values().all(is_zero),
        Value::String(text) => text == "0",
        value => value.as_f64() == Some(0.0),
    }
}

/// True for a list of lists or objects.
fn has_entries(value: &Value) -> bool {
    let is_entry = |value: &Value| value.is_object() || value.is_array();
    value.as_array().is_some_and(|all| all.iter().any(is_entry))
}

/// A value in words; absent if it is empty.
fn words(key: &str, value: &Value) -> Option<String> {
    let joined = |parts: Vec<String>| (!parts.is_empty()).then(|| parts.join(", "));
    match value {
        Value::Null | Value::Bool(false) => None,
        Value::Bool(true) => Some("yes".to_owned()),
        Value::Number(number) => Some(number_words(key, number)),
        // Nanoseconds are text.
        Value::String(text) => match text.parse() {
            Ok(number) if key.rsplit('_').next() == Some("ns") => Some(number_words(key, &number)),
            _ => Some(text.clone()),
        },
        Value::Array(sides) if key == "size_px" => {
            let sides: Vec<_> = sides.iter().map(Value::to_string).collect();
            Some(sides.join("x") + " px")
        }
        Value::Array(all) => joined(all.iter().filter_map(|value| words(key, value)).collect()),
        Value::Object(fields) if fields.contains_key("words") => words("words", &fields["words"]),
        Value::Object(fields) => {
            let mut fields: Vec<_> = fields.iter().collect();
            fields.sort_by_key(|(own, _)| {
                let name = own.rsplit_once('_').map_or(own.as_str(), |(name, _)| name);
                let place = FIRST.iter().position(|first| *first == name);
                (place.unwrap_or(FIRST.len()), *own == "reason")
            });
            let words = fields
                .iter()
                .filter_map(|(own, value)| field_words(key, own, value));
            joined(words.collect())
        }
    }
}

/// A field of an object, with its name. A value whose key has no unit has that of the object. Lists
/// of objects have lines of their own.
fn field_words(key: &str, own: &str, value: &Value) -> Option<String> {
    if has_entries(value) {
        return None;
    }
    let (name, has_unit) = match own.rsplit_once('_') {
        Some((name, unit)) if is_unit(unit) => (name, true),
        _ => (own, is_unit(own)),
    };
    let words = words(if has_unit { own } else { key }, value)?;
    // Names of topics stay as they are.
    let name = if name.starts_with('/') {
        name.to_owned()
    } else {
        name.trim_start_matches("is_").replace('_', " ")
    };
    match value {
        _ if NAMELESS.contains(&own) => Some(words),
        Value::Bool(_) => Some(name),
        Value::Object(_) | Value::Array(_) => Some(format!("{name} ({words})")),
        _ => Some(format!("{name} {words}")),
    }
}

fn is_unit(word: &str) -> bool {
    ["ns", "px", "m", "hz", "bytes"].contains(&word)
}

/// A number in the unit that its key ends with.
fn number_words(key: &str, number: &serde_json::Number) -> String {
    let value = number.as_f64().unwrap_or(f64::NAN);
    match key.rsplit('_').next() {
        Some("ns") if value.abs() >= 1e8 => format!("{:.3} s", value / 1e9),
        Some("ns") => format!("{:.3} ms", value / 1e6),
        Some("bytes") => size(value as u64),
        Some("m") => format!("{value:.4} m"),
        Some("hz") => format!("{value:.2} Hz"),
        Some("px") if number.is_f64() => format!("{value:.2} px"),
        Some("px") => format!("{number} px"),
        _ if number.is_f64() => {
            let text = format!("{value:.4}");
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        }
        _ => number.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_have_labels_and_units() {
        let data = json!({
            "bytes": 2_500_000, "duration_ns": "3900000000", "drops": 0, "seed": 0,
            "damage": null, "is_intact": false, "size_px": [320, 240],
            "skew": { "min_ns": "-5000", "max_ns": "8000" },
            "truths": [{
                "topic": "/truth_depth", "is_asked_for": true, "pairs": 3, "error": null,
                "distance_m": { "min": 0.5, "max": 2.0 }
            }],
            "missing": { "/left_image": 5 },
            "gaps": ([1, 2, 3].map(|n| json!({ "after_ns": n * 1_000_000_000_u64 }))),
        });
        let fields = [
            field("bytes", "size"),
            field("duration_ns", "duration"),
            events("drops", "dropped"),
            field("seed", "seed"),
            field("damage", "damage"),
            field("is_intact", "intact"),
            field("size_px", "images"),
            field("skew", "skew"),
            field("skew.max_ns", "largest skew"),
            field("truths", "truth"),
            field("missing", "missing"),
            field("gaps", "gaps"),
        ];
        let expected = "\
size            2.5 MB
duration        3.900 s
seed            0
intact          no
images          320x240 px
skew            min -0.005 ms, max 0.008 ms
largest skew    0.008 ms
truth           /truth_depth, distance (min 0.5000 m, max 2.0000 m), asked for, pairs 3
missing         /left_image 5
gaps            after 1.000 s
                after 2.000 s
                after 3.000 s
";
        assert_eq!(data_text(&data, &fields, 100).unwrap(), expected);
    }

    #[test]
    fn long_lists_are_cut() {
        let data = json!({ "gaps": vec![json!({ "length_ns": 7 }); MAX_LISTED + 4] });
        let text = data_text(&data, &[field("gaps", "gaps")], 80).unwrap();
        assert_eq!(text.lines().count(), MAX_LISTED + 1, "{text}");
        assert!(text.ends_with("and 4 more; --json lists them\n"), "{text}");
    }

    #[test]
    fn a_table_has_a_row_per_entry() {
        let rows = json!([{ "name": "/tf", "messages": 5, "rate_hz": 10.0, "schema": "TF" }]);
        let columns = DataColumns {
            name: ("name", "topic"),
            numbers: &[("rate_hz", "rate")],
            text: ("schema", "schema"),
        };
        let text = data_table(&rows, &columns, 80).unwrap();
        assert_eq!(text, "topic      rate  schema\n/tf    10.00 Hz  TF\n");
    }
}
