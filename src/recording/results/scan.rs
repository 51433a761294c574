//! The cells of a result as a planar scan, for navigation: obstacle, free, unknown.

use super::cells::{AlgorithmCells, CellReport};
use super::result::PairResult;
use crate::message::ros::message::CdrWriter;
use crate::message::ros::result_message::{ResultMessage, ResultOptions};
use crate::message::ros::write::{encode, encode_transforms, header_fields};
use crate::message::wire::{Encoded, FLOOR_FRAME, RosStamp};
use std::ops::Range;
use svl_core::Result;
use svl_core::stereo::{CellState, Pose, Rig};

/// `range_max`: obstacles are reported below it. Nav2 turns `+∞` into this range and marks an
/// obstacle there unless it is beyond its `obstacle_max_range`, by default 2.5 m.
const RANGE_MAX_M: f64 = 10.0;
/// Largest angle between two beams: 0.09 m at 5 m.
const STEP_RAD: f64 = 1.0_f64.to_radians();
/// Depth below the camera from which a point is of the floor, as a fraction of the camera's height:
/// distances of cells are right to a fifth.
const FLOOR: f64 = 0.8;
/// Part of a cell's height by which its centre may be below the camera, if the camera's height is
/// unknown.
const BELOW: f64 = 0.25;

/// The frame of the scan: x forward, y to the left, z up. The optical frame's name without
/// `_optical`, as camera drivers name it, or else with `_scan` after it.
fn scan_frame(frame_id: &str) -> String {
    if frame_id.contains("_optical") {
        frame_id.replacen("_optical", "", 1)
    } else {
        format!("{frame_id}_scan")
    }
}

/// The transforms from the optical frame on `/tf_static`, in one message, as its last one is that
/// of late subscribers: to the scan's frame, unless the camera's driver publishes it, and to the
/// floor below a level camera of that height. `None` if there are none.
///
/// # Errors
/// [`svl_core::Error::Invalid`] for stamps outside 1970 ..= 2038.
pub fn static_transforms(
    frame_id: &str,
    camera_height_m: Option<f64>,
    stamp_ns: u64,
) -> Result<Option<ResultMessage>> {
    // Forward, left and up of the child are z, -x and -y of the parent.
    let rotation = nalgebra::Quaternion::new(0.5, 0.5, -0.5, 0.5);
    let rotation = nalgebra::Unit::new_unchecked(rotation);
    let below = |m: f64| Pose::from_parts(nalgebra::Translation3::new(0.0, m, 0.0), rotation);
    let scan = scan_frame(frame_id);
    let to_scan = (scan.starts_with(frame_id)).then(|| (below(0.0), [frame_id, &scan]));
    let to_floor = camera_height_m.map(|height_m| (below(height_m), [frame_id, FLOOR_FRAME]));
    let transforms: Vec<_> = to_scan.into_iter().chain(to_floor).collect();
    let stamp = RosStamp::new(stamp_ns)?;
    Ok((!transforms.is_empty()).then(|| ResultMessage {
        topic: "/tf_static",
        message: encode_transforms(&transforms, stamp),
    }))
}

