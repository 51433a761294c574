//! Quoting in settings and commands: text in `'…'` or `"…"` is not split.

/// The parts of `text` between separators outside quotes, quotes kept.
pub(super) fn split(text: &str, separator: char) -> impl Iterator<Item = &str> {
    let mut open = None;
    text.split(move |c| {
        open = after(open, c);
        c == separator && open.is_none()
    })
}

/// True if every quote is closed.
pub(super) fn closed(text: &str) -> bool {
    text.chars().fold(None, after).is_none()
}

/// `text` without its quotes, if it is quoted as a whole.
pub(super) fn unquote(text: &str) -> &str {
    let inner = |quote| {
        text.strip_prefix(quote)?
            .strip_suffix(quote)
            .filter(|inner| !inner.contains(quote))
    };
    inner('"').or_else(|| inner('\'')).unwrap_or(text)
}

/// The words of a command, quotes taken away.
#[cfg(feature = "exec")]
pub(super) fn words(command: &str) -> Vec<String> {
    let mut words = Vec::new();
    for word in split(command, ' ').filter(|word| !word.is_empty()) {
        let mut open = None;
        // A character that opens or closes a quote is dropped.
        let kept = word.chars().filter(|&c| {
            let before = open;
            open = after(before, c);
            before == open
        });
        words.push(kept.collect());
    }
    words
}

/// The quote that is open after `c`, given the one before.
fn after(open: Option<char>, c: char) -> Option<char> {
    match (open, c) {
        (None, '"' | '\'') => Some(c),
        (Some(quote), _) if c == quote => None,
        (open, _) => open,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_keep_commas_together() {
        let parts: Vec<_> = split(r#"a=1,b='x,"y',c="p,'q",d=,e=3"#, ',').collect();
        assert_eq!(parts, ["a=1", r#"b='x,"y'"#, r#"c="p,'q""#, "d=", "e=3"]);
    }

    #[test]
    fn only_a_whole_is_unquoted() {
        for (text, plain) in [
            ("'a b'", "a b"),
            ("'a' 'b'", "'a' 'b'"),
            ("\"a'b\"", "a'b"),
            ("a", "a"),
            ("'", "'"),
        ] {
            assert_eq!(unquote(text), plain);
        }
        assert!(closed("a 'b' \"c'\"") && !closed("it's"));
    }

    #[cfg(feature = "exec")]
    #[test]
    fn a_command_is_taken_apart_as_a_shell_would() {
        assert_eq!(
            words(r#" python3  "my adapter.py" --sizes='3,5' "" "#),
            ["python3", "my adapter.py", "--sizes=3,5", ""]
        );
    }
}
