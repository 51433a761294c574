//! Notices: reasons as values, from where they are known to the report, the page and the terminal.

use parking_lot::Mutex;
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt::{self, Debug, Display, Formatter};
use std::sync::{Arc, LazyLock};
use svl_core::doubt::Doubt;
use svl_core::{counted, listed};
use tracing::field::{Field, Visit};

/// Most notices that a log holds.
const MAX_NOTICES: usize = 1000;

/// Something that the user should know of a run, of algorithms, or of a pair.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Notice {
    /// The algorithms that it is of, by their labels; empty for one of the run itself.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub algorithms: Vec<String>,
    /// Number of the pair that it is of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pair: Option<u64>,
    /// Without the names of algorithms and the pair.
    pub text: String,
    /// The doubt that it tells; none is read if a number of it is infinite.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "read_doubt"
    )]
    pub doubt: Option<Doubt>,
}

impl Notice {
    /// A notice of algorithms.
    pub fn new<'a>(algorithms: impl IntoIterator<Item = &'a str>, text: impl Into<String>) -> Self {
        Self {
            algorithms: algorithms.into_iter().map(str::to_owned).collect(),
            text: text.into(),
            ..Self::default()
        }
    }

    /// A notice of an algorithm on a pair.
    pub fn on_pair(algorithm: &str, pair: u64, text: &str) -> Self {
        Self {
            pair: Some(pair),
            ..Self::new([algorithm], text)
        }
    }

    /// The notice of an event: its own, or its message.
    pub fn from_event(event: &tracing::Event<'_>) -> Self {
        let mut notice = Self::default();
        event.record(&mut notice);
        notice
    }

    /// Warns of it.
    pub fn warn(&self) {
        let notice: &(dyn std::error::Error + 'static) = self;
        tracing::warn!(notice, "{self}");
    }

    /// The same with other names for its algorithms, of pairs of a name and another; absent if it
    /// is of algorithms, and none has another.
    pub fn renamed<'a>(&self, names: impl Iterator<Item = (&'a str, &'a str)>) -> Option<Self> {
        let own = names.filter(|(name, _)| self.algorithms.iter().any(|own| own == name));
        let renamed = Self {
            pair: self.pair,
            doubt: self.doubt.clone(),
            ..Self::new(own.map(|(_, other)| other), &*self.text)
        };
        (renamed.algorithms.is_empty() == self.algorithms.is_empty()).then_some(renamed)
    }

    /// Adds it to others: of one text the algorithms together.
    pub fn add_to(self, notices: &mut Vec<Self>) {
        let key = |own: &Self| (own.algorithms.is_empty(), own.pair);
        let is_same = |own: &&mut Self| own.text == self.text && key(own) == key(&self);
        match notices.iter_mut().find(is_same) {
            Some(own) => {
                for algorithm in self.algorithms {
                    if !own.algorithms.contains(&algorithm) {
                        own.algorithms.push(algorithm);
                    }
                }
            }
            None => notices.push(self),
        }
    }
}

impl Display for Notice {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let pair = self.pair.map(|pair| format!(" on pair {pair}"));
        match self.algorithms.is_empty() {
            true => f.write_str(&self.text),
            false => {
                let algorithms = self.algorithms.join(", ");
                write!(f, "{algorithms}{}: {}", pair.unwrap_or_default(), self.text)
            }
        }
    }
}

/// A kind of value that an event has as a field.
impl std::error::Error for Notice {}

impl Visit for Notice {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" && self.text.is_empty() {
            self.text = format!("{value:?}");
        }
    }

    fn record_error(&mut self, _: &Field, value: &(dyn std::error::Error + 'static)) {
        if let Some(notice) = value.downcast_ref::<Self>() {
            self.clone_from(notice);
        }
        self.doubt = self.doubt.take().or(value.downcast_ref().cloned());
    }
}

fn read_doubt<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Doubt>, D::Error> {
    let value = serde_json::Value::deserialize(deserializer)?;
    Ok(serde_json::from_value(value).ok())
}

/// The name that a warning begins with, and its words without numbers.
pub fn name_and_kind(line: &str) -> Option<(&str, String)> {
    let (name, words) = line.split_once(": ")?;
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    Some((name, words.replace(is_number, "")))
}

