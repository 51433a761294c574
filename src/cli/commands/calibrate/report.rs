//! The report folder beside a calibration: HTML page, JSON, and the accepted pairs as PNG.

use anyhow::bail;
use std::path::{Path, PathBuf};
use svl::calibrate::{Solution, StereoView};
use svl::files::{encode_jpeg, read_gray, write_png};
use svl::outputs::{FolderRule, Outputs, distinct, write_json};
use svl::rectify::Rectifier;
use svl::report::calibration::{CalibrationPage, RectifiedImages};
use svl::stereo::{Frame, Gray, StereoPair};

/// Names of the files in the folder, besides the pairs'.
const PAGE: &str = "index.html";
const SOLUTION: &str = "calibration.json";
const CORNERS: &str = "corners.json";

/// Largest width of an image on the page.
const MAX_WIDTH: usize = 640;

/// A folder that receives pairs, then a report.
pub(super) struct ReportFolder {
    pub(super) path: PathBuf,
    corners: Vec<Corners>,
}

/// The corners of a pair, for other programs.
#[derive(serde::Serialize)]
struct Corners {
    left_image: String,
    right_image: String,
    /// Pixels, in the board's order.
    left: Vec<[f64; 2]>,
    right: Vec<[f64; 2]>,
}

impl ReportFolder {
    /// The folder beside `output`, with its claim.
    pub(super) fn claim(
        output: &Path,
        source: &Path,
        force: bool,
    ) -> anyhow::Result<(Self, Outputs)> {
        let stem = output.file_stem().unwrap_or_default().to_string_lossy();
        let path = output.with_file_name(format!("{stem}-report"));
        distinct([path.as_path(), source])?;
        let is_empty = |path: &Path| path.read_dir().is_ok_and(|mut own| own.next().is_none());
        if path.exists() && !is_empty(&path) && !force {
            let shown = path.display();
            bail!("{shown}: exists already; name another output, or add --force to replace it");
        }
        let claimed = Outputs::claim_folder(&path, &REPORT)?;
        let corners = Vec::new();
        Ok((Self { path, corners }, claimed))
    }

    /// Number of pairs added.
    pub(super) fn pairs(&self) -> usize {
        self.corners.len()
    }

    /// File the pair in question is drawn in.
    pub(super) fn picture(&self) -> PathBuf {
        self.path.with_extension("png")
    }

    /// Adds an accepted pair.
    pub(super) fn keep(&mut self, frame: &Frame, view: &StereoView) -> anyhow::Result<()> {
        let number = self.corners.len() + 1;
        let save = |side: &str, image: &Gray| {
            let name = format!("{side}{number:02}.png");
            let pixels: Vec<u8> = image.pixels().collect();
            let path = self.path.join(&name);
            write_png(&path, image.width(), image.height(), &pixels).map(|()| name)
        };
        let [left, right] =
            [&view.left, &view.right].map(|corners| corners.iter().map(|p| [p.x, p.y]).collect());
        self.corners.push(Corners {
            left_image: save("left", frame.pair.left())?,
            right_image: save("right", frame.pair.right())?,
            left,
            right,
        });
        Ok(write_json(&self.path.join(CORNERS), &self.corners)?)
    }

    /// The first used pair, rectified; none without a rectification.
    fn rectified(&self, solution: &Solution) -> anyhow::Result<Option<RectifiedImages>> {
        let first = solution.fits().next();
        let corners = first.and_then(|(id, _)| self.corners.get(id));
        // A calibration without a rectification was warned about.
        let (Some(corners), Ok(rectifier)) = (corners, Rectifier::new(&solution.calibration))
        else {
            return Ok(None);
        };
        let read = |name: &String| read_gray(&self.path.join(name));
        let pair = StereoPair::new(read(&corners.left_image)?, read(&corners.right_image)?)?;
        let mut images = [Gray::filled(1, 1, 0)?, Gray::filled(1, 1, 0)?];
        let [left, right] = &mut images;
        rectifier.apply(&pair, left, right)?;
        let file = |image: &Gray| encode_jpeg(image, MAX_WIDTH);
        Ok(Some(RectifiedImages {
            name: format!("{}, {}", corners.left_image, corners.right_image),
            size: rectifier.size(),
            files: [file(&images[0])?, file(&images[1])?],
        }))
    }

    /// Writes the report. `accepted`: the source's name of each pair.
    pub(super) fn finish(
        &self,
        source: &str,
        accepted: &[String],
        solution: &Solution,
    ) -> anyhow::Result<()> {
        write_json(&self.path.join(SOLUTION), solution)?;
        let identity = vec![
            ("svl".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("source".to_owned(), source.to_owned()),
        ];
        let names = (1..).zip(accepted);
        let names = names.map(|(number, name)| format!("{number} ({name})"));
        let page = CalibrationPage {
            title: format!("Calibration from {source}"),
            solution,
            names: names.collect(),
            pair: self.rectified(solution)?,
            identity,
        };
        Ok(page.write(&self.path.join(PAGE))?)
    }
}

/// The folder of a calibration's report, which a later report replaces.
const REPORT: FolderRule = FolderRule {
    kind: "a calibration's report",
    owns: |name| [PAGE, SOLUTION, CORNERS].contains(&name) || is_pair(name),
    inner: None,
    mark: CORNERS,
    cure: "name another output",
};

/// True if a file name is that of an accepted pair's image: `left01.png`.
fn is_pair(name: &str) -> bool {
    let number = |stem: &str| stem.len() >= 2 && stem.bytes().all(|b| b.is_ascii_digit());
    name.strip_suffix(".png")
        .and_then(|stem| stem.strip_prefix("left").or(stem.strip_prefix("right")))
        .is_some_and(number)
}
