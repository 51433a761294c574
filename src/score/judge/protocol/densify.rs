//! Fills the gaps of a sparse map, like KITTI's development kits before scoring.

use svl_core::stereo::Plane;

/// The map with its holes (`+∞`) filled: along each row a gap between two disparities gets the
/// smaller of the two, and both ends the nearest one; then the tops and bottoms of columns get the
/// nearest one. So an empty row between others stays empty, as in the kits (`interpolateBackground`
/// of `io_disparity.h`).
pub fn densify(map: &Plane<f32>) -> Plane<f32> {
    let mut dense = map.clone();
    let (width, height) = dense.size();
    for y in 0..height {
        fill_row(dense.row_mut(y));
    }
    for x in 0..width {
        let known = |y: &usize| dense.get(x, *y).is_finite();
        if let (Some(top), Some(bottom)) = ((0..height).find(known), (0..height).rev().find(known))
        {
            // Rows first, then columns: the order of the kits, which matters in the corners.
            (0..top).for_each(|y| dense.set(x, y, dense.get(x, top)));
            (bottom + 1..height).for_each(|y| dense.set(x, y, dense.get(x, bottom)));
        }
    }
    dense
}

fn fill_row(row: &mut [f32]) {
    let mut from = 0;
    let mut left: Option<f32> = None;
    for x in 0..row.len() {
        let right = row[x];
        if right.is_finite() {
            // The smaller disparity is the background, which fills most gaps.
            row[from..x].fill(left.map_or(right, |left| left.min(right)));
            left = Some(right);
            from = x + 1;
        }
    }
    if let Some(left) = left {
        row[from..].fill(left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NO: f32 = f32::INFINITY;

    fn map(rows: &[&[f32]]) -> Plane<f32> {
        Plane::from_vec(rows[0].len(), rows.len(), rows.concat()).unwrap()
    }

    #[test]
    fn hand_computed() {
        let sparse = map(&[
            &[NO, NO, NO, NO, NO, NO],
            &[NO, 5.0, NO, NO, 3.0, NO],
            &[NO, NO, NO, NO, NO, NO],
            &[2.0, NO, 9.0, NO, NO, 7.0],
            &[NO, NO, NO, NO, NO, NO],
        ]);
        let dense = map(&[
            &[5.0, 5.0, 3.0, 3.0, 3.0, 3.0],
            &[5.0, 5.0, 3.0, 3.0, 3.0, 3.0],
            &[NO, NO, NO, NO, NO, NO],
            &[2.0, 2.0, 9.0, 7.0, 7.0, 7.0],
            &[2.0, 2.0, 9.0, 7.0, 7.0, 7.0],
        ]);
        assert_eq!(densify(&sparse), dense);
        let empty = map(&[&[NO, NO], &[NO, NO]]);
        assert_eq!(densify(&empty), empty);
        assert_eq!(densify(&map(&[&[NO, 4.0, NO]])), map(&[&[4.0, 4.0, 4.0]]));
    }

    proptest! {
        #[test]
        fn known_pixels_stay_and_rows_between_filled_ones_alone_stay_empty(
            width in 1usize..9,
            values in prop::collection::vec(prop_oneof![2 => Just(NO), 1 => 0.0f32..99.0], 9..80),
        ) {
            let height = values.len() / width;
            let sparse = Plane::from_vec(width, height, values[..width * height].to_vec()).unwrap();
            let dense = densify(&sparse);
            let mut pixels = sparse.pixels().zip(dense.pixels());
            let kept = pixels.all(|(d, filled)| !d.is_finite() || d == filled);
            prop_assert!(kept);
            let again: Vec<_> = densify(&dense).pixels().collect();
            prop_assert_eq!(again, dense.pixels().collect::<Vec<_>>());
            let full = |y: &usize| sparse.row(*y).iter().any(|d| d.is_finite());
            let (first, last) = ((0..height).find(full), (0..height).rev().find(full));
            for y in 0..height {
                let below = first.is_some_and(|first| y > first);
                let between = below && last.is_some_and(|last| y < last);
                let empty = first.is_none() || (between && !full(&y));
                prop_assert!(dense.row(y).iter().all(|d| d.is_finite() != empty), "row {}", y);
            }
        }
    }
}