/// Warnings of which those of one kind are one line: the first, and the names of the others. All of
/// a kind have other names, and words that differ in numbers alone.
pub fn grouped(lines: impl IntoIterator<Item = String>) -> Vec<String> {
    fn parts(line: &str) -> (&str, &str) {
        line.split_once(": ").unwrap_or_default()
    }
    let mut kinds: Vec<(Option<String>, Vec<String>)> = Vec::new();
    for line in lines {
        let kind = name_and_kind(&line).map(|(_, kind)| kind);
        let mut known = kinds
            .iter_mut()
            .filter(|(own, _)| kind.is_some() && *own == kind);
        match known.find(|(_, own)| parts(&own[0]).0 != parts(&line).0) {
            Some((_, own)) => own.push(line),
            None => kinds.push((kind, vec![line])),
        }
    }
    let words = |(_, lines): (Option<String>, Vec<String>)| {
        let (first, others) = (&lines[0], &lines[1..]);
        if others.is_empty() {
            return first.clone();
        }
        let is_same = |other: &String| parts(other).1 == parts(first).1;
        let numbers = if others.iter().all(is_same) {
            ""
        } else {
            ", numbers differ"
        };
        let names = listed(others.iter().map(|other| parts(other).0));
        format!(
            "{first} (likewise {}{numbers}: {names})",
            counted(others.len(), "other")
        )
    };
    kinds.into_iter().map(words).collect()
}

/// The log that takes the notices; at first one of the whole process.
static CURRENT: LazyLock<Mutex<NoticeLog>> = LazyLock::new(Mutex::default);

/// The notices that were given while it was entered.
#[derive(Clone, Debug, Default)]
pub struct NoticeLog(Arc<Mutex<Vec<Notice>>>);

/// Notices are taken by a log while this lives.
#[must_use]
pub struct EnteredNotices(NoticeLog);

impl NoticeLog {
    /// Takes the notices of any thread, in place of the log before it, until the result is dropped.
    pub fn enter(&self) -> EnteredNotices {
        EnteredNotices(std::mem::replace(&mut CURRENT.lock(), self.clone()))
    }

    /// The log that takes the notices.
    pub fn current() -> Self {
        CURRENT.lock().clone()
    }

    /// The doubts that were told.
    pub fn doubts(&self) -> Vec<Doubt> {
        let notices = self.0.lock();
        let doubts = notices.iter().filter_map(|notice| notice.doubt.clone());
        doubts.collect()
    }

    /// Adds a notice.
    pub fn add(&self, notice: Notice) {
        let mut notices = self.0.lock();
        if notices.len() < MAX_NOTICES {
            notice.add_to(&mut notices);
        }
    }

    /// The notices so far, of one text once.
    pub fn notices(&self) -> Vec<Notice> {
        self.0.lock().clone()
    }
}

impl Drop for EnteredNotices {
    fn drop(&mut self) {
        *CURRENT.lock() = std::mem::take(&mut self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notices_of_one_text_are_those_of_their_algorithms() {
        let log = NoticeLog::default();
        for algorithms in [&["bm"][..], &["v3"], &["bm", "v3"], &[]] {
            log.add(Notice::new(algorithms.iter().copied(), "short"));
        }
        let words = log
            .notices()
            .iter()
            .map(Notice::to_string)
            .collect::<Vec<_>>();
        assert_eq!(words, ["bm, v3: short", "short"]);
    }

    #[test]
    fn a_notice_of_algorithms_that_have_no_name_is_absent() {
        let renamed = |notice: Notice| {
            let renamed = notice.renamed([("bm", "digest")].into_iter());
            renamed.map(|notice| notice.algorithms)
        };
        assert_eq!(
            renamed(Notice::new(["bm", "v3"], "")),
            Some(vec!["digest".to_owned()])
        );
        assert_eq!(renamed(Notice::new(["v3"], "")), None);
        assert_eq!(renamed(Notice::new([], "")), Some(Vec::new()));
    }

    #[test]
    fn warnings_of_one_kind_are_one_line() {
        let lines = [
            "a.mcap: 6 pairs dropped",
            "a.mcap: 12.5 pairs dropped",
            "the machine was busy",
            "b.mcap: 16 pairs dropped",
            "c.mcap: 8 images dropped",
            "d.mcap: 9 pairs dropped",
        ];
        let expected = [
            "a.mcap: 6 pairs dropped (likewise 2 others, numbers differ: b.mcap, d.mcap)",
            lines[1],
            lines[2],
            lines[4],
        ];
        assert_eq!(grouped(lines.map(str::to_owned)), expected);
        let same = ["a: lost", "b: lost", "a: lost"].map(str::to_owned);
        assert_eq!(grouped(same), ["a: lost (likewise 1 other: b)", "a: lost"]);
    }

    #[test]
    fn the_log_that_was_entered_last_takes_the_notices() {
        let [outer, inner] = [NoticeLog::default(), NoticeLog::default()];
        let note = |text: &str| NoticeLog::current().add(Notice::new([], text));
        let entered = outer.enter();
        note("before");
        let entered_inner = inner.enter();
        note("within");
        drop(entered_inner);
        note("after");
        drop(entered);
        let texts = [outer, inner].map(|log| {
            let notices = log.notices().into_iter();
            notices.map(|notice| notice.text).collect::<Vec<_>>()
        });
        assert_eq!(texts, [vec!["before", "after"], vec!["within"]]);
    }
}
