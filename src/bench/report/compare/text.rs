//! A comparison on the terminal.

use super::{AlgorithmChange, Change, Comparison, Judgement, ReportOrigin};
use crate::report::summary::caution;
use std::fmt::{Display, Formatter, Result};
use svl_core::counted;
use svl_data::score::{Metric, MetricUnit};

impl Comparison {
    /// Origin of the two reports, and the reasons that forbid a judgement.
    pub(super) fn head(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let sides = [("base ", &self.base), ("other", &self.other)];
        for (((name, folder), truths), origin) in sides.iter().zip(&self.truths).zip(&self.origins)
        {
            let caution = caution(truths).map_or_else(String::new, |words| format!(": {words}"));
            lines.push(format!("{name}  {}{caution}", folder.display()));
            let ReportOrigin {
                svl,
                processor,
                isa,
                threads,
                times: _,
            } = origin;
            let threads = counted(*threads, "thread");
            lines.push(format!("       svl {svl}, {processor}, {isa}, {threads}"));
        }
        let [base, other] = &self.origins;
        let differs = [
            ("svl", base.svl != other.svl),
            ("CPU", base.processor != other.processor),
            ("instruction set", base.isa != other.isa),
            ("threads", base.threads != other.threads),
            ("what was timed", base.times != other.times),
        ];
        let differs: Vec<_> = differs.iter().filter(|d| d.1).map(|d| d.0).collect();
        if !differs.is_empty() {
            let what = differs.join(", ");
            lines.push(format!(
                "Different: {what}; ratios of times are of that, too."
            ));
        }
        let incomplete = self.incomplete.iter();
        lines.extend(
            incomplete.map(|(folder, why)| format!("{} is incomplete: {why}", folder.display())),
        );
        if !self.differences.is_empty() {
            let differences = self.differences.join("; ");
            lines.push(format!(
                "Scored differently ({differences}): nothing is called better or worse."
            ));
        }
        lines
    }
}

impl Display for Comparison {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let mut head = self.head().into_iter();
        head.try_for_each(|line| writeln!(f, "{line}"))?;
        self.algorithms
            .iter()
            .try_for_each(|algorithm| write!(f, "\n{algorithm}"))?;
        for (labels, folder) in [
            (&self.only_in_base, &self.base),
            (&self.only_in_other, &self.other),
        ] {
            if !labels.is_empty() {
                write!(
                    f,
                    "\nonly in {}, not compared: {}\n",
                    folder.display(),
                    labels.join(", ")
                )?;
            }
        }
        Ok(())
    }
}

impl AlgorithmChange {
    /// Pairs that the second run alone failed on, in words.
    pub fn failures(&self) -> Option<String> {
        let pairs = counted(self.newly_failed as u64, "pair");
        (self.newly_failed > 0).then(|| format!("failed on {pairs} that the base has results of"))
    }
}

impl Display for AlgorithmChange {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let Self {
            pairs,
            unmatched,
            equal_results,
            ..
        } = self;
        write!(
            f,
            "{}: {}, {equal_results} with equal results",
            self.title(),
            counted(*pairs, "pair")
        )?;
        if *unmatched > 0 {
            write!(
                f,
                "; not compared: {} of one run alone",
                counted(*unmatched, "pair")
            )?;
        }
        if let Some(failures) = self.failures() {
            write!(f, "; {failures}")?;
        }
        writeln!(
            f,
            "\n{:28} {:>10} {:>10} {:>10}   95 %",
            "", "base", "other", "change"
        )?;
        let mut changes = self.changes();
        changes.try_for_each(|(name, change)| line(f, &name, change))
    }
}

fn line(f: &mut Formatter<'_>, name: &str, change: &Change) -> Result {
    let Change {
        metric,
        base,
        other,
        difference,
        interval,
        judgement,
    } = change;
    let (base, other) = (metric.show(*base), metric.show(*other));
    let signed = |v: f64| signed(metric, v);
    write!(
        f,
        "  {name:26} {base:>10} {other:>10} {:>10}",
        signed(*difference)
    )?;
    match interval {
        Some((low, high)) => write!(f, "   {} .. {}", signed(*low), signed(*high))?,
        None => write!(f, "   too few pairs")?,
    }
    match verdict(*judgement) {
        "" => writeln!(f),
        word => writeln!(f, "  {word}"),
    }
}

/// A difference with its sign; of times a ratio.
pub fn signed(metric: &Metric, v: f64) -> String {
    // Rounded first, as a small negative value would be shown as -0.0.
    let is_negative = v < 0.0 && !metric.show(-v).starts_with("0.0 ");
    match metric.unit {
        MetricUnit::Ms => metric.show_relative(v),
        _ if is_negative => format!("-{}", metric.show(v.abs())),
        _ => format!("+{}", metric.show(v.abs())),
    }
}

/// A word for what was found; none where that is nothing.
pub fn verdict(judgement: Judgement) -> &'static str {
    match judgement {
        Judgement::Unclear => "",
        Judgement::Equal => "equal",
        Judgement::Better => "better",
        Judgement::Worse => "WORSE",
        Judgement::Differs => "differs",
    }
}
