//! Folders with the layouts that users have, one by one.

use super::pairs::FolderRequest;
use super::source::FolderSource;
use crate::source::frames::Source;
use crate::source::inputs::dataset::scene::Scene;
use svl_core::Result;
use svl_core::stereo::Geometry;
use svl_files::SideBySide;
use svl_files::encode_png;
use svl_recording::StampOrigin;
use tempfile::TempDir;

/// A folder with these files: images whose only pixel is their number in the list, and texts.
fn folder(images: &[&str], texts: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    };
    for (i, name) in images.iter().enumerate() {
        write(name, &encode_png(2, 1, &[i as u8; 2]).unwrap());
    }
    texts
        .iter()
        .for_each(|(name, text)| write(name, text.as_bytes()));
    folder
}

fn open(folder: &TempDir) -> Result<FolderSource> {
    FolderSource::new(folder.path(), &FolderRequest::default())
}

/// The pixels of each pair.
fn pixels(source: &mut FolderSource) -> Vec<[u8; 2]> {
    let frames = std::iter::from_fn(|| source.next().unwrap());
    frames
        .map(|frame| [frame.pair.left().get(0, 0), frame.pair.right().get(0, 0)])
        .collect()
}

fn stamps(source: &mut FolderSource) -> Vec<(u64, Option<i64>)> {
    let frames = std::iter::from_fn(|| source.next().unwrap());
    frames
        .map(|frame| (frame.stamp_ns, frame.exposure.skew_ns))
        .collect()
}

#[test]
fn every_layout_pairs_its_images() {
    let layouts = [
        ["left/8.png", "right/8.png", "left/13.png", "right/13.png"],
        ["Left/8.PNG", "RIGHT/8.png", "Left/13.PNG", "RIGHT/13.png"],
        [
            "left/left_8.png",
            "right/right_8.png",
            "left/left_13.png",
            "right/right_13.png",
        ],
        [
            "left/8_left.png",
            "right/8_right.png",
            "left/13_left.png",
            "right/13_right.png",
        ],
        [
            "left/8_L.png",
            "right/8_R.png",
            "left/13_L.png",
            "right/13_R.png",
        ],
        ["cam0/8.png", "cam1/8.png", "cam0/13.png", "cam1/13.png"],
        [
            "cam0/data/8.png",
            "cam1/data/8.png",
            "cam0/data/13.png",
            "cam1/data/13.png",
        ],
        [
            "mav0/cam0/data/8.png",
            "mav0/cam1/data/8.png",
            "mav0/cam0/data/13.png",
            "mav0/cam1/data/13.png",
        ],
        ["8_left.jpg", "8_right.jpg", "13_left.jpg", "13_right.jpg"],
        ["00_left.png", "00_right.png", "01_left.png", "01_right.png"],
        ["00_L.png", "00_R.png", "01_L.png", "01_R.png"],
        ["left_8.png", "right_8.png", "left_13.png", "right_13.png"],
        ["left8.bmp", "right8.tif", "left13.webp", "right13.png"],
        [
            "image_2/8.png",
            "image_3/8.png",
            "image_2/13.png",
            "image_3/13.png",
        ],
        [
            "image_0/8.png",
            "image_1/8.png",
            "image_0/13.png",
            "image_1/13.png",
        ],
        [
            "colored_0/8.png",
            "colored_1/8.png",
            "colored_0/13.png",
            "colored_1/13.png",
        ],
        [
            "image_00/data/8.png",
            "image_01/data/8.png",
            "image_00/data/13.png",
            "image_01/data/13.png",
        ],
        [
            "image_02/data/8.png",
            "image_03/data/8.png",
            "image_02/data/13.png",
            "image_03/data/13.png",
        ],
    ];
    for layout in layouts {
        let folder = folder(&layout, &[("readme.txt", "not an image")]);
        let mut source = open(&folder).unwrap();
        assert_eq!(source.pairs(), Some(2), "{layout:?}");
        assert_eq!(source.stamps, Some(StampOrigin::UNKNOWN), "{layout:?}");
        // By their numbers, 8 before 13, whatever their extensions: the content decides.
        assert_eq!(pixels(&mut source), [[0, 1], [2, 3]], "{layout:?}");
    }
}

