//! Exit code 2 is for the command line itself, 1 for files and machines; the message names the
//! option and what was expected.

use super::fixture::Fixture;

/// Commands with the words of their error line, as read by [`Fixture::fails`].
const WRONG: &str = "
    # Numbers out of their range, names of nothing.
    record sim --timeout 1e20 => 2: --timeout | 0.01 to 86400
    record sim --timeout 0 => 2: --timeout | 0.01 to 86400
    record sim --rate 2000 => 2: --rate | 0.1 to 1000
    record sim --rate 1e-9 => 2: --rate | 0.1 to 1000
    record sim --rate 0 => 2: --rate | 0.1 to 1000
    record sim --trigger fixed:2000 => 2: fixed:2000 | 0.1 to 1000
    record sim --trigger fixed: => 2: --trigger | 0.1 to 1000
    record sim --queue 0 => 2: --queue | 1 to 4096
    record --duration 1e30 => 2: --duration | 0.001 to
    record --max-skew-ms -1 => 2: --max-skew-ms | 0 to 60000
    record --calib none --alpha 2 => 2: --alpha | 0 to 1
    record --threads 0 => 2: --threads | 1 to 1024
    record --frames many => 2: --frames | 1 to
    record --seed -1 => 2: --seed | 0 to
    replay --rate 0 => 2: --rate | 0.001 to 1000 | asap
    replay --rate 1e-300 => 2: --rate
    replay --algo v9 => 2: unknown algorithm 'v9'
    replay --algo bm:block_size=6 => 2: --algo | block_size=6 is even
    score a.toml --algo v3:max_disparity=x => 2: max_disparity=x
    algos v9 => 2: unknown algorithm 'v9' | svl algos
    bench --algo exec => 2: exec:command=PROGRAM
    bench --max-disparity 60000 => 2: --max-disparity | 0 to 1024
    bench --max-disparity 1000 => 2: max_disparity=1000
    bench --size 8x8 => 2: --size | 32..=4096
    match l.png r.png -o a.pfm --algo exec => 2: exec:command=PROGRAM
    reproduce 9.9 => 2: unknown figure '9.9'
    datasets fetch nosuch => 2: unknown data set 'nosuch' | svl datasets
    datasets fetch eth3d nosuch => 2: no part 'nosuch'
    eval a.pfm b.pfm --protocol kitti => 2: --protocol
    eval a.pfm b.pfm --protocol eth3d --scale 1e300 => 2: --scale | 0.001 to 65536
    calibrate board board --squares 2x2 -o a.xml => 2: 3 to 50
    calibrate board board --square-m 0 -o a.xml => 2: --square-m | 0.0001 to 100
    calibrate distance ten=a.mcap => 2: 'ten' | 130cm
    calibrate distance 1m= => 2: 1m= | recording
    calibrate convert a.xml b.yaml --to euroc => 2: read only
    generate completions nosuch => 2: nosuch | bash
    # Cameras.
    record sim:foo=1 => 2: no option 'foo' | arm_ms
    record sim:size=8x8 => 2: size=8x8 | 16 to 4096
    record sim:arm_ms=abc => 2: arm_ms=abc | 0..=60000
    record sim:scene=board,size=64x48 => 2: 640x480 | 64x48
    record sim:pictures=9999 => 2: 9999 pictures of 640x480
    record /dev/video0 => 2: v4l2:/dev/video0,/dev/video2
    record sim --left /x => 2: --left | recording
    record arena --trigger free => 2: --trigger | 'arena'
    # At their defaults too.
    record arena --queue 64 => 2: --queue | 'arena'
    record arena --timeout 1 => 2: --timeout | 'arena'
    record arena --when-full drop => 2: --when-full | 'arena'
    # clap's tip is set apart.
    replay --verfiy => 2: found; tip: | '--verify'
    calibrate board board --rate 3 --yes -o a.xml => 2: --rate | 'board'
    # Endings.
    record -o one.txt => 2: one.txt | .mcap
    replay --rows one.txt => 2: one.txt | .csv or .parquet
    replay --rerun one.txt => 2: one.txt | FILE.rrd
    replay --rerun http:// => 2: http:// | rerun+http://127.0.0.1:9876/proxy
    recover a.mcap -o b.txt => 2: b.txt | .mcap
    match l.png r.png -o c.txt => 2: c.txt | .pfm or .png
    match l.png r.png -o c.pfm --why c.jpg => 2: c.jpg | .png
    eval a.pfm b.pfm --protocol eth3d --error-map e.jpg => 2: e.jpg | .png
    calibrate board board --yes -o c.png => 2: c.png | .xml
    calibrate convert a.xml b.pdf => 2: b.pdf | .yaml
    calibrate distance a.csv --figure b.png => 2: b.png | .svg
    # What is missing, empty or there twice.
    recover a.mcap => 2: --output
    recover a.mcap -o a.mcap => 2: a.mcap | named twice
    replay a.mcap -o a.mcap --force => 2: a.mcap | named twice
    replay a.mcap --algo v3 --algo v3 => 2: v3 | named twice
    replay a.mcap --algo v3:max_disparity=9,max_disparity=8 => 2: max_disparity is given twice
    match l.png -o a.pfm => 2: <RIGHT>
    compare one => 2: REPORT
    view => 2: <FILE>
    record '' => 2: SOURCE
    record -o '' => 2: --output
    record --calib '' => 2: --calib
    info '' => 2: <FILE>
    record --left '' => 2: --left
    score a.toml --scenes '' => 2: --scenes
    datasets fetch eth3d --from '' => 2: --from
    calibrate convert a.xml , => 2: one has no name
    replay sim => 2: sim: is no recording | svl record sim
    replay arena --algo v3 => 2: arena: is no recording | svl record arena
    calibrate distance 1m=a.mcap --target 9,9 => 2: --target | 9,9 | 5x3 cells
    score '' => 2: <SCENARIO
    calibrate distance '' => 2: TABLE.csv
    calibrate check '' => 2: <RECORDING>
    datasets fetch eth3d => 2: --data DIR | SVL_DATASETS
    record --alpha 0.5 => 2: --calib
    nosuch => 2: 'nosuch'
