//! An algorithm that reports nothing: the result of a run without stereo.
//!
//! It is the other end of the scale from `truth`. A robot that it steers treats every cell as
//! unknown.

use super::{MatchContext, MatchOutput, Matcher, MatcherKind, MatcherSpec};
use crate::error::Result;
use crate::stereo::{ExtraPlanes, Reason, RectifiedPair};
use crate::timing::Stage;

pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "blind",
    kind: MatcherKind::Blind,
    aliases: &[],
    summary: "reports nothing: every pixel and every cell is unknown",
    about: "",
    paper: "none: it ignores the images",
    parameters: &[],
    cells: None,
    build: |_, _| Ok(Box::new(Blind)),
};

struct Blind;

impl Matcher for Blind {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        _: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let (width, height) = pair.size();
        output.disparity.resize(width, height, ExtraPlanes::NONE)?;
        for mut row in output.disparity.rows_mut() {
            (0..width).for_each(|x| row.reject(x, Reason::Unmatched));
        }
        output.clock.lap(Stage::Matching);
        Ok(())
    }
}
