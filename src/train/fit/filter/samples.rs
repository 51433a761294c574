//! Labelled windows with their features.

use super::{FrameLabels, SamplePart};
use std::collections::BTreeMap;
use svl_core::Result;
use svl_core::filter::{Features, FilterKind, FilterWindows, Spectrum};
use svl_core::stereo::{Frame, GridShape, Surface, Truth, Visibility};

/// A labelled window.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowSample {
    /// Recording or run: samples of one are never split.
    pub group: usize,
    /// The frame's sequence number.
    pub sequence: u64,
    /// Number of the window in its frame.
    pub window: usize,
    /// True if it shows the filter's object.
    pub is: bool,
    /// Grey values, for samples of the test set.
    pub pixels: Vec<u8>,
}

/// Labelled windows with their features, a row each.
#[derive(Clone, Debug)]
pub struct WindowSamples {
    pub kind: FilterKind,
    pub features: Features,
    /// Rows of [`Features::stride`] values.
    pub inputs: Vec<f32>,
    pub samples: Vec<WindowSample>,
    /// The part of each group.
    pub parts: Vec<SamplePart>,
}

/// Origin of the labels of windows.
#[derive(Clone, Debug)]
pub enum WindowLabels<'a> {
    /// A person's.
    Given(&'a FrameLabels),
    /// The frame's truth; for *too close* with the range of disparities, pixels.
    Truth { range_px: f64 },
}

/// A window is floor if more than this fraction of its pixels is, and not floor if less than the
/// rest is.
const FLOOR_SHARE: f64 = 0.9;

impl WindowSamples {
    pub fn new(kind: FilterKind, features: Features, parts: Vec<SamplePart>) -> Self {
        Self {
            kind,
            features,
            inputs: Vec::new(),
            samples: Vec::new(),
            parts,
        }
    }

    /// With the same filter and parts, without samples.
    #[must_use]
    pub fn empty(&self) -> Self {
        Self::new(self.kind, self.features, self.parts.clone())
    }

    /// Adds the samples of another set with the same filter and parts.
    pub fn append(&mut self, mut others: Self) {
        self.inputs.append(&mut others.inputs);
        self.samples.append(&mut others.samples);
    }

    /// The samples with these indices.
    #[must_use]
    pub fn select(&self, numbers: impl IntoIterator<Item = usize>) -> Self {
        let (mut fewer, stride) = (self.empty(), self.features.stride());
        for i in numbers {
            fewer.samples.push(self.samples[i].clone());
            fewer
                .inputs
                .extend_from_slice(&self.inputs[i * stride..][..stride]);
        }
        fewer
    }

    /// All samples, but at most a limit per category in the listed parts, spread evenly.
    #[must_use]
    pub fn limited(&self, limits: &[(SamplePart, usize)]) -> Self {
        let mut numbers = Vec::new();
        for part in SamplePart::ALL {
            let limit = limits.iter().find(|(limited, _)| *limited == part);
            for is in [true, false] {
                let indices = self.indices(part).filter(|&i| self.samples[i].is == is);
                let indices: Vec<_> = indices.collect();
                let most = limit.map_or(indices.len(), |(_, most)| indices.len().min(*most));
                numbers.extend((0..most).map(|i| indices[i * indices.len() / most]));
            }
        }
        self.select(numbers)
    }

    /// Adds the labelled windows of a frame of a group.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] for images smaller than a window.
    pub fn add(
        &mut self,
        spectrum: &mut Spectrum,
        frame: &Frame,
        group: usize,
        labels: &WindowLabels<'_>,
    ) -> Result<()> {
        let (features, left) = (self.features, frame.pair.left());
        let truth = frame.truth.as_ref();
        let side = features.window;
        let windows = FilterWindows::new(self.kind, side, left.size(), GridShape::default())?;
        for (window, &at) in windows.corners.iter().enumerate() {
            let is = match labels {
                WindowLabels::Given(labels) => labels.get(frame.sequence, window),
                WindowLabels::Truth { range_px } => {
                    truth.and_then(|truth| true_label(self.kind, truth, at, side, *range_px))
                }
            };
            let Some(is) = is else {
                continue;
            };
            let first = self.inputs.len();
            self.inputs.resize(first + features.stride(), 0.0);
            spectrum.features(features, left, at, &mut self.inputs[first..]);
            let row = |y: usize| left.row(at[1] + y)[at[0]..at[0] + side].iter().copied();
            let is_shown = self.parts[group] == SamplePart::Test;
            self.samples.push(WindowSample {
                group,
                sequence: frame.sequence,
                window,
                is,
                pixels: if is_shown {
                    (0..side).flat_map(row).collect()
                } else {
                    Vec::new()
                },
            });
        }
        Ok(())
    }

    /// The samples of a part.
    pub fn indices(&self, part: SamplePart) -> impl Iterator<Item = usize> + '_ {
        let is_of = move |i: &usize| self.parts[self.samples[*i].group] == part;
        (0..self.samples.len()).filter(is_of)
    }

    /// Copies the rows of samples into `batch`, and returns the part of it that they fill.
    pub(super) fn gather<'a>(&self, indices: &[usize], batch: &'a mut [f32]) -> &'a [f32] {
        let stride = self.features.stride();
        for (to, &i) in batch.chunks_exact_mut(stride).zip(indices) {
            to.copy_from_slice(&self.inputs[i * stride..][..stride]);
        }
        &batch[..indices.len() * stride]
    }
}

