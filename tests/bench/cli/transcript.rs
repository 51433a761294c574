//! Transcripts: commands with what they have to print, one per line.

use super::fixture::{Fixture, Ran};
use serde_json::Value;
use std::cmp::Ordering;
use std::fs;

impl Fixture {
    /// Runs the commands of a transcript in the folder, and checks what is expected of each. Lines
    /// starting with `#` are comments. No data sets are found.
    ///
    /// - `COMMAND`: `svl COMMAND` succeeds.
    /// - `COMMAND => WORDS | WORDS`: it succeeds, and its output has all these words.
    /// - `COMMAND => CODE: WORDS | WORDS`: it fails with this code and one line that has them.
    /// - `COMMAND => CODE~ WORDS | WORDS`: it ends with this code; standard error has them.
    /// - `COMMAND => WORDS => CODE: WORDS`: both.
    /// - `cat FILE => WORDS | WORDS`: a file has these words.
    /// - `cp`, `mv`, `mkdir`, `rm`, `test -e FILE`, `test ! -e FILE`: as in a shell.
    ///
    /// For the conditions in place of `WORDS` see [`assert_words`].
    #[track_caller]
    pub fn transcript(&self, lines: &str) {
        let lines = lines.lines().map(str::trim);
        for line in lines.filter(|line| !line.is_empty() && !line.starts_with('#')) {
            println!("{line}");
            let mut parts = line.trim_end_matches(" =>").split(" => ");
            let command = parts.next().unwrap_or_default();
            let ran = self.ran_in_shell(command);
            let ran = ran.unwrap_or_else(|| self.svl_with(command, &[("SVL_DATASETS", "")]));
            let expected: Vec<_> = parts.map(Expected::from_text).collect();
            let code = expected.iter().find_map(|part| part.code);
            let said = format!("{line}\n{}{}", ran.stdout, ran.stderr);
            assert_eq!(ran.code, Some(code.unwrap_or(0)), "{said}");
            for part in expected {
                match (part.code, part.is_error) {
                    (None, _) => assert_words(&ran.stdout, part.words),
                    (_, true) => assert_words(ran.error(), part.words),
                    (_, false) => assert_words(&ran.stderr, part.words),
                }
            }
        }
    }

    /// Does what a shell does with files; `None` if it is another command.
    #[track_caller]
    fn ran_in_shell(&self, command: &str) -> Option<Ran> {
        let words: Vec<_> = command.split(' ').collect();
        let mut stdout = String::new();
        match words[..] {
            ["cat", file] => stdout = self.text(file),
            ["cp", from, to] => drop(fs::copy(self.path(from), self.path(to)).unwrap()),
            ["mv", from, to] => fs::rename(self.path(from), self.path(to)).unwrap(),
            ["mkdir", folder] => fs::create_dir_all(self.path(folder)).unwrap(),
            ["rm", file] => fs::remove_file(self.path(file)).unwrap(),
            ["test", "-e", file] => assert!(self.path(file).exists(), "{file}"),
            ["test", "!", "-e", file] => assert!(!self.path(file).exists(), "{file}"),
            _ => return None,
        }
        let (code, stderr) = (Some(0), String::new());
        Some(Ran {
            code,
            stdout,
            stderr,
        })
    }
}

/// What is expected behind an arrow of a transcript.
struct Expected<'a> {
    /// `None`: of the output of a command that succeeds.
    code: Option<i32>,
    /// One line with an error.
    is_error: bool,
    words: &'a str,
}

impl<'a> Expected<'a> {
    fn from_text(text: &'a str) -> Self {
        let coded = |mark: &str, is_error| {
            let (code, words) = text.split_once(mark)?;
            let code = Some(code.parse().ok()?);
            Some(Self {
                code,
                is_error,
                words: words.trim_start(),
            })
        };
        let plain = Self {
            code: None,
            is_error: false,
            words: text,
        };
        coded(": ", true).or(coded("~", false)).unwrap_or(plain)
    }
}

