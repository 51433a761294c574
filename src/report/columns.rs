//! A column of a table on disk: its type, unit and meaning.

use serde::Serialize;

/// A column of a table on disk.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ColumnDescription {
    pub name: &'static str,
    /// `text`, `integer`, `number` or `boolean`; with `?` where it may be empty.
    pub kind: &'static str,
    /// Unit of its numbers; counts, names and fractions from 0 to 1 have none.
    pub unit: Option<&'static str>,
    pub about: String,
}

impl ColumnDescription {
    /// A column whose unit its name ends with.
    pub(super) fn new(name: &'static str, kind: &'static str, about: &str) -> Self {
        Self {
            name,
            kind,
            unit: unit(name),
            // Code quotes are of the source.
            about: about.trim().replace('`', ""),
        }
    }
}

/// Units by the suffixes of names.
const UNITS: [(&str, &str); 11] = [
    ("_per_m_per_s", "1/(m s)"),
    ("_m_per_s", "m/s"),
    ("_per_mp_s", "s per million pixels"),
    ("_per_gd_s", "s per 10⁹ pixels times disparities"),
    ("mde_per_s", "million pixels times disparities per s"),
    ("_ns", "ns"),
    ("_us", "µs"),
    ("_ms", "ms"),
    ("_px", "px"),
    ("_mb", "10⁶ bytes"),
    ("heading", "rad"),
];

fn unit(name: &str) -> Option<&'static str> {
    let found = UNITS.iter().find(|(ending, _)| name.ends_with(ending));
    let short = || match name.rsplit_once('_')?.1 {
        "m" => Some("m"),
        "s" => Some("s"),
        _ => None,
    };
    found.map(|(_, unit)| *unit).or_else(short)
}
