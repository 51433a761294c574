//! Options of commands of reports, a report on the terminal, and its gate.

use super::terminal::{print, print_json, report_lines, style};
use super::usage;
use std::path::Path;
use svl::losses::Ending;
use svl::pass::complete;
use svl::report::{BuiltReport, GateResult, GateState, Results};
use svl::score::AreaChoice;

/// The choice of cells that commands of reports have.
#[derive(Clone, clap::Args)]
pub(crate) struct AreaArgs {
    /// Cells that right, wrong, unknown and errors are of: obstacle, floor, beyond or all
    #[arg(
        long,
        value_name = "AREA",
        default_value_t,
        help_heading = "Output",
        hide_short_help = true
    )]
    pub(crate) area: AreaChoice,
}

/// Fails for a report that lacks results, or misses more pairs than is allowed.
pub(crate) fn check_whole(ending: &Ending) -> anyhow::Result<()> {
    match &ending.incomplete {
        Some(why) if !ending.is_whole() => Err(usage::incomplete(why.clone())),
        _ => Ok(complete(ending)?),
    }
}

/// Prints a report on the terminal, or as JSON.
pub(crate) fn print_report(
    report: &BuiltReport,
    title: &str,
    folder: &Path,
    explain: bool,
    json: bool,
) -> anyhow::Result<()> {
    let BuiltReport { summary, gate, .. } = report;
    if json {
        return print_json(&ReportAnswer { summary, gate });
    }
    let line = |result: &GateResult| format!("{:<12}  {result}\n", result.state.words());
    let lines: String = gate.iter().map(line).collect();
    let text = summary.terminal(title, style(), explain);
    print(&format!("{text}\n{lines}{}", report_lines(folder)))
}

/// The JSON that `--json` prints.
#[derive(serde::Serialize)]
struct ReportAnswer<'a> {
    #[serde(flatten)]
    summary: &'a Results,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    gate: &'a [GateResult],
}

/// Fails for a run that failed a limit, or that no limit applies to.
pub(crate) fn pass_gate(gate: &[GateResult]) -> anyhow::Result<()> {
    let broken: Vec<_> = gate.iter().filter(|result| result.state.fails()).collect();
    match &broken[..] {
        [] if gate.iter().any(|result| result.state == GateState::Pass) => Ok(()),
        [] => Err(usage::wrong(
            "gate: none of the scenario's limits applies to an algorithm of this run",
        )),
        [one] => Err(usage::gate(format!("gate: {one}"))),
        [first, more @ ..] => {
            let more = more.len();
            Err(usage::gate(format!("gate: {first}; and {more} more")))
        }
    }
}
