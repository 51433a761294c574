//! Matchers: rectified pair to disparity map. [`MATCHERS`] is the table of algorithms.

mod blind;
mod block_matching;
mod bm;
mod dp;
#[cfg(feature = "exec")]
mod exec;
mod filtered;
mod method;
mod mirrored;
mod parameter;
mod program;
mod quotes;
mod recorded;
mod sgm;
#[doc(hidden)]
pub mod stage;
mod truth;
mod v1;
mod v2;
mod v3;
mod v4;
mod v5;

#[doc(hidden)]
pub use {
    mirrored::{match_right, mirrored},
    parameter::{Parameter, ParameterFile, Parameters, Range, Value},
    program::ProgramRecord,
    recorded::{MapPlace, MapRequest},
    v5::{GapSampler, GapWeights, V5Fault, V5Model, has_small_cells},
};

use crate::depth::decision::SafeChoice;
use crate::depth::{self, GridSettings};
use crate::error::{Error, Result, nearest};
use crate::filter::{FilterModel, Filters};
use crate::kernel::{Isa, isa};
use crate::stereo::{
    Cell, CellRule, DepthGrid, DisparityMap, FittedTo, Frame, LevelCell, RecordedMap,
    RectifiedPair, Rgb, Rig, Truth, buffer,
};
use crate::timing::Clock;
use filtered::FilteredMatcher;
use quotes::{split, unquote};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// A stereo correspondence algorithm, with its scratch memory.
pub trait Matcher: Send {
    /// Matches `pair` into `output`, whose disparity map is resized to the pair. Allocates nothing
    /// after the first pair of a size; on several threads rayon keeps a small job for each.
    ///
    /// # Errors
    /// The reason why this pair cannot be matched; the matcher stays usable.
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()>;

    /// Identity and performance of the external program, if the matcher runs one.
    #[doc(hidden)]
    fn program(&self) -> Option<ProgramRecord> {
        None
    }

    /// True if a result depends on all earlier pairs of the run. A pair that is computed once more,
    /// of the same [`MatchContext::sequence`], has the same earlier pairs and an equal result.
    fn has_run_memory(&self) -> bool {
        false
    }

    /// Forgets all earlier pairs.
    fn reset(&mut self) {}

    /// The largest disparity that it finds in pairs of a size with that many cells, pixels, where
    /// that is not its parameter `max_disparity`.
    #[doc(hidden)]
    fn range_px(&self, _size: (usize, usize), _cells: usize) -> Option<i32> {
        None
    }

    /// Remark on the pairs so far, in one line.
    #[doc(hidden)]
    fn remark(&self) -> Option<String> {
        None
    }

    /// Number of pairs it matches at once.
    fn batch(&self) -> usize {
        1
    }

    /// Announces the pairs of the next calls of [`Matcher::compute`], of one size and in their
    /// order, to a matcher that handles several at once.
    fn announce(&mut self, _pairs: &[(RectifiedPair<'_>, MatchContext<'_>)]) {}
}

/// Everything a matcher may use besides the pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchContext<'a> {
    /// Number of the pair in its run.
    pub sequence: u64,
    /// Stamp of the pair, if it has one: algorithms with a memory know by it which pairs follow
    /// each other.
    pub stamp_ns: Option<u64>,
    /// Name of the pair, if it has one.
    pub name: Option<&'a str>,
    /// Left and right in colour, of the pair's size, if the source has them.
    pub color: Option<&'a [Rgb; 2]>,
    /// The truth of the frame, only for the algorithm `truth`.
    #[doc(hidden)]
    pub truth: Option<&'a Truth>,
    /// The maps that the source has besides the images, for `topic` and `files`.
    #[doc(hidden)]
    pub maps: &'a [RecordedMap],
    /// The rig of a calibrated pair.
    pub rig: Option<Rig>,
    /// Shape of the depth grid, and the rule for a known cell.
    pub grid: GridSettings,
    /// Rule for a right cell.
    pub cells: CellRule,
    /// Threads of the pool that calls the matcher, for algorithms that start threads of their own.
    pub threads: usize,
}

impl Default for MatchContext<'_> {
    /// No rig, the thesis's grid, the default cell rule, the threads of rayon's current pool.
    fn default() -> Self {
        Self {
            sequence: 0,
            stamp_ns: None,
            name: None,
            color: None,
            truth: None,
            maps: &[],
            rig: None,
            grid: GridSettings::default(),
            cells: CellRule::default(),
            threads: rayon::current_num_threads(),
        }
    }
}

