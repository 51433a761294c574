//! `svl info`: the contents of a recording, and its integrity.

mod first_pairs;

use crate::cli::shared::progress::listen_for_interrupt;
use crate::cli::shared::terminal::{
    FactLine, MAX_LISTED, fact, fact_text, listed, losses, missing, print, print_json, size, width,
    wrapped,
};
use std::path::{Path, PathBuf};
use svl::manifest::Manifest;
use svl::recording::{
    FramePoses, Misalignment, PoseSummary, Recording, RecordingSummary, SkewSummary, StampOrigin,
    Topic, UnpairedImages, VideoSummary, is_bag,
};
use svl::report::table::{Table, TerminalStyle};
use svl::source::{Heard, Request, SourceFacts, SourceKind, Usability};
use svl::{Error, counted, interrupt};

/// Show the contents of a recording, and check its integrity
///
/// The first line says if svl can use it: pairs, raw or rectified, calibration, truth, what is
/// missing and the cure.
///
/// Also shows, from the first pairs, the size of the images, focal length and baseline, the nearest
/// distance by the default range of disparities, and the number of cells that each ground truth
/// would score. For a folder of images only these are shown.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl info recordings/arena.mcap
  svl info bag.mcap     which topics of a ROS 2 bag svl would take
  svl info ros2:        the published topics, and why they form no pairs
  svl info pictures/    image size, focal length, baseline, truth
  svl info recordings/arena.mcap --json | jq '.gaps | length'")]
pub(crate) struct Args {
    /// The recording; any other MCAP file will do, the folder of a ROS 2 bag of one file, a folder
    /// of images, or live topics: ros2:[LEFT,RIGHT]
    file: PathBuf,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let name = args.file.to_string_lossy();
    let live = match SourceKind::topics(&name) {
        Some(topics) => {
            listen_for_interrupt();
            Some((topics.listen)(&name, interrupt::requested)?)
        }
        None => None,
    };
    let file = live.as_ref().map_or_else(|| args.file.clone(), Heard::bag);
    let is_recording = !file.is_dir() || is_bag(&file);
    let summary = if is_recording {
        Some(Recording::open(&file)?.summary()?)
    } else {
        None
    };
    let path = file.to_string_lossy();
    let mut request = Request::new(&path);
    if let Some([left, right]) = live.as_ref().and_then(|heard| heard.named.clone()) {
        (request.options.left, request.options.right) = (Some(left), Some(right));
    }
    let (mut usability, first_pairs, no_pairs) = match SourceFacts::read(&request, is_recording) {
        Ok(facts) => {
            let pairs = summary.as_ref().map(|summary| summary.pairs);
            let usability = Usability::from_facts(pairs.or(facts.pairs), &facts);
            (usability, Some(facts), None)
        }
        // A recording without pairs has a summary all the same.
        Err(error) if summary.is_some() => {
            let (words, reason) = no_pairs(error, &file, &name);
            (Usability::without_pairs(&reason), None, Some(words))
        }
        Err(error) => return Err(error.into()),
    };
    if summary.as_ref().is_some_and(|summary| !summary.is_intact()) {
        let cure = format!("a damaged file: `svl recover {name} -o OUT.mcap`");
        usability.missing.push(cure);
    }
    let info = Info {
        usability,
        summary,
        live,
        first_pairs,
        no_pairs,
    };
    if args.json {
        print_json(&info)
    } else {
        print(&info.text(&name))
    }
}

/// The reason why a file has no pairs, of the source `name` and alone: live topics are read from a
/// file that is removed.
fn no_pairs(error: Error, file: &Path, name: &str) -> (String, String) {
    match error {
        Error::Format { path, reason } | Error::Damaged { path, reason } if path == file => {
            (format!("{name}: {reason}"), reason)
        }
        error => (error.to_string(), error.to_string()),
    }
}

/// The JSON that `--json` prints.
#[derive(serde::Serialize)]
struct Info {
    /// Can svl use it?
    usability: Usability,
    #[serde(flatten)]
    summary: Option<RecordingSummary>,
    /// In place of a file, what was heard of live topics.
    #[serde(skip_serializing_if = "Option::is_none")]
    live: Option<Heard>,
    first_pairs: Option<SourceFacts>,
    #[serde(skip_serializing_if = "Option::is_none")]
    no_pairs: Option<String>,
}

impl Info {
    fn text(&self, name: &str) -> String {
        let facts = self.first_pairs.as_ref().map(first_pairs::lines);
        let why_none = self.no_pairs.iter();
        let why_none = why_none.map(|reason| fact!("images", "{reason}"));
        let facts = facts.unwrap_or_else(|| why_none.collect());
        let rest = match (&self.summary, &self.first_pairs) {
            (Some(summary), _) => {
                let begin = match &self.live {
                    Some(heard) => heard_lines(name, heard),
                    None => file_lines(summary),
                };
                table(summary, begin, facts)
            }
            (None, Some(SourceFacts { geometry, .. })) => {
                let geometry = fact!("geometry", "{}", geometry.name());
                let mut lines = vec![FactLine::Heading(name.to_owned()), geometry];
                lines.extend(facts);
                fact_text(&lines, width())
            }
            (None, None) => String::new(),
        };
        format!("{}{rest}", self.first_line())
    }

