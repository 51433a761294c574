//! Decision on a cell: what to report, and the log odds that it is right.

use super::steps::{MAX_NUMBER, Steps, TableFault};
use super::{BINS_PER_PX, CellPixels, TimeTable, Tolerance};
use crate::stereo::{Cell, CellDepth, CellEvidence, Reason, Rig};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Evidence without which a cell is not far, though its pixels have the least disparity: gaps are
/// filled by what is farther, and plain pixels, black or saturated, match anywhere.
const SUPPORTED: (Feature, i64) = (Feature::Support, 500);
const TEXTURED: (Feature, i64) = (Feature::Texture, 200);

/// Most pixels of a far cell that equal their left neighbour, per mille: more of them may be half
/// of what votes.
const MAX_PLAIN: i64 = 250;

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
}

/// The rule that decides on cells: the disparity that is reported, and the steps that turn the
/// evidence into the log odds that it is right. Scores are thousandths of log odds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VerdictTable {
    /// The percentile of the cell's disparities to report, 1..=99: 50 is the median, 75 the nearest
    /// quarter.
    pub rank: i64,
    /// Disparities whose safety differs by at most this, thousandths of the cell, count as equal:
    /// the one nearest to that percentile is reported.
    pub slack: i64,
    /// Least score of a known cell.
    pub least_score: i64,
    /// That of a report nearer than the rule's `beyond_m`, with and without a past.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near_least_score: Option<i64>,
    pub base: i64,
    #[serde(with = "by_name")]
    pub steps: [Steps; Feature::ALL.len()],
    /// The scores of earlier reports, if they count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<TimeTable>,
}

impl VerdictTable {
    /// Parses a table: JSON with `rank`, `slack`, `least_score`, `base`, and under `steps` per
    /// feature a list of `[above, score]`; `near_least_score` and `time` may be absent.
    ///
    /// # Errors
    /// The fault in the text.
    pub fn parse(text: &str) -> Result<Self, TableFault> {
        let table: Self = serde_json::from_str(text)?;
        let near_least_score = table.near_least_score.unwrap_or_default();
        for (name, number, range) in [
            ("rank", table.rank, 1..=99),
            ("slack", table.slack, 0..=1000),
            ("base", table.base, -MAX_NUMBER..=MAX_NUMBER),
            ("least_score", table.least_score, -MAX_NUMBER..=MAX_NUMBER),
            (
                "near_least_score",
                near_least_score,
                -MAX_NUMBER..=MAX_NUMBER,
            ),
        ] {
            if !range.contains(&number) {
                return Err(TableFault::Range(name, number, range));
            }
        }
        for (feature, steps) in Feature::ALL.into_iter().zip(&table.steps) {
            steps.validate(&format!("steps.{}", feature.name()))?;
        }
        if let Some(time) = &table.time {
            time.validate()?;
        }
        Ok(table)
    }

    /// The table in the form that [`VerdictTable::parse`] reads.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("a table has only numbers and names")
    }

    /// The same table with cells known from that probability on, 0.5..1, at any distance.
    #[must_use]
    pub fn known_from(mut self, confidence: f64) -> Self {
        self.least_score = least_score(confidence);
        self.near_least_score = None;
        if let Some(time) = &mut self.time {
            time.least_score = self.least_score;
        }
        self
    }

    /// The log odds that the cell's report is right.
    pub fn score(&self, evidence: &CellEvidence) -> i64 {
        self.base + self.parts(evidence).map(|(.., score)| score).sum::<i64>()
    }

    /// Each measured feature with its value and its part of the score.
    pub fn parts(&self, evidence: &CellEvidence) -> impl Iterator<Item = (Feature, i64, i64)> {
        let values = Feature::ALL.into_iter().zip(evidence.features);
        let measured = values.zip(&self.steps).filter(|((_, value), _)| {
            // It exceeds no step.
            *value != CellEvidence::NOT_MEASURED
        });
        measured.map(|((feature, value), steps)| (feature, value, steps.score(value)))
    }

    /// The evidence on a cell and its report: of pixels that were counted, of which at least one
    /// votes.
    pub fn evidence(&self, cell: &CellPixels, tolerance: &Tolerance) -> CellEvidence {
        let (pixels, votes) = (cell.pixels, cell.votes);
        let bins = tolerance.bins();
        let all = |bin| cell.all(bin);
        let supporting = |bin| cell.supporting(bin);
        // Fraction of the cell that may be uncertain, on the side with less room. Half of the votes
        // for none count on either side.
        let rank = self.rank * votes - 50 * cell.none;
        let safe = |v: usize| {
            let [l, r] = tolerance.within(v);
            (rank - 100 * all(l)).min(100 * all(r) - rank)
        };
        let held = |v: usize| {
            let [l, r] = tolerance.within(v);
            supporting(r) - supporting(l)
        };
        let score = |v: usize| 4 * safe(v) + 100 * held(v);
        let target = cell.percentile(self.rank);
        // A bin beyond those is no better than the last of them, and farther from the percentile:
        // with a rank of 50 and more the votes for none weigh less than it.
        let reached = tolerance.reaching(cell.voted(), target as usize);
        let best = reached.clone().map(score).max().unwrap_or_default();
        let is_good =
            |v: &usize| reached.contains(v) && 10 * (best - score(*v)) <= 4 * self.slack * votes;
        // The nearest to the percentile; of two, the greater.
        let apart = (0..bins).flat_map(|apart| {
            let below = (target as usize).checked_sub(apart);
            std::iter::once(target as usize + apart).chain(below)
        });
        let report = apart.into_iter().find(is_good).unwrap_or_default();
        let report_bins = report as i64;
        let vote_share = |part: i64| match cell.agreed {
            Some(_) => 1000 * part / votes,
            None => CellEvidence::NOT_MEASURED,
        };
        CellEvidence {
            report: report_bins,
            target,
            features: [
                (10 * safe(report)).div_euclid(votes),
                1000 * held(report) / votes,
                1000 * cell.seen / pixels,
                1000 * (report_bins - target).abs() / tolerance.span(report),
                100 * cell.cost / pixels,
                25 * cell.texture.sum / pixels,
                tolerance.span(report),
                vote_share(votes - cell.none),
                vote_share(cell.agreed.unwrap_or(0)),
            ],
            plain: 1000 * cell.texture.plain / pixels,
        }
    }
}

