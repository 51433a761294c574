//! `svl datasets`: the data sets svl reads, listed or fetched.

use crate::cli::shared::progress::Bytes;
use crate::cli::shared::terminal::{print, print_json, width, wrapped};
use crate::cli::shared::usage;
use anyhow::bail;
use clap::builder::NonEmptyStringValueParser;
use std::collections::BTreeSet;
use std::io::Read;
use std::path::{Path, PathBuf};
use svl::counted;
use svl::fetch::{self, Receipt, Receipts};
use svl::outputs::make_folder;
use svl::runs::data_folder;
use svl::source::dataset::{self, DATASETS, Dataset, Part};

/// List the stereo data sets svl reads, or fetch one
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl datasets list
  svl datasets fetch middeval3 --data DATASETS
  svl score scenarios/middeval3.toml --data DATASETS")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: DatasetsCommand,
}

#[derive(clap::Subcommand)]
enum DatasetsCommand {
    /// List the data sets with home pages, terms and sizes
    #[command(after_help = "Examples:\n  svl datasets list\n  svl datasets list --json")]
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    Fetch(FetchArgs),
}

/// Download a data set from its authors and unpack it
///
/// The files go to DIR/NAME, with the paths of the archives; existing files are kept. An
/// interrupted download resumes. The authors publish no checksums: the first fetch writes those it
/// saw into DIR/NAME/fetched.json, and later ones are checked against them. Archives that svl
/// downloaded are removed once they are unpacked.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl datasets fetch middlebury2003 --data DATASETS
  svl datasets fetch middlebury2014 Piano Motorcycle --data DATASETS
  svl datasets fetch kitti2015 --from ~/Downloads --data DATASETS
  svl datasets fetch eth3d --from https://mirror.example/eth3d --data DATASETS")]
struct FetchArgs {
    /// Data set, as `svl datasets list` lists them
    #[arg(value_name = "NAME", value_parser = dataset::find)]
    dataset: &'static Dataset,
    /// Parts of it [default: the usual ones]
    part: Vec<String>,
    /// Folder that already has the archives, or address of a mirror
    #[arg(long, value_name = "URL|DIR", value_parser = NonEmptyStringValueParser::new())]
    from: Option<String>,
    /// Folder of the data sets [default: SVL_DATASETS]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    match &args.command {
        DatasetsCommand::Fetch(args) => fetch(args, quiet),
        DatasetsCommand::List { json: true } => print_json(&DATASETS),
        DatasetsCommand::List { json: false } => print(&list()),
    }
}

/// Column where the description of a data set begins.
const COLUMN: usize = 16;

fn list() -> String {
    let last = width();
    let mut text = String::new();
    for dataset in DATASETS {
        let usual: u32 = dataset
            .parts
            .iter()
            .filter(|p| p.usual)
            .map(|p| p.megabytes)
            .sum();
        let title = format!("{}, about {usual} MB", dataset.title);
        text += &wrapped(dataset.name, COLUMN, &title, last);
        text += &wrapped("", COLUMN, dataset.licence, last);
        text += &wrapped("", COLUMN, dataset.home, last);
        let others: Vec<_> = dataset
            .parts
            .iter()
            .filter(|p| !p.usual)
            .map(|p| p.name)
            .collect();
        if !others.is_empty() {
            text += &wrapped("", COLUMN, &format!("also: {}", others.join(", ")), last);
        }
        text.push('\n');
    }
    text + "Fetch one with svl datasets fetch NAME --data DIR\n"
}

fn fetch(args: &FetchArgs, quiet: bool) -> anyhow::Result<()> {
    let dataset = args.dataset;
    let parts = dataset.parts(&args.part).map_err(usage::wrong)?;
    let Some(data) = data_folder(args.data.as_deref()) else {
        return Err(usage::wrong(
            "no folder to fetch into; name that of the data sets with --data DIR or SVL_DATASETS",
        ));
    };
    let origin = Origin::named(args.from.as_deref())?;
    let folder = data.join(dataset.name);
    make_folder(&folder)?;
    print(&format!(
        "{}: {}\nTerms: {}; {}\n",
        dataset.name, dataset.title, dataset.licence, dataset.home
    ))?;
    print(&format!("Please cite: {}\n", dataset.citation))?;
    let mut fetching = Fetching {
        receipts: Receipts::read(&folder)?,
        folder,
        origin,
        quiet,
        written: 0,
        kept: 0,
    };
    for part in parts {
        for file in part.files {
            fetching.file(part, file)?;
        }
    }
    let Fetching {
        folder,
        written,
        kept,
        ..
    } = fetching;
    print(&format!(
        "{}: {} written, {kept} existed already\n",
        folder.display(),
        counted(written as u64, "file")
    ))
}

/// Origin of the files.
enum Origin {
    Authors,
    Mirror(String),
    Folder(PathBuf),
}

