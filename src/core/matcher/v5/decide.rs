//! The decision on the cells of a pair, from the votes at each of its levels.

use super::levels::{Levels, MAX_COARSEST, has_small_cells, places};
use super::past::PairKey;
use crate::depth::decision::{
    BINS_PER_PX, CellPast, CellPixels, Feature, LevelRule, Past, SafeChoice, Tolerance,
    VerdictTable, cell, probability,
};
use crate::matcher::MatchContext;
use crate::stereo::{Cell, CellRule, LevelCell, NearSurface};
use rayon::prelude::*;

/// The narrowest rule of distances, metres and percent, that the tables of images up to 400 px were
/// fitted to, and that of the others; the fewest lattice places of a cell.
const WIDE_RULE: (f64, f64) = (0.1, 20.0);
const NARROW_RULE: (f64, f64) = (0.02, 5.0);
const FITTED_PLACES: usize = 8;

/// Distance up to which a report is held to less, metres, of rules without `beyond_m`.
const BEYOND_M: f64 = 2.0;

/// Least number of right bins of a nearer surface: a narrower tolerance takes a far wall for one.
const MIN_SURFACE_SPAN: i64 = 13;

/// What is outside of the fit of the tables.
#[derive(Clone, Copy, Default)]
pub(super) struct OutsideFit {
    /// The narrowest rule of the fit, metres and percent, if the run's is narrower.
    pub rule: Option<(f64, f64)>,
    /// The grid at 320 px of the smallest cells of the fit, if the run's are smaller.
    pub cells: Option<&'static str>,
}

impl OutsideFit {
    /// The parts in words.
    pub fn words(self) -> Vec<String> {
        let rule = self.rule;
        let rule = rule.map(|(m, percent)| format!("a tolerance below {percent} % or {m} m"));
        let cells = self
            .cells
            .map(|grid| format!("cells smaller than those of {grid} at 320 px"));
        rule.into_iter().chain(cells).collect()
    }
}

/// The decision on the cells of a pair.
struct Deciding<'a> {
    choice: &'a SafeChoice,
    rule: LevelRule<'a>,
    is_small: bool,
    /// False for images of one level that are wider than those its `near_least_score` is for.
    has_near_least: bool,
    /// Number of levels, computed or not.
    count: usize,
    /// `obstacle_m` and `clear_m` of the rule.
    near_m: (f64, f64),
    /// `beyond_m` of the rule, or the default.
    beyond_m: f64,
    stamp_ns: Option<u64>,
}

impl Levels {
    /// Decides on the cells, in raster order, and at each level. Returns what is outside of the fit
    /// of the tables.
    pub(super) fn decide(
        &mut self,
        choice: &SafeChoice,
        context: &MatchContext,
        cells: &mut [Cell],
        decisions: &mut Vec<LevelCell>,
    ) -> OutsideFit {
        self.make_tolerances(choice, context);
        let bins = |tolerances: &[Tolerance]| tolerances.iter().map(Tolerance::bins).max();
        let Some((rule, rig, tolerances)) = &self.tolerances else {
            return OutsideFit::default();
        };
        let (numbers, most) = (self.numbers(), bins(tolerances).unwrap_or(0));
        let count = numbers.len();
        let mut pixels = std::mem::take(&mut self.pixels);
        pixels.resize_with(cells.len(), || CellPixels::new(most));
        let mut past = std::mem::take(&mut self.past);
        let key = PairKey::new(context, self.plan.size);
        let (before, after) = past.begin(key, cells.len() * count);
        decisions.clear();
        decisions.resize(cells.len() * count, LevelCell::NOTHING);
        let all = numbers.end;
        let is_small = has_small_cells(self.plan.size, cells.len());
        let is_tiny = places(self.plan.size, cells.len()) < FITTED_PLACES;
        let has_levels = choice.levels.is_some();
        let fitted = if has_levels && (all > 1 || is_small) {
            NARROW_RULE
        } else {
            WIDE_RULE
        };
        let outside = OutsideFit {
            rule: is_narrow(rule, fitted).then_some(fitted),
            cells: match has_levels {
                true => is_tiny.then_some("24x12"),
                false => is_small.then_some("5x3"),
            },
        };
        let deciding = Deciding {
            choice,
            rule: LevelRule {
                tolerances,
                ranges: &self.ranges,
                is_outside: has_levels && (is_tiny || is_narrow(rule, WIDE_RULE)),
                rig: rig.as_ref(),
            },
            is_small,
            has_near_least: all > 1 || self.plan.size.0 <= MAX_COARSEST,
            count: all,
            near_m: context.cells.obstacle_and_clear_m(),
            beyond_m: context.cells.beyond_m().unwrap_or(BEYOND_M),
            stamp_ns: context.stamp_ns,
        };
        let states = before
            .par_chunks_exact(count)
            .zip(after.par_chunks_exact_mut(count));
        let cells = cells.par_iter_mut().zip(&mut pixels);
        let cells = cells.zip(decisions.par_chunks_exact_mut(count)).zip(states);
        cells
            .enumerate()
            .for_each(|(i, (((cell, pixels), levels), states))| {
                *cell = deciding.cell(self, context, i, pixels, levels, states);
            });
        (self.pixels, self.past) = (pixels, past);
        outside
    }

