//! Results of an algorithm as ROS 2 messages in CDR, for live topics and bags.

use super::cells::{AlgorithmCells, CellReport};
use super::result::PairResult;
use super::scan::scan;
use crate::message::ros::message::CdrWriter;
use crate::message::ros::result_message::{ResultMessage, ResultOptions};
use crate::message::ros::write::{encode, encode_32fc1, header_fields, image_fields};
use crate::message::wire::{Encoded, RosStamp};
use svl_core::Result;
use svl_core::stereo::{Frame, Plane, Rig};
use svl_files::pixel_points;

/// Fields of a point in [`cloud`].
type CloudPoint = [f32; 4];
/// `sensor_msgs/msg/PointField::FLOAT32`.
const FLOAT32: u8 = 7;
/// The value of pixels without a disparity: below the smallest disparity, as in image_pipeline.
const NO_DISPARITY: f32 = -1.0;

/// Topic and type of each message of a result, and of the status.
pub const RESULT_TOPICS: [(&str, &str); 4] = [
    ("points", "sensor_msgs/msg/PointCloud2"),
    ("scan", "sensor_msgs/msg/LaserScan"),
    ("disparity", "stereo_msgs/msg/DisparityImage"),
    ("depth", "sensor_msgs/msg/Image"),
];
pub const DIAGNOSTICS: (&str, &str) = ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray");

/// The messages of a result on the topics that are wanted: cloud, scan, disparities and depths.
/// Without a rig there are no distances, and so no messages.
///
/// # Errors
/// [`svl_core::Error::Invalid`] for stamps outside 1970 ..= 2038.
pub fn result_messages(
    frame: &Frame,
    result: &PairResult,
    options: &ResultOptions,
    is_wanted: impl Fn(&str) -> bool,
) -> Result<Vec<ResultMessage>> {
    let stamp = RosStamp::new(frame.stamp_ns)?;
    let Some(rig) = frame.rig() else {
        return Ok(Vec::new());
    };
    let (map, frame_id) = (&result.disparity, &options.frame_id);
    let size = frame.pair.size();
    let points = || {
        let (points, fourth) = if options.dense {
            (pixel_points(map, frame.pair.left(), rig), "intensity")
        } else {
            (cell_points(&result.cells, rig, size), "probability")
        };
        cloud(&points, fourth, stamp, frame_id)
    };
    let messages: [&dyn Fn() -> Encoded; 4] = [
        &points,
        &|| scan(result, rig, size, stamp, options),
        &|| disparity_image(result, rig, stamp, frame_id),
        &|| encode_32fc1(&depths(map, rig), stamp, frame_id),
    ];
    let messages = RESULT_TOPICS.into_iter().zip(messages);
    let wanted = messages.filter(|((topic, _), _)| is_wanted(topic));
    let made = wanted.map(|((topic, _), encode)| (topic, encode()));
    let message = |(topic, message)| ResultMessage { topic, message };
    Ok(made.map(message).collect())
}

/// A point per cell with a distance, at the centre of the cell, in the optical frame; and the
/// probability, NaN if the algorithm reports none.
fn cell_points(cells: &AlgorithmCells, rig: &Rig, size: (usize, usize)) -> Vec<CloudPoint> {
    let point = |cell: &CellReport| {
        let [x, y, z] = rig.point_m(cells.center_px(cell, size), cell.distance_m?);
        let probability = cell.probability.unwrap_or(f64::NAN);
        Some([x, y, z, probability].map(|value| value as f32))
    };
    cells.cells.iter().filter_map(point).collect()
}

