//! Data for the page template: formatted numbers, residuals as SVG paths.

use super::text::{extrinsics, facts, intrinsics};
use super::verdict::CalibrationVerdict;
use crate::show::page::parts::{data_url, fill};
use crate::show::table::model::Table;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;
use svl_calibrate::{CameraEstimate, Corner, Correlation, Fit, Solution};
use svl_core::{Error, Result};

/// Everything the page shows.
pub struct CalibrationPage<'a> {
    pub title: String,
    pub solution: &'a Solution,
    /// Names of the views, such as file or frame; where one is missing, its number.
    pub names: Vec<String>,
    /// A pair, rectified; absent if that is not possible.
    pub pair: Option<RectifiedImages>,
    /// Identity of the run: names and values.
    pub identity: Vec<(String, String)>,
}

/// Two rectified images as PNG or JPEG files.
pub struct RectifiedImages {
    pub name: String,
    /// Width and height, pixels.
    pub size: (usize, usize),
    pub files: [Vec<u8>; 2],
}

impl CalibrationPage<'_> {
    /// Writes the page.
    ///
    /// # Errors
    /// [`Error::Io`] with the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        std::fs::write(path, self.render()?).map_err(|e| Error::io(path, e))
    }

    /// The page as HTML, all texts escaped.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the message of the template engine.
    pub fn render(&self) -> Result<String> {
        let view = CalibrationView::new(self);
        let (page, style) = (include_str!("page.html"), include_str!("page.css"));
        fill(page, style, &[], view)
    }
}

#[derive(Serialize)]
pub(crate) struct CalibrationView<'a> {
    title: &'a str,
    verdict: CalibrationVerdict,
    pair: Option<RectifiedView<'a>>,
    facts: Vec<(&'static str, String)>,
    intrinsics: Table,
    extrinsics: Table,
    correlations: Vec<String>,
    model: &'static str,
    /// Names of its coefficients.
    lens: String,
    cameras: Vec<CameraFigure>,
    /// Magnification of the residuals.
    magnified: f64,
    /// Half the side of the scatter's square, pixels.
    reach_px: f64,
    /// Radii of the circles in it, pixels.
    circles: [f64; 2],
    unit: &'static str,
    views: Vec<FitView>,
    all: [String; 3],
    refused: Vec<(String, &'a str)>,
    images: [(); 0],
    identity: &'a [(String, String)],
}

/// A rectified pair side by side, with lines across both images.
#[derive(Serialize)]
struct RectifiedView<'a> {
    name: &'a str,
    width: usize,
    height: usize,
    files: [String; 2],
    /// Heights of the lines.
    lines: Vec<usize>,
}

/// Lines across a rectified pair.
const LINES: usize = 16;

impl<'a> RectifiedView<'a> {
    fn new(pair: &'a RectifiedImages) -> Self {
        let (width, height) = pair.size;
        Self {
            name: &pair.name,
            width,
            height,
            files: pair.files.each_ref().map(|file| data_url(file)),
            lines: (1..LINES).map(|i| i * height / LINES).collect(),
        }
    }
}

#[derive(Serialize)]
struct CameraFigure {
    name: &'static str,
    width: usize,
    height: usize,
    caption: String,
    drawn: Vec<ImageDrawing>,
    /// Corners refused as outliers.
    outliers: Vec<(f64, f64)>,
}

/// One view in one image.
#[derive(Serialize)]
struct ImageDrawing {
    words: String,
    hue: f64,
    /// Paths: the corners, their residuals, the board, the residuals around 0.
    corners: String,
    residuals: String,
    board: String,
    scatter: String,
}

/// A row of the table of views. Bars in percent of the longest.
#[derive(Serialize)]
struct FitView {
    name: String,
    hue: f64,
    left: (String, f64),
    right: (String, f64),
    rows: String,
    distance: String,
    tilt: String,
}

