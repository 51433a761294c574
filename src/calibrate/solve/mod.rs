//! Stereo calibration from corners: intrinsics, distortion and extrinsics of two cameras.
//!
//! First, each camera alone: homographies and closed-form intrinsics (Zhang, A flexible new
//! technique for camera calibration, PAMI 2000), then an adjustment of intrinsics with distortion
//! (Brown, Close-range camera calibration, 1971) and all poses. Then both cameras: one adjustment
//! of all intrinsics, R, T and the poses, in which the board has one pose for both images. Each
//! stage rejects views and corners that do not agree with the rest and adjusts again without them.

mod adjust;
mod board_motion;
mod bundle;
mod measure;
mod outliers;
mod solution;
mod start;

pub use solution::{
    CameraEstimate, CameraParameters, Corner, Correlation, EpipolarError, Estimated, Fit, Solution,
    ViewFit,
};

use super::{Board, StereoView};
use bundle::{BundleProblem, ImageCorners, PosedCamera, PosedView};
use nalgebra::{Isometry3, Matrix3, Point2, Point3, Translation3, UnitQuaternion, Vector3};
use outliers::{RejectedView, adjust_robustly};
use svl_core::statistics::upper_median;
use svl_core::stereo::{DistortionModel, Intrinsics};
use svl_core::{Error, Result};

/// Fewest views that determine all parameters (Zhang, section 3.1).
pub const MIN_VIEWS: usize = 3;

/// The cures for too few views: of one camera, and of both.
const TILTED: &str = "add views with the board tilted differently";
const TOGETHER: &str = "each camera fits the board alone, but not both together: hold the board \
                        still, and pair images of one time; if those of one camera are mirrored, \
                        turn them back: `ffmpeg -i IN -vf hflip OUT`";

/// The views, with the reasons for those refused.
struct ViewSelection<'a> {
    views: &'a [StereoView],
    refused: Vec<Option<String>>,
}

/// Calibrates two cameras of images of `size` (width, height) from `views` of a board, with a
/// distortion model for both.
///
/// # Errors
/// [`Error::Invalid`] if a view has another number of corners than the board, if fewer than three
/// views agree, or if they do not determine the parameters, as with boards that are all parallel.
/// The message tells what to add.
pub fn solve(
    board: &Board,
    size: (usize, usize),
    model: DistortionModel,
    views: &[StereoView],
) -> Result<Solution> {
    let corners: Vec<Point3<f64>> = board.corners().collect();
    let mut selection = ViewSelection {
        views,
        refused: vec![None; views.len()],
    };
    selection.check_corners(size, corners.len())?;
    let mut camera = |name, pixels: fn(&StereoView) -> &Vec<Point2<f64>>| {
        calibrate_camera(&corners, (size, model), &mut selection, name, pixels)
    };
    let left = camera("left", |view| &view.left)?;
    let right = camera("right", |view| &view.right)?;
    let bundle = calibrate_pair(left, right, &mut selection)?;
    measure::solution(board, bundle, selection.refused)
}

impl ViewSelection<'_> {
    /// Refuses views with corners outside the images.
    fn check_corners(&mut self, (width, height): (usize, usize), corners: usize) -> Result<()> {
        for (id, view) in self.views.iter().enumerate() {
            let counts = (view.left.len(), view.right.len());
            if counts != (corners, corners) {
                let (left, right) = counts;
                return Err(Error::Invalid(format!(
                    "view {} has {left} corners on the left and {right} on the right, the board \
                     has {corners}",
                    id + 1
                )));
            }
            let inside = |p: &Point2<f64>| {
                (-1.0..=width as f64).contains(&p.x) && (-1.0..=height as f64).contains(&p.y)
            };
            for (name, image) in [("left", &view.left), ("right", &view.right)] {
                if let Some(corner) = image.iter().position(|p| !inside(p)) {
                    let reason = format!(
                        "corner {} is outside the {name} image or not a number",
                        corner + 1
                    );
                    self.refused[id] = Some(reason);
                }
            }
        }
        self.require_enough(TILTED)
    }

    fn used(&self) -> impl Iterator<Item = usize> {
        self.refused
            .iter()
            .enumerate()
            .filter(|(_, reason)| reason.is_none())
            .map(|(id, _)| id)
    }

    /// # Errors
    /// [`Error::Invalid`] for too few views, with the cure.
    fn require_enough(&self, cure: &str) -> Result<()> {
        let (used, all) = (self.used().count(), self.views.len());
        if used >= MIN_VIEWS {
            return Ok(());
        }
        let reasons = self
            .refused
            .iter()
            .enumerate()
            .filter_map(|(id, r)| Some(format!("view {}: {}", id + 1, r.as_ref()?)));
        let mut reasons: Vec<_> = reasons.collect();
        let more = reasons.len().saturating_sub(3);
        reasons.truncate(3);
        if more > 0 {
            reasons.push(format!("and {more} more"));
        }
        let why = if reasons.is_empty() {
            String::new()
        } else {
            format!(" ({})", reasons.join("; "))
        };
        Err(Error::Invalid(format!(
            "{used} of {all} views of the board can be used, at least {MIN_VIEWS} are \
             needed{why}; {cure}"
        )))
    }
}

