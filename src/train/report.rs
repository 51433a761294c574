//! Results of the training of a filter, for people.

use crate::fit::filter::{
    EpochError, FitSettings, FittedNetwork, FrameLabels, RocCurve, SamplePart, WindowErrors,
    WindowSample, WindowSamples,
};
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};
use svl_core::Result;
use svl_core::filter::ModelFacts;
use svl_core::stereo::hash_words;
use svl_files::encode_png;
use svl_report::page::{PlotView, data_url, fill};
use svl_report::plot::{Axis, Chart, Series, SeriesStyle};
use svl_report::table::{Table, TerminalStyle};

/// A trained filter's figures.
#[derive(Clone, Debug, Serialize)]
pub struct FilterTraining {
    pub filter: &'static str,
    /// The category that it detects, and all else.
    pub categories: [&'static str; 2],
    pub window: usize,
    pub scaling: &'static str,
    pub hidden: usize,
    pub seed: u64,
    pub recordings: usize,
    /// Windows that show it and that do not, by part.
    pub samples: BTreeMap<&'static str, [usize; 2]>,
    /// On the test set.
    pub errors: WindowErrors,
    pub roc: RocCurve,
    /// Mean square errors by epoch.
    pub epochs: Vec<EpochError>,
    pub best_epoch: usize,
    /// True if training was interrupted: the best network so far is kept.
    pub interrupted: bool,
    /// All sizes and seeds that were trained.
    pub trials: Vec<HiddenTrial>,
    /// Hash of features and labels.
    pub data: String,
    #[serde(skip)]
    examples: [Vec<WindowExample>; 2],
}

/// One network of a sweep over the number of hidden neurons.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HiddenTrial {
    pub hidden: usize,
    pub seed: u64,
    /// Least mean square error on the validation set.
    pub validation_error: f64,
    /// On the test set.
    pub errors: WindowErrors,
}

#[derive(Clone, Debug, Serialize)]
struct WindowExample {
    url: String,
    words: String,
}

/// Pictures of each kind of error.
const EXAMPLES: usize = 12;

impl FilterTraining {
    pub(super) fn new(
        samples: &WindowSamples,
        fit: FitSettings,
        fitted: &FittedNetwork,
        trials: Vec<HiddenTrial>,
        test: &[(f32, bool)],
        data: u128,
    ) -> Self {
        let features = samples.features;
        let example = |(sample, score): (&WindowSample, f32)| {
            let png = encode_png(features.window, features.window, &sample.pixels).ok()?;
            let (group, sequence) = (sample.group + 1, sample.sequence);
            let window = FrameLabels::window_name(samples.kind, sample.window);
            Some(WindowExample {
                url: data_url(&png),
                words: format!("recording {group}, frame {sequence}, window {window}: {score:+.1}"),
            })
        };
        let examples = [false, true].map(|is| {
            let worst = samples.worst(test, is, EXAMPLES).into_iter();
            worst.filter_map(example).collect()
        });
        Self {
            filter: samples.kind.name(),
            categories: samples.kind.spec().categories,
            window: features.window,
            scaling: features.scaling.name(),
            hidden: fit.hidden,
            seed: fit.seed,
            recordings: samples.parts.len(),
            samples: samples.counts(),
            errors: WindowErrors::new(test, 0.0),
            roc: RocCurve::new(test, samples.kind.spec().acceptance_cost),
            epochs: fitted.epochs.clone(),
            best_epoch: fitted.best_epoch,
            interrupted: fitted.interrupted,
            trials,
            data: hash_words(data),
            examples,
        }
    }

    /// Facts in the model's file.
    pub(super) fn facts(&self) -> ModelFacts {
        let share = |rate: f64| format!("{rate:.5}");
        [
            ("svl", svl_files::BuildInfo::current().version.to_owned()),
            ("data_hash", self.data.clone()),
            ("seed", self.seed.to_string()),
            ("recordings", self.recordings.to_string()),
            ("false_acceptance", share(self.errors.false_acceptance.rate)),
            ("false_rejection", share(self.errors.false_rejection.rate)),
            ("roc_area", share(self.roc.area)),
        ]
        .map(|(key, text)| (key.to_owned(), text))
        .into()
    }

    /// Mean error rates in per cent by the number of hidden neurons: false acceptance, false
    /// rejection.
    pub fn by_hidden(&self) -> BTreeMap<usize, [f64; 2]> {
        let mut by_hidden = BTreeMap::<usize, Vec<WindowErrors>>::new();
        for trial in &self.trials {
            by_hidden
                .entry(trial.hidden)
                .or_default()
                .push(trial.errors);
        }
        let mean = |errors: &[WindowErrors], error: fn(&WindowErrors) -> f64| {
            100.0 * errors.iter().map(error).sum::<f64>() / errors.len() as f64
        };
        let means = |(hidden, errors): (usize, Vec<WindowErrors>)| {
            let accepted = mean(&errors, |e| e.false_acceptance.rate);
            (
                hidden,
                [accepted, mean(&errors, |e| e.false_rejection.rate)],
            )
        };
        by_hidden.into_iter().map(means).collect()
    }

