//! Corner candidates from the ChESS detector, not yet assigned to a board.

use chess_corners::{CornerDescriptor, Detector, DetectorConfig, ImageRefiner, UpscaleConfig};
use nalgebra::{Point2, Vector2};
use svl_core::stereo::Gray;

/// A point at which two dark and two bright fields meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CornerCandidate {
    pub at: Point2<f64>,
    /// Unit vectors along the two edges, signs arbitrary. The sector from the first to the second,
    /// in the direction from x to y, is dark: so neighbours on a board have the two exchanged.
    pub axes: [Vector2<f64>; 2],
}

/// Several times the number of the largest board's corners.
const MAX_CANDIDATES: usize = 8_000;

/// Finds candidates with the ring of Bennett and Lasenby (ChESS: Quick and robust detection of
/// chess-board features, CVIU 2014).
pub(super) struct Finder {
    plain: Detector,
    /// On the image enlarged twice, for squares smaller than the detector's ring.
    enlarged: Detector,
}

impl Finder {
    pub(super) fn new() -> svl_core::Result<Self> {
        let config = DetectorConfig::chess().with_refiner(ImageRefiner::saddle_point());
        let detector =
            |config| Detector::new(config).map_err(|e| svl_core::Error::Invalid(e.to_string()));
        Ok(Self {
            plain: detector(config)?,
            enlarged: detector(config.with_upscale(UpscaleConfig::fixed(2)))?,
        })
    }

    pub(super) fn find(&mut self, image: &Gray) -> Vec<CornerCandidate> {
        candidates(&mut self.plain, image)
    }

    /// In the image at half size, for edges blurred wider than the detector's ring.
    pub(super) fn find_halved(&mut self, image: &Gray) -> Vec<CornerCandidate> {
        let mean = |x: usize, y: usize| {
            let sum: u16 = [(0, 0), (1, 0), (0, 1), (1, 1)]
                .map(|(i, j)| image.get(2 * x + i, 2 * y + j).into())
                .iter()
                .sum();
            (sum / 4) as u8
        };
        // An image of one pixel cannot be halved.
        let Ok(half) = Gray::from_fn(image.width() / 2, image.height() / 2, mean) else {
            return Vec::new();
        };
        // Pixel centres are at integers: the centre of half-size pixel i is at 2i + 0.5.
        let whole = |at: Point2<f64>| Point2::from(2.0 * at.coords + Vector2::new(0.5, 0.5));
        candidates(&mut self.plain, &half)
            .into_iter()
            .map(|c| CornerCandidate {
                at: whole(c.at),
                ..c
            })
            .collect()
    }

    pub(super) fn find_enlarged(&mut self, image: &Gray) -> Vec<CornerCandidate> {
        candidates(&mut self.enlarged, image)
    }
}

/// The detector indexes out of bounds in images whose sides are shorter than its ring.
const SMALLEST_SIDE: usize = 16;

/// Candidates, the strongest first.
fn candidates(detector: &mut Detector, image: &Gray) -> Vec<CornerCandidate> {
    if image.width().min(image.height()) < SMALLEST_SIDE {
        return Vec::new();
    }
    let pixels: Vec<u8>;
    let pixels = match image.as_slice() {
        Some(slice) => slice,
        None => {
            pixels = image.pixels().collect();
            &pixels
        }
    };
    // It fails only for a wrong length or for sides beyond u32, which `Gray` rules out.
    let found = detector.detect_u8(pixels, image.width() as u32, image.height() as u32);
    let mut found = found.unwrap_or_default();
    found.sort_by(|a, b| b.response.total_cmp(&a.response));
    found.truncate(MAX_CANDIDATES);
    found.iter().filter_map(candidate).collect()
}

fn candidate(corner: &CornerDescriptor) -> Option<CornerCandidate> {
    let axes = corner
        .axes?
        .map(|axis| Vector2::new(f64::from(axis.angle.cos()), f64::from(axis.angle.sin())));
    let at = Point2::new(f64::from(corner.x), f64::from(corner.y));
    (at.coords
        .iter()
        .chain(axes.iter().flatten())
        .all(|v| v.is_finite()))
    .then_some(CornerCandidate { at, axes })
}
