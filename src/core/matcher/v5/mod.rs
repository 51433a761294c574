//! v5: svl's own algorithm, which decides on cells instead of pixels.
//!
//! It estimates the distance of each cell of the depth grid, and decides whether to report it.
//! SGM (Hirschmüller 2008) of small censuses at half size along four paths; then gaps are filled
//! like occluded surfaces, and each cell reports a value that is right whatever the disparities of
//! its uncertain pixels ([`crate::depth::decision`]).

mod census;
mod gaps;
mod half_map;
mod level;
mod model;
mod past;
mod sums;

use super::{
    MatchContext, MatchOutput, Matcher, MatcherKind, MatcherSpec, Parameter, Parameters, Range,
};
use crate::depth::decision::{
    BINS_PER_PX, CellPast, CellPixels, Past, SafeChoice, Tolerance, probability,
};
use crate::error::{Error, Result};
use crate::kernel::{GapCandidates, GapNetwork, Isa, STEPS, WinnerTest};
use crate::stereo::{Cell, CellRule, DepthGrid, ExtraPlanes, Reason, RectifiedPair, Rig};
use crate::timing::Stage;
use gaps::Gaps;
use level::MatchLevel;
use past::{CellPasts, PairKey};
use rayon::prelude::*;

pub use model::{GapWeights, V5Model};

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v5",
    kind: MatcherKind::Images,
    aliases: &[],
    summary: "svl's own: cells that are safe to report, from semi-global matching at half size; \
              with the probability that each is right",
    about: "v5 estimates the distance of a cell of the depth grid, not the disparity of a pixel. \
            1. Both images are halved by a low-pass, which averages noise and halves a \
            misalignment. 2. The census of 5x5 pixels and semi-global matching along four paths \
            give each pixel a disparity; what leads out of the image costs less than a random \
            match. 3. A pixel is seen when it is unique, the right image agrees, and most of its \
            neighbours are seen, too. 4. A small network weighs the disparities that the others \
            may have. 5. A cell reports the disparity that stays right, by the rule \
            of the scenario, whatever its uncertain pixels are: the one whose tolerance leaves \
            the least of the cell on either side. 6. That margin, how much was seen and supports \
            the report, matching costs and texture become the probability that the report is \
            right; below `confidence` the cell is unknown. 7. A report that agrees with the \
            cell's earlier ones gains, one that contradicts them loses. 8. An unknown cell with \
            something near is flagged. docs/v5.md shows it.",
    paper: "svl, docs/v5.md; after Hirschmüller, Stereo Processing by Semiglobal Matching and \
            Mutual Information, PAMI 30(2), 2008",
    parameters: &[
        Parameter {
            name: "revision",
            unit: "",
            range: Range::Choice {
                default: "4",
                options: &["2", "4"],
            },
            description: "4 has learned gaps and a memory; 2 has neither and takes half the time",
        },
        Parameter {
            name: "max_disparity",
            unit: "px",
            range: Range::int(80, 0..=255),
            description: "largest disparity; half as many are tried, at half size",
        },
        Parameter {
            name: "out",
            unit: "bits",
            range: Range::int(7, 0..=24),
            description: "cost of a disparity that leads out of the right image; random is 12",
        },
        Parameter {
            name: "p1",
            unit: "bits",
            range: Range::int(6, 0..=39),
            description: "cost of a step of disparity by one: slopes",
        },
        Parameter {
            name: "p2",
            unit: "bits",
            range: Range::int(32, 0..=39),
            description: "cost of any other step, at least p1: edges of objects",
        },
        Parameter {
            name: "edge",
            unit: "× 1/4 grey level",
            range: Range::int(40, 1..=1020),
            description: "difference of neighbours beyond which p2 falls in proportion",
        },
        Parameter {
            name: "unique",
            unit: "",
            range: Range::int(20, 0..=65_535),
            description: "a pixel is seen when its second best sum is greater by 1/unique",
        },
        Parameter {
            name: "jump",
            unit: "× 1/8 px",
            range: Range::int(16, 0..=4096),
            description: "gaps between disparities that differ by more belong to the farther one",
        },
        Parameter {
            name: "target",
            unit: "",
            range: Range::Choice {
                default: "median",
                options: &["median", "near"],
            },
            description: "what a cell reports: its median, or its nearest quarter",
        },
        Parameter {
            name: "model",
            unit: "",
            range: Range::File,
            description: "network and tables, of `svl train v5`, in place of the built-in ones",
        },
        Parameter {
            name: "allowance_px",
            unit: "px",
            range: Range::real(0.25, 0.0..=16.0),
            description: "part of the tolerance that is kept for the matcher's own error",
        },
        Parameter {
            name: "confidence",
            unit: "",
            range: Range::real(0.0, 0.0..=0.999),
            description: "least probability of a cell that is reported, 0 = the model's: 0.9, \
                          0.93 with earlier reports; 0.85 in revision 2",
        },
    ],
    cells: Some(safe_choice),
    build: |parameters, isa| Ok(Box::new(V5::new(parameters, isa)?)),
};

