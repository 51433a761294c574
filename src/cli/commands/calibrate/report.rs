//! The folder beside a calibration: its report, and the pairs it was made from.

use super::collect::Collected;
use crate::cli::shared::folder::{Aside, write_json};
use crate::cli::shared::output::distinct;
use anyhow::{Context, bail};
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
    earlier: Aside,
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
    /// The folder beside `output`, which is made with the first pair. An earlier report there is
    /// set aside if `force`.
    pub(super) fn new(output: &Path, source: &Path, force: bool) -> anyhow::Result<Self> {
        let stem = output.file_stem().unwrap_or_default().to_string_lossy();
        let path = output.with_file_name(format!("{stem}-report"));
        distinct([path.as_path(), source])?;
        let earlier = match path.exists() {
            true if !force => {
                bail!(
                    "{}: exists already; name another output, or add --force to replace it",
                    path.display()
                )
            }
            true => earlier(&path)?,
            false => Vec::new(),
        };
        let earlier = Aside::of(&path, earlier)?;
        Ok(Self {
            path,
            corners: Vec::new(),
            earlier,
        })
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
        std::fs::create_dir_all(&self.path).with_context(|| self.path.display().to_string())?;
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
        write_json(&self.path, CORNERS, &self.corners)
    }

    /// Writes the report.
    pub(super) fn finish(
        self,
        source: &str,
        collected: &Collected,
        solution: &Solution,
    ) -> anyhow::Result<()> {
        write_json(&self.path, SOLUTION, solution)?;
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
        page.write(&self.path.join(PAGE))?;
        self.earlier.replaced()
    }
}

/// The files of an earlier report; refuses a folder that holds others.
fn earlier(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(path).with_context(|| path.display().to_string())?;
    let files = entries
        .map(|entry| entry.map(|e| e.path()))
        .collect::<Result<Vec<_>, _>>();
    let files = files.with_context(|| path.display().to_string())?;
    let ours = |file: &&PathBuf| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let pair = name
            .strip_suffix(".png")
            .and_then(|n| n.strip_prefix("left").or(n.strip_prefix("right")));
        let pair = pair
            .is_some_and(|number| number.len() >= 2 && number.bytes().all(|b| b.is_ascii_digit()));
        file.is_file() && (pair || [PAGE, SOLUTION, CORNERS].contains(&&*name))
    };
    match files.iter().find(|file| !ours(file)) {
        Some(foreign) => bail!(
            "{}: not part of a calibration's report; name another output",
            foreign.display()
        ),
        None => Ok(files),
    }
}
