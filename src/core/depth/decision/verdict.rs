//! Log odds that a cell's report is right, from the evidence on the cell.

use crate::stereo::{CellEvidence, FittedTo};
use std::borrow::Cow;

/// One piece of evidence on a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Fraction of the cell that may be on the wrong side before the report is wrong, ‰.
    Margin,
    /// Fraction of pixels that were seen and agree with the report, ‰.
    Support,
    /// Fraction of pixels that were seen, ‰.
    Seen,
    /// Distance of the report from the percentile, in tolerances, ‰.
    Shift,
    /// Mean matching cost, hundredths.
    Cost,
    /// Mean difference of left neighbours, hundredths of a grey level.
    Texture,
    /// Number of bins of true disparities for which the report is right.
    Span,
    /// With learned gaps: fraction of votes for any disparity, ‰.
    Voted,
    /// With learned gaps: fraction of votes that agree with the best of their pixel, ‰.
    Agreed,
}

impl Feature {
    /// Unit of its values, empty for a plain number.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Margin
            | Self::Support
            | Self::Seen
            | Self::Shift
            | Self::Voted
            | Self::Agreed => "‰",
            Self::Cost => "bits/100",
            Self::Texture => "grey levels/100",
            Self::Span => "px/8",
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Margin => "margin",
            Self::Support => "support",
            Self::Seen => "seen",
            Self::Shift => "shift",
            Self::Cost => "cost",
            Self::Texture => "texture",
            Self::Span => "span",
            Self::Voted => "voted",
            Self::Agreed => "agreed",
        }
    }

    pub const ALL: [Self; CellEvidence::FEATURES] = [
        Self::Margin,
        Self::Support,
        Self::Seen,
        Self::Shift,
        Self::Cost,
        Self::Texture,
        Self::Span,
        Self::Voted,
        Self::Agreed,
    ];

    /// True if only the votes of learned gaps have it.
    pub fn needs_gaps(self) -> bool {
        matches!(self, Self::Voted | Self::Agreed)
    }
}

/// The runs that the tables of revision 1 were fitted to (specification of v5, section 7).
const REVISION_1: FittedTo = FittedTo::built_in(&[
    Cow::Borrowed("arena seed 4..6"),
    Cow::Borrowed("arena seed 31"),
]);

/// Those of revision 2, and of revision 3 (docs/results/v5.md has the commands).
const REVISION_2: FittedTo = FittedTo::built_in(&[
    Cow::Borrowed("arena seed 4..10"),
    Cow::Borrowed("arena-row seed 4..10"),
    Cow::Borrowed("arena-gain seed 4..10"),
    Cow::Borrowed("arena-noise seed 4..10"),
    Cow::Borrowed("tsukuba"),
    Cow::Borrowed("venus"),
    Cow::Borrowed("barn1"),
    Cow::Borrowed("bull"),
    Cow::Borrowed("cones"),
    Cow::Borrowed("teddy"),
    Cow::Borrowed("middlebury2006/Art"),
    Cow::Borrowed("middlebury2006/Baby1"),
    Cow::Borrowed("middlebury2006/Books"),
    Cow::Borrowed("middlebury2006/Cloth3"),
    Cow::Borrowed("middlebury2006/Reindeer"),
    Cow::Borrowed("middlebury2006/Wood1"),
    Cow::Borrowed("middlebury2014q/Adirondack"),
    Cow::Borrowed("middlebury2014q/ArtL"),
    Cow::Borrowed("middlebury2014q/Motorcycle"),
    Cow::Borrowed("middlebury2014q/MotorcycleE"),
    Cow::Borrowed("middlebury2014q/Piano"),
    Cow::Borrowed("middlebury2014q/PianoL"),
    Cow::Borrowed("middlebury2014q/Playroom"),
]);

const REVISION_3: FittedTo = FittedTo::built_in(&[
    Cow::Borrowed("arena seed 41..60"),
    Cow::Borrowed("arena-training seed 41..60"),
    Cow::Borrowed("worlds-training seed 41..60"),
    Cow::Borrowed("shapes-training seed 41..60"),
]);

