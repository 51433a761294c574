//! The file of a model: safetensors of the network's whole numbers, with the tables as metadata.

use crate::depth::decision::{LevelTables, TableFault, VerdictTable};
use crate::filter::{ModelFacts, safetensors_bytes};
use crate::kernel::{GAP_TENSORS, GAP_WEIGHTS, GapFault, GapNetwork};
use crate::stereo::{FittedTo, UnsortedPairs, hash_words};
use safetensors::{Dtype, SafeTensorError, SafeTensors};

/// Everything that v5 learned: what `svl train v5` makes and `v5:model=FILE` reads.
#[derive(Clone, Debug, PartialEq)]
pub struct V5Model {
    /// The network that weighs disparities for gaps; without one they are filled along rows.
    pub network: Option<GapWeights>,
    /// The decision on the median of a cell, of images that are decided at their own size alone.
    pub median: VerdictTable,
    /// The decisions on images that are decided at several sizes, and on small cells.
    pub levels: LevelTables,
    /// The decision on its nearest quarter.
    pub near: VerdictTable,
    /// The second decision on small cells: their nearer surface.
    pub near_small: Option<VerdictTable>,
    /// The runs that network and tables were fitted to.
    pub fitted: FittedTo,
    /// Facts reported by its author: version, data, figures.
    pub facts: ModelFacts,
}

/// The weights of a network, in the order of [`GAP_TENSORS`].
#[derive(Clone, Debug, PartialEq)]
pub struct GapWeights(Box<[i32; GAP_WEIGHTS]>);

/// Key and version of the format: hypotheses, features, layers, evidence, levels and state of a
/// cell.
const KEY: &str = "v5";
const VERSION: &str = "3";
/// Key of the hash of the file without it.
const CHECKSUM: &str = "checksum";

const CURE: &str = "`svl train v5` makes one";

