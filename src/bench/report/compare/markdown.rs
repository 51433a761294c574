//! A comparison as Markdown, for a pull request.

use super::text::{signed, verdict};
use super::{Change, Comparison};
use svl_core::counted;

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
                "\n**{}**: {}, {} with equal results{}\n\n| | base | other | change | 95 % | |\n\
                 |---|---:|---:|---:|---|---|\n",
                algorithm.title(),
                counted(algorithm.pairs, "pair"),
                algorithm.equal_results,
                algorithm
                    .failures()
                    .map_or_else(String::new, |failures| format!("; {failures}")),
            ));
            for (name, change) in algorithm.changes() {
                page.push_str(&change.markdown_row(&name));
            }
        }
        page
    }
}

impl Change {
    /// A row of a table: name, before, after, change, interval and what it is called.
    pub fn markdown_row(&self, name: &str) -> String {
        let interval = self.interval.map(|(low, high)| {
            format!(
                "{} .. {}",
                signed(self.metric, low),
                signed(self.metric, high)
            )
        });
        format!(
            "| {name} | {} | {} | {} | {} | {} |\n",
            self.metric.show(self.base),
            self.metric.show(self.other),
            signed(self.metric, self.difference),
            interval.unwrap_or_else(|| "too few pairs".to_owned()),
            verdict(self.judgement)
        )
    }
}