/// The words of a text, separated by one space each.
pub fn plain(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Asserts conditions on a text, which are separated by ` | `:
///
/// - `WORDS`: it has these words, also across the ends of lines; `\n` is an end of a line.
/// - `!WORDS`: it does not have them; `^WORDS`: it begins with them.
/// - `2x WORDS`: it has them twice.
/// - `/PATH = VALUE`, `!=`, `<`, `>`, `has`: of the JSON that the text is; see [`values`].
/// - `/PATH absent`: the JSON has no value there, but what would hold it.
#[track_caller]
pub fn assert_words(text: &str, conditions: &str) {
    let conditions = conditions.replace("\\n", "\n");
    for condition in conditions.split(" | ").filter(|words| !words.is_empty()) {
        assert!(
            is_true(text, condition),
            "'{condition}' is not true of: {text}"
        );
    }
}

fn is_true(text: &str, condition: &str) -> bool {
    let plain = plain(text);
    let count = |words: &str| {
        let counts = [text, &plain].map(|text| text.matches(words).count());
        counts.into_iter().max().unwrap_or_default()
    };
    let counted = condition.split_once("x ");
    let counted = counted.and_then(|(n, words)| Some((n.parse::<usize>().ok()?, words)));
    let of_json = condition.starts_with('/').then(|| holds(text, condition));
    match (condition.split_at_checked(1), counted, of_json.flatten()) {
        (Some(("!", words)), ..) => count(words) == 0,
        (Some(("^", words)), ..) => [text, &plain].iter().any(|text| text.starts_with(words)),
        (_, Some((times, words)), _) => count(words) == times,
        (.., Some(is_true)) => is_true,
        _ => count(condition) > 0,
    }
}

/// The truth of a condition on JSON, of all values at its path; `None` for any other text.
fn holds(text: &str, condition: &str) -> Option<bool> {
    if let Some(path) = condition.strip_suffix(" absent") {
        let at = |path| values(serde_json::from_str(text).unwrap(), path);
        let (parent, _) = path.rsplit_once('/')?;
        return Some(!at(parent).is_empty() && at(path).is_empty());
    }
    let mut parts = condition.splitn(3, ' ');
    let (path, operator, expected) = (parts.next()?, parts.next()?, parts.next()?);
    if !["=", "!=", "<", ">", "has"].contains(&operator) {
        return None;
    }
    let expected: Value = serde_json::from_str(expected).unwrap_or_else(|_| expected.into());
    let found = values(serde_json::from_str(text).unwrap(), path);
    let is_true = |value: &Value| {
        let numbers = value.as_f64().zip(expected.as_f64());
        let order = numbers.and_then(|(value, expected)| value.partial_cmp(&expected));
        let text = expected.as_str().unwrap_or_default();
        let is_equal = *value == expected || order == Some(Ordering::Equal);
        match operator {
            "=" => is_equal,
            "!=" => !is_equal,
            "has" => value.to_string().contains(text),
            "<" => order == Some(Ordering::Less),
            _ => order == Some(Ordering::Greater),
        }
    };
    Some(!found.is_empty() && found.iter().all(is_true))
}

/// The values at a path of JSON, as `/algorithms/v3/pairs`: names and numbers; in an array also a
/// text that its element has; `*` for all elements, and `#` for their number.
fn values(json: Value, path: &str) -> Vec<Value> {
    let step = |value: Value, step: &str| match (&value, step.parse::<usize>()) {
        (Value::Array(all), _) if step == "*" => all.clone(),
        (Value::Array(all), _) if step == "#" => vec![all.len().into()],
        (Value::Array(all), Err(_)) => {
            let is_named = |own: &&Value| own.as_object().is_some_and(|own| has(own, step));
            all.iter().find(is_named).cloned().into_iter().collect()
        }
        (Value::Array(all), Ok(place)) => all.get(place).cloned().into_iter().collect(),
        _ => value.get(step).cloned().into_iter().collect(),
    };
    let steps = path.split('/').skip(1);
    steps.fold(vec![json], |values, name| {
        let values = values.into_iter();
        values.flat_map(|value| step(value, name)).collect()
    })
}

fn has(object: &serde_json::Map<String, Value>, text: &str) -> bool {
    object.values().any(|value| value == text)
}

#[test]
fn conditions_tell_true_from_false() {
    let text = "two words\n  of two lines";
    let json = r#"{"a": 1.0, "b": null, "c": [{"name": "x", "n": 2}, {"n": 3}], "d": []}"#;
    let cases = [
        (text, "words of", "words two"),
        (text, "!three", "!two"),
        (text, "^two", "^words"),
        (text, "2x two", "1x two"),
        (json, "/a = 1", "/a = 2"),
        (json, "/a != 2", "/a != 1"),
        (json, "/a < 2", "/a < 1"),
        (json, "/a > 0", "/a > 1"),
        (json, "/b = null", "/none = null"),
        (json, "/none absent", "/b absent"),
        (json, "/c/*/none absent", "/d/*/none absent"),
        (json, "/c/x/n = 2", "/c/x/n = 3"),
        (json, "/c/1/n = 3", "/c/2/n = 3"),
        (json, "/c/# = 2", "/c/# = 1"),
        (json, "/c/*/n > 1", "/c/*/n > 2"),
        (json, "/c/0/name has x", "/c/0/name has y"),
    ];
    for (text, right, wrong) in cases {
        assert!(is_true(text, right), "{right}");
        assert!(!is_true(text, wrong), "{wrong}");
    }
}
