//! The report of the experiments: HTML (one file without scripts or downloads), Markdown and JSON.

use super::{ClaimVerdict, Exhibit, Experiment, Finding, FindingTable, Quantity};
use serde_json::{Value, json};
use std::fmt::Write;
use svl_core::{Result, joined};
use svl_report::page::{MarkView, PageImages, fill};
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

impl FindingsPage<'_> {
    /// Number of experiments per verdict, in words.
    pub fn tally(&self) -> String {
        let count = |verdict| {
            let verdicts = self.entries.iter().map(|e| e.finding.verdict());
            verdicts.filter(|own| *own == verdict).count()
        };
        let counts = ClaimVerdict::WORDS.map(|(verdict, words)| (count(verdict), words));
        let found = counts.into_iter().filter(|(count, _)| *count > 0);
        let found = found.map(|(n, words)| format!("{n} {}", words[usize::from(n > 1)]));
        joined(found)
    }

    /// The report as JSON.
    pub fn json(&self) -> Value {
        let experiments: Vec<_> = self.entries.iter().map(ExperimentFinding::json).collect();
        json!({
            "incomplete": self.incomplete,
            "identity": self.identity,
            "scenes": self.scenes,
            "experiments": experiments,
        })
    }

    /// The report without its figures.
    pub fn markdown(&self) -> String {
        let mut text = format!("# The thesis's experiments\n\n{}.\n", self.tally());
        for entry in self.entries {
            let (experiment, finding) = (entry.experiment, &entry.finding);
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
    /// The errors of [`fill`].
    pub fn html(&self) -> Result<String> {
        let mut images = PageImages::default();
        let sections = self.entries.iter().map(|entry| entry.section(&mut images));
        let sections: Vec<_> = sections.collect();
        let view = json!({
            "incomplete": self.incomplete,
            "identity": self.identity,
            "scenes": self.scenes.join(", "),
            "tally": self.tally(),
            "sections": sections,
            "images": images.into_views(),
        });
        let (page, style) = (include_str!("page.html"), include_str!("page.css"));
        fill(page, style, &[], view)
    }
}

impl ExperimentFinding {
    fn json(&self) -> Value {
        let mut json = json!(self.finding);
        json["figure"] = json!(self.experiment.figure());
        json["title"] = json!(self.experiment.title);
        json["claim"] = json!(self.experiment.claim);
        json["method"] = json!(self.experiment.method);
        json["verdict"] = json!(self.finding.verdict());
        json
    }

    /// For the template: also with plots and pictures.
    fn section<'a>(&'a self, images: &mut PageImages<'a>) -> Value {
        let finding = &self.finding;
        let mut picture = |picture: &'a Exhibit| {
            let marks = picture.marks.iter();
            let marks = marks.map(|(mark, wrong)| MarkView::new(*mark, String::new(), *wrong));
            let (caption, png) = (&picture.caption, &picture.png);
            images.picture(caption, png, picture.size, marks.collect())
        };
        let pictures: Vec<_> = finding.pictures.iter().map(&mut picture).collect();
        let mut section = self.json();
        section["heading"] = json!(self.experiment.place);
        section["words"] = json!(finding.verdict().words());
        section["numbers"] = json!(tables(finding));
        section["plots"] = json!(finding.plots);
        section["pictures"] = json!(pictures);
        section
    }
}

/// The quantities next to the thesis's, then the other tables.
fn tables(finding: &Finding) -> Vec<Table> {
    let mut beside = Table::new("", "").with_columns(["thesis", "here"]);
    for quantity in &finding.quantities {
        beside.push(&quantity.name, numbers(quantity));
    }
    let others = finding.tables.iter().map(worded);
    beside.if_any().into_iter().chain(others).collect()
}

fn numbers(quantity: &Quantity) -> [String; 2] {
    let thesis = quantity.thesis.unwrap_or_default().to_owned();
    [thesis, number(quantity.ours)].map(|number| match (&*number, quantity.unit) {
        ("" | NONE, _) | (_, "") => number,
        (_, unit) => format!("{number}\u{a0}{unit}"),
    })
}

fn worded(finding: &FindingTable) -> Table {
    let cell = |value: &Value| match value {
        Value::String(text) => text.clone(),
        value => number(value.as_f64().unwrap_or(f64::NAN)),
    };
    let mut table = Table::new("", &finding.heads[0]).with_columns(&finding.heads[1..]);
    for (name, values) in &finding.rows {
        table.push(name, values.iter().map(cell));
    }
    table
}

/// About three digits.
fn number(value: f64) -> String {
    match value.abs() {
        v if !v.is_finite() => NONE.to_owned(),
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
        finding.condition(true).says("x > 1");
        finding.quantity("share <i>", "%", "35", 33.333);
        finding.quantity("nothing", "", "", f64::NAN);
        finding.table("scene | share, %", [("cones & co".into(), [12.34])]);
        finding.pictures.push(Exhibit {
            caption: "c & d".into(),
            png: vec![1, 2, 3],
            size: (4, 2),
            marks: Vec::new(),
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
        let json = page(&entries).json();
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