#[test]
fn stamps_come_from_the_files_beside_the_images() {
    let text = "#timestamp [ns],filename\n1000,a.png\n51000,b.png\n";
    let right = "#timestamp [ns],filename\r\n1500,a.png\r\n51000,b.png\r\n";
    let images = [
        "cam0/data/b.png",
        "cam1/data/b.png",
        "cam0/data/a.png",
        "cam1/data/a.png",
    ];
    let euroc = folder(
        &images,
        &[("cam0/data.csv", text), ("cam1/data.csv", right)],
    );
    let mut source = open(&euroc).unwrap();
    assert_eq!(source.stamps, None);
    assert_eq!(stamps(&mut source), [(1000, Some(500)), (51_000, Some(0))]);
    // Stamps of the left camera alone.
    let left_only = folder(&images, &[("cam0/data.csv", text)]);
    let mut source = open(&left_only).unwrap();
    assert_eq!(stamps(&mut source), [(1000, None), (51_000, None)]);
    // A line for each number, also of images that are not there.
    let images = [
        "image_00/data/0000000000.png",
        "image_01/data/0000000000.png",
        "image_00/data/0000000002.png",
        "image_01/data/0000000002.png",
    ];
    let times = "2011-09-26 13:02:25.0\n2011-09-26 13:02:25.1\n2011-09-26 13:02:25.2\n";
    let kitti = folder(
        &images,
        &[
            ("image_00/timestamps.txt", times),
            ("image_01/timestamps.txt", times),
        ],
    );
    let found = stamps(&mut open(&kitti).unwrap());
    assert_eq!(found[1].0 - found[0].0, 200_000_000);
    assert_eq!(found[1].1, Some(0));
    // A bad line is named.
    let bad = folder(&images, &[("image_00/timestamps.txt", "soon\n")]);
    let error = open(&bad).err().unwrap().to_string();
    assert!(error.contains("timestamps.txt: line 1, 'soon'"), "{error}");
    // One that lists too few gives none.
    let few = folder(
        &images,
        &[("image_00/timestamps.txt", "2011-09-26 13:02:25.0\n")],
    );
    assert_eq!(open(&few).unwrap().stamps, Some(StampOrigin::UNKNOWN));
}

#[test]
fn stamps_come_from_names_and_the_user_overrides() {
    let images = [
        "left/1403715273262142976.png",
        "right/1403715273262142976.png",
        "left/1403715273312142976.png",
        "right/1403715273312142976.png",
    ];
    let folder = folder(&images, &[]);
    let mut source = open(&folder).unwrap();
    let first = 1_403_715_273_262_142_976;
    assert_eq!(
        stamps(&mut source),
        [(first, None), (first + 50_000_000, None)]
    );
    assert_eq!((source.stamps, source.depth.note()), (None, None));
    let request = FolderRequest {
        fps: Some(25.0),
        ..FolderRequest::default()
    };
    let mut source = FolderSource::new(folder.path(), &request).unwrap();
    assert_eq!(stamps(&mut source), [(0, None), (40_000_000, None)]);
    assert_eq!(source.stamps, Some(StampOrigin::Given(25.0)));
}

