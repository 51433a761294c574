//! The tables of a summary: headline, all metrics, speed, checkpoints, drives, perturbations.

use crate::results::best::FAILED;
use crate::results::choice::{MAX_WRONG, answer_metrics};
use crate::results::summary::{AlgorithmSummary, CheckpointSummary, Results};
use crate::show::table::model::{Table, TableCell, TableColumn, TextColumn};
use crate::show::words::{NONE, digits, mark, number, percent, time};
use crate::subjects::accuracy::AccuracyRow;
use crate::subjects::drives::DriveSummary;
use crate::subjects::pieces::PieceRow;
use crate::subjects::references::{EXACT, PRIOR};
use crate::subjects::reliability::ReliabilityRow;
use svl_score::bootstrap::Interval;
use svl_score::judge::{Better, ColumnChoice, Metric, MetricOrigin, TruthLevel};

const TIMES: [TextColumn<AlgorithmSummary>; 2] = [
    ("ms per pair", "p50", |a| time(a.p50_ms)),
    ("ms per pair", "p99", |a| time(a.p99_ms)),
];

const SPEED: [TextColumn<AlgorithmSummary>; 14] = [
    ("", "algorithm", |a| a.algorithm.clone()),
    ("ms per pair", "p50", |a| time(a.p50_ms)),
    ("ms per pair", "p95", |a| time(a.p95_ms)),
    ("ms per pair", "p99", |a| time(a.p99_ms)),
    ("ms per pair", "max", |a| time(a.max_ms)),
    ("by size", "s/MP", |a| digits(a.time_per_mp_s)),
    ("by size", "s/GD", |a| digits(a.time_per_gd_s)),
    ("by size", "MDE/s", |a| digits(a.mde_per_s)),
    ("stages, ms", "smoothing", |a| time(a.smoothing_ms)),
    ("stages, ms", "texture", |a| time(a.texture_ms)),
    ("stages, ms", "matching", |a| time(a.matching_ms)),
    ("stages, ms", "checks", |a| time(a.checks_ms)),
    ("stages, ms", "filters", |a| {
        time(a.filters_ms.filter(|ms| *ms > 0.0))
    }),
    ("stages, ms", "other", |a| time(a.other_ms)),
];

const ACCURACY: [TextColumn<AccuracyRow>; 12] = [
    ("", "algorithm", |row| row.algorithm.clone()),
    ("", "true m", |row| row.range_words()),
    ("", "scored", |row| row.scored.to_string()),
    ("", "fill %", |row| percent(row.fill)),
    ("", "wrong %", |row| percent(row.wrong)),
    ("", "bias m", |row| metres(row.bias_m)),
    ("", "RMSE m", |row| metres(row.rmse_m)),
    ("", "median m", |row| metres(row.median_error_m)),
    ("", "AbsRel %", |row| percent(row.abs_rel)),
    ("", "noise m", |row| metres(row.noise_m)),
    ("", "flicker %", |row| percent(row.flicker)),
    ("", "resting", |row| counted_or_none(row.resting)),
];

const RELIABILITY: [TextColumn<ReliabilityRow>; 5] = [
    ("", "algorithm", |row| row.algorithm.clone()),
    ("", "predicted %", |row| {
        let ends = [row.from, row.to].map(|share| (1000.0 * share).round() / 10.0);
        format!("{}–{}", ends[0], ends[1])
    }),
    ("", "cells", |row| row.cells.to_string()),
    ("", "mean %", |row| percent(Some(row.predicted))),
    ("", "right %", |row| percent(Some(row.right))),
];

