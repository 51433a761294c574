//! Whether the pairs of a source are rectified on their way, and by what.

use super::source::Opened;
use super::usage;
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use svl::Error;
use svl::calibrate::files;
use svl::recording::{CALIBRATION, Header, Recording, Writer};
use svl::rectify::{Framing, Rectifier, bouguet};
use svl::source::{RecordingSource, RectifiedSource, Source};
use svl::stereo::StereoCalibration;

#[derive(clap::Args)]
pub(crate) struct Rectify {
    /// Rectify the pairs by a calibration: a file, two with a comma between, the folder of the two,
    /// or a recording that keeps it; or by an estimate from the pictures alone, which knows no
    /// distances; or leave them as they are [default: rectified by what a bag of raw images says of
    /// its cameras, else as they are]
    #[arg(long, value_name = "FILE|estimate|none")]
    calib: Option<By>,
    /// How much of the raw images is kept, as OpenCV's alpha: 0 what has no black in it, 1 all
    /// [default: as the file has it, else 0]
    #[arg(
        long, value_name = "0..1", allow_negative_numbers = true, requires = "calib",
        value_parser = usage::within(0.0..=1.0)
    )]
    alpha: Option<f64>,
}

#[derive(Clone)]
enum By {
    Files(PathBuf),
    Estimate,
    Nothing,
}

impl FromStr for By {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "estimate" => Self::Estimate,
            "none" => Self::Nothing,
            "" => return Err("expected a file, estimate or none"),
            path => Self::Files(path.into()),
        })
    }
}

/// What a recording says of its pairs.
#[derive(Default)]
pub(crate) struct Recorded {
    /// What rectifies them, where they are raw and it knows.
    raw: Option<StereoCalibration>,
    remarks: Vec<String>,
    /// Those by which they were rectified, or can be.
    files: Kept,
}

/// Names and contents of files.
type Kept = Vec<(String, Vec<u8>)>;

impl Recorded {
    pub(crate) fn of(source: &RecordingSource) -> anyhow::Result<Self> {
        let reader = source.reader();
        Ok(Self {
            raw: reader.calibration(),
            remarks: reader.remarks(),
            files: match reader.recording().calibration_files() {
                // Damage is told with the pairs.
                Err(Error::Damaged { .. }) => Vec::new(),
                found => found?,
            },
        })
    }

    /// Keeps the files of the calibration in a recording of the pairs: of raw ones that which would
    /// rectify them.
    pub(crate) fn attach(&self, writer: &mut Writer) -> anyhow::Result<()> {
        let own = self
            .raw
            .as_ref()
            .map(written)
            .transpose()?
            .unwrap_or_default();
        for (name, bytes) in self.files.iter().chain(&own) {
            writer.attach(
                &format!("{CALIBRATION}{name}"),
                "application/octet-stream",
                bytes,
            )?;
        }
        Ok(())
    }
}

impl Rectify {
    /// As [`Rectify::pairs`], of what was opened to be recorded.
    pub(crate) fn opened(&self, mut opened: Opened, quiet: bool) -> anyhow::Result<Opened> {
        (opened.source, opened.recorded) =
            self.pairs(opened.source, opened.recorded, &mut opened.header, quiet)?;
        Ok(opened)
    }

