//! SGM cost aggregation along paths (Hirschmüller 2008, equation 13): the three directions that
//! come from the previous row of a sweep over the image.
//!
//! Path costs fit a byte: the matching cost is at most 62, and a path adds at most P2 to it. The
//! sum of three paths fits a byte too, with P2 up to [`PathBlock::LARGEST_PENALTY`].

use super::volume::OUTSIDE;
use super::{Lanes, Totals, VolumeShape};

const N: usize = Lanes::COUNT;

/// Penalties for a change of disparity between neighbours on a path.
#[derive(Clone, Debug)]
pub struct Penalties {
    /// P1, for a change by one.
    pub small: u8,
    /// P2, for any other change, by the difference in grey level between the two pixels.
    pub large: [u8; 256],
}

/// The paths of a sweep, downwards or upwards, through a block of columns: along the column and
/// along both diagonals.
///
/// The diagonals come from the neighbouring blocks: before a row, [`PathBlock::enter`] takes their
/// costs of the previous row.
pub struct PathBlock {
    /// The block's first column.
    x: usize,
    /// Paths from the previous, the same and the next column of the previous row. Path costs by
    /// disparity, one slot more than there are, then their least: [`OUTSIDE`] if there is no path.
    lines: [Vec<PathPixels>; 3],
}

/// The pixels of a block, between their neighbours of the adjacent blocks.
type PathPixels = [u8; N + 2];

impl PathBlock {
    /// Largest P2.
    pub const LARGEST_PENALTY: i32 = 85;

    /// Paths through a block of volumes of that shape.
    pub fn new(shape: VolumeShape, block: usize) -> Self {
        Self {
            x: block * N,
            lines: [(); 3].map(|()| vec![[OUTSIDE; N + 2]; Self::slots(&shape)]),
        }
    }

    /// Slots of a line.
    pub fn slots(shape: &VolumeShape) -> usize {
        shape.count + 2
    }

    /// Begins a sweep.
    pub fn restart(&mut self) {
        for line in &mut self.lines {
            line.fill([OUTSIDE; N + 2]);
        }
    }

    /// Copies the costs of the diagonal that enters the block before this one.
    pub fn first(&self, out: &mut [u8]) {
        for (out, pixels) in out.iter_mut().zip(&self.lines[2]) {
            *out = pixels[1];
        }
    }

    /// Reads the costs of the diagonals that enter from the block before, `before`, and from the
    /// one after. Leaves in `before` those that enter the block after.
    pub fn enter(&mut self, before: &mut [u8], after: &[u8]) {
        let [falling, _, rising] = &mut self.lines;
        for (pixels, before) in falling.iter_mut().zip(before) {
            pixels[0] = std::mem::replace(before, pixels[N]);
        }
        for (pixels, after) in rising.iter_mut().zip(after) {
            pixels[N + 1] = *after;
        }
    }

    /// Aggregates over the next row, and passes on the amount that each of the three paths adds,
    /// disparity by disparity.
    #[inline(always)]
    fn advance(
        &mut self,
        costs: &[Lanes<u8>],
        [grey, grey_behind]: [&[u8]; 2],
        penalties: &Penalties,
        out: impl PathOutput<3, N>,
    ) {
        let large = steps(self.x, grey, grey_behind, penalties);
        let [falling, column, rising] = self.lines.each_mut().map(|line| {
            let (least, costs) = line.split_last_mut().expect("not empty");
            (costs.iter_mut(), least)
        });
        advance(
            [falling.0, column.0, rising.0],
            [falling.1, column.1, rising.1],
            [0, 1, 2],
            costs.iter().map(|lanes| &lanes.0),
            penalties.small,
            large,
            out,
        );
    }
}

/// P2 of the steps from three pixels of the previous row to those from `x` on; 0 beyond the image.
#[inline(always)]
fn steps(x: usize, grey: &[u8], behind: &[u8], penalties: &Penalties) -> [[u8; N]; 3] {
    let mut large = [[0; N]; 3];
    let last = grey.len() - 1;
    for (i, x) in (x..grey.len().min(x + N)).enumerate() {
        let step = |from: usize| penalties.large[usize::from(grey[x].abs_diff(behind[from]))];
        large[0][i] = step(x.saturating_sub(1));
        large[1][i] = step(x);
        large[2][i] = step(last.min(x + 1));
    }
    large
}

