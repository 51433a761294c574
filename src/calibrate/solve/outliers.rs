//! Outlier rejection: views and corners that do not agree with the rest.
//!
//! The scatter of a view is estimated from the median of its residuals, which tolerates outliers in
//! up to half of its corners; the typical scatter from the median over all views.

use super::adjust::adjust;
use super::bundle::{BundleProblem, LossFunction, PosedView};
use nalgebra::Vector2;
use svl_core::statistics::upper_median;

/// A view is refused if its corners scatter by this many times the typical scatter,
const VIEW: f64 = 1.5;
/// or are all shifted by this fraction of the typical scatter, as if the board moved between the
/// exposures (pose and intrinsics then absorb most of it, but not all),
const SHIFT: f64 = 0.5;
/// beyond this many standard deviations of what chance does to a view with few corners.
const CHANCE: f64 = 4.0;
/// A corner off by this many standard deviations is refused: with normal noise, one in 270 000 is.
const CORNER: f64 = 5.0;
/// If more than this fraction of a view's corners are outliers, the whole view is refused.
const CORNERS: f64 = 0.25;
/// Least typical scatter, pixels: no detector does better, and without noise everything would be
/// an outlier.
const FINEST_PX: f64 = 0.01;
/// Median of the Rayleigh distribution: median length of a residual whose x and y are normal with
/// standard deviation 1.
const RAYLEIGH_MEDIAN: f64 = 1.177_41;
const ROUNDS: usize = 10;

/// A view removed from the bundle, with the reason.
pub(super) struct RejectedView {
    pub view: PosedView,
    pub reason: String,
}

/// Adjusts the problem, whose cameras are named `names`, and removes the corners and views that do
/// not agree. Returns the removed views; `None` if no corner is left or the cost is undefined.
pub(super) fn adjust_robustly(
    bundle: &mut BundleProblem,
    names: &[&str],
) -> Option<Vec<RejectedView>> {
    let mut typical = typical_px(bundle)?;
    // The scatter sets the scale of the robust loss, and the loss the scatter: repeated until both
    // converge.
    for _ in 0..ROUNDS {
        adjust(bundle, LossFunction::Robust(2.0 * typical))?;
        let before = std::mem::replace(&mut typical, typical_px(bundle)?);
        if typical > 0.9 * before {
            break;
        }
    }
    let mut refusals = Vec::new();
    for _ in 0..ROUNDS {
        let refused = refuse(bundle, names, &mut refusals)?;
        adjust(bundle, LossFunction::Squares)?;
        if refused == 0 {
            break;
        }
    }
    readmit(bundle, refusals)
}

/// Readmits views that agree after all, because other bad views had pulled the solution away from
/// them: with such a view the sum of squares rises by no more than its own noise. Returns those
/// that stay refused.
fn readmit(bundle: &mut BundleProblem, refusals: Vec<RejectedView>) -> Option<Vec<RejectedView>> {
    let mut remaining = Vec::new();
    for refusal in refusals {
        let typical = typical_px(bundle)?;
        let mut with = bundle.clone();
        with.views.push(refusal.view.clone());
        adjust(&mut with, LossFunction::Squares)?;
        let rise = with.cost(LossFunction::Squares)? - bundle.cost(LossFunction::Squares)?;
        let used = refusal
            .view
            .images
            .iter()
            .flat_map(|image| &image.used)
            .filter(|used| **used)
            .count();
        // Two coordinates per corner, each with an expected square of the variance.
        if rise > VIEW * 2.0 * used as f64 * typical * typical {
            remaining.push(refusal)
        } else {
            *bundle = with
        }
    }
    Some(remaining)
}

