//! v5: svl's own algorithm, which decides on cells instead of pixels.
//!
//! It estimates the distance of each cell of the depth grid, and decides whether to report it.
//! SGM (Hirschmüller 2008) of small censuses at half size along four paths; then gaps are filled
//! like occluded surfaces, and each cell reports a value that is right whatever the disparities of
//! its uncertain pixels ([`crate::depth::decision`]).

mod census;
mod decide;
mod gaps;
mod half_map;
mod level;
mod levels;
mod model;
mod past;
mod sums;

use super::{
    MatchContext, MatchOutput, Matcher, MatcherKind, MatcherSpec, Parameter, Parameters, Range,
};
use crate::depth::decision::{LevelTables, SafeChoice, VerdictTable};
use crate::error::{Error, Result};
use crate::kernel::{GapCandidates, GapNetwork, Isa, WinnerTest};
use crate::stereo::{
    Cell, DepthGrid, ExtraPlanes, GridShape, LevelCell, LevelVerdict, Reason, RectifiedPair,
};
use crate::timing::Stage;
use decide::OutsideFit;
use level::MatchSettings;
use levels::{LevelPlan, Levels};
use past::CellPasts;

pub use levels::has_small_cells;
pub use model::{GapWeights, V5Fault, V5Model};

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
            name: "max_disparity",
            unit: "px",
            range: Range::int(80, 0..=255),
            description: "largest disparity at full size; what is nearer is found at half the size",
        },
        Parameter {
            name: "width",
            unit: "px",
            range: Range::int(0, 0..=65_535),
            description: "wider sizes of the image are not matched, 0 = all are; for speed",
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
            description: "least probability of a cell that is reported, 0 = the model's: 0.9; \
                          up to 400 px of width 0.93 with earlier reports, 0.82 below 2 m; \
                          in wider images 0.82 from 0.5 to 2 m",
        },
    ],
    cells: Some(safe_choice),
    build: |parameters, isa| Ok(Box::new(V5::new(parameters, isa)?)),
};

struct V5 {
    settings: MatchSettings,
    max_disparity: usize,
    /// Widest size that is matched.
    width: usize,
    choice: SafeChoice,
    network: Option<GapNetwork>,
    /// Memory for pairs of one size; none for one that cannot be halved.
    levels: Option<Levels>,
    /// What of the last pair was outside of the fit.
    outside_fit: OutsideFit,
    /// Cells so far, and those whose tolerance is finer than a pixel can tell.
    cells: u64,
    too_fine: u64,
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
        let model = model(parameters)?;
        Ok(Self {
            settings: MatchSettings {
                isa,
                out_and_small: [out, p1],
                jumps: std::array::from_fn(|difference| {
                    p1.max((i32::from(p2) * edge / edge.max(difference as i32)) as u8)
                }),
                test: WinnerTest {
                    unique: parameters.int("unique") as u32,
                    out,
                },
                jump: parameters.int("jump"),
            },
            max_disparity: parameters.int("max_disparity") as usize,
            width: parameters.int("width") as usize,
            network: model.network.as_ref().map(GapWeights::network),
            choice: choice_of(model, parameters),
            levels: None,
            cells: 0,
            outside_fit: OutsideFit::default(),
            too_fine: 0,
        })
    }

    fn plan(&self, size: (usize, usize), cells: usize) -> LevelPlan {
        LevelPlan {
            size,
            cells,
            max_disparity: self.max_disparity,
            width: self.width,
            halves: self.choice.levels.is_some(),
            has_gaps: self.network.is_some(),
        }
    }

    /// Memory for pairs of `size`, at least 2 x 2, and that many cells.
    fn reserve(&mut self, size: (usize, usize), cells: usize) -> Result<()> {
        let plan = self.plan(size, cells);
        // Freed before the new memory is allocated, so that both sizes are never held at once.
        self.levels.take_if(|levels| levels.plan != plan);
        if self.levels.is_none() {
            self.levels = Some(Levels::new(plan)?);
        }
        Ok(())
    }
}

