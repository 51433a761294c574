//! Indexed pictures, of at most 256 colours.

use svl_core::stereo::Plane;

/// A picture of at most 256 colours: per pixel the index of its colour in the palette.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    pub codes: Plane<u8>,
    /// RGB.
    pub palette: Vec<[u8; 3]>,
}

impl Picture {
    /// The picture subsampled to at most `width` columns, in its proportions, without
    /// interpolation: every colour keeps its meaning. A pixel has the code nearest to the middle of
    /// its area, of those that are not `empty`, if there is one: a sparse map keeps its points.
    pub fn at_most(self, width: usize, empty: u8) -> Self {
        let (w, h) = self.codes.size();
        if w <= width || width == 0 {
            return self;
        }
        // A wide strip of few rows keeps at least one.
        let height = (h * width / w).max(1);
        let span = |i: usize, from: usize, to: usize| {
            let begin = i * from / to;
            begin..((i + 1) * from / to).max(begin + 1).min(from)
        };
        let code = |x: usize, y: usize| {
            let (columns, rows) = (span(x, w, width), span(y, h, height));
            let cx = (columns.start + columns.end) / 2;
            let cy = (rows.start + rows.end) / 2;
            let middle = self.codes.get(cx, cy);
            if middle != empty {
                return middle;
            }
            let places = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            let known = places.filter(|(x, y)| self.codes.get(*x, *y) != empty);
            let nearest = known.min_by_key(|(x, y)| x.abs_diff(cx).pow(2) + y.abs_diff(cy).pow(2));
            nearest.map_or(empty, |(x, y)| self.codes.get(x, y))
        };
        match Plane::from_fn(width, height, code) {
            Ok(codes) => Self { codes, ..self },
            // Sides smaller than those of a plane are valid.
            Err(_) => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smaller_pictures_keep_colours_and_proportions() {
        let picture = Picture {
            codes: Plane::from_fn(6, 4, |x, y| (10 * y + x) as u8).unwrap(),
            palette: vec![[1; 3]],
        };
        assert_eq!(picture.clone().at_most(6, 255), picture);
        let small = picture.at_most(3, 255);
        assert_eq!(
            small.codes.pixels().collect::<Vec<_>>(),
            [11, 13, 15, 31, 33, 35]
        );
    }

    /// Every second column is known, in every phase; and one point in sixteen.
    #[test]
    fn sparse_points_are_kept() {
        for phase in 0..2 {
            let codes = Plane::from_fn(8, 8, |x, _| 9 * u8::from(x % 2 == phase)).unwrap();
            let small = Picture {
                codes,
                palette: vec![[1; 3]],
            };
            assert!(small.at_most(4, 0).codes.pixels().all(|code| code == 9));
        }
        let codes = Plane::from_fn(8, 8, |x, y| 7 * u8::from(x % 4 == 3 && y % 4 == 0)).unwrap();
        let small = Picture {
            codes,
            palette: vec![[1; 3]],
        };
        let points = small.at_most(2, 0).codes;
        assert!(points.pixels().all(|code| code == 7));
    }
}
