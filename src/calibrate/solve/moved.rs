//! Why a view that is good in each image by itself is not good in both: what the board did between them.

use nalgebra::{Isometry3, Point3};

/// Beyond this turn, in degrees, corners are counted from another end rather than moved.
const ANOTHER_END_DEG: f64 = 120.0;
/// Slips are whole squares, up to this share of one.
const SLIP: f64 = 0.2;

/// `motion` of the board from the left image to the right one, in its own frame. `board`: its corners. Nothing for a
/// motion too small to speak of.
pub(super) fn words(motion: &Isometry3<f64>, board: &[Point3<f64>]) -> Option<String> {
    let turn = motion.rotation.angle().to_degrees();
    if turn > ANOTHER_END_DEG {
        return Some("the corners are counted from another end in one image".to_owned());
    }
    let square = (board[1] - board[0]).norm();
    let shift = motion.translation.vector / square;
    let slip = shift.map(f64::round);
    if turn < 10.0 && slip.norm() > 0.5 && (shift - slip).norm() < SLIP && slip.z == 0.0 {
        return Some(format!("the corners are slipped by ({:.0}, {:.0}) squares in one image", slip.x, slip.y));
    }
    let centre = board.iter().fold(nalgebra::Vector3::zeros(), |sum, p| sum + p.coords) / board.len() as f64;
    let away = (motion * Point3::from(centre) - Point3::from(centre)).norm() / square;
    (away > 0.02 || turn > 0.2).then(|| {
        format!("between the images the board moved by {away:.2} squares and turned by {turn:.1}°; hold it still, check the trigger")
    })
}
