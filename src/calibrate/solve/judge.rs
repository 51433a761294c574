//! Which views and corners cannot belong to the rest.
//!
//! How far a view scatters is told by the median of its corners' distances, which half of them may
//! not spoil; what is usual by the median over all views.

use super::adjust::adjust;
use super::scene::{Loss, Scene, Shot};
use crate::statistics::upper_median;
use nalgebra::Vector2;

/// A view is refused whose corners scatter this many times as much as usual ...
const VIEW: f64 = 1.5;
/// ... or are all off by this share of the usual scatter, as when the board moved between the
/// images: pose and lens then take up most of it, but not all ...
const SHIFT: f64 = 0.5;
/// ... beyond this many standard deviations of what chance does to a view of few corners.
const CHANCE: f64 = 4.0;
/// A corner this many standard deviations off is refused: of normal noise one in 270 000 is.
const CORNER: f64 = 5.0;
/// Share of a view's corners of which more are not refused without the view.
const CORNERS: f64 = 0.25;
/// No detector does better; without noise everything would be an outlier.
const FINEST_PX: f64 = 0.01;
/// Median distance of points with normal noise of standard deviation 1 in x and in y.
const MEDIAN: f64 = 1.177_41;
const ROUNDS: usize = 10;

/// A view that was taken out of the scene, and why.
pub(super) struct Refusal {
    pub shot: Shot,
    pub reason: String,
}

/// Adjusts the scene, whose cameras are called `names`, to the corners that agree, and takes out
/// those and the views that do not. Nothing when no corner is left or they lead nowhere.
pub(super) fn settle(scene: &mut Scene, names: &[&str]) -> Option<Vec<Refusal>> {
    let mut usual = usual_px(scene)?;
    for _ in 0..ROUNDS {
        adjust(scene, Loss::Robust(2.0 * usual))?;
        let before = std::mem::replace(&mut usual, usual_px(scene)?);
        if usual > 0.9 * before {
            break;
        }
    }
    let mut refusals = Vec::new();
    for _ in 0..ROUNDS {
        let refused = refuse(scene, names, &mut refusals)?;
        adjust(scene, Loss::Squares)?;
        if refused == 0 {
            break;
        }
    }
    readmit(scene, refusals)
}

/// Takes back views that agree after all, as bad ones had pulled at them: with such a view the sum
/// of squares rises by no more than its own noise, whatever it does to the others. Hands back what
/// remains refused.
fn readmit(scene: &mut Scene, refusals: Vec<Refusal>) -> Option<Vec<Refusal>> {
    let mut remaining = Vec::new();
    for refusal in refusals {
        let usual = usual_px(scene)?;
        let mut with = scene.clone();
        with.shots.push(refusal.shot.clone());
        adjust(&mut with, Loss::Squares)?;
        let rise = with.cost(Loss::Squares)? - scene.cost(Loss::Squares)?;
        let used = refusal
            .shot
            .images
            .iter()
            .flat_map(|image| &image.used)
            .filter(|used| **used)
            .count();
        if rise > VIEW * 2.0 * used as f64 * usual * usual {
            remaining.push(refusal)
        } else {
            *scene = with
        }
    }
    Some(remaining)
}

/// Takes out what is off by far; how many views and corners that is.
fn refuse(scene: &mut Scene, names: &[&str], refusals: &mut Vec<Refusal>) -> Option<usize> {
    let usual = usual_px(scene)?;
    let wrong_view = |shot: &Shot| {
        let images = names
            .iter()
            .enumerate()
            .filter_map(|(camera, name)| wrong_image(scene, shot, camera, name, usual));
        images.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let wrong: Vec<_> = scene.shots.iter().map(wrong_view).collect();
    let worst = wrong
        .iter()
        .flatten()
        .map(|(excess, _)| *excess)
        .fold(1.0, f64::max);
    let mut views = 0;
    for (shot, wrong) in std::mem::take(&mut scene.shots).into_iter().zip(wrong) {
        match wrong {
            // A bad view pulls at good ones: they get another chance without it.
            Some((excess, reason)) if excess >= worst / 2.0 => {
                refusals.push(Refusal { shot, reason });
                views += 1;
            }
            _ => scene.shots.push(shot),
        }
    }
    Some(views + refuse_corners(scene, usual))
}

/// Whether an image of a view is off by more than the views' limits, how many times as far, and in
/// words.
fn wrong_image(
    scene: &Scene,
    shot: &Shot,
    camera: usize,
    name: &str,
    usual: f64,
) -> Option<(f64, String)> {
    let used = &shot.images[camera].used;
    let seen: Vec<_> = scene
        .residuals(shot, camera)
        .zip(used)
        .filter(|(_, used)| **used)
        .map(|(r, _)| r)
        .collect();
    let scatter = scatter_px(
        seen.iter()
            .map(|r| r.map_or(f64::INFINITY, |r| r.norm()))
            .collect(),
    )?;
    let middle = |i: usize| upper_median(seen.iter().flatten().map(|r| r[i])).unwrap_or_default();
    let shift = Vector2::new(middle(0), middle(1));
    let wrong = used.iter().filter(|used| !**used).count() as f64 / used.len() as f64;
    let chance = CHANCE / (used.len() as f64).sqrt();
    let excesses = [
        scatter / usual / (VIEW + chance),
        shift.norm() / usual / (SHIFT + chance),
        wrong / CORNERS,
    ];
    let (most, excess) = excesses
        .into_iter()
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let words = match most {
        0 => format!("the {name} image's corners are {scatter:.2} px off, usually {usual:.2} px"),
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

/// Takes out single corners; how many.
fn refuse_corners(scene: &mut Scene, usual: f64) -> usize {
    let mut shots = std::mem::take(&mut scene.shots);
    let mut refused = 0;
    for shot in &mut shots {
        for camera in 0..shot.images.len() {
            let distances = distances(scene, shot, camera);
            let used = &mut shot.images[camera].used;
            let chosen = distances
                .iter()
                .zip(&*used)
                .filter(|(_, used)| **used)
                .map(|(d, _)| *d);
            let limit =
                CORNER * scatter_px(chosen.collect()).map_or(usual, |scatter| scatter.max(usual));
            for (distance, used) in distances.iter().zip(used.iter_mut()) {
                if *used && *distance > limit {
                    *used = false;
                    refused += 1;
                }
            }
        }
    }
    scene.shots = shots;
    refused
}

/// Distance of every corner from where it should be, pixels; infinite where it should be behind the
/// camera.
fn distances(scene: &Scene, shot: &Shot, camera: usize) -> Vec<f64> {
    scene
        .residuals(shot, camera)
        .map(|residual| residual.map_or(f64::INFINITY, |r| r.norm()))
        .collect()
}

/// The scatter of all used corners; nothing without any.
fn usual_px(scene: &Scene) -> Option<f64> {
    let mut all = Vec::new();
    for shot in &scene.shots {
        for (camera, image) in shot.images.iter().enumerate() {
            let used = distances(scene, shot, camera)
                .into_iter()
                .zip(&image.used)
                .filter(|(_, used)| **used);
            all.extend(used.map(|(distance, _)| distance));
        }
    }
    scatter_px(all).map(|scatter| scatter.max(FINEST_PX))
}

/// Standard deviation per coordinate that the median of distances tells.
fn scatter_px(distances: Vec<f64>) -> Option<f64> {
    upper_median(distances).map(|middle| middle / MEDIAN)
}
