//! Values of metrics, by their places.

use super::super::AreaChoice;
use super::super::measured::CaseKind;
use super::kinds::{FrameFacts, Metric, MetricOrigin, MetricTotal};
use super::table::METRICS;

/// Number of metrics that have a value for each area.
const BY_AREA: usize = {
    let (mut count, mut i) = (0, 0);
    while i < METRICS.len() {
        count += METRICS[i].by_area as usize;
        i += 1;
    }
    count
};

/// Number of the places of values: the headline's by [`METRICS`], then those over floor, over what
/// is beyond and over all.
pub const PLACES: usize = METRICS.len() + 3 * BY_AREA;
const _: () = assert!(PLACES <= u128::BITS as usize);

/// Values of a frame or a run for the metrics of [`METRICS`] that have a column: those of areas for
/// each area, of which one is selected. Most are absent, and take no memory: a report has a row per
/// pair.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MetricValues {
    /// A bit per place that has a value.
    known: u128,
    /// The values, by their places.
    values: Vec<f64>,
    selected: AreaChoice,
}

impl MetricValues {
    /// One frame of one algorithm.
    pub fn from_facts(facts: &mut FrameFacts<'_>) -> Self {
        let mut values = Self::default();
        for area in AreaChoice::ALL {
            facts.area = area;
            for metric in METRICS.iter().filter(|metric| metric.has_area(area)) {
                if let MetricOrigin::Frame { value, .. } = metric.origin {
                    values.set_in(metric.name, area, facts.value(value));
                }
            }
        }
        values
    }

    /// The values at all [`PLACES`].
    pub fn from_places(value: impl Fn(usize) -> Option<f64>) -> Self {
        let mut own = Self::default();
        for place in 0..PLACES {
            let value = value(place);
            own.known |= u128::from(value.is_some()) << place;
            own.values.extend(value);
        }
        own
    }

    /// Values of the headline.
    pub fn from_fn(value: impl Fn(&'static Metric) -> Option<f64>) -> Self {
        let mut values = Self::default();
        for metric in METRICS {
            values.set(metric.name, value(metric));
        }
        values
    }

    /// Selects the area of the values that are read.
    pub fn select(&mut self, area: AreaChoice) {
        self.selected = area;
    }

    /// True if there is a value at a place, and its index in the values, or that where it belongs.
    fn find(&self, place: usize) -> (bool, usize) {
        let before = self.known & ((1 << place) - 1);
        (self.known >> place & 1 == 1, before.count_ones() as usize)
    }

    /// Sets the value of the headline.
    pub fn set(&mut self, name: &str, value: Option<f64>) {
        self.set_in(name, AreaChoice::default(), value);
    }

    pub fn set_in(&mut self, name: &str, area: AreaChoice, value: Option<f64>) {
        let place = value_place(name, area);
        let (is_known, index) = self.find(place);
        // A mean of no values is none.
        let value = value.filter(|value| !value.is_nan());
        self.values
            .splice(index..index + usize::from(is_known), value);
        self.known &= !(1 << place);
        self.known |= u128::from(value.is_some()) << place;
    }

    /// Sets the counts of all cells to the sums of the areas', once all values are set.
    pub fn add_up(&mut self) {
        for metric in METRICS.iter().filter(|metric| metric.by_area) {
            if metric.column().is_some() {
                let parts = AreaChoice::PARTS.iter();
                let parts = parts.filter_map(|area| self.get_in(metric.name, *area));
                let sum = parts.reduce(|a, b| a + b);
                self.set_in(metric.name, AreaChoice::All, sum);
            }
        }
        self.values.shrink_to_fit();
    }
}

impl MetricSource for MetricValues {
    fn area(&self) -> AreaChoice {
        self.selected
    }

    fn at(&self, place: usize) -> Option<f64> {
        let (is_known, index) = self.find(place);
        is_known.then(|| self.values[index])
    }
}

/// Values of metrics, wherever they are stored.
pub trait MetricSource {
    /// The area of the values that are read.
    fn area(&self) -> AreaChoice;

    /// The value at one of the [`PLACES`].
    fn at(&self, place: usize) -> Option<f64>;

    /// The value of its column, in the selected area.
    ///
    /// # Panics
    /// If no metric of [`METRICS`] has that name.
    fn get(&self, name: &str) -> Option<f64> {
        self.get_in(name, self.area())
    }

    /// The value of its column in an area; that of a metric of no area in all of them.
    ///
    /// # Panics
    /// Panics as [`Self::get`] does.
    fn get_in(&self, name: &str, area: AreaChoice) -> Option<f64> {
        self.at(value_place(name, area))
    }