const DRIVES: [TextColumn<DriveSummary>; 13] = [
    ("", "algorithm", |d| d.algorithm.clone()),
    ("", "courses", |d| d.courses.to_string()),
    ("", "finished, %", |d| {
        let share = 100.0 * d.finished_share();
        format!("{share:.0}{}", interval(d.finished_interval, 100.0, 0))
    }),
    ("", "late", |d| d.late.to_string()),
    ("", "hits/100 m", |d| {
        rate(d.collisions_per_100m, d.collisions_interval)
    }),
    ("", "near/100 m", |d| {
        rate(d.near_misses_per_100m, d.near_misses_interval)
    }),
    ("", "first hit, m", |d| {
        let first = Some(d.first_collision_m).filter(|_| d.collisions > 0);
        rate(first, d.first_collision_interval)
    }),
    ("", "stuck", |d| d.stuck.to_string()),
    ("", "driven, m", |d| {
        format!("{:.1} of {:.1}", d.route_m, d.course_m)
    }),
    ("", "m/s", |d| format!("{:.2}", d.speed_m_per_s)),
    ("", "stood, %", |d| format!("{:.0}", 100.0 * d.stood_share)),
    ("", "latency, ms", |d| {
        d.latency_ms.map_or(NONE.to_owned(), |ms| ms.to_string())
    }),
    ("", "skipped, %", |d| {
        format!("{:.0}", 100.0 * d.skipped_share)
    }),
];

/// Terms of the columns of times, and their meanings.
const TIME_NOTES: [&str; 5] = [
    "p50, p99: median and 99th percentile; with fewer than 100 pairs p99 is the slowest pair",
    "s/MP, s/GD: seconds per million pixels, and per 10⁹ pixels times disparities, of the median \
     pair",
    "MDE/s: million pixels times disparities per second, of the median pair",
    "MB: memory for the largest pair, disparity map included",
    "stages: means over the half of the pairs nearest to the median; other: the rest of the total",
];

/// The meanings of times that a table shows.
fn with_time_notes(table: Table) -> Table {
    let is_of = |note: &&str| {
        let term = note.split(": ").next().unwrap_or_default();
        table.columns.iter().any(|column| {
            column.group.starts_with(term) || term.split(", ").any(|part| part == column.head)
        })
    };
    let notes: Vec<_> = TIME_NOTES.into_iter().filter(is_of).collect();
    table.with_notes(&notes)
}

/// A number of cases; none is no number.
fn counted_or_none(cases: u64) -> String {
    match cases {
        0 => NONE.to_owned(),
        cases => cases.to_string(),
    }
}

fn metres(value: Option<f64>) -> String {
    // A number that rounds to 0 has no sign.
    let shown = |v: f64| format!("{:.3}", (1000.0 * v).round() / 1000.0 + 0.0);
    value.map_or_else(|| NONE.to_owned(), shown)
}

/// An interval in brackets; nothing without one.
fn interval(interval: Option<Interval>, scale: f64, digits: usize) -> String {
    interval.map_or_else(String::new, |(low, high)| {
        format!(" ({:.digits$}–{:.digits$})", scale * low, scale * high)
    })
}

fn rate(value: Option<f64>, range: Option<Interval>) -> String {
    let words = |value| format!("{value:.1}{}", interval(range, 1.0, 1));
    value.map_or_else(|| NONE.to_owned(), words)
}

/// Errors of distances by range: those of cells, then those of pixels.
pub(crate) fn accuracy_tables(rows: impl Iterator<Item = AccuracyRow>) -> Vec<Table> {
    let (pixels, cells): (Vec<_>, Vec<_>) = rows.partition(|row| row.is_of_pixels);
    let title = "Error against distance";
    let pixels = accuracy_table(&format!("{title}: pixels"), &pixels);
    let pixels = pixels.map(|table| {
        table.with_notes(&[
            "pixels: about 4800 of each pair, of which those that both cameras see are scored; \
             wrong by the tolerance of a cell; the median to a twentieth",
        ])
    });
    let cells = accuracy_table(title, &cells);
    cells.into_iter().chain(pixels).collect()
}

/// Errors by range; none without any.
fn accuracy_table(title: &str, rows: &[AccuracyRow]) -> Option<Table> {
    let mut table = Table::from_items(title, &ACCURACY, rows);
    table.columns[1].is_text = true;
    table.remove_empty_columns();
    let mut notes = vec!["fill, wrong: fractions of the scored"];
    if table.columns.iter().any(|column| column.head == "resting") {
        notes.push(
            "noise, flicker: of the resting cells, whose true distance changes by at most 1 % \
             from an answer to the next",
        );
    }
    table.with_notes(&notes).if_any()
}

