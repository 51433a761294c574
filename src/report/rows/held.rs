//! The rows of pairs as a report holds them: by columns, in chunks, so that those of millions of
//! pairs fit into memory.

use super::records::record;
use std::collections::HashMap;
use svl_score::judge::{AreaChoice, MetricSource, MetricValues, PLACES};

/// Largest number of texts of a column that are looked for: more are as good as unique.
const MAX_KNOWN: usize = 1 << 12;

/// Whole numbers in the fewest bytes that hold all of them. Narrow ones are one more than the
/// number, and 0 without one.
#[derive(Debug)]
pub enum Wholes {
    /// The number of those that are not there.
    Absent(usize),
    Bytes(Vec<u8>),
    Shorts(Vec<u16>),
    Words(Vec<u32>),
    Longs(Vec<u64>),
    /// With the greatest number.
    All(Vec<Option<u64>>),
}

impl Default for Wholes {
    fn default() -> Self {
        Self::Absent(0)
    }
}

impl Wholes {
    fn get(&self, at: usize) -> Option<u64> {
        match self {
            Self::Absent(_) => None,
            Self::Bytes(all) => u64::from(all[at]).checked_sub(1),
            Self::Shorts(all) => u64::from(all[at]).checked_sub(1),
            Self::Words(all) => u64::from(all[at]).checked_sub(1),
            Self::Longs(all) => all[at].checked_sub(1),
            Self::All(all) => all[at],
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Absent(count) => *count,
            Self::Bytes(all) => all.len(),
            Self::Shorts(all) => all.len(),
            Self::Words(all) => all.len(),
            Self::Longs(all) => all.len(),
            Self::All(all) => all.len(),
        }
    }

    fn push(&mut self, number: Option<u64>) {
        fn narrow<T: TryFrom<u64>>(all: &mut Vec<T>, number: Option<u64>) -> bool {
            let code = number.map_or(Some(0), |number| number.checked_add(1));
            let code = code.and_then(|code| T::try_from(code).ok());
            let fits = code.is_some();
            all.extend(code);
            fits
        }
        let fits = match self {
            Self::Absent(count) => {
                *count += usize::from(number.is_none());
                number.is_none()
            }
            Self::Bytes(all) => narrow(all, number),
            Self::Shorts(all) => narrow(all, number),
            Self::Words(all) => narrow(all, number),
            Self::Longs(all) => narrow(all, number),
            Self::All(all) => {
                all.push(number);
                true
            }
        };
        if !fits {
            let mut wider = match self {
                Self::Absent(_) => Self::Bytes(Vec::new()),
                Self::Bytes(_) => Self::Shorts(Vec::new()),
                Self::Shorts(_) => Self::Words(Vec::new()),
                Self::Words(_) => Self::Longs(Vec::new()),
                Self::Longs(_) | Self::All(_) => Self::All(Vec::new()),
            };
            (0..self.len()).for_each(|at| wider.push(self.get(at)));
            *self = wider;
            self.push(number);
        }
    }
}

/// Numbers: whole ones, until one is not.
#[derive(Debug)]
enum HeldNumbers {
    Wholes(Wholes),
    /// Not a number without one.
    Reals(Vec<f64>),
}

impl HeldNumbers {
    fn get(&self, at: usize) -> Option<f64> {
        match self {
            Self::Wholes(all) => all.get(at).map(|number| number as f64),
            Self::Reals(all) => Some(all[at]).filter(|number| !number.is_nan()),
        }
    }

    fn push(&mut self, number: Option<f64>) {
        // A float that is whole is exact, but -0.
        let whole = |number: f64| {
            let whole = number as u64;
            ((whole as f64).to_bits() == number.to_bits()).then_some(whole)
        };
        match (&mut *self, number) {
            (Self::Wholes(all), None) => all.push(None),
            (Self::Wholes(all), Some(number)) => match whole(number) {
                Some(whole) => all.push(Some(whole)),
                None => {
                    let before = (0..all.len()).map(|at| self.get(at).unwrap_or(f64::NAN));
                    *self = Self::Reals(before.chain([number]).collect());
                }
            },
            (Self::Reals(all), number) => all.push(number.unwrap_or(f64::NAN)),
        }
    }
}

