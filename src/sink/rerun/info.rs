//! What is known of a run before its first frame.

use crate::stereo::ExtraPlanes;

/// The run: who takes part, and where.
#[derive(Clone, Debug, Default)]
pub struct RunInfo {
    /// One for all algorithms of a run.
    pub recording_id: String,
    /// Name of the scenario or source, shown as the recording's name.
    pub scenario: String,
    /// The algorithms as they were asked for, each with its parameters in words.
    pub algorithms: Vec<(String, String)>,
    /// True geometry, empty where unknown.
    pub wireframe: Vec<Edges>,
}

/// The edges of a thing in the world.
#[derive(Clone, Debug)]
pub struct Edges {
    pub name: String,
    /// Line strips, world frame, metres.
    pub strips: Vec<Vec<[f32; 3]>>,
}

/// An algorithm of the run: its label, and the label as part of a path.
pub(super) struct Algorithm {
    pub label: String,
    pub part: String,
    /// What its maps have besides disparities and reasons, known from the first frame on.
    pub extra: ExtraPlanes,
}

impl Algorithm {
    /// Path of one of its entities.
    pub(super) fn path(&self, entity: &str) -> String {
        format!("algo/{}/{entity}", self.part)
    }
}

/// The labels as parts of entity paths, which have their own meaning for `/ : = ,` and spaces:
/// letters, digits, `_` and `.` stay, the rest becomes `-`. Labels that would become equal are
/// numbered.
pub(super) fn algorithms(labels: impl Iterator<Item = String>) -> Vec<Algorithm> {
    let safe = |c: char| {
        if c.is_ascii_alphanumeric() || matches!(c, '_' | '.') {
            c
        } else {
            '-'
        }
    };
    let mut made: Vec<Algorithm> = Vec::new();
    for label in labels {
        let stem: String = label.chars().map(safe).collect();
        let names = std::iter::once(stem.clone()).chain((2..).map(|n| format!("{stem}-{n}")));
        // The numbers never end, so one of them is free.
        let part = names
            .into_iter()
            .find(|name| made.iter().all(|a| a.part != *name))
            .unwrap_or(stem);
        made.push(Algorithm {
            label,
            part,
            extra: ExtraPlanes::NONE,
        });
    }
    made
}

/// The run's head line and its parameters.
pub(super) fn parameters(run: &RunInfo) -> String {
    let rows = run
        .algorithms
        .iter()
        .map(|(label, parameters)| format!("\n### {label}\n{parameters}\n"));
    format!("# {}\n{}", run.scenario, rows.collect::<String>())
}

/// What stands for the verdicts until there are some.
pub(super) fn awaiting(run: &RunInfo) -> String {
    format!(
        "# {}\n\nNo checkpoint has been judged: verdicts come at the end of a scored run.\n",
        run.scenario
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_become_parts_of_paths() {
        let labels = [
            "v3",
            "v3:max_disparity=64",
            "v3:max_disparity,64",
            "exec:a b/c",
        ];
        let parts: Vec<_> = algorithms(labels.into_iter().map(str::to_owned))
            .into_iter()
            .map(|a| a.part)
            .collect();
        assert_eq!(
            parts,
            [
                "v3",
                "v3-max_disparity-64",
                "v3-max_disparity-64-2",
                "exec-a-b-c"
            ]
        );
    }
}
