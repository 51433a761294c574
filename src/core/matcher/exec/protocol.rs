//! Requests to the program and its replies.

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

impl Hello {
    /// The same with every text limited to one line; an error if no run can meet its request.
    fn checked(self) -> Result<Self, String> {
        if self.batch > LARGEST_BATCH {
            let batch = self.batch;
            return Err(format!(
                "wants {batch} pairs at once; at most {LARGEST_BATCH}"
            ));
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
/// The violation of the protocol, worded as something the program did.
pub(super) fn read_reply(
    from: &mut BufReader<impl Read>,
    question: Question,
    memory: Vec<u8>,
) -> Result<Reply, String> {
    let (seq, (width, height)) = (question.seq, question.size);
    let broken = |error: std::io::Error| format!("cannot be read from: {error}");
    let mut line = Vec::new();
    from.by_ref()
        // A program that never ends its line must not fill the memory.
        .take(LONGEST_LINE)
        .read_until(b'\n', &mut line)
        .map_err(broken)?;
    if line.is_empty() {
        return Err("closed its output before it answered".to_owned());
    }
    let garbage = |why: &str| {
        format!(
            "answered {} where a reply's line was expected: {why}",
            quoted(&line)
        )
    };
    if line.last() != Some(&b'\n') {
        return Err(garbage(&format!(
            "no end of line within {} bytes",
            line.len()
        )));
    }
    let reply: ReplyLine =
        serde_json::from_slice(&line).map_err(|error| garbage(&error.to_string()))?;
    if reply.hello.is_none() && reply.seq != seq {
        return Err(garbage(&format!("it was asked for seq {seq}")));
    }
    let reply = match reply {
        ReplyLine {
            hello: Some(hello), ..
        } => Reply::Hello(hello.checked()?),
        ReplyLine {
            error: Some(why), ..
        } => Reply::Refused(one_line(&why)),
        ReplyLine {
            millis: Some(millis),
            cells,
            ..
        } if (0.0..1e9).contains(&millis) => {
            check_cells(cells.as_deref(), question.cells)?;
            let disparities = read_disparities(from, question.size, memory)?;
            check_disparities(&disparities, width)?;
            Reply::Matched {
                millis,
                disparities,
                cells,
            }
        }
        _ => return Err(garbage("neither millis, 0 or more, nor error")),
    };
    // Any surplus would be read as the reply to the next pair.
    match from.buffer().len() {
        0 => Ok(reply),
        _ if question.followers > 0 => Ok(reply),
        more => Err(format!(
            "wrote {more} bytes and perhaps more after its reply for {width}x{height} pixels"
        )),
    }
}

/// Rejects cells that do not fit a grid of that many cells.
fn check_cells(cells: Option<&[Option<ReplyCell>]>, expected: usize) -> Result<(), String> {
    let Some(cells) = cells else { return Ok(()) };
    if cells.len() != expected {
        let given = cells.len();
        return Err(format!(
            "gave {given} cells, but the grid has {expected}: columns times rows, row by row"
        ));
    }
    for (i, cell) in cells.iter().enumerate() {
        let Some(cell) = cell else { continue };
        if !cell.disparity_px.is_finite() {
            return Err(format!("gave cell {i} no finite disparity_px"));
        }
        if cell.probability.is_some_and(|p| !(0.0..=1.0).contains(&p)) {
            return Err(format!("gave cell {i} a probability that is not 0 to 1"));
        }
    }
    Ok(())
}

fn read_disparities(
    from: &mut impl Read,
    (width, height): (usize, usize),
    mut bytes: Vec<u8>,
) -> Result<Vec<u8>, String> {
    let expected = width * height * 4;
    bytes.resize(expected, 0);
    let mut filled = 0;
    while filled < expected {
        match from.read(&mut bytes[filled..]) {
            Ok(0) => {
                return Err(format!(
                    "closed its output after {filled} bytes of disparities; {width}x{height} \
                     pixels are {expected}"
                ));
            }
            Ok(read) => filled += read,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(format!("cannot be read from: {error}")),
        }
    }
    Ok(bytes)
}

/// The disparities encoded in a reply.
pub(super) fn disparities(bytes: &[u8]) -> impl Iterator<Item = f32> {
    let (values, _) = bytes.as_chunks::<4>();
    values.iter().map(|&value| f32::from_le_bytes(value))
}

fn check_disparities(bytes: &[u8], width: usize) -> Result<(), String> {
    let is_wrong = |d: f32| d.is_nan() || d == f32::NEG_INFINITY;
    // Without a branch for each, which is several times faster.
    if !disparities(bytes).fold(false, |any, d| any | is_wrong(d)) {
        return Ok(());
    }
    let wrong = disparities(bytes).enumerate().find(|(_, d)| is_wrong(*d));
    let (i, disparity) = wrong.unwrap_or_default();
    Err(format!(
        "gave the disparity {disparity} at ({}, {}): none is +inf",
        i % width,
        i / width
    ))
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
