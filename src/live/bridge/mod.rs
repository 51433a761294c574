//! ROS 2 topics through a Foxglove bridge, where DDS does not reach: a client of its WebSocket
//! protocol, <https://github.com/foxglove/ws-protocol>.

mod address;
pub mod message;

pub use address::BridgeAddress;

use crate::dds::FoundTopic;
use message::{BridgeChannel, ServerMessage};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};
use svl_core::{Error, Result};
use svl_recording::LiveTopic;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket};

/// The versions of the protocol; svl needs what both have alike.
const PROTOCOLS: &str = "foxglove.sdk.v1, foxglove.websocket.v1";
/// Longest wait for a connection and its handshake, and for the bridge to accept a message.
const MAX_WAIT: Duration = Duration::from_secs(5);
/// Longest look at the bridge's topics.
const LOOK: Duration = Duration::from_millis(20);
/// Limit on a message, which is also that of a frame: an image of 32 megapixels in colour.
const MAX_BYTES: usize = 96 << 20;
/// Limit on the channels of a bridge.
const MAX_CHANNELS: usize = 10_000;
/// Limit on different warnings that are passed on.
const MAX_WARNINGS: usize = 16;
/// Limit on the characters of one.
const MAX_WARNING: usize = 400;

/// A connection to a bridge.
pub struct Bridge {
    name: String,
    socket: WebSocket<TimedStream>,
    /// Channels in CDR, by the bridge's number.
    channels: BTreeMap<u64, LiveTopic>,
    topics: Vec<LiveTopic>,
    /// Channel, and index of its topic, of each subscription.
    subscriptions: BTreeMap<u32, (u64, usize)>,
    /// Number of the next subscription.
    next: u32,
    warnings: BTreeSet<String>,
}

/// A connection that is read until a time, however slowly it sends.
struct TimedStream {
    stream: TcpStream,
    end: Instant,
}

impl Read for TimedStream {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let left = self.end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(ErrorKind::TimedOut.into());
        }
        self.stream.set_read_timeout(Some(left))?;
        self.stream.read(buffer)
    }
}

impl Write for TimedStream {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.stream.flush()
    }
}

impl Bridge {
    /// # Errors
    /// [`Error::Camera`] if nothing answers, or it is not a bridge.
    pub fn connect(address: &BridgeAddress) -> Result<Self> {
        let name = address.to_string();
        let failed = |error: &dyn Display| Error::camera(&name, format!("no bridge: {error}"));
        let found = address.host.to_socket_addrs().map_err(|e| failed(&e))?;
        let mut stream = Err(ErrorKind::NotFound.into());
        for found in found {
            stream = stream.or_else(|_| TcpStream::connect_timeout(&found, MAX_WAIT));
        }
        let stream = stream.map_err(|e| failed(&e))?;
        let set = stream.set_write_timeout(Some(MAX_WAIT));
        set.map_err(|e| failed(&e))?;
        let stream = TimedStream {
            stream,
            end: Instant::now() + MAX_WAIT,
        };
        let request = format!("ws://{}/", address.host).into_client_request();
        let mut request = request.map_err(|e| failed(&e))?;
        let protocols = HeaderValue::from_static(PROTOCOLS);
        request
            .headers_mut()
            .insert("Sec-WebSocket-Protocol", protocols);
        let config = WebSocketConfig::default()
            .max_message_size(Some(MAX_BYTES))
            .max_frame_size(Some(MAX_BYTES));
        let connected = tungstenite::client::client_with_config(request, stream, Some(config));
        let (socket, _) = connected.map_err(|e| failed(&e))?;
        Ok(Self {
            name,
            socket,
            channels: BTreeMap::new(),
            topics: Vec::new(),
            subscriptions: BTreeMap::new(),
            next: 0,
            warnings: BTreeSet::new(),
        })
    }

    /// The topics in CDR that the bridge has now, by name.
    ///
    /// # Errors
    /// As [`Bridge::receive`].
    pub fn topics(&mut self) -> Result<Vec<FoundTopic>> {
        let end = Instant::now() + LOOK;
        // No data: nothing is subscribed yet.
        while Instant::now() < end && self.receive_one(LOOK, |_, _| {})? {}
        let channels = self.channels.values().cloned();
        Ok(FoundTopic::merged(
            channels.map(|topic| (topic, false, false)),
        ))
    }

    /// Subscribes to topics, also if they come back later.
    ///
    /// # Errors
    /// [`Error::Camera`] if the bridge closes the connection.
    pub fn subscribe(&mut self, topics: &[FoundTopic]) -> Result<()> {
        self.topics = topics.iter().map(|found| found.topic.clone()).collect();
        let known: Vec<_> = self.channels.keys().copied().collect();
        known.into_iter().try_for_each(|id| self.subscribe_to(id))
    }

