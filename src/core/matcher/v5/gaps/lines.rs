//! The nearest seen pixels along the rows and columns of a lattice.

/// Ends of two surfaces, bins: seen pixels that differ by more are not of one.
const JUMP: u16 = 16;

/// A seen pixel of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SeenPixel {
    /// Place on the line; `NONE` without one.
    pub(super) at: u16,
    /// Greatest step of grey on the way there.
    pub(super) barrier: u16,
}

pub(super) const NONE: u16 = u16::MAX;

/// The nearest seen pixels before and after a pixel, each followed by the next one in that
/// direction that is another surface.
pub(super) type NearestSeen = [[SeenPixel; 2]; 2];

/// A line of the half image: its first pixel, step and number of pixels.
#[derive(Clone, Copy)]
pub(super) struct Line {
    pub(super) first: usize,
    pub(super) step: usize,
    pub(super) count: usize,
}

impl Line {
    /// Finds the nearest seen pixels of every pixel whose number is a multiple of `1 << step`.
    /// `bins` and `seen` are planes of pixels; `grey` are the line's own.
    pub(super) fn scan(
        self,
        step: u32,
        bins: &[i16],
        seen: &[u8],
        grey: impl Fn(usize) -> u16,
        out: &mut [NearestSeen],
    ) {
        for direction in 0..2 {
            let none = SeenPixel {
                at: NONE,
                barrier: 0,
            };
            // The last seen pixel, and the one of another surface before it.
            let (mut last, mut other, mut last_bin) = (none, none, 0_i16);
            let end = self.count - 1;
            let mut before = grey(direction * end);
            for n in 0..self.count {
                let i = [n, end - n][direction];
                let here = grey(i);
                last.barrier = last.barrier.max(here.abs_diff(before));
                before = here;
                if i & ((1 << step) - 1) == 0 {
                    let barrier = other.barrier.max(last.barrier);
                    out[i >> step][direction] = [last, SeenPixel { barrier, ..other }];
                }
                let place = self.first + i * self.step;
                if seen[place] == 1 {
                    let bin = bins[place];
                    if last.at != NONE && bin.abs_diff(last_bin) > JUMP {
                        other = last;
                    } else {
                        other.barrier = other.barrier.max(last.barrier);
                    }
                    last = SeenPixel {
                        at: i as u16,
                        barrier: 0,
                    };
                    last_bin = bin;
                }
            }
        }
    }
}
