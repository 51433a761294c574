//! Chooses the topics of the two cameras in another program's recording.

use super::camera;
use crate::decode::image;
use crate::decode::video::message;
use crate::stream::channel::Channel;
use crate::stream::stamp_rule::StampUnit;
use std::collections::BTreeSet;
use svl_core::{joined, listed};
use svl_files::SideBySide;

/// The topics and the largest skew of the pairs in a recording that svl did not write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Topic of the left images; by default found by type and name.
    pub left: Option<String>,
    pub right: Option<String>,
    /// Topics of the calibrations of both; by default found by namespace and name.
    pub infos: [Option<String>; 2],
    /// The places of both in each image of one topic, the left one, if that holds both.
    pub side_by_side: Option<SideBySide>,
    /// Largest skew of a pair.
    pub max_skew_ns: u64,
    /// Number of bits of 16 that the images use; by default decided by the first images.
    pub bits: Option<u8>,
    /// Unit of stamps that are not in nanoseconds.
    pub stamps: Option<StampUnit>,
    /// Added to the stamps of the right images and their calibrations.
    pub right_offset_ns: Option<i64>,
    /// Log time from the first message on, nanoseconds, behind which no pair is read: what is
    /// behind it is not looked at.
    pub to_ns: Option<u64>,
}

impl Selection {
    /// A quarter of the period at 50 pairs per second: cameras with a common trigger are far below,
    /// free-running ones above.
    pub const MAX_SKEW_NS: u64 = 5_000_000;

    /// True if it tells how topics form pairs: then svl's own recordings are paired by stamp, too.
    pub fn names_topics(&self) -> bool {
        let infos = self.infos.iter();
        infos.chain([&self.left, &self.right]).any(Option::is_some) || self.side_by_side.is_some()
    }
}

impl Default for Selection {
    fn default() -> Self {
        Self {
            left: None,
            right: None,
            infos: [None, None],
            side_by_side: None,
            max_skew_ns: Self::MAX_SKEW_NS,
            bits: None,
            stamps: None,
            right_offset_ns: None,
            to_ns: None,
        }
    }
}

/// True if the messages of a channel are images.
pub(crate) fn is_image(channel: &Channel) -> bool {
    image::SCHEMAS.contains(&channel.schema.as_str()) || message::is_video(channel)
}

/// The topics of the left and the right images.
///
/// # Errors
/// The reason why they are missing or ambiguous, with the remedy.
pub(crate) fn choose(channels: &[&Channel], selection: &Selection) -> Result<[String; 2], String> {
    let topics = image_topics(channels, selection);
    let listed = listed(&topics);
    for (option, named) in [("--left", &selection.left), ("--right", &selection.right)] {
        if let Some(named) = named.as_deref().filter(|named| !topics.contains(named)) {
            let fault = topic_fault(named, channels, &listed);
            return Err(format!("{option}{fault}"));
        }
    }
    if selection.side_by_side.is_some() {
        return match (&selection.left, &selection.right, &topics[..]) {
            (_, Some(_), _) => Err("--side-by-side reads one topic: leave --right out".to_owned()),
            (Some(left), ..) => Ok([left.clone(), left.clone()]),
            (None, None, [only]) => Ok([only, only].map(|topic| (*topic).to_owned())),
            _ => Err(format!(
                "which images are side by side? Name one with --left TOPIC; it has \
                 {listed}"
            )),
        };
    }
    let free =
        |named: &Option<String>, topic: &str| named.as_deref().is_none_or(|named| named == topic);
    let pairs = topics
        .iter()
        .flat_map(|&left| topics.iter().map(move |&right| [left, right]));
    let pairs = pairs.filter(|&[left, right]| {
        free(&selection.left, left) && free(&selection.right, right) && left != right
    });
    // If both topics are given, their names need not match.
    let both_named = selection.left.is_some() && selection.right.is_some();
    let pairs: Vec<_> = pairs
        .filter(|&[left, right]| both_named || are_sides(left, right))
        .collect();
    let pairs = best_variants(pairs);
    match (pairs[..].split_first(), &topics[..]) {
        // Exactly one: two pairs, such as stereo cameras in front and behind, are ambiguous.
        (Some((pair, [])), _) => Ok(pair.map(str::to_owned)),
        (_, []) => Err(unread(channels).map_or(
            "has no stereo pairs: it has no images".to_owned(),
            |reason| format!("has no stereo pairs that svl reads: {reason}"),
        )),
        (_, [only]) => Err(format!(
            "has no stereo pairs: {only} is its only topic of images; --side-by-side if each shows \
             both cameras"
        )),
        _ => Err(format!(
            "which images are the pair? Name two with --left TOPIC --right TOPIC; it has {listed}"
        )),
    }
}

