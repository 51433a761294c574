//! The disparities of the right image, from any matcher: it matches the mirrored, swapped images.

use super::{MatchContext, MatchOutput, Matcher};
use crate::error::Result;
use crate::stereo::{Gray, Plane, RectifiedPair, StereoPair};

/// A pair with the same disparities: the mirrored right image as the left one, and the mirrored
/// left image as the right one.
///
/// # Errors
/// None: the images keep the sizes of a valid pair.
pub fn mirrored(pair: &StereoPair) -> Result<StereoPair> {
    let image = |image: &Gray| mirror(image);
    StereoPair::new(image(pair.right())?, image(pair.left())?)
}

/// The disparities of the right image, `+∞` for invalid pixels: a right pixel `(x, y)` matches the
/// left `(x + d, y)`. `output` is used for the matching.
///
/// # Errors
/// The errors of [`Matcher::compute`].
pub fn match_right(
    matcher: &mut dyn Matcher,
    pair: RectifiedPair<'_>,
    context: &MatchContext,
    output: &mut MatchOutput,
) -> Result<Plane<f32>> {
    let mirrored = mirrored(&pair)?;
    let color = context
        .color
        .map(|[left, right]| -> Result<_> { Ok([mirror(right)?, mirror(left)?]) });
    let color = color.transpose()?;
    let context = MatchContext {
        color: color.as_ref(),
        ..*context
    };
    output.begin();
    matcher.compute(RectifiedPair::assume(&mirrored), &context, output)?;
    mirror(output.disparity.disparity())
}

fn mirror<T: Copy>(plane: &Plane<T>) -> Result<Plane<T>> {
    let (width, height) = plane.size();
    Plane::from_fn(width, height, |x, y| plane.get(width - 1 - x, y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matcher::Algorithm;

    /// Noise, and the same shifted 7 px to the left.
    fn shifted() -> StereoPair {
        let mut random = fastrand::Rng::with_seed(3);
        let noise: Vec<u8> = (0..80 * 40).map(|_| random.u8(..)).collect();
        let left = Plane::from_vec(80, 40, noise).unwrap();
        let right = Plane::from_fn(80, 40, |x, y| left.get((x + 7) % 80, y)).unwrap();
        StereoPair::new(left, right).unwrap()
    }

    #[test]
    fn twice_mirrored_is_the_pair() {
        let pair = shifted();
        let other = mirrored(&pair).unwrap();
        assert_eq!(other.left().get(79, 0), pair.right().get(0, 0));
        assert_eq!(mirrored(&other).unwrap(), pair);
    }

    #[test]
    fn the_right_image_has_the_same_disparities() {
        let pair = shifted();
        let mut matcher = "sgm".parse::<Algorithm>().unwrap().build().unwrap();
        let mut output = MatchOutput::new().unwrap();
        let right = match_right(
            &mut *matcher,
            RectifiedPair::assume(&pair),
            &MatchContext::default(),
            &mut output,
        )
        .unwrap();
        // Right pixels up to 72 are seen by the left camera, 7 px farther right.
        for x in 10..60 {
            // SGM interpolates between disparities.
            assert_eq!(right.get(x, 20).round(), 7.0, "{x}");
        }
    }
}
