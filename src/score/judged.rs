//! Which pixels are judged, for every score alike.

use crate::stereo::{Plane, Visibility};

/// The pixels whose truth is known, and that both cameras see where `mask` says which, as
/// `(x, y, true disparity)`. The two are of one size.
pub(super) fn judged<'a>(
    truth: &'a Plane<f32>,
    mask: Option<&'a Plane<Visibility>>,
) -> impl Iterator<Item = (usize, usize, f32)> + 'a {
    truth.rows().enumerate().flat_map(move |(y, row)| {
        let visible = mask.map(|mask| mask.row(y));
        let pixels = row.iter().enumerate().map(move |(x, &truth)| (x, y, truth));
        pixels.filter(move |&(x, _, d)| {
            d.is_finite() && visible.is_none_or(|v| v[x] == Visibility::Visible)
        })
    })
}
