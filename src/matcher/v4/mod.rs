//! Stereoscopic Machine Vision Algo v.4 (thesis, section 5.3.4), a feasibility study for cameras
//! that are not aligned.
//!
//! No scan along the row: all textured windows of the left image stand in a hash table under the
//! sum of their nine pixels, and each window of the right image looks up those of similar sum,
//! close by, also on other rows. So each match says how far apart its rows are, and their median
//! measures how badly the pair is aligned.
//!
//! Departures from the thesis: all in integers; a table for each right row instead of one for the
//! image, so that a look-up meets no window of a row too far away; the cheapest of several claims
//! on a window holds; v3's self check follows.

mod claims;

use super::stage::{
    BACK_CHECK, Blocks, DisparityRange, DogTexture, SUBPIXEL, SelfCheck, VerticalSmoothing,
    back_check, each_row, refine,
};
use super::{MatchContext, MatchOutput, Matcher, MatcherSpec, Parameters};
use crate::error::Result;
use crate::kernel::{Isa, Proposal};
use crate::stereo::{ExtraPlanes, Gray, Plane, Reason, RectifiedPair, RowMut};
use crate::timing::Stage;
use claims::{Claims, Tolerance};

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v4",
    aliases: &[],
    summary: "windows in a hash table, matched across rows: for cameras out of line, and measures \
              by how much they are",
    paper: "Palme, Stereo Vision Library for Obstacle Avoidance Applications, Fribourg and EPFL \
            2007, section 5.3.4",
    parameters: &[
        DisparityRange::MIN,
        DisparityRange::MAX,
        VerticalSmoothing::SIGMA,
        DogTexture::SIGMA,
        DogTexture::DELTA,
        Tolerance::SUM,
        Tolerance::ROWS,
        SUBPIXEL,
        BACK_CHECK,
    ],
    build: |parameters, isa| Ok(Box::new(V4::new(parameters, isa)?)),
};

struct V4 {
    isa: Isa,
    range: DisparityRange,
    smoothing: VerticalSmoothing,
    texture: DogTexture,
    tolerance: Tolerance,
    subpixel: bool,
    back_check: bool,
    scratch: Option<Scratch>,
}

/// Memory for pairs of one size.
struct Scratch {
    left: Gray,
    right: Gray,
    textured: Plane<bool>,
    left_blocks: Blocks,
    claims: Claims,
    band_rows: usize,
    /// One per band.
    checks: Vec<SelfCheck>,
}

impl V4 {
    fn new(parameters: &Parameters, isa: Isa) -> Result<Self> {
        Ok(Self {
            isa,
            range: DisparityRange::of(parameters)?,
            smoothing: VerticalSmoothing::new(parameters.real(VerticalSmoothing::SIGMA.name)),
            texture: DogTexture::new(
                parameters.real(DogTexture::SIGMA.name),
                parameters.real(DogTexture::DELTA.name),
            ),
            tolerance: Tolerance {
                sum: parameters.int(Tolerance::SUM.name).unsigned_abs(),
                rows: parameters.int(Tolerance::ROWS.name).unsigned_abs() as usize,
            },
            subpixel: parameters.flag(SUBPIXEL.name),
            back_check: parameters.flag(BACK_CHECK.name),
            scratch: None,
        })
    }

    fn scratch(&self, (width, height): (usize, usize)) -> Result<Scratch> {
        let (bands, band_rows) = Blocks::bands(height);
        Ok(Scratch {
            left: Gray::filled(width, height, 0)?,
            right: Gray::filled(width, height, 0)?,
            textured: Plane::filled(width, height, false)?,
            left_blocks: Blocks::new(width, height),
            claims: Claims::new((width, height), self.range, self.tolerance)?,
            band_rows,
            checks: (0..bands)
                .map(|_| SelfCheck::new(width, self.range))
                .collect(),
        })
    }

    fn write_row(&self, granted: &[Proposal], textured: &[bool], row: &mut RowMut<'_>) {
        row.clear(Reason::Border);
        for x in self.range.columns(row.width()) {
            if !textured[x] {
                row.reject(x, Reason::Untextured);
            } else if granted[x] == Proposal::NONE {
                row.reject(x, Reason::Unmatched);
            } else {
                row.accept(x, f32::from(granted[x].disparity));
                row.set_ssdpi(x, granted[x].ssd);
            }
        }
    }
}

impl Matcher for V4 {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        _: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let MatchOutput {
            disparity: map,
            clock,
            ..
        } = output;
        let (isa, size) = (self.isa, pair.size());
        map.resize(size.0, size.1, ExtraPlanes::ALL)?;
        let fitting = self
            .scratch
            .take()
            .filter(|scratch| scratch.left.size() == size);
        let mut scratch = fitting.map_or_else(|| self.scratch(size), Ok)?;
        let Scratch {
            left,
            right,
            textured,
            left_blocks,
            claims,
            band_rows,
            checks,
        } = &mut scratch;

        self.smoothing.apply(isa, pair.left(), left);
        self.smoothing.apply(isa, pair.right(), right);
        clock.lap(Stage::Smoothing);

        self.texture.apply(isa, left, textured);
        clock.lap(Stage::Texture);

        let granted = claims.settle(isa, left, right, textured);
        map.each_band_mut(*band_rows, checks, |top, band, _| {
            for (y, mut row) in (top..).zip(band.into_rows()) {
                self.write_row(granted.row(y), textured.row(y), &mut row);
            }
        });
        // The plane was asked for above, and as all planes of a map its rows have no gaps.
        let offsets = map.row_offset_mut().and_then(Plane::as_mut_slice);
        each_row(offsets.expect("gapless"), size.0, 64, |y, offsets| {
            let claims = offsets.iter_mut().zip(granted.row(y));
            claims.for_each(|(offset, claim)| *offset = claim.row_offset);
        });
        clock.lap(Stage::Matching);

        left_blocks.load(isa, left);
        map.each_band_mut(*band_rows, checks, |top, band, check| {
            for (y, mut row) in (top..).zip(band.into_rows()) {
                let lane = y % Blocks::ROWS;
                if lane == 0 {
                    check.search(isa, left_blocks.around(y));
                }
                check.check_row(isa, lane, left.row(y), &mut row);
                if self.subpixel {
                    let matched = |x| {
                        right.row((y as i32 + i32::from(granted.get(x, y).row_offset)) as usize)
                    };
                    refine(self.range, left.row(y), matched, &mut row);
                }
                if self.back_check {
                    back_check(&mut row);
                }
            }
        });
        clock.lap(Stage::Checks);
        self.scratch = Some(scratch);
        Ok(())
    }
}
