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
        for column in (table.columns)() {
            let facts = [Some(column.kind), column.heading.as_deref(), column.unit];
            let facts: Vec<_> = facts.into_iter().flatten().collect();
            text += &format!("{}  ({})\n", column.name, facts.join("; "));
            text += &wrapped("", 4, &column.about, last);
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
        let (name, about) = (table.name, table.about);
        page += &format!("\n## {name}\n\nA row is {about}.\n\n{text}");
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
        let levels: Vec<_> = kind.levels.iter().map(f64::to_string).collect();
        let (name, unit, levels) = (kind.name, kind.unit, levels.join(", "));
        let (summary, formula) = (kind.summary, kind.formula);
        section += &format!("| `{name}` | {unit} | {levels} | {summary}: `{formula}` |\n");
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
