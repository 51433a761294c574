//! Which motions between two poses a robot can make.

use svl_core::nanoseconds;

use nalgebra::{Isometry3, Vector3};

/// No robot is faster, in m/s: 144 km/h, a car on a motorway.
const MAX_M_S: f64 = 40.0;
/// No robot turns faster, in rad/s: 570° a second.
const MAX_RAD_S: f64 = 10.0;
/// Nor that many times as fast as over the second around it, from [`SLOW_M_S`] on: by the median of
/// its steps, and by the way from its first pose to its last, which two odometries by turns do not
/// make longer.
const MAX_RATIO: f64 = 5.0;
/// Slower motions are not compared with that second: a robot may start to drive.
const SLOW_M_S: f64 = 2.0;
/// Half of that second.
const AROUND_NS: u64 = 500_000_000;
/// Poses nearer to each other in time are skipped: their noise divided by their interval is no
/// speed.
const MIN_STEP_NS: u64 = 10_000_000;

/// The motion from one pose to the next.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PoseStep {
    /// Stamp of the first pose.
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub start_ns: u64,
    /// Stamp of the next one.
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub end_ns: u64,
    pub metres: f64,
    pub radians: f64,
    /// In the world's frame, m.
    #[serde(skip)]
    moved: Vector3<f64>,
}

impl PoseStep {
    fn seconds(&self) -> f64 {
        (self.end_ns - self.start_ns) as f64 / 1e9
    }

    fn m_s(&self) -> f64 {
        self.metres / self.seconds()
    }
}

/// The motions between poses, sorted by their stamps.
pub(crate) fn steps(poses: impl Iterator<Item = (u64, Isometry3<f64>)>) -> Vec<PoseStep> {
    let mut steps = Vec::new();
    let mut last: Option<(u64, Isometry3<f64>)> = None;
    for (end_ns, pose) in poses {
        let Some((start_ns, from)) = last else {
            last = Some((end_ns, pose));
            continue;
        };
        if end_ns - start_ns < MIN_STEP_NS {
            continue;
        }
        let moved = from.inverse() * pose;
        steps.push(PoseStep {
            start_ns,
            end_ns,
            metres: moved.translation.vector.norm(),
            radians: moved.rotation.angle(),
            moved: pose.translation.vector - from.translation.vector,
        });
        last = Some((end_ns, pose));
    }
    steps
}

/// The first step between the two stamps that no robot makes: an estimate that was corrected, or an
/// odometry that began anew.
pub(crate) fn jump(steps: &[PoseStep], [from_ns, to_ns]: [u64; 2]) -> Option<&PoseStep> {
    let middle_ns = from_ns.midpoint(to_ns);
    let is_near = |step: &&PoseStep| {
        step.end_ns >= middle_ns.saturating_sub(AROUND_NS)
            && step.start_ns <= middle_ns.saturating_add(AROUND_NS)
    };
    let near: Vec<_> = steps.iter().filter(is_near).collect();
    let mut speeds: Vec<_> = near.iter().map(|step| step.m_s()).collect();
    speeds.sort_by(f64::total_cmp);
    let median = speeds.get(speeds.len() / 2).copied().unwrap_or(0.0);
    let way: Vector3<f64> = near.iter().map(|step| step.moved).sum();
    let seconds: f64 = near.iter().map(|step| step.seconds()).sum();
    let speed = median.min(way.norm() / seconds.max(f64::MIN_POSITIVE));
    let limit = (MAX_RATIO * speed).clamp(SLOW_M_S, MAX_M_S);
    let is_jump =
        |step: &&PoseStep| step.m_s() > limit || step.radians / step.seconds() > MAX_RAD_S;
    let mut between = steps
        .iter()
        .filter(|step| step.start_ns < to_ns && step.end_ns > from_ns);
    between.find(is_jump)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    /// Poses every 20 ms of a robot with that speed, m/s, which is `by` ahead from 1 s on.
    fn path(speed: f64, by: Isometry3<f64>) -> Vec<PoseStep> {
        let pose = |i: u32| {
            let own = Isometry3::translation(speed * 0.02 * f64::from(i), 0.0, 0.0);
            let ahead = if i >= 50 { by } else { Isometry3::identity() };
            (u64::from(i) * 20_000_000, own * ahead)
        };
        steps((0..100).map(pose))
    }

    fn is_jump(speed: f64, by: Isometry3<f64>) -> bool {
        jump(&path(speed, by), [970_000_000, 985_000_000]).is_some()
    }

    #[test]
    fn jumps_are_motions_that_no_robot_makes() {
        let ahead = |x| Isometry3::translation(x, 0.0, 0.0);
        assert!(!is_jump(0.0, ahead(0.03)) && is_jump(0.0, ahead(0.05)));
        // A robot that drives is compared with its own speed.
        assert!(!is_jump(1.0, ahead(0.07)) && is_jump(1.0, ahead(0.09)));
        assert!(!is_jump(30.0, ahead(0.1)) && is_jump(30.0, ahead(0.3)));
        let turned = |angle| UnitQuaternion::from_euler_angles(0.0, 0.0, angle);
        let turned = |angle| Isometry3::from_parts(ahead(0.0).translation, turned(angle));
        assert!(!is_jump(1.0, turned(0.15)) && is_jump(1.0, turned(0.25)));
        // Between other stamps it moves as before.
        let steps = path(1.0, ahead(3.0));
        assert!(jump(&steps, [940_000_000, 975_000_000]).is_none());
        assert_eq!(steps.len(), 99);
    }

    #[test]
    fn odometries_that_disagree_by_turns_jump() {
        let two = |apart: f64, speed: f64| {
            let pose = |i: u32| {
                let own = speed * 0.01 * f64::from(i) + apart * f64::from(i % 2);
                (
                    u64::from(i) * 10_000_000,
                    Isometry3::translation(own, 0.0, 0.0),
                )
            };
            let steps = steps((0..200).map(pose));
            jump(&steps, [1_000_000_000, 1_030_000_000]).is_some()
        };
        assert!(two(0.3, 0.0) && two(0.3, 1.5) && two(0.1, 1.5));
        assert!(!two(0.0, 1.5) && !two(0.002, 1.5) && !two(0.0, 30.0));
    }

    #[test]
    fn the_noise_of_poses_at_nearly_one_time_is_no_speed() {
        let noisy = (0..1000_u64).map(|i| {
            let noise = if i % 3 == 0 { 0.002 } else { 0.0 };
            (i * 500_000, Isometry3::translation(noise, 0.0, 0.0))
        });
        assert!(jump(&steps(noisy), [100_000_000, 120_000_000]).is_none());
    }
}