/// Texts, of which those that repeat are held once.
#[derive(Debug, Default)]
pub struct Texts {
    all: String,
    /// End of each text.
    ends: Wholes,
    /// The place of the text of each row.
    places: Wholes,
    known: HashMap<Box<str>, u64>,
}

impl Texts {
    fn get(&self, at: usize) -> Option<&str> {
        let place = self.places.get(at)? as usize;
        let end = |place| self.ends.get(place).unwrap_or_default() as usize;
        let begin = place.checked_sub(1).map_or(0, end);
        Some(&self.all[begin..end(place)])
    }

    fn push(&mut self, text: Option<&str>) {
        let place = text.map(|text| {
            // The rows of a pair follow each other.
            let last = self.places.len().checked_sub(1);
            let last = last.filter(|last| self.get(*last) == Some(text));
            let known = last.and_then(|last| self.places.get(last));
            known
                .or_else(|| self.known.get(text).copied())
                .unwrap_or_else(|| self.add(text))
        });
        self.places.push(place);
    }

    fn add(&mut self, text: &str) -> u64 {
        let place = self.ends.len() as u64;
        self.all.push_str(text);
        self.ends.push(Some(self.all.len() as u64));
        if self.known.len() < MAX_KNOWN {
            self.known.insert(text.into(), place);
        }
        place
    }
}

/// A field of a row, as it is held.
pub trait HeldField: Sized {
    type Column: Default + std::fmt::Debug;
    type Value<'a>;

    fn push(&self, column: &mut Self::Column);

    fn get(column: &Self::Column, at: usize) -> Self::Value<'_>;

    /// The field again.
    fn restore(value: Self::Value<'_>) -> Self;
}

macro_rules! held_fields {
    ($($kind:ty: $column:ty as $value:ty, |$field:ident| $number:expr, |$held:ident| $get:expr,
        |$own:ident| $restore:expr;)*) => {$(
        impl HeldField for $kind {
            type Column = $column;
            type Value<'a> = $value;

            fn push(&self, column: &mut $column) {
                let $field = self;
                column.push($number);
            }

            fn get(column: &$column, at: usize) -> Self::Value<'_> {
                let $held = column.get(at);
                $get
            }

            fn restore($own: Self::Value<'_>) -> Self {
                $restore
            }
        }
    )*};
}

held_fields! {
    String: Texts as &'a str, |text| Some(text), |text| text.unwrap_or_default(),
        |text| text.to_owned();
    Option<String>: Texts as Option<&'a str>, |text| text.as_deref(), |text| text,
        |text| text.map(str::to_owned);
    u64: Wholes as u64, |number| Some(*number), |number| number.unwrap_or_default(),
        |number| number;
    u32: Wholes as u32, |number| Some(u64::from(*number)),
        |number| number.unwrap_or_default() as u32, |number| number;
    Option<u64>: Wholes as Option<u64>, |number| *number, |number| number, |number| number;
    Option<u32>: Wholes as Option<u32>, |number| number.map(u64::from),
        |number| number.map(|number| number as u32), |number| number;
    MetricValues: HeldMetrics as HeldValues<'a>, |values| values, |values| values,
        |values| values.restore();
}

/// The metrics of rows, by the places of their values.
#[derive(Debug)]
pub struct HeldMetrics {
    places: Vec<HeldNumbers>,
    /// The area of the values that are read.
    area: AreaChoice,
}

impl Default for HeldMetrics {
    fn default() -> Self {
        let absent = || HeldNumbers::Wholes(Wholes::default());
        Self {
            places: std::iter::repeat_with(absent).take(PLACES).collect(),
            area: AreaChoice::default(),
        }
    }
}

impl HeldMetrics {
    fn push(&mut self, values: &MetricValues) {
        for (place, column) in self.places.iter_mut().enumerate() {
            column.push(values.at(place));
        }
    }

    fn get(&self, at: usize) -> HeldValues<'_> {
        HeldValues { metrics: self, at }
    }
}

