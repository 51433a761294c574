//! Census transform (Zabih & Woodfill 1994): a bit for each neighbour of a pixel that is darker,
//! and the Hamming distances between censuses.

use super::{Lanes, VolumeShape};

/// Half of the window, 9 x 7 pixels: 62 neighbours.
pub const CENSUS_REACH: [usize; 2] = [4, 3];

/// Bytes of a census. The bytes of a row are in as many planes, so that pixels are lanes.
pub const CENSUS_BYTES: usize = 8;

/// Elements before the first pixel in a plane of censuses, and after the last block of pixels.
pub const CENSUS_MARGIN: usize = Lanes::COUNT;

/// Pixels of a block with those around it, in a row.
const SPAN: usize = Lanes::COUNT + 2 * CENSUS_REACH[0];

/// Where the neighbours of a block's first pixel are, in rows of [`SPAN`].
const NEIGHBOURS: [usize; 62] = {
    let window = 2 * CENSUS_REACH[0] + 1;
    let mut places = [0; 62];
    let mut i = 0;
    while i < places.len() {
        // The middle one is left out.
        let k = if i < places.len() / 2 { i } else { i + 1 };
        places[i] = k / window * SPAN + k % window;
        i += 1;
    }
    places
};

/// See [`super::census_row`].
#[inline(always)]
pub(super) fn census(rows: [&[u8]; 7], stride: usize, out: &mut [u8]) {
    const N: usize = Lanes::COUNT;
    let [reach_x, reach_y] = CENSUS_REACH;
    let width = rows[0].len() - 2 * reach_x;
    for x in (0..width).step_by(N) {
        // Blocks of one size, so that the compiler knows how many vectors they are.
        let mut around = [[0; SPAN]; 7];
        for (around, row) in around.iter_mut().zip(rows) {
            let row = &row[x..];
            match row.first_chunk() {
                Some(row) => *around = *row,
                None => around[..row.len()].copy_from_slice(row),
            }
        }
        let around = around.as_flattened();
        let pixels = |first: usize| -> &[u8; N] {
            let pixels = around[first..].first_chunk();
            pixels.expect("pixels of a block")
        };
        let centres = pixels(reach_y * SPAN + reach_x);
        let pixels_left = N.min(width - x);
        for (places, plane) in NEIGHBOURS.chunks(8).zip(out.chunks_mut(stride)) {
            let mut bits = [0; N];
            // From the highest bit down.
            for &place in places.iter().rev() {
                let neighbours = pixels(place);
                for l in 0..N {
                    // SSE2 compares no numbers without a sign.
                    let darker = centres[l].saturating_sub(neighbours[l]).min(1);
                    bits[l] = bits[l] << 1 | darker;
                }
            }
            plane[x..x + pixels_left].copy_from_slice(&bits[..pixels_left]);
        }
    }
}

/// See [`super::census_costs`].
#[inline(always)]
pub(super) fn costs<const W: usize>(
    shape: &VolumeShape,
    left: &[u8],
    right: &[u8],
    outside: &[u8],
    out: &mut [Lanes<u8>],
) {
    let stride = outside.len();
    let lanes = |row: &[u8], at: usize| -> [u8; W] {
        *row[at..]
            .first_chunk()
            .expect("a margin after the last block")
    };
    // The planes have one length, so that one test of the bounds serves all.
    let mut planes = [[outside; CENSUS_BYTES]; 2];
    for b in 0..CENSUS_BYTES {
        planes[0][b] = &left[b * stride..][..stride];
        planes[1][b] = &right[b * stride..][..stride];
    }
    for (block, out) in out.chunks_exact_mut(shape.count).enumerate() {
        for from in (0..Lanes::COUNT).step_by(W) {
            let x = CENSUS_MARGIN + block * Lanes::COUNT + from;
            let mut here = [[0; W]; CENSUS_BYTES];
            for b in 0..CENSUS_BYTES {
                here[b] = lanes(planes[0][b], x);
            }
            let beyond = lanes(outside, x);
            for (d, out) in (shape.first..).zip(&mut out[..shape.reached_in(block)]) {
                // Never before the margin, as some pixel of the block has use for the disparity; in
                // the other margin all are outside.
                let at = (x as i32 - d).min((stride - W) as i32) as usize;
                let outside = lanes(outside, at);
                let mut there = [[0; W]; CENSUS_BYTES];
                for b in 0..CENSUS_BYTES {
                    there[b] = lanes(planes[1][b], at);
                }
                let mut costs = [0; W];
                for i in 0..W {
                    let mut differing = [0; CENSUS_BYTES];
                    for b in 0..CENSUS_BYTES {
                        differing[b] = here[b][i] ^ there[b][i];
                    }
                    costs[i] = ones(differing) | outside[i] | beyond[i];
                }
                out.0[from..from + W].copy_from_slice(&costs);
            }
        }
    }
}

/// Number of bits set.
#[inline(always)]
fn ones(bytes: [u8; CENSUS_BYTES]) -> u8 {
    let count = |bits: u8| bits.count_ones() as u8;
    // Counting is a single instruction.
    if cfg!(target_arch = "aarch64") {
        return bytes.into_iter().map(count).sum();
    }
    let [a, b, c, d, e, f, g, h] = bytes;
    // Seven bytes are added bit by bit first, which halves the number of counts. A full adder: the
    // sum and the carry of three bits.
    let add = |a: u8, b: u8, c: u8| (a ^ b ^ c, a & b | (a ^ b) & c);
    let ((sum_a, carry_a), (sum_b, carry_b)) = (add(a, b, c), add(d, e, f));
    let (ones, carry_c) = add(sum_a, sum_b, g);
    let (twos, fours) = add(carry_a, carry_b, carry_c);
    count(ones) + 2 * count(twos) + 4 * count(fours) + count(h)
}
