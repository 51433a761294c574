//! Collects views of the board from a source until there are enough.

use super::ask::{Decision, Offer, ViewPrompt};
use super::report::ReportFolder;
use crate::cli::shared::progress::{interrupted, listen_for_interrupt};
use anyhow::bail;
use indicatif::{ProgressBar, ProgressStyle};
use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};
use std::time::{Duration, Instant};
use svl::calibrate::choose::{Chooser, MissingCoverage, Refusal, SUFFICIENT_VIEWS};
use svl::calibrate::detect::PairDetector;
use svl::calibrate::{Board, MIN_VIEWS, StereoView};
use svl::pass::report_losses;
use svl::source::Opened;
use svl::stereo::Frame;

/// The collected views, and what was refused.
#[derive(Default, serde::Serialize)]
pub(super) struct Collected {
    pairs: u64,
    #[serde(skip)]
    pub(super) views: Vec<StereoView>,
    /// Label of each view: its name in the source, or its number.
    pub(super) accepted: Vec<String>,
    /// Number of pairs that were refused, by reason.
    refused: BTreeMap<String, u64>,
    /// The key in JSON is older than the name.
    #[serde(rename = "lacks")]
    missing: MissingCoverage,
    #[serde(skip)]
    pub(super) size: (usize, usize),
    /// The error that ended the search early.
    #[serde(skip)]
    failure: Option<anyhow::Error>,
    /// Boards with another number of corners, with how often they were seen.
    #[serde(skip)]
    others: BTreeMap<(usize, usize), u64>,
}

/// Reads the source until its end, Ctrl-C, the user's decision, or until there are enough views.
/// Accepted pairs are written to the folder at once.
pub(super) fn collect(
    mut opened: Opened,
    board: Board,
    mut prompt: ViewPrompt,
    folder: &mut ReportFolder,
    quiet: bool,
) -> anyhow::Result<Collected> {
    // Ctrl-C ends the collection, not the program: what was accepted is calibrated.
    listen_for_interrupt();
    let bar = bar(&opened, quiet);
    let mut detector = PairDetector::new(board)?;
    let mut lag = opened.is_live.then(Lag::default);
    let mut chooser: Option<Chooser> = None;
    let mut found = Collected::default();
    while !interrupted() {
        let frame = match opened.source.next() {
            Ok(Some(frame)) => frame,
            Ok(None) => break,
            Err(error) => {
                found.failure = Some(error.into());
                break;
            }
        };
        // Detection may be slower than the cameras: skip pairs instead of falling behind.
        if lag.as_mut().is_some_and(|lag| lag.is_late(frame.stamp_ns)) {
            continue;
        }
        let chooser = chooser.get_or_insert_with(|| {
            if frame.rig().is_some() {
                let name = opened.source.name();
                bar.suspend(|| tracing::warn!("{name}: its images are rectified already"));
            }
            found.size = frame.pair.size();
            Chooser::new(board, found.size)
        });
        if let Err(error) = found.check_size(&frame) {
            found.failure = Some(error);
            break;
        }
        found.pairs += 1;
        let seen = detector.find(&frame.pair);
        // Images with names are unrelated; only a stream has motion to check.
        let stamp_ns = frame.name.is_none().then_some(frame.stamp_ns);
        let verdict = chooser.judge(stamp_ns, &seen);
        if opened.is_live {
            let reason = verdict.as_ref().err().map(Refusal::to_string);
            prompt.show(&frame, &seen, &reason.unwrap_or_default())?;
        }
        let word = match verdict {
            Err(refusal) => found.refuse(&refusal),
            Ok(view) => {
                let offer = Offer {
                    frame: &frame,
                    name: name(&frame),
                    view: &view,
                    missing: chooser.missing(),
                };
                let decision = bar.suspend(|| prompt.ask(&offer))?;
                match found.follow(decision, &frame, view, chooser, folder)? {
                    Some(word) => word,
                    None => break,
                }
            }
        };
        bar.inc(1);
        bar.set_message(progress(chooser, &word));
        if chooser.is_done() {
            break;
        }
    }
    bar.finish_and_clear();
    found.warn_of_failure(folder);
    prompt.finish()?;
    report_losses(&opened.source.name(), &opened.source.finish(found.pairs));
    if let Some(chooser) = chooser {
        found.missing = chooser.missing();
        found.views = chooser.views.to_vec();
    }
    Ok(found)
}

/// The message of the bar; `word` is what became of the last pair.
fn progress(chooser: &Chooser, word: &str) -> String {
    let missing = chooser.missing();
    let missing = if missing.is_empty() {
        String::new()
    } else {
        format!("; still missing: {missing}")
    };
    let accepted = chooser.views.len();
    format!("{accepted} of {SUFFICIENT_VIEWS} accepted, last {word}{missing}")
}

/// The name of a pair in messages: its own, or its number.
fn name(frame: &Frame) -> String {
    let own = frame.name.clone();
    own.unwrap_or_else(|| frame.sequence.to_string())
}