/// Greatest number in a table's file.
const MAX_VALUE: u64 = 1_000_000_000;

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct TableFile {
    rank: i64,
    base: i64,
    gaps: Option<String>,
    #[serde(default)]
    fitted_runs: Vec<String>,
    #[serde(default)]
    fitted_pairs: String,
    #[serde(default)]
    steps: std::collections::BTreeMap<String, Vec<(i64, i64)>>,
}

impl TableFile {
    #[cfg(feature = "tables")]
    fn parse(text: &str) -> Result<Self, String> {
        toml::from_str(text).map_err(|error| {
            let message = error.message().lines().next().unwrap_or_default();
            format!("is not a table of cells ({message}); `svl train cells` makes one")
        })
    }

    #[cfg(not(feature = "tables"))]
    fn parse(_: &str) -> Result<Self, String> {
        Err("svl-core reads tables of cells with its feature `tables`".to_owned())
    }
}

/// Log odds of a cell, in thousandths: a base, and per feature the score of the last of its steps
/// that it exceeds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VerdictTable {
    /// The percentile of a cell's disparities for which it is fitted.
    pub rank: i64,
    pub base: i64,
    /// Hash of the network for gaps with which it was fitted.
    pub network: Option<Cow<'static, str>>,
    /// The runs and pairs that it was fitted to.
    pub fitted: FittedTo,
    /// By feature: pairs of a value and the score above it.
    pub steps: [Cow<'static, [(i64, i64)]>; Feature::ALL.len()],
}

impl VerdictTable {
    /// For the median of a cell (specification of v5, section 3.10).
    pub const MEDIAN: Self = Self {
        rank: 50,
        network: None,
        fitted: REVISION_1,
        base: -131,
        steps: [
            Cow::Borrowed(&[
                (26, 226),
                (49, 829),
                (67, 1678),
                (83, 2336),
                (98, 2648),
                (127, 2897),
                (157, 3564),
                (239, 4278),
            ]),
            Cow::Borrowed(&[(84, 321), (215, 451), (528, 758)]),
            Cow::Borrowed(&[(314, 610), (364, 743), (509, 947), (640, 997)]),
            Cow::Borrowed(&[(315, -630)]),
            Cow::Borrowed(&[
                (313, -59),
                (325, -434),
                (359, -510),
                (372, -578),
                (412, -747),
            ]),
            Cow::Borrowed(&[(181, -669), (326, -727)]),
            Cow::Borrowed(&[]),
            Cow::Borrowed(&[]),
            Cow::Borrowed(&[]),
        ],
    };

    /// For the nearest quarter of a cell (specification of v5, near table).
    pub const NEAR: Self = Self {
        rank: 75,
        network: None,
        fitted: REVISION_1,
        base: -1066,
        steps: [
            Cow::Borrowed(&[
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
            ]),
            Cow::Borrowed(&[
                (108, 66),
                (177, 571),
                (207, 763),
                (236, 1029),
                (264, 1178),
                (592, 1419),
            ]),
            Cow::Borrowed(&[(493, 282), (578, 507), (597, 753)]),
            Cow::Borrowed(&[(150, -75), (358, -773)]),
            Cow::Borrowed(&[(404, -131), (414, -275), (445, -561), (460, -703)]),
            Cow::Borrowed(&[(563, 154)]),
            Cow::Borrowed(&[]),
            Cow::Borrowed(&[]),
            Cow::Borrowed(&[]),
        ],
    };

    /// For the median of a cell, revision 2 (docs/v5.md: fitted by `svl train cells`).
    pub const MEDIAN_2: Self = Self {
        rank: 50,
        network: None,
        fitted: REVISION_2,
        base: 2561,
        steps: [
            Cow::Borrowed(&[
                (42, 969),
                (60, 1565),
                (91, 2338),
                (127, 2887),
                (160, 3453),
                (235, 4328),
                (485, 5907),
            ]),
            Cow::Borrowed(&[
                (69, 644),
                (121, 1426),
                (183, 2526),
                (485, 3255),
                (524, 4598),
                (575, 6935),
            ]),
            Cow::Borrowed(&[(638, 310)]),
            Cow::Borrowed(&[(168, -430), (350, -1388)]),
            Cow::Borrowed(&[(357, -838), (413, -1464), (465, -2091), (500, -2729)]),
            Cow::Borrowed(&[(183, -460), (476, -1202), (897, -788), (1080, -1243)]),
            Cow::Borrowed(&[
                (9, -1567),
                (13, -2490),
                (47, -3544),
                (59, -4433),
                (83, -2650),
                (201, -1062),
                (238, 331),
            ]),
            Cow::Borrowed(&[]),
            Cow::Borrowed(&[]),
        ],
    };

