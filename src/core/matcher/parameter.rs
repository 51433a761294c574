//! Parameters as data: the command line, `svl algos`, scenario files and the contract tests all
//! read the same tables.

use super::MatcherSpec;
use super::quotes::{closed, split, unquote};
use crate::error::{Error, Result, nearest};
use crate::inputs;
use std::io::Read;
use std::ops::RangeInclusive;
use std::path::Path;

/// A parameter of an algorithm.
pub struct Parameter {
    pub name: &'static str,
    /// Unit of the value, empty for a plain number.
    pub unit: &'static str,
    pub range: Range,
    pub description: &'static str,
}

/// Kind, default and admissible values of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    Int {
        default: i32,
        min: i32,
        max: i32,
    },
    Real {
        default: f64,
        min: f64,
        max: f64,
    },
    Flag {
        default: bool,
    },
    Text {
        default: &'static str,
    },
    Choice {
        default: &'static str,
        options: &'static [&'static str],
    },
    /// A file, none by default.
    File,
    /// A topic of the recording; as the first setting it needs no name.
    Topic,
    /// A pattern of files; as the first setting it needs no name.
    Pattern,
}

/// Largest file that a parameter may name, bytes.
const MAX_FILE: u64 = 1 << 20;

/// A parameter's value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    Int(i32),
    Real(f64),
    Flag(bool),
    Text(String),
    Choice(&'static str),
    File(Option<ParameterFile>),
}

/// A file that a parameter names, read when the algorithm is parsed.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterFile {
    pub path: String,
    pub bytes: Vec<u8>,
}

impl Value {
    /// The file of that name with these bytes, which need not exist.
    pub fn file(path: &str, bytes: Vec<u8>) -> Self {
        let path = path.to_owned();
        Self::File(Some(ParameterFile { path, bytes }))
    }
}

impl Range {
    /// False for what says which program, file or topic an algorithm is.
    pub fn is_setting(self) -> bool {
        !matches!(
            self,
            Self::Text { .. } | Self::File | Self::Topic | Self::Pattern
        )
    }

    /// Whole numbers in `range`.
    pub const fn int(default: i32, range: RangeInclusive<i32>) -> Self {
        Self::Int {
            default,
            min: *range.start(),
            max: *range.end(),
        }
    }

    /// Real numbers in `range`.
    pub const fn real(default: f64, range: RangeInclusive<f64>) -> Self {
        Self::Real {
            default,
            min: *range.start(),
            max: *range.end(),
        }
    }

    pub fn default(&self) -> Value {
        match *self {
            Range::Int { default, .. } => Value::Int(default),
            Range::Real { default, .. } => Value::Real(default),
            Range::Flag { default } => Value::Flag(default),
            Range::Text { default } => Value::Text(default.to_owned()),
            Range::Choice { default, .. } => Value::Choice(default),
            Range::File => Value::File(None),
            Range::Topic | Range::Pattern => Value::Text(String::new()),
        }
    }

    /// True if it needs no name as the first setting.
    fn is_positional(&self) -> bool {
        matches!(self, Range::Topic | Range::Pattern)
    }

    /// The value of `text`, if it lies in the range.
    pub fn parse(&self, text: &str) -> Option<Value> {
        match *self {
            Range::Int { min, max, .. } => text
                .parse()
                .ok()
                .filter(|v| (min..=max).contains(v))
                .map(Value::Int),
            Range::Real { min, max, .. } => text
                .parse()
                .ok()
                .filter(|v| (min..=max).contains(v))
                .map(Value::Real),
            Range::Flag { .. } => text.parse().ok().map(Value::Flag),
            Range::Text { .. } | Range::Topic | Range::Pattern => {
                closed(text).then(|| Value::Text(unquote(text).to_owned()))
            }
            Range::Choice { options, .. } => options
                .iter()
                .find(|o| **o == text)
                .copied()
                .map(Value::Choice),
            Range::File if text.is_empty() => Some(Value::File(None)),
            Range::File => ParameterFile::read(unquote(text)).map(|file| Value::File(Some(file))),
        }
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Range::Int { min, max, .. } => write!(f, "a whole number in {min}..={max}"),
            Range::Real { min, max, .. } => write!(f, "a number in {min}..={max}"),
            Range::Flag { .. } => write!(f, "true or false"),
            Range::Text { .. } | Range::Topic | Range::Pattern => {
                write!(f, "a text that closes its quotes")
            }
            Range::Choice { options, .. } => write!(f, "one of {}", options.join(", ")),
            Range::File => write!(f, "a readable file of at most {} MiB", MAX_FILE >> 20),
        }
    }
}

