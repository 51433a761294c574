//! Stereoscopic Machine Vision Algo v.4 (thesis, section 5.3.4), a feasibility study for cameras
//! that are not aligned.
//!
//! No scan along the row: all textured windows of the left image are in a hash table under the sum
//! of their nine pixels, and each window of the right image looks up those of similar sum nearby,
//! also on other rows. So each match has a row offset, and the median row offset measures the
//! pair's vertical misalignment.
//!
//! Departures from the thesis: all in integers; a table for each right row instead of one for the
//! image, so that a look-up finds no window of a row too far away; if several right windows propose
//! one left window, the cheapest match wins; v3's self check follows.

mod proposals;

use super::method::{Method, matcher};
use super::stage::{
    BACK_CHECK, Blocks, DisparityRange, DogTexture, RowCheck, SUBPIXEL, SelfCheck, TextureFilter,
    VerticalSmoothing, back_check, each_plane_row, refine,
};
use super::{MatchOutput, MatcherKind, MatcherSpec, Parameters};
use crate::error::Result;
use crate::kernel::{Isa, Proposal};
use crate::stereo::{DisparityMap, ExtraPlanes, Gray, Plane, Reason, RowMut, StereoPair};
use crate::timing::Stage;
use proposals::{Proposals, Tolerance};

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v4",
    kind: MatcherKind::Images,
    aliases: &[],
    summary: "windows in a hash table, matched across rows: for misaligned cameras, whose \
              vertical misalignment it measures",
    about: "",
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
    cells: None,
    build: |parameters, isa| Ok(matcher(V4::new(parameters, isa)?)),
};

struct V4 {
    isa: Isa,
    range: DisparityRange,
    smoothing: VerticalSmoothing,
    texture: DogTexture,
    tolerance: Tolerance,
    subpixel: bool,
    back_check: bool,
}

/// Memory for pairs of one size.
struct Scratch {
    left: Gray,
    right: Gray,
    textured: Plane<bool>,
    left_blocks: Blocks,
    proposals: Proposals,
    band_rows: usize,
    /// One per band.
    checks: Vec<SelfCheck>,
}

impl V4 {
    fn new(parameters: &Parameters, isa: Isa) -> Result<Self> {
        Ok(Self {
            isa,
            range: DisparityRange::from_parameters(parameters)?,
            smoothing: VerticalSmoothing::from_parameters(parameters),
            texture: DogTexture::from_parameters(parameters),
            tolerance: Tolerance::from_parameters(parameters),
            subpixel: parameters.flag(SUBPIXEL.name),
            back_check: parameters.flag(BACK_CHECK.name),
        })
    }

    fn write_row(&self, accepted: &[Proposal], textured: &[bool], row: &mut RowMut<'_>) {
        row.clear(Reason::Border);
        for x in self.range.columns(row.width()) {
            if !textured[x] {
                row.reject(x, Reason::Untextured);
            } else if accepted[x] == Proposal::NONE {
                // Textured, but no window of the right image proposed it.
                row.reject(x, Reason::Unmatched);
            } else {
                row.accept(x, f32::from(accepted[x].disparity));
                row.set_ssdpi(x, accepted[x].ssd);
            }
        }
    }
}

fn write_row_offsets(accepted: &Plane<Proposal>, map: &mut DisparityMap) {
    let offsets = map.row_offset_mut().expect("among the planes of v4");
    each_plane_row(offsets, 64, |y, offsets| {
        let proposals = offsets.iter_mut().zip(accepted.row(y));
        proposals.for_each(|(offset, proposal)| *offset = proposal.row_offset);
    });
}

impl Method for V4 {
    type Scratch = Scratch;
    const PLANES: ExtraPlanes = ExtraPlanes::ALL;

    fn scratch(&self, (width, height): (usize, usize)) -> Result<Self::Scratch> {
        let (bands, band_rows) = Blocks::bands(height);
        Ok(Scratch {
            left: Gray::filled(width, height, 0)?,
            right: Gray::filled(width, height, 0)?,
            textured: Plane::filled(width, height, false)?,
            left_blocks: Blocks::new(width, height)?,
            proposals: Proposals::new((width, height), self.range, self.tolerance)?,
            band_rows,
            checks: (0..bands)
                .map(|_| SelfCheck::new(width, self.range))
                .collect(),
        })
    }

    fn compute(&self, scratch: &mut Scratch, pair: &StereoPair, output: &mut MatchOutput) {
        let (map, clock) = (&mut output.disparity, &mut output.clock);
        let isa = self.isa;
        self.smoothing.apply(isa, pair.left(), &mut scratch.left);
        self.smoothing.apply(isa, pair.right(), &mut scratch.right);
        clock.lap(Stage::Smoothing);

        let (left, right) = (&scratch.left, &scratch.right);
        self.texture.apply(isa, left, &mut scratch.textured);
        clock.lap(Stage::Texture);

        let accepted = scratch
            .proposals
            .resolve(isa, left, right, &scratch.textured);
        map.each_row_mut(scratch.band_rows, &mut scratch.checks, |y, row, _| {
            self.write_row(accepted.row(y), scratch.textured.row(y), row);
        });
        write_row_offsets(accepted, map);
        clock.lap(Stage::Matching);

        scratch.left_blocks.load(isa, left);
        map.each_row_mut(scratch.band_rows, &mut scratch.checks, |y, row, check| {
            let lane = y % Blocks::ROWS;
            if lane == 0 {
                // The self check uses only the left image.
                let columns = scratch.left_blocks.around(y);
                check.search(isa, columns, columns, Blocks::ROWS);
            }
            check.check_row(isa, lane, left.row(y), row);
            if self.subpixel {
                let row_offset = |x| i32::from(accepted.get(x, y).row_offset);
                // The row of the match, which tolerances keep inside the image.
                let matched = |x| right.row((y as i32 + row_offset(x)) as usize);
                refine(self.range, left.row(y), matched, row);
            }
            if self.back_check {
                back_check(row);
            }
        });
        clock.lap(Stage::Checks);
    }
}
