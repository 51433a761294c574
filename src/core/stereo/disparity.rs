//! A dense disparity map: disparities, and the reason for each invalid pixel.

use super::row::NO_SSDPI;
use super::{BandMut, GridShape, Plane, Reason, RowMut};
use crate::error::Result;
use parking_lot::Mutex;

/// Disparity and reason for every pixel of the left image; with some matchers also the winner's SSD
/// and row offset.
///
/// A pixel's disparity is finite exactly if its reason is [`Reason::Valid`]; otherwise it is `+∞`.
#[derive(Clone, Debug, PartialEq)]
pub struct DisparityMap {
    disparity: Plane<f32>,
    why: Plane<Reason>,
    ssdpi: Option<Plane<u32>>,
    row_offset: Option<Plane<i8>>,
}

/// Planes of a [`DisparityMap`] that only some matchers produce.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExtraPlanes {
    pub ssdpi: bool,
    pub row_offset: bool,
}

impl ExtraPlanes {
    pub const NONE: Self = Self {
        ssdpi: false,
        row_offset: false,
    };
    /// SSDPIs alone.
    pub const SSDPI: Self = Self {
        ssdpi: true,
        row_offset: false,
    };
    pub const ALL: Self = Self {
        ssdpi: true,
        row_offset: true,
    };
}

impl DisparityMap {
    /// SSDPI of a pixel that was never compared.
    pub const NO_SSDPI: u32 = NO_SSDPI;

    /// A map in which every pixel is [`Reason::Border`], without extra planes.
    ///
    /// # Errors
    /// [`crate::Error::Dimensions`].
    pub fn new(width: usize, height: usize) -> Result<Self> {
        Ok(Self {
            disparity: Plane::filled(width, height, f32::INFINITY)?,
            why: Plane::filled(width, height, Reason::Border)?,
            ssdpi: None,
            row_offset: None,
        })
    }

    /// [`DisparityMap::new`] with `extra` planes.
    ///
    /// # Errors
    /// [`crate::Error::Dimensions`].
    pub fn with_planes(width: usize, height: usize, extra: ExtraPlanes) -> Result<Self> {
        let mut map = Self::new(width, height)?;
        map.resize(width, height, extra)?;
        Ok(map)
    }

    /// Resizes the map to `width` x `height` with exactly these `extra` planes. Memory and content
    /// that already fit are kept.
    ///
    /// # Errors
    /// [`crate::Error::Dimensions`].
    pub fn resize(&mut self, width: usize, height: usize, extra: ExtraPlanes) -> Result<()> {
        if self.size() != (width, height) {
            *self = Self::new(width, height)?;
        }
        fit(
            &mut self.ssdpi,
            extra.ssdpi,
            (width, height),
            Self::NO_SSDPI,
        )?;
        fit(&mut self.row_offset, extra.row_offset, (width, height), 0)
    }

    pub fn size(&self) -> (usize, usize) {
        self.disparity.size()
    }

    /// The extra planes of the map.
    pub fn extra(&self) -> ExtraPlanes {
        ExtraPlanes {
            ssdpi: self.ssdpi.is_some(),
            row_offset: self.row_offset.is_some(),
        }
    }

    /// Disparities in pixels, `+∞` for invalid pixels.
    pub fn disparity(&self) -> &Plane<f32> {
        &self.disparity
    }

    pub fn why(&self) -> &Plane<Reason> {
        &self.why
    }

    /// The winner's sum of squared differences of pixel intensities (thesis, section 5.3.3), kept
    /// even if a later check rejected it; [`DisparityMap::NO_SSDPI`] if nothing was compared.
    /// `None` from matchers without such a cost.
    pub fn ssdpi(&self) -> Option<&Plane<u32>> {
        self.ssdpi.as_ref()
    }

    /// Row of each pixel's match minus the pixel's row: `(x, y)` matches `(x − d, y + offset)` in
    /// the right image; meaningless for invalid pixels. `None` from matchers that search only along
    /// the row.
    pub fn row_offset(&self) -> Option<&Plane<i8>> {
        self.row_offset.as_ref()
    }

    /// The row offsets, mutable; `None` if the map has no such plane.
    pub fn row_offset_mut(&mut self) -> Option<&mut Plane<i8>> {
        self.row_offset.as_mut()
    }

    /// The vertical misalignment, in rows by which the right image is too low: the median row
    /// offset of the valid pixels (the lower of the two middle ones for an even number). 0 for a
    /// rectified pair; `None` without row offsets or valid pixels.
    pub fn median_row_offset(&self) -> Option<i8> {
        let mut counts = [0usize; 256];
        let offsets = self.row_offset.as_ref()?.pixels().zip(self.why.pixels());
        offsets
            .filter(|&(_, why)| why == Reason::Valid)
            // A histogram of all 256 offsets instead of sorting a map's pixels.
            .for_each(|(offset, _)| counts[usize::from(offset as u8)] += 1);
        let half = counts.iter().sum::<usize>().div_ceil(2);
        let mut below = 0;
        (i8::MIN..=i8::MAX).find(|&offset| {
            below += counts[usize::from(offset as u8)];
            half > 0 && below >= half
        })
    }