/// The model that the parameters select.
fn model(parameters: &Parameters) -> Result<V5Model> {
    let (path, bytes) = match parameters.file("model") {
        Some(file) => (file.path.as_str(), &file.bytes[..]),
        None => ("v5", V5Model::BUILT_IN),
    };
    V5Model::from_bytes(bytes).map_err(|why| Error::Usage(format!("{path}: {why}")))
}

/// Decision on cells according to the parameters.
fn safe_choice(parameters: &Parameters) -> Result<SafeChoice> {
    Ok(choice_of(model(parameters)?, parameters))
}

fn choice_of(model: V5Model, parameters: &Parameters) -> SafeChoice {
    let known = |table: VerdictTable| match parameters.real("confidence") {
        0.0 => table,
        confidence => table.known_from(confidence),
    };
    let (table, levels, near, near_small) = if parameters.choice("target") == "median" {
        let levels = LevelTables {
            finest: known(model.levels.finest),
            middle: known(model.levels.middle),
            coarsest: known(model.levels.coarsest),
            small: known(model.levels.small),
        };
        let levels = Some(Box::new(levels));
        (model.median, levels, Some(model.near), model.near_small)
    } else {
        (model.near, None, None, None)
    };
    SafeChoice {
        table: known(table),
        levels,
        near,
        near_small,
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
        let shape = context.grid.shape();
        let (mut cells, mut decisions) = output.take_cells();
        cells.clear();
        cells.resize(shape.cells(), Cell::UNKNOWN);
        decisions.clear();
        if width < 2 || height < 2 {
            // The image is too small for a half image.
            self.levels = None;
            let rows = output.disparity.rows_mut();
            rows.for_each(|mut row| row.clear(Reason::Border));
        } else {
            self.reserve((width, height), shape.cells())?;
            if let Some(levels) = &mut self.levels {
                let settings = &self.settings;
                levels.follow(settings, pair, &mut |stage| output.clock.lap(stage));
                if let Some(network) = &self.network {
                    levels.weigh(settings.isa, network);
                }
                levels.write(&mut output.disparity);
                self.outside_fit = levels.decide(&self.choice, context, &mut cells, &mut decisions);
                let is_unknown = |decision: &&LevelCell| {
                    decision.level == 0 && decision.verdict == LevelVerdict::Span
                };
                let too_fine = decisions.iter().filter(is_unknown).count();
                self.cells += cells.len() as u64;
                self.too_fine += too_fine as u64;
            }
        }
        output.grid = Some(DepthGrid::new(shape, cells)?.with_levels(decisions));
        output.clock.lap(Stage::Checks);
        Ok(())
    }

    fn has_run_memory(&self) -> bool {
        self.choice.table.time.is_some()
    }

    fn range_px(&self, size: (usize, usize), cells: usize) -> Option<i32> {
        Some(self.plan(size, cells).range_px() as i32)
    }

    fn remark(&self) -> Option<String> {
        let outside = self.outside_fit.words();
        let outside = (!outside.is_empty()).then(|| {
            let outside = outside.join(" and ");
            format!("v5's probabilities were not fitted to {outside}, which this run has")
        });
        let too_fine = (self.too_fine > 0).then(|| {
            let share = 100.0 * self.too_fine as f64 / self.cells as f64;
            format!(
                "v5: {share:.1} % of the cells are unknown as their tolerance is finer than a \
                 pixel can tell"
            )
        });
        let parts: Vec<_> = outside.into_iter().chain(too_fine).collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    fn reset(&mut self) {
        if let Some(levels) = &mut self.levels {
            levels.past = CellPasts::default();
        }
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
        if width < 4 || height < 4 {
            return Ok(());
        }
        let isa = self.v5.settings.isa;
        self.v5.reserve(pair.size(), GridShape::default().cells())?;
        if let Some(levels) = &mut self.v5.levels {
            levels.follow(&self.v5.settings, pair, &mut |_| {});
            if let Some((matched, gaps)) = levels.finest_gaps()
                && matched[0].map.sees
            {
                gaps.sample(isa, matched, take);
            }
        }
        Ok(())
    }
}
