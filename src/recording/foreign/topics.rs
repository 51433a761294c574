//! Which topics of a foreign recording are the two cameras.

use super::{camera, image};
use crate::recording::messages::Channel;

/// Which pairs to read of a recording that svl did not write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Topic of the left images; found by type and name where it is not given.
    pub left: Option<String>,
    pub right: Option<String>,
    /// How far the stamps of a pair may be apart.
    pub max_skew_ns: u64,
}

impl Selection {
    /// A quarter of the period at 50 pairs a second: cameras with one trigger are far below, ones that run free above.
    pub const MAX_SKEW_NS: u64 = 5_000_000;

    /// Whether it names a topic, so that even svl's own recordings are read as foreign ones are.
    pub fn names_topics(&self) -> bool {
        self.left.is_some() || self.right.is_some()
    }
}

impl Default for Selection {
    fn default() -> Self {
        Self { left: None, right: None, max_skew_ns: Self::MAX_SKEW_NS }
    }
}

/// Whether the messages of a channel are images.
pub(in crate::recording) fn is_image(channel: &Channel) -> bool {
    image::SCHEMAS.contains(&channel.schema.as_str())
}

/// The topics of the left and the right images.
///
/// # Errors
/// Why there are none, or more than one pair of them, with the cure.
pub(in crate::recording) fn choose(channels: &[Channel], selection: &Selection) -> Result<[String; 2], String> {
    let images: Vec<_> = channels.iter().filter(|channel| is_image(channel)).collect();
    let mut topics: Vec<&str> = images.iter().map(|channel| channel.topic.as_str()).collect();
    topics.sort_unstable();
    topics.dedup();
    let listed = topics.join(", ");
    for (option, named) in [("--left", &selection.left), ("--right", &selection.right)] {
        if let Some(named) = named.as_deref().filter(|named| !topics.contains(named)) {
            return Err(match channels.iter().find(|channel| channel.topic == named) {
                Some(channel) => format!("{option} {named} has messages of {}, no images", channel.schema),
                None if topics.is_empty() => format!("{option} {named}: it has no images"),
                None => format!("{option} {named}: no such topic of images; it has {listed}"),
            });
        }
    }
    let free = |named: &Option<String>, topic: &str| named.as_deref().is_none_or(|named| named == topic);
    let pairs = topics.iter().flat_map(|&left| topics.iter().map(move |&right| [left, right]));
    let pairs =
        pairs.filter(|&[left, right]| free(&selection.left, left) && free(&selection.right, right) && left != right);
    let both_named = selection.left.is_some() && selection.right.is_some();
    let pairs: Vec<_> = pairs.filter(|&[left, right]| both_named || are_sides(left, right)).collect();
    match (pairs[..].split_first(), &topics[..]) {
        (Some((pair, [])), _) => Ok(pair.map(str::to_owned)),
        (_, []) => Err("has no stereo pairs: it has no images".to_owned()),
        (_, [only]) => Err(format!("has no stereo pairs: {only} is its only topic of images")),
        _ => Err(format!("which images are the pair? Name two with --left TOPIC --right TOPIC; it has {listed}")),
    }
}

/// Whether two topics differ as left and right do: in these words, or in a number that is one higher, from 0 or 1.
fn are_sides(left: &str, right: &str) -> bool {
    let (left, right) = (left.to_lowercase(), right.to_lowercase());
    if left.contains("left") && left.replace("left", "right") == right {
        return true;
    }
    let (left, right) = (words(&left), words(&right));
    let differing: Vec<_> = left.iter().zip(&right).filter(|(l, r)| l != r).collect();
    let is_number_pair = |(l, r): (&str, &str)| [("0", "1"), ("1", "2"), ("00", "01"), ("01", "02")].contains(&(l, r));
    let Some(&(first_left, first_right)) = differing.first() else { return false };
    let first = (first_left.as_str(), first_right.as_str());
    left.len() == right.len()
        && (first == ("l", "r") || is_number_pair(first))
        && differing.iter().all(|(l, r)| (l.as_str(), r.as_str()) == first)
}

/// The runs of letters, of digits, and single other characters of a topic.
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

/// The topic of the calibration that belongs to the images of `topic`: the one that shares the most of its folders.
pub(super) fn calibration(channels: &[Channel], topic: &str) -> Option<String> {
    let calibrations = channels.iter().filter(|channel| camera::SCHEMAS.contains(&channel.schema.as_str()));
    let folder = |channel: &&Channel| channel.topic.rsplit_once('/').map_or(0, |(folder, _)| folder.len() + 1);
    let fits = |channel: &&Channel| topic.starts_with(&channel.topic[..folder(channel)]);
    // By name where several share as much, so that the order in the file does not matter.
    let found = calibrations.filter(fits).max_by_key(|channel| (folder(channel), std::cmp::Reverse(&channel.topic)));
    found.map(|channel| channel.topic.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(topics: &[&str], selection: &Selection) -> Result<[String; 2], String> {
        let channel = |&topic: &&str| {
            let schema = if topic.ends_with("scan") { "LaserScan" } else { "sensor_msgs/msg/Image" };
            Channel { topic: topic.to_owned(), schema: schema.to_owned(), encoding: "cdr".to_owned() }
        };
        let channels: Vec<_> = topics.iter().map(channel).collect();
        choose(&channels, selection)
    }

    #[test]
    fn sides_are_known_by_their_names() {
        for (left, right) in [
            ("/cam0/image_raw", "/cam1/image_raw"),
            ("/stereo/left/image_rect", "/stereo/right/image_rect"),
            ("/camera/infra1/image_rect_raw", "/camera/infra2/image_rect_raw"),
            ("/kitti/image_00/data", "/kitti/image_01/data"),
            ("/oak/Left_mono", "/oak/Right_mono"),
            ("/zed/l/gray", "/zed/r/gray"),
            ("/left/left_image", "/right/right_image"),
        ] {
            let expected = Ok([left.to_owned(), right.to_owned()]);
            assert_eq!(chosen(&[right, "/scan", left], &Selection::default()), expected);
            assert_eq!(chosen(&[right, "/depth/image", left], &Selection::default()), expected, "one pair among three");
        }
        for (left, right) in [("/a", "/b"), ("/cam0/image1", "/cam1/image2"), ("/cam0/x", "/cam2/x"), ("/2", "/3")] {
            assert!(chosen(&[left, right], &Selection::default()).is_err(), "{left} {right}");
        }
    }

    #[test]
    fn what_is_ambiguous_is_asked() {
        let topics = ["/cam0/image", "/cam1/image", "/cam2/image", "/scan"];
        let error = chosen(&topics, &Selection::default()).unwrap_err();
        assert!(error.contains("--left TOPIC --right TOPIC; it has /cam0/image, /cam1/image, /cam2/image"), "{error}");
        let named = |left: Option<&str>, right: Option<&str>| {
            let (left, right) = (left.map(str::to_owned), right.map(str::to_owned));
            chosen(&topics, &Selection { left, right, ..Selection::default() })
        };
        assert_eq!(named(Some("/cam2/image"), Some("/cam0/image")).unwrap(), ["/cam2/image", "/cam0/image"]);
        assert_eq!(named(None, Some("/cam2/image")).unwrap(), ["/cam1/image", "/cam2/image"]);
        assert!(named(Some("/cam2/image"), None).is_err());
        assert!(named(Some("/cam9"), None).unwrap_err().contains("no such topic of images; it has /cam0"));
        assert!(named(Some("/scan"), None).unwrap_err().contains("LaserScan, no images"));
    }
}
