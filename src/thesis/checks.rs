//! v3 up to its validity test, and the two tests compared in the thesis.

use svl_core::Result;
use svl_core::kernel::isa;
use svl_core::matcher::stage::{
    BlockSearch, Blocks, DisparityRange, DogTexture, RowCheck, RowSearch, SelfCheck, Strip,
    SymmetricCheck, TextureFilter, VerticalSmoothing,
};
use svl_core::stereo::{DisparityMap, ExtraPlanes, Gray, Plane, Reason, StereoPair};

/// v3's texture filter by default, verified by the test below.
pub(super) const SIGMA: f64 = 0.4;
pub(super) const DELTA: f64 = 3.35;

pub(super) fn dog_texture() -> DogTexture {
    DogTexture::new(SIGMA, DELTA)
}

/// v3's vertical smoothing by default.
fn smoothing() -> VerticalSmoothing {
    VerticalSmoothing::new(1.0)
}

/// An image smoothed vertically as by default in v3.
pub(super) fn smoothed(image: &Gray) -> Result<Gray> {
    let mut smooth = Gray::filled(image.width(), image.height(), 0)?;
    smoothing().apply(isa()?, image, &mut smooth);
    Ok(smooth)
}

/// The pixels that a texture filter keeps.
pub(super) fn textured(filter: &dyn TextureFilter, image: &Gray) -> Result<Plane<bool>> {
    let mut mask = Plane::filled(image.width(), image.height(), false)?;
    filter.apply(isa()?, image, &mut mask);
    Ok(mask)
}

/// A test of v3's matches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Check {
    /// Keeps every match.
    Nothing,
    /// v3's own.
    Own,
    /// That of v1 and v2: the right image agrees to that number of pixels.
    Symmetric(i32),
    /// The same, but the right pixel must be textured too: untextured ones are not matched back.
    Textured(i32),
}

/// The matches of v3 that pass a check in place of its own.
pub(super) fn matches(pair: &StereoPair, check: Check) -> Result<DisparityMap> {
    let ((width, height), isa) = (pair.size(), isa()?);
    // The thesis's range of disparities.
    let range = DisparityRange::new(0, 80)?;
    let (smoothing, texture) = (smoothing(), dog_texture());
    let (mut strip, mut textured) = (Strip::new(width)?, vec![false; width]);
    let mut search = BlockSearch::new(width, range);
    let mut row_check: Option<Box<dyn RowCheck>> = match check {
        Check::Nothing => None,
        Check::Own => Some(Box::new(SelfCheck::new(width, range))),
        Check::Symmetric(tolerance_px) | Check::Textured(tolerance_px) => {
            Some(Box::new(SymmetricCheck::new(tolerance_px, width, range)))
        }
    };
    let mut map = DisparityMap::with_planes(width, height, ExtraPlanes::SSDPI)?;
    for (y, mut row) in map.rows_mut().enumerate() {
        // The kernels search several rows at once: a group is searched at its first row, and its
        // rows are then written and checked one by one.
        let lane = y % Blocks::ROWS;
        if lane == 0 {
            let rows = Blocks::ROWS.min(height - y);
            strip.load(isa, &smoothing, pair, y, rows);
            strip.transpose(isa);
            let [left, right] = strip.columns();
            search.search(isa, left, right, rows);
            if let Some(check) = &mut row_check {
                check.search(isa, left, right, rows);
            }
        }
        let (left, right) = (strip.left(lane), strip.right(lane));
        texture.apply_row(isa, left, &mut textured);
        search.write_row(isa, lane, [left, right], &textured, &mut row);
        if let Some(check) = &row_check {
            check.check_row(isa, lane, left, &mut row);
        }
        if let Check::Textured(_) = check {
            texture.apply_row(isa, right, &mut textured);
            for x in 0..width {
                // The window of a match lies inside the right image.
                if row.at(x).is_ok_and(|d| !textured[x - d as usize]) {
                    row.reject(x, Reason::Inconsistent);
                }
            }
        }
    }
    Ok(map)
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::matcher::Algorithm;
    use svl_core::stereo::RectifiedPair;
    use svl_sim::arena::{Arena, ArenaConfig};

    #[test]
    fn with_the_self_check_it_is_v3() {
        let pair = Arena::new(&ArenaConfig::default(), 1)
            .unwrap()
            .frame(40)
            .unwrap()
            .pair;
        let algorithm: Algorithm = "v3".parse().unwrap();
        let v3 = algorithm
            .match_pair(RectifiedPair::assume(&pair), None)
            .unwrap()
            .disparity;
        let matches = |check| matches(&pair, check).unwrap();
        assert_eq!(matches(Check::Own).hash(), v3.hash());
        let valid = |check| matches(check).valid();
        let symmetric = valid(Check::Symmetric(1));
        assert!(valid(Check::Symmetric(0)) < symmetric);
        assert!(valid(Check::Textured(1)) < symmetric);
        assert!(symmetric < valid(Check::Nothing));
    }
}
