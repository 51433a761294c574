//! `svl merge`: makes one report of the parts that shards of a run left.

mod tables;

use crate::cli::shared::progress::Terminal;
use crate::cli::shared::terminal::{print, print_json, width};
use crate::cli::shared::usage;
use anyhow::{Context, bail};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use svl::console::{Console, Unit};
use svl::evaluation::{
    COURSES, MANIFEST, PART, REPORT, ReportContent, ReportHead, ReportPart, ReportRun, maps,
    read_ending,
};
use svl::files::relative_path;
use svl::losses::{LossLimit, Missing, RunEnding};
use svl::manifest::{AlgorithmRecord, Manifest, PartRecord, Purpose};
use svl::matcher::{Algorithm, ProgramRecord};
use svl::outputs::{Outputs, write_json};
use svl::report::{CellRow, CoursePlan, DriveRow, FailureRow, Summary, TrackRow, read_rows};
use svl::run::complete;
use tables::{MergeOrder, TableMerge};

/// Make one report of the parts that `svl score --shard` left
///
/// The report has the tables and hashes of a run on one machine; times are those of the parts,
/// whose machines it lists. Their pages and their runs for Rerun stay where they are, and are
/// linked.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl score scenarios/drive.toml --shard 1/2 --out part1
  svl score scenarios/drive.toml --shard 2/2 --out part2
  svl merge part1 part2 --out reports/all

