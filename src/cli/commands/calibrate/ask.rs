//! Whether a pair is wanted: shown in Rerun or as a picture, asked on the terminal.

use super::collect::corners;
use crate::cli::shared::progress::interrupted;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;
use svl::calibrate::choose::Lacks;
use svl::calibrate::detect::Seen;
use svl::calibrate::{Board, View};
use svl::files::write_png;
use svl::overlay::corners_drawn;
use svl::sink::{BoardView, RerunTarget};
use svl::stereo::Frame;

/// A pair that would help.
pub(super) struct Offer<'a> {
    pub frame: &'a Frame,
    pub name: String,
    pub view: &'a View,
    pub lacks: Lacks,
}

pub(super) enum Answer {
    Yes,
    No,
    /// No more.
    Enough,
}

/// Who answers.
pub(super) enum Answers {
    Yes,
    /// Lines of standard input, read beside so that Ctrl-C is heard while waiting.
    Terminal(Receiver<String>),
}

impl Answers {
    pub(super) fn asked() -> Self {
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

/// Shows pairs and asks about them.
pub(super) struct Judge {
    answers: Answers,
    viewer: Option<BoardView>,
    /// Where the picture goes without a viewer.
    picture: PathBuf,
    columns: usize,
}

impl Judge {
    /// `required`: whether no viewer is an error; else the pictures are written to a file.
    pub(super) fn new(
        answers: Answers,
        target: Option<RerunTarget>,
        required: bool,
        board: &Board,
        picture: PathBuf,
    ) -> anyhow::Result<Self> {
        let viewer = match target.map(|target| BoardView::new(target, board.columns())) {
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

    /// Shows what cameras see, without asking.
    pub(super) fn show(&self, frame: &Frame, seen: &[Seen; 2], word: &str) -> anyhow::Result<()> {
        match &self.viewer {
            Some(viewer) => Ok(viewer.show(frame.sequence, &frame.pair, corners(seen), word)?),
            None => Ok(()),
        }
    }

    pub(super) fn ask(&mut self, offer: &Offer<'_>) -> anyhow::Result<Answer> {
        let found = [&offer.view.left[..], &offer.view.right[..]];
        let lacks = if offer.lacks.is_nothing() {
            "nothing".to_owned()
        } else {
            offer.lacks.to_string()
        };
        if let Some(viewer) = &self.viewer {
            let state = format!("Pair **{}**. Still missing: {lacks}", offer.name);
            viewer.show(offer.frame.sequence, &offer.frame.pair, found, &state)?;
        }
        let Answers::Terminal(lines) = &self.answers else {
            return Ok(Answer::Yes);
        };
        if self.viewer.is_none() {
            let (width, height, pixels) = corners_drawn(&offer.frame.pair, found, self.columns);
            write_png(&self.picture, width, height, &pixels)?;
        }
        // What was typed before the question is no answer to it.
        while lines.try_recv().is_ok() {}
        loop {
            eprint!(
                "pair {}; still missing: {lacks}\naccept it? [Y]es, [n]o, [e]nough: ",
                offer.name
            );
            match answer(lines).as_deref().map(str::trim) {
                Some("" | "y" | "Y" | "yes") => return Ok(Answer::Yes),
                Some("n" | "N" | "no") => return Ok(Answer::No),
                Some("e" | "E" | "enough" | "q") | None => return Ok(Answer::Enough),
                Some(_) => {}
            }
        }
    }

    pub(super) fn finish(&self) -> anyhow::Result<()> {
        if self.viewer.is_none() {
            // There is one only where somebody was asked.
            let _ = std::fs::remove_file(&self.picture);
        }
        match &self.viewer {
            Some(viewer) => Ok(viewer.finish()?),
            None => Ok(()),
        }
    }
}

/// The next line; nothing at the end of the input and after Ctrl-C.
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
