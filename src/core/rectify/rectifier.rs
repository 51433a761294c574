//! Rectifies raw pairs with tables computed once.

use super::bouguet::{bouguet, views};
use super::framing::Framing;
use super::remap::Remap;
use super::rotated_camera::RotatedCamera;
use crate::error::Result;
use crate::kernel::{Isa, isa};
use crate::stereo::{Gray, Rgb, Rig, Side, StereoCalibration, StereoPair};
use nalgebra::{Point2, UnitQuaternion, Vector2};
use rayon::prelude::*;
use std::borrow::Cow;

/// Rectifies raw pairs of one calibration.
#[derive(Clone, Debug)]
pub struct Rectifier {
    isa: Isa,
    left: Remap,
    right: Remap,
    rig: Option<Rig>,
    /// Rotation of the left camera, `X_rectified = rotation · X_left`.
    pub rotation: UnitQuaternion<f64>,
    /// True if the pairs are rectified already, and stay as they are.
    is_identity: bool,
}

impl Rectifier {
    /// From the rectification of a calibration, or from [`bouguet`] with the default framing if it
    /// has none.
    ///
    /// # Errors
    /// The errors of [`bouguet`], and [`crate::Error::Invalid`] if `SVL_ISA` names an instruction
    /// set that this CPU lacks.
    pub fn new(calibration: &StereoCalibration) -> Result<Self> {
        let rectification = match calibration.rectification() {
            Some(own) => own.clone(),
            None => bouguet(calibration, &Framing::default())?,
        };
        let views = views(calibration, rectification.left, rectification.right);
        let rig = rectification.rig;
        let remap = |view: &RotatedCamera, side| {
            let (focal, k) = (rig.focal_px(), rig.intrinsics(side));
            let direction =
                |p: Point2<f64>| Vector2::new((p.x - k[(0, 2)]) / focal, (p.y - k[(1, 2)]) / focal);
            Remap::new(view.size(), rectification.size, |pixel| {
                view.pixel(direction(pixel))
            })
        };
        let left = remap(&views[0], Side::Left)?;
        let right = remap(&views[1], Side::Right)?;
        let rotation = UnitQuaternion::from_rotation_matrix(&rectification.left);
        // Only a calibration in metres gives a rig; one in squares has no distances.
        let rig = calibration.clone().with_rectification(rectification).rig();
        Ok(Self {
            isa: isa()?,
            left,
            right,
            rig,
            rotation,
            is_identity: calibration.is_rectified(),
        })
    }

    /// The same on another instruction set, with the same results.
    pub fn on(self, isa: Isa) -> Self {
        Self { isa, ..self }
    }

    /// The rig of the rectified pairs; `None` if lengths are unknown.
    pub fn rig(&self) -> Option<&Rig> {
        self.rig.as_ref()
    }

    /// Width and height of the rectified images.
    pub fn size(&self) -> (usize, usize) {
        self.left.size()
    }

    /// Fraction of the rectified pixels outside the cameras' images, 0..=1.
    pub fn outside(&self) -> f64 {
        let (width, height) = self.size();
        (self.left.outside() + self.right.outside()) as f64 / (2 * width * height) as f64
    }

    /// Rectifies `pair` into `left` and `right`, which are reallocated unless they have the
    /// rectified size. Allocates nothing if they do and the rows of the pair are contiguous. Runs
    /// on rayon's current thread pool.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] for a pair of another size than the calibration's.
    pub fn apply(&self, pair: &StereoPair, left: &mut Gray, right: &mut Gray) -> Result<()> {
        let (width, height) = self.size();
        for out in [&mut *left, &mut *right] {
            if out.size() != (width, height) || out.as_slice().is_none() {
                *out = Gray::filled(width, height, 0)?;
            }
        }
        self.left.check(pair.left())?;
        self.right.check(pair.right())?;
        let sources = [gapless(pair.left()), gapless(pair.right())];
        // `Gray::filled` above makes contiguous rows.
        let outs = [left, right].map(|out| out.as_mut_slice().expect("gapless"));
        if self.is_identity {
            let both = outs.into_iter().zip(&sources);
            both.for_each(|(out, source)| out.copy_from_slice(source));
            return Ok(());
        }
        let threads = rayon::current_num_threads();
        // With one thread a band is the whole image: splitting would only add cost.
        let rows = if threads == 1 {
            height
        } else {
            height.div_ceil(BANDS * threads)
        };
        let [left, right] = outs.map(|out| out.par_chunks_mut(rows * width).enumerate());
        let sides = [(&self.left, &sources[0]), (&self.right, &sources[1])];
        left.map(|band| (sides[0], band))
            .chain(right.map(|band| (sides[1], band)))
            .for_each(|((remap, source), (band, out))| {
                remap.rows(
                    self.isa,
                    source,
                    band * rows..(band * rows + out.len() / width),
                    out,
                );
            });
        Ok(())
    }