    /// The disparity at `(x, y)`, or the reason for its absence.
    pub fn at(&self, x: usize, y: usize) -> std::result::Result<f32, Reason> {
        match self.why.get(x, y) {
            Reason::Valid => Ok(self.disparity.get(x, y)),
            reason => Err(reason),
        }
    }

    /// The rows as writers, top to bottom, to be filled in any order.
    pub fn rows_mut(&mut self) -> impl Iterator<Item = RowMut<'_>> {
        self.band_mut().into_rows()
    }

    /// Cuts the map into bands of `rows` rows and calls `work` with the index of each band's first
    /// row, its rows and one element of `scratch`, on the threads of rayon's current pool.
    /// `scratch` has one element per band.
    pub fn each_band_mut<S: Send>(
        &mut self,
        rows: usize,
        scratch: &mut [S],
        work: impl Fn(usize, BandMut<'_>, &mut S) + Sync,
    ) {
        let height = self.size().1;
        assert!(
            rows * scratch.len() >= height,
            "{} bands of {rows} rows do not cover {height}",
            scratch.len()
        );
        let count = height.div_ceil(rows);
        let bands = self.band_mut().into_bands(rows).zip(scratch);
        share(bands.enumerate(), count, |(index, (band, scratch))| {
            work(index * rows, band, scratch);
        });
    }

    /// Calls `work` with the number of each row, the row and the scratch of its band, as
    /// [`DisparityMap::each_band_mut`].
    pub fn each_row_mut<S: Send>(
        &mut self,
        rows: usize,
        scratch: &mut [S],
        work: impl Fn(usize, &mut RowMut<'_>, &mut S) + Sync,
    ) {
        self.each_band_mut(rows, scratch, |top, band, scratch| {
            for (y, mut row) in (top..).zip(band.into_rows()) {
                work(y, &mut row, scratch);
            }
        });
    }

    /// All rows as one band.
    fn band_mut(&mut self) -> BandMut<'_> {
        let ssdpi = self.ssdpi.as_mut().and_then(Plane::as_mut_slice);
        // Planes of a map are made by `Plane::filled`, so their rows have no gaps.
        BandMut {
            width: self.disparity.width(),
            disparity: self.disparity.as_mut_slice().expect("gapless"),
            why: self.why.as_mut_slice().expect("gapless"),
            ssdpi: ssdpi.unwrap_or_default(),
        }
    }

    /// Number of valid pixels.
    pub fn valid(&self) -> usize {
        self.why.pixels().filter(|&w| w == Reason::Valid).count()
    }

    /// Fraction of valid pixels, 0..=1.
    pub fn coverage(&self) -> f64 {
        let (width, height) = self.size();
        self.valid() as f64 / (width * height) as f64
    }

    /// Pixels per reason, indexed by its code.
    pub fn tally(&self) -> [usize; Reason::PIXELS.len()] {
        let mut tally = [0; Reason::PIXELS.len()];
        self.why.pixels().for_each(|w| tally[w as usize] += 1);
        tally
    }

    /// The reason why a cell is unknown: the most frequent one of its invalid pixels, the lower
    /// code if equal. [`Reason::Disagreement`] if at least the fraction `min_valid`, 0..=1, is
    /// valid.
    pub fn cell_reason(&self, shape: GridShape, place: (usize, usize), min_valid: f64) -> Reason {
        let (columns, rows) = shape.pixels(place, self.size());
        let pixels = columns.len() * rows.len();
        // Two histograms, as neighbours mostly have one reason, and an addition waits for the last.
        let mut counts = [[0u32; Reason::PIXELS.len()]; 2];
        for y in rows {
            for (x, &why) in self.why.row(y)[columns.clone()].iter().enumerate() {
                counts[x % 2][why as usize] += 1;
            }
        }
        let [mut counts, odd] = counts;
        (counts.iter_mut().zip(odd)).for_each(|(count, odd)| *count += odd);
        let [valid, invalid @ ..] = counts;
        if valid > 0 && f64::from(valid) >= min_valid * pixels as f64 {
            return Reason::Disagreement;
        }
        let most = invalid.iter().max();
        let reasons = Reason::PIXELS[1..].iter().zip(&invalid);
        let mut most_frequent = reasons.filter(|(_, count)| Some(*count) == most);
        most_frequent
            .next()
            .map_or(Reason::Valid, |(reason, _)| *reason)
    }

    /// Hash of size, disparities, reasons and row offsets: equal results have equal hashes on every
    /// machine.
    pub fn hash(&self) -> u128 {
        let (width, height) = self.size();
        let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
        hasher.update(&(width as u32).to_le_bytes());
        hasher.update(&(height as u32).to_le_bytes());
        // Row by row in little endian, so that neither gaps nor the machine's byte order matter.
        let (mut values, mut bytes) = (Vec::with_capacity(width), Vec::with_capacity(width));
        for (disparity, why) in self.disparity.rows().zip(self.why.rows()) {
            values.clear();
            values.extend(disparity.iter().map(|d| d.to_le_bytes()));
            hasher.update(values.as_flattened());
            bytes.clear();
            bytes.extend(why.iter().map(|&w| w as u8));
            hasher.update(&bytes);
        }
        for offset in self.row_offset.iter().flat_map(Plane::rows) {
            bytes.clear();
            bytes.extend(offset.iter().map(|&o| o as u8));
            hasher.update(&bytes);
        }
        hasher.digest128()
    }
}

