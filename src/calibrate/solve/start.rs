//! Start of the adjustment of one camera: homographies, intrinsics in closed form, poses (Zhang, A
//! flexible new technique for camera calibration, PAMI 2000).

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix2, Matrix3, Point2, Point3, Rotation3, SMatrix, SVector,
    SymmetricEigen, Translation3, UnitQuaternion, Vector2, Vector3,
};
use svl_core::statistics::upper_median;
use svl_core::stereo::{Distortion, Intrinsics};

/// Limit on the iterations of decompositions, which converge in a few or not at all.
const ITERATIONS: usize = 200;

/// Determinant below which a balanced homography of norm 1 maps the board to a line; that of a
/// board seen frontally is 0.19.
const MIN_DETERMINANT: f64 = 1e-3;

/// The homography from the board's plane to an image by the normalized direct linear transformation
/// (Hartley, In defense of the eight-point algorithm, 1997), and its residual rms distance, pixels.
/// `None` for points on one line, or no points.
pub(super) fn homography(
    board: &[Point3<f64>],
    pixels: &[Point2<f64>],
) -> Option<(Matrix3<f64>, f64)> {
    let to_board = balance(board.iter().map(|p| p.xy()))?;
    let to_image = balance(pixels.iter().copied())?;
    let mut sum = SMatrix::<f64, 9, 9>::zeros();
    for (point, pixel) in board.iter().zip(pixels) {
        let p = to_board * Vector3::new(point.x, point.y, 1.0);
        let q = to_image * pixel.to_homogeneous();
        let (mut first, mut second) = (SVector::<f64, 9>::zeros(), SVector::<f64, 9>::zeros());
        // q × H p = 0: two independent equations per point (Hartley & Zisserman, equation 4.3).
        first.fixed_rows_mut::<3>(0).copy_from(&p);
        first.fixed_rows_mut::<3>(6).copy_from(&(-q.x * p));
        second.fixed_rows_mut::<3>(3).copy_from(&p);
        second.fixed_rows_mut::<3>(6).copy_from(&(-q.y * p));
        sum += first * first.transpose() + second * second.transpose();
    }
    let (vector, values) = smallest(DMatrix::from_column_slice(9, 9, sum.as_slice()))?;
    // A second vanishing eigenvalue: points on one line leave a family of homographies.
    if values[1] < 1e-9 * values[8] {
        return None;
    }
    let balanced = Matrix3::from_row_slice(vector.as_slice());
    if balanced.determinant().abs() < MIN_DETERMINANT {
        return None;
    }
    let h = to_image.try_inverse()? * balanced * to_board;
    let squared = |(point, pixel): (&Point3<f64>, &Point2<f64>)| {
        Some(
            (Point2::from_homogeneous(h * Vector3::new(point.x, point.y, 1.0))? - pixel)
                .norm_squared(),
        )
    };
    let sum = board.iter().zip(pixels).map(squared).sum::<Option<f64>>()?;
    Some((h, (sum / board.len() as f64).sqrt()))
        .filter(|(h, rms)| rms.is_finite() && h.iter().all(|v| v.is_finite()))
}

/// The similarity that moves the centroid to the origin and scales the mean distance from it to 1.
fn balance(points: impl Iterator<Item = Point2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let count = points.clone().count() as f64;
    let centre = points
        .clone()
        .fold(Vector2::zeros(), |sum, p| sum + p.coords)
        / count;
    let distance = points.map(|p| (p.coords - centre).norm()).sum::<f64>() / count;
    let scale = 1.0 / distance;
    let shift = -centre * scale;
    scale
        .is_finite()
        .then(|| Matrix3::new(scale, 0.0, shift.x, 0.0, scale, shift.y, 0.0, 0.0, 1.0))
}

/// The eigenvector of the smallest eigenvalue, and all eigenvalues, ascending.
fn smallest(matrix: DMatrix<f64>) -> Option<(DVector<f64>, Vec<f64>)> {
    let eigen = SymmetricEigen::try_new(matrix, f64::EPSILON, ITERATIONS)?;
    let (at, _) = eigen.eigenvalues.argmin();
    let mut values = eigen.eigenvalues.as_slice().to_vec();
    values.sort_unstable_by(f64::total_cmp);
    Some((eigen.eigenvectors.column(at).into_owned(), values))
}

