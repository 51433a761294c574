//! Distortion models beside OpenCV's: points, rectification maps and images of random cameras.
//!
//! Prints the largest differences and the times of the maps by model, docs/results/cameras.md:
//! `cargo test --release --test lean distortion -- --nocapture`.

use crate::common;
use fastrand::Rng;
use nalgebra::{Isometry3, Point2, Rotation3, Vector2, Vector3};
use std::fmt::Write;
use std::time::Instant;
use svl_core::rectify::Rectifier;
use svl_core::stereo::{
    DistortionModel, Gray, Intrinsics, LengthUnit, Rectification, Rig, StereoCalibration,
    StereoPair,
};

const SIZE: (usize, usize) = (640, 480);
const POINTS: usize = 200;

/// A model of the table, and its number of coefficients.
const MODELS: [(DistortionModel, usize); 6] = [
    (DistortionModel::PlumbBob, 4),
    (DistortionModel::PlumbBob, 5),
    (DistortionModel::RationalPolynomial, 8),
    (DistortionModel::RationalPolynomial, 12),
    (DistortionModel::RationalPolynomial, 14),
    (DistortionModel::Equidistant, 4),
];

struct Case {
    camera: Intrinsics,
    rotation: Rotation3<f64>,
    rig: Rig,
    /// Radius at which the model ends.
    fold: f64,
    directions: Vec<Vector2<f64>>,
}

fn uniform(rng: &mut Rng, most: f64) -> f64 {
    most * (2.0 * rng.f64() - 1.0)
}

impl Case {
    /// A random camera whose model does not fold inside the image.
    fn new(rng: &mut Rng, model: DistortionModel, count: usize) -> Self {
        let camera = loop {
            let most: &[f64] = match model {
                // Fields of view of 100° to 180°.
                DistortionModel::Equidistant => &[0.05, 0.02, 0.005, 0.001],
                _ => &[
                    0.3, 0.1, 0.002, 0.002, 0.02, 0.3, 0.1, 0.02, 0.002, 0.001, 0.002, 0.001, 0.03,
                    0.03,
                ],
            };
            let coefficients: Vec<_> = most[..count].iter().map(|v| uniform(rng, *v)).collect();
            let lens = model.with_coefficients(&coefficients).unwrap();
            let focal = match model {
                DistortionModel::Equidistant => 200.0 + 160.0 * rng.f64(),
                _ => 400.0 + 400.0 * rng.f64(),
            };
            let center = (319.5 + uniform(rng, 15.0), 239.5 + uniform(rng, 15.0));
            let camera = Intrinsics::new(SIZE, (focal, focal * 1.01), center, lens).unwrap();
            let (_, farthest) = camera.side_distances_px();
            if camera.fold_px(farthest).is_none() {
                break camera;
            }
        };
        let rotation = Rotation3::from_euler_angles(
            uniform(rng, 0.05),
            uniform(rng, 0.05),
            uniform(rng, 0.05),
        );
        let rig = Rig::new(0.8 * camera.focal_px().0, (319.5, 239.5), 0.1, 0.0).unwrap();
        let fold = camera.distortion().max_radius();
        let mut directions = Vec::new();
        while directions.len() < POINTS {
            let pixel = Point2::new(rng.f64() * 639.0, rng.f64() * 479.0);
            let direction = camera.direction(pixel);
            directions
                .extend(direction.filter(|direction| direction.norm() < 0.95 * fold.min(5.0)));
        }
        Self {
            camera,
            rotation,
            rig,
            fold,
            directions,
        }
    }

    fn text(&self) -> String {
        let Self {
            camera,
            rotation,
            rig,
            directions,
            ..
        } = self;
        let ((fx, fy), (cx, cy)) = (camera.focal_px(), camera.center_px());
        let (width, height) = camera.size();
        let numbers = |values: &mut dyn Iterator<Item = f64>| {
            values.map(|v| format!("{v:e} ")).collect::<String>()
        };
        let mut text = format!("{}\n{width} {height}\n", camera.distortion().model());
        let (x, y) = rig.center_px();
        let rows: [&mut dyn Iterator<Item = f64>; 5] = [
            &mut [fx, fy, cx, cy].into_iter(),
            &mut camera.distortion().coefficients().iter().copied(),
            &mut rotation
                .matrix()
                .transpose()
                .as_slice()
                .to_vec()
                .into_iter(),
            &mut [rig.focal_px(), x, y].into_iter(),
            &mut directions.iter().flat_map(|p| [p.x, p.y]),
        ];
        for row in rows {
            writeln!(text, "{}", numbers(row)).unwrap();
        }
        text
    }

    /// The camera beside itself, rectified as the case says.
    fn rectifier(&self) -> Rectifier {
        let apart = Isometry3::translation(-0.1, 0.0, 0.0);
        let unit = LengthUnit::Metres;
        let calibration = StereoCalibration::new(self.camera, self.camera, apart, unit).unwrap();
        let rectification = Rectification {
            size: SIZE,
            left: self.rotation,
            right: self.rotation,
            rig: self.rig,
        };
        Rectifier::new(&calibration.with_rectification(rectification)).unwrap()
    }

