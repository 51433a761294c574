//! Files and messages that are compressed with zstd.

use std::io::Read as _;

/// First bytes of a zstd frame.
pub(crate) const ZSTD: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];

/// Limit on the size of an unpacked message, bytes.
const MAX_MESSAGE: u64 = 1 << 30;

/// The data of a message that rosbag2 compressed on its own; other data unchanged.
///
/// # Errors
/// The reason why they cannot be unpacked.
pub(crate) fn unpack_message(data: &[u8]) -> Result<Option<Vec<u8>>, String> {
    // No message encoding begins like this: CDR's first byte is 0.
    if !data.starts_with(&ZSTD) {
        return Ok(None);
    }
    let mut unpacked = Vec::new();
    let read = zstd::stream::read::Decoder::with_buffer(data)
        .and_then(|decoder| decoder.take(MAX_MESSAGE + 1).read_to_end(&mut unpacked));
    match read {
        Ok(length) if length as u64 > MAX_MESSAGE => {
            Err(format!("it unpacks to more than {MAX_MESSAGE} bytes"))
        }
        Ok(_) => Ok(Some(unpacked)),
        Err(e) => Err(format!(
            "it is compressed with zstd and cannot be unpacked: {e}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_unpacked_by_how_they_begin() {
        let data = [0, 1, 0, 0].repeat(100);
        assert_eq!(unpack_message(&data), Ok(None));
        let packed = zstd::bulk::compress(&data, 3).unwrap();
        assert_eq!(unpack_message(&packed), Ok(Some(data)));
        let cut = unpack_message(&packed[..packed.len() - 3]);
        assert!(cut.unwrap_err().contains("cannot be unpacked"));
    }
}
