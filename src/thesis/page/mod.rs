//! The report of the experiments: HTML (one file without scripts or downloads), Markdown and JSON.

use super::{
    ClaimVerdict, DrawnCell, Exhibit, Experiment, Finding, FindingTable, Quantity, TableValue,
};
use serde::Serialize;
use std::fmt::Write;
use svl_core::{Error, Result, joined};
use svl_report::page::{MarkView, PageImages, Value, fill};
use svl_report::table::{NONE, Table};

/// Contents of the report.
pub struct FindingsPage<'a> {
    pub entries: &'a [ExperimentFinding],
    /// Names of the real scenes.
    pub scenes: Vec<String>,
    /// Machine and program: names and values.
    pub identity: Vec<(String, String)>,
    /// Reason why the work stopped early, if it did.
    pub incomplete: Option<String>,
}

/// An experiment and its result.
pub struct ExperimentFinding {
    pub experiment: &'static Experiment,
    pub finding: Finding,
}

/// An experiment for JSON and for the template.
#[derive(Serialize)]
struct EntryView<'a> {
    figure: &'static str,
    title: &'static str,
    claim: &'static str,
    method: &'static str,
    verdict: ClaimVerdict,
    #[serde(flatten)]
    finding: &'a Finding,
}

#[derive(Serialize)]
struct ReportView<'a> {
    incomplete: &'a Option<String>,
    identity: &'a [(String, String)],
    scenes: &'a [String],
    experiments: Vec<EntryView<'a>>,
}

#[derive(Serialize)]
struct SectionView<'a> {
    heading: &'static str,
    words: &'static str,
    numbers: Vec<Table>,
    plots: Vec<&'a str>,
    pictures: Vec<Value>,
    #[serde(flatten)]
    entry: EntryView<'a>,
}

#[derive(Serialize)]
struct PageView<'a> {
    incomplete: &'a Option<String>,
    identity: &'a [(String, String)],
    scenes: String,
    tally: String,
    sections: Vec<SectionView<'a>>,
    images: Vec<Value>,
}

impl FindingsPage<'_> {
    /// Number of experiments per verdict, in words.
    pub fn tally(&self) -> String {
        let verdicts = || self.entries.iter().map(|e| e.finding.verdict());
        let count = |verdict| verdicts().filter(|own| *own == verdict).count();
        let words = |verdict: ClaimVerdict| match count(verdict) {
            0 => None,
            1 => Some(format!("1 {}", verdict.words())),
            n => Some(format!("{n} {}", verdict.plural())),
        };
        joined(ClaimVerdict::ALL.into_iter().filter_map(words))
    }

    /// The report as JSON values.
    ///
    /// # Errors
    /// None in practice: it contains only numbers and text.
    pub fn json(&self) -> Result<serde_json::Value> {
        let report = ReportView {
            incomplete: &self.incomplete,
            identity: &self.identity,
            scenes: &self.scenes,
            experiments: self.entries.iter().map(ExperimentFinding::view).collect(),
        };
        serde_json::to_value(report).map_err(|e| Error::Invalid(format!("report: {e}")))
    }

    /// The report without its figures.
    pub fn markdown(&self) -> String {
        let mut text = format!("# The thesis's experiments\n\n{}.\n", self.tally());
        for ExperimentFinding {
            experiment,
            finding,
        } in self.entries
        {
            let (heading, title, claim) = (experiment.place, experiment.title, experiment.claim);
            let (verdict, why) = (finding.verdict().words(), &finding.why);
            // Writing to a String cannot fail.
            let _ = write!(text, "\n## {heading}: {title}\n\n> {claim}\n\n");
            let _ = write!(text, "**{verdict}**: {why}\n\n");
            for condition in &finding.conditions {
                let met = if condition.met { "met" } else { "not met" };
                let _ = writeln!(text, "- {met}: {}", condition.says);
            }
            for table in tables(finding) {
                let _ = write!(text, "\n{}", table.markdown());
            }
            // The method comes last: readers interested in the result may stop before it.
            let _ = writeln!(text, "\n{}", experiment.method);
        }
        text
    }

    /// The report as one HTML file. All texts are escaped.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the template engine's message.
    pub fn html(&self) -> Result<String> {
        let mut images = PageImages::default();
        let sections = self.entries.iter().map(|entry| entry.section(&mut images));
        let view = PageView {
            incomplete: &self.incomplete,
            identity: &self.identity,
            scenes: self.scenes.join(", "),
            tally: self.tally(),
            sections: sections.collect(),
            images: images.into_views(),
        };
        let (page, style) = (include_str!("page.html"), include_str!("page.css"));
        fill(page, style, &[], view)
    }
}