impl Results {
    /// The metrics of the columns that are shown per algorithm, the best first.
    pub fn headline(&self) -> Table {
        self.metric_table(&self.shown.columns)
    }

    /// Every metric that was measured, with pairs and memory.
    pub fn all_metrics(&self) -> Table {
        self.metric_table(&ColumnChoice::All)
    }

    /// Errors of distances by range: those of cells, then those of pixels.
    pub fn accuracy_tables(&self) -> Vec<Table> {
        let ranked = self.ranked_algorithms().into_iter();
        let rows = ranked.flat_map(|a| {
            let own = self.accuracy.iter();
            own.filter(|row| row.algorithm == a.algorithm)
        });
        let area = self.basis.area;
        accuracy_tables(
            rows.filter(|row| row.is_of_pixels || row.area == area)
                .cloned(),
        )
    }

    /// Right cells by the probability that an algorithm gives them.
    pub(crate) fn reliability_table(&self) -> Option<Table> {
        let rows = || self.reliability.iter();
        let ranked = self.ranked_algorithms().into_iter();
        let own = ranked.flat_map(|a| rows().filter(|row| row.algorithm == a.algorithm));
        let mut table = Table::from_items("Reliability of probabilities", &RELIABILITY, own);
        table.columns[1].is_text = true;
        let table = table.with_notes(&["cells: known and scored, with a probability"]);
        table.if_any()
    }

    /// Delays of the topics whose maps were scored.
    pub fn latency_table(&self) -> Option<Table> {
        let heads = ["p50", "p99", "images p50", "images p99"];
        let mut table = Table::new("Latency on the robot, ms", "topic").with_columns(heads);
        for delay in &self.latency {
            let delays = [delay.topic_ms, delay.images_ms].into_iter();
            let delays = delays.flat_map(|pair| [0, 1].map(|i| pair.map(|ms| ms[i])));
            let run = delay.run.as_ref().filter(|_| self.basis.scope.runs > 1);
            let run = run.map_or_else(String::new, |run| format!(" {run}"));
            let topic = format!("{}{run}", delay.topic);
            table.push(topic, delays.map(|ms| rate(ms, None)));
        }
        let table = table.with_notes(&[
            "latency: log time minus stamp: exposure, transport and processing on the robot, as \
             recorded; the difference to that of the images is what the depth cost",
        ]);
        table.if_any()
    }

