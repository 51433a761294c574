//! The truth of the frames as an algorithm: the output of a perfect matcher.
//!
//! The line of the truth in a table is the best that any matcher with that range of disparities can
//! reach: no cell beyond the range is right, and a checkpoint that it fails cannot be passed.

use super::stage::DisparityRange;
use super::{MatchContext, MatchOutput, Matcher, MatcherKind, MatcherSpec};
use crate::error::{Error, Result};
use crate::stereo::{ExtraPlanes, Reason, RectifiedPair};
use crate::timing::Stage;

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "truth",
    kind: MatcherKind::Truth,
    aliases: &[],
    summary: "the truth of the frames: what a perfect matcher with that range would report",
    about: "",
    paper: "none: it ignores the images",
    parameters: &[DisparityRange::MIN, DisparityRange::MAX],
    cells: None,
    build: |parameters, _| {
        Ok(Box::new(TrueDisparities(DisparityRange::from_parameters(
            parameters,
        )?)))
    },
};

struct TrueDisparities(DisparityRange);

impl Matcher for TrueDisparities {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let Some(truth) = context.truth else {
            return Err(Error::Invalid(
                "there is no truth here to report; it is for `svl score` and `svl replay` of \
                 sources with truth"
                    .into(),
            ));
        };
        let (width, height) = pair.size();
        output.disparity.resize(width, height, ExtraPlanes::NONE)?;
        let (min, max) = (self.0.min() as f32, self.0.max() as f32);
        // A truth has the size of its frame's images.
        for (mut row, disparities) in output.disparity.rows_mut().zip(truth.disparity.rows()) {
            for (x, &disparity) in disparities.iter().enumerate() {
                match disparity {
                    d if !d.is_finite() => row.reject(x, Reason::Unmatched),
                    d if (min..=max).contains(&d) => row.accept(x, d),
                    _ => row.reject(x, Reason::Border),
                }
            }
        }
        output.clock.lap(Stage::Matching);
        Ok(())
    }
}