/// The metrics of a row.
#[derive(Clone, Copy, Debug)]
pub struct HeldValues<'a> {
    metrics: &'a HeldMetrics,
    at: usize,
}

impl HeldValues<'_> {
    fn restore(self) -> MetricValues {
        let mut values = MetricValues::from_places(|place| self.at(place));
        values.select(self.metrics.area);
        values
    }
}

impl MetricSource for HeldValues<'_> {
    fn area(&self) -> AreaChoice {
        self.metrics.area
    }

    fn at(&self, place: usize) -> Option<f64> {
        self.metrics.places[place].get(self.at)
    }
}

/// Most rows of a chunk.
const MAX_CHUNK: usize = 1 << 16;

/// Declares a row as [`record`] does, rows of a table by columns, and a row of it.
macro_rules! held_record {
    ($(#[$about:meta])* $name:ident, $(#[$rows_about:meta])* $rows:ident,
        $(#[$row_about:meta])* $row:ident {
        $($(#[doc = $doc:literal])* $field:ident: $kind:ty,)*
    }) => {
        record! { $(#[$about])* $name { $($(#[doc = $doc])* $field: $kind,)* } }

        $(#[$rows_about])*
        #[derive(Debug, Default)]
        struct $rows {
            len: usize,
            $($field: <$kind as HeldField>::Column,)*
        }

        $(#[$row_about])*
        #[derive(Clone, Copy, Debug)]
        pub struct $row<'a> {
            rows: &'a $rows,
            at: usize,
        }

        impl $rows {
            fn push(&mut self, row: &$name) {
                $(HeldField::push(&row.$field, &mut self.$field);)*
                self.len += 1;
            }
        }

        impl<'a> $row<'a> {
            $($(#[doc = $doc])* pub fn $field(self) -> <$kind as HeldField>::Value<'a> {
                <$kind as HeldField>::get(&self.rows.$field, self.at)
            })*

            /// The row by itself.
            pub fn to_row(self) -> $name {
                $name {$($field: <$kind as HeldField>::restore(self.$field()),)*}
            }
        }
    };
}

held_record! {
    #[derive(Default)]
    /// One pair through one algorithm.
    Row,
    /// Rows of a table that follow each other, by columns.
    RowChunk,
    /// A row of a table.
    RowRef {
        /// Name of the scenario.
        scenario: String,
        /// Number of the pair in its run.
        sequence: u64,
        /// Exposure stamp of the pair.
        stamp_ns: u64,
        /// Name of the scene, empty if frames have none.
        name: String,
        /// Seed of the arena.
        seed: Option<u64>,
        /// Hash of the pair's pixels, hexadecimal.
        pair_hash: String,
        /// Label of the algorithm, as `v3:max_disparity=64`.
        algorithm: String,
        /// Hash of the algorithm and its parameters, hexadecimal.
        parameters_hash: String,
        /// Width of the images, pixels.
        width: u32,
        /// Height of the images, pixels.
        height: u32,
        /// Number of disparities that the algorithm tries per pixel, if its parameters determine
        /// it.
        disparities: Option<u32>,
        /// Time of smoothing.
        smoothing_us: Option<u64>,
        /// Time of the texture filter.
        texture_us: Option<u64>,
        /// Time of matching.
        matching_us: Option<u64>,
        /// Time of the consistency checks.
        checks_us: Option<u64>,
        /// Time of the whole pair, filters included; the times are absent for a map that others
        /// computed.
        total_us: Option<u64>,
        /// A column per metric of frames.
        metrics: MetricValues,
        /// Hash of the disparity map, hexadecimal.
        result_hash: String,
        /// Origin of the truth: exact, sensor TOPIC or board SIZE; absent without truth.
        truth: Option<String>,
        /// Name of the recording, if the scenario has recordings.
        run: Option<String>,
        /// Time of the filters, if the algorithm runs behind some.
        filters_us: Option<u64>,
        /// Perturbation of the pair, as `row_offset=0.5`; absent for an unperturbed pair.
        stress: Option<String>,
        /// Hash of everything that the result was scored on: pixels, geometry and truth,
        /// hexadecimal.
        input_hash: String,
        /// The session that matched it, as in the manifest.
        session: String,
    }
}

/// The rows of a table.
#[derive(Debug, Default)]
pub struct Rows {
    /// All but the last one have [`MAX_CHUNK`] rows: columns that grow without end are copied each
    /// time they do, and their old places stay in memory.
    chunks: Vec<RowChunk>,
    area: AreaChoice,
}

impl Rows {
    /// Adds a row.
    pub fn push(&mut self, row: &Row) {
        let last = self.chunks.last_mut();
        match last.filter(|last| last.len < MAX_CHUNK) {
            Some(last) => last.push(row),
            None => {
                let mut next = RowChunk::default();
                next.metrics.area = self.area;
                next.push(row);
                self.chunks.push(next);
            }
        }
    }

    /// Selects the area of the metrics that are read.
    pub fn select(&mut self, area: AreaChoice) {
        self.area = area;
        for chunk in &mut self.chunks {
            chunk.metrics.area = area;
        }
    }

    pub fn len(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.len).sum()
    }

    pub fn is_empty(&self) -> bool {
        self.chunks.is_empty()
    }

    /// The row at a place.
    pub(crate) fn row(&self, at: usize) -> RowRef<'_> {
        RowRef {
            rows: &self.chunks[at / MAX_CHUNK],
            at: at % MAX_CHUNK,
        }
    }

    /// The rows, in their order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = RowRef<'_>> + Clone {
        (0..self.len()).map(|at| self.row(at))
    }
}

impl Extend<Row> for Rows {
    fn extend<I: IntoIterator<Item = Row>>(&mut self, rows: I) {
        rows.into_iter().for_each(|row| self.push(&row));
    }
}

impl FromIterator<Row> for Rows {
    fn from_iter<I: IntoIterator<Item = Row>>(rows: I) -> Self {
        let mut all = Self::default();
        all.extend(rows);
        all
    }
}

/// Seed and recording of a pair's run.
pub(crate) type RunKey<'a> = (Option<u64>, Option<&'a str>);

/// The place of a row's pair.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairOrigin<'a> {
    pub(crate) seed: Option<u64>,
    pub(crate) run: Option<&'a str>,
    pub(crate) sequence: u64,
    pub(crate) stamp_ns: u64,
    name: &'a str,
}

impl Row {
    /// The place of the pair.
    pub(crate) fn origin(&self) -> PairOrigin<'_> {
        PairOrigin {
            seed: self.seed,
            run: self.run.as_deref(),
            sequence: self.sequence,
            stamp_ns: self.stamp_ns,
            name: &self.name,
        }
    }
}

