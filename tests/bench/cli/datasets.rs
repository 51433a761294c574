//! `svl datasets`.

use super::fixture::{Fixture, Ran, assert_says, pgm};
use super::server::{Manners, Server};
use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;

const POLITE: Manners = Manners {
    ranges: true,
    breaks_after: None,
    silent_length: false,
    drips: false,
};

/// The archives of Middlebury 2003, with an incompressible image of noise.
fn cones_and_teddy() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("cones/cones-png-2.zip", scene("cones")),
        ("teddy/teddy-png-2.zip", scene("teddy")),
    ]
}

fn scene(name: &str) -> Vec<u8> {
    let random = |i: u64| {
        ((i ^ i >> 7).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32).wrapping_mul(0xbf58_476d) >> 24
    };
    let noise = |shift: u64| {
        (0..60 * 375)
            .map(|i| random(i + shift) as u8)
            .collect::<Vec<_>>()
    };
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let truth = pgm(60, 375, &vec![16; 60 * 375]);
    for (file, bytes) in [
        ("im2.pgm", pgm(60, 375, &noise(0))),
        ("im6.pgm", pgm(60, 375, &noise(4))),
        ("disp2.pgm", truth.clone()),
        ("disp6.pgm", truth),
    ] {
        writer
            .start_file(format!("{name}/{file}"), SimpleFileOptions::default())
            .unwrap();
        writer.write_all(&bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

fn fetch(fixture: &Fixture, line: &str) -> Ran {
    // The server is on this machine, whatever proxy there is.
    let proxies = [("NO_PROXY", "127.0.0.1"), ("no_proxy", "127.0.0.1")];
    fixture.svl_with(&format!("datasets fetch {line}"), &proxies)
}

/// Fetches the scenes of Middlebury 2003 into `d`.
fn fetch_from(fixture: &Fixture, url: &str) -> Ran {
    fetch(fixture, &format!("middlebury2003 --from {url} --data d"))
}

#[test]
fn lists_the_data_sets_with_terms_and_sizes() {
    insta::assert_snapshot!(Fixture::new().run("datasets list"));
}

#[test]
fn json_has_every_address() {
    let json: serde_json::Value =
        serde_json::from_str(&Fixture::new().run("datasets list --json")).unwrap();
    let kitti = json
        .as_array()
        .unwrap()
        .iter()
        .find(|d| d["name"] == "kitti2012")
        .unwrap();
    assert_eq!(
        kitti["parts"][0]["urls"][0],
        "https://s3.eu-central-1.amazonaws.com/avg-kitti/data_stereo_flow.zip"
    );
}

#[test]
fn fetches_and_scores() {
    let fixture = Fixture::new();
    let server = Server::new(&cones_and_teddy(), POLITE);
    let said = fetch_from(&fixture, &server.url).done();
    assert_says(&said, &["Please cite: D. Scharstein", "Terms: free to use"]);
    assert!(
        said.ends_with("d/middlebury2003: 8 files written, 0 existed already\n"),
        "{said}"
    );
    assert!(
        !fixture
            .path("d/middlebury2003/cones/cones-png-2.zip")
            .exists(),
        "the archive is unpacked"
    );
    fixture.write(
        "middlebury2003.toml",
        include_str!("../../../scenarios/middlebury2003.toml"),
    );
    let args = "score middlebury2003.toml --algo v3 --data d --json";
    let json = fixture.json(args);
    assert_eq!(json["algorithms"][0]["pairs"], 2);

    // Again: nothing is requested, nothing written.
    let said = fetch_from(&fixture, &server.url).done();
    assert!(
        said.ends_with("0 files written, 2 existed already\n"),
        "{said}"
    );
    assert_eq!(
        server.asked(),
        ["/cones/cones-png-2.zip", "/teddy/teddy-png-2.zip"]
    );
}

#[test]
fn goes_on_where_the_connection_broke() {
    let fixture = Fixture::new();
    let manners = Manners {
        breaks_after: Some(20_000),
        ..POLITE
    };
    let server = Server::new(&cones_and_teddy(), manners);
    fetch_from(&fixture, &server.url).done();
    let asked = server.asked();
    assert_eq!(
        asked[..2],
        ["/cones/cones-png-2.zip", "/cones/cones-png-2.zip 20000-"]
    );
}

#[test]
fn goes_on_where_an_earlier_fetch_ended() {
    let fixture = Fixture::new();
    let archive = scene("cones");
    fixture.write(
        "d/middlebury2003/cones/cones-png-2.zip.part",
        &archive[..1000],
    );
    fixture.write(
        "d/middlebury2003/teddy/teddy-png-2.zip.part",
        scene("teddy"),
    );
    let server = Server::new(&cones_and_teddy(), POLITE);
    fetch_from(&fixture, &server.url).done();
    let whole = scene("teddy").len();
    assert_eq!(
        server.asked(),
        [
            "/cones/cones-png-2.zip 1000-".to_owned(),
            format!("/teddy/teddy-png-2.zip {whole}-")
        ]
    );
}

#[test]
fn a_server_without_ranges_or_lengths_starts_again() {
    for silent_length in [false, true] {
        let fixture = Fixture::new();
        fixture.write("d/middlebury2003/cones/cones-png-2.zip.part", [1; 1000]);
        let manners = Manners {
            silent_length,
            ..Manners::default()
        };
        let server = Server::new(&cones_and_teddy(), manners);
        fetch_from(&fixture, &server.url).done();
        assert!(fixture.path("d/middlebury2003/cones/disp6.pgm").is_file());
    }
}

#[test]
fn a_connection_that_gives_nothing_ends() {
    let fixture = Fixture::new();
    let server = Server::new(
        &cones_and_teddy(),
        Manners {
            breaks_after: Some(0),
            ..POLITE
        },
    );
    let words = ["cones-png-2.zip: broke off after 0 bytes", "run it again"];
    fetch_from(&fixture, &server.url).failed(1, &words);
}

#[test]
fn another_checksum_than_the_first_is_refused() {
    let fixture = Fixture::new();
    let server = Server::new(&cones_and_teddy(), POLITE);
    fetch_from(&fixture, &server.url).done();
    std::fs::remove_dir_all(fixture.path("d/middlebury2003/cones")).unwrap();
    // The same archive is accepted again.
    let said = fetch_from(&fixture, &server.url).done();
    assert!(
        said.ends_with("4 files written, 1 existed already\n"),
        "{said}"
    );
    std::fs::remove_dir_all(fixture.path("d/middlebury2003/cones")).unwrap();
    let changed = Server::new(&[("cones/cones-png-2.zip", scene("hijacked"))], POLITE);
    let words = [
        "cones-png-2.zip: its sha256 is ",
        "of the one fetched before it was ",
        "fetched.json",
    ];
    fetch_from(&fixture, &changed.url).failed(1, &words);
    assert!(!fixture.path("d/middlebury2003/hijacked").exists());
}

#[test]
fn archives_at_hand_are_unpacked_and_kept() {
    let fixture = Fixture::new();
    fixture.write("downloads/cones-png-2.zip", scene("cones"));
    fixture.write("downloads/teddy/teddy-png-2.zip", scene("teddy"));
    fetch(&fixture, "middlebury2003 --from downloads --data d").done();
    assert!(fixture.path("d/middlebury2003/teddy/im2.pgm").is_file());
    assert!(fixture.path("downloads/cones-png-2.zip").is_file());
    let words = ["conesH-ppm-2.zip: no such file", "--from takes the folder"];
    fetch(&fixture, "middlebury2003 half --from downloads --data d").failed(1, &words);
}

#[test]
fn single_files_go_where_the_archive_would_have_put_them() {
    let fixture = Fixture::new();
    let url = |json: serde_json::Value| -> Vec<String> {
        let sets = json
            .as_array()
            .unwrap()
            .iter()
            .find(|d| d["name"] == "middlebury2001")
            .unwrap()
            .clone();
        serde_json::from_value(sets["parts"][0]["urls"].clone()).unwrap()
    };
    let urls = url(serde_json::from_str(&fixture.run("datasets list --json")).unwrap());
    for url in &urls {
        let name = url.rsplit_once("/data/").unwrap().1;
        fixture.write(&format!("mirror/{name}"), pgm(40, 20, &[80; 800]));
    }
    fetch(&fixture, "middlebury2001 --from mirror --data d").done();
    fixture.run("record d/middlebury2001 -o all.mcap");
    let said = fixture.run("info all.mcap");
    assert!(said.contains('8'), "{said}");
    // Another run takes a new file where there was none, and leaves those that are there.
    std::fs::remove_file(fixture.path("d/middlebury2001/map/im0.pgm")).unwrap();
    let said = fetch(&fixture, "middlebury2001 --from mirror --data d").done();
    assert!(
        said.ends_with(&format!(
            "1 file written, {} existed already\n",
            urls.len() - 1
        )),
        "{said}"
    );
}

#[test]
fn unavailable_data_sets_are_one_line_with_the_cure() {
    let fixture = Fixture::new();
    let server = Server::new(
        &[(
            "cones/cones-png-2.zip",
            b"<html>We have moved</html>".to_vec(),
        )],
        POLITE,
    );
    let from = |url: &str, words: &[&str]| {
        fetch_from(&fixture, url).failed(1, words);
    };
    from(
        &format!("{}/old", server.url),
        &["no such file there", "home page", "--from", "404"],
    );
    from(
        &server.url,
        &["cones-png-2.zip: is a web page", "check the address"],
    );
    assert!(
        !fixture
            .path("d/middlebury2003/cones/cones-png-2.zip")
            .exists()
    );
    let server = Server::new(
        &[("cones/cones-png-2.zip", b"PK not quite".to_vec())],
        POLITE,
    );
    from(
        &server.url,
        &[
            "cones-png-2.zip: not an intact archive",
            "delete it and fetch it again",
        ],
    );
    std::fs::remove_file(fixture.path("d/middlebury2003/cones/cones-png-2.zip")).unwrap();
    // A port that was free a moment ago: nothing listens there.
    let nobody = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    from(
        &format!("http://{nobody}"),
        &["cannot be reached", "check the network", "--from DIR"],
    );
    from(
        "http://no-such-host.invalid",
        &["cannot be reached", "check the network"],
    );
    from("nowhere", &["--from nowhere: neither an address"]);
    fetch(&fixture, "middlebury2003").failed(2, &["--data DIR", "SVL_DATASETS"]);
    fetch(&fixture, "kiti2015 --data d").failed(
        2,
        &["unknown data set 'kiti2015'", "did you mean 'kitti2015'?"],
    );
    fetch(&fixture, "middeval3 X --data d").failed(2, &["no part 'X'", "Q, H, F"]);
    fixture.write("d/eth3d/fetched.json", "[]");
    fetch(&fixture, "eth3d --data d").failed(1, &["fetched.json: not svl's list"]);
    assert_eq!(fetch(&fixture, "").code, Some(2));
}
