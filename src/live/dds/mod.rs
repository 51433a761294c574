//! ROS 2 topics over DDS, without ROS: messages in CDR, as a bag stores them.

mod address;
mod cdr;
mod inbox;
mod outbox;

pub use address::Address;
pub use inbox::TopicInbox;
pub use outbox::{FoundReader, TopicOutbox};

use rustdds::policy::{Durability, History, Reliability, ResourceLimits};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, QosPolicies, QosPolicyBuilder, TopicKind,
};
use std::collections::BTreeMap;
use std::fmt::Display;
use svl_core::{Error, Result};
use svl_recording::LiveTopic;

/// Requested buffer of each receiving socket: some 25 images of 640x480.
const RECEIVE_BYTES: usize = 8 << 20;
/// Messages of a topic that DDS keeps until they are taken.
const DEPTH: i32 = 16;
/// Messages of a reliable topic that a subscriber may leave unconfirmed: DDS forgets one that is
/// silent before there are that many.
const MAX_UNCONFIRMED: i32 = 1024;

/// A domain of DDS that svl takes part in.
pub struct Domain {
    name: String,
    participant: DomainParticipant,
}

/// A topic that is published.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundTopic {
    pub topic: LiveTopic,
    pub publishers: usize,
    /// True if all publishers send again what was lost.
    reliable: bool,
    /// True if all publishers send late subscribers the last message: `transient_local`.
    latched: bool,
}

impl Domain {
    /// Joins the domain of an address. Others are discovered within a second or two.
    ///
    /// # Errors
    /// [`Error::Other`] if the network cannot be used.
    pub fn join(address: &Address) -> Result<Self> {
        let name = address.to_string();
        let mut builder =
            DomainParticipantBuilder::new(address.domain).socket_receive_buffer_size(RECEIVE_BYTES);
        if let Some(interface) = address.interface {
            builder = builder.with_only_networks([interface]);
        }
        let participant = builder.build().map_err(|e| failed(&name, e))?;
        warn_of_small_buffers(&name);
        Ok(Self { name, participant })
    }

    /// The topics of ROS that are published now, by name.
    pub fn topics(&self) -> Vec<FoundTopic> {
        let mut topics: BTreeMap<String, FoundTopic> = BTreeMap::new();
        for (topic, reliable, latched) in self.published() {
            let found = topics.entry(topic.name.clone()).or_insert(FoundTopic {
                topic,
                publishers: 0,
                reliable: true,
                latched: true,
            });
            found.publishers += 1;
            found.reliable &= reliable;
            found.latched &= latched;
        }
        topics.into_values().collect()
    }

    /// The topic of each publisher, with true if it is reliable, and if it is latched.
    fn published(&self) -> impl Iterator<Item = (LiveTopic, bool, bool)> {
        let writers = self.participant.discovered_writers().into_iter();
        writers.filter_map(|writer| {
            let writer = writer.publication_topic_data;
            let reliable = matches!(writer.reliability, Some(Reliability::Reliable { .. }));
            let latched = matches!(writer.durability, Some(Durability::TransientLocal));
            let topic = ros_topic(&writer.topic_name, &writer.type_name)?;
            Some((topic, reliable, latched))
        })
    }

    fn failed(&self, error: impl Display) -> Error {
        failed(&self.name, error)
    }

    /// The topic of DDS for one of ROS.
    fn dds_topic(&self, topic: &LiveTopic, qos: &QosPolicies) -> Result<rustdds::Topic> {
        let schema = topic.schema.replace('/', "::");
        let (package, name) = schema.rsplit_once("::").unwrap_or(("", &schema));
        let type_name = format!("{package}::dds_::{name}_");
        let name = format!("rt{}", topic.name);
        let made = self
            .participant
            .create_topic(name, type_name, qos, TopicKind::NoKey);
        made.map_err(|e| self.failed(e))
    }
}

/// The topic of ROS for one of DDS; `None` for services and for topics of others.
fn ros_topic(name: &str, type_name: &str) -> Option<LiveTopic> {
    let (package, schema) = type_name.strip_suffix('_')?.split_once("::dds_::")?;
    Some(LiveTopic {
        name: name
            .strip_prefix("rt")
            .filter(|name| name.starts_with('/'))?
            .to_owned(),
        schema: format!("{}/{schema}", package.replace("::", "/")),
    })
}

fn qos(reliable: bool, latched: bool) -> QosPolicies {
    let samples = if reliable { MAX_UNCONFIRMED } else { DEPTH };
    QosPolicyBuilder::new()
        .reliability(if reliable {
            Reliability::Reliable {
                // A publisher that waited would delay its robot.
                max_blocking_time: Duration::ZERO,
            }
        } else {
            Reliability::BestEffort
        })
        .durability(if latched {
            Durability::TransientLocal
        } else {
            Durability::Volatile
        })
        .history(History::KeepLast { depth: DEPTH })
        .resource_limits(ResourceLimits {
            max_samples: samples,
            max_instances: 1,
            max_samples_per_instance: samples,
        })
        .build()
}

fn failed(name: &str, error: impl Display) -> Error {
    Error::other(format!("{name}: DDS: {error}"))
}

/// Warns where the kernel gives sockets less than [`RECEIVE_BYTES`].
fn warn_of_small_buffers(name: &str) {
    let limit = std::fs::read_to_string("/proc/sys/net/core/rmem_max");
    // Other systems have no such file, and other limits.
    let limit = limit.ok().and_then(|text| text.trim().parse().ok());
    if let Some(limit) = limit.filter(|limit: &usize| *limit < RECEIVE_BYTES) {
        tracing::warn!(
            "{name}: sockets receive into {limit} bytes at most, so large images may be lost; \
             `sudo sysctl -w net.core.rmem_max={RECEIVE_BYTES}` allows more"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_of_ros_are_distinguished_from_others() {
        let topic = |name: &str, schema: &str| LiveTopic {
            name: name.to_owned(),
            schema: schema.to_owned(),
        };
        let image = "sensor_msgs::msg::dds_::Image_";
        let expected = topic("/left/image_raw", "sensor_msgs/msg/Image");
        assert_eq!(ros_topic("rt/left/image_raw", image), Some(expected));
        for (name, type_name) in [
            (
                "rq/set_bool/_request",
                "std_srvs::srv::dds_::SetBool_Request_",
            ),
            ("rtk", image),
            ("/left", image),
            ("rt/square", "ShapeType"),
            ("rt/square", "ShapeType_"),
        ] {
            assert_eq!(ros_topic(name, type_name), None, "{name}");
        }
    }
}
