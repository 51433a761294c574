//! Floor in the truth of other programs' recordings: by base_footprint, by the surfaces that a bag
//! of svl's has, by the height of a level camera.

use super::bag::{
    Bag, FB, Link, Message, OPTICAL, PARALLEL, SIZE, all_frames, cloud, depth32, open_with,
    ros_image, transforms,
};
use super::frames::stamp;
use super::says::Says;
use std::f64::consts::FRAC_1_SQRT_2;
use svl::scenario::SourceOptions;
use svl::stereo::{Frame, Surface};

/// The inverse of [`OPTICAL`].
const LEVEL: [f64; 4] = [0.5, -0.5, 0.5, 0.5];

/// The frames of a bag of two pairs and these messages, with the truth of a topic.
fn frames(
    messages: impl IntoIterator<Item = Message>,
    topic: &str,
    camera_height_m: Option<f64>,
) -> svl::Result<Vec<Frame>> {
    let options = SourceOptions {
        truth: Some(topic.to_owned()),
        camera_height_m,
        ..SourceOptions::default()
    };
    let saved = Bag::pairs(2).and(messages).saved();
    let (frames, _) = open_with(&saved, options).and_then(all_frames)?;
    Ok(frames)
}

/// Static transforms.
fn tf(links: &[Link<'_>]) -> Message {
    transforms("/tf_static", 0, links)
}

/// Depth images of a floor 0.5 m below a level camera, from row 9 on, and of a wall above it.
fn floor_and_wall() -> [Message; 2] {
    [0, 1].map(|i| depth32(i, SIZE, |_, y| distance_m(y) as f32))
}

/// Row of the optical axis of [`pairs`].
const CENTRE: f64 = 8.0;

fn distance_m(y: usize) -> f64 {
    if y < 9 {
        2.0
    } else {
        0.5 * focal_px() / (y as f64 - CENTRE)
    }
}

fn focal_px() -> f64 {
    // By FB and the baseline of the rig.
    rig().focal_px()
}

fn rig() -> svl::stereo::Rig {
    let frames = frames([depth32(0, SIZE, |_, _| 1.0)], "/depth", None).unwrap();
    let rig = *frames[0].rig().unwrap();
    assert!((rig.focal_px() * rig.baseline_m() - FB).abs() < 1e-6);
    assert!((rig.center_px().1 - CENTRE).abs() <= 1.0);
    rig
}

/// Rows of the first frame's truth that are floor; `None` if nothing tells.
fn floor_rows(frames: &[Frame]) -> Option<Vec<usize>> {
    let truth = frames[0].truth.as_ref().unwrap();
    let surfaces = truth.surface.as_ref()?;
    let is_floor = |y: &usize| surfaces.row(*y).iter().all(|s| *s == Surface::Floor);
    Some((0..surfaces.height()).filter(is_floor).collect())
}

/// [`floor_rows`] of a camera of that height, and with these static transforms.
fn floor_of(camera_height_m: Option<f64>, links: &[Link<'_>]) -> svl::Result<Option<Vec<usize>>> {
    let messages = floor_and_wall().into_iter().chain([tf(links)]);
    let frames = frames(messages, "/depth", camera_height_m)?;
    Ok(floor_rows(&frames))
}

#[test]
fn a_frame_on_the_floor_is_found_in_either_direction() {
    let below: Vec<_> = (9..SIZE.1).collect();
    let rows = |links: &[Link<'_>]| floor_of(None, links).unwrap();
    // The camera above the footprint, and the footprint below the camera.
    let above = ("base_footprint", "cam", [0.0, 0.0, 0.5], OPTICAL);
    let under = ("cam", "base_footprint", [0.0, 0.5, 0.0], LEVEL);
    assert_eq!(rows(&[above]), Some(below.clone()));
    assert_eq!(rows(&[under]), Some(below.clone()));
    // By frames between them, and not straight below the camera.
    let mast = ("base_footprint", "mast", [-0.2, 0.4, 0.2], PARALLEL);
    let on_mast = ("mast", "cam", [0.5, 0.0, 0.3], OPTICAL);
    assert_eq!(rows(&[mast, on_mast]), Some(below));
    // A frame that is tilted by 90 degrees is a plane elsewhere: what is behind it is not floor.
    let tilted = ("base_footprint", "cam", [0.0, 0.0, 0.5], PARALLEL);
    assert_eq!(rows(&[tilted]), Some(Vec::new()));
    let rolled = [0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2];
    for link in [
        ("cam", "base_footprint", [0.0, 0.5, 0.0], rolled),
        // On the floor, or below it, there is no camera.
        ("base_footprint", "cam", [0.0; 3], OPTICAL),
        ("base_footprint", "cam", [0.0, 0.0, -0.5], OPTICAL),
        ("base_link", "cam", [0.0, 0.0, 0.5], OPTICAL),
    ] {
        assert_eq!(rows(&[link]), None, "{link:?}");
    }
}

#[test]
fn points_are_floor_before_any_quantile() {
    let cloud = |i: u64| {
        let points = [
            // All but the last in the fifth row below the optical axis.
            [0.4, 0.5, 32.8],
            [0.0, 0.46, 30.176],
            [-0.4, 0.44, 28.864],
            [0.0, 0.0, 2.0],
        ];
        cloud("cam", stamp(i), &points)
    };
    let under = tf(&[("cam", "base_footprint", [0.0, 0.5, 0.0], LEVEL)]);
    let found = frames([cloud(0), cloud(1), under], "/points", None).unwrap();
    let truth = found[0].truth.as_ref().unwrap();
    let surfaces = truth.surface.as_ref().unwrap();
    let known = truth.disparity.pixels().zip(surfaces.pixels());
    let known: Vec<_> = known.filter(|(d, _)| d.is_finite()).collect();
    let floor = known.iter().filter(|(_, s)| *s == Surface::Floor).count();
    // 5 cm is the limit, as a fifth of the height is more.
    assert_eq!((floor, known.len()), (2, 4));
}

#[test]
fn a_named_height_is_that_of_a_level_camera() {
    let below: Vec<_> = (9..SIZE.1).collect();
    let above = ("base_footprint", "cam", [0.0, 0.0, 0.5], OPTICAL);
    for (height_m, links, expected) in [
        (0.5, &[][..], Some(below.clone())),
        // One that the truth denies: its largest level surface is 0.5 m below.
        (3.0, &[], None),
        (0.54, &[], Some(below)),
        // It takes the place of a frame on the floor.
        (3.0, &[above], None),
    ] {
        assert_eq!(floor_of(Some(height_m), links).unwrap(), expected);
    }
    let refused = floor_of(Some(0.0), &[]).unwrap_err();
    refused.says("--camera-height: 0.01 to 100");
}

#[test]
fn surfaces_of_the_same_pixels_are_taken() {
    let surfaces = |size: (usize, usize)| {
        let codes = [64, 192].repeat(size.0 * size.1 / 2);
        [0, 1].map(|i| ros_image("/truth/surface", stamp(i), size, "mono8", &codes))
    };
    let count = |size| {
        let messages = floor_and_wall().into_iter().chain(surfaces(size));
        let found = frames(messages, "/depth", None).unwrap();
        let surface = found[1].truth.as_ref().unwrap().surface.clone()?;
        let count = |kind| surface.pixels().filter(|s| *s == kind).count();
        Some([Surface::Floor, Surface::Wall].map(count))
    };
    let half = SIZE.0 * SIZE.1 / 2;
    assert_eq!(count(SIZE), Some([half, half]));
    // Surfaces of another size are of other pixels.
    assert_eq!(count((SIZE.0 / 2, SIZE.1)), None);
}
