//! Figures 5.8 and 5.9: the self check against the symmetric check before a close object.

use super::checks::Correlated;
use super::measure::{Spread, gray_picture, percent, right, ssdpi_picture, valid};
use super::{Context, Experiment, Finding, Value, stage};
use crate::arena::ArenaConfig;
use crate::error::Result;
use crate::report::plot::{Axis, Chart, Form, Series};
use crate::stereo::{DisparityMap, Frame};

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["5.9", "5.8"],
    title: "Self check against symmetric check",
    claim: "Before a close object the symmetric check drops 55 % of all matches and the self check 35 %, and the mean and \
            median SSDPI are comparable (section 5.3.3).",
    method: "The close object is a block turned by 35° with a ball beside it, 0.2 m before the arena's stereo head (the \
             thesis held a hand there), a forest wall 1.5 m away. Both checks see the same matches, v3's; the symmetric \
             check is v1's, which lets the right image's disparity be 1 px off (0 px stands beside it). The SSDPI, as \
             ln(SSDPI + 1), is of what each check keeps: comparable is within 0.5, a factor of 1.65. Which matches were \
             right, within 2 px, the truth tells; the thesis could not.",
    records: false,
    run,
};

/// Distance of the close object.
const CLOSE_M: f64 = 0.2;
/// Distances from which it is approached, the farthest first.
const APPROACH_M: [f64; 7] = [1.0, 0.7, 0.5, 0.4, 0.3, 0.25, 0.2];
/// Difference of ln SSDPIs that is comparable.
const COMPARABLE: f64 = 0.5;

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let mut finding = Finding::default();
    let frame = context.still(&close_object(CLOSE_M))?;
    let close = Checked::of(&frame)?;
    let dropped = close.contest.dropped();
    finding.quantity("matches that the self check drops", "%", "35", dropped[0]);
    finding.quantity("matches that the symmetric check drops", "%", "55", dropped[1]);
    conditions("Before the close object", &close.contest, &mut finding);
    let mut why = format!("Before the close object {}", close.contest.words());
    let mut rows = close.contest.rows("close object").to_vec();
    let approach = approach(context, &mut finding)?;

    let mut real = Contest::default();
    let mut shares = Vec::new();
    for frame in context.real() {
        let frame = frame?;
        context.step()?;
        let scene = Checked::of(&frame)?.contest;
        let [own, symmetric] = scene.dropped();
        shares.push((symmetric, own));
        real.add(scene);
    }
    if real.matches > 0 {
        conditions("In the real scenes", &real, &mut finding);
        why += &format!("; in the real scenes {}", real.words());
        rows.extend(real.rows("real scenes"));
    }
    finding.why = why + ".";
    let table = finding.table([
        "view, check",
        "matches dropped, %",
        "mean ln SSDPI of the rest",
        "median ln SSDPI of the rest",
        "right matches dropped, %",
        "wrong among the rest, %",
    ]);
    rows.into_iter().for_each(|(name, values)| table.row(name, values));
    finding.plot(&approach)?;
    finding.plot(&both_checks(shares, dropped))?;
    finding.exhibits.push(gray_picture("the left image", frame.pair.left())?);
    finding.exhibits.push(ssdpi_picture("ln SSDPI of all matches", &close.matches)?);
    finding.exhibits.push(ssdpi_picture("ln SSDPI of what the self check keeps", &close.own)?);
    finding.exhibits.push(ssdpi_picture("ln SSDPI of what the symmetric check keeps", &close.symmetric)?);
    Ok(finding)
}

/// A block turned by 35°, a ball beside it and a wall behind.
fn close_object(ahead_m: f64) -> ArenaConfig {
    let mut config = stage::empty();
    config.world.blocks =
        vec![stage::block(ahead_m, 0.03, [0.12, 0.08, 0.14], 35.0), stage::block(1.5, 0.0, [3.0, 0.1, 0.8], 0.0)];
    config.world.balls = vec![stage::ball(ahead_m + 0.02, -0.06, 0.035)];
    config
}

/// What the checks drop while the object comes nearer.
fn approach(context: &mut Context<'_>, finding: &mut Finding) -> Result<Chart> {
    let mut dropped = Vec::new();
    for ahead_m in APPROACH_M {
        let frame = context.still(&close_object(ahead_m))?;
        dropped.push((ahead_m, Checked::of(&frame)?.contest.dropped()));
    }
    // The approach is not empty.
    if let (Some((far_m, far)), Some((near_m, near))) = (dropped.first(), dropped.last()) {
        finding.condition(
            near[1] > far[1],
            format!(
                "The nearer the object, the more the symmetric check drops: {:.1} % at {far_m} m and {:.1} % at {near_m} m.",
                far[1], near[1]
            ),
        );
    }
    let series = |name: &str, check: usize| Series {
        name: name.into(),
        form: Form::Both,
        points: dropped.iter().map(|(ahead_m, dropped)| (*ahead_m, dropped[check])).collect(),
    };
    Ok(Chart {
        title: "The same object from far to near".into(),
        x: Axis::new("distance of the object, m"),
        y: Axis { range: Some((0.0, 80.0)), ..Axis::new("matches dropped, %") },
        series: vec![series("self check", 0), series("symmetric check", 1)],
    })
}

