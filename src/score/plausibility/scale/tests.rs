use super::*;
use crate::judge::Judge;
use svl_core::depth;
use svl_core::stereo::{
    DisparityMap, Estimate, ExtraPlanes, Geometry, Gray, GridShape, MapDensity, Plane, RecordedMap,
    Rig, StereoPair,
};

const SIZE: (usize, usize) = (64, 64);

/// Disparities from 8 to 27 px, never the same in two rows.
fn true_px(x: usize, y: usize) -> f32 {
    8.0 + (x + 2 * y) as f32 / 10.0
}

fn rig() -> Rig {
    Rig::new(50.0, (32.0, 32.0), 0.1, 0.0).unwrap()
}

fn estimate(algorithm: &str, px: impl Fn(usize, usize) -> f32) -> Estimate {
    let mut disparity = DisparityMap::new(SIZE.0, SIZE.1).unwrap();
    disparity.resize(SIZE.0, SIZE.1, ExtraPlanes::NONE).unwrap();
    for (y, mut row) in disparity.rows_mut().enumerate() {
        (0..SIZE.0).for_each(|x| row.accept(x, px(x, y)));
    }
    let grid = depth::grid(disparity.disparity(), GridShape::default().into(), None);
    Estimate {
        algorithm: algorithm.to_owned(),
        disparity,
        grid,
        own_grid: false,
        unfiltered: None,
        range_px: None,
        times: None,
    }
}

/// The words of doubts, whose values are none of the usual ones.
fn words(doubts: &[Doubt]) -> Vec<String> {
    assert!(doubts.iter().all(Doubt::is_unusual), "{doubts:?}");
    doubts.iter().map(Doubt::to_string).collect()
}

/// The doubt about a truth in a file, against two algorithms with an error of a pixel.
fn doubt(name: &str, truth: impl Fn(f32) -> f32, others: Vec<Estimate>) -> Option<String> {
    let image = Gray::filled(SIZE.0, SIZE.1, 0).unwrap();
    let pair = StereoPair::new(image.clone(), image).unwrap();
    let disparity = Plane::from_fn(SIZE.0, SIZE.1, |x, y| truth(true_px(x, y))).unwrap();
    let frame = Frame {
        truth: Some(Truth::measured(
            disparity,
            MapDensity::Dense,
            TruthOrigin::Sensor(name.to_owned()),
        )),
        ..Frame::new(pair, Geometry::Rectified(Some(rig())))
    };
    let mut estimates = vec![
        estimate("v3", |x, y| true_px(x, y).round()),
        // A third is wrong.
        estimate("bm", |x, y| {
            if (x + y) % 3 == 0 {
                60.0
            } else {
                true_px(x, y) + 0.5
            }
        }),
    ];
    estimates.extend(others);
    let mut scales = TruthScales::default();
    scales.observe(&Judge::default().judge(frame, estimates));
    words(&scales.measured().doubts()).pop()
}

#[test]
fn a_constant_factor_is_named_with_the_unit_that_cures_it() {
    let doubt = |name: &str, factor: f32| doubt(name, |d| d / factor, Vec::new());
    assert_eq!(doubt("d/*.png", 1.0), None);
    assert_eq!(doubt("d/*.png", 1.3), None, "a wrong baseline, not a unit");
    for (factor, cure) in [
        (1000.0, "unit=0.000001"),
        (5.0, "unit=0.0002"),
        (2.0, "unit=0.0005"),
        (0.5, "unit=0.002"),
        (0.001, "unit=1"),
    ] {
        let words = doubt("d/*.png", factor).unwrap_or_default();
        let expected = format!(
            "the truth is doubtful: its distances are {factor} times those of every algorithm \
             (bm, v3); likely --truth 'd/*.png:{cure}'"
        );
        assert!(words.starts_with(&expected), "{words}");
    }
    let words = doubt("d/*.png", -1.0).unwrap();
    assert!(words.contains("the opposite sign"), "{words}");
}

#[test]
fn distances_along_the_rays_are_doubted_by_their_error_as_depths() {
    let scale = AlgorithmScale {
        factor: Some(1.01),
        inverse: None,
        along_rays: Some(0.05),
        recorded: None,
        line: None,
        right: 0,
        wrong: 0,
    };
    let by = |origin| MeasuredScales {
        origin,
        algorithms: BTreeMap::from([("v3".to_owned(), scale.clone())]),
    };
    let doubts = by(TruthOrigin::Sensor("/depth".into())).doubts();
    assert!(words(&doubts)[0].contains("along the rays"), "{doubts:?}");
    assert_eq!(
        (&*doubts[0].name, doubts[0].value),
        ("error_as_depths", 0.05)
    );
    assert_eq!(by(TruthOrigin::Exact).doubts(), []);
}