";

/// The same, for missing files and machines.
const FAILED: &str = "
    record nosuch => 1: nosuch | sim | v4l2:LEFT,RIGHT | genicam: | arena | .toml
    record simm => 1: simm | sim | v4l2:LEFT,RIGHT
    record text.txt => 1: text.txt | not a source | sim
    record text.mcap => 1: text.mcap
    record -o no/a.mcap => 1: no | no such folder
    record sim --trigger serial:/dev/nowhere => 1: /dev/nowhere
    replay nosuch.mcap => 1: nosuch.mcap | no such file
    replay text.txt => 1: text.txt
    replay a.mcap --algo exec:command=/no/such => 1: /no/such
    score nosuch.toml => 1: nosuch.toml | no such file
    compare one two => 1: one | not a report
    match nosuch.png r.png -o a.pfm => 1: nosuch.png | no such file
    eval nosuch.pfm b.pfm --protocol eth3d => 1: no such file | check the name
    bench --algo exec:command=/no/such => 1: /no/such | check its name
    score arena --rerun-detail much => 2: much | light | full
    replay run.mcap --rerun-detail light => 2: --rerun
    view nosuch.rrd => 1: nosuch.rrd | no such file or folder; check the name
    view text.txt => 1: text.txt | .mcap | .rrd
    info nosuch.mcap => 1: nosuch.mcap | no such file
    recover nosuch.mcap -o a2.mcap => 1: nosuch.mcap | no such file
    calibrate check nosuch.mcap => 1: nosuch.mcap | no such source | FILE.mcap | FOLDER
    calibrate board nosuch --yes -o a.xml => 1: nosuch | v4l2:LEFT,RIGHT
    calibrate convert nosuch.xml a.yaml => 1: nosuch.xml | no such file
    calibrate distance nosuch.csv => 1: nosuch.csv | no such table
    datasets fetch eth3d --from nosuch --data d => 1: nosuch | folder
";

#[test]
fn wrong_words_are_2_and_what_is_not_there_is_1() {
    let fixture = Fixture::new();
    fixture.write("text.txt", "words");
    fixture.write("text.mcap", "words");
    fixture.run("record --frames 2 -o a.mcap");
    let before = fixture.bytes("a.mcap");
    fixture.fails(WRONG);
    fixture.fails(FAILED);
    assert_eq!(fixture.bytes("a.mcap"), before);
    let left: Vec<_> = std::fs::read_dir(fixture.path(""))
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(left.len(), 3, "nothing else was written: {left:?}");
}
