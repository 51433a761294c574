//! v3 up to its validity test, and the two tests compared in the thesis.

use svl_core::Result;
use svl_core::kernel::{Isa, isa};
use svl_core::matcher::stage::{
    BlockSearch, Blocks, DisparityRange, DogTexture, RowCheck, RowSearch, SelfCheck,
    SymmetricCheck, TextureFilter, VerticalSmoothing,
};
use svl_core::stereo::{DisparityMap, ExtraPlanes, Gray, Plane, Reason, StereoPair};

/// v3's texture filter by default, verified by the test below.
pub(super) const SIGMA: f64 = 0.4;
pub(super) const DELTA: f64 = 3.35;

pub(super) fn dog_texture() -> DogTexture {
    DogTexture::new(SIGMA, DELTA)
}

/// An image smoothed vertically as by default in v3.
pub(super) fn smoothed(image: &Gray) -> Result<Gray> {
    let mut smooth = Gray::filled(image.width(), image.height(), 0)?;
    VerticalSmoothing::new(1.0).apply(isa()?, image, &mut smooth);
    Ok(smooth)
}

/// The pixels that a texture filter keeps.
pub(super) fn textured(filter: &dyn TextureFilter, image: &Gray) -> Result<Plane<bool>> {
    let mut mask = Plane::filled(image.width(), image.height(), false)?;
    filter.apply(isa()?, image, &mut mask);
    Ok(mask)
}

/// A pair smoothed as in v3, with the matches of its textured pixels.
pub(super) struct Correlated {
    isa: Isa,
    range: DisparityRange,
    left: Gray,
    /// Left and right.
    blocks: [Blocks; 2],
    right_textured: Plane<bool>,
    /// Every match, none of them checked.
    pub(super) matches: DisparityMap,
}

impl Correlated {
    pub(super) fn new(pair: &StereoPair) -> Result<Self> {
        let ((width, height), isa) = (pair.size(), isa()?);
        // The thesis's range of disparities.
        let range = DisparityRange::new(0, 80)?;
        let (left, right) = (smoothed(pair.left())?, smoothed(pair.right())?);
        let left_textured = textured(&dog_texture(), &left)?;
        let blocks = |image: &Gray| -> Result<Blocks> {
            let mut blocks = Blocks::new(width, height)?;
            blocks.load(isa, image);
            Ok(blocks)
        };
        let blocks = [blocks(&left)?, blocks(&right)?];
        let mut matches = DisparityMap::with_planes(width, height, ExtraPlanes::SSDPI)?;
        let mut search = BlockSearch::new(width, range);
        for (y, mut row) in matches.rows_mut().enumerate() {
            // The kernel searches several rows at once: a group is searched at its first row, and
            // its rows are then written one by one.
            let lane = y % Blocks::ROWS;
            if lane == 0 {
                let rows = Blocks::ROWS.min(height - y);
                search.search(isa, blocks[0].around(y), blocks[1].around(y), rows);
            }
            let pair = [left.row(y), right.row(y)];
            search.write_row(isa, lane, pair, left_textured.row(y), &mut row);
        }
        Ok(Self {
            isa,
            range,
            blocks,
            right_textured: textured(&dog_texture(), &right)?,
            left,
            matches,
        })
    }

    /// The matches that pass the self check: the result of v3.
    pub(super) fn self_checked(&self) -> DisparityMap {
        self.checked(SelfCheck::new(self.left.width(), self.range))
    }

    /// The matches with which the right image agrees to `tolerance_px`: the symmetric check of v1
    /// and v2.
    pub(super) fn symmetric(&self, tolerance_px: i32) -> DisparityMap {
        let width = self.left.width();
        self.checked(SymmetricCheck::new(tolerance_px, width, self.range))
    }

    fn checked(&self, mut check: impl RowCheck) -> DisparityMap {
        let [left, right] = &self.blocks;
        let height = self.left.height();
        // A check only rejects: it starts from all matches, so both checks see the same ones.
        let mut map = self.matches.clone();
        for (y, mut row) in map.rows_mut().enumerate() {
            let lane = y % Blocks::ROWS;
            if lane == 0 {
                let rows = Blocks::ROWS.min(height - y);
                check.search(self.isa, left.around(y), right.around(y), rows);
            }
            check.check_row(self.isa, lane, self.left.row(y), &mut row);
        }
        map
    }

    /// Same as [`Self::symmetric`], but the right pixel must be textured too: untextured ones are
    /// not matched back.
    pub(super) fn symmetric_on_texture(&self, tolerance_px: i32) -> DisparityMap {
        let mut map = self.symmetric(tolerance_px);
        for (y, mut row) in map.rows_mut().enumerate() {
            for x in 0..row.width() {
                // The window of a match lies inside the right image.
                if row
                    .at(x)
                    .is_ok_and(|d| !self.right_textured.get(x - d as usize, y))
                {
                    row.reject(x, Reason::Inconsistent);
                }
            }
        }
        map
    }
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
        let correlated = Correlated::new(&pair).unwrap();
        assert_eq!(correlated.self_checked().hash(), v3.hash());
        assert!(correlated.symmetric(0).valid() < correlated.symmetric(1).valid());
        assert!(correlated.symmetric_on_texture(1).valid() < correlated.symmetric(1).valid());
    }
}
