//! `svl datasets`.

use super::fixture::Fixture;

/// Folders of data sets, of which some are whole: the number of scenes, and the files of each.
const DATA: &str = "
    middlebury2003 2 */im2.png */im6.png */disp2.png */disp6.png
    middlebury2006/FullSize 21 */view1.png */view5.png
    eth3d/two_view_training 27 */im0.png */im1.png */calib.txt
    eth3d/two_view_training_gt 26 */disp0GT.pfm
    kitti2015/training 200 image_2/*_10.png image_3/*_10.png disp_occ_0/*_10.png
    kitti2015/testing 200 image_2/*_10.png image_3/*_10.png
    kitti2012/training 1 image_0/*_10.png";

/// Bytes of each file. The names alone decide.
const BYTES: u64 = 5;

fn data() -> Fixture {
    let fixture = Fixture::new();
    for line in DATA.trim().lines() {
        let mut words = line.split_whitespace();
        let folder = words.next().unwrap();
        let scenes: usize = words.next().unwrap().parse().unwrap();
        for file in words {
            for scene in 0..scenes {
                let name = file.replace('*', &format!("{scene:06}"));
                fixture.write(&format!("d/{folder}/{name}"), [0; BYTES as usize]);
            }
        }
    }
    fixture
}

#[test]
fn without_a_folder_it_lists_the_layouts() {
    let fixture = Fixture::new();
    let listed = fixture.svl_with("datasets", &[("SVL_DATASETS", "")]).done();
    insta::assert_snapshot!(listed);
}

#[test]
fn it_says_what_is_there_and_what_is_missing() {
    let fixture = data();
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
    let fixture = data();
    let json = fixture.json("datasets --data d --json");
    let sets = json.as_array().unwrap();
    let named = |name: &str| sets.iter().find(|set| set["name"] == name).unwrap();
    let kitti = named("kitti2015");
    let home = kitti["home"].as_str().unwrap();
    assert!(home.starts_with("https://www.cvlibs.net/"), "{home}");
    assert_eq!(kitti["folder"], "kitti2015/training");
    assert_eq!(kitti["scenes"], 200);
    assert_eq!(kitti["there"]["scenes"], 400);
    assert_eq!(kitti["there"]["bytes"], 200 * 5 * BYTES);
    let missing = ["calibration of 200 scenes in kitti2015/training"];
    assert_eq!(kitti["there"]["missing"], serde_json::json!(missing));
    let whole = &named("middlebury2003")["there"]["missing"];
    assert_eq!(whole, &serde_json::json!([]));
}
