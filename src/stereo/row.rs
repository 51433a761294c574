//! Rows of a disparity map, to write.

use super::{DisparityMap, Reason};

/// Neighbouring rows of a [`DisparityMap`], to write.
pub struct BandMut<'a> {
    pub(super) width: usize,
    pub(super) disparity: &'a mut [f32],
    pub(super) why: &'a mut [Reason],
    pub(super) ssdpi: &'a mut [u32],
}

impl<'a> BandMut<'a> {
    /// The rows as writers, top to bottom, to be filled again later.
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
    pub fn into_bands(self, rows: usize) -> impl Iterator<Item = BandMut<'a>> {
        let (width, pixels) = (self.width, self.width * rows);
        let planes = self
            .disparity
            .chunks_mut(pixels)
            .zip(self.why.chunks_mut(pixels));
        let planes = planes.zip(self.ssdpi.chunks_mut(pixels));
        planes.map(move |((disparity, why), ssdpi)| BandMut {
            width,
            disparity,
            why,
            ssdpi,
        })
    }

    /// The rows as writers, top to bottom.
    pub fn into_rows(self) -> impl Iterator<Item = RowMut<'a>> {
        let disparity = self.disparity.chunks_exact_mut(self.width);
        let why = self.why.chunks_exact_mut(self.width);
        let ssdpi = self.ssdpi.chunks_exact_mut(self.width);
        disparity
            .zip(why)
            .zip(ssdpi)
            .map(|((disparity, why), ssdpi)| RowMut {
                disparity,
                why,
                ssdpi,
            })
    }
}

/// One row of a [`DisparityMap`], to write.
pub struct RowMut<'a> {
    pub(super) disparity: &'a mut [f32],
    pub(super) why: &'a mut [Reason],
    pub(super) ssdpi: &'a mut [u32],
}

impl RowMut<'_> {
    pub fn width(&self) -> usize {
        self.why.len()
    }

    /// The disparity at `x`, or why there is none.
    pub fn at(&self, x: usize) -> Result<f32, Reason> {
        match self.why[x] {
            Reason::Valid => Ok(self.disparity[x]),
            reason => Err(reason),
        }
    }

    /// The winners' SSDs.
    pub fn ssdpis(&self) -> &[u32] {
        self.ssdpi
    }

    /// Disparities, reasons and SSDPIs, to write together: finite exactly where valid.
    pub(crate) fn planes_mut(&mut self) -> (&mut [f32], &mut [Reason], &mut [u32]) {
        (self.disparity, self.why, self.ssdpi)
    }

    /// The row's pixels `columns` alone.
    pub fn part_mut(&mut self, columns: std::ops::Range<usize>) -> RowMut<'_> {
        RowMut {
            disparity: &mut self.disparity[columns.clone()],
            why: &mut self.why[columns.clone()],
            ssdpi: &mut self.ssdpi[columns],
        }
    }

    /// The winner's SSD at `x`.
    pub fn ssdpi(&self, x: usize) -> u32 {
        self.ssdpi[x]
    }

    /// Writes that no pixel of the row was compared, and why.
    pub fn clear(&mut self, reason: Reason) {
        debug_assert!(reason != Reason::Valid);
        self.disparity.fill(f32::INFINITY);
        self.why.fill(reason);
        self.ssdpi.fill(DisparityMap::NO_SSDPI);
    }

    /// Writes a disparity.
    pub fn accept(&mut self, x: usize, disparity: f32, ssdpi: u32) {
        debug_assert!(disparity.is_finite());
        self.disparity[x] = disparity;
        self.why[x] = Reason::Valid;
        self.ssdpi[x] = ssdpi;
    }

    /// Writes that there is none, and why.
    pub fn reject(&mut self, x: usize, reason: Reason, ssdpi: u32) {
        debug_assert!(reason != Reason::Valid);
        self.disparity[x] = f32::INFINITY;
        self.why[x] = reason;
        self.ssdpi[x] = ssdpi;
    }
}