/// Intrinsics without distortion from the homographies of boards in different poses: Zhang's closed
/// form, else with a centred principal point, else a guess. `None` for an impossible image size.
pub(super) fn intrinsics(
    size: (usize, usize),
    homographies: &[Matrix3<f64>],
) -> Option<Intrinsics> {
    let (width, height) = (size.0 as f64, size.1 as f64);
    let scale = (width + height) / 2.0;
    let centre = ((width - 1.0) / 2.0, (height - 1.0) / 2.0);
    let unit = Matrix3::new(1.0, 0.0, -centre.0, 0.0, 1.0, -centre.1, 0.0, 0.0, scale) / scale;
    // Centred and scaled, so that fx, fy, cx, cy are near 1 and 0 and the equations well
    // conditioned.
    let normalized = homographies
        .iter()
        .map(|h| unit * h)
        .map(|h| h / h.norm())
        .collect::<Vec<_>>();
    let plausible = |(fx, fy, cx, cy): &(f64, f64, f64, f64)| {
        let focal = |f: &f64| (0.2..20.0).contains(f);
        focal(fx)
            && focal(fy)
            && (0.5..2.0).contains(&(fx / fy))
            && cx.abs() < 0.5
            && cy.abs() < 0.5
    };
    let found = closed_form(&normalized)
        .filter(plausible)
        .or_else(|| centred(&normalized).filter(plausible));
    // A field of view of 45°: the adjustment converges from far off.
    let (fx, fy, cx, cy) = found.unwrap_or((1.2, 1.2, 0.0, 0.0));
    let center_px = (cx * scale + centre.0, cy * scale + centre.1);
    Intrinsics::new(size, (fx * scale, fy * scale), center_px, Distortion::NONE).ok()
}

/// Numbers of focal lengths that [`fisheye`] tries, and the least and greatest of them as fractions
/// of the image's longer side: fields of view of 230° and 40°.
const FOCAL_LENGTHS: u32 = 24;
const FOCAL_RANGE: (f64, f64) = (0.25, 1.4);

/// An `equidistant` camera whose undistorted images of the boards are nearest to homographies, with
/// a centred principal point and without coefficients: a search over focal lengths. Zhang's closed
/// form needs straight lines, which a fisheye's image has not.
pub(super) fn fisheye(
    size: (usize, usize),
    board: &[Point3<f64>],
    views: &[&[Point2<f64>]],
) -> Option<Intrinsics> {
    let side = size.0.max(size.1) as f64;
    let center_px = ((size.0 as f64 - 1.0) / 2.0, (size.1 as f64 - 1.0) / 2.0);
    let lens = Distortion::Equidistant([0.0; 4]);
    let ratio = (FOCAL_RANGE.1 / FOCAL_RANGE.0).ln() / f64::from(FOCAL_LENGTHS - 1);
    let cameras = (0..FOCAL_LENGTHS).filter_map(|i| {
        let focal = side * FOCAL_RANGE.0 * (ratio * f64::from(i)).exp();
        Intrinsics::new(size, (focal, focal), center_px, lens).ok()
    });
    let fit = |camera: &Intrinsics| {
        let distances = views.iter().map(|pixels| {
            let found = undistorted_homography(camera, board, pixels);
            // A view that the camera cannot see is as bad as one that is far off.
            found.map_or(f64::MAX, |(_, off)| off)
        });
        upper_median(distances)
    };
    let fits = cameras.filter_map(|camera| Some((fit(&camera)?, camera)));
    let (_, camera) = fits.min_by(|(a, _), (b, _)| a.total_cmp(b))?;
    Some(camera)
}

/// Fewest corners that determine a homography well, and the angle from the axis up to which corners
/// are used, radians: farther out, an error of a pixel is large on a plane.
const MIN_CORNERS: usize = 8;
const MAX_ANGLE: f64 = 1.3;