/// A sensor_msgs/msg/PointCloud2 of x, y, z and a fourth field.
fn cloud(points: &[CloudPoint], fourth: &str, stamp: RosStamp, frame_id: &str) -> Encoded {
    let data = points.as_flattened();
    let data: Vec<u8> = data.iter().flat_map(|value| value.to_le_bytes()).collect();
    let body = |cdr: &mut CdrWriter| {
        header_fields(cdr, stamp, frame_id);
        cdr.u32(1);
        cdr.u32(points.len() as u32);
        let fields = ["x", "y", "z", fourth];
        cdr.length(fields.len());
        for (offset, name) in (0..).step_by(size_of::<f32>()).zip(fields) {
            cdr.str(name);
            cdr.u32(offset);
            cdr.u8(FLOAT32);
            cdr.u32(1);
        }
        cdr.u8(0);
        cdr.u32(size_of::<CloudPoint>() as u32);
        cdr.u32(data.len() as u32);
        cdr.bytes(&data);
        // Dense: all points are finite, NaN probabilities apart.
        cdr.u8(1);
    };
    let definition = include_str!("PointCloud2.msg");
    encode("sensor_msgs/msg/PointCloud2", definition, data.len(), body)
}

/// Depths in metres by REP 118: NaN for pixels without a possible disparity, `+∞` at infinity.
fn depths(map: &Plane<f32>, rig: &Rig) -> Plane<f32> {
    map.map(|d| {
        if d.is_finite() && rig.is_possible(d.into()) {
            rig.depth_m(d.into()).map_or(f32::INFINITY, |z| z as f32)
        } else {
            f32::NAN
        }
    })
}

