//! The command of an exec algorithm: words and quotes.

use svl_core::matcher::{Algorithm, Value};

#[test]
fn a_command_that_cannot_start_is_told_before_the_first_pair() {
    let error = |text: &str| {
        text.parse::<Algorithm>()
            .and_then(|a| a.build())
            .err()
            .unwrap()
            .to_string()
    };
    let missing = error("exec:command=no-such-program --fast");
    assert!(
        missing.contains("program `no-such-program --fast` cannot be started")
            && !missing.contains('\n'),
        "{missing}"
    );
    assert!(error("exec").contains("exec:command=PROGRAM"));
    assert!(error("exec:command=it's").contains("closes its quotes"));
}

#[test]
fn a_command_with_commas_stands_in_quotes() {
    let command = |text: &str| {
        let algorithm: Algorithm = text.parse().unwrap();
        let again: Algorithm = format!("exec:{}", algorithm.parameters()).parse().unwrap();
        assert_eq!(
            algorithm.parameters(),
            again.parameters(),
            "written and read again"
        );
        assert_eq!(algorithm.parameters().int("max_disparity"), 64, "{text}");
        let command = algorithm
            .parameters()
            .iter()
            .find(|(name, _)| *name == "command")
            .unwrap()
            .1;
        match command {
            Value::Text(command) => command.clone(),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(
        command("exec:command=python3 a.py --x=1:2,max_disparity=64"),
        "python3 a.py --x=1:2"
    );
    assert_eq!(
        command("exec:command='python3 a.py 1,2',max_disparity=64"),
        "python3 a.py 1,2"
    );
    assert_eq!(
        command("exec:max_disparity=64,command=python3 'a b.py' \"1,2\""),
        "python3 'a b.py' \"1,2\""
    );
    assert_eq!(
        command("exec:command=\"python3 'a, b.py'\",max_disparity=64"),
        "python3 'a, b.py'"
    );
}
