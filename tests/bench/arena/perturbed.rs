//! The scenarios of perturbed arenas equal the arena except for the change in their names.

use std::fs::read_to_string;
use std::path::Path;

/// The lines of a scenario from its name to its gate, without comments.
fn lines(name: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenarios/{name}.toml"));
    let text = read_to_string(path).unwrap();
    let text = text.split("[[gate]]").next().unwrap().to_owned();
    let stripped = text.lines().map(|line| match line.split_once('#') {
        // No text in these scenarios contains a '#'.
        Some((before, _)) => before.trim_end().to_owned(),
        None => line.to_owned(),
    });
    stripped.filter(|line| !line.is_empty()).collect()
}

#[test]
fn worse_arenas_differ_from_the_arena_in_what_they_say() {
    for (name, changed) in [
        ("arena-row", &["right_row_offset_px = 1.0"][..]),
        ("arena-gain", &["right_gain_db = 1.0"]),
        (
            "arena-noise",
            &[
                "white_e_per_ms = 425.0",
                "full_scale_e = 2250.0",
                "read_noise_e = 12.5",
            ],
        ),
    ] {
        let (arena, worse) = (lines("arena"), lines(name));
        assert_eq!(arena.len(), worse.len(), "{name}");
        let differing: Vec<_> = arena
            .iter()
            .zip(&worse)
            .filter(|(a, b)| a != b)
            .map(|(_, b)| b.as_str())
            .collect();
        let named = format!("name = \"{name}\"");
        assert_eq!(differing[0], named);
        assert!(differing[1].starts_with("description = "));
        let mut rest = differing[2..].to_vec();
        rest.retain(|line| *line != "seeds = [21, 22]");
        assert_eq!(rest, changed, "{name}");
    }
}
