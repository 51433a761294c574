//! Messages of a Foxglove bridge: text, and binary ones. Any bytes are tried as both.
#![no_main]

use svl::bridge::message::{self, ServerMessage};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Some((_, data)) = message::data(bytes) {
        assert!(data.len() + 13 == bytes.len() && bytes[0] == 1);
    }
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    match message::text(text) {
        Err(reason) => assert!(
            !reason.is_empty() && reason.lines().count() == 1,
            "{reason}"
        ),
        Ok(ServerMessage::Advertise(channels)) => assert!(channels.len() * 40 <= text.len()),
        Ok(ServerMessage::Unadvertise(gone)) => assert!(gone.len() <= text.len()),
        Ok(ServerMessage::Warning(words)) => assert!(words.len() <= text.len()),
        Ok(ServerMessage::Other) => {}
    }
});
