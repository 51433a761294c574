//! Middlebury v2 (D. Scharstein and R. Szeliski, *A taxonomy and evaluation of dense two-frame
//! stereo correspondence algorithms*, IJCV 47, 2002), the table of tsukuba, venus, teddy and cones:
//! bad1.0 under each of the masks nonocc, all and disc. Its quirk: a pixel without estimate is bad.

use super::errors::Errors;
use super::numbers::{Numbers, percent};
use super::{ProtocolImage, judged};
use crate::error::Result;

pub(super) fn numbers(image: &ProtocolImage) -> Result<Numbers> {
    let judged = judged(image.truth, image.mask);
    let errors = Errors::collect(judged.map(|(x, y, truth)| (truth, image.estimate.get(x, y))))?;
    Ok(errors.table(
        |t| percent(errors.over(t) + errors.invalid(), errors.pixels()),
        |q| errors.rank(q),
    ))
}