/// The homography from the board's plane to the image of an ideal lens of that camera, and the RMS
/// distance of the corners from their images in the camera's own, pixels. `None` as for
/// [`homography`].
pub(super) fn undistorted_homography(
    camera: &Intrinsics,
    board: &[Point3<f64>],
    pixels: &[Point2<f64>],
) -> Option<(Matrix3<f64>, f64)> {
    let ideal = camera.with_distortion(Distortion::NONE).ok()?;
    let seen = board.iter().zip(pixels).filter_map(|(point, pixel)| {
        let direction = camera.direction(*pixel)?;
        (direction.norm() < MAX_ANGLE.tan()).then(|| (*point, ideal.pixel(direction)))
    });
    let (points, flat): (Vec<_>, Vec<_>) = seen.unzip();
    if points.len() < MIN_CORNERS.min(board.len()) {
        return None;
    }
    let (h, _) = homography(&points, &flat)?;
    let off = reprojected(camera, board, pixels, &pose(&ideal, &h)?)?;
    Some((h, off))
}

/// RMS distance of a board's corners from their images, pixels; `None` if one is behind the camera.
fn reprojected(
    camera: &Intrinsics,
    board: &[Point3<f64>],
    pixels: &[Point2<f64>],
    pose: &Isometry3<f64>,
) -> Option<f64> {
    let squared = |(point, pixel): (&Point3<f64>, &Point2<f64>)| {
        Some((camera.project(&(pose * point))? - pixel).norm_squared())
    };
    let sum = board.iter().zip(pixels).map(squared).sum::<Option<f64>>()?;
    Some((sum / board.len() as f64).sqrt())
}

/// Zhang's section 3.1 without skew: fx, fy, cx, cy.
fn closed_form(homographies: &[Matrix3<f64>]) -> Option<(f64, f64, f64, f64)> {
    let mut sum = SMatrix::<f64, 5, 5>::zeros();
    for h in homographies {
        // hᵢᵀ B hⱼ by B11, B22, B13, B23, B33.
        let row = |i: usize, j: usize| {
            let (a, b) = (h.column(i), h.column(j));
            let mixed = |k: usize| a[k] * b[2] + a[2] * b[k];
            SVector::<f64, 5>::new(a[0] * b[0], a[1] * b[1], mixed(0), mixed(1), a[2] * b[2])
        };
        // Zhang's equations 3 and 4: the board's axes are orthogonal and of equal length.
        let (right_angle, same_length) = (row(0, 1), row(0, 0) - row(1, 1));
        sum += right_angle * right_angle.transpose() + same_length * same_length.transpose();
    }
    let (b, _) = smallest(DMatrix::from_column_slice(5, 5, sum.as_slice()))?;
    // Zhang's appendix B with B12 = 0, as the skew is 0.
    let (cx, cy) = (-b[2] / b[0], -b[3] / b[1]);
    let lambda = b[4] - b[2] * b[2] / b[0] - b[3] * b[3] / b[1];
    Some(((lambda / b[0]).sqrt(), (lambda / b[1]).sqrt(), cx, cy))
}

/// The same with the principal point in the centre of the image, as two lines for 1/fx² and 1/fy².
fn centred(homographies: &[Matrix3<f64>]) -> Option<(f64, f64, f64, f64)> {
    let (mut sum, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for h in homographies {
        let product = |i: usize, j: usize, k: usize| h[(k, i)] * h[(k, j)];
        let right_angle = [0, 1, 2].map(|k| product(0, 1, k));
        let same_length = [0, 1, 2].map(|k| product(0, 0, k) - product(1, 1, k));
        for [x, y, one] in [right_angle, same_length] {
            let row = Vector2::new(x, y);
            sum += row * row.transpose();
            right -= row * one;
        }
    }
    // The square root of a negative solution is NaN, which the caller treats as implausible.
    let inverse = sum.try_inverse()? * right;
    Some((inverse.x.recip().sqrt(), inverse.y.recip().sqrt(), 0.0, 0.0))
}

/// Pose of a board, camera from board, from its homography.
pub(super) fn pose(camera: &Intrinsics, homography: &Matrix3<f64>) -> Option<Isometry3<f64>> {
    let h = camera.matrix().try_inverse()? * homography;
    let scale = 2.0 / (h.column(0).norm() + h.column(1).norm());
    // The sign of a homography is arbitrary; the board is in front of the camera.
    let h = h * scale.copysign(h[(2, 2)]);
    let (x, y) = (h.column(0).normalize(), h.column(1).normalize());
    // With noise the two columns are not orthogonal: the nearest orthogonal pair is used.
    let (sum, difference) = ((x + y).normalize(), (x - y).normalize());
    let x = (sum + difference).normalize();
    let y = (sum - difference).normalize();
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
    let translation = Translation3::from(h.column(2).into_owned());
    let numbers = rotation.matrix().iter().chain(translation.vector.iter());
    let finite = numbers.copied().all(f64::is_finite);
    finite.then(|| {
        Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation))
    })
}

