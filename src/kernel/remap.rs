//! Pixels fetched from between the pixels of another image.

/// Pixels whose sources are fetched before any is weighed: so many that what was stored in bytes is
/// there when it is loaded in vectors.
const BLOCK: usize = 1024;

/// See [`super::remap_row`].
#[inline(always)]
pub(super) fn row(source: &[u8], stride: usize, places: &[u32], parts: [&[u8]; 2], out: &mut [u8]) {
    let [right, below] = parts.map(|parts| parts.chunks(BLOCK));
    for (((places, right), below), out) in places
        .chunks(BLOCK)
        .zip(right)
        .zip(below)
        .zip(out.chunks_mut(BLOCK))
    {
        // Two neighbours in one load.
        let (mut upper, mut lower) = ([0u16; BLOCK], [0u16; BLOCK]);
        let two = |at: usize| u16::from_le_bytes([source[at], source[at + 1]]);
        for ((&place, upper), lower) in places.iter().zip(&mut upper).zip(&mut lower) {
            let at = place as usize;
            (*upper, *lower) = (two(at), two(at + stride));
        }
        let along = |two: u16, right: u8| {
            (two & 255) * (256 - u16::from(right)) + (two >> 8) * u16::from(right)
        };
        for (i, (out, (&right, &below))) in out.iter_mut().zip(right.iter().zip(below)).enumerate()
        {
            let (above, beneath) = (
                u32::from(along(upper[i], right)),
                u32::from(along(lower[i], right)),
            );
            let sum = above * (256 - u32::from(below)) + beneath * u32::from(below);
            *out = ((sum + (1 << 15)) >> 16) as u8;
        }
    }
}
