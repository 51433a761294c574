//! Blocks of rows of a pair, one task for a thread from the smoothing to the last check: every
//! stage finds the rows in the thread's cache.

use super::{Blocks, VerticalSmoothing};
use crate::error::Result;
use crate::kernel::{Isa, Lanes, transpose};
use crate::stereo::{BandMut, DisparityMap, Gray, StereoPair};
use crate::timing::{Clock, Stage, StageTimes};

/// A block of rows of a pair, smoothed, and its columns.
pub struct Strip {
    left: Gray,
    right: Gray,
    left_columns: Vec<Lanes<u16>>,
    right_columns: Vec<Lanes<u16>>,
}

impl Strip {
    /// For pairs of that width.
    ///
    /// # Errors
    /// [`crate::Error::Dimensions`].
    pub fn new(width: usize) -> Result<Self> {
        let [left, right] = [0; 2].map(|_| Gray::filled(width, Blocks::ROWS, 0));
        let [left_columns, right_columns] = [0; 2].map(|_| vec![Lanes::splat(0); width]);
        Ok(Self {
            left: left?,
            right: right?,
            left_columns,
            right_columns,
        })
    }

    /// Loads `rows` rows of `pair` from `top` on, smoothed.
    pub fn load(
        &mut self,
        isa: Isa,
        smoothing: &VerticalSmoothing,
        pair: &StereoPair,
        top: usize,
        rows: usize,
    ) {
        for (image, strip) in [
            (pair.left(), &mut self.left),
            (pair.right(), &mut self.right),
        ] {
            (0..rows)
                .for_each(|lane| smoothing.apply_row(isa, image, top + lane, strip.row_mut(lane)));
        }
    }

    /// Transposes the rows into columns of lanes.
    pub fn transpose(&mut self, isa: Isa) {
        transpose(isa, &self.left, 0, &mut self.left_columns);
        transpose(isa, &self.right, 0, &mut self.right_columns);
    }

    /// A row of the left image.
    pub fn left(&self, lane: usize) -> &[u8] {
        self.left.row(lane)
    }

    /// A row of the right image.
    pub fn right(&self, lane: usize) -> &[u8] {
        self.right.row(lane)
    }

    /// The columns of the left and the right image; rows that were not loaded are unspecified.
    pub fn columns(&self) -> [&[Lanes<u16>]; 2] {
        [&self.left_columns, &self.right_columns]
    }
}

/// The bands into which images of one height are cut, each with its scratch.
pub struct Bands<S> {
    rows: usize,
    /// With the time spent there on the last pair.
    scratch: Vec<(S, StageTimes)>,
}

impl<S: Send> Bands<S> {
    /// For images of `height` rows.
    ///
    /// # Errors
    /// The errors of `scratch`.
    pub fn new(height: usize, scratch: impl Fn() -> Result<S>) -> Result<Self> {
        let (bands, rows) = Blocks::bands(height);
        let scratch = (0..bands)
            .map(|_| Ok((scratch()?, StageTimes::default())))
            .collect::<Result<_>>()?;
        Ok(Self { rows, scratch })
    }

    /// Runs `work` on each block of rows of `map` with the index of the first, on the threads of
    /// rayon's current pool.
    pub fn each_block(
        &mut self,
        map: &mut DisparityMap,
        clock: &mut Clock,
        work: impl Fn(usize, BandMut<'_>, &mut S, &mut Clock) + Sync,
    ) {
        map.each_band_mut(
            self.rows,
            &mut self.scratch,
            |top, band, (scratch, times)| {
                let mut clock = Clock::start();
                for (block, rows) in band.into_bands(Blocks::ROWS).enumerate() {
                    work(top + block * Blocks::ROWS, rows, scratch, &mut clock);
                }
                *times = clock.times();
            },
        );
        let mut times = StageTimes::default();
        // Bands run in parallel: their times add up to more than the wall time, which is divided
        // among the stages in proportion.
        for (_, band) in &self.scratch {
            Stage::ALL
                .into_iter()
                .for_each(|stage| times.add(stage, band.get(stage)));
        }
        clock.lap_as(times);
    }
}
