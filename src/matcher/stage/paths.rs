//! Semi-global aggregation (Hirschmüller 2008, section 2.3): the costs of eight paths that end in a pixel, summed, and
//! the disparity of the least sum.
//!
//! Two sweeps follow four directions each, one downwards and one upwards, and run at the same time: each leaves its sums
//! in the rows that it comes to first and adds them in those that the other was in before, where the disparities then
//! are chosen. The result depends on nothing but the costs.

use super::CostVolume;
use crate::kernel::{ChosenRow, DISPARITIES, Isa, Paths, Penalties, SumTest, Sums, choose_row, follow_paths};
use crate::stereo::{Gray, Reason};

/// The sums, with all that is needed to make them.
pub struct PathSums {
    size: (usize, usize),
    chunks: usize,
    sums: Vec<Sums>,
    down: Sweep,
    up: Sweep,
}

/// The disparities chosen from the sums.
pub struct Chosen {
    width: usize,
    /// Of the left image, in 16ths of a pixel.
    left: Vec<i16>,
    why: Vec<Reason>,
    /// Of the right image, in pixels, backwards.
    right: Vec<i16>,
    first: i32,
    right_stride: usize,
}

struct Sweep {
    upwards: bool,
    paths: Paths,
    right_sums: Vec<u16>,
}

/// Neighbouring rows of [`Chosen`].
struct Part<'a> {
    left: &'a mut [i16],
    why: &'a mut [Reason],
    right: &'a mut [i16],
}

impl PathSums {
    /// For costs of that shape.
    pub fn new(costs: &CostVolume) -> Self {
        let (size, chunks) = (costs.size(), costs.chunks());
        let sweep = |upwards| Sweep {
            upwards,
            paths: Paths::new(size.0, costs.first(), chunks, upwards),
            right_sums: vec![0; size.0 + chunks * DISPARITIES],
        };
        Self {
            size,
            chunks,
            sums: vec![Sums([0; DISPARITIES]); size.0 * size.1 * chunks],
            down: sweep(false),
            up: sweep(true),
        }
    }

    /// Sums `costs`, those of the left image `image`, and chooses.
    pub fn choose(
        &mut self,
        isa: Isa,
        costs: &CostVolume,
        image: &Gray,
        penalties: &Penalties,
        test: &SumTest,
        chosen: &mut Chosen,
    ) {
        let Self { size: (width, height), chunks, sums, down, up } = self;
        let (middle, stride) = (*height / 2, *width * *chunks);
        let work = Work { isa, costs, image, penalties, test };
        let (top, bottom) = sums.split_at_mut(middle * stride);
        down.paths.restart();
        up.paths.restart();
        both(
            || work.sweep(down, 0..middle, 0, top, None),
            || work.sweep(up, (middle..*height).rev(), middle, bottom, None),
        );
        let (top_chosen, bottom_chosen) = chosen.split(middle);
        both(
            || work.sweep(down, middle..*height, middle, bottom, Some(bottom_chosen)),
            || work.sweep(up, (0..middle).rev(), 0, top, Some(top_chosen)),
        );
    }
}

/// Runs both, at the same time where rayon's current pool has threads for it.
fn both(a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if rayon::current_num_threads() == 1 {
        a();
        b();
    } else {
        rayon::join(a, b);
    }
}

/// What both sweeps read.
struct Work<'a> {
    isa: Isa,
    costs: &'a CostVolume,
    image: &'a Gray,
    penalties: &'a Penalties,
    test: &'a SumTest,
}

impl Work<'_> {
    /// Follows the paths over `rows` of a half of the image, whose first row is `top`: writes the sums where there is nothing
    /// to choose yet, else adds them and chooses.
    fn sweep(
        &self,
        sweep: &mut Sweep,
        rows: impl Iterator<Item = usize>,
        top: usize,
        sums: &mut [Sums],
        mut chosen: Option<Part<'_>>,
    ) {
        let (last, stride) = (self.image.height() - 1, self.image.width() * self.costs.chunks());
        for y in rows {
            let local = y - top;
            // The first row of a sweep has none behind it; no path of it looks there.
            let behind = if sweep.upwards { last.min(y + 1) } else { y.saturating_sub(1) };
            let sums = &mut sums[local * stride..][..stride];
            let grey = [self.image.row(y), self.image.row(behind)];
            follow_paths(self.isa, &mut sweep.paths, self.costs.row(y), grey, self.penalties, chosen.is_some(), sums);
            if let Some(part) = &mut chosen {
                let mut row = part.row(local, grey[0].len(), &mut sweep.right_sums);
                choose_row(self.isa, sums, self.costs.chunks(), self.test, &mut row);
            }
        }
    }
}

impl Chosen {
    /// For costs of that shape.
    pub fn new(costs: &CostVolume) -> Self {
        let (width, height) = costs.size();
        let right_stride = width + costs.chunks() * DISPARITIES;
        Self {
            width,
            first: costs.first(),
            right_stride,
            left: vec![0; width * height],
            why: vec![Reason::Border; width * height],
            right: vec![0; right_stride * height],
        }
    }

    /// The disparities of row `y` of the left image, in 16ths of a pixel; 0 at the *border*.
    pub fn left(&self, y: usize) -> &[i16] {
        &self.left[y * self.width..][..self.width]
    }

    /// *Valid*, *ambiguous* or *border*.
    pub fn why(&self, y: usize) -> &[Reason] {
        &self.why[y * self.width..][..self.width]
    }

    /// The disparity of the pixel `(x, y)` of the right image, in pixels; nothing outside the image.
    pub fn right(&self, x: i32, y: usize) -> Option<i16> {
        let place = self.width as i32 - 1 - self.first - x;
        let inside = (0..self.width as i32).contains(&x) && (0..self.right_stride as i32).contains(&place);
        inside.then(|| self.right[y * self.right_stride + place as usize])
    }

    /// The rows above `middle`, and the others.
    fn split(&mut self, middle: usize) -> (Part<'_>, Part<'_>) {
        let (left, left_below) = self.left.split_at_mut(middle * self.width);
        let (why, why_below) = self.why.split_at_mut(middle * self.width);
        let (right, right_below) = self.right.split_at_mut(middle * self.right_stride);
        (Part { left, why, right }, Part { left: left_below, why: why_below, right: right_below })
    }
}

impl Part<'_> {
    fn row<'a>(&'a mut self, y: usize, width: usize, right_sums: &'a mut [u16]) -> ChosenRow<'a> {
        let stride = right_sums.len();
        ChosenRow {
            left: &mut self.left[y * width..][..width],
            why: &mut self.why[y * width..][..width],
            right: &mut self.right[y * stride..][..stride],
            right_sums,
        }
    }
}