/// Words of topics that say how an image was processed, not which camera it is of.
const PROCESSING: [&str; 11] = [
    "image",
    "raw",
    "rect",
    "rectified",
    "color",
    "colour",
    "gray",
    "grey",
    "mono",
    "compressed",
    "unrectified",
];

/// Among pairs of the same cameras, the one to use: rectified before raw, grey before colour,
/// processed before raw. Pairs of different cameras are left.
fn best_variants(mut pairs: Vec<[&str; 2]>) -> Vec<[&str; 2]> {
    let camera = |topic: &str| {
        let topic = topic.to_lowercase();
        let words = topic.split(|c: char| !c.is_alphanumeric());
        let words = words.filter(|word| !word.is_empty() && !PROCESSING.contains(word));
        words.map(str::to_owned).collect::<Vec<_>>()
    };
    let cameras = |pair: &[&str; 2]| pair.map(camera);
    let rank = |[left, _]: &[&str; 2]| {
        let left = left.to_lowercase();
        let has = |known: &[&str]| {
            let mut words = left.split(|c: char| !c.is_alphanumeric());
            words.any(|word| known.contains(&word))
        };
        let is_rectified = has(&["rect", "rectified"]);
        (!is_rectified, has(&["color", "colour"]), has(&["raw"]))
    };
    let are_same = pairs
        .windows(2)
        .all(|two| cameras(&two[0]) == cameras(&two[1]));
    if let Some(best) = pairs.iter().map(rank).min()
        && are_same
    {
        pairs.retain(|pair| rank(pair) == best);
    }
    pairs
}

/// True if a topic of compressed images or videos is the copy of another that image_transport
/// makes: `image/compressed` of `image`.
pub(crate) fn is_copy(channel: &Channel, channels: &[&Channel]) -> bool {
    let is_compressed = channel.schema.ends_with("CompressedImage") || message::is_video(channel);
    let original = channel.topic.rsplit_once('/');
    let is_it = |(original, _): (&str, &str)| channels.iter().any(|other| other.topic == original);
    is_compressed && original.is_some_and(is_it)
}

/// The topics of images in alphabetical order, without those that repeat another: in colour, or as
/// image_transport's copy.
fn image_topics<'a>(channels: &[&'a Channel], selection: &Selection) -> Vec<&'a str> {
    let images: Vec<_> = channels
        .iter()
        .filter(|channel| is_image(channel))
        .collect();
    let copies = images.iter().filter(|channel| is_copy(channel, channels));
    let copies: Vec<_> = copies.map(|channel| channel.topic.as_str()).collect();
    let mut topics: Vec<&str> = images
        .iter()
        .map(|channel| channel.topic.as_str())
        .collect();
    topics.sort_unstable();
    // The files of a bag repeat the channels.
    topics.dedup();
    // A publisher of both image_rect_color and image_rect means the same image.
    let all = topics.clone();
    let is_repeated = |topic: &str| {
        let raw = topic.strip_suffix("/compressed");
        let (name, transport) = raw.map_or((topic, ""), |name| (name, "/compressed"));
        let grey = name
            .strip_suffix("_color")
            .map(|grey| format!("{grey}{transport}"));
        grey.is_some_and(|grey| all.contains(&grey.as_str()))
    };
    let is_named = |topic: &str| {
        [&selection.left, &selection.right]
            .into_iter()
            .flatten()
            .any(|named| named == topic)
    };
    let repeats = |topic: &str| is_repeated(topic) || copies.contains(&topic);
    topics.retain(|topic| is_named(topic) || !repeats(topic));
    topics
}

