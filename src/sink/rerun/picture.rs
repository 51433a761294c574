//! Disparity, depth, SSDPI and reason maps as Rerun images with fixed ranges and colours.
//!
//! Disparities (pixels), depths (metres) and ln(SSDPI + 1) are half floats: 11 bits of precision,
//! half of `f32`'s size, and NaN is the invalid value that an integer does not have. Reasons are
//! bytes.

use super::scale::Scale;
use crate::stereo::{DisparityMap, Frame, Gray, Plane, Reason, Rig};
use ::rerun::components::Colormap;
use ::rerun::external::arrow::datatypes::{ArrowPrimitiveType, Float16Type};
use ::rerun::{
    AnnotationContext, ChannelDatatype, DepthImage, Image, ImageFormat, Points2D, Radius, Rgba32,
    SegmentationImage,
};

/// IEEE half precision, by way of Arrow, which Rerun brings along.
type Half = <Float16Type as ArrowPrimitiveType>::Native;

/// The thesis's scale of SSDPI: 0 to 12, its logarithm (section 5.3.3).
const SSDPI_RANGE: [f64; 2] = [0.0, 12.0];

/// Class of the pixels without a depth: the first code after those of the reasons.
const UNKNOWN: u8 = Reason::ALL.len() as u8;

/// Names and colours of the classes. Rerun applies them to everything below the entity.
pub(super) fn classes() -> AnnotationContext {
    let reasons = Reason::ALL.map(|reason| (reason as u16, reason.name(), color(reason)));
    AnnotationContext::new(reasons.into_iter().chain([(
        UNKNOWN.into(),
        "unknown",
        Rgba32::from_rgb(12, 12, 14),
    )]))
}

/// A reason's colour. Valid pixels are transparent, so that the image shows through.
fn color(reason: Reason) -> Rgba32 {
    match reason {
        Reason::Valid => Rgba32::from_unmultiplied_rgba(0, 0, 0, 0),
        Reason::Border => Rgba32::from_rgb(90, 90, 100),
        Reason::Untextured => Rgba32::from_rgb(66, 133, 214),
        Reason::Ambiguous => Rgba32::from_rgb(245, 166, 35),
        Reason::Inconsistent => Rgba32::from_rgb(208, 62, 140),
        Reason::SelfCheck => Rgba32::from_rgb(44, 160, 110),
        Reason::Unmatched => Rgba32::from_rgb(150, 100, 60),
    }
}

/// The left image, in colour where the source has it.
pub(super) fn left(frame: &Frame) -> Image {
    match &frame.color {
        Some([left, _]) => {
            let pixels: Vec<u8> = left.pixels().flatten().collect();
            Image::from_rgb24(pixels, resolution(left))
        }
        None => gray(frame.pair.left()),
    }
}

/// A grey image.
pub(super) fn gray(image: &Gray) -> Image {
    let pixels = image
        .as_slice()
        .map_or_else(|| image.pixels().collect(), <[u8]>::to_vec);
    Image::from_l8(pixels, resolution(image))
}

/// Disparities in pixels, blue (far) over green to red (near); none is nearly black.
pub(super) fn disparity(map: &Plane<f32>, scale: &Scale) -> DepthImage {
    half(map, |d| d, [0.0, scale.nearness.near_px()], Colormap::Turbo)
}

/// Depths in metres, red (near) over yellow to blue (far), and the mask that blackens the pixels
/// without: Rerun paints NaN in the colour of 0, which here would be that of the nearest obstacle.
pub(super) fn depth(map: &Plane<f32>, rig: &Rig, scale: &Scale) -> (DepthImage, SegmentationImage) {
    let unknown = |d| {
        if meters(d, rig).is_nan() {
            UNKNOWN
        } else {
            Reason::Valid as u8
        }
    };
    let depth = half(
        map,
        |d| meters(d, rig),
        [0.0, scale.far_m],
        Colormap::Spectral,
    );
    (depth, mask(map, unknown).with_opacity(1.0))
}

/// Depth of a disparity; NaN where there is none or it lies at infinity.
fn meters(disparity: f32, rig: &Rig) -> f32 {
    let depth_m = rig
        .depth_m(disparity.into())
        .filter(|_| disparity.is_finite());
    depth_m.map_or(f32::NAN, |z| z as f32)
}

/// ln(SSDPI + 1); black where nothing was compared.
pub(super) fn ssdpi(map: &Plane<u32>) -> DepthImage {
    let ln = |s: u32| {
        if s == DisparityMap::NO_SSDPI {
            f32::NAN
        } else {
            (s as f32).ln_1p()
        }
    };
    half(map, ln, SSDPI_RANGE, Colormap::Inferno)
}

/// Reasons by their codes.
pub(super) fn why(map: &Plane<Reason>) -> SegmentationImage {
    mask(map, |reason| reason as u8).with_opacity(0.8)
}

/// Height of the legend, as a share of the image's.
pub(super) const LEGEND_SHARE: f64 = 0.32;

/// The colours of [`why`] with their names, in two lines below an image of `size` pixels.
pub(super) fn legend((width, height): (usize, usize)) -> Points2D {
    let (width, height) = (width as f32, height as f32);
    let reasons = &Reason::ALL[1..];
    let place = |i: usize| {
        [
            (0.17 + (i % 3) as f32 / 3.0) * width,
            (1.05 + 0.15 * (i / 3) as f32) * height,
        ]
    };
    Points2D::new((0..reasons.len()).map(place))
        .with_class_ids(reasons.iter().map(|&reason| reason as u16))
        .with_labels(reasons.iter().map(|reason| reason.name()))
        .with_show_labels(true)
        .with_radii([Radius::new_ui_points(4.0)])
}

fn half<T: Copy>(
    map: &Plane<T>,
    value: impl Fn(T) -> f32,
    range: [f64; 2],
    colors: Colormap,
) -> DepthImage {
    let mut bytes = Vec::with_capacity(2 * map.width() * map.height());
    for &pixel in map.rows().flatten() {
        let value = value(pixel);
        let value = Half::from_f32(if value.is_finite() { value } else { f32::NAN });
        bytes.extend_from_slice(&value.to_ne_bytes());
    }
    DepthImage::new(
        bytes,
        ImageFormat::depth(resolution(map), ChannelDatatype::F16),
    )
    .with_meter(1.0)
    .with_depth_range(range)
    .with_colormap(colors)
}

fn mask<T: Copy>(map: &Plane<T>, class: impl Fn(T) -> u8) -> SegmentationImage {
    let classes: Vec<u8> = map.pixels().map(class).collect();
    SegmentationImage::new(
        classes,
        ImageFormat::segmentation(resolution(map), ChannelDatatype::U8),
    )
}

fn resolution<T: Copy>(map: &Plane<T>) -> [u32; 2] {
    // Sides are at most MAX_SIDE.
    [map.width() as u32, map.height() as u32]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_disparity_is_nan_and_not_zero_metres() {
        let rig = Rig::new(328.0, (159.5, 119.5), 0.05, 0.0).unwrap();
        assert_eq!(meters(8.2, &rig), 2.0);
        assert!(meters(f32::INFINITY, &rig).is_nan() && meters(0.0, &rig).is_nan());
    }
}
