//! Publishes messages to topics.

use super::cdr::{RawCdr, body};
use super::{Domain, qos};
use rustdds::Publisher;
use rustdds::bytes::Bytes;
use rustdds::no_key::DataWriter;
use std::collections::HashMap;
use svl_core::Result;
use svl_recording::LiveTopic;

/// Publishers of some topics.
pub struct TopicOutbox {
    writers: HashMap<String, DataWriter<Bytes, RawCdr>>,
    publisher: Publisher,
    domain: Domain,
}

impl TopicOutbox {
    /// # Errors
    /// The errors of DDS.
    pub fn new(domain: Domain) -> Result<Self> {
        let publisher = domain.participant.create_publisher(&qos(false, false));
        let publisher = publisher.map_err(|e| domain.failed(e))?;
        Ok(Self {
            writers: HashMap::new(),
            publisher,
            domain,
        })
    }

    /// Declares a topic. Reliable: what was lost is sent again, and while a subscriber confirms
    /// nothing, because it died, some further messages are refused; subscribers that ask for
    /// reliability find no other publishers. Latched: late subscribers receive the last message.
    ///
    /// # Errors
    /// The errors of DDS.
    pub fn declare(&mut self, topic: &LiveTopic, reliable: bool, latched: bool) -> Result<()> {
        let qos = qos(reliable, latched);
        let dds = self.domain.dds_topic(topic, &qos)?;
        let writer = self.publisher.create_datawriter_no_key(&dds, Some(qos));
        let writer = writer.map_err(|e| self.domain.failed(e))?;
        self.writers.insert(topic.name.clone(), writer);
        Ok(())
    }

    /// Publishes a message in CDR, with its encapsulation header, to a topic that was declared.
    ///
    /// # Errors
    /// The errors of DDS, if a reliable topic refuses the message: all subscribers miss it.
    pub fn send(&self, topic: &str, message: Vec<u8>) -> Result<()> {
        let Some(writer) = self.writers.get(topic) else {
            return Err(self
                .domain
                .failed(format_args!("{topic}: was not declared")));
        };
        let sent = writer.write(body(message), None);
        sent.map_err(|e| self.domain.failed(format_args!("{topic}: {e}")))
    }
}
