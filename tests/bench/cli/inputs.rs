//! Every file that is opened for a run is one of its inputs: the list of a report is compared with
//! what the system saw.
#![cfg(target_os = "linux")]

use super::fixture::{Fixture, has};
use super::losses::{messages, write_bag};
use super::results::unit_files;
use super::videos::ffmpeg;
use crate::recording::{bag, ros1};
use rustix::fs::inotify::{CreateFlags, ReadFlags, Reader, WatchFlags, add_watch, init};
use std::collections::{BTreeMap, BTreeSet};
use std::mem::MaybeUninit;
use std::path::{Path, PathBuf};

/// The folders below a path, itself included.
fn folders(path: PathBuf) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(&path).unwrap().flatten();
    let below = entries
        .map(|entry| entry.path())
        .filter(|path| path.is_dir());
    let mut all: Vec<_> = below.flat_map(folders).collect();
    all.push(path);
    all
}

/// The files below a folder that `run` opens.
fn opened(folder: &Path, run: impl FnOnce()) -> BTreeSet<PathBuf> {
    let watch = init(CreateFlags::NONBLOCK).unwrap();
    let watched = folders(folder.to_owned()).into_iter();
    let watched = watched.map(|path| (add_watch(&watch, &path, WatchFlags::OPEN).unwrap(), path));
    let watched: BTreeMap<_, _> = watched.collect();
    run();
    let mut bytes = [MaybeUninit::uninit(); 4096];
    let mut reader = Reader::new(watch, &mut bytes);
    let mut opened = BTreeSet::new();
    while let Ok(event) = reader.next() {
        if let Some(name) = event
            .file_name()
            .filter(|_| !event.events().contains(ReadFlags::ISDIR))
        {
            opened.insert(watched[&event.wd()].join(name.to_str().unwrap()));
        }
    }
    opened
}

/// The files in the lists of a report's runs.
fn listed(fixture: &Fixture, report: &str) -> BTreeSet<PathBuf> {
    let runs = unit_files(fixture, report, "run.json").into_iter();
    let lists = runs.map(|run| fixture.json_file(&run)["content"]["facts"]["files"].take());
    let files = lists.flat_map(|list| list.as_array().unwrap().clone());
    let files = files.filter(|file| file["state"].get("File").is_some());
    let paths = files.map(|file| fixture.path(file["path"].as_str().unwrap()));
    paths.map(|path| path.canonicalize().unwrap()).collect()
}

#[test]
fn every_file_that_is_opened_is_an_input() {
    let fixture = Fixture::new();
    for i in 0..3 {
        let name = |folder: &str, side: &str| format!("{folder}/{side}/{i}.pgm");
        let [left, right] = ["left", "right"].map(|side| name("data/pairs", side));
        fixture.write_pair(&left, &right, (40, 24), 3);
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (24, 40)}\n";
        let length = (header.len() as u16).to_le_bytes();
        let pixels = 3_f32.to_le_bytes().repeat(40 * 24);
        let map = [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), &pixels].concat();
        fixture.write(&format!("data/truth/{i}.npy"), &map);
        fixture.write(&format!("data/maps/{i}.npy"), &map);
    }
    let calib = "cam0=[50 0 20; 0 50 12; 0 0 1]\ncam1=[50 0 20; 0 50 12; 0 0 1]\ndoffs=0\n\
                 baseline=100\nwidth=40\nheight=24\nndisp=16\n";
    fixture.write("data/pairs/calib.txt", calib);
    fixture.write_pair("data/cones/im0.pgm", "data/cones/im1.pgm", (80, 60), 5);
    fixture.write(
        "data/cones/calib.txt",
        calib.replace("40", "80").replace("24", "60"),
    );
    fixture.write_euroc("60.0");
    std::fs::rename(fixture.path("mav0"), fixture.path("data/mav0")).unwrap();
    write_bag(&fixture, "data/bag.mcap", 0..9, 0..9, 0);
    for folder in ["ros", "ros1", "ros2"] {
        std::fs::create_dir(fixture.path(&format!("data/{folder}"))).unwrap();
    }
    std::fs::copy(
        fixture.path("data/bag.mcap"),
        fixture.path("data/ros/bag_0.mcap"),
    )
    .unwrap();
    fixture.write(
        "data/ros/metadata.yaml",
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  \
         relative_file_paths:\n    - bag_0.mcap\n",
    );
    fixture.run("record data/pairs -o data/own.mcap");
    let images = messages(0..9, 0..9, 0);
    bag::write_sqlite(&fixture.path("data/ros2"), &images);
    ros1::write_bag(&fixture.path("data/ros1"), &images, "lz4");
    let has_ffmpeg = has("ffmpeg", &["-version"]);
    if has_ffmpeg {
        let film = "-f lavfi -i testsrc=size=128x48:rate=25 -frames:v 9 -c:v mjpeg data/both.mkv";
        ffmpeg(&fixture, film);
    }
    let scenes = "name = \"s\"\nalgorithms = [\"v3\"]\n[cells]\njudge = \"disparity\"\n\
                  tolerance_px = 2\n[source]\nkind = \"dataset\"\nscenes = [\"cones\"]\n";
    fixture.write("scenes.toml", scenes);
    for (i, (what, least)) in [
        ("data/pairs", 7),
        ("data/pairs --truth ../truth/*.npy:disparity=1", 10),
        ("data/pairs --algo net=files:data/maps/*.npy", 10),
        ("scenes.toml --data data", 3),
        ("data/mav0", 6),
        ("data/bag.mcap", 1),
        ("data/ros", 2),
        ("data/own.mcap", 1),
        ("data/ros1/a.bag", 1),
        ("data/ros2", 1),
        ("data/both.mkv --side-by-side", usize::from(has_ffmpeg)),
    ]
    .into_iter()
    .enumerate()
    {
        let data = fixture.path("data").canonicalize().unwrap();
        let line = format!("score {what} --algo v3:max_disparity=8 --rerun none -q -o r{i}");
        let opened = opened(&data, || drop(fixture.svl(&line)));
        assert!(opened.len() >= least, "{what}: {opened:?}");
        let listed = listed(&fixture, &format!("r{i}"));
        let missing: Vec<_> = opened.difference(&listed).collect();
        assert!(missing.is_empty(), "{what}: {missing:?}");
    }
}
