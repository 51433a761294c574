//! Seeds of the arena, as a list or a range.

use std::collections::BTreeSet;

/// Distinct seeds, at least one: `4..10`, `4,7,9`, in a scenario also `[4, 7, 9]`.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "WrittenSeeds", into = "String")]
pub struct SeedList(Vec<u64>);

/// Most seeds in one list.
const MAX_SEEDS: usize = 1000;

/// Forms of seeds in a scenario.
#[derive(serde::Deserialize)]
#[serde(untagged, expecting = "expected seeds as [4, 7, 9] or \"4..10\"")]
enum WrittenSeeds {
    List(Vec<u64>),
    Text(String),
}

impl SeedList {
    /// # Errors
    /// The fault in them.
    pub fn new(seeds: Vec<u64>) -> Result<Self, String> {
        let distinct = seeds.iter().collect::<BTreeSet<_>>().len() == seeds.len();
        if distinct && (1..=MAX_SEEDS).contains(&seeds.len()) {
            Ok(Self(seeds))
        } else {
            Err(format!(
                "seeds: at least one, at most {MAX_SEEDS}, each once"
            ))
        }
    }

    pub fn seeds(&self) -> &[u64] {
        &self.0
    }
}

impl std::str::FromStr for SeedList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || format!("expected numbers as 4..10 or 4,7,9, at most {MAX_SEEDS}");
        let number = |text: &str| text.trim().parse::<u64>().map_err(|_| expected());
        let mut seeds = Vec::new();
        for part in text.split(',') {
            let (first, last) = match part.split_once("..") {
                Some((first, last)) => (number(first)?, number(last)?),
                None => (number(part)?, number(part)?),
            };
            if first > last || last - first >= MAX_SEEDS as u64 || seeds.len() > MAX_SEEDS {
                return Err(expected());
            }
            seeds.extend(first..=last);
        }
        Self::new(seeds).map_err(|_| expected() + ", each once")
    }
}

impl TryFrom<WrittenSeeds> for SeedList {
    type Error = String;

    fn try_from(written: WrittenSeeds) -> Result<Self, String> {
        match written {
            WrittenSeeds::List(seeds) => Self::new(seeds),
            WrittenSeeds::Text(text) => text.parse().map_err(|why| format!("seeds: {why}")),
        }
    }
}

impl From<SeedList> for String {
    fn from(seeds: SeedList) -> Self {
        seeds.to_string()
    }
}

impl std::fmt::Display for SeedList {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<_> = self.0.iter().map(u64::to_string).collect();
        f.write_str(&names.join(", "))
    }
}
