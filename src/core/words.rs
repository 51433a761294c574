//! Counts and lists in words.

use std::fmt::Display;

/// `1 pair`, `2 pairs`: a number and its noun, whose plural ends in s.
pub fn counted<N: Display + PartialEq + From<u8>>(n: N, noun: &str) -> String {
    let plural = if n == N::from(1) { "" } else { "s" };
    format!("{n} {noun}{plural}")
}

/// `a, b, c`.
pub fn joined(words: impl IntoIterator<Item = impl Display>) -> String {
    let words: Vec<_> = words.into_iter().map(|word| word.to_string()).collect();
    words.join(", ")
}

/// Number of words of a list in a message.
const LISTED: usize = 8;

/// `a, b, c`, and of more than eight their number: `…, h and 5 more`.
pub fn listed(words: impl IntoIterator<Item = impl Display>) -> String {
    let mut words = words.into_iter();
    let first = joined(words.by_ref().take(LISTED));
    match words.count() {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

/// A text from outside as a terminal may show it: characters that control the terminal or reverse
/// the order of others are escaped, in a form that JSON and TOML read back. Lines and tabs remain.
pub fn printable(text: &str) -> String {
    escaped(text, |c| matches!(c, '\n' | '\t'))
}

/// [`printable`] in one line.
pub fn printable_line(text: &str) -> String {
    escaped(text, |_| false)
}

fn escaped(text: &str, is_kept: impl Fn(char) -> bool) -> String {
    let mut printable = String::with_capacity(text.len());
    for c in text.chars() {
        // Marks of direction (Unicode's Bidi_Control), and ends of lines and paragraphs.
        let is_mark = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2066}'..='\u{2069}');
        if (c.is_control() && !is_kept(c)) || is_mark {
            printable += &format!("\\u{:04x}", u32::from(c));
        } else {
            printable.push(c);
        }
    }
    printable
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminal_controls_are_escaped() {
        let text = "a\u{1b}[2J\u{7}\u{9b}1m\u{202e}\u{2066}\r\u{7f}\u{2028}\tö\u{200d}µ\n";
        let escaped = r"a\u001b[2J\u0007\u009b1m\u202e\u2066\u000d\u007f\u2028";
        assert_eq!(printable(text), format!("{escaped}\tö\u{200d}µ\n"));
        let line = format!(r"{escaped}\u0009ö{}µ\u000a", '\u{200d}');
        assert_eq!(printable_line(text), line);
        let json: String = serde_json::from_str(&format!("\"{line}\"")).unwrap();
        assert_eq!(json, text);
    }

    #[test]
    fn a_list_of_many_is_cut() {
        assert_eq!(listed(1..9), "1, 2, 3, 4, 5, 6, 7, 8");
        assert_eq!(listed(1..12), "1, 2, 3, 4, 5, 6, 7, 8 and 3 more");
        assert_eq!(listed([""; 0]), "");
    }

    #[test]
    fn one_is_singular() {
        assert_eq!(
            [0, 1, 2].map(|n: u64| counted(n, "left image")),
            ["0 left images", "1 left image", "2 left images"]
        );
    }
}
