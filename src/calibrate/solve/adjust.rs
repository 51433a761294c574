//! Bundle adjustment: all parameters of all cameras and poses at once.
//!
//! Levenberg and Marquardt's steps, from normal equations out of which the poses are eliminated (Schur's complement; Triggs,
//! `McLauchlan`, Hartley, Fitzgibbon: Bundle adjustment, a modern synthesis, 2000, section 6.1): 24 unknowns remain for a
//! pair of cameras, however many views there are.

use super::scene::{Loss, MOTION, Normal, Scene};
use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, Vector6};

const STEPS: usize = 100;
/// Share of the cost below which a gain is none.
const GAIN: f64 = 1e-12;
const DAMPING: f64 = 1e-3;
const MOST_DAMPING: f64 = 1e12;

/// Moves cameras and poses to the nearest minimum. Nothing when there is no cost to begin with.
pub(super) fn adjust(scene: &mut Scene, loss: Loss) -> Option<()> {
    let mut cost = scene.cost(loss)?;
    let mut damping = DAMPING;
    for _ in 0..STEPS {
        let normal = scene.normal(loss);
        let (next, lower) = loop {
            let step = normal.step(damping).and_then(|(cameras, poses)| scene.moved(&cameras, &poses));
            let next = step.and_then(|next| Some((next.cost(loss)?, next))).filter(|(lower, _)| *lower <= cost);
            if let Some((lower, next)) = next {
                break (next, lower);
            }
            damping *= 10.0;
            if damping > MOST_DAMPING {
                return Some(());
            }
        };
        damping = (damping / 10.0).max(1e-12);
        *scene = next;
        if cost - lower <= GAIN * cost {
            break;
        }
        cost = lower;
    }
    Some(())
}

impl Normal {
    /// The step that solves them: of the cameras, and of each pose.
    fn step(&self, damping: f64) -> Option<(DVector<f64>, Vec<Vector6<f64>>)> {
        let (reduced, right, inverses) = self.reduced(damping)?;
        let cameras = Cholesky::new(reduced)?.solve(&right);
        let pose = |(block, inverse): (&super::scene::PoseBlock, &Matrix6<f64>)| {
            let left = block.right - block.mixed.tr_mul(&cameras).fixed_rows::<MOTION>(0);
            inverse * left
        };
        let poses = self.poses.iter().zip(&inverses).map(pose).collect();
        Some((cameras, poses))
    }

    /// Covariance of the cameras' parameters for residuals of variance 1, the poses being unknown too. Nothing when they
    /// cannot be told from the views.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let (reduced, ..) = self.reduced(0.0)?;
        let inverse = Cholesky::new(reduced)?.inverse();
        inverse.iter().all(|v| v.is_finite()).then_some(inverse)
    }

    /// The equations of the cameras alone, and the inverses of the poses' blocks.
    fn reduced(&self, damping: f64) -> Option<(DMatrix<f64>, DVector<f64>, Vec<Matrix6<f64>>)> {
        let (mut reduced, mut right) = (self.cameras.clone(), self.cameras_right.clone());
        for i in 0..reduced.nrows() {
            reduced[(i, i)] *= 1.0 + damping;
        }
        let mut inverses = Vec::with_capacity(self.poses.len());
        for block in &self.poses {
            let damped = block.pose + Matrix6::from_diagonal(&(block.pose.diagonal() * damping));
            let inverse = Cholesky::new(damped)?.inverse();
            let weighed = &block.mixed * inverse;
            reduced.gemm(-1.0, &weighed, &block.mixed.transpose(), 1.0);
            right.gemv(-1.0, &weighed, &block.right, 1.0);
            inverses.push(inverse);
        }
        Some((reduced, right, inverses))
    }
}