struct V5 {
    isa: Isa,
    /// Number of disparities at half size.
    count: usize,
    /// Cost of a disparity that leads out of the right image, and of a change by one.
    out_and_small: [u8; 2],
    /// Penalty for a jump of disparity, by the difference of the pixels.
    jumps: [u8; STEPS],
    test: WinnerTest,
    choice: SafeChoice,
    gaps: Option<GapNetwork>,
    past: CellPasts,
    scratch: Option<Scratch>,
    tolerance: Option<(CellRule, Option<Rig>, Tolerance)>,
    cells: Vec<CellPixels>,
}

/// Memory for pairs of one size.
struct Scratch {
    size: (usize, usize),
    half: MatchLevel,
    /// Memory of a network for gaps, if the half image can be halved again.
    gaps: Option<Gaps>,
}

impl V5 {
    fn new(parameters: &Parameters, isa: Isa) -> Result<Self> {
        let byte = |name| parameters.int(name) as u8;
        let [p1, p2, out] = ["p1", "p2", "out"].map(byte);
        if p2 < p1 {
            return Err(Error::Usage(format!(
                "v5: p2={p2} is below p1={p1}: a large step costs at least a small one"
            )));
        }
        let edge = parameters.int("edge");
        let count = parameters.int("max_disparity") as usize / 2 + 1;
        let model = model(parameters)?;
        let network = model.network.as_ref();
        Ok(Self {
            isa,
            count,
            out_and_small: [out, p1],
            jumps: std::array::from_fn(|difference| {
                p1.max((i32::from(p2) * edge / edge.max(difference as i32)) as u8)
            }),
            test: WinnerTest {
                unique: parameters.int("unique") as u32,
                out,
            },
            gaps: network.map(GapWeights::network),
            choice: choice_of(model, parameters),
            past: CellPasts::default(),
            scratch: None,
            tolerance: None,
            cells: Vec::new(),
        })
    }

    /// Number of bins that distinguish disparities.
    fn bins(&self) -> usize {
        16 * self.count
    }

    /// Makes memory for half images of `size`, unless there is some.
    fn reserve(&mut self, size: (usize, usize), has_gaps: bool) -> Result<()> {
        // Freed before the new memory is allocated, so that both sizes are never held at once.
        self.scratch.take_if(|scratch| scratch.size != size);
        if self.scratch.is_none() {
            self.scratch = Some(Scratch::new(size, self.count, has_gaps)?);
        }
        Ok(())
    }

    /// Matches at half size, and at quarter size for gaps; `lap` is called after each stage.
    fn follow(&mut self, pair: RectifiedPair<'_>, lap: &mut dyn FnMut(Stage)) {
        let Some(Scratch { half, gaps, .. }) = &mut self.scratch else {
            return;
        };
        let isa = self.isa;
        let (jumps, test, paths) = (&self.jumps, &self.test, self.out_and_small);
        half.load(
            isa,
            jumps,
            |image| image.load(isa, pair.left()),
            |image| image.load(isa, pair.right()),
        );
        lap(Stage::Smoothing);
        half.choose(isa, test, paths);
        lap(Stage::Matching);
        half.map.fill(self.choice.jump);
        if let Some(gaps) = gaps {
            let [left, right] = &half.images;
            gaps.quarter.load(
                isa,
                jumps,
                |image| image.load_half(isa, left),
                |image| image.load_half(isa, right),
            );
            gaps.quarter.choose(isa, test, paths);
            gaps.measure(half);
        }
    }

