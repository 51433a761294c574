//! The folder beside a calibration: its report, and the pairs it was made from.

use super::collect::Collected;
use crate::cli::shared::outputs::{FolderRule, Outputs, distinct, write_json};
use anyhow::bail;
use std::path::{Path, PathBuf};
use svl::calibrate::{Solution, View};
use svl::files::write_png;
use svl::report::calibration::Page;
use svl::stereo::{Frame, Gray};

/// What the files of the folder are called, besides the pairs'.
const PAGE: &str = "index.html";
const SOLUTION: &str = "calibration.json";
const CORNERS: &str = "corners.json";

/// A folder that pairs are added to, and then a report.
pub(super) struct Folder {
    path: PathBuf,
    corners: Vec<Corners>,
}

/// The corners of a pair, as other programs can read them.
#[derive(serde::Serialize)]
struct Corners {
    left_image: String,
    right_image: String,
    /// Pixels, in the board's order.
    left: Vec<[f64; 2]>,
    right: Vec<[f64; 2]>,
}

impl Folder {
    /// The folder beside `output`, with its claim.
    pub(super) fn claim(
        output: &Path,
        source: &Path,
        force: bool,
    ) -> anyhow::Result<(Self, Outputs)> {
        let stem = output.file_stem().unwrap_or_default().to_string_lossy();
        let path = output.with_file_name(format!("{stem}-report"));
        distinct([path.as_path(), source])?;
        let empty = !path.exists()
            || path
                .read_dir()
                .is_ok_and(|mut files| files.next().is_none());
        if !empty && !force {
            bail!(
                "{}: exists already; name another output, or add --force to replace it",
                path.display()
            );
        }
        let claimed = Outputs::claim_folder(&path, &REPORT)?;
        let corners = Vec::new();
        Ok((Self { path, corners }, claimed))
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// How many were added.
    pub(super) fn pairs(&self) -> usize {
        self.corners.len()
    }

    /// Where a pair is drawn that is asked about.
    pub(super) fn picture(&self) -> PathBuf {
        self.path.with_extension("png")
    }

    /// Adds an accepted pair.
    pub(super) fn keep(&mut self, frame: &Frame, view: &View) -> anyhow::Result<()> {
        let number = self.corners.len() + 1;
        let save = |side: &str, image: &Gray| {
            let name = format!("{side}{number:02}.png");
            let pixels: Vec<u8> = image.pixels().collect();
            write_png(
                &self.path.join(&name),
                image.width(),
                image.height(),
                &pixels,
            )
            .map(|()| name)
        };
        let (left_image, right_image) = (
            save("left", frame.pair.left())?,
            save("right", frame.pair.right())?,
        );
        let [left, right] =
            [&view.left, &view.right].map(|corners| corners.iter().map(|p| [p.x, p.y]).collect());
        self.corners.push(Corners {
            left_image,
            right_image,
            left,
            right,
        });
        write_json(&self.path.join(CORNERS), &self.corners)
    }

    /// Writes the report.
    pub(super) fn finish(
        &self,
        source: &str,
        collected: &Collected,
        solution: &Solution,
    ) -> anyhow::Result<()> {
        write_json(&self.path.join(SOLUTION), solution)?;
        let identity = vec![
            ("svl".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("source".to_owned(), source.to_owned()),
        ];
        let names = (1..)
            .zip(&collected.accepted)
            .map(|(number, name)| format!("{number} ({name})"))
            .collect();
        let page = Page {
            title: format!("Calibration from {source}"),
            solution,
            names,
            identity,
        };
        Ok(page.write(&self.path.join(PAGE))?)
    }
}

/// The folder of a calibration's report, which a later one replaces.
const REPORT: FolderRule = FolderRule {
    kind: "a calibration's report",
    owns: |name| [PAGE, SOLUTION, CORNERS].contains(&name) || is_pair(name),
    mark: CORNERS,
    cure: "name another output",
};

/// Whether a file is called as an image of an accepted pair is: `left01.png`.
fn is_pair(name: &str) -> bool {
    let number = |stem: &str| stem.len() >= 2 && stem.bytes().all(|b| b.is_ascii_digit());
    name.strip_suffix(".png")
        .and_then(|stem| stem.strip_prefix("left").or(stem.strip_prefix("right")))
        .is_some_and(number)
}
