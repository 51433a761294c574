//! From corners to two calibrated cameras.
//!
//! Each camera by itself: homographies and closed form (Zhang, A flexible new technique for camera calibration, PAMI
//! 2000), then its lens (Brown, Close-range camera calibration, 1971) and all poses adjusted. Then both together: every
//! parameter of both lenses, R, T and the poses in one adjustment, in which a board has one pose for both images.
//! Views and corners that cannot belong to the rest are refused at every stage, and the rest adjusted again without them.

mod adjust;
mod judge;
mod measure;
mod moved;
mod scene;
mod solution;
mod start;
mod text;

pub use solution::{Camera, Corner, Correlation, Epipolar, Estimate, Fit, Solution, ViewFit};

use super::{Board, View};
use crate::error::{Error, Result};
use judge::{Refusal, settle};
use nalgebra::{Isometry3, Matrix3, Point2, Point3, Translation3, UnitQuaternion, Vector3};
use scene::{Image, Scene, Shot};

/// Fewest views that tell everything.
pub const LEAST_VIEWS: usize = 3;

/// The views that are still believed, and why the others are not.
struct Sieve<'a> {
    views: &'a [View],
    refused: Vec<Option<String>>,
}

/// One camera by itself.
struct Single {
    scene: Scene,
    /// Its poses by view, those of views that the other camera refuses too.
    poses: Vec<Option<Isometry3<f64>>>,
}

/// Calibrates two cameras of images of `size` (width, height) from `views` of a board.
///
/// # Errors
/// [`Error::Invalid`] when a view has another number of corners than the board, when fewer than three views agree, or
/// when they do not tell the parameters, as with boards that are all parallel; it says what to add.
pub fn solve(board: &Board, size: (usize, usize), views: &[View]) -> Result<Solution> {
    let corners: Vec<Point3<f64>> = board.corners().collect();
    let mut sieve = Sieve { views, refused: vec![None; views.len()] };
    sieve.look(size, corners.len())?;
    let left = single(&corners, size, &mut sieve, "left", |view| &view.left)?;
    let right = single(&corners, size, &mut sieve, "right", |view| &view.right)?;
    let scene = together(&left, &right, &mut sieve)?;
    measure::solution(board, scene, sieve.refused)
}

impl Sieve<'_> {
    /// Refuses views that are no views of a board.
    fn look(&mut self, (width, height): (usize, usize), corners: usize) -> Result<()> {
        for (id, view) in self.views.iter().enumerate() {
            let counts = (view.left.len(), view.right.len());
            if counts != (corners, corners) {
                let (left, right) = counts;
                return Err(Error::Invalid(format!(
                    "view {} has {left} corners on the left and {right} on the right, the board has {corners}",
                    id + 1
                )));
            }
            let inside =
                |p: &Point2<f64>| (-1.0..=width as f64).contains(&p.x) && (-1.0..=height as f64).contains(&p.y);
            if let Some(p) = view.left.iter().chain(&view.right).find(|p| !inside(p)) {
                self.refused[id] = Some(format!("a corner at ({:.1}, {:.1}) is outside the image", p.x, p.y));
            }
        }
        self.enough()
    }

    fn alive(&self) -> impl Iterator<Item = usize> {
        self.refused.iter().enumerate().filter(|(_, reason)| reason.is_none()).map(|(id, _)| id)
    }

    fn enough(&self) -> Result<()> {
        let (alive, all) = (self.alive().count(), self.views.len());
        if alive >= LEAST_VIEWS {
            return Ok(());
        }
        let reasons =
            self.refused.iter().enumerate().filter_map(|(id, r)| Some(format!("view {}: {}", id + 1, r.as_ref()?)));
        let mut reasons: Vec<_> = reasons.collect();
        let more = reasons.len().saturating_sub(3);
        reasons.truncate(3);
        if more > 0 {
            reasons.push(format!("and {more} more"));
        }
        let why = if reasons.is_empty() { String::new() } else { format!(" ({})", reasons.join("; ")) };
        Err(Error::Invalid(format!(
            "{alive} of {all} views of the board can be used, at least {LEAST_VIEWS} are needed{why}; add views with the \
             board tilted differently"
        )))
    }
}

