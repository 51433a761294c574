//! What v1 and v2 have in common: smoothing, block matching with a filter on its costs, and the
//! symmetric check.

use super::stage::{
    BACK_CHECK, Bands, Blocks, CostFilter, CostSearch, DeviationTexture, DisparityRange, SUBPIXEL,
    Strip, SymmetricCheck, VerticalSmoothing, back_check, refine,
};
use super::{MatchContext, MatchOutput, Matcher, Parameters};
use crate::error::Result;
use crate::kernel::Isa;
use crate::stereo::{BandMut, ExtraPlanes, Plane, RectifiedPair, StereoPair};
use crate::timing::{Clock, Stage};

/// A matcher that matches both ways.
pub(super) struct Symmetric<F> {
    isa: Isa,
    range: DisparityRange,
    smoothing: VerticalSmoothing,
    /// Without one every pixel is matched.
    texture: Option<DeviationTexture>,
    filter: F,
    tolerance_px: i32,
    subpixel: bool,
    back_check: bool,
    scratch: Option<Bands<Scratch<F>>>,
}

/// Memory for a block of rows.
struct Scratch<F> {
    strip: Strip,
    textured: Plane<bool>,
    search: CostSearch<F>,
    check: SymmetricCheck,
}

impl<F: CostFilter + Copy> Symmetric<F> {
    /// # Errors
    /// What [`DisparityRange::new`] says.
    pub(super) fn new(
        parameters: &Parameters,
        isa: Isa,
        texture: Option<DeviationTexture>,
        filter: F,
    ) -> Result<Self> {
        let range = DisparityRange::of(parameters)?;
        Ok(Self {
            isa,
            range,
            smoothing: VerticalSmoothing::new(parameters.real(VerticalSmoothing::SIGMA.name)),
            texture,
            filter,
            tolerance_px: parameters.int(SymmetricCheck::TOLERANCE.name),
            subpixel: parameters.flag(SUBPIXEL.name),
            back_check: parameters.flag(BACK_CHECK.name),
            scratch: None,
        })
    }

    fn scratch(&self, width: usize) -> Result<Scratch<F>> {
        Ok(Scratch {
            strip: Strip::new(width)?,
            textured: Plane::filled(width, Blocks::ROWS, true)?,
            search: CostSearch::new(self.filter, width, self.range),
            check: SymmetricCheck::new(self.tolerance_px, width, self.range),
        })
    }

    /// Matches the rows from `top` on.
    fn match_rows(
        &self,
        pair: &StereoPair,
        top: usize,
        mut rows: BandMut<'_>,
        scratch: &mut Scratch<F>,
        clock: &mut Clock,
    ) {
        let (
            isa,
            count,
            Scratch {
                strip,
                textured,
                search,
                check,
            },
        ) = (self.isa, rows.rows(), scratch);
        strip.load(isa, &self.smoothing, pair, top, count);
        clock.lap(Stage::Smoothing);

        if let Some(texture) = self.texture {
            (0..count)
                .for_each(|lane| texture.apply_row(isa, strip.left(lane), textured.row_mut(lane)));
        }
        clock.lap(Stage::Texture);

        strip.transpose(isa);
        let [left, right] = strip.columns();
        search.search(isa, left, right, count);
        for (lane, mut row) in rows.rows_mut().enumerate() {
            search.write_row(
                lane,
                [strip.left(lane), strip.right(lane)],
                textured.row(lane),
                &mut row,
            );
        }
        clock.lap(Stage::Matching);

        check.search(isa, left, right, count);
        for (lane, mut row) in rows.rows_mut().enumerate() {
            check.check_row(lane, &mut row);
            if self.subpixel {
                refine(
                    self.range,
                    strip.left(lane),
                    |_| strip.right(lane),
                    &mut row,
                );
            }
            if self.back_check {
                back_check(&mut row);
            }
        }
        clock.lap(Stage::Checks);
    }
}

impl<F: CostFilter + Copy + Send> Matcher for Symmetric<F> {
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
        let size = pair.size();
        map.resize(size.0, size.1, ExtraPlanes::SSDPI)?;
        let mut bands = Bands::fitting(self.scratch.take(), size, || self.scratch(size.0))?;
        bands.each_block(map, clock, |top, rows, scratch, clock| {
            self.match_rows(&pair, top, rows, scratch, clock)
        });
        self.scratch = Some(bands);
        Ok(())
    }
}
