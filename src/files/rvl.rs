//! RVL, a lossless code for 16-bit depth images: Wilson, "Fast Lossless Depth Image Compression",
//! 2017, with the header of ROS 2's `compressed_depth_image_transport`, as read by Rerun. Maps are
//! as small as in a PNG of medium compression, in a fifth of the time.

use super::MapFault;
use svl_core::stereo::Plane;

/// Bytes before the size: a number, and the two of [`InverseDepth`].
pub const RVL_HEADER: usize = 12;

/// Conversion of a code c to a depth if the code is not the depth: `a / (c − b)`, ROS's form for
/// inverse depths. Then 0 is invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseDepth {
    pub a: f32,
    pub b: f32,
}

impl InverseDepth {
    /// From the header of a file.
    pub fn from_header(header: &[u8]) -> Self {
        let number = |at: usize| {
            let bytes = header.get(at..).and_then(<[u8]>::first_chunk);
            bytes.copied().map_or(f32::NAN, f32::from_le_bytes)
        };
        Self {
            a: number(4),
            b: number(8),
        }
    }

    /// The depth of a code, NaN for 0.
    pub fn depth(self, code: u16) -> f32 {
        if code == 0 {
            f32::NAN
        } else {
            self.a / (f32::from(code) - self.b)
        }
    }
}

/// Limit on the pixels of an image: a few bytes can be a run of zeros of any length.
const MAX_PIXELS: usize = 1 << 26;

/// The codes of an RVL file behind its first [`RVL_HEADER`] bytes. 0 is invalid.
///
/// # Errors
/// The reason why it cannot be read.
pub fn decode_rvl(file: &[u8]) -> Result<Plane<u16>, MapFault> {
    let [width, height, words @ ..] = file.as_chunks::<4>().0 else {
        return Err(MapFault::Malformed("it ends before its size"));
    };
    let [width, height] = [width, height].map(|side| u32::from_le_bytes(*side) as usize);
    let pixels = width.saturating_mul(height);
    if pixels > MAX_PIXELS {
        return Err(MapFault::Large(width, height, MAX_PIXELS));
    }
    let words = words.iter().map(|word| u32::from_le_bytes(*word));
    // The first nibble is in the highest bits.
    let mut nibbles = words.flat_map(|word| (0..8).map(move |i| word >> (28 - 4 * i) & 15));
    let mut number = || {
        let mut number = 0_u32;
        // Eleven groups of three bits hold the largest number.
        for shift in (0..33).step_by(3) {
            let end = MapFault::Malformed("it ends before its last pixel");
            let nibble = nibbles.next().ok_or(end)?;
            number |= (nibble & 7) << shift;
            if nibble & 8 == 0 {
                return Ok(number);
            }
        }
        Err(MapFault::Malformed("a number is longer than 32 bits"))
    };
    let (mut codes, mut last) = (Vec::with_capacity(pixels), 0_u16);
    while codes.len() < pixels {
        let (zeros, others) = (number()? as usize, number()? as usize);
        let left = pixels - codes.len();
        if zeros.saturating_add(others) > left {
            return Err(MapFault::Run(zeros, others, left));
        }
        codes.resize(codes.len() + zeros, 0);
        for _ in 0..others {
            let zigzag = number()?;
            // Wrapping, as ROS computes with signed numbers of 16 bits.
            last = last.wrapping_add((zigzag >> 1) as u16 ^ (zigzag as u16 & 1).wrapping_neg());
            codes.push(last);
        }
    }
    if nibbles.any(|nibble| nibble > 0) {
        return Err(MapFault::Surplus(width, height));
    }
    Ok(Plane::from_vec(width, height, codes)?)
}

/// The codes as an RVL file. 0 is invalid.
pub fn encode_rvl(codes: &Plane<u16>, inverse: Option<InverseDepth>) -> Vec<u8> {
    let InverseDepth { a, b } = inverse.unwrap_or(InverseDepth { a: 0.0, b: 0.0 });
    let mut file = Vec::with_capacity(codes.width() * codes.height() / 2);
    // The header: the format's number, which readers ignore, and the two parameters. Then the size.
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
        let length = |is_zero: bool, codes: &[u16]| {
            let end = codes.iter().position(|&code| (code == 0) != is_zero);
            end.unwrap_or(codes.len())
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

    /// Images with runs, holes and steps of any size.
    fn images() -> impl Iterator<Item = Plane<u16>> {
        let mut random = fastrand::Rng::with_seed(1);
        let sizes = [(1, 1), (7, 5), (320, 24)].into_iter();
        let kinds = sizes.flat_map(|size| [0, 50, 100].map(|holes| (size, holes)));
        kinds.map(move |((width, height), holes)| {
            let mut code = || {
                if random.u8(0..100) < holes {
                    0
                } else {
                    random.u16(..) >> random.u8(0..16)
                }
            };
            let codes = (0..width * height).map(|_| code()).collect();
            Plane::from_vec(width, height, codes).unwrap()
        })
    }

    #[test]
    fn the_viewer_s_decoder_and_svl_s_read_what_was_written() {
        for plane in images() {
            let file = encode_rvl(&plane, None);
            let (size, values) = decoded(&file);
            assert_eq!(size, (plane.width() as u32, plane.height() as u32));
            assert!(values.into_iter().eq(plane.pixels().map(f32::from)));
            assert_eq!(decode_rvl(&file[RVL_HEADER..]).unwrap(), plane);
        }
    }

    #[test]
    fn every_cut_and_every_size_that_lies_is_an_error() {
        for plane in images() {
            let file = encode_rvl(&plane, None).split_off(RVL_HEADER);
            for length in (0..file.len()).step_by(file.len() / 50 + 1) {
                let cut = decode_rvl(&file[..length]).unwrap_err().to_string();
                assert!(cut.contains("ends before"), "{length}: {cut}");
            }
            let sized = |width: u32, height: u32| {
                let size = [width, height].map(u32::to_le_bytes).concat();
                decode_rvl(&[&size, &file[8..]].concat())
            };
            let (width, height) = (plane.width() as u32, plane.height() as u32);
            assert!(sized(width, height + 1).is_err());
            assert!(sized(width, height - 1).is_err());
            let huge = sized(u32::MAX, u32::MAX).unwrap_err().to_string();
            assert!(huge.contains("at most 67108864 pixels"), "{huge}");
            assert!(sized(0, 0).is_err());
        }
        // Numbers without an end, and runs of nothing.
        let words = |nibbles: u8| {
            let read = decode_rvl(&[&[9, 0, 0, 0, 9, 0, 0, 0], &[nibbles; 8][..]].concat());
            read.unwrap_err().to_string()
        };
        assert!(words(0xFF).contains("longer than 32 bits"));
        assert!(words(0x00).contains("ends before"));
        assert!(words(0x77).contains("ends before"));
    }

    #[test]
    fn codes_of_disparities_become_depths_and_none_no_number() {
        let plane = Plane::from_vec(3, 1, vec![0, 16, 160]).unwrap();
        let inverse = InverseDepth { a: 32.0, b: -16.0 };
        let (_, depths) = decoded(&encode_rvl(&plane, Some(inverse)));
        assert!(depths[0].is_nan() && inverse.depth(0).is_nan());
        assert_eq!(depths[1..], [1.0, 32.0 / 176.0]);
        assert_eq!(depths[1..], [16, 160].map(|code| inverse.depth(code)));
    }
}
