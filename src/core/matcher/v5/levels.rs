//! The sizes at which the cells of a pair are decided: the pair's own and, of wide images, halves
//! of it. The matching at quarter size, which a level needs for its gaps, is that of the next one.

use super::census::HalfImage;
use super::gaps::Gaps;
use super::level::{MatchLevel, MatchSettings};
use super::past::CellPasts;
use crate::depth::decision::{CellPixels, Tolerance};
use crate::error::Result;
use crate::kernel::{GapNetwork, Isa};
use crate::stereo::{CellRule, DisparityMap, RectifiedPair, Rig};
use crate::timing::Stage;
use std::ops::Range;

/// Widest level that has no coarser one: the tables of a single level were fitted to 320 px.
pub(super) const MAX_COARSEST: usize = 400;

/// Least range of a coarser level, pixels of it.
const MIN_RANGE: usize = 80;

/// Least lattice places of a cell at a level of several: more say little more, and cost time.
const MIN_PLACES: usize = 240;

/// Least lattice places of a cell at a coarser level: smaller cells show two surfaces as one.
const MIN_HALVED_PLACES: usize = 40;

/// Least lattice places of a cell that is not small, as in the fit of all tables but one.
const USUAL_PLACES: usize = 100;

/// Hypotheses of the coarsest level this close to a pixel's best agree with it, bins.
const AGREEING_BINS: u16 = 12;

/// Columns and rows of a half image of which the lattice of a level has one, as powers of two, at
/// least: neighbouring rows say nearly the same.
const LATTICE: [u32; 2] = [1, 2];

/// The images and parameters that memory is made for.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct LevelPlan {
    /// Size of the pair, at least 2 x 2.
    pub(super) size: (usize, usize),
    /// Number of cells.
    pub(super) cells: usize,
    pub(super) max_disparity: usize,
    /// Widest level that is computed, unless it is the coarsest; 0 for all.
    pub(super) width: usize,
    /// False for the pair's size alone.
    pub(super) halves: bool,
    /// False without a network.
    pub(super) has_gaps: bool,
}

/// Memory for pairs of one plan.
pub(super) struct Levels {
    pub(super) plan: LevelPlan,
    /// Images of levels that are not computed.
    skipped: Vec<[HalfImage; 2]>,
    /// The matching of each level that is computed, finest first; then that for the gaps of the
    /// last, if its half image can be halved.
    matched: Vec<MatchLevel>,
    /// The gaps of each computed level; of the last one only if its half image can be halved.
    gaps: Vec<Gaps>,
    computed: usize,
    /// Greatest disparity of each computed level, pixels of it.
    pub(super) ranges: Vec<i64>,
    pub(super) past: CellPasts,
    /// The tolerances of the levels, and the rule and rig that they are of.
    pub(super) tolerances: Option<(CellRule, Option<Rig>, Vec<Tolerance>)>,
    pub(super) pixels: Vec<CellPixels>,
}

impl LevelPlan {
    /// The largest disparity that any level finds, pixels of the pair.
    pub(super) fn range_px(&self) -> usize {
        let levels = 0..sizes(self).len();
        let range_px = levels.map(|level| range(self.max_disparity, level) << level);
        range_px.max().unwrap_or(self.max_disparity)
    }
}

/// The sizes of an image and its halves, of half images of at least a pixel.
fn sizes(plan: &LevelPlan) -> Vec<(usize, usize)> {
    let next = |&(width, height): &(usize, usize)| {
        let half = (width / 2, height / 2);
        let is_large = width > MAX_COARSEST && half.1 >= 2;
        (plan.halves && is_large && places(half, plan.cells) >= MIN_HALVED_PLACES).then_some(half)
    };
    std::iter::successors(Some(plan.size), next).collect()
}

/// Powers of two of the lattice of a half image of that size.
fn lattice(plan: &LevelPlan, half: (usize, usize), is_single: bool) -> [u32; 2] {
    let places = |[x, y]: [u32; 2]| half.0.div_ceil(1 << x) * half.1.div_ceil(1 << y) / plan.cells;
    let doubled = |[x, y]: [u32; 2]| if x < y { [x + 1, y] } else { [x, y + 1] };
    let mut steps = LATTICE;
    while !is_single && places(doubled(steps)) >= MIN_PLACES {
        steps = doubled(steps);
    }
    steps
}

