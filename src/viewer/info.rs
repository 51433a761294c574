//! Static facts of a run in Rerun, and the entity paths of its algorithms.

use svl_bench::sink::ViewedScene;
use svl_core::stereo::ExtraPlanes;
use svl_files::safe_name;

/// An algorithm of the run: its label, and the label as part of a path.
pub(crate) struct AlgorithmPath {
    pub label: String,
    pub part: String,
    /// Planes of its maps besides disparities and reasons, known from the first frame on.
    pub extra: ExtraPlanes,
}

impl AlgorithmPath {
    /// Path of one of its entities.
    pub(crate) fn path(&self, entity: &str) -> String {
        format!("algo/{}/{entity}", self.part)
    }
}

/// The labels as parts of entity paths: letters, digits, `_` and `.` are kept, the rest becomes
/// `-`. Labels that would become equal are numbered.
pub(crate) fn algorithms(labels: impl Iterator<Item = String>) -> Vec<AlgorithmPath> {
    let mut made: Vec<AlgorithmPath> = Vec::new();
    for label in labels {
        // Rerun parses `/ : = ,` and spaces in entity paths.
        let stem = safe_name(&label, usize::MAX);
        let names = std::iter::once(stem.clone()).chain((2..).map(|n| format!("{stem}-{n}")));
        // The numbers never end, so one of them is unused.
        let part = names
            .into_iter()
            .find(|name| made.iter().all(|a| a.part != *name))
            .unwrap_or(stem);
        made.push(AlgorithmPath {
            label,
            part,
            extra: ExtraPlanes::NONE,
        });
    }
    made
}

/// The scenario's name and the parameters of the algorithms, as Markdown.
pub(crate) fn parameters(run: &ViewedScene) -> String {
    let rows = run
        .algorithms
        .iter()
        .map(|(label, parameters)| format!("\n### {label}\n{parameters}\n"));
    format!("# {}\n{}", run.scenario, rows.collect::<String>())
}

/// Placeholder for the results, as Markdown.
pub(crate) fn awaiting(run: &ViewedScene) -> String {
    format!(
        "# {}\n\nNo checkpoint has been scored yet: verdicts come at the end of `svl score`.\n",
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
