//! Whole screens: what a user reads at the end, at 80 and at 120 columns.

use super::fixture::Fixture;
use super::results::unit_files;
use svl::files::write_pfm;
use svl::stereo::Plane;

/// Algorithms of a screen that has to hold them all.
const EIGHT: &str = "\"v5\", \"dp\", \"v1\", \"v2\", \"v3\", \"v4\", \"bm\", \"sgm\"";

/// Lines of a terminal.
const SCREEN: usize = 25;

/// The rows with 1 ms for the first algorithm, 2 ms for the second and so on: times vary.
fn fix_times(fixture: &Fixture, report: &str, rows: &str) {
    let list = fixture.json_file(&format!("{report}/report.json"));
    let labels = list["content"]["manifest"]["algorithms"]
        .as_array()
        .unwrap();
    let text = fixture.text(rows);
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let heads = reader.headers().unwrap().clone();
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(&heads).unwrap();
    let place = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let (label, total) = (place("algorithm"), place("total_us"));
    for record in reader.records().map(Result::unwrap) {
        let mut own = labels.iter();
        let own = own.position(|own| own["label"] == record[label]);
        // The witness is no algorithm of the table.
        let ms = 1 + own.unwrap_or_default();
        let field = |(i, field): (usize, &str)| match i {
            i if i == total => (1000 * ms).to_string(),
            i if heads[i].ends_with("_us") => "0".to_owned(),
            _ => field.to_owned(),
        };
        writer
            .write_record(record.iter().enumerate().map(field))
            .unwrap();
    }
    fixture.write(rows, writer.into_inner().unwrap());
}

/// The same in the units of a report, with their checksums.
fn fix_unit_times(fixture: &Fixture, report: &str) {
    for file in unit_files(fixture, report, ".unit") {
        let text = fixture.bytes(&file);
        let mut lines = text.splitn(3, |byte| *byte == b'\n').skip(1);
        let mut header: serde_json::Value = serde_json::from_slice(lines.next().unwrap()).unwrap();
        // The rows are the first table.
        let rows = header["parts"][0][1].as_u64().unwrap() as usize;
        let (rows, others) = lines.next().unwrap().split_at(rows);
        fixture.write("rows.csv", rows);
        fix_times(fixture, report, "rows.csv");
        let rows = fixture.bytes("rows.csv");
        header["parts"][0][1] = rows.len().into();
        let text = [header.to_string().as_bytes(), b"\n", &rows, others].concat();
        let checksum = svl::manifest::hash_bytes(&text);
        fixture.write(&file, [checksum.as_bytes(), b"\n", &text].concat());
    }
}

/// Output of a command at a width, without the build and the machine; it fits on a screen.
#[track_caller]
fn screen(fixture: &Fixture, command: &str, columns: usize) -> String {
    let text = fixture.svl_with(command, &[("COLUMNS", &columns.to_string())]);
    let text = text.done();
    let (mut is_of_build, mut is_of_machine) = (false, false);
    let mut lines = vec![format!("> svl {command}")];
    for line in text.lines() {
        assert!(line.chars().count() <= columns, "{columns}: {line}");
        assert_eq!(line, line.trim_end(), "{columns}");
        let machine = [
            ("both   svl ", "both   svl …"),
            ("       svl ", "       svl …"),
        ];
        let machine = machine.iter().find(|(start, _)| line.starts_with(start));
        is_of_build =
            line.starts_with("warning: built with") || is_of_build && line.starts_with("  ");
        // A long name of a CPU goes on in the next line.
        is_of_machine = machine.is_some() || is_of_machine && line.starts_with("       ");
        let is_double = line.is_empty() && lines.last().is_some_and(String::is_empty);
        match machine {
            Some((_, words)) => lines.push((*words).to_owned()),
            None if is_of_build || is_of_machine || is_double => {}
            None => lines.push(line.to_owned()),
        }
    }
    assert!(lines.len() <= SCREEN, "{}", lines.join("\n"));
    lines.join("\n") + "\n"
}