    /// The pairs of a source as they were asked for, and what then is to be said and kept of them.
    pub(crate) fn pairs(
        &self,
        source: Box<dyn Source>,
        recorded: Recorded,
        header: &mut Header,
        quiet: bool,
    ) -> anyhow::Result<(Box<dyn Source>, Recorded)> {
        let name = source.name();
        let (source, by, files): (Box<dyn Source>, _, _) = match (&self.calib, &recorded.raw) {
            (Some(By::Files(path)), _) => {
                let (calibration, files) = read(path)?;
                let rectifier = Rectifier::new(&self.framed(calibration)?)?;
                if rectifier.rig().is_none() {
                    let cure = "`svl calibrate convert --unit squares=SIDE_IN_METRES` says how \
                                large they are";
                    tracing::warn!(
                        "{}: is in squares of its board, so there are no distances; {cure}",
                        path.display()
                    );
                }
                let names = files
                    .iter()
                    .map(|(name, _)| name.as_str())
                    .collect::<Vec<_>>()
                    .join(", ");
                (
                    Box::new(RectifiedSource::new(source, rectifier)?),
                    names,
                    files,
                )
            }
            (Some(By::Estimate), _) => {
                let framing = Framing {
                    alpha: self.alpha.unwrap_or(0.0),
                    ..Framing::default()
                };
                let source = RectifiedSource::estimated(source, &framing)?;
                (
                    Box::new(source),
                    "an estimate from its pictures".to_owned(),
                    Vec::new(),
                )
            }
            (None, Some(own)) => {
                if !quiet {
                    eprintln!(
                        "{name}: raw images, rectified by what it says of its cameras; --calib \
                         none leaves them"
                    );
                }
                let source = RectifiedSource::new(source, Rectifier::new(own)?)?;
                (
                    Box::new(source),
                    "what the recording says of its cameras".to_owned(),
                    Vec::new(),
                )
            }
            (Some(By::Nothing), _) if self.alpha.is_some() => {
                return Err(usage::wrong(
                    "--alpha is for pairs that are rectified; leave it or --calib none out",
                ));
            }
            _ => {
                recorded
                    .remarks
                    .iter()
                    .for_each(|remark| tracing::warn!("{name}: {remark}"));
                return Ok((source, recorded));
            }
        };
        header.calibration = Some(by);
        Ok((
            source,
            Recorded {
                files,
                ..Recorded::default()
            },
        ))
    }

    /// What to do when rows are apart all the same.
    pub(crate) fn cure(&self) -> &'static str {
        match self.calib {
            None | Some(By::Nothing) => "rectify them with --calib FILE, or --calib estimate",
            Some(By::Files(_)) => {
                "the calibration is not, or no longer, that of these cameras: calibrate anew"
            }
            Some(By::Estimate) => "an estimate knows no lenses: calibrate the cameras",
        }
    }

    /// The calibration with the rectification that was asked for; without any its own stays.
    fn framed(&self, calibration: StereoCalibration) -> anyhow::Result<StereoCalibration> {
        let Some(alpha) = self.alpha else {
            return Ok(calibration);
        };
        let rectification = bouguet(
            &calibration,
            &Framing {
                alpha,
                ..Framing::default()
            },
        )?;
        Ok(calibration.with_rectification(rectification))
    }
}

/// The calibration that was named, and its files: of a recording those that it keeps.
fn read(path: &Path) -> anyhow::Result<(StereoCalibration, Kept)> {
    if path.extension().is_none_or(|ending| ending != "mcap") {
        return Ok((files::read(path)?, kept(&files::inputs(path)?)?));
    }
    let kept = Recording::open(path)?.calibration_files()?;
    let folder = tempfile::tempdir()?;
    let mut paths = Vec::new();
    for (name, bytes) in &kept {
        // The last part alone: a recording has no say in where its files go.
        let name = Path::new(name)
            .file_name()
            .with_context(|| format!("{}: a file named '{name}'", path.display()))?;
        paths.push(folder.path().join(name).display().to_string());
        std::fs::write(folder.path().join(name), bytes)?;
    }
    if paths.is_empty() {
        bail!(
            "{}: keeps no calibration (attachments {CALIBRATION}…); `svl info` lists what it keeps",
            path.display()
        );
    }
    let calibration =
        files::read(Path::new(&paths.join(","))).with_context(|| path.display().to_string())?;
    Ok((calibration, kept))
}

/// The files of a calibration that no file holds yet.
fn written(calibration: &StereoCalibration) -> anyhow::Result<Kept> {
    let folder = tempfile::tempdir()?;
    files::write(folder.path(), calibration)?;
    kept(&files::inputs(folder.path())?)
}

/// Names and contents of a calibration's files. Two of one name have their folder's before it.
fn kept(paths: &[PathBuf]) -> anyhow::Result<Kept> {
    let name = |path: &Path| {
        path.file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let alike = |path: &Path| {
        paths
            .iter()
            .filter(|other| other.file_name() == path.file_name())
            .count()
            > 1
    };
    let keep = |path: &PathBuf| {
        let folder = path
            .parent()
            .filter(|_| alike(path))
            .map(|folder| name(folder) + "-")
            .unwrap_or_default();
        Ok((
            folder + &name(path),
            std::fs::read(path).with_context(|| path.display().to_string())?,
        ))
    };
    paths.iter().map(keep).collect()
}