/// The cell of a report at a level, with its score; known if `is_known` and the report has a depth;
/// far only with some support and texture. `percentiles` are the 20th and the 80th.
pub fn cell(
    evidence: &CellEvidence,
    percentiles: [i64; 2],
    (score, is_known): (i64, bool),
    level: u8,
    rig: Option<&Rig>,
) -> Cell {
    let [p20, p80] = percentiles;
    let depth = reported_depth([p20, evidence.report, p80], level, rig);
    let is_shown = |(feature, least)| evidence.features[feature as usize] >= least;
    let is_far = depth.is_some_and(|depth| depth.is_far());
    let is_textured = is_shown(TEXTURED) && evidence.plain <= MAX_PLAIN;
    // Without a report there is nothing that may be right.
    let report = depth.filter(|_| !is_far || is_shown(SUPPORTED) && is_textured);
    Cell {
        depth: report.filter(|_| is_known),
        probability: report.map(|_| probability(score)),
        reason: (is_far && !is_textured).then_some(Reason::Untextured),
        evidence: Some(*evidence),
        level,
        ..Cell::UNKNOWN
    }
}

/// The depth of a report, which is the middle of these bins of a level: of 0 only at infinity, as 0
/// stands for all that is farther than the range of disparities. `rig`: that of the pair.
pub fn reported_depth(bins: [i64; 3], level: u8, rig: Option<&Rig>) -> Option<CellDepth> {
    let px = |bin: i64| (bin << level) as f32 / BINS_PER_PX as f32;
    let depth = CellDepth::new(bins.map(px), rig);
    (bins[1] > 0 || depth.is_far()).then_some(depth)
}

/// The score from which a cell is right with that probability, 0.5..1.
pub fn least_score(confidence: f64) -> i64 {
    (1000.0 * (confidence / (1.0 - confidence)).ln() + 0.5).floor() as i64
}

/// The probability of a score.
pub fn probability(score: i64) -> f64 {
    1.0 / (1.0 + (-score as f64 / 1000.0).exp())
}

/// Steps by the names of their features; one without steps is left out.
mod by_name {
    use super::{BTreeMap, Feature, Steps};
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    type AllSteps = [Steps; Feature::ALL.len()];

