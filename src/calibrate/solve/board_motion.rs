//! Diagnosis of a view that agrees in each image but not in both: the board moved between the
//! exposures, or the corners were numbered differently.

use nalgebra::{Isometry3, Point3, Vector2, Vector3};

/// Beyond this rotation, in degrees, the corners were numbered from another end rather than moved.
const ANOTHER_END_DEG: f64 = 120.0;
/// A slipped numbering looks like a shift by whole squares in the board's plane, up to this
/// fraction of a square. Across the plane a single image is less certain.
const SLIP: f64 = 0.3;

/// Describes the `motion` of the board from the left image to the right one, in the board's frame.
/// `board`: its corners. `None` for a motion too small to matter.
pub(super) fn describe(motion: &Isometry3<f64>, board: &[Point3<f64>]) -> Option<String> {
    let turn = motion.rotation.angle().to_degrees();
    if turn > ANOTHER_END_DEG {
        return Some("the corners are numbered from another end in one image".to_owned());
    }
    let square = (board[1] - board[0]).norm();
    let shift = motion.translation.vector / square;
    let slip = shift.map(f64::round);
    if turn < 10.0
        && slip.xy() != Vector2::zeros()
        && (shift - slip).xy().norm() < SLIP
        && shift.z.abs() < 1.0
    {
        return Some(format!(
            "the corners are slipped by ({:.0}, {:.0}) squares in one image",
            slip.x, slip.y
        ));
    }
    let centre = board.iter().fold(Vector3::zeros(), |sum, p| sum + p.coords) / board.len() as f64;
    let away = (motion * Point3::from(centre) - Point3::from(centre)).norm() / square;
    (away > 0.02 || turn > 0.2).then(|| {
        format!(
            "between the images the board moved by {away:.2} squares and turned by {turn:.1}°; \
             hold it still, check the trigger"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_are_described() {
        let board: Vec<_> = (0..20)
            .map(|i| Point3::new(f64::from(i % 5) * 0.03, f64::from(i / 5) * 0.03, 0.0))
            .collect();
        let words = |x: f64, y: f64, turn: Vector3<f64>| {
            describe(&Isometry3::new(Vector3::new(x, y, 0.0), turn), &board).unwrap_or_default()
        };
        assert!(words(0.12, 0.09, Vector3::z() * std::f64::consts::PI).contains("another end"));
        assert!(words(0.12, 0.0, Vector3::y() * std::f64::consts::PI).contains("another end"));
        assert!(words(-0.0301, 0.001, Vector3::z() * 0.01).contains("slipped by (-1, 0) squares"));
        assert!(words(0.015, 0.0, Vector3::zeros()).contains("moved by 0.50 squares"));
        assert_eq!(words(0.0, 0.0, Vector3::zeros()), "");
    }
}