/// Removes outlying views and corners, and returns their number.
fn refuse(
    bundle: &mut BundleProblem,
    names: &[&str],
    refusals: &mut Vec<RejectedView>,
) -> Option<usize> {
    let typical = typical_px(bundle)?;
    let wrong_view = |view: &PosedView| {
        let images = names
            .iter()
            .enumerate()
            .filter_map(|(camera, name)| wrong_image(bundle, view, camera, name, typical));
        images.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let wrong: Vec<_> = bundle.views.iter().map(wrong_view).collect();
    let worst = wrong
        .iter()
        .flatten()
        .map(|(excess, _)| *excess)
        .fold(1.0, f64::max);
    let mut views = 0;
    for (view, wrong) in std::mem::take(&mut bundle.views).into_iter().zip(wrong) {
        match wrong {
            // A bad view pulls the solution away from good ones, so only views about as bad as the
            // worst are removed in one round; the others get another chance without them.
            Some((excess, reason)) if excess >= worst / 2.0 => {
                refusals.push(RejectedView { view, reason });
                views += 1;
            }
            _ => bundle.views.push(view),
        }
    }
    Some(views + refuse_corners(bundle, typical))
}

/// Factor by which an image of a view exceeds its limit, and the reason in words; `None` within the
/// limits.
fn wrong_image(
    bundle: &BundleProblem,
    view: &PosedView,
    camera: usize,
    name: &str,
    typical: f64,
) -> Option<(f64, String)> {
    let used = &view.images[camera].used;
    let residuals: Vec<_> = bundle.used_residuals(view, camera).collect();
    let scatter = scatter_px(residuals.iter().copied().map(length))?;
    // The median shift: unlike the mean, single outliers do not affect it.
    let shift = [0, 1]
        .map(|axis| upper_median(residuals.iter().flatten().map(|r| r[axis])).unwrap_or_default());
    let shift = Vector2::from(shift);
    let wrong = used.iter().filter(|used| !**used).count() as f64 / used.len() as f64;
    let chance = CHANCE / (used.len() as f64).sqrt();
    let excesses = [
        scatter / typical / (VIEW + chance),
        shift.norm() / typical / (SHIFT + chance),
        wrong / CORNERS,
    ];
    let (most, excess) = excesses
        .into_iter()
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let words = match most {
        0 => format!("the {name} image's corners are {scatter:.2} px off, usually {typical:.2} px"),
        1 => format!(
            "the {name} image's corners are all off by ({:.2}, {:.2}) px",
            shift.x, shift.y
        ),
        _ => format!(
            "{:.0} % of the {name} image's corners are outliers",
            100.0 * wrong
        ),
    };
    (excess > 1.0).then_some((excess, words))
}

/// Removes single corners and returns their number.
fn refuse_corners(bundle: &mut BundleProblem, typical: f64) -> usize {
    let mut posed = std::mem::take(&mut bundle.views);
    let mut refused = 0;
    for view in &mut posed {
        for camera in 0..view.images.len() {
            let scatter = scatter_px(bundle.used_residuals(view, camera).map(length));
            let limit = CORNER * scatter.map_or(typical, |scatter| scatter.max(typical));
            let distances: Vec<_> = bundle.residuals(view, camera).map(length).collect();
            let used = &mut view.images[camera].used;
            for (distance, used) in distances.iter().zip(used.iter_mut()) {
                if *used && *distance > limit {
                    *used = false;
                    refused += 1;
                }
            }
        }
    }
    bundle.views = posed;
    refused
}

/// Reprojection error, pixels; infinite if the corner is predicted behind the camera.
fn length(residual: Option<Vector2<f64>>) -> f64 {
    residual.map_or(f64::INFINITY, |r| r.norm())
}

/// The scatter of all used corners, pixels; `None` without any.
fn typical_px(bundle: &BundleProblem) -> Option<f64> {
    let all = bundle.views.iter().flat_map(|view| {
        let cameras = 0..view.images.len();
        cameras.flat_map(move |camera| bundle.used_residuals(view, camera).map(length))
    });
    scatter_px(all).map(|scatter| scatter.max(FINEST_PX))
}

/// Standard deviation per coordinate, estimated from the median of the distances.
fn scatter_px(distances: impl IntoIterator<Item = f64>) -> Option<f64> {
    upper_median(distances).map(|median| median / RAYLEIGH_MEDIAN)
}
