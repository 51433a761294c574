//! Points of lidars: PointCloud2, LaserScan, and Foxglove's.

use crate::message::MessageError::Unsuited;
use crate::message::wire::decode_protobuf;
use crate::message::{MessageError, MessageResult, ros};
use crate::stream::channel::Channel;
use foxglove::messages::{LaserScan, PointCloud, Pose};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};

/// Codes of 32- and 64-bit floats, shared by ROS's PointField and Foxglove's PackedElementField.
const FLOAT32: i32 = 7;
const FLOAT64: i32 = 8;

/// Points in the sensor's frame, metres; those without a measurement are NaN or omitted.
type Points = Vec<Point3<f64>>;

/// Offset and type of x, y and z in the bytes of a point.
type Fields = [(usize, i32); 3];

pub(crate) fn ros_cloud(channel: &Channel, data: &[u8]) -> MessageResult<Points> {
    let cloud = ros::read(channel, data, ros::point_cloud)?;
    if cloud.big_endian {
        let why = "its points are big-endian, svl reads little-endian ones";
        return Err(Unsuited(why));
    }
    let fields = fields(|name| {
        let (_, offset, kind) = cloud.fields.iter().find(|(known, ..)| *known == name)?;
        Some((*offset, i32::from(*kind)))
    })?;
    let (width, height) = (cloud.width as usize, cloud.height as usize);
    let step = cloud.point_step as usize;
    check(&fields, step)?;
    // Saturating: the sizes are untrusted numbers from a message.
    let row_bytes = width.saturating_mul(step);
    // Some programs leave it out.
    let row = match cloud.row_step as usize {
        0 => row_bytes,
        row => row,
    };
    // An organized cloud may pad its rows; the last one may lack the padding.
    let needed = row
        .saturating_mul(height.saturating_sub(1))
        .saturating_add(row_bytes);
    if height > 0 && width > 0 && (row < row_bytes || cloud.data.len() < needed) {
        let what =
            format!("a cloud of {width}x{height} points of {step} bytes, with rows of {row},");
        return Err(MessageError::Length(what, cloud.data.len()));
    }
    let rows =
        (0..if width == 0 { 0 } else { height }).map(|y| &cloud.data[y * row..][..row_bytes]);
    Ok(rows.flat_map(|row| points(row, step, fields)).collect())
}

pub(crate) fn foxglove_cloud(_: &Channel, data: &[u8]) -> MessageResult<Points> {
    let cloud: PointCloud = decode_protobuf(data)?;
    let fields = fields(|name| {
        let field = cloud.fields.iter().find(|field| field.name == name)?;
        Some((field.offset, field.r#type))
    })?;
    let step = cloud.point_stride as usize;
    check(&fields, step)?;
    let pose = pose(cloud.pose)?;
    Ok(points(&cloud.data, step, fields)
        .map(|point| pose * point)
        .collect())
}

pub(crate) fn ros_scan(channel: &Channel, data: &[u8]) -> MessageResult<Points> {
    let scan = ros::read(channel, data, ros::laser_scan)?;
    let within = |range: f64| range > 0.0 && range >= scan.range_min && range <= scan.range_max;
    let ranges = scan.ranges.iter().enumerate();
    // Beyond the limits of the sensor there is no measurement (sensor_msgs/LaserScan); NaN is
    // outside them.
    let measured = ranges.filter(|(_, range)| within(**range));
    Ok(measured
        .map(|(i, &range)| polar(range, scan.angle_min + i as f64 * scan.angle_increment))
        .collect())
}

pub(crate) fn foxglove_scan(_: &Channel, data: &[u8]) -> MessageResult<Points> {
    let scan: LaserScan = decode_protobuf(data)?;
    let pose = pose(scan.pose)?;
    // From the first to the last ray.
    let steps = scan.ranges.len().saturating_sub(1).max(1) as f64;
    let angle =
        |i: usize| scan.start_angle + (scan.end_angle - scan.start_angle) * i as f64 / steps;
    let measured = scan
        .ranges
        .iter()
        .enumerate()
        .filter(|(_, range)| **range > 0.0);
    Ok(measured
        .map(|(i, &range)| pose * polar(range, angle(i)))
        .collect())
}

/// A ray of a scan, in the plane of x and y.
fn polar(range: f64, angle: f64) -> Point3<f64> {
    Point3::new(range * angle.cos(), range * angle.sin(), 0.0)
}

fn fields(field: impl Fn(&str) -> Option<(u32, i32)>) -> MessageResult<Fields> {
    let mut fields = [(0, 0); 3];
    for (place, name) in fields.iter_mut().zip(["x", "y", "z"]) {
        let Some((offset, kind)) = field(name) else {
            return Err(MessageError::NoField(name));
        };
        if ![FLOAT32, FLOAT64].contains(&kind) {
            return Err(MessageError::FieldType(name, kind));
        }
        *place = (offset as usize, kind);
    }
    Ok(fields)
}

/// Checks that the fields are within a point's bytes.
fn check(fields: &Fields, step: usize) -> MessageResult<()> {
    let end = |&(offset, kind): &(usize, i32)| offset.saturating_add(bytes(kind));
    match fields.iter().map(end).max() {
        Some(end) if end <= step => Ok(()),
        _ => Err(MessageError::FieldPlaces(step)),
    }
}

fn bytes(kind: i32) -> usize {
    if kind == FLOAT32 { 4 } else { 8 }
}

/// The points of whole steps; any remaining bytes are padding.
/// The points of a cloud; one at its origin is no measurement, as organized clouds have zeros
/// there.
fn points(data: &[u8], step: usize, fields: Fields) -> impl Iterator<Item = Point3<f64>> {
    let points = data.chunks_exact(step).map(move |point| {
        Point3::from(fields.map(|(offset, kind)| {
            let field = &point[offset..][..bytes(kind)];
            match (field.first_chunk::<4>(), field.first_chunk::<8>()) {
                (_, Some(&double)) => f64::from_le_bytes(double),
                (Some(&float), None) => f32::from_le_bytes(float).into(),
                (None, None) => f64::NAN,
            }
        }))
    });
    points.filter(|point| *point != Point3::origin())
}

fn pose(pose: Option<Pose>) -> MessageResult<Isometry3<f64>> {
    let Some(Pose {
        position,
        orientation,
    }) = pose
    else {
        return Ok(Isometry3::identity());
    };
    let p = position.unwrap_or_default();
    let rotation = match orientation {
        Some(q) if q.x != 0.0 || q.y != 0.0 || q.z != 0.0 || q.w != 0.0 => {
            UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, q.y, q.z))
        }
        // The quaternion was never set.
        _ => UnitQuaternion::identity(),
    };
    let pose = Isometry3::from_parts(Translation3::new(p.x, p.y, p.z), rotation);
    if pose
        .translation
        .vector
        .iter()
        .chain(pose.rotation.coords.iter())
        .all(|v| v.is_finite())
    {
        Ok(pose)
    } else {
        Err(Unsuited("its pose is not finite"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_at_the_sensor_is_none() {
        let numbers = [[0.0f32; 3], [1.0, 0.0, 0.0], [-0.0; 3]];
        let data: Vec<_> = numbers
            .as_flattened()
            .iter()
            .flat_map(|n| n.to_le_bytes())
            .collect();
        let fields = [(0, FLOAT32), (4, FLOAT32), (8, FLOAT32)];
        let found: Vec<_> = points(&data, 12, fields).collect();
        assert_eq!(found, [Point3::new(1.0, 0.0, 0.0)]);
    }
}
