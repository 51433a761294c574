//! A calibration file as a tree of names and values, independent of its syntax.

use super::markup;
use crate::yaml::{self, YamlNode as Node};
use nalgebra::{Matrix3, Matrix3x4, Rotation3};
use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use svl_core::bounded::read_text;
use svl_core::stereo::{self, MAX_SIDE};
use svl_core::{Error, Result};

/// Largest calibration file accepted, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Syntax of a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Syntax {
    /// XML if it starts with `<`, else YAML.
    Markup,
    /// `NAME: values` or `NAME=values` in each line, with this separator.
    Lines(char),
}

/// A parsed calibration file.
///
/// Keys are paths such as `left.pinhole.fx` or `Camera.0.ImageSize`; `K1|M1` means the first that
/// exists. All errors name the file and the key.
pub(super) struct Document {
    path: PathBuf,
    /// Title of its format.
    title: &'static str,
    root: Node,
}

/// The text of a calibration file.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for a file that is too large or not text.
pub(super) fn text(path: &Path) -> Result<String> {
    read_text(path, MAX_BYTES)
}

impl Document {
    /// # Errors
    /// [`Error::Format`] with the line of a syntax error.
    pub(super) fn parse(
        path: &Path,
        text: &str,
        syntax: Syntax,
        title: &'static str,
    ) -> Result<Self> {
        // Editors on Windows put a byte order mark first.
        let text = text.trim_start_matches('\u{feff}');
        let root = match syntax {
            Syntax::Lines(separator) => Ok(parse_lines(text, separator)),
            Syntax::Markup if text.trim_start().starts_with('<') => markup::parse(text),
            Syntax::Markup => yaml::parse(text),
        };
        let root = root.map_err(|fault| Error::format(path, fault))?;
        Ok(Self {
            path: path.to_owned(),
            title,
            root,
        })
    }

    /// An error that names this file.
    pub(super) fn error(&self, reason: impl Display) -> Error {
        Error::format(&self.path, reason.to_string())
    }

    /// The result of the values under `key`, which its error names.
    pub(super) fn keyed<T, E: Display>(&self, key: &str, read: Result<T, E>) -> Result<T> {
        read.map_err(|e| self.error(format_args!("'{key}': {e}")))
    }

    /// Adds the entries of the other file that this one lacks.
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
            self.error(format!(
                "no '{}', which {} has; is it complete?",
                key.replace('|', "' or '"),
                self.title
            ))
        })
    }

    /// # Errors
    /// If the key is missing or not a single value.
    pub(super) fn text(&self, key: &str) -> Result<&str> {
        match self.node(key)? {
            Node::Value(text) => Ok(text.trim()),
            _ => Err(self.error(format!("'{key}' has several values, expected one"))),
        }
    }

    /// All numbers of a list, a matrix or a line.
    ///
    /// # Errors
    /// If the key is missing or a value is not a finite number.
    pub(super) fn numbers(&self, key: &str) -> Result<Vec<f64>> {
        let number = |word: &str| {
            let value = word.parse().ok().filter(|v: &f64| v.is_finite());
            let found = || format!("'{key}' is '{}', expected a finite number", short(word));
            value.ok_or_else(|| self.error(found()))
        };
        let separator = |c: char| c.is_whitespace() || ",;[]".contains(c);
        match self.node(key)? {
            Node::Value(text) => {
                let words = text.split(separator).filter(|word| !word.is_empty());
                words.map(number).collect()
            }
            // OpenCV and ROS nest the numbers of a matrix under `data`.
            Node::Table(_) => self.numbers(&format!("{key}.data").replace('|', ".data|")),
            Node::List(list) => list
                .iter()
                .map(|node| match node {
                    Node::Value(text) => number(text.trim()),
                    _ => Err(self.error(format!("'{key}' is a list of lists, expected numbers"))),
                })
                .collect(),
        }
    }

    /// # Errors
    /// The errors of [`Document::numbers`], and for another count.
    pub(super) fn array<const N: usize>(&self, key: &str) -> Result<[f64; N]> {
        let numbers = self.numbers(key)?;
        numbers.try_into().map_err(|n: Vec<f64>| {
            self.error(format!("'{key}' has {} numbers, expected {N}", n.len()))
        })
    }

    /// # Errors
    /// The errors of [`Document::array`].
    pub(super) fn number(&self, key: &str) -> Result<f64> {
        Ok(self.array::<1>(key)?[0])
    }

    /// Numbers under numbered keys: `rot0`, `rot1` and so on.
    ///
    /// # Errors
    /// The errors of [`Document::array`].
    pub(super) fn counted<const N: usize>(&self, key: &str) -> Result<[f64; N]> {
        let mut numbers = [0.0; N];
        for (i, number) in numbers.iter_mut().enumerate() {
            *number = self.number(&format!("{key}{i}"))?;
        }
        Ok(numbers)
    }

    /// Width and height under separate keys.
    ///
    /// # Errors
    /// The errors of [`Document::number`], and for an invalid image size.
    pub(super) fn size(&self, width: &str, height: &str) -> Result<(usize, usize)> {
        let side = |key: &str| self.side(key, self.number(key)?);
        Ok((side(width)?, side(height)?))
    }

    /// Width and height under one key.
    ///
    /// # Errors
    /// The errors of [`Document::size`].
    pub(super) fn size_of(&self, key: &str) -> Result<(usize, usize)> {
        let [width, height] = self.array(key)?;
        Ok((self.side(key, width)?, self.side(key, height)?))
    }

    fn side(&self, key: &str, side: f64) -> Result<usize> {
        if side.fract() == 0.0 && (1.0..=MAX_SIDE as f64).contains(&side) {
            Ok(side as usize)
        } else {
            Err(self.error(format!(
                "'{key}' is {side}, expected whole pixels, 1 to {MAX_SIDE}"
            )))
        }
    }

    /// A 3 x 3 matrix, row by row.
    ///
    /// # Errors
    /// The errors of [`Document::array`].
    pub(super) fn matrix(&self, key: &str) -> Result<Matrix3<f64>> {
        Ok(Matrix3::from_row_slice(&self.array::<9>(key)?))
    }

    /// A projection matrix, row by row.
    ///
    /// # Errors
    /// The errors of [`Document::array`].
    pub(super) fn projection(&self, key: &str) -> Result<Matrix3x4<f64>> {
        Ok(Matrix3x4::from_row_slice(&self.array::<12>(key)?))
    }

    /// # Errors
    /// The errors of [`Document::array`], and if the matrix is not a rotation.
    pub(super) fn rotation(&self, key: &str) -> Result<Rotation3<f64>> {
        self.keyed(key, stereo::rotation(&self.matrix(key)?))
    }
}

/// `NAME=values` or `NAME: values`, line by line. Lines without the separator are skipped; if a
/// name occurs twice, the second is used.
fn parse_lines(text: &str, separator: char) -> Node {
    let mut table = BTreeMap::new();
    for (name, value) in text.lines().filter_map(|line| line.split_once(separator)) {
        let value = || Node::Value(value.trim().to_owned());
        table.entry(name.trim().to_owned()).or_insert_with(value);
    }
    Node::Table(table)
}

/// The first 40 characters of a word, printable, for a message.
fn short(word: &str) -> String {
    let printed = word.chars().map(|c| if c.is_control() { ' ' } else { c });
    printed.take(40).collect()
}
