//! Stub.
use super::*;
pub(super) const SPEC: MatcherSpec = MatcherSpec {
    name: "v3",
    summary: "",
    paper: "",
    parameters: &[],
    build: |_| Err(Error::Invalid("not yet".into())),
};
