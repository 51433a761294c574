//! Matching by an external program, over its standard input and output.
//!
//! svl starts the program once. Per pair it writes to its standard input one line of JSON and the
//! pixels of both images, row by row, without gaps:
//!
//! ```text
//! {"width":W,"height":H,"min_disparity":a,"max_disparity":b,"seq":n,"columns":C,"rows":R,
//!  "rig":{"focal_px":f,"cx_px":x,"cy_px":y,"baseline_m":B,"doffs_px":o}}\n   no rig: not known
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
//! A program may answer the C·R cells of the depth grid itself: `"cells":[...]` beside `millis`,
//! row by row, `null` for an unknown one, else `{"disparity_px":d}` or with `"probability":p`, 0 to
//! 1. Distances follow from the rig. Where it does not, cells are made of its disparities.
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
use crate::depth;
use crate::error::{Error, Result};
use crate::stereo::{
    Cell, CellDepth, DepthGrid, ExtraPlanes, Plane, Reason, RectifiedPair, StereoPair,
};
use crate::timing::Stage;
use program::{Program, ProgramFailure};
use protocol::{Question, Reply, ReplyCell};
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
    cells: None,
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

    fn ask(
        &mut self,
        pair: &StereoPair,
        context: &MatchContext,
    ) -> std::result::Result<Reply, ProgramFailure> {
        let (sequence, timeout) = (self.sequence, self.timeout);
        let request = protocol::request(pair, self.range, sequence, context);
        let question = Question {
            sequence,
            size: pair.size(),
            cells: context.grid.shape().cells(),
        };
        self.program()?.ask(request, question, timeout)
    }
}

impl Matcher for Exec {
    fn process_memory(&self) -> Option<usize> {
        self.program.as_ref()?.memory()
    }

    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let (map, (width, height)) = (&mut output.disparity, pair.size());
        // Also for pairs that fail, so that no two requests share a number.
        self.sequence += 1;
        map.resize(width, height, ExtraPlanes::NONE)?;
        let reply = self.ask(&pair, context).map_err(|failure| {
            // Dropped, so ended.
            self.program = None;
            failure.into_error(&self.command)
        })?;
        let (millis, disparities, cells) = match reply {
            Reply::Matched {
                millis,
                disparities,
                cells,
            } => (millis, disparities, cells),
            Reply::Refused(why) => {
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
        output.grid = cells
            .map(|cells| own_grid(&cells, map.disparity(), context))
            .transpose()?;
        let matching = Duration::from_secs_f64(millis / 1e3);
        output.clock.lap_of(Stage::Matching, matching);
        Ok(())
    }
}

/// The program's own cells, with the share of its disparities that each has.
fn own_grid(
    cells: &[Option<ReplyCell>],
    disparity: &Plane<f32>,
    context: &MatchContext,
) -> Result<DepthGrid> {
    let seen = depth::grid(disparity, context.grid, None);
    let cell = |(own, (_, seen)): (&Option<ReplyCell>, (_, &Cell))| Cell {
        valid_share: seen.valid_share,
        depth: own.map(|own| CellDepth {
            median_px: own.disparity_px,
            p20_px: own.disparity_px,
            p80_px: own.disparity_px,
            distance_m: context
                .rig
                .and_then(|rig| rig.depth_m(f64::from(own.disparity_px))),
        }),
        probability: own.and_then(|own| own.probability),
        evidence: None,
        too_close: false,
    };
    let cells = cells.iter().zip(seen.iter()).map(cell).collect();
    DepthGrid::new(context.grid.shape(), cells)
}
