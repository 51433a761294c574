//! A matcher of your own, scored on a frame of the arena: least sum of absolute differences in a
//! window of 9 × 1 pixels.
//!
//! `cargo run --release --example own_matcher`. To have it in `svl replay` and `svl score` too, see
//! CONTRIBUTING.md: its file, and one line in `MATCHERS`.

use svl::arena::{Arena, ArenaConfig};
use svl::matcher::{MatchContext, MatchOutput, Matcher};
use svl::score::DisparityScore;
use svl::stereo::{ExtraPlanes, Reason, RectifiedPair};

struct LeastDifference {
    max_disparity: usize,
}

impl Matcher for LeastDifference {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        _: &MatchContext,
        output: &mut MatchOutput,
    ) -> svl::Result<()> {
        let (width, height) = pair.size();
        output.disparity.resize(width, height, ExtraPlanes::NONE)?;
        for (y, mut row) in output.disparity.rows_mut().enumerate() {
            let (left, right) = (pair.left().row(y), pair.right().row(y));
            row.clear(Reason::Border);
            for x in self.max_disparity + 4..width.saturating_sub(4) {
                let difference = |d: usize| -> u32 {
                    let window = x - 4..=x + 4;
                    window
                        .map(|i| u32::from(left[i].abs_diff(right[i - d])))
                        .sum()
                };
                let best = (0..=self.max_disparity).min_by_key(|&d| difference(d));
                row.accept(x, best.unwrap_or(0) as f32);
            }
        }
        Ok(())
    }
}

pub fn main() -> svl::Result<()> {
    let frame = Arena::new(&ArenaConfig::default(), 1)?.frame(100)?;
    let mut output = MatchOutput::new()?;
    let mut matcher = LeastDifference { max_disparity: 80 };
    matcher.compute(frame.rectified()?, &MatchContext::default(), &mut output)?;
    let truth = frame.truth.as_ref().expect("the arena knows its truth");
    let bad = DisparityScore::new(&output.disparity, truth)
        .bad2()
        .unwrap_or(1.0);
    println!("{:.0} % of the pixels off by more than 2 px", 100.0 * bad);
    Ok(())
}
