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
    /// The costs of the previous row, by disparity, one slot more than there are, then their least:
    /// [`OUTSIDE`] if there is no path.
    lines: Vec<PathPixels>,
    /// The costs of the row, until it is the previous one.
    next: Vec<PathPixels>,
}

/// The pixels of a block, between their neighbours of the adjacent blocks, on the paths from the
/// previous, the same and the next column of the previous row.
type PathPixels = [[u8; N + 2]; 3];

impl PathBlock {
    /// Largest P2.
    pub const LARGEST_PENALTY: i32 = 85;

    /// Paths through a block of volumes of that shape.
    pub fn new(shape: VolumeShape, block: usize) -> Self {
        let lines = vec![[[OUTSIDE; N + 2]; 3]; Self::slots(&shape)];
        Self {
            x: block * N,
            next: lines.clone(),
            lines,
        }
    }

    /// Slots of a line.
    pub fn slots(shape: &VolumeShape) -> usize {
        shape.count + 2
    }

    /// Begins a sweep.
    pub fn restart(&mut self) {
        for lines in [&mut self.lines, &mut self.next] {
            lines.fill([[OUTSIDE; N + 2]; 3]);
        }
    }

    /// Copies the costs of the diagonal that enters the block before this one.
    pub fn first(&self, out: &mut [u8]) {
        for (out, [_, _, rising]) in out.iter_mut().zip(&self.lines) {
            *out = rising[1];
        }
    }

    /// Reads the costs of the diagonals that enter from the block before, `before`, and from the
    /// one after. Leaves in `before` those that enter the block after.
    pub fn enter(&mut self, before: &mut [u8], after: &[u8]) {
        let beside = before.iter_mut().zip(after);
        for ([falling, _, rising], (before, after)) in self.lines.iter_mut().zip(beside) {
            falling[0] = std::mem::replace(before, falling[N]);
            rising[N + 1] = *after;
        }
    }

    /// Aggregates over W pixels of the next row, the first at lane `from`, and passes on the amount
    /// that each of the three paths adds, disparity by disparity.
    #[inline(always)]
    fn advance<const W: usize>(
        &mut self,
        costs: &[Lanes<u8>],
        [grey, grey_behind]: [&[u8]; 2],
        penalties: &Penalties,
        from: usize,
        out: impl Iterator<Item = impl PathOutput<3, W>>,
    ) {
        advance(
            &self.lines,
            &mut self.next,
            ([from, from + 1, from + 2], from + 1),
            costs.iter().map(|lanes| part(&lanes.0, from)),
            penalties.small,
            steps(self.x + from, grey, grey_behind, penalties),
            out,
        );
    }

    /// The row becomes the previous one.
    fn next_row(&mut self) {
        std::mem::swap(&mut self.lines, &mut self.next);
    }
}

#[inline(always)]
fn part<const W: usize>(lanes: &[u8], from: usize) -> &[u8; W] {
    lanes[from..].first_chunk().expect("a part of the lanes")
}

/// P2 of the steps from three pixels of the previous row to those from `x` on; any beyond the
/// image.
#[inline(always)]
fn steps<const W: usize>(
    x: usize,
    grey: &[u8],
    behind: &[u8],
    penalties: &Penalties,
) -> [[u8; W]; 3] {
    let here = pixels::<W>(grey, x as i32);
    let mut large = [[0; W]; 3];
    for (from, large) in (x as i32 - 1..).zip(&mut large) {
        let behind = pixels::<W>(behind, from);
        for l in 0..W {
            large[l] = penalties.large[usize::from(here[l].abs_diff(behind[l]))];
        }
    }
    large
}

/// The pixels of a row from `x` on, edges replicated.
#[inline(always)]
fn pixels<const W: usize>(row: &[u8], x: i32) -> [u8; W] {
    if let Some(pixels) = row.get(x as usize..).and_then(|row| row.first_chunk()) {
        return *pixels;
    }
    let mut pixels = [0; W];
    for (x, pixel) in (x..).zip(&mut pixels) {
        *pixel = row[x.clamp(0, row.len() as i32 - 1) as usize];
    }
    pixels
}