    fn subscribe_to(&mut self, id: u64) -> Result<()> {
        let topic = self.channels.get(&id);
        let wanted = topic.and_then(|topic| self.topics.iter().position(|own| own == topic));
        let Some(wanted) = wanted else {
            return Ok(());
        };
        self.subscriptions.insert(self.next, (id, wanted));
        let subscription = serde_json::json!({ "id": self.next, "channelId": id });
        let said = serde_json::json!({ "op": "subscribe", "subscriptions": [subscription] });
        self.next = self.next.wrapping_add(1);
        let sent = self.socket.send(Message::text(said.to_string()));
        sent.map_err(|e| self.failed(e))
    }

    /// Waits for messages and gives those with data to `take`, with the index of their topic.
    ///
    /// # Errors
    /// [`Error::Camera`] if the bridge closes the connection or breaks the protocol.
    pub fn receive(&mut self, timeout: Duration, take: impl FnMut(usize, Vec<u8>)) -> Result<()> {
        self.receive_one(timeout, take).map(drop)
    }

    /// As [`Bridge::receive`], of one message. False if none came.
    fn receive_one(
        &mut self,
        timeout: Duration,
        mut take: impl FnMut(usize, Vec<u8>),
    ) -> Result<bool> {
        self.socket.get_mut().end = Instant::now() + timeout;
        match self.socket.read() {
            Ok(Message::Text(text)) => self.handle(&text)?,
            Ok(Message::Binary(bytes)) => {
                if let Some((subscription, data)) = message::data(&bytes)
                    && let Some((_, topic)) = self.subscriptions.get(&subscription)
                {
                    take(*topic, data.to_vec());
                }
            }
            Ok(_) => {}
            Err(tungstenite::Error::Io(error)) if is_silence(error.kind()) => return Ok(false),
            Err(error) => return Err(self.failed(error)),
        }
        Ok(true)
    }

    /// Another type with which the topic at that index is published now, if there is any.
    pub fn other_type(&self, topic: usize) -> Option<String> {
        let own = self.topics.get(topic)?;
        let mut channels = self.channels.values();
        let other = channels.find(|topic| topic.name == own.name && *topic != own)?;
        Some(other.schema.clone())
    }

    fn handle(&mut self, text: &str) -> Result<()> {
        match message::text(text) {
            Ok(ServerMessage::Advertise(channels)) => {
                return channels
                    .into_iter()
                    .try_for_each(|channel| self.add(channel));
            }
            Ok(ServerMessage::Unadvertise(gone)) => {
                let gone = BTreeSet::from_iter(gone);
                self.channels.retain(|id, _| !gone.contains(id));
                self.subscriptions.retain(|_, (id, _)| !gone.contains(id));
            }
            Ok(ServerMessage::Warning(words)) => self.warn(&format!("the bridge says: {words}")),
            Ok(ServerMessage::Other) => {}
            Err(error) => self.warn(&format!("the bridge sent what cannot be read: {error}")),
        }
        Ok(())
    }

    /// Adds a channel that the bridge announces.
    fn add(&mut self, channel: BridgeChannel) -> Result<()> {
        let BridgeChannel { id, encoding, .. } = channel;
        let topic = LiveTopic {
            name: channel.topic,
            schema: channel.schema_name,
        };
        if encoding != "cdr" {
            if topic.is_image() || topic.is_calibration() {
                self.warn(&format!(
                    "{}: {} in {encoding}, and svl reads CDR of a bridge, as foxglove_bridge of \
                     ROS 2 sends it; left out: record it with Foxglove, and give svl the file",
                    topic.name, topic.schema
                ));
            }
            return Ok(());
        }
        if self.channels.get(&id) == Some(&topic) {
            return Ok(());
        }
        if self.channels.len() >= MAX_CHANNELS {
            return Err(self.failed(format_args!("more than {MAX_CHANNELS} channels")));
        }
        self.subscriptions.retain(|_, (channel, _)| *channel != id);
        self.channels.insert(id, topic);
        self.subscribe_to(id)
    }

    /// Warns in a line, of the same once.
    fn warn(&mut self, warning: &str) {
        let printable = |c: char| if c.is_control() { ' ' } else { c };
        let warning: String = warning.chars().take(MAX_WARNING).map(printable).collect();
        if self.warnings.len() < MAX_WARNINGS && !self.warnings.contains(&warning) {
            tracing::warn!("{}: {warning}", self.name);
            self.warnings.insert(warning);
        }
    }

    fn failed(&self, error: impl Display) -> Error {
        Error::camera(&self.name, format!("the bridge: {error}"))
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        // Bridges report connections that end otherwise.
        let _ = self.socket.close(None);
    }
}

/// True for a time limit, and for Ctrl-C.
fn is_silence(kind: ErrorKind) -> bool {
    [
        ErrorKind::WouldBlock,
        ErrorKind::TimedOut,
        ErrorKind::Interrupted,
    ]
    .contains(&kind)
}

#[cfg(test)]
mod tests;
