//! JUnit's XML, in which CI servers show passes and failures.

use quick_xml::escape::escape;
use std::fmt::Write;

/// One limit or comparison.
pub struct TestCase {
    pub name: String,
    /// Reason why it failed or was skipped, in words.
    pub result: TestResult,
}

/// Its result.
pub enum TestResult {
    Passed,
    Failed(String),
    /// There was nothing to test.
    Skipped(String),
}

/// A document of one suite.
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
    for TestCase { name, result } in cases {
        let name = escape(name.as_str());
        let inside = match result {
            TestResult::Passed => String::new(),
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
    fn names_are_escaped_and_results_counted() {
        let case = |name: &str, result| TestCase {
            name: name.to_owned(),
            result,
        };
        let text = junit(
            "a & b",
            &[
                case("kept", TestResult::Passed),
                case("wrong < 5 %", TestResult::Failed("6 \"per cent\"".into())),
                case("absent", TestResult::Skipped("not in the run".into())),
            ],
        );
        assert!(text.contains("name=\"a &amp; b\" tests=\"3\" failures=\"1\" skipped=\"1\""));
        assert!(text.contains("name=\"wrong &lt; 5 %\"><failure message=\"6 &quot;per cent"));
        let mut reader = quick_xml::Reader::from_str(&text);
        while reader.read_event().unwrap() != quick_xml::events::Event::Eof {}
    }
}
