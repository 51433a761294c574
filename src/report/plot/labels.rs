//! Texts beside points, where they hide least.

use super::text_width;

/// A rectangle of the plot: left, top, right, bottom.
pub(super) type Area = [i32; 4];

/// The areas that are taken, as texts are placed among them.
pub(super) struct Labels {
    bounds: Area,
    taken: Vec<Area>,
    size: u32,
}

impl Labels {
    /// Texts of that `size` stay within `bounds`.
    pub(super) fn new(bounds: Area, size: u32) -> Self {
        Self { bounds, taken: Vec::new(), size }
    }

    /// Nothing should stand within `radius` of that point.
    pub(super) fn avoid(&mut self, (x, y): (i32, i32), radius: i32) {
        self.taken.push([x - radius, y - radius, x + radius, y + radius]);
    }

    /// The left middle of `text` beside `point`, up to `away` lines from it; with how much of it is hidden or hides,
    /// square units.
    pub(super) fn place(&mut self, text: &str, (x, y): (i32, i32), away: i32) -> ((i32, i32), i32) {
        let (width, height) = (text_width(text, self.size), self.size as i32);
        let area = |left: i32, middle: i32| [left, middle - height / 2, left + width, middle + height / 2];
        let mut best: Option<(i32, Area)> = None;
        for away in 1..=away {
            let (dx, dy) = (14 * away, 8 + height * (2 * away - 1) / 2 + 4);
            let beside = [(x + dx, y), (x - dx - width, y)];
            let above_and_below =
                [-dy, dy].into_iter().flat_map(|dy| [x - width / 2, x + dx, x - dx - width].map(|left| (left, y + dy)));
            for (left, middle) in beside.into_iter().chain(above_and_below) {
                let area = area(left, middle);
                let hidden = self.taken.iter().map(|taken| shared(&area, taken)).sum::<i32>() + width * height
                    - shared(&area, &self.bounds);
                if best.is_none_or(|(least, _)| hidden < least) {
                    best = Some((hidden, area));
                }
            }
        }
        // At least one place was tried.
        let (hidden, area) = best.unwrap_or((0, area(x, y)));
        self.taken.push(area);
        ((area[0], (area[1] + area[3]) / 2), hidden)
    }

    /// Gives back the room of the last text, which is not drawn.
    pub(super) fn withdraw(&mut self) {
        self.taken.pop();
    }
}

/// The area that two rectangles have in common.
fn shared(a: &Area, b: &Area) -> i32 {
    let side = |i: usize| (a[i + 2].min(b[i + 2]) - a[i].max(b[i])).max(0);
    side(0) * side(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_stay_apart_and_inside() {
        let bounds = [0, 0, 400, 300];
        let mut labels = Labels::new(bounds, 20);
        let points = [(390, 100), (390, 105), (10, 5), (200, 200), (204, 200), (208, 204)];
        points.iter().for_each(|p| labels.avoid(*p, 8));
        for point in points {
            let (_, hidden) = labels.place("sgm", point, 3);
            assert_eq!(hidden, 0, "{point:?}");
        }
    }

    #[test]
    fn a_text_without_room_says_so() {
        let mut labels = Labels::new([0, 0, 60, 30], 20);
        labels.place("abcde", (10, 10), 3);
        assert!(labels.place("abcde", (10, 10), 3).1 > 0);
    }
}
