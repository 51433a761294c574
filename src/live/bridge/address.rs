//! `foxglove:ws://HOST:PORT[/LEFT,RIGHT]`: a bridge, and names of topics.

use std::fmt;
use std::str::FromStr;
use svl_core::{Error, Result};

/// A bridge, and topics that it has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BridgeAddress {
    /// The user's text.
    text: String,
    /// `HOST:PORT`.
    pub(super) host: String,
    pub topics: Vec<String>,
}

/// The port that foxglove_bridge has by default.
const PORT: u16 = 8765;

impl FromStr for BridgeAddress {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = |reason: &str| {
            let expected = "expected foxglove:ws://HOST:PORT, or with /LEFT,/RIGHT after it";
            Error::Usage(format!("{text}: {reason}; {expected}"))
        };
        let url = text.strip_prefix("foxglove:").unwrap_or(text);
        let Some(rest) = url.strip_prefix("ws://") else {
            return Err(wrong("only ws:// is spoken"));
        };
        let end = rest.find('/').unwrap_or(rest.len());
        let (host, topics) = rest.split_at(end);
        if host.is_empty() {
            return Err(wrong("names no host"));
        }
        let topics = topics.split(',').filter(|topic| !["", "/"].contains(topic));
        let topics: Vec<_> = topics.map(str::to_owned).collect();
        if let Some(topic) = topics.iter().find(|topic| !topic.starts_with('/')) {
            return Err(wrong(&format!("'{topic}' is no topic")));
        }
        // The brackets are those of an IPv6 address.
        let has_port = host.rsplit(']').next().is_some_and(|end| end.contains(':'));
        Ok(Self {
            text: text.to_owned(),
            host: match has_port {
                true => host.to_owned(),
                false => format!("{host}:{PORT}"),
            },
            topics,
        })
    }
}

impl fmt::Display for BridgeAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_port_and_topics() {
        for (text, host, topics) in [
            ("foxglove:ws://robot", "robot:8765", &[][..]),
            ("foxglove:ws://robot:9000/", "robot:9000", &[]),
            ("foxglove:ws://[::1]", "[::1]:8765", &[]),
            ("foxglove:ws://[::1]:1", "[::1]:1", &[]),
            (
                "foxglove:ws://10.0.0.2:1/a/b,/c",
                "10.0.0.2:1",
                &["/a/b", "/c"],
            ),
        ] {
            let read: BridgeAddress = text.parse().unwrap();
            assert_eq!(read.host, host);
            assert_eq!(read.topics, topics);
        }
        for (text, named) in [
            ("foxglove:wss://robot", "only ws://"),
            ("foxglove:robot:8765", "only ws://"),
            ("foxglove:ws:///a,/b", "no host"),
            ("foxglove:ws://robot/a,b", "'b'"),
        ] {
            let error = text.parse::<BridgeAddress>().unwrap_err();
            assert!(matches!(error, Error::Usage(_)), "{error}");
            assert!(error.to_string().contains(named), "{error}");
        }
    }
}