/// Extends R paths by a pixel, per lane: `L(p, d) = C(p, d) + min(L(q, d), L(q, d ± 1) + P1,
/// min L(q) + P2) − min L(q)` with q the pixel before p on the path.
///
/// `before` holds L(q) and, in the last slot, min L(q); `now` receives those of p. Both have at
/// least two slots more than p has disparities, `costs`. In a slot the lanes of q begin at `from`,
/// those of p at `to`. `out` receives the amount that each path adds to a cost.
#[inline(always)]
pub(super) fn advance<'a, const R: usize, const W: usize, const S: usize>(
    before: &[[[u8; S]; R]],
    now: &mut [[[u8; S]; R]],
    (from, to): ([usize; R], usize),
    costs: impl ExactSizeIterator<Item = &'a [u8; W]>,
    small: u8,
    large: [[u8; W]; R],
    out: impl Iterator<Item = impl PathOutput<R, W>>,
) {
    let read = |slot: &[[u8; S]; R]| {
        let mut lanes = [[0; W]; R];
        for r in 0..R {
            lanes[r] = *part(&slot[r], from[r]);
        }
        lanes
    };
    let write = |slot: &mut [[u8; S]; R], lanes: [[u8; W]; R]| {
        for r in 0..R {
            slot[r][to..to + W].copy_from_slice(&lanes[r]);
        }
    };
    let (least, before) = before.split_last().expect("the least");
    let (new_least, now) = now.split_last_mut().expect("the least");
    let least = read(least);
    let mut limit = [[0; W]; R];
    for r in 0..R {
        for l in 0..W {
            limit[r][l] = least[r][l].saturating_add(large[r][l]);
        }
    }
    let mut lower = [[OUTSIDE; W]; R];
    let mut same = read(&before[0]);
    let mut fewest = [[OUTSIDE; W]; R];
    let (now, end) = now.split_at_mut(costs.len());
    let slots = before[1..=costs.len()].iter().zip(now);
    for ((cost, out), (higher, now)) in costs.zip(out).zip(slots) {
        let higher = read(higher);
        let mut added = [[0; W]; R];
        let mut path = [[0; W]; R];
        for r in 0..R {
            for l in 0..W {
                let step = lower[r][l].min(higher[r][l]).saturating_add(small);
                // Never negative: no admissible cost is below their least.
                added[r][l] = same[r][l].min(step).min(limit[r][l]) - least[r][l];
                path[r][l] = cost[l].saturating_add(added[r][l]);
                fewest[r][l] = fewest[r][l].min(path[r][l]);
            }
        }
        write(now, path);
        (lower, same) = (same, higher);
        out.put(cost, added);
    }
    // A path may have reached more disparities on its previous pixel.
    write(&mut end[0], [[OUTSIDE; W]; R]);
    write(new_least, fewest);
}

/// Receiver of the amounts that R paths add to a cost in [`advance`].
///
/// A trait, because a closure cannot be marked for inlining, and large ones are not inlined.
pub(super) trait PathOutput<const R: usize, const W: usize> {
    fn put(self, cost: &[u8; W], added: [[u8; W]; R]);
}

/// The sums of the paths.
struct Sums<'a>(&'a mut [u8]);

impl<const W: usize> PathOutput<3, W> for Sums<'_> {
    #[inline(always)]
    fn put(self, _: &[u8; W], [a, b, c]: [[u8; W]; 3]) {
        let mut sums = [0; W];
        for l in 0..W {
            sums[l] = a[l] + b[l] + c[l];
        }
        self.0.copy_from_slice(&sums);
    }
}

/// The sums of all eight paths, and those of other paths than the three.
struct AllPaths<'a, const W: usize> {
    total: &'a mut [i16; W],
    others: [&'a [u8; W]; 2],
}

impl<const W: usize> PathOutput<3, W> for AllPaths<'_, W> {
    #[inline(always)]
    fn put(self, cost: &[u8; W], [a, b, c]: [[u8; W]; 3]) {
        let [sums, along] = self.others;
        let mut total = [0; W];
        // Each path carries C + added: summed over eight, the cost counts eight times.
        for l in 0..W {
            total[l] = 8 * i16::from(cost[l])
                + i16::from(sums[l])
                + i16::from(along[l])
                + i16::from(a[l] + b[l] + c[l]);
        }
        *self.total = total;
    }
}

/// See [`super::follow_paths`].
#[inline(always)]
pub(super) fn follow<const W: usize>(
    paths: &mut PathBlock,
    costs: &[Lanes<u8>],
    grey: [&[u8]; 2],
    penalties: &Penalties,
    sums: &mut [Lanes<u8>],
) {
    for from in (0..N).step_by(W) {
        let sums = sums
            .iter_mut()
            .map(|sums| Sums(&mut sums.0[from..from + W]));
        paths.advance::<W>(costs, grey, penalties, from, sums);
    }
    paths.next_row();
}

/// See [`super::finish_paths`].
#[inline(always)]
pub(super) fn finish<const W: usize>(
    paths: &mut PathBlock,
    costs: &[Lanes<u8>],
    grey: [&[u8]; 2],
    penalties: &Penalties,
    [sums, along]: [&[Lanes<u8>]; 2],
    totals: &mut Totals,
) {
    for from in (0..N).step_by(W) {
        let others = sums.iter().zip(along);
        let out = totals.places_mut(paths.x + from).zip(others);
        let out = out.map(|(total, (sums, along))| AllPaths {
            total,
            others: [part(&sums.0, from), part(&along.0, from)],
        });
        paths.advance::<W>(costs, grey, penalties, from, out);
    }
    paths.next_row();
}
