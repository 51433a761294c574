//! Row writers of a disparity map: one row, or a band of rows that a thread fills.

use super::Reason;

/// SSDPI of a pixel for which nothing was compared.
pub(super) const NO_SSDPI: u32 = u32::MAX;

/// Neighbouring rows of a [`super::DisparityMap`], mutable.
pub struct BandMut<'a> {
    pub(super) width: usize,
    pub(super) disparity: &'a mut [f32],
    pub(super) why: &'a mut [Reason],
    /// Empty where the map has no SSDPI plane.
    pub(super) ssdpi: &'a mut [u32],
}

impl<'a> BandMut<'a> {
    /// The rows as writers, top to bottom; the band can be iterated again.
    pub fn rows_mut(&mut self) -> impl Iterator<Item = RowMut<'_>> {
        BandMut {
            width: self.width,
            disparity: self.disparity,
            why: self.why,
            ssdpi: self.ssdpi,
        }
        .into_rows()
    }

    /// Rows of the band.
    pub fn rows(&self) -> usize {
        self.why.len() / self.width
    }

    /// Cuts the band into bands of `rows` rows, top to bottom; the last may have fewer.
    pub fn into_bands(mut self, rows: usize) -> impl Iterator<Item = BandMut<'a>> {
        std::iter::from_fn(move || self.split_off(rows))
    }

    /// The rows as writers, top to bottom.
    pub fn into_rows(mut self) -> impl Iterator<Item = RowMut<'a>> {
        std::iter::from_fn(move || self.split_off(1)).map(|row| RowMut {
            disparity: row.disparity,
            why: row.why,
            ssdpi: row.ssdpi,
        })
    }

    /// Splits off the first `rows` rows, or as many as remain; `None` if the band is empty.
    fn split_off(&mut self, rows: usize) -> Option<Self> {
        let pixels = (rows * self.width).min(self.why.len());
        // A missing SSDPI plane is an empty slice, and so are all its parts.
        let ssdpis = pixels.min(self.ssdpi.len());
        (pixels > 0).then_some(Self {
            width: self.width,
            disparity: self.disparity.split_off_mut(..pixels)?,
            why: self.why.split_off_mut(..pixels)?,
            ssdpi: self.ssdpi.split_off_mut(..ssdpis)?,
        })
    }
}

/// One row of a [`super::DisparityMap`], mutable.
pub struct RowMut<'a> {
    disparity: &'a mut [f32],
    why: &'a mut [Reason],
    /// Empty where the map has no SSDPI plane.
    ssdpi: &'a mut [u32],
}

impl RowMut<'_> {
    pub fn width(&self) -> usize {
        self.why.len()
    }

    /// The disparity at `x`, or the reason for its absence.
    pub fn at(&self, x: usize) -> Result<f32, Reason> {
        match self.why[x] {
            Reason::Valid => Ok(self.disparity[x]),
            reason => Err(reason),
        }
    }

    /// The winners' SSDs; empty where the map has no SSDPI plane.
    pub fn ssdpi(&self) -> &[u32] {
        self.ssdpi
    }

    /// Disparities, reasons and SSDPIs, mutable together: a disparity is finite exactly if valid.
    /// SSDPIs are empty if the map has none.
    pub(crate) fn planes_mut(&mut self) -> (&mut [f32], &mut [Reason], &mut [u32]) {
        (self.disparity, self.why, self.ssdpi)
    }

    /// Pixels `columns` of the row.
    pub fn part_mut(&mut self, columns: std::ops::Range<usize>) -> RowMut<'_> {
        RowMut {
            disparity: &mut self.disparity[columns.clone()],
            why: &mut self.why[columns.clone()],
            ssdpi: self.ssdpi.get_mut(columns).unwrap_or_default(),
        }
    }

    /// Rejects the whole row; no pixel of it was compared.
    pub fn clear(&mut self, reason: Reason) {
        debug_assert!(reason != Reason::Valid);
        self.disparity.fill(f32::INFINITY);
        self.why.fill(reason);
        self.ssdpi.fill(NO_SSDPI);
    }

    /// Writes a disparity; the SSDPI is unchanged.
    pub fn accept(&mut self, x: usize, disparity: f32) {
        debug_assert!(disparity.is_finite());
        self.disparity[x] = disparity;
        self.why[x] = Reason::Valid;
    }

    /// Writes all pixels, `+∞` for invalid ones; SSDPIs are unchanged.
    ///
    /// # Panics
    /// Unless both have the row's width.
    pub fn write(&mut self, disparities: &[f32], why: &[Reason]) {
        self.disparity.copy_from_slice(disparities);
        self.why.copy_from_slice(why);
    }

    /// Marks the pixel as invalid for a reason; the SSDPI is unchanged.
    pub fn reject(&mut self, x: usize, reason: Reason) {
        debug_assert!(reason != Reason::Valid);
        self.disparity[x] = f32::INFINITY;
        self.why[x] = reason;
    }

    /// Writes the winner's SSD.
    ///
    /// # Panics
    /// If the map has no SSDPI plane.
    pub fn set_ssdpi(&mut self, x: usize, ssdpi: u32) {
        self.ssdpi[x] = ssdpi;
    }
}
