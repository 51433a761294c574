//! Raw cameras of each distortion model beside the rectified rig that sees the same: the arena,
//! distorted by a lens and rectified again.

use super::super::cli::fixture::Fixture;
use nalgebra::{Isometry3, Point2, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};
use svl::arena::{Arena, ArenaConfig, FloorPattern};
use svl::calibrate::files;
use svl::calibrate::simulated::MovingBoard;
use svl::depth::{GridSettings, grid};
use svl::matcher::{Algorithm, MatchContext, MatchOutput};
use svl::rectify::{Framing, Rectifier, bouguet};
use svl::score::{Judge, Verdict};
use svl::stereo::{
    Cell, Distortion, DistortionModel, Estimate, Frame, Gray, Intrinsics, LengthUnit,
    Rectification, RectifiedPair, Rig, StereoCalibration, StereoPair,
};

const SIZE: (usize, usize) = (640, 480);
const BASELINE_M: f64 = 0.044;
/// Pixels of the perfect render for each pixel of the rectified images.
const OVERSAMPLING: usize = 3;
/// Samples of a raw pixel along each side.
const SAMPLES: usize = 3;

/// Column and row.
type Point = [u16; 2];

/// The arena of a rig, without noise.
fn arena((width, height): (usize, usize), field_of_view_deg: f64) -> Arena {
    let mut config = ArenaConfig::default();
    config.rig.width_px = width;
    config.rig.height_px = height;
    config.rig.field_of_view_deg = field_of_view_deg;
    config.rig.baseline_m = BASELINE_M;
    // So high that disparities differ little within a cell of the floor.
    config.rig.above_floor_m = 0.5;
    (config.rig.right_row_offset_px, config.rig.right_roll_deg) = (0.0, 0.0);
    (config.sensor.noise, config.sensor.right_gain_db) = (false, 0.0);
    config.world.floor_patterns = vec![FloorPattern::Noise];
    Arena::new(&config, 1).unwrap()
}

/// The place in the perfect image, if it is in it, of each sample of each pixel of a camera with a
/// lens. `turn`: from the camera's axes to the image's.
fn places(perfect: &Frame, camera: &Intrinsics, turn: &Rotation3<f64>) -> Vec<Option<Point>> {
    let (rig, (width, height)) = (perfect.rig().unwrap(), perfect.pair.size());
    let (focal, (cx, cy)) = (rig.focal_px(), rig.center_px());
    let place = |x: f64, y: f64| {
        let seen = camera.direction(Point2::new(x, y))?;
        let seen = turn * seen.push(1.0);
        let at = Vector2::new(focal * seen.x / seen.z + cx, focal * seen.y / seen.z + cy);
        let within = |v: f64, side: usize| (0.0..(side - 1) as f64).contains(&v);
        let inside = within(at.x, width) && within(at.y, height);
        (seen.z > 0.0 && inside).then(|| [at.x.round() as u16, at.y.round() as u16])
    };
    let sample = |i: usize| (i as f64 + 0.5) / SAMPLES as f64 - 0.5;
    let (columns, rows) = camera.size();
    (0..columns * rows * SAMPLES * SAMPLES)
        .map(|i| {
            let (pixel, i) = (i / (SAMPLES * SAMPLES), i % (SAMPLES * SAMPLES));
            let (x, y) = ((pixel % columns) as f64, (pixel / columns) as f64);
            place(x + sample(i % SAMPLES), y + sample(i / SAMPLES))
        })
        .collect()
}

/// The view of a camera with a lens, from a perfect, much larger image.
fn distorted(perfect: &Gray, places: &[Option<Point>], (width, height): (usize, usize)) -> Gray {
    let grey = |place: &Option<Point>| match place {
        Some([x, y]) => u32::from(perfect.get((*x).into(), (*y).into())),
        None => 0,
    };
    let count = SAMPLES * SAMPLES;
    let pixel = |x: usize, y: usize| {
        let samples = &places[(y * width + x) * count..][..count];
        let sum: u32 = samples.iter().map(grey).sum();
        (f64::from(sum) / count as f64 + 0.5) as u8
    };
    Gray::from_fn(width, height, pixel).unwrap()
}

/// The raw pair of a perfect one, which has the axes of the calibration's rectification.
fn raw(perfect: &Frame, calibration: &StereoCalibration) -> StereoPair {
    let by = calibration.rectification().unwrap();
    let view = |image, camera: &Intrinsics, turn| {
        distorted(image, &places(perfect, camera, turn), camera.size())
    };
    StereoPair::new(
        view(perfect.pair.left(), calibration.left(), &by.left),
        view(perfect.pair.right(), calibration.right(), &by.right),
    )
    .unwrap()
}

fn rectified(rectifier: &Rectifier, raw: &StereoPair) -> StereoPair {
    let [mut left, mut right] = [0; 2].map(|_| Gray::filled(1, 1, 0).unwrap());
    rectifier.apply(raw, &mut left, &mut right).unwrap();
    StereoPair::new(left, right).unwrap()
}