impl Value {
    /// In the form that [`Range::parse`] reads.
    pub fn written(&self) -> String {
        match self {
            Value::File(Some(file)) => Value::Text(file.path.clone()).to_string(),
            other => other.to_string(),
        }
    }

    /// The value as a number, if it is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Value::Int(v) => Some(f64::from(*v)),
            Value::Real(v) => Some(*v),
            _ => None,
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Int(v) => write!(f, "{v}"),
            Value::Real(v) => write!(f, "{v}"),
            Value::Flag(v) => write!(f, "{v}"),
            // In quotes if it would be parsed differently without them.
            Value::Text(v) if split(v, ',').count() < 2 && unquote(v) == v => write!(f, "{v}"),
            Value::Text(v) => write!(
                f,
                "{quote}{v}{quote}",
                quote = if v.contains('"') { '\'' } else { '"' }
            ),
            Value::Choice(v) => write!(f, "{v}"),
            Value::File(None) => Ok(()),
            // Equal contents are equal parameters: that of the file is included.
            Value::File(Some(file)) => {
                let hash = xxhash_rust::xxh3::xxh3_64(&file.bytes);
                write!(f, "{}#h{hash:016x}", file.path)
            }
        }
    }
}

impl ParameterFile {
    fn read(path: &str) -> Option<Self> {
        // Before opening: opening a pipe would wait for its writer.
        let is_file = std::fs::metadata(path).is_ok_and(|metadata| metadata.is_file());
        let file = inputs::open(Path::new(path)).ok().filter(|_| is_file)?;
        let mut bytes = Vec::new();
        // One more than allowed, as the file may grow while it is read.
        file.take(MAX_FILE + 1).read_to_end(&mut bytes).ok()?;
        let path = path.to_owned();
        (bytes.len() as u64 <= MAX_FILE).then_some(Self { path, bytes })
    }
}

/// The cure of a range of disparities beyond the limit: smaller images.
fn scaled_range(name: &str, text: &str, range: &Range) -> String {
    let Range::Int { max, .. } = *range else {
        return String::new();
    };
    match text.parse::<f64>().map(|px| (px, f64::from(max) / px)) {
        Ok((px, most)) if name == "max_disparity" && (0.01..1.0).contains(&most) => {
            format!("; {}", at_scale(most, px))
        }
        _ => String::new(),
    }
}

/// Images so much smaller, with their range of disparities, in words.
pub(super) fn at_scale(most: f64, max_disparity: f64) -> String {
    let scale = (100.0 * most).floor() / 100.0;
    let px = (scale * max_disparity).ceil();
    format!("images of `--scale {scale}` need max_disparity={px}")
}

/// A value for every parameter of an algorithm, each within its range.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters(Vec<(&'static str, Value)>);

/// Place of a parameter in the algorithm's table.
fn index(spec: &MatcherSpec, name: &str) -> Result<usize> {
    let place = spec.parameters.iter().position(|p| p.name == name);
    place.ok_or_else(|| Error::UnknownParameter {
        algorithm: spec.name,
        name: name.to_owned(),
        nearest: nearest(name, spec.parameters.iter().map(|p| p.name)),
    })
}

/// Name and value of a setting. A name alone has an empty value, which only text ranges accept.
pub(super) fn named<'a>(
    spec: &MatcherSpec,
    setting: &'a str,
    is_first: bool,
) -> (&'a str, &'a str) {
    let named = setting.split_once('=');
    match spec.parameters.first() {
        Some(first) if is_first && first.range.is_positional() => {
            let named = named.filter(|(name, _)| spec.parameter(name).is_some());
            named.unwrap_or((first.name, setting))
        }
        _ => named.unwrap_or((setting, "")),
    }
}

impl Parameters {
    /// The algorithm's defaults.
    pub fn defaults(spec: &MatcherSpec) -> Self {
        Self(
            spec.parameters
                .iter()
                .map(|p| (p.name, p.range.default()))
                .collect(),
        )
    }