/// Content of a window, by the truth of a simulation, which alone covers every pixel; `None` for
/// another truth, or if the window shows both.
pub fn true_label(
    kind: FilterKind,
    truth: &Truth,
    [x, y]: [usize; 2],
    side: usize,
    range_px: f64,
) -> Option<bool> {
    let places = (y..y + side).flat_map(|y| (x..x + side).map(move |x| (x, y)));
    let share = |is: &dyn Fn(usize, usize) -> bool| {
        let count = places.clone().filter(|&(x, y)| is(x, y)).count();
        count as f64 / (side * side) as f64
    };
    let surface = truth.surface.as_ref()?;
    match kind {
        FilterKind::Floor => {
            let floor = share(&|x, y| surface.get(x, y) == Surface::Floor);
            match floor {
                floor if floor > FLOOR_SHARE => Some(true),
                floor if floor < 1.0 - FLOOR_SHARE => Some(false),
                _ => None,
            }
        }
        FilterKind::TooClose => {
            let one_camera = |x, y| {
                let seen = truth.visibility.as_ref().map(|seen| seen.get(x, y));
                seen == Some(Visibility::Occluded)
            };
            let too_near = |x, y| {
                let disparity = truth.disparity.get(x, y);
                disparity.is_finite() && f64::from(disparity) > range_px
            };
            Some(share(&|x, y| too_near(x, y) || one_camera(x, y)) > 0.5)
        }
    }
}

impl WindowSamples {
    /// The labels of a part's samples.
    pub fn labels(&self, part: SamplePart) -> Vec<bool> {
        self.indices(part).map(|i| self.samples[i].is).collect()
    }

    /// Hash of all features and labels.
    pub fn hash(&self) -> u128 {
        let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
        for value in &self.inputs {
            hasher.update(&value.to_le_bytes());
        }
        for sample in &self.samples {
            hasher.update(&[u8::from(sample.is), self.parts[sample.group] as u8]);
        }
        hasher.digest128()
    }

    /// Number of windows of a part with the filter's object, and without.
    pub fn counts(&self) -> BTreeMap<&'static str, [usize; 2]> {
        let count = |part: SamplePart| {
            let labels = self.labels(part);
            let is = labels.iter().filter(|&&is| is).count();
            (part.name(), [is, labels.len() - is])
        };
        SamplePart::ALL.map(count).into()
    }

    /// The test samples with the worst scores of a category, worst first.
    pub fn worst(
        &self,
        scores: &[(f32, bool)],
        is: bool,
        most: usize,
    ) -> Vec<(&WindowSample, f32)> {
        let tested = self.indices(SamplePart::Test);
        let samples = tested.map(|i| &self.samples[i]).zip(scores);
        let wrong = samples.filter(|(_, (score, label))| *label == is && (*score > 0.0) != is);
        let mut wrong: Vec<_> = wrong.map(|(sample, (score, _))| (sample, *score)).collect();
        wrong.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        // One per frame: neighbouring windows are similar.
        let mut shown = Vec::<(&WindowSample, f32)>::new();
        for (sample, score) in wrong {
            let near = |other: &&WindowSample| {
                other.group == sample.group && other.sequence.abs_diff(sample.sequence) < 5
            };
            if shown.len() < most && !shown.iter().map(|(sample, _)| sample).any(near) {
                shown.push((sample, score));
            }
        }
        shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::Plane;

    /// A truth of 100x10 whose first columns are floor, too near, or visible only in the left
    /// camera.
    fn truth(floor: usize, near: usize, hidden: usize) -> Truth {
        let plane = |first: f32, columns: usize, rest: f32| {
            Plane::from_fn(100, 10, |x, _| if x < columns { first } else { rest }).unwrap()
        };
        let surface = plane(0.0, floor, 1.0).map(|v| match v {
            0.0 => Surface::Floor,
            _ => Surface::Wall,
        });
        let visibility = plane(0.0, near + hidden, 1.0).map(|v| match v {
            0.0 => Visibility::Occluded,
            _ => Visibility::Visible,
        });
        let disparity = plane(90.0, near, 20.0);
        Truth {
            surface: Some(surface),
            ..Truth::exact(disparity, (hidden > 0).then_some(visibility))
        }
    }

    #[test]
    fn truth_labels_windows_that_show_one_thing() {
        let floor = |columns| {
            let truth = truth(columns, 0, 0);
            true_label(FilterKind::Floor, &truth, [0, 0], 10, 80.0)
        };
        // Out of ten columns.
        assert_eq!(
            [0, 1, 5, 9, 10].map(floor),
            [Some(false), None, None, None, Some(true)]
        );
        let close = |near, hidden| {
            let truth = truth(0, near, hidden);
            true_label(FilterKind::TooClose, &truth, [0, 0], 10, 80.0)
        };
        assert_eq!(
            [close(5, 0), close(6, 0), close(3, 3)],
            [Some(false), Some(true), Some(true)]
        );
        let unknown = Truth::exact(Plane::filled(100, 10, 5.0).unwrap(), None);
        assert_eq!(
            true_label(FilterKind::Floor, &unknown, [0, 0], 10, 80.0),
            None
        );
        // Pixels without a truth do not count as far.
        let label = true_label(FilterKind::TooClose, &unknown, [0, 0], 10, 80.0);
        assert_eq!(label, None);
    }
}
