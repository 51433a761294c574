//! HTML report of a calibration: one file without scripts or external resources.

use super::view;
use crate::show::page::parts::fill;
use std::path::Path;
use svl_calibrate::Solution;
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
        let view = view::CalibrationView::new(self);
        let (page, style) = (include_str!("page.html"), include_str!("page.css"));
        fill(page, style, &[], view)
    }
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
                let point = pose * point;
                Point2::new(
                    500.0 * (point.x - x) / point.z + 320.0,
                    500.0 * point.y / point.z + 240.0,
                )
            };
            board.corners().map(pixel).collect::<Vec<_>>()
        };
        let turns = [
            (0.5, 0.0),
            (-0.5, 0.1),
            (0.0, 0.6),
            (0.1, -0.6),
            (0.4, 0.4),
            (-0.4, 0.3),
        ];
        let mut views: Vec<StereoView> = turns
            .iter()
            .map(|(x, y)| {
                Isometry3::new(Vector3::new(-0.03, -0.04, 0.5), Vector3::new(*x, *y, 0.1))
            })
            .map(|pose| StereoView {
                left: image(&pose, 0.0),
                right: image(&pose, 0.1),
            })
            .collect();
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
            verdict::CalibrationVerdict::new(&changed).words()
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
        for text in [
            "rig &lt;b&gt;",
            "4.png &lt;&amp;&gt;",
            "&lt;i&gt;",
            "numbered from another end",
            "5 of 6",
            "T, m",
            "Calibration is ",
            "<title>left01.png</title>",
        ] {
            assert!(page.contains(text), "{text}");
        }
        let count = |text: &str| page.matches(text).count();
        // Five views in two images, twice.
        assert_eq!(
            (
                count("class=\"residuals\""),
                count("class=\"board\""),
                count("class=\"key\"")
            ),
            (10, 10, 5)
        );
        assert!(!page.contains("http") && !page.contains("<script"));
    }
}