/// Pose of a board in front of a camera with known intrinsics.
pub(super) fn seen_pose(
    camera: &Intrinsics,
    board: &[Point3<f64>],
    pixels: &[Point2<f64>],
) -> Option<Isometry3<f64>> {
    let directions = pixels
        .iter()
        .map(|pixel| camera.direction(*pixel).map(Point2::from))
        .collect::<Option<Vec<_>>>()?;
    // The directions are already undistorted, so a pinhole with K = I remains.
    let pinhole = Intrinsics::new(camera.size(), (1.0, 1.0), (0.0, 0.0), Distortion::NONE).ok()?;
    pose(&pinhole, &homography(board, &directions)?.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn board() -> Vec<Point3<f64>> {
        (0..20)
            .map(|i| Point3::new(f64::from(i % 5) * 0.03, f64::from(i / 5) * 0.03, 0.0))
            .collect()
    }

    fn poses() -> Vec<Isometry3<f64>> {
        let turns = [
            Vector3::new(0.5, 0.1, 0.0),
            Vector3::new(-0.4, 0.3, 0.2),
            Vector3::new(0.1, -0.6, -0.1),
        ];
        turns
            .iter()
            .map(|turn| Isometry3::new(Vector3::new(-0.05, 0.02, 0.5), *turn))
            .collect()
    }

    #[test]
    fn without_noise_and_distortion_the_closed_form_is_exact() {
        let camera = Intrinsics::new((640, 480), (700.0, 690.0), (330.0, 230.0), [0.0; 5]).unwrap();
        let homographies: Vec<_> = poses()
            .iter()
            .map(|pose| {
                let pixels: Vec<_> = board()
                    .iter()
                    .map(|p| camera.project(&(pose * p)).unwrap())
                    .collect();
                let (h, rms) = homography(&board(), &pixels).unwrap();
                assert!(rms < 1e-8, "{rms}");
                h
            })
            .collect();
        let found = intrinsics((640, 480), &homographies).unwrap();
        let off = found
            .parameters()
            .into_iter()
            .zip(camera.parameters())
            .map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-4, "{found:?}");
        for (h, expected) in homographies.iter().zip(poses()) {
            let pose = pose(&camera, h).unwrap();
            assert!(
                (pose.to_homogeneous() - expected.to_homogeneous()).amax() < 1e-8,
                "{pose}"
            );
        }
    }

    #[test]
    fn a_line_and_a_point_have_no_homography() {
        let line: Vec<_> = (0..20)
            .map(|i| Point2::new(f64::from(i), 2.0 * f64::from(i) + 1.0))
            .collect();
        assert_eq!(homography(&board(), &line), None);
        assert_eq!(homography(&board(), &[Point2::new(3.0, 4.0); 20]), None);
    }

    #[test]
    fn degenerate_homographies_give_a_guess() {
        let same = Matrix3::new(500.0, 0.0, 300.0, 0.0, 500.0, 200.0, 0.0, 0.0, 1.0);
        let guess = intrinsics((640, 480), &[same, same, same]).unwrap();
        assert!((300.0..3000.0).contains(&guess.focal_px().0), "{guess:?}");
        assert!(intrinsics((640, 480), &[]).is_some());
    }
}