impl<'a> MatchContext<'a> {
    /// Context of a frame with those settings.
    #[doc(hidden)]
    pub fn for_frame(frame: &'a Frame, grid: GridSettings, cells: CellRule) -> Self {
        Self {
            sequence: frame.sequence,
            stamp_ns: Some(frame.stamp_ns),
            name: frame.name.as_deref(),
            color: frame.color.as_ref(),
            truth: frame.truth.as_ref(),
            maps: &frame.maps,
            rig: frame.rig().copied(),
            grid,
            cells,
            ..Self::default()
        }
    }
}

/// Output of a matcher for a pair. Reusing it for the next pair reuses its memory.
pub struct MatchOutput {
    pub disparity: DisparityMap,
    /// The depth grid, from an algorithm that computes cells itself.
    pub grid: Option<DepthGrid>,
    /// The grid before filters, from an algorithm followed by some.
    #[doc(hidden)]
    pub unfiltered: Option<DepthGrid>,
    /// The grid that the caller made of the map within the measured time, if it did.
    #[doc(hidden)]
    pub decided: Option<DepthGrid>,
    /// Attributes the time since [`MatchOutput::begin`] to stages.
    pub clock: Clock,
    /// Memory for the cells of a grid and their levels, and for the disparities of one cell.
    cells: Vec<Cell>,
    levels: Vec<LevelCell>,
    keys: Vec<i32>,
}

impl MatchOutput {
    /// An output without a grid; its map takes the size of the first pair.
    ///
    /// # Errors
    /// None: a map of one pixel is always possible.
    pub fn new() -> Result<Self> {
        DisparityMap::new(1, 1).map(Self::with_memory)
    }

    /// An output that writes its disparities into the memory of `disparity`.
    pub fn with_memory(disparity: DisparityMap) -> Self {
        Self {
            disparity,
            grid: None,
            unfiltered: None,
            decided: None,
            clock: Clock::start(),
            cells: Vec::new(),
            levels: Vec::new(),
            keys: Vec::new(),
        }
    }

    /// Starts the clock for the next pair and forgets the last grid.
    pub fn begin(&mut self) {
        self.take_back_cells();
        (self.unfiltered, self.decided) = (None, None);
        self.clock = Clock::start();
    }

    /// Buffers for the cells of a grid and their levels: those of the last grid, if there was one.
    pub(crate) fn take_cells(&mut self) -> (Vec<Cell>, Vec<LevelCell>) {
        self.take_back_cells();
        (
            std::mem::take(&mut self.cells),
            std::mem::take(&mut self.levels),
        )
    }

    /// Makes the grid of the medians, unless the algorithm answered one. Allocates nothing after
    /// the first pair.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub fn decide(&mut self, settings: GridSettings, rig: Option<&Rig>) -> Result<()> {
        if self.grid.is_none() {
            let map = self.disparity.disparity();
            let largest = depth::largest_cell(map.size(), settings.shape());
            if self.keys.len() < largest {
                self.keys = buffer(0, largest)?;
            }
            let cells = std::mem::take(&mut self.cells);
            self.grid = Some(depth::grid_with(map, settings, rig, cells, &mut self.keys));
        }
        Ok(())
    }

    fn take_back_cells(&mut self) {
        if let Some(grid) = self.grid.take() {
            (self.cells, self.levels) = grid.into_parts();
        }
    }
}

/// Kind of a matcher by what its disparities come from.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatcherKind {
    /// The images, matched in this process.
    Images,
    /// A program that the user names, with its own algorithm.
    Program,
    /// The truth of the frame.
    Truth,
    /// A map that others computed, which the source has besides the images: nothing is matched.
    Recorded,
    /// Nothing: it has no disparities.
    Blind,
}

/// An entry of [`MATCHERS`].
#[doc(hidden)]
pub struct MatcherSpec {
    pub name: &'static str,
    pub kind: MatcherKind,
    /// Other names it is known by; unique in the table, as `name` is.
    pub aliases: &'static [&'static str],
    pub summary: &'static str,
    /// Description in a few lines; may be empty.
    pub about: &'static str,
    /// Publication of the method.
    pub paper: &'static str,
    pub parameters: &'static [Parameter],
    /// Decision on the cells of the depth grid, if the matcher computes them itself by the rule
    /// that scores them.
    pub cells: Option<fn(&Parameters) -> Result<SafeChoice>>,
    /// Builds the matcher for that instruction set; the parameters are complete and within their
    /// ranges.
    pub build: fn(&Parameters, Isa) -> Result<Box<dyn Matcher>>,
}

