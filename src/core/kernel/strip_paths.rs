//! Costs of censuses and their aggregation along both directions of strips.
//!
//! A strip is one column, or row, per lane; the paths run along it, so that no lane reads another.
//! SGM's recurrence is Hirschmüller 2008, equation 13.

// Iterators over lanes instead of these loops are slower.
#![expect(clippy::needless_range_loop)]

use super::Lanes;
use super::small_census::SMALL_CENSUS_PLANES;

const N: usize = Lanes::COUNT;

/// Position of a strip and its matches in planes of bytes.
#[derive(Clone, Copy, Debug)]
pub struct StripPlace {
    /// Pixels along the strip.
    pub length: usize,
    /// Index of its first pixel in the planes of the left image and of the steps.
    pub start: usize,
    /// The same in the planes of the right image.
    pub right: usize,
    /// Distance from a pixel to the next along the strip.
    pub pitch: usize,
    /// Distance from a match to that of the next disparity, backwards.
    pub towards: usize,
    /// Column of the first pixel's first lane.
    pub column: usize,
    /// True if lanes are columns; else the pixels along the strip are.
    pub lanes_are_columns: bool,
}

/// Costs along a path.
#[derive(Clone, Copy, Debug)]
pub struct PathCost<'a> {
    /// Cost of a disparity that leads out of the right image.
    pub out: u8,
    /// Penalty for a change of disparity by one.
    pub small: u8,
    /// Penalty for any other change from the previous pixel, by the index of the pixel.
    pub large: &'a [u8],
}

/// See [`super::follow_strip`].
#[inline(always)]
pub(super) fn follow(
    place: &StripPlace,
    [left, right]: [[&[u8]; SMALL_CENSUS_PLANES]; 2],
    cost: PathCost<'_>,
    costs: &mut [Lanes<u8>],
    line: &mut [Lanes<u8>],
    sums: &mut [Lanes<u8>],
) {
    let count = line.len() - 1;
    let mut least = [0; N];
    for (i, (costs, sums)) in costs
        .chunks_exact_mut(count)
        .zip(sums.chunks_exact_mut(count))
        .take(place.length)
        .enumerate()
    {
        match_pixels(place, i, left, right, cost.out, costs);
        if i == 0 {
            least = begin(costs, line);
            sums.copy_from_slice(costs);
        } else {
            let large = lanes(cost.large, place.start + i * place.pitch);
            least = advance(costs, line, least, cost.small, large, |d, path| {
                sums[d].0 = path;
            });
        }
    }
    for i in (0..place.length).rev() {
        let costs = &costs[i * count..][..count];
        let sums = &mut sums[i * count..][..count];
        let mut add = |d: usize, path: [u8; N]| {
            let sum: &mut Lanes<u8> = &mut sums[d];
            for l in 0..N {
                sum.0[l] += path[l];
            }
        };
        if i + 1 == place.length {
            least = begin(costs, line);
            costs
                .iter()
                .enumerate()
                .for_each(|(d, cost)| add(d, cost.0));
        } else {
            let large = lanes(cost.large, place.start + (i + 1) * place.pitch);
            least = advance(costs, line, least, cost.small, large, add);
        }
    }
}

#[inline(always)]
fn lanes(plane: &[u8], at: usize) -> &[u8; N] {
    plane[at..].first_chunk().expect("a block within the plane")
}

/// The costs of the strip's pixels `i`.
#[inline(always)]
fn match_pixels(
    place: &StripPlace,
    i: usize,
    left: [&[u8]; SMALL_CENSUS_PLANES],
    right: [&[u8]; SMALL_CENSUS_PLANES],
    out: u8,
    costs: &mut [Lanes<u8>],
) {
    // Unrolled: `map` would be a call, and copy.
    let from = place.start + i * place.pitch;
    let here = [
        lanes(left[0], from),
        lanes(left[1], from),
        lanes(left[2], from),
    ];
    let at = place.right + i * place.pitch;
    let (column, last) = if place.lanes_are_columns {
        (place.column, place.column + N - 1)
    } else {
        (place.column + i, place.column + i)
    };
    for (d, costs) in costs.iter_mut().enumerate() {
        if d > last {
            costs.0 = [out; N];
            continue;
        }
        let from = at - d * place.towards;
        let there = [
            lanes(right[0], from),
            lanes(right[1], from),
            lanes(right[2], from),
        ];
        for l in 0..N {
            let [a, b, c] = [0, 1, 2].map(|plane| here[plane][l] ^ there[plane][l]);
            // A full adder first, so that fewer bytes are counted.
            let (ones, twos) = (a ^ b ^ c, a & b | (a ^ b) & c);
            costs.0[l] = ones.count_ones() as u8 + 2 * twos.count_ones() as u8;
        }
        if d > column {
            costs.0[..d - column].fill(out);
        }
    }
}

/// Begins paths: their costs are those of the pixels. Returns the least.
#[inline(always)]
fn begin(costs: &[Lanes<u8>], line: &mut [Lanes<u8>]) -> [u8; N] {
    let mut least = [u8::MAX; N];
    for (path, cost) in line.iter_mut().zip(costs) {
        *path = *cost;
        for l in 0..N {
            least[l] = least[l].min(cost.0[l]);
        }
    }
    least
}

/// Extends paths by a pixel. `line` has the path costs of the previous pixel, `least` their least;
/// the last element of `line` is greater than any. Returns the new least.
#[inline(always)]
fn advance(
    costs: &[Lanes<u8>],
    line: &mut [Lanes<u8>],
    least: [u8; N],
    small: u8,
    large: &[u8; N],
    mut take: impl FnMut(usize, [u8; N]),
) -> [u8; N] {
    let mut jump = [0; N];
    for l in 0..N {
        jump[l] = least[l] + large[l];
    }
    let mut new_least = [u8::MAX; N];
    let mut stepped_up = [u8::MAX; N];
    for (d, cost) in costs.iter().enumerate() {
        let (here, next) = (line[d].0, line[d + 1].0);
        let mut path = [0; N];
        for l in 0..N {
            let stepped = stepped_up[l].min(next[l].saturating_add(small));
            path[l] = here[l].min(jump[l]).min(stepped) - least[l] + cost.0[l];
            new_least[l] = new_least[l].min(path[l]);
            stepped_up[l] = here[l].saturating_add(small);
        }
        line[d].0 = path;
        take(d, path);
    }
    new_least
}