    /// For the nearest quarter of a cell, revision 2.
    pub const NEAR_2: Self = Self {
        rank: 75,
        network: None,
        fitted: REVISION_2,
        base: 1175,
        steps: [
            Cow::Borrowed(&[
                (28, 1013),
                (50, 1691),
                (99, 2177),
                (127, 2534),
                (173, 3051),
                (249, 6373),
            ]),
            Cow::Borrowed(&[
                (101, 560),
                (167, 889),
                (250, 1318),
                (558, 1772),
                (666, 4007),
            ]),
            Cow::Borrowed(&[(480, 409), (556, 812), (638, 1340), (746, 2141)]),
            Cow::Borrowed(&[(155, -508), (516, -1882)]),
            Cow::Borrowed(&[(413, -859), (473, -1699), (516, -2135), (582, -2662)]),
            Cow::Borrowed(&[(550, 460), (1001, -456)]),
            Cow::Borrowed(&[
                (9, -1816),
                (11, -2633),
                (13, -4488),
                (25, -3250),
                (35, -1845),
                (49, -2520),
                (65, -1506),
                (400, 378),
            ]),
            Cow::Borrowed(&[]),
            Cow::Borrowed(&[]),
        ],
    };

    /// For the median of a cell, revision 3 (docs/results/v5.md has the commands that made it).
    pub const MEDIAN_3: Self = Self {
        rank: 50,
        network: Some(Cow::Borrowed("bfe4adebaef937f9")),
        fitted: REVISION_3,
        base: -1907,
        steps: [
            Cow::Borrowed(&[(44, 755), (102, 941), (136, 1337), (181, 1843), (261, 2308)]),
            Cow::Borrowed(&[
                (179, 963),
                (245, 1734),
                (546, 2195),
                (729, 2511),
                (986, 3831),
            ]),
            Cow::Borrowed(&[]),
            Cow::Borrowed(&[(111, -247), (363, -1251)]),
            Cow::Borrowed(&[]),
            Cow::Borrowed(&[(135, -698), (258, -117), (367, -458), (780, -288)]),
            Cow::Borrowed(&[(9, -1162), (25, -560), (93, -944), (202, -622), (323, -932)]),
            Cow::Borrowed(&[(926, 415), (976, 718), (991, 1050)]),
            Cow::Borrowed(&[
                (714, 731),
                (826, 1326),
                (892, 1766),
                (936, 2315),
                (963, 2744),
                (981, 3014),
                (993, 3892),
            ]),
        ],
    };

    /// For the nearest quarter of a cell, revision 3.
    pub const NEAR_3: Self = Self {
        rank: 75,
        network: Some(Cow::Borrowed("bfe4adebaef937f9")),
        fitted: REVISION_3,
        base: -1374,
        steps: [
            Cow::Borrowed(&[
                (32, 419),
                (61, 1131),
                (111, 1670),
                (161, 2249),
                (189, 2699),
                (219, 3305),
                (240, 4520),
                (242, 6446),
            ]),
            Cow::Borrowed(&[(282, 373), (440, 822), (639, 1042), (847, 2000)]),
            Cow::Borrowed(&[(425, 270), (761, 649)]),
            Cow::Borrowed(&[(58, -213), (145, -606), (350, -907), (488, -1386)]),
            Cow::Borrowed(&[(497, -175)]),
            Cow::Borrowed(&[(114, -428), (636, -46)]),
            Cow::Borrowed(&[
                (9, -1112),
                (29, -532),
                (37, 525),
                (53, 1174),
                (71, 698),
                (400, 908),
            ]),
            Cow::Borrowed(&[(926, 1308)]),
            Cow::Borrowed(&[(947, 416), (963, 692), (973, 1275)]),
        ],
    };

