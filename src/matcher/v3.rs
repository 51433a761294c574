//! Stereoscopic Machine Vision Algo v.3 (thesis, section 5.3.3), the thesis's final result.
//!
//! Vertical smoothing, a texture filter by differences of Gaussians, block matching of the textured
//! pixels with a one-dimensional window of nine pixels, and the self check instead of a left/right
//! check.
//!
//! Departures from the thesis: all in integers; windows near the left edge try the disparities that
//! stay inside the right image; the back check sends negative disparities to 0.

use super::stage::{
    BACK_CHECK, Bands, BlockSearch, Blocks, DisparityRange, DogTexture, SUBPIXEL, SelfCheck, Strip,
    VerticalSmoothing, back_check, refine,
};
use super::{MatchContext, MatchOutput, Matcher, MatcherSpec, Parameters};
use crate::error::Result;
use crate::kernel::Isa;
use crate::stereo::{BandMut, ExtraPlanes, Plane, RectifiedPair, StereoPair};
use crate::timing::{Clock, Stage};

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v3",
    aliases: &[],
    summary: "block matching on textured pixels with a self check: fast and robust, made for \
              obstacle avoidance",
    paper: "Palme, Stereo Vision Library for Obstacle Avoidance Applications, Fribourg and EPFL \
            2007, section 5.3.3",
    parameters: &[
        DisparityRange::MIN,
        DisparityRange::MAX,
        VerticalSmoothing::SIGMA,
        DogTexture::SIGMA,
        DogTexture::DELTA,
        SUBPIXEL,
        BACK_CHECK,
    ],
    build: |parameters, isa| Ok(Box::new(V3::new(parameters, isa)?)),
};

struct V3 {
    isa: Isa,
    range: DisparityRange,
    smoothing: VerticalSmoothing,
    texture: DogTexture,
    subpixel: bool,
    back_check: bool,
    scratch: Option<Bands<Scratch>>,
}

/// Memory for a block of rows.
struct Scratch {
    strip: Strip,
    textured: Plane<bool>,
    search: BlockSearch,
    check: SelfCheck,
}

impl V3 {
    fn new(parameters: &Parameters, isa: Isa) -> Result<Self> {
        Ok(Self {
            isa,
            range: DisparityRange::of(parameters)?,
            smoothing: VerticalSmoothing::new(parameters.real("smoothing_sigma")),
            texture: DogTexture::new(
                parameters.real("texture_sigma"),
                parameters.real("texture_delta"),
            ),
            subpixel: parameters.flag(SUBPIXEL.name),
            back_check: parameters.flag(BACK_CHECK.name),
            scratch: None,
        })
    }

    fn scratch(&self, width: usize) -> Result<Scratch> {
        Ok(Scratch {
            strip: Strip::new(width)?,
            textured: Plane::filled(width, Blocks::ROWS, false)?,
            search: BlockSearch::new(width, self.range),
            check: SelfCheck::new(width, self.range),
        })
    }

    /// Matches the rows from `top` on.
    fn match_rows(
        &self,
        pair: &StereoPair,
        top: usize,
        mut rows: BandMut<'_>,
        scratch: &mut Scratch,
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

        (0..count).for_each(|lane| {
            self.texture
                .apply_row(isa, strip.left(lane), textured.row_mut(lane))
        });
        clock.lap(Stage::Texture);

        strip.transpose(isa);
        let [left, right] = strip.columns();
        search.search(isa, left, right, count);
        for (lane, mut row) in rows.rows_mut().enumerate() {
            search.write_row(isa, lane, textured.row(lane), &mut row);
        }
        clock.lap(Stage::Matching);

        check.search(isa, left);
        for (lane, mut row) in rows.rows_mut().enumerate() {
            check.check_row(isa, lane, strip.left(lane), &mut row);
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

impl Matcher for V3 {
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