fn bar(opened: &Opened, quiet: bool) -> ProgressBar {
    let pairs = opened.source.pairs();
    let bar = if quiet {
        ProgressBar::hidden()
    } else {
        pairs.map_or_else(ProgressBar::no_length, ProgressBar::new)
    };
    let form = if pairs.is_some() {
        "{pos:>5}/{len} pairs, {wide_msg}"
    } else {
        "{pos:>5} pairs, {wide_msg}"
    };
    // The templates above are constants, and the tests run both.
    bar.with_style(ProgressStyle::with_template(form).expect("a valid template"))
}

/// Delay with which the pairs of a live source are processed.
#[derive(Default)]
struct Lag {
    first: Option<(Instant, u64)>,
}

impl Lag {
    /// Pairs that waited longer are skipped: the board is elsewhere by now.
    const MAX_LAG: Duration = Duration::from_millis(250);

    fn is_late(&mut self, stamp_ns: u64) -> bool {
        let (began, first_ns) = *self.first.get_or_insert((Instant::now(), stamp_ns));
        began.elapsed() > Duration::from_nanos(stamp_ns.saturating_sub(first_ns)) + Self::MAX_LAG
    }
}

impl Collected {
    fn check_size(&self, frame: &Frame) -> anyhow::Result<()> {
        let ((width, height), (w, h)) = (self.size, frame.pair.size());
        if (width, height) != (w, h) {
            let name = name(frame);
            bail!(
                "pair {name} is {w}x{h} pixels, those before {width}x{height}; a calibration is \
                 of one size"
            );
        }
        Ok(())
    }

    fn refuse(&mut self, refusal: &Refusal) -> String {
        if let Refusal::OtherBoard(_, corners) = refusal {
            *self.others.entry(*corners).or_default() += 1;
        }
        let word = refusal.to_string();
        *self.refused.entry(word.clone()).or_default() += 1;
        word
    }

    /// Keeps or declines an offered view, and returns a word for it; `None` to stop.
    fn follow(
        &mut self,
        decision: Decision,
        frame: &Frame,
        view: StereoView,
        chooser: &mut Chooser,
        folder: &mut ReportFolder,
    ) -> anyhow::Result<Option<String>> {
        Ok(match decision {
            Decision::Accept => {
                folder.keep(frame, &view)?;
                self.accepted.push(name(frame));
                chooser.keep(view);
                Some("accepted".to_owned())
            }
            Decision::Decline => {
                chooser.decline(&view);
                *self.refused.entry("not wanted".to_owned()).or_default() += 1;
                Some("not wanted".to_owned())
            }
            Decision::Stop => None,
        })
    }

    /// Warns of an error that ended the search, if there are enough views without it.
    fn warn_of_failure(&self, folder: &ReportFolder) {
        let failure = self.failure.as_ref();
        if let Some(failure) = failure.filter(|_| folder.pairs() >= MIN_VIEWS) {
            tracing::warn!("{failure:#}; calibrating from the views before it");
        }
    }

    /// Reason why there are not enough views, with the cure.
    pub(super) fn too_few(self, source: &str, board: &Board) -> anyhow::Error {
        if let Some(failure) = self.failure {
            return failure;
        }
        let (columns, rows) = (board.columns(), board.rows());
        let counted = "--squares counts the inner corners, one less than the squares";
        let other = self.others.iter().max_by_key(|(_, times)| **times);
        let (pairs, reasons) = (self.pairs, self.reasons());
        let why = match (self.views.len(), other) {
            // Some false detections of other sizes are normal; a quarter of the pairs is another
            // board.
            (_, Some(((long, short), times))) if *times > pairs / 4 => format!(
                "{source}: shows a board of {long}x{short} inner corners, not {columns}x{rows}; \
                 try --squares {long}x{short}"
            ),
            (0, _) if !self.views_were_offered() => format!(
                "{source}: no complete board of {columns}x{rows} inner corners in both images of \
                 any of {pairs} pairs ({reasons}); {counted}"
            ),
            (views, _) => format!(
                "{source}: {views} of {pairs} pairs accepted, at least {MIN_VIEWS} are needed \
                 ({reasons})"
            ),
        };
        anyhow::Error::msg(why)
    }

    fn views_were_offered(&self) -> bool {
        let mut words = ["not wanted", "nothing new", "moving"].into_iter();
        words.any(|word| self.refused.contains_key(word))
    }

    /// `47 no board left, 3 moving`: the most frequent first.
    fn reasons(&self) -> String {
        let mut reasons: Vec<_> = self.refused.iter().collect();
        reasons.sort_by_key(|(_, times)| std::cmp::Reverse(**times));
        let reasons = reasons
            .iter()
            .map(|(word, times)| format!("{times} {word}"));
        match &reasons.collect::<Vec<_>>()[..] {
            [] => "none".to_owned(),
            reasons => reasons.join(", "),
        }
    }
}

impl Display for Collected {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let (views, pairs, reasons) = (self.views.len(), self.pairs, self.reasons());
        writeln!(f, "{views} of {pairs} pairs accepted; refused: {reasons}")?;
        if !self.missing.is_empty() {
            writeln!(f, "Still missing, and worth more pairs: {}", self.missing)?;
        }
        Ok(())
    }
}
