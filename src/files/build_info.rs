//! Version, git revision and profile of the running svl, as stored in manifests and recordings.
//!
//! The root package reads them when the program is built, and passes them down, so that a commit
//! rebuilds only that package.

use std::sync::OnceLock;

/// A build of svl.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildInfo {
    pub version: &'static str,
    /// `None` for a build outside a git checkout.
    pub git_revision: Option<&'static str>,
    /// Digest of the sources that results depend on.
    pub sources: Option<&'static str>,
    /// Cargo profile, such as `release` or `work`; `None` if the program does not report it.
    pub profile: Option<&'static str>,
}

static BUILD: OnceLock<BuildInfo> = OnceLock::new();

impl BuildInfo {
    /// Sets the build of this process, before anything is recorded or scored. The first call takes
    /// effect.
    pub fn hand_down(self) {
        BUILD.get_or_init(|| self);
    }

    /// The build of this process: only the version for a program that did not set its own.
    pub fn current() -> Self {
        BUILD.get().copied().unwrap_or(Self {
            version: env!("CARGO_PKG_VERSION"),
            git_revision: None,
            sources: None,
            profile: None,
        })
    }
}

/// The profile in words, if the times of such a build are not representative of svl.
pub fn slow_profile(profile: Option<&str>) -> Option<String> {
    let slow = profile.filter(|name| ["debug", "work"].contains(name))?;
    Some(format!(
        "built with the profile `{slow}`: results are the same, but times need a release build"
    ))
}