    /// Decides on the cells of a pair of that size, in raster order.
    fn decide(&mut self, context: &MatchContext, size: (usize, usize), cells: &mut Vec<Cell>) {
        let bins = self.bins();
        let rule = context.cells.for_rig(context.rig.is_some());
        let known = self.tolerance.take();
        let known = known.filter(|(known_rule, rig, _)| *known_rule == rule && *rig == context.rig);
        let (_, _, tolerance) = self.tolerance.insert(known.unwrap_or_else(|| {
            let made = Tolerance::new(rule, context.rig.as_ref(), self.choice.allowance_px, bins);
            (rule, context.rig, made)
        }));
        let shape = context.grid.shape();
        cells.clear();
        cells.resize(shape.cells(), Cell::UNKNOWN);
        let (before, after) = self.past.begin(PairKey::new(context, size), shape.cells());
        let Some(Scratch { half, gaps, .. }) = &self.scratch else {
            return;
        };
        let (images, map) = (&half.images, &half.map);
        if !map.sees() {
            return;
        }
        self.cells
            .resize_with(shape.cells(), || CellPixels::new(bins));
        let rig = context.rig.as_ref();
        let deciding = Deciding {
            choice: &self.choice,
            tolerance,
            rig,
            near_m: context.cells.obstacle_and_clear_m(),
            stamp_ns: context.stamp_ns,
        };
        let decide = |i: usize, cell: &mut Cell, pixels: &mut CellPixels, past: &mut CellPast| {
            let place = (i % shape.columns, i / shape.columns);
            let (columns, rows) = shape.pixels(place, map.size());
            if columns.is_empty() || rows.is_empty() {
                return;
            }
            pixels.clear();
            for y in rows.clone() {
                let (bins, seen, cost) = map.part(y, &columns);
                let texture = images[0].texture(y, &columns);
                match gaps {
                    Some(_) => pixels.measure(seen, cost, texture),
                    None => pixels.add(bins, seen, cost, texture),
                }
            }
            for pixel_votes in gaps.iter().flat_map(|gaps| gaps.votes(&columns, &rows)) {
                pixels.vote(&pixel_votes.bins, &pixel_votes.votes, pixel_votes.agreed);
            }
            pixels.count();
            (*cell, *past) = deciding.cell(pixels, &before[i]);
        };
        let cells = cells.par_iter_mut().zip(&mut self.cells).zip(after);
        cells
            .enumerate()
            .for_each(|(i, ((cell, pixels), past))| decide(i, cell, pixels, past));
    }
}

/// The decision on the cells of a pair.
struct Deciding<'a> {
    choice: &'a SafeChoice,
    tolerance: &'a Tolerance,
    rig: Option<&'a Rig>,
    /// `obstacle_m` and `clear_m` of the rule.
    near_m: (f64, f64),
    stamp_ns: Option<u64>,
}

impl Deciding<'_> {
    /// The cell of those pixels, and its state, from its state before the pair.
    fn cell(&self, pixels: &CellPixels, before: &CellPast) -> (Cell, CellPast) {
        let table = &self.choice.table;
        let evidence = table.evidence(pixels, self.tolerance);
        let own = table.score(&evidence);
        let (mut scores, mut after) = ([own, table.least_score], CellPast::default());
        // A report of 0 has no past, and leaves none.
        if let Some(time) = &table.time
            && evidence.report > 0
        {
            let ends = self.tolerance.ends(evidence.report as usize);
            let relation = before.relation(evidence.report, ends);
            let mut added = time.score(relation, before.trust);
            if self.is_nearer(evidence.report, self.near_m.1) {
                added = added.max(0);
            }
            if relation != Past::None {
                scores = [own + added, time.least_score];
            }
            after = before.after(relation, evidence.report, own, self.stamp_ns);
        }
        let mut cell = table.cell(pixels, &evidence, scores, self.rig);
        if cell.depth.is_none() {
            cell.near = self.near(pixels);
        }
        (cell, after)
    }

    /// The probability that something is nearer than `obstacle_m`, if it is high enough.
    fn near(&self, pixels: &CellPixels) -> Option<f64> {
        let table = self.choice.near.as_ref().filter(|_| self.rig.is_some())?;
        let evidence = table.evidence(pixels, self.tolerance);
        let score = table.score(&evidence);
        let is_near = score >= table.least_score && self.is_nearer(evidence.report, self.near_m.0);
        is_near.then(|| probability(score))
    }

    /// True if a report above 0 is nearer than that; never without a rig.
    fn is_nearer(&self, report: i64, metres: f64) -> bool {
        let px = report as f64 / f64::from(BINS_PER_PX);
        let depth_m = self
            .rig
            .filter(|_| report > 0)
            .and_then(|rig| rig.depth_m(px));
        depth_m.is_some_and(|depth_m| depth_m < metres)
    }
}

