//! SGM cost aggregation along paths (Hirschmüller 2008, equation 13): the three directions that
//! come from the previous row of a sweep over the image.
//!
//! Path costs fit a byte: the matching cost is at most 62 and what a path adds to it at most P2.
//! What three paths add fits a byte too, with P2 up to [`Paths::LARGEST_PENALTY`].

use super::volume::OUTSIDE;
use super::{Lanes, Totals, VolumeShape};

const N: usize = Lanes::COUNT;

/// Penalties of a change of disparity between neighbours on a path.
#[derive(Clone, Debug)]
pub struct Penalties {
    /// P1, of a change by one.
    pub small: u8,
    /// P2, of any other change, by the difference of grey level between the two pixels.
    pub large: [u8; 256],
}

/// The paths of a sweep, downwards or upwards: along the column and along both diagonals.
pub struct Paths {
    shape: VolumeShape,
    /// Rows of the sweep so far.
    behind: usize,
    /// From the previous, the same and the next column of the previous row.
    lines: [PathLine; 3],
}

/// Path costs of a row in one direction, by disparity and then by pixel: [`OUTSIDE`] where there is
/// no path, as before the image.
///
/// Costs stay where they are until the path's next pixel replaces them. As a diagonal path moves on
/// by a column per row, the place of the row's first pixel moves as far the other way.
struct PathLine {
    span: usize,
    costs: Vec<u8>,
    least: Vec<u8>,
}

impl Paths {
    /// Largest P2.
    pub const LARGEST_PENALTY: i32 = 85;

    /// Paths over volumes of that shape.
    pub fn new(shape: VolumeShape) -> Self {
        let lines = [(); 3].map(|()| {
            // An odd number of cache lines, so that neighbouring disparities do not contend for the
            // same ones.
            let span = ((shape.padded() + shape.height).div_ceil(N) | 1) * N;
            PathLine {
                span,
                costs: vec![OUTSIDE; (shape.count + 1) * span],
                least: vec![OUTSIDE; span],
            }
        });
        Self {
            shape,
            behind: 0,
            lines,
        }
    }

    /// Begins a sweep.
    pub fn restart(&mut self) {
        self.behind = 0;
        for line in &mut self.lines {
            line.costs.fill(OUTSIDE);
            line.least.fill(OUTSIDE);
        }
    }

    /// Aggregates over the next row, and passes on what the three paths add, block by block and
    /// disparity by disparity.
    #[inline(always)]
    fn advance(
        &mut self,
        costs: &[Lanes<u8>],
        [grey, grey_behind]: [&[u8]; 2],
        penalties: &Penalties,
        mut out: impl FnMut(usize, usize, &[u8; N], [u8; N]),
    ) {
        let Self {
            shape,
            behind,
            lines,
        } = self;
        let starts = [shape.height - 1 - *behind, 0, *behind];
        for (block, costs) in costs.chunks_exact(shape.count).enumerate() {
            let large = steps(block * N, grey, grey_behind, penalties);
            let at = starts.map(|start| start + block * N);
            let [falling, column, rising] = lines.each_mut();
            let (falling, falling_least) = falling.at(at[0]);
            let (column, column_least) = column.at(at[1]);
            let (rising, rising_least) = rising.at(at[2]);
            let costs = costs[..shape.reached_in(block)]
                .iter()
                .map(|lanes| &lanes.0);
            let least = [falling_least, column_least, rising_least];
            advance(
                [falling, column, rising],
                least,
                costs,
                penalties.small,
                large,
                |i, cost, added| {
                    let mut sum = [0; N];
                    for l in 0..N {
                        sum[l] = added[0][l] + added[1][l] + added[2][l];
                    }
                    out(block, i, cost, sum);
                },
            );
        }
        *behind += 1;
    }
}

impl PathLine {
    /// The costs of the block at `place`, and their least.
    #[inline(always)]
    fn at(&mut self, place: usize) -> (impl Iterator<Item = &mut [u8; N]>, &mut [u8; N]) {
        let costs = self.costs.chunks_exact_mut(self.span);
        (
            costs.map(move |row| {
                row[place..]
                    .first_chunk_mut()
                    .expect("a block within the line")
            }),
            self.least[place..]
                .first_chunk_mut()
                .expect("a block within the line"),
        )
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
/// p has disparities, `costs`. `out` gets what each path adds to a cost.
#[inline(always)]
pub(super) fn advance<'a, const R: usize, const N: usize>(
    lines: [impl Iterator<Item = &'a mut [u8; N]>; R],
    least: [&mut [u8; N]; R],
    costs: impl Iterator<Item = &'a [u8; N]>,
    small: u8,
    large: [[u8; N]; R],
    mut out: impl FnMut(usize, &[u8; N], [[u8; N]; R]),
) {
    let mut lines = lines;
    let mut slots = lines
        .each_mut()
        .map(|line| line.next().expect("one more than there are disparities"));
    let mut lower = [[OUTSIDE; N]; R];
    let mut same = slots.each_ref().map(|slot| **slot);
    let before = least.each_ref().map(|least| **least);
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
            let higher = *next;
            let mut now = [0; N];
            for l in 0..N {
                let step = lower[r][l].min(higher[l]).saturating_add(small);
                // Never negative: no admissible cost is below their least.
                added[r][l] = same[r][l].min(step).min(limit[r][l]) - before[r][l];
                now[l] = cost[l].saturating_add(added[r][l]);
                fewest[r][l] = fewest[r][l].min(now[l]);
            }
            *std::mem::replace(&mut slots[r], next) = now;
            lower[r] = std::mem::replace(&mut same[r], higher);
        }
        out(i, cost, added);
    }
    for (r, least) in least.into_iter().enumerate() {
        // A diagonal path may have reached more disparities on its previous pixel.
        *slots[r] = [OUTSIDE; N];
        *least = fewest[r];
    }
}

/// See [`super::follow_paths`].
#[inline(always)]
pub(super) fn follow(
    paths: &mut Paths,
    costs: &[Lanes<u8>],
    grey: [&[u8]; 2],
    penalties: &Penalties,
    sums: &mut [Lanes<u8>],
) {
    let count = paths.shape.count;
    paths.advance(costs, grey, penalties, |block, i, _, added| {
        sums[block * count + i].0 = added
    });
}

/// See [`super::finish_paths`].
#[inline(always)]
pub(super) fn finish(
    paths: &mut Paths,
    costs: &[Lanes<u8>],
    grey: [&[u8]; 2],
    penalties: &Penalties,
    [sums, along]: [&[Lanes<u8>]; 2],
    totals: &mut Totals,
) {
    let count = paths.shape.count;
    paths.advance(costs, grey, penalties, |block, i, cost, added| {
        let (sums, along) = (&sums[block * count + i].0, &along[block * count + i].0);
        let total = totals.at_mut(i, block * N);
        // Each path carries C + added: of eight, the cost counts eight times.
        for l in 0..N {
            total[l] = 8 * u16::from(cost[l])
                + u16::from(sums[l])
                + u16::from(along[l])
                + u16::from(added[l]);
        }
    });
}
