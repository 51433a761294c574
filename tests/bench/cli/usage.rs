//! Exit code 2 is for the command line itself, 1 for files and machines; the message names the
//! option and what was expected.

use super::fixture::Fixture;

/// Commands, whose words stand between spaces, '' being an empty one; and what the line says.
const WRONG: &[(&str, &str)] = &[
    // Numbers out of their range, names of nothing.
    ("record sim --timeout 1e20", "--timeout | 0.01 to 86400"),
    ("record sim --timeout 0", "--timeout | 0.01 to 86400"),
    ("record sim --rate 2000", "--rate | 0.1 to 1000"),
    ("record sim --rate 1e-9", "--rate | 0.1 to 1000"),
    ("record sim --rate 0", "--rate | 0.1 to 1000"),
    (
        "record sim --trigger fixed:2000",
        "fixed:2000 | 0.1 to 1000",
    ),
    ("record sim --trigger fixed:", "--trigger | 0.1 to 1000"),
    ("record sim --queue 0", "--queue | 1 to 4096"),
    ("record --duration 1e30", "--duration | 0.001 to"),
    ("record --max-skew-ms -1", "--max-skew-ms | 0 to 60000"),
    ("record --calib none --alpha 2", "--alpha | 0 to 1"),
    ("record --threads 0", "--threads | 1 to 1024"),
    ("record --frames many", "--frames | 1 to"),
    ("record --seed -1", "--seed | 0 to"),
    ("replay --rate 0", "--rate | 0.001 to 1000 | asap"),
    ("replay --rate 1e-300", "--rate"),
    ("replay --algo v9", "unknown algorithm 'v9'"),
    (
        "replay --algo bm:block_size=6",
        "--algo | block_size=6 is even",
    ),
    ("score a.toml --algo v3:max_disparity=x", "max_disparity=x"),
    ("algos v9", "unknown algorithm 'v9' | svl algos"),
    ("bench --algo exec", "exec:command=PROGRAM"),
    ("bench --max-disparity 60000", "--max-disparity | 0 to 1024"),
    ("bench --max-disparity 1000", "max_disparity=1000"),
    ("bench --size 8x8", "--size | 32..=4096"),
    (
        "match l.png r.png -o a.pfm --algo exec",
        "exec:command=PROGRAM",
    ),
    ("reproduce 9.9", "unknown figure '9.9'"),
    (
        "datasets fetch nosuch",
        "unknown data set 'nosuch' | svl datasets",
    ),
    ("datasets fetch eth3d nosuch", "no part 'nosuch'"),
    ("eval a.pfm b.pfm --protocol kitti", "--protocol"),
    (
        "eval a.pfm b.pfm --protocol eth3d --scale 1e300",
        "--scale | 0.001 to 65536",
    ),
    ("calibrate board board --squares 2x2 -o a.xml", "3 to 50"),
    (
        "calibrate board board --square-m 0 -o a.xml",
        "--square-m | 0.0001 to 100",
    ),
    ("calibrate distance ten=a.mcap", "'ten' | 130cm"),
    ("calibrate distance 1m=", "1m= | recording"),
    ("calibrate convert a.xml b.yaml --to euroc", "read only"),
    ("completions nosuch", "nosuch | bash"),
    // Cameras.
    ("record sim:foo=1", "no option 'foo' | arm_ms"),
    ("record sim:size=8x8", "size=8x8 | 16 to 4096"),
    ("record sim:arm_ms=abc", "arm_ms=abc | 0..=60000"),
    ("record sim:scene=board,size=64x48", "640x480 | 64x48"),
    ("record sim:pictures=9999", "9999 pictures of 640x480"),
    ("record /dev/video0", "v4l2:/dev/video0,/dev/video2"),
    ("record sim --left /x", "--left | recording"),
    ("record arena --trigger free", "--trigger | 'arena'"),
    (
        "calibrate board board --rate 3 --yes -o a.xml",
        "--rate | 'board'",
    ),
    // Endings.
    ("record -o one.txt", "one.txt | .mcap"),
    ("replay --rows one.txt", "one.txt | .csv or .parquet"),
    ("replay --rerun one.txt", "one.txt | FILE.rrd"),
    (
        "replay --rerun http://",
        "http:// | rerun+http://127.0.0.1:9876/proxy",
    ),
    ("recover a.mcap -o b.txt", "b.txt | .mcap"),
    ("match l.png r.png -o c.txt", "c.txt | .pfm or .png"),
    ("match l.png r.png -o c.pfm --why c.jpg", "c.jpg | .png"),
    (
        "eval a.pfm b.pfm --protocol eth3d --error-map e.jpg",
        "e.jpg | .png",
    ),
    ("calibrate board board --yes -o c.png", "c.png | .xml"),
    ("calibrate convert a.xml b.pdf", "b.pdf | .yaml"),
    ("calibrate distance a.csv --figure b.png", "b.png | .svg"),
    // What is missing, empty or there twice.
    ("recover a.mcap", "--output"),
    ("recover a.mcap -o a.mcap", "a.mcap | named twice"),
    ("replay a.mcap -o a.mcap --force", "a.mcap | named twice"),
    ("replay a.mcap --algo v3 --algo v3", "v3 | named twice"),
    ("match l.png -o a.pfm", "<RIGHT>"),
    ("compare one", "REPORT"),
    ("view", "<FILE>"),
    ("record ''", "SOURCE"),
    ("record -o ''", "--output"),
    ("record --calib ''", "--calib"),
    ("info ''", "<FILE>"),
    ("record --left ''", "--left"),
    ("score a.toml --scenes ''", "--scenes"),
    ("datasets fetch eth3d --from ''", "--from"),
    ("calibrate convert a.xml ,", "one has no name"),
    ("replay sim", "sim: is no recording | svl record sim"),
    (
        "replay arena --algo v3",
        "arena: is no recording | svl record arena",
    ),
    (
        "calibrate distance 1m=a.mcap --cells 9,9",
        "--cells | 9,9 | 5x3 cells",
    ),
    ("score ''", "<SCENARIO>"),
    ("calibrate distance ''", "TABLE.csv"),
    ("calibrate check ''", "<RECORDING>"),
    ("datasets fetch eth3d", "--data DIR | SVL_DATASETS"),
    ("record --alpha 0.5", "--calib"),
    ("nosuch", "'nosuch'"),
];

