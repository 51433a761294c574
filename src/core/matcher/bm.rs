//! Block matching of the SRI Small Vision System (chapter 7 of the thesis), on which OpenCV's
//! StereoBM is based.
//!
//! Konolige, "Small Vision Systems: Hardware and Implementation", ISRR 1997. Edges instead of grey
//! levels, the sum of absolute differences over a square window, a test of texture, a test of
//! uniqueness, a parabola-like fraction of a pixel; optionally a left/right check and a speckle
//! filter.
//!
//! With `min_disparity` 0 and `max_disparity` one less than a multiple of 16 it equals
//! `cv2.StereoBM_create(max_disparity + 1, block_size)` of OpenCV 5.0 on every pixel. Departures
//! from OpenCV: any disparity range; with a negative `min_disparity` windows that leave the right
//! image are *border*; the speckle filter's step is in pixels, and the pixels it removes are
//! *inconsistent*. Departure from Konolige: x-Sobel unless `prefilter=log`.

use super::method::{Method, matcher};
use super::stage::{
    DisparityRange, EdgeImage, OnePassCheck, Prefilter, SadSearch, Speckles, both, uniqueness,
};
use super::{MatchOutput, MatcherKind, MatcherSpec, Parameter, Parameters, Range};
use crate::error::{Error, Result};
use crate::kernel::Isa;
use crate::stereo::{ExtraPlanes, StereoPair};
use crate::timing::Stage;

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "bm",
    kind: MatcherKind::Images,
    aliases: &["svs"],
    summary: "block matching of edges in square windows, the Small Vision System's and OpenCV's: \
              fast and dense",
    about: "",
    paper: "Konolige, Small Vision Systems: Hardware and Implementation, ISRR 1997; OpenCV's \
            StereoBM",
    parameters: &[
        DisparityRange::MIN,
        DisparityRange::MAX,
        Prefilter::CHOICE,
        Parameter {
            name: "block_size",
            unit: "px",
            range: Range::int(9, 5..=31),
            description: "side of the square window, odd",
        },
        Parameter {
            name: "texture_threshold",
            unit: "",
            range: Range::int(10, 0..=30_000),
            description: "least sum of the strength of edges over the window",
        },
        uniqueness(15),
        OnePassCheck::tolerance(-1),
        Speckles::size(0),
        Speckles::RANGE,
    ],
    cells: None,
    build: |parameters, isa| Ok(matcher(Bm::new(parameters, isa)?)),
};

struct Bm {
    isa: Isa,
    range: DisparityRange,
    prefilter: Prefilter,
    window: usize,
    texture: u16,
    uniqueness: u32,
    tolerance: i32,
    speckles: (i32, f64),
}

/// Memory for pairs of one size.
struct Scratch {
    left: EdgeImage,
    right: EdgeImage,
    band_rows: usize,
    /// One per band.
    searches: Vec<(SadSearch, Option<OnePassCheck>)>,
    speckles: Option<Speckles>,
}

impl Bm {
    fn new(parameters: &Parameters, isa: Isa) -> Result<Self> {
        let window = parameters.int("block_size");
        if window % 2 == 0 {
            return Err(Error::Usage(format!(
                "bm: block_size={window} is even: a window has a pixel at its centre"
            )));
        }
        Ok(Self {
            isa,
            range: DisparityRange::from_parameters(parameters)?,
            prefilter: Prefilter::new(parameters.choice("prefilter")),
            window: window as usize,
            texture: parameters.int("texture_threshold") as u16,
            uniqueness: parameters.int("uniqueness") as u32,
            tolerance: parameters.int("symmetry_tolerance"),
            speckles: (
                parameters.int("speckle_size"),
                parameters.real("speckle_range"),
            ),
        })
    }
}

impl Method for Bm {
    type Scratch = Scratch;
    const PLANES: ExtraPlanes = ExtraPlanes::NONE;

    fn scratch(&self, (width, height): (usize, usize)) -> Result<Scratch> {
        // Each band computes the sum of its first window from scratch, so a band is several windows
        // high.
        let bands = match rayon::current_num_threads() {
            1 => 1,
            threads => threads.min(height.div_ceil(4 * self.window)),
        };
        let band_rows = height.div_ceil(bands);
        let search = || {
            SadSearch::new(
                (width, height),
                self.range,
                self.window,
                self.texture,
                self.uniqueness,
            )
        };
        Ok(Scratch {
            left: EdgeImage::new(width, height)?,
            right: EdgeImage::new(width, height)?,
            band_rows,
            searches: (0..height.div_ceil(band_rows))
                .map(|_| (search(), OnePassCheck::new(width, self.tolerance)))
                .collect(),
            speckles: Speckles::new(width * height, self.speckles.0, self.speckles.1)?,
        })
    }

    fn compute(&self, scratch: &mut Scratch, pair: &StereoPair, output: &mut MatchOutput) {
        let (map, clock) = (&mut output.disparity, &mut output.clock);
        let isa = self.isa;
        both(
            || scratch.left.load(isa, self.prefilter, pair.left()),
            || scratch.right.load(isa, self.prefilter, pair.right()),
        );
        clock.lap(Stage::Smoothing);

        let (band_rows, searches) = (scratch.band_rows, &mut scratch.searches);
        map.each_band_mut(band_rows, searches, |top, band, (search, check)| {
            search.restart();
            for (y, mut row) in (top..).zip(band.into_rows()) {
                search.match_row(isa, y, &scratch.left, &scratch.right, &mut row);
                if let Some(check) = check {
                    // Here, as the SADs are those of the last matched row; the time counts as
                    // matching.
                    check.check_row(|x| search.sad(x), &mut row);
                }
            }
        });
        clock.lap(Stage::Matching);

        if let Some(speckles) = &mut scratch.speckles {
            speckles.remove(map);
        }
        clock.lap(Stage::Checks);
    }
}
