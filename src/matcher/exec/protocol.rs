//! What goes to the program and what comes back.

use crate::matcher::MatchContext;
use crate::matcher::stage::DisparityRange;
use crate::stereo::{Rig, StereoPair};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Read};

/// Longest line of a reply, in bytes.
const LONGEST_LINE: u64 = 64 * 1024;

/// A line before a pair.
#[derive(Serialize)]
struct RequestLine {
    width: usize,
    height: usize,
    min_disparity: i32,
    max_disparity: i32,
    seq: u64,
    columns: usize,
    rows: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    rig: Option<Rig>,
}

/// A line before disparities, or in their place.
#[derive(Deserialize)]
struct ReplyLine {
    seq: u64,
    millis: Option<f64>,
    error: Option<String>,
    cells: Option<Vec<Option<ReplyCell>>>,
}

/// A cell that the program knows.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ReplyCell {
    pub(super) disparity_px: f32,
    pub(super) probability: Option<f64>,
}

/// What is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Question {
    pub(super) sequence: u64,
    /// Width and height of the pair.
    pub(super) size: (usize, usize),
    /// How many cells the grid has.
    pub(super) cells: usize,
}

/// What the program answered to a pair.
#[derive(Debug, PartialEq)]
pub(super) enum Reply {
    /// Disparities in raster order, each finite or `+∞`.
    Matched {
        millis: f64,
        disparities: Vec<f32>,
        /// Its own cells in raster order, nothing for unknown ones.
        cells: Option<Vec<Option<ReplyCell>>>,
    },
    /// Why it does not match the pair, in one line.
    Refused(String),
}

/// The bytes that ask for a pair.
pub(super) fn request(
    pair: &StereoPair,
    range: DisparityRange,
    seq: u64,
    context: &MatchContext,
) -> Vec<u8> {
    let (width, height) = pair.size();
    let line = RequestLine {
        width,
        height,
        min_disparity: range.min(),
        max_disparity: range.max(),
        seq,
        columns: context.grid.columns,
        rows: context.grid.rows,
        rig: context.rig,
    };
    // Numbers under plain names.
    let mut bytes = serde_json::to_vec(&line).expect("JSON");
    bytes.push(b'\n');
    for image in [pair.left(), pair.right()] {
        image.rows().for_each(|row| bytes.extend_from_slice(row));
    }
    bytes
}

/// Reads the answer to a question.
///
/// # Errors
/// What is wrong with it, as what the program did.
pub(super) fn read_reply(
    from: &mut BufReader<impl Read>,
    question: Question,
) -> Result<Reply, String> {
    let Question {
        sequence: seq,
        size: (width, height),
        ..
    } = question;
    let broken = |error: std::io::Error| format!("cannot be read from: {error}");
    let mut line = Vec::new();
    from.by_ref()
        // A program that prints no end of line must not fill the memory.
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
    if reply.seq != seq {
        return Err(garbage(&format!("it was asked for seq {seq}")));
    }
    let reply = match reply {
        ReplyLine {
            error: Some(why), ..
        } => Reply::Refused(one_line(&why)),
        ReplyLine {
            millis: Some(millis),
            cells,
            ..
        } if (0.0..1e9).contains(&millis) => {
            check_cells(cells.as_deref(), question.cells)?;
            Reply::Matched {
                millis,
                disparities: read_disparities(from, width, height)?,
                cells,
            }
        }
        _ => return Err(garbage("neither millis, 0 or more, nor error")),
    };
    // What is left over would be read as the reply to the next pair.
    match from.buffer().len() {
        0 => Ok(reply),
        more => Err(format!(
            "wrote {more} bytes and perhaps more after its reply for {width}x{height} pixels"
        )),
    }
}

/// Refuses cells that no grid of that many has.
fn check_cells(cells: Option<&[Option<ReplyCell>]>, expected: usize) -> Result<(), String> {
    let Some(cells) = cells else { return Ok(()) };
    if cells.len() != expected {
        let given = cells.len();
        return Err(format!(
            "gave {given} cells where the grid has {expected}: columns times rows, row by row"
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

fn read_disparities(from: &mut impl Read, width: usize, height: usize) -> Result<Vec<f32>, String> {
    let expected = width * height * 4;
    let mut bytes = Vec::with_capacity(expected);
    let read = from.take(expected as u64).read_to_end(&mut bytes);
    read.map_err(|error| format!("cannot be read from: {error}"))?;
    if bytes.len() < expected {
        return Err(format!(
            "closed its output after {} bytes of disparities; {width}x{height} pixels are \
             {expected}",
            bytes.len()
        ));
    }
    let (values, _) = bytes.as_chunks::<4>();
    let disparities: Vec<f32> = values
        .iter()
        .map(|&value| f32::from_le_bytes(value))
        .collect();
    match disparities
        .iter()
        .position(|d| !d.is_finite() && *d != f32::INFINITY)
    {
        None => Ok(disparities),
        Some(i) => Err(format!(
            "gave the disparity {} at ({}, {}): none is +inf",
            disparities[i],
            i % width,
            i / width
        )),
    }
}

/// The beginning of `bytes` in quotes, fit for one line.
fn quoted(bytes: &[u8]) -> String {
    let bytes = bytes.trim_ascii_end();
    format!("\"{}\"", bytes[..bytes.len().min(60)].escape_ascii())
}

/// `text` in one line that is not too long.
pub(super) fn one_line(text: &str) -> String {
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    words
        .chars()
        .filter(|c| !c.is_control())
        .take(400)
        .collect()
}
