//! The source that is labelled: a recorded one, and its options. The files of labels.

use crate::cli::shared::source::{self, SCENARIO_OPTIONS, SourceParser, hidden};
use crate::cli::shared::stepper::{FrameStore, Stepper, open_again};
use anyhow::bail;
use std::io::Write;
use std::path::Path;
use svl::scenario::SourceOptions;
use svl::source::{Request, Source, SourceKind};

/// The source that the user steps through.
#[derive(clap::Args)]
#[command(mut_args(|arg| hidden(arg, SCENARIO_OPTIONS)))]
pub(super) struct LabelInput {
    /// A recording, a bag, a folder of pairs, a data-set scene, or the arena
    #[arg(value_parser = SourceParser, hide_possible_values = true)]
    pub(super) source: String,
    /// Seed of a simulated source [default: 1]
    #[arg(long, value_name = "N", help_heading = "Input")]
    pub(super) seed: Option<u64>,
    #[command(flatten)]
    pub(super) options: SourceOptions,
}

impl LabelInput {
    /// Refuses cameras.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        let name = &self.source;
        self.options
            .refuse(SCENARIO_OPTIONS, "does not apply to labelling")?;
        if SourceKind::are_cameras(name) {
            bail!(
                "{name}: cameras cannot be stepped through; record them first: svl record {name}"
            );
        }
        Ok(())
    }

    /// The request for it.
    pub(super) fn request(&self) -> Request<'_> {
        Request {
            seed: self.seed,
            options: self.options.clone(),
            ..Request::new(&self.source)
        }
    }
}

/// Steps through a source that is open; an earlier frame is read from its beginning again.
pub(super) fn stepper<'a, T>(
    first: Box<dyn Source>,
    request: &'a Request<'_>,
) -> anyhow::Result<Stepper<'a, T>> {
    let again = || Ok(source::open(request.clone(), true)?.source);
    Stepper::new(request.name, FrameStore::new(open_again(first, again))?)
}

/// Writes a file so that at any moment it holds the old text or the new one, `synced` after a
/// power cut too.
pub(super) fn replace(path: &Path, text: &str, synced: bool) -> anyhow::Result<()> {
    // The file that a link names is replaced, not the link.
    let path = &path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let folder = path.parent().unwrap_or(Path::new(""));
    let write = || {
        let mut builder = tempfile::Builder::new();
        // The permissions of any new file; temporary ones are private.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut file = builder
            .prefix(".svl-")
            .tempfile_in(Path::new(".").join(folder))?;
        file.write_all(text.as_bytes())?;
        if synced {
            file.as_file().sync_all()?;
        }
        if let Ok(metadata) = path.metadata() {
            file.as_file().set_permissions(metadata.permissions())?;
        }
        file.persist(path).map_err(|error| error.error).map(|_| ())
    };
    write().map_err(|error| svl::Error::io(path, error).into())
}
