//! The fields of a ROS message: ROS 2's in little-endian CDR, or ROS 1's, which are packed and only
//! read.

use crate::message::message_error::FieldError;
/// Reads the fields of one message in their order. Everything it returns is within the bytes.
pub(crate) struct MessageReader<'a> {
    data: &'a [u8],
    at: usize,
    /// True for ROS 2, whose types differ a little from those of ROS 1.
    pub(crate) is_cdr: bool,
}

pub(crate) type Parsed<T> = Result<T, FieldError>;

impl<'a> MessageReader<'a> {
    /// `data`: the body, without CDR's encapsulation header.
    pub(crate) fn new(data: &'a [u8], is_cdr: bool) -> Self {
        Self {
            data,
            at: 0,
            is_cdr,
        }
    }

    pub(crate) fn remaining(&self) -> usize {
        self.data.len() - self.at
    }

    fn take(&mut self, bytes: usize) -> Parsed<&'a [u8]> {
        let taken = self.data.get(self.at..).and_then(|rest| rest.get(..bytes));
        let taken = taken.ok_or(FieldError::Cut(bytes, self.at, self.remaining()))?;
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
            return Err(FieldError::Sequence(length, limit));
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
        Ok(std::str::from_utf8(text)?)
    }
}

/// Writes the fields of one message in CDR in their order.
pub(crate) struct CdrWriter {
    data: Vec<u8>,
}

impl CdrWriter {
    /// `capacity`: the length that is expected.
    pub(crate) fn with_capacity(capacity: usize) -> Self {
        let mut data = Vec::with_capacity(capacity);
        data.extend(CDR_LE);
        Self { data }
    }

    pub(crate) fn finish(self) -> Vec<u8> {
        self.data
    }

    /// CDR aligns a number to its size, from the start of the body.
    fn number<const N: usize>(&mut self, number: [u8; N]) {
        let body = self.data.len() - CDR_LE.len();
        let at = CDR_LE.len() + body.next_multiple_of(N);
        self.data.resize(at, 0);
        self.data.extend(number);
    }

    pub(crate) fn u8(&mut self, number: u8) {
        self.data.push(number);
    }

    pub(crate) fn u32(&mut self, number: u32) {
        self.number(number.to_le_bytes());
    }

    pub(crate) fn f32(&mut self, number: f32) {
        self.number(number.to_le_bytes());
    }

    pub(crate) fn f64(&mut self, number: f64) {
        self.number(number.to_le_bytes());
    }

    /// Length of a sequence, whose elements follow. Sequences of svl are far below 4 GB: sides of
    /// an image are at most `MAX_SIDE`.
    pub(crate) fn length(&mut self, length: usize) {
        self.u32(length as u32);
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        self.length(bytes.len());
        self.data.extend_from_slice(bytes);
    }

    pub(crate) fn str(&mut self, text: &str) {
        // A closing zero is counted.
        self.length(text.len() + 1);
        self.data.extend_from_slice(text.as_bytes());
        self.data.push(0);
    }
}

/// OMG encapsulation header of little-endian CDR, with which a message of ROS 2 begins.
pub const CDR_LE: [u8; 4] = [0, 1, 0, 0];

#[cfg(test)]
mod tests {
    use super::*;

    /// The fields with which all messages here begin.
    fn check_fields(reader: &mut MessageReader<'_>) {
        assert_eq!((reader.u8(), reader.str()), (Ok(7), Ok("ab")));
        assert_eq!(reader.f64(), Ok(1.5));
    }

    #[test]
    fn written_fields_are_read_back() {
        let mut writer = CdrWriter::with_capacity(0);
        writer.u8(7);
        writer.str("ab");
        writer.f64(1.5);
        writer.bytes(&[1, 2]);
        writer.f32(2.5);
        writer.u32(9);
        let data = writer.finish();
        assert_eq!(data.len(), CDR_LE.len() + 40);
        let mut reader = MessageReader::new(&data[CDR_LE.len()..], true);
        check_fields(&mut reader);
        assert_eq!((reader.bytes(), reader.f32()), (Ok(&[1, 2][..]), Ok(2.5)));
        assert_eq!(reader.u32(), Ok(9));
        assert_eq!(reader.remaining(), 0);
    }

    #[test]
    fn cdr_is_aligned_and_ros_1_is_packed() {
        let packed = [&[7][..], &2u32.to_le_bytes(), b"ab", &1.5f64.to_le_bytes()].concat();
        let mut reader = MessageReader::new(&packed, false);
        check_fields(&mut reader);
        assert!(reader.u8().is_err());
        let aligned = [&[7, 0, 0, 0][..], &3u32.to_le_bytes(), b"ab\0"];
        let aligned = [&aligned.concat()[..], &[0; 5], &1.5f64.to_le_bytes()].concat();
        check_fields(&mut MessageReader::new(&aligned, true));
        let mut cut = MessageReader::new(&aligned[..10], true);
        assert!(cut.u8().is_ok() && cut.str().unwrap_err().to_string().contains("bytes for 2"));
        assert!(MessageReader::new(&[0xFF; 4], false).bytes().is_err());
    }
}
