//! Matching by an external program, over its standard input and output.
//!
//! svl starts the program once. Per pair it writes to its standard input one line of JSON and the
//! pixels of both images, row by row, without gaps:
//!
//! ```text
//! {"width":W,"height":H,"channels":1,"min_disparity":a,"max_disparity":b,"seq":n,
//!  "sequence":s,"name":"motor","columns":C,"rows":R,"threads":t,"batch":k,
//!  "rig":{"focal_px":f,"cx_px":x,"cy_px":y,"baseline_m":B,"doffs_px":o}}\n
//! W·H·channels bytes of the left image, W·H·channels bytes of the right image
//! ```
//!
//! `seq`: the number of the request; `sequence`: that of the pair in its run; `name`: the pair's
//! name, if it has one, as in data sets; `columns`, `rows`: size of the depth grid; `threads`:
//! number that may be used; `rig`: if the cameras are known; `batch`: see below. The program writes
//! to its standard output one line of JSON and the disparities, row by row, little-endian, `+∞` for
//! none:
//!
//! ```text
//! {"seq":n,"millis":t}\n  or  {"seq":n,"error":"why this pair cannot be matched"}\n
//! W·H · 4 bytes                nothing
//! ```
//!
//! Instead of its first reply a program may identify itself; it is then sent the same pair again:
//!
//! ```text
//! {"hello":{"name":"mynet","version":"1.2","device":"cuda:0","threads":2,"isa":"avx2",
//!           "model":"HASH","color":true,"batch":8}}\n
//! ```
//!
//! All fields are optional, and are recorded in the run's manifest. A program that requests colour
//! is sent three channels, red, green and blue by pixel; grey images have three equal ones. A
//! program that accepts several pairs at once is sent them so when svl measures (`svl score`): up
//! to `batch` requests of one size, each with the number of requests left in the batch, itself
//! included; svl then reads as many replies. `millis` is then the time of the batch divided by its
//! size.
//!
//! A program may report the C·R cells of the depth grid itself: `"cells":[...]` next to `millis`,
//! row by row, `null` for an unknown one, else `{"disparity_px":d}` or with `"probability":p`, 0 to
//! 1. Distances follow from the rig. Without `cells`, svl computes them from the disparities.
//!
//! `millis` is the self-reported time of the matching, without the transfer; svl reports it next to
//! the time until the answer, with a warning if the two are inconsistent. `preparing_millis`, the
//! part of it that made inputs from images, is optional. Disparities more than
//! half a pixel outside the range are discarded and counted. The program must exit at the end of
//! its input. The end of its standard error is kept for error messages. An error reply concerns
//! only its pair. A program that exits, times out or answers anything else is killed, with all that
//! it started, and restarted for the next pair, up to `restarts` times. Ctrl-C ends it at once.
//! `svl algos exec --example python` is such a program.
//!
//! No shell is involved: the command is split at spaces, and quotes keep spaces in a word.

mod program;
mod protocol;

use super::quotes::words;
use super::stage::DisparityRange;
use super::{
    MatchContext, MatchOutput, Matcher, MatcherKind, MatcherSpec, Parameter, Parameters,
    ProgramRecord, Range,
};
use crate::depth;
use crate::error::{Error, Result};
use crate::stereo::{Cell, CellDepth, DepthGrid, ExtraPlanes, Plane, Reason, RectifiedPair};
use crate::timing::Stage;
use program::{Program, ProgramFailure};
use protocol::{Hello, Question, Reply, ReplyCell, RequestForm};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "exec",
    kind: MatcherKind::Program,
    aliases: &[],
    summary: "any program, over its standard input and output: to compare with an algorithm that \
              svl does not have",
    about: ABOUT,
    paper: "whatever the program does; --example prints helpers for Python, C++, ONNX, PyTorch",
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
        Parameter {
            name: "restarts",
            unit: "",
            range: Range::int(3, 0..=1_000_000),
            description: "limit on restarts after it died or timed out",
        },
    ],
    cells: None,
    build: |parameters, _| Ok(Box::new(Exec::start(parameters)?)),
};

const ABOUT: &str = "A function of two numpy arrays is a matcher: svl algos exec --example \
    python > svl_bench/matcher.py says how. A network in ONNX: svl algos exec --example onnx > \
    svl_onnx.py beside svl_bench/, then \
    --algo \"net=exec:command='python3 svl_onnx.py model.onnx'\". For C++: svl algos exec \
    --example cpp > svl_matcher.hpp.";