/// A sensor_msgs/msg/LaserScan of the cells that are not of the floor. A beam has the range of the
/// nearest known cell of its column; `+∞` if all its cells are known and none is nearer than
/// `range_max`; NaN otherwise, and if the search begins beyond `range_max`. A cell with something
/// near is unknown, or known at [`ResultOptions::near_m`]; of two surfaces the nearer counts, also
/// of an unknown cell. Intensities are the cells' probabilities, 0 if none is reported.
pub(crate) fn scan(
    result: &PairResult,
    rig: &Rig,
    size: (usize, usize),
    stamp: RosStamp,
    options: &ResultOptions,
) -> Encoded {
    let columns = Columns::new(&result.cells, rig, size, options);
    let angle = |x: f64| ((rig.center_px().0 - x) / rig.focal_px()).atan();
    // From the right edge of the image to the left one, as angles are counted.
    let (right, left) = (angle(size.0 as f64 - 0.5), angle(-0.5));
    let beams = ((left - right) / STEP_RAD).ceil().max(1.0);
    let step = (left - right) / beams;
    let nearest = result.result.range_px.and_then(|range| rig.depth_m(range));
    let range_min = nearest.unwrap_or(0.0).min(RANGE_MAX_M) as f32;
    // A rig that matches nothing nearer than the range's end sees nothing in it.
    let sees_range = nearest.is_none_or(|nearest| nearest < RANGE_MAX_M);
    let beam = |i: usize| {
        let angle = right + (i as f64 + 0.5) * step;
        let x = rig.center_px().0 - rig.focal_px() * angle.tan();
        if sees_range {
            columns.at(x).range(angle)
        } else {
            (f64::NAN, 0.0)
        }
    };
    let (ranges, intensities): (Vec<f64>, Vec<f64>) = (0..beams as usize).map(beam).unzip();
    let body = |cdr: &mut CdrWriter| {
        header_fields(cdr, stamp, &scan_frame(&options.frame_id));
        let [first, last] = [right + 0.5 * step, left - 0.5 * step];
        // All beams are of one moment.
        let numbers = [first, last, step, 0.0, 0.0].map(|number| number as f32);
        let numbers = numbers.into_iter().chain([range_min, RANGE_MAX_M as f32]);
        numbers.for_each(|number| cdr.f32(number));
        // A cell of the range's end is in range also after rounding; NaN stays NaN.
        let ranges = ranges.iter().map(|&range| range as f32);
        let ranges = ranges.map(|range| if range < range_min { range_min } else { range });
        cdr.length(ranges.len());
        ranges.for_each(|range| cdr.f32(range));
        cdr.length(intensities.len());
        let intensities = intensities.iter();
        intensities.for_each(|intensity| cdr.f32(*intensity as f32));
    };
    let definition = include_str!("LaserScan.msg");
    encode(
        "sensor_msgs/msg/LaserScan",
        definition,
        8 * ranges.len(),
        body,
    )
}

/// The columns of a grid, with their pixels.
struct Columns(Vec<(Range<usize>, Column)>);

/// The cells of a column that are not of the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Column {
    /// Depth and probability of the nearest obstacle.
    nearest: Option<(f64, f64)>,
    is_known: bool,
}

impl Columns {
    fn new(
        cells: &AlgorithmCells,
        rig: &Rig,
        size: (usize, usize),
        options: &ResultOptions,
    ) -> Self {
        let (camera_height_m, near_m) = (options.camera_height_m, options.near_m);
        let flagged_m = |cell: &CellReport| near_m.filter(|_| cell.state == CellState::Near);
        let column = |column: usize| {
            let own = cells.cells.iter().filter(|cell| cell.column == column);
            let rows = size.1 as f64 / cells.rows as f64;
            // Floor is known and free; what is below a camera of unknown height is not looked at.
            let is_looked_at = |cell: &&CellReport| {
                let below = cells.center_px(cell, size).1 - rig.center_px().1;
                camera_height_m.is_some() || below <= BELOW * rows
            };
            let obstacles = |cell: &CellReport| {
                let flagged_m = flagged_m(cell).filter(|_| cell.near_distance_m.is_none());
                let probability = cell.near_probability.or(cell.probability);
                let surfaces = [
                    (cell.distance_m.or(flagged_m), probability),
                    (cell.near_distance_m, cell.surface_probability),
                ];
                let center_px = cells.center_px(cell, size);
                surfaces.into_iter().filter_map(move |(z, probability)| {
                    let [_, below, _] = rig.point_m(center_px, z?);
                    let is_floor = camera_height_m.is_some_and(|height| below >= FLOOR * height);
                    (!is_floor).then_some((z?, probability.unwrap_or(0.0)))
                })
            };
            let looked_at: Vec<_> = own.filter(is_looked_at).collect();
            let obstacles = looked_at.iter().flat_map(|cell| obstacles(cell));
            let is_unknown = |cell: &&CellReport| {
                let is_possible = cell.disparity_px.is_none_or(|d| rig.is_possible(d.into()));
                let is_unknown = match cell.state {
                    CellState::Unknown => true,
                    CellState::Near => flagged_m(cell).is_none(),
                    _ => false,
                };
                is_unknown || !is_possible
            };
            let found = Column {
                nearest: obstacles.min_by(|a, b| a.0.total_cmp(&b.0)),
                is_known: !looked_at.is_empty() && !looked_at.iter().any(is_unknown),
            };
            (cells.shape().pixels((column, 0), size).0, found)
        };
        Self((0..cells.columns).map(column).collect())
    }