The order of the parts does not matter. All shards of one run are needed, of
one svl and one scenario with the same options, each at its end. What they miss
is added up: with more than --allow-loss the exit status is 4.")]
pub(in crate::cli) struct Args {
    /// Folders that `svl score --shard` wrote
    #[arg(value_name = "PART", required = true)]
    parts: Vec<PathBuf>,
    /// Folder for the report; a report of svl's that is there is replaced
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Exit with 0 where no more is lost in all parts together: N pairs, or P per cent, as `svl
    /// score` counts them [default: that of the run; 0]
    #[arg(long, value_name = "N|P%", allow_negative_numbers = true)]
    allow_loss: Option<LossLimit>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A part with its folder.
struct FoundPart {
    folder: PathBuf,
    part: ReportPart,
    manifest: Manifest,
    missing: Missing,
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let parts = read_parts(&args.parts)?;
    let out = args.out.canonicalize();
    if let Some(found) = parts
        .iter()
        .find(|part| part.folder.canonicalize().ok() == out.as_ref().ok().cloned())
    {
        let shown = found.folder.display();
        return Err(usage::wrong(format!(
            "{shown}: is a part; name another folder with --out"
        )));
    }
    let mut outputs = Outputs::claim_folder(&args.out, &REPORT)?;
    outputs.set_aside()?;
    let summary = merge(&parts, args, quiet)?;
    outputs.commit();
    if args.json {
        print_json(&summary)?;
    } else {
        let width = width();
        print(&format!(
            "{summary:width$}\n{}\n",
            args.out.join("index.html").display()
        ))?;
    }
    Ok(complete(&summary.ending)?)
}

/// The parts in the order of their shards, all of one run.
fn read_parts(folders: &[PathBuf]) -> anyhow::Result<Vec<FoundPart>> {
    let mut parts: Vec<_> = folders
        .iter()
        .map(|folder| read_part(folder))
        .collect::<Result<_, _>>()?;
    parts.sort_by_key(|found| found.part.shard.number);
    let first = &parts[0];
    for pair in parts.windows(2) {
        let (before, found) = (&pair[0], &pair[1]);
        let shown = found.folder.display();
        if found.part.shard.of != first.part.shard.of {
            bail!(
                "{shown}: is shard {}, but {} is {}: all must be of one number of shards",
                found.part.shard,
                first.folder.display(),
                first.part.shard
            );
        }
        let differences = first
            .manifest
            .differences(&found.manifest, Purpose::Merge)?;
        if !differences.is_empty() {
            let (first, why) = (first.folder.display(), differences.join("; "));
            bail!("{shown}: is not of the same run as {first}: {why}");
        }
        let of_first = ReportPart {
            shard: found.part.shard,
            tables: found.part.tables.clone(),
            ..first.part.clone()
        };
        if found.part != of_first {
            let first = first.folder.display();
            bail!("{shown}: is not of the same run as {first}: its runs or cell rule were others");
        }
        if found.part.shard == before.part.shard {
            let before = before.folder.display();
            bail!("{shown}: is shard {}, and so is {before}", found.part.shard);
        }
    }
    let has = |number: usize| parts.iter().any(|found| found.part.shard.number == number);
    let of = first.part.shard.of;
    let missing: Vec<_> = (1..=of).filter(|&number| !has(number)).collect();
    if let [first, ..] = missing[..] {
        let names: Vec<_> = missing.iter().take(5).map(usize::to_string).collect();
        let more = if missing.len() > 5 { ", …" } else { "" };
        bail!(
            "shard {}{more} of {of} missing: run it, svl score … --shard {first}/{of} --out DIR",
            names.join(", ")
        );
    }
    Ok(parts)
}

fn read_part(folder: &Path) -> anyhow::Result<FoundPart> {
    let shown = folder.display();
    if !folder.join(PART).is_file() {
        bail!("{shown}: is no part of a report; `svl score --shard I/N` writes them");
    }
    let part = ReportPart::read(folder)?;
    let manifest = Manifest::read(folder)?;
    let again = "run it again, with --resume";
    let Some(ending) = read_ending(folder)? else {
        bail!("{shown}: is incomplete: it was killed; {again}");
    };
    if !ending.is_whole() {
        let why = ending.incomplete.unwrap_or_default();
        bail!("{shown}: is incomplete: {why}; {again}");
    }
    if part.tables.is_empty() {
        bail!("{shown}: is incomplete; {again}");
    }
    if let Some(table) = part.damaged(folder) {
        bail!("{shown}: {table} is not as it was written; copy or run it again");
    }
    Ok(FoundPart {
        folder: folder.to_owned(),
        part,
        manifest,
        missing: ending.missing,
    })
}

fn merge(parts: &[FoundPart], args: &Args, quiet: bool) -> anyhow::Result<Summary> {
    let out = &args.out;
    let part = &parts[0].part;
    let manifest = merged_manifest(parts, out)?;
    write_json(&out.join(MANIFEST), &manifest)?;
    let terminal = Terminal { quiet };
    let tables = TableMerge {
        parts,
        out,
        order: MergeOrder::new(part, &manifest),
        id: manifest.run_id.clone(),
        bar: terminal.bar("merge", Unit::Rows, None),
    };
    let mut collected = ReportContent::default();
    tables.merge("cells", |_: &[CellRow]| ())?;
    tables.merge("failures", |_: &[FailureRow]| ())?;
    tables.merge("rows", |rows| collected.rows.extend_from_slice(rows))?;
    match part.driven {
        true => merge_drives(&tables, &mut collected)?,
        false => {
            let kept = &mut collected.checkpoints;
            tables.merge("checkpoints", |rows| kept.extend_from_slice(rows))?;
        }
    }
    drop(tables);
    let algorithms = manifest
        .algorithms
        .iter()
        .filter_map(algorithm)
        .collect::<Vec<_>>();
    let head = ReportHead {
        description: &part.description,
        rule: part.rule,
        measured: !part.driven,
        algorithms: &algorithms,
        sort: None,
        limits: &[],
    };
    let mut missing = Missing::default();
    parts
        .iter()
        .for_each(|found| missing.add(found.missing.clone()));
    let allowed = args.allow_loss.or(manifest.allow_loss()?);
    let ending = RunEnding::new(missing, allowed);
    let (summary, _) = collected.write(out, head, manifest, ending, terminal.warnings())?;
    Ok(summary)
}

/// An algorithm of a manifest; those behind filters cannot be built of it.
fn algorithm(record: &AlgorithmRecord) -> Option<Algorithm> {
    let text = match record.parameters.as_str() {
        "" => record.name.clone(),
        parameters => format!("{}:{parameters}", record.name),
    };
    let algorithm: Algorithm = text.parse().ok()?;
    Some(algorithm.called(record.label.clone()))
}

fn merge_drives(tables: &TableMerge<'_>, collected: &mut ReportContent) -> anyhow::Result<()> {
    let mut drives: Vec<DriveRow> = Vec::new();
    let mut plans: BTreeMap<Option<usize>, CoursePlan> = BTreeMap::new();
    for found in tables.parts {
        let folder = relative(&found.folder, tables.out);
        for mut row in read_rows::<DriveRow>(&found.folder.join("drives.csv"))? {
            row.recording = row.recording.map(|name| format!("{folder}/{name}"));
            drives.push(row);
        }
        let path = found.folder.join(COURSES);
        let text = std::fs::read_to_string(&path).map_err(|e| svl::Error::io(&path, e))?;
        let own: Vec<CoursePlan> =
            serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        let place = |plan: &CoursePlan| tables.order.run(&ReportRun::course(plan.seed, None));
        plans.extend(own.into_iter().map(|plan| (place(&plan), plan)));
    }
    let mut track: Vec<TrackRow> = Vec::new();
    tables.merge("tracks", |rows| track.extend_from_slice(rows))?;
    let plans: Vec<_> = plans.into_values().collect();
    write_json(&tables.out.join(COURSES), &plans)?;
    collected.drives = tables.sort("drives", drives)?;
    collected.maps = maps(&plans, &collected.drives, &track);
    Ok(())
}

/// The manifest of the whole: that of the first part, with what the others add.
fn merged_manifest(parts: &[FoundPart], out: &Path) -> anyhow::Result<Manifest> {
    let first = &parts[0].manifest;
    let record = |found: &FoundPart| PartRecord {
        shard: found.part.shard.to_string(),
        run_id: found.manifest.run_id.clone(),
        began: found.manifest.began.clone(),
        folder: relative(&found.folder, out),
        machine: found.manifest.machine.clone(),
    };
    let own = Manifest::new(&first.scenario, &[])?;
    let mut manifest = Manifest {
        run_id: own.run_id,
        began: own.began,
        shard: None,
        parts: parts.iter().map(record).collect(),
        warnings: warnings(parts),
        resumed: Vec::new(),
        ..first.clone()
    };
    for (i, record) in manifest.algorithms.iter_mut().enumerate() {
        let all = parts
            .iter()
            .filter_map(|found| found.manifest.algorithms.get(i));
        record.memory_bytes = all.clone().filter_map(|a| a.memory_bytes).max();
        record.failed_pairs = all.clone().map(|a| a.failed_pairs).sum();
        record.failure = all.clone().filter_map(|a| a.failure.clone()).next_back();
        // Its times are of the last part; the parts have theirs.
        let programs = all.filter_map(|a| a.program.clone());
        record.program = programs.reduce(|one, other| ProgramRecord {
            pairs: one.pairs + other.pairs,
            disparities: one.disparities + other.disparities,
            out_of_range: one.out_of_range + other.out_of_range,
            memory_bytes: one.memory_bytes.max(other.memory_bytes),
            ..other
        });
    }
    Ok(manifest)
}

/// The warnings of the parts, each once.
fn warnings(parts: &[FoundPart]) -> Vec<String> {
    let mut warnings = Vec::new();
    for warning in parts.iter().flat_map(|found| &found.manifest.warnings) {
        if !warnings.contains(warning) {
            warnings.push(warning.clone());
        }
    }
    warnings
}

/// A part's folder, as a link of the report's page has it.
fn relative(folder: &Path, from: &Path) -> String {
    relative_path(folder, from).to_string_lossy().into_owned()
}
