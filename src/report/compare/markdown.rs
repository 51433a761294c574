//! A comparison as Markdown, for a pull request.

use super::text::{signed, verdict};
use super::{Change, Comparison, Judgement};
use crate::counted;

impl Comparison {
    /// A heading, how the two were made, and a table for each algorithm.
    pub fn markdown(&self) -> String {
        let mut page = format!(
            "### {}: `{}` → `{}`\n\n",
            self.scenario,
            self.base.display(),
            self.other.display()
        );
        for line in self.head() {
            page.push_str(&format!("{line}  \n"));
        }
        for algorithm in &self.algorithms {
            page.push_str(&format!(
                "\n**{}**: {}, {} with equal results\n\n| | base | other | change | 95 % | |\n\
                 |---|---:|---:|---:|---|---|\n",
                algorithm.title(),
                counted(algorithm.pairs, "pair"),
                algorithm.equal_results
            ));
            for (name, change) in algorithm.changes() {
                page.push_str(&row(&name, change));
            }
        }
        page
    }
}

fn row(name: &str, change: &Change) -> String {
    let interval = change
        .interval
        .filter(|_| change.judgement != Judgement::Equal);
    let interval = interval.map(|(low, high)| {
        format!(
            "{} .. {}",
            signed(change.metric, low),
            signed(change.metric, high)
        )
    });
    format!(
        "| {name} | {} | {} | {} | {} | {} |\n",
        change.metric.show(change.base),
        change.metric.show(change.other),
        signed(change.metric, change.difference),
        interval.unwrap_or_default(),
        verdict(change.judgement)
    )
}
