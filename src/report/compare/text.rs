//! A comparison on the terminal.

use super::{AlgorithmChange, Change, Comparison, Judgement};
use crate::counted;
use crate::report::summary::caution;
use crate::score::MetricUnit;
use std::fmt::{Display, Formatter, Result};

impl Display for Comparison {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let cautions = self.truths.each_ref().map(|truths| caution(truths));
        for (name, folder, caution) in [
            ("base ", &self.base, &cautions[0]),
            ("other", &self.other, &cautions[1]),
        ] {
            write!(f, "{name}  {}", folder.display())?;
            let caution = caution.as_ref();
            writeln!(
                f,
                "{}",
                caution.map_or_else(String::new, |c| format!(": {c}"))
            )?;
        }
        for (folder, why) in &self.incomplete {
            writeln!(f, "{} is incomplete: {why}", folder.display())?;
        }
        let [base, other] = &self.truths;
        if base != other && !base.is_empty() && !other.is_empty() {
            writeln!(
                f,
                "The truths differ, and with them what counts as right: nothing is called better \
                 or worse."
            )?;
        }
        if !self.same_scenario {
            writeln!(
                f,
                "The scenarios differ, and with them what counts as right: nothing is called \
                 better or worse."
            )?;
        }
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

impl Display for AlgorithmChange {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let Self {
            algorithm,
            other_algorithm,
            same_parameters,
            pairs,
            unmatched,
            equal_results,
            ..
        } = self;
        write!(f, "{algorithm}")?;
        if other_algorithm != algorithm {
            write!(f, " → {other_algorithm}")?;
        } else if !same_parameters {
            f.write_str(" (other parameters)")?;
        }
        write!(
            f,
            ": {}, {equal_results} with equal results",
            counted(*pairs, "pair")
        )?;
        if *unmatched > 0 {
            write!(
                f,
                "; not compared: {} of one run alone",
                counted(*unmatched, "pair")
            )?;
        }
        writeln!(
            f,
            "\n{:28} {:>10} {:>10} {:>10}   95 %",
            "", "base", "other", "change"
        )?;
        for change in &self.metrics {
            line(f, change.metric.words, change)?;
        }
        for c in &self.checkpoints {
            line(
                f,
                &format!("checkpoint {} {}", c.checkpoint, c.name),
                &c.change,
            )?;
        }
        Ok(())
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
    let signed = |v: f64| match metric.unit {
        MetricUnit::Ms => metric.show_relative(v),
        // Rounded first, as a small negative value would be shown as -0.0.
        _ => format!(
            "{}{}",
            if v < 0.0 && !metric.show(-v).starts_with("0.0 ") {
                "-"
            } else {
                "+"
            },
            metric.show(v.abs())
        ),
    };
    write!(
        f,
        "  {name:26} {base:>10} {other:>10} {:>10}",
        signed(*difference)
    )?;
    if let (Some((low, high)), true) = (interval, *judgement != Judgement::Equal) {
        write!(f, "   {} .. {}", signed(*low), signed(*high))?;
    }
    let word = match judgement {
        Judgement::Equal | Judgement::Unclear => "",
        Judgement::Better => "  better",
        Judgement::Worse => "  WORSE",
        Judgement::Differs => "  differs",
    };
    writeln!(f, "{word}")
}