    /// Parses the table in a file: TOML with `rank`, `base`, `gaps`, the hash of a network, if the
    /// table was fitted with one, and under `[steps]` per feature a list of `[above, score]`, which
    /// rises.
    ///
    /// # Errors
    /// The fault in the text, in one line.
    pub fn parse(text: &str) -> Result<Self, String> {
        let file = TableFile::parse(text)?;
        if !(1..=99).contains(&file.rank) {
            return Err(format!("rank is {}; it is a percentile, 1..=99", file.rank));
        }
        let known = |name: &String| Feature::ALL.iter().any(|feature| feature.name() == name);
        if let Some(name) = file.steps.keys().find(|name| !known(name)) {
            let names = Feature::ALL.map(Feature::name).join(", ");
            return Err(format!("[steps] has '{name}'; expected {names}"));
        }
        for (name, steps) in &file.steps {
            if !steps.is_sorted_by(|a, b| a.0 < b.0) {
                return Err(format!("the steps of '{name}' do not rise"));
            }
            let is_large = |value: i64| value.unsigned_abs() > MAX_VALUE;
            if steps
                .iter()
                .any(|step| is_large(step.0) || is_large(step.1))
            {
                return Err(format!("'{name}' has a step beyond {MAX_VALUE}"));
            }
        }
        if file.base.unsigned_abs() > MAX_VALUE {
            return Err(format!("base is beyond {MAX_VALUE}"));
        }
        let mut steps = file.steps;
        Ok(Self {
            rank: file.rank,
            base: file.base,
            network: file.gaps.map(Cow::Owned),
            fitted: FittedTo::parse(
                file.fitted_runs.iter().map(String::as_str),
                &file.fitted_pairs,
            )?,
            steps: Feature::ALL
                .map(|feature| Cow::Owned(steps.remove(feature.name()).unwrap_or_default())),
        })
    }

    /// The table in the form that [`VerdictTable::parse`] reads.
    pub fn to_toml(&self) -> String {
        use std::fmt::Write;
        let network = self.network.as_ref();
        let gaps = network.map_or_else(String::new, |hash| format!("gaps = \"{hash}\"\n"));
        let quoted = |run: &Cow<'_, str>| run.replace('\\', "\\\\").replace('"', "\\\"");
        let runs = self.fitted.runs.iter();
        let runs: Vec<_> = runs
            .map(|run| format!("    \"{}\",\n", quoted(run)))
            .collect();
        let mut text = format!(
            "rank = {}\nbase = {}\n{gaps}{} = [\n{}]\n{} = \"{}\"\n\n[steps]\n",
            self.rank,
            self.base,
            FittedTo::RUNS,
            runs.concat(),
            FittedTo::PAIRS,
            self.fitted.pairs_text(),
        );
        let features = Feature::ALL.into_iter().zip(&self.steps);
        for (feature, steps) in features.filter(|(of, steps)| !of.needs_gaps() || !steps.is_empty())
        {
            let steps: Vec<_> = steps.iter().map(|(a, s)| format!("[{a}, {s}]")).collect();
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{} = [{}]", feature.name(), steps.join(", "));
        }
        text
    }

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

#[cfg(all(test, feature = "tables"))]
mod tests {
    use super::*;

    #[test]
    fn a_table_comes_back_from_its_file() {
        for table in [VerdictTable::MEDIAN, VerdictTable::NEAR] {
            assert_eq!(VerdictTable::parse(&table.to_toml()), Ok(table));
        }
    }

    #[test]
    fn what_is_wrong_with_a_file_is_one_line() {
        let cases = [
            ("", "missing field"),
            ("rank = 50\nbase = 1\nother = 2", "unknown field"),
            ("rank = 0\nbase = 1", "rank is 0"),
            (
                "rank = 50\nbase = 1\n[steps]\nmargins = [[1, 2]]",
                "'margins'",
            ),
            (
                "rank = 50\nbase = 1\n[steps]\ncost = [[2, 2], [1, 3]]",
                "do not rise",
            ),
            (
                "rank = 50\nbase = 1\n[steps]\ncost = [[2, 9999999999]]",
                "beyond",
            ),
            ("rank = 50\nbase = 9999999999", "base is beyond"),
        ];
        for (text, expected) in cases {
            let error = VerdictTable::parse(text).unwrap_err();
            assert!(error.contains(expected) && !error.contains('\n'), "{error}");
        }
    }
}
