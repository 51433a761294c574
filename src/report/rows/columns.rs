//! A column of a table on disk: its type, unit and meaning.

use serde::Serialize;
use svl_core::stereo::CellRule;
use svl_score::judge::{AreaChoice, Better, Metric, MetricOrigin};

/// A column of a table on disk.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ColumnDescription {
    pub name: &'static str,
    /// `text`, `integer`, `number` or `boolean`; with `?` where it may be empty.
    pub kind: &'static str,
    /// Unit of its numbers; counts, names and fractions from 0 to 1 have none.
    pub unit: Option<&'static str>,
    /// Heading of a metric in the tables of algorithms, below that of its group.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading: Option<String>,
    pub about: String,
    /// The area of its number, where another column has that of the headline.
    #[serde(skip)]
    pub(crate) area: Option<AreaChoice>,
}

impl ColumnDescription {
    /// A column whose unit its name ends with.
    pub(crate) fn new(name: &'static str, kind: &'static str, about: &str) -> Self {
        Self {
            name,
            kind,
            unit: unit(name),
            heading: None,
            // Code quotes are of the source.
            about: about.trim().replace('`', ""),
            area: None,
        }
    }

    /// A metric, as options and scenarios name it.
    pub(crate) fn from_metric(metric: &Metric) -> Self {
        let heading = match metric.group {
            "" => metric.head.to_owned(),
            group => format!("{group}: {}", metric.head),
        };
        let better = match metric.better {
            Better::More => "more is better",
            Better::Less => "less is better",
            Better::Zero => "better nearer to 0",
            Better::Neither => "neither direction is better",
        };
        let extent = match metric.origin {
            MetricOrigin::Frame { .. } | MetricOrigin::Time => "",
            MetricOrigin::Cells { .. } | MetricOrigin::Estimated { .. } => "; over all pairs",
            MetricOrigin::Checkpoints => "; of checkpoints",
            MetricOrigin::Drives(_) => "; of drives",
            MetricOrigin::Pieces { .. } => "; of approaches",
        };
        let areas = if metric.by_area { "; of an area" } else { "" };
        let note = metric.note.map(|note| note.text(CellRule::default()).1);
        let note = note.map_or_else(String::new, |note| format!(": {note}"));
        Self {
            name: metric.name,
            kind: "number",
            unit: metric.unit.name(),
            heading: Some(heading),
            about: format!("{} ({better}{extent}{areas}){note}.", metric.words),
            area: None,
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
