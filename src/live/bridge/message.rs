//! Messages of a Foxglove bridge: JSON about its channels, and binary ones with their data.

use serde::Deserialize;

/// Limit on JSON: of a bridge with thousands of topics.
const MAX_TEXT: usize = 16 << 20;
/// First byte of a binary message with data of a channel.
const MESSAGE_DATA: u8 = 1;

/// JSON that svl uses.
#[derive(Debug, PartialEq, Eq)]
pub enum ServerMessage {
    /// New channels.
    Advertise(Vec<BridgeChannel>),
    /// Numbers of channels that are gone.
    Unadvertise(Vec<u64>),
    /// A warning or an error.
    Warning(String),
    /// Something else, as the bridge's name and its services.
    Other,
}

/// A topic of one type.
#[derive(Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct BridgeChannel {
    pub id: u64,
    pub topic: String,
    /// Encoding of its messages.
    pub encoding: String,
    /// Their type, as in a bag: `sensor_msgs/msg/Image`.
    pub schema_name: String,
}

#[derive(Deserialize)]
struct Operation {
    op: String,
}

#[derive(Deserialize)]
struct Advertise {
    channels: Vec<BridgeChannel>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Unadvertise {
    channel_ids: Vec<u64>,
}

#[derive(Deserialize)]
struct BridgeStatus {
    level: u8,
    message: String,
}

/// Reads a text message.
///
/// # Errors
/// The reason why it is not one of a bridge.
pub fn text(text: &str) -> Result<ServerMessage, String> {
    if text.len() > MAX_TEXT {
        return Err(format!("JSON of {} bytes, above {MAX_TEXT}", text.len()));
    }
    // The operation first: what svl does not use is not built.
    let Operation { op } = json(text)?;
    Ok(match op.as_str() {
        "advertise" => ServerMessage::Advertise(json::<Advertise>(text)?.channels),
        "unadvertise" => ServerMessage::Unadvertise(json::<Unadvertise>(text)?.channel_ids),
        "status" => match json::<BridgeStatus>(text)? {
            // Information.
            BridgeStatus { level: 0, .. } => ServerMessage::Other,
            BridgeStatus { message, .. } => ServerMessage::Warning(message),
        },
        _ => ServerMessage::Other,
    })
}

fn json<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|e| e.to_string())
}

/// Number of the subscription and message of a binary message; `None` for one of another kind.
pub fn data(bytes: &[u8]) -> Option<(u32, &[u8])> {
    // After the number the bridge's clock, 8 bytes.
    let (head, data) = bytes.split_first_chunk::<13>()?;
    let [MESSAGE_DATA, a, b, c, d, ..] = *head else {
        return None;
    };
    Some((u32::from_le_bytes([a, b, c, d]), data))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_has_a_number_and_a_clock_before_it() {
        let bytes = [&[1, 7, 1, 0, 0], &[9; 8][..], b"cdr"].concat();
        assert_eq!(data(&bytes), Some((263, &b"cdr"[..])));
        assert_eq!(data(&bytes[..13]), Some((263, &b""[..])));
        assert!((0..13).all(|end| data(&bytes[..end]).is_none()));
        assert_eq!(data(&[2; 20]), None, "the time");
    }

    #[test]
    fn messages_are_distinguished_by_opcode() {
        let channel = BridgeChannel {
            id: 1,
            topic: "/a".to_owned(),
            encoding: "cdr".to_owned(),
            schema_name: "sensor_msgs/msg/Image".to_owned(),
        };
        let advertise = r#"{"op":"advertise","channels":[{"id":1,"topic":"/a","encoding":"cdr",
            "schemaName":"sensor_msgs/msg/Image","schemaEncoding":"ros2msg","schema":""}]}"#;
        for (message, said) in [
            (advertise, ServerMessage::Advertise(vec![channel])),
            (
                r#"{"op":"unadvertise","channelIds":[1,2]}"#,
                ServerMessage::Unadvertise(vec![1, 2]),
            ),
            (
                r#"{"op":"status","level":0,"message":"x"}"#,
                ServerMessage::Other,
            ),
            (
                r#"{"op":"status","level":1,"message":"x"}"#,
                ServerMessage::Warning("x".to_owned()),
            ),
            // The same keys may mean something else there.
            (
                r#"{"op":"serverInfo","channels":"x"}"#,
                ServerMessage::Other,
            ),
        ] {
            assert_eq!(text(message), Ok(said));
        }
        for message in ["", "[]", "{}", r#"{"op":"advertise"}"#, r#"{"op":1}"#] {
            assert!(text(message).is_err(), "{message}");
        }
        assert!(text(&" ".repeat(MAX_TEXT + 1)).is_err());
    }
}
