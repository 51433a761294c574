use crate::fixture::Fixture;

#[test]
fn help_tells_what_svl_is_for() {
    insta::assert_snapshot!(Fixture::new().svl(&["--help"]).done());
}

#[test]
fn every_subcommand_has_help_with_an_example() {
    let fixture = Fixture::new();
    for command in ["record", "replay", "score", "match", "algos", "info", "view", "completions"] {
        let text = fixture.svl(&[command, "--help"]).done();
        assert!(text.contains("Example"), "{command} --help shows no example");
    }
}

#[test]
fn no_arguments_is_wrong_usage() {
    assert_eq!(Fixture::new().svl(&[]).code, Some(2));
}

#[test]
fn completions_and_man_page() {
    let fixture = Fixture::new();
    assert!(fixture.svl(&["completions", "bash"]).done().contains("_svl"));
    assert!(fixture.svl(&["man"]).done().contains(".TH svl"));
}