/// The homographies of one camera's views of the board, undistorted by `lens` if there is one, with
/// the number of the view; refuses views whose corners are in disorder.
fn homographies(
    board: &[Point3<f64>],
    (size, lens): ((usize, usize), Option<&Intrinsics>),
    selection: &mut ViewSelection<'_>,
    name: &str,
    pixels: impl Fn(&StereoView) -> &Vec<Point2<f64>>,
) -> Vec<(usize, Matrix3<f64>)> {
    let views = selection.views;
    let mut homographies: Vec<(usize, Matrix3<f64>, f64)> = Vec::new();
    for id in selection.used().collect::<Vec<_>>() {
        let found = match lens {
            None => start::homography(board, pixels(&views[id])),
            Some(lens) => start::undistorted_homography(lens, board, pixels(&views[id])),
        };
        match found {
            Some((h, off)) => homographies.push((id, h, off)),
            None => {
                let edge = lens.map_or("", |_| ", or it is 90° off the axis");
                selection.refused[id] = Some(format!(
                    "the {name} image's corners lie on one line or are out of order{edge}"
                ))
            }
        }
    }
    // Distortion moves a board by a few pixels; corners in disorder are off by a large part of the
    // board.
    let typical = upper_median(homographies.iter().map(|(.., off)| *off)).unwrap_or_default();
    let limit = 4.0 * typical + 0.03 * (size.0 as f64).hypot(size.1 as f64);
    homographies.retain(|(id, _, off)| {
        if *off > limit {
            selection.refused[*id] = Some(format!(
                "the {name} image's corners are out of order: {off:.0} px off"
            ));
        }
        *off <= limit
    });
    homographies.into_iter().map(|(id, h, _)| (id, h)).collect()
}

/// The poses of the board in one camera's views; refuses views without one.
fn posed_views(
    board: &[Point3<f64>],
    intrinsics: &Intrinsics,
    homographies: &[(usize, Matrix3<f64>)],
    selection: &mut ViewSelection<'_>,
    name: &str,
    pixels: impl Fn(&StereoView) -> &Vec<Point2<f64>>,
) -> Vec<PosedView> {
    let views = selection.views;
    let mut posed = Vec::new();
    for &(id, h) in homographies {
        let in_front = |pose: &Isometry3<f64>| board.iter().all(|point| (pose * point).z > 0.0);
        match start::pose(intrinsics, &h).filter(in_front) {
            Some(pose) => posed.push(PosedView {
                id,
                pose,
                images: vec![ImageCorners::new(pixels(&views[id]))],
            }),
            None => {
                selection.refused[id] = Some(format!(
                    "the {name} image's corners do not form a board in front of the camera"
                ))
            }
        }
    }
    posed
}

