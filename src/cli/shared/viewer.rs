//! The viewer that svl was built with, and where `--rerun` shows a run in it.

use std::str::FromStr;
use svl::sink::{RerunTarget, Viewer};

/// The viewer that this svl was built with: the only place that knows which.
///
/// # Errors
/// The error where it was built without one, with the cure.
pub(crate) fn viewer() -> svl::Result<&'static dyn Viewer> {
    #[cfg(feature = "rerun")]
    {
        Ok(&svl::viewer::Rerun)
    }
    #[cfg(not(feature = "rerun"))]
    Err(svl::Error::Invalid(
        "this svl was built without Rerun; `cargo install --locked --path . --features rerun` adds \
         it"
            .into(),
    ))
}

/// A destination, or none where there is one by default.
#[derive(Clone)]
pub(crate) struct RerunChoice(Option<RerunTarget>);

impl RerunChoice {
    pub(crate) fn target(&self) -> Option<&RerunTarget> {
        self.0.as_ref()
    }
}

impl FromStr for RerunChoice {
    type Err = svl::Error;

    fn from_str(text: &str) -> svl::Result<Self> {
        match text {
            "none" => Ok(Self(None)),
            target => Ok(Self(Some(target.parse()?))),
        }
    }
}