/// The reason why a named topic is none of images, behind its option. `listed`: those that are.
fn topic_fault(named: &str, channels: &[&Channel], listed: &str) -> String {
    match channels.iter().find(|channel| channel.topic == named) {
        Some(channel) => match unread(&[channel]) {
            Some(reason) => format!(": {reason}"),
            None => format!(" {named} has messages of {}, not images", channel.schema),
        },
        None if named.contains('*') => format!(
            " {named}: is a pattern, for the images of a folder; here it is a topic, of {listed}"
        ),
        None if listed.is_empty() => format!(" {named}: it has no images"),
        None => format!(" {named}: no such topic of images; it has {listed}"),
    }
}

/// Image topics of types that svl cannot read, if there are any, with the remedy.
fn unread(channels: &[&Channel]) -> Option<String> {
    let name = |channel: &Channel| {
        channel
            .schema
            .rsplit(['/', '.'])
            .next()
            .unwrap_or_default()
            .to_owned()
    };
    let kinds = [
        "Image",
        "RawImage",
        "CompressedImage",
        "CompressedVideo",
        "FFMPEGPacket",
        "ImgFrame",
        "EncodedFrame",
    ];
    let seems = |channel: &&&Channel| kinds.contains(&name(channel).as_str());
    let first = channels
        .iter()
        .filter(seems)
        .find(|channel| !is_image(channel))?;
    let alike = channels
        .iter()
        .filter(|channel| channel.schema == first.schema);
    let topics = joined(alike.map(|channel| &channel.topic));
    let schema = &first.schema;
    Some(match name(first).as_str() {
        "ImgFrame" | "EncodedFrame" => format!(
            "{topics}: {schema} of DepthAI, whose images are in the videos beside this file: `svl \
             record FOLDER --left LEFT.mp4 --right RIGHT.mp4`"
        ),
        _ => format!("{topics}: {schema}; it reads {}", image::SCHEMAS.join(", ")),
    })
}

/// True if two topics differ only in left and right, in l and r, or in numbers from 0 or 1 that are
/// one apart.
fn are_sides(left: &str, right: &str) -> bool {
    let (left, right) = (left.to_lowercase(), right.to_lowercase());
    // Also if `left` is part of a longer word, as in Left_mono or /left/left_image.
    if left.contains("left") && left.replace("left", "right") == right {
        return true;
    }
    let (left, right) = (words(&left), words(&right));
    let differing: Vec<_> = left.iter().zip(&right).filter(|(l, r)| l != r).collect();
    let is_number_pair = |(l, r): (&str, &str)| {
        [("0", "1"), ("1", "2"), ("00", "01"), ("01", "02")].contains(&(l, r))
    };
    let Some(&(first_left, first_right)) = differing.first() else {
        return false;
    };
    let first = (first_left.as_str(), first_right.as_str());
    left.len() == right.len()
        && (first == ("l", "r") || is_number_pair(first))
        && differing
            .iter()
            // /cam0/image1 and /cam1/image2 differ twice, by different numbers: not a pair.
            .all(|(l, r)| (l.as_str(), r.as_str()) == first)
}

/// Splits a topic into runs of letters, runs of digits, and single other characters.
fn words(topic: &str) -> Vec<String> {
    let kind = |c: char| (c.is_alphabetic(), c.is_numeric());
    let mut words: Vec<String> = Vec::new();
    let mut last = None;
    for c in topic.chars() {
        match words.last_mut() {
            Some(word) if last == Some(kind(c)) && kind(c) != (false, false) => word.push(c),
            _ => words.push(c.to_string()),
        }
        last = Some(kind(c));
    }
    words
}

/// True if the name of a topic marks its images as rectified: `rect` is a word of its last part, as
/// in `image_rect`, `image_rect_raw` and `rectified/compressed`. Its namespace is ignored.
pub(crate) fn is_of_rectified(topic: &str) -> bool {
    // image_transport appends /compressed to the name of the raw topic.
    let topic = topic.strip_suffix("/compressed").unwrap_or(topic);
    let words = topic
        .rsplit('/')
        .next()
        .unwrap_or_default()
        .split(|c: char| !c.is_alphabetic());
    words
        .map(str::to_lowercase)
        .any(|word| word == "rect" || word.starts_with("rectif"))
}