/// Small cells.
fn judge() -> Judge {
    let grid = GridSettings {
        columns: 12,
        rows: 9,
        ..GridSettings::default()
    };
    Judge {
        grid,
        ..Judge::default()
    }
}

/// The estimate of `sgm`, which has disparities nearly everywhere.
fn estimate(frame: &Frame) -> Estimate {
    let algorithm: Algorithm = "sgm".parse().unwrap();
    let judge = judge();
    let context = MatchContext::for_frame(frame, judge.grid, judge.cells);
    let mut output = MatchOutput::new().unwrap();
    let mut matcher = algorithm.build().unwrap();
    let pair = RectifiedPair::assume(&frame.pair);
    matcher.compute(pair, &context, &mut output).unwrap();
    let map = output.disparity.disparity();
    let own_grid = output.grid.take();
    Estimate {
        algorithm: String::new(),
        own_grid: own_grid.is_some(),
        grid: own_grid.unwrap_or_else(|| grid(map, judge.grid, frame.rig())),
        disparity: output.disparity,
        unfiltered: None,
        range_px: None,
        times: None,
    }
}

/// Right cells and cells with truth.
fn right(frame: Frame, estimate: Estimate) -> (usize, usize) {
    let judged = judge().judge(frame, vec![estimate]);
    let cells = judged.estimates[0].cells.as_ref().unwrap();
    let scored = cells.iter().filter(|cell| cell.verdict != Verdict::NoTruth);
    let right = scored.clone().filter(|cell| cell.verdict == Verdict::Right);
    (right.count(), scored.count())
}

/// True for the same state, and disparities within a pixel or 5 %.
fn is_alike(a: &Cell, b: &Cell) -> bool {
    match (a.depth, b.depth) {
        (Some(a), Some(b)) => {
            (a.median_px - b.median_px).abs() <= f32::max(1.0, 0.05 * b.median_px)
        }
        (None, None) => true,
        _ => false,
    }
}

fn camera(
    size: (usize, usize),
    focal: f64,
    center: (f64, f64),
    lens: impl Into<Distortion>,
) -> Intrinsics {
    Intrinsics::new(size, (focal, focal), center, lens).unwrap()
}

/// One pair, distorted by each model and rectified again, has the cells of the perfect pair.
#[test]
fn every_model_gives_the_cells_of_the_perfect_pair() {
    let field_of_view_deg = 60.0;
    const SIZE: (usize, usize) = (320, 240);
    let perfect = arena((SIZE.0 * OVERSAMPLING, SIZE.1 * OVERSAMPLING), 70.0);
    let small = arena(SIZE, field_of_view_deg);
    let rig = small.rig();
    let models: [(DistortionModel, &[f64]); 5] = [
        (DistortionModel::PlumbBob, &[-0.1, 0.02, 1e-3, -1e-3, 0.002]),
        (
            DistortionModel::RationalPolynomial,
            &[0.2, 0.05, 0.0, 0.0, 0.0, 0.3, 0.1, 0.01],
        ),
        (
            DistortionModel::RationalPolynomial,
            &[
                -0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2e-3, 0.0, -2e-3, 0.0,
            ],
        ),
        (
            DistortionModel::RationalPolynomial,
            &[
                -0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02, -0.01,
            ],
        ),
        (DistortionModel::Equidistant, &[0.01, -0.005, 0.0, 0.0]),
    ];
    let calibrations = [(None, &[][..])]
        .into_iter()
        .chain(models.map(|(model, d)| (Some(model), d)))
        .map(|(model, coefficients)| {
            let model = model.unwrap_or_default();
            let lens = model.with_coefficients(coefficients).unwrap();
            let camera = camera(SIZE, 0.95 * rig.focal_px(), rig.center_px(), lens);
            let apart = Isometry3::translation(-BASELINE_M, 0.0, 0.0);
            let unit = LengthUnit::Metres;
            let calibration = StereoCalibration::new(camera, camera, apart, unit).unwrap();
            calibration.with_rectification(Rectification {
                size: SIZE,
                left: Rotation3::identity(),
                right: Rotation3::identity(),
                rig,
            })
        });
    let calibrations: Vec<_> = calibrations.collect();
    let (mut alike, mut cells, mut known) = (vec![0; calibrations.len()], 0, 0);
    for index in [5, 150] {
        let (large, frame) = (perfect.frame(index).unwrap(), small.frame(index).unwrap());
        let estimates: Vec<_> = calibrations
            .iter()
            .map(|calibration| {
                let rectifier = Rectifier::new(calibration).unwrap();
                let camera = calibration.left();
                // Both cameras are the same.
                let places = places(&large, camera, &Rotation3::identity());
                let view = |image| distorted(image, &places, camera.size());
                let (left, right) = (view(large.pair.left()), view(large.pair.right()));
                let pair = rectified(&rectifier, &StereoPair::new(left, right).unwrap());
                estimate(&Frame {
                    pair,
                    ..frame.clone()
                })
            })
            .collect();
        // The first lens is ideal, and as sharp as the others.
        let first: Vec<_> = estimates[0].grid.iter().map(|(_, cell)| *cell).collect();
        known += first.iter().filter(|cell| cell.depth.is_some()).count();
        cells += first.len();
        for (alike, estimate) in alike.iter_mut().zip(&estimates) {
            let pairs = estimate.grid.iter().zip(&first);
            *alike += pairs.filter(|((_, a), b)| is_alike(a, b)).count();
        }
    }
    assert!(2 * known > cells, "{known} of {cells} known");
    for (calibration, alike) in calibrations.iter().zip(alike) {
        let share = alike as f64 / cells as f64;
        let lens = calibration.left().distortion();
        println!("{} {}: {share:.4}", lens.model(), lens.coefficients().len());
        assert!(share >= 0.97, "{}: {share}", lens.model());
    }
}