    /// Makes the tolerances of the levels, unless they are known.
    fn make_tolerances(&mut self, choice: &SafeChoice, context: &MatchContext) {
        let rule = context.cells.for_rig(context.rig.is_some());
        let known = self.tolerances.take();
        let known = known.filter(|(known, rig, _)| *known == rule && *rig == context.rig);
        self.tolerances = Some(known.unwrap_or_else(|| {
            let of_level = |level: usize| {
                let halves = 0..level;
                let rule = halves.clone().fold(rule, |rule, _| rule.halved());
                let rig = context
                    .rig
                    .map(|rig| halves.fold(rig, |rig, _| rig.halved()));
                let bins = 16 * (self.ranges[level - self.finest()] as usize / 2 + 1);
                Tolerance::new(rule, rig.as_ref(), choice.allowance_px, bins)
            };
            (rule, context.rig, self.numbers().map(of_level).collect())
        }));
    }

    /// Collects the pixels of a cell at a level; false if nothing was seen there, or it has none.
    fn collect(
        &self,
        context: &MatchContext,
        i: usize,
        level: usize,
        pixels: &mut CellPixels,
    ) -> bool {
        let shape = context.grid.shape();
        let Some((half, gaps)) = self.computed().nth(level) else {
            return false;
        };
        let (image, map) = (&half.images[0], &half.map);
        let place = (i % shape.columns, i / shape.columns);
        let (columns, rows) = shape.pixels(place, map.size);
        if columns.is_empty() || rows.is_empty() || !map.sees {
            return false;
        }
        pixels.clear();
        for y in rows.clone() {
            let (bins, seen, cost) = map.part(y, &columns);
            let texture = image.texture(y, &columns);
            match gaps {
                Some(_) => pixels.measure(seen, cost, texture),
                None => pixels.add(bins, seen, cost, texture),
            }
        }
        for pixel_votes in gaps.iter().flat_map(|gaps| gaps.votes(&columns, &rows)) {
            pixels.vote(&pixel_votes.bins, &pixel_votes.votes, pixel_votes.agreed);
        }
        pixels.count();
        true
    }
}