struct Exec {
    command: String,
    words: Vec<String>,
    range: DisparityRange,
    timeout: Duration,
    /// Limit on restarts after failures, and the number so far.
    max_restarts: u32,
    restarts: u32,
    /// `None` after a failure.
    program: Option<Program>,
    /// Number of the last request.
    seq: u64,
    /// Answers to announced pairs.
    ahead: VecDeque<PairAnswer>,
    /// The size of the last pair. The first pair of a size may set up memory.
    warm_for: Option<(usize, usize)>,
    /// Times of all other pairs, microseconds: the self-reported time, and the time waited.
    reported_us: Vec<u32>,
    preparing_us: Vec<u32>,
    waited_us: Vec<u32>,
    disparities: u64,
    out_of_range: u64,
    /// Identity of the last program, and its peak memory.
    hello: Hello,
    memory_bytes: Option<usize>,
}

/// Reply to a pair, and the time svl waited for it.
struct PairAnswer {
    reply: Reply,
    waited: Duration,
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
            max_restarts: parameters.int("restarts") as u32,
            restarts: 0,
            seq: 0,
            ahead: VecDeque::new(),
            warm_for: None,
            reported_us: Vec::new(),
            preparing_us: Vec::new(),
            waited_us: Vec::new(),
            disparities: 0,
            out_of_range: 0,
            hello: Hello::default(),
            memory_bytes: None,
        })
    }

    /// The program, restarted if it failed before.
    fn program(&mut self) -> std::result::Result<&mut Program, ProgramFailure> {
        let program = match self.program.take() {
            Some(program) => program,
            None if self.restarts == self.max_restarts => {
                return Err(ProgramFailure::new(format!(
                    "failed {} times and is not started again; restarts=N raises the limit",
                    self.restarts + 1
                )));
            }
            None => {
                self.restarts += 1;
                Program::start(&self.words)?
            }
        };
        Ok(self.program.insert(program))
    }

    /// Sends pairs of one size at once and waits for all their answers.
    fn ask(
        &mut self,
        pairs: &[(RectifiedPair<'_>, MatchContext<'_>)],
    ) -> std::result::Result<Vec<PairAnswer>, ProgramFailure> {
        let (range, timeout, first) = (self.range, self.timeout, self.seq + 1);
        // Also for pairs that fail, so that no two requests share a number.
        self.seq += pairs.len() as u64;
        let program = self.program()?;
        let began = Instant::now();
        let hello = program.hello.as_ref();
        let (color, takes_several) = hello.map_or((false, false), |h| (h.color, h.batch > 1));
        for (i, (pair, context)) in pairs.iter().enumerate() {
            let form = RequestForm {
                range,
                seq: first + i as u64,
                color,
                batch: takes_several.then_some(pairs.len() - i),
            };
            let memory = program.memory_for_request();
            let request = protocol::request(pair, form, context, memory);
            let question = Question {
                seq: form.seq,
                size: pair.size(),
                cells: context.grid.shape().cells(),
                followers: pairs.len() - i - 1,
            };
            program.send(request, question);
        }
        let timeout = timeout.saturating_mul(pairs.len() as u32);
        let mut replies = Vec::with_capacity(pairs.len());
        for (pair, _) in pairs {
            match program.answer(pair.size(), timeout)? {
                Reply::Hello(hello) if program.hello.is_none() => {
                    program.hello = Some(hello);
                    // The same pair again, in the form that the program requested.
                    return self.ask(pairs);
                }
                Reply::Hello(_) => return Err(ProgramFailure::new("identified itself twice")),
                reply => replies.push(reply),
            }
        }
        let waited = began.elapsed() / pairs.len() as u32;
        let answer = |reply| PairAnswer { reply, waited };
        Ok(replies.into_iter().map(answer).collect())
    }

    /// Same as [`Exec::ask`], but ends a program that failed.
    fn ask_or_end(
        &mut self,
        pairs: &[(RectifiedPair<'_>, MatchContext<'_>)],
    ) -> Result<Vec<PairAnswer>> {
        let answers = self.ask(pairs);
        if let Some(program) = &self.program {
            self.memory_bytes = self.memory_bytes.max(program.memory());
            if let Some(hello) = &program.hello {
                self.hello.clone_from(hello);
            }
        }
        answers.map_err(|failure| {
            // Dropped, and so ended; a new one has to warm up.
            (self.program, self.warm_for) = (None, None);
            failure.into_error(&self.command)
        })
    }

    /// True if a pixel's disparity is within half a pixel of the range.
    fn is_in_range(&self, disparity: f32) -> bool {
        let (min, max) = (self.range.min() as f32, self.range.max() as f32);
        (min - 0.5..=max + 0.5).contains(&disparity)
    }
}

