//! Texts beside points, placed where they cover least.

use super::canvas::{Canvas, LEFT};
use super::series::{Series, SeriesStyle, TEXT, text_width};

const SIZE: u32 = TEXT - 4;

/// Writes the names beside points within `bounds`. `place`: the position of a point, if it has one.
pub(crate) fn write(
    canvas: &mut Canvas,
    series: &[Series],
    bounds: Area,
    place: impl Fn(&(f64, f64)) -> Option<(i32, i32)>,
) {
    let mut labels = Labels::new(bounds, SIZE);
    for series in series {
        let drawn: Vec<_> = series.points.iter().filter_map(&place).collect();
        // The marks of points come first: a label may cover another label's place, but not a point.
        let radius = match series.form {
            SeriesStyle::Front => 0,
            form => radius(form) + 2,
        };
        drawn.iter().for_each(|p| labels.avoid(*p, radius));
        if matches!(
            series.form,
            SeriesStyle::Both | SeriesStyle::Joined | SeriesStyle::Front
        ) {
            drawn
                .windows(2)
                .flat_map(|ends| between(ends[0], ends[1]))
                .for_each(|p| labels.avoid(p, 4));
        }
    }
    // In the order of importance: an algorithm's name is omitted where it would cover another text,
    // the label of a sweep's value where it would cover anything. Tooltips have all names.
    labels.marks = labels.taken.len();
    let turn = |form| match form {
        SeriesStyle::Named | SeriesStyle::Disc(_) => Some((0, 3)),
        SeriesStyle::Caption => Some((1, 3)),
        SeriesStyle::Label => Some((2, 1)),
        _ => None,
    };
    let turns = series.iter();
    let turns = turns.filter_map(|s| turn(s.form).map(|(turn, away)| (turn, away, s)));
    let mut turns: Vec<_> = turns.collect();
    turns.sort_by_key(|(turn, ..)| *turn);
    for (_, away, series) in turns {
        for point in series.points.iter().filter_map(&place) {
            let (at, hidden) = labels.place(&series.name, point, radius(series.form), away);
            if series.form == SeriesStyle::Label && hidden > 0 || labels.is_cut() {
                labels.withdraw();
            } else {
                canvas.text(&series.name, at, SIZE, LEFT);
            }
        }
    }
}

/// Radius of a point; that of another series' point is that of most.
fn radius(form: SeriesStyle) -> i32 {
    form.radius().unwrap_or(8) as i32
}

/// Points of the line from `a` to `b`, half a text's height apart.
fn between(a: (i32, i32), b: (i32, i32)) -> impl Iterator<Item = (i32, i32)> {
    let steps = (f64::from(b.0 - a.0).hypot(f64::from(b.1 - a.1)) / f64::from(SIZE / 2))
        .ceil()
        .max(1.0) as i32;
    (1..steps).map(move |i| (a.0 + (b.0 - a.0) * i / steps, a.1 + (b.1 - a.1) * i / steps))
}

/// A rectangle of the plot: left, top, right, bottom.
type Area = [i32; 4];

/// The occupied areas, among which texts are placed.
struct Labels {
    bounds: Area,
    taken: Vec<Area>,
    /// Number of the areas that are no texts.
    marks: usize,
    size: u32,
}

impl Labels {
    /// Texts of that `size` stay within `bounds`.
    fn new(bounds: Area, size: u32) -> Self {
        Self {
            bounds,
            taken: Vec::new(),
            marks: 0,
            size,
        }
    }

    /// Keeps texts out of `radius` around that point.
    fn avoid(&mut self, (x, y): (i32, i32), radius: i32) {
        self.taken
            .push([x - radius, y - radius, x + radius, y + radius]);
    }

    /// The left middle of `text` beside a point of that `radius`, up to `away` lines from it; with
    /// the area by which it overlaps others, square units.
    fn place(
        &mut self,
        text: &str,
        (x, y): (i32, i32),
        radius: i32,
        away: i32,
    ) -> ((i32, i32), i32) {
        let (width, height) = (text_width(text, self.size), self.size as i32);
        let area =
            |left: i32, middle: i32| [left, middle - height / 2, left + width, middle + height / 2];
        let mut best: Option<(i32, Area)> = None;
        for away in 1..=away {
            let dx = radius + 14 * away - 8;
            let dy = radius + height * (2 * away - 1) / 2 + 4;
            let beside = [(x + dx, y), (x - dx - width, y)];
            let above_and_below = [-dy, dy]
                .into_iter()
                .flat_map(|dy| [x - width / 2, x + dx, x - dx - width].map(|left| (left, y + dy)));
            for (left, middle) in beside.into_iter().chain(above_and_below) {
                let area = area(left, middle);
                let hidden = self
                    .taken
                    .iter()
                    .map(|taken| shared(&area, taken))
                    .sum::<i32>()
                    + width * height
                    - shared(&area, &self.bounds);
                // Strictly less: of equal places the first, which is the nearest and to the right,
                // wins.
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

    /// True if the last text covers part of another, or leaves the bounds.
    fn is_cut(&self) -> bool {
        let Some((last, others)) = self.taken[self.marks..].split_last() else {
            return false;
        };
        let is_inside = shared(last, &self.bounds) == shared(last, last);
        !is_inside || others.iter().any(|other| shared(last, other) > 0)
    }

    /// Gives back the room of the last text, which is not drawn.
    fn withdraw(&mut self) {
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
        let points = [
            (390, 100),
            (390, 105),
            (10, 5),
            (200, 200),
            (204, 200),
            (208, 204),
        ];
        points.iter().for_each(|p| labels.avoid(*p, 8));
        for point in points {
            let (_, hidden) = labels.place("sgm", point, 8, 3);
            assert_eq!(hidden, 0, "{point:?}");
        }
    }

    #[test]
    fn a_text_is_beside_its_disc() {
        let mut labels = Labels::new([0, 0, 400, 300], 20);
        labels.avoid((200, 150), 40);
        let ((left, middle), hidden) = labels.place("sgm", (200, 150), 38, 3);
        assert_eq!((middle, hidden), (150, 0));
        assert!((240..260).contains(&left), "{left}");
    }

    #[test]
    fn a_text_without_room_is_reported() {
        let mut labels = Labels::new([0, 0, 90, 30], 20);
        labels.place("abcde", (10, 10), 8, 3);
        assert!(!labels.is_cut());
        assert!(labels.place("abcde", (10, 10), 8, 3).1 > 0);
        assert!(labels.is_cut());
    }
}
