//! Facts of a run besides the results of algorithms: files, pairs, losses, warnings.

use super::plan::{BLOCK, PlannedAlgorithm};
use crate::results::summary::TopicDelay;
use crate::subjects::witness::FloorRays;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use svl_core::inputs::FileStamp;
use svl_score::judge::BodyPose;
use svl_score::losses::Losses;
use svl_score::manifest::{InputRecord, hash};
use svl_score::notice::Notice;

/// Facts of a run besides the results of algorithms.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunFacts {
    pub record: Option<InputRecord>,
    /// The files that were opened, as they were: they only decide if the pairs are decoded again.
    pub files: Vec<FileStamp>,
    /// Digest of the description of its source, with paths.
    pub source: String,
    /// Digest of the runs whose pairs were registered before, which it has no copies of.
    pub after: String,
    /// Stamp of the first pair of its source; absent unless it was read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_ns: Option<u64>,
    /// The pairs, in their order.
    pub pairs: Vec<PairFacts>,
    /// All that is in no pair; none unless the run was read to its end.
    pub losses: Option<Losses>,
    /// The error that ended it early.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Warnings of the run, and those of algorithms, by their digests.
    pub warnings: Vec<Notice>,
    /// Delays of the topics that it reads maps from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub latency: Vec<TopicDelay>,
}

/// A pair of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PairFacts {
    pub sequence: u64,
    /// Digest of all that rows depend on: pixels, stamp, calibration, truth, pose and name.
    pub hash: String,
    /// Disparity of infinity by its calibration, pixels; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub infinity_px: Option<f32>,
    /// The robot, if poses tell where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<BodyPose>,
    /// The floor along the rays of its cells, if something tells it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<FloorRays>,
    /// Hashes of the maps that others computed, by their names.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub maps: BTreeMap<String, String>,
}

impl RunFacts {
    /// Digest of the content of all pairs, in their order.
    pub fn inputs(&self) -> String {
        let hashes: Vec<_> = self.pairs.iter().map(|pair| pair.hash.as_str()).collect();
        hash(&hashes.join("\n"))
    }

    /// Adds notices, of algorithms by their digests; none of a failure on a pair, which a table
    /// has.
    pub fn add_notices(&mut self, notices: Vec<Notice>, algorithms: &[PlannedAlgorithm<'_>]) {
        let digests = || algorithms.iter().map(|own| (own.label, &*own.digest));
        let of_run = notices.into_iter().filter(|notice| notice.pair.is_none());
        let of_run = of_run.filter_map(|notice| notice.renamed(digests()));
        of_run.for_each(|notice| notice.add_to(&mut self.warnings));
    }

    /// Adds the warnings of algorithms on the same pairs. Those of the run itself are known to all
    /// who read it.
    pub fn join(&mut self, other: &Self) {
        let of_algorithms = other.warnings.iter();
        let of_algorithms = of_algorithms.filter(|own| !own.algorithms.is_empty());
        of_algorithms.for_each(|warning| warning.clone().add_to(&mut self.warnings));
    }
}

impl PlannedAlgorithm<'_> {
    /// The name of the unit of a block, of the pairs of the run so far.
    pub fn unit_name(&self, block: u64, pairs: &[PairFacts]) -> String {
        let end = pairs.len().min(((block + 1) * BLOCK) as usize);
        let begin = match self.has_run_memory {
            true => 0,
            false => (block * BLOCK) as usize,
        };
        let mut text = self.digest.clone();
        for pair in &pairs[begin.min(end)..end] {
            text += &pair.hash;
            let map = self.maps.as_ref().and_then(|name| pair.maps.get(name));
            text += map.map_or("", String::as_str);
        }
        format!("{block:05}-{}", &hash(&text)[..16])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_named_by_what_its_rows_depend_on() {
        let pair = |number: u64| PairFacts {
            sequence: number,
            hash: number.to_string(),
            ..PairFacts::default()
        };
        let pairs: Vec<_> = (0..100).map(pair).collect();
        let mut other = pairs.clone();
        other[3].hash = "other".to_owned();
        let mut mapped = pairs.clone();
        mapped[70].maps = BTreeMap::from([("files:a".to_owned(), "map".to_owned())]);
        // The kind of algorithm, the pairs that differ, and the blocks whose names differ then.
        for (has_run_memory, maps, changed, blocks) in [
            (false, None, &other, vec![0]),
            (true, None, &other, vec![0, 1]),
            (false, None, &mapped, vec![]),
            (false, Some("files:a"), &mapped, vec![1]),
        ] {
            let algorithm = PlannedAlgorithm {
                label: "a",
                digest: "digest".to_owned(),
                has_run_memory,
                maps: maps.map(str::to_owned),
            };
            let name = |pairs, block| algorithm.unit_name(block, pairs);
            let differ = (0..2).filter(|block| name(&pairs, *block) != name(changed, *block));
            assert_eq!(differ.collect::<Vec<_>>(), blocks);
        }
    }

    #[test]
    fn a_text_that_begins_like_an_algorithm_is_not_attributed_to_it() {
        let algorithm = |label| PlannedAlgorithm {
            label,
            digest: format!("digest of {label}"),
            has_run_memory: false,
            maps: None,
        };
        let algorithms = ["bm", "v3"].map(algorithm);
        let texts = ["bm: 3 pairs dropped", "bm on pair 3: dark", "bm, v3: dark"];
        let mut notices = texts.map(|text| Notice::new([], text)).to_vec();
        notices.push(Notice::new(["v3"], "dark"));
        notices.push(Notice::on_pair("bm", 3, "dark"));
        let mut facts = RunFacts::default();
        facts.add_notices(notices, &algorithms);
        let words: Vec<_> = facts.warnings.iter().map(Notice::to_string).collect();
        assert_eq!(words, [&texts[..], &["digest of v3: dark"]].concat());
    }
}