impl Matcher for Exec {
    fn program(&self) -> Option<ProgramRecord> {
        let hello = self.hello.clone();
        let has_answered = self.warm_for.is_some() || !self.waited_us.is_empty();
        (has_answered || hello != Hello::default()).then(|| ProgramRecord {
            name: hello.name,
            version: hello.version,
            device: hello.device,
            threads: hello.threads,
            isa: hello.isa,
            model: hello.model,
            color: hello.color,
            batch: hello.batch.max(1),
            pairs: self.waited_us.len() as u64,
            reported_us: median(&self.reported_us),
            preparing_us: (!self.preparing_us.is_empty()).then(|| median(&self.preparing_us)),
            waited_us: median(&self.waited_us),
            disparities: self.disparities,
            out_of_range: self.out_of_range,
            memory_bytes: self.memory_bytes,
        })
    }

    fn batch(&self) -> usize {
        self.hello.batch.max(1)
    }

    fn announce(&mut self, pairs: &[(RectifiedPair<'_>, MatchContext<'_>)]) {
        self.ahead.clear();
        // A restarted program has to identify itself first.
        let has_said = |program: &Program| program.hello.is_some();
        if !self.program.as_ref().is_some_and(has_said) {
            return;
        }
        // A failure recurs when the pairs are sent one by one.
        if let Ok(answers) = self.ask_or_end(pairs) {
            self.ahead.extend(answers);
        }
    }

    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let (map, (width, height)) = (&mut output.disparity, pair.size());
        map.resize(width, height, ExtraPlanes::NONE)?;
        let answer = match self.ahead.pop_front() {
            Some(answer) => Some(answer),
            None => self.ask_or_end(&[(pair, *context)])?.pop(),
        };
        let (millis, preparing_millis, disparities, cells, waited) = match answer {
            Some(PairAnswer {
                reply:
                    Reply::Matched {
                        millis,
                        preparing_millis,
                        disparities,
                        cells,
                    },
                waited,
            }) => (millis, preparing_millis, disparities, cells, waited),
            Some(PairAnswer {
                reply: Reply::Refused(why),
                ..
            }) => {
                return Err(
                    ProgramFailure::new(format!("answered: {why}")).into_error(&self.command)
                );
            }
            // There is one answer per pair, and no hello.
            Some(PairAnswer {
                reply: Reply::Hello(_),
                ..
            })
            | None => unreachable!("an answer"),
        };
        for (mut row, values) in map.rows_mut().zip(disparities.chunks_exact(4 * width)) {
            for (x, disparity) in protocol::disparities(values).enumerate() {
                self.disparities += u64::from(disparity.is_finite());
                if self.is_in_range(disparity) {
                    row.accept(x, disparity);
                } else {
                    self.out_of_range += u64::from(disparity.is_finite());
                    // The program gives no reason.
                    row.reject(x, Reason::Unmatched);
                }
            }
        }
        if let Some(program) = &self.program {
            program.take_back(disparities);
        }
        output.grid = cells
            .map(|cells| own_grid(&cells, map.disparity(), context))
            .transpose()?;
        let duration = |millis: f64| Duration::from_secs_f64(millis / 1e3);
        let micros = |time: Duration| u32::try_from(time.as_micros()).unwrap_or(u32::MAX);
        let reported = duration(millis);
        if self.warm_for.replace((width, height)) == Some((width, height)) {
            self.reported_us.push(micros(reported));
            self.preparing_us
                .extend(preparing_millis.map(duration).map(micros));
            self.waited_us.push(micros(waited));
        }
        // Capped at the time that svl waited.
        output.clock.lap_with(Stage::Matching, reported.min(waited));
        Ok(())
    }
}

/// By nearest rank; 0 if empty.
fn median(times: &[u32]) -> u64 {
    let mut times = times.to_vec();
    times.sort_unstable();
    let middle = times.get(times.len().saturating_sub(1) / 2);
    middle.copied().map_or(0, u64::from)
}

/// The program's own cells, with the fraction of valid disparities in each.
fn own_grid(
    cells: &[Option<ReplyCell>],
    disparity: &Plane<f32>,
    context: &MatchContext,
) -> Result<DepthGrid> {
    let seen = depth::grid(disparity, context.grid, None);
    let cell = |(own, (_, seen)): (&Option<ReplyCell>, (_, &Cell))| Cell {
        valid_share: seen.valid_share,
        depth: own.map(|own| CellDepth::at(own.disparity_px, context.rig.as_ref())),
        probability: own.and_then(|own| own.probability),
        ..Cell::UNKNOWN
    };
    let cells = cells.iter().zip(seen.iter()).map(cell).collect();
    DepthGrid::new(context.grid.shape(), cells)
}
