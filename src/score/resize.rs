//! Frames cropped and shrunk; the rig and the true disparities follow.
//!
//! Left and right are cropped equally, so disparities are unchanged and the principal point moves.
//! Images are shrunk by area averages: a new pixel is the mean of the area it covers, in fractions
//! of pixels. A true disparity is that of the pixel in the centre, times the scale: a mean of two
//! surfaces would be a distance at which there is nothing.

use crate::scenario::CropScale;
use svl_core::stereo::{
    Frame, Geometry, Gray, MapDensity, Plane, RecordedMap, Rgb, Rig, StereoPair, Truth, Visibility,
};
use svl_core::{Error, Result};

/// Crops and shrinks frames.
pub struct Resizer {
    crop: Option<[usize; 4]>,
    scale: f64,
}

/// The pixel that provides each pixel.
type PixelPlaces = Plane<(usize, usize)>;

impl Resizer {
    pub fn new(window: CropScale) -> Self {
        Self {
            crop: window.crop,
            scale: window.scale.unwrap_or(1.0),
        }
    }

    /// The frame with the rig, the truth and the images of the window.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a crop that is not inside the image, with the frame's `source`.
    pub fn resized(&self, frame: Frame, source: &str) -> Result<Frame> {
        let (width, height) = frame.pair.size();
        let window = self.crop.unwrap_or([0, 0, width, height]);
        let [x, y, w, h] = window;
        let fits = |at: usize, size: usize, all| at.checked_add(size).is_some_and(|end| end <= all);
        if !fits(x, w, width) || !fits(y, h, height) {
            let pair = frame.sequence;
            return Err(Error::Invalid(format!(
                "{source}: pair {pair}: crop = [{x}, {y}, {w}, {h}] is not inside its image of \
                 {width}x{height}"
            )));
        }
        let [left, right] = frame.pair.into_images();
        let image = |image: &Gray| shrunk(&cropped(image, window)?, self.scale);
        let color = |[left, right]: &[Rgb; 2]| -> Result<_> {
            let image = |image: &Rgb| shrunk_color(&cropped(image, window)?, self.scale);
            Ok([image(left)?, image(right)?])
        };
        let truth = frame.truth.map(|truth| self.truth(&truth, window));
        let maps = frame.maps.into_iter().map(|map| self.map(map, window));
        Ok(Frame {
            color: frame.color.as_ref().map(color).transpose()?,
            pair: StereoPair::new(image(&left)?, image(&right)?)?,
            geometry: match frame.geometry {
                Geometry::Rectified(Some(rig)) => {
                    Geometry::Rectified(Some(self.rig(&rig, (x, y))?))
                }
                other => other,
            },
            truth: truth.transpose()?,
            maps: maps.collect::<Result<_>>()?,
            ..frame
        })
    }

    /// Pixel centres are at whole numbers, so that of pixel 0 is at (0 + ½)·scale − ½.
    fn rig(&self, rig: &Rig, (x, y): (usize, usize)) -> Result<Rig> {
        let place = |at: f64, from: usize| (at - from as f64 + 0.5) * self.scale - 0.5;
        let (cx, cy) = rig.center_px();
        Rig::new(
            rig.focal_px() * self.scale,
            (place(cx, x), place(cy, y)),
            rig.baseline_m(),
            rig.doffs_px() * self.scale,
        )
    }

    fn map(&self, map: RecordedMap, window: [usize; 4]) -> Result<RecordedMap> {
        let (disparity, _) = self.sampled(&map.disparity, map.density, window)?;
        Ok(RecordedMap { disparity, ..map })
    }

    /// The disparities in the window, with the pixel of the window that provides each.
    fn sampled(
        &self,
        disparity: &Plane<f32>,
        density: MapDensity,
        window: [usize; 4],
    ) -> Result<(Plane<f32>, PixelPlaces)> {
        let whole = cropped(disparity, window)?;
        let places = sampling(&whole, density, self.scale)?;
        let scaled = places.map(|(x, y)| (f64::from(whole.get(x, y)) * self.scale) as f32);
        Ok((scaled, places))
    }

    fn truth(&self, truth: &Truth, window: [usize; 4]) -> Result<Truth> {
        let (disparity, places) = self.sampled(&truth.disparity, truth.kind.density, window)?;
        let visibility = truth.visibility.as_ref();
        let visibility = visibility.map(|seen| cropped(seen, window)).transpose()?;
        let mut visibility = visibility.map(|seen| places.map(|(x, y)| seen.get(x, y)));
        // Parts of the right image outside of the crop are visible only in the left one.
        if let (Some(visibility), true) = (&mut visibility, self.crop.is_some()) {
            let width = disparity.width() as f32;
            for y in 0..disparity.height() {
                let codes = visibility.row_mut(y).iter_mut().zip(disparity.row(y));
                for (x, (code, d)) in codes.enumerate() {
                    let right = x as f32 - d;
                    if *code == Visibility::Visible && !(-0.5..width - 0.5).contains(&right) {
                        *code = Visibility::Occluded;
                    }
                }
            }
        }
        let surface = truth.surface.as_ref();
        let surface = surface.map(|shown| cropped(shown, window)).transpose()?;
        Ok(Truth {
            disparity,
            visibility,
            surface: surface.map(|shown| places.map(|(x, y)| shown.get(x, y))),
            kind: truth.kind.clone(),
        })
    }
}

fn cropped<T: Copy>(plane: &Plane<T>, [x, y, width, height]: [usize; 4]) -> Result<Plane<T>> {
    let rows = (y..y + height).map(|y| &plane.row(y)[x..x + width]);
    Plane::from_vec(width, height, rows.collect::<Vec<_>>().concat())
}

