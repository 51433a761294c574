//! Catalogue of messages: commands that fail, and a snapshot of their exit status and lines.
//!
//! Other tests assert exit status and names; the sentences and their cures are only here.

use super::fixture::{Fixture, pgm};
use svl::files::write_pfm;
use svl::stereo::Plane;

/// Commands by area, in the folder of [`inputs`].
const COMMANDS: &str = "
    # The command line
    record sim --timeout 1e20
    record sim --timeout 0
    record sim --rate 2000
    record sim --rate 1e-9
    record sim --rate 0
    record sim --trigger fixed:2000
    record sim --trigger fixed:
    record sim --queue 0
    record --duration 1e30
    record --max-skew-ms -1
    record --calib none --alpha 2
    record --threads 0
    record --frames many
    record --seed -1
    replay --speed 0
    replay --speed 1e-300
    replay --algo v9
    replay --algo bm:block_size=6
    score a.toml --algo v3:max_disparity=x
    algos v9
    bench --algo exec
    bench --max-disparity 60000
    bench --max-disparity 1000
    bench --size 8x8
    match l.png r.png -o a.pfm --algo exec
    reproduce 9.9
    datasets fetch eth3d
    fetch eth3d
    eval a.pfm b.pfm --protocol kitti
    eval a.pfm b.pfm --protocol eth3d --disparity-scale 1e300
    calibrate board board --squares 2x2 -o a.xml
    calibrate board board --square-m 0 -o a.xml
    calibrate distance ten=a.mcap
    calibrate distance 1m=
    calibrate convert a.xml b.yaml --to euroc
    calibrate convert a.xml b.txt --to kitti-raw
    calibrate convert a.xml b.yaml --to boofcv
    generate completions nosuch
    record sim:foo=1
    record sim:size=8x8
    record sim:arm_ms=abc
    record sim:scene=board,size=64x48
    record sim:pictures=9999
    record /dev/video0
    record sim --left /x
    record arena --trigger free
    record arena --queue 64
    record arena --timeout 1
    record arena --when-full drop
    replay --verfiy
    calibrate board board --rate 3 --yes -o a.xml
    record -o one.txt
    replay --rows one.txt
    replay --rerun one.txt
    replay --rerun http://
    recover a.mcap -o b.txt
    match l.png r.png -o c.txt
    match l.png r.png -o c.pfm --why c.jpg
    eval a.pfm b.pfm --protocol eth3d --error-map e.jpg
    calibrate board board --yes -o c.png
    calibrate convert a.xml b.pdf
    calibrate distance a.csv --figure b.png
    recover a.mcap
    recover a.mcap -o a.mcap
    replay a.mcap -o a.mcap --force
    replay a.mcap --algo v3 --algo v3
    replay a.mcap --algo v3:max_disparity=9,max_disparity=8
    match l.png -o a.pfm
    compare one
    view
    record ''
    record -o ''
    record --calib ''
    info ''
    record --left ''
    score a.toml --scenes ''
    datasets --data ''
    calibrate convert a.xml ,
    replay sim
    replay arena --algo v3
    calibrate distance 1m=a.mcap --target 9,9
    score ''
    calibrate distance ''
    calibrate check ''
    record --alpha 0.5
    nosuch
    record nosuch
    record simm
    record text.txt
    record text.mcap
    record -o no/a.mcap
    record sim:size=64x48,pictures=2 --trigger serial:/dev/nowhere
    replay nosuch.mcap
    replay text.txt
    replay a.mcap --algo exec:command=/no/such
    score nosuch.toml
    compare one two
    match nosuch.png r.png -o a.pfm
    eval nosuch.pfm b.pfm --protocol eth3d
    bench --algo exec:command=/no/such
    view nosuch.rrd
    view text.txt
    info nosuch.mcap
    recover nosuch.mcap -o a2.mcap
    calibrate check nosuch.mcap
    calibrate board nosuch --yes -o a.xml
    calibrate convert nosuch.xml a.yaml
    calibrate distance nosuch.csv
    datasets --data nosuch
    # record
    record -o there.mcap
    record nowhere -o o.mcap
    record empty -o o.mcap
    record odd -o b.mcap
    record odd -o there.mcap --force
    record odd --seed 3 -o o.mcap
    record -o a.txt
    record bad.toml -o o.mcap
    record there.mcap -o o.mcap
    record -o no/where.mcap
    record --frames 0
    record --duration -1
    record sim:arm=3 -o o.mcap
    record arena --rate 3
    record sim:size=64x48,pictures=2 --trigger fixed:9 --rate 9
    record sim:size=64x48,pictures=2 --trigger free --pairing trigger
    record sim:size=64x48,pictures=2 --max-skew-ms 3
    record sim:size=64x48,pictures=2 --rate 5000
    record sim:size=64x48,pictures=2 --trigger often
    replay pairs
    replay empty
    replay short.toml
    # replay
    replay missing.mcap
    replay none.mcap
    replay text.mcap
    replay .
    replay a.mcap --algo v2x
    replay a.mcap --speed 0
    replay a.mcap --rows rows.txt
    replay a.mcap --rows no/rows.csv
    replay a.mcap -o a.mcap
    replay a.mcap --rerun spwan
    replay a.mcap --truth /truth/dept
    replay a.mcap --algo v3:min_disparity=9,max_disparity=3
    # match
    match l.pgm small.pgm -o o.pfm
    match l.pgm missing.png -o o.pfm
    match l.pgm empty.png -o o.pfm
    match l.pgm text.png -o o.pfm
    match l.pgm cut.pgm -o o.pfm
    match l.pgm huge.pgm -o o.pfm
    match l.pgm . -o o.pfm
    match l.pgm r.pgm -o o.pfm --calib text.png
    match l.pgm r.pgm -o o.pfm --algo v33
    match l.pgm r.pgm -o o.pfm --algo v3:max_disparty=4
    match l.pgm r.pgm -o o.pfm --algo v3:max_disparity=x
    match l.pgm r.pgm -o o.pfm --algo v3:max_disparity=99999
    match l.pgm r.pgm -o o.pfm --algo v3:min_disparity=9,max_disparity=3
    match l.pgm r.pgm -o o.jpg
    match l.pgm r.pgm -o no/where.pfm
    match l.pgm r.pgm -o o.png --why ./o.png
    match l.pgm r.pgm -o /dev/null
    match l.pgm r.pgm -o o.pfm --calib /dev/zero
    match l.pgm r.pgm -o there.pfm
    match l.pgm r.pgm -o o.pfm --algo v5:model=none.safetensors
    match l.pgm r.pgm -o o.pfm --algo v5:model=rank.toml
    match l.pgm r.pgm -o o.pfm --algo v5:revision=4
    # eval
    eval small.pfm truth.pfm --protocol eth3d
    eval small.pfm truth.pfm --protocol middeval3
    eval d.pfm nowhere.pfm --protocol kitti12
    eval d.pfm cut.pfm --protocol kitti12
    eval d.pfm cut.npz --protocol kitti12
    eval d.pfm missing.npz --protocol kitti12
    eval d.pfm eight.pgm --protocol eth3d
    eval eight.pgm truth.pfm --protocol eth3d
    eval d.pfm truth.pfm --protocol eth3d --mask mask.pgm
    eval d.pfm truth.pfm --protocol eth3d --right-truth small.pfm
    eval d.pfm truth.pfm --protocol kitti15 --object-map mask.pgm
    eval d.pfm truth.pfm --protocol kitti13
    eval d.pfm truth.pfm --protocol kitti12 --object-map noc.pgm
    eval d.pfm truth.pfm --protocol eth3d --max-disparity 9
    eval d.pfm truth.pfm --protocol eth3d --disparity-scale 0
    eval d.pfm truth.pfm --protocol eth3d --disparity-scale 4
    eval d.pfm truth.pfm --protocol eth3d --error-map e.jpg
    eval d.pfm truth.pfm --protocol eth3d --mask noc.pgm --right-truth d.pfm
    # calibrate
    calibrate convert cv.yml c.xml
    calibrate convert cv.yml c.txt --unit m
    calibrate convert cv.yml c.pdf --unit m
    calibrate convert cv.yml cv.yml --force --unit m
    calibrate convert cv.yml c.xml --unit foot
    calibrate convert cv.yml c.xml --from opencw
    calibrate convert cv.yml c.xml --from kalibr
    calibrate convert cv.yml l.yaml,r.yaml --unit m
    calibrate convert cv.yml l.yaml,r.yaml --unit squares
    calibrate convert cv.yml c.txt --to kitti --unit m
    calibrate convert other.yaml c.xml
    calibrate convert nothing.xml c.xml
    calibrate distance words.csv
    calibrate distance columns.csv
    calibrate distance few.csv
    calibrate distance nan.csv
    calibrate distance neither.csv
    calibrate distance swapped.csv
    calibrate distance missing.csv
    calibrate distance no.mcap
    calibrate distance 10cm=no.mcap
    calibrate distance ten=no.mcap
    calibrate distance few.csv --target 1;2
    calibrate distance few.csv --figure a.png
    calibrate distance few.csv --table few.csv
    calibrate distance
    # score
    score bare.toml
    score nameless.toml
    score unknown.toml
    score algorithm.toml
    score binary.toml
    score missing.toml
    score scenarios/drive.toml
    score middlebury.toml
    score middlebury.toml --data .
    score short.toml --stress fog
    score short.toml --drives none
    score short.toml --stress noise=-1
    score short.toml --stress noise=1/x
    score short.toml --stress noise=1/1
    score short.toml --stress noise=1 --stress noise=2
    score short.toml --stress skew=0.5
    score wide.toml
    score low.toml
    score rows.toml
    score stop.toml
    score late.toml
    score who.toml
    score long.toml
    score small.toml --rerun spawn
    score small.toml --every 2
    score small.toml --repeat 3
    record small.toml -o o.mcap
    tune small.toml --algo v3 --script keys
    # label, train, tune
    label checkpoints sim --script keys
    label checkpoints nothing.mcap --script keys
    label checkpoints empty --script keys
    label checkpoints p --script keys
    label checkpoints p --script keys -o p.json
    label checkpoints p --script keys --grid 0x3
    label checkpoints p --script wrong
    label checkpoints p
    label checkpoints p --script keys -o bad.toml
    train v5 short.toml --seeds 4..5 -o t.safetensors --algo v5:target=near
    train v5 short.toml --scenes cones -o t.safetensors
    train v5 short.toml --seeds 5..4 -o t.safetensors
    train v5 short.toml --seeds 3,3 -o t.safetensors
    train v5 short.toml --seeds a -o t.safetensors
    train v5 short.toml --seeds 1..5000 -o t.safetensors
    train v5 short.toml --seeds 4..5 -o mine.safetensors
    train v5 short.toml --seeds 4..5 -o t.txt
    train v5 short.toml --seeds 4..5 -o mine.safetensors
    train v5 short.toml --seeds 4..5 --epochs 0 -o t.safetensors
    train filter run.mcap --kind floor -o t.safetensors
    train filter none.mcap --kind floor -o t.safetensors
    train filter short.toml --kind flor -o t.safetensors
    train filter short.toml --kind floor -o t.bin
    train filter short.toml --kind floor -o mine.safetensors
    train filter short.toml --kind floor --hidden 0 -o t.safetensors
    label windows run.mcap
    label windows run.mcap --kind floor --script none
    replay run.mcap --filter none.safetensors
    replay run.mcap --filter run.mcap
    tune run.mcap
    tune run.mcap other.mcap
    tune nothing.mcap --script bad
    tune run.mcap -o o.csv
