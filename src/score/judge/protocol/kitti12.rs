//! KITTI 2012: outliers beyond 1 … 5 px and the mean error, per image; over several images their
//! mean.

use super::errors::Errors;
use super::kitti::{KittiMaps, stored};
use super::numbers::{NumberUnit, Numbers};
use super::{ProtocolImage, scored_pixels};
use svl_core::Result;
use svl_core::stereo::Plane;

/// Outliers of the map as given, densified, and among only the estimated pixels, by threshold.
const OUTLIERS: [(f32, [&str; 3]); 5] = [
    (1.0, ["out1", "out1_dense", "out1_est"]),
    (2.0, ["out2", "out2_dense", "out2_est"]),
    (3.0, ["out3", "out3_dense", "out3_est"]),
    (4.0, ["out4", "out4_dense", "out4_est"]),
    (5.0, ["out5", "out5_dense", "out5_est"]),
];

pub(super) fn numbers(image: &ProtocolImage) -> Result<Numbers> {
    let KittiMaps { sparse, dense } = KittiMaps::new(image);
    let errors = |map: &Plane<f32>, read: fn(f32) -> f32| {
        Errors::collect(
            scored_pixels(image.truth, image.mask)
                .map(|(x, y, truth)| (truth, read(map.get(x, y)))),
        )
    };
    // A hole is stored as -1 and so counts as an outlier at almost every threshold.
    let as_is = errors(&sparse, stored)?;
    let densified = errors(&dense, stored)?;
    let estimated = errors(&sparse, |d| d)?;
    let filled = scored_pixels(image.truth, image.mask)
        .filter(|&(x, y, _)| dense.get(x, y).is_finite())
        .count();

    let mut numbers = Numbers::default();
    let outliers = |numbers: &mut Numbers, column: usize, errors: &Errors| {
        for (threshold_px, names) in OUTLIERS {
            let part = errors.over(threshold_px);
            numbers.add_share(names[column], part, errors.estimated());
        }
    };
    outliers(&mut numbers, 0, &as_is);
    // A hole has no error to average.
    numbers.add("avgerr", NumberUnit::Px, estimated.mean());
    numbers.add_share("density", estimated.estimated(), estimated.pixels());
    outliers(&mut numbers, 1, &densified);
    numbers.add("avgerr_dense", NumberUnit::Px, densified.mean());
    numbers.add_share("density_dense", filled, estimated.pixels());
    outliers(&mut numbers, 2, &estimated);
    numbers.add("pixels", NumberUnit::Count, Some(as_is.pixels() as f64));
    Ok(numbers)
}
