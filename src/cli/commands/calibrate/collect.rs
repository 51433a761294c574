//! Pairs from a source, until there are enough with a board that helps.

use super::ask::{Answer, Judge, Offer};
use super::report::Folder;
use crate::cli::shared::progress::{interrupted, listen_for_interrupt};
use crate::cli::shared::runner::report_losses;
use crate::cli::shared::source::Opened;
use anyhow::bail;
use indicatif::{ProgressBar, ProgressStyle};
use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};
use std::time::{Duration, Instant};
use svl::calibrate::choose::{Chooser, ENOUGH, Lacks, Refusal};
use svl::calibrate::detect::{PairDetector, Seen};
use svl::calibrate::{Board, LEAST_VIEWS, View};
use svl::stereo::Frame;

/// What a search found.
#[derive(serde::Serialize)]
pub(super) struct Collected {
    pairs: u64,
    #[serde(skip)]
    pub(super) views: Vec<View>,
    /// What the source calls each view: its name, or its number.
    pub(super) accepted: Vec<String>,
    /// How many pairs were refused, by reason.
    refused: BTreeMap<String, u64>,
    lacks: Lacks,
    #[serde(skip)]
    pub(super) size: (usize, usize),
    /// What ended the search before its time.
    #[serde(skip)]
    failure: Option<anyhow::Error>,
    /// Boards of other corners that were seen, with how often.
    #[serde(skip)]
    others: BTreeMap<(usize, usize), u64>,
}