";

/// Small inputs, most of them wrong in one way.
pub(super) fn inputs() -> Fixture {
    let fixture = Fixture::new();
    fixture.run("record --frames 2 -o a.mcap");
    std::fs::copy(fixture.path("a.mcap"), fixture.path("run.mcap")).unwrap();
    fixture.write("none.mcap", "");
    for name in ["text.txt", "text.mcap", "text.png", "no.mcap"] {
        fixture.write(
            name,
            "this is no recording and no image, and long enough to look at",
        );
    }
    for name in ["there.mcap", "there.pfm", "mine.toml", "mine.safetensors"] {
        fixture.write(name, "precious");
    }
    fixture.write("empty/notes.txt", "");
    fixture.write("bad.toml", "name = 3");

    fixture.write_pair("l.pgm", "r.pgm", (160, 96), 7);
    fixture.write("small.pgm", pgm(4, 4, &[0; 16]));
    fixture.write("cut.pgm", &pgm(64, 24, &[0; 64 * 24])[..200]);
    fixture.write("huge.pgm", "P5\n4000000000 4000000000\n255\n");
    fixture.write("empty.png", "");
    fixture.write("rank.toml", "rank = 50\n");
    fixture.write_pair("odd/im0.pgm", "odd/im1.pgm", (40, 20), 3);
    fixture.write("odd/im1.pgm", pgm(4, 2, &[0; 8]));
    let stamped = ["pairs/left/1700000000.pgm", "pairs/right/1700000000.pgm"];
    fixture.write_pair(stamped[0], stamped[1], (64, 48), 4);
    fixture.write_pair(
        "p/left/1700000000.pgm",
        "p/right/1700000000.pgm",
        (64, 48),
        4,
    );

    const NO: f32 = f32::INFINITY;
    let map = |name: &str, row: &[f32]| {
        let plane = Plane::from_vec(row.len(), 1, row.to_vec()).unwrap();
        write_pfm(&fixture.path(name), &plane).unwrap();
    };
    map("truth.pfm", &[4.0, 4.0, 4.0, NO, 4.0]);
    map("d.pfm", &[4.0, 5.5, NO, 4.0, 0.5]);
    map("small.pfm", &[1.0, 2.0]);
    map("nowhere.pfm", &[NO; 5]);
    fixture.write("cut.pfm", "Pf\n5 1\n-1\nabc");
    fixture.write("cut.npz", "PK");
    fixture.write("eight.pgm", pgm(5, 1, &[8; 5]));
    fixture.write("noc.pgm", pgm(5, 1, &[255, 255, 255, 0, 128]));
    fixture.write("mask.pgm", pgm(4, 1, &[255; 4]));

    fixture.write("cv.yml", super::calibrate_convert::PAIR);
    fixture.write("other.yaml", "a: 1\n");
    let tables = [
        ("words.csv", "distance_cm,disparity_px\n10,x\n"),
        ("columns.csv", "cm,px\n10,3\n"),
        ("few.csv", "distance_cm,disparity_px\n10,3\n20,1.5\n"),
        (
            "nan.csv",
            "distance_cm,disparity_px\n10,nan\n20,1.5\n30,1\n",
        ),
        ("neither.csv", "distance_cm,disparity_px,recording\n10,,\n"),
        (
            "swapped.csv",
            "distance_cm,disparity_px\n10,100\n12,110\n14,130\n",
        ),
    ];
    for (name, text) in tables {
        fixture.write(name, text);
    }

    fixture.write_short_arena("short.toml", 2);
    let arena = include_str!("../../../scenarios/arena.toml");
    fixture.write("unknown.toml", arena.replacen("\nmust", "\nmist", 1));
    fixture.write("algorithm.toml", arena.replacen("\"v3\"", "\"v33\"", 1));
    fixture.write("binary.toml", [0xff, 0xfe, 0]);
    fixture.write(
        "bare.toml",
        "[source]\n[[checkpoint]]\nname = \"a\"\n[[gate]]\n",
    );
    fixture.write("nameless.toml", "[source]\nkind = \"arena\"\n");
    let middlebury = include_str!("../../../scenarios/middlebury.toml");
    fixture.write("middlebury.toml", middlebury);
    let courses = super::drive::courses("");
    fixture.write("small.toml", &courses);
    fixture.write("long.toml", courses.replace("frames = 280", "frames = 401"));
    let drives = [
        ("wide.toml", "radius_m = 0.2"),
        ("low.toml", "max_speed_m_per_s = 0.02"),
        ("rows.toml", "steering = { rows = [3] }"),
        ("stop.toml", "steering = { stop_m = 0.9 }"),
        ("late.toml", "latency_ms = -1"),
        ("who.toml", "latency_ms = { smg = 5 }"),
    ];
    for (name, keys) in drives {
        fixture.write(name, format!("{courses}[drive]\n{keys}\n"));
    }
    fixture.write("keys", "q");
    fixture.write("wrong", "q quit");
    fixture.write("bad", "wait nonsense");
    fixture
}

