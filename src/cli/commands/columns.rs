//! `svl columns`: the metrics, and the columns of a report's tables, with units and meanings.

use crate::cli::shared::terminal::{print, print_json, width, wrapped};
use svl::report::{ColumnDescription, METRIC_NAMES, TABLES, TableDescription};
use svl::stress::STRESSES;

/// List the metrics, and the columns of a report's tables
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl columns metrics        the names that --columns and [[gate]] accept
  svl columns rows
  svl columns --json
  svl columns --markdown > docs/tables.md")]
pub(in crate::cli) struct Args {
    /// metrics, or a table, as rows or cells [default: all]
    #[arg(value_name = "TABLE", value_parser = table)]
    table: Option<&'static TableDescription>,
    /// Print JSON
    #[arg(long, conflicts_with = "markdown", help_heading = "Output")]
    json: bool,
    /// Print the page docs/tables.md
    #[arg(long, conflicts_with = "table", help_heading = "Output")]
    markdown: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let tables: Vec<_> = match args.table {
        Some(table) => vec![table],
        None => listed().collect(),
    };
    if args.json {
        let json = |table: &&TableDescription| DescribedTable {
            table: table.name,
            row: table.about,
            columns: (table.columns)(),
        };
        return print_json(&tables.iter().map(json).collect::<Vec<_>>());
    }
    if args.markdown {
        return print(&page());
    }
    let last = width();
    for table in tables {
        let mut text = format!("{}: a row is {}\n\n", table.name, table.about);
        for ColumnDescription {
            name,
            kind,
            unit,
            heading,
            about,
            ..
        } in (table.columns)()
        {
            let facts = [Some(kind), heading.as_deref(), unit];
            let facts: Vec<_> = facts.into_iter().flatten().collect();
            text += &format!("{name}  ({})\n", facts.join("; "));
            text += &wrapped("", 4, &about, last);
        }
        print(&format!("{text}\n"))?;
    }
    Ok(())
}

/// A table as `--json` prints it.
#[derive(serde::Serialize)]
struct DescribedTable {
    table: &'static str,
    row: &'static str,
    columns: Vec<ColumnDescription>,
}

/// All tables as docs/tables.md.
fn page() -> String {
    let mut page = include_str!("columns.md").to_owned();
    for table in listed() {
        let text = table.table().markdown();
        page.push_str(&format!(
            "\n## {}\n\nA row is {}.\n\n{text}",
            table.name, table.about
        ));
    }
    page + &perturbations()
}

/// The kinds of `--stress`, with their default levels.
fn perturbations() -> String {
    let mut section = "
## Perturbations

The kinds of `--stress`, on grey values *v*, of the right image *r*.

| kind | unit | levels | effect |
|---|---|---|---|
"
    .to_owned();
    for kind in STRESSES {
        let levels = kind.levels.iter().map(f64::to_string);
        section.push_str(&format!(
            "| `{}` | {} | {} | {}: `{}` |\n",
            kind.name,
            kind.unit,
            levels.collect::<Vec<_>>().join(", "),
            kind.summary,
            kind.formula
        ));
    }
    section
}

/// The metrics, then the tables.
fn listed() -> impl Iterator<Item = &'static TableDescription> {
    std::iter::once(&METRIC_NAMES).chain(TABLES)
}

fn table(name: &str) -> Result<&'static TableDescription, String> {
    let names: Vec<_> = listed().map(|table| table.name).collect();
    let unknown = || {
        let names = names.join(", ");
        format!("no table is called '{name}'; expected one of {names}")
    };
    listed()
        .find(|table| table.name == name)
        .ok_or_else(unknown)
}
