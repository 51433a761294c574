//! The parser's errors in terms of TOML, with line and column.

use std::path::Path;
use svl_core::Error;

/// Line number of the byte at `at`, from 1.
pub(super) fn line(text: &str, at: usize) -> usize {
    text.get(..at).unwrap_or(text).matches('\n').count() + 1
}

/// The keys without a default: of the file, of its tables, and of each in its lists of tables.
const REQUIRED: [(&str, &[&str]); 6] = [
    ("", &["name", "source"]),
    ("source", &["kind"]),
    ("checkpoint", &["number", "name"]),
    ("filter", &["detects"]),
    ("stress", &["kind"]),
    ("gate", &["algorithm", "metric"]),
];

/// Keys of [`REQUIRED`] that a scenario lacks.
fn missing_keys(text: &str) -> Vec<String> {
    let Ok(file) = text.parse::<toml::Table>() else {
        return Vec::new();
    };
    let mut missing = Vec::new();
    let mut look = |table: &toml::Table, keys: &[&str], place: String| {
        let absent = keys.iter().filter(|key| !table.contains_key(**key));
        missing.extend(absent.map(|key| format!("{key}{place}")));
    };
    for (name, keys) in REQUIRED {
        match file.get(name) {
            None if name.is_empty() => look(&file, keys, String::new()),
            Some(toml::Value::Table(table)) => look(table, keys, format!(" of [{name}]")),
            Some(toml::Value::Array(tables)) => {
                for (i, table) in (1..).zip(tables.iter().filter_map(toml::Value::as_table)) {
                    look(table, keys, format!(" of [[{name}]] {i}"));
                }
            }
            _ => {}
        }
    }
    missing
}

/// The parser's message, which has several lines, in one, with line and column.
pub(super) fn toml_error(error: &toml::de::Error, text: &str, path: &Path) -> Error {
    let mut message = plain(&error.message().lines().collect::<Vec<_>>().join(" "));
    // serde stops at the first.
    if message.starts_with("missing field") {
        let missing = missing_keys(text);
        if missing.len() > 1 {
            let what = format!("missing {}", missing.join(", "));
            return Error::format(path, what);
        }
        message = message.replacen("field", "key", 1);
    }
    let place = error.span().map(|span| {
        let before = text.get(..span.start).unwrap_or(text);
        let line = line(text, span.start);
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        format!("line {line}, column {column}: ")
    });
    Error::format(path, format!("{}{message}", place.unwrap_or_default()))
}

/// serde's message in terms of TOML instead of Rust types.
fn plain(message: &str) -> String {
    let Some((found, expected)) = message.split_once(", expected ") else {
        return message.to_owned();
    };
    let expected = match expected.split(' ').collect::<Vec<_>>()[..] {
        ["struct" | "map", ..] | ["a", "map"] | ["internally", "tagged", ..] => "a table",
        ["u8" | "u16" | "u32" | "u64" | "usize"] => "a whole number, 0 or more",
        ["i8" | "i16" | "i32" | "i64" | "isize"] => "a whole number",
        ["f32" | "f64"] => "a number",
        ["a", "boolean"] => "true or false",
        ["a", "sequence"] => "a list",
        ["a", "tuple", "of", "size", size] | ["an", "array", "of", "length", size] => {
            &format!("a list of {size}")
        }
        _ => expected,
    };
    let kind = found
        .strip_prefix("invalid type: ")
        .or(found.strip_prefix("invalid value: "));
    let found = match kind.unwrap_or(found) {
        "map" => "a table",
        "sequence" => "a list",
        other => other.strip_prefix("floating point ").unwrap_or(other),
    };
    format!("{found}, expected {expected}")
}
