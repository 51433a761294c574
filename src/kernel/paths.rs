//! Costs summed along paths (Hirschmüller 2008, equation 13), half of the eight directions in one sweep over the image.
//!
//! Disparities are the lanes. A path's costs fit a byte: the matching cost is at most 62 and what a path adds to it at
//! most P2, so with P2 up to [`Paths::LARGEST_PENALTY`] even the least cost plus P2 does.

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

/// The paths of a sweep, downwards or upwards: along the row, along the column and along both diagonals.
pub struct Paths {
    /// The lowest disparity.
    lowest: i32,
    /// [`Costs`] per pixel.
    chunks: usize,
    upwards: bool,
    /// Nothing lies behind the next row.
    first: bool,
    /// Of the row behind and of this one, by direction; and of two neighbours in this row.
    behind: [Lines; 3],
    here: [Lines; 3],
    along: [Lines; 2],
    /// What a path begins with: nothing is added to its first cost.
    none: Lines,
}

/// Path costs of pixels: bytes by disparity, [`Costs::OUTSIDE`] between pixels, and the least of each pixel.
struct Lines {
    costs: Vec<u8>,
    least: Vec<u8>,
}

impl Paths {
    /// Largest P2.
    pub const LARGEST_PENALTY: i32 = 96;

    /// Paths over rows of `width` pixels with `chunks` [`Costs`] each, from the disparity `lowest` on.
    pub fn new(width: usize, lowest: i32, chunks: usize, upwards: bool) -> Self {
        let lines = |count: usize| Lines {
            costs: vec![Costs::OUTSIDE; (count * (chunks + 1) + 1) * DISPARITIES],
            least: vec![0; count],
        };
        let mut none = lines(1);
        none.costs[DISPARITIES..][..chunks * DISPARITIES].fill(0);
        Self {
            lowest,
            chunks,
            upwards,
            first: true,
            behind: [(); 3].map(|()| lines(width)),
            here: [(); 3].map(|()| lines(width)),
            along: [(); 2].map(|()| lines(1)),
            none,
        }
    }

    /// Begins a sweep.
    pub fn restart(&mut self) {
        self.first = true;
    }
}

impl Lines {
    /// The costs of pixel `i`, with one more at either end, and their least.
    #[inline(always)]
    fn read(&self, i: usize, chunks: usize) -> (&[u8], u8) {
        let at = (i * (chunks + 1) + 1) * DISPARITIES - 1;
        (&self.costs[at..][..chunks * DISPARITIES + 2], self.least[i])
    }

    /// The first `reached` chunks of pixel `i`, and its least. Beyond them nothing is reached.
    #[inline(always)]
    fn write(&mut self, i: usize, chunks: usize, reached: usize) -> (&mut [[u8; DISPARITIES]], &mut u8) {
        let at = (i * (chunks + 1) + 1) * DISPARITIES;
        self.costs[at + reached * DISPARITIES] = Costs::OUTSIDE;
        (self.costs[at..][..reached * DISPARITIES].as_chunks_mut().0, &mut self.least[i])
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
    let Paths { lowest, chunks, upwards, first, behind, here, along, none } = paths;
    let (width, chunks) = (grey.len(), *chunks);
    let none = none.read(0, chunks);
    let [falling, column, rising] = &*behind;
    let [falling_here, column_here, rising_here] = here;
    let [mut last, mut next] = along.each_mut();
    // Left over from the row behind, where more may have been reached.
    last.costs.fill(Costs::OUTSIDE);
    next.costs.fill(Costs::OUTSIDE);
    for i in 0..width {
        // In the direction of the sweep: the pixels behind and ahead in a row.
        let (back, ahead) = (i.saturating_sub(1), (i + 1).min(width - 1));
        let place = |i: usize| if *upwards { width - 1 - i } else { i };
        let x = place(i);
        let reached = Costs::reached(x, *lowest, chunks);
        let step = |other: u8| penalties.large[usize::from(grey[x].abs_diff(other))];
        let large = [
            step(grey[place(back)]),
            step(grey_behind[place(back)]),
            step(grey_behind[x]),
            step(grey_behind[place(ahead)]),
        ];
        let before = [
            if i == 0 { none } else { last.read(0, chunks) },
            if i == 0 || *first { none } else { falling.read(back, chunks) },
            if *first { none } else { column.read(i, chunks) },
            if i == width - 1 || *first { none } else { rising.read(ahead, chunks) },
        ];
        let now = [
            next.write(0, chunks, reached),
            falling_here.write(i, chunks, reached),
            column_here.write(i, chunks, reached),
            rising_here.write(i, chunks, reached),
        ];
        let pixel = x * chunks..x * chunks + reached;
        advance(before, now, &costs[pixel.clone()], penalties.small, large, add, &mut sums[pixel]);
        std::mem::swap(&mut last, &mut next);
    }
    std::mem::swap(behind, here);
    *first = false;
}

/// Moves four paths on to a pixel.
#[inline(always)]
fn advance(
    before: [(&[u8], u8); 4],
    [(row, row_least), (falling, falling_least), (column, column_least), (rising, rising_least)]: [(&mut [[u8; DISPARITIES]], &mut u8);
        4],
    costs: &[Costs],
    small: u8,
    large: [u8; 4],
    add: bool,
    sums: &mut [Sums],
) {
    let mut least = [[u8::MAX; DISPARITIES]; 4];
    let out = row.iter_mut().zip(falling).zip(column).zip(rising).zip(sums);
    for (chunk, (costs, ((((row, falling), column), rising), sums))) in costs.iter().zip(out).enumerate() {
        let mut total = [0u16; DISPARITIES];
        let mut now = [[0; DISPARITIES]; 4];
        for r in 0..4 {
            let (behind, behind_least) = before[r];
            let limit = behind_least.saturating_add(large[r]);
            let (lower, same, higher) = around(behind, chunk);
            for i in 0..DISPARITIES {
                let step = lower[i].min(higher[i]).saturating_add(small);
                now[r][i] = costs.0[i].saturating_add(same[i].min(step).min(limit) - behind_least);
                least[r][i] = least[r][i].min(now[r][i]);
                total[i] += u16::from(now[r][i]);
            }
        }
        (*row, *falling, *column, *rising) = (now[0], now[1], now[2], now[3]);
        for (sum, total) in sums.0.iter_mut().zip(total) {
            *sum = total + if add { *sum } else { 0 };
        }
    }
    *row_least = least_lane(&least[0]);
    *falling_least = least_lane(&least[1]);
    *column_least = least_lane(&least[2]);
    *rising_least = least_lane(&least[3]);
}

/// The costs of a chunk at one disparity less, at the same and at one more.
#[inline(always)]
fn around(costs: &[u8], chunk: usize) -> ([u8; DISPARITIES], [u8; DISPARITIES], [u8; DISPARITIES]) {
    let window: &[u8; DISPARITIES + 2] = costs[chunk * DISPARITIES..].first_chunk().expect("one more at either end");
    let at = |i: usize| -> [u8; DISPARITIES] { *window[i..].first_chunk().expect("one more at either end") };
    (at(0), at(1), at(2))
}

#[inline(always)]
fn least_lane(lanes: &[u8; DISPARITIES]) -> u8 {
    let mut least = u8::MAX;
    for &lane in lanes {
        least = least.min(lane);
    }
    least
}
