//! Compiles in the revision, the profile and the digest of the sources of svl, for the manifests of
//! recordings and reports.

use std::collections::hash_map::DefaultHasher;
use std::hash::Hasher;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The sources that the rows of a report depend on; those of a published package are in Cargo.lock.
const SOURCES: [&str; 11] = [
    "src/core",
    "src/calibrate",
    "src/files",
    "src/sim",
    "src/recording",
    "src/score",
    "src/bench/source",
    "src/bench/pass",
    "src/bench/drive",
    "src/bench/sink/table.rs",
    "Cargo.lock",
];

/// The parts of them that no row depends on.
const OTHER_SOURCES: [&str; 1] = ["src/core/examples"];

fn main() {
    // Where they lie differs in a worktree.
    for name in ["HEAD", "refs/heads", "packed-refs"] {
        if let Some(path) =
            git(&["rev-parse", "--git-path", name]).filter(|path| Path::new(path).exists())
        {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    println!("cargo:rerun-if-changed=build.rs");
    // OUT_DIR is target/[TRIPLE/]PROFILE/build/…; cargo's variable PROFILE is only debug or release.
    let out = std::env::var("OUT_DIR").unwrap_or_default();
    let mut folders = Path::new(&out).ancestors();
    let build = folders.find(|folder| folder.ends_with("build"));
    let profile = build.and_then(Path::parent).and_then(Path::file_name);
    if let Some(profile) = profile {
        println!("cargo:rustc-env=SVL_PROFILE={}", profile.display());
    }
    for name in SOURCES {
        println!("cargo:rerun-if-changed={name}");
    }
    println!("cargo:rustc-env=SVL_SOURCES={}", digest_of_sources());
    if let Some(revision) = git(&["rev-parse", "--short=12", "HEAD"]) {
        println!("cargo:rustc-env=SVL_GIT_REVISION={revision}");
    }
}

/// Digest of the names and bytes of [`SOURCES`].
fn digest_of_sources() -> String {
    let mut files = Vec::new();
    for name in SOURCES {
        add_files(Path::new(name), &mut files);
    }
    files.sort();
    let mut hasher = DefaultHasher::new();
    for path in files {
        hasher.write(path.to_string_lossy().as_bytes());
        hasher.write(&std::fs::read(&path).unwrap_or_default());
    }
    format!("{:016x}", hasher.finish())
}

fn add_files(path: &Path, files: &mut Vec<PathBuf>) {
    if OTHER_SOURCES.iter().any(|other| path == Path::new(other)) {
        return;
    }
    match std::fs::read_dir(path) {
        Ok(entries) => entries
            .flatten()
            .for_each(|entry| add_files(&entry.path(), files)),
        Err(_) if path.is_file() => files.push(path.to_owned()),
        Err(_) => {}
    }
}

/// What git prints, where there is one.
fn git(args: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .args(args)
        .output()
        .ok()
        .filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
