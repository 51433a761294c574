//! What is measured of a cell as log odds that its report is right.

use super::CellEvidence;

/// A number of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Share of the cell that may be on the wrong side before the report is wrong, ‰.
    Margin,
    /// Share of pixels that were seen and agree with the report, ‰.
    Support,
    /// Share of pixels that were seen, ‰.
    Seen,
    /// How far the report is from the percentile, in tolerances, ‰.
    Shift,
    /// Mean matching cost, hundredths.
    Cost,
    /// Mean difference of left neighbours, hundredths of a grey level.
    Texture,
}

impl Feature {
    pub const ALL: [Self; 6] = [
        Self::Margin,
        Self::Support,
        Self::Seen,
        Self::Shift,
        Self::Cost,
        Self::Texture,
    ];
}

/// Log odds of a cell, in thousandths: a base, and per feature the score of the last of its steps
/// that it exceeds.
#[derive(Debug)]
pub struct VerdictTable {
    pub base: i64,
    /// By feature: above which value, what score.
    pub steps: [&'static [(i64, i64)]; Feature::ALL.len()],
}

impl VerdictTable {
    /// For the median of a cell (specification of v5, section 3.10).
    pub const MEDIAN: Self = Self {
        base: -131,
        steps: [
            &[
                (26, 226),
                (49, 829),
                (67, 1678),
                (83, 2336),
                (98, 2648),
                (127, 2897),
                (157, 3564),
                (239, 4278),
            ],
            &[(84, 321), (215, 451), (528, 758)],
            &[(314, 610), (364, 743), (509, 947), (640, 997)],
            &[(315, -630)],
            &[
                (313, -59),
                (325, -434),
                (359, -510),
                (372, -578),
                (412, -747),
            ],
            &[(181, -669), (326, -727)],
        ],
    };

    /// For the nearest quarter of a cell (specification of v5, near table).
    pub const NEAR: Self = Self {
        base: -1066,
        steps: [
            &[
                (10, 128),
                (28, 525),
                (44, 1142),
                (57, 1486),
                (87, 1562),
                (100, 1925),
                (153, 2438),
                (171, 2993),
                (194, 3295),
                (221, 3569),
                (240, 4390),
            ],
            &[
                (108, 66),
                (177, 571),
                (207, 763),
                (236, 1029),
                (264, 1178),
                (592, 1419),
            ],
            &[(493, 282), (578, 507), (597, 753)],
            &[(150, -75), (358, -773)],
            &[(404, -131), (414, -275), (445, -561), (460, -703)],
            &[(563, 154)],
        ],
    };

    /// The log odds that the cell's report is right, thousandths.
    pub fn score(&self, evidence: &CellEvidence) -> i64 {
        let parts = self
            .steps
            .iter()
            .zip(evidence.features)
            .map(|(steps, value)| {
                let reached = steps.iter().rev().find(|(above, _)| value > *above);
                reached.map_or(0, |(_, score)| *score)
            });
        self.base + parts.sum::<i64>()
    }
}
