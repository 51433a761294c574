//! Requests to the program and its replies.

use crate::error::Cause;
use crate::matcher::MatchContext;
use crate::matcher::stage::DisparityRange;
use crate::stereo::{Gray, Rig, StereoPair};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, ErrorKind, Read};

/// Longest line of a reply, in bytes.
const LONGEST_LINE: u64 = 64 * 1024;

/// Largest batch that a program may request.
const LARGEST_BATCH: usize = 64;

/// Header line of a pair.
#[derive(Serialize)]
struct RequestLine<'a> {
    width: usize,
    height: usize,
    channels: usize,
    min_disparity: i32,
    max_disparity: i32,
    seq: u64,
    sequence: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<&'a str>,
    columns: usize,
    rows: usize,
    threads: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    batch: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rig: Option<Rig>,
}

/// Identity that a program reports instead of its first reply.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Hello {
    pub(super) name: Option<String>,
    pub(super) version: Option<String>,
    /// True if it requests colour.
    pub(super) color: bool,
    /// Number of pairs it accepts at once; 0 means 1.
    pub(super) batch: usize,
    pub(super) threads: Option<usize>,
    pub(super) isa: Option<String>,
    pub(super) device: Option<String>,
    /// Hash of its model.
    pub(super) model: Option<String>,
}