/// Every algorithm of svl. A new one is one file and one line here.
#[doc(hidden)]
pub const MATCHERS: &[MatcherSpec] = &[
    dp::SPEC,
    v1::SPEC,
    v2::SPEC,
    v3::SPEC,
    v4::SPEC,
    v5::SPEC,
    bm::SPEC,
    sgm::SPEC,
    truth::SPEC,
    blind::SPEC,
    recorded::TOPIC,
    recorded::FILES,
    #[cfg(feature = "exec")]
    exec::SPEC,
];

/// The algorithm of that name or alias.
///
/// # Errors
/// [`Error::UnknownAlgorithm`] with the nearest name.
#[doc(hidden)]
pub fn find(name: &str) -> Result<&'static MatcherSpec> {
    MATCHERS
        .iter()
        .find(|spec| spec.names().any(|n| n == name))
        .ok_or_else(|| Error::UnknownAlgorithm {
            name: name.to_owned(),
            similar: nearest(name, MATCHERS.iter().flat_map(MatcherSpec::names))
                .into_iter()
                .collect(),
        })
}

impl MatcherSpec {
    /// True if it matches images in this process: not a program, `truth` or `blind`.
    pub fn matches_images(&self) -> bool {
        self.kind == MatcherKind::Images
    }

    /// True if it starts a program that the user names: its parameters do not say which algorithm
    /// that is.
    pub fn is_program(&self) -> bool {
        self.kind == MatcherKind::Program
    }

    /// True if it reports the truth.
    pub fn is_truth(&self) -> bool {
        self.kind == MatcherKind::Truth
    }

    /// True if it reports a map that others computed: it has no time of matching.
    pub fn is_recorded(&self) -> bool {
        self.kind == MatcherKind::Recorded
    }

    /// The parameter of that name.
    pub fn parameter(&self, name: &str) -> Option<&'static Parameter> {
        self.parameters.iter().find(|p| p.name == name)
    }

    /// The name, then the aliases.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        std::iter::once(self.name).chain(self.aliases.iter().copied())
    }
}

/// An algorithm with its parameters, as written `[LABEL=]NAME[:key=value,...]`.
#[derive(Clone)]
pub struct Algorithm {
    spec: &'static MatcherSpec,
    parameters: Parameters,
    filters: Vec<Arc<FilterModel>>,
    label: String,
}

impl std::fmt::Debug for Algorithm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.spec.name, self.parameters)?;
        self.filters
            .iter()
            .try_for_each(|filter| write!(f, "+{}", filter.kind))
    }
}

impl PartialEq for Algorithm {
    /// Equality of name, parameters, filters and label.
    fn eq(&self, other: &Self) -> bool {
        self.spec.name == other.spec.name
            && self.parameters == other.parameters
            && self.filters == other.filters
            && self.label == other.label
    }
}

impl Default for Algorithm {
    /// The algorithm used if none is named: v5.
    fn default() -> Self {
        "v5".parse().expect("it is registered")
    }
}

impl std::str::FromStr for Algorithm {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (label, written) = labelled(text)?;
        // Only the first colon: values may contain more, such as paths of programs.
        let (name, settings) = written.split_once(':').unwrap_or((written, ""));
        let spec = find(name)?;
        let parameters = Parameters::parse(spec, settings)?;
        Ok(Self {
            spec,
            parameters,
            filters: Vec::new(),
            label: label.unwrap_or(written).to_owned(),
        })
    }
}

/// Splits `LABEL=NAME[:key=value,...]` into the label, if there is one, and the rest. The label may
/// have settings after a colon, like those of a sweep: `fast:p1=20=sgm:p1=20`.
///
/// # Errors
/// [`Error::Usage`] for a label that contains characters other than letters, digits, `_`, `-` and
/// `.`, is an algorithm's own name, or that of a reference in reports.
#[doc(hidden)]
pub fn labelled(text: &str) -> Result<(Option<&str>, &str)> {
    let own = text.split([':', '=']).next().unwrap_or_default();
    let is_written =
        |(i, _): &(usize, &str)| find(text[i + 1..].split(':').next().unwrap_or_default()).is_ok();
    let end = match text.as_bytes().get(own.len()) {
        Some(b'=') => Some(own.len()),
        Some(_) if find(own).is_err() => text.match_indices('=').find(is_written).map(|(i, _)| i),
        _ => None,
    };
    let Some(end) = end else {
        return Ok((None, text));
    };
    let (label, written) = (&text[..end], &text[end + 1..]);
    let is_safe = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
    let settings = label.strip_prefix(own).unwrap_or_default();
    let are_safe = settings.chars().all(|c| is_safe(c) || ":=,".contains(c));
    if own.is_empty() || own.len() > 40 || !own.chars().all(is_safe) || !are_safe {
        let expected = "1 to 40 letters, digits, '_', '-' and '.'";
        return Err(Error::Usage(format!(
            "'{label}' is not a label of an algorithm; expected {expected}"
        )));
    }
    if find(label).is_ok() {
        return Err(Error::Usage(format!(
            "'{label}' is an algorithm's own name; give '{written}' another label"
        )));
    }
    if ["exact", "prior", "witness"].contains(&label) {
        return Err(Error::Usage(format!(
            "'{label}' is a name of svl's own in reports; give '{written}' another label"
        )));
    }
    Ok((Some(label), written))
}

