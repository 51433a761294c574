//! Another source's images, cropped and shrunk.

use crate::source::frames::Source;
use svl_core::Result;
use svl_core::stereo::Frame;
use svl_score::resize::Resizer;
use svl_score::scenario::CropScale;

/// Crops and shrinks the images of frames.
pub fn resized(window: CropScale) -> impl FnMut(Frame, &dyn Source) -> Result<Frame> {
    let resizer = Resizer::new(window);
    move |mut frame, source| {
        frame.keep_id();
        resizer.resized(frame, &source.name())
    }
}

#[cfg(test)]
mod tests {
    use super::super::chain::Mapped;
    use super::{CropScale, Frame, Result};
    use crate::source::frames::Source;
    use svl_core::stereo::{Geometry, Gray, Plane, Rig, StereoPair, Truth, Visibility};
    use svl_score::losses::Losses;

    /// One frame: columns of grey 10·x, 6 px of true disparity, all seen by both.
    struct One(Option<Frame>);

    impl One {
        fn new(width: usize, height: usize) -> Self {
            let image = Gray::from_fn(width, height, |x, _| (10 * x) as u8).unwrap();
            let rig = Rig::new(100.0, (3.5, 1.5), 0.1, 2.0).unwrap();
            Self(Some(Frame {
                sequence: 7,
                stamp_ns: 9,
                truth: Some(Truth::exact(
                    Plane::filled(width, height, 2.0).unwrap(),
                    Some(Plane::filled(width, height, Visibility::Visible).unwrap()),
                )),
                ..Frame::new(
                    StereoPair::new(image.clone(), image).unwrap(),
                    Geometry::Rectified(Some(rig)),
                )
            }))
        }
    }

    impl Source for One {
        fn name(&self) -> String {
            "one".into()
        }

        fn next(&mut self) -> Result<Option<Frame>> {
            Ok(self.0.take())
        }

        fn pairs(&self) -> Option<u64> {
            Some(1)
        }

        fn finish(&mut self, taken: u64) -> Losses {
            Losses {
                late: taken,
                ..Losses::default()
            }
        }
    }

    fn resized(crop: Option<[usize; 4]>, scale: Option<f64>) -> Result<Frame> {
        let change = super::resized(CropScale { crop, scale });
        let source: Box<dyn Source> = Box::new(One::new(8, 4));
        let mut source = Mapped { source, change };
        assert_eq!((source.pairs(), source.finish(1).late), (Some(1), 1));
        source.next().map(Option::unwrap)
    }

    #[test]
    fn halves_are_means_and_distances_stay() {
        let whole = One::new(8, 4).0.unwrap();
        let half = resized(None, Some(0.5)).unwrap();
        assert_eq!((half.sequence, half.pair.size()), (7, (4, 2)));
        assert_eq!(half.pair.left().row(0), [5, 25, 45, 65]);
        let (rig, truth) = (half.rig().unwrap(), half.truth.as_ref().unwrap());
        assert_eq!(
            (rig.focal_px(), rig.center_px(), rig.doffs_px()),
            (50.0, (1.5, 0.5), 1.0)
        );
        assert_eq!(truth.disparity.get(0, 0), 1.0);
        assert_eq!(rig.depth_m(1.0), whole.rig().unwrap().depth_m(2.0));
    }

    #[test]
    fn odd_scales_cover_fractions_of_pixels() {
        // 8 · 0.4 = 3.2: three pixels of two and a half each: (0 + 10 + 20/2) / 2.5 and so on.
        let frame = resized(None, Some(0.4)).unwrap();
        assert_eq!(frame.pair.size(), (3, 1));
        assert_eq!(frame.pair.left().row(0), [8, 32, 58]);
    }

    #[test]
    fn a_crop_moves_the_principal_point_and_hides_what_leaves_the_right_image() {
        let frame = resized(Some([3, 1, 4, 2]), None).unwrap();
        assert_eq!(frame.pair.left().row(0), [30, 40, 50, 60]);
        assert_eq!(frame.rig().unwrap().center_px(), (0.5, 0.5));
        let truth = frame.truth.unwrap();
        assert_eq!(truth.disparity.size(), (4, 2));
        let seen = |x| truth.visibility.as_ref().unwrap().get(x, 0);
        assert_eq!(seen(1), Visibility::Occluded);
        assert_eq!(seen(2), Visibility::Visible);
    }

    #[test]
    fn a_crop_beyond_the_image_is_refused() {
        for crop in [[5, 0, 4, 4], [0, 1, 8, 4], [usize::MAX, 0, 2, 2]] {
            let error = resized(Some(crop), None).unwrap_err().to_string();
            assert!(error.starts_with("one: pair 7: crop = ["), "{error}");
        }
    }
}
