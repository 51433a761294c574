//! From corners to two calibrated cameras.
//!
//! Each camera by itself: homographies and closed form (Zhang, A flexible new technique for camera
//! calibration, PAMI 2000), then its lens (Brown, Close-range camera calibration, 1971) and all
//! poses adjusted. Then both together: every parameter of both lenses, R, T and the poses in one
//! adjustment, in which a board has one pose for both images. Views and corners that cannot belong
//! to the rest are refused at every stage, and the rest adjusted again without them.

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
use crate::statistics::upper_median;
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

/// Calibrates two cameras of images of `size` (width, height) from `views` of a board.
///
/// # Errors
/// [`Error::Invalid`] when a view has another number of corners than the board, when fewer than
/// three views agree, or when they do not tell the parameters, as with boards that are all
/// parallel; it says what to add.
pub fn solve(board: &Board, size: (usize, usize), views: &[View]) -> Result<Solution> {
    let corners: Vec<Point3<f64>> = board.corners().collect();
    let mut sieve = Sieve {
        views,
        refused: vec![None; views.len()],
    };
    sieve.look(size, corners.len())?;
    let left = single(&corners, size, &mut sieve, "left", |view| &view.left)?;
    let right = single(&corners, size, &mut sieve, "right", |view| &view.right)?;
    let scene = together(left, right, &mut sieve)?;
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
                        "corner {} is outside the {name} image or no number",
                        corner + 1
                    );
                    self.refused[id] = Some(reason);
                }
            }
        }
        self.enough()
    }

    fn alive(&self) -> impl Iterator<Item = usize> {
        self.refused
            .iter()
            .enumerate()
            .filter(|(_, reason)| reason.is_none())
            .map(|(id, _)| id)
    }

    fn enough(&self) -> Result<()> {
        let (alive, all) = (self.alive().count(), self.views.len());
        if alive >= LEAST_VIEWS {
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
            "{alive} of {all} views of the board can be used, at least {LEAST_VIEWS} are \
             needed{why}; add views with the board tilted differently"
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
) -> Result<Scene> {
    let views = sieve.views;
    let mut homographies: Vec<(usize, Matrix3<f64>, f64)> = Vec::new();
    for id in sieve.alive().collect::<Vec<_>>() {
        match start::homography(board, pixels(&views[id])) {
            Some((h, off)) => homographies.push((id, h, off)),
            None => {
                sieve.refused[id] = Some(format!(
                    "the {name} image's corners lie on one line or in no order"
                ))
            }
        }
    }
    // A lens bends a board by a few pixels; corners in disorder are off by a good part of the
    // board.
    let usual = upper_median(homographies.iter().map(|(.., off)| *off)).unwrap_or_default();
    let limit = 4.0 * usual + 0.03 * (size.0 as f64).hypot(size.1 as f64);
    homographies.retain(|(id, _, off)| {
        if *off > limit {
            sieve.refused[*id] = Some(format!(
                "the {name} image's corners are no board in order: {off:.0} px off"
            ));
        }
        *off <= limit
    });
    sieve.enough()?;

    let lens = start::intrinsics(
        size,
        &homographies.iter().map(|(_, h, _)| *h).collect::<Vec<_>>(),
    );
    let lens = lens.ok_or_else(|| lost(&format!("{name} camera")))?;
    let mut shots = Vec::new();
    for (id, h, _) in homographies {
        match start::pose(&lens, &h).filter(|pose| scene::in_front(board, pose)) {
            Some(pose) => shots.push(Shot {
                id,
                pose,
                images: vec![Image::new(pixels(&views[id]))],
            }),
            None => {
                sieve.refused[id] = Some(format!(
                    "the {name} image's corners are no board before the camera"
                ))
            }
        }
    }
    sieve.enough()?;
    let cameras = vec![scene::Camera {
        lens,
        place: Isometry3::identity(),
    }];
    let mut scene = Scene {
        board: board.to_vec(),
        cameras,
        shots,
    };
    for Refusal { shot, reason } in
        settle(&mut scene, &[name]).ok_or_else(|| lost(&format!("{name} camera")))?
    {
        sieve.refused[shot.id] = Some(reason);
    }
    sieve.enough()?;
    Ok(scene)
}

/// Both cameras with one pose of the board for both images.
fn together(left: Scene, mut right: Scene, sieve: &mut Sieve<'_>) -> Result<Scene> {
    let Scene {
        board,
        mut cameras,
        shots,
    } = left;
    let (mut pairs, mut apart) = (Vec::new(), Vec::new());
    for mut shot in shots {
        if let Some(same) = right.shots.iter().find(|same| same.id == shot.id) {
            apart.push(same.pose * shot.pose.inverse());
            shot.images.extend(same.images.iter().cloned());
            pairs.push(shot);
        }
    }
    cameras.append(&mut right.cameras);
    cameras[1].place = middle(&apart);
    let mut scene = Scene {
        board,
        cameras,
        shots: pairs,
    };
    for Refusal { shot, reason } in
        settle(&mut scene, &["left", "right"]).ok_or_else(|| lost("cameras"))?
    {
        let seen = |camera: usize| {
            let scene::Camera { lens, place } = &scene.cameras[camera];
            Some(
                place.inverse()
                    * start::seen_pose(lens, &scene.board, &shot.images[camera].pixels)?,
            )
        };
        let moved = seen(0)
            .zip(seen(1))
            .map(|(left, right)| left.inverse() * right);
        let moved = moved
            .and_then(|motion| moved::words(&motion, &scene.board))
            .map(|words| format!(": {words}"));
        sieve.refused[shot.id] = Some(reason + &moved.unwrap_or_default());
    }
    sieve.enough()?;
    Ok(scene)
}

/// The middle of several motions, which less than half of them can spoil.
fn middle(motions: &[Isometry3<f64>]) -> Isometry3<f64> {
    let median = |value: fn(&Isometry3<f64>) -> Vector3<f64>| {
        Vector3::from_fn(|i, _| {
            upper_median(motions.iter().map(|m| value(m)[i])).unwrap_or_default()
        })
    };
    let shift = Translation3::from(median(|motion| motion.translation.vector));
    Isometry3::from_parts(
        shift,
        UnitQuaternion::from_scaled_axis(median(|motion| motion.rotation.scaled_axis())),
    )
}

fn lost(what: &str) -> Error {
    Error::Invalid(format!(
        "the views tell nothing about the {what}: add views with the board tilted in different \
         directions, by 20° to 45°"
    ))
}