    /// The reaches of test pieces: algorithms by sizes, and what they cost.
    pub fn piece_table(&self) -> Option<Table> {
        let names = self.ranked_algorithms().into_iter();
        let names: Vec<_> = names.map(|a| a.algorithm.as_str()).chain([EXACT]).collect();
        let own = |name: &str| {
            self.pieces
                .iter()
                .filter(|row| row.algorithm == name)
                .collect()
        };
        let rows: Vec<Vec<&PieceRow>> = names.into_iter().map(own).collect();
        let mut table = Table::new("Test pieces", "");
        for piece in rows.last()? {
            table
                .columns
                .push(TableColumn::new("always seen from, m", piece.size()));
        }
        for head in ["false cells", "by chance %", "stops per 100 m"] {
            table.columns.push(TableColumn::new("cost", head));
        }
        for own in rows.iter().filter(|own| !own.is_empty()) {
            let reach = |row: &&PieceRow| match (row.reach_m, row.median_m) {
                (Some(reach), _) => format!("{reach:.2}"),
                (None, Some(median)) => format!("({median:.2})"),
                (None, None) => NONE.to_owned(),
            };
            let mean = |value: fn(&PieceRow) -> Option<f64>| {
                let values = own.iter().filter_map(|row| value(row));
                let values: Vec<_> = values.collect();
                (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
            };
            let cost = [
                rate(mean(|row| Some(row.false_cells)), None),
                percent(mean(|row| row.by_chance)),
                rate(mean(|row| row.stops_per_100m), None),
            ];
            table.push(own[0].algorithm.clone(), own.iter().map(reach).chain(cost));
        }
        let table = table.with_notes(&[
            "always seen from: the distance from which 95 % of the approaches see the piece in \
             every pair, with a confidence of 95 %; in brackets the median of fewer than 59 \
             approaches; exact: the limit of the cells",
            "false cells: cells of a pair that are reported nearer than anything in them; by \
             chance: pairs whose mirrored cells, without the piece, report the same; stops: pairs \
             with a false cell ahead, nearer than clear space",
        ]);
        table.if_any()
    }

    /// The algorithms in the order of tables: the user's, else by right minus wrong where true
    /// distances are known, else by the first column that has a better direction.
    pub fn ranked_algorithms(&self) -> Vec<&AlgorithmSummary> {
        if self.shown.sort.is_some() {
            return self.algorithms.iter().collect();
        }
        let keyed = self.algorithms.iter().map(|a| {
            let merit = self.merit(a);
            let is_absent = self.basis.common.is_absent(&a.algorithm);
            ((merit.is_none(), is_absent), merit.unwrap_or_default(), a)
        });
        let mut keyed: Vec<_> = keyed.collect();
        // Stable: those without a value are last, behind those that answered less than half.
        keyed.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
        keyed.into_iter().map(|(.., a)| a).collect()
    }

    /// The number that the algorithms are ranked by: more is better.
    pub(crate) fn merit(&self, a: &AlgorithmSummary) -> Option<f64> {
        let metric = self.first_metric()?;
        let value = |name| a.value(Metric::find(name)?);
        if self.kind() == TruthLevel::Distances {
            return Some(value("right")? - value("wrong")?);
        }
        let value = self.value(&a.algorithm, metric, None)?;
        Some(match metric.better {
            Better::Less => -value,
            Better::Zero => -value.abs(),
            Better::More | Better::Neither => value,
        })
    }

    /// That number in words.
    pub(crate) fn merit_words(&self) -> Option<&'static str> {
        match self.kind() {
            TruthLevel::Distances => Some("right minus wrong"),
            _ => Some(self.first_metric()?.words),
        }
    }

    /// The order in words; none if the user chose it, and an algorithm has that metric.
    pub(crate) fn order_words(&self) -> Option<String> {
        let Some(metric) = self.shown.sort else {
            return Some(format!("sorted by {}", self.merit_words()?));
        };
        let mut values = self.algorithms.iter().map(|a| a.value(metric));
        let words = format!("not sorted: {} is not measured", metric.name);
        values.all(|value| value.is_none()).then_some(words)
    }