/// The model that the parameters select.
fn model(parameters: &Parameters) -> Result<V5Model> {
    let is_fast = parameters.choice("revision") == "2";
    let (path, bytes) = match parameters.file("model") {
        Some(file) if is_fast => {
            return Err(Error::Usage(format!(
                "v5: revision=2 has its own tables, and model={} is for revision 4; leave one out",
                file.path
            )));
        }
        Some(file) => (file.path.as_str(), &file.bytes[..]),
        None if is_fast => ("v5", V5Model::REVISION_2),
        None => ("v5", V5Model::REVISION_4),
    };
    V5Model::from_bytes(bytes).map_err(|why| Error::Usage(format!("{path}: {why}")))
}

/// Decision on cells according to the parameters.
fn safe_choice(parameters: &Parameters) -> Result<SafeChoice> {
    Ok(choice_of(model(parameters)?, parameters))
}

fn choice_of(model: V5Model, parameters: &Parameters) -> SafeChoice {
    let is_median = parameters.choice("target") == "median";
    let has_flags = is_median && parameters.choice("revision") != "2";
    let table = if is_median {
        model.median
    } else {
        model.near.clone()
    };
    SafeChoice {
        table: match parameters.real("confidence") {
            0.0 => table,
            confidence => table.known_from(confidence),
        },
        near: has_flags.then_some(model.near),
        jump: parameters.int("jump"),
        allowance_px: parameters.real("allowance_px"),
        fitted: model.fitted,
    }
}

impl Matcher for V5 {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let (width, height) = pair.size();
        output.disparity.resize(width, height, ExtraPlanes::NONE)?;
        let size = (width / 2, height / 2);
        if size.0 == 0 || size.1 == 0 {
            // The image is too small for a half image.
            self.scratch = None;
            let rows = output.disparity.rows_mut();
            rows.for_each(|mut row| row.clear(Reason::Border));
        } else {
            self.reserve(size, self.gaps.is_some())?;
            self.follow(pair, &mut |stage| output.clock.lap(stage));
            if let Some(Scratch { half, gaps, .. }) = &mut self.scratch {
                if let (Some(gaps), Some(network)) = (gaps, &self.gaps) {
                    gaps.weigh(self.isa, half, network);
                }
                half.map.write(&mut output.disparity);
            }
        }
        let mut cells = output.take_cells();
        self.decide(context, pair.size(), &mut cells);
        output.grid = Some(DepthGrid::new(context.grid.shape(), cells)?);
        output.clock.lap(Stage::Checks);
        Ok(())
    }

    fn has_run_memory(&self) -> bool {
        self.choice.table.time.is_some()
    }

    fn reset(&mut self) {
        self.past = CellPasts::default();
    }
}

impl Scratch {
    fn new(size: (usize, usize), count: usize, has_gaps: bool) -> Result<Self> {
        // Disparities at quarter size, of at least one pixel.
        let has_gaps = has_gaps && size.0 >= 2 && size.1 >= 2;
        Ok(Self {
            size,
            half: MatchLevel::new(size, count, has_gaps)?,
            gaps: if has_gaps {
                Some(Gaps::new(size, (count - 1) / 2 + 1)?)
            } else {
                None
            },
        })
    }
}

/// The pixels that a network for gaps would weigh, with their features: samples to train it.
pub struct GapSampler {
    v5: V5,
}

impl GapSampler {
    /// The pixels of v5 with its defaults.
    ///
    /// # Errors
    /// None: the defaults are valid.
    pub fn new(isa: Isa) -> Result<Self> {
        let v5 = V5::new(&Parameters::defaults(&SPEC), isa)?;
        Ok(Self { v5 })
    }

    /// Shows the pixels of a pair to a function, in blocks: measurements, and the place of each
    /// lane in the half image.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub fn sample(
        &mut self,
        pair: RectifiedPair<'_>,
        take: &mut dyn FnMut(&GapCandidates, &[[usize; 2]]),
    ) -> Result<()> {
        let (width, height) = pair.size();
        let size = (width / 2, height / 2);
        if size.0 < 2 || size.1 < 2 {
            return Ok(());
        }
        self.v5.reserve(size, true)?;
        self.v5.follow(pair, &mut |_| {});
        if let Some(Scratch { half, gaps, .. }) = &mut self.v5.scratch
            && let Some(gaps) = gaps
            && half.map.sees()
        {
            gaps.sample(self.v5.isa, half, take);
        }
        Ok(())
    }
}
