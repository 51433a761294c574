//! A topic with the encoding of its messages, and the records of a file as events.

use super::stamp_rule::StampRule;
use mcap::records::{self, Header, Metadata, SchemaHeader};
use parking_lot::Mutex;
use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap};
use svl_core::Result;
use svl_core::doubt::Doubt;

/// The encoding of ROS 1's messages.
pub(crate) const ROS1: &str = "ros1";

/// A topic with the encoding of its messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    pub(crate) schema: String,
    pub(crate) encoding: String,
    pub(crate) stamps: StampRule,
}

impl Channel {
    /// Types of ROS 1 are named as those of ROS 2 with the same fields.
    pub(crate) fn new(topic: String, schema: String, encoding: String) -> Self {
        // Recorders of DDS write sensor_msgs::msg::dds_::Image_.
        let dds = schema
            .strip_suffix('_')
            .and_then(|name| name.split_once("::dds_::"));
        let schema = match dds {
            Some((package, name)) => format!("{}/{name}", package.replace("::", "/")),
            None => schema,
        };
        let schema = match schema.split_once('/') {
            Some(("tf", "tfMessage")) if encoding == ROS1 => "tf2_msgs/msg/TFMessage".to_owned(),
            Some((package, name)) if encoding == ROS1 => format!("{package}/msg/{name}"),
            _ => schema,
        };
        Self {
            topic,
            schema,
            encoding,
            stamps: StampRule::default(),
        }
    }

    /// A channel of messages of ROS 2.
    pub(crate) fn cdr(topic: &str, schema: &str) -> Self {
        Self::new(topic.to_owned(), schema.to_owned(), "cdr".to_owned())
    }

    /// The same with another rule for its stamps.
    pub(crate) fn restamped(&self, stamps: StampRule) -> Self {
        Self {
            stamps,
            ..self.clone()
        }
    }

    pub(crate) fn declared(channel: &records::Channel, schemas: &HashMap<u16, Schema>) -> Self {
        let schema = schemas.get(&channel.schema_id);
        let schema = schema.map(|(schema, _)| schema.name.clone());
        Self::new(
            channel.topic.clone(),
            schema.unwrap_or_default(),
            channel.message_encoding.clone(),
        )
    }
}

/// One message, metadata record or attachment, or the header of a file.
pub(crate) enum FileEvent<'a> {
    /// A message with its channel and log time.
    Message(&'a Channel, u64, Cow<'a, [u8]>),
    Metadata(Metadata),
    Attachment {
        /// Start of its record.
        start: u64,
        name: String,
        /// Size of its data.
        bytes: u64,
    },
    Library(Header),
}

/// Reads the messages of a file, and its other records.
pub(crate) trait EventReader: Send {
    /// The next event; `None` at the end of the file and after an error.
    ///
    /// # Errors
    /// [`svl_core::Error::Damaged`] if the file ends early or contradicts its CRCs.
    fn next(&mut self) -> Result<Option<FileEvent<'_>>>;
}

pub(crate) type Schema = (SchemaHeader, Vec<u8>);

/// Warns of a doubt about a source of that name.
pub fn warn_of(name: &str, doubt: &Doubt) {
    let value: &(dyn std::error::Error + 'static) = doubt;
    tracing::warn!(doubt = value, "{name}: {doubt}");
}

/// Limit on different warnings.
const MAX_WARNINGS: usize = 100;

/// Warns once in a process: pairs, truth and places read the poses of a recording each.
pub fn warn_once(warning: String) {
    static WARNED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let mut warned = WARNED.lock();
    if warned.len() < MAX_WARNINGS && !warned.contains(&warning) {
        tracing::warn!("{warning}");
        warned.insert(warning);
    }
}
