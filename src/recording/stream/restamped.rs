//! Messages of a recording with the rules by which their stamps are read.

use super::channel::{Channel, EventReader, FileEvent};
use super::stamp_rule::StampRule;
use std::collections::BTreeMap;
use std::sync::Arc;
use svl_core::Result;

/// The rules of the topics that have one.
pub(crate) type StampRules = Arc<BTreeMap<String, StampRule>>;

/// Messages whose stamps are read by rules.
pub(crate) struct Restamped {
    messages: Box<dyn EventReader>,
    rules: StampRules,
    /// The channel of the last message, with its rule.
    channel: Option<Channel>,
}

impl Restamped {
    /// The messages themselves if there are no rules.
    pub(crate) fn over(messages: Box<dyn EventReader>, rules: &StampRules) -> Box<dyn EventReader> {
        if rules.is_empty() {
            return messages;
        }
        Box::new(Self {
            messages,
            rules: Arc::clone(rules),
            channel: None,
        })
    }
}

impl EventReader for Restamped {
    fn next(&mut self) -> Result<Option<FileEvent<'_>>> {
        Ok(match self.messages.next()? {
            Some(FileEvent::Message(channel, log_time, data)) => {
                let rule = self.rules.get(&channel.topic);
                let channel = match rule {
                    Some(rule) => &*self.channel.insert(channel.restamped(*rule)),
                    None => channel,
                };
                Some(FileEvent::Message(channel, log_time, data))
            }
            other => other,
        })
    }
}