/// The calibration topics for the image topics of a pair: those that the user names, else those
/// that are found.
///
/// # Errors
/// The named topic that has no calibrations, with those that have.
pub(crate) fn calibrations(
    channels: &[&Channel],
    images: [&str; 2],
    selection: &Selection,
) -> Result<[Option<String>; 2], String> {
    let mut infos = found_calibrations(channels, images);
    let known = calibration_topics(channels);
    let named = infos.iter_mut().zip(&selection.infos);
    for ((info, named), option) in named.zip(["--left-info", "--right-info"]) {
        let Some(named) = named else {
            continue;
        };
        if !known.contains(named) {
            let listed = if known.is_empty() {
                "none".to_owned()
            } else {
                listed(known)
            };
            return Err(format!(
                "{option} {named}: no such topic of calibrations; it has {listed}"
            ));
        }
        *info = Some(named.clone());
    }
    Ok(infos)
}

/// The topics of calibrations.
pub(crate) fn calibration_topics(channels: &[&Channel]) -> BTreeSet<String> {
    let infos = channels.iter().filter(|c| camera::is_calibration(c));
    infos.map(|channel| channel.topic.clone()).collect()
}

/// Each image's own calibration ([`calibration`]); else, of those for no image, the only two that
/// are a left and a right one.
fn found_calibrations(channels: &[&Channel], images: [&str; 2]) -> [Option<String>; 2] {
    let own = images.map(|image| calibration(channels, image));
    if own[0] != own[1] && own.iter().all(Option::is_some) {
        return own;
    }
    let others = channels.iter().map(|channel| channel.topic.as_str());
    let others = others.filter(|topic| !images.contains(topic));
    let is_image = |topic: &&str| channels.iter().any(|c| c.topic == *topic && is_image(c));
    let taken: Vec<_> = others
        .filter(is_image)
        .filter_map(|topic| calibration(channels, topic))
        .collect();
    let free = calibration_topics(channels);
    let free: Vec<_> = free.iter().filter(|topic| !taken.contains(topic)).collect();
    let pairs = free
        .iter()
        .flat_map(|left| free.iter().map(move |right| [*left, *right]));
    let mut pairs = pairs.filter(|[left, right]| are_sides(left, right));
    match (pairs.next(), pairs.next()) {
        (Some(pair), None) => pair.map(|topic| Some(topic.clone())),
        _ => own,
    }
}

/// True if a topic is in a namespace of an image topic, or below it: image/camera_info.
pub(crate) fn is_near(info: &str, image: &str) -> bool {
    format!("{image}/").starts_with(namespace(info))
}

/// True if a topic is in the namespace of an image topic itself, or below it.
pub(crate) fn is_beside(info: &str, image: &str) -> bool {
    namespace(info) == namespace(image) || info.starts_with(&format!("{image}/"))
}

/// The name of a topic up to its last part.
fn namespace(topic: &str) -> &str {
    &topic[..topic.rfind('/').map_or(0, |slash| slash + 1)]
}