impl ExperimentFinding {
    fn view(&self) -> EntryView<'_> {
        EntryView {
            figure: self.experiment.figure(),
            title: self.experiment.title,
            claim: self.experiment.claim,
            method: self.experiment.method,
            verdict: self.finding.verdict(),
            finding: &self.finding,
        }
    }

    fn section<'a>(&'a self, images: &mut PageImages<'a>) -> SectionView<'a> {
        let (mut plots, mut pictures) = (Vec::new(), Vec::new());
        for exhibit in &self.finding.exhibits {
            match exhibit {
                Exhibit::Plot(svg) => plots.push(svg.as_str()),
                Exhibit::Picture {
                    caption,
                    png,
                    size,
                    marks,
                } => {
                    let mark =
                        |drawn: &DrawnCell| MarkView::new(drawn.mark, String::new(), drawn.wrong);
                    let marks = marks.iter().map(mark).collect();
                    pictures.push(images.picture(caption, png, *size, marks));
                }
            }
        }
        SectionView {
            heading: self.experiment.place,
            words: self.finding.verdict().words(),
            numbers: tables(&self.finding),
            plots,
            pictures,
            entry: self.view(),
        }
    }
}

/// The quantities next to the thesis's, then the other tables.
fn tables(finding: &Finding) -> Vec<Table> {
    let mut beside = Table::new("", "").with_columns(["thesis", "here"]);
    for quantity in &finding.quantities {
        beside.push(&quantity.name, numbers(quantity));
    }
    let beside = (!beside.rows.is_empty()).then_some(beside);
    let others = finding.tables.iter().map(worded);
    beside.into_iter().chain(others).collect()
}

fn numbers(quantity: &Quantity) -> [String; 2] {
    let with_unit = |number: String| match quantity.unit {
        "" => number,
        unit => format!("{number}\u{a0}{unit}"),
    };
    let thesis = quantity.thesis.clone().map_or_else(String::new, with_unit);
    let ours = quantity.ours.map(|value| with_unit(number(value)));
    [thesis, ours.unwrap_or_else(|| NONE.to_owned())]
}

fn worded(finding: &FindingTable) -> Table {
    let cell = |value: &TableValue| match value {
        TableValue::Number(value) => number(*value),
        TableValue::Text(text) => text.clone(),
        TableValue::Nothing => NONE.to_owned(),
    };
    let mut heads = finding.heads.iter();
    let first = heads.next().map_or("", String::as_str);
    let mut table = Table::new("", first).with_columns(heads);
    for (name, values) in &finding.rows {
        table.push(name, values.iter().map(cell));
    }
    table
}

/// About three digits.
fn number(value: f64) -> String {
    match value.abs() {
        // Counts are whole and shown without decimals.
        v if v >= 100.0 || value == value.round() => format!("{value:.0}"),
        v if v >= 10.0 => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(entries: &[ExperimentFinding]) -> FindingsPage<'_> {
        FindingsPage {
            entries,
            scenes: vec!["tsukuba <&>".into()],
            identity: Vec::new(),
            incomplete: None,
        }
    }

    #[test]
    fn everything_is_there_and_escaped() {
        let mut finding = Finding {
            why: "a < b".into(),
            ..Finding::default()
        };
        finding.condition(true, "x > 1");
        finding.quantity("share <i>", "%", "35", 33.333);
        finding.quantity("nothing", "", "", f64::NAN);
        finding
            .table(["scene", "share, %"])
            .row("cones & co", [TableValue::from(12.34)]);
        let marks = Vec::new();
        finding.exhibits.push(Exhibit::Picture {
            caption: "c & d".into(),
            png: vec![1, 2, 3],
            size: (4, 2),
            marks,
        });
        let entries = [ExperimentFinding {
            experiment: &super::super::EXPERIMENTS[0],
            finding,
        }];
        let html = page(&entries).html().unwrap();
        for text in [
            "a &lt; b",
            "x &gt; 1",
            "share &lt;i&gt;",
            "33.3\u{a0}%",
            "c &amp; d",
            "AQID",
            "cones &amp; co",
            "<td>12.3</td>",
            "tsukuba &lt;&amp;&gt;",
        ] {
            assert!(html.contains(text), "{text}");
        }
        assert_eq!(page(&entries).tally(), "1 holds");
        let markdown = page(&entries).markdown();
        for text in ["share &lt;i", "35\u{a0}%", "33.3\u{a0}%"] {
            assert!(markdown.contains(text), "{markdown}");
        }
        let json = page(&entries).json().unwrap();
        assert_eq!(
            (
                json["experiments"][0]["verdict"].as_str(),
                json["experiments"][0]["figure"].as_str()
            ),
            (Some("holds"), Some("5.1"))
        );
        assert!(json["experiments"][0]["quantities"][1]["ours"].is_null());
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [0.0, 6.0, 1800.4, 35.26, 0.456].map(number),
            ["0", "6", "1800", "35.3", "0.46"]
        );
    }
}
