//! RVL, a lossless code for 16-bit depth images: Wilson, "Fast Lossless Depth Image Compression",
//! 2017, with the header of ROS 2's `compressed_depth_image_transport`, as read by Rerun. Maps are
//! as small as in a PNG of medium compression, in a fifth of the time.

use svl_core::stereo::Plane;

/// Conversion of a code c to a depth if the code is not the depth: `a / (c − b)`, ROS's form for
/// inverse depths. Then 0 is invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseDepth {
    pub a: f32,
    pub b: f32,
}

/// The codes as an RVL file. 0 is invalid.
pub fn encode_rvl(codes: &Plane<u16>, inverse: Option<InverseDepth>) -> Vec<u8> {
    let InverseDepth { a, b } = inverse.unwrap_or(InverseDepth { a: 0.0, b: 0.0 });
    let mut file = Vec::with_capacity(codes.width() * codes.height() / 2);
    // The format's number, which readers ignore, the two parameters, and the size.
    file.extend_from_slice(&0i32.to_le_bytes());
    file.extend([a, b].into_iter().flat_map(f32::to_le_bytes));
    let size = [codes.width(), codes.height()];
    // Sides are at most MAX_SIDE.
    file.extend(
        size.into_iter()
            .flat_map(|side| (side as u32).to_le_bytes()),
    );
    let pixels: Vec<u16> = codes.rows().flatten().copied().collect();
    let mut nibbles = Nibbles {
        file,
        word: 0,
        count: 0,
    };
    let (mut left, mut last) = (&pixels[..], 0);
    while !left.is_empty() {
        // A run of zeros, a run of non-zeros, each preceded by its length.
        let length = |is_zero: bool, of: &[u16]| {
            let end = of.iter().position(|&code| (code == 0) != is_zero);
            end.unwrap_or(of.len())
        };
        let zeros = length(true, left);
        let others = length(false, &left[zeros..]);
        nibbles.push(zeros as u32);
        nibbles.push(others as u32);
        for &code in &left[zeros..zeros + others] {
            let difference = i32::from(code) - last;
            // Zigzag: 0, −1, 1, −2, … become 0, 1, 2, 3, …
            nibbles.push((difference << 1 ^ difference >> 31) as u32);
            last = code.into();
        }
        left = &left[zeros + others..];
    }
    nibbles.finish()
}

/// Numbers in groups of three bits, each with a bit that tells if another follows; eight groups
/// make a word, the first in its highest bits.
struct Nibbles {
    file: Vec<u8>,
    word: u32,
    count: u8,
}

impl Nibbles {
    fn push(&mut self, mut number: u32) {
        loop {
            let more = number >> 3;
            self.word = self.word << 4 | number & 7 | u32::from(more > 0) << 3;
            self.count += 1;
            if self.count == 8 {
                self.file.extend_from_slice(&self.word.to_le_bytes());
                (self.word, self.count) = (0, 0);
            }
            if more == 0 {
                break;
            }
            number = more;
        }
    }

    fn finish(mut self) -> Vec<u8> {
        if self.count > 0 {
            let word = self.word << (4 * (8 - self.count));
            self.file.extend_from_slice(&word.to_le_bytes());
        }
        self.file
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use re_rvl::{RosRvlMetadata, decode_rvl_with_quantization};

    /// Decoded by Rerun's decoder.
    fn decoded(file: &[u8]) -> ((u32, u32), Vec<f32>) {
        let head = RosRvlMetadata::parse(file).unwrap();
        let depths = decode_rvl_with_quantization(file, &head).unwrap();
        ((head.width, head.height), depths)
    }

    #[test]
    fn the_viewer_s_decoder_reads_what_was_written() {
        let mut random = fastrand::Rng::with_seed(1);
        for (width, height) in [(1, 1), (7, 5), (320, 24)] {
            for holes in [0, 50, 100] {
                let mut code = || {
                    if random.u8(0..100) < holes {
                        0
                    } else {
                        random.u16(..) >> random.u8(0..16)
                    }
                };
                let codes: Vec<u16> = (0..width * height).map(|_| code()).collect();
                let plane = Plane::from_vec(width, height, codes.clone()).unwrap();
                let (size, values) = decoded(&encode_rvl(&plane, None));
                assert_eq!(size, (width as u32, height as u32));
                assert!(values.into_iter().eq(codes.into_iter().map(f32::from)));
            }
        }
    }

    #[test]
    fn codes_of_disparities_become_depths_and_none_no_number() {
        let plane = Plane::from_vec(3, 1, vec![0, 16, 160]).unwrap();
        let inverse = InverseDepth { a: 32.0, b: -16.0 };
        let (_, depths) = decoded(&encode_rvl(&plane, Some(inverse)));
        assert!(depths[0].is_nan());
        assert_eq!(depths[1..], [1.0, 32.0 / 176.0]);
    }
}
