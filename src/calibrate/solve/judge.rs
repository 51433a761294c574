//! Which views and corners cannot belong to the rest.
//!
//! How far a view scatters is told by the median of its corners' distances, which half of them may not spoil; what is
//! usual by the median over all views.

use super::adjust::adjust;
use super::scene::{Loss, Scene, Shot};

/// A view that scatters this many times as much as usual is refused.
const VIEW: f64 = 3.0;
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

/// Adjusts the scene, whose cameras are called `names`, to the corners that agree, and takes out those and the views
/// that do not. Nothing when no corner is left or they lead nowhere.
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
        let (views, corners) = (refusals.len(), refuse(scene, names, &mut refusals)?);
        adjust(scene, Loss::Squares)?;
        if refusals.len() == views && corners == 0 {
            break;
        }
    }
    Some(refusals)
}

/// Takes out what is off by far; how many corners of the views that remain.
fn refuse(scene: &mut Scene, names: &[&str], refusals: &mut Vec<Refusal>) -> Option<usize> {
    let usual = usual_px(scene)?;
    let (mut kept, mut corners) = (Vec::new(), 0);
    for mut shot in std::mem::take(&mut scene.shots) {
        let reason = names.iter().enumerate().find_map(|(camera, name)| {
            let distances = distances(scene, &shot, camera);
            let used = &mut shot.images[camera].used;
            let chosen = distances.iter().zip(&*used).filter(|(_, used)| **used).map(|(d, _)| *d);
            let scatter = scatter_px(chosen.collect())?;
            if scatter > VIEW * usual {
                return Some(format!("the {name} image's corners are {scatter:.2} px off, usual are {usual:.2} px"));
            }
            let limit = CORNER * scatter.max(usual);
            for (distance, used) in distances.iter().zip(used.iter_mut()) {
                // Not `<`: a distance that is no number is too far.
                if *used && !(*distance <= limit) {
                    *used = false;
                    corners += 1;
                }
            }
            let (wrong, all) = (used.iter().filter(|used| !**used).count(), used.len());
            (wrong as f64 > CORNERS * all as f64)
                .then(|| format!("{wrong} of the {all} corners of the {name} image are off by more than {limit:.2} px"))
        });
        match reason {
            Some(reason) => refusals.push(Refusal { shot, reason }),
            None => kept.push(shot),
        }
    }
    scene.shots = kept;
    Some(corners)
}

/// Distance of every corner from where it should be, pixels; infinite where it should be behind the camera.
fn distances(scene: &Scene, shot: &Shot, camera: usize) -> Vec<f64> {
    scene.residuals(shot, camera).map(|residual| residual.map_or(f64::INFINITY, |r| r.norm())).collect()
}

/// The scatter of all used corners; nothing without any.
fn usual_px(scene: &Scene) -> Option<f64> {
    let mut all = Vec::new();
    for shot in &scene.shots {
        for (camera, image) in shot.images.iter().enumerate() {
            let used = distances(scene, shot, camera).into_iter().zip(&image.used).filter(|(_, used)| **used);
            all.extend(used.map(|(distance, _)| distance));
        }
    }
    scatter_px(all).map(|scatter| scatter.max(FINEST_PX))
}

/// Standard deviation per coordinate that the median of distances tells.
fn scatter_px(mut distances: Vec<f64>) -> Option<f64> {
    let middle = distances.len() / 2;
    if distances.is_empty() {
        return None;
    }
    Some(*distances.select_nth_unstable_by(middle, f64::total_cmp).1 / MEDIAN)
}