    pub(super) fn serialize<S: Serializer>(steps: &AllSteps, to: S) -> Result<S::Ok, S::Error> {
        let named = Feature::ALL.into_iter().map(Feature::name).zip(steps);
        let named = named.filter(|(_, steps)| !steps.0.is_empty());
        named.collect::<BTreeMap<_, _>>().serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<AllSteps, D::Error> {
        let mut named = BTreeMap::<String, Steps>::deserialize(from)?;
        let steps = Feature::ALL.map(|feature| named.remove(feature.name()).unwrap_or_default());
        match named.keys().next() {
            None => Ok(steps),
            Some(name) => {
                let names = Feature::ALL.map(Feature::name).join(", ");
                Err(D::Error::custom(format!(
                    "steps has '{name}'; expected {names}"
                )))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::decision::StepSum;
    use crate::stereo::CellRule;

    fn table() -> VerdictTable {
        let mut steps: [Steps; Feature::ALL.len()] = Default::default();
        steps[Feature::Margin as usize] = Steps(vec![(44, 755), (102, 941)]);
        steps[Feature::Cost as usize] = Steps(vec![(313, -59)]);
        VerdictTable {
            rank: 50,
            slack: 100,
            least_score: 2197,
            near_least_score: Some(1386),
            base: -1907,
            steps,
            time: Some(TimeTable {
                least_score: 2587,
                agrees: Steps(vec![(2500, 452)]),
                farther: Steps(vec![(6000, -135)]),
                nearer: Steps::default(),
            }),
        }
    }

    #[test]
    fn a_table_comes_back_from_its_text() {
        for table in [
            table(),
            VerdictTable {
                near_least_score: None,
                time: None,
                ..table()
            },
        ] {
            assert_eq!(VerdictTable::parse(&table.to_json()).unwrap(), table);
        }
    }

    #[test]
    fn a_fault_is_one_line_with_its_key() {
        let text = table().to_json();
        let cases = [
            ("\"rank\":50", "\"rank\":0", "rank is 0"),
            ("\"rank\":50,", "", "missing field `rank`"),
            ("\"rank\"", "\"ranks\"", "unknown field `ranks`"),
            ("\"slack\":100", "\"slack\":1001", "slack is 1001"),
            ("\"margin\"", "\"margins\"", "steps has 'margins'"),
            ("102", "44", "steps.margin: its values do not rise"),
            ("-59", "-9999999999", "steps.cost: a number is beyond"),
            ("-1907", "-9999999999", "base is -9999999999"),
            ("2587", "9999999999", "time.least_score is beyond"),
            ("1386", "9999999999", "near_least_score is 9999999999"),
            ("452", "-452", "time.agrees"),
            ("-135", "135", "time.farther"),
        ];
        for (from, to, expected) in cases {
            assert!(text.contains(from), "{from}");
            let error = VerdictTable::parse(&text.replacen(from, to, 1));
            let error = error.unwrap_err().to_string();
            assert!(error.contains(expected) && !error.contains('\n'), "{error}");
        }
    }

    /// The report as the specification has it: of all bins.
    fn report_of_all(table: &VerdictTable, cell: &CellPixels, tolerance: &Tolerance) -> i64 {
        let rank = table.rank * cell.votes - 50 * cell.none;
        let score = |v: usize| {
            let [l, r] = tolerance.within(v);
            let safe = (rank - 100 * cell.all(l)).min(100 * cell.all(r) - rank);
            4 * safe + 100 * (cell.supporting(r) - cell.supporting(l))
        };
        let bins = 0..tolerance.bins();
        let best = bins.clone().map(score).max().unwrap();
        let target = cell.percentile(table.rank);
        let good = bins.filter(|v| 10 * (best - score(*v)) <= 4 * table.slack * cell.votes);
        let nearest = good.min_by_key(|v| ((*v as i64 - target).abs(), -(*v as i64)));
        nearest.unwrap() as i64
    }

    #[test]
    fn bins_without_a_vote_in_reach_change_no_report() {
        const BINS: usize = 16 * 41;
        let rig = |doffs_px| Rig::new(328.0, (160.0, 120.0), 0.044, doffs_px).unwrap();
        let narrow = CellRule::Distance {
            tolerance_m: 0.02,
            tolerance_percent: 5.0,
            obstacle_m: 0.5,
            clear_m: 0.75,
            beyond_m: None,
        };
        let rules = [
            (CellRule::default(), Some(rig(0.0))),
            (CellRule::default(), Some(rig(-3.0))),
            (CellRule::default(), Some(rig(5.0))),
            (narrow, Some(rig(0.0))),
            (CellRule::default(), None),
        ];
        let tolerances = rules.map(|(rule, rig)| Tolerance::new(rule, rig.as_ref(), 0.25, BINS));
        let tables = [(50, 100), (75, 10), (75, 100)].map(|(rank, slack)| VerdictTable {
            rank,
            slack,
            ..table()
        });
        let mut random = fastrand::Rng::with_seed(3);
        let mut cell = CellPixels::new(BINS);
        for round in 0..3000 {
            cell.clear();
            let surfaces: Vec<_> = (0..random.usize(1..4))
                .map(|_| random.i16(0..640))
                .collect();
            let (width, none) = (random.i16(1..16), random.u8(0..=255));
            for _ in 0..random.usize(1..60) {
                let surface = random.choice(&surfaces).unwrap();
                let bins = [0; 3].map(|_: i32| surface + random.i16(0..width));
                let votes = [random.u8(0..90), random.u8(0..90), random.u8(0..90)];
                let votes = votes.map(|votes| if none == 255 { 0 } else { votes });
                let votes = [votes[0], votes[1], votes[2], random.u8(0..=none).max(1)];
                cell.vote(&bins, &votes, 0);
                // Gaps that were filled vote without support.
                let seen = random.u8(0..2);
                cell.add(&bins[..1], &[seen], 0, StepSum::default());
                if none == 255 {
                    break;
                }
            }
            cell.count();
            for tolerance in &tolerances {
                for table in &tables {
                    let report = table.evidence(&cell, tolerance).report;
                    let expected = report_of_all(table, &cell, tolerance);
                    assert_eq!(report, expected, "round {round}");
                }
            }
        }
    }

    #[test]
    fn confidence_is_log_odds() {
        let table = table().known_from(0.75);
        let least = (table.least_score, table.near_least_score);
        assert_eq!(least, (1099, None));
        assert_eq!(least_score(0.75), 1099);
        assert_eq!(least_score(0.5), 0);
    }
}
