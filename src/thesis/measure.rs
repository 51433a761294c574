//! Numbers and pictures of a disparity map for several experiments.

use super::{DrawnCell, Exhibit};
use svl_core::Result;
use svl_core::statistics::lower_median;
use svl_core::stereo::{DisparityMap, Frame, Gray, Truth};
use svl_files::encode_png;
use svl_files::overlay::{Nearness, marks, viridis};
use svl_score::judge::{JudgedEstimate, Verdict};

/// Mean and median.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MeanMedian {
    pub(super) mean: f64,
    pub(super) median: f64,
}

impl MeanMedian {
    /// Over finite values; `None` without any. The median is by nearest rank.
    pub(super) fn from_values(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let values: Vec<f64> = values.into_iter().collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let median = lower_median(values)?;
        Some(Self { mean, median })
    }

    /// Over finite values; NaN without any.
    pub(super) fn or_nan(values: impl IntoIterator<Item = f64>) -> Self {
        let [mean, median] = [f64::NAN; 2];
        Self::from_values(values).unwrap_or(Self { mean, median })
    }
}

/// The top of the thesis's scale of SSDPI, its logarithm (section 5.3.3).
pub(super) const SSDPI_TOP: f64 = 12.0;

/// A valid pixel.
#[derive(Clone, Copy)]
pub(super) struct Valid {
    pub(super) at: (usize, usize),
    pub(super) disparity_px: f32,
    /// `ln(SSDPI + 1)`; NaN if the map has no SSDPIs.
    pub(super) ln_ssdpi: f64,
}

/// The valid pixels of a map, in raster order.
pub(super) fn valid(map: &DisparityMap) -> impl Iterator<Item = Valid> {
    let (width, height) = map.size();
    let places = (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
    places.filter_map(|(x, y)| {
        let disparity_px = map.at(x, y).ok()?;
        Some(Valid {
            at: (x, y),
            disparity_px,
            ln_ssdpi: map
                .ssdpi()
                .map_or(f64::NAN, |plane| f64::from(plane.get(x, y)).ln_1p()),
        })
    })
}

/// Mean and median ln SSDPI over all valid pixels of some maps.
pub(super) fn ssdpi<'a>(maps: impl IntoIterator<Item = &'a DisparityMap>) -> MeanMedian {
    MeanMedian::or_nan(maps.into_iter().flat_map(valid).map(|v| v.ln_ssdpi))
}

/// True if a disparity is within 2 px of the truth; `None` without truth.
pub(super) fn right(truth: &Truth, valid: &Valid) -> Option<bool> {
    let true_px = truth.disparity.get(valid.at.0, valid.at.1);
    true_px
        .is_finite()
        .then(|| (valid.disparity_px - true_px).abs() <= 2.0)
}

/// A fraction as a percentage; `None` if the denominator is 0.
pub(super) fn percent(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| 100.0 * part as f64 / whole as f64)
}

/// The ln SSDPIs of the valid pixels as colours, from dark blue at 0 to yellow at 12; black
/// elsewhere.
pub(super) fn ssdpi_picture(caption: impl Into<String>, map: &DisparityMap) -> Result<Exhibit> {
    let (width, height) = map.size();
    let mut rgb = vec![0; 3 * width * height];
    for Valid {
        at: (x, y),
        ln_ssdpi,
        ..
    } in valid(map)
    {
        rgb[3 * (y * width + x)..][..3].copy_from_slice(&viridis((ln_ssdpi / SSDPI_TOP) as f32));
    }
    picture(caption, (width, height), &rgb)
}

/// The left image with the estimate's depth grid over it, wrong cells crossed out.
pub(super) fn grid_picture(
    caption: String,
    frame: &Frame,
    scored: &JudgedEstimate,
) -> Result<Exhibit> {
    let size = frame.pair.size();
    let marks = marks(&scored.estimate.grid, size, Nearness::for_frame(frame));
    let drawn = marks.into_iter().zip(scored.cells.iter().flatten());
    let drawn = drawn.map(|(mark, cell)| DrawnCell {
        mark,
        wrong: cell.verdict == Verdict::Wrong,
    });
    let marks = drawn.collect();
    let pixels: Vec<_> = frame.pair.left().pixels().collect();
    let png = encode_png(size.0, size.1, &pixels)?;
    Ok(Exhibit::Picture {
        caption,
        png,
        size,
        marks,
    })
}

/// An image without marks.
pub(super) fn gray_picture(caption: impl Into<String>, image: &Gray) -> Result<Exhibit> {
    picture(caption, image.size(), &image.pixels().collect::<Vec<_>>())
}

fn picture(caption: impl Into<String>, size: (usize, usize), pixels: &[u8]) -> Result<Exhibit> {
    let png = encode_png(size.0, size.1, pixels)?;
    Ok(Exhibit::Picture {
        caption: caption.into(),
        png,
        size,
        marks: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{ExtraPlanes, Plane, Reason};

    #[test]
    fn medians_are_nearest_ranks() {
        assert_eq!(MeanMedian::from_values([]), None);
        assert_eq!(
            MeanMedian::from_values([4.0, 1.0, 1.0, 2.0]),
            Some(MeanMedian {
                mean: 2.0,
                median: 1.0
            })
        );
        assert_eq!(
            MeanMedian::from_values([4.0, 0.0, 2.0]),
            Some(MeanMedian {
                mean: 2.0,
                median: 2.0
            })
        );
    }

    #[test]
    fn only_valid_pixels_count() {
        let mut map = DisparityMap::with_planes(4, 1, ExtraPlanes::SSDPI).unwrap();
        let mut row = map.rows_mut().next().unwrap();
        row.accept(0, 5.0);
        row.accept(1, 9.0);
        row.reject(2, Reason::SelfCheck);
        for (x, ssdpi) in [0, 99, 5000].into_iter().enumerate() {
            row.set_ssdpi(x, ssdpi);
        }
        let spread = ssdpi([&map]);
        assert_eq!(
            spread,
            MeanMedian {
                mean: 0.5 * 100f64.ln(),
                median: 0.0
            }
        );
        let mut disparity = Plane::filled(4, 1, 7.0).unwrap();
        disparity.set(1, 0, f32::INFINITY);
        let truth = Truth::exact(disparity, None);
        assert_eq!(
            valid(&map).map(|v| right(&truth, &v)).collect::<Vec<_>>(),
            [Some(true), None]
        );
        assert_eq!(percent(1, 0), None);
    }
}
