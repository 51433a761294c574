//! The tree of names and values that a calibration file is, whatever its syntax.

use super::{Format, lines, markup};
use crate::bounded::read_text;
use crate::error::{Error, Result};
use crate::stereo::{self, MAX_SIDE};
use crate::yaml::{self, Node};
use nalgebra::{Matrix3, Matrix3x4, Rotation3};
use std::path::{Path, PathBuf};

/// Largest calibration file that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// How a format writes names and values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Syntax {
    /// XML when it begins so, else YAML.
    Markup,
    /// `NAME: values` or `NAME=values` in each line.
    Lines(char),
}

/// A calibration file, read.
///
/// Its keys are paths, `left.pinhole.fx` or `Camera.0.ImageSize`, of which `K1|M1` names two: the
/// first that is there. All its errors name the file and the key.
pub(super) struct Document {
    path: PathBuf,
    /// Whose file it is.
    title: &'static str,
    root: Node,
}

/// The text of a calibration file.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for what is too large or no text.
pub(super) fn text(path: &Path) -> Result<String> {
    read_text(path, MAX_BYTES)
}

impl Document {
    /// # Errors
    /// [`Error::Format`] with the line for what is not of that format's syntax.
    pub(super) fn parse(path: &Path, text: &str, format: &Format) -> Result<Self> {
        let text = text.trim_start_matches('\u{feff}');
        let root = match format.syntax {
            Syntax::Lines(mark) => Ok(lines::parse(text, mark)),
            Syntax::Markup if text.trim_start().starts_with('<') => markup::parse(text),
            Syntax::Markup => yaml::parse(text),
        };
        let root = root.map_err(|reason| Error::format(path, reason))?;
        Ok(Self {
            path: path.to_owned(),
            title: format.title,
            root,
        })
    }

    /// An error of this file.
    pub(super) fn wrong(&self, reason: impl std::fmt::Display) -> Error {
        Error::format(&self.path, reason.to_string())
    }

    /// What stands in the other file too, where this one lacks it.
    pub(super) fn completed_by(mut self, other: Self) -> Self {
        if let (Node::Table(own), Node::Table(more)) = (&mut self.root, other.root) {
            for (key, node) in more {
                own.entry(key).or_insert(node);
            }
        }
        self
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.find(key).is_some()
    }

    fn find(&self, key: &str) -> Option<&Node> {
        key.split('|').find_map(|key| {
            key.split('.')
                .try_fold(&self.root, |node, name| match node {
                    Node::Table(table) => table.get(name),
                    Node::List(list) => list.get(name.parse::<usize>().ok()?),
                    Node::Value(_) => None,
                })
        })
    }

    fn node(&self, key: &str) -> Result<&Node> {
        self.find(key).ok_or_else(|| {
            self.wrong(format!(
                "no '{}', which {} has; is it whole?",
                key.replace('|', "' or '"),
                self.title
            ))
        })
    }

    /// # Errors
    /// When it is not there or no single value.
    pub(super) fn text(&self, key: &str) -> Result<&str> {
        match self.node(key)? {
            Node::Value(text) => Ok(text.trim()),
            _ => Err(self.wrong(format!("'{key}' holds several values, expected one"))),
        }
    }

    /// All numbers of a list, of a matrix, or of a line.
    ///
    /// # Errors
    /// When it is not there or holds what is no finite number.
    pub(super) fn numbers(&self, key: &str) -> Result<Vec<f64>> {
        let number = |word: &str| {
            let value = word.parse().ok().filter(|v: &f64| v.is_finite());
            value.ok_or_else(|| {
                self.wrong(format!(
                    "'{key}' holds '{}', expected a finite number",
                    short(word)
                ))
            })
        };
        let separator = |c: char| c.is_whitespace() || ",;[]".contains(c);
        let words = |text: &str| {
            text.split(separator)
                .filter(|w| !w.is_empty())
                .map(number)
                .collect::<Result<_>>()
        };
        match self.node(key)? {
            Node::Value(text) => words(text),
            Node::Table(_) => self.numbers(&format!("{key}.data").replace('|', ".data|")),
            Node::List(list) => list
                .iter()
                .map(|node| match node {
                    Node::Value(text) => number(text.trim()),
                    _ => Err(self.wrong(format!("'{key}' is a list of lists, expected numbers"))),
                })
                .collect(),
        }
    }

    /// # Errors
    /// Those of [`Document::numbers`], and when there are more or fewer.
    pub(super) fn array<const N: usize>(&self, key: &str) -> Result<[f64; N]> {
        let numbers = self.numbers(key)?;
        numbers.try_into().map_err(|n: Vec<f64>| {
            self.wrong(format!("'{key}' has {} numbers, expected {N}", n.len()))
        })
    }

    /// # Errors
    /// Those of [`Document::array`].
    pub(super) fn number(&self, key: &str) -> Result<f64> {
        Ok(self.array::<1>(key)?[0])
    }

    /// Numbers under keys that are counted: `rot0`, `rot1` and so on.
    ///
    /// # Errors
    /// Those of [`Document::array`].
    pub(super) fn counted<const N: usize>(&self, key: &str) -> Result<[f64; N]> {
        let mut numbers = [0.0; N];
        for (i, number) in numbers.iter_mut().enumerate() {
            *number = self.number(&format!("{key}{i}"))?;
        }
        Ok(numbers)
    }

    /// Width and height, of one image side each.
    ///
    /// # Errors
    /// Those of [`Document::number`], and for what no image is large.
    pub(super) fn size(&self, width: &str, height: &str) -> Result<(usize, usize)> {
        let side = |key: &str| self.side(key, self.number(key)?);
        Ok((side(width)?, side(height)?))
    }

    /// Width and height under one key.
    ///
    /// # Errors
    /// Those of [`Document::size`].
    pub(super) fn size_of(&self, key: &str) -> Result<(usize, usize)> {
        let [width, height] = self.array(key)?;
        Ok((self.side(key, width)?, self.side(key, height)?))
    }

    fn side(&self, key: &str, side: f64) -> Result<usize> {
        if side.fract() == 0.0 && (1.0..=MAX_SIDE as f64).contains(&side) {
            Ok(side as usize)
        } else {
            Err(self.wrong(format!(
                "'{key}' is {side}, expected whole pixels, 1 to {MAX_SIDE}"
            )))
        }
    }

    /// A 3 x 3 matrix, row by row.
    ///
    /// # Errors
    /// Those of [`Document::array`].
    pub(super) fn matrix(&self, key: &str) -> Result<Matrix3<f64>> {
        Ok(Matrix3::from_row_slice(&self.array::<9>(key)?))
    }

    /// A projection matrix, row by row.
    ///
    /// # Errors
    /// Those of [`Document::array`].
    pub(super) fn projection(&self, key: &str) -> Result<Matrix3x4<f64>> {
        Ok(Matrix3x4::from_row_slice(&self.array::<12>(key)?))
    }

    /// # Errors
    /// Those of [`Document::array`], and when it is no rotation.
    pub(super) fn rotation(&self, key: &str) -> Result<Rotation3<f64>> {
        stereo::rotation(&self.matrix(key)?).map_err(|e| self.wrong(format!("'{key}': {e}")))
    }
}

/// As much of a word as a message has room for.
fn short(word: &str) -> String {
    let printed = word.chars().map(|c| if c.is_control() { ' ' } else { c });
    printed.take(40).collect()
}