    /// The images of `pair`, rectified by this thread alone: a fork copies no others.
    ///
    /// # Errors
    /// The errors of [`Rectifier::apply`].
    pub fn apply_alone(&self, pair: [&Gray; 2]) -> Result<[Gray; 2]> {
        let [left, right] = pair;
        Ok([
            self.left.apply(self.isa, left)?,
            self.right.apply(self.isa, right)?,
        ])
    }

    /// [`Rectifier::apply`] for each of the three colours.
    ///
    /// # Errors
    /// The errors of [`Rectifier::apply`]; [`crate::Error::PairSize`].
    pub fn apply_color(&self, [left, right]: &[Rgb; 2]) -> Result<[Rgb; 2]> {
        let (width, height) = self.size();
        let mut out = [
            Rgb::filled(width, height, [0; 3])?,
            Rgb::filled(width, height, [0; 3])?,
        ];
        let mut rectified = [
            Gray::filled(width, height, 0)?,
            Gray::filled(width, height, 0)?,
        ];
        for at in 0..3 {
            let pair = StereoPair::new(channel(left, at), channel(right, at))?;
            let [left, right] = &mut rectified;
            self.apply(&pair, left, right)?;
            for (out, channel) in out.iter_mut().zip(&rectified) {
                for (y, row) in channel.rows().enumerate() {
                    let pixels = out.row_mut(y).iter_mut().zip(row);
                    pixels.for_each(|(pixel, &value)| pixel[at] = value);
                }
            }
        }
        Ok(out)
    }
}

/// One of the three colours.
fn channel(image: &Rgb, at: usize) -> Gray {
    image.map(|pixel| pixel[at])
}

/// Bands of each image per thread: enough to balance the load.
const BANDS: usize = 2;

