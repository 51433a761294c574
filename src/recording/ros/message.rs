//! The fields of a ROS message: ROS 2's in little-endian CDR, or ROS 1's, which are packed.

/// Reads the fields of one message in their order. Everything it returns is within the bytes.
pub(crate) struct MessageReader<'a> {
    data: &'a [u8],
    at: usize,
    is_cdr: bool,
}

pub(super) type Parsed<T> = Result<T, String>;

impl<'a> MessageReader<'a> {
    /// `data`: the body, without CDR's encapsulation header.
    pub(super) fn new(data: &'a [u8], is_cdr: bool) -> Self {
        Self {
            data,
            at: 0,
            is_cdr,
        }
    }

    /// True for ROS 2, whose types differ a little from those of ROS 1.
    pub(super) fn is_cdr(&self) -> bool {
        self.is_cdr
    }

    pub(crate) fn remaining(&self) -> usize {
        self.data.len() - self.at
    }

    fn take(&mut self, bytes: usize) -> Parsed<&'a [u8]> {
        let taken = self.data.get(self.at..).and_then(|rest| rest.get(..bytes));
        let taken = taken.ok_or_else(|| {
            let (left, at) = (self.remaining(), self.at);
            format!("{bytes} bytes expected at byte {at}, there are {left}")
        })?;
        self.at += bytes;
        Ok(taken)
    }

    /// A number of `N` bytes. CDR aligns it to its size, from the start of the body.
    fn number<const N: usize>(&mut self) -> Parsed<[u8; N]> {
        if self.is_cdr {
            self.at = self.at.next_multiple_of(N).min(self.data.len());
        }
        let bytes = self.take(N)?;
        Ok(bytes.try_into().unwrap_or([0; N]))
    }

    pub(crate) fn u8(&mut self) -> Parsed<u8> {
        self.number().map(u8::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Parsed<u32> {
        self.number().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Parsed<u64> {
        self.number().map(u64::from_le_bytes)
    }

    pub(crate) fn f32(&mut self) -> Parsed<f32> {
        self.number().map(f32::from_le_bytes)
    }

    pub(crate) fn f64(&mut self) -> Parsed<f64> {
        self.number().map(f64::from_le_bytes)
    }

    /// Length of a sequence of elements of at least `size` bytes, which the rest can hold.
    pub(crate) fn length(&mut self, size: usize) -> Parsed<usize> {
        let length = self.u32()? as usize;
        let limit = self.remaining() / size;
        if length > limit {
            return Err(format!(
                "a sequence of {length} elements, there are bytes for {limit}"
            ));
        }
        Ok(length)
    }

    pub(crate) fn bytes(&mut self) -> Parsed<&'a [u8]> {
        let length = self.length(1)?;
        self.take(length)
    }

    pub(crate) fn str(&mut self) -> Parsed<&'a str> {
        let bytes = self.bytes()?;
        // CDR counts a closing zero.
        let text = if self.is_cdr {
            bytes.strip_suffix(&[0]).unwrap_or(bytes)
        } else {
            bytes
        };
        std::str::from_utf8(text).map_err(|_| "a text is not UTF-8".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cdr_is_aligned_and_ros_1_is_packed() {
        let packed = [&[7][..], &2u32.to_le_bytes(), b"ab", &1.5f64.to_le_bytes()].concat();
        let mut reader = MessageReader::new(&packed, false);
        assert_eq!(
            (reader.u8(), reader.str(), reader.f64()),
            (Ok(7), Ok("ab"), Ok(1.5))
        );
        assert!(reader.u8().is_err());
        let aligned = [&[7, 0, 0, 0][..], &3u32.to_le_bytes(), b"ab\0"];
        let aligned = [&aligned.concat()[..], &[0; 5], &1.5f64.to_le_bytes()].concat();
        let mut reader = MessageReader::new(&aligned, true);
        assert_eq!(
            (reader.u8(), reader.str(), reader.f64()),
            (Ok(7), Ok("ab"), Ok(1.5))
        );
        let mut cut = MessageReader::new(&aligned[..10], true);
        assert!(cut.u8().is_ok() && cut.str().unwrap_err().contains("bytes for 2"));
        assert!(MessageReader::new(&[0xFF; 4], false).bytes().is_err());
    }
}