    /// The number of the cases of a metric that counts them, in an area; those of a metric of no
    /// area are of all.
    fn whole_in(&self, metric: &Metric, area: AreaChoice) -> Option<f64> {
        let area = if metric.by_area {
            area
        } else {
            AreaChoice::All
        };
        match metric.cases {
            CaseKind::Sum(parts, _) => parts.iter().map(|part| self.get_in(part, area)).sum(),
            _ => None,
        }
    }

    /// The metric: its column, or the fraction it stands for; `None` if the denominator is 0.
    fn value(&self, metric: &Metric) -> Option<f64> {
        self.value_in(metric, self.area())
    }

    /// [`Self::value`] in an area.
    fn value_in(&self, metric: &Metric, area: AreaChoice) -> Option<f64> {
        let value = self.get_in(metric.name, area)?;
        match self.parts_in(metric, area) {
            // A frame with only unknown truths has cells, but none that could be right.
            Some([part, whole]) => (whole > 0.0).then(|| part / whole),
            None if matches!(metric.column(), Some((_, MetricTotal::Share))) => None,
            None => Some(value),
        }
    }

    /// The part and the whole of a share in an area; `None` of other metrics. Known cells are of
    /// the scored ones of the selected area, where cells are scored.
    fn parts_in(&self, metric: &Metric, area: AreaChoice) -> Option<[f64; 2]> {
        if metric.name == "known" {
            let counts = ["right", "wrong", "unknown"].map(|name| self.get(name));
            let [Some(right), Some(wrong), Some(unknown)] = counts else {
                return None;
            };
            return Some([right + wrong, right + wrong + unknown]);
        }
        let part = self.get_in(metric.name, area)?;
        let is_share = matches!(metric.column(), Some((_, MetricTotal::Share)));
        Some([part, self.whole_in(metric, area).filter(|_| is_share)?])
    }
}

/// The place of a metric in [`METRICS`].
fn place(name: &str) -> usize {
    let place = METRICS.iter().position(|metric| metric.name == name);
    place.expect("a metric of METRICS")
}

/// The place of a metric among those that have a value for each area; `None` for the others.
fn area_place(place: usize) -> Option<usize> {
    let before = || METRICS[..place].iter().filter(|metric| metric.by_area);
    METRICS[place].by_area.then(|| before().count())
}

/// The place of a metric's value in an area; that of a metric of no area is the same in all.
fn value_place(name: &str, area: AreaChoice) -> usize {
    let place = place(name);
    match area_place(place).zip((area as usize).checked_sub(1)) {
        Some((own, area)) => METRICS.len() + area * BY_AREA + own,
        None => place,
    }
}

impl<const N: usize> From<[(&str, f64); N]> for MetricValues {
    fn from(values: [(&str, f64); N]) -> Self {
        let mut metrics = Self::default();
        for (name, value) in values {
            metrics.set(name, Some(value));
        }
        metrics.add_up();
        metrics
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_of_an_area_is_read_where_the_area_is_selected() {
        let mut values = MetricValues::from([("right", 3.0), ("missed", 1.0)]);
        values.set_in("right", AreaChoice::Floor, Some(5.0));
        values.add_up();
        let selected = |area| {
            let mut values = values.clone();
            values.select(area);
            values
        };
        let right = |area| selected(area).get("right");
        let expected = [Some(3.0), Some(5.0), None, Some(8.0)];
        assert_eq!(AreaChoice::ALL.map(right), expected);
        // Near cells count in any area.
        let missed = |area| selected(area).get("missed");
        assert_eq!(AreaChoice::ALL.map(missed), [Some(1.0); 4]);
        // Nothing is measured where no cell is of the area.
        assert_eq!(values.get_in("wrong", AreaChoice::All), None);
        // A value that is taken away leaves the others.
        for none in [None, Some(f64::NAN)] {
            let mut fewer = values.clone();
            fewer.set("right", none);
            let left = [("right", AreaChoice::Floor), ("right", AreaChoice::All)];
            let left = left.map(|(name, area)| fewer.get_in(name, area));
            assert_eq!(left, [Some(5.0), Some(8.0)]);
            assert_eq!((fewer.get("right"), fewer.get("missed")), (None, Some(1.0)));
        }
    }

    #[test]
    fn a_share_is_of_the_whole_and_of_nothing_absent() {
        let metric = |name| Metric::find(name).unwrap();
        let values = MetricValues::from([("right", 3.0), ("wrong", 1.0), ("unknown", 4.0)]);
        assert_eq!(values.value(metric("right")), Some(0.375));
        assert_eq!(
            (values.get("right"), values.value(metric("bad1"))),
            (Some(3.0), None)
        );
        let none = MetricValues::from([("right", 0.0), ("wrong", 0.0), ("unknown", 0.0)]);
        assert_eq!(none.value(metric("right")), None);
    }
}
