//! A shard: some blocks of a run, or some drives, for one of several processes.

use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// One of several parts of a run, written `3/16`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Shard {
    /// From 1.
    pub number: usize,
    pub count: usize,
}

impl Shard {
    const MAX_SHARDS: usize = 10_000;

    /// True if the unit at that index is in this shard: units are dealt out in turn.
    pub fn takes(self, unit: usize) -> bool {
        unit % self.count == self.number - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/');
        let numbers = numbers.and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((number, count))
                if (1..=Self::MAX_SHARDS).contains(&count) && (1..=count).contains(&number) =>
            {
                Ok(Self { number, count })
            }
            _ => Err(format!(
                "expected I/N, I from 1 to N, as 3/16; N at most {}",
                Self::MAX_SHARDS
            )),
        }
    }
}

impl TryFrom<String> for Shard {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_is_in_one_shard() {
        for count in [1, 3, 16] {
            for unit in 0..100 {
                let shards = (1..=count).map(|number| Shard { number, count });
                assert_eq!(shards.filter(|shard| shard.takes(unit)).count(), 1);
            }
        }
    }

    #[test]
    fn shards_are_written_from_one() {
        assert_eq!(
            "3/16".parse(),
            Ok(Shard {
                number: 3,
                count: 16
            })
        );
        for wrong in ["0/4", "5/4", "1/0", "1", "a/b", "1/99999", "-1/4"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
