//! Training of v5's model as a whole: the network of its gaps, and its tables.

use super::cells::CellTraining;
use super::gaps::{GapTraining, LearnedGaps, LearnedNetwork};
use super::learned_cells::{CellAlgorithms, LearnedCells, TableRole, TrainingPart};
use crate::fit::{CellSample, GapSettings, TimeFigures, fit_time};
use serde::Serialize;
use std::path::PathBuf;
use svl_bench::console::{Console, Unit};
use svl_core::depth::decision::{TimeTable, probability};
use svl_core::filter::ModelFacts;
use svl_core::matcher::V5Model;
use svl_core::{Error, Result, counted, interrupt};
use svl_report::table::TerminalStyle;
use svl_score::notice::Notice;
use svl_score::scenario::Scenario;

/// A scenario in its file.
pub struct TrainingScenario {
    pub path: PathBuf,
    pub scenario: Scenario,
    /// True if it is no part of the fit, only of the figures.
    pub tested: bool,
}

/// A trained model with its figures.
pub struct TrainedV5 {
    pub model: V5Model,
    pub training: V5Training,
}

/// Figures of a training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct V5Training {
    /// Absent if the network was kept.
    pub network: Option<GapTraining>,
    /// The fitted tables; others are kept.
    pub tables: Vec<CellTraining>,
    /// Absent if the table was kept.
    pub near: Option<NearTraining>,
    /// Absent if no cell has an earlier report.
    pub time: Option<TimeFigures>,
}

/// Figures of the table for the nearest quarter, of held-out cells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NearTraining {
    pub cells: usize,
    /// Least probability of a cell with something near.
    pub confidence: f64,
    /// Fraction of the cells that reach it, and fraction of these that is right.
    pub known: f64,
    pub right: f64,
}

/// Log odds, thousandths, that reports of one of several sizes lose: the first that is sure
/// decides, so each is another chance to be wrong.
const SEVERAL_CHANCES: [(TableRole, i64); 3] = [
    (TableRole::Finest, 650),
    (TableRole::Middle, 1800),
    (TableRole::Coarsest, 700),
];

/// Fewest cells of either kind that are worth a fit.
const MIN_CELLS: usize = 20;

