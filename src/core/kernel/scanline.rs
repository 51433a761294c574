//! Scanline matching by dynamic programming (Birchfield and Tomasi 1998), sixteen rows at once.
//!
//! A cell of the table waits for the one above it in its own column, so a row alone cannot be cut
//! into lanes; rows can, as they are independent. A cell is one number, `4 · cost + step`: the
//! least number has the least cost, and among equal costs the first step.
//!
//! OpenCV forbids a step up after a diagonal one and a diagonal one after a step up. Two such steps
//! lead to the same cell as one step to the left, which costs less, so with costs and rewards of 0
//! or more they are never taken and nothing forbids them here.

use super::Lanes;
use crate::error::Result;
use crate::stereo::buffer;

/// Steps of a path into a cell: from the column before at the same disparity, from one disparity
/// more in the same column, from the column before at one disparity less.
const LEFT: i32 = 0;
const UP: i32 = 1;
const DIAG: i32 = 2;
const STEP: i32 = 3;

/// Four times a cost that no path of `MAX_SIDE` columns reaches, with occlusions of up to 1000; it
/// leaves room for additions.
const INFINITE: i32 = 1 << 29;

/// Gates: the maximum of a gate and a step's cost either allows the step or rules it out.
const OPEN: i32 = i32::MIN;
const CLOSED: i32 = INFINITE;

/// Least range of three grey levels that counts as an edge.
const EDGE: u16 = 5;

#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct CellNumbers([i32; ScanlinePaths::ROWS]);

/// A column of the left image.
struct LeftColumn {
    /// Times four.
    pixel: [u16; ScanlinePaths::ROWS],
    /// All bits where dissimilarities count: the last column costs nothing.
    counted: u16,
    /// Gate: open if the disparity may fall here.
    up: [i32; ScanlinePaths::ROWS],
}

/// A column of the right image.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct RightColumn {
    /// The pixel's highest and lowest value within half a pixel, times four.
    high: [u16; ScanlinePaths::ROWS],
    low: [u16; ScanlinePaths::ROWS],
    /// Gate: open if the disparity may rise after the match with this column.
    diag: [i32; ScanlinePaths::ROWS],
}

/// The cheapest paths through sixteen rows. It holds one thread's scratch.
pub struct ScanlinePaths {
    disparities: usize,
    right: Vec<RightColumn>,
    /// Cells of the previous column, by disparity from −1 on; while a column is computed, the cells
    /// above belong to it.
    cells: Vec<CellNumbers>,
    /// By column, then disparity.
    steps: Vec<[u8; ScanlinePaths::ROWS]>,
}

impl ScanlinePaths {
    /// Rows matched at once.
    pub const ROWS: usize = 16;

    /// For rows of `width` pixels and disparities from 0 up to 255.
    pub fn new(width: usize, max_disparity: u8) -> Result<Self> {
        let disparities = width.min(usize::from(max_disparity) + 1);
        let column = RightColumn {
            high: [0; Self::ROWS],
            low: [0; Self::ROWS],
            diag: [CLOSED; Self::ROWS],
        };
        Ok(Self {
            disparities,
            right: buffer(column, width)?,
            cells: vec![CellNumbers([INFINITE; Self::ROWS]); disparities + 1],
            steps: buffer([0; Self::ROWS], width * disparities)?,
        })
    }

    /// Writes the disparities of row `lane` along its cheapest path.
    pub fn trace(&self, lane: usize, mut write: impl FnMut(usize, u8)) {
        let width = self.right.len();
        let step = |x: usize, d: usize| i32::from(self.steps[x * self.disparities + d][lane]);
        // Without the two bits of the step: only costs are compared.
        let last = self.cells[1..].iter().map(|numbers| numbers.0[lane] >> 2);
        // Disparity 0 always exists; among equals the first wins.
        let (mut d, _) = last
            .enumerate()
            .min_by_key(|&(_, cost)| cost)
            .expect("a disparity");
        let mut x = width - 1;
        write(0, 0);
        while x > 0 {
            write(x, d as u8);
            while step(x, d) == UP {
                d += 1;
            }
            let from = x;
            while step(x, d) == DIAG {
                (x, d) = (x - 1, d - 1);
            }
            (x..from).for_each(|x| write(x, d as u8));
            x = x.saturating_sub(1);
        }
    }
}

/// True if column `x` of the left image ends an occlusion: there is an edge on the three pixels
/// before it. `at` returns the columns of N rows.
#[inline(always)]
pub fn edge_before<const N: usize>(
    x: usize,
    width: usize,
    at: impl Fn(usize) -> [u16; N],
) -> [bool; N] {
    match x {
        _ if x + 3 >= width => [true; N],
        _ if x < 3 || x + 4 == width => [false; N],
        _ => edge([at(x - 3), at(x - 2), at(x - 1)]),
    }
}