/// Names and contents of the files of a folder and of those below it.
fn files(folder: &std::path::Path) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut found: Vec<_> = entries
        .flat_map(|entry| {
            let path = entry.unwrap().path();
            if path.is_dir() {
                files(&path)
            } else {
                vec![(path.clone(), std::fs::read(path).unwrap())]
            }
        })
        .collect();
    found.sort();
    found
}

/// A command with the lines of its message, as the catalogue shows it.
fn message(fixture: &Fixture, command: &str) -> String {
    if command.starts_with('#') {
        return format!("\n{command}\n\n");
    }
    let ran = fixture.svl_with(command, &[("SVL_DATASETS", "")]);
    let code = ran.code.unwrap();
    let lines = ran.stderr.lines().filter(|line| !line.is_empty());
    let lines: Vec<_> = lines.map(|line| format!("    {line}\n")).collect();
    let errors = lines.iter().filter(|line| line.starts_with("    error: "));
    assert_eq!(
        errors.count(),
        usize::from(code != 0),
        "{command}: {}",
        ran.stderr
    );
    format!("{command} => {code}\n{}", lines.concat())
}

#[test]
fn every_message_is_one_line_with_its_cure_and_no_file_is_touched() {
    let fixture = inputs();
    let before = files(&fixture.path(""));
    let commands = COMMANDS.lines().map(str::trim);
    let commands: Vec<_> = commands.filter(|line| !line.is_empty()).collect();
    let catalogue = std::thread::scope(|scope| {
        let parts = commands.chunks(commands.len().div_ceil(4));
        let workers: Vec<_> = parts
            .map(|part| {
                let fixture = &fixture;
                scope.spawn(move || {
                    let messages = part.iter().map(|command| message(fixture, command));
                    messages.collect::<String>()
                })
            })
            .collect();
        workers
            .into_iter()
            .map(|worker| worker.join().unwrap())
            .collect::<String>()
    });
    insta::assert_snapshot!(catalogue);
    assert!(
        files(&fixture.path("")) == before,
        "a file was written or changed"
    );
}
