//! Truth of a folder's pairs from files: depth images, NumPy's arrays, KITTI's laser scans.

use super::fixture::{Fixture, assert_says};
use super::transcript::assert_words;
use crate::recording::bag::png;
use svl::source::{Request, open};
use svl::stereo::{Frame, MapDensity, TruthOrigin};

const SIZE: (usize, usize) = (40, 24);
const CALIB: &str = "cam0=[50 0 20; 0 50 12; 0 0 1]\ncam1=[50 0 20; 0 50 12; 0 0 1]\ndoffs=0\n\
                     baseline=100\nwidth=40\nheight=24\nndisp=16\n";

fn steps() -> Vec<u16> {
    (0..SIZE.0 * SIZE.1)
        .map(|at| if at % 5 == 0 { 0 } else { 800 + at as u16 })
        .collect()
}

fn array(kind: &str, bytes: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (24, 40)}}\n");
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), bytes].concat()
}

/// Two pairs, named by times 50 ms apart.
fn scene(fixture: &Fixture) {
    for (name, shift) in [("1700000000.00", 3), ("1700000000.05", 5)] {
        let [left, right] = ["left", "right"].map(|side| format!("p/{side}/{name}.pgm"));
        fixture.write_pair(&left, &right, SIZE, shift);
    }
    fixture.write("p/calib.txt", CALIB);
}

fn frames(fixture: &Fixture, name: &str, truth: &str) -> Vec<Frame> {
    let path = fixture.path(name);
    let mut request = Request::new(path.to_str().unwrap());
    request.options.truth = Some(truth.to_owned());
    let source = &mut open(&request).unwrap().source;
    std::iter::from_fn(|| source.next().unwrap()).collect()
}