/// The screens of `svl score` of a scenario or a recording, into the folder `r`, at both widths.
#[track_caller]
fn scored(fixture: &Fixture, what: &str) -> String {
    let command = format!("score {what} -o r --rerun none -q");
    fixture.run(&command);
    fix_unit_times(fixture, "r");
    [80, 120]
        .map(|columns| screen(fixture, "report r", columns))
        .join("\n")
}

#[test]
fn a_data_set_of_disparities() {
    let fixture = Fixture::new();
    let mut scenes = Vec::new();
    for shift in 2..12 {
        let name = format!("s{shift}");
        let file = |file: &str| format!("{name}/{file}");
        fixture.write_pair(&file("im0.pgm"), &file("im1.pgm"), (96, 64), shift);
        let truth = Plane::from_fn(96, 64, |_, y| (shift + y / 48) as f32).unwrap();
        for file in [file("disp0.pfm"), file("disp1.pfm")] {
            write_pfm(&fixture.path(&file), &truth).unwrap();
        }
        scenes.push(format!("{name:?}"));
    }
    let scenes = scenes.join(", ");
    let scenario = format!(
        "name = \"noise\"\nalgorithms = [{EIGHT}]\n[source]\nkind = \"dataset\"\n\
         scenes = [{scenes}]\n"
    );
    fixture.write("noise.toml", scenario);
    insta::assert_snapshot!(scored(&fixture, "noise.toml --data ."));
}

#[test]
fn a_drive() {
    let fixture = Fixture::new();
    let scenario = "name = \"small\"\nalgorithms = [\"truth\", \"v5\", \"bm\", \"blind\"]\n\
                    [source]\nkind = \"drive\"\nseeds = [1, 7]\n[arena]\nframes = 280\nrate_hz = \
                    4.0\n[arena.rig]\nwidth_px = 80\nheight_px = 60\n";
    fixture.write("small.toml", scenario);
    let command = "score small.toml -q -o r --drives none";
    fixture.run(command);
    let at = |columns| screen(&fixture, "report r", columns);
    insta::assert_snapshot!([80, 120].map(at).join("\n"));
}

#[test]
fn a_recording_without_truth() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    let recordings = std::fs::read_dir(fixture.path("recordings")).unwrap();
    let first = recordings.map(|file| file.unwrap().path()).min().unwrap();
    fixture.run(&[
        "record",
        first.to_str().unwrap(),
        "--ros2",
        "-q",
        "-o",
        "bag.mcap",
    ]);
    let algorithms = EIGHT.replace('"', "").replace(", ", " --algo ");
    insta::assert_snapshot!(scored(&fixture, &format!("bag.mcap --algo {algorithms}")));
}

#[test]
fn two_reports() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    let same = ["v3", "v5"].join(" --algo ");
    for (folder, more) in [
        ("before", "--algo bm"),
        ("after", "--algo bm:block_size=21"),
    ] {
        fixture.run(&format!(
            "score short.toml -q --rerun none -o {folder} --algo {same} {more}"
        ));
        fix_unit_times(&fixture, folder);
        fixture.run(&format!("report {folder}"));
    }
    let renamed = "--map bm=bm:block_size=21";
    let all = format!("compare before after {renamed}");
    let text = [80, 120].map(|columns| screen(&fixture, &all, columns));
    let one = [80, 120].map(|columns| screen(&fixture, "compare before#v3 before#v5", columns));
    // An algorithm with other parameters, whose map is proposed, and the form for a pull request.
    let proposed = [80, 120].map(|columns| screen(&fixture, "compare before after", columns));
    let request = ["compare before after", &all, "compare before#v3 before#v5"];
    let request = request.map(|line| {
        let line = format!("{line} --markdown");
        format!("> svl {line}\n{}", fixture.run(&line))
    });
    let all = [&text[..], &one, &proposed, &request].concat();
    insta::assert_snapshot!(all.join("\n"));
}