impl<'a> CalibrationView<'a> {
    pub(crate) fn new(page: &'a CalibrationPage<'a>) -> Self {
        let CalibrationPage {
            title,
            solution,
            identity,
            ..
        } = page;
        let lens = solution
            .left
            .parameters
            .0
            .iter()
            .skip(4)
            .map(|(name, _)| *name);
        let lens: Vec<_> = lens.collect();
        let magnified = magnified(solution);
        let circles = [1.0, 3.0].map(|n| n * solution.corner_deviation_px);
        let all = [
            solution.left.rms_px,
            solution.right.rms_px,
            solution.epipolar.mean_px,
        ];
        Self {
            title,
            verdict: CalibrationVerdict::new(solution),
            pair: page.pair.as_ref().map(RectifiedView::new),
            // The verdict is above them.
            facts: facts(solution).split_off(1),
            intrinsics: intrinsics(solution),
            extrinsics: extrinsics(solution),
            correlations: correlations(solution),
            model: solution.left.model,
            lens: lens.join(" "),
            cameras: vec![
                camera_view(page, magnified, "Left", &solution.left, |fit| &fit.left),
                camera_view(page, magnified, "Right", &solution.right, |fit| &fit.right),
            ],
            magnified,
            // Beyond the outer circle of three standard deviations; outliers are not drawn.
            reach_px: 4.5 * solution.corner_deviation_px,
            circles,
            unit: solution.unit_sign(),
            views: views(page),
            all: all.map(|number| format!("{number:.3}")),
            refused: solution
                .refused()
                .map(|(id, why)| (page.name(id), why))
                .collect(),
            images: [],
            identity,
        }
    }
}

impl CalibrationPage<'_> {
    fn name(&self, id: usize) -> String {
        self.names
            .get(id)
            .cloned()
            .unwrap_or_else(|| (id + 1).to_string())
    }

    /// Hues by the golden angle, so that consecutive views differ clearly.
    fn hue(&self, id: usize) -> f64 {
        const GOLDEN_DEG: f64 = 137.508;
        (id as f64 * GOLDEN_DEG).rem_euclid(360.0).round()
    }
}

/// The strongest correlations as text.
fn correlations(solution: &Solution) -> Vec<String> {
    const MAX_SHOWN: usize = 6;
    let words = |c: &Correlation| format!("{} and {} ({:+.2})", c.first, c.second, c.correlation);
    let more = solution.correlations.len().saturating_sub(MAX_SHOWN);
    let shown = solution.correlations.iter().take(MAX_SHOWN).map(words);
    shown
        .chain((more > 0).then(|| format!("{more} more beyond ±0.9")))
        .collect()
}

/// Magnification that draws a typical residual a fortieth of the image's width long, rounded down
/// to 1, 2 or 5 times a power of ten.
fn magnified(solution: &Solution) -> f64 {
    let wanted = solution.size.0 as f64 / 40.0 / solution.rms_px.max(1e-3);
    let power = 10_f64.powf(wanted.log10().floor());
    [5.0, 2.0, 1.0]
        .into_iter()
        .map(|n| n * power)
        .find(|n| *n <= wanted)
        .unwrap_or(power)
}

fn camera_view(
    page: &CalibrationPage<'_>,
    magnified: f64,
    name: &'static str,
    camera: &CameraEstimate,
    corners: fn(&Fit) -> &Vec<Corner>,
) -> CameraFigure {
    let solution = page.solution;
    let (width, height) = solution.size;
    let all = || solution.fits().flat_map(|(_, fit)| corners(fit));
    let drawn = solution
        .fits()
        .map(|(id, fit)| drawn(page, id, corners(fit), magnified))
        .collect();
    CameraFigure {
        name,
        width,
        height,
        caption: format!(
            "RMS {:.3} px over {} corners",
            camera.rms_px,
            all().filter(|c| c.used).count()
        ),
        drawn,
        outliers: all()
            .filter(|corner| !corner.used)
            .map(|corner| corner.seen)
            .collect(),
    }
}

fn drawn(page: &CalibrationPage<'_>, id: usize, all: &[Corner], magnified: f64) -> ImageDrawing {
    let (mut corners, mut residuals, mut scatter) = (String::new(), String::new(), String::new());
    for Corner {
        seen: (x, y),
        residual: (dx, dy),
        ..
    } in all.iter().filter(|corner| corner.used)
    {
        // Writing to a String cannot fail.
        // A path of zero length with round caps is a dot: far fewer bytes than a circle each.
        let _ = write!(corners, "M{x:.1} {y:.1}h0");
        let _ = write!(
            residuals,
            "M{x:.1} {y:.1}l{:.1} {:.1}",
            dx * magnified,
            dy * magnified
        );
        let _ = write!(scatter, "M{dx:.4} {dy:.4}h0");
    }
    let columns = page.solution.board.0;
    // The outline of the board: its four outer corners in order.
    let ends = [0, columns - 1, all.len() - 1, all.len() - columns].map(|i| all[i].seen);
    let board = ends.map(|(x, y)| format!("{x:.1} {y:.1}")).join("L");
    ImageDrawing {
        words: format!("view {}", page.name(id)),
        hue: page.hue(id),
        corners,
        residuals,
        board: format!("M{board}Z"),
        scatter,
    }
}

