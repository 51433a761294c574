//! Propagation of reliable disparities over unreliable ones, along columns and rows up to the
//! image's edges (Birchfield and Tomasi 1998, section 4, as in OpenCV 1.0).
//!
//! The reliability of a pixel is the length of its run of equal disparities.

/// A pixel of a column or a row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PropagationPixel {
    pub disparity: u8,
    /// On an edge of the image, which stops the propagation.
    pub edge: bool,
    /// Length of its run, set by [`Propagation::apply`].
    pub run: u16,
}

/// Run lengths, in pixels, from which disparities propagate or resist.
#[derive(Clone, Copy, Debug)]
pub struct Propagation {
    /// From this length on a smaller disparity is not overwritten.
    pub slightly_reliable: u16,
    /// From this length on a disparity propagates.
    pub moderately_reliable: u16,
    /// From this length on a disparity propagates even over one that is larger by one.
    pub highly_reliable: u16,
}

impl Propagation {
    /// Propagates disparities along a line, from its start and in place.
    pub fn apply(&self, line: &mut [PropagationPixel]) {
        measure_runs(line);
        let mut i = 0;
        while i < line.len() {
            let from = line[i];
            if from.run < self.moderately_reliable || from.edge || from.disparity == 0 {
                i += 1;
                continue;
            }
            let (before, after) = line.split_at_mut(i);
            self.overwrite(from, before.iter_mut().rev());
            // The pixels just written have this disparity, and need no propagation of their own.
            i += 1 + self.overwrite(from, after[1..].iter_mut());
        }
    }

    /// Writes the disparity of `from` until something stops it; returns the number of pixels
    /// written.
    fn overwrite<'a>(
        &self,
        from: PropagationPixel,
        line: impl Iterator<Item = &'a mut PropagationPixel>,
    ) -> usize {
        let nearer = u16::from(from.disparity) + 1;
        let mut count = 0;
        for pixel in line {
            let stops = pixel.edge
                || pixel.disparity < from.disparity && pixel.run >= self.slightly_reliable
                || u16::from(pixel.disparity) == nearer && from.run < self.highly_reliable;
            if stops {
                break;
            }
            pixel.disparity = from.disparity;
            count += 1;
        }
        count
    }
}

fn measure_runs(line: &mut [PropagationPixel]) {
    for run in line.chunk_by_mut(|a, b| a.disparity == b.disparity) {
        // Lines are no longer than `MAX_SIDE`.
        let length = run.len() as u16;
        run.iter_mut().for_each(|pixel| pixel.run = length);
    }
}

/// Assigns a pixel the disparity of its neighbours if these agree, from the line's start and in
/// place.
pub fn bridge(line: &mut [PropagationPixel]) {
    for i in 1..line.len().saturating_sub(1) {
        if line[i - 1].disparity == line[i + 1].disparity {
            line[i].disparity = line[i - 1].disparity;
        }
    }
}
