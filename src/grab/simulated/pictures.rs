//! The world of simulated cameras: part of the arena's run, rendered in advance, played forward and
//! backward.

use super::sensor::REFERENCE;
use rayon::prelude::*;
use svl_calibrate::simulated::{MovingBoard, RATE_HZ};
use svl_core::stereo::{Gray, Rig, Side, StereoPair};
use svl_core::{Error, Result};
use svl_sim::arena::{Arena, ArenaConfig};

/// Pairs without noise, with an exposure of 8 ms, at a fixed rate.
///
/// Rendering one takes longer than a camera's period, so all are rendered in advance. An image
/// shows the world at the time of its exposure, so a pair with skew shows two moments. A longer
/// shutter makes it brighter, not more blurred.
pub struct RenderedPictures {
    pairs: Vec<StereoPair>,
    period_ns: u64,
    rig: Option<Rig>,
}

impl RenderedPictures {
    /// Renders the first `count` pictures of the arena's run, at `rate_hz` but at most 100 per
    /// second. `None` once `go_on` returns false, which is called after each picture, on any
    /// thread.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the arena's settings are invalid.
    pub fn render(
        (width_px, height_px): (usize, usize),
        rate_hz: f64,
        count: usize,
        seed: u64,
        go_on: impl Fn() -> bool + Sync,
    ) -> Result<Option<Self>> {
        // The reference shutter of 8 ms has to fit into the period.
        let rate_hz = rate_hz.min(100.0);
        let mut config = ArenaConfig::default();
        let duration_s = config.frames as f64 / config.rate_hz;
        config.rate_hz = rate_hz;
        config.frames = (duration_s * rate_hz).ceil() as u64;
        (config.rig.width_px, config.rig.height_px) = (width_px, height_px);
        // Each camera adds its own noise on exposure.
        config.sensor.noise = false;
        (config.sensor.shutter_us, config.sensor.gain_db) =
            (REFERENCE.shutter_us, f64::from(REFERENCE.gain_mdb) / 1e3);
        let arena = Arena::new(&config, seed)?;
        let count = (count as u64).min(arena.frames());
        let pairs = rendered(count, go_on, |i| arena.frame(i).map(|frame| frame.pair))?;
        pairs
            .map(|pairs| Self::new(pairs, rate_hz, Some(arena.rig())))
            .transpose()
    }

    /// Renders all pictures of a moving calibration board, like [`RenderedPictures::render`], with
    /// lens distortion.
    ///
    /// # Errors
    /// [`Error::Usage`] for a size other than that of the board's cameras.
    pub fn render_board(
        size: (usize, usize),
        seed: u64,
        go_on: impl Fn() -> bool + Sync,
    ) -> Result<Option<Self>> {
        let board = MovingBoard::new(seed)?;
        let own = board.truth.left().size();
        if size != own {
            let reason = format!(
                "sim: the board's pictures are {}x{}, not {}x{}",
                own.0, own.1, size.0, size.1
            );
            return Err(Error::Usage(reason));
        }
        let pairs = rendered(board.pairs(), go_on, |i| board.pair(i))?;
        pairs
            .map(|pairs| Self::new(pairs, RATE_HZ, None))
            .transpose()
    }

    /// Pictures from images.
    ///
    /// # Errors
    /// [`Error::Usage`] if there are none, or `rate_hz` is invalid.
    pub fn new(pairs: Vec<StereoPair>, rate_hz: f64, rig: Option<Rig>) -> Result<Self> {
        let period_ns = (1e9 / rate_hz).round() as u64;
        if pairs.is_empty() || period_ns == 0 || !rate_hz.is_finite() {
            return Err(Error::Usage(format!(
                "simulated cameras: {} pictures, {rate_hz} a second",
                pairs.len()
            )));
        }
        Ok(Self {
            pairs,
            period_ns,
            rig,
        })
    }

    pub fn rig(&self) -> Option<Rig> {
        self.rig
    }

    /// The picture of a camera at a time. They play forward, then backward, without a jump.
    pub(super) fn at(&self, side: Side, time_ns: u64) -> &Gray {
        // Forward and backward without showing the first and the last picture twice.
        let turns = (2 * (self.pairs.len() - 1)).max(1);
        let step = ((time_ns / self.period_ns) % turns as u64) as usize;
        let pair = &self.pairs[if step < self.pairs.len() {
            step
        } else {
            turns - step
        }];
        match side {
            Side::Left => pair.left(),
            Side::Right => pair.right(),
        }
    }
}

/// `count` pairs; `None` once `go_on` returns false, which is called after each pair.
fn rendered(
    count: u64,
    go_on: impl Fn() -> bool + Sync,
    pair: impl Fn(u64) -> Result<StereoPair> + Sync,
) -> Result<Option<Vec<StereoPair>>> {
    let one = |i| pair(i).map(|pair| go_on().then_some(pair)).transpose();
    (0..count)
        .into_par_iter()
        .map(one)
        .collect::<Option<Result<_>>>()
        .transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn rendering_can_be_stopped() {
        let done = AtomicU64::new(0);
        let pictures = RenderedPictures::render((32, 24), 60.0, 200, 1, || {
            done.fetch_add(1, Ordering::Relaxed) < 3
        });
        assert!(pictures.unwrap().is_none());
        assert!(done.into_inner() < 100, "the others are not begun");
        assert!(
            RenderedPictures::render((32, 24), 60.0, 2, 1, || true)
                .unwrap()
                .is_some()
        );
    }
}