/// The text of an algorithm with other paths: `file` maps each path that a parameter names, and
/// `word` each word of a command. A text that is not an algorithm is returned unchanged.
#[doc(hidden)]
pub fn with_paths(
    text: &str,
    file: &dyn Fn(&str) -> String,
    word: &dyn Fn(&str) -> String,
) -> String {
    let Ok((_, written)) = labelled(text) else {
        return text.to_owned();
    };
    let (name, settings) = written.split_once(':').unwrap_or((written, ""));
    let Ok(spec) = find(name) else {
        return text.to_owned();
    };
    let setting = |(i, setting): (usize, &str)| {
        let (name, value) = parameter::named(spec, setting, i == 0);
        let parameter = spec.parameter(name)?;
        let replaced = match parameter.range {
            Range::File | Range::Pattern if !value.is_empty() => file(unquote(value)),
            // The only text is a command.
            Range::Text { .. } => {
                let words = split(unquote(value), ' ').map(|quoted| match unquote(quoted) {
                    "" => quoted.to_owned(),
                    plain => match word(plain) {
                        same if same == plain => quoted.to_owned(),
                        path if path.contains(' ') => format!("\"{path}\""),
                        path => path,
                    },
                });
                words.collect::<Vec<_>>().join(" ")
            }
            _ => return None,
        };
        (replaced != unquote(value)).then(|| format!("{name}={}", Value::Text(replaced)))
    };
    let settings = split(settings, ',').enumerate();
    let settings = settings.map(|(i, text)| setting((i, text)).unwrap_or(text.to_owned()));
    let settings = settings.collect::<Vec<_>>().join(",");
    let head = &text[..text.len() - written.len() + name.len()];
    if settings.is_empty() {
        head.to_owned()
    } else {
        format!("{head}:{settings}")
    }
}

