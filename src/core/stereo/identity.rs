//! Identity of a recorded pair, and of what a learned file was fitted to.

use super::StereoPair;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// A hash as all files have it: `h` and 32 hexadecimal digits. Digits alone may be a number to the
/// readers of a table: `69e0…` is infinite.
pub fn hash_words(hash: u128) -> String {
    format!("h{hash:032x}")
}

/// The hash of such a text.
pub fn parse_hash(text: &str) -> Option<u128> {
    let digits = text.strip_prefix('h').filter(|digits| digits.len() == 32)?;
    u128::from_str_radix(digits, 16).ok()
}

/// Identity of a pair as it was recorded, before rectification, crop, scale and perturbation: its
/// pixels and the stamps of both images. Copies of a recording have the same pairs, compressed or
/// not, in any format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PairId {
    /// Hash of both images.
    pub pixels: u128,
    /// Stamps of the left and of the right image, nanoseconds.
    pub stamps_ns: [u64; 2],
}

impl PairId {
    /// `left_ns`: stamp of the left image. `skew_ns`: right stamp minus left stamp, if known.
    pub fn new(pair: &StereoPair, left_ns: u64, skew_ns: Option<i64>) -> Self {
        let skew_ns = skew_ns.unwrap_or(0);
        Self {
            pixels: pair.hash(),
            stamps_ns: [left_ns, left_ns.wrapping_add_signed(skew_ns)],
        }
    }

    /// Short form of the identity in the files of learned numbers: two of a million pairs share one
    /// by chance once in two times.
    fn short(&self) -> u64 {
        let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
        hasher.update(&self.pixels.to_le_bytes());
        for stamp in self.stamps_ns {
            hasher.update(&stamp.to_le_bytes());
        }
        hasher.digest() >> (64 - SHORT_BITS)
    }
}

const SHORT_BITS: u32 = 40;

/// Hexadecimal digits of a short form.
const SHORT_DIGITS: usize = SHORT_BITS as usize / 4;

/// The runs and pairs that a learned file was fitted to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FittedTo {
    /// Recordings, data-set scenes, and simulated runs: `arena seed 4`, `arena seed 4..10`.
    pub runs: Cow<'static, [Cow<'static, str>]>,
    /// Short forms of the pairs' identities, sorted; none for what svl has built in.
    pairs: Vec<u64>,
}

/// A list of pairs that no [`FittedTo`] has.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "its '{}' is not a sorted list of {SHORT_DIGITS} hexadecimal digits each",
    FittedTo::PAIRS
)]
pub struct UnsortedPairs;

impl FittedTo {
    /// Keys of the facts in the files of learned numbers.
    pub const RUNS: &str = "fitted_runs";
    pub const PAIRS: &str = "fitted_pairs";

    /// That of a built-in table or network.
    pub const fn built_in(runs: &'static [Cow<'static, str>]) -> Self {
        Self {
            runs: Cow::Borrowed(runs),
            pairs: Vec::new(),
        }
    }

    pub fn new(runs: Vec<String>, pairs: impl Iterator<Item = PairId>) -> Self {
        let mut pairs: Vec<_> = pairs.map(|id| id.short()).collect();
        pairs.sort_unstable();
        pairs.dedup();
        Self {
            runs: runs.into_iter().map(Cow::Owned).collect(),
            pairs,
        }
    }

    /// These runs and pairs, and those of another.
    #[must_use]
    pub fn and(self, other: &Self) -> Self {
        let mut runs = self.runs.into_owned();
        for run in other.runs.iter() {
            if !runs.contains(run) {
                runs.push(run.clone());
            }
        }
        let mut pairs = [self.pairs, other.pairs.clone()].concat();
        pairs.sort_unstable();
        pairs.dedup();
        Self {
            runs: Cow::Owned(runs),
            pairs,
        }
    }

    /// From the facts of a network, with its runs in lines; empty where it has none.
    ///
    /// # Errors
    /// A list of pairs that is damaged.
    pub(crate) fn from_facts(facts: &BTreeMap<String, String>) -> Result<Self, UnsortedPairs> {
        let fact = |key: &str| facts.get(key).map_or("", String::as_str);
        let (chunks, rest) = fact(Self::PAIRS).as_bytes().as_chunks::<SHORT_DIGITS>();
        let short = |digits: &[u8; SHORT_DIGITS]| {
            let text = std::str::from_utf8(digits).ok()?;
            u64::from_str_radix(text, 16).ok()
        };
        let pairs: Option<Vec<_>> = chunks.iter().map(short).collect();
        let pairs = pairs.filter(|pairs| rest.is_empty() && pairs.is_sorted());
        let runs = fact(Self::RUNS).lines();
        Ok(Self {
            runs: runs.map(|run| Cow::Owned(run.to_owned())).collect(),
            pairs: pairs.ok_or(UnsortedPairs)?,
        })
    }

    /// Facts of a network that say what it was fitted to.
    pub fn facts(&self) -> [(String, String); 2] {
        [
            (Self::RUNS.to_owned(), self.runs.join("\n")),
            (Self::PAIRS.to_owned(), self.pairs_text()),
        ]
    }

    /// The short forms of its pairs as text.
    pub fn pairs_text(&self) -> String {
        let pairs = self.pairs.iter();
        pairs
            .map(|pair| format!("{pair:0SHORT_DIGITS$x}"))
            .collect()
    }

    /// True if it was fitted to the pair, or to the simulated run or data-set scene of it, by its
    /// names.
    pub fn has<'a>(&self, id: PairId, names: impl IntoIterator<Item = &'a str>) -> bool {
        if self.pairs.binary_search(&id.short()).is_ok() {
            return true;
        }
        let mut runs = names
            .into_iter()
            .flat_map(|name| self.runs.iter().map(move |run| (run, name)));
        runs.any(|(run, name)| run == name || has_seed(run, name).unwrap_or(false))
    }
}

