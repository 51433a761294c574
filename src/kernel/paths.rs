//! Costs summed along paths (Hirschmüller 2008, equation 13), half of the eight directions in one sweep over the image.
//!
//! Disparities are the lanes. A path's costs fit a byte: the matching cost is at most 62 and what a path adds to it at
//! most P2, so with P2 up to [`Paths::LARGEST_PENALTY`] even the least cost plus P2 does. A path is kept in one place
//! while the sweep follows it: straight ones by their column, oblique ones by the column at which they meet the first
//! row, modulo the width, for where one leaves the image the next one enters.

use super::{Costs, DISPARITIES};

/// Sums of path costs of neighbouring disparities.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Sums(pub [u16; DISPARITIES]);

/// What a step of disparity costs.
#[derive(Clone, Debug)]
pub struct Penalties {
    /// P1, of a step by one.
    pub small: u8,
    /// P2, of any other step, by the difference of grey level between the two pixels.
    pub large: [u8; 256],
}

/// The paths of a sweep, downwards or upwards: along the row, along both diagonals and along the column.
pub struct Paths {
    width: usize,
    /// [`Costs`] per pixel.
    chunks: usize,
    upwards: bool,
    /// Rows seen.
    rows: usize,
    /// Per direction the costs of every path, [`Costs::OUTSIDE`] between them.
    lines: [Vec<u8>; 4],
    /// Per direction the least cost of every path.
    least: [Vec<u8>; 4],
}

impl Paths {
    /// Largest P2.
    pub const LARGEST_PENALTY: i32 = 96;

    /// Paths over rows of `width` pixels with `chunks` [`Costs`] each.
    pub fn new(width: usize, chunks: usize, upwards: bool) -> Self {
        let count = [1, width, width, width];
        Self {
            width,
            chunks,
            upwards,
            rows: 0,
            lines: count.map(|count| vec![Costs::OUTSIDE; (count * (chunks + 1) + 1) * DISPARITIES]),
            least: count.map(|count| vec![0; count]),
        }
    }

    /// Begins a sweep.
    pub fn restart(&mut self) {
        self.rows = 0;
        for direction in 0..4 {
            (0..self.least[direction].len()).for_each(|line| self.begin(direction, line));
        }
    }

    /// Begins a path: nothing lies behind it, so nothing is added to its first cost.
    fn begin(&mut self, direction: usize, line: usize) {
        let at = (line * (self.chunks + 1) + 1) * DISPARITIES;
        self.lines[direction][at..][..self.chunks * DISPARITIES].fill(0);
        self.least[direction][line] = 0;
    }
}

/// See [`super::follow_paths`].
#[inline(always)]
pub(super) fn follow(
    paths: &mut Paths,
    costs: &[Costs],
    [grey, grey_behind]: [&[u8]; 2],
    penalties: &Penalties,
    add: bool,
    sums: &mut [Sums],
) {
    let (width, chunks, shift) = (paths.width, paths.chunks, paths.rows % paths.width);
    paths.begin(0, 0);
    for i in 0..width {
        let turn = |line: usize| if line < width { line } else { line - width };
        let lines = [0, turn(i + width - shift), i, turn(i + shift)];
        if i == 0 {
            paths.begin(1, lines[1]);
        }
        if i == width - 1 {
            paths.begin(3, lines[3]);
        }
        // In the direction of the sweep: the column behind and the one ahead.
        let (behind, ahead) = (i.saturating_sub(1), (i + 1).min(width - 1));
        let column = |i: usize| if paths.upwards { width - 1 - i } else { i };
        let (x, behind, ahead) = (column(i), column(behind), column(ahead));
        let step = |other: u8| penalties.large[usize::from(grey[x].abs_diff(other))];
        let large = [step(grey[behind]), step(grey_behind[behind]), step(grey_behind[x]), step(grey_behind[ahead])];

        let (costs, sums) = (&costs[x * chunks..][..chunks], &mut sums[x * chunks..][..chunks]);
        let line =
            |r: usize| lines[r] * (chunks + 1) * DISPARITIES..(lines[r] * (chunks + 1) + chunks + 2) * DISPARITIES;
        let [row, falling, column, rising] = &mut paths.lines;
        let mut here = [&mut row[line(0)], &mut falling[line(1)], &mut column[line(2)], &mut rising[line(3)]];
        let [row, falling, column, rising] = &mut paths.least;
        let least = [&mut row[lines[0]], &mut falling[lines[1]], &mut column[lines[2]], &mut rising[lines[3]]];
        let now =
            pixel(&mut here, [*least[0], *least[1], *least[2], *least[3]], costs, penalties.small, large, add, sums);
        for r in 0..4 {
            *least[r] = now[r];
        }
    }
    paths.rows += 1;
}

/// Moves four paths on to a pixel; returns their least costs there.
#[inline(always)]
fn pixel(
    lines: &mut [&mut [u8]; 4],
    least: [u8; 4],
    costs: &[Costs],
    small: u8,
    large: [u8; 4],
    add: bool,
    sums: &mut [Sums],
) -> [u8; 4] {
    let mut now_least = [[u8::MAX; DISPARITIES]; 4];
    let mut lower = [[0; DISPARITIES]; 4];
    for r in 0..4 {
        lower[r] = load(lines[r], DISPARITIES - 1);
    }
    for (chunk, (costs, sums)) in costs.iter().zip(sums).enumerate() {
        let at = (chunk + 1) * DISPARITIES;
        let mut total = [0u16; DISPARITIES];
        for r in 0..4 {
            let (same, higher) = (load(lines[r], at), load(lines[r], at + 1));
            let next_lower = load(lines[r], at + DISPARITIES - 1);
            let limit = least[r].saturating_add(large[r]);
            let mut now = [0; DISPARITIES];
            for i in 0..DISPARITIES {
                let step = lower[r][i].min(higher[i]).saturating_add(small);
                now[i] = costs.0[i].saturating_add(same[i].min(step).min(limit) - least[r]);
                now_least[r][i] = now_least[r][i].min(now[i]);
                total[i] += u16::from(now[i]);
            }
            lines[r][at..][..DISPARITIES].copy_from_slice(&now);
            lower[r] = next_lower;
        }
        for i in 0..DISPARITIES {
            sums.0[i] = total[i] + if add { sums.0[i] } else { 0 };
        }
    }
    let mut least = [u8::MAX; 4];
    for r in 0..4 {
        for i in 0..DISPARITIES {
            least[r] = least[r].min(now_least[r][i]);
        }
    }
    least
}

/// Part of a line, which holds a chunk before its first cost and one after its last.
#[inline(always)]
fn load(line: &[u8], at: usize) -> [u8; DISPARITIES] {
    *line[at..].first_chunk().expect("a chunk")
}
