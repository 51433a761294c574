//! Block matching of v1, v2 and v3 (thesis, section 5.3): vertical smoothing, texture filter,
//! search, check, sub-pixel refinement and back check, one block of rows after the other.

use super::method::Method;
use super::stage::{
    BACK_CHECK, Bands, Blocks, DisparityRange, RowCheck, RowSearch, SUBPIXEL, Strip, TextureFilter,
    VerticalSmoothing, back_check, refine,
};
use super::{MatchOutput, Parameters};
use crate::error::Result;
use crate::kernel::Isa;
use crate::stereo::{BandMut, ExtraPlanes, Plane, StereoPair};
use crate::timing::{Clock, Stage};

/// The method, with the search `S` and the check `C` of one algorithm.
pub(super) struct BlockMatching<S, C> {
    isa: Isa,
    range: DisparityRange,
    smoothing: VerticalSmoothing,
    /// `None` matches every pixel.
    texture: Option<Box<dyn TextureFilter>>,
    steps: Steps<S, C>,
    subpixel: bool,
    back_check: bool,
}

/// Constructor of the search and the check for rows of a width.
type Steps<S, C> = Box<dyn Fn(usize, DisparityRange) -> (S, C) + Send + Sync>;

/// Memory for a block of rows.
pub(super) struct Scratch<S, C> {
    strip: Strip,
    textured: Plane<bool>,
    search: S,
    check: C,
}

impl<S: RowSearch, C: RowCheck> BlockMatching<S, C> {
    /// From the parameters that all three share: range, smoothing, `subpixel` and `back_check`.
    ///
    /// # Errors
    /// The errors of [`DisparityRange::new`].
    pub(super) fn new(
        parameters: &Parameters,
        isa: Isa,
        texture: Option<Box<dyn TextureFilter>>,
        steps: impl Fn(usize, DisparityRange) -> (S, C) + Send + Sync + 'static,
    ) -> Result<Self> {
        Ok(Self {
            isa,
            range: DisparityRange::from_parameters(parameters)?,
            smoothing: VerticalSmoothing::from_parameters(parameters),
            texture,
            steps: Box::new(steps),
            subpixel: parameters.flag(SUBPIXEL.name),
            back_check: parameters.flag(BACK_CHECK.name),
        })
    }

    /// Matches the rows from `top` on, at most a block.
    fn match_rows(
        &self,
        pair: &StereoPair,
        top: usize,
        mut rows: BandMut<'_>,
        scratch: &mut Scratch<S, C>,
        clock: &mut Clock,
    ) {
        let (isa, count) = (self.isa, rows.rows());
        let strip = &mut scratch.strip;
        strip.load(isa, &self.smoothing, pair, top, count);
        clock.lap(Stage::Smoothing);

        if let Some(texture) = &self.texture {
            let textured = &mut scratch.textured;
            (0..count)
                .for_each(|lane| texture.apply_row(isa, strip.left(lane), textured.row_mut(lane)));
        }
        // Also without a texture filter, so that every run of the method reports all stages.
        clock.lap(Stage::Texture);

        // Texture and checks read rows, the search reads columns of lanes: both are kept.
        strip.transpose(isa);
        let [left, right] = strip.columns();
        scratch.search.search(isa, left, right, count);
        for (lane, mut row) in rows.rows_mut().enumerate() {
            let pair = [strip.left(lane), strip.right(lane)];
            let textured = scratch.textured.row(lane);
            scratch
                .search
                .write_row(isa, lane, pair, textured, &mut row);
        }
        clock.lap(Stage::Matching);

        scratch.check.search(isa, left, right, count);
        for (lane, mut row) in rows.rows_mut().enumerate() {
            let (left, right) = (strip.left(lane), strip.right(lane));
            scratch.check.check_row(isa, lane, left, &mut row);
            if self.subpixel {
                refine(self.range, left, |_| right, &mut row);
            }
            if self.back_check {
                back_check(&mut row);
            }
        }
        clock.lap(Stage::Checks);
    }
}

impl<S: RowSearch, C: RowCheck> Method for BlockMatching<S, C> {
    type Scratch = Bands<Scratch<S, C>>;
    const PLANES: ExtraPlanes = ExtraPlanes::SSDPI;

    fn scratch(&self, (width, height): (usize, usize)) -> Result<Self::Scratch> {
        Bands::new(height, || {
            let (search, check) = (self.steps)(width, self.range);
            Ok(Scratch {
                strip: Strip::new(width)?,
                // Stays all true without a texture filter.
                textured: Plane::filled(width, Blocks::ROWS, true)?,
                search,
                check,
            })
        })
    }

    fn compute(&self, bands: &mut Self::Scratch, pair: &StereoPair, output: &mut MatchOutput) {
        let (map, clock) = (&mut output.disparity, &mut output.clock);
        bands.each_block(map, clock, |top, rows, scratch, clock| {
            self.match_rows(pair, top, rows, scratch, clock)
        });
    }
}