    /// The answer to "can svl use this?", broken at the last column.
    fn first_line(&self) -> String {
        let head = format!("{}: ", self.usability.answer());
        wrapped(&head, head.len(), &self.usability.words(), width())
    }
}

/// Received and silent topics of the source `name`.
fn heard_lines(name: &str, heard: &Heard) -> Vec<FactLine> {
    let Heard {
        seconds,
        silent,
        lost,
        others,
        ..
    } = heard;
    let mut lines = vec![FactLine::Heading(format!("{name}: {seconds:.1} s"))];
    lines.extend(silent.iter().map(|(topic, publishers)| {
        let publishers = counted(*publishers as u64, "publisher");
        fact!("silent", "{topic}: {publishers}, nothing received")
    }));
    let lost = lost.iter();
    lines.extend(lost.map(|(topic, n)| fact!("lost", "{} of {topic}", counted(*n, "message"))));
    lines.extend(listed(others.iter(), |(topic, schema)| {
        fact!("other", "{topic}, {schema}")
    }));
    lines
}

/// The file with its integrity and its writer.
fn file_lines(summary: &RecordingSummary) -> Vec<FactLine> {
    let mut lines = vec![
        FactLine::Heading(format!(
            "{}: {}, {}",
            summary.path.display(),
            size(summary.bytes),
            seconds(summary.duration_ns())
        )),
        match &summary.damage {
            None if !summary.checksums => {
                fact!("intact", "as far as can be known: it has no checksums")
            }
            None => fact!("intact", "yes"),
            Some(damage) => fact!("intact", "NO: {damage}"),
        },
        match &summary.header {
            None => fact!("writer", "{}", summary.library),
            Some(header) => {
                let seed = header
                    .seed
                    .map(|seed| format!(", seed {seed}"))
                    .unwrap_or_default();
                let scenario = header
                    .scenario
                    .as_ref()
                    .map(|name| format!(", scenario {name}"))
                    .unwrap_or_default();
                fact!(
                    "writer",
                    "{}, from {}{scenario}{seed}",
                    summary.library,
                    header.source
                )
            }
        },
    ];
    let manifest = summary.manifest.clone().map(serde_json::from_value);
    if let Some(Ok(Manifest {
        run_id,
        began,
        machine,
        ..
    })) = manifest
    {
        lines.push(fact!(
            "run",
            "{run_id}, began {began} on {}",
            machine.processor
        ));
    }
    lines
}

fn table(summary: &RecordingSummary, mut lines: Vec<FactLine>, facts: Vec<FactLine>) -> String {
    lines.push(pairs(summary));
    lines.extend(unpaired(summary));
    lines.extend(summary.videos.iter().map(video));
    lines.extend(geometry(summary));
    lines.extend(facts);
    lines.extend(
        summary
            .grabber
            .get("counts")
            .map(|counts| fact!("grabbed", "{counts}")),
    );
    lines.extend(
        summary
            .grabber
            .get("error")
            .map(|error| fact!("ended", "by an error: {error}")),
    );
    let bits = summary.header.as_ref().and_then(|header| header.bits);
    lines.extend(bits.map(|bits| fact!("bits", "{bits} of 16 used by its source's images")));
    match &summary.skew {
        Some(known) => lines.extend(skew(known)),
        None if summary.pairs > 0 => lines.push(fact!("skew", "not known")),
        None => {}
    }
    lines.extend(summary.misalignment.iter().map(misalignment));
    lines.extend(gaps(summary));
    lines.extend(repeated(summary));
    lines.extend(clock(summary));
    lines.extend(summary.poses.iter().flat_map(poses));
    lines.extend(missing(&summary.missing));
    if !summary.is_intact() {
        lines.extend(losses(&summary.losses));
        lines.push(fact!(
            "cure",
            "svl recover {} -o OUT.mcap",
            summary.path.display()
        ));
    }
    lines.extend(
        summary
            .attachments
            .iter()
            .map(|(name, bytes)| fact!("attached", "{name}, {}", counted(*bytes, "byte"))),
    );
    let last = width();
    let topics = topics(&summary.topics).terminal(TerminalStyle::plain(last));
    format!("{}\n{topics}", fact_text(&lines, last))
}