    /// The column with that pixel.
    fn at(&self, x: f64) -> Column {
        let pixel = (x + 0.5).max(0.0) as usize;
        let found = self.0.iter().find(|(pixels, _)| pixel < pixels.end);
        found
            .or(self.0.last())
            .map_or(Column::UNKNOWN, |(_, column)| *column)
    }
}

impl Column {
    const UNKNOWN: Self = Self {
        nearest: None,
        is_known: false,
    };

    /// Range and intensity of a beam.
    fn range(self, angle: f64) -> (f64, f64) {
        let range = self
            .nearest
            .map(|(z, probability)| (z / angle.cos(), probability));
        match range.filter(|(range, _)| *range < RANGE_MAX_M) {
            Some(obstacle) => obstacle,
            None if self.is_known => (f64::INFINITY, 0.0),
            None => (f64::NAN, 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::ros_messages::{tests::result, tests::rig};
    use super::*;
    use crate::message::ros;
    use svl_core::stereo::Plane;

    const SIZE: (usize, usize) = (64, 32);

    fn scanned(rows: &[&[f64]], camera_height_m: Option<f64>) -> ros::RosScan {
        let result = result(rows, Plane::filled(1, 1, 0.0).unwrap());
        scan_of(&result, camera_height_m)
    }

    fn scan_of(result: &PairResult, camera_height_m: Option<f64>) -> ros::RosScan {
        let options = ResultOptions {
            camera_height_m,
            ..ResultOptions::new("cam_optical_frame")
        };
        let data = scan(result, &rig(), SIZE, RosStamp::new(1).unwrap(), &options).data;
        let header = ros::read_cdr(&data, |cdr| Ok(ros::header(cdr)?.frame_id.to_owned()));
        assert_eq!(header.unwrap(), "cam_frame");
        ros::read_cdr(&data, ros::laser_scan).unwrap()
    }

    #[test]
    fn a_flagged_cell_is_an_obstacle_if_that_is_asked_for() {
        let mut result = result(&[&[2.0, f64::NAN]], Plane::filled(1, 1, 0.0).unwrap());
        result.cells.cells[1].state = CellState::Near;
        result.cells.cells[1].near_probability = Some(0.9);
        let scan_of = |near_m| {
            let options = ResultOptions {
                near_m,
                ..ResultOptions::new("cam_optical_frame")
            };
            let data = scan(&result, &rig(), SIZE, RosStamp::new(1).unwrap(), &options).data;
            ros::read_cdr(&data, ros::laser_scan).unwrap().ranges[0]
        };
        assert!(scan_of(None).is_nan());
        assert!((0.5..0.55).contains(&scan_of(Some(0.5))));
    }

    #[test]
    fn the_nearer_of_two_surfaces_is_an_obstacle_also_of_an_unknown_cell() {
        let mut result = result(&[&[2.0, f64::NAN]], Plane::filled(1, 1, 0.0).unwrap());
        for (cell, near_m) in result.cells.cells.iter_mut().zip([1.25, 0.4]) {
            cell.near_distance_m = Some(near_m);
            cell.surface_probability = Some(0.9);
        }
        // It stands in for the flag, too.
        for state in [CellState::Unknown, CellState::Near] {
            result.cells.cells[1].state = state;
            let options = ResultOptions {
                near_m: Some(0.2),
                ..ResultOptions::new("cam_optical_frame")
            };
            let data = scan(&result, &rig(), SIZE, RosStamp::new(1).unwrap(), &options).data;
            let ranges = ros::read_cdr(&data, ros::laser_scan).unwrap().ranges;
            let ends = [ranges[0], ranges[ranges.len() - 1]];
            assert!((0.4..0.45).contains(&ends[0]), "{ends:?}");
            assert!((1.25..1.35).contains(&ends[1]), "{ends:?}");
        }
    }

    #[test]
    fn a_beam_is_an_obstacle_free_or_unknown() {
        // Four columns; the beams are counted from the right.
        let rows: [&[f64]; 2] = [
            &[2.0, f64::INFINITY, f64::NAN, 30.0],
            &[1.0, 40.0, 3.0, f64::NAN],
        ];
        let scan = scanned(&rows, Some(100.0));
        assert_eq!(scan.range_max, RANGE_MAX_M);
        // 100 px · 0.1 m / (64 + 2) px.
        assert!((scan.range_min - 10.0 / 66.0).abs() < 1e-6);
        let n = scan.ranges.len();
        assert_eq!(n, (2.0 * 0.32_f64.atan() / STEP_RAD).ceil() as usize);
        assert!(scan.ranges[0].is_nan() && scan.angle_min < 0.0);
        let last = scan.angle_min + (n - 1) as f64 * scan.angle_increment;
        assert!((last + scan.angle_min).abs() < 1e-5, "symmetric");
        // The wall of a cell is perpendicular to the optical axis.
        assert!((scan.ranges[n - 1] - 1.0 / last.cos()).abs() < 1e-5);
        let of_column = |column: f64| scan.ranges[((3.5 - column) / 4.0 * n as f64) as usize];
        assert_eq!(of_column(1.0), f64::INFINITY);
        // An obstacle beside an unknown cell.
        assert!((3.0..3.1).contains(&of_column(2.0)));
    }

    #[test]
    fn nothing_is_free_that_the_search_cannot_see() {
        let free: [&[f64]; 1] = [&[f64::INFINITY]];
        let result = result(&free, Plane::filled(1, 1, 0.0).unwrap());
        let ranges = |result: &PairResult| scan_of(result, Some(1.0)).ranges;
        assert!(ranges(&result).iter().all(|range| *range == f64::INFINITY));
        // A disparity more than a pixel beyond infinity, which is at -2, is a wrong match.
        let mut wrong = result.clone();
        for (disparity, is_unknown) in [(-2.5, false), (-3.5, true)] {
            wrong.cells.cells[0].disparity_px = Some(disparity);
            let are_unknown = ranges(&wrong).iter().all(|range| range.is_nan());
            assert_eq!(are_unknown, is_unknown, "{disparity}");
        }
        // 10 m are 1 px with an offset of 2: a search up to -1.5 px begins at 20 m.
        let mut far = result;
        far.result.range_px = Some(-1.5);
        let scan = scan_of(&far, Some(1.0));
        assert!(scan.ranges.iter().all(|range| range.is_nan()));
        assert!(scan.range_min <= scan.range_max);
    }

    #[test]
    fn floor_is_no_obstacle_and_what_is_below_the_camera_needs_its_height() {
        // The centre of the lower cell is 8 px below the optical axis: 0.16 m at 2 m.
        let rows: [&[f64]; 2] = [&[5.0], &[2.0]];
        let middle = |height| {
            let ranges = scanned(&rows, height).ranges;
            ranges[ranges.len() / 2].round()
        };
        assert_eq!(middle(None), 5.0);
        assert_eq!(middle(Some(0.3)), 2.0);
        assert_eq!(middle(Some(0.17)), 5.0);
    }

    #[test]
    fn a_frame_that_no_driver_has_is_published() {
        let none = static_transforms("cam_optical_frame", None, 1);
        assert!(none.unwrap().is_none());
        let sent = static_transforms("stereo_left", Some(0.3), 1);
        let data = sent.unwrap().unwrap().into_data();
        let read = ros::read_cdr(&data, ros::transforms).unwrap();
        let (_, (_, floor, place, _)) = &read[1];
        assert_eq!((&**floor, *place), ("base_footprint", [0.0, 0.3, 0.0]));
        let (_, (parent, child, _, [x, y, z, w])) = &read[0];
        assert_eq!([parent, child], ["stereo_left", "stereo_left_scan"]);
        let rotation = nalgebra::Quaternion::new(*w, *x, *y, *z);
        let rotation = nalgebra::Unit::new_normalize(rotation);
        // Forward is z of the optical frame, up is -y.
        let axes = [nalgebra::Vector3::x(), nalgebra::Vector3::z()].map(|axis| rotation * axis);
        assert!((axes[0] - nalgebra::Vector3::z()).norm() < 1e-12);
        assert!((axes[1] + nalgebra::Vector3::y()).norm() < 1e-12);
    }
}