impl Deciding<'_> {
    /// The cell of that number; sets its decisions at the levels and its states after the pair,
    /// from those before.
    fn cell(
        &self,
        levels: &Levels,
        context: &MatchContext,
        i: usize,
        pixels: &mut CellPixels,
        decisions: &mut [LevelCell],
        (before, after): (&[CellPast], &mut [CellPast]),
    ) -> Cell {
        let (mut valid_share, mut is_collected) = (0.0, false);
        let numbers = levels.numbers();
        for (level, decision) in decisions.iter_mut().enumerate() {
            decision.level = (numbers.start + level) as u8;
            is_collected = levels.collect(context, i, level, pixels);
            if !is_collected {
                continue;
            }
            if level == 0 {
                valid_share = pixels.valid_share();
            }
            after[level] = self.decide(level, pixels, decision, &before[level]);
        }
        let chosen = match &mut *decisions {
            [only] if numbers.end == 1 => self.rule.reports_alone(only).then_some(0),
            levels => self.rule.choose(levels),
        };
        let mut cell = self.chosen(decisions, chosen);
        cell.valid_share = valid_share;
        if !is_collected {
            return cell;
        }
        // The pixels are those of the coarsest level, which sees nearest; small cells have one.
        cell.surface = self.surface(pixels, &cell);
        if cell.depth.is_none() {
            cell.near = match &cell.surface {
                Some(surface) => {
                    (surface.distance_m < self.near_m.0).then_some(surface.probability)
                }
                None => self.near(pixels),
            };
        }
        cell
    }

    /// The nearer surface of a small cell, by its pixels; none that is the cell's report.
    fn surface(&self, pixels: &CellPixels, cell: &Cell) -> Option<NearSurface> {
        let table = self.choice.near_small.as_ref().filter(|_| self.is_small)?;
        let (rig, tolerance) = (self.rule.rig?, self.rule.tolerances.last()?);
        let evidence = table.evidence(pixels, tolerance);
        let (report, score) = (evidence.report, table.score(&evidence));
        let is_wide = evidence.features[Feature::Span as usize] >= MIN_SURFACE_SPAN;
        // A surface nearer than `obstacle_m` is held to what a near flag is.
        let flag = self.choice.near.as_ref();
        let flag = flag.filter(|_| self.is_nearer(report, 0, self.near_m.0));
        let least = flag.map_or(table.least_score, |near| near.least_score);
        if report <= 0 || score < table.least_score.max(least) || !is_wide {
            return None;
        }
        let known = cell.evidence.filter(|_| cell.depth.is_some());
        // Up to half of its tolerance farther, the cell's report is that of the same surface.
        let [farthest, _] = tolerance.ends(report as usize).map(i64::from);
        if known.is_some_and(|known| 2 * known.report >= report + farthest) {
            return None;
        }
        let px = report as f32 / BINS_PER_PX as f32;
        Some(NearSurface {
            px,
            distance_m: rig.depth_m(px.into())?,
            probability: probability(score),
        })
    }

    /// Decides at a level; returns the cell's state after the pair, from that before.
    fn decide(
        &self,
        level: usize,
        pixels: &CellPixels,
        decision: &mut LevelCell,
        before: &CellPast,
    ) -> CellPast {
        let number = decision.level.into();
        let table = self
            .choice
            .table_of_level(number, self.count, self.is_small);
        let tolerance = &self.rule.tolerances[level];
        let evidence = table.evidence(pixels, tolerance);
        let own = table.score(&evidence);
        decision.percentiles = pixels.percentiles();
        decision.evidence = Some(evidence);
        let is_nearer = |metres| self.is_nearer(evidence.report, decision.level, metres);
        // Reports of several levels below `obstacle_m` are held to as much as all others.
        let may_gain = is_nearer(self.beyond_m) && (self.count == 1 || !is_nearer(self.near_m.0));
        let near_least = table
            .near_least_score
            .filter(|_| self.has_near_least && may_gain);
        let hides_near = || self.hides_near(level, decision.level, evidence.report, pixels);
        let least = |least_score, score| match near_least {
            Some(near_least) if score >= least_score || !hides_near() => near_least,
            _ => least_score,
        };
        (decision.scores, decision.least_score) = ([own; 2], least(table.least_score, own));
        // A report of 0 has no past, and leaves none.
        let Some(time) = table.time.as_ref().filter(|_| evidence.report > 0) else {
            return CellPast::default();
        };
        let ends = tolerance.ends(evidence.report as usize);
        let relation = before.relation(evidence.report, ends);
        let mut added = time.score(relation, before.trust);
        if is_nearer(self.near_m.1) {
            added = added.max(0);
        }
        if relation != Past::None {
            let score = own + added;
            (decision.scores[1], decision.least_score) = (score, least(time.least_score, score));
        }
        before.after(relation, evidence.report, own, self.stamp_ns)
    }

    /// True if a report of a level, beyond `clear_m`, would hide that the nearest quarter of its
    /// cell reports something nearer than `obstacle_m`, however probable.
    fn hides_near(&self, level: usize, number: u8, report: i64, pixels: &CellPixels) -> bool {
        let (obstacle_m, clear_m) = self.near_m;
        let is_obstacle = |table: &VerdictTable| {
            let nearest = table.evidence(pixels, &self.rule.tolerances[level]);
            self.is_nearer(nearest.report, number, obstacle_m)
        };
        !self.is_nearer(report, number, clear_m)
            && self.choice.near.as_ref().is_some_and(is_obstacle)
    }

    /// The cell as the chosen level reports it; unknown, as the finest has it, without one.
    fn chosen(&self, decisions: &[LevelCell], chosen: Option<usize>) -> Cell {
        let decision = &decisions[chosen.unwrap_or(0)];
        let Some(evidence) = &decision.evidence else {
            return Cell::UNKNOWN;
        };
        let score = decision.scores[1];
        let is_known = chosen.is_some() && score >= decision.least_score;
        let score = (score, is_known);
        let cell = cell(
            evidence,
            decision.percentiles,
            score,
            decision.level,
            self.rule.rig,
        );
        Cell {
            // A report that failed a test of its level is not one that may be right.
            probability: cell.probability.filter(|_| chosen.is_some()),
            ..cell
        }
    }

    /// The probability that something is nearer than `obstacle_m`, if it is high enough, by the
    /// pixels of the coarsest level.
    fn near(&self, pixels: &CellPixels) -> Option<f64> {
        let table = self
            .choice
            .near
            .as_ref()
            .filter(|_| self.rule.rig.is_some())?;
        let (tolerance, level) = (self.rule.tolerances.last()?, (self.count - 1) as u8);
        let evidence = table.evidence(pixels, tolerance);
        let score = table.score(&evidence);
        let is_near =
            score >= table.least_score && self.is_nearer(evidence.report, level, self.near_m.0);
        is_near.then(|| probability(score))
    }

    /// True if a report above 0 of a level is nearer than that; never without a rig.
    fn is_nearer(&self, report: i64, level: u8, metres: f64) -> bool {
        let px = (report << level) as f64 / f64::from(BINS_PER_PX);
        let rig = self.rule.rig.filter(|_| report > 0);
        let depth_m = rig.and_then(|rig| rig.depth_m(px));
        depth_m.is_some_and(|depth_m| depth_m < metres)
    }
}

/// True for a rule of distances that is narrower than that one.
fn is_narrow(rule: &CellRule, (fitted_m, fitted_percent): (f64, f64)) -> bool {
    let (metres, percent) = rule.tolerances();
    let is_distance = matches!(rule, CellRule::Distance { .. });
    is_distance && (metres < fitted_m || percent < fitted_percent)
}
