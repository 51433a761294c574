//! Plots as SVG, for reports and the thesis's figures.
//!
//! A page that holds them styles them: axes and texts take the page's colours through the class
//! `plot`.

use std::collections::{BTreeMap, BTreeSet};
use svl_files::overlay::{COLOR_COUNT, algorithm_colors, kind_of_label as kind};

/// Points under one name. Non-finite points are omitted and interrupt a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    pub name: String,
    pub form: SeriesStyle,
    pub points: Vec<(f64, f64)>,
}

/// The algorithms of a run, and their colours: those of a kind have one
/// colour where there are more algorithms than colours, and those of a sweep the shade of their
/// parameter.
pub struct AlgorithmColors<'a> {
    labels: Vec<&'a str>,
    colors: Vec<[u8; 3]>,
    shades: BTreeMap<&'a str, [u8; 3]>,
}

impl<'a> AlgorithmColors<'a> {
    pub fn new(labels: impl IntoIterator<Item = &'a str>) -> Self {
        let mut labels: Vec<_> = labels.into_iter().collect();
        if labels.len() > COLOR_COUNT {
            let mut seen = BTreeSet::new();
            labels = labels.into_iter().map(kind).collect();
            labels.retain(|label| seen.insert(*label));
        }
        Self {
            colors: algorithm_colors(&labels),
            labels,
            shades: BTreeMap::new(),
        }
    }

    /// With the colours of some of them.
    #[must_use]
    pub fn with_shades(mut self, shades: impl IntoIterator<Item = (&'a str, [u8; 3])>) -> Self {
        self.shades.extend(shades);
        self
    }

    /// The colour of an algorithm, or of a kind of algorithms.
    pub fn rgb(&self, label: &str) -> Option<[u8; 3]> {
        let place = |is: &dyn Fn(&str) -> bool| self.labels.iter().position(|own| is(own));
        let own = || place(&|own| own == label);
        let place = || own().or_else(|| place(&|own| kind(own) == kind(label)));
        let shade = self.shades.get(label).copied();
        shade.or_else(|| place().map(|place| self.colors[place]))
    }
}

impl Series {
    pub fn new(
        name: &str,
        form: SeriesStyle,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        let (name, points) = (name.to_owned(), points.into_iter().collect());
        Self { name, form, points }
    }

    /// True if the series is in the key.
    pub(super) fn is_keyed(&self) -> bool {
        let form = self.form;
        !self.name.is_empty()
            && matches!(
                form,
                SeriesStyle::Line | SeriesStyle::Points | SeriesStyle::Both
            )
    }
}

/// Drawing style of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeriesStyle {
    Line,
    Points,
    /// Points joined by lines.
    Both,
    /// Points with the series' name beside each, which is then not in the key; all such series have
    /// one colour.
    Named,
    /// [`SeriesStyle::Named`] with discs of that radius in the series' own colour.
    Disc(u32),
    /// A line without a key: captions name its points.
    Joined,
    /// Points without a key.
    Unkeyed,
    /// A dashed line without a key: it joins points of other series.
    Front,
    /// The name alone beside each point: the caption of another series, in place of a key.
    Caption,
    /// [`SeriesStyle::Caption`] where there is room: the label of a point of another series.
    Label,
}

impl SeriesStyle {
    /// Radius of its points, where they are drawn.
    pub(super) fn radius(self) -> Option<u32> {
        match self {
            Self::Points | Self::Both | Self::Unkeyed | Self::Named => Some(8),
            Self::Disc(radius) => Some(radius),
            Self::Line | Self::Joined | Self::Front | Self::Caption | Self::Label => None,
        }
    }
}

/// Width of every plot in the SVG's own units, which are whole; a page scales it, to between a
/// third and two thirds of a pixel each: on a phone and on paper the texts are still texts.
pub(crate) const WIDTH: u32 = 960;

/// Text size in the same units.
pub(crate) const TEXT: u32 = 30;

/// Height of a title.
pub(crate) const TITLE: i32 = 52;

/// Grid and axes; the page's style replaces it.
pub(crate) const AXIS: [u8; 3] = [0x80; 3];

/// Approximate width of a text in sans-serif fonts; the browser picks the font.
pub(crate) fn text_width(text: &str, size: u32) -> i32 {
    (0.56 * f64::from(size) * text.chars().count() as f64).ceil() as i32
}
