//! Networks with live topics: a domain of DDS, or a Foxglove bridge.

use std::time::Duration;
use svl_core::{Error, Result};
use svl_live::bridge::{Bridge, BridgeAddress};
use svl_live::dds::{Address, Domain, FoundTopic, TopicInbox};

/// A network with topics.
pub(super) enum TopicNetwork {
    Dds(Domain),
    Bridge(Box<Bridge>),
}

/// The messages of some of its topics.
pub(super) enum Inbox {
    Dds(TopicInbox),
    Bridge(Box<Bridge>),
}

/// A network that a user named.
pub(super) struct Joined {
    pub network: TopicNetwork,
    /// The two topics that the user named.
    pub named: Option<[String; 2]>,
    /// The reason if there is no topic at all.
    pub why_none: String,
}

impl TopicNetwork {
    /// Joins the network that a user names.
    ///
    /// # Errors
    /// Those of the address and of the network.
    pub(super) fn join(name: &str) -> Result<Joined> {
        if name.starts_with("foxglove:") {
            let address: BridgeAddress = name.parse()?;
            let named = pair(name, &address.topics)?;
            return Ok(Joined {
                network: Self::Bridge(Box::new(Bridge::connect(&address)?)),
                named,
                why_none: "the bridge has no topic in CDR".to_owned(),
            });
        }
        let address: Address = name.parse()?;
        let named = pair(name, &address.topics)?;
        let why_none = format!(
            "no topic in domain {}: publishers need the same ROS_DOMAIN_ID and a network with \
             multicast, or the same host",
            address.domain
        );
        Ok(Joined {
            network: Self::Dds(Domain::join(&address)?),
            named,
            why_none,
        })
    }

    /// The topics that are published now, by name.
    ///
    /// # Errors
    /// Those of the bridge.
    pub(super) fn topics(&mut self) -> Result<Vec<FoundTopic>> {
        match self {
            Self::Dds(domain) => Ok(domain.topics()),
            Self::Bridge(bridge) => bridge.topics(),
        }
    }

    /// # Errors
    /// Those of the network.
    pub(super) fn subscribe(self, topics: &[FoundTopic]) -> Result<Inbox> {
        match self {
            Self::Dds(domain) => Ok(Inbox::Dds(TopicInbox::new(domain, topics)?)),
            Self::Bridge(mut bridge) => {
                bridge.subscribe(topics)?;
                Ok(Inbox::Bridge(bridge))
            }
        }
    }
}

/// The two topics of an address, if it has any.
fn pair(name: &str, topics: &[String]) -> Result<Option<[String; 2]>> {
    match topics {
        [] => Ok(None),
        [left, right] => Ok(Some([left.clone(), right.clone()])),
        _ => {
            let cure = "name two topics, left and right, or none";
            Err(Error::Usage(format!("{name}: {cure}")))
        }
    }
}

impl Inbox {
    /// Waits for messages and gives those that came to `take`, with the index of their topic.
    ///
    /// # Errors
    /// Those of the network.
    pub(super) fn receive(
        &mut self,
        timeout: Duration,
        take: impl FnMut(usize, Vec<u8>),
    ) -> Result<()> {
        match self {
            Self::Dds(inbox) => inbox.receive(timeout, take),
            Self::Bridge(bridge) => bridge.receive(timeout, take),
        }
    }

    /// Names of the topics, each with the number of messages lost so far; none of a bridge, which
    /// numbers no messages.
    pub(super) fn lost(&self) -> Vec<(&str, u64)> {
        match self {
            Self::Dds(inbox) => inbox.lost().collect(),
            Self::Bridge(_) => Vec::new(),
        }
    }

    /// Another type with which the topic at that index is published now, if there is any.
    pub(super) fn other_type(&self, topic: usize) -> Option<String> {
        match self {
            Self::Dds(inbox) => inbox.other_type(topic),
            Self::Bridge(bridge) => bridge.other_type(topic),
        }
    }
}
