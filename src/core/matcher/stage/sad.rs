//! Block matching by the sum of absolute differences over a square window (Konolige 1997).
//!
//! A window is matched only if every disparity of the range keeps it inside both images: a strip as
//! wide as the highest disparity is lost at the left, which the thesis criticises in section 7 and
//! its own matchers avoid.

use super::{DisparityRange, EdgeImage};
use crate::kernel::{
    Isa, PIXELS, SadBlock, SadTest, SadWinners, Sads, accept_sads, least_sads, run_sums,
    slide_columns, slide_texture,
};
use crate::stereo::{Reason, RowMut};
use std::ops;

/// Centres of the windows that fit an image of a given size.
#[derive(Clone, Debug)]
struct Room {
    columns: ops::Range<usize>,
    rows: ops::Range<usize>,
}

/// Finds the best window of each pixel, row by row downwards. It holds one thread's scratch.
pub struct SadSearch {
    range: DisparityRange,
    window: usize,
    test: SadTest,
    /// Per cent by which another disparity must be worse; 0 = off.
    uniqueness: u32,
    room: Room,
    /// The row of the current sums.
    at: Option<usize>,
    /// Sums of each column at all disparities.
    columns: Vec<Sads>,
    block: SadBlock,
    texture_sums: Vec<u16>,
    textures: Vec<u16>,
    winners: Vec<SadWinners>,
    /// Substitute for the leaving row if none leaves: equal in both images, without texture.
    blank: Vec<u8>,
}

impl SadSearch {
    /// For images of that size and an odd `window`; a winner is tested by its texture and its
    /// `uniqueness` in per cent.
    pub fn new(
        (width, height): (usize, usize),
        range: DisparityRange,
        window: usize,
        texture: u16,
        uniqueness: u32,
    ) -> Self {
        let reach = window / 2;
        // Columns of the left image that every disparity keeps inside the right one.
        let first = range.max().max(0) as usize;
        // Negative disparities need as many columns on the right.
        let end = width.saturating_sub(range.min().min(0).unsigned_abs() as usize);
        let room = |first: usize, end: usize| {
            if first + window <= end {
                first + reach..end - reach
            } else {
                0..0
            }
        };
        let room = Room {
            columns: room(first, end),
            rows: room(0, height),
        };
        let room = if room.columns.is_empty() || room.rows.is_empty() {
            Room {
                columns: 0..0,
                rows: 0..0,
            }
        } else {
            room
        };
        let count = (range.max() - range.min() + 1) as usize;
        let block = SadBlock::new(count);
        let pixels = room.columns.len();
        // No columns without windows.
        let columns = if pixels == 0 { 0 } else { pixels + window - 1 };
        Self {
            range,
            window,
            test: SadTest {
                highest: range.max(),
                count: count as u16,
                texture,
            },
            uniqueness,
            room,
            at: None,
            columns: vec![Sads::ZERO; columns * block.column()],
            texture_sums: vec![0; columns],
            textures: vec![0; pixels],
            winners: vec![SadWinners::NONE; pixels.div_ceil(PIXELS)],
            blank: vec![crate::kernel::PREFILTER_CAP as u8; columns + block.column() * Sads::COUNT],
            block,
        }
    }

    /// Writes `row`, row `y` of the map. Consecutive rows reuse the column sums; after a jump they
    /// are recomputed; another image needs [`SadSearch::restart`].
    pub fn match_row(
        &mut self,
        isa: Isa,
        y: usize,
        left: &EdgeImage,
        right: &EdgeImage,
        row: &mut RowMut<'_>,
    ) {
        let width = row.width();
        if !self.room.rows.contains(&y) {
            row.clear(Reason::Border);
            return;
        }
        self.move_to(isa, y, left, right);
        least_sads(
            isa,
            &self.columns,
            self.window,
            self.uniqueness,
            &mut self.block,
            &mut self.winners,
        );
        run_sums(isa, &self.texture_sums, self.window, &mut self.textures);
        let columns = self.room.columns.clone();
        row.part_mut(0..columns.start).clear(Reason::Border);
        row.part_mut(columns.end..width).clear(Reason::Border);
        accept_sads(
            isa,
            &self.winners,
            &self.textures,
            &self.test,
            &mut row.part_mut(columns),
        );
    }

    /// Discards the column sums: the next row is from another image.
    pub fn restart(&mut self) {
        self.at = None;
    }

    /// The winner's SAD at `x` of the last matched row, the maximum if there is none.
    pub fn sad(&self, x: usize) -> u16 {
        match x.checked_sub(self.room.columns.start) {
            Some(i) if x < self.room.columns.end => self.winners[i / PIXELS].sad[i % PIXELS],
            _ => u16::MAX,
        }
    }

    /// Moves the column sums to the windows around row `y`.
    fn move_to(&mut self, isa: Isa, y: usize, left: &EdgeImage, right: &EdgeImage) {
        let reach = self.window / 2;
        match self.at {
            Some(at) if at + 1 == y => self.slide(isa, y + reach, Some(at - reach), left, right),
            _ => {
                self.columns.fill(Sads::ZERO);
                self.texture_sums.fill(0);
                (y - reach..=y + reach).for_each(|new| self.slide(isa, new, None, left, right));
            }
        }
        self.at = Some(y);
    }

    fn slide(
        &mut self,
        isa: Isa,
        new: usize,
        old: Option<usize>,
        left: &EdgeImage,
        right: &EdgeImage,
    ) {
        let from = self.room.columns.start - self.window / 2;
        let met = (from as i32 - self.range.max()) as usize;
        let left_old = old.map_or(&self.blank[..], |y| &left.row(y)[from..]);
        let right_old = old.map_or(&self.blank[..], |y| &right.row(y)[met..]);
        let left_new = &left.row(new)[from..];
        slide_columns(
            isa,
            [left_new, left_old],
            [&right.row(new)[met..], right_old],
            self.block.column(),
            &mut self.columns,
        );
        slide_texture(isa, [left_new, left_old], &mut self.texture_sums);
    }
}
