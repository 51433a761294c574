//! The scene in 3D: camera, trail, arena, points.
//!
//! Frames of reference: `world` (z up) and [`CAMERA_FRAME`], the left camera's optical frame,
//! positioned by the pose. The left image's plane is the pinhole's own frame, that of the entity
//! `world/rig/left`; anything drawn on the image is put into it by [`on_image`], wherever its
//! entity is in the tree.

use crate::{CAMERA, scale::Scale};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rerun::{CoordinateFrame, LineStrips3D, Pinhole, Radius, Rgba32, Transform3D};
use svl_core::stereo::{Frame, Plane, Pose, Rig, Side};
use svl_sim::arena::WireObject;

/// Name of the left camera's optical frame.
const CAMERA_FRAME: &str = "left_camera";

/// Moves an entity onto the left image.
pub(crate) fn on_image() -> CoordinateFrame {
    CoordinateFrame::new(format!("tf#/{CAMERA}"))
}

/// The default pose if none is known: at the origin, upright, facing along the x axis of the world.
pub(crate) fn resting() -> Pose {
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(Translation3::identity(), rotation)
}

/// The pose of the left camera.
pub(crate) fn transform(pose: &Pose) -> Transform3D {
    let q = pose.rotation.coords.map(|v| v as f32);
    Transform3D::from_translation_rotation(
        position(pose),
        rerun::Quaternion::from_xyzw([q.x, q.y, q.z, q.w]),
    )
    .with_parent_frame("tf#/world")
    .with_child_frame(CAMERA_FRAME)
}

/// The left camera's projection.
pub(crate) fn pinhole(rig: &Rig, frame: &Frame, scale: &Scale) -> Pinhole {
    let (width, height) = frame.pair.size();
    // nalgebra, like Rerun, stores columns.
    let k: [[f32; 3]; 3] = rig.intrinsics(Side::Left).map(|v| v as f32).into();
    Pinhole::new(k)
        .with_resolution([width as f32, height as f32])
        .with_image_plane_distance(scale.far_m as f32 / 10.0)
        .with_parent_frame(CAMERA_FRAME)
        .with_child_frame(format!("tf#/{CAMERA}"))
}

/// The line from the last position to this one.
pub(crate) fn step(from: &Pose, to: &Pose) -> LineStrips3D {
    LineStrips3D::new([[position(from), position(to)]])
        .with_colors([Rgba32::from_rgb(90, 200, 250)])
        .with_radii([Radius::new_ui_points(1.5)])
}

/// The arena's edges, named.
pub(crate) fn wireframe(things: &[WireObject]) -> LineStrips3D {
    let strips = things.iter().flat_map(|thing| thing.strips.iter().cloned());
    let names = things
        .iter()
        .flat_map(|thing| thing.strips.iter().map(|_| thing.name.as_str()));
    LineStrips3D::new(strips)
        .with_labels(names)
        .with_show_labels(false)
        .with_colors([Rgba32::from_rgb(150, 155, 165)])
        .with_radii([Radius::new_ui_points(0.8)])
}

/// Position and target of the 3D view: from behind and above the camera towards the cloud of the
/// first frame.
pub(crate) fn eye(scale: &Scale, frame: &Frame, cloud: Option<&Plane<f32>>) -> [[f32; 3]; 2] {
    let pose = frame.pose.unwrap_or_else(resting);
    let place = |point: Point3<f64>| (pose * point).coords.map(|v| v as f32).into();
    let middle = cloud.zip(frame.rig());
    let middle = middle.and_then(|(map, rig)| cloud_middle(map, rig, scale));
    let middle = middle.unwrap_or(Point3::new(0.0, 0.0, 0.4 * scale.far_m));
    let behind = Point3::new(-0.3, -0.4, -0.5) * scale.far_m;
    [place(behind), place(middle)]
}

/// Mean of the points of a cloud in the camera's frame; none without a point.
fn cloud_middle(map: &Plane<f32>, rig: &Rig, scale: &Scale) -> Option<Point3<f64>> {
    let k = rig.intrinsics(Side::Left);
    let (mut sum, mut points) = (Vector3::zeros(), 0.0);
    for (y, row) in map.rows().enumerate() {
        for (x, &disparity) in row.iter().enumerate() {
            let depth_m = Some(disparity).filter(|d| d.is_finite());
            let depth_m = depth_m.and_then(|d| rig.depth_m(d.into()));
            if let Some(z) = depth_m.filter(|z| *z <= scale.far_m) {
                let across = |pixel: usize, axis| (pixel as f64 - k[(axis, 2)]) / k[(axis, axis)];
                sum += Vector3::new(across(x, 0), across(y, 1), 1.0) * z;
                points += 1.0;
            }
        }
    }
    (points > 0.0).then(|| Point3::from(sum / points))
}

fn position(pose: &Pose) -> [f32; 3] {
    pose.translation.vector.map(|v| v as f32).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{Geometry, Gray, StereoPair};

    #[test]
    fn the_eye_looks_at_the_cloud_wherever_the_camera_is() {
        let image = Gray::filled(320, 240, 0).unwrap();
        let rig = Rig::new(320.0, (159.5, 119.5), 0.05, 0.0).unwrap();
        let mut frame = Frame::new(
            StereoPair::new(image.clone(), image).unwrap(),
            Geometry::Rectified(Some(rig)),
        );
        let scale = Scale::new(&frame);
        // A wall at 1 m.
        let wall = Plane::filled(320, 240, 16.0).unwrap();
        let at = |frame: &Frame| eye(&scale, frame, Some(&wall))[1];
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(near(at(&frame), [1.0, 0.0, 0.0]), "{:?}", at(&frame));
        let mut moved = resting();
        moved.translation.vector.x += 100.0;
        frame.pose = Some(moved);
        assert!(near(at(&frame), [101.0, 0.0, 0.0]), "{:?}", at(&frame));
    }
}