/// Fault in the file of a [`V5Model`], with its cure, in one line.
#[derive(Debug, thiserror::Error)]
pub enum V5Fault {
    #[error("is not a safetensors file, or corrupt: {0}; {CURE}")]
    File(#[from] SafeTensorError),
    #[error("is a model of v5 of version '{0}', and this svl reads version {VERSION}; {CURE}")]
    Version(String),
    #[error("is not a model of v5: its metadata has no '{KEY}'; {CURE}")]
    NoVersion,
    #[error("its metadata has no '{0}'; {CURE}")]
    NoTable(&'static str),
    #[error("'{0}': {1}; {CURE}")]
    Table(&'static str, #[source] TableFault),
    #[error("'{0}': has no use for '{1}'; {CURE}")]
    NoUse(&'static str, &'static str),
    #[error("has no tensor '{0}'; {CURE}")]
    NoTensor(&'static str),
    #[error("its '{0}' is {1:?} {2:?}; expected I32 {3:?}; {CURE}")]
    Tensor(&'static str, Dtype, Vec<usize>, [usize; 2]),
    #[error("{0}; {CURE}")]
    Weights(#[from] GapFault),
    #[error(transparent)]
    Fitted(#[from] UnsortedPairs),
    #[error("is damaged, by its checksum: copy it again, or {CURE}")]
    Checksum,
}

/// Units of a weight and of a bias: 256ths, and 64ths of them.
const WEIGHT: f32 = 256.0;
const BIAS: f32 = 64.0 * WEIGHT;

impl GapWeights {
    /// Rounds the weights of a network in floats.
    ///
    /// # Errors
    /// Weights that are too large, or not finite.
    pub fn rounded(weights: &[f32; GAP_WEIGHTS]) -> Result<Self, GapFault> {
        let mut rounded = Box::new([0; GAP_WEIGHTS]);
        let units = GAP_TENSORS.iter().flat_map(|(name, [rows, inputs])| {
            let is_bias = name.ends_with("bias");
            std::iter::repeat_n(if is_bias { BIAS } else { WEIGHT }, rows * inputs)
        });
        for ((to, weight), unit) in rounded.iter_mut().zip(weights).zip(units) {
            if !weight.is_finite() {
                return Err(GapFault::NotFinite);
            }
            *to = (weight * unit).round() as i32;
        }
        GapNetwork::new(&rounded)?;
        Ok(Self(rounded))
    }

    /// The network as the matcher computes it.
    pub(super) fn network(&self) -> GapNetwork {
        GapNetwork::new(&self.0).expect("checked when the weights were made")
    }

    /// The weights in a file; none if it has no tensors.
    fn read(tensors: &SafeTensors<'_>) -> Result<Option<Self>, V5Fault> {
        if tensors.is_empty() {
            return Ok(None);
        }
        let mut weights = Box::new([0; GAP_WEIGHTS]);
        let mut rest = &mut weights[..];
        for (name, shape) in GAP_TENSORS {
            let tensor = tensors.tensor(name);
            let tensor = tensor.map_err(|_| V5Fault::NoTensor(name))?;
            let (dtype, found) = (tensor.dtype(), tensor.shape());
            if dtype != Dtype::I32 || found != shape {
                return Err(V5Fault::Tensor(name, dtype, found.to_vec(), shape));
            }
            let (to, others) = rest.split_at_mut(shape[0] * shape[1]);
            rest = others;
            for (to, bytes) in to.iter_mut().zip(tensor.data().as_chunks().0) {
                *to = i32::from_le_bytes(*bytes);
            }
        }
        GapNetwork::new(&weights)?;
        Ok(Some(Self(weights)))
    }
}

impl V5Model {
    /// The file of the built-in model.
    pub(super) const BUILT_IN: &[u8] = include_bytes!("model.safetensors");

    /// The built-in model.
    pub fn built_in() -> Self {
        Self::parse(Self::BUILT_IN).expect("a test reads it")
    }

    /// Parses the bytes of a file.
    ///
    /// # Errors
    /// The fault in them.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, V5Fault> {
        let model = Self::parse(bytes)?;
        let is_whole = model.to_bytes() == bytes;
        is_whole.then_some(model).ok_or(V5Fault::Checksum)
    }

    /// The model of bytes that may be damaged.
    fn parse(bytes: &[u8]) -> Result<Self, V5Fault> {
        let (_, header) = SafeTensors::read_metadata(bytes)?;
        let tensors = SafeTensors::deserialize(bytes)?;
        let mut facts: ModelFacts = header.metadata().clone().into_iter().flatten().collect();
        match facts.remove(KEY) {
            Some(version) if version == VERSION => {}
            Some(other) => return Err(V5Fault::Version(other)),
            None => return Err(V5Fault::NoVersion),
        }
        let mut optional = |name, rank: i64| {
            let table = facts.remove(name).map(|text| VerdictTable::parse(&text));
            match table.transpose() {
                Ok(Some(other)) if other.rank != rank => {
                    Err(V5Fault::Table(name, TableFault::Rank(other.rank, rank)))
                }
                table => table.map_err(|fault| V5Fault::Table(name, fault)),
            }
        };
        let near_small = optional("near_small", 75)?;
        let mut table = |name, rank| optional(name, rank)?.ok_or(V5Fault::NoTable(name));
        let (median, near) = (table("median", 50)?, table("near", 75)?);
        let levels = LevelTables {
            finest: table("finest", 50)?,
            middle: table("middle", 50)?,
            coarsest: table("coarsest", 50)?,
            small: table("small", 50)?,
        };
        let second = [("near", Some(&near)), ("near_small", near_small.as_ref())];
        for (name, table) in second {
            let unused = table.and_then(|table| {
                let time = table.time.as_ref().map(|_| "time");
                time.or(table.near_least_score.map(|_| "near_least_score"))
            });
            if let Some(unused) = unused {
                return Err(V5Fault::NoUse(name, unused));
            }
        }
        let network = GapWeights::read(&tensors)?;
        let fitted = FittedTo::from_facts(&facts)?;
        let others = [FittedTo::RUNS, FittedTo::PAIRS, CHECKSUM];
        facts.retain(|key, _| !others.contains(&key.as_str()));
        Ok(Self {
            network,
            median,
            levels,
            near,
            near_small,
            fitted,
            facts,
        })
    }

    /// The bytes of its file; identical for identical models.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut facts = self.facts.clone();
        facts.extend(self.fitted.facts());
        facts.extend([
            (KEY.to_owned(), VERSION.to_owned()),
            ("median".to_owned(), self.median.to_json()),
            ("finest".to_owned(), self.levels.finest.to_json()),
            ("middle".to_owned(), self.levels.middle.to_json()),
            ("coarsest".to_owned(), self.levels.coarsest.to_json()),
            ("small".to_owned(), self.levels.small.to_json()),
            ("near".to_owned(), self.near.to_json()),
        ]);
        let near_small = self.near_small.iter();
        facts.extend(near_small.map(|table| ("near_small".to_owned(), table.to_json())));
        let network = self.network.as_ref();
        let mut rest = network.map_or(&[][..], |weights| &weights.0[..]);
        let tensors = GAP_TENSORS.iter().filter(|_| network.is_some());
        let tensors = tensors.map(|(name, shape)| {
            let (tensor, others) = rest.split_at(shape[0] * shape[1]);
            rest = others;
            let bytes = tensor.iter().flat_map(|w| w.to_le_bytes()).collect();
            (*name, shape.to_vec(), bytes)
        });
        let tensors: Vec<_> = tensors.collect();
        let bytes = safetensors_bytes(&facts, "I32", &tensors);
        let checksum = hash_words(xxhash_rust::xxh3::xxh3_128(&bytes));
        facts.insert(CHECKSUM.to_owned(), checksum);
        safetensors_bytes(&facts, "I32", &tensors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flipped_bit_is_found() {
        let bytes = V5Model::BUILT_IN;
        assert_eq!(V5Model::built_in().to_bytes(), bytes);
        for at in (0..bytes.len()).step_by(97) {
            let mut flipped = bytes.to_vec();
            flipped[at] ^= 1 << (at % 8);
            let read = V5Model::from_bytes(&flipped);
            assert!(read.is_err(), "byte {at}");
        }
        let mut weight = bytes.to_vec();
        *weight.last_mut().unwrap() ^= 1;
        let error = V5Model::from_bytes(&weight).unwrap_err();
        assert!(matches!(error, V5Fault::Checksum), "{error}");
    }
}
