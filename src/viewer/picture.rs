//! Disparity, depth, SSDPI and reason maps as Rerun images with fixed ranges and colours.
//!
//! Images are JPEG files. Disparities, depths and ln(SSDPI + 1) are RVL files of 16-bit codes, in
//! which 0 means invalid; reasons are PNG files with a palette. Together they take a quarter of the
//! size of half floats and bytes.

use crate::scale::Scale;
use rerun::components::{Colormap, MediaType};
use rerun::{AnnotationContext, EncodedDepthImage, EncodedImage, Image, Points2D, Radius, Rgba32};
use svl_core::Result;
use svl_core::stereo::{Frame, Gray, Plane, Reason, Rig};
use svl_files::overlay::{
    CODES_PER_LN, CODES_PER_PX, depth_codes, disparity_codes, no_depth_classes, reason_classes,
    sparse_disparities, ssdpi_codes,
};
use svl_files::{self as files, InverseDepth};

/// The thesis's scale of SSDPI: 0 to 12, its logarithm (section 5.3.3).
const SSDPI_RANGE: [f64; 2] = [0.0, 12.0];

/// Pixels without a depth.
const UNKNOWN: [u8; 4] = [12, 12, 14, 255];

/// Rerun ignores the transparency of an image with full opacity.
const OPAQUE: f32 = 0.999;

/// Limit on the points of a cloud: enough to see the shape.
const MAX_POINTS: f64 = 20_000.0;

/// Names and colours of the reasons, for their legend.
pub(crate) fn classes() -> AnnotationContext {
    let class = |reason: Reason| (reason as u16, reason.name(), color(reason));
    AnnotationContext::new(Reason::PIXELS.map(class))
}

/// A reason's colour. Valid pixels are transparent, so that the image shows through.
fn color(reason: Reason) -> Rgba32 {
    match reason {
        Reason::Valid => Rgba32::from_unmultiplied_rgba(0, 0, 0, 0),
        Reason::Untextured => Rgba32::from_rgb(66, 133, 214),
        Reason::Ambiguous => Rgba32::from_rgb(245, 166, 35),
        Reason::Inconsistent => Rgba32::from_rgb(208, 62, 140),
        Reason::SelfCheck => Rgba32::from_rgb(44, 160, 110),
        Reason::Unmatched => Rgba32::from_rgb(150, 100, 60),
        Reason::Floor => Rgba32::from_rgb(120, 160, 60),
        // The border, and what is not known here.
        _ => Rgba32::from_rgb(90, 90, 100),
    }
}

/// The left image, in colour if the source has it.
pub(crate) fn left(frame: &Frame) -> Result<EncodedImage> {
    let jpeg = match &frame.color {
        Some([left, _]) => files::encode_color_jpeg(left, 0),
        None => files::encode_jpeg(frame.pair.left(), 0),
    };
    Ok(EncodedImage::new(jpeg?).with_media_type(MediaType::JPEG))
}

/// A grey image.
pub(crate) fn gray(image: &Gray) -> Image {
    let pixels = image
        .as_slice()
        .map_or_else(|| image.pixels().collect(), <[u8]>::to_vec);
    Image::from_l8(pixels, resolution(image))
}

/// Disparities in pixels, blue (far) through green to red (near); invalid pixels are nearly black.
/// [`disparity_range`] is logged besides.
pub(crate) fn disparity(map: &Plane<f32>) -> EncodedDepthImage {
    coded(&disparity_codes(map), None, Colormap::Turbo).with_meter(CODES_PER_PX)
}

/// The range of the colours of disparities that end at `end_px`, for all frames.
pub(crate) fn disparity_range(end_px: f32) -> EncodedDepthImage {
    let end = f64::from(end_px * CODES_PER_PX);
    EncodedDepthImage::update_fields().with_depth_range([0.0, end])
}

/// Depths in metres, red (near) through yellow to blue (far).
pub(crate) fn depth(map: &Plane<f32>, rig: &Rig, scale: &Scale) -> EncodedDepthImage {
    let codes = depth_codes(map, rig);
    let inverse = InverseDepth {
        a: (rig.focal_px() * rig.baseline_m()) as f32 * CODES_PER_PX,
        b: -rig.doffs_px() as f32 * CODES_PER_PX,
    };
    coded(&codes, Some(inverse), Colormap::Spectral)
        .with_depth_range([0.0, scale.far_m])
        .with_meter(1.0)
}

/// Mask that blackens the pixels without a depth: Rerun paints them in the colour of 0, which is
/// that of the nearest obstacle.
///
/// # Errors
/// The errors of [`files::encode_classes_png`].
pub(crate) fn no_depth(map: &Plane<f32>, rig: &Rig) -> Result<EncodedImage> {
    let codes = no_depth_classes(map, rig);
    let png = files::encode_classes_png(&codes, &[[0; 4], UNKNOWN])?;
    Ok(over(png).with_opacity(OPAQUE))
}

/// The depths as a cloud, which Rerun computes from a depth image in 3D: every n-th column and row,
/// none beyond the scale's far end, where a pixel of disparity is metres of depth.
pub(crate) fn points(map: &Plane<f32>, rig: &Rig, scale: &Scale) -> Result<EncodedDepthImage> {
    let (width, height) = map.size();
    let step = ((width * height) as f64 / MAX_POINTS).sqrt().ceil() as usize;
    let nearest_px = rig.disparity_px(scale.far_m) as f32;
    let sparse = sparse_disparities(map, step, nearest_px)?;
    Ok(depth(&sparse, rig, scale).with_point_fill_ratio(step as f32))
}

/// ln(SSDPI + 1); black if nothing was compared.
pub(crate) fn ssdpi(map: &Plane<u32>) -> EncodedDepthImage {
    let codes = ssdpi_codes(map);
    let range = SSDPI_RANGE.map(|end| end * f64::from(CODES_PER_LN));
    coded(&codes, None, Colormap::Inferno)
        .with_depth_range(range)
        .with_meter(CODES_PER_LN)
}

/// Reasons in their colours.
pub(crate) fn why(map: &Plane<Reason>) -> Result<EncodedImage> {
    let colors = Reason::PIXELS.map(|reason| color(reason).to_array());
    let png = files::encode_classes_png(&reason_classes(map), &colors)?;
    Ok(over(png).with_opacity(0.8))
}

/// An overlay image; Rerun draws images at -10 and below.
fn over(png: Vec<u8>) -> EncodedImage {
    EncodedImage::new(png)
        .with_media_type(MediaType::PNG)
        .with_draw_order(0.0)
}

/// Height of the legend, as a fraction of the image's.
pub(crate) const LEGEND_SHARE: f64 = 0.5;

/// The colours of [`why`] with their names, in three lines below an image of `size` pixels.
pub(crate) fn legend((width, height): (usize, usize)) -> Points2D {
    let (width, height) = (width as f32, height as f32);
    let reasons = &Reason::PIXELS[1..];
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

fn coded(codes: &Plane<u16>, inverse: Option<InverseDepth>, colors: Colormap) -> EncodedDepthImage {
    EncodedDepthImage::new(files::encode_rvl(codes, inverse))
        .with_media_type(MediaType::RVL)
        .with_colormap(colors)
}

fn resolution<T: Copy>(map: &Plane<T>) -> [u32; 2] {
    // Sides are at most MAX_SIDE.
    [map.width() as u32, map.height() as u32]
}
