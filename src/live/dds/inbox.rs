//! Receives the messages of topics, and counts those that were lost.

use super::cdr::RawCdr;
use super::{Domain, FoundTopic, qos};
use rustdds::mio1::{Events, Interest, Poll, Token};
use rustdds::no_key::SimpleDataReader;
use rustdds::{GUID, Subscriber};
use std::time::Duration;
use svl_core::Result;
use svl_recording::LiveTopic;

/// Limit on the publishers of a topic whose messages are counted.
const MAX_PUBLISHERS: usize = 16;

/// The messages of some topics.
pub struct TopicInbox {
    readers: Vec<TopicReader>,
    poll: Poll,
    events: Events,
    /// Readers belong to it.
    _subscriber: Subscriber,
    domain: Domain,
}

struct TopicReader {
    reader: SimpleDataReader<Vec<u8>, RawCdr>,
    topic: LiveTopic,
    /// Number of the last message of each publisher, those that were heard longest ago first.
    last: Vec<(GUID, i64)>,
    lost: u64,
    warned: bool,
}

impl TopicInbox {
    /// Subscribes to topics. Images arrive without confirmation (best effort); other messages as
    /// reliably as their publishers send them.
    ///
    /// # Errors
    /// The errors of DDS.
    pub fn new(domain: Domain, topics: &[FoundTopic]) -> Result<Self> {
        let subscriber = domain.participant.create_subscriber(&qos(false, false));
        let subscriber = subscriber.map_err(|e| domain.failed(e))?;
        let poll = Poll::new().map_err(|e| domain.failed(e))?;
        let mut readers = Vec::new();
        for (place, found) in topics.iter().enumerate() {
            let is_image = found.topic.is_image();
            let qos = qos(found.reliable && !is_image, found.latched && !is_image);
            let topic = domain.dds_topic(&found.topic, &qos)?;
            let mut reader = subscriber
                .create_simple_datareader_no_key(&topic, Some(qos))
                .map_err(|e| domain.failed(e))?;
            poll.registry()
                .register(&mut reader, Token(place), Interest::READABLE)
                .map_err(|e| domain.failed(e))?;
            readers.push(TopicReader {
                reader,
                topic: found.topic.clone(),
                last: Vec::new(),
                lost: 0,
                warned: false,
            });
        }
        Ok(Self {
            readers,
            poll,
            events: Events::with_capacity(topics.len().max(1)),
            _subscriber: subscriber,
            domain,
        })
    }

    /// Waits for messages and gives all that came to `take`, with the index of their topic.
    ///
    /// # Errors
    /// The errors of DDS.
    pub fn receive(
        &mut self,
        timeout: Duration,
        mut take: impl FnMut(usize, Vec<u8>),
    ) -> Result<()> {
        match self.poll.poll(&mut self.events, Some(timeout)) {
            // Ctrl-C.
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => return Ok(()),
            polled => polled.map_err(|e| self.domain.failed(e))?,
        }
        for (place, subscription) in self.readers.iter_mut().enumerate() {
            subscription.reader.drain_read_notifications();
            while let Some(message) = subscription.next() {
                take(place, message);
            }
        }
        Ok(())
    }

    /// Another type with which the topic at that index is published now, if there is any.
    pub fn other_type(&self, topic: usize) -> Option<String> {
        let own = &self.readers.get(topic)?.topic;
        let mut published = self.domain.published();
        let other = published.find(|(topic, ..)| topic.name == own.name && topic != own)?;
        Some(other.0.schema)
    }

    /// Names of the topics, each with the number of messages lost so far.
    pub fn lost(&self) -> impl Iterator<Item = (&str, u64)> {
        let readers = self.readers.iter();
        readers.map(|subscription| (subscription.topic.name.as_str(), subscription.lost))
    }
}

impl TopicReader {
    /// The next message that has arrived.
    fn next(&mut self) -> Option<Vec<u8>> {
        loop {
            match self.reader.try_take_one() {
                Ok(Some(sample)) => {
                    let number = i64::from(sample.sequence_number);
                    self.lost += missed(&mut self.last, sample.writer_guid, number);
                    return Some(sample.into_value());
                }
                Ok(None) => return None,
                // It counts as lost with the next message.
                Err(error) => {
                    if !std::mem::replace(&mut self.warned, true) {
                        let name = &self.topic.name;
                        tracing::warn!("{name}: a message cannot be read: {error}");
                    }
                }
            }
        }
    }
}

/// Messages that were missed since the last one of the same publisher.
fn missed<P: PartialEq>(last: &mut Vec<(P, i64)>, publisher: P, number: i64) -> u64 {
    let known = last.iter().position(|(known, _)| *known == publisher);
    let before = known.map(|place| last.remove(place).1);
    // Publishers that die and return are new ones.
    if last.len() == MAX_PUBLISHERS {
        last.remove(0);
    }
    last.push((publisher, number));
    before.map_or(0, |before| gap(before, number))
}

/// Messages between two of the same publisher.
fn gap(last: i64, next: i64) -> u64 {
    u64::try_from(next.saturating_sub(last).saturating_sub(1)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_counted_between_sequence_numbers() {
        assert_eq!([gap(1, 2), gap(1, 5), gap(5, 5), gap(5, 1)], [0, 3, 0, 0]);
        assert_eq!(gap(i64::MIN, i64::MAX), i64::MAX as u64 - 1);
    }

    #[test]
    fn publishers_come_and_go_without_end() {
        let mut last = Vec::new();
        // A permanent one, and others of one message each.
        let lost: u64 = (1..=100)
            .map(|n| missed(&mut last, 0, 2 * n) + missed(&mut last, n, 1))
            .sum();
        assert_eq!((lost, last.len()), (99, MAX_PUBLISHERS));
    }
}
