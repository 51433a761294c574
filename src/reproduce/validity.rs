//! Figures 5.8 and 5.9: the self check against the symmetric check before a close object.

use super::checks::Correlated;
use super::measure::{Spread, gray_picture, percent, right, ssdpi, ssdpi_picture, valid};
use super::{Context, Experiment, Finding, stage};
use crate::error::Result;
use crate::report::plot::Bars;
use crate::stereo::{DisparityMap, Frame};

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["5.9", "5.8"],
    title: "Self check against symmetric check",
    claim: "Before a close object the symmetric check drops 55 % of all matches and the self check 35 %, and the mean and \
            median SSDPI are comparable (section 5.3.3).",
    method: "The close object is a block turned by 35° with a ball beside it, 0.22 m before the arena's stereo head (the \
             thesis held a hand there), a forest wall 1.2 m behind. Both checks see the same matches, v3's; the symmetric \
             check is v1's, which lets the right image's disparity be 1 px off (0 px stands beside it). The SSDPI, as \
             ln(SSDPI + 1), is of what each check keeps: comparable is within 0.5, a factor of 1.65. Which matches were \
             right, within 2 px, the truth tells; the thesis could not.",
    records: false,
    run,
};

/// Difference of ln SSDPIs that is comparable.
const COMPARABLE: f64 = 0.5;

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let mut config = stage::empty();
    config.world.blocks =
        vec![stage::block(0.22, 0.03, [0.12, 0.08, 0.12], 35.0), stage::block(1.2, 0.0, [3.0, 0.1, 0.6], 0.0)];
    config.world.balls = vec![stage::ball(0.24, -0.06, 0.035)];
    let frame = context.still(&config)?;
    let close = Checked::of(&frame)?;
    let mut finding = Finding::default();
    let mut bars = Vec::new();
    tell("close object", &close.contest, ["35", "55"], &mut finding);
    bars.push(("close object".to_owned(), close.contest.dropped()));
    conditions("Before the close object", &close.contest, &mut finding);
    let mut why = format!("Before the close object {}", close.contest.words());

    let mut real = Contest::default();
    for frame in context.real() {
        let frame = frame?;
        context.step()?;
        let scene = Checked::of(&frame)?.contest;
        let name = frame.name.clone().unwrap_or_default();
        bars.push((name, scene.dropped()));
        real.add(scene);
    }
    if real.matches > 0 {
        tell("real scenes", &real, ["", ""], &mut finding);
        conditions("In the real scenes", &real, &mut finding);
        why += &format!("; in the real scenes {}", real.words());
    }
    finding.why = why + ".";
    let bars = bars.into_iter().map(|(name, [own, symmetric])| (name, vec![own, symmetric])).collect::<Vec<_>>();
    for (i, title) in ["Dropped by the self check", "Dropped by the symmetric check"].into_iter().enumerate() {
        let chart = Bars {
            title: title.into(),
            label: "share of the matches, %".into(),
            parts: vec![String::new()],
            bars: bars.iter().map(|(name, shares)| (name.clone(), vec![shares[i]])).collect(),
        };
        finding.exhibits.push(super::Exhibit::Plot(chart.svg()?));
    }
    finding.exhibits.push(gray_picture("the left image", frame.pair.left())?);
    finding.exhibits.push(ssdpi_picture("ln SSDPI of all matches", &close.matches)?);
    finding.exhibits.push(ssdpi_picture("ln SSDPI of what the self check keeps", &close.own)?);
    finding.exhibits.push(ssdpi_picture("ln SSDPI of what the symmetric check keeps", &close.symmetric)?);
    Ok(finding)
}

struct Checked {
    matches: DisparityMap,
    own: DisparityMap,
    symmetric: DisparityMap,
    contest: Contest,
}

impl Checked {
    fn of(frame: &Frame) -> Result<Self> {
        let correlated = Correlated::of(&frame.pair)?;
        let (own, symmetric, strict) = (correlated.self_checked(), correlated.symmetric(1), correlated.symmetric(0));
        let good = |map: &DisparityMap| {
            let judged = frame.truth.iter().flat_map(|t| valid(map).filter_map(|v| right(t, &v)));
            judged.filter(|right| *right).count()
        };
        let kept = |map: &DisparityMap| valid(map).map(|v| v.ln_ssdpi).collect::<Vec<f64>>();
        let contest = Contest {
            matches: correlated.matches.valid(),
            good: good(&correlated.matches),
            own: Kept { matches: own.valid(), good: good(&own), ln_ssdpi: kept(&own) },
            symmetric: Kept { matches: symmetric.valid(), good: good(&symmetric), ln_ssdpi: kept(&symmetric) },
            strict: strict.valid(),
        };
        debug_assert_eq!(ssdpi([&own]), contest.own.spread());
        Ok(Self { matches: correlated.matches, own, symmetric, contest })
    }
}