/// True if `arena seed 4..10` has `arena seed 7`.
fn has_seed(runs: &str, run: &str) -> Option<bool> {
    let (name, seed) = run.rsplit_once(' ')?;
    let (runs_name, seeds) = runs.rsplit_once(' ')?;
    let (first, last) = seeds.split_once("..")?;
    let [first, last, seed] = [first, last, seed].map(|number| number.parse::<u64>().ok());
    Some(runs_name == name && (first?..=last?).contains(&seed?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::Gray;

    fn id(gray: u8, left_ns: u64, skew_ns: Option<i64>) -> PairId {
        let image = |gray| Gray::filled(4, 3, gray).unwrap();
        let pair = StereoPair::new(image(gray), image(7)).unwrap();
        PairId::new(&pair, left_ns, skew_ns)
    }

    #[test]
    fn a_pair_is_its_pixels_and_its_stamps() {
        assert_eq!(id(1, 50, Some(-3)), id(1, 50, Some(-3)));
        assert_eq!(id(1, 50, None), id(1, 50, Some(0)));
        for other in [id(2, 50, Some(-3)), id(1, 51, Some(-3)), id(1, 50, None)] {
            assert_ne!(id(1, 50, Some(-3)), other);
        }
    }

    #[test]
    fn runs_and_pairs_come_back_from_facts() {
        let ids = (0..50).map(|i| id(i, 0, None));
        let runs = vec!["night, wet.mcap".to_owned(), "arena seed 4".to_owned()];
        let fitted = FittedTo::new(runs, ids);
        let facts = fitted.facts().into();
        assert_eq!(FittedTo::from_facts(&facts), Ok(fitted.clone()));
        assert!(fitted.has(id(49, 0, None), []));
        assert!(!fitted.has(id(50, 0, None), ["arena seed 5"]));
        // Other pairs of a run are no test, either.
        assert!(fitted.has(id(50, 0, None), ["arena seed 4"]));
        for wrong in ["0", "000000000g", "00000000020000000001"] {
            let facts = [(FittedTo::PAIRS.to_owned(), wrong.to_owned())].into();
            assert_eq!(FittedTo::from_facts(&facts), Err(UnsortedPairs), "{wrong}");
        }
    }

    #[test]
    fn simulated_runs_are_known_by_their_seeds() {
        const FITTED: FittedTo = FittedTo::built_in(&[
            Cow::Borrowed("arena seed 4..10"),
            Cow::Borrowed("worlds seed 3"),
            Cow::Borrowed("teddy"),
        ]);
        let has = |run: &str| FITTED.has(id(0, 0, None), [run]);
        assert!(has("arena seed 4") && has("arena seed 10") && has("worlds seed 3"));
        assert!(!has("arena seed 3") && !has("arena seed 11") && !has("worlds seed 4"));
        assert!(!has("arena seed x") && !has("teddy bear") && has("teddy"));
    }
}
