//! The offset of two videos by their pixels: those of cameras that were started by hand.
//!
//! Both cameras turn and shake at the same time, whatever their images show: so the motions of their
//! images from one frame to the next are compared.

use super::stamped::FrameClock;
use super::stream::VideoStream;
use svl_core::Result;
use svl_core::stereo::Gray;
use svl_files::DecodedImage;

/// Size of the frames that are compared, the number of them, and the fewest.
const SIZE: (usize, usize) = (64, 48);
const MAX_FRAMES: usize = 450;
const MIN_FRAMES: usize = 60;
/// Least correlation, and by how much it is above that of all times but its neighbours'.
const MIN_CORRELATION: f64 = 0.8;
const MIN_AHEAD: f64 = 0.1;
const NEIGHBOURS: usize = 5;

/// An offset that fits better than none.
pub(super) struct OffsetFit {
    /// Added to the stamps of the right video.
    pub offset_ns: i64,
    /// The correlation of the motions with it, and without.
    pub correlation: f64,
    pub unmoved: f64,
}

/// Motions along rows and columns by the number of the frame's time; pixels.
type Motions = Vec<Option<[f64; 2]>>;

/// The offset of the right video that fits the pixels of the first frames, if none does not.
///
/// # Errors
/// The errors of [`VideoStream::next`].
pub(super) fn fit(videos: [&VideoStream; 2], clock: FrameClock) -> Result<Option<OffsetFit>> {
    let [left, right] = videos.map(|video| motions(video, clock));
    Ok(
        best(&left?, &right?).map(|(frames, correlation, unmoved)| OffsetFit {
            offset_ns: -frames * clock.period_ns() as i64,
            correlation,
            unmoved,
        }),
    )
}

/// The motions of the first frames, without their mean.
fn motions(video: &VideoStream, clock: FrameClock) -> Result<Motions> {
    let mut video = video.again(SIZE)?;
    let (mut motions, mut before) = (Motions::new(), None);
    let mut read = 0;
    while read < MAX_FRAMES
        && let Some((time_ns, DecodedImage::Gray(image))) = video.next()?
    {
        let place = clock.place(time_ns, read).min(2 * MAX_FRAMES);
        motions.resize(motions.len().max(place + 1), None);
        let now = profiles(&image);
        if let Some([columns, rows]) = before.replace(now.clone()) {
            motions[place] = Some([shift(&columns, &now[0]), shift(&rows, &now[1])]);
        }
        read += 1;
    }
    let known = motions.iter().flatten().count() as f64;
    let mean = [0, 1].map(|way| motions.iter().flatten().map(|m| m[way]).sum::<f64>() / known);
    for motion in motions.iter_mut().flatten() {
        *motion = [motion[0] - mean[0], motion[1] - mean[1]];
    }
    Ok(motions)
}

/// The means of columns and of rows, without their mean.
fn profiles(image: &Gray) -> [Vec<f64>; 2] {
    let (width, height) = image.size();
    let mut means = [vec![0.0; width], vec![0.0; height]];
    let all = image.pixels().map(f64::from).sum::<f64>() / (width * height) as f64;
    for y in 0..height {
        for x in 0..width {
            let grey = f64::from(image.get(x, y)) - all;
            means[0][x] += grey / height as f64;
            means[1][y] += grey / width as f64;
        }
    }
    means
}

/// The shift from a profile to the next, by their slopes (Lucas & Kanade 1981).
fn shift(before: &[f64], now: &[f64]) -> f64 {
    let slopes = before.windows(3).map(|three| (three[2] - three[0]) / 2.0);
    let changes = now[1..]
        .iter()
        .zip(&before[1..])
        .map(|(now, before)| now - before);
    let (mut product, mut square) = (0.0, f64::MIN_POSITIVE);
    for (slope, change) in slopes.zip(changes) {
        product += slope * change;
        square += slope * slope;
    }
    -product / square
}

/// The frames by which the right motions are later, with their correlation then and as they are;
/// `None` unless that is much better.
fn best(left: &Motions, right: &Motions) -> Option<(i64, f64, f64)> {
    let reach = left.len().max(right.len()) as i64;
    let all = (-reach..=reach).map(|frames| (frames, correlation(left, right, frames)));
    let all: Vec<_> = all.collect();
    let (frames, most) = *all.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let unmoved = correlation(left, right, 0);
    let others = all
        .iter()
        .filter(|(other, _)| other.abs_diff(frames) as usize > NEIGHBOURS);
    let next = others.map(|(_, other)| *other).fold(unmoved, f64::max);
    (most >= MIN_CORRELATION && most - next >= MIN_AHEAD).then_some((frames, most, unmoved))
}

/// The correlation of motions, the right ones later by so many frames; 0 of few.
fn correlation(left: &Motions, right: &Motions, frames: i64) -> f64 {
    let (mut product, mut squares, mut count) = (0.0, [0.0; 2], 0);
    for (place, left) in left.iter().enumerate() {
        let partner = usize::try_from(place as i64 + frames).ok();
        let partner = partner.and_then(|partner| *right.get(partner)?);
        if let (Some(left), Some(right)) = (left, partner) {
            for (left, right) in left.iter().zip(right) {
                product += left * right;
                squares[0] += left * left;
                squares[1] += right * right;
            }
            count += 1;
        }
    }
    let norm = (squares[0] * squares[1]).sqrt();
    if count >= MIN_FRAMES && norm > 0.0 {
        product / norm
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Motions of a camera that shakes, from a frame on, with noise of their own.
    fn shaken(from: u64, seed: u64, amount: f64) -> Motions {
        let noise = |n: u64| {
            let mixed = (n ^ (n >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            (mixed >> 40) as f64 / f64::from(1 << 24) - 0.5
        };
        let motion = |frame: u64, way: u64| {
            noise(2 * frame + way) + amount * noise(seed + 1000 * frame + way)
        };
        (from..from + 150)
            .map(|frame| Some([motion(frame, 0), motion(frame, 1)]))
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
        assert_eq!(
            best(&shaken(100, 7, 0.2), &shaken(100, 8, 0.2)),
            None,
            "together"
        );
        assert_eq!(
            best(&shaken(100, 7, 2.0), &shaken(140, 8, 2.0)),
            None,
            "noise"
        );
        let still = vec![Some([0.0; 2]); 150];
        assert_eq!(best(&still, &still), None, "still");
    }

    #[test]
    fn a_shift_of_a_profile_is_measured() {
        let profile = |shift: f64| -> Vec<_> {
            (0..64)
                .map(|x| (0.2 * (f64::from(x) - shift)).sin())
                .collect()
        };
        for px in [-0.7, 0.0, 0.3] {
            let found = shift(&profile(0.0), &profile(px));
            assert!((found - px).abs() < 0.05, "{px}: {found}");
        }
    }
}