#[test]
fn depth_images_and_arrays_are_the_same_truth() {
    let fixture = Fixture::new();
    scene(&fixture);
    let metres = steps().into_iter().map(|step| f32::from(step) / 1000.0);
    let metres: Vec<u8> = metres.flat_map(f32::to_le_bytes).collect();
    // By the name of the pair, and 10 ms from its stamp; 30 ms away is too far.
    for (folder, times) in [("depth", ["00", "05"]), ("near", ["01", "08"])] {
        for time in times {
            let name = |ending: &str| format!("p/{folder}/1700000000.{time}.{ending}");
            fixture.write(&name("png"), png(SIZE, &steps()));
            fixture.write(&name("npy"), array("<f4", &metres));
        }
    }
    let by_name = frames(&fixture, "p", "depth/*.png");
    let truth = |frame: &Frame| frame.truth.clone().unwrap();
    for (step, disparity) in steps().iter().zip(truth(&by_name[0]).disparity.pixels()) {
        let expected = 50.0 * 0.1 / (f64::from(*step) / 1000.0);
        assert!(
            *step == 0 && disparity.is_infinite() || (f64::from(disparity) - expected).abs() < 1e-6
        );
    }
    assert_eq!(truth(&by_name[0]).kind.density, MapDensity::Dense);
    for pattern in ["depth/*.npy", "depth/*.png:unit=0.001"] {
        let others = frames(&fixture, "p", pattern);
        let mut pairs = others.iter().zip(&by_name);
        let is_same = pairs.all(|(a, b)| truth(a).disparity == truth(b).disparity);
        assert!(is_same, "{pattern}");
    }
    let near = frames(&fixture, "p", "near/*.png");
    assert_eq!([0, 1].map(|i| near[i].truth.is_some()), [true, false]);
    let ten = frames(&fixture, "p", "depth/*.png:unit=0.01");
    let [one, ten] = [&by_name[0], &ten[0]].map(|frame| truth(frame).disparity.get(1, 0));
    assert!((one / ten - 10.0).abs() < 1e-5);
    fixture.transcript(
        "info p => depth/*.png | depth/*.npy
        score p --truth depth/*.png --algo bm --output r => against the sensor depth/*.png",
    );
}

#[test]
fn invalid_truths_are_refused_in_one_line() {
    let fixture = Fixture::new();
    scene(&fixture);
    fixture.write("p/depth/1700000000.00.png", png(SIZE, &[9u8; 40 * 24]));
    fixture.write("p/small/1700000000.00.png", png((2, 2), &[9u16; 4]));
    fixture.write("p/scan/1700000000.00.bin", [0; 16]);
    fixture.write("p/other/a.png", png(SIZE, &steps()));
    fixture.write("p/late/1700000000.012.png", png(SIZE, &steps()));
    fixture.write("p/both/1699999999.00.png", [0]);
    fixture.write("p/both/1700000000.05.png", [0]);
    fixture.write_pair("q/left/1.pgm", "q/right/1.pgm", SIZE, 3);
    fixture.write("q/depth/1.png", png(SIZE, &steps()));
    fixture.write_pair("s/im0.pgm", "s/im1.pgm", SIZE, 3);
    // Each warning is told once, and does not hide the others. An unreadable file costs its pair's
    // truth.
    let record = "record p -o x.mcap --force --truth";
    let late = "late/1700000000.012.png is 12.0 ms from its pair: at 1 m/s the scene moves";
    fixture.transcript(&format!(
        "record p -o x.mcap --truth /depth => 2: is a pattern with one *
         record p -o x.mcap --truth no/*.png => 1: no such file | velodyne/*.bin
         record p -o x.mcap --truth depth/*.png:unit=mm => 2: metres per step
         record p -o x.mcap --truth depth/*.exr => 1: is not read; convert to one of png, tif
         record p -o x.mcap --truth small/*.png => 1: is 2x2, the left image 40x24
         record p -o x.mcap --truth scan/*.bin => 1: laser scans need KITTI's
         record q -o x.mcap --truth depth/*.png => 1: --calib FILE
         record s -o x.mcap --truth depth/*.png => 2: --truth is for sequences of pairs
         {record} both/*.png => 0~ no file fits | left out, its pair has no truth
         {record} depth/*.png => 0~ 1700000000.00.png: is not an image of one channel of 16 bits"
    ));
    for (pattern, words) in [
        (
            "other",
            "no file fits the pair '1700000000.00': the part at * is 'a'",
        ),
        ("late", late),
    ] {
        let ran = fixture.svl(&format!("{record} {pattern}/*.png"));
        assert_words(&ran.stderr, &format!("1x {words}"));
    }
}

#[test]
fn each_unusable_file_is_named_with_its_reason() {
    let fixture = Fixture::new();
    scene(&fixture);
    fixture.write("p/depth/1700000000.00.png", "no image");
    fixture.write("p/depth/1700000000.05.png", [0]);
    fixture.transcript("info p => 0~ 1700000000.00.png: not a | 1700000000.05.png: not a");
    // One of another size is the error of the second pair.
    fixture.write("p/depth/1700000000.05.png", png((8, 8), &[900_u16; 64]));
    fixture.transcript("info p => 1700000000.05.png: is 8x8, the left image 40x24");
}

/// A pair of 160x120 with a disparity of 8 px everywhere, so at 0.625 m.
fn wall(fixture: &Fixture) {
    fixture.write_pair("w/left/0.pgm", "w/right/0.pgm", WALL, 8);
    let calib = CALIB.replace("width=40\nheight=24", "width=160\nheight=120");
    let calib = calib.replace("0 20;", "0 80;").replace("50 12;", "50 60;");
    fixture.write("w/calib.txt", calib);
}

const WALL: (usize, usize) = (160, 120);

/// The wall's value, zero at every seventh pixel.
fn wall_image(value: u16) -> Vec<u8> {
    let at = |i| if i % 7 == 0 { 0 } else { value };
    png(WALL, &(0..WALL.0 * WALL.1).map(at).collect::<Vec<_>>())
}

#[test]
fn disparity_images_are_read_as_such() {
    let fixture = Fixture::new();
    wall(&fixture);
    for name in ["disp_occ_0", "other"] {
        fixture.write(&format!("w/{name}/0.png"), wall_image(8 * 256));
    }
    fixture.write("w/half/0.png", wall_image(8 * 128));
    fixture.write("w/metres/0.png", wall_image(625));
    let truth = |pattern: &str| frames(&fixture, "w", pattern)[0].truth.clone().unwrap();
    for (pattern, name) in [
        // The unit is as given, by the name, or by the images.
        ("other/*.png:disparity=256", "other/*.png:disparity=256"),
        ("disp_occ_0/*.png", "disp_occ_0/*.png:disparity=256"),
        ("other/*.png", "other/*.png:disparity=256"),
        ("half/*.png:disparity=128", "half/*.png:disparity=128"),
    ] {
        let truth = truth(pattern);
        assert_eq!(truth.kind.origin, TruthOrigin::Sensor(name.to_owned()));
        let disparity = |x| truth.disparity.get(x, 0);
        assert_eq!([0, 1].map(disparity), [f32::INFINITY, 8.0], "{pattern}");
    }
    // Depths stay depths, also where their name misleads.
    assert!((truth("metres/*.png").disparity.get(1, 0) - 8.0).abs() < 1e-5);
    let misnamed = truth("disp_occ_0/*.png:unit=0.001");
    assert!((f64::from(misnamed.disparity.get(1, 0)) - 5.0 / 2.048).abs() < 1e-5);
    for (name, words) in [
        (
            "disp_occ_0",
            "by their names they are disparities, read as :disparity=256",
        ),
        (
            "other",
            "match the two images as disparities and not as depths",
        ),
    ] {
        let ran = fixture.svl(&format!("record w -o x.mcap --force --truth {name}/*.png"));
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        assert_words(&(ran.stdout + &ran.stderr), &format!("1x {words}"));
    }
    // Without a calibration, disparities are a truth all the same.
    fixture.transcript(
        "info w => truth at start  disp_occ_0/*.png, cells 15, disparity (min 8.00 px, \
        median 8.00 px
        rm w/calib.txt
        info w => scored cells 15 | max 8.00 px",
    );
    assert_eq!(truth("disp_occ_0/*.png").disparity.get(1, 0), 8.0);
}

#[test]
fn numbers_that_are_not_the_images_are_named_and_so_are_files_without_a_pair() {
    let fixture = Fixture::new();
    wall(&fixture);
    for name in [1, 2] {
        let [left, right] = ["left", "right"].map(|side| format!("w/{side}/{name}.pgm"));
        fixture.write_pair(&left, &right, WALL, 8);
    }
    let record = |numbers: std::ops::Range<u16>, words: &str| {
        let folder = format!("disp{}-{}", numbers.start, numbers.end);
        for number in numbers {
            let image = wall_image(8 * 256 + number);
            fixture.write(&format!("w/{folder}/{number}.png"), image);
        }
        let pattern = format!("{folder}/*.png");
        let ran = fixture.svl(&format!("record w -o x.mcap --force --truth {pattern}"));
        assert_words(&ran.stderr, words);
        let found = frames(&fixture, "w", &pattern).into_iter();
        let px = found.map(|f| f.truth.map(|t| t.disparity.get(1, 0) * 256.0 - 2048.0));
        px.collect::<Vec<_>>()
    };
    let px = record(1..4, "numbers 1 to 3 for pairs 0 to 2: 1 is pair 0");
    assert_eq!(px, [Some(1.0), Some(2.0), Some(3.0)]);
    record(
        1..3,
        "are read as the pairs' own, so that some have none; if 1 is pair 0",
    );
    let px = record(0..5, "2 files used by no pair, the first is | 3.png");
    assert_eq!(px, [Some(0.0), Some(1.0), Some(2.0)]);
}

#[test]
fn a_truth_of_another_unit_is_named_with_the_likely_one() {
    let fixture = Fixture::new();
    wall(&fixture);
    // TUM's 1/5000 m, read as millimetres.
    fixture.write("w/depth/0.png", wall_image(3125));
    fixture.write("w/near/0.png", wall_image(625));
    // A single impossible pixel is dropped and counted.
    let mut values = vec![6250u16; WALL.0 * WALL.1];
    values[5] = 1;
    fixture.write("w/one/0.png", png(WALL, &values));
    let score = "score w --algo bm --algo sgm -o r --truth";
    let ran = fixture.svl(&format!("{score} depth/*.png"));
    let doubt = "the truth is doubtful: its distances are 5 times those of every algorithm \
                 (bm, sgm); likely --truth 'depth/*.png:unit=0.0002'";
    assert_words(&(ran.stdout + &ran.stderr), &format!("1x {doubt}"));
    // `info` compares the truth with bm. 0.6 mm is no distance.
    fixture.transcript(&format!(
        "cat r/summary.json => its distances are 5 times
        cat r/index.html => its distances are 5 times | 0.666667 to 1.5
        cat r/manifest.json => /doubts/0/of = truth | /doubts/0/name = scale \
        | /doubts/0/cure/kind = unit | /doubts/0/value > 0.18 | /doubts/0/value < 0.22
        {score} depth/*.png:unit=0.0002 => 0~ !doubtful => !doubtful
        {score} near/*.png:unit=0.000001 \
        => 1: is impossible: its median disparity is 8000 px (0.000625 m) \
        | likely --truth 'near/*.png:unit=0.001'
        {score} one/*.png:unit=0.0001 => 0~ 1x pair 0: 1 of 19200 pixels of the truth (sensor \
        one/*.png:unit=0.0001) are impossible
        cat r/summary.json => \"impossible\": 1
        cat r/index.html => 1 pixel of the truth that are impossible"
    ));
    let ran = fixture.svl(&format!("{score} depth/*.png:unit=0.0000002"));
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
    for (truth, is_doubted) in [("depth/*.png", true), ("depth/*.png:unit=0.0002", false)] {
        let info = fixture.json(&format!("info w --truth {truth} --json"));
        let mut doubts = info["usability"]["doubts"].as_array().unwrap().iter();
        let is_of_unit = doubts.any(|doubt| doubt["cure"]["kind"] == "unit");
        assert_eq!(is_of_unit, is_doubted, "{truth}");
    }
}

/// KITTI's odometry: poses of camera 0, beside the sequence or two above it.
#[test]
fn kitti_s_poses_are_read() {
    let fixture = Fixture::new();
    for i in ["000000", "000001", "000002"] {
        let image = |camera: &str| format!("sequences/07/{camera}/{i}.pgm");
        fixture.write_pair(&image("image_0"), &image("image_1"), SIZE, 3);
    }
    let poses = "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0.5 0 1 0 -0.1 0 0 1 2\n";
    fixture.write("poses/07.txt", poses);
    let places = |calib: &str| {
        fixture.write("sequences/07/calib.txt", calib);
        fixture.run("record sequences/07 -o x.mcap --force");
        let mut reader = svl::recording::Reader::open(fixture.path("x.mcap")).unwrap();
        let pairs = std::iter::from_fn(|| reader.next_pair().unwrap());
        let poses = pairs.map(|frame| frame.pose);
        let place = |pose: svl::stereo::Pose| pose.translation.vector.data.0[0];
        poses.map(|pose| pose.map(place)).collect::<Vec<_>>()
    };
    let grey = "P0: 50 0 20 0 0 50 12 0 0 0 1 0\nP1: 50 0 20 -5 0 50 12 0 0 0 1 0\n";
    assert_eq!(places(grey), [Some([0.0; 3]), Some([0.5, 2.0, 0.1]), None]);
    // The colour cameras are beside camera 0, whose poses these are: 0.06 m to its left.
    fixture.transcript(
        "mv sequences/07/image_0 sequences/07/image_2
        mv sequences/07/image_1 sequences/07/image_3",
    );
    let colour = "P2: 50 0 20 3 0 50 12 0 0 0 1 0\nP3: 50 0 20 -2 0 50 12 0 0 0 1 0\n";
    assert!((places(colour)[1].unwrap()[0] - 0.44).abs() < 1e-12);
    fixture.transcript("rm sequences/07/calib.txt");
    let ran = fixture.svl("record sequences/07 -o x.mcap --force");
    assert_says(&ran.stderr, &["the poses of camera 0"]);
    fixture.write("sequences/07/calib.txt", colour);
    fixture.write("sequences/07/poses.txt", "1 0 0\n");
    fixture.fails("record sequences/07 -o y.mcap => 1: poses.txt: line 1: expected twelve numbers");
}

/// KITTI raw with the rectified cameras only, and a scanner 0.2 m above and 0.3 m behind.
#[test]
fn kitti_s_scans_are_moved_into_the_camera() {
    let fixture = Fixture::new();
    let image = |camera: &str| format!("day/drive/{camera}/data/0000000000.pgm");
    fixture.write_pair(&image("image_00"), &image("image_01"), SIZE, 3);
    fixture.write(
        "day/calib_cam_to_cam.txt",
        "S_rect_00: 40 24\nR_rect_00: 1 0 0 0 1 0 0 0 1\nP_rect_00: 50 0 20 0 0 50 12 0 0 0 1 0\n\
         P_rect_01: 50 0 20 -5 0 50 12 0 0 0 1 0\n",
    );
    fixture.write(
        "day/calib_velo_to_cam.txt",
        "calib_time: today\nR: 0 -1 0 0 0 -1 1 0 0\nT: 0 -0.2 -0.3\n",
    );
    // x forward, y left, z up: 5 m before the camera, a tenth of that to its left.
    let point = [5.3f32, 0.5, -0.2, 0.9].map(f32::to_le_bytes).concat();
    fixture.write("day/drive/velodyne_points/data/0000000000.bin", point);
    let found = frames(&fixture, "day/drive", "velodyne_points/data/*.bin");
    let truth = found[0].truth.as_ref().unwrap();
    let known = |(x, y): (usize, usize)| truth.disparity.get(x, y).is_finite();
    let pixels = (0..24).flat_map(|y| (0..40).map(move |x| (x, y)));
    let known: Vec<_> = pixels.filter(|at| known(*at)).collect();
    assert_eq!(known, [(15, 12)]);
    assert!((truth.disparity.get(15, 12) - 1.0).abs() < 1e-5);
    assert_eq!(truth.kind.density, MapDensity::Sparse);
    fixture.transcript("info day/drive => velodyne_points/data/*.bin");
}

#[test]
fn a_checkpoint_by_place_needs_poses() {
    let fixture = Fixture::new();
    scene(&fixture);
    fixture.write(
        "place.toml",
        "name = \"place\"\nalgorithms = [\"v3\"]\n[source]\nkind = \"recording\"\n\
         files = [\"p\"]\n[[checkpoint]]\nnumber = 1\nname = \"door\"\nat_m = [0, 0]\n\
         radius_m = 1\nheading_deg = 0\nheading_tolerance_deg = 9\n\
         [[checkpoint.cell]]\nat = [1, 1]\nfree = true\n",
    );
    fixture.fails("score place.toml -q -o r => 1: at_m needs poses");
}

#[test]
fn depth_images_of_pairs_that_svl_rectifies_are_refused() {
    let fixture = Fixture::new();
    fixture.write_euroc("60.0");
    for name in ["a", "b"] {
        fixture.write(&format!("mav0/depth/{name}.png"), png(SIZE, &steps()));
    }
    fixture.transcript(
        "record mav0 --truth depth/*.png -o x.mcap \
        => 1~ before svl rectifies them | --calib none",
    );
}

#[test]
fn frames_without_times_are_shown_by_their_numbers() {
    let fixture = Fixture::new();
    for (name, shift) in [("a", 3), ("b", 5)] {
        let [left, right] = ["left", "right"].map(|side| format!("q/{side}/{name}.pgm"));
        fixture.write_pair(&left, &right, SIZE, shift);
        fixture.write(&format!("q/depth/{name}.png"), png(SIZE, &steps()));
    }
    fixture.write("q/calib.txt", CALIB);
    let line = "score q --truth depth/*.png --algo b=bm:max_disparity=8 \
                --algo v=v3:max_disparity=8 --rerun none";
    fixture.transcript(&format!(
        "{line} -o r
        cat r/index.html => q, frame 1</h3> | >frame 0</button> | a bar per frame \
        | b, frame 1: | !bar per second
        compare r#b r#v -o c.html => before
        cat c.html => q, frame | !frame 0, at | !frame 1, at
        {line} --fps 10 -o timed
        cat timed/index.html => q, frame 1, 0.10 s</h3> | a bar per second"
    ));
}

#[test]
fn options_that_need_a_truth_are_told_where_there_is_none() {
    let fixture = Fixture::new();
    scene(&fixture);
    let line = "score p --algo bm:max_disparity=8 --rerun none";
    fixture.transcript(&format!(
        "{line} --area floor --beyond 2 --camera-height 0.3 -o r \
        => 0~ --area, --beyond, --camera-height need a ground truth
        {line} --ranges 2,4 -o s => 0~ --ranges needs a ground truth
        {line} --beyond 2 -o r => 0~ --beyond needs a ground truth
        {line} -o plain => 0~ !ground truth"
    ));
}
