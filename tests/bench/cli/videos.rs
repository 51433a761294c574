//! Users' videos, side by side and one of each camera, whole and damaged.

use super::fixture::{CommandLine, Fixture, has, pgm};
use super::own_data::frames;
use std::ops::Range;
use std::process::Command;

const RECORD: &str = "record films --left left.mp4 --right right.mp4 -o out.mcap --force";

/// Runs ffmpeg in the folder of a fixture.
pub(super) fn ffmpeg(fixture: &Fixture, line: &str) {
    let mut ffmpeg = Command::new("ffmpeg");
    let ffmpeg = ffmpeg.args(["-v", "error", "-y"]).args(line.arguments());
    let ran = ffmpeg.current_dir(fixture.path("")).status();
    assert!(ran.unwrap().success(), "{line}");
}

#[test]
fn two_videos_are_pairs() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let fixture = Fixture::new();
    let film = |size: &str, rate: u32, frames: u32, name: &str| {
        // The two cameras see different things.
        let is_right = name.starts_with('b');
        let kind = if is_right { "testsrc2" } else { "testsrc" };
        ffmpeg(
            &fixture,
            &format!(
                "-f lavfi -i {kind}=size={size}:rate={rate} -frames:v {frames} -c:v mjpeg {name}"
            ),
        );
    };
    film("128x48", 25, 30, "both.mkv");
    fixture.run("record both.mkv --side-by-side -o both.mcap");
    let pairs = frames(&fixture, "both.mcap");
    assert_eq!((pairs.len(), pairs[0].pair.size()), (30, (64, 48)));
    let (stamp_ns, skew_ns) = (pairs[3].stamp_ns, pairs[3].exposure.skew_ns);
    assert_eq!((stamp_ns, skew_ns), (120_000_000, None));
    assert!(pairs[3].color.is_some());
    // Two with one rate, one of them shorter. By number it is not known which of them is longer.
    film("64x48", 25, 30, "a.avi");
    film("64x48", 25, 28, "b.avi");
    film("32x48", 25, 3, "small.avi");
    film("64x48", 30, 3, "fast.avi");
    // Truncated: the part before is kept, the part after is counted.
    let whole = fixture.bytes("both.mkv");
    fixture.write("cut.mkv", &whole[..whole.len() / 2]);
    fixture.write("no.mp4", "no video at all");
    let two = "record . --left a.avi --right";
    fixture.transcript(&format!(
        "{two} b.avi -o two.mcap => 0~ 2 images outside
        {two} b.avi -o numbers.mcap --fps 25 \
        => 4~ ./a.avi has 30 frames, ./b.avi 28 | 2 images dropped
        {two} small.avi -o no.mcap => 1: 64x48 | 32x48
        {two} fast.avi -o no.mcap => 1: 25.000 frames a second | 30.000
        {two} none.avi -o no.mcap => 1: none.avi | no such file
        record cut.mkv --side-by-side -o cut.mcap \
        => 4~ frames dropped: a video is damaged or cut off
        record no.mp4 --side-by-side -o no.mcap => 1: no.mp4: ffprobe cannot read it"
    ));
    for name in ["two.mcap", "numbers.mcap"] {
        assert_eq!(frames(&fixture, name).len(), 28);
    }
    let kept = frames(&fixture, "cut.mcap").len();
    assert!((5..30).contains(&kept), "{kept}");
}

#[test]
fn without_ffmpeg_the_cure_is_told() {
    let fixture = Fixture::new();
    fixture.write("a.mp4", "anything");
    let nowhere = fixture.path("nowhere").display().to_string();
    fixture
        .svl_with(
            "record a.mp4 --side-by-side -o a.mcap",
            &[("PATH", &nowhere)],
        )
        .failed(1, &["not installed", "apt install ffmpeg"]);
}

/// A video of 10 frames a second, each as bright as its number.
fn write_film(fixture: &Fixture, width: u32, numbers: Range<u32>, filter: &str, name: &str) {
    let (first, seconds) = (numbers.start, numbers.len() as f64 / 10.0);
    let source = format!(
        "color=size={width}x48:rate=10:d={seconds},format=yuv420p,\
         geq=lum=16+5*(N+{first}):cb=128:cr=128{filter}"
    );
    // Matroska keeps the times of frames, whatever the option for that is called.
    let is_mp4 = name.ends_with(".mp4");
    let first = if is_mp4 { "film.mkv" } else { name };
    ffmpeg(
        fixture,
        &format!("-f lavfi -i {source} -c:v mjpeg -q:v 1 {first}"),
    );
    if is_mp4 {
        ffmpeg(fixture, &format!("-i {first} -c copy {name}"));
    }
}