/// True if column `x` of the right image begins an occlusion: there is an edge on the three pixels
/// after it.
#[inline(always)]
fn edge_after<const N: usize>(x: usize, width: usize, at: impl Fn(usize) -> [u16; N]) -> [bool; N] {
    match x {
        _ if x + 3 >= width || x >= 3 && x + 4 == width => [false; N],
        _ if x < 3 => [true; N],
        _ => edge([at(x + 1), at(x + 2), at(x + 3)]),
    }
}

/// True for each of N rows in which three neighbouring pixels contain an edge.
#[inline(always)]
pub fn edge<const N: usize>([a, b, c]: [[u16; N]; 3]) -> [bool; N] {
    std::array::from_fn(|i| a[i].max(b[i]).max(c[i]) - a[i].min(b[i]).min(c[i]) >= EDGE)
}

#[inline(always)]
fn gate(open: [bool; ScanlinePaths::ROWS]) -> [i32; ScanlinePaths::ROWS] {
    open.map(|open| if open { OPEN } else { CLOSED })
}

/// See [`super::find_paths`].
#[inline(always)]
pub(super) fn find(
    left: &[Lanes<u16>],
    right: &[Lanes<u16>],
    first: usize,
    occlusion: i32,
    reward: i32,
    paths: &mut ScanlinePaths,
) {
    const N: usize = ScanlinePaths::ROWS;
    let width = left.len();
    // Blocks have a multiple of sixteen rows.
    let rows =
        |lanes: &Lanes<u16>| -> [u16; N] { *lanes.0[first..].first_chunk().expect("sixteen rows") };
    load(right, rows, &mut paths.right);

    let costs = [4 * occlusion + UP, 4 * occlusion + DIAG, 4 * reward];
    paths.cells.fill(CellNumbers([INFINITE; N]));
    // A path begins at disparity 0, as its first column has no other; cell indices start at −1.
    paths.cells[1] = CellNumbers([LEFT; N]);
    for x in 1..width {
        let count = (x + 1).min(paths.disparities);
        let column = LeftColumn {
            pixel: rows(&left[x]).map(|v| 4 * v),
            counted: if x + 1 < width { u16::MAX } else { 0 },
            up: gate(edge_before(x, width, |x| rows(&left[x]))),
        };
        let (cells, right) = (&mut paths.cells[..=count], &paths.right[x + 1 - count..=x]);
        let steps = &mut paths.steps[x * paths.disparities..][..count];
        let mut up = [INFINITE; N];
        // Downwards: a step up leads from one disparity more, in the same column.
        for d in (0..count).rev() {
            let (below, here) = cells.split_at_mut(d + 1);
            cell(
                costs,
                &column,
                &right[count - 1 - d],
                &below[d].0,
                &mut here[0].0,
                &mut up,
                &mut steps[d],
            );
        }
    }
}

/// Replaces `here`, the number at the previous column and the same disparity, by that of this cell.
/// `up` is the number by which this cell is reached from above; it becomes that for the cell below
/// it.
#[inline(always)]
fn cell(
    [up_cost, diag_cost, reward]: [i32; 3],
    left: &LeftColumn,
    right: &RightColumn,
    below: &[i32; ScanlinePaths::ROWS],
    here: &mut [i32; ScanlinePaths::ROWS],
    up: &mut [i32; ScanlinePaths::ROWS],
    step: &mut [u8; ScanlinePaths::ROWS],
) {
    for i in 0..ScanlinePaths::ROWS {
        // The larger of a step's number and its gate: a closed gate exceeds the cost of any path.
        let same = (here[i] & !STEP) - reward;
        let diag = ((below[i] & !STEP) + diag_cost).max(right.diag[i]);
        // One of the two is 0.
        let unlike = left.pixel[i].saturating_sub(right.high[i])
            | right.low[i].saturating_sub(left.pixel[i]);
        let number = same.min(up[i]).min(diag) + i32::from(unlike & left.counted);
        up[i] = ((number & !STEP) + up_cost).max(left.up[i]);
        step[i] = (number & STEP) as u8;
        here[i] = number;
    }
}

/// Prepares the columns of the right image.
#[inline(always)]
fn load(
    right: &[Lanes<u16>],
    rows: impl Fn(&Lanes<u16>) -> [u16; ScanlinePaths::ROWS],
    out: &mut [RightColumn],
) {
    let width = right.len();
    for (x, column) in out.iter_mut().enumerate() {
        // The content of the last column does not matter: it matches only the last column of the
        // left image, at no cost.
        let [before, here, after] =
            [x.saturating_sub(1), x, (x + 1).min(width - 1)].map(|x| rows(&right[x]));
        for i in 0..ScanlinePaths::ROWS {
            let (before, after) = ((before[i] + here[i]) >> 1, (here[i] + after[i]) >> 1);
            column.high[i] = 4 * here[i].max(before).max(after);
            column.low[i] = 4 * here[i].min(before).min(after);
        }
        column.diag = gate(edge_after(x, width, |x| rows(&right[x])));
    }
}
