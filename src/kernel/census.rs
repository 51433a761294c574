//! The census of a pixel, which of its neighbours are darker (Zabih & Woodfill 1994), and in how many of them two differ.

/// Half of the window, 9 x 7 pixels: 62 neighbours.
pub const CENSUS_REACH: [usize; 2] = [4, 3];

/// Bytes that a census takes. Those of a row lie in as many planes, so that pixels are lanes.
pub const CENSUS_BYTES: usize = 8;

/// Disparities handled together.
pub const DISPARITIES: usize = 32;

/// Matching costs of neighbouring disparities: 0 ..= 62, or [`Costs::OUTSIDE`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(32))]
pub struct Costs(pub [u8; DISPARITIES]);

impl Costs {
    /// Of a disparity beyond the range or the right image.
    pub const OUTSIDE: u8 = u8::MAX;

    /// How many of `chunks` a pixel in column `x` has use for: at the left edge the higher disparities lead outside.
    /// What lies beyond them is neither written nor read.
    #[inline(always)]
    pub(super) fn reached(x: usize, first: i32, chunks: usize) -> usize {
        let disparities = (x as i32 - first).max(0) as usize;
        chunks.min(disparities / DISPARITIES + 1)
    }
}

/// See [`super::census_row`].
#[inline(always)]
pub(super) fn census(rows: [&[u8]; 7], stride: usize, out: &mut [u8]) {
    let [reach_x, reach_y] = CENSUS_REACH;
    let (width, window) = (rows[0].len() - 2 * reach_x, 2 * reach_x + 1);
    let centres = &rows[reach_y][reach_x..][..width];
    out.chunks_mut(stride).for_each(|plane| plane[..width].fill(0));
    let neighbours = (0..7 * window).filter(|&k| k != reach_y * window + reach_x);
    for (bit, k) in neighbours.enumerate() {
        let plane = &mut out[bit / 8 * stride..][..width];
        let neighbours = &rows[k / window][k % window..][..width];
        for ((byte, &neighbour), &centre) in plane.iter_mut().zip(neighbours).zip(centres) {
            *byte |= u8::from(neighbour < centre) << (bit % 8);
        }
    }
}

/// See [`super::census_costs`].
#[inline(always)]
pub(super) fn costs(left: &[u8], right: &[u8], outside: &[u8], first: i32, tail: &[Costs], out: &mut [Costs]) {
    let chunks = tail.len();
    let width = out.len() / chunks;
    let stride = right.len() / CENSUS_BYTES;
    for (x, out) in out.chunks_exact_mut(chunks).enumerate() {
        let out = &mut out[..Costs::reached(x, first, chunks)];
        for (chunk, (out, tail)) in out.iter_mut().zip(tail).enumerate() {
            let at = width - 1 - x + chunk * DISPARITIES;
            // Each plane goes on for the whole range beyond its last pixel.
            let lanes = |row: &[u8]| *row[at..].first_chunk::<DISPARITIES>().expect("a row as long as the range");
            let mut bytes = [[0; DISPARITIES]; CENSUS_BYTES];
            for (b, bytes) in bytes.iter_mut().enumerate() {
                *bytes = lanes(&right[b * stride..]);
            }
            let outside = lanes(outside);
            for i in 0..DISPARITIES {
                let mut differing = [0; CENSUS_BYTES];
                for b in 0..CENSUS_BYTES {
                    differing[b] = bytes[b][i] ^ left[b * width + width - 1 - x];
                }
                out.0[i] = ones(differing) | outside[i] | tail.0[i];
            }
        }
    }
}

/// How many bits are set. Seven bytes are added bit by bit first, as half as many are counted then.
#[inline(always)]
fn ones([a, b, c, d, e, f, g, h]: [u8; CENSUS_BYTES]) -> u8 {
    // What a full adder gives: the sum and the carry of three bits.
    let add = |a: u8, b: u8, c: u8| (a ^ b ^ c, a & b | (a ^ b) & c);
    let ((sum_a, carry_a), (sum_b, carry_b)) = (add(a, b, c), add(d, e, f));
    let (ones, carry_c) = add(sum_a, sum_b, g);
    let (twos, fours) = add(carry_a, carry_b, carry_c);
    let count = |bits: u8| bits.count_ones() as u8;
    count(ones) + 2 * count(twos) + 4 * count(fours) + count(h)
}
