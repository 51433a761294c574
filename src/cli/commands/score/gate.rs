//! `svl score --gate`: what a CI reads.

use anyhow::bail;
use svl::report::Ruling;

/// A ruling for the terminal.
pub(super) fn line(ruling: &Ruling) -> String {
    let word = match ruling.kept {
        Some(true) => "kept",
        Some(false) => "BROKEN",
        None => "–",
    };
    format!("{word:<6}  {ruling}\n")
}

/// Refuses a run that broke a limit, or that no limit was for.
pub(super) fn pass(gate: &[Ruling]) -> anyhow::Result<()> {
    let broken: Vec<_> = gate
        .iter()
        .filter(|ruling| ruling.kept == Some(false))
        .collect();
    match broken[..] {
        [] if gate.iter().any(|ruling| ruling.kept.is_some()) => Ok(()),
        [] => bail!("gate: none of the scenario's limits is for the algorithms that took part"),
        [one] => bail!("gate: {one}"),
        [first, ..] => bail!("gate: {first}; and {} more", broken.len() - 1),
    }
}