/// Reads the source to its end, to Ctrl-C, to the user's wish, or until there are enough views.
/// Accepted pairs are in the folder at once.
pub(super) fn collect(
    mut opened: Opened,
    board: Board,
    mut judge: Judge,
    folder: &mut Folder,
    quiet: bool,
) -> anyhow::Result<Collected> {
    listen_for_interrupt();
    let bar = bar(&opened, quiet);
    let mut detector = PairDetector::new(board)?;
    let mut lag = opened.is_live.then(Lag::default);
    let mut chooser: Option<Chooser> = None;
    let mut found = Collected::new();
    while !interrupted() {
        let frame = match opened.source.next() {
            Ok(Some(frame)) => frame,
            Ok(None) => break,
            Err(error) => {
                found.failure = Some(error.into());
                break;
            }
        };
        if lag.as_mut().is_some_and(|lag| lag.is_late(frame.stamp_ns)) {
            continue;
        }
        let chooser = chooser.get_or_insert_with(|| {
            if frame.rig().is_some() {
                bar.suspend(|| {
                    tracing::warn!(
                        "{} says that its images are rectified already",
                        opened.source.name()
                    )
                });
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
        // Pictures with names are no stream.
        let stamp_ns = frame.name.is_none().then_some(frame.stamp_ns);
        let verdict = chooser.judge(stamp_ns, &seen);
        if opened.is_live {
            judge.show(
                &frame,
                &seen,
                &verdict
                    .as_ref()
                    .err()
                    .map_or_else(String::new, Refusal::to_string),
            )?;
        }
        let word = match verdict {
            Err(refusal) => found.refuse(&refusal),
            Ok(view) => {
                let offer = Offer {
                    frame: &frame,
                    name: name(&frame),
                    view: &view,
                    lacks: chooser.lacks(),
                };
                match bar.suspend(|| judge.ask(&offer))? {
                    Answer::Yes => {
                        folder.keep(&frame, &view)?;
                        found.accepted.push(name(&frame));
                        chooser.keep(view);
                        "accepted".to_owned()
                    }
                    Answer::No => {
                        chooser.decline(&view);
                        *found.refused.entry("not wanted".to_owned()).or_default() += 1;
                        "not wanted".to_owned()
                    }
                    Answer::Enough => break,
                }
            }
        };
        let lacks = chooser.lacks();
        let missing = if lacks.is_nothing() {
            String::new()
        } else {
            format!("; still missing: {lacks}")
        };
        bar.inc(1);
        bar.set_message(format!(
            "{} of {ENOUGH} accepted, last {word}{missing}",
            chooser.views().len()
        ));
        if chooser.is_done() {
            break;
        }
    }
    bar.finish_and_clear();
    if let Some(failure) = found
        .failure
        .as_ref()
        .filter(|_| folder.pairs() >= LEAST_VIEWS)
    {
        tracing::warn!("{failure:#}; calibrating from what came before");
    }
    judge.finish()?;
    report_losses(&opened.source.name(), &opened.source.finish(found.pairs));
    if let Some(chooser) = chooser {
        found.lacks = chooser.lacks();
        found.views = chooser.views().to_vec();
    }
    Ok(found)
}

/// What a person calls a pair.
fn name(frame: &Frame) -> String {
    frame
        .name
        .clone()
        .unwrap_or_else(|| frame.sequence.to_string())
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
    // The templates above are constants; the tests run both.
    bar.with_style(ProgressStyle::with_template(form).expect("a valid template"))
}

/// How far a live source is behind.
#[derive(Default)]
struct Lag {
    first: Option<(Instant, u64)>,
}

impl Lag {
    /// Pairs that waited longer are of the past: the board is elsewhere by now.
    const MOST: Duration = Duration::from_millis(250);

    fn is_late(&mut self, stamp_ns: u64) -> bool {
        let (began, first_ns) = *self.first.get_or_insert((Instant::now(), stamp_ns));
        began.elapsed() > Duration::from_nanos(stamp_ns.saturating_sub(first_ns)) + Self::MOST
    }
}

impl Collected {
    fn new() -> Self {
        let size = (0, 0);
        let (views, accepted, lacks) = (Vec::new(), Vec::new(), Lacks::default());
        let (refused, others) = (BTreeMap::new(), BTreeMap::new());
        Self {
            pairs: 0,
            views,
            accepted,
            refused,
            lacks,
            size,
            failure: None,
            others,
        }
    }

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

    /// Why there are not enough views, and what to do.
    pub(super) fn too_few(self, source: &str, board: &Board) -> anyhow::Error {
        if let Some(failure) = self.failure {
            return failure;
        }
        let (columns, rows) = (board.columns(), board.rows());
        let counted = "--squares counts the inner corners, one less than the squares";
        let other = self.others.iter().max_by_key(|(_, times)| **times);
        let most = self.refused.iter().max_by_key(|(_, times)| **times);
        let why = match (self.views.len(), other, most) {
            (_, Some(((long, short), times)), _) if *times > self.pairs / 4 => format!(
                "{source}: shows a board of {long}x{short} inner corners, not {columns}x{rows}; \
                 try --squares {long}x{short}"
            ),
            (0, _, _) if !self.views_were_offered() => format!(
                "{source}: no whole board of {columns}x{rows} inner corners in both images of any \
                 of {} pairs ({}); {counted}",
                self.pairs,
                self.reasons()
            ),
            (views, ..) => format!(
                "{source}: {views} of {} pairs accepted, at least {LEAST_VIEWS} are needed ({})",
                self.pairs,
                self.reasons()
            ),
        };
        anyhow::Error::msg(why)
    }

    fn views_were_offered(&self) -> bool {
        ["not wanted", "nothing new", "moving"]
            .iter()
            .any(|word| self.refused.contains_key(*word))
    }

    /// `47 no board left, 3 moving`: the most frequent first.
    fn reasons(&self) -> String {
        let mut reasons: Vec<_> = self.refused.iter().collect();
        reasons.sort_by_key(|(_, times)| std::cmp::Reverse(**times));
        let reasons: Vec<_> = reasons
            .into_iter()
            .map(|(word, times)| format!("{times} {word}"))
            .collect();
        if reasons.is_empty() {
            "none refused".to_owned()
        } else {
            reasons.join(", ")
        }
    }
}

impl Display for Collected {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        writeln!(
            f,
            "{} of {} pairs accepted; refused: {}",
            self.views.len(),
            self.pairs,
            self.reasons()
        )?;
        if !self.lacks.is_nothing() {
            writeln!(f, "Still missing, and worth more pairs: {}", self.lacks)?;
        }
        Ok(())
    }
}

/// Corners of whole boards, nothing for others.
pub(super) fn corners(seen: &[Seen; 2]) -> [&[nalgebra::Point2<f64>]; 2] {
    seen.each_ref().map(|seen| match seen {
        Seen::Whole(sighting) => &sighting.corners[..],
        _ => &[],
    })
}