impl Algorithm {
    #[doc(hidden)]
    pub fn spec(&self) -> &'static MatcherSpec {
        self.spec
    }

    /// The same algorithm with that label.
    #[doc(hidden)]
    #[must_use]
    pub fn called(self, label: String) -> Self {
        Self { label, ..self }
    }

    /// The same algorithm followed by filters, at most one of a kind, which are added to its label:
    /// `v3+floor`.
    #[must_use]
    pub fn filtered(self, filters: &[Arc<FilterModel>]) -> Self {
        let names = filters.iter().map(|filter| format!("+{}", filter.kind));
        Self {
            label: self.label + &names.collect::<String>(),
            filters: filters.to_vec(),
            ..self
        }
    }

    /// The same algorithm with another value of a parameter, labelled with its text.
    ///
    /// # Errors
    /// [`Error::UnknownParameter`] and [`Error::ParameterValue`], as for a text.
    #[doc(hidden)]
    pub fn with(&self, name: &str, value: &Value) -> Result<Self> {
        let parameters = self.parameters.with(self.spec, name, value)?;
        let changed = Self {
            spec: self.spec,
            parameters,
            filters: Vec::new(),
            label: String::new(),
        };
        let label = changed.written();
        Ok(changed.called(label).filtered(&self.filters))
    }

    /// The text as accepted by every command, without filters: the name, and all that differs
    /// from the defaults.
    #[doc(hidden)]
    pub fn written(&self) -> String {
        let name = self.spec.name;
        match self.parameters.changes(self.spec) {
            changes if changes.is_empty() => name.to_owned(),
            changes => format!("{name}:{changes}"),
        }
    }

    /// The map that the source has to have for it, if it reports one.
    #[doc(hidden)]
    pub fn recorded(&self) -> Option<MapRequest> {
        MapRequest::new(self.spec, &self.parameters)
    }

    /// The filters after it.
    pub fn filters(&self) -> &[Arc<FilterModel>] {
        &self.filters
    }

    /// The label, or the text that the user wrote.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// All parameters, defaults included.
    #[doc(hidden)]
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Number of disparities searched per pixel, if the parameters determine it: from
    /// `min_disparity` or 0 to `max_disparity`.
    pub fn disparities(&self) -> Option<u32> {
        let range = self.range()?;
        u32::try_from(range.end() - range.start() + 1).ok()
    }

    /// The disparities searched, if the parameters determine them, pixels.
    pub fn range(&self) -> Option<RangeInclusive<i32>> {
        let bound = |name| match self.parameters.iter().find(|(n, _)| *n == name)? {
            (_, Value::Int(px)) => Some(*px),
            _ => None,
        };
        // Algorithms without a lower bound (dp) begin at 0.
        Some(bound("min_disparity").unwrap_or(0)..=bound("max_disparity")?)
    }

    /// The greatest disparity searched, if the parameters determine it, pixels.
    pub fn max_disparity(&self) -> Option<i32> {
        self.range().map(|range| *range.end())
    }

    /// Decision on cells, if the matcher computes them itself ([`MatcherSpec::cells`]).
    ///
    /// # Errors
    /// The errors of its parameters, such as the file of a table.
    #[doc(hidden)]
    pub fn safe_choice(&self) -> Result<Option<SafeChoice>> {
        let choice = self.spec.cells.map(|choice| choice(&self.parameters));
        choice.transpose()
    }

    /// The runs that its learned numbers were fitted to: those of its table and network, and of its
    /// filters.
    ///
    /// # Errors
    /// The errors of [`Algorithm::safe_choice`]; the fault in the facts of a filter.
    #[doc(hidden)]
    pub fn fitted(&self) -> Result<Vec<FittedTo>> {
        let choice = self.safe_choice()?;
        let mut fitted: Vec<_> = choice.map(|choice| choice.fitted).into_iter().collect();
        for filter in &self.filters {
            let fitted_filter = FittedTo::from_facts(&filter.facts);
            fitted.push(
                fitted_filter.map_err(|why| Error::Invalid(format!("{}: {why}", self.label())))?,
            );
        }
        Ok(fitted)
    }

    /// A matcher on the instruction set in use, [`crate::kernel::isa`].
    ///
    /// # Errors
    /// The errors of the algorithm's constructor, or of an `SVL_ISA` that names an instruction set
    /// this CPU lacks.
    pub fn build(&self) -> Result<Box<dyn Matcher>> {
        self.build_on(isa()?)
    }

    /// Checks that the parameters go together, by building a matcher. A program is not started for
    /// that.
    ///
    /// # Errors
    /// The errors of [`Algorithm::build`].
    pub fn check(&self) -> Result<()> {
        if self.spec.is_program() {
            return Ok(());
        }
        self.build().map(drop)
    }

    /// Matches one pair with a matcher built for it: the short form for a single pair.
    ///
    /// # Errors
    /// The errors of [`Algorithm::build`] and [`Matcher::compute`].
    pub fn match_pair(&self, pair: RectifiedPair<'_>, rig: Option<Rig>) -> Result<MatchOutput> {
        let context = MatchContext {
            rig,
            ..MatchContext::default()
        };
        let mut output = MatchOutput::new()?;
        self.build()?.compute(pair, &context, &mut output)?;
        Ok(output)
    }

    /// Rejects a too-close filter whose range begins beyond the disparities searched: those in
    /// between would be neither reported nor filtered.
    fn check_filters(&self) -> Result<()> {
        let Some(max) = self.max_disparity() else {
            return Ok(());
        };
        let ranges = self.filters.iter().filter_map(|filter| filter.range_px);
        match ranges
            .into_iter()
            .find(|range_px| *range_px > f64::from(max) + 1.0)
        {
            None => Ok(()),
            Some(range_px) => Err(Error::Usage(format!(
                "{}: tries disparities up to {max}, and its filter is for {range_px} px: set \
                 max_disparity={range_px:.0}, or train a filter with --max-disparity {max}",
                self.label
            ))),
        }
    }

    /// A matcher on a given instruction set; the result is the same on all of them.
    ///
    /// # Errors
    /// The errors of the algorithm's constructor.
    #[doc(hidden)]
    pub fn build_on(&self, isa: Isa) -> Result<Box<dyn Matcher>> {
        let matcher = (self.spec.build)(&self.parameters, isa)?;
        self.check_filters()?;
        Ok(match &self.filters[..] {
            [] => matcher,
            filters => Box::new(FilteredMatcher {
                filters: Filters::new(filters, isa)?,
                matcher,
            }),
        })
    }
}
