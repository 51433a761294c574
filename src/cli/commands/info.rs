//! `svl info`: the contents of a recording, and its integrity.

use crate::cli::shared::data::{DataColumns, DataField, data_table, data_text, events, field};
use crate::cli::shared::progress::listen_for_interrupt;
use crate::cli::shared::source::hidden;
use crate::cli::shared::terminal::{print_value, width, wrapped};
use std::path::{Path, PathBuf};
use svl::doubt::Cure;
use svl::notice::NoticeLog;
use svl::recording::{Recording, RecordingSummary, is_bag};
use svl::scenario::{PairRange, SourceOptions};
use svl::source::{Heard, OnePicture, Request, SourceFacts, SourceKind, Usability};
use svl::{Error, interrupt, outputs};

/// Show the contents of a recording, and check its integrity
///
/// The first line says if svl can use it: pairs, raw or rectified, calibration, truth, what is
/// missing and the cure.
///
/// Also shows, from the first pairs, the size of the images, focal length and baseline, the nearest
/// distance by the default range of disparities, and the number of cells that each ground truth
/// would score. For a folder of images only these are shown.
#[derive(clap::Args)]
#[command(mut_args(|arg| hidden(arg, NOT_TAKEN)))]
#[command(after_help = "\
Examples:
  svl info recordings/arena.mcap
  svl info bag.mcap     which topics of a ROS 2 bag svl would take
  svl info ros2:        the published topics, and why they form no pairs
  svl info pictures/    image size, focal length, baseline, truth
  svl info recordings/arena.mcap --json | jq '.gaps | length'")]
pub(crate) struct Args {
    /// The recording; any other MCAP file will do, the folder of a ROS 2 bag, a folder of images,
    /// or live topics: ros2:[LEFT,RIGHT]
    file: PathBuf,
    #[command(flatten)]
    options: SourceOptions,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// Options of other commands, which do not change what there is.
const NOT_TAKEN: &[&str] = &["data", "scenes", "seeds", "allow_loss"];

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    args.options
        .refuse(NOT_TAKEN, "does not apply to svl info")?;
    let name = args.file.to_string_lossy();
    let live = match SourceKind::topics(&name) {
        Some(topics) => {
            listen_for_interrupt();
            Some((topics.listen)(&name, interrupt::requested)?)
        }
        None => None,
    };
    let file = live.as_ref().map_or_else(|| args.file.clone(), Heard::bag);
    let is_recording = if file.is_dir() {
        is_bag(&file)
    } else {
        !SourceKind::is_unrecorded(&name)
    };
    let path = file.to_string_lossy();
    let mut request = Request {
        options: args.options.clone(),
        ..Request::new(&path)
    };
    if let Some([left, right]) = live.as_ref().and_then(|heard| heard.named.clone()) {
        (request.options.left, request.options.right) = (Some(left), Some(right));
    }
    let summary = is_recording.then(|| {
        let mut summary = Recording::open(&file)?.summary(&request.selection())?;
        let range = args.options.range();
        if range != PairRange::default() {
            summary.pairs = range.count(&summary.pair_stamps_ns);
        }
        Ok::<_, Error>(summary)
    });
    let summary = summary.transpose()?;
    let (mut usability, first_pairs, no_pairs) = match SourceFacts::read(&request, is_recording) {
        Ok(facts) => {
            let pairs = summary.as_ref().map(|summary| summary.pairs);
            let usability = Usability::from_facts(pairs.or(facts.pairs), &facts);
            (usability, Some(facts), None)
        }
        // A recording without pairs has a summary all the same.
        Err(error) if summary.is_some() && !is_refused(&error) => {
            let (words, reason) = no_pairs(error, &file, &name);
            (Usability::without_pairs(&reason), None, Some(words))
        }
        Err(error) => return Err(error.into()),
    };
    // Layers told of truths while they gave the first pairs, in words.
    let told = NoticeLog::current().doubts().into_iter();
    let told = told.filter(|_| args.json);
    let told = told.filter(|doubt| matches!(doubt.cure, Cure::Truth(_)));
    let told = told.filter(|doubt| !usability.doubts.contains(doubt));
    let told: Vec<_> = told.collect();
    usability.doubts.extend(told);
    let is_intact = summary.as_ref().map(RecordingSummary::is_intact);
    let cure = (is_intact == Some(false)).then(|| format!("svl recover {name} -o OUT.mcap"));
    if let Some(cure) = &cure {
        usability.missing.push(format!("a damaged file: `{cure}`"));
    }
    let info = Info {
        usability,
        is_intact,
        cure,
        unfinished: outputs::unfinished(&args.file).map(|new| {
            let new = new.display();
            format!("{new}: of a killed svl; `svl recover` reads it, and --force removes it")
        }),
        duration_ns: summary.as_ref().map(RecordingSummary::duration_ns),
        summary,
        live,
        first_pairs,
        no_pairs,
    };
    print_value(args.json, &info, || info.text(&name))
}