/// Trains a model: least scores and slack are those of `base`, and its network is kept unless
/// `settings` train another. `with`: v5 with the model in a file.
///
/// # Errors
/// The errors of the runs; [`Error::Invalid`] for too few cells or runs, [`Error::Interrupted`].
pub fn train_v5(
    scenarios: Vec<TrainingScenario>,
    base: V5Model,
    settings: Option<GapSettings>,
    with: &dyn Fn(&V5Model) -> Result<CellAlgorithms>,
    console: &dyn Console,
) -> Result<TrainedV5> {
    let network = settings
        .map(|settings| learn_network(&scenarios, settings, console))
        .transpose()?;
    let mut model = base;
    // A model without a table for nearer surfaces gets one of small cells alone.
    let present = model.near_small.clone();
    model.near_small = present.clone().or_else(|| V5Model::built_in().near_small);
    // The tables are fitted to pairs alone.
    let time = model.median.time.take();
    let least = time.as_ref().map(|time| time.least_score);
    let least_with_past = least.unwrap_or(model.median.least_score);
    model.facts = ModelFacts::from([("svl".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]);
    let share = match &network {
        Some(network) => {
            model.network = Some(network.weights.clone());
            model.fitted = network.fitted.clone();
            model.facts.extend(network.facts.clone());
            TrainingPart::Tables
        }
        None => TrainingPart::All,
    };
    let algorithms = with(&model)?;
    let mut learned = LearnedCells::default();
    for scenario in scenarios {
        let (path, tested) = (&scenario.path, scenario.tested);
        let share = if tested { TrainingPart::All } else { share };
        let shares = (share, tested);
        learned.learn(scenario.scenario, path, &algorithms, shares, console)?;
    }
    let bar = console.bar("fit", Unit::Pairs, None);
    let step = || {
        bar.step();
        !interrupt::requested()
    };
    let tables = fit_tables(&learned, &mut model, step)?;
    let near = learned.fit_near(&model.near, step);
    let near = near.ok_or(Error::Interrupted)?;
    drop(bar);
    let least = model.near.least_score;
    let near = near.map(|(fit, samples)| {
        model.near = fit.table;
        NearTraining::new(samples, &fit.held_out, least)
    });
    model.fitted = model.fitted.and(&learned.fitted_to());
    let single = tables.iter().any(|table| table.table == TableRole::Single);
    let fit = single.then(|| fit_time(&learned.runs, &model.median, least_with_past));
    let fit = fit.flatten();
    // Cells with a past are held to more only if it says something.
    let is_empty = |table: &TimeTable| {
        let steps = [&table.agrees, &table.farther, &table.nearer];
        steps.iter().all(|steps| steps.0.is_empty())
    };
    let own = fit.as_ref().map(|fit| fit.table.clone());
    model.median.time = if single {
        own.filter(|table| !is_empty(table))
    } else {
        time
    };
    complete_levels(&mut model, &tables);
    if tables
        .iter()
        .all(|table| table.table != TableRole::NearSmall)
    {
        model.near_small = present;
    }
    Ok(TrainedV5 {
        training: V5Training {
            network: network.map(|network| network.training),
            tables,
            near,
            time: fit.map(|fit| fit.figures),
        },
        model,
    })
}

/// Fits the tables that have cells; others are kept, with a warning if they have too few.
///
/// # Errors
/// [`Error::Invalid`] if no table can be fitted; [`Error::Interrupted`].
fn fit_tables(
    learned: &LearnedCells,
    model: &mut V5Model,
    step: impl Fn() -> bool + Sync + Copy,
) -> Result<Vec<CellTraining>> {
    let (mut tables, mut refused) = (Vec::new(), Vec::new());
    for role in TableRole::ALL {
        let samples = learned.samples(role, model);
        let fitted = &samples.samples[..samples.fitted()];
        if fitted.is_empty() {
            continue;
        }
        if let Err(why) = check(fitted) {
            refused.push((role, why));
            continue;
        }
        let present = role.table(model).clone();
        let fit = samples.fit(&present, step).ok_or(Error::Interrupted)?;
        tables.push(CellTraining::new(role, &present, &samples, &fit));
        *role.table_mut(model) = fit.table;
    }
    if tables.is_empty() {
        let first = refused.into_iter().next().map(|(_, why)| why);
        let none = || Error::Invalid("no cell has a truth and a report".to_owned());
        return Err(first.unwrap_or_else(none));
    }
    for (role, why) in refused {
        let text = format!("the table for {} is kept: {why}", role.words());
        Notice::new([], text).warn();
    }
    Ok(tables)
}

/// Completes the tables of several sizes: earlier reports count as at one size, and each of those
/// that were fitted is one of several chances.
fn complete_levels(model: &mut V5Model, fitted: &[CellTraining]) {
    let is_fitted = |role| fitted.iter().any(|table| table.table == role);
    for (role, lost) in SEVERAL_CHANCES {
        role.table_mut(model).base -= if is_fitted(role) { lost } else { 0 };
    }
    let time = model.median.time.clone();
    let levels = &mut model.levels;
    for table in [
        &mut levels.finest,
        &mut levels.middle,
        &mut levels.coarsest,
        &mut levels.small,
    ] {
        table.time = time.clone().map(|time| TimeTable {
            least_score: table.least_score,
            ..time
        });
    }
}

fn learn_network(
    scenarios: &[TrainingScenario],
    settings: GapSettings,
    console: &dyn Console,
) -> Result<LearnedNetwork> {
    let mut learned = LearnedGaps::default();
    for scenario in scenarios.iter().filter(|scenario| !scenario.tested) {
        learned.learn(&scenario.scenario, TrainingPart::Network, console)?;
    }
    let network = learned.train(settings, console)?;
    if network.training.interrupted {
        return Err(Error::Interrupted);
    }
    Ok(network)
}

/// # Errors
/// [`Error::Invalid`] for cells that no table can be fitted to.
fn check(samples: &[CellSample]) -> Result<()> {
    let count = |right: bool| {
        let reportable = samples.iter().filter(|sample| sample.is_reportable());
        reportable.filter(|sample| sample.right == right).count()
    };
    let [right, wrong] = [true, false].map(count);
    if right.min(wrong) < MIN_CELLS {
        return Err(Error::Invalid(format!(
            "{right} right and {wrong} wrong cells are too few, at least {MIN_CELLS} of each; take \
             more runs, scenes or scenarios"
        )));
    }
    let first = samples[0].group;
    if samples.iter().all(|sample| sample.group == first) {
        let cure = "take more seeds, scenes or recordings";
        let message = format!("one run cannot be held out of itself; {cure}");
        return Err(Error::Invalid(message));
    }
    Ok(())
}

impl NearTraining {
    fn new(samples: &[CellSample], held_out: &[i64], least_score: i64) -> Self {
        let scored = samples.iter().zip(held_out);
        let known =
            scored.filter(|(sample, score)| sample.is_reportable() && **score >= least_score);
        let known: Vec<_> = known.collect();
        let right = known.iter().filter(|(sample, _)| sample.right).count();
        Self {
            cells: samples.len(),
            confidence: probability(least_score),
            known: known.len() as f64 / samples.len().max(1) as f64,
            right: right as f64 / known.len().max(1) as f64,
        }
    }
}

impl V5Training {
    /// The figures for people.
    pub fn terminal(&self, style: TerminalStyle) -> String {
        let network = self.network.as_ref();
        let network = network.map_or_else(String::new, |network| format!("{network}\n\n"));
        let tables = self.tables.iter().map(|table| table.terminal(style));
        let tables = tables.collect::<Vec<_>>().join("\n");
        let near = self.near.as_ref().map_or_else(String::new, |near| {
            let (known, right) = (100.0 * near.known, 100.0 * near.right);
            let (cells, least) = (counted(near.cells as u64, "cell"), near.confidence);
            format!(
                "\nnearest quarter, held out: {known:.1} % of {cells} from {least:.2} on;\n\
                 {right:.2} % of them right"
            )
        });
        let time = match &self.time {
            None => "the table of earlier reports is kept".to_owned(),
            Some(time) => {
                let [agrees, farther, nearer] = time.relations;
                let cells = counted(time.cells as u64, "cell");
                let (loss, alone) = (time.loss, time.loss_alone);
                format!(
                    "earlier reports of {cells}: {agrees} agree, {farther} farther,\n{nearer} \
                     nearer; held-out loss {loss:.4} for {alone:.4}"
                )
            }
        };
        format!("{network}{tables}{near}\n{time}")
    }
}
