//! Matching by an external program, over its standard input and output.
//!
//! svl starts the program once. Per pair it writes to its standard input one line of JSON and the
//! pixels of both images, row by row, without gaps:
//!
//! ```text
//! {"width":W,"height":H,"min_disparity":a,"max_disparity":b,"seq":n}\n
//! W·H bytes of the left image, W·H bytes of the right image
//! ```
//!
//! and reads from its standard output one line of JSON and the disparities, row by row,
//! little-endian, `+∞` for none:
//!
//! ```text
//! {"seq":n,"millis":t}\n  or  {"seq":n,"error":"why this pair cannot be matched"}\n
//! W·H · 4 bytes                nothing
//! ```
//!
//! `millis` is the self-reported time of the matching, without the transfer; it is the time that
//! svl reports. At the end of its input the program must end. The end of its standard error is kept
//! for error messages. An error reply concerns its pair alone. A program that ends, times out or
//! answers anything else is killed and started again for the next pair, [`RESTARTS`] times.
//! `adapters/opencv.py` is such a program.
//!
//! No shell is involved: the command is split at spaces, and quotes keep spaces in a word.

mod program;
mod protocol;

use super::quotes::words;
use super::stage::DisparityRange;
use super::{MatchContext, MatchOutput, Matcher, MatcherSpec, Parameter, Parameters, Range};
use crate::error::{Error, Result};
use crate::stereo::{ExtraPlanes, Reason, RectifiedPair, StereoPair};
use crate::timing::Stage;
use program::{Program, ProgramFailure};
use std::time::Duration;

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "exec",
    aliases: &[],
    summary: "any program, over its standard input and output: to compare with an algorithm that \
              svl does not have",
    about: "",
    paper: "whatever the program does; adapters/opencv.py explains the protocol and is an example",
    parameters: &[
        Parameter {
            name: "command",
            unit: "",
            range: Range::Text { default: "" },
            description: "program and arguments; parts with commas or spaces are quoted",
        },
        DisparityRange::MIN,
        DisparityRange::MAX,
        Parameter {
            name: "timeout_s",
            unit: "s",
            range: Range::real(30.0, 0.01..=86_400.0),
            description: "longest time to an answer; the first includes the program's start",
        },
    ],
    answers_cells: false,
    build: |parameters, _| Ok(Box::new(Exec::start(parameters)?)),
};

/// How often a program that failed is started again.
const RESTARTS: u32 = 3;

struct Exec {
    command: String,
    words: Vec<String>,
    range: DisparityRange,
    timeout: Duration,
    /// None after a failure.
    program: Option<Program>,
    restarts: u32,
    sequence: u64,
}

impl Exec {
    fn start(parameters: &Parameters) -> Result<Self> {
        let command = parameters.text("command");
        let words = words(command);
        if words.is_empty() {
            return Err(Error::Usage(
                "exec needs a program: exec:command=PROGRAM ARGUMENTS".to_owned(),
            ));
        }
        let range = DisparityRange::from_parameters(parameters)?;
        Ok(Self {
            command: command.to_owned(),
            range,
            timeout: Duration::from_secs_f64(parameters.real("timeout_s")),
            program: Some(Program::start(&words).map_err(|failure| failure.into_error(command))?),
            words,
            restarts: 0,
            sequence: 0,
        })
    }

    /// The program, started again if it failed before.
    fn program(&mut self) -> std::result::Result<&mut Program, ProgramFailure> {
        let program = match self.program.take() {
            Some(program) => program,
            None if self.restarts == RESTARTS => {
                return Err(ProgramFailure::new(format!(
                    "failed {} times and is not started again",
                    RESTARTS + 1
                )));
            }
            None => {
                self.restarts += 1;
                Program::start(&self.words)?
            }
        };
        Ok(self.program.insert(program))
    }

    fn ask(&mut self, pair: &StereoPair) -> std::result::Result<protocol::Reply, ProgramFailure> {
        let (sequence, timeout) = (self.sequence, self.timeout);
        let request = protocol::request(pair, self.range, sequence);
        self.program()?.ask(request, sequence, pair.size(), timeout)
    }
}

impl Matcher for Exec {
    fn process_memory(&self) -> Option<usize> {
        self.program.as_ref()?.memory()
    }

    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        _: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let (map, (width, height)) = (&mut output.disparity, pair.size());
        // Also for pairs that fail, so that no two requests share a number.
        self.sequence += 1;
        map.resize(width, height, ExtraPlanes::NONE)?;
        let reply = self.ask(&pair).map_err(|failure| {
            // Dropped, so ended.
            self.program = None;
            failure.into_error(&self.command)
        })?;
        let (millis, disparities) = match reply {
            protocol::Reply::Matched {
                millis,
                disparities,
            } => (millis, disparities),
            protocol::Reply::Refused(why) => {
                return Err(
                    ProgramFailure::new(format!("answered: {why}")).into_error(&self.command)
                );
            }
        };
        for (mut row, disparities) in map.rows_mut().zip(disparities.chunks_exact(width)) {
            for (x, &disparity) in disparities.iter().enumerate() {
                if disparity.is_finite() {
                    row.accept(x, disparity);
                } else {
                    // It does not say why.
                    row.reject(x, Reason::Unmatched);
                }
            }
        }
        let matching = Duration::from_secs_f64(millis / 1e3);
        output.clock.lap_of(Stage::Matching, matching);
        Ok(())
    }
}