impl<'a> RowRef<'a> {
    /// True if both are the same row of a table.
    pub(crate) fn is(self, other: Self) -> bool {
        std::ptr::eq(self.rows, other.rows) && self.at == other.at
    }

    /// The place of the pair.
    pub(crate) fn origin(self) -> PairOrigin<'a> {
        PairOrigin {
            seed: self.seed(),
            run: self.run(),
            sequence: self.sequence(),
            stamp_ns: self.stamp_ns(),
            name: self.name(),
        }
    }
}

impl<'a> PairOrigin<'a> {
    pub(crate) fn run_key(self) -> RunKey<'a> {
        (self.seed, self.run)
    }

    /// True for a frame of a data set.
    pub(crate) fn is_scene(self) -> bool {
        !self.name.is_empty() && self.run.is_none()
    }

    /// The stamp; a photograph has none, and follows no other.
    pub(crate) fn time_ns(self) -> Option<u64> {
        (!self.is_scene()).then_some(self.stamp_ns)
    }

    /// The name of the run, as in links to its frames.
    pub(crate) fn run_name(self) -> String {
        let seed = || self.seed.map(|seed| seed.to_string());
        self.run
            .map(str::to_owned)
            .or_else(seed)
            .unwrap_or_default()
    }

    /// The place in words.
    pub(crate) fn words(self) -> String {
        let seed = self.seed.map(|seed| format!("seed {seed}, "));
        let run = self.run.map(|run| format!("{run}, "));
        let run = seed.or(run).unwrap_or_default();
        format!("{run}frame {}", self.sequence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(numbers: &[Option<u64>]) -> Wholes {
        let mut all = Wholes::default();
        numbers.iter().for_each(|number| all.push(*number));
        all
    }

    #[test]
    fn whole_numbers_are_those_that_were_given_whatever_their_width() {
        let edges = [1 << 8, 1 << 16, 1 << 32, 0].map(|edge: u64| edge.wrapping_sub(1));
        let mut numbers = vec![None, Some(0), None];
        for edge in edges {
            for number in [edge - 1, edge] {
                numbers.extend([Some(number), None]);
                let all = held(&numbers);
                let found: Vec<_> = (0..all.len()).map(|at| all.get(at)).collect();
                assert_eq!(found, numbers);
            }
        }
        assert!(matches!(held(&[None, Some(254)]), Wholes::Bytes(_)));
        assert!(matches!(held(&[None, Some(255)]), Wholes::Shorts(_)));
        assert!(matches!(held(&[None, None]), Wholes::Absent(2)));
    }

    #[test]
    fn numbers_are_those_that_were_given() {
        let numbers = [
            None,
            Some(3.0),
            Some(0.0),
            Some(-0.0),
            None,
            Some(0.1),
            Some(f64::MAX),
        ];
        for count in 0..=numbers.len() {
            let mut all = HeldNumbers::Wholes(Wholes::default());
            numbers[..count].iter().for_each(|number| all.push(*number));
            let found = (0..count).map(|at| all.get(at).map(f64::to_bits));
            let given = numbers[..count]
                .iter()
                .map(|number| number.map(f64::to_bits));
            assert!(found.eq(given), "{all:?}");
        }
    }

    #[test]
    fn texts_that_repeat_are_held_once() {
        let mut texts = Texts::default();
        let given = [
            Some("bm"),
            Some("v3"),
            None,
            Some(""),
            Some("bm"),
            Some("é"),
            Some("é"),
        ];
        given.iter().for_each(|text| texts.push(*text));
        let found: Vec<_> = (0..given.len()).map(|at| texts.get(at)).collect();
        assert_eq!((found, texts.all.as_str()), (given.to_vec(), "bmv3é"));
        // Beyond the texts that are looked for, those of neighbours are.
        for number in 0..2 * MAX_KNOWN {
            let text = number.to_string();
            (0..2).for_each(|_| texts.push(Some(&text)));
        }
        assert_eq!(texts.ends.len(), 4 + 2 * MAX_KNOWN);
        assert_eq!(texts.get(given.len() + 2 * 5000 + 1), Some("5000"));
    }

    #[test]
    fn a_row_is_the_one_that_was_pushed() {
        let mut metrics = MetricValues::from([("right", 5.0), ("bad2", 0.25)]);
        metrics.set_in("wrong", AreaChoice::Floor, Some(300.0));
        let given = [
            Row::default(),
            Row {
                stamp_ns: u64::MAX,
                seed: Some(u64::MAX),
                run: Some("a.mcap".to_owned()),
                name: "scene".to_owned(),
                total_us: Some(70_000),
                metrics,
                ..Row::default()
            },
        ];
        let rows: Rows = given.iter().cloned().collect();
        let found: Vec<_> = rows.iter().map(RowRef::to_row).collect();
        assert_eq!(found, given);
        // Chunks are no border.
        let mut rows = Rows::default();
        rows.select(AreaChoice::Floor);
        for sequence in 0..=MAX_CHUNK as u64 {
            let row = Row {
                sequence,
                ..given[1].clone()
            };
            rows.push(&row);
        }
        assert_eq!((rows.chunks.len(), rows.len()), (2, MAX_CHUNK + 1));
        for (sequence, row) in (0..).zip(rows.iter()) {
            let found = (row.sequence(), row.metrics().get("wrong"));
            assert_eq!(found, (sequence, Some(300.0)));
        }
    }
}