/// The number of the left and of the right frame of each pair, and its stamp in tenths of a second.
fn pairs(fixture: &Fixture, name: &str) -> Vec<(u64, u64, u64)> {
    let number = |gray: u8| (f64::from(gray) * 219.0 / 255.0 / 5.0).round() as u64;
    let pairs = frames(fixture, name).into_iter().map(|frame| {
        let [left, right] = [frame.pair.left(), frame.pair.right()].map(|image| image.get(20, 20));
        assert_eq!(frame.stamp_ns % 100_000_000, 0);
        (number(left), number(right), frame.stamp_ns / 100_000_000)
    });
    pairs.collect()
}

/// True pairs of the frames with these numbers.
fn alike(numbers: impl Iterator<Item = u64>) -> Vec<(u64, u64, u64)> {
    numbers.map(|n| (n, n, n)).collect()
}

#[test]
fn two_videos_are_paired_by_their_times() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let fixture = Fixture::new();
    fixture.write("films/README", "");
    let lacks = |first: u32| format!(",select='not(between(n,{first},{}))'", first + 4);
    write_film(&fixture, 64, 0..40, &lacks(5), "films/left.mp4");
    write_film(&fixture, 64, 0..40, &lacks(20), "films/right.mp4");
    fixture.transcript(&format!(
        "{RECORD} => 4~ 10 images dropped: without a partner"
    ));
    let both = (0..40).filter(|n| n / 5 != 1 && n / 5 != 4);
    assert_eq!(pairs(&fixture, "out.mcap"), alike(both));
    // By number their gaps make false pairs, as the user asked for.
    fixture.run(&format!("{RECORD} --fps 10"));
    assert_eq!(pairs(&fixture, "out.mcap")[5], (10, 5, 5));

    // The right camera started three frames later, and stopped later.
    write_film(&fixture, 64, 0..20, "", "films/left.mp4");
    write_film(&fixture, 64, 3..23, "", "films/start.mp4");
    let start_at = |s: &str| {
        let films = "-i films/start.mp4 -c copy films/right.mp4";
        ffmpeg(&fixture, &format!("-itsoffset {s} {films}"));
    };
    for offset in ["0.3", "0.32"] {
        start_at(offset);
        fixture.transcript(&format!(
            "{RECORD} => 0~ later than that of films/left.mp4 | 6 images outside"
        ));
        assert_eq!(pairs(&fixture, "out.mcap"), alike(3..20));
    }
    let skew = frames(&fixture, "out.mcap")[0].exposure.skew_ns;
    // In ticks of the file's clock.
    assert_eq!(skew.unwrap() / 100_000, 200);

    // Two clocks without a common time.
    start_at("1000");
    fixture.transcript(&format!(
        "{RECORD} => 1: films/left.mp4: has no frame at the time | --fps HZ pairs by number
        {RECORD} --fps 10"
    ));
    assert_eq!(pairs(&fixture, "out.mcap")[1], (1, 4, 1));
}

#[test]
fn a_damaged_frame_shifts_no_other() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let fixture = Fixture::new();
    fixture.write("films/README", "");
    let damage = |name: &str| {
        let mut bytes = fixture.bytes(name);
        let movie = bytes.windows(4).position(|word| word == b"movi").unwrap();
        let starts = (movie..bytes.len()).filter(|at| bytes[*at..].starts_with(b"00dc"));
        let starts: Vec<_> = starts.collect();
        // One frame has no image, another not even the header of its chunk.
        bytes[starts[10] + 8..starts[11]].fill(0);
        bytes[starts[15]..starts[16]].fill(0);
        fixture.write(name, bytes);
    };
    write_film(&fixture, 64, 0..30, "", "films/left.avi");
    write_film(&fixture, 64, 0..30, "", "films/right.avi");
    write_film(&fixture, 128, 0..30, "", "films/both.avi");
    damage("films/right.avi");
    damage("films/both.avi");
    // Numbers cannot tell where frames are lost, and say so.
    let record = "record films --left left.avi --right right.avi --force -o";
    let dropped = "2 frames dropped: a video is damaged or cut off";
    fixture.transcript(&format!(
        "{record} two.mcap => 4~ {dropped} | 2 images dropped: without
        record films/both.avi --side-by-side -o one.mcap => 4~ {dropped}
        {record} out.mcap --fps 10 => 4~ {dropped} | frames are counted without the 2 lost"
    ));
    for name in ["two.mcap", "one.mcap"] {
        let intact = (0..30).filter(|n| ![10, 15].contains(n));
        assert_eq!(pairs(&fixture, name), alike(intact));
    }
}