#[test]
fn an_offset_is_no_factor() {
    let doubt = |truth: fn(f32) -> f32| doubt("d/*.png", truth, Vec::new()).unwrap_or_default();
    for (truth, words) in [
        (
            (|d| d + 8.0) as fn(f32) -> f32,
            "its disparities are 7.9 px more than those",
        ),
        (|d| d - 5.5, "its disparities are 5.6 px less than those"),
        (
            |d| 0.58 * d + 8.0,
            "its disparities are 0.58 times those of v3, and 7.9 px more",
        ),
    ] {
        let said = doubt(truth);
        assert!(
            said.contains(words) && said.contains("principal points"),
            "{said}"
        );
    }
    for factor in [0.5, 2.0, 3.0] {
        let said = self::doubt("d/*.png", |d| d / factor, Vec::new()).unwrap();
        assert!(said.contains("its distances are"), "{said}");
    }
    assert_eq!(doubt(|d| d + 0.5), "");
    // An algorithm with the truth's own disparities denies it; one without any line does not.
    let beside = |other: fn(f32) -> f32| {
        let other = estimate("v5", |x, y| other(true_px(x, y)) + (x % 2) as f32 / 10.0);
        self::doubt("d/*.png", |d| d + 8.0, vec![other]).unwrap_or_default()
    };
    assert_eq!(beside(|d| d + 8.0), "");
    let said = beside(|d| 8.0 + 37.0 * d % 23.0);
    assert!(said.contains("7.9 px more than those of v3:"), "{said}");
}

#[test]
fn a_pattern_that_repeats_beyond_the_search_is_no_factor() {
    // A tilted board whose squares match 50 px off, beyond the 64 px that are searched.
    let mut ratios = Ratios::new("sgm:max_disparity=64");
    let truth = |x: usize, y: usize| 90.0 + (x + 2 * y) as f32 / 2.0;
    let image = Gray::filled(SIZE.0, SIZE.1, 0).unwrap();
    let pair = StereoPair::new(image.clone(), image).unwrap();
    let frame = Frame::new(pair, Geometry::Rectified(Some(rig())));
    let map = |px: fn(f32) -> f32| Plane::from_fn(SIZE.0, SIZE.1, |x, y| px(truth(x, y))).unwrap();
    let exact = Truth::exact(map(|d| d), None);
    ratios.add(&frame, &exact, &map(|d| d - 50.0));
    assert_eq!((ratios.within.len(), ratios.factor()), (0, None));
    let mut ratios = Ratios::new("sgm:max_disparity=64");
    ratios.add(&frame, &exact, &map(|d| d / 2.0));
    assert_eq!(ratios.factor(), Some(2.0));
}

#[test]
fn one_distance_tells_no_factor_from_an_offset() {
    let points: Vec<_> = (0..300)
        .map(|i| [14.0, 6.0 + 0.001 * f64::from(i)])
        .collect();
    let line = ScaleLine::new(&points).unwrap();
    assert!(line.is_either && line.factor.is_some() && line.offset_px.is_some());
    assert_eq!(ScaleLine::new(&[]), None);
}

#[test]
fn disparities_read_as_depths_are_named() {
    // The values 256·d, read as millimetres.
    let as_depth = |d: f32| rig().disparity_px(f64::from(0.256 * d)) as f32;
    let words = doubt("d/*.png", as_depth, Vec::new()).unwrap();
    assert!(
        words.ends_with("likely --truth 'd/*.png:disparity=256'"),
        "{words}"
    );
    // A topic has them as another type, not by an option.
    let words = doubt("/depth", as_depth, Vec::new()).unwrap();
    assert!(words.ends_with("stereo_msgs/DisparityImage"), "{words}");
}