/// The calibration topic for the image topic `topic`: the one that shares the longest namespace,
/// and of one namespace the one of its processing: `camera_info_rect` for `image_rect`.
pub(crate) fn calibration(channels: &[&Channel], topic: &str) -> Option<String> {
    let calibrations = channels
        .iter()
        .copied()
        .filter(|channel| camera::is_calibration(channel));
    let folder = |channel: &&Channel| namespace(&channel.topic).len();
    let fits = |channel: &&Channel| is_near(&channel.topic, topic);
    // Length of the processing in the names of both; 0 of a calibration of any image.
    let processing = |channel: &&Channel| {
        let folder = folder(channel);
        let info = channel.topic[folder..].strip_prefix("camera_info")?;
        let image = topic.get(folder..)?.strip_prefix("image")?;
        image.starts_with(info).then_some(info.len())
    };
    // Ties are decided by name, so that the order in the file does not matter.
    let found = calibrations.filter(fits).max_by_key(|channel| {
        let name = std::cmp::Reverse(&channel.topic);
        (folder(channel), processing(channel), name)
    });
    found.map(|channel| channel.topic.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels(topics: &[&str]) -> Vec<Channel> {
        let schema = |topic: &str| match topic {
            topic if topic.ends_with("scan") => "LaserScan",
            topic if topic.ends_with("compressed") => "sensor_msgs/msg/CompressedImage",
            topic if topic.contains("info") => "sensor_msgs/msg/CameraInfo",
            _ => "sensor_msgs/msg/Image",
        };
        let channels = topics.iter();
        channels
            .map(|topic| Channel::cdr(topic, schema(topic)))
            .collect()
    }

    fn chosen_by(topics: &[&str], selection: &Selection) -> Result<[String; 2], String> {
        let channels = channels(topics);
        choose(&channels.iter().collect::<Vec<_>>(), selection)
    }

    fn chosen(topics: &[&str]) -> Result<[String; 2], String> {
        chosen_by(topics, &Selection::default())
    }

    fn by_names(left: Option<&str>, right: Option<&str>) -> Selection {
        let [left, right] = [left, right].map(|name| name.map(str::to_owned));
        Selection {
            left,
            right,
            ..Selection::default()
        }
    }

    #[test]
    fn sides_are_known_by_their_names() {
        for sides in [
            ["/cam0/image_raw", "/cam1/image_raw"],
            ["/stereo/left/image_rect", "/stereo/right/image_rect"],
            [
                "/camera/infra1/image_rect_raw",
                "/camera/infra2/image_rect_raw",
            ],
            ["/kitti/image_00/data", "/kitti/image_01/data"],
            ["/oak/Left_mono", "/oak/Right_mono"],
            ["/zed/l/gray", "/zed/r/gray"],
            ["/left/left_image", "/right/right_image"],
        ] {
            // One pair among three, too.
            for other in ["/scan", "/depth/image"] {
                let found = chosen(&[sides[1], other, sides[0]]);
                assert_eq!(found, Ok(sides.map(str::to_owned)), "{other}");
            }
        }
        for sides in [
            ["/a", "/b"],
            ["/cam0/image1", "/cam1/image2"],
            ["/cam0/x", "/cam2/x"],
            ["/2", "/3"],
        ] {
            assert!(chosen(&sides).is_err(), "{sides:?}");
        }
    }

    #[test]
    fn the_best_variant_of_one_pair_is_used() {
        // `#` is the side.
        let best = |topics: &str| {
            let topics = [topics.replace('#', "left"), topics.replace('#', "right")].join(" ");
            chosen(&topics.split(' ').collect::<Vec<_>>()).map(|[left, _]| left)
        };
        for (topics, expected) in [
            (
                "/#/image_raw /#/image_rect /#/image_rect_color",
                "/left/image_rect",
            ),
            (
                "/#/image_raw /#/image_color /#/image_mono",
                "/left/image_mono",
            ),
            (
                "/zed/#/color/rect/image /zed/#/gray/rect/image /zed/#/gray/raw/image",
                "/zed/left/gray/rect/image",
            ),
            (
                "/#_raw/image_raw /#/image_rect_color",
                "/left/image_rect_color",
            ),
        ] {
            assert_eq!(best(topics).as_deref(), Ok(expected), "{topics}");
        }
        // Topics of different cameras, of different sizes, and of one rank.
        for topics in [
            "/front/#/image_raw /back/#/image_rect",
            "/#/image_raw /#/image_resize",
            "/#/image_rect_mono /#/image_rect_gray",
        ] {
            let error = best(topics).unwrap_err();
            assert!(error.starts_with("which images"), "{topics}");
        }
    }

    #[test]
    fn a_compressed_copy_is_used_without_its_original_alone() {
        let copies = ["/left/image/compressed", "/right/image/compressed"];
        assert_eq!(chosen(&copies).unwrap(), copies);
        let originals = ["/left/image", "/right/image"];
        let all = [copies, originals].concat();
        assert_eq!(chosen(&all).unwrap(), originals);
    }

    #[test]
    fn a_calibration_is_of_the_processing_of_its_images() {
        let found = |infos: &[&str], topic: &str| {
            let channels = channels(infos);
            calibration(&channels.iter().collect::<Vec<_>>(), topic)
        };
        let isaac = ["", "_rect", "_resize"].map(|end| format!("/left/camera_info{end}"));
        let isaac = isaac.each_ref().map(String::as_str);
        for (topic, expected) in [
            ("image_rect", 1),
            ("image_rect_color", 1),
            ("image_rect/compressed", 1),
            ("image_resize", 2),
            ("image_raw", 0),
            ("mono", 0),
        ] {
            let found = found(&isaac, &format!("/left/{topic}"));
            assert_eq!(found.as_deref(), Some(isaac[expected]), "{topic}");
        }
        let zed = ["/left/rect/camera_info", "/left/rect/image/camera_info"];
        assert_eq!(found(&zed, "/left/rect/image").as_deref(), Some(zed[1]));
        assert_eq!(found(&zed[1..], "/left/rect/image_2"), None);
    }

    #[test]
    fn calibrations_elsewhere_are_a_left_and_a_right_one_for_no_other_image() {
        let images = ["/a/left/image", "/a/right/image"];
        for (more, expected) in [
            ("/info/left /info/right", ["/info/left", "/info/right"]),
            ("/info_right /info_left", ["/info_left", "/info_right"]),
            // Both share a namespace with both cameras.
            ("/a/info_l /a/info_r", ["/a/info_l", "/a/info_r"]),
            (
                "/a/left/info /a/right/info /info/left /info/right",
                ["/a/left/info", "/a/right/info"],
            ),
            // Calibrations of other cameras, and two pairs of them.
            (
                "/b/left/image /b/right/image /b/left/info /b/right/info",
                [""; 2],
            ),
            (
                "/info/i/left /info/i/right /info/j/left /info/j/right",
                [""; 2],
            ),
        ] {
            let topics: Vec<_> = images.into_iter().chain(more.split(' ')).collect();
            let channels = channels(&topics);
            let found = found_calibrations(&channels.iter().collect::<Vec<_>>(), images);
            assert_eq!(found.map(Option::unwrap_or_default), expected, "{more}");
        }
    }

    #[test]
    fn rectified_is_a_word_of_the_topics_last_part() {
        let rectified = [
            "/stereo/left/image_rect",
            "/stereo/left/image_rect/compressed",
            "/left/image_rect_color",
            "/camera/infra1/image_rect_raw",
            "/left/rectified",
            "/left/IMAGE_RECT",
            "/left/rect0",
        ];
        let others = [
            "/stereo/left/image_unrectified",
            "/left/image_unrect/compressed",
            "/director/left/image_raw",
            "/rect/left/image_raw",
            "/left/rectangles",
            "/left/direct",
            "",
        ];
        assert_eq!(rectified.map(is_of_rectified), [true; 7]);
        assert_eq!(others.map(is_of_rectified), [false; 7]);
    }

    #[test]
    fn images_that_are_not_read_are_named_with_the_cure() {
        for (schema, encoding, left, words) in [
            (
                "my_msgs/msg/CompressedVideo",
                "cdr",
                Some("/cam0/image"),
                "--left: /cam0/image: my_msgs/msg/CompressedVideo; it reads",
            ),
            (
                "dai.proto.img_frame.ImgFrame",
                "protobuf",
                None,
                "of DepthAI, whose images are in the videos",
            ),
            (
                "foxglove_msgs/msg/RawImage",
                "cdr",
                None,
                "it reads sensor_msgs/msg/Image,",
            ),
            ("sensor_msgs/msg/Imu", "cdr", None, "it has no images"),
        ] {
            let channel = |topic: &str| Channel::new(topic.into(), schema.into(), encoding.into());
            let channels = ["/cam0/image", "/cam1/image"].map(channel);
            let error = choose(&channels.each_ref(), &by_names(left, None)).unwrap_err();
            assert!(error.contains(words), "{error}");
            assert_eq!(error.starts_with("--left: /cam0"), left.is_some());
        }
    }

    #[test]
    fn ambiguous_topics_are_asked_for() {
        let topics = ["/cam0/image", "/cam1/image", "/cam2/image", "/scan"];
        let [cam0, cam1, cam2, scan] = topics;
        let listed = "--left TOPIC --right TOPIC; it has /cam0/image, /cam1/image, /cam2/image";
        for (left, right, expected) in [
            (None, None, Err(listed)),
            (Some(cam2), Some(cam0), Ok([cam2, cam0])),
            (None, Some(cam2), Ok([cam1, cam2])),
            (Some(cam2), None, Err("")),
            (
                Some("/cam9"),
                None,
                Err("no such topic of images; it has /cam0"),
            ),
            (Some(scan), None, Err("LaserScan, not images")),
        ] {
            match (chosen_by(&topics, &by_names(left, right)), expected) {
                (Err(error), Err(words)) => assert!(error.contains(words), "{error}"),
                (found, expected) => assert_eq!(found.unwrap(), expected.unwrap()),
            }
        }
    }
}
