//! The numbers as a table or as JSON.

use super::{Args, ImageFiles};
use crate::cli::shared::terminal::{print, print_json};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use svl::score::protocol::{NumberUnit, Numbers, Protocol, Score};

/// The contract's keys, and beside them what several masks or images bring.
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
}

/// Prints what was found; `scores` has a row per column of the table, with an element per image.
pub(super) fn print_scores(
    args: &Args,
    images: &[ImageFiles],
    scores: &[Vec<Score>],
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
            (true, _) => format!("{} images, their mean", images.len()),
        };
        return print(&table(args.protocol, &what, &labels, &columns)?);
    }
    let masks =
        (columns.len() > 1).then(|| labels.iter().map(String::as_str).zip(&columns).collect());
    let of_each = images
        .iter()
        .zip(&scores[0])
        .map(|(files, score)| (files.name.as_str(), score.numbers()));
    let images = folders.then(|| of_each.collect());
    print_json(&EvalReport {
        protocol: args.protocol.name(),
        numbers: &columns[0],
        masks,
        images,
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

fn table(
    protocol: Protocol,
    what: &str,
    labels: &[String],
    columns: &[Numbers],
) -> Result<String, std::fmt::Error> {
    let mut text = format!("{}: {what}\n", protocol.name());
    let width = labels
        .iter()
        .map(|label| label.chars().count())
        .max()
        .unwrap_or(0)
        .max(9);
    if !labels.is_empty() {
        write!(text, "{:17}", "")?;
        labels
            .iter()
            .try_for_each(|label| write!(text, "  {label:>width$}"))?;
        text.push('\n');
    }
    for (row, number) in columns[0].iter().enumerate() {
        let unit = match number.unit {
            NumberUnit::Percent => "%",
            NumberUnit::Px => "px",
            NumberUnit::Count => "",
        };
        write!(text, "{:<14} {unit:<2}", number.name)?;
        for value in columns
            .iter()
            .filter_map(|numbers| numbers.iter().nth(row))
            .map(|number| number.value)
        {
            match value {
                Some(value) if number.unit == NumberUnit::Count => {
                    write!(text, "  {value:>width$.0}")?
                }
                Some(value) => write!(text, "  {value:>width$.3}")?,
                None => write!(text, "  {:>width$}", "-")?,
            }
        }
        text.push('\n');
    }
    Ok(text)
}