    /// The defaults changed by `settings`, written `key=value,key=value`. A text with commas needs
    /// single or double quotes, around the whole or around the commas.
    ///
    /// # Errors
    /// [`Error::UnknownParameter`] with the nearest name, [`Error::ParameterValue`] with what is
    /// expected; [`Error::Usage`] for a parameter given twice.
    pub fn parse(spec: &MatcherSpec, settings: &str) -> Result<Self> {
        let mut parameters = Self::defaults(spec);
        let mut given = Vec::new();
        for setting in split(settings, ',').filter(|s| !s.is_empty()) {
            let (name, text) = named(spec, setting, given.is_empty());
            let index = index(spec, name)?;
            if given.contains(&index) {
                return Err(Error::Usage(format!(
                    "{}: {name} is given twice; omit one",
                    spec.name
                )));
            }
            given.push(index);
            let range = &spec.parameters[index].range;
            // The defaults are in the order of the table, so they share its indices.
            parameters.0[index].1 = range.parse(text).ok_or_else(|| Error::ParameterValue {
                algorithm: spec.name,
                name: name.to_owned(),
                value: text.to_owned(),
                expected: range.to_string() + &scaled_range(name, text, range),
            })?;
        }
        Ok(parameters)
    }

    /// The same with another value of a parameter.
    ///
    /// # Errors
    /// The errors of [`Parameters::parse`].
    pub fn with(&self, spec: &MatcherSpec, name: &str, value: &Value) -> Result<Self> {
        let index = index(spec, name)?;
        let mut with = self.clone();
        with.0[index].1 = match value {
            Value::File(_) => value.clone(),
            _ => {
                let setting = format!("{name}={}", value.written());
                Self::parse(spec, &setting)?.value(name).clone()
            }
        };
        Ok(with)
    }

    /// All values that differ from the defaults, as accepted by [`Parameters::parse`].
    pub fn changes(&self, spec: &MatcherSpec) -> String {
        let values = self.iter().zip(spec.parameters);
        let changed = values.filter(|((_, value), parameter)| **value != parameter.range.default());
        let settings = changed.map(|((name, value), parameter)| match parameter.range {
            range if range.is_positional() => value.written(),
            _ => format!("{name}={}", value.written()),
        });
        settings.collect::<Vec<_>>().join(",")
    }

    /// Names and values in the order of the algorithm's table.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.0.iter().map(|(name, value)| (*name, value))
    }

    /// The whole number `name`.
    ///
    /// # Panics
    /// If the algorithm's table has no such whole number: an error in the algorithm's own file.
    pub fn int(&self, name: &str) -> i32 {
        match self.value(name) {
            Value::Int(v) => *v,
            other => panic!("parameter {name} is {other:?}"),
        }
    }

    /// The number `name`.
    ///
    /// # Panics
    /// Panics as [`Parameters::int`] does.
    pub fn real(&self, name: &str) -> f64 {
        match self.value(name) {
            Value::Real(v) => *v,
            other => panic!("parameter {name} is {other:?}"),
        }
    }

    /// The switch `name`.
    ///
    /// # Panics
    /// Panics as [`Parameters::int`] does.
    pub fn flag(&self, name: &str) -> bool {
        match self.value(name) {
            Value::Flag(v) => *v,
            other => panic!("parameter {name} is {other:?}"),
        }
    }

    /// The text `name`.
    ///
    /// # Panics
    /// Panics as [`Parameters::int`] does.
    pub fn text(&self, name: &str) -> &str {
        match self.value(name) {
            Value::Text(v) => v,
            other => panic!("parameter {name} is {other:?}"),
        }
    }

    /// The file `name`, if one is given.
    ///
    /// # Panics
    /// Panics as [`Parameters::int`] does.
    pub fn file(&self, name: &str) -> Option<&ParameterFile> {
        match self.value(name) {
            Value::File(v) => v.as_ref(),
            other => panic!("parameter {name} is {other:?}"),
        }
    }

    /// The option chosen for `name`.
    ///
    /// # Panics
    /// Panics as [`Parameters::int`] does.
    pub fn choice(&self, name: &str) -> &'static str {
        match self.value(name) {
            Value::Choice(v) => v,
            other => panic!("parameter {name} is {other:?}"),
        }
    }

    fn value(&self, name: &str) -> &Value {
        match self.0.iter().find(|(n, _)| *n == name) {
            Some((_, value)) => value,
            None => panic!("no parameter {name}"),
        }
    }
}

impl std::fmt::Display for Parameters {
    /// `key=value,key=value`, complete: equal texts are equal parameters.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (i, (name, value)) in self.iter().enumerate() {
            write!(f, "{}{name}={value}", if i == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}