    /// The first column that has a better direction.
    pub(crate) fn first_metric(&self) -> Option<&'static Metric> {
        let mut metrics = self.shown.columns.metrics(self.kind()).into_iter();
        metrics.find(|metric| metric.better != Better::Neither)
    }

    /// The algorithms that have a result, in that order.
    fn measured(&self) -> impl Iterator<Item = &AlgorithmSummary> {
        let ranked = self.ranked_algorithms().into_iter();
        ranked.filter(|a| a.pairs > 0)
    }

    /// The metrics of a choice per algorithm, the best first.
    pub(crate) fn metric_table(&self, choice: &ColumnChoice) -> Table {
        let kind = self.kind();
        let is_all = *choice == ColumnChoice::All;
        let metrics = choice.metrics(kind);
        let mut ranked = self.ranked_algorithms();
        // Below the algorithms, and never among them.
        ranked.extend(&self.references);
        let value = |a: &AlgorithmSummary, metric: &Metric| self.value(&a.algorithm, metric, None);
        let is_measured = |metric: &Metric| ranked.iter().any(|a| value(a, metric).is_some());
        let mut table = Table::new("", if is_all { "algorithm" } else { "" });
        let name = |a: &&AlgorithmSummary| vec![TableCell::Text(a.algorithm.clone())];
        let mut rows: Vec<Vec<TableCell>> = ranked.iter().map(name).collect();
        let mut add = |column: TableColumn, cell: &dyn Fn(&AlgorithmSummary) -> TableCell| {
            table.columns.push(column);
            for (row, a) in rows.iter_mut().zip(&ranked) {
                row.push(cell(a));
            }
        };
        let text = |number: String| TableCell::Text(number);
        let has_few =
            |a: &AlgorithmSummary| a.pairs > 0 && self.basis.common.is_absent(&a.algorithm);
        if is_all || self.has_own_pairs() || self.algorithms.iter().any(has_few) {
            let pairs = TableColumn::new("", "pairs");
            add(pairs, &|a| text(a.pairs.to_string()));
        }
        for metric in &metrics {
            let named = |name| Metric::find(name).filter(|metric| is_measured(metric));
            if let (false, "right", Some(right), Some(wrong)) =
                (is_all, metric.name, named("right"), named("wrong"))
            {
                add(TableColumn::new(self.group(metric), ""), &|a| {
                    let shares = value(a, right).zip(value(a, wrong));
                    let bar = |(right, wrong)| TableCell::Bar { right, wrong };
                    shares.map_or_else(|| text(String::new()), bar)
                });
            }
            match metric.origin {
                MetricOrigin::Time => {
                    for (group, head, number) in TIMES {
                        let is_headline = head == "p50" && !is_all;
                        let column = TableColumn {
                            is_optional: head != "p50" && !is_all,
                            is_less_better: true,
                            ..TableColumn::new(group, head)
                        };
                        add(column, &|a| match a.p50_ms.filter(|_| is_headline) {
                            Some(ms) => TableCell::Time {
                                ms,
                                mark: self.mark(metric, &a.algorithm),
                            },
                            None => text(number(a)),
                        });
                    }
                }
                MetricOrigin::Checkpoints if !is_all => {
                    if let Some(column) = self.marks_column() {
                        add(column, &|a| match a.algorithm.as_str() {
                            PRIOR | EXACT => text(String::new()),
                            label => TableCell::Marks(self.shares(label)),
                        });
                    }
                }
                _ if is_measured(metric) => {
                    let column = TableColumn {
                        is_optional: metric.better == Better::Neither && !is_all,
                        is_less_better: metric.better == Better::Less,
                        ..TableColumn::new(self.group(metric), metric.head)
                    };
                    add(column, &|a| {
                        let mark = (!is_all).then(|| self.mark(metric, &a.algorithm));
                        metric_cell(metric, value(a, metric), &mark.unwrap_or_default())
                    });
                }
                _ => {}
            }
        }
        if is_all {
            add(TableColumn::new("", "MB"), &|a| text(digits(a.memory_mb)));
        }
        table.rows = rows;
        table.remove_empty_columns();
        self.metric_notes(&mut table, &metrics);
        with_time_notes(table)
    }

    /// The mark of an algorithm by a metric: the best, or not told apart from it; and where it
    /// failed on pairs. All marks of a column are as wide.
    fn mark(&self, metric: &Metric, label: &str) -> String {
        let lacks = |label: &str| self.basis.common.partial.contains_key(label);
        let answers = answer_metrics(self.kind());
        // Drives run beside each other, and their pairs differ.
        let is_driven = self.kind() == TruthLevel::Courses;
        let has_losses = answers.first() == Some(&metric) && !is_driven;
        let best = self.best.iter().find(|best| best.metric == metric);
        let is_marked = best.is_some() || answers.contains(&metric) && !self.has_one_algorithm();
        let mark = |label: &str| {
            let unfit = self.unfit.get(label).filter(|_| is_marked);
            let own = best.map_or("", |best| best.mark(label)).to_owned();
            own + unfit.map_or("", |own| own.mark())
                + if has_losses && lacks(label) {
                    FAILED
                } else {
                    ""
                }
        };
        let all = self.algorithms.iter().map(|a| mark(&a.algorithm).len());
        format!("{:<width$}", mark(label), width = all.max().unwrap_or(0))
    }

    /// The meanings of a table's metrics.
    fn metric_notes(&self, table: &mut Table, metrics: &[&Metric]) {
        // Obstacles have a distance, so they are counted where there is a calibration.
        let has_distances = matches!(self.kind(), TruthLevel::Distances | TruthLevel::Courses);
        let rule = self.shown.rule.for_rig(has_distances);
        let is_shown = |metric: &&&Metric| {
            let own = |column: &TableColumn| {
                column.group == self.group(metric) && column.head == metric.head
            };
            table.columns.iter().any(own)
        };
        let shown: Vec<_> = metrics.iter().filter(is_shown).collect();
        for note in shown.iter().filter_map(|metric| metric.note) {
            let (term, meaning) = note.text(rule);
            table.note(term, meaning);
        }
        if shown.iter().any(|metric| metric.by_area)
            && let Some((term, meaning)) = self.area_note()
        {
            table.note(term, meaning);
        }
        if !self.references.is_empty() {
            table.note(
                PRIOR,
                "cell averages of other seeds or blocks, no image: in each cell the median of the \
                 true disparities of the other runs, or of the other blocks of a single run",
            );
            table.note(
                EXACT,
                "the distances by which cells are scored: what it misses, any matcher misses that \
                 is right in every cell; a sensor's truth is compared with itself",
            );
        }
        if table.columns.iter().any(|own| own.group == CHECKPOINTS) {
            table.note(CHECKPOINTS, self.mark_words());
        }
    }

    /// Numbers and names of the checkpoints, in their order.
    pub(crate) fn checkpoint_names(&self) -> Vec<(u32, &str)> {
        let mut names: Vec<(u32, &str)> = Vec::new();
        for c in &self.checkpoints {
            if !names.iter().any(|(number, _)| *number == c.checkpoint) {
                names.push((c.checkpoint, &c.name));
            }
        }
        names
    }

    fn checkpoints_of<'a>(&'a self, label: &str) -> impl Iterator<Item = &'a CheckpointSummary> {
        let label = label.to_owned();
        let checkpoints = self.checkpoints.iter();
        checkpoints.filter(move |c| c.algorithm == label)
    }

    /// Per checkpoint the fraction of its frames in which an algorithm passes it.
    fn shares(&self, label: &str) -> Vec<Option<f64>> {
        let names = self.checkpoint_names().into_iter();
        let find = |number| self.checkpoints_of(label).find(|c| c.checkpoint == number);
        names.map(|(number, _)| find(number)?.share()).collect()
    }

    fn marks_column(&self) -> Option<TableColumn> {
        let names = self.checkpoint_names();
        // The column is as wide as the marks: longer numbers would not be above them.
        let number = |(i, (number, _)): (usize, &(u32, &str))| match number {
            0..10 => number.to_string(),
            _ => ((i + 1) % 10).to_string(),
        };
        let heads: Vec<_> = names.iter().enumerate().map(number).collect();
        (!names.is_empty()).then(|| TableColumn::text(CHECKPOINTS, heads.join(" ")))
    }

    fn mark_words(&self) -> String {
        let names = self.checkpoint_names();
        let names = names.iter();
        let names = names.map(|(number, name)| format!("{number} {name}"));
        let names: Vec<_> = names.collect();
        format!(
            "frames that pass: ● all, ◕ ◑ ◔ a part, ○ none, · not seen; {}",
            names.join(", ")
        )
    }

    /// Times, throughput and stages; none without pairs.
    pub fn speed_table(&self) -> Option<Table> {
        let mut table = Table::from_items("Speed", &SPEED, self.measured());
        table.remove_empty_columns();
        // One of names alone has nothing to tell.
        let is_measured = table.columns.len() > 1;
        with_time_notes(table).if_any().filter(|_| is_measured)
    }

    /// The result of the best and of the worst frame per checkpoint, and the fraction that passes;
    /// none without checkpoints.
    pub fn checkpoint_table(&self) -> Option<Table> {
        let names = self.checkpoint_names();
        let mut table = Table::new("Checkpoints", "algorithm");
        let heads = names.iter();
        let heads = heads.map(|(number, name)| format!("{number} {name}"));
        table = table.with_columns(heads.chain(["all".to_owned()]));
        for a in self.measured() {
            let own: Vec<_> = self.checkpoints_of(&a.algorithm).collect();
            let cell = |(number, _): &(u32, &str)| {
                let found = own.iter().find(|c| c.checkpoint == *number);
                found.map_or_else(|| NEVER_SEEN.to_owned(), |c| checkpoint_cell(c))
            };
            table.push(&a.algorithm, names.iter().map(cell).chain([all_cell(&own)]));
        }
        table.note(
            "✓, ✗",
            "the best, then the worst frame of all runs passes or fails; number: share of the \
             frames that pass, %; all: checkpoints whose best and whose worst frame passes",
        );
        (!names.is_empty()).then_some(table)
    }

    /// The drives with intervals over the courses; none without drives.
    pub fn drive_table(&self) -> Option<Table> {
        let table = Table::from_items("Drives", &DRIVES, &self.drives);
        let table = table.with_notes(&[
            "finished: courses whose goal was reached without a collision and without help; in \
             brackets the 95 % interval over the courses, if there are eight or more",
            "late: courses whose goal was not reached within the scenario's pairs, with help or \
             without",
            "hits, near: collisions and near misses per 100 m driven; after a collision the robot \
             is set back on the route of the driver with perfect sight, 0.3 m farther on",
            "first hit: mean distance to the first collision; a drive without one counts with its \
             whole distance",
            "stuck: number of times that the robot was stuck and was set back on the route",
            "driven: metres of the route that the robot drove itself, of its length; means over \
             the courses",
            "latency, skipped: time from a pair's stamp until its command takes effect, without \
             one the next pair; pairs that arrived while the algorithm was busy",
        ]);
        table.if_any()
    }
}