/// The two checks on the same matches.
#[derive(Clone, Debug, Default)]
struct Contest {
    matches: usize,
    /// Of them, those that are right.
    good: usize,
    own: Kept,
    symmetric: Kept,
    /// Matches that the symmetric check keeps when disparities must be equal.
    strict: usize,
}

/// What a check keeps.
#[derive(Clone, Debug, Default)]
struct Kept {
    matches: usize,
    good: usize,
    ln_ssdpi: Vec<f64>,
}

impl Kept {
    fn spread(&self) -> Option<Spread> {
        Spread::of(self.ln_ssdpi.iter().copied())
    }

    fn add(&mut self, other: Self) {
        self.matches += other.matches;
        self.good += other.good;
        self.ln_ssdpi.extend(other.ln_ssdpi);
    }
}

impl Contest {
    fn add(&mut self, other: Self) {
        self.matches += other.matches;
        self.good += other.good;
        self.strict += other.strict;
        self.own.add(other.own);
        self.symmetric.add(other.symmetric);
    }

    /// Shares of the matches that self check and symmetric check drop, percent.
    fn dropped(&self) -> [f64; 2] {
        [&self.own, &self.symmetric].map(|kept| percent(self.matches - kept.matches, self.matches).unwrap_or(f64::NAN))
    }

    /// Medians of ln SSDPI of what the two keep.
    fn medians(&self) -> [f64; 2] {
        [&self.own, &self.symmetric].map(|kept| kept.spread().map_or(f64::NAN, |s| s.median))
    }

    fn words(&self) -> String {
        let ([own, symmetric], medians) = (self.dropped(), self.medians());
        format!(
            "the self check drops {own:.0} % of the matches and the symmetric check {symmetric:.0} %, with a median ln SSDPI of \
             {:.2} and {:.2}",
            medians[0], medians[1]
        )
    }
}

fn conditions(place: &str, contest: &Contest, finding: &mut Finding) {
    let ([own, symmetric], medians) = (contest.dropped(), contest.medians());
    finding.condition(
        own < symmetric,
        format!(
            "{place} the self check drops fewer matches than the symmetric check: {own:.1} % and {symmetric:.1} %."
        ),
    );
    finding.condition(
        (medians[0] - medians[1]).abs() <= COMPARABLE,
        format!(
            "{place} the median ln SSDPIs of what they keep are within {COMPARABLE}: {:.2} and {:.2}.",
            medians[0], medians[1]
        ),
    );
}

fn tell(place: &str, contest: &Contest, thesis: [&str; 2], finding: &mut Finding) {
    let dropped = contest.dropped();
    let checks = [("self check", &contest.own), ("symmetric check", &contest.symmetric)];
    for (((name, kept), dropped), thesis) in checks.into_iter().zip(dropped).zip(thesis) {
        let name = |what: &str| format!("{place}, {name}: {what}");
        let spread = kept.spread();
        finding.quantity(name("matches dropped"), "%", thesis, dropped);
        finding.quantity(name("mean ln SSDPI of the rest"), "", "", spread.map(|s| s.mean));
        finding.quantity(name("median ln SSDPI of the rest"), "", "", spread.map(|s| s.median));
        finding.quantity(name("right matches dropped"), "%", "", percent(contest.good - kept.good, contest.good));
        finding.quantity(name("wrong among the rest"), "%", "", percent(kept.matches - kept.good, kept.matches));
    }
    let strict = percent(contest.matches - contest.strict, contest.matches);
    finding.quantity(format!("{place}, symmetric check to 0 px: matches dropped"), "%", "", strict);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::Verdict;

    fn contest(own: usize, symmetric: usize, ssdpi: [f64; 2]) -> Contest {
        let kept = |matches: usize, ln_ssdpi: f64| Kept { matches, good: matches, ln_ssdpi: vec![ln_ssdpi] };
        Contest { matches: 100, good: 80, own: kept(own, ssdpi[0]), symmetric: kept(symmetric, ssdpi[1]), strict: 10 }
    }

    #[test]
    fn the_thesis_s_numbers_hold() {
        let mut finding = Finding::default();
        conditions("There", &contest(65, 45, [6.0, 6.4]), &mut finding);
        assert_eq!(finding.verdict(), Verdict::Holds);
        conditions("There", &contest(45, 65, [6.0, 6.6]), &mut finding);
        assert_eq!(finding.conditions.iter().map(|c| c.met).collect::<Vec<_>>(), [true, true, false, false]);
    }

    #[test]
    fn scenes_are_pooled_by_matches() {
        let mut sum = contest(65, 45, [6.0, 6.4]);
        sum.add(contest(85, 35, [7.0, 8.0]));
        assert_eq!(sum.dropped(), [25.0, 60.0]);
        assert_eq!((sum.good, sum.own.ln_ssdpi.len()), (160, 2));
    }
}
