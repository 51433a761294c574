//! Where a run is shown in Rerun, as `--rerun` names it.

use std::str::FromStr;
use svl::sink::RerunTarget;

/// A destination, or none where there is one by default.
#[derive(Clone)]
pub(crate) enum RerunChoice {
    None,
    To(RerunTarget),
}

impl RerunChoice {
    pub(crate) fn target(&self) -> Option<&RerunTarget> {
        match self {
            Self::None => None,
            Self::To(target) => Some(target),
        }
    }
}

impl FromStr for RerunChoice {
    type Err = svl::Error;

    fn from_str(text: &str) -> svl::Result<Self> {
        match text {
            "none" => Ok(Self::None),
            target => target.parse().map(Self::To),
        }
    }
}