/// The same, of what is not there.
const FAILED: &[(&str, &str)] = &[
    (
        "record nosuch",
        "nosuch | sim | v4l2:LEFT,RIGHT | genicam: | arena | .toml",
    ),
    ("record simm", "simm | sim | v4l2:LEFT,RIGHT"),
    ("record text.txt", "text.txt | not a source | sim"),
    ("record text.mcap", "text.mcap"),
    ("record -o no/a.mcap", "no | no such folder"),
    ("record sim --trigger serial:/dev/nowhere", "/dev/nowhere"),
    ("replay nosuch.mcap", "nosuch.mcap | no such file"),
    ("replay text.txt", "text.txt"),
    ("replay a.mcap --algo exec:command=/no/such", "/no/such"),
    ("score nosuch.toml", "nosuch.toml | no such file"),
    ("compare one two", "one | not a report"),
    (
        "match nosuch.png r.png -o a.pfm",
        "nosuch.png | no such file",
    ),
    (
        "eval nosuch.pfm b.pfm --protocol eth3d",
        "no such file | check the name",
    ),
    (
        "bench --algo exec:command=/no/such",
        "/no/such | check its name",
    ),
    (
        "view nosuch.rrd",
        "nosuch.rrd | no such file or folder; check the name",
    ),
    ("view text.txt", "text.txt | .mcap | .rrd"),
    ("info nosuch.mcap", "nosuch.mcap | no such file"),
    (
        "recover nosuch.mcap -o a2.mcap",
        "nosuch.mcap | no such file",
    ),
    (
        "calibrate check nosuch.mcap",
        "nosuch.mcap | no such source | FILE.mcap | FOLDER",
    ),
    (
        "calibrate board nosuch --yes -o a.xml",
        "nosuch | v4l2:LEFT,RIGHT",
    ),
    (
        "calibrate convert nosuch.xml a.yaml",
        "nosuch.xml | no such file",
    ),
    (
        "calibrate distance nosuch.csv",
        "nosuch.csv | no such table",
    ),
    (
        "datasets fetch eth3d --from nosuch --data d",
        "nosuch | folder",
    ),
];

#[test]
fn wrong_words_are_2_and_what_is_not_there_is_1() {
    let fixture = Fixture::new();
    fixture.write("text.txt", "words");
    fixture.write("text.mcap", "words");
    fixture
        .svl(&["record", "--frames", "2", "-o", "a.mcap"])
        .done();
    let before = std::fs::read(fixture.path("a.mcap")).unwrap();
    for (code, table) in [(2, WRONG), (1, FAILED)] {
        for (command, words) in table {
            let args: Vec<_> = command
                .split(' ')
                .map(|word| if word == "''" { "" } else { word })
                .collect();
            let words: Vec<_> = words.split(" | ").collect();
            let ran = fixture.svl_with(&args, &[("SVL_DATASETS", "")]);
            println!("svl {command}\n  {}", ran.stderr);
            ran.failed(code, &words);
        }
    }
    assert_eq!(std::fs::read(fixture.path("a.mcap")).unwrap(), before);
    let left: Vec<_> = std::fs::read_dir(fixture.path(""))
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(left.len(), 3, "nothing else was written: {left:?}");
}
