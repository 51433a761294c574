//! Recording from simulated cameras.

use super::fixture::Fixture;
use super::own_data::frames;

/// Small cameras that start at once.
const SIM: &str = "sim:size=64x48,pictures=2";

#[test]
fn cameras_are_recorded_and_what_was_done_is_told() {
    let fixture = Fixture::new();
    fixture.transcript(&format!(
        "record {SIM} --frames 20 --allow-loss 100% -o a.mcap --when-full wait => pulses \
        | 0 pairs dropped | skew p50 0.000 p99 0.000 max 0.000 ms | latency p50 | a.mcap: 20 pairs"
    ));
    let frames = frames(&fixture, "a.mcap");
    assert_eq!(frames.len(), 20);
    for (i, frame) in frames.iter().enumerate() {
        let exposure = &frame.exposure;
        let numbers = (frame.sequence, exposure.trigger_id, exposure.skew_ns);
        assert_eq!(numbers, (i as u64, i as u64, Some(0)));
        assert!(exposure.shutter_us > 0 && frame.rig().is_some());
        assert_eq!(frame.pair.size(), (64, 48));
    }
    let said = fixture.run(&format!("-q record {SIM} --frames 1 --allow-loss 100%"));
    assert!(said.is_empty());
    assert!(fixture.path("recordings/sim-1.mcap").is_file());
}

#[test]
fn every_image_is_in_a_pair_or_counted() {
    let fixture = Fixture::new();
    for (name, args) in [
        ("duration", "--duration 0.5"),
        ("frames", "--frames 9"),
        (
            "order",
            ",right.jitter_ms=12 --trigger fixed:60 --pairing order --duration 0.5",
        ),
        ("hang", ",left.hang_at=7 --trigger fixed:50 --timeout 0.2"),
    ] {
        let space = if args.starts_with(',') { "" } else { " " };
        let file = format!("{name}.mcap");
        let ran = fixture.svl(&format!("record -o {file} {SIM}{space}{args}"));
        let fails = name == "hang";
        let no = if fails { "" } else { "!" };
        fixture.transcript(&format!(
            "info {file} => grabbed          | {no}grabber error   "
        ));
        let info = fixture.json(&format!("info {file} --json"));
        let facts = info["grabber"].as_object().unwrap();
        let count = |fact: &str| facts[fact].as_str().unwrap().parse::<u64>().unwrap();
        let unpaired = facts.keys().filter(|fact| fact.starts_with("unpaired"));
        let unpaired: u64 = unpaired.map(|fact| count(fact)).sum();
        let outside = ["unpaired_unready", "unpaired_unfinished"];
        let outside = outside.iter().filter(|fact| facts.contains_key(**fact));
        let outside: u64 = outside.map(|fact| count(fact)).sum();
        let lost = unpaired - outside + count("dropped_pairs");
        let code = if fails { 1 } else { 4 * i32::from(lost > 0) };
        assert_eq!(ran.code, Some(code), "{name}: {facts:?}");
        let written = info["pairs"].as_u64().unwrap();
        let pairs = written + count("dropped_pairs") + count("unread_pairs");
        assert_eq!(count("pairs"), pairs, "{name}: {facts:?}");
        let images = count("left_images") + count("right_images");
        assert_eq!(images, 2 * count("pairs") + unpaired, "{name}: {facts:?}");
    }
}

#[test]
fn images_that_were_lost_end_with_their_status() {
    let fixture = Fixture::new();
    let late = format!("record {SIM},right.jitter_ms=12 --trigger fixed:60 --duration 0.5");
    let apart = format!("{late} --pairing stamp --max-skew-ms 1");
    // A damaged image and its partner are one pair.
    fixture.transcript(&format!(
        "{apart} -o a.mcap => 4~ had no partner; --allow-loss | ; all else is kept
        {apart} --allow-loss 90% -o b.mcap
        record {SIM},right.damage_at=3 --trigger software --frames 6 -o c.mcap \
        => 4~ 1 pair could not be read; --allow-loss 1 | ; all else is kept"
    ));
}

#[test]
fn every_trigger_records() {
    let fixture = Fixture::new();
    for (name, trigger) in [
        ("fixed.mcap", "fixed:20"),
        ("free.mcap", "free"),
        ("soft.mcap", "software"),
    ] {
        fixture.run(&format!(
            "record {SIM} --trigger {trigger} --frames 5 --allow-loss 100% -o {name}"
        ));
        assert_eq!(frames(&fixture, name).len(), 5);
    }
}

#[test]
fn pairs_before_a_camera_failed_are_kept() {
    let fixture = Fixture::new();
    for (fault, words) in [
        ("hang_at", "silent for 3.0 s"),
        ("disconnect_at", "disconnected"),
    ] {
        fixture.transcript(&format!(
            "record {SIM},right.{fault}=3 -o {fault}.mcap => 1: right camera, sim right | {words}
            info {fault}.mcap => intact          yes"
        ));
        assert_eq!(frames(&fixture, &format!("{fault}.mcap")).len(), 3);
    }
}

/// No image arrives in a period that is longer than a camera may usually be silent.
#[test]
fn slow_cameras_are_not_silent_ones() {
    let fixture = Fixture::new();
    let free = "--trigger free --rate 0.5 --timeout 0.3 --frames 2";
    fixture.run(&format!("record {SIM} {free} --allow-loss 100% -o a.mcap"));
}

#[test]
fn devices_are_listed() {
    let text = Fixture::new().run("record --list");
    assert!(text.starts_with("sim  "), "{text}");
    assert_eq!(
        text.contains("genicam                 not built in"),
        cfg!(not(feature = "genicam")),
        "{text}"
    );
}

#[test]
fn wrong_usage_is_one_line() {
    let fixture = Fixture::new();
    let v4l2 = "v4l2:/dev/video98,/dev/video99";
    let words = match cfg!(target_os = "linux") {
        true => "/dev/video98 | no such device",
        false => "built without v4l2 | Linux",
    };
    fixture.transcript(&format!(
        "record {SIM} --trigger serial:/dev/nowhere => 1: /dev/nowhere: cannot be opened
        record {SIM} --list => 2: --list
        record {v4l2} => 1: {words}
        record {v4l2} --trigger software => 2: cannot trigger v4l2 cameras | serial:DEVICE
        record {v4l2} --seed 3 => 2: --seed | {v4l2}
        record genicam:a,b --seed 3 => 2: genicam:a,b:  | omit --seed"
    ));
    if cfg!(not(feature = "genicam")) {
        fixture.fails("record genicam:a,b => 1: genicam:a,b | libaravis-dev | --features genicam");
    }
    assert!(!fixture.path("a.mcap").exists());
}