fn pairs(summary: &RecordingSummary) -> FactLine {
    let rate = summary
        .period_ns
        .filter(|&period| period > 0)
        .map(|period| 1e9 / period as f64);
    let origin = summary.header.as_ref().and_then(|header| header.stamps);
    let rate = match (origin, rate) {
        (Some(StampOrigin::Nominal(hz)), _) => {
            format!(", rate not known (its stamps are nominal, {hz} a second)")
        }
        (Some(StampOrigin::Given(hz)), _) => format!(", {hz} a second by --fps"),
        (None, rate) => rate.map_or(String::new(), |hz| format!(", {hz:.2} a second")),
    };
    if let Some([left, right]) = &summary.stereo {
        let pairs = summary.pairs;
        return fact!(
            "pairs",
            "{pairs}: {left}{rate}, with {right}, by their stamps"
        );
    }
    let missing = match summary.missing_pairs {
        0 => String::new(),
        n => format!(", {n} missing between the first and the last"),
    };
    // The grabber's own counts say more.
    let before = match summary.drops_before {
        0 => String::new(),
        n => format!(" ({n} before the first pair)"),
    };
    let dropped = if summary.grabber.is_empty() {
        format!(", {} dropped{before}", counted(summary.drops, "frame"))
    } else {
        String::new()
    };
    fact!("pairs", "{}{rate}{dropped}{missing}", summary.pairs)
}

/// Images without a partner: those at the edges, where one camera began earlier or ended later, and
/// those between pairs, which were lost.
fn unpaired(summary: &RecordingSummary) -> Option<FactLine> {
    let unpaired = summary.unpaired.filter(|unpaired| unpaired.total() > 0)?;
    let UnpairedImages {
        before,
        inside,
        after,
    } = unpaired;
    let total = counted(unpaired.total(), "image");
    Some(fact!(
        "unpaired",
        "{total}: {before} before the first pair, {inside} between pairs, {after} after \
         the last"
    ))
}

/// A topic of videos, its codec and the pictures that cannot be decoded.
fn video((topic, video): (&String, &VideoSummary)) -> FactLine {
    let codec = video.codec.unwrap_or("not known");
    let undecodable = video.reason.as_ref().map(|reason| {
        let (n, all) = (video.undecodable, counted(video.pictures, "picture"));
        format!("; {n} of {all} cannot be decoded, the first as {reason}")
    });
    fact!(
        "video",
        "{topic}: {codec}{}",
        undecodable.unwrap_or_default()
    )
}

/// Geometry of the pairs, raw or rectified, and the calibration.
fn geometry(summary: &RecordingSummary) -> Option<FactLine> {
    let names: Vec<_> = summary.geometry.iter().map(|kind| kind.name()).collect();
    let calibration = summary
        .header
        .as_ref()
        .and_then(|header| header.calibration.as_ref())
        .map_or_else(String::new, |calibration| format!(" by {calibration}"));
    (!names.is_empty()).then(|| fact!("geometry", "{}{calibration}", names.join(" and ")))
}

/// The vertical misalignment that an algorithm measured.
fn misalignment(misalignment: &Misalignment) -> FactLine {
    let Misalignment {
        algorithm,
        pairs,
        median_px,
        min_px,
        max_px,
    } = misalignment;
    let words = match median_px {
        0 => "both images at the same height".to_owned(),
        1.. => format!("right image {median_px} px lower"),
        _ => format!("right image {} px higher", median_px.unsigned_abs()),
    };
    let pairs = counted(*pairs, "pair");
    fact!(
        "misaligned",
        "{algorithm}: {words} (median of {pairs}; {min_px} .. {max_px} px, positive is \
         lower)"
    )
}

/// Columns of the longest bar.
const BAR: u64 = 30;

/// The skew, with a histogram if it varies.
fn skew(skew: &SkewSummary) -> Vec<FactLine> {
    // A unit for all, in which the range has some digits before the point.
    let range_ns = skew.min_ns.unsigned_abs().max(skew.max_ns.unsigned_abs());
    let (unit_ns, unit) = if range_ns < 1_000_000 {
        (1e3, "µs")
    } else {
        (1e6, "ms")
    };
    let number = |ns: i64| format!("{:.1}", ns as f64 / unit_ns);
    let [min, median, max] = [skew.min_ns, skew.median_ns, skew.max_ns].map(number);
    let mut lines = vec![fact!(
        "skew",
        "{min} .. {max} {unit}, median {median} {unit}"
    )];
    let most = skew
        .histogram
        .iter()
        .map(|bin| bin.pairs)
        .max()
        .unwrap_or(0);
    if skew.histogram.len() > 1 {
        // Edges are multiples of a bin's width.
        let width_ns = skew.histogram[0]
            .to_ns
            .abs_diff(skew.histogram[0].from_ns)
            .max(1) as f64;
        // The bin width decides the decimals, so that edges are printed exactly.
        let digits = (unit_ns / width_ns).log10().ceil().max(0.0) as usize;
        let edge = |ns: i64| format!("{:.digits$}", ns as f64 / unit_ns);
        lines.extend(skew.histogram.iter().map(|bin| {
            // Rounded up: a bin with one pair still shows.
            let bar = "#".repeat((bin.pairs * BAR).div_ceil(most) as usize);
            FactLine::Columns(format!(
                "{:>7} .. {:>7} {unit} {bar:<width$} {}",
                edge(bin.from_ns),
                edge(bin.to_ns),
                bin.pairs,
                width = BAR as usize
            ))
        }));
    }
    lines
}