/// Side of a shrunk image: the whole pixels that fit inside the old one.
fn side(side: usize, scale: f64) -> usize {
    ((side as f64 * scale + 1e-9).floor() as usize).max(1)
}

/// The pixel that provides the truth of a new one: its central pixel. For a sensor's points,
/// between which there are none, the one nearest to the centre of the area that the new pixel
/// covers.
fn sampling(truth: &Plane<f32>, density: MapDensity, scale: f64) -> Result<Plane<(usize, usize)>> {
    let (width, height) = truth.size();
    let middle = |i: usize, side: usize| (((i as f64 + 0.5) / scale) as usize).min(side - 1);
    let covered = |i: usize, side: usize| {
        let [from, to] = [i, i + 1].map(|edge| edge as f64 / scale);
        from.round() as usize..(to.round() as usize).min(side)
    };
    let middles = |all: usize| -> Vec<_> {
        let new = 0..side(all, scale);
        new.map(|i| middle(i, all)).collect()
    };
    let (columns, rows) = (middles(width), middles(height));
    Plane::from_fn(columns.len(), rows.len(), |x, y| {
        let (u, v) = (columns[x], rows[y]);
        if density == MapDensity::Dense || truth.get(u, v).is_finite() {
            return (u, v);
        }
        let places = covered(y, height).flat_map(|j| covered(x, width).map(move |i| (i, j)));
        let known = places.filter(|&(i, j)| truth.get(i, j).is_finite());
        let off = |&(i, j): &(usize, usize)| i.abs_diff(u).pow(2) + j.abs_diff(v).pow(2);
        known.min_by_key(off).unwrap_or((u, v))
    })
}

fn shrunk_color(image: &Rgb, scale: f64) -> Result<Rgb> {
    let channel = |i: usize| shrunk(&image.map(|pixel| pixel[i]), scale);
    let channels = [channel(0)?, channel(1)?, channel(2)?];
    let (width, height) = channels[0].size();
    Plane::from_fn(width, height, |x, y| {
        channels.each_ref().map(|channel| channel.get(x, y))
    })
}

/// The means of the areas that the new pixels cover, rounded to nearest.
fn shrunk(image: &Gray, scale: f64) -> Result<Gray> {
    if scale == 1.0 {
        return Ok(image.clone());
    }
    let (width, height) = image.size();
    let columns = shares(width, scale);
    let rows = shares(height, scale);
    let means = |row: &[u8]| -> Vec<f64> {
        let mean = |shares: &Shares| shares.mean(|x| f64::from(row[x]));
        columns.iter().map(mean).collect()
    };
    let narrow: Vec<Vec<f64>> = image.rows().map(means).collect();
    let mut pixels = Vec::with_capacity(columns.len() * rows.len());
    for Shares { first, weights } in &rows {
        // A whole row at a time, which the compiler vectorizes.
        let mut means = vec![0.0; columns.len()];
        for (weight, row) in weights.iter().zip(&narrow[*first..]) {
            let values = means.iter_mut().zip(row);
            values.for_each(|(mean, value)| *mean += weight * value);
        }
        pixels.extend(means.iter().map(|mean| mean.round() as u8));
    }
    Gray::from_vec(columns.len(), rows.len(), pixels)
}

/// The pixels covered by a new one, from the first on, with the fraction of each.
struct Shares {
    first: usize,
    weights: Vec<f64>,
}

impl Shares {
    fn mean(&self, value: impl Fn(usize) -> f64) -> f64 {
        let weighted = self.weights.iter().enumerate();
        weighted
            .map(|(i, weight)| weight * value(self.first + i))
            .sum()
    }
}

fn shares(old: usize, scale: f64) -> Vec<Shares> {
    let share = |i: usize| {
        let (from, to) = (i as f64 / scale, ((i + 1) as f64 / scale).min(old as f64));
        let (first, end) = (from.floor() as usize, (to.ceil() as usize).min(old));
        let covered = |x: usize| (to.min((x + 1) as f64) - from.max(x as f64)).max(0.0);
        let weights = (first..end).map(|x| covered(x) / (to - from)).collect();
        Shares { first, weights }
    };
    (0..side(old, scale)).map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_whole_pixels_inside_the_old_image() {
        // A scale of a third is not exact in binary, but three thirds are still one.
        assert_eq!(side(9, 1.0 / 3.0), 3);
        assert_eq!(side(1, 0.1), 1);
    }

    #[test]
    fn points_of_a_sensor_survive_shrinking_and_holes_of_a_map_stay() {
        let truth = Plane::from_fn(8, 4, |x, y| match (x, y) {
            (0, 0) => 2.0,
            (5, 3) => 6.0,
            (4, 2) => 8.0,
            _ => f32::INFINITY,
        });
        let truth = truth.unwrap();
        let known = |density| {
            let places = sampling(&truth, density, 0.5).unwrap();
            let values = places.map(|(x, y)| truth.get(x, y));
            let known = values.pixels().filter(|d| d.is_finite());
            known.collect::<Vec<_>>()
        };
        // The pixels (1, 1) and (5, 3) are the centres.
        assert_eq!(known(MapDensity::Sparse), [2.0, 6.0]);
        assert_eq!(known(MapDensity::Dense), [6.0]);
    }

    #[test]
    fn colours_are_cropped_and_shrunk_as_their_greys() {
        let color = Rgb::from_fn(4, 2, |x, y| [10 * x as u8, y as u8 * 100, 7]).unwrap();
        let half = shrunk_color(&cropped(&color, [2, 0, 2, 2]).unwrap(), 0.5).unwrap();
        assert_eq!(half.row(0), [[25, 50, 7]]);
    }
}
