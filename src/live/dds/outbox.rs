//! Publishes messages to topics, and knows who reads them.

use super::cdr::{RawCdr, body};
use super::{Domain, qos, ros_topic};
use rustdds::bytes::Bytes;
use rustdds::no_key::DataWriter;
use rustdds::{Publisher, QosPolicies};
use std::collections::BTreeMap;
use svl_core::Result;
use svl_recording::LiveTopic;

/// Publishers of some topics.
pub struct TopicOutbox {
    topics: BTreeMap<String, OfferedTopic>,
    publisher: Publisher,
    domain: Domain,
}

/// A topic with its publisher.
struct OfferedTopic {
    topic: LiveTopic,
    qos: QosPolicies,
    writer: DataWriter<Bytes, RawCdr>,
}

/// A subscriber of a topic of an outbox.
pub struct FoundReader {
    pub topic: String,
    /// The reason why it receives nothing, if it does not match.
    pub unfit: Option<String>,
}

impl TopicOutbox {
    /// # Errors
    /// The errors of DDS.
    pub fn new(domain: Domain) -> Result<Self> {
        let publisher = domain.participant.create_publisher(&qos(false, false));
        let publisher = publisher.map_err(|e| domain.failed(e))?;
        Ok(Self {
            topics: BTreeMap::new(),
            publisher,
            domain,
        })
    }

    /// Declares a topic. Reliable: what was lost is sent again, so that subscribers that ask for
    /// reliability match too. Latched: late subscribers receive the last message.
    ///
    /// # Errors
    /// The errors of DDS.
    pub fn declare(&mut self, topic: &LiveTopic, reliable: bool, latched: bool) -> Result<()> {
        let qos = qos(reliable, latched);
        let writer = self.writer(topic, &qos)?;
        let (name, topic) = (topic.name.clone(), topic.clone());
        let offered = OfferedTopic { topic, qos, writer };
        self.topics.insert(name, offered);
        Ok(())
    }

    fn writer(&self, topic: &LiveTopic, qos: &QosPolicies) -> Result<DataWriter<Bytes, RawCdr>> {
        let dds = self.domain.dds_topic(topic, qos)?;
        let qos = Some(qos.clone());
        let writer = self.publisher.create_datawriter_no_key(&dds, qos);
        writer.map_err(|e| self.domain.failed(e))
    }

    /// Publishes a message in CDR, with its encapsulation header, to a topic that was declared.
    ///
    /// # Errors
    /// The errors of DDS: all subscribers miss the message.
    pub fn send(&mut self, topic: &str, message: Vec<u8>) -> Result<()> {
        let Some(offered) = self.topics.get(topic) else {
            return Err(self
                .domain
                .failed(format_args!("{topic}: was not declared")));
        };
        let body = body(message);
        if offered.writer.write(body.clone(), None).is_ok() {
            return Ok(());
        }
        // A subscriber that confirms nothing must not hold up the others: a new publisher has
        // nothing that is unconfirmed.
        let writer = self.writer(&offered.topic, &offered.qos)?;
        let sent = writer.write(body, None);
        let sent = sent.map_err(|e| self.domain.failed(format_args!("{topic}: {e}")));
        if let Some(offered) = self.topics.get_mut(topic) {
            offered.writer = writer;
        }
        sent
    }

    /// The subscribers that were discovered.
    pub fn readers(&self) -> Vec<FoundReader> {
        let readers = self.domain.participant.discovered_readers().into_iter();
        let found = readers.filter_map(|reader| {
            let reader = reader.subscription_topic_data;
            let topic = reader.topic_name.strip_prefix("rt")?.to_owned();
            let OfferedTopic {
                topic: own, qos, ..
            } = self.topics.get(&topic)?;
            let (asked, type_name) = (reader.qos(), reader.type_name());
            let unfit = if ros_topic(&reader.topic_name, type_name).as_ref() != Some(own) {
                Some(format!("it expects {type_name}, not {}", own.schema))
            } else if asked.is_reliable() && !qos.is_reliable() {
                Some("it asks for the QoS reliable; choose best_effort".to_owned())
            } else {
                let policy = qos.compliance_failure_wrt(&asked);
                policy.map(|policy| format!("its QoS {policy:?} asks for more than is offered"))
            };
            Some(FoundReader { topic, unfit })
        });
        found.collect()
    }

    /// Number of publishers and subscribers of others that were discovered, of any topic.
    pub fn discovered(&self) -> usize {
        let participant = &self.domain.participant;
        participant.discovered_readers().len() + participant.discovered_writers().len()
    }
}
