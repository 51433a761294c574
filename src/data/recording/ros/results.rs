//! Results of an algorithm as ROS 2 messages in CDR, for live topics.

use super::write::{Cdr, encode_body, header_fields, image_fields};
use crate::recording::RosStamp;
use svl_core::Result;
use svl_core::stereo::{DepthGrid, Estimate, Frame, Plane, Rig};

/// A message for a live topic.
pub struct LiveMessage {
    /// Last part of the topic's name.
    pub topic: &'static str,
    /// As in a bag: `sensor_msgs/msg/PointCloud2`.
    pub schema: &'static str,
    /// In CDR, with its encapsulation header.
    pub data: Vec<u8>,
}

/// Fields of a point in [`cloud`], 32-bit floats.
const FIELDS: [&str; 4] = ["x", "y", "z", "probability"];
/// `sensor_msgs/msg/PointField::FLOAT32`.
const FLOAT32: u8 = 7;
/// The value of pixels without a disparity: below the smallest disparity, as in image_pipeline.
const NO_DISPARITY: f32 = -1.0;

/// The messages of an estimate: cloud and disparities, in the optical frame `frame_id` of the left
/// camera. Without a rig there are no distances, and so no messages.
///
/// # Errors
/// [`svl_core::Error::Invalid`] for stamps outside 1970 ..= 2038.
pub fn result_messages(
    frame: &Frame,
    estimate: &Estimate,
    frame_id: &str,
) -> Result<Vec<LiveMessage>> {
    let stamp = RosStamp::new(frame.stamp_ns)?;
    let Some(rig) = frame.rig() else {
        return Ok(Vec::new());
    };
    let points = points(&estimate.grid, rig, frame.pair.size());
    let range_px = estimate.range_px.unwrap_or(0.0) as f32;
    let map = estimate.disparity.disparity();
    Ok(vec![
        LiveMessage {
            topic: "points",
            schema: "sensor_msgs/msg/PointCloud2",
            data: cloud(&points, stamp, frame_id),
        },
        LiveMessage {
            topic: "disparity",
            schema: "stereo_msgs/msg/DisparityImage",
            data: disparity_image(map, rig, range_px, stamp, frame_id),
        },
    ])
}

/// A point per cell with a distance, at the centre of the cell: x to the right, y down, z forward,
/// metres, and the probability, NaN if the algorithm reports none.
fn points(grid: &DepthGrid, rig: &Rig, size: (usize, usize)) -> Vec<[f32; 4]> {
    let (cx, cy) = rig.center_px();
    let point = |(place, cell): ((usize, usize), &svl_core::stereo::Cell)| {
        let z = cell.depth?.distance_m?;
        let (columns, rows) = grid.shape().pixels(place, size);
        let middle = |range: std::ops::Range<usize>| (range.start + range.end) as f64 / 2.0 - 0.5;
        let along = |pixel: f64, center: f64| (pixel - center) / rig.focal_px() * z;
        let probability = cell.probability.unwrap_or(f64::NAN);
        let [x, y] = [along(middle(columns), cx), along(middle(rows), cy)];
        Some([x, y, z, probability].map(|value| value as f32))
    };
    grid.iter().filter_map(point).collect()
}

/// A sensor_msgs/msg/PointCloud2.
fn cloud(points: &[[f32; FIELDS.len()]], stamp: RosStamp, frame_id: &str) -> Vec<u8> {
    let data = points.as_flattened();
    let data: Vec<u8> = data.iter().flat_map(|value| value.to_le_bytes()).collect();
    encode_body(data.len() + 128, |cdr| {
        header_fields(cdr, stamp, frame_id);
        cdr.write_u32(1);
        cdr.write_u32(points.len() as u32);
        cdr.write_sequence_length(FIELDS.len());
        for (offset, name) in (0..).step_by(size_of::<f32>()).zip(FIELDS) {
            cdr.write_string(name);
            cdr.write_u32(offset);
            cdr.write_u8(FLOAT32);
            cdr.write_u32(1);
        }
        cdr.write_bool(false);
        cdr.write_u32(size_of::<[f32; FIELDS.len()]>() as u32);
        cdr.write_u32(data.len() as u32);
        cdr.write_bytes(&data);
        // Dense: all points are finite, NaN probabilities apart.
        cdr.write_bool(true);
    })
}

/// A stereo_msgs/msg/DisparityImage, whose depth is `f · t / d`.
fn disparity_image(
    map: &Plane<f32>,
    rig: &Rig,
    range_px: f32,
    stamp: RosStamp,
    frame_id: &str,
) -> Vec<u8> {
    // The message has no offset of the principal points.
    let doffs = rig.doffs_px() as f32;
    let value = |d: f32| {
        if d.is_finite() {
            d + doffs
        } else {
            NO_DISPARITY
        }
    };
    let (width, height) = map.size();
    let pixels = map.pixels().flat_map(|d| value(d).to_le_bytes());
    let pixels: Vec<u8> = pixels.collect();
    encode_body(pixels.len() + 256, |cdr| {
        header_fields(cdr, stamp, frame_id);
        header_fields(cdr, stamp, frame_id);
        image_fields(cdr, (width, height), "32FC1", &pixels);
        cdr.write_f32(rig.focal_px() as f32);
        cdr.write_f32(rig.baseline_m() as f32);
        // The window of valid pixels: all, as it says nothing of single ones.
        [0, 0, height as u32, width as u32]
            .into_iter()
            .for_each(|side| cdr.write_u32(side));
        cdr.write_bool(false);
        cdr.write_f32(0.0);
        cdr.write_f32(range_px + doffs);
        // The step of a disparity: matchers interpolate between whole pixels.
        cdr.write_f32(1.0 / 16.0);
    })
}