/// Adds or removes an extra plane; keeps one that is there.
fn fit<T: Copy>(
    plane: &mut Option<Plane<T>>,
    wanted: bool,
    (width, height): (usize, usize),
    none: T,
) -> Result<()> {
    match (wanted, &plane) {
        (false, _) => *plane = None,
        (true, None) => *plane = Some(Plane::filled(width, height, none)?),
        // Stale content is fine: a matcher writes every pixel of every plane.
        (true, Some(_)) => {}
    }
    Ok(())
}

/// Runs `work` on all `count` items, on the threads of rayon's current pool.
///
/// The calling thread works too, instead of waiting: a whole pair takes a fraction of a
/// millisecond, and the pool's other threads need a part of that to wake up. A caller in the pool
/// needs none of them: it can process every item itself, and threads that start late find none
/// left.
fn share<T: Send>(items: impl Iterator<Item = T> + Send, count: usize, work: impl Fn(T) + Sync) {
    let helpers = rayon::current_num_threads().min(count).saturating_sub(1);
    if helpers == 0 {
        return items.for_each(work);
    }
    let items = Mutex::new(items);
    let next = || items.lock().next();
    let work_off = || std::iter::from_fn(next).for_each(&work);
    if rayon::current_thread_index().is_some() {
        return repeat(helpers, &work_off);
    }
    rayon::in_place_scope(|scope| {
        (0..helpers).for_each(|_| scope.spawn(|_| work_off()));
        work_off();
    });
}

/// Calls `work` here and by up to `helpers` other threads of this thread's pool. Unlike a scope,
/// it allocates nothing.
fn repeat(helpers: usize, work: &(impl Fn() + Sync)) {
    if helpers == 0 {
        return work();
    }
    rayon::join(work, || repeat(helpers - 1, work));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_has_the_most_frequent_reason() {
        let shape = GridShape {
            columns: 2,
            rows: 1,
        };
        let mut map = DisparityMap::new(10, 1).unwrap();
        let mut row = map.rows_mut().next().unwrap();
        for (x, reason) in [
            (0, Reason::Unmatched),
            (1, Reason::Unmatched),
            (2, Reason::Floor),
            (3, Reason::Floor),
        ] {
            row.reject(x, reason);
        }
        row.accept(4, 7.0);
        row.accept(5, 7.0);
        let reason = |cell, min_valid| map.cell_reason(shape, (cell, 0), min_valid);
        assert_eq!(
            [0.21, 0.2].map(|m| reason(0, m)),
            [Reason::Unmatched, Reason::Disagreement]
        );
        assert_eq!(reason(1, 0.5), Reason::Border);
    }

    #[test]
    fn a_pixel_is_finite_exactly_when_valid() {
        let mut map = DisparityMap::new(3, 2).unwrap();
        map.rows_mut().nth(1).unwrap().accept(2, 7.0);
        assert_eq!(map.at(2, 1), Ok(7.0));
        assert_eq!(map.at(0, 0), Err(Reason::Border));
        map.rows_mut().nth(1).unwrap().reject(2, Reason::SelfCheck);
        assert_eq!(
            (map.at(2, 1), map.disparity().get(2, 1)),
            (Err(Reason::SelfCheck), f32::INFINITY)
        );
        assert_eq!(map.valid(), 0);
    }

    #[test]
    fn hash_sees_reasons() {
        let a = DisparityMap::new(3, 2).unwrap();
        let mut b = a.clone();
        b.rows_mut().next().unwrap().reject(0, Reason::Untextured);
        assert_ne!(a.hash(), b.hash());
    }
}