#[test]
fn patterns_name_any_images() {
    let images = [
        "a/x1.png",
        "B/y1.png",
        "a/x10.png",
        "B/y10.png",
        "a/x9.png",
        "other.png",
    ];
    let folder = folder(&images, &[]);
    let read = |left: &str, right: &str| {
        let images = [left, right].map(|pattern| Some(pattern.to_owned()));
        let request = FolderRequest {
            images,
            ..FolderRequest::default()
        };
        FolderSource::new(folder.path(), &request)
    };
    let mut source = read("a/x*.png", "b/y*").unwrap();
    assert_eq!(pixels(&mut source), [[0, 1], [2, 3]]);
    assert_eq!(source.finish(2).unpaired, 1, "x9");
    assert_eq!(
        pixels(&mut read("*/x1.png", "*/x10.png").unwrap()),
        [[0, 2]]
    );
    assert_eq!(
        pixels(&mut read("a/x1.png", "other.png").unwrap()),
        [[0, 5]]
    );
    for (left, right, word) in [
        (
            "a/*.jpg",
            "b/*",
            "--left: no image is named 'a/*.jpg'; the folder has 2 folders (B, a)",
        ),
        ("a/*", "b/*", "the part at * is equal in no two images"),
        ("a/*", "b/*y*", "more than one *"),
        ("/cam0/image_raw", "/cam1/image_raw", "is a topic"),
    ] {
        let error = read(left, right).err().unwrap().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn images_of_both_are_split() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, width, bytes: &[u8]| {
        std::fs::write(
            folder.path().join(name),
            encode_png(width, 1, bytes).unwrap(),
        )
        .unwrap();
    };
    write("1.png", 4, &[1, 1, 2, 2]);
    write("2.png", 4, &[3, 3, 4, 4]);
    let request = FolderRequest {
        side_by_side: Some(SideBySide::LeftRight),
        ..FolderRequest::default()
    };
    let mut source = FolderSource::new(folder.path(), &request).unwrap();
    assert_eq!(pixels(&mut source), [[1, 2], [3, 4]]);
    write("1.png", 3, &[1, 1, 2]);
    write("2.png", 3, &[1, 1, 2]);
    let odd = FolderSource::new(folder.path(), &request).err().unwrap();
    assert!(odd.to_string().contains("1.png: is 3 pixels wide"), "{odd}");
}

#[test]
fn folders_without_pairs_are_reported() {
    let folder = folder(&["a.png", "b.png", "sub/c.png"], &[("notes.txt", "")]);
    let error = open(&folder).err().unwrap().to_string();
    for words in [
        "1 folder (sub), 2 images (a.png, b.png), 1 other file (notes.txt)",
        "left/* and right/*",
        "--left and --right",
    ] {
        assert!(error.contains(words), "{error}");
    }
    let empty = tempfile::tempdir().unwrap();
    let error = open(&empty).err().unwrap().to_string();
    assert!(error.contains("it has nothing"), "{error}");
}

#[test]
fn a_refusal_fits_a_screen() {
    let mut names: Vec<_> = (0..9)
        .map(|i| format!("{}{i}.png", "long".repeat(50)))
        .collect();
    names.extend((0..9).map(|i| format!("{}{i}/a.png", "deep".repeat(50))));
    let folder = folder(&names.iter().map(String::as_str).collect::<Vec<_>>(), &[]);
    let error = open(&folder).err().unwrap().to_string();
    assert!(error.chars().count() < 20 * 80, "{error}");
    assert!(
        error.contains("9 images (longlong") && error.contains("long…"),
        "{error}"
    );
}

#[test]
fn a_folder_of_one_camera_is_no_pair() {
    let images = |left, right| {
        let images = ["im0.png", "im1.png"];
        let names = [left, right].map(|camera| images.map(|image| format!("{camera}/{image}")));
        let names = names.concat();
        folder(&names.iter().map(String::as_str).collect::<Vec<_>>(), &[])
    };
    for (left, right) in [("camera_00", "camera_02"), ("camera_00", "camera_01")] {
        let scene = images(left, right);
        // Image 0 of both cameras, and image 1.
        assert_eq!(pixels(&mut open(&scene).unwrap()), [[0, 2], [1, 3]]);
        assert!(Scene::all_in(scene.path(), "").unwrap().is_empty());
        let one = FolderSource::new(&scene.path().join(left), &FolderRequest::default());
        let error = one.err().unwrap().to_string();
        assert!(
            error.contains("of one camera: name the folder above"),
            "{error}"
        );
    }
    // One scene has no other camera beside it.
    let scenes = images("camera_00", "other");
    assert_eq!(Scene::all_in(scenes.path(), "").unwrap().len(), 2);
}

#[test]
fn unreadable_files_are_counted() {
    let images = [
        "left/1.png",
        "right/1.png",
        "left/2.png",
        "right/2.png",
        "left/3.png",
    ];
    let folder = folder(&images, &[("left/0.png", "no image"), ("right/0.png", "")]);
    let mut source = open(&folder).unwrap();
    assert_eq!(pixels(&mut source), [[0, 1], [2, 3]]);
    let losses = source.finish(2);
    assert_eq!((losses.unreadable, losses.unpaired), (1, 1));
    // Not one that can be read.
    std::fs::remove_file(folder.path().join("left/1.png")).unwrap();
    std::fs::remove_file(folder.path().join("left/2.png")).unwrap();
    let error = open(&folder).err().unwrap().to_string();
    assert!(
        error.contains("left/0.png: not a readable image"),
        "{error}"
    );
}

#[cfg(unix)]
#[test]
fn names_that_are_not_utf_8_are_read() {
    use std::os::unix::ffi::OsStrExt;
    let folder = folder(&["left/1.png", "right/1.png"], &[]);
    let name = std::ffi::OsStr::from_bytes(b"caf\xe9.png");
    for side in ["left", "right"] {
        let png = encode_png(2, 1, &[7; 2]).unwrap();
        std::fs::write(folder.path().join(side).join(name), png).unwrap();
    }
    assert_eq!(pixels(&mut open(&folder).unwrap()), [[0, 1], [7, 7]]);
}

#[test]
fn cameras_of_a_folder_are_read() {
    let calib = "cam0=[300 0 1; 0 300 0; 0 0 1]\ncam1=[300 0 1; 0 300 0; 0 0 1]\ndoffs=0\n\
                 baseline=100\n";
    let images = ["left/1.png", "right/1.png"];
    let rig = |texts: &[(&str, &str)]| open(&folder(&images, texts)).map(|s| s.geometry);
    assert_eq!(rig(&[]).unwrap(), Geometry::Rectified(None));
    let size = |size: &str| format!("{calib}{size}");
    for text in [calib.to_owned(), size("width=2\nheight=1\n")] {
        assert!(rig(&[("calib.txt", &text)]).unwrap().rig().is_some());
    }
    let error = rig(&[("calib.txt", &size("width=640\nheight=480\n"))])
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("calib.txt: ") && error.contains("640x480"),
        "{error}"
    );
    // EuRoC's are raw, with or without their sensor.yaml; others only with it.
    for (side, geometry) in [
        ("cam0/data", Geometry::Raw),
        ("cam0", Geometry::Rectified(None)),
    ] {
        let right = side.replace('0', "1");
        let folder = folder(&[&format!("{side}/1.png"), &format!("{right}/1.png")], &[]);
        let source = open(&folder).unwrap();
        assert_eq!(
            (source.geometry, &source.calibration),
            (geometry, &Ok(None)),
            "{side}"
        );
        std::fs::write(folder.path().join("cam0/sensor.yaml"), "T_BS: 3").unwrap();
        std::fs::write(folder.path().join("cam1/sensor.yaml"), "T_BS: 3").unwrap();
        let source = open(&folder).unwrap();
        assert_eq!(source.geometry, Geometry::Raw, "{side}");
        assert!(
            source
                .calibration
                .as_ref()
                .unwrap_err()
                .contains("sensor.yaml")
        );
    }
    // KITTI's projections, of the cameras whose images these are.
    let projections = "P0: 700 0 1 0 0 700 0 0 0 0 1 0\nP1: 700 0 1 -378 0 700 0 0 0 0 1 0\n";
    let source = open(&folder(
        &["image_0/1.png", "image_1/1.png"],
        &[("calib.txt", projections)],
    ));
    let baseline_m = source.unwrap().geometry.rig().unwrap().baseline_m();
    assert!((baseline_m - 0.54).abs() < 1e-9, "{baseline_m}");
}

#[test]
fn pairs_without_times_have_no_past() {
    let names = ["left/a.png", "right/a.png", "left/b.png", "right/b.png"];
    let folder = folder(&names, &[]);
    let stamps = stamps(&mut open(&folder).unwrap());
    assert!(!svl_core::depth::decision::follows(
        stamps[0].0,
        stamps[1].0
    ));
}