/// A diagnostic_msgs/msg/DiagnosticArray of one status. `level`: 0 is fine, 1 a warning, 2 an
/// error, 3 stale.
///
/// # Errors
/// [`svl_core::Error::Invalid`] for stamps outside 1970 ..= 2038.
pub fn diagnostics(
    stamp_ns: u64,
    level: u8,
    name: &str,
    message: &str,
    values: &[(&str, String)],
) -> Result<LiveMessage> {
    let stamp = RosStamp::new(stamp_ns)?;
    let body = |cdr: &mut Cdr| {
        header_fields(cdr, stamp, "");
        cdr.write_sequence_length(1);
        cdr.write_u8(level);
        for text in [name, message, ""] {
            cdr.write_string(text);
        }
        cdr.write_sequence_length(values.len());
        for (key, value) in values {
            cdr.write_string(key);
            cdr.write_string(value);
        }
    };
    Ok(LiveMessage {
        topic: "/diagnostics",
        schema: "diagnostic_msgs/msg/DiagnosticArray",
        data: encode_body(512, body),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::ros;
    use svl_core::stereo::{Cell, CellDepth, GridShape};

    fn rig() -> Rig {
        Rig::new(100.0, (31.5, 15.5), 0.1, 2.0).unwrap()
    }

    fn grid() -> DepthGrid {
        let known = |distance_m, probability| Cell {
            valid_share: 1.0,
            depth: Some(CellDepth {
                median_px: 3.0,
                p20_px: 3.0,
                p80_px: 3.0,
                distance_m,
            }),
            probability,
            evidence: None,
            too_close: false,
        };
        let unknown = Cell {
            depth: None,
            ..known(None, None)
        };
        let shape = GridShape {
            columns: 2,
            rows: 2,
        };
        let cells = vec![known(Some(2.0), Some(0.75)), unknown, known(None, None)];
        let cells = [cells, vec![known(Some(1.0), None)]].concat();
        DepthGrid::new(shape, cells).unwrap()
    }

    #[test]
    fn a_cloud_has_a_point_per_cell_with_a_distance() {
        let points = points(&grid(), &rig(), (64, 32));
        assert_eq!(points.len(), 2);
        assert_eq!(points[0], [-0.32, -0.16, 2.0, 0.75]);
        assert_eq!(points[1][..3], [0.16, 0.08, 1.0]);
        assert!(points[1][3].is_nan());
        let data = cloud(&points, RosStamp::new(5_000_000_007).unwrap(), "left");
        let read = ros::read_cdr(&data, ros::point_cloud).unwrap();
        let fields = [
            ("x", 0, 7),
            ("y", 4, 7),
            ("z", 8, 7),
            ("probability", 12, 7),
        ];
        assert_eq!(read.fields, fields);
        assert_eq!((read.width, read.height, read.point_step), (2, 1, 16));
        assert_eq!((read.row_step, read.data.len()), (32, 32));
        assert_eq!(read.data[8..12], 2.0f32.to_le_bytes());
    }

    #[test]
    fn a_disparity_image_carries_the_offset_and_marks_what_is_unknown() {
        let map = Plane::from_vec(2, 1, vec![3.0, f32::INFINITY]).unwrap();
        let stamp = RosStamp::new(1).unwrap();
        let data = disparity_image(&map, &rig(), 64.0, stamp, "left");
        let (image, f, t, max) = ros::read_cdr(&data, |cdr| {
            ros::header(cdr)?;
            let (_, image) = ros::image(cdr)?;
            let (f, t) = (cdr.f32()?, cdr.f32()?);
            let window = [(); 4].map(|()| cdr.u32());
            assert_eq!(window.map(|side| side.unwrap()), [0, 0, 1, 2]);
            let (_, min, max) = (cdr.u8()?, cdr.f32()?, cdr.f32()?);
            assert_eq!(min, 0.0);
            Ok((image, f, t, max))
        })
        .unwrap();
        assert_eq!((image.width, image.height, image.encoding), (2, 1, "32FC1"));
        let expected = [5.0f32, NO_DISPARITY].map(f32::to_le_bytes).concat();
        assert_eq!(image.data, expected);
        assert_eq!((f, t, max), (100.0, 0.1, 66.0));
        // The depth of the message is that of the rig.
        assert_eq!(f * t / 5.0, rig().depth_m(3.0).unwrap() as f32);
    }
}
