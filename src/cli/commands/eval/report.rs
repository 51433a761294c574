//! The numbers as a table or as JSON.

use super::{Args, ImageFiles};
use crate::cli::shared::terminal::{print, print_json, style};
use serde::Serialize;
use std::collections::BTreeMap;
use svl::doubt::Doubt;
use svl::report::table::{NONE, Table};
use svl::score::protocol::{NumberUnit, Numbers, Protocol, Score};

/// The keys of one mask and one image, and those that several masks or images add.
#[derive(Serialize)]
struct EvalReport<'a> {
    protocol: &'a str,
    /// Figures of the first mask.
    #[serde(flatten)]
    numbers: &'a Numbers,
    #[serde(skip_serializing_if = "Option::is_none")]
    masks: Option<BTreeMap<&'a str, &'a Numbers>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    images: Option<BTreeMap<&'a str, Numbers>>,
    /// Quantities of the maps that cannot be right.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    doubts: &'a [Doubt],
}

/// Prints the scores; `scores` has a row per column of the table, with an element per image.
pub(super) fn print_scores(
    args: &Args,
    images: &[ImageFiles],
    scores: &[Vec<(f64, Score)>],
    doubts: &[Doubt],
) -> anyhow::Result<()> {
    let columns: Vec<Numbers> = scores.iter().map(|scores| Score::over(scores)).collect();
    let labels = labels(args);
    let folders = args.ground_truth.is_dir();
    if !args.json {
        let what = match (folders, args.protocol) {
            (false, _) => images[0].name.clone(),
            (true, Protocol::Kitti15) => {
                format!("{} images, their pixels counted together", images.len())
            }
            (true, _) if images.iter().any(|files| files.weight != 1.0) => {
                format!("{} images, their weighted mean", images.len())
            }
            (true, _) => format!("{} images, their mean", images.len()),
        };
        let is_masked = args.mask.is_empty() && images.iter().any(|f| !f.masks.is_empty());
        let what = what + ["", ", by mask0nocc.png"][usize::from(is_masked && folders)];
        let (protocol, table) = (args.protocol.name(), table(&labels, &columns));
        return print(&format!("{protocol}: {what}\n{}", table.terminal(style())));
    }
    let masks =
        (columns.len() > 1).then(|| labels.iter().map(String::as_str).zip(&columns).collect());
    let images_json = images
        .iter()
        .zip(&scores[0])
        .map(|(files, (_, score))| (files.name.as_str(), score.numbers()));
    let images = folders.then(|| images_json.collect());
    print_json(&EvalReport {
        protocol: args.protocol.name(),
        numbers: &columns[0],
        masks,
        images,
        doubts,
    })
}

/// Headings of the columns: the masks' names, with the folder where two are named alike.
fn labels(args: &Args) -> Vec<String> {
    let stems = args.mask.iter().map(|path| {
        path.file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    });
    let stems: Vec<String> = stems.collect();
    let alone = |stem: &String| stems.iter().filter(|s| *s == stem).count() == 1;
    let label = |(path, stem): (&std::path::PathBuf, &String)| {
        if alone(stem) {
            stem.clone()
        } else {
            path.display().to_string()
        }
    };
    args.mask.iter().zip(&stems).map(label).collect()
}

/// A row per number; a column per mask.
fn table(labels: &[String], columns: &[Numbers]) -> Table {
    let heads = match labels {
        [] => vec!["value"],
        labels => labels.iter().map(String::as_str).collect(),
    };
    let mut table = Table::new("", "number")
        .with_texts(["unit"])
        .with_columns(heads);
    for (row, number) in columns[0].iter().enumerate() {
        let (unit, decimals) = match number.unit {
            NumberUnit::Percent => ("%", 3),
            NumberUnit::Px => ("px", 3),
            NumberUnit::Count => ("", 0),
        };
        let values = columns.iter().filter_map(|numbers| numbers.iter().nth(row));
        let values = values.map(|number| match number.value {
            Some(value) => format!("{value:.decimals$}"),
            None => NONE.to_owned(),
        });
        table.push(number.name, std::iter::once(unit.to_owned()).chain(values));
    }
    table
}