fn views(page: &CalibrationPage<'_>) -> Vec<FitView> {
    let fits = || page.solution.fits();
    let longest = fits()
        .map(|(_, fit)| fit.rms_left_px.max(fit.rms_right_px))
        .fold(f64::MIN_POSITIVE, f64::max);
    let bar = |rms: f64| (format!("{rms:.3}"), (100.0 * rms / longest).round());
    let view = |(id, fit): (usize, &Fit)| FitView {
        name: page.name(id),
        hue: page.hue(id),
        left: bar(fit.rms_left_px),
        right: bar(fit.rms_right_px),
        rows: format!("{:.3}", fit.epipolar_px),
        distance: format!("{:.3}", fit.distance),
        tilt: format!("{:.0}", fit.tilt_deg),
    };
    fits().map(view).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Point2, Point3, Vector3};
    use svl_calibrate::{Board, StereoView, solve};
    use svl_core::stereo::DistortionModel;

    /// Six views by two cameras without noise; the last one's corners are counted backwards on the
    /// right.
    fn solution() -> Solution {
        let board = Board::new((5, 4), Some(0.03)).unwrap();
        let image = |pose: &Isometry3<f64>, x: f64| {
            let pixel = |point: Point3<f64>| {
                let point = pose * point - Vector3::new(x, 0.0, 0.0);
                let at = |side: f64| 500.0 * side / point.z;
                Point2::new(at(point.x) + 320.0, at(point.y) + 240.0)
            };
            board.corners().map(pixel).collect::<Vec<_>>()
        };
        let place = Vector3::new(-0.03, -0.04, 0.5);
        let xs = [0.5, -0.5, 0.0, 0.1, 0.4, -0.4];
        let turns = xs.into_iter().zip([0.0, 0.1, 0.6, -0.6, 0.4, 0.3]);
        let poses = turns.map(|(x, y)| Isometry3::new(place, Vector3::new(x, y, 0.1)));
        let views = poses.map(|pose| StereoView {
            left: image(&pose, 0.0),
            right: image(&pose, 0.1),
        });
        let mut views: Vec<_> = views.collect();
        views[5].right.reverse();
        solve(&board, (640, 480), DistortionModel::PlumbBob, &views).unwrap()
    }

    #[test]
    fn the_worst_number_decides() {
        let solution = solution();
        let verdict = |change: fn(&mut Solution)| {
            let mut changed = solution.clone();
            changed.left.coverage = 0.7;
            changed.right.coverage = 0.7;
            change(&mut changed);
            CalibrationVerdict::new(&changed).words()
        };
        assert_eq!(
            verdict(|_| ()),
            "good; mean |Δy| 0.00 px (at most 0.25), RMS 0.00 px (at most 0.5), coverage 70 % (at \
             least 60)"
        );
        assert_eq!(
            verdict(|solution| {
                solution.rms_px = 0.6;
                solution.right.coverage = 0.5;
            }),
            "acceptable; RMS 0.60 px (good: at most 0.5), coverage 50 % (good: at least 60); hold \
             a flat board still in a good light, or try another --model; move the board to the \
             edges of both images"
        );
        assert_eq!(
            verdict(|solution| {
                solution.rms_px = 0.6;
                solution.epipolar.mean_px = 0.75;
            }),
            "repeat; mean |Δy| 0.75 px (acceptable: at most 0.5); fix both cameras to each other, \
             and let them expose at the same time"
        );
    }

    #[test]
    fn everything_is_there_and_escaped() {
        let solution = solution();
        let names = (0..5).map(|i| format!("{i}.png <&>")).collect();
        let identity = vec![("svl".to_owned(), "<i>".to_owned())];
        let page = CalibrationPage {
            title: "rig <b>".into(),
            solution: &solution,
            names,
            pair: Some(RectifiedImages {
                name: "left01.png".into(),
                size: (640, 480),
                files: [b"left".to_vec(), b"right".to_vec()],
            }),
            identity,
        }
        .render()
        .unwrap();
        let escaped = ["rig &lt;b&gt;", "4.png &lt;&amp;&gt;", "&lt;i&gt;"];
        let words = ["numbered from another end", "5 of 6", "T, m"];
        let others = ["Calibration is ", "<title>left01.png</title>"];
        for text in escaped.into_iter().chain(words).chain(others) {
            assert!(page.contains(text), "{text}");
        }
        // Five views in two images, twice.
        let classes = ["residuals", "board", "key"];
        let counts = classes.map(|class| page.matches(&format!("class=\"{class}\"")).count());
        assert_eq!(counts, [10, 10, 5]);
        assert!(!page.contains("http") && !page.contains("<script"));
    }
}
