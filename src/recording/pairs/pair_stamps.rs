//! The stamps of a recording's pairs, without their images.

use super::stamp_order::ImagePairing;
use crate::message::MessageResult;
use crate::message::sync::StereoSync;
use crate::message::wire::topic;
use crate::stream::channel::Channel;
use svl_core::stereo::Side;

/// Rule by which messages form pairs.
#[derive(Clone)]
pub(crate) enum PairStamps {
    /// By `/stereo/sync`, in svl's own recordings.
    Synced,
    /// By the stamps of two topics, as in [`super::pair_reader::PairReader`].
    Nearest {
        topics: [String; 2],
        pairing: Box<ImagePairing<()>>,
        next: u64,
    },
}

/// Reads the stamp of a message, if it has one, and its frame.
type ReadHead = fn(&Channel, &[u8]) -> MessageResult<(Option<u64>, String)>;

impl PairStamps {
    /// Adds stamp and sequence of the pairs that a message completes. `head` reads the stamp of an
    /// image.
    pub(crate) fn take_in(
        &mut self,
        channel: &Channel,
        log_time: u64,
        data: &[u8],
        head: ReadHead,
        pairs: &mut Vec<(u64, u64)>,
    ) {
        match self {
            Self::Synced if channel.topic == topic::SYNC => {
                let sync = StereoSync::decode(&channel.schema, data);
                pairs.extend(sync.map(|sync| (sync.left_stamp_ns, sync.sequence)));
            }
            Self::Synced => {}
            Self::Nearest {
                topics, pairing, ..
            } => {
                pairing.advance(log_time);
                let of_topic = |side: &Side| topics[*side as usize] == channel.topic;
                let mut sides = Side::BOTH.into_iter().filter(of_topic).peekable();
                // An unreadable message is reported when its turn comes.
                if sides.peek().is_some()
                    && let Ok((stamp, _)) = head(channel, data)
                {
                    let stamp_ns = stamp.unwrap_or(log_time);
                    sides.for_each(|side| {
                        pairing.push(side, stamp_ns, log_time, (), data.len());
                    });
                }
            }
        }
        self.pop(pairs);
    }

    /// Adds the pairs completed by the end of the recording.
    pub(crate) fn end(&mut self, pairs: &mut Vec<(u64, u64)>) {
        if let Self::Nearest { pairing, .. } = self {
            pairing.end();
        }
        self.pop(pairs);
    }

    fn pop(&mut self, pairs: &mut Vec<(u64, u64)>) {
        let Self::Nearest { pairing, next, .. } = self else {
            return;
        };
        while let Some([(left_ns, ()), _]) = pairing.pop() {
            pairs.push((left_ns, *next));
            *next += 1;
        }
    }
}