/// A rig of fisheyes of 150°, recorded raw, calibrated by `svl calibrate board` and rectified, sees
/// what the rectified rig sees.
#[test]
fn a_wide_rig_sees_what_its_rectified_rig_sees() {
    let focal = 244.0;
    let apart = Isometry3::from_parts(
        Translation3::new(-BASELINE_M, 0.0, 0.0),
        UnitQuaternion::from_scaled_axis(Vector3::new(0.004, -0.006, 0.003)),
    );
    let lens = Distortion::Equidistant([0.012, -0.008, 0.002, -0.0005]);
    let (left, right_camera) = (
        camera(SIZE, focal, (322.0, 237.5), lens),
        camera(SIZE, focal + 1.5, (317.0, 241.0), lens),
    );
    let truth = StereoCalibration::new(left, right_camera, apart, LengthUnit::Metres).unwrap();
    let by = bouguet(&truth, &Framing::default()).unwrap();
    let truth = truth.with_rectification(by);
    let (horizontal, _) = truth.left().field_of_view().unwrap();
    assert!(
        (148.0..152.0).contains(&horizontal.to_degrees()),
        "{horizontal}"
    );

    let fixture = Fixture::new();
    let board = MovingBoard::before(truth.clone(), 3).unwrap();
    std::fs::create_dir(fixture.path("pictures")).unwrap();
    for (number, index) in (0..24).map(|pose| pose * 8 + 1).enumerate() {
        let pair = board.pair(index).unwrap();
        for (side, image) in [("left", pair.left()), ("right", pair.right())] {
            let path = fixture.path(&format!("pictures/{side}{number:02}.png"));
            let (width, height) = image.size();
            let pixels: Vec<u8> = image.pixels().collect();
            svl::files::write_png(&path, width, height, &pixels).unwrap();
        }
    }
    let text = fixture
        .run("calibrate board pictures --square-m 0.03 --yes --model equidistant -o calib.yaml");
    println!("{text}");
    let calibration = files::read(&fixture.path("calib.yaml")).unwrap();
    let by = calibration.rectification().unwrap().clone();
    let field_of_view = 2.0 * (SIZE.0 as f64 / 2.0 / by.rig.focal_px()).atan();
    // The rectified rig, rendered directly. Its images are centred, which raw ones are nearly.
    let small = arena(SIZE, field_of_view.to_degrees());
    let (rig, centred) = (by.rig, small.rig().center_px());
    println!("rectified: {rig:?}");
    let rig = Rig::new(rig.focal_px(), centred, rig.baseline_m(), 0.0).unwrap();
    let rectifier = Rectifier::new(&calibration.with_rectification(Rectification { rig, ..by }));
    let rectifier = rectifier.unwrap();
    let large = arena((SIZE.0 * OVERSAMPLING, SIZE.1 * OVERSAMPLING), 130.0);
    // The ideal images are as sharp as the raw ones: sampled from the same render.
    let ideal = camera(SIZE, rig.focal_px(), centred, Distortion::NONE);
    let apart = Isometry3::translation(-BASELINE_M, 0.0, 0.0);
    let ideal = StereoCalibration::new(ideal, ideal, apart, LengthUnit::Metres).unwrap();
    let by = bouguet(&ideal, &Framing::default()).unwrap();
    let ideal = ideal.with_rectification(by);
    let (mut direct, mut from_raw) = ((0, 0), (0, 0));
    let add = |sum: &mut (usize, usize), (right, scored): (usize, usize)| {
        *sum = (sum.0 + right, sum.1 + scored);
    };
    for index in [10, 85, 160, 235]
        .into_iter()
        .step_by(crate::common::step(2))
    {
        let (frame, perfect) = (small.frame(index).unwrap(), large.frame(index).unwrap());
        let pairs = [
            raw(&perfect, &ideal),
            rectified(&rectifier, &raw(&perfect, &truth)),
        ];
        for (pair, sum) in pairs.into_iter().zip([&mut direct, &mut from_raw]) {
            let seen = Frame {
                pair,
                ..frame.clone()
            };
            let estimate = estimate(&seen);
            add(sum, right(seen, estimate));
        }
    }
    let share = |(right, scored): (usize, usize)| 100.0 * right as f64 / scored as f64;
    println!(
        "right: {:.2} % rendered, {:.2} % from raw",
        share(direct),
        share(from_raw)
    );
    assert!(
        (share(direct) - share(from_raw)).abs() < 2.0,
        "{direct:?} {from_raw:?}"
    );
}