/// Violation of the protocol, worded as something the program did.
#[derive(Debug, thiserror::Error)]
pub(super) enum ReplyFault {
    #[error("cannot be read from: {0}")]
    Unreadable(#[from] std::io::Error),
    #[error("closed its output before it answered")]
    Closed,
    /// A line that is no reply's, in quotes, and the reason.
    #[error("answered {0} where a reply's line was expected: {1}")]
    Line(String, #[source] Cause),
    #[error("wants {0} pairs at once; at most {LARGEST_BATCH}")]
    Batch(usize),
    #[error("gave {0} cells, but the grid has {1}: columns times rows, row by row")]
    Cells(usize, usize),
    #[error("gave cell {0} no finite disparity_px")]
    CellDisparity(usize),
    #[error("gave cell {0} a probability that is not 0 to 1")]
    CellProbability(usize),
    #[error("closed its output after {0} bytes of disparities; {1}x{2} pixels are {3}")]
    Short(usize, usize, usize, usize),
    /// A disparity at a pixel.
    #[error("gave the disparity {0} at ({1}, {2}): none is +inf")]
    Disparity(f32, usize, usize),
    #[error("wrote {0} bytes and perhaps more after its reply for {1}x{2} pixels")]
    Surplus(usize, usize, usize),
}

impl Hello {
    /// The same with every text limited to one line; an error if no run can meet its request.
    fn checked(self) -> Result<Self, ReplyFault> {
        if self.batch > LARGEST_BATCH {
            return Err(ReplyFault::Batch(self.batch));
        }
        let line = |text: Option<String>| text.map(|text| one_line(&text));
        Ok(Self {
            name: line(self.name),
            version: line(self.version),
            isa: line(self.isa),
            device: line(self.device),
            model: line(self.model),
            ..self
        })
    }
}

/// Header line of disparities, or a reply without any.
#[derive(Deserialize)]
struct ReplyLine {
    #[serde(default)]
    seq: u64,
    millis: Option<f64>,
    preparing_millis: Option<f64>,
    error: Option<String>,
    cells: Option<Vec<Option<ReplyCell>>>,
    hello: Option<Hello>,
}

/// A cell that the program knows.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ReplyCell {
    pub(super) disparity_px: f32,
    pub(super) probability: Option<f64>,
}

/// Expected reply.
#[derive(Clone, Debug)]
pub(super) struct Question {
    pub(super) seq: u64,
    /// Width and height of the pair.
    pub(super) size: (usize, usize),
    /// Number of cells in the grid.
    pub(super) cells: usize,
    /// Replies to other pairs of its batch that follow.
    pub(super) followers: usize,
}

/// Reply of the program to a pair.
#[derive(Debug, PartialEq)]
pub(super) enum Reply {
    /// Disparities in raster order, as received.
    Matched {
        millis: f64,
        /// Part of `millis`, before the matching proper.
        preparing_millis: Option<f64>,
        disparities: Vec<u8>,
        /// The program's own cells in raster order, `None` for unknown ones.
        cells: Option<Vec<Option<ReplyCell>>>,
    },
    /// Reason for not matching the pair, in one line.
    Refused(String),
    /// Identity of the program; the pair has to be sent again.
    Hello(Hello),
}

/// Form of a request.
#[derive(Clone, Copy)]
pub(super) struct RequestForm {
    pub(super) range: DisparityRange,
    /// Number of the request, which the reply repeats.
    pub(super) seq: u64,
    /// True if the program requests colour.
    pub(super) color: bool,
    /// For programs that accept several pairs at once, the number of pairs from this one on.
    pub(super) batch: Option<usize>,
}

/// The request for a pair, for the program's input, in the buffer `bytes`.
pub(super) fn request(
    pair: &StereoPair,
    form: RequestForm,
    context: &MatchContext,
    mut bytes: Vec<u8>,
) -> Vec<u8> {
    let (width, height) = pair.size();
    let channels = if form.color { 3 } else { 1 };
    let line = RequestLine {
        width,
        height,
        channels,
        min_disparity: form.range.min(),
        max_disparity: form.range.max(),
        seq: form.seq,
        sequence: context.sequence,
        name: context.name,
        columns: context.grid.columns,
        rows: context.grid.rows,
        threads: context.threads,
        batch: form.batch,
        rig: context.rig,
    };
    bytes.clear();
    // A buffer accepts all bytes, and every key of the line is a string.
    serde_json::to_writer(&mut bytes, &line).expect("a line of JSON");
    bytes.push(b'\n');
    let gray = [pair.left(), pair.right()];
    match (form.color, context.color) {
        (false, _) => {
            let rows = gray.into_iter().flat_map(Gray::rows);
            rows.for_each(|row| bytes.extend_from_slice(row));
        }
        (true, Some(color)) => {
            let rows = color.iter().flat_map(|image| image.rows());
            rows.for_each(|row| bytes.extend_from_slice(row.as_flattened()));
        }
        (true, None) => gray.into_iter().for_each(|image| {
            let pixels = image.rows().flatten();
            bytes.extend(pixels.flat_map(|&grey| [grey; 3]));
        }),
    }
    bytes
}

/// Reads the reply to a question; its disparities go into the given buffer.
///
/// # Errors
/// The violation of the protocol.
pub(super) fn read_reply(
    from: &mut BufReader<impl Read>,
    question: Question,
    memory: Vec<u8>,
) -> Result<Reply, ReplyFault> {
    let (seq, (width, height)) = (question.seq, question.size);
    let mut line = Vec::new();
    // A program that never ends its line must not fill the memory.
    let mut limited = from.by_ref().take(LONGEST_LINE);
    limited.read_until(b'\n', &mut line)?;
    if line.is_empty() {
        return Err(ReplyFault::Closed);
    }
    let garbage = |why: Cause| ReplyFault::Line(quoted(&line), why);
    if line.last() != Some(&b'\n') {
        let why = format!("no end of line within {} bytes", line.len());
        return Err(garbage(why.into()));
    }
    let reply = serde_json::from_slice::<ReplyLine>(&line).map_err(|e| garbage(e.into()))?;
    if reply.hello.is_none() && reply.seq != seq {
        return Err(garbage(format!("it was asked for seq {seq}").into()));
    }
    let reply = match (reply.hello, reply.error, reply.millis) {
        (Some(hello), ..) => Reply::Hello(hello.checked()?),
        (_, Some(why), _) => Reply::Refused(one_line(&why)),
        (.., Some(millis)) if (0.0..1e9).contains(&millis) => {
            if !(0.0..=millis).contains(&reply.preparing_millis.unwrap_or(0.0)) {
                return Err(garbage("preparing_millis is not 0 to millis".into()));
            }
            check_cells(reply.cells.as_deref(), question.cells)?;
            let disparities = read_disparities(from, question.size, memory)?;
            check_disparities(&disparities, width)?;
            Reply::Matched {
                millis,
                preparing_millis: reply.preparing_millis,
                disparities,
                cells: reply.cells,
            }
        }
        _ => return Err(garbage("neither millis, 0 or more, nor error".into())),
    };
    // Any surplus would be read as the reply to the next pair.
    match from.buffer().len() {
        0 => Ok(reply),
        _ if question.followers > 0 => Ok(reply),
        more => Err(ReplyFault::Surplus(more, width, height)),
    }
}

/// Rejects cells that do not fit a grid of that many cells.
fn check_cells(cells: Option<&[Option<ReplyCell>]>, expected: usize) -> Result<(), ReplyFault> {
    let Some(cells) = cells else { return Ok(()) };
    if cells.len() != expected {
        return Err(ReplyFault::Cells(cells.len(), expected));
    }
    for (i, cell) in cells.iter().enumerate() {
        let Some(cell) = cell else { continue };
        if !cell.disparity_px.is_finite() {
            return Err(ReplyFault::CellDisparity(i));
        }
        if cell.probability.is_some_and(|p| !(0.0..=1.0).contains(&p)) {
            return Err(ReplyFault::CellProbability(i));
        }
    }
    Ok(())
}

fn read_disparities(
    from: &mut impl Read,
    (width, height): (usize, usize),
    mut bytes: Vec<u8>,
) -> Result<Vec<u8>, ReplyFault> {
    let expected = width * height * 4;
    bytes.resize(expected, 0);
    let mut filled = 0;
    while filled < expected {
        match from.read(&mut bytes[filled..]) {
            Ok(0) => return Err(ReplyFault::Short(filled, width, height, expected)),
            Ok(read) => filled += read,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(bytes)
}

/// The disparities encoded in a reply.
pub(super) fn disparities(bytes: &[u8]) -> impl Iterator<Item = f32> {
    let (values, _) = bytes.as_chunks::<4>();
    values.iter().map(|&value| f32::from_le_bytes(value))
}

fn check_disparities(bytes: &[u8], width: usize) -> Result<(), ReplyFault> {
    let is_wrong = |d: f32| d.is_nan() || d == f32::NEG_INFINITY;
    // Without a branch for each, which is several times faster.
    if !disparities(bytes).fold(false, |any, d| any | is_wrong(d)) {
        return Ok(());
    }
    let wrong = disparities(bytes).enumerate().find(|(_, d)| is_wrong(*d));
    let (i, disparity) = wrong.unwrap_or_default();
    Err(ReplyFault::Disparity(disparity, i % width, i / width))
}

/// The beginning of `bytes` in quotes, as part of one line.
fn quoted(bytes: &[u8]) -> String {
    let bytes = bytes.trim_ascii_end();
    format!("\"{}\"", bytes[..bytes.len().min(60)].escape_ascii())
}

/// `text` as one line of limited length.
pub(super) fn one_line(text: &str) -> String {
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    words.chars().take(400).collect()
}
