//! Messages that DDS neither decodes nor encodes: CDR with its encapsulation header.

use rustdds::RepresentationIdentifier;
use rustdds::bytes::Bytes;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};
use std::convert::Infallible;
use svl_recording::CDR_LE;

/// Hands over messages as they are. Those in another representation are errors of DDS.
pub(super) struct RawCdr;

#[derive(Clone)]
pub(super) struct RawDecoder;

impl DeserializerAdapter<Vec<u8>> for RawCdr {
    type Error = Infallible;
    type Decoded = Vec<u8>;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE]
    }

    fn transform_decoded(decoded: Vec<u8>) -> Vec<u8> {
        decoded
    }
}

impl DefaultDecoder<Vec<u8>> for RawCdr {
    type Decoder = RawDecoder;
    const DECODER: RawDecoder = RawDecoder;
}

impl Decode<'_, Vec<u8>> for RawDecoder {
    type Error = Infallible;

    fn decode_bytes(
        self,
        bytes: &[u8],
        _: RepresentationIdentifier,
    ) -> Result<Vec<u8>, Infallible> {
        Ok([&CDR_LE, bytes].concat())
    }
}

impl SerializerAdapter<Bytes> for RawCdr {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(body: &Bytes) -> Result<Bytes, Infallible> {
        Ok(body.clone())
    }
}

/// The message without its header, which DDS writes itself.
pub(super) fn body(message: Vec<u8>) -> Bytes {
    let mut body = Bytes::from(message);
    body.split_off(CDR_LE.len().min(body.len()))
}
