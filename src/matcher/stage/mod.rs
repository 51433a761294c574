//! Stages that the matchers share.