/// One camera by itself from the views that are still believed.
fn single(
    board: &[Point3<f64>],
    size: (usize, usize),
    sieve: &mut Sieve<'_>,
    name: &str,
    pixels: impl Fn(&View) -> &Vec<Point2<f64>>,
) -> Result<Single> {
    let views = sieve.views;
    let mut homographies: Vec<(usize, Matrix3<f64>, f64)> = Vec::new();
    for id in sieve.alive().collect::<Vec<_>>() {
        match start::homography(board, pixels(&views[id])) {
            Some((h, off)) => homographies.push((id, h, off)),
            None => sieve.refused[id] = Some(format!("the {name} image's corners lie on one line or on one point")),
        }
    }
    // A lens bends a board by a few pixels; corners in disorder are off by a good part of the board.
    let mut offs: Vec<f64> = homographies.iter().map(|(.., off)| *off).collect();
    offs.sort_unstable_by(f64::total_cmp);
    let limit =
        4.0 * offs.get(offs.len() / 2).copied().unwrap_or_default() + 0.03 * (size.0 as f64).hypot(size.1 as f64);
    homographies.retain(|(id, _, off)| {
        if *off > limit {
            sieve.refused[*id] = Some(format!("the {name} image's corners are no board in order: {off:.0} px off"));
        }
        *off <= limit
    });
    sieve.enough()?;

    let lens = start::intrinsics(size, &homographies.iter().map(|(_, h, _)| *h).collect::<Vec<_>>());
    let lens = lens.ok_or_else(|| lost(name))?;
    let shots = homographies.iter().filter_map(|(id, h, _)| {
        let pixels = pixels(&views[*id]).clone();
        let used = vec![true; pixels.len()];
        Some(Shot { id: *id, pose: start::pose(&lens, h)?, images: vec![Image { pixels, used }] })
    });
    let cameras = vec![scene::Camera { lens, place: Isometry3::identity() }];
    let mut scene = Scene { board: board.to_vec(), cameras, shots: shots.collect() };
    scene.shots.retain(|shot| {
        let seen = scene::in_front(board, &shot.pose);
        if !seen {
            sieve.refused[shot.id] = Some(format!("the {name} image's corners are no board before the camera"));
        }
        seen
    });
    sieve.enough()?;
    for Refusal { shot, reason } in settle(&mut scene, &[name]).ok_or_else(|| lost(name))? {
        sieve.refused[shot.id] = Some(reason);
    }
    sieve.enough()?;
    let mut poses = vec![None; views.len()];
    scene.shots.iter().for_each(|shot| poses[shot.id] = Some(shot.pose));
    Ok(Single { scene, poses })
}

/// Both cameras with one pose of the board for both images.
fn together(left: &Single, right: &Single, sieve: &mut Sieve<'_>) -> Result<Scene> {
    let pairs: Vec<_> = sieve.alive().filter_map(|id| Some((id, left.poses[id]?, right.poses[id]?))).collect();
    let apart: Vec<_> = pairs.iter().map(|(_, left, right)| right * left.inverse()).collect();
    let place = middle(&apart);
    let image = |single: &Single, id: usize| {
        single.scene.shots.iter().find(|shot| shot.id == id).map(|shot| shot.images[0].clone())
    };
    let shots = pairs.iter().filter_map(|(id, pose, _)| {
        Some(Shot { id: *id, pose: *pose, images: vec![image(left, *id)?, image(right, *id)?] })
    });
    let mut cameras = vec![left.scene.cameras[0].clone(), right.scene.cameras[0].clone()];
    cameras[1].place = place;
    let mut scene = Scene { board: left.scene.board.clone(), cameras, shots: shots.collect() };
    for Refusal { shot, reason } in settle(&mut scene, &["left", "right"]).ok_or_else(|| lost("two"))? {
        let moved = pairs.iter().find(|(id, ..)| *id == shot.id).and_then(|(_, left, right)| {
            moved::words(&((scene.cameras[1].place * left).inverse() * right), &scene.board)
        });
        sieve.refused[shot.id] = Some(moved.map_or(reason.clone(), |moved| format!("{reason}: {moved}")));
    }
    sieve.enough()?;
    Ok(scene)
}

/// The middle of several motions, which less than half of them can spoil.
fn middle(motions: &[Isometry3<f64>]) -> Isometry3<f64> {
    let median = |value: &dyn Fn(&Isometry3<f64>) -> f64| {
        let mut values: Vec<f64> = motions.iter().map(value).collect();
        values.sort_unstable_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or_default()
    };
    let turn = Vector3::from_fn(|i, _| median(&|m| m.rotation.scaled_axis()[i]));
    let shift = Vector3::from_fn(|i, _| median(&|m| m.translation.vector[i]));
    Isometry3::from_parts(Translation3::from(shift), UnitQuaternion::from_scaled_axis(turn))
}

fn lost(camera: &str) -> Error {
    Error::Invalid(format!(
        "the views tell nothing about the {camera} camera: show the board tilted in different directions, by 20° to 45°"
    ))
}