    /// The plots: training and validation error (thesis, figure 8.2), the receiver operating
    /// characteristic, and error rates by hidden neurons (figure 8.3) where several were tried.
    pub fn charts(&self) -> Vec<(&'static str, &'static str, Chart)> {
        let epochs = |name: &str, error: fn(&EpochError) -> f64| {
            let epochs = self.epochs.iter().enumerate();
            let points = epochs.map(|(i, e)| (i as f64 + 1.0, error(e)));
            Series::new(name, SeriesStyle::Line, points)
        };
        // The corner of a good curve that matters.
        let corner = |axis: Axis, range| Axis {
            range: (self.roc.area > 0.98).then_some(range),
            ..axis
        };
        let accepted = self.roc.points.iter().map(|(x, y)| (100.0 * x, 100.0 * y));
        let mut charts = vec![
            (
                "Training and validation",
                "Mean square error after each epoch; the network of the epoch with the least \
                 validation loss is kept (thesis, figure 8.2).",
                Chart::untitled(
                    Axis::new("epoch"),
                    Axis::new("mean square error"),
                    [
                        epochs("training", |e| e.training),
                        epochs("validation", |e| e.validation),
                    ],
                ),
            ),
            (
                "Acceptance",
                "Over all thresholds, on the test set: windows accepted rightly and falsely.",
                Chart::untitled(
                    corner(Axis::share("false acceptance, %"), (0.0, 20.0)),
                    corner(Axis::share("true acceptance, %"), (80.0, 100.0)),
                    [Series::new("test", SeriesStyle::Line, accepted)],
                ),
            ),
        ];
        let by_hidden = self.by_hidden();
        if by_hidden.len() > 1 {
            let errors = |name: &str, i: usize| {
                let points = by_hidden.iter().map(|(h, e)| (*h as f64, e[i]));
                Series::new(name, SeriesStyle::Both, points)
            };
            charts.push((
                "Hidden neurons",
                "Errors on the test set by the number of hidden neurons, means over the seeds \
                 (thesis, figure 8.3).",
                Chart::untitled(
                    Axis::new("hidden neurons"),
                    Axis::new("error rate, %"),
                    [errors("false rejected", 1), errors("false accepted", 0)],
                ),
            ));
        }
        charts
    }

    /// The page: one file without scripts, all texts escaped.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the template engine or of the plotting
    /// library.
    pub fn page(&self, identity: Vec<(String, String)>) -> Result<String> {
        let charts = self.charts().into_iter();
        let charts = charts.filter_map(|(title, about, chart)| {
            let chart = chart.if_any()?;
            Some(PlotView::new(title, about, chart.svg()))
        });
        let view = json!({
            "training": self,
            "false_acceptance": self.errors.false_acceptance.to_string(),
            "false_rejection": self.errors.false_rejection.to_string(),
            "area": format!("{:.4}", self.roc.area),
            "examples": self.examples,
            "charts": charts.collect::<Vec<_>>(),
            "images": [],
            "identity": identity,
            "incomplete": null,
        });
        fill(include_str!("filter.html"), "", &[], view)
    }
}

impl Display for FilterTraining {
    /// Lines of at most 80 columns.
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let [is, is_not] = self.categories;
        let (filter, hidden) = (&self.filter, self.hidden);
        let (window, scaling) = (&self.window, &self.scaling);
        writeln!(
            f,
            "filter {filter}: {hidden} hidden neurons, windows of {window}, {scaling}"
        )?;
        let parts = SamplePart::deal(self.recordings);
        for part in SamplePart::ALL {
            let name = part.name();
            let [yes, no] = self.samples[name];
            let recordings = parts.iter().filter(|own| **own == part).count();
            let recordings = svl_core::counted(recordings as u64, "recording");
            writeln!(f, "{name:<18}{recordings}: {yes} {is}, {no} {is_not}")?;
        }
        let ended = if self.interrupted {
            ", interrupted"
        } else {
            ""
        };
        let (best, epochs) = (self.best_epoch, self.epochs.len());
        writeln!(f, "best epoch        {best} of {epochs}{ended}")?;
        writeln!(f, "false acceptance  {}", self.errors.false_acceptance)?;
        writeln!(f, "false rejection   {}", self.errors.false_rejection)?;
        write!(f, "area of the ROC   {:.4}", self.roc.area)?;
        let by_hidden = self.by_hidden();
        if by_hidden.len() > 1 {
            let heads = ["false accepted, %", "false rejected, %"];
            let mut table = Table::new("", "hidden neurons").with_columns(heads);
            for (hidden, errors) in by_hidden {
                table.push(
                    hidden.to_string(),
                    errors.map(|error| format!("{error:.2}")),
                );
            }
            let table = table.terminal(TerminalStyle::plain(80));
            write!(f, "\n\n{}", table.trim_end())?;
        }
        Ok(())
    }
}
