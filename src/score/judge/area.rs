//! Areas of cells by their truth: what a robot can hit, floor, and what is beyond.

use serde::{Deserialize, Serialize};
use std::str::FromStr;
use svl_core::did_you_mean;

/// Area of a cell with truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellArea {
    /// Neither floor nor beyond: what a robot can hit.
    Obstacle,
    /// Half or more of the pixels with truth are floor.
    Floor,
    /// The median is beyond the rule's `beyond_m`.
    Beyond,
    /// The rule scores disparities, which have one area.
    Pixels,
}

impl CellArea {
    const ALL: [Self; 4] = [Self::Obstacle, Self::Floor, Self::Beyond, Self::Pixels];

    pub fn name(self) -> &'static str {
        match self {
            Self::Obstacle => "obstacle",
            Self::Floor => "floor",
            Self::Beyond => "beyond",
            Self::Pixels => "pixels",
        }
    }

    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|area| area.name() == name)
    }

    /// The choice of its cells alone.
    pub fn choice(self) -> AreaChoice {
        match self {
            Self::Obstacle | Self::Pixels => AreaChoice::Obstacle,
            Self::Floor => AreaChoice::Floor,
            Self::Beyond => AreaChoice::Beyond,
        }
    }
}

/// The cells that a number is of. Where disparities are scored, all are [`AreaChoice::Obstacle`].
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum AreaChoice {
    /// That of all headline numbers.
    #[default]
    Obstacle,
    Floor,
    Beyond,
    All,
}

impl AreaChoice {
    /// Every choice: first the headline's, then the disjoint others, then all.
    pub const ALL: [Self; 4] = [Self::Obstacle, Self::Floor, Self::Beyond, Self::All];
    /// The choices whose numbers add up to those of all.
    pub const PARTS: [Self; 3] = [Self::Obstacle, Self::Floor, Self::Beyond];

    pub fn name(self) -> &'static str {
        match self {
            Self::Obstacle => "obstacle",
            Self::Floor => "floor",
            Self::Beyond => "beyond",
            Self::All => "all",
        }
    }

    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|choice| choice.name() == name)
    }

    /// True if it has the cells of an area; only all have those whose area is unknown.
    pub fn has(self, area: Option<CellArea>) -> bool {
        self == Self::All || area.is_some_and(|area| area.choice() == self)
    }
}

impl std::fmt::Display for AreaChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for AreaChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::from_name(text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name);
            let hint = did_you_mean(text, names);
            format!("there is no area '{text}'{hint}: {}", names.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_written() {
        for area in CellArea::ALL {
            assert_eq!(CellArea::from_name(area.name()), Some(area));
            let choices = AreaChoice::PARTS.into_iter();
            assert_eq!(choices.filter(|choice| choice.has(Some(area))).count(), 1);
            assert!(AreaChoice::All.has(Some(area)));
        }
        for choice in AreaChoice::ALL {
            assert_eq!(choice.name().parse(), Ok(choice));
        }
        let unknown = "flor".parse::<AreaChoice>().unwrap_err();
        assert!(unknown.contains("did you mean 'floor'"), "{unknown}");
    }
}