fn gapless(image: &Gray) -> Cow<'_, [u8]> {
    image
        .as_slice()
        .map_or_else(|| Cow::Owned(image.pixels().collect()), Cow::Borrowed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::{Intrinsics, LengthUnit, Rectification};
    use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};

    fn calibration() -> StereoCalibration {
        let camera = |f, cx| {
            Intrinsics::new(
                (160, 120),
                (f, f),
                (cx, 60.0),
                [-0.2, 0.05, 1e-3, -1e-3, 0.0],
            )
            .unwrap()
        };
        let rotation = UnitQuaternion::from_euler_angles(0.02, -0.03, 0.04);
        let motion = Isometry3::from_parts(Translation3::new(-0.1, 0.004, 0.002), rotation);
        StereoCalibration::new(
            camera(140.0, 80.0),
            camera(143.0, 78.0),
            motion,
            LengthUnit::Metres,
        )
        .unwrap()
    }

    /// Smooth images of distant points in which every position has its own grey: the camera's view
    /// is known exactly.
    fn pair(calibration: &StereoCalibration) -> StereoPair {
        let grey =
            |d: Vector2<f64>| (128.0 + 60.0 * (9.0 * d.x).sin() + 60.0 * (8.0 * d.y).cos()) as u8;
        let image = |camera: &Intrinsics, rotation: UnitQuaternion<f64>| {
            let looks = |x: usize, y: usize| {
                let seen = camera.direction(Point2::new(x as f64, y as f64)).unwrap();
                let point = rotation * Point3::new(seen.x, seen.y, 1.0);
                grey(Vector2::new(point.x / point.z, point.y / point.z))
            };
            Gray::from_fn(160, 120, looks).unwrap()
        };
        let left = image(calibration.left(), UnitQuaternion::identity());
        StereoPair::new(
            left,
            image(
                calibration.right(),
                calibration.right_from_left().rotation.inverse(),
            ),
        )
        .unwrap()
    }

    #[test]
    fn points_at_infinity_have_disparity_0() {
        let calibration = calibration();
        let pair = pair(&calibration);
        let rectifier = Rectifier::new(&calibration).unwrap();
        assert_eq!(rectifier.outside(), 0.0);
        let (mut left, mut right) = (
            Gray::filled(1, 1, 0).unwrap(),
            Gray::filled(1, 1, 0).unwrap(),
        );
        rectifier.apply(&pair, &mut left, &mut right).unwrap();
        let off = left
            .pixels()
            .zip(right.pixels())
            .map(|(l, r)| l.abs_diff(r))
            .max()
            .unwrap();
        assert!(off <= 3, "{off} grey levels");
        let raw = pair
            .left()
            .pixels()
            .zip(pair.right().pixels())
            .map(|(l, r)| l.abs_diff(r))
            .max()
            .unwrap();
        assert!(raw > 20, "the raw ones differ by {raw}");
    }

    #[test]
    fn threads_and_instruction_sets_give_the_same_bytes() {
        let calibration = calibration();
        let wide = bouguet(
            &calibration,
            &Framing {
                alpha: 1.0,
                size: Some((201, 99)),
            },
        )
        .unwrap();
        let rectifier = Rectifier::new(&calibration.clone().with_rectification(wide)).unwrap();
        assert!(rectifier.outside() > 0.05);
        let pair = pair(&calibration);
        let rectified = |isa, threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let (mut left, mut right) = (
                Gray::filled(1, 1, 0).unwrap(),
                Gray::filled(1, 1, 0).unwrap(),
            );
            pool.install(|| {
                rectifier
                    .clone()
                    .on(isa)
                    .apply(&pair, &mut left, &mut right)
            })
            .unwrap();
            [left, right]
        };
        let expected = [
            rectifier.left.apply(Isa::BASELINE, pair.left()),
            rectifier.right.apply(Isa::BASELINE, pair.right()),
        ];
        let expected = expected.map(|image| image.unwrap());
        let alone = rectifier.apply_alone([pair.left(), pair.right()]);
        assert!(alone.unwrap() == expected);
        for isa in Isa::available() {
            for threads in 1..=4 {
                assert!(
                    rectified(isa, threads) == expected,
                    "{isa}, {threads} threads"
                );
            }
        }
    }

    #[test]
    fn the_calibration_s_rectification_is_kept() {
        let calibration = calibration();
        let plain = bouguet(&calibration, &Framing::default()).unwrap();
        let rig = Rig::new(plain.rig.focal_px(), plain.rig.center_px(), 0.1, 4.0).unwrap();
        let apart = Rectification {
            rig,
            ..plain.clone()
        };
        let rectifier = |own| Rectifier::new(&calibration.clone().with_rectification(own)).unwrap();
        let (plain, apart) = (rectifier(plain), rectifier(apart));
        assert_eq!(apart.rig().unwrap().doffs_px(), 4.0);
        // The right image is shifted 4 pixels further right, the left one is unchanged.
        let pair = pair(&calibration);
        let [left, other_left] =
            [&plain, &apart].map(|r| r.left.apply(Isa::BASELINE, pair.left()).unwrap());
        let [right, other_right] =
            [&plain, &apart].map(|r| r.right.apply(Isa::BASELINE, pair.right()).unwrap());
        assert!(left == other_left);
        assert!((0..120).all(|y| right.row(y)[..156] == other_right.row(y)[4..]));
    }

    #[test]
    fn pairs_of_another_size_are_refused() {
        let image = Gray::filled(320, 240, 0).unwrap();
        let pair = StereoPair::new(image.clone(), image).unwrap();
        let (mut left, mut right) = (
            Gray::filled(1, 1, 0).unwrap(),
            Gray::filled(1, 1, 0).unwrap(),
        );
        let error = Rectifier::new(&calibration())
            .unwrap()
            .apply(&pair, &mut left, &mut right)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("320x240") && error.contains("160x120"),
            "{error}"
        );
    }
}
