//! Bits and Exp-Golomb numbers in the headers of H.264 and H.265 (H.264, 7.2 and 9.1).

/// Longest header that is read.
const MAX_BYTES: usize = 4096;

/// Reads bits, the highest first. `None` after the last.
pub(crate) struct BitReader {
    bytes: Vec<u8>,
    /// Index of the next bit.
    at: usize,
}

impl BitReader {
    /// The payload of a NAL unit, without the bytes that keep start codes out of it.
    pub(crate) fn new(payload: &[u8]) -> Self {
        let mut zeros = 0;
        let payload = payload.iter().take(MAX_BYTES).copied();
        let bytes = payload.filter(|byte| {
            let is_data = *byte != 3 || zeros < 2;
            zeros = if *byte == 0 { zeros + 1 } else { 0 };
            is_data
        });
        Self {
            bytes: bytes.collect(),
            at: 0,
        }
    }

    pub(crate) fn flag(&mut self) -> Option<bool> {
        let byte = self.bytes.get(self.at / 8)?;
        let bit = byte >> (7 - self.at % 8) & 1;
        self.at += 1;
        Some(bit == 1)
    }

    /// A number of so many bits: the last 32 of more.
    pub(crate) fn bits(&mut self, count: u32) -> Option<u32> {
        (0..count).try_fold(0, |number, _| Some(number << 1 | u32::from(self.flag()?)))
    }

    /// An unsigned Exp-Golomb number.
    pub(crate) fn golomb(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while !self.flag()? {
            zeros += 1;
            if zeros > 31 {
                return None;
            }
        }
        Some((1 << zeros) - 1 + self.bits(zeros)?)
    }

    /// A signed Exp-Golomb number.
    pub(crate) fn signed(&mut self) -> Option<i64> {
        let number = i64::from(self.golomb()?);
        let half = number / 2;
        Some(if number % 2 == 1 { half + 1 } else { -half })
    }

    /// Reads Exp-Golomb numbers that svl does not use.
    pub(crate) fn skip_golombs(&mut self, count: usize) -> Option<()> {
        (0..count).try_for_each(|_| self.golomb().map(drop))
    }
}

#[cfg(test)]
mod tests {
    use super::BitReader;

    #[test]
    fn numbers_are_read_bit_by_bit_and_end() {
        // 1, 010, 011, 00100, 00101: 0 to 4, then three bits of ones.
        let mut reader = BitReader::new(&[0b1010_0110, 0b0100_0010, 0b1111_0000]);
        let golombs: Vec<_> = (0..5).map(|_| reader.golomb()).collect();
        assert_eq!(golombs, [0, 1, 2, 3, 4].map(Some));
        assert_eq!((reader.bits(3), reader.golomb()), (Some(7), None));
        assert_eq!(BitReader::new(&[0b0010_1000]).signed(), Some(-2));
        assert_eq!(BitReader::new(&[0; 9]).golomb(), None);
        // 3 after two zeros keeps start codes out; the next 3 is data.
        let mut reader = BitReader::new(&[0, 0, 3, 3, 0, 0, 3, 0, 0, 3, 1]);
        assert_eq!(reader.bits(32), Some(0x0000_0300));
        assert_eq!((reader.bits(32), reader.flag()), (Some(1), None));
    }
}
