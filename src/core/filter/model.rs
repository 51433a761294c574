//! The file of a trained filter: safetensors with its kind, features and figures.

use super::{Features, FilterKind, Network, Scaling};
use crate::error::{Error, Result};
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

/// A trained filter.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterModel {
    pub kind: FilterKind,
    pub features: Features,
    pub network: Network,
    /// For *too close*: disparities from this on are out of range, pixels.
    pub range_px: Option<f64>,
    /// Facts reported by its author: version, data, figures.
    pub facts: ModelFacts,
}

/// Names and texts.
pub type ModelFacts = BTreeMap<String, String>;

/// Largest file accepted, bytes.
const MAX_BYTES: u64 = 256 << 20;

/// Largest side of a window.
const MAX_WINDOW: usize = 512;

/// Names of the tensors: weights and biases of the hidden layer and of the output, in PyTorch's
/// shapes.
const HIDDEN_WEIGHT: &str = "hidden.weight";
const HIDDEN_BIAS: &str = "hidden.bias";
const OUTPUT_WEIGHT: &str = "output.weight";
const OUTPUT_BIAS: &str = "output.bias";

/// Fault in the file of a [`FilterModel`].
#[derive(Debug, thiserror::Error)]
pub enum FilterFault {
    #[error("is not a safetensors file, or corrupt: {0}")]
    File(#[from] SafeTensorError),
    #[error("is not a filter of svl: its metadata has no '{0}'; `svl train filter` makes one")]
    NoFact(&'static str),
    #[error("is not a filter of svl: it has no tensor '{0}'")]
    NoTensor(&'static str),
    #[error("its range_px is not a positive number")]
    Range,
    #[error("its window is not an even number up to {MAX_WINDOW}")]
    Window,
    #[error("its scaling is neither 'amplitude' nor 'log'")]
    Scaling,
    #[error("'{0}' is of {1:?}, not F32")]
    Number(&'static str, Dtype),
    /// The shape of the weights, and the window with its number of features.
    #[error("its '{HIDDEN_WEIGHT}' is {0:?}, but windows of {1} have {2} features")]
    Shape(Vec<usize>, usize, usize),
    #[error("'{OUTPUT_BIAS}' is not one number")]
    OutputBias,
    /// A kind of filter that svl does not know, and a network that none can be.
    #[error(transparent)]
    Other(#[from] Error),
}

impl FilterModel {
    /// Reads a file that `svl train filter` wrote.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] with the fault.
    pub fn read(path: &Path) -> Result<Self> {
        let file = crate::inputs::open(path).map_err(|e| Error::io(path, e))?;
        let mut bytes = Vec::new();
        let read = file.take(MAX_BYTES + 1).read_to_end(&mut bytes);
        read.map_err(|e| Error::io(path, e))?;
        if bytes.len() as u64 > MAX_BYTES {
            let most = MAX_BYTES >> 20;
            return Err(Error::format(path, format!("is larger than {most} MiB")));
        }
        Self::from_bytes(&bytes).map_err(|fault| Error::format(path, fault))
    }

    /// Parses the bytes of such a file.
    ///
    /// # Errors
    /// The fault in them.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FilterFault> {
        let (_, header) = SafeTensors::read_metadata(bytes)?;
        let tensors = SafeTensors::deserialize(bytes)?;
        let mut facts: ModelFacts = header.metadata().clone().into_iter().flatten().collect();
        let kind: FilterKind = take(&mut facts, "filter")?.parse()?;
        let features = take_features(&mut facts)?;
        let range_px = match kind {
            FilterKind::Floor => None,
            FilterKind::TooClose => {
                let range = take(&mut facts, "range_px")?.parse().ok();
                let range = range.filter(|px: &f64| px.is_finite() && *px > 0.0);
                Some(range.ok_or(FilterFault::Range)?)
            }
        };
        let weights = floats(&tensors, HIDDEN_WEIGHT)?;
        let (window, inputs) = (features.window, features.count());
        if !matches!(weights.shape[..], [_, count] if count == inputs) {
            return Err(FilterFault::Shape(weights.shape, window, inputs));
        }
        let bias = floats(&tensors, HIDDEN_BIAS)?.values;
        let out_weights = floats(&tensors, OUTPUT_WEIGHT)?.values;
        let out_bias = floats(&tensors, OUTPUT_BIAS)?.values;
        let [out_bias] = out_bias[..] else {
            return Err(FilterFault::OutputBias);
        };
        let network = Network::new(inputs, &weights.values, bias, out_weights, out_bias)?;
        Ok(Self {
            kind,
            features,
            network,
            range_px,
            facts,
        })
    }

    /// The bytes of its file; identical for identical models.
    pub fn to_bytes(&self) -> Vec<u8> {
        let (features, network) = (&self.features, &self.network);
        let mut said = self.facts.clone();
        let mut say = |key: &str, text: String| said.insert(key.to_owned(), text);
        say("filter", self.kind.name().to_owned());
        say("window", features.window.to_string());
        say("scaling", features.scaling.name().to_owned());
        say("hidden", network.hidden().to_string());
        if let Some(px) = self.range_px {
            say("range_px", px.to_string());
        }
        let (out_weights, out_bias) = network.output();
        let (inputs, hidden) = (network.inputs(), network.hidden());
        let bytes = |values: &mut dyn Iterator<Item = &f32>| -> Vec<u8> {
            values.flat_map(|value| value.to_le_bytes()).collect()
        };
        let tensors = [
            (
                HIDDEN_WEIGHT,
                vec![hidden, inputs],
                bytes(&mut network.rows().flatten()),
            ),
            (HIDDEN_BIAS, vec![hidden], bytes(&mut network.bias().iter())),
            (
                OUTPUT_WEIGHT,
                vec![1, hidden],
                bytes(&mut out_weights.iter()),
            ),
            (OUTPUT_BIAS, vec![1], out_bias.to_le_bytes().to_vec()),
        ];
        safetensors_bytes(&said, "F32", &tensors)
    }

    /// Hash of everything that determines its decisions.
    pub fn hash(&self) -> u128 {
        let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
        let Features { window, scaling } = self.features;
        let range_px = self.range_px.unwrap_or_default();
        let text = format!("{} {window} {} {range_px}", self.kind, scaling.name());
        hasher.update(text.as_bytes());
        let (out_weights, out_bias) = self.network.output();
        let rows = self.network.rows().flatten();
        let weights = rows.chain(self.network.bias()).chain(out_weights);
        weights
            .chain([&out_bias])
            .for_each(|weight| hasher.update(&weight.to_le_bytes()));
        hasher.digest128()
    }
}

/// The bytes of a safetensors file of tensors of one type: names, shapes, bytes. Written here, as
/// the crate orders metadata randomly: equal models are equal files.
pub(crate) fn safetensors_bytes(
    facts: &ModelFacts,
    dtype: &str,
    tensors: &[(&str, Vec<usize>, Vec<u8>)],
) -> Vec<u8> {
    use serde_json::{Map, Value, json};

    let (mut header, mut data) = (Map::new(), Vec::new());
    header.insert("__metadata__".into(), json!(facts));
    for (name, shape, bytes) in tensors {
        let begin = data.len();
        data.extend(bytes);
        let place = json!({ "dtype": dtype, "shape": shape, "data_offsets": [begin, data.len()] });
        header.insert((*name).to_owned(), place);
    }
    let mut header = Value::Object(header).to_string().into_bytes();
    header.resize(header.len().next_multiple_of(8), b' ');
    let length = (header.len() as u64).to_le_bytes();
    [&length[..], &header, &data].concat()
}

/// Removes a fact that every filter has.
fn take(facts: &mut ModelFacts, key: &'static str) -> Result<String, FilterFault> {
    facts.remove(key).ok_or(FilterFault::NoFact(key))
}

/// Removes the facts about the features.
fn take_features(facts: &mut ModelFacts) -> Result<Features, FilterFault> {
    let window = take(facts, "window")?.parse::<usize>().ok();
    let window = window.filter(|side| (2..=MAX_WINDOW).contains(side) && side.is_multiple_of(2));
    let window = window.ok_or(FilterFault::Window)?;
    let scaling = Scaling::from_name(&take(facts, "scaling")?).ok_or(FilterFault::Scaling)?;
    Ok(Features { window, scaling })
}

struct Floats {
    shape: Vec<usize>,
    values: Vec<f32>,
}

fn floats(tensors: &SafeTensors<'_>, name: &'static str) -> Result<Floats, FilterFault> {
    let tensor = tensors.tensor(name);
    let tensor = tensor.map_err(|_| FilterFault::NoTensor(name))?;
    if tensor.dtype() != Dtype::F32 {
        return Err(FilterFault::Number(name, tensor.dtype()));
    }
    let values = tensor.data().as_chunks().0.iter();
    Ok(Floats {
        shape: tensor.shape().to_vec(),
        values: values.map(|bytes| f32::from_le_bytes(*bytes)).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> FilterModel {
        let features = Features {
            window: 8,
            scaling: Scaling::Log,
        };
        let weights: Vec<_> = (0..66).map(|i| i as f32 * 0.1).collect();
        let network = Network::new(33, &weights, vec![0.5, -1.0], vec![2.0, 3.0], 0.25);
        FilterModel {
            kind: FilterKind::TooClose,
            features,
            network: network.unwrap(),
            range_px: Some(80.0),
            facts: [("svl".to_owned(), "0.1.0 \"x\"".to_owned())].into(),
        }
    }

    #[test]
    fn a_file_holds_the_model() {
        let bytes = model().to_bytes();
        let mut read = FilterModel::from_bytes(&bytes).unwrap();
        assert_eq!(read.facts.remove("hidden").as_deref(), Some("2"));
        assert_eq!(read, model());
        assert_eq!(read.hash(), model().hash());
        assert_eq!(bytes, model().to_bytes());
    }

    #[test]
    fn every_truncation_and_foreign_files_are_refused() {
        let bytes = model().to_bytes();
        for length in 0..bytes.len() {
            assert!(
                FilterModel::from_bytes(&bytes[..length]).is_err(),
                "{length}"
            );
        }
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let changed = |from: &str, to: &str| {
            assert!(from.len() == to.len() && text.contains(from), "{from}");
            let at = bytes.windows(from.len()).position(|w| w == from.as_bytes());
            let mut bytes = bytes.clone();
            bytes[at.unwrap()..][..to.len()].copy_from_slice(to.as_bytes());
            FilterModel::from_bytes(&bytes).unwrap_err().to_string()
        };
        for (from, to, reason) in [
            (
                "\"filter\"",
                "\"folter\"",
                "not a filter of svl: its metadata has no 'filter'",
            ),
            ("too-close", "tooclosed", "there is no filter 'tooclosed'"),
            (
                "\"window\":\"8\"",
                "\"window\":\"6\"",
                "windows of 6 have 19 features",
            ),
            ("\"window\":\"8\"", "\"window\":\"7\"", "not an even number"),
            ("\"80\"", "\"-1\"", "range_px"),
            ("output.bias", "output.byas", "no tensor 'output.bias'"),
        ] {
            let error = changed(from, to);
            assert!(error.contains(reason), "{error}");
        }
        let mut nan = bytes.clone();
        let end = nan.len();
        nan[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
        let error = FilterModel::from_bytes(&nan).unwrap_err().to_string();
        assert!(error.contains("not a finite number"), "{error}");
    }
}
