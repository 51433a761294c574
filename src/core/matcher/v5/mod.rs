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
mod sums;

use super::{MatchContext, MatchOutput, Matcher, MatcherSpec, Parameter, Parameters, Range};
use crate::depth::decision::{CellPixels, Decision, Feature, SafeChoice, Tolerance, VerdictTable};
use crate::error::{Error, Result};
use crate::kernel::{GapCandidates, GapNetwork, Isa, STEPS, WinnerTest};
use crate::stereo::{Cell, CellRule, DepthGrid, ExtraPlanes, FittedTo, Reason, RectifiedPair, Rig};
use crate::timing::Stage;
use gaps::Gaps;
use level::MatchLevel;
use rayon::prelude::*;
use std::borrow::Cow;

pub use gaps::GapModel;

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v5",
    aliases: &[],
    summary: "svl's own: cells that are safe to report, from semi-global matching at half size; \
              with the probability that each is right",
    about: "v5 estimates the distance of a cell of the depth grid, not the disparity of a pixel. \
            1. Both images are halved by a low-pass, which averages noise and halves a \
            misalignment. 2. The census of 5x5 pixels and semi-global matching along four paths \
            give each pixel a disparity; what leads out of the image costs less than a random \
            match. 3. A pixel is seen when it is unique, the right image agrees, and most of its \
            neighbours are seen, too. 4. Gaps between seen pixels belong to the farther surface, \
            as occluded pixels do. 5. A cell reports the disparity that stays right, by the rule \
            of the scenario, whatever its uncertain pixels are: the one whose tolerance leaves \
            the least of the cell on either side. 6. That margin, how much was seen and supports \
            the report, matching costs and texture become the probability that the report is \
            right; below `confidence` the cell is unknown. docs/v5.md shows it.",
    paper: "svl, docs/v5.md; after Hirschmüller, Stereo Processing by Semiglobal Matching and \
            Mutual Information, PAMI 30(2), 2008",
    parameters: &[
        Parameter {
            name: "revision",
            unit: "",
            range: Range::int(2, 1..=3),
            description: "of the algorithm; results of a revision never change",
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
            name: "slack",
            unit: "‰",
            range: Range::int(10, 0..=500),
            description: "of nearly equally safe disparities the one nearest to the median",
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
            name: "table",
            unit: "",
            range: Range::File,
            description: "steps of the probability, of `svl train cells`, in place of the target's",
        },
        Parameter {
            name: "gaps",
            unit: "",
            range: Range::File,
            description: "network that weighs disparities for gaps, of `svl train gaps`, in place \
                          of revision 3's",
        },
        Parameter {
            name: "rank",
            unit: "%",
            range: Range::int(0, 0..=99),
            description: "percentile of the cell's disparities that is reported, 0 = the \
                          target's: 50, near 75",
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
            description: "least probability of a cell that is reported, 0 = the revision's: 0.75, \
                          0.85, 0.9",
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
    /// True if a cell must have the grid's least fraction of seen pixels to be known. From revision
    /// 2 on the probability alone decides; that fraction is among its evidence.
    needs_valid: bool,
    gaps: Option<GapNetwork>,
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
            choice: safe_choice(parameters)?,
            needs_valid: parameters.int("revision") == 1,
            gaps: gap_network(parameters)?,
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
    fn reserve(&mut self, size: (usize, usize), make: impl FnOnce() -> Scratch) {
        // Freed before the new memory is allocated, so that both sizes are never held at once.
        self.scratch.take_if(|scratch| scratch.size != size);
        self.scratch.get_or_insert_with(make);
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

    /// Decides on the cells of the half image, in raster order.
    fn decide(&mut self, context: &MatchContext, cells: &mut Vec<Cell>) {
        let bins = self.bins();
        let rule = context.cells.for_rig(context.rig.is_some());
        let known = self.tolerance.take();
        let known = known.filter(|(of, rig, _)| *of == rule && *rig == context.rig);
        let (_, _, tolerance) = self.tolerance.insert(known.unwrap_or_else(|| {
            let made = Tolerance::new(rule, context.rig.as_ref(), self.choice.allowance_px, bins);
            (rule, context.rig, made)
        }));
        let shape = context.grid.shape();
        let unknown = Cell {
            valid_share: 0.0,
            depth: None,
            probability: None,
            evidence: None,
            too_close: false,
        };
        cells.clear();
        cells.resize(shape.cells(), unknown);
        let Some(Scratch { half, gaps, .. }) = &self.scratch else {
            return;
        };
        let (images, map) = (&half.images, &half.map);
        if !map.sees() {
            return;
        }
        self.cells
            .resize_with(shape.cells(), || CellPixels::new(bins));
        let min_valid = if self.needs_valid {
            context.grid.min_valid
        } else {
            0.0
        };
        let decide = |(i, (cell, pixels)): (usize, (&mut Cell, &mut CellPixels))| {
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
            for of in gaps.iter().flat_map(|gaps| gaps.votes(&columns, &rows)) {
                pixels.vote(&of.bins, &of.votes, of.agreed);
            }
            let evidence = self.choice.decision.evidence(pixels, tolerance);
            let rig = context.rig.as_ref();
            *cell = self.choice.decision.cell(pixels, &evidence, min_valid, rig);
        };
        let cells = cells.par_iter_mut().zip(&mut self.cells);
        cells.enumerate().for_each(decide);
    }
}

/// The runs that the built-in network was fitted to (docs/results/v5.md, "Learned gaps").
const REVISION_3: FittedTo = FittedTo::built_in(&[
    Cow::Borrowed("arena seed 101..110"),
    Cow::Borrowed("arena-training seed 101..110"),
    Cow::Borrowed("worlds-training seed 1..40"),
    Cow::Borrowed("shapes-training seed 1..40"),
]);

/// The network for gaps that the parameters select, in the bytes of its file.
struct NetworkFile<'a> {
    /// The setting that selects it.
    named: &'a str,
    bytes: &'a [u8],
}

impl<'a> NetworkFile<'a> {
    fn of(parameters: &'a Parameters) -> Option<Self> {
        match (parameters.file("gaps"), parameters.int("revision")) {
            (Some(file), _) => Some(Self {
                named: "gaps=",
                bytes: &file.bytes,
            }),
            (None, 3) => Some(Self {
                named: "revision=3",
                bytes: GapModel::REVISION_3,
            }),
            (None, _) => None,
        }
    }

    /// The runs that it was fitted to.
    ///
    /// # Errors
    /// The fault in its file.
    fn fitted(&self) -> std::result::Result<FittedTo, String> {
        if self.bytes.as_ptr() == GapModel::REVISION_3.as_ptr() {
            return Ok(REVISION_3);
        }
        FittedTo::of_facts(&GapModel::from_bytes(self.bytes)?.facts)
    }

    /// Identifies it in the tables that were fitted with it.
    fn hash(&self) -> String {
        format!("{:016x}", xxhash_rust::xxh3::xxh3_64(self.bytes))
    }
}

/// The network for gaps that the parameters select.
fn gap_network(parameters: &Parameters) -> Result<Option<GapNetwork>> {
    let Some(NetworkFile { bytes, .. }) = NetworkFile::of(parameters) else {
        return Ok(None);
    };
    let model = GapModel::from_bytes(bytes).map_err(|why| {
        let path = parameters.file("gaps").map_or("v5", |file| &file.path);
        Error::Usage(format!("{path}: {why}"))
    })?;
    Ok(Some(model.network()))
}

/// Decision on cells according to the parameters.
fn safe_choice(parameters: &Parameters) -> Result<SafeChoice> {
    let table = table(parameters)?;
    let needs_gaps =
        |feature: &Feature| feature.needs_gaps() && !table.steps[*feature as usize].is_empty();
    let network = NetworkFile::of(parameters);
    if let (Some(file), None) = (parameters.file("table"), &network)
        && let Some(feature) = Feature::ALL.iter().find(|feature| needs_gaps(feature))
    {
        return Err(Error::Usage(format!(
            "{}: has steps of '{}', which only gaps=FILE measures: name the network too, or train \
             a table without",
            file.path,
            feature.name()
        )));
    }
    let hash = network.as_ref().map(NetworkFile::hash);
    if let Some(file) = parameters.file("table")
        && table.network.as_deref() != hash.as_deref()
    {
        let fitted = match &table.network {
            Some(hash) => format!("was fitted with the network of hash {hash}"),
            None => "was fitted without a network".to_owned(),
        };
        let given = match &network {
            Some(of) => format!("{} has hash {}", of.named, of.hash()),
            None => "gaps= is not given".to_owned(),
        };
        return Err(Error::Usage(format!(
            "{}: {fitted}, and {given}: give both as they were, or train a table anew",
            file.path
        )));
    }
    let fitted_network = network.as_ref().map(|network| {
        let fitted = network.fitted();
        fitted.map_err(|why| Error::Usage(format!("{}: {why}", network.named)))
    });
    let fitted = [Some(table.fitted.clone()), fitted_network.transpose()?];
    let rank = match parameters.int("rank") {
        0 => table.rank,
        rank => i64::from(rank),
    };
    let confidence = match (parameters.real("confidence"), parameters.int("revision")) {
        (0.0, 1) => 0.75,
        (0.0, 2) => 0.85,
        (0.0, _) => 0.9,
        (confidence, _) => confidence,
    };
    Ok(SafeChoice {
        decision: Decision {
            rank,
            slack: i64::from(parameters.int("slack")),
            least_score: Decision::least_score(confidence),
            table,
        },
        jump: parameters.int("jump"),
        allowance_px: parameters.real("allowance_px"),
        network: hash,
        fitted: fitted.into_iter().flatten().collect(),
    })
}

/// The probability steps that the parameters select.
fn table(parameters: &Parameters) -> Result<VerdictTable> {
    let target = parameters.choice("target");
    if let Some(file) = parameters.file("table") {
        if target != "median" {
            return Err(Error::Usage(format!(
                "v5: target={target} and table={}: a table is for the target it was made for; \
                 leave one out",
                file.path
            )));
        }
        let text = std::str::from_utf8(&file.bytes);
        let text = text.map_err(|_| "is not a text; `svl train cells` makes a table".to_owned());
        let table = text.and_then(VerdictTable::parse);
        return table.map_err(|why| Error::Usage(format!("{}: {why}", file.path)));
    }
    Ok(match (target, parameters.int("revision")) {
        ("near", 1) => VerdictTable::NEAR,
        ("near", 2) => VerdictTable::NEAR_2,
        ("near", _) => VerdictTable::NEAR_3,
        (_, 1) => VerdictTable::MEDIAN,
        (_, 2) => VerdictTable::MEDIAN_2,
        _ => VerdictTable::MEDIAN_3,
    })
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
            let (count, has_gaps) = (self.count, self.gaps.is_some());
            self.reserve(size, || Scratch::new(size, count, has_gaps));
            self.follow(pair, &mut |stage| output.clock.lap(stage));
            if let Some(Scratch { half, gaps, .. }) = &mut self.scratch {
                if let (Some(gaps), Some(network)) = (gaps, &self.gaps) {
                    gaps.weigh(self.isa, half, network);
                }
                half.map.write(&mut output.disparity);
            }
        }
        let mut cells = output.take_cells();
        self.decide(context, &mut cells);
        output.grid = Some(DepthGrid::new(context.grid.shape(), cells)?);
        output.clock.lap(Stage::Checks);
        Ok(())
    }
}

impl Scratch {
    fn new(size: (usize, usize), count: usize, has_gaps: bool) -> Self {
        // Disparities at quarter size, of at least one pixel.
        let has_gaps = has_gaps && size.0 >= 2 && size.1 >= 2;
        Self {
            size,
            half: MatchLevel::new(size, count, has_gaps),
            gaps: has_gaps.then(|| Gaps::new(size, (count - 1) / 2 + 1)),
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
    pub fn sample(
        &mut self,
        pair: RectifiedPair<'_>,
        take: &mut dyn FnMut(&GapCandidates, &[[usize; 2]]),
    ) {
        let (width, height) = pair.size();
        let (size, count) = ((width / 2, height / 2), self.v5.count);
        if size.0 < 2 || size.1 < 2 {
            return;
        }
        self.v5.reserve(size, || Scratch::new(size, count, true));
        self.v5.follow(pair, &mut |_| {});
        if let Some(Scratch { half, gaps, .. }) = &mut self.v5.scratch
            && let Some(gaps) = gaps
            && half.map.sees()
        {
            gaps.sample(self.v5.isa, half, take);
        }
    }
}
