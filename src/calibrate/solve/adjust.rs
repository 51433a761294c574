//! Bundle adjustment: all parameters of all cameras and poses at once.
//!
//! Levenberg-Marquardt steps from normal equations whose poses are eliminated by the Schur
//! complement (Triggs, McLauchlan, Hartley, Fitzgibbon: Bundle adjustment, a modern synthesis,
//! 2000, section 6.1): 24 unknowns remain for a pair of cameras, however many views there are.

use super::bundle::{BundleProblem, LossFunction, MOTION, NormalEquations, PoseBlock};
use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, Vector6};

const STEPS: usize = 100;
/// The adjustment has converged if a step lowers the cost by less than this fraction. A robust
/// minimum is only the start of the next adjustment, so it needs less.
const GAIN: f64 = 1e-12;
const ROBUST_GAIN: f64 = 1e-5;
const DAMPING: f64 = 1e-3;
const MAX_DAMPING: f64 = 1e12;

/// Moves cameras and poses to the nearest minimum. `None` if the cost is undefined at the start.
pub(super) fn adjust(bundle: &mut BundleProblem, loss: LossFunction) -> Option<()> {
    let mut cost = bundle.cost(loss)?;
    let mut damping = DAMPING;
    let least = match loss {
        LossFunction::Squares => GAIN,
        LossFunction::Robust(_) => ROBUST_GAIN,
    };
    for _ in 0..STEPS {
        let normal = bundle.normal(loss);
        let (next, lower) = loop {
            let step = normal
                .step(damping)
                .and_then(|(cameras, poses)| bundle.moved(&cameras, &poses));
            let next = step
                .and_then(|next| Some((next.cost(loss)?, next)))
                .filter(|(lower, _)| *lower <= cost);
            if let Some((lower, next)) = next {
                break (next, lower);
            }
            // The step was too long for the linearization: shorten it, towards gradient descent.
            damping *= 10.0;
            if damping > MAX_DAMPING {
                return Some(());
            }
        };
        damping = (damping / 10.0).max(1e-12);
        *bundle = next;
        if cost - lower <= least * cost {
            break;
        }
        cost = lower;
    }
    Some(())
}

/// The equations of only the cameras (Schur complement), and the inverses of the poses' blocks.
struct Reduced {
    cameras: DMatrix<f64>,
    right: DVector<f64>,
    poses: Vec<Matrix6<f64>>,
}

impl NormalEquations {
    /// The damped step of the cameras and of each pose; `None` for a singular system.
    fn step(&self, damping: f64) -> Option<(DVector<f64>, Vec<Vector6<f64>>)> {
        let reduced = self.reduced(damping)?;
        let cameras = Cholesky::new(reduced.cameras)?.solve(&reduced.right);
        let pose = |(block, inverse): (&PoseBlock, &Matrix6<f64>)| {
            let left = block.right - block.mixed.tr_mul(&cameras).fixed_rows::<MOTION>(0);
            inverse * left
        };
        let poses = self.poses.iter().zip(&reduced.poses).map(pose).collect();
        Some((cameras, poses))
    }

    /// Covariance of the cameras' parameters for residuals of variance 1, marginalized over the
    /// poses. `None` if the views do not determine them.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let inverse = Cholesky::new(self.reduced(0.0)?.cameras)?.inverse();
        inverse.iter().all(|v| v.is_finite()).then_some(inverse)
    }

    /// Eliminates the poses: `A − Σ B C⁻¹ Bᵀ`, pose by pose, as `C` is block diagonal.
    fn reduced(&self, damping: f64) -> Option<Reduced> {
        let (mut cameras, mut right) = (self.cameras.clone(), self.cameras_right.clone());
        for i in 0..cameras.nrows() {
            cameras[(i, i)] *= 1.0 + damping;
        }
        let mut poses = Vec::with_capacity(self.poses.len());
        for block in &self.poses {
            let damped = block.pose + Matrix6::from_diagonal(&(block.pose.diagonal() * damping));
            let inverse = Cholesky::new(damped)?.inverse();
            let weighed = &block.mixed * inverse;
            cameras.gemm(-1.0, &weighed, &block.mixed.transpose(), 1.0);
            right.gemv(-1.0, &weighed, &block.right, 1.0);
            poses.push(inverse);
        }
        Some(Reduced {
            cameras,
            right,
            poses,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::bundle::tests::pair;
    use super::*;

    /// All equations in one matrix, without elimination.
    fn whole(normal: &NormalEquations) -> (DMatrix<f64>, DVector<f64>) {
        let n = normal.cameras.nrows();
        let size = n + MOTION * normal.poses.len();
        let (mut matrix, mut right) = (DMatrix::zeros(size, size), DVector::zeros(size));
        matrix.view_mut((0, 0), (n, n)).copy_from(&normal.cameras);
        right.rows_mut(0, n).copy_from(&normal.cameras_right);
        for (i, block) in normal.poses.iter().enumerate() {
            let at = n + MOTION * i;
            matrix
                .view_mut((0, at), (n, MOTION))
                .copy_from(&block.mixed);
            matrix
                .view_mut((at, 0), (MOTION, n))
                .copy_from(&block.mixed.transpose());
            matrix
                .view_mut((at, at), (MOTION, MOTION))
                .copy_from(&block.pose);
            right.rows_mut(at, MOTION).copy_from(&block.right);
        }
        (matrix, right)
    }

    #[test]
    fn step_and_covariance_are_those_of_the_whole_equations() {
        let normal = pair().normal(LossFunction::Squares);
        let (matrix, right) = whole(&normal);
        let n = normal.cameras.nrows();
        let damped = &matrix + DMatrix::from_diagonal(&(matrix.diagonal() * 0.1));
        let expected = damped.lu().solve(&right).unwrap();
        let (cameras, poses) = normal.step(0.1).unwrap();
        let close = |a: f64, b: f64| (a - b).abs() < 1e-6 * b.abs().max(1e-9);
        assert!(
            cameras
                .iter()
                .zip(expected.iter())
                .all(|(a, b)| close(*a, *b))
        );
        let poses = poses.iter().flat_map(|pose| pose.iter());
        assert!(
            poses
                .zip(expected.iter().skip(n))
                .all(|(a, b)| close(*a, *b))
        );
        let (covariance, inverse) = (normal.covariance().unwrap(), matrix.try_inverse().unwrap());
        assert!((0..n).all(|i| (covariance[(i, i)] / inverse[(i, i)] - 1.0).abs() < 1e-4));
    }

    #[test]
    fn the_gradient_of_an_adjusted_problem_vanishes() {
        let mut bundle = pair();
        let before = bundle.cost(LossFunction::Squares).unwrap();
        adjust(&mut bundle, LossFunction::Squares).unwrap();
        assert!(bundle.cost(LossFunction::Squares).unwrap() < before);
        let normal = bundle.normal(LossFunction::Squares);
        let (cameras, _) = normal.step(0.0).unwrap();
        let covariance = normal.covariance().unwrap();
        // A step is small against the standard deviations.
        assert!(
            (0..cameras.len()).all(|i| cameras[i].abs() < 1e-3 * covariance[(i, i)].sqrt()),
            "{cameras}"
        );
    }
}
