//! JUnit's XML, in which CI servers show passes and failures.

use quick_xml::escape::escape;
use std::collections::HashMap;
use std::fmt::Write;

/// One limit or comparison.
pub struct TestCase {
    /// The same in every run, as servers follow a test by its name: without measured values.
    pub name: String,
    pub result: TestResult,
}

/// Result of a test case, with the values or the reason in words.
pub enum TestResult {
    Passed(String),
    Failed(String),
    /// There was nothing to test.
    Skipped(String),
}

/// A document of one suite. A number follows a name that an earlier case has.
pub fn junit(suite: &str, cases: &[TestCase]) -> String {
    let count = |is_counted: fn(&TestResult) -> bool| {
        cases.iter().filter(|case| is_counted(&case.result)).count()
    };
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"{}\" tests=\"{}\" \
         failures=\"{}\" skipped=\"{}\">\n",
        escape(suite),
        cases.len(),
        count(|result| matches!(result, TestResult::Failed(_))),
        count(|result| matches!(result, TestResult::Skipped(_))),
    );
    let mut seen: HashMap<&str, usize> = HashMap::new();
    for TestCase { name, result } in cases {
        let count = seen.entry(name).or_default();
        *count += 1;
        let name = match *count {
            1 => name.clone(),
            n => format!("{name} ({n})"),
        };
        let name = escape(name.as_str());
        let inside = match result {
            TestResult::Passed(words) if words.is_empty() => String::new(),
            TestResult::Passed(words) => {
                format!("<system-out>{}</system-out>", escape(words.as_str()))
            }
            TestResult::Failed(why) => format!("<failure message=\"{}\"/>", escape(why.as_str())),
            TestResult::Skipped(why) => format!("<skipped message=\"{}\"/>", escape(why.as_str())),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "  <testcase classname=\"svl\" name=\"{name}\">{inside}</testcase>"
        );
    }
    text.push_str("</testsuite>\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_names_are_numbered() {
        let case = |name: &str| TestCase {
            name: name.to_owned(),
            result: TestResult::Passed(String::new()),
        };
        let text = junit("s", &[case("a"), case("b"), case("a")]);
        for name in ["\"a\"", "\"b\"", "\"a (2)\""] {
            assert_eq!(text.matches(&format!("name={name}>")).count(), 1, "{text}");
        }
    }

    #[test]
    fn names_are_escaped_and_results_counted() {
        let case = |name: &str, result| TestCase {
            name: name.to_owned(),
            result,
        };
        let text = junit(
            "a & b",
            &[
                case("kept", TestResult::Passed("4 < 5".into())),
                case("wrong < 5 %", TestResult::Failed("6 \"per cent\"".into())),
                case("absent", TestResult::Skipped("not in the run".into())),
            ],
        );
        assert!(text.contains("name=\"a &amp; b\" tests=\"3\" failures=\"1\" skipped=\"1\""));
        assert!(text.contains("name=\"kept\"><system-out>4 &lt; 5</system-out></testcase>"));
        assert!(text.contains("name=\"wrong &lt; 5 %\"><failure message=\"6 &quot;per cent"));
        let mut reader = quick_xml::Reader::from_str(&text);
        while reader.read_event().unwrap() != quick_xml::events::Event::Eof {}
    }
}
