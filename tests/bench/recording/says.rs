//! Words that a program or an error says, or does not.

use crate::cli::fixture::{Fixture, Ran};
use crate::common::assert_says;

/// A text in which words are looked for: an error's, or standard error of a program.
pub(super) trait Says: Sized {
    fn text(&self) -> String;

    /// Asserts that all these words, separated by ` | `, are in the text.
    #[track_caller]
    fn says(self, words: &str) -> Self {
        assert_says(&self.text(), &words.split(" | ").collect::<Vec<_>>());
        self
    }

    /// Asserts that these words are not in the text.
    #[track_caller]
    fn lacks(self, words: &str) -> Self {
        self.says_if(false, words)
    }

    /// Asserts that these words are in the text if `is_said`, and not otherwise.
    #[track_caller]
    fn says_if(self, is_said: bool, words: &str) -> Self {
        let text = self.text();
        assert_eq!(text.contains(words), is_said, "'{words}': {text}");
        self
    }

    /// Asserts that these words are in the text so many times.
    #[track_caller]
    fn counts(self, count: usize, words: &str) -> Self {
        let text = self.text();
        assert_eq!(text.matches(words).count(), count, "'{words}': {text}");
        self
    }
}

impl Says for &str {
    fn text(&self) -> String {
        (*self).to_owned()
    }
}

impl Says for String {
    fn text(&self) -> String {
        self.clone()
    }
}

impl Says for svl::Error {
    fn text(&self) -> String {
        self.to_string()
    }
}

impl Says for Ran {
    fn text(&self) -> String {
        self.stderr.clone()
    }
}

impl<T: Says> Says for &T {
    fn text(&self) -> String {
        T::text(self)
    }
}

impl Ran {
    /// Asserts this exit status.
    #[track_caller]
    pub(super) fn exits(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{}{}", self.stdout, self.stderr);
        self
    }

    /// Standard output and error in one line.
    pub(super) fn line(&self) -> String {
        joined(&(self.stdout.clone() + &self.stderr))
    }
}

impl Fixture {
    /// The output of `svl info`, which must succeed, in one line.
    #[track_caller]
    pub(super) fn info(&self, what: &str) -> String {
        joined(&self.run(&format!("info {what}")))
    }

    /// The answer of `svl info` on `bag.mcap`: what is before its facts, in one line.
    #[track_caller]
    pub(super) fn answer(&self, options: &str) -> String {
        let text = self.info(&format!("bag.mcap {options}"));
        text.split(" bag.mcap ").next().unwrap().to_owned()
    }

    /// What `svl info` knows of the first pairs of `bag.mcap`.
    #[track_caller]
    pub(super) fn first_pairs(&self, options: &str) -> serde_json::Value {
        self.json(&format!("info bag.mcap --json {options}"))["first_pairs"].take()
    }
}

/// The words of a text, separated by single spaces.
pub(super) fn joined(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
