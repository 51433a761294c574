//! The pictures of a Matroska stream of raw video, as ffmpeg writes it to a pipe (RFC 9559).

use std::io::{self, Read};

/// Elements that contain others: the segment, a cluster, the tracks, one of them, its video, a
/// group of blocks.
const CONTAINERS: [u64; 6] = [0x1853_8067, 0x1F43_B675, 0x1654_AE6B, 0xAE, 0xE0, 0xA0];
const WIDTH: u64 = 0xB0;
const HEIGHT: u64 = 0xBA;
const CLUSTER_TIME: u64 = 0xE7;
const BLOCK: u64 = 0xA1;
const SIMPLE_BLOCK: u64 = 0xA3;

/// Bytes of a block before its picture: track, time and flags.
const BLOCK_HEAD: u64 = 4;

/// Reads a stream from its beginning.
pub(crate) struct RawPictures<R> {
    input: R,
    pub(crate) size: (u64, u64),
    cluster_time: i64,
}

impl<R: Read> RawPictures<R> {
    pub(crate) fn new(input: R) -> Self {
        Self {
            input,
            size: (0, 0),
            cluster_time: 0,
        }
    }

    /// The time and the bytes of the next picture; `None` at the end.
    ///
    /// # Errors
    /// That of the input; a picture larger than `limit` bytes.
    pub(crate) fn next(&mut self, limit: u64) -> io::Result<Option<(i64, Vec<u8>)>> {
        loop {
            let Some(id) = self.number(false)? else {
                return Ok(None);
            };
            let size = self.number(true)?.ok_or(io::ErrorKind::UnexpectedEof)?;
            match id {
                _ if CONTAINERS.contains(&id) => {}
                WIDTH => self.size.0 = self.unsigned(size)?,
                HEIGHT => self.size.1 = self.unsigned(size)?,
                CLUSTER_TIME => self.cluster_time = self.unsigned(size)?.cast_signed(),
                BLOCK | SIMPLE_BLOCK => {
                    let [_track, high, low, _flags] = self.array()?;
                    let time = i64::from(i16::from_be_bytes([high, low]));
                    let bytes = size.saturating_sub(BLOCK_HEAD);
                    if bytes > limit {
                        return Err(io::ErrorKind::InvalidData.into());
                    }
                    let mut picture = Vec::new();
                    let read = (&mut self.input).take(bytes).read_to_end(&mut picture)?;
                    if read as u64 != bytes {
                        return Err(io::ErrorKind::UnexpectedEof.into());
                    }
                    return Ok(Some((self.cluster_time.saturating_add(time), picture)));
                }
                _ => {
                    io::copy(&mut (&mut self.input).take(size), &mut io::sink())?;
                }
            }
        }
    }

    fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.input.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    fn unsigned(&mut self, bytes: u64) -> io::Result<u64> {
        (0..bytes.min(8)).try_fold(0, |number, _| {
            let [byte] = self.array()?;
            Ok(number << 8 | u64::from(byte))
        })
    }

    /// A number whose first byte tells its length by its zeros: a size, or with the marking bit an
    /// identifier. `None` at the end.
    fn number(&mut self, is_size: bool) -> io::Result<Option<u64>> {
        let mut first = [0];
        let read = loop {
            match self.input.read(&mut first) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                read => break read?,
            }
        };
        if read == 0 {
            return Ok(None);
        }
        let length = first[0].leading_zeros().min(7);
        let kept = if is_size { 0x7F >> length } else { 0xFF };
        (0..length)
            .try_fold(u64::from(first[0] & kept), |number, _| {
                let [byte] = self.array()?;
                Ok(number << 8 | u64::from(byte))
            })
            .map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::RawPictures;

    /// An unknown element, the tracks, and a cluster at 300 with two pictures of two bytes.
    const STREAM: [&[u8]; 6] = [
        &[0xEC, 0x82, 1, 2],
        &[
            0x18, 0x53, 0x80, 0x67, 0x01, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF,
        ],
        &[
            0x16, 0x54, 0xAE, 0x6B, 0x8B, 0xAE, 0x89, 0xE0, 0x87, 0xB0, 0x82, 1, 0x40, 0xBA, 0x81,
            2,
        ],
        &[0x1F, 0x43, 0xB6, 0x75, 0x94, 0xE7, 0x82, 1, 0x2C],
        &[0xA3, 0x86, 0x81, 0, 5, 0x80, 7, 8],
        &[0xA0, 0x88, 0xA1, 0x86, 0x81, 0xFF, 0xFE, 0, 9, 10],
    ];

    #[test]
    fn pictures_have_the_times_of_cluster_and_block() {
        let bytes = STREAM.concat();
        let mut pictures = RawPictures::new(&bytes[..]);
        assert_eq!(pictures.next(9).unwrap(), Some((305, vec![7, 8])));
        assert_eq!(pictures.size, (320, 2));
        assert_eq!(pictures.next(9).unwrap(), Some((298, vec![9, 10])));
        assert_eq!(pictures.next(9).unwrap(), None);
        // A picture that is larger than the limit, and one that is cut.
        assert!(RawPictures::new(&bytes[..]).next(1).is_err());
        assert!(
            RawPictures::new(&bytes[..bytes.len() - 11])
                .next(9)
                .is_err()
        );
    }
}
