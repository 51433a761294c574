//! Rectified pairs as bytes, for another program: docs/exec-protocol.md.

use super::Sink;
use serde::Serialize;
use std::io::Write;
use svl_core::stereo::{Frame, Rig};
use svl_core::{Error, Result};
use svl_score::judge::Judged;

/// A sink that writes of each frame a line of JSON, the two images, and the truth.
pub struct PairStreamSink<W> {
    to: W,
    /// Memory that the next pair uses again.
    bytes: Vec<u8>,
}

/// Header line of a pair.
#[derive(Serialize)]
struct PairLine<'a> {
    width: usize,
    height: usize,
    sequence: u64,
    stamp_ns: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rig: Option<Rig>,
    /// True if the disparities of the truth follow the images.
    truth: bool,
}

impl<W: Write> PairStreamSink<W> {
    pub fn new(to: W) -> Self {
        let bytes = Vec::new();
        Self { to, bytes }
    }

    fn fill(&mut self, frame: &Frame) -> std::io::Result<()> {
        let (width, height) = frame.pair.size();
        let truth = frame.truth.as_ref();
        let line = PairLine {
            width,
            height,
            sequence: frame.sequence,
            stamp_ns: frame.stamp_ns,
            name: frame.name.as_deref(),
            rig: frame.rig().copied(),
            truth: truth.is_some(),
        };
        let bytes = &mut self.bytes;
        bytes.clear();
        serde_json::to_writer(&mut *bytes, &line)?;
        bytes.push(b'\n');
        for image in [frame.pair.left(), frame.pair.right()] {
            image.rows().for_each(|row| bytes.extend_from_slice(row));
        }
        if let Some(truth) = truth {
            let disparities = truth.disparity.map(f32::to_le_bytes);
            let rows = disparities.rows();
            rows.for_each(|row| bytes.extend_from_slice(row.as_flattened()));
        }
        Ok(())
    }
}

impl<W: Write + Send> Sink for PairStreamSink<W> {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        let written = self
            .fill(&judged.frame)
            .and_then(|()| self.to.write_all(&self.bytes))
            .and_then(|()| self.to.flush());
        written.map_err(|error| Error::io("standard output", error))
    }
}