/// A video of 25 frames a second of a camera that shakes, from a frame on; the right one sees all
/// farther left by that many pixels.
fn write_shaken(fixture: &Fixture, from: u32, shift: u32, name: &str) {
    let square = |i: usize| {
        let number = (i % 480 / 9 * 7919 + i / 480 / 9 * 104_729) as u64;
        (number.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as u8
    };
    let pixels: Vec<_> = (0..480 * 360).map(square).collect();
    fixture.write("wall.pgm", pgm(480, 360, &pixels));
    let wave = |size: u32, terms: [(u32, f64); 3]| {
        let terms = terms.map(|(px, speed)| format!("{px}*sin((n+{from})*{speed})"));
        format!("{size}+{}", terms.join("+"))
    };
    let x = wave(60 + shift, [(20, 0.31), (12, 0.83), (9, 0.123)]);
    let y = wave(50, [(16, 0.27), (13, 0.71), (8, 0.057)]);
    let crop = format!("crop=320:240:x='{x}':y='{y}',format=gray");
    let wall = "-loop 1 -framerate 25 -i wall.pgm -frames:v 120";
    ffmpeg(
        fixture,
        &format!("{wall} -vf {crop} -c:v mjpeg -q:v 2 {name}"),
    );
}

#[test]
fn videos_that_were_started_by_hand_are_told_their_offset() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let fixture = Fixture::new();
    fixture.write("films/README", "");
    write_shaken(&fixture, 0, 0, "films/left.avi");
    write_shaken(&fixture, 0, 8, "films/right.avi");
    write_shaken(&fixture, 30, 8, "films/late.avi");
    write_shaken(&fixture, 30, 0, "films/late_left.avi");
    let record = |left: &str, right: &str, more: &str, words: &str| {
        let films = format!("films --left {left}.avi --right {right}.avi");
        let line = format!("record {films} -o out.mcap --force {more}");
        fixture.transcript(&format!("{line} => 0~ {words}"));
    };
    record("left", "right", "", "!right-offset-ms");
    // Whichever is late; the proposal pairs images of one moment.
    for (left, right, ms) in [
        ("left", "late", "1200.0"),
        ("late_left", "right", "-1200.0"),
    ] {
        let cure = format!("--right-offset-ms {ms}");
        record(left, right, "", &format!("`{cure}`"));
        for more in ["", " --fps 25 --allow-loss 30"] {
            record(left, right, &(cure.clone() + more), "!`--right-offset-ms");
            let pairs = frames(&fixture, "out.mcap");
            assert_eq!(pairs.len(), 90, "{left}");
            let [left, right] = [pairs[40].pair.left(), pairs[40].pair.right()];
            let apart = (100..200).map(|x| left.get(x + 8, 120).abs_diff(right.get(x, 120)));
            assert!(apart.max() < Some(60));
        }
    }
    fixture.fails(
        "record films --left l* --right r* --right-offset-ms 5 -o n.mcap => 2: two videos
         info films --left left.avi --right left.avi => 1: one picture twice | first 16 pairs
         record films --left left.avi --right left.avi -o n.mcap => 1: one picture twice
         score films --left left.avi --right left.avi => 1: one picture twice",
    );
}

#[test]
fn a_video_is_turned_before_its_halves_are_cut() {
    if !has("ffmpeg", &["-version"]) {
        return;
    }
    let fixture = Fixture::new();
    // Two halves of one grey each, then turned as a telephone's are.
    let film = |filter: &str, name: &str| {
        let source = format!("color=size=64x48:rate=10:d=1,format=gray,{filter}");
        ffmpeg(
            &fixture,
            &format!("-f lavfi -i {source} -c:v mjpeg -q:v 1 {name}"),
        );
    };
    film("geq=lum='if(lt(X,32),50,200)'", "both.mov");
    film("geq=lum='if(lt(Y,24),50,200)'", "upright.mov");
    // By the matrix of its track header, the second of the file's: options of ffmpeg differ.
    let mut turned = fixture.bytes("upright.mov");
    let matrix = |cells: [i32; 5]| cells.map(i32::to_be_bytes).concat();
    let upright = matrix([0x1_0000, 0, 0, 0, 0x1_0000]);
    let mut places = (0..turned.len()).filter(|at| turned[*at..].starts_with(&upright));
    let track = places.nth(1).unwrap();
    turned[track..track + 20].copy_from_slice(&matrix([0, 0x1_0000, 0, -0x1_0000, 0]));
    fixture.write("turned.mov", &turned);
    for (name, layout, size, greys) in [
        ("both", "", (32, 48), [1, 4]),
        ("both", "=right-left", (32, 48), [4, 1]),
        ("upright", "=top-bottom", (64, 24), [1, 4]),
        ("upright", "=bottom-top", (64, 24), [4, 1]),
        ("turned", "", (24, 64), [4, 1]),
    ] {
        let no = if name == "turned" { "" } else { "!" };
        fixture.transcript(&format!(
            "record {name}.mov --side-by-side{layout} -o out.mcap --force \
            => 0~ {no}turned.mov: is turned by"
        ));
        let pair = frames(&fixture, "out.mcap").remove(0).pair;
        let found = [pair.left(), pair.right()].map(|image| image.get(9, 9) / 50);
        assert_eq!((pair.size(), found), (size, greys), "{name}{layout}");
    }
    fixture.fails("record both.mov --side-by-side=up -o n.mcap => 2: left-right | right-left");
}