/// True for an error of what was named, not of what it contains.
fn is_refused(error: &Error) -> bool {
    matches!(error, Error::Usage(_)) || error.downcast_ref::<OnePicture>().is_some()
}

/// The reason why a file has no pairs, of the source `name` and alone: live topics are read from a
/// file that is removed.
fn no_pairs(error: Error, file: &Path, name: &str) -> (String, String) {
    match error {
        Error::Format { path, reason } | Error::Damaged { path, reason } if path == file => {
            (format!("{name}: {reason}"), reason.to_string())
        }
        error => (error.to_string(), error.to_string()),
    }
}

/// The JSON that `--json` prints.
#[derive(serde::Serialize)]
struct Info {
    /// Can svl use it?
    usability: Usability,
    is_intact: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cure: Option<String>,
    /// The new file that a killed svl left beside this one.
    #[serde(skip_serializing_if = "Option::is_none")]
    unfinished: Option<String>,
    #[serde(serialize_with = "svl::nanoseconds::as_text")]
    duration_ns: Option<u64>,
    #[serde(flatten)]
    summary: Option<RecordingSummary>,
    /// In place of a file, what was heard of live topics.
    #[serde(skip_serializing_if = "Option::is_none")]
    live: Option<Heard>,
    first_pairs: Option<SourceFacts>,
    #[serde(skip_serializing_if = "Option::is_none")]
    no_pairs: Option<String>,
}

/// The lines of the text; docs/recording.md explains them.
const FIELDS: &[DataField] = &[
    field("bytes", "size"),
    field("duration_ns", "duration"),
    field("is_intact", "intact"),
    field("damage", "damage"),
    field("checksums", "checksums"),
    field("library", "writer"),
    field("header.source", "source"),
    field("header.scenario", "scenario"),
    field("header.seed", "seed"),
    field("header.calibration", "calibration"),
    field("header.bits", "bits"),
    field("manifest.run_id", "session"),
    field("manifest.began", "began"),
    field("manifest.machine.processor", "machine"),
    field("live.seconds", "seconds"),
    field("live.silent", "silent topics"),
    field("live.lost", "lost messages"),
    field("live.others", "other topics"),
    field("no_pairs", "no pairs"),
    field("pairs", "pairs"),
    field("stereo", "paired topics"),
    field("header.stamps", "stamps"),
    field("period_ns", "period"),
    events("drops", "dropped frames"),
    events("drops_before", "before a pair"),
    events("missing_pairs", "missing pairs"),
    events("unpaired", "unpaired"),
    field("videos", "video"),
    field("first_pairs.geometry", "geometry"),
    field("first_pairs.size_px", "images"),
    field("first_pairs.grey", "grey levels"),
    field("first_pairs.focal_px", "focal length"),
    field("first_pairs.rig.baseline_m", "baseline"),
    field(
        "first_pairs.vertical_misalignment.median_abs_px",
        "misaligned",
    ),
    field(
        "first_pairs.unrectified_misalignment.median_abs_px",
        "unrectified",
    ),
    field("misalignment", "by algorithm"),
    field("first_pairs.nearest", "nearest"),
    field("first_pairs.truths", "truth at start"),
    field("grabber.counts", "grabbed"),
    field("grabber.error", "grabber error"),
    field("skew", "skew"),
    field("skew.histogram", "spread of skew"),
    field("gaps", "gaps"),
    events("repeated_images", "repeated images"),
    field("clock_jumps", "clock jumps"),
    field("clocks.faults", "clock faults"),
    field("poses", "poses"),
    field("poses.frames", "frames"),
    field("missing", "missing"),
    field("losses", "damaged parts"),
    field("cure", "cure"),
    field("unfinished", "unfinished"),
    field("attachments", "attachments"),
];

const TOPIC_COLUMNS: DataColumns<'_> = DataColumns {
    name: ("name", "topic"),
    numbers: &[
        ("messages", "messages"),
        ("rate_hz", "rate"),
        ("bytes", "size"),
    ],
    text: ("schema", "schema"),
};

impl Info {
    fn text(&self, name: &str) -> serde_json::Result<String> {
        let head = format!("{}: ", self.usability.answer());
        let mut text = wrapped(&head, head.len(), &self.usability.words(), width());
        text += &format!("{name}\n{}", data_text(self, FIELDS, width())?);
        if let Some(summary) = &self.summary {
            let topics = data_table(&summary.topics, &TOPIC_COLUMNS, width())?;
            text += &format!("\n{topics}");
        }
        Ok(text)
    }
}
