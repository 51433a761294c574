//! Branch-free writers of block-matching results into the rows of a disparity map with SSDPIs.

use super::{CAP, Match};
use crate::stereo::{DisparityMap, Reason, RowMut};

/// See [`super::accept_row`].
#[inline(always)]
pub(super) fn accept(first: i32, winners: &[Match], textured: &[bool], row: &mut RowMut<'_>) {
    let (disparity, why, ssdpi) = row.planes_mut();
    for (((disparity, why), ssdpi), (winner, &textured)) in disparity
        .iter_mut()
        .zip(why)
        .zip(ssdpi)
        .zip(winners.iter().zip(textured))
    {
        *disparity = if textured {
            (first + winner.index() as i32) as f32
        } else {
            f32::INFINITY
        };
        *why = if textured {
            Reason::Valid
        } else {
            Reason::Untextured
        };
        *ssdpi = if textured {
            winner.ssd()
        } else {
            DisparityMap::NO_SSDPI
        };
    }
}

/// See [`super::self_check_row`].
#[inline(always)]
pub(super) fn self_check(references: &[u16], row: &mut RowMut<'_>) {
    let (disparity, why, ssdpi) = row.planes_mut();
    for (((disparity, why), ssdpi), &reference) in
        disparity.iter_mut().zip(why).zip(ssdpi).zip(references)
    {
        let exact = *ssdpi < u32::from(CAP);
        // A pixel that is not valid has the SSDPI `NO_SSDPI`, so it is not exact.
        let rejected = exact & (*ssdpi >= u32::from(reference));
        *disparity = if rejected { f32::INFINITY } else { *disparity };
        *why = if rejected { Reason::SelfCheck } else { *why };
    }
}
