//! The colours of swept algorithms: by the value of their first parameter.

use super::figures::ReportPage;
use crate::pages::html::figures::ParameterSweep;
use crate::show::page::parts::css_color;
use crate::show::plot::series::AlgorithmColors;
use serde::Serialize;
use std::collections::BTreeSet;
use svl_files::overlay::parameter_color;
use svl_score::manifest::AlgorithmRecord;

/// The first swept parameter of a kind of algorithms.
#[derive(Serialize)]
pub(crate) struct ParameterShade<'a> {
    words: String,
    /// Values of the parameter, ascending, with their colours.
    values: Vec<(String, String)>,
    /// The swept algorithms, by their labels.
    #[serde(skip)]
    pub colors: Vec<(&'a str, [u8; 3])>,
}

/// The values of a parameter among algorithms, ascending, each once.
pub(crate) fn parameter_values(records: &[&AlgorithmRecord], parameter: &str) -> Vec<f64> {
    let values = records.iter();
    let values = values.filter_map(|record| record.number(parameter));
    let mut values: Vec<_> = values.collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// The parameters that are swept, each once.
pub(crate) fn swept(page: &ReportPage) -> Vec<&str> {
    let mut seen = BTreeSet::new();
    let parameters = page.sweeps.iter().map(|sweep| sweep.parameter.as_str());
    let parameters = parameters.filter(|parameter| seen.insert(*parameter));
    parameters.collect()
}

/// The swept algorithms of that name.
pub(crate) fn swept_records<'a>(page: &'a ReportPage, name: &str) -> Vec<&'a AlgorithmRecord> {
    let records = page.manifest.algorithms.iter();
    let is_own = |own: &&AlgorithmRecord| own.name == name && page.is_swept(&own.label);
    records.filter(is_own).collect()
}

impl ReportPage {
    /// The colours of the algorithms.
    pub(super) fn colors(&self) -> AlgorithmColors<'_> {
        let shades = parameter_shades(self);
        let colors = shades.iter().flat_map(|shade| shade.colors.iter().copied());
        AlgorithmColors::new(self.manifest.labels()).with_shades(colors)
    }
}

/// A shade for each kind of algorithms that is swept.
pub(crate) fn parameter_shades(page: &ReportPage) -> Vec<ParameterShade<'_>> {
    let mut seen = BTreeSet::new();
    let first = page.sweeps.iter();
    let first = first.filter(|sweep| seen.insert(&sweep.algorithm));
    let shade = |sweep: &'_ ParameterSweep| {
        let records = swept_records(page, &sweep.algorithm);
        let values = parameter_values(&records, &sweep.parameter);
        let last = values.len().saturating_sub(1).max(1) as f64;
        let color = |i: usize| parameter_color(i as f64 / last);
        let own = |record: &&'_ AlgorithmRecord| {
            let value = record.number(&sweep.parameter)?;
            values.iter().position(|own| *own == value).map(color)
        };
        let colors = records
            .iter()
            .filter_map(|own_record| Some((own_record.label.as_str(), own(own_record)?)));
        let values = values.iter().enumerate();
        ParameterShade {
            words: format!("{}: {}", sweep.algorithm, sweep.parameter),
            colors: colors.collect(),
            values: values
                .map(|(i, value)| (value.to_string(), css_color(color(i))))
                .collect(),
        }
    };
    first.map(shade).collect()
}