/// Calibrates one camera alone from the views that are not refused.
fn calibrate_camera(
    board: &[Point3<f64>],
    (size, model): ((usize, usize), DistortionModel),
    selection: &mut ViewSelection<'_>,
    name: &str,
    pixels: impl Fn(&StereoView) -> &Vec<Point2<f64>>,
) -> Result<BundleProblem> {
    let undetermined = || undetermined(&format!("{name} camera"));
    let fisheye = match model {
        DistortionModel::Equidistant => {
            let views = selection.used().map(|id| &pixels(&selection.views[id])[..]);
            let views = views.collect::<Vec<_>>();
            Some(start::fisheye(size, board, &views).ok_or_else(undetermined)?)
        }
        DistortionModel::PlumbBob | DistortionModel::RationalPolynomial => None,
    };
    let lens = (size, fisheye.as_ref());
    let homographies = homographies(board, lens, selection, name, &pixels);
    selection.require_enough(TILTED)?;
    let matrices = homographies.iter().map(|(_, h)| *h).collect::<Vec<_>>();
    let intrinsics = fisheye.or_else(|| start::intrinsics(size, &matrices));
    let lens = model.with_coefficients(&[])?;
    let intrinsics = intrinsics.ok_or_else(undetermined)?.with_distortion(lens)?;
    let views = posed_views(board, &intrinsics, &homographies, selection, name, &pixels);
    selection.require_enough(TILTED)?;
    let cameras = vec![PosedCamera {
        intrinsics,
        from_first: Isometry3::identity(),
    }];
    let mut bundle = BundleProblem {
        board: board.to_vec(),
        cameras,
        views,
    };
    let rejected = adjust_robustly(&mut bundle, &[name]).ok_or_else(undetermined)?;
    for RejectedView { view, reason } in rejected {
        selection.refused[view.id] = Some(reason);
    }
    selection.require_enough(TILTED)?;
    Ok(bundle)
}

/// Calibrates both cameras, with one pose of the board for both images.
fn calibrate_pair(
    left: BundleProblem,
    mut right: BundleProblem,
    selection: &mut ViewSelection<'_>,
) -> Result<BundleProblem> {
    let BundleProblem {
        board,
        mut cameras,
        views,
    } = left;
    let (mut pairs, mut motions) = (Vec::new(), Vec::new());
    for mut view in views {
        if let Some(same) = right.views.iter().find(|same| same.id == view.id) {
            // Each view gives the motion from left to right; noise makes them differ.
            motions.push(same.pose * view.pose.inverse());
            view.images.extend(same.images.iter().cloned());
            pairs.push(view);
        }
    }
    cameras.append(&mut right.cameras);
    cameras[1].from_first = median_motion(&motions);
    let mut bundle = BundleProblem {
        board,
        cameras,
        views: pairs,
    };
    for RejectedView { view, reason } in adjust_robustly(&mut bundle, &["left", "right"])
        .ok_or_else(|| Error::Invalid(TOGETHER.to_owned()))?
    {
        let seen = |camera: usize| {
            let PosedCamera { intrinsics, .. } = &bundle.cameras[camera];
            let pixels = &view.images[camera].pixels;
            let pose = start::seen_pose(intrinsics, &bundle.board, pixels)?;
            Some(bundle.cameras[camera].from_first.inverse() * pose)
        };
        // The poses in the two images alone show how the board moved between the exposures.
        let motion = seen(0)
            .zip(seen(1))
            .map(|(left, right)| left.inverse() * right);
        let words = motion.and_then(|motion| board_motion::describe(&motion, &bundle.board));
        let words = words.map(|words| format!(": {words}")).unwrap_or_default();
        selection.refused[view.id] = Some(reason + &words);
    }
    selection.require_enough(TOGETHER)?;
    Ok(bundle)
}

/// The median motion, component by component: robust as long as less than half of them are
/// outliers.
fn median_motion(motions: &[Isometry3<f64>]) -> Isometry3<f64> {
    let median = |value: fn(&Isometry3<f64>) -> Vector3<f64>| {
        Vector3::from_fn(|i, _| {
            upper_median(motions.iter().map(|m| value(m)[i])).unwrap_or_default()
        })
    };
    let translation = Translation3::from(median(|motion| motion.translation.vector));
    Isometry3::from_parts(
        translation,
        UnitQuaternion::from_scaled_axis(median(|motion| motion.rotation.scaled_axis())),
    )
}

fn undetermined(what: &str) -> Error {
    Error::Invalid(format!(
        "the views do not determine the {what}: add views with the board tilted in different \
         directions, by 20° to 45°"
    ))
}
