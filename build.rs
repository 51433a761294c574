//! Compiles in which revision and profile of svl this is, for the recordings' and reports' manifests.

use std::path::Path;
use std::process::Command;

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
    if let Some(revision) = git(&["rev-parse", "--short=12", "HEAD"]) {
        println!("cargo:rustc-env=SVL_GIT_REVISION={revision}");
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