/// A stereo_msgs/msg/DisparityImage, whose depth is `f · t / d`.
fn disparity_image(result: &PairResult, rig: &Rig, stamp: RosStamp, frame_id: &str) -> Encoded {
    let map = &result.disparity;
    let largest = map.pixels().filter(|d| d.is_finite()).fold(0.0, f32::max);
    let range_px = result.result.range_px.map_or(largest, |range| range as f32);
    // The message has no offset of the principal points.
    let doffs = rig.doffs_px() as f32;
    let value = |d: f32| {
        if d.is_finite() && rig.is_possible(d.into()) {
            (d + doffs).max(0.0)
        } else {
            NO_DISPARITY
        }
    };
    let (width, height) = map.size();
    let pixels = map.pixels().flat_map(|d| value(d).to_le_bytes());
    let pixels: Vec<u8> = pixels.collect();
    let body = |cdr: &mut CdrWriter| {
        header_fields(cdr, stamp, frame_id);
        header_fields(cdr, stamp, frame_id);
        image_fields(cdr, (width, height), "32FC1", &pixels);
        cdr.f32(rig.focal_px() as f32);
        cdr.f32(rig.baseline_m() as f32);
        // The window of valid pixels: all, as it says nothing of single ones.
        [0, 0, height as u32, width as u32]
            .into_iter()
            .for_each(|side| cdr.u32(side));
        cdr.u8(0);
        cdr.f32(0.0);
        cdr.f32(range_px + doffs);
        // The step of a disparity: matchers interpolate between whole pixels.
        cdr.f32(1.0 / 16.0);
    };
    let definition = include_str!("DisparityImage.msg");
    encode(
        "stereo_msgs/msg/DisparityImage",
        definition,
        pixels.len(),
        body,
    )
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
) -> Result<ResultMessage> {
    let stamp = RosStamp::new(stamp_ns)?;
    let body = |cdr: &mut CdrWriter| {
        header_fields(cdr, stamp, "");
        cdr.length(1);
        cdr.u8(level);
        for text in [name, message, ""] {
            cdr.str(text);
        }
        cdr.length(values.len());
        for (key, value) in values {
            cdr.str(key);
            cdr.str(value);
        }
    };
    // Live only, so that its definition has no reader.
    Ok(ResultMessage {
        topic: DIAGNOSTICS.0,
        message: encode(DIAGNOSTICS.1, "", 512, body),
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::result::AlgorithmResult;
    use super::*;
    use crate::message::ros;
    use svl_core::stereo::CellState;

    pub(crate) fn rig() -> Rig {
        Rig::new(100.0, (31.5, 15.5), 0.1, 2.0).unwrap()
    }

    /// A result of cells by rows from the top: a distance, infinity, or NaN for an unknown cell.
    pub(crate) fn result(rows: &[&[f64]], map: Plane<f32>) -> PairResult {
        let cell = |row, (column, &z): (usize, &f64)| CellReport {
            column,
            row,
            state: match z {
                f64::INFINITY => CellState::Far,
                z if z.is_nan() => CellState::Unknown,
                _ => CellState::Known,
            },
            distance_m: z.is_finite().then_some(z),
            disparity_px: None,
            probability: (z == 2.0).then_some(0.75),
            near_probability: None,
            near_distance_m: None,
            near_px: None,
            surface_probability: None,
            level: 0,
        };
        let rows_of_cells = rows.iter().enumerate();
        let cells = rows_of_cells.flat_map(|(row, cells)| {
            let cells = cells.iter().enumerate();
            cells.map(move |at| cell(row, at))
        });
        let algorithm = "bm".to_owned();
        PairResult {
            disparity: map,
            cells: AlgorithmCells {
                sequence: 0,
                algorithm: algorithm.clone(),
                columns: rows[0].len(),
                rows: rows.len(),
                cells: cells.collect(),
            },
            result: AlgorithmResult {
                sequence: 0,
                algorithm,
                hash: String::new(),
                pair_hash: String::new(),
                coverage: 1.0,
                row_offset_px: None,
                range_px: Some(64.0),
            },
        }
    }

    #[test]
    fn each_topic_has_its_type_and_only_what_is_wanted_is_made() {
        let image = svl_core::stereo::Gray::filled(64, 32, 7).unwrap();
        let pair = svl_core::stereo::StereoPair::new(image.clone(), image).unwrap();
        let geometry = svl_core::stereo::Geometry::Rectified(Some(rig()));
        let frame = Frame::new(pair, geometry);
        let result = result(&[&[2.0]], Plane::filled(64, 32, 5.0).unwrap());
        let options = ResultOptions::new("left");
        let made = |is_wanted: fn(&str) -> bool| -> Vec<_> {
            let messages = result_messages(&frame, &result, &options, is_wanted).unwrap();
            let found = messages.iter();
            found.map(|own| (own.topic, own.schema())).collect()
        };
        assert_eq!(made(|_| true), RESULT_TOPICS);
        assert_eq!(made(|topic| topic == "scan"), RESULT_TOPICS[1..2]);
    }

    #[test]
    fn a_cloud_has_a_point_per_cell_with_a_distance() {
        let map = Plane::filled(1, 1, 0.0).unwrap();
        let cells = result(&[&[2.0, f64::NAN], &[f64::INFINITY, 1.0]], map).cells;
        let points = cell_points(&cells, &rig(), (64, 32));
        assert_eq!(points.len(), 2);
        assert_eq!(points[0], [-0.32, -0.16, 2.0, 0.75]);
        assert_eq!(points[1][..3], [0.16, 0.08, 1.0]);
        assert!(points[1][3].is_nan());
        let stamp = RosStamp::new(5_000_000_007).unwrap();
        let data = cloud(&points, "probability", stamp, "left").data;
        let read = ros::read_cdr(&data, ros::point_cloud).unwrap();
        let places = [("x", 0), ("y", 4), ("z", 8), ("probability", 12)];
        assert_eq!(read.fields, places.map(|(name, at)| (name, at, 7)));
        assert_eq!((read.width, read.height, read.point_step), (2, 1, 16));
        assert_eq!((read.row_step, read.data.len()), (32, 32));
        assert_eq!(read.data[8..12], 2.0f32.to_le_bytes());
    }

    #[test]
    fn a_disparity_image_carries_the_offset_and_marks_what_is_unknown() {
        let map = Plane::from_vec(2, 1, vec![3.0, f32::INFINITY]).unwrap();
        let stamp = RosStamp::new(1).unwrap();
        let data = disparity_image(&result(&[&[1.0]], map), &rig(), stamp, "left").data;
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

    #[test]
    fn depths_tell_unknown_from_infinity() {
        let map = Plane::from_vec(4, 1, vec![3.0, -2.0, f32::INFINITY, -3.5]).unwrap();
        let found: Vec<_> = depths(&map, &rig()).pixels().collect();
        assert_eq!(found[..2], [2.0, f32::INFINITY]);
        // Unknown, and farther than infinity, which a wrong match or a wrong calibration is.
        assert!(found[2].is_nan() && found[3].is_nan());
    }
}
