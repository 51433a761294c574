//! A summary as Markdown.

use crate::results::summary::Results;
use crate::show::table::markdown::escape;
use crate::show::table::model::Table;
use svl_score::notice::grouped;

impl Results {
    /// The summary as a Markdown page under `title`.
    pub fn markdown(&self, title: &str) -> String {
        let mut page = format!("# {}\n\n{}.\n", escape(title), escape(&self.scope_words()));
        let answer = self.answer().join(" ");
        if !answer.is_empty() {
            page.push_str(&format!("\n{}\n", escape(&answer)));
        }
        for caution in self.cautions() {
            page.push_str(&format!("\n**Warning:** {}\n", escape(&caution)));
        }
        page.push_str(&format!("\n{}", self.headline().markdown()));
        for line in self.legend() {
            page.push_str(&format!("\n{}\n", escape(&line)));
        }
        let mut section = |title: &str, table: &Table| {
            page.push_str(&format!("\n## {}\n\n{}", escape(title), table.markdown()));
        };
        section("All metrics", &self.all_metrics());
        let single = [
            self.recording_table(),
            self.checkpoint_table(),
            self.drive_table(),
            self.latency_table(),
            self.piece_table(),
        ];
        let tables = single.into_iter().flatten().chain(self.accuracy_tables());
        let tables = tables.chain(self.stress_tables());
        for table in tables.chain(self.speed_table()) {
            section(&table.title, &table);
        }
        let mut facts = Vec::new();
        let times = self.times.iter();
        facts.extend(times.map(|times| format!("times: {times}")));
        let programs = self.programs.iter();
        facts.extend(programs.map(|p| format!("program: {}: {}", p.algorithm, p.program.words())));
        let warnings = grouped(self.warnings.clone()).into_iter();
        facts.extend(warnings.map(|warning| format!("warning: {warning}")));
        if !facts.is_empty() {
            page.push_str("\n## Run\n\n");
        }
        for fact in facts {
            page.push_str(&format!("- {}\n", escape(&fact)));
        }
        page
    }

    /// The checkpoints' results alone, under `title`; the whole summary where there are no
    /// checkpoints.
    pub fn verdicts_markdown(&self, title: &str) -> String {
        match self.checkpoint_table() {
            Some(table) => format!("# {}\n\n{}", escape(title), table.markdown()),
            None => self.markdown(title),
        }
    }
}
