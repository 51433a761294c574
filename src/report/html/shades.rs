//! The colours of swept algorithms: by the value of their first parameter.

use super::ReportPage;
use crate::page::css_color;
use serde::Serialize;
use svl_files::overlay::parameter_color;
use svl_score::manifest::AlgorithmRecord;

/// The first swept parameter of a kind of algorithms.
pub(super) struct ParameterShade<'a> {
    algorithm: &'a str,
    parameter: &'a str,
    /// Values of the parameter, ascending, with their colours.
    values: Vec<(String, [u8; 3])>,
    /// The swept algorithms, by their labels.
    pub colors: Vec<(&'a str, [u8; 3])>,
}

/// Key of the shades on the page.
#[derive(Serialize)]
pub(super) struct ShadeView {
    words: String,
    /// With colours.
    values: Vec<(String, String)>,
}

impl ParameterShade<'_> {
    pub(super) fn view(&self) -> ShadeView {
        let values = self.values.iter();
        ShadeView {
            words: format!("{}: {}", self.algorithm, self.parameter),
            values: values
                .map(|(value, color)| (value.clone(), css_color(*color)))
                .collect(),
        }
    }
}

/// The value of a parameter that is a number.
pub(super) fn parameter_value(record: &AlgorithmRecord, parameter: &str) -> Option<f64> {
    let mut values = record.values.iter();
    values.find(|(name, _)| name == parameter)?.1.parse().ok()
}

/// The values of a parameter among algorithms, ascending, each once.
pub(super) fn parameter_values(records: &[&AlgorithmRecord], parameter: &str) -> Vec<f64> {
    let values = records.iter();
    let values = values.filter_map(|record| parameter_value(record, parameter));
    let mut values: Vec<_> = values.collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// The parameters that are swept, each once.
pub(super) fn swept(page: &ReportPage) -> Vec<&str> {
    let mut parameters: Vec<&str> = Vec::new();
    for sweep in &page.sweeps {
        if !parameters.contains(&sweep.parameter.as_str()) {
            parameters.push(&sweep.parameter);
        }
    }
    parameters
}

/// The swept algorithms of that name.
pub(super) fn swept_records<'a>(page: &'a ReportPage, name: &str) -> Vec<&'a AlgorithmRecord> {
    let is_swept = |label: &String| {
        let mut points = page.sweeps.iter().flat_map(|sweep| &sweep.points);
        points.any(|(_, own)| own == label)
    };
    let records = page.manifest.algorithms.iter();
    let records = records.filter(|record| record.name == name && is_swept(&record.label));
    records.collect()
}

/// A shade for each kind of algorithms that is swept.
pub(super) fn parameter_shades(page: &ReportPage) -> Vec<ParameterShade<'_>> {
    let mut shades: Vec<ParameterShade<'_>> = Vec::new();
    for sweep in &page.sweeps {
        let (algorithm, parameter) = (sweep.algorithm.as_str(), sweep.parameter.as_str());
        if shades.iter().any(|shade| shade.algorithm == algorithm) {
            continue;
        }
        let records = swept_records(page, algorithm);
        let values = parameter_values(&records, parameter);
        let last = values.len().saturating_sub(1).max(1) as f64;
        let color = |i: usize| parameter_color(i as f64 / last);
        let own = |record: &&'_ AlgorithmRecord| {
            let value = parameter_value(record, parameter)?;
            values.iter().position(|own| *own == value).map(color)
        };
        let colors = records.iter();
        let colors = colors.filter_map(|record| Some((record.label.as_str(), own(record)?)));
        shades.push(ParameterShade {
            algorithm,
            parameter,
            colors: colors.collect(),
            values: (values.iter().enumerate())
                .map(|(i, value)| (value.to_string(), color(i)))
                .collect(),
        });
    }
    shades
}
