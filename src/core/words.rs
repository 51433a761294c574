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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular() {
        assert_eq!(
            [0, 1, 2].map(|n: u64| counted(n, "left image")),
            ["0 left images", "1 left image", "2 left images"]
        );
    }
}