    /// The source of a rectified pixel; `None` behind the camera or beyond the model.
    fn source(&self, x: f64, y: f64) -> Option<Point2<f64>> {
        let (focal, (cx, cy)) = (self.rig.focal_px(), self.rig.center_px());
        let seen = self.rotation.inverse() * Vector3::new((x - cx) / focal, (y - cy) / focal, 1.0);
        let direction = seen.xy() / seen.z;
        (seen.z > 0.0 && direction.norm() < 0.99 * self.fold).then(|| self.camera.pixel(direction))
    }
}

/// Largest differences from OpenCV.
#[derive(Debug, Default)]
struct Differences {
    pixel_px: f64,
    direction_px: f64,
    map_px: f64,
    grey: f64,
}

impl std::fmt::Display for Differences {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            pixel_px,
            direction_px,
            map_px,
            grey,
        } = self;
        write!(
            f,
            "pixels {pixel_px:.1e} px, directions {direction_px:.1e} px, maps {map_px:.1e} px, \
             images {grey} grey"
        )
    }
}

impl Differences {
    fn add(&mut self, case: &Case, mut expected: impl FnMut(usize) -> Vec<f64>) {
        let raise = |most: &mut f64, value: f64| *most = most.max(value);
        let points = |values: Vec<f64>| {
            let points = values.as_chunks::<2>().0.iter();
            points.map(|[x, y]| Point2::new(*x, *y)).collect::<Vec<_>>()
        };
        let pixels = points(expected(2 * POINTS));
        let back = points(expected(2 * POINTS));
        for ((direction, pixel), back) in case.directions.iter().zip(&pixels).zip(&back) {
            raise(
                &mut self.pixel_px,
                (case.camera.pixel(*direction) - pixel).norm(),
            );
            let found = case.camera.direction(*pixel).unwrap();
            let off = (found - back.coords).norm() * case.camera.focal_px().0;
            raise(&mut self.direction_px, off);
        }
        let (width, height) = SIZE;
        let [x, y, image] = [0; 3].map(|_| expected(width * height));
        let raw = Gray::from_fn(width, height, |x, y| {
            let wave = (x as f64 / 25.0).sin() + (y as f64 / 20.0).cos();
            (127.0 + 60.0 * wave).round_ties_even() as u8
        });
        let raw = raw.unwrap();
        let pair = StereoPair::new(raw.clone(), raw).unwrap();
        let [mut left, mut right] = [0; 2].map(|_| Gray::filled(width, height, 0).unwrap());
        case.rectifier()
            .apply(&pair, &mut left, &mut right)
            .unwrap();
        for (at, grey) in left.pixels().enumerate() {
            let Some(source) = case.source((at % width) as f64, (at / width) as f64) else {
                continue;
            };
            raise(
                &mut self.map_px,
                (source - Point2::new(x[at], y[at])).norm(),
            );
            // At the border, OpenCV mixes the image with the black around it.
            let inside = |v: f64, side: usize| (0.0..=(side - 1) as f64).contains(&v);
            if inside(source.x, width) && inside(source.y, height) {
                raise(&mut self.grey, (f64::from(grey) - image[at]).abs());
            }
        }
    }
}

#[test]
fn models_are_those_of_opencv() {
    let folder = tempfile::tempdir().unwrap();
    for (model, count) in MODELS {
        let rng = &mut Rng::with_seed(count as u64);
        let cases: Vec<_> = (0..if common::is_nightly() { 200 } else { 8 })
            .map(|_| Case::new(rng, model, count))
            .collect();
        let files = ["cases", "out"].map(|name| folder.path().join(name));
        std::fs::write(&files[0], cases.iter().map(Case::text).collect::<String>()).unwrap();
        let Some(printed) = common::python("distortion.py", "cv2, numpy", &files) else {
            return;
        };
        let bytes = std::fs::read(&files[1]).unwrap();
        let mut numbers = bytes
            .as_chunks::<8>()
            .0
            .iter()
            .map(|b| f64::from_le_bytes(*b));
        let mut found = Differences::default();
        let mut map_ms = f64::MAX;
        for case in &cases {
            found.add(case, |count| numbers.by_ref().take(count).collect());
            let begin = Instant::now();
            let _ = case.rectifier();
            // Tables of both images.
            map_ms = map_ms.min(begin.elapsed().as_secs_f64() * 500.0);
        }
        let printed = String::from_utf8(printed).unwrap();
        let opencv_ms = printed.lines().map(|line| line.parse::<f64>().unwrap());
        let opencv_ms = opencv_ms.fold(f64::MAX, f64::min);
        println!("{model} {count}: {found}, map {map_ms:.1} ms, OpenCV's {opencv_ms:.1} ms");
        assert!(
            found.pixel_px < 1e-6
                && found.direction_px < 1e-6
                && found.map_px < 1e-3
                && found.grey <= 1.0,
            "{model} {count}: {found:?}"
        );
    }
}
