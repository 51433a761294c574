//! The picture in pixels.

use super::geometry::{Mark, Rect};
use crate::error::{Error, Result};
use crate::stereo::Gray;
use image::{GrayImage, ImageBuffer, PixelWithColorType, Rgb, RgbImage, imageops};
use std::io::Cursor;

/// The picture is this many times as large as the image, so that lines are thin and small squares visible.
const SCALE: u32 = 2;

const RED: Rgb<u8> = Rgb([230, 30, 30]);
const YELLOW: Rgb<u8> = Rgb([255, 214, 10]);
const VIOLET: Rgb<u8> = Rgb([190, 90, 255]);
const GRID: Rgb<u8> = Rgb([255, 255, 255]);

/// The marks on the left image, twice its size.
pub fn draw(left: &Gray, marks: &[Mark]) -> RgbImage {
    let gray = to_image(left);
    let (width, height) = (gray.width() * SCALE, gray.height() * SCALE);
    let gray = imageops::resize(&gray, width, height, imageops::FilterType::Triangle);
    let mut picture = RgbImage::from_fn(width, height, |x, y| Rgb([gray.get_pixel(x, y).0[0]; 3]));
    for mark in marks {
        outline(&mut picture, mark.cell, GRID, 0.25);
        match mark.squares {
            Some(squares) => {
                fill(&mut picture, squares.median, RED, 0.5);
                outline(&mut picture, squares.p80, VIOLET, 1.0);
                outline(&mut picture, squares.p20, YELLOW, 1.0);
            }
            None => dot(&mut picture, mark.cell),
        }
    }
    picture
}

/// An image as a PNG file.
///
/// # Errors
/// [`Error::Invalid`] with the encoder's reason.
pub fn png<P>(image: &ImageBuffer<P, Vec<u8>>) -> Result<Vec<u8>>
where
    P: PixelWithColorType<Subpixel = u8>,
{
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).map_err(|e| Error::Invalid(format!("PNG: {e}")))?;
    Ok(bytes.into_inner())
}

/// A grey image as a PNG file.
///
/// # Errors
/// As [`png`].
pub fn gray_png(image: &Gray) -> Result<Vec<u8>> {
    png(&to_image(image))
}

fn to_image(plane: &Gray) -> GrayImage {
    // A plane's sides are at most `MAX_SIDE`, which fits.
    GrayImage::from_fn(plane.width() as u32, plane.height() as u32, |x, y| {
        image::Luma([plane.get(x as usize, y as usize)])
    })
}

/// The picture's pixels whose centres lie in `rect`: x range, y range.
fn pixels(picture: &RgbImage, rect: Rect) -> (std::ops::Range<u32>, std::ops::Range<u32>) {
    let pixel = |edge: f64, end: u32| ((edge * f64::from(SCALE)).round().max(0.0) as u32).min(end);
    let x = pixel(rect.x, picture.width())..pixel(rect.x + rect.width, picture.width());
    let y = pixel(rect.y, picture.height())..pixel(rect.y + rect.height, picture.height());
    (x, y)
}

fn blend(picture: &mut RgbImage, x: u32, y: u32, colour: Rgb<u8>, opacity: f32) {
    let pixel = picture.get_pixel_mut(x, y);
    for (below, above) in pixel.0.iter_mut().zip(colour.0) {
        *below = (f32::from(*below) + opacity * (f32::from(above) - f32::from(*below))).round() as u8;
    }
}

fn fill(picture: &mut RgbImage, rect: Rect, colour: Rgb<u8>, opacity: f32) {
    let (columns, rows) = pixels(picture, rect);
    rows.for_each(|y| columns.clone().for_each(|x| blend(picture, x, y, colour, opacity)));
}

/// A line one pixel wide along the inner edge of `rect`.
fn outline(picture: &mut RgbImage, rect: Rect, colour: Rgb<u8>, opacity: f32) {
    let (columns, rows) = pixels(picture, rect);
    for y in rows.clone() {
        for x in columns.clone() {
            let edge = |at: u32, range: &std::ops::Range<u32>| at == range.start || at + 1 == range.end;
            if edge(x, &columns) || edge(y, &rows) {
                blend(picture, x, y, colour, opacity);
            }
        }
    }
}

/// The dot of a cell of which nothing is known, a sixteenth of the cell in radius.
fn dot(picture: &mut RgbImage, cell: Rect) {
    let (cx, cy) = cell.center();
    let radius = cell.width.min(cell.height) / 16.0;
    let (columns, rows) = pixels(picture, cell);
    for y in rows {
        for x in columns.clone() {
            let [dx, dy] = [(x, cx), (y, cy)].map(|(at, c)| (f64::from(at) + 0.5) / f64::from(SCALE) - c);
            if dx.hypot(dy) <= radius {
                blend(picture, x, y, RED, 1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::geometry::Squares;
    use super::*;

    #[test]
    fn marks_fall_on_their_pixels() {
        let left = Gray::filled(32, 16, 100).unwrap();
        let cell = |x| Rect { x, y: 0.0, width: 16.0, height: 16.0 };
        let squares =
            Squares { median: cell(0.0).scaled(0.5), p20: cell(0.0).scaled(0.25), p80: cell(0.0).scaled(0.75) };
        let marks = [
            Mark { column: 0, row: 0, cell: cell(0.0), squares: Some(squares) },
            Mark { column: 1, row: 0, cell: cell(16.0), squares: None },
        ];
        let picture = draw(&left, &marks);
        assert_eq!(picture.dimensions(), (64, 32));
        let at = |x, y| *picture.get_pixel(x, y);
        assert_eq!(at(12, 12), YELLOW);
        assert_eq!(at(4, 16), VIOLET);
        assert_eq!(at(8, 16), Rgb([165, 65, 65]));
        assert_eq!(at(7, 16), Rgb([100; 3]));
        assert_eq!(at(48, 16), RED);
        assert_eq!(at(48, 20), Rgb([100; 3]));
    }

    #[test]
    fn a_png_holds_the_pixels() {
        let left = Gray::from_fn(5, 3, |x, y| (x * 10 + y) as u8).unwrap();
        let back = image::load_from_memory(&gray_png(&left).unwrap()).unwrap().to_luma8();
        assert_eq!(back.into_raw(), left.pixels().collect::<Vec<_>>());
    }
}
