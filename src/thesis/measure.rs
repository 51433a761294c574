//! Numbers and pictures of disparity maps for several experiments.

use super::{Exhibit, Finding};
use svl_core::Result;
use svl_core::statistics::lower_median;
use svl_core::stereo::{DisparityMap, Frame, Gray, Truth};
use svl_files::encode_png;
use svl_files::overlay::{Mark, Nearness, marks, viridis};
use svl_score::judge::{JudgedEstimate, Verdict};

/// Mean and median of finite values, the median by nearest rank; NaN without values.
pub(super) fn mean_and_median(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let values: Vec<f64> = values.into_iter().collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    [mean, lower_median(values).unwrap_or(f64::NAN)]
}

/// The top of the thesis's scale of SSDPI, its logarithm (section 5.3.3).
pub(super) const SSDPI_TOP: f64 = 12.0;

/// A valid pixel.
#[derive(Clone, Copy)]
pub(super) struct Valid {
    pub(super) at: (usize, usize),
    pub(super) disparity_px: f32,
    /// The true disparity; not finite if unknown.
    pub(super) true_px: f32,
    /// `ln(SSDPI + 1)`; NaN if the map has no SSDPIs.
    pub(super) ln_ssdpi: f64,
}

/// The valid pixels of a map, in raster order.
pub(super) fn valid(map: &DisparityMap, truth: Option<&Truth>) -> impl Iterator<Item = Valid> {
    let (width, height) = map.size();
    let places = (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
    places.filter_map(move |(x, y)| {
        let ssdpi = map.ssdpi().map(|plane| f64::from(plane.get(x, y)));
        Some(Valid {
            at: (x, y),
            disparity_px: map.at(x, y).ok()?,
            true_px: truth.map_or(f32::NAN, |truth| truth.disparity.get(x, y)),
            ln_ssdpi: ssdpi.map_or(f64::NAN, f64::ln_1p),
        })
    })
}

/// Matches of some maps, counted over all their pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct Matches {
    pub(super) pixels: usize,
    /// Matches whose truth is known.
    pub(super) known: usize,
    /// Matches within 2 px of the truth.
    pub(super) right: usize,
    /// One per match: the median of several maps does not follow from their medians.
    pub(super) ln_ssdpis: Vec<f64>,
}

impl Matches {
    pub(super) fn new(frame: &Frame, map: &DisparityMap) -> Self {
        let mut matches = Self {
            pixels: map.size().0 * map.size().1,
            ..Self::default()
        };
        for valid in valid(map, frame.truth.as_ref()) {
            // Pixels without truth are matches but neither right nor wrong.
            let off_px = (valid.disparity_px - valid.true_px).abs();
            matches.known += usize::from(valid.true_px.is_finite());
            matches.right += usize::from(off_px <= 2.0);
            matches.ln_ssdpis.push(valid.ln_ssdpi);
        }
        matches
    }

    pub(super) fn add(&mut self, other: Self) {
        self.pixels += other.pixels;
        self.known += other.known;
        self.right += other.right;
        self.ln_ssdpis.extend(other.ln_ssdpis);
    }

    pub(super) fn count(&self) -> usize {
        self.ln_ssdpis.len()
    }

    /// Mean and median ln SSDPI.
    pub(super) fn spread(&self) -> [f64; 2] {
        mean_and_median(self.ln_ssdpis.iter().copied())
    }

    /// Per cent of the matches with known truth.
    pub(super) fn wrong_percent(&self) -> f64 {
        percent(self.known - self.right, self.known)
    }
}

/// A fraction as a percentage; NaN if both are 0.
pub(super) fn percent(part: usize, whole: usize) -> f64 {
    100.0 * part as f64 / whole as f64
}

impl Finding {
    /// Adds an image without marks.
    pub(super) fn image(&mut self, caption: impl Into<String>, image: &Gray) -> Result<()> {
        let pixels: Vec<_> = image.pixels().collect();
        let picture = picture(caption, image.size(), &pixels, Vec::new())?;
        self.pictures.push(picture);
        Ok(())
    }

    /// Adds the ln SSDPIs of the valid pixels as colours, from dark blue at 0 to yellow at 12;
    /// black elsewhere.
    pub(super) fn ssdpis(&mut self, caption: impl Into<String>, map: &DisparityMap) -> Result<()> {
        let (width, height) = map.size();
        let mut rgb = vec![0; 3 * width * height];
        for pixel in valid(map, None) {
            let color = viridis((pixel.ln_ssdpi / SSDPI_TOP) as f32);
            rgb[3 * (pixel.at.1 * width + pixel.at.0)..][..3].copy_from_slice(&color);
        }
        let picture = picture(caption, map.size(), &rgb, Vec::new())?;
        self.pictures.push(picture);
        Ok(())
    }
}

/// The left image with the estimate's depth grid over it, wrong cells crossed out.
pub(super) fn grid_picture(
    caption: String,
    frame: &Frame,
    scored: &JudgedEstimate,
) -> Result<Exhibit> {
    let (left, nearness) = (frame.pair.left(), Nearness::for_frame(frame));
    let marks = marks(&scored.estimate.grid, left.size(), nearness);
    let wrong = scored.cells.iter().flatten();
    let wrong = wrong.map(|cell| cell.verdict == Verdict::Wrong);
    let marks = marks.into_iter().zip(wrong).collect();
    picture(
        caption,
        left.size(),
        &left.pixels().collect::<Vec<_>>(),
        marks,
    )
}

fn picture(
    caption: impl Into<String>,
    size: (usize, usize),
    pixels: &[u8],
    marks: Vec<(Mark, bool)>,
) -> Result<Exhibit> {
    Ok(Exhibit {
        caption: caption.into(),
        png: encode_png(size.0, size.1, pixels)?,
        size,
        marks,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{ExtraPlanes, Geometry, Plane, Reason, StereoPair};

    #[test]
    fn medians_are_nearest_ranks() {
        assert!(mean_and_median([]).iter().all(|value| value.is_nan()));
        assert_eq!(mean_and_median([4.0, 1.0, 1.0, 2.0]), [2.0, 1.0]);
        assert_eq!(mean_and_median([4.0, 0.0, 2.0]), [2.0, 2.0]);
        assert!(percent(0, 0).is_nan());
    }

    #[test]
    fn matches_are_counted_over_all_pixels() {
        let image = Gray::filled(4, 1, 0).unwrap();
        let pair = StereoPair::new(image.clone(), image).unwrap();
        let mut disparity = Plane::filled(4, 1, 3.0).unwrap();
        disparity.set(2, 0, f32::INFINITY);
        let frame = Frame {
            truth: Some(Truth::exact(disparity, None)),
            ..Frame::new(pair, Geometry::Rectified(None))
        };
        let mut map = DisparityMap::with_planes(4, 1, ExtraPlanes::SSDPI).unwrap();
        let mut row = map.rows_mut().next().unwrap();
        row.accept(0, 3.0);
        row.accept(1, 5.5);
        row.accept(2, 3.0);
        row.reject(3, Reason::SelfCheck);
        for (x, ssdpi) in [0, 99, 0, 5000].into_iter().enumerate() {
            row.set_ssdpi(x, ssdpi);
        }
        let mut matches = Matches::new(&frame, &map);
        matches.add(matches.clone());
        assert_eq!((matches.pixels, matches.count()), (8, 6));
        assert_eq!((matches.known, matches.right), (4, 2));
        assert_eq!(matches.wrong_percent(), 50.0);
        let [mean, median] = matches.spread();
        assert_eq!(median, 0.0);
        assert!((mean - 100f64.ln() / 3.0).abs() < 1e-12);
    }
}
