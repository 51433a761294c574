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
    /// interpolation: every colour keeps its meaning.
    pub fn at_most(self, width: usize) -> Self {
        let (w, h) = self.codes.size();
        if w <= width || width == 0 {
            return self;
        }
        // A wide strip of few rows keeps at least one.
        let height = (h * width / w).max(1);
        match Plane::from_fn(width, height, |x, y| {
            self.codes.get(x * w / width, y * h / height)
        }) {
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
        assert_eq!(picture.clone().at_most(6), picture);
        let small = picture.at_most(3);
        assert_eq!(
            small.codes.pixels().collect::<Vec<_>>(),
            [0, 2, 4, 20, 22, 24]
        );
    }
}
