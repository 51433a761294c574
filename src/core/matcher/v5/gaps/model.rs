//! The file of a trained network: safetensors of whole numbers.

use crate::filter::{ModelFacts, safetensors_bytes};
use crate::kernel::{GAP_TENSORS, GAP_WEIGHTS, GapNetwork};
use safetensors::{Dtype, SafeTensors};

/// Weights of a network for the gaps of v5, which `v5:gaps=FILE` reads and `svl train gaps` makes.
#[derive(Clone, Debug, PartialEq)]
pub struct GapModel {
    /// In the order of [`GAP_TENSORS`].
    weights: Box<[i32; GAP_WEIGHTS]>,
    /// Facts reported by its author: version, data, figures.
    pub facts: ModelFacts,
}

/// Key and version of the format: hypotheses, features and layers.
const KEY: &str = "gaps";
const VERSION: &str = "1";

/// Units of a weight and of a bias: 256ths, and 64ths of them.
const WEIGHT: f32 = 256.0;
const BIAS: f32 = 64.0 * WEIGHT;

impl GapModel {
    /// The file of revision 3's network (docs/results/v5.md has the commands that made it).
    pub(in super::super) const REVISION_3: &[u8] = include_bytes!("revision_3.safetensors");

    /// Rounds the weights of a network in floats, in the order of [`GAP_TENSORS`].
    ///
    /// # Errors
    /// Weights that are too large, or not finite.
    pub fn rounded(weights: &[f32; GAP_WEIGHTS]) -> Result<Self, String> {
        let mut rounded = Box::new([0; GAP_WEIGHTS]);
        let units = GAP_TENSORS.iter().flat_map(|(name, [rows, inputs])| {
            let is_bias = name.ends_with("bias");
            std::iter::repeat_n(if is_bias { BIAS } else { WEIGHT }, rows * inputs)
        });
        for ((to, weight), unit) in rounded.iter_mut().zip(weights).zip(units) {
            if !weight.is_finite() {
                return Err("a weight is not a finite number".into());
            }
            *to = (weight * unit).round() as i32;
        }
        GapNetwork::new(&rounded)?;
        Ok(Self {
            weights: rounded,
            facts: ModelFacts::new(),
        })
    }

    /// The network as the matcher computes it.
    pub fn network(&self) -> GapNetwork {
        GapNetwork::new(&self.weights).expect("checked when the model was made")
    }

    /// Parses the bytes of a file.
    ///
    /// # Errors
    /// The fault in them, with its cure, in one line.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let cure = "`svl train gaps` makes one";
        let damaged = |e| format!("is not a safetensors file, or corrupt: {e}; {cure}");
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(damaged)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(damaged)?;
        let facts = header.metadata().iter().flatten();
        let mut facts: ModelFacts = facts.map(|(k, v)| (k.clone(), v.clone())).collect();
        match facts.remove(KEY).as_deref() {
            Some(VERSION) => {}
            Some(other) => {
                return Err(format!(
                    "is a network of gaps of version '{other}', and this svl reads version \
                     {VERSION}; {cure}"
                ));
            }
            None => {
                return Err(format!(
                    "is not a network of v5's gaps: its metadata has no '{KEY}'; {cure}"
                ));
            }
        }
        let mut weights = Box::new([0; GAP_WEIGHTS]);
        let mut rest = &mut weights[..];
        for (name, shape) in GAP_TENSORS {
            let tensor = tensors.tensor(name);
            let tensor = tensor.map_err(|_| format!("has no tensor '{name}'; {cure}"))?;
            if tensor.dtype() != Dtype::I32 || tensor.shape() != shape {
                return Err(format!(
                    "its '{name}' is {:?} {:?}; expected I32 {shape:?}; {cure}",
                    tensor.dtype(),
                    tensor.shape()
                ));
            }
            let (to, others) = rest.split_at_mut(shape[0] * shape[1]);
            rest = others;
            for (to, bytes) in to.iter_mut().zip(tensor.data().as_chunks().0) {
                *to = i32::from_le_bytes(*bytes);
            }
        }
        GapNetwork::new(&weights).map_err(|why| format!("{why}; {cure}"))?;
        Ok(Self { weights, facts })
    }

    /// The bytes of its file; identical for identical models.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut facts = self.facts.clone();
        facts.insert(KEY.to_owned(), VERSION.to_owned());
        let mut rest = &self.weights[..];
        let tensors = GAP_TENSORS.map(|(name, shape)| {
            let (tensor, others) = rest.split_at(shape[0] * shape[1]);
            rest = others;
            let bytes = tensor.iter().flat_map(|w| w.to_le_bytes()).collect();
            (name, shape.to_vec(), bytes)
        });
        safetensors_bytes(&facts, "I32", &tensors)
    }
}