/// The doubt about a map of files, alone against an exact truth.
fn doubt_of_files(options: &str, map: impl Fn(f32) -> f32) -> Option<String> {
    let image = Gray::filled(SIZE.0, SIZE.1, 0).unwrap();
    let pair = StereoPair::new(image.clone(), image).unwrap();
    let truth = Plane::from_fn(SIZE.0, SIZE.1, true_px).unwrap();
    let map = |x: usize, y: usize| map(true_px(x, y));
    let frame = Frame {
        truth: Some(Truth::exact(truth, None)),
        maps: vec![RecordedMap {
            source: format!("files:pattern=d/*{options},skew_ms=20"),
            disparity: Plane::from_fn(SIZE.0, SIZE.1, map).unwrap(),
            density: MapDensity::Dense,
        }],
        ..Frame::new(pair, Geometry::Rectified(Some(rig())))
    };
    let mut scales = TruthScales::default();
    scales.observe(&Judge::default().judge(frame, vec![estimate("net", map)]));
    words(&scales.measured().doubts()).pop()
}

#[test]
fn maps_of_files_are_doubted_with_the_option_that_cures_them() {
    let px = |z: f32| rig().disparity_px(f64::from(z)) as f32;
    let z = |d: f32| rig().depth_m(f64::from(d)).unwrap() as f32;
    assert_eq!(doubt_of_files(".npy,unit=0,disparity=0", |d| d), None);
    let times_16 = doubt_of_files(".npy,unit=0,disparity=0", |d| 16.0 * d).unwrap();
    assert_eq!(
        times_16,
        "the map of net is doubtful: its distances are 0.0625 times those of the truth; likely \
         files:PATTERN,disparity=16"
    );
    for (options, words, map) in [
        (
            ".npy,unit=0,disparity=0",
            "unit=1",
            (&z) as &dyn Fn(f32) -> f32,
        ),
        (".png,unit=0,disparity=0", "disparity=1", &|d| d / 256.0),
        (".npy,unit=1,disparity=0", "unit=0.001", &|d| d / 1000.0),
        (".npy,unit=1,disparity=0", "disparity=16", &|d| px(16.0 * d)),
    ] {
        let doubt = doubt_of_files(options, map).unwrap_or_default();
        assert!(
            doubt.ends_with(&format!("files:PATTERN,{words}")),
            "{options}: {doubt}"
        );
    }
}

#[test]
fn every_algorithm_has_to_agree() {
    let right = |px: fn(f32) -> f32| vec![estimate("sgm", move |x, y| px(true_px(x, y)))];
    assert_eq!(
        doubt("d/*.png", |d| d / 2.0, right(|d| d / 2.0 + 0.1)),
        None
    );
    // One that copies the truth does not count.
    assert!(doubt("d/*.png", |d| d / 2.0, right(|d| d / 2.0)).is_some());
    // One without pixels does not, either.
    assert!(doubt("d/*.png", |d| d / 2.0, right(|_| 0.0)).is_some());
}

/// The doubts about a truth of that origin by an algorithm of such cells and such a factor.
fn doubts_of(
    label: &str,
    origin: TruthOrigin,
    factor: Option<f64>,
    cells: [u64; 2],
) -> Vec<String> {
    let scale = AlgorithmScale {
        factor,
        inverse: None,
        along_rays: None,
        recorded: (label == "map").then(|| "/estimate".to_owned()),
        line: None,
        right: cells[0],
        wrong: cells[1],
    };
    let algorithms = BTreeMap::from([(label.to_owned(), scale)]);
    let doubts = MeasuredScales { origin, algorithms }.doubts();
    words(&doubts)
}

#[test]
fn cells_that_are_right_deny_a_factor() {
    let sensor = || TruthOrigin::Sensor("d/*.png".into());
    // Beyond the range of an algorithm its pixels are wrong, and its cells unknown.
    let doubts = doubts_of("v5", sensor(), Some(2.0), [90, 2]);
    assert_eq!(doubts, Vec::<String>::new());
    let doubts = doubts_of("v5", sensor(), Some(2.0), [0, 90]);
    assert!(doubts[0].contains("0.5 times"), "{doubts:?}");
}

#[test]
fn a_truth_that_denies_what_v5_knows_is_doubtful() {
    let sensor = || TruthOrigin::Sensor("/depth".into());
    let doubts = doubts_of("v5:max_disparity=96", sensor(), None, [20, 40]);
    let words = "40 of 60 cells that v5:max_disparity=96 knows in the first pairs are wrong";
    assert!(doubts[0].contains(words), "{doubts:?}");
    for (label, cells) in [("v5", [40, 20]), ("v5", [0, 19]), ("v3", [20, 40])] {
        let doubts = doubts_of(label, sensor(), None, cells);
        assert_eq!(doubts, Vec::<String>::new(), "{label} {cells:?}");
    }
}
