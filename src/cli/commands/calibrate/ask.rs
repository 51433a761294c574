//! Asks the user about each helpful pair: shown in Rerun or as a PNG, answered on the terminal.

use crate::cli::shared::progress::interrupted;
use crate::cli::shared::terminal::write_error;
use crate::cli::shared::viewer::viewer;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;
use svl::calibrate::choose::MissingCoverage;
use svl::calibrate::detect::Detection;
use svl::calibrate::{Board, StereoView};
use svl::files::write_png;
use svl::overlay::corners_drawn;
use svl::sink::{BoardView, RerunTarget};
use svl::stereo::Frame;

/// A helpful pair, offered to the user.
pub(super) struct Offer<'a> {
    pub frame: &'a Frame,
    pub name: String,
    pub view: &'a StereoView,
    pub missing: MissingCoverage,
}

pub(super) enum Decision {
    Accept,
    Decline,
    /// No more pairs.
    Stop,
}

/// Source of the answers.
pub(super) enum Answers {
    /// Every pair is accepted.
    AcceptAll,
    /// Lines of standard input, read on a thread so that Ctrl-C is noticed while waiting.
    Terminal(Receiver<String>),
}

impl Answers {
    pub(super) fn from_terminal() -> Self {
        let (sender, receiver) = channel();
        std::thread::spawn(move || {
            for line in std::io::stdin().lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        Self::Terminal(receiver)
    }
}

/// Shows pairs and asks whether to accept them.
pub(super) struct ViewPrompt {
    answers: Answers,
    viewer: Option<Box<dyn BoardView>>,
    /// File the pair is drawn in when there is no viewer.
    picture: PathBuf,
    columns: usize,
}

impl ViewPrompt {
    /// `required`: whether a missing viewer is an error; otherwise pairs are drawn in a file.
    pub(super) fn new(
        answers: Answers,
        target: Option<RerunTarget>,
        required: bool,
        board: &Board,
        picture: PathBuf,
    ) -> anyhow::Result<Self> {
        // Without --rerun a viewer is only a convenience, and the machine may have none.
        let viewer = match target.map(|target| viewer()?.board(target, board.columns())) {
            Some(Err(error)) if !required => {
                tracing::warn!(
                    "{error}; each pair is drawn in {} instead",
                    picture.display()
                );
                None
            }
            viewer => viewer.transpose()?,
        };
        Ok(Self {
            answers,
            viewer,
            picture,
            columns: board.columns(),
        })
    }

    /// Shows a pair with its detections, without asking.
    pub(super) fn show(
        &self,
        frame: &Frame,
        seen: &[Detection; 2],
        word: &str,
    ) -> anyhow::Result<()> {
        if let Some(viewer) = &self.viewer {
            let corners = seen.each_ref().map(Detection::corners);
            viewer.show(frame.sequence, &frame.pair, corners, word)?;
        }
        Ok(())
    }

    pub(super) fn ask(&mut self, offer: &Offer<'_>) -> anyhow::Result<Decision> {
        let found = [&offer.view.left[..], &offer.view.right[..]];
        let missing = if offer.missing.is_empty() {
            "nothing".to_owned()
        } else {
            offer.missing.to_string()
        };
        if let Some(viewer) = &self.viewer {
            let state = format!("Pair **{}**. Still missing: {missing}", offer.name);
            viewer.show(offer.frame.sequence, &offer.frame.pair, found, &state)?;
        }
        let Answers::Terminal(lines) = &self.answers else {
            return Ok(Decision::Accept);
        };
        if self.viewer.is_none() {
            let (width, height, pixels) = corners_drawn(&offer.frame.pair, found, self.columns);
            write_png(&self.picture, width, height, &pixels)?;
        }
        // Discard what was typed before the question.
        while lines.try_recv().is_ok() {}
        loop {
            let question = format!(
                "pair {}; still missing: {missing}\naccept it? [Y]es, [n]o, [e]nough: ",
                offer.name
            );
            write_error("", &question);
            match answer(lines).as_deref().map(str::trim) {
                Some("" | "y" | "Y" | "yes") => return Ok(Decision::Accept),
                Some("n" | "N" | "no") => return Ok(Decision::Decline),
                Some("e" | "E" | "enough" | "q") | None => return Ok(Decision::Stop),
                Some(_) => {}
            }
        }
    }

    pub(super) fn finish(&self) -> anyhow::Result<()> {
        if self.viewer.is_none() {
            // The file exists only if a question was asked.
            let _ = std::fs::remove_file(&self.picture);
        }
        match &self.viewer {
            Some(viewer) => Ok(viewer.finish()?),
            None => Ok(()),
        }
    }
}

/// The next line; `None` at the end of the input and after Ctrl-C.
fn answer(lines: &Receiver<String>) -> Option<String> {
    loop {
        match lines.recv_timeout(Duration::from_millis(100)) {
            Ok(line) => return Some(line),
            Err(RecvTimeoutError::Disconnected) => return None,
            Err(RecvTimeoutError::Timeout) if interrupted() => return None,
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}