impl Origin {
    fn named(from: Option<&str>) -> anyhow::Result<Self> {
        match from {
            None => Ok(Self::Authors),
            Some(url) if url.starts_with("http://") || url.starts_with("https://") => {
                Ok(Self::Mirror(url.trim_end_matches('/').to_owned() + "/"))
            }
            Some(folder) if Path::new(folder).is_dir() => Ok(Self::Folder(folder.into())),
            Some(other) => {
                bail!("--from {other}: neither an address (http://, https://) nor a folder")
            }
        }
    }
}

/// A data set that is being fetched.
struct Fetching {
    folder: PathBuf,
    receipts: Receipts,
    origin: Origin,
    quiet: bool,
    written: usize,
    kept: usize,
}

impl Fetching {
    fn file(&mut self, part: &Part, file: &str) -> anyhow::Result<()> {
        let key = if part.folder.is_empty() {
            file.to_owned()
        } else {
            format!("{}/{file}", part.folder)
        };
        if self.receipts.fulfilled(&key) {
            self.kept += 1;
            return Ok(());
        }
        let own = self.folder.join(&key);
        let downloads = !matches!(self.origin, Origin::Folder(_)) && !own.exists();
        let (path, from) = self.obtain(part, file, &own)?;
        let mut first = [0];
        let page = std::fs::File::open(&path)
            .and_then(|mut file| Ok(file.read(&mut first)? == 1 && first == *b"<"));
        if page.map_err(|e| svl::Error::io(&path, e))? {
            if downloads {
                // It would be taken for the file the next time.
                let _ = std::fs::remove_file(&path);
            }
            bail!(
                "{from}: is a web page, not {file}; check the address, and that this machine may \
                 download from it"
            );
        }
        let (sha256, bytes) = self.with_bar("check", &path, |bar| fetch::sha256(&path, bar))?;
        self.receipts.agrees(&key, &path, &sha256)?;
        let made = self.place(part, &path, &own)?;
        let made = made
            .into_iter()
            .map(|top| join(part.folder, &top))
            .collect();
        self.receipts.add(
            &key,
            Receipt {
                from,
                bytes,
                sha256,
                made,
            },
        )?;
        // Files of the user stay.
        if fetch::is_archive(file) && downloads {
            std::fs::remove_file(&path).map_err(|e| svl::Error::io(&path, e))?;
        }
        Ok(())
    }

    /// The file, downloaded to `own` if it is not at hand, and its origin.
    fn obtain(&self, part: &Part, file: &str, own: &Path) -> anyhow::Result<(PathBuf, String)> {
        let url = match &self.origin {
            Origin::Authors => format!("{}{file}", part.base),
            Origin::Mirror(base) => format!("{base}{file}"),
            Origin::Folder(folder) => {
                let places = [
                    folder.join(file),
                    folder.join(file.rsplit('/').next().unwrap_or(file)),
                ];
                // Single files of many scenes have one name.
                let places = if fetch::is_archive(file) {
                    &places[..]
                } else {
                    &places[..1]
                };
                let Some(path) = places.iter().find(|p| p.is_file()) else {
                    bail!(
                        "{}: no such file; --from takes the folder that holds {file}",
                        places[0].display()
                    );
                };
                return Ok((path.clone(), path.display().to_string()));
            }
        };
        if own.exists() {
            return Ok((own.to_owned(), own.display().to_string()));
        }
        let folder = own.parent().unwrap_or(&self.folder);
        make_folder(folder)?;
        self.with_bar("fetch", own, |bar| fetch::download(&url, own, bar))?;
        Ok((own.to_owned(), url))
    }

    /// Unpacks an archive, or moves a single file to its place. Returns the paths that this made,
    /// below the part's folder.
    fn place(&mut self, part: &Part, path: &Path, own: &Path) -> anyhow::Result<BTreeSet<String>> {
        if fetch::is_archive(&path.to_string_lossy()) {
            let folder = self.folder.join(part.folder);
            let unpacked =
                self.with_bar("unpack", path, |bar| fetch::unpack(path, &folder, bar))?;
            self.written += unpacked.written;
            self.kept += unpacked.kept;
            return Ok(unpacked.top);
        }
        if path != own && own.exists() {
            self.kept += 1;
        } else {
            if path != own {
                let folder = own.parent().unwrap_or(&self.folder);
                make_folder(folder)?;
                // Half a copy must not be taken for the file.
                let partial = own.with_extension("copy");
                std::fs::copy(path, &partial).map_err(|e| svl::Error::io(&partial, e))?;
                std::fs::rename(&partial, own).map_err(|e| svl::Error::io(own, e))?;
            }
            self.written += 1;
        }
        let below = own.strip_prefix(self.folder.join(part.folder))?;
        Ok(BTreeSet::from([below.to_string_lossy().into_owned()]))
    }

    fn with_bar<T>(
        &self,
        verb: &str,
        path: &Path,
        work: impl FnOnce(fetch::Watch<'_>) -> svl::Result<T>,
    ) -> svl::Result<T> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let bar = Bytes::new(&format!("{verb} {name}"), self.quiet);
        let result = work(&mut |done, total| bar.go_on(done, total));
        bar.clear();
        result
    }
}

fn join(folder: &str, name: &str) -> String {
    if folder.is_empty() {
        name.to_owned()
    } else {
        format!("{folder}/{name}")
    }
}
