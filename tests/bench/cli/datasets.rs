//! `svl datasets`.

use super::fixture::Fixture;

/// Empty files of a scene each: the names decide.
fn write(fixture: &Fixture, folder: &str, scenes: &[String], files: &[&str]) {
    for scene in scenes {
        for file in files {
            let name = file.replace('*', scene);
            let path = if file.contains('*') {
                format!("d/{folder}/{name}")
            } else {
                format!("d/{folder}/{scene}/{name}")
            };
            fixture.write(&path, "12345");
        }
    }
}

/// Numbers below `count`, as text.
fn numbers(count: usize) -> Vec<String> {
    (0..count).map(|i| format!("{i:06}")).collect()
}

/// A folder of data sets, of which some are whole.
fn data(fixture: &Fixture) {
    let both = ["cones".to_owned(), "teddy".to_owned()];
    let files = ["im2.png", "im6.png", "disp2.png", "disp6.png"];
    write(fixture, "middlebury2003", &both, &files);
    // Other sizes than that of the scenario.
    write(fixture, "middlebury2006/FullSize", &numbers(21), &["view1.png", "view5.png"]);
    let scenes = numbers(27);
    write(fixture, "eth3d/two_view_training", &scenes, &["im0.png", "im1.png", "calib.txt"]);
    write(fixture, "eth3d/two_view_training_gt", &scenes[1..], &["disp0GT.pfm"]);
    let pair = ["image_2/*_10.png", "image_3/*_10.png"];
    let truth = ["disp_occ_0/*_10.png", "disp_noc_0/*_10.png"];
    for (folder, files) in [("training", &truth[..]), ("training", &pair), ("testing", &pair)] {
        write(fixture, &format!("kitti2015/{folder}"), &numbers(200), files);
    }
    write(fixture, "kitti2012/training", &numbers(1), &["image_0/*_10.png"]);
}

#[test]
fn without_a_folder_it_lists_the_layouts() {
    let fixture = Fixture::new();
    let listed = fixture.svl_with("datasets", &[("SVL_DATASETS", "")]).done();
    insta::assert_snapshot!(listed);
}

#[test]
fn it_says_what_is_there_and_what_is_missing() {
    let fixture = Fixture::new();
    data(&fixture);
    // A link that leads back adds nothing.
    #[cfg(unix)]
    std::os::unix::fs::symlink(fixture.path("d/eth3d"), fixture.path("d/eth3d/again")).unwrap();
    let there = fixture.run("datasets --data d");
    insta::assert_snapshot!(there);
    let named = [("SVL_DATASETS", "d")];
    assert_eq!(fixture.svl_with("datasets", &named).done(), there);
}

#[test]
fn json_has_pages_and_numbers() {
    let fixture = Fixture::new();
    data(&fixture);
    let json = fixture.json("datasets --data d --json");
    let named = |name: &str| json.as_array().unwrap().iter().find(|d| d["name"] == name).unwrap();
    let kitti = named("kitti2015");
    assert!(kitti["home"].as_str().unwrap().starts_with("https://www.cvlibs.net/"));
    assert_eq!((&kitti["folder"], &kitti["scenes"]), (&"kitti2015/training".into(), &200.into()));
    assert_eq!(kitti["there"]["scenes"], 400);
    assert_eq!(kitti["there"]["bytes"], 200 * 6 * 5);
    assert_eq!(
        kitti["there"]["missing"],
        serde_json::json!(["calibration of 200 scenes in kitti2015/training"])
    );
    assert_eq!(named("middlebury2003")["there"]["missing"], serde_json::json!([]));
}