/// Extends R paths by a pixel, per lane: `L(p, d) = C(p, d) + min(L(q, d), L(q, d ± 1) + P1,
/// min L(q) + P2) − min L(q)` with q the pixel before p on the path.
///
/// `lines` and `least` hold L(q) and min L(q), and become those of p; a line has one slot more than
/// p has disparities, `costs`. A slot has S − N neighbours about its pixels; q begins at `from` in
/// it, p in the middle. `out` receives the amount that each path adds to a cost.
#[inline(always)]
pub(super) fn advance<'a, const R: usize, const N: usize, const S: usize>(
    lines: [impl Iterator<Item = &'a mut [u8; S]>; R],
    least: [&mut [u8; S]; R],
    from: [usize; R],
    costs: impl Iterator<Item = &'a [u8; N]>,
    small: u8,
    large: [[u8; N]; R],
    mut out: impl PathOutput<R, N>,
) {
    let mut lines = lines;
    let mut slots = lines
        .each_mut()
        .map(|line| line.next().expect("one more than there are disparities"));
    let part = |slot: &[u8; S], from: usize| -> [u8; N] {
        *slot[from..]
            .first_chunk()
            .expect("neighbours on both sides")
    };
    let store = |slot: &mut [u8; S], lanes: [u8; N]| {
        *slot[(S - N) / 2..].first_chunk_mut().expect("as above") = lanes;
    };
    let mut lower = [[OUTSIDE; N]; R];
    let mut same = std::array::from_fn::<_, R, _>(|r| part(slots[r], from[r]));
    let before = std::array::from_fn::<_, R, _>(|r| part(least[r], from[r]));
    let mut limit = [[0; N]; R];
    for r in 0..R {
        for l in 0..N {
            limit[r][l] = before[r][l].saturating_add(large[r][l]);
        }
    }
    let mut fewest = [[OUTSIDE; N]; R];
    // In place: the slot of a disparity is overwritten once its neighbour above has been read, so
    // the old costs of the disparity below and of the disparity itself are carried along.
    for (i, cost) in costs.enumerate() {
        let mut added = [[0; N]; R];
        for r in 0..R {
            let next = lines[r]
                .next()
                .expect("one more than there are disparities");
            let higher = part(next, from[r]);
            let mut now = [0; N];
            for l in 0..N {
                let step = lower[r][l].min(higher[l]).saturating_add(small);
                // Never negative: no admissible cost is below their least.
                added[r][l] = same[r][l].min(step).min(limit[r][l]) - before[r][l];
                now[l] = cost[l].saturating_add(added[r][l]);
                fewest[r][l] = fewest[r][l].min(now[l]);
            }
            store(std::mem::replace(&mut slots[r], next), now);
            lower[r] = std::mem::replace(&mut same[r], higher);
        }
        out.put(i, cost, added);
    }
    for (r, least) in least.into_iter().enumerate() {
        // A diagonal path may have reached more disparities on its previous pixel.
        store(slots[r], [OUTSIDE; N]);
        store(least, fewest[r]);
    }
}

/// Receiver of the amounts that R paths add to the cost at index `i` of the disparities in
/// [`advance`].
///
/// A trait, because a closure cannot be marked for inlining, and large ones are not inlined.
pub(super) trait PathOutput<const R: usize, const N: usize> {
    fn put(&mut self, i: usize, cost: &[u8; N], added: [[u8; N]; R]);
}

struct Sums<'a>(&'a mut [Lanes<u8>]);

impl PathOutput<3, N> for Sums<'_> {
    #[inline(always)]
    fn put(&mut self, i: usize, _: &[u8; N], added: [[u8; N]; 3]) {
        let [a, b, c] = added;
        for (l, sum) in self.0[i].0.iter_mut().enumerate() {
            *sum = a[l] + b[l] + c[l];
        }
    }
}

/// All eight paths of a block from column `x` on.
struct AllPaths<'a> {
    x: usize,
    sums: [&'a [Lanes<u8>]; 2],
    totals: &'a mut Totals,
}

impl PathOutput<3, N> for AllPaths<'_> {
    #[inline(always)]
    fn put(&mut self, i: usize, cost: &[u8; N], added: [[u8; N]; 3]) {
        let [sums, along] = self.sums.map(|sums| &sums[i].0);
        let total = self.totals.at_mut(i, self.x);
        // Each path carries C + added: summed over eight, the cost counts eight times.
        for l in 0..N {
            total[l] = 8 * u16::from(cost[l])
                + u16::from(sums[l])
                + u16::from(along[l])
                + u16::from(added[0][l] + added[1][l] + added[2][l]);
        }
    }
}

/// See [`super::follow_paths`].
#[inline(always)]
pub(super) fn follow(
    paths: &mut PathBlock,
    costs: &[Lanes<u8>],
    grey: [&[u8]; 2],
    penalties: &Penalties,
    sums: &mut [Lanes<u8>],
) {
    paths.advance(costs, grey, penalties, Sums(sums));
}

/// See [`super::finish_paths`].
#[inline(always)]
pub(super) fn finish(
    paths: &mut PathBlock,
    costs: &[Lanes<u8>],
    grey: [&[u8]; 2],
    penalties: &Penalties,
    sums: [&[Lanes<u8>]; 2],
    totals: &mut Totals,
) {
    let x = paths.x;
    paths.advance(costs, grey, penalties, AllPaths { x, sums, totals });
}
