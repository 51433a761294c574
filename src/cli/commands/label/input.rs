//! What is labelled: a recorded source, and how it is opened.

use crate::cli::shared::source::SourceParser;
use anyhow::bail;
use clap::builder::NonEmptyStringValueParser;
use svl::grab;
use svl::source::Request;

/// The source that a person steps through.
#[derive(clap::Args)]
pub(super) struct LabelInput {
    /// A recording, a bag, a folder of pairs, a data-set scene, or the arena
    #[arg(value_parser = SourceParser)]
    pub(super) source: String,
    /// Seed of a simulated source [default: 1]
    #[arg(long, value_name = "N")]
    pub(super) seed: Option<u64>,
    /// Topic of the left images, in another program's recording [default: found by type and name]
    #[arg(
        long, value_name = "TOPIC", requires = "right",
        value_parser = NonEmptyStringValueParser::new()
    )]
    pub(super) left: Option<String>,
    /// Topic of the right images
    #[arg(
        long, value_name = "TOPIC", requires = "left",
        value_parser = NonEmptyStringValueParser::new()
    )]
    pub(super) right: Option<String>,
    /// Rectify the pairs by a calibration, as `svl replay` does
    #[arg(long, value_name = "FILE|none", value_parser = NonEmptyStringValueParser::new())]
    pub(super) calib: Option<String>,
}

impl LabelInput {
    /// Refuses cameras.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        let name = &self.source;
        if grab::driver(name).is_some() {
            bail!(
                "{name}: cameras cannot be stepped through; record them first: svl record {name}"
            );
        }
        Ok(())
    }

    /// How it is opened.
    pub(super) fn request(&self) -> Request<'_> {
        let Ok(calib) = self.calib.as_deref().unwrap_or("own").parse();
        Request {
            seed: self.seed,
            topics: [self.left.clone(), self.right.clone()],
            calib,
            ..Request::new(&self.source)
        }
    }
}
