//! Pairs scored against other algorithms, where these are confident.

use crate::source::frames::{Source, wraps};
use svl_core::depth::GridSettings;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, Matcher, match_right};
use svl_core::stereo::{
    CellRule, Frame, MapDensity, Plane, RectifiedPair, Truth, TruthKind, TruthOrigin,
};
use svl_core::{Error, Result};
use svl_score::agreement::{both, consistent, textured};
use svl_score::losses::Losses;

/// A source whose frames get the disparities of references for their truth, in place of their own.
///
/// A pixel has a truth where the first reference has a disparity, the pixel is textured, the right
/// map agrees within a pixel, and so do all other references. The right map is that of the pair
/// mirrored and swapped, which any algorithm can match.
pub struct ReferenceSource<'a> {
    source: Box<dyn Source + 'a>,
    references: Vec<Reference>,
    label: String,
    without: u64,
    /// True once the user was warned that the frames' own truth is replaced.
    replaced: bool,
}

struct Reference {
    label: String,
    matcher: Box<dyn Matcher>,
    left: MatchOutput,
    right: MatchOutput,
    /// Failures that were reported: of the pair, and of the mirrored pair.
    reported: [bool; 2],
}

impl<'a> ReferenceSource<'a> {
    /// # Errors
    /// The reason why a reference cannot be built.
    pub fn new(source: Box<dyn Source + 'a>, references: &[Algorithm]) -> Result<Self> {
        let labels: Vec<_> = references.iter().map(Algorithm::label).collect();
        let label = labels.join(" and ");
        let reference = |algorithm: &Algorithm| {
            Ok(Reference {
                label: algorithm.label().to_owned(),
                matcher: algorithm.build()?,
                left: MatchOutput::new()?,
                right: MatchOutput::new()?,
                reported: [false; 2],
            })
        };
        Ok(Self {
            source,
            references: references.iter().map(reference).collect::<Result<_>>()?,
            label,
            without: 0,
            replaced: false,
        })
    }

    fn refer(&mut self, frame: &mut Frame) {
        if frame.truth.is_some() && !self.replaced {
            let name = self.source.name();
            tracing::warn!("{name}: scored against {}, not its own truth", self.label);
            self.replaced = true;
        }
        frame.truth = None;
        let mut agreed: Option<Plane<f32>> = None;
        for reference in &mut self.references {
            let Some(sure) = reference.sure(frame) else {
                self.without += 1;
                return;
            };
            agreed = Some(match agreed {
                None => sure,
                Some(first) => both(&first, &sure),
            });
        }
        frame.truth = agreed.map(|disparity| Truth {
            disparity: textured(frame.pair.left(), disparity),
            visibility: None,
            surface: None,
            kind: TruthKind {
                density: MapDensity::Dense,
                origin: TruthOrigin::Reference(self.label.clone()),
            },
        });
    }
}

impl Reference {
    /// Left-right consistent disparities of the reference, `+∞` elsewhere; none if it fails on the
    /// pair.
    fn sure(&mut self, frame: &Frame) -> Option<Plane<f32>> {
        let (label, sequence) = (&self.label, frame.sequence);
        let mut failed = |which: usize, what: &str, error: &Error| {
            let is_told = matches!(error, Error::Interrupted);
            if !is_told && !std::mem::replace(&mut self.reported[which], true) {
                tracing::warn!("reference {label} on pair {sequence}{what}: {error}");
            }
        };
        let context = MatchContext::for_frame(frame, GridSettings::default(), CellRule::default());
        let matched = RectifiedPair::assume(&frame.pair);
        self.left.begin();
        if let Err(error) = self.matcher.compute(matched, &context, &mut self.left) {
            failed(0, "", &error);
            return None;
        }
        let left = self.left.disparity.disparity();
        let turned = match_right(&mut *self.matcher, matched, &context, &mut self.right);
        Some(match turned {
            Ok(right) => consistent(left, &right),
            Err(error) => {
                let what = ", mirrored: its disparities count without a left-right check";
                failed(1, what, &error);
                left.clone()
            }
        })
    }
}