fn gaps(summary: &RecordingSummary) -> Vec<FactLine> {
    let Some(longest) = summary.gaps.iter().map(|gap| gap.length_ns).max() else {
        return summary
            .period_ns
            .map(|_| fact!("gaps", "none"))
            .into_iter()
            .collect();
    };
    let mut lines = vec![fact!(
        "gaps",
        "{}, the longest {}",
        summary.gaps.len(),
        seconds(longest)
    )];
    let after = |ns: u64| seconds(ns.saturating_sub(summary.start_ns));
    lines.extend(listed(summary.gaps.iter(), |gap| {
        fact!(
            "",
            "{} after {}",
            seconds(gap.length_ns),
            after(gap.after_ns)
        )
    }));
    lines
}

/// Images that are equal to the one before.
fn repeated(summary: &RecordingSummary) -> Option<FactLine> {
    let [left, right] = summary.repeated_images;
    (left + right > 0).then(|| {
        fact!(
            "equal",
            "{left} left and {right} right images equal the one before"
        )
    })
}

/// Jumps of the stamps of the left images against the log times.
fn clock(summary: &RecordingSummary) -> Vec<FactLine> {
    let jumps = &summary.clock_jumps;
    if jumps.is_empty() {
        return Vec::new();
    }
    let many = counted(jumps.len() as u64, "time");
    let mut lines = vec![fact!("clock", "the stamps of the left images jump {many}")];
    lines.extend(listed(jumps.iter(), |jump| {
        let way = if jump.by_ns < 0 { "back" } else { "ahead" };
        fact!(
            "",
            "{way} by {} after {}",
            seconds(jump.by_ns.unsigned_abs()),
            seconds(jump.after_ns)
        )
    }));
    lines
}

/// The poses of each frame, and the images that have one.
fn poses(summary: &PoseSummary) -> Vec<FactLine> {
    let PoseSummary {
        frames,
        images,
        placed,
        unusable,
        faulty,
    } = summary;
    let words = |frame: &FramePoses| {
        let rate = frame.rate_hz.map(|hz| format!(", {hz:.2} a second"));
        let largest = frame.largest.map(|step| {
            format!(
                ", largest step {:.3} m, {:.1}° in {:.0} ms",
                step.metres,
                step.radians.to_degrees(),
                (step.end_ns - step.start_ns) as f64 / 1e6
            )
        });
        let jumps = (frame.jumps > 0).then(|| {
            let many = counted(frame.jumps, "step");
            format!("; {many} that no robot makes, across which no truth is moved")
        });
        format!(
            "{}: {} → {}, {}{}{}{}",
            frame.topic,
            frame.parent,
            frame.frame,
            counted(frame.poses, "pose"),
            rate.unwrap_or_default(),
            largest.unwrap_or_default(),
            jumps.unwrap_or_default()
        )
    };
    let mut lines: Vec<_> = frames.iter().take(MAX_LISTED).map(words).collect();
    if frames.len() > MAX_LISTED {
        let more = frames.len() - MAX_LISTED;
        lines.push(format!("and {more} more frames; --json lists them"));
    }
    lines.push(match unusable {
        None => format!("all {images} left images have one"),
        Some(reason) => format!("{placed} of {images} left images have one: {reason}"),
    });
    lines.extend(faulty.iter().map(|(topic, (messages, why))| {
        let messages = counted(*messages, "message");
        format!("{messages} of {topic} cannot be used: {why}")
    }));
    let label = |(i, line)| fact!(if i == 0 { "poses" } else { "" }, "{line}");
    lines.into_iter().enumerate().map(label).collect()
}

fn topics(topics: &[Topic]) -> Table {
    let table = Table::new("", "topic").with_columns(["messages", "Hz", "size"]);
    let mut table = table.with_texts(["schema"]);
    for topic in topics {
        let rate = topic.rate_hz.map(|hz| format!("{hz:.2}"));
        let cells = [
            topic.messages.to_string(),
            rate.unwrap_or_default(),
            size(topic.bytes),
            topic.schema.clone(),
        ];
        table.push(&topic.name, cells);
    }
    table
}

fn seconds(ns: u64) -> String {
    format!("{:.3} s", ns as f64 / 1e9)
}