impl Levels {
    pub(super) fn new(plan: LevelPlan) -> Result<Self> {
        let sizes = sizes(&plan);
        let is_wider = |&&(width, _): &&(usize, usize)| plan.width > 0 && width > plan.width;
        let finest = sizes
            .iter()
            .take_while(is_wider)
            .count()
            .min(sizes.len() - 1);
        let half = |&(width, height): &(usize, usize)| (width / 2, height / 2);
        let image = |size| HalfImage::new(size, 0);
        let skipped = sizes[..finest].iter().map(half);
        let skipped = skipped.map(|size| Ok([image(size)?, image(size)?]));
        let skipped = skipped.collect::<Result<_>>()?;
        let (mut matched, mut gaps) = (Vec::new(), Vec::new());
        let mut count = 0;
        for (level, size) in sizes.iter().enumerate().skip(finest) {
            count = range(plan.max_disparity, level) / 2 + 1;
            matched.push(MatchLevel::new(half(size), count)?);
        }
        let last = half(&sizes[sizes.len() - 1]);
        if plan.has_gaps && last.0 >= 2 && last.1 >= 2 {
            matched.push(MatchLevel::new(half(&last), (count - 1) / 2 + 1)?);
        }
        let gapped = if plan.has_gaps { matched.len() - 1 } else { 0 };
        for (level, size) in sizes.iter().enumerate().skip(finest).take(gapped) {
            let steps = lattice(&plan, half(size), sizes.len() == 1);
            // The same part of the image at each level.
            let agreeing_bins = AGREEING_BINS << (sizes.len() - 1 - level);
            gaps.push(Gaps::new(half(size), steps, agreeing_bins)?);
        }
        Ok(Self {
            plan,
            skipped,
            matched,
            gaps,
            computed: sizes.len() - finest,
            ranges: (finest..sizes.len())
                .map(|level| range(plan.max_disparity, level) as i64)
                .collect(),
            past: CellPasts::default(),
            tolerances: None,
            pixels: Vec::new(),
        })
    }

    /// Number of the finest level that is computed.
    pub(super) fn finest(&self) -> usize {
        self.skipped.len()
    }

    /// Numbers of the levels that are computed.
    pub(super) fn numbers(&self) -> Range<usize> {
        self.finest()..self.finest() + self.computed
    }

    /// The matching of each computed level, with its gaps.
    pub(super) fn computed(&self) -> impl Iterator<Item = (&MatchLevel, Option<&Gaps>)> {
        let gaps = self.gaps.iter().map(Some).chain(std::iter::repeat(None));
        self.matched[..self.computed].iter().zip(gaps)
    }

    /// Writes the disparities of the finest computed level.
    pub(super) fn write(&mut self, map: &mut DisparityMap) {
        let finest = self.finest();
        self.matched[0].map.write(finest, map);
    }

    /// Matches at all sizes and measures the hypotheses of the gaps; `lap` is called after each
    /// stage.
    pub(super) fn follow(
        &mut self,
        settings: &MatchSettings,
        pair: RectifiedPair<'_>,
        lap: &mut dyn FnMut(Stage),
    ) {
        let isa = settings.isa;
        let mut wider: Option<&[HalfImage; 2]> = None;
        for images in &mut self.skipped {
            for (image, side) in images.iter_mut().zip([0, 1]) {
                match wider {
                    None => image.halve(isa, [pair.left(), pair.right()][side]),
                    Some(wider) => image.halve_again(isa, &wider[side]),
                }
            }
            wider = Some(images);
        }
        for matched in &mut self.matched {
            matched.load(settings, |image, side| match wider {
                None => image.halve(isa, [pair.left(), pair.right()][side]),
                Some(wider) => image.halve_again(isa, &wider[side]),
            });
            wider = Some(&matched.images);
        }
        lap(Stage::Smoothing);
        self.matched
            .iter_mut()
            .for_each(|matched| matched.choose(settings));
        lap(Stage::Matching);
        for matched in &mut self.matched[..self.computed] {
            matched.map.fill(settings.jump);
        }
        for (gaps, half) in self.gaps.iter_mut().zip(&self.matched) {
            gaps.measure(half);
        }
    }

    /// Weighs the hypotheses of the gaps, measured before.
    pub(super) fn weigh(&mut self, isa: Isa, network: &GapNetwork) {
        for ((gaps, half), quarter) in self
            .gaps
            .iter_mut()
            .zip(&self.matched)
            .zip(&self.matched[1..])
        {
            gaps.weigh(isa, [half, quarter], network);
        }
    }

    /// The matching of the finest computed level, that at half its size, and its gaps, if there are
    /// any.
    pub(super) fn finest_gaps(&mut self) -> Option<([&MatchLevel; 2], &mut Gaps)> {
        let gaps = self.gaps.first_mut()?;
        Some(([&self.matched[0], &self.matched[1]], gaps))
    }
}

/// True if the cells of pairs of `size` have fewer lattice places than those that most tables were
/// fitted to.
pub fn has_small_cells(size: (usize, usize), cells: usize) -> bool {
    places(size, cells) < USUAL_PLACES
}

/// Lattice places of a cell of pairs of `size`, at least.
pub(super) fn places((width, height): (usize, usize), cells: usize) -> usize {
    let [columns, rows] = LATTICE;
    (width / 2).div_ceil(1 << columns) * (height / 2).div_ceil(1 << rows) / cells
}

fn range(max_disparity: usize, level: usize) -> usize {
    match level {
        0 => max_disparity,
        _ => max_disparity.div_ceil(1 << level).max(MIN_RANGE),
    }
}
