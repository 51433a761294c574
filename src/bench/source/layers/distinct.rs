//! Pairs of one picture twice: a camera, video, topic or pattern that is named for both sides.

use crate::source::frames::{Source, wraps};
use std::collections::VecDeque;
use svl_core::stereo::Frame;
use svl_core::{Error, Result, counted};

/// The images of both cameras are one picture, in an [`Error::Other`]: no pair can be used.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct OnePicture(String);

/// Pairs that decide: the first ones.
const MAX_PAIRS: usize = 16;

/// A source that fails if the images of all its first pairs are equal and some have texture. Those
/// of black or saturated pairs tell nothing.
pub struct DistinctSource<'a> {
    source: Box<dyn Source + 'a>,
    /// Pairs that were read to decide.
    ahead: VecDeque<Result<Frame>>,
    is_decided: bool,
}

impl<'a> DistinctSource<'a> {
    pub fn new(source: Box<dyn Source + 'a>) -> Self {
        Self {
            source,
            ahead: VecDeque::new(),
            is_decided: false,
        }
    }

    /// Reads the pairs that decide: one, unless its images are equal.
    fn decide(&mut self) -> Result<()> {
        let (mut pictures, mut is_same) = (0, true);
        while is_same
            && self.ahead.len() < MAX_PAIRS
            && let Some(next) = self.source.next().transpose()
        {
            let pair = next.as_ref().map(|frame| &frame.pair);
            is_same = pair.is_ok_and(|pair| pair.left() == pair.right());
            pictures += u64::from(pair.is_ok_and(|pair| pair.is_one_picture()));
            self.ahead.push_back(next);
        }
        if is_same && pictures > 0 {
            self.ahead.clear();
            return Err(Error::other(OnePicture(format!(
                "{}: left and right are one picture twice: all pixels of the first {} are equal; \
                 name images of two cameras",
                self.source.name(),
                counted(pictures, "pair")
            ))));
        }
        self.is_decided = true;
        Ok(())
    }
}

impl Source for DistinctSource<'_> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        if !self.is_decided {
            self.decide()?;
        }
        match self.ahead.pop_front() {
            Some(next) => next.map(Some),
            None => self.source.next(),
        }
    }

    fn seek(&mut self, index: u64) -> Result<bool> {
        let sought = self.source.seek(index)?;
        if sought {
            self.ahead.clear();
        }
        Ok(sought)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::frames::FromFn;
    use svl_core::stereo::{Geometry, Gray, StereoPair};

    /// The pairs that come out before the first refusal, and that. A letter for each: one picture
    /// twice, black, or distinct; an error.
    fn read(letters: &str) -> (usize, Option<String>) {
        let mut letters = letters.chars();
        let source = FromFn(move || {
            let image = |scale: usize| Gray::from_fn(40, 20, |x, y| (scale * (31 * x + y)) as u8);
            let pair = match letters.next() {
                None => return Ok(None),
                Some('e') => return Err(Error::Invalid("broken".into())),
                Some('s') => StereoPair::new(image(1)?, image(1)?),
                Some('b') => StereoPair::new(image(0)?, image(0)?),
                Some(_) => StereoPair::new(image(1)?, image(3)?),
            };
            Ok(Some(Frame::new(pair?, Geometry::Raw)))
        });
        let mut source = DistinctSource::new(Box::new(source));
        let mut pairs = 0;
        loop {
            match source.next() {
                Ok(Some(_)) => pairs += 1,
                Ok(None) => return (pairs, None),
                Err(error) if error.to_string() == "broken" => {}
                Err(error) => return (pairs, Some(error.to_string())),
            }
        }
    }

    #[test]
    fn one_picture_twice_is_refused_and_nothing_else() {
        for (letters, pairs) in [
            ("s", 1),
            ("ssss", 4),
            ("bbs", 1),
            ("bbbsssssssssssssssd", 13),
        ] {
            let (read, refusal) = read(letters);
            let refusal = refusal.unwrap_or_default();
            let expected = format!(
                "pairs: left and right are one picture twice: all pixels of \
                                    the first {} are equal",
                counted(pairs as u64, "pair")
            );
            assert!(
                read == 0 && refusal.starts_with(&expected),
                "{letters}: {refusal}"
            );
        }
        for letters in [
            "",
            "d",
            "bbbb",
            "sssd",
            "bsd",
            "ssssssssssssssse",
            "dsssssssssssssssss",
        ] {
            let pairs = letters.chars().filter(|letter| *letter != 'e').count();
            assert_eq!(read(letters), (pairs, None), "{letters}");
        }
    }
}