/// Each view by what the two checks drop of it.
fn both_checks(real: Vec<(f64, f64)>, [own, symmetric]: [f64; 2]) -> Chart {
    let series = |name: &str, form, points| Series { name: name.into(), form, points };
    let axis = |label: &str| Axis { range: Some((0.0, 80.0)), ..Axis::new(label) };
    Chart {
        title: "What both checks drop".into(),
        x: axis("dropped by the symmetric check, %"),
        y: axis("dropped by the self check, %"),
        series: vec![
            series("real scenes", Form::Points, real),
            series("close object, thesis", Form::Points, vec![(55.0, 35.0)]),
            series("close object, here", Form::Points, vec![(symmetric, own)]),
            series("as much", Form::Line, vec![(0.0, 0.0), (80.0, 80.0)]),
        ],
    }
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
        let kept = |map: &DisparityMap| {
            let judged: Vec<bool> =
                frame.truth.iter().flat_map(|truth| valid(map).filter_map(|v| right(truth, &v))).collect();
            Kept {
                matches: map.valid(),
                known: judged.len(),
                good: judged.iter().filter(|right| **right).count(),
                ln_ssdpi: valid(map).map(|v| v.ln_ssdpi).collect(),
            }
        };
        let contest = Contest {
            matches: correlated.matches.valid(),
            good: kept(&correlated.matches).good,
            own: kept(&own),
            symmetric: kept(&symmetric),
            strict: kept(&strict),
        };
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
    /// By the symmetric check when disparities must be equal.
    strict: Kept,
}

/// What a check keeps.
#[derive(Clone, Debug, Default)]
struct Kept {
    matches: usize,
    /// Of them, those whose truth is known ...
    known: usize,
    /// ... and those that are right.
    good: usize,
    ln_ssdpi: Vec<f64>,
}

impl Kept {
    fn spread(&self) -> Option<Spread> {
        Spread::of(self.ln_ssdpi.iter().copied())
    }

    fn wrong_percent(&self) -> Option<f64> {
        percent(self.known - self.good, self.known)
    }

    fn add(&mut self, other: Self) {
        self.matches += other.matches;
        self.known += other.known;
        self.good += other.good;
        self.ln_ssdpi.extend(other.ln_ssdpi);
    }
}

impl Contest {
    fn add(&mut self, other: Self) {
        self.matches += other.matches;
        self.good += other.good;
        self.strict.add(other.strict);
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
        let wrong = [&self.own, &self.symmetric].map(|kept| kept.wrong_percent().unwrap_or(f64::NAN));
        format!(
            "the self check drops {own:.0} % of the matches and the symmetric check {symmetric:.0} %, and the rest has a median \
             ln SSDPI of {:.2} and {:.2}, {:.0} % and {:.0} % of it wrong",
            medians[0], medians[1], wrong[0], wrong[1]
        )
    }

    /// A line per check: matches dropped, mean and median of the rest, right ones dropped, wrong ones left.
    fn rows(&self, place: &str) -> [(String, [Value; 5]); 3] {
        let line = |name: &str, kept: &Kept| {
            let spread = kept.spread();
            let values = [
                percent(self.matches - kept.matches, self.matches),
                spread.map(|s| s.mean),
                spread.map(|s| s.median),
                percent(self.good - kept.good, self.good),
                kept.wrong_percent(),
            ];
            (format!("{place}, {name}"), values.map(Value::from))
        };
        [
            line("self check", &self.own),
            line("symmetric check", &self.symmetric),
            line("symmetric check to 0 px", &self.strict),
        ]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::Verdict;

    fn contest(own: usize, symmetric: usize, ssdpi: [f64; 2]) -> Contest {
        let kept =
            |matches: usize, ln_ssdpi: f64| Kept { matches, known: matches, good: matches, ln_ssdpi: vec![ln_ssdpi] };
        Contest {
            matches: 100,
            good: 80,
            own: kept(own, ssdpi[0]),
            symmetric: kept(symmetric, ssdpi[1]),
            strict: kept(10, 5.0),
        }
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