impl Source for ReferenceSource<'_> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        let mut frame = self.source.next()?;
        if let Some(frame) = &mut frame {
            self.refer(frame);
        }
        Ok(frame)
    }

    fn finish(&mut self, taken: u64) -> Losses {
        let losses = self.source.finish(taken);
        Losses {
            without_truth: losses.without_truth + self.without,
            ..losses
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::frames::FromFn;
    use svl_core::stereo::{Geometry, Gray, StereoPair};

    const SIZE: (usize, usize) = (96, 48);

    /// Frames of a textured plane at a disparity of 7 px, with a stripe of plain grey.
    fn wall(mut frames: u64) -> Box<dyn Source> {
        Box::new(FromFn(move || {
            if frames == 0 {
                return Ok(None);
            }
            frames -= 1;
            let texture = |x: usize, y: usize| {
                let mixed = ((x * 7919 + y * 104_729) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
                if (20..30).contains(&y) {
                    90
                } else {
                    (mixed >> 56) as u8
                }
            };
            let image = |shift| Gray::from_fn(SIZE.0, SIZE.1, |x, y| texture(x + shift, y));
            Ok(Some(Frame {
                sequence: frames,
                truth: Some(Truth::exact(Plane::filled(SIZE.0, SIZE.1, 3.0)?, None)),
                ..Frame::new(StereoPair::new(image(0)?, image(7)?)?, Geometry::Raw)
            }))
        }))
    }

    fn truth(references: &[&str]) -> Truth {
        let references: Vec<_> = references
            .iter()
            .map(|name| name.parse().unwrap())
            .collect();
        let mut source = ReferenceSource::new(wall(1), &references).unwrap();
        source.next().unwrap().unwrap().truth.unwrap()
    }

    #[test]
    fn the_truth_is_where_the_reference_is_sure() {
        let found = truth(&["sgm:max_disparity=16"]);
        assert_eq!(
            found.kind.origin,
            TruthOrigin::Reference("sgm:max_disparity=16".into())
        );
        let known: Vec<_> = found.disparity.pixels().filter(|d| d.is_finite()).collect();
        assert!(known.len() > SIZE.0 * SIZE.1 / 3, "{}", known.len());
        assert!(known.iter().all(|d| (d - 7.0).abs() <= 1.0));
        assert!(
            (22..28).all(|y| found.disparity.row(y).iter().all(|d| d.is_infinite())),
            "no texture, no truth"
        );
        assert!(
            (0..SIZE.1).all(|y| found.disparity.row(y)[..6].iter().all(|d| d.is_infinite())),
            "the right camera does not see these"
        );
    }

    #[test]
    fn two_references_have_to_agree() {
        let known = |references: &[&str]| {
            let truth = truth(references);
            truth.disparity.pixels().filter(|d| d.is_finite()).count()
        };
        let (one, two) = (
            known(&["sgm:max_disparity=16"]),
            known(&["sgm:max_disparity=16", "bm:max_disparity=15"]),
        );
        assert!(two > 0 && two < one, "{two} of {one}");
    }

    #[test]
    fn a_point_counts_where_the_right_map_leads_back() {
        let left = Plane::from_vec(6, 1, vec![0.0, 1.0, 2.0, 2.0, f32::INFINITY, 9.0]).unwrap();
        // By right pixel: 0 has 2, 1 has 2, all others none.
        let none = f32::INFINITY;
        let right = Plane::from_vec(6, 1, vec![2.0, 2.0, none, none, none, none]).unwrap();
        let sure = consistent(&left, &right);
        let expected = [none, 1.0, 2.0, 2.0, none, none];
        assert_eq!(sure.row(0), expected);
    }

    #[test]
    fn a_failed_reference_leaves_no_truth_and_is_counted() {
        let references = ["exec:command=false".parse().unwrap()];
        let mut source = ReferenceSource::new(wall(3), &references).unwrap();
        for _ in 0..3 {
            assert_eq!(source.next().unwrap().unwrap().truth, None);
        }
        assert_eq!(source.finish(3).without_truth, 3);
    }
}
