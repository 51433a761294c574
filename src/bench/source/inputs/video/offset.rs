//! The offset of two videos by their pixels: those of cameras that were started by hand.
//!
//! Whatever both cameras see, it changes when they turn, shake, start and stop: how much each frame
//! differs from the one before it is compared.

use super::stamped::{FrameClock, StampedVideo};
use super::stream::VideoStream;
use svl_core::Result;
use svl_core::stereo::Gray;
use svl_files::DecodedImage;

/// Size of the frames that are compared, the number of them, and the fewest.
const SIZE: (usize, usize) = (64, 48);
const MAX_FRAMES: usize = 450;
const MIN_FRAMES: usize = 60;
/// Least correlation, and by how much it is above those of all offsets but its neighbours.
const MIN_CORRELATION: f64 = 0.8;
const MIN_AHEAD: f64 = 0.15;
const NEIGHBOURS: u64 = 5;

/// Changes of frames by their times in periods.
type FrameChanges = Vec<Option<f64>>;

/// The frames by which the first ones of the right video come later than those of the left one at
/// the same moments, with the correlation of their changes then and as they are; `None` unless that
/// is far better.
///
/// # Errors
/// The errors of [`VideoStream::next`].
pub(crate) fn late(
    videos: [&VideoStream; 2],
    clock: FrameClock,
) -> Result<Option<(i64, f64, f64)>> {
    let [left, right] = videos.map(|video| changes(video, clock));
    Ok(best(&left?, &right?))
}

fn changes(video: &VideoStream, clock: FrameClock) -> Result<FrameChanges> {
    let mut video = StampedVideo::new(video.again(SIZE)?, clock, 0);
    let (mut changes, mut before) = (FrameChanges::new(), None::<Gray>);
    while changes.len() < MAX_FRAMES {
        video.fill(1)?;
        let Some((stamp_ns, DecodedImage::Gray(image))) = video.take() else {
            break;
        };
        let place = (stamp_ns as f64 / clock.period_ns() as f64).round() as usize;
        let place = place.min(MAX_FRAMES);
        changes.resize(changes.len().max(place + 1), None);
        changes[place] = before.map(|before| {
            let both = before.pixels().zip(image.pixels());
            both.map(|(a, b)| f64::from(a.abs_diff(b))).sum()
        });
        before = Some(image);
    }
    Ok(changes)
}

fn best(left: &FrameChanges, right: &FrameChanges) -> Option<(i64, f64, f64)> {
    let reach = left.len().max(right.len()) as i64;
    let all = (-reach..=reach).filter_map(|late| Some((late, correlation(left, right, late)?)));
    let all: Vec<_> = all.collect();
    let (late, most) = *all.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let unmoved = correlation(left, right, 0).unwrap_or(0.0);
    let others = all
        .iter()
        .filter(|other| other.0.abs_diff(late) > NEIGHBOURS);
    let next = others.map(|other| other.1).fold(unmoved, f64::max);
    (most >= MIN_CORRELATION && most - next >= MIN_AHEAD).then_some((late, most, unmoved))
}

/// The correlation of changes, the right ones `late` frames later; `None` of few frames.
fn correlation(left: &FrameChanges, right: &FrameChanges, late: i64) -> Option<f64> {
    let both = left.iter().enumerate().filter_map(|(place, left)| {
        let place = usize::try_from(place as i64 + late).ok()?;
        Some(((*left)?, (*right.get(place)?)?))
    });
    let n = both.clone().count() as f64;
    let mean = |value: fn((f64, f64)) -> f64| both.clone().map(value).sum::<f64>() / n;
    let (l, r) = (mean(|both| both.0), mean(|both| both.1));
    let squares = mean(|both| both.0 * both.0) - l * l;
    let squares = squares * (mean(|both| both.1 * both.1) - r * r);
    let is_known = n >= MIN_FRAMES as f64 && squares > 0.0;
    is_known.then(|| (mean(|both| both.0 * both.1) - l * r) / squares.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Changes of a camera that shakes, from a frame on, with noise of their own.
    fn shaken(from: u64, seed: u64, amount: f64) -> FrameChanges {
        let noise = |n: u64| {
            let mixed = (n ^ (n >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            (mixed >> 40) as f64 / f64::from(1 << 24)
        };
        let change = |frame: u64| noise(frame) + amount * noise(seed + 1000 * frame);
        (from..from + 150)
            .map(|frame| Some(change(frame)))
            .collect()
    }

    #[test]
    fn a_late_start_is_found_and_nothing_else() {
        // The right video that starts later shows the same at an earlier frame.
        for (from, frames) in [(140, -40), (60, 40), (101, -1)] {
            let found = best(&shaken(100, 7, 0.2), &shaken(from, 8, 0.2)).unwrap();
            assert_eq!(found.0, frames, "{from}");
            assert!(found.1 > 0.9 && found.2 < 0.3, "{found:?}");
        }
        let together = best(&shaken(100, 7, 0.2), &shaken(100, 8, 0.2));
        assert_eq!(together, None, "together");
        assert_eq!(
            best(&shaken(100, 7, 2.0), &shaken(140, 8, 2.0)),
            None,
            "noise"
        );
        // Scenes that repeat, or hardly change, fit everywhere.
        let still = vec![Some(3.0); 150];
        assert_eq!(best(&still, &still), None, "still");
        let wave = |from: u32| -> FrameChanges {
            (from..from + 150)
                .map(|frame| Some((0.3 * f64::from(frame)).sin()))
                .collect()
        };
        assert_eq!(best(&wave(0), &wave(7)), None, "waves");
    }
}