/// The value of a metric; one of more wrong cells than a usable algorithm has is an alert.
fn metric_cell(metric: &Metric, value: Option<f64>, mark: &str) -> TableCell {
    let Some(value) = value else {
        return TableCell::Text(NONE.to_owned() + mark.trim_end());
    };
    let shown = number(metric.unit, value) + mark;
    if metric.name == "wrong" && 100.0 * value > MAX_WRONG.into() {
        TableCell::Alert(shown)
    } else {
        TableCell::Text(shown)
    }
}

/// The group of the marks of checkpoints.
const CHECKPOINTS: &str = "checkpoints";

/// The cell of a checkpoint that no frame shows.
const NEVER_SEEN: &str = "not seen";

fn checkpoint_cell(c: &CheckpointSummary) -> String {
    match (c.best_passed, c.worst_passed, c.share()) {
        (Some(best), Some(worst), Some(share)) => {
            format!("{}{} {}", mark(best), mark(worst), percent(Some(share)))
        }
        _ => NEVER_SEEN.to_owned(),
    }
}

/// All checkpoints of one algorithm that some frame shows.
fn all_cell(checkpoints: &[&CheckpointSummary]) -> String {
    let seen: Vec<_> = checkpoints.iter().filter(|c| c.frames > 0).collect();
    let count = |passed: fn(&CheckpointSummary) -> Option<bool>| {
        seen.iter().filter(|c| passed(c) == Some(true)).count()
    };
    let sum =
        |count: fn(&CheckpointSummary) -> u64| seen.iter().map(|c| count(c)).sum::<u64>() as f64;
    if seen.is_empty() {
        return NEVER_SEEN.to_owned();
    }
    let share = percent(Some(sum(|c| c.passed) / sum(|c| c.frames)));
    let (best, worst) = (count(|c| c.best_passed), count(|c| c.worst_passed));
    format!("{best}/{n} {worst}/{n} {share}", n = seen.len())
}
