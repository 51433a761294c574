//! Files and messages that are compressed with zstd.

use std::io::Read as _;

/// First bytes of a zstd frame.
pub(crate) const ZSTD: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];

/// Limit on the size of an unpacked message, bytes.
const MAX_MESSAGE: u64 = 1 << 30;

/// Why a compressed message cannot be unpacked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UnpackError {
    #[error("it unpacks to more than {MAX_MESSAGE} bytes")]
    TooLarge,
    #[error("it is compressed with zstd and cannot be unpacked: {0}")]
    Zstd(#[from] std::io::Error),
}

/// The data of a message that rosbag2 compressed on its own; other data unchanged.
///
/// # Errors
/// The reason why they cannot be unpacked.
pub(crate) fn unpack_message(data: &[u8]) -> Result<Option<Vec<u8>>, UnpackError> {
    // No message encoding begins like this: CDR's first byte is 0.
    if !data.starts_with(&ZSTD) {
        return Ok(None);
    }
    let mut unpacked = Vec::new();
    let decoder = zstd::stream::read::Decoder::with_buffer(data)?;
    if decoder.take(MAX_MESSAGE + 1).read_to_end(&mut unpacked)? as u64 > MAX_MESSAGE {
        return Err(UnpackError::TooLarge);
    }
    Ok(Some(unpacked))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_unpacked_by_how_they_begin() {
        let data = [0, 1, 0, 0].repeat(100);
        assert_eq!(unpack_message(&data).unwrap(), None);
        let packed = zstd::bulk::compress(&data, 3).unwrap();
        assert_eq!(unpack_message(&packed).unwrap(), Some(data));
        let cut = unpack_message(&packed[..packed.len() - 3]);
        assert!(cut.unwrap_err().to_string().contains("cannot be unpacked"));
    }
}
