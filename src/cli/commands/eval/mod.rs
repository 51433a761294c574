//! `svl eval`: disparity maps against their ground truth, by a benchmark's protocol.

mod files;
mod report;

use crate::cli::shared::usage;
use files::ImageFiles;
use std::path::{Path, PathBuf};
use svl::Error;
use svl::files::{self as on_disk, MapScale};
use svl::outputs::Outputs;
use svl::plausibility::{map_doubt, sign_doubt, without};
use svl::score::protocol::{Protocol, ProtocolImage, Score};
use svl::stereo::{Plane, Visibility, cross_check};

/// Score disparity maps as a benchmark's own program does
///
/// Both may be folders of files with equal names: KITTI 2015 then counts the pixels of all images
/// together, the other protocols average over the images. Or folders of scenes, as those of
/// Middlebury v3 and ETH3D (SCENE/disp0NAME.pfm, SCENE/disp0GT.pfm, mask0nocc.png, calib.txt):
/// then the masks, ndisp and the weights of the benchmark are used.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl eval disparity.pfm disp0GT.pfm --protocol middeval3 --mask mask0nocc.png
  svl eval cones.pfm disp2.png --disparity-scale 4 --protocol middlebury-v2 \\
      --right-truth disp6.png
  svl eval results MiddEval3/trainingQ --protocol middeval3
  svl eval disparity.png truth.png --protocol kitti12 --error-map errors.png
  svl eval results/disp_0 training/disp_occ_0 --protocol kitti15 \\
      --object-map training/obj_map

Protocols:
  middeval3      Middlebury v3: bad is of all judged pixels, holes are neither
                 bad nor filled
  middlebury-v2  tsukuba, venus, cones, teddy: holes are bad; one --mask per
                 column
  eth3d          ETH3D two-view: bad and errors count only estimated pixels
  kitti12        beyond 1 to 5 px
  kitti15        D1: beyond 3 px and 5 % of the truth

KITTI's numbers are for the map without filling, a hole being -1; those in
_dense for the map filled as by the kit (the web page's All); those in _est
for the estimated pixels alone (its Est).

Fractions are in per cent, errors in pixels of disparity. A division by zero
is null, and - in the table. A hole of DISPARITY is a value that is not finite
or negative in .pfm, .npy and .npz, 0 in images and 16-bit integers.")]
pub(crate) struct Args {
    /// Disparities to score: .pfm, .npy, .npz, 16-bit .png (256·d); or a folder of them
    #[arg(value_parser = usage::map())]
    disparity: PathBuf,
    /// True disparities: .pfm, .npy, .npz, .png, .pgm; or a folder of them
    ground_truth: PathBuf,
    /// Protocol: middeval3, middlebury-v2, eth3d, kitti12 or kitti15
    #[arg(long, help_heading = "Scoring")]
    protocol: Protocol,
    /// Score only pixels where this image is 255; may be given more than once, for a column each
    #[arg(long, value_name = "M.png", help_heading = "Input")]
    mask: Vec<PathBuf>,
    /// Score only pixels that both cameras see, by the truth of the right image (cross-check at 1
    /// px)
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with = "mask",
        help_heading = "Input"
    )]
    right_truth: Option<PathBuf>,
    /// KITTI 2015's objects, 0 being the background: without it there is only d1_all
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    object_map: Option<PathBuf>,
    /// Clip to this disparity, as middeval3 does to `ndisp` of calib.txt (pixels of DISPARITY)
    #[arg(
        long, value_name = "N", value_parser = usage::within(0.001..=65536.0),
        help_heading = "Scoring"
    )]
    max_disparity: Option<f64>,
    /// Factor by which integers of the truth multiply disparities; required for 8-bit images and
    /// arrays [default: 256 for 16-bit images]
    #[arg(
        long, value_name = "S", value_parser = usage::within(0.001..=65536.0),
        help_heading = "Input"
    )]
    disparity_scale: Option<f64>,
    /// Factor by which integers of DISPARITY multiply disparities [default: 256 for 16-bit images,
    /// that of the truth for 8-bit ones]
    #[arg(
        long, value_name = "S", value_parser = usage::within(0.001..=65536.0),
        help_heading = "Input", hide_short_help = true
    )]
    estimate_scale: Option<f64>,
    /// Picture of the errors in KITTI's colours
    #[arg(
        long, value_name = "OUT.png", value_parser = usage::ending(&["png"]),
        help_heading = "Output"
    )]
    error_map: Option<PathBuf>,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    args.check()?;
    let images = ImageFiles::find(args)?;
    let may_have = |which: usize| images.iter().any(|files| files.may_have_scales()[which]);
    for (option, given, which) in [
        ("--disparity-scale", args.disparity_scale, 0),
        ("--estimate-scale", args.estimate_scale, 1),
    ] {
        // An 8-bit estimate has the truth's scale.
        let is_used = may_have(which) || (which == 0 && may_have(1));
        if given.is_some() && !is_used {
            let why = format!("{option} is for integers; .pfm has disparities as they are");
            return Err(usage::wrong(why));
        }
    }
    let mut outputs = Outputs::claim(
        args.force,
        images.iter().flat_map(ImageFiles::inputs),
        args.error_map.as_deref(),
    )?;
    let columns = args.mask.len().max(1);
    let mut scores: Vec<Vec<(f64, Score)>> = vec![Vec::new(); columns];
    let mut doubts = Vec::new();
    for files in &images {
        let loaded = Loaded::read(files, args)?;
        let name = files.disparity.display().to_string();
        if let Some(doubt) = map_doubt(&name, &loaded.estimate, &loaded.truth) {
            tracing::warn!("{doubt}");
            doubts.push(doubt);
        }
        for (column, scores) in scores.iter_mut().enumerate() {
            let score = args.protocol.score(&loaded.image(column));
            scores.push((files.weight, score.map_err(|e| files.explain(&e))?));
        }
        if let Some(path) = &args.error_map {
            let map = args.protocol.error_map(&loaded.image(0));
            let rgb = map.map_err(|e| files.explain(&e))?;
            let (width, height) = loaded.truth.size();
            outputs.begin()?;
            on_disk::write_png(&outputs.place(path), width, height, &rgb)?;
        }
    }
    outputs.commit()?;
    report::print_scores(args, &images, &scores, &doubts)
}

impl Args {
    /// Refuses options that the protocol does not use: users would believe that they had an effect.
    fn check(&self) -> anyhow::Result<()> {
        let name = self.protocol.name();
        let wrong = if self.max_disparity.is_some() && self.protocol != Protocol::Middeval3 {
            format!("--max-disparity is for middeval3, not {name}")
        } else if self.object_map.is_some() && self.protocol != Protocol::Kitti15 {
            format!("--object-map is for kitti15, not {name}")
        } else if self.error_map.is_some() && self.disparity.is_dir() {
            "--error-map draws one image; name a file, not a folder of them".to_owned()
        } else {
            return Ok(());
        };
        Err(usage::wrong(wrong))
    }
}

/// The disparities of a file without those that stand for unknown, which are counted: negative
/// ones, and in a truth those beyond the image.
fn disparities(path: &Path, scale: MapScale, is_truth: bool) -> anyhow::Result<Plane<f32>> {
    let name = path.display();
    let map = on_disk::read_disparities(path, scale)?;
    if let Some(doubt) = sign_doubt(&name.to_string(), &map).filter(|_| is_truth) {
        return Err(Error::other(doubt).into());
    }
    let (map, negative) = without(map, |d| d < 0.0).unwrap_or_else(|map| (map, 0));
    let width = map.width() as f32;
    let may_be_beyond = is_truth && map.pixels().any(|d| d <= width);
    let within = without(map, |d| may_be_beyond && d > width);
    let (map, beyond) = within.unwrap_or_else(|map| (map, 0));
    let negative = (negative, "negative disparities");
    for (count, what) in [negative, (beyond, "disparities beyond the image's width")] {
        if count > 0 {
            tracing::warn!("{name}: {count} {what} count as unknown");
        }
    }
    Ok(map)
}

/// One image's files, read.
struct Loaded {
    estimate: Plane<f32>,
    truth: Plane<f32>,
    masks: Vec<Plane<Visibility>>,
    foreground: Option<Plane<bool>>,
    max_disparity: Option<f32>,
}

impl Loaded {
    fn read(files: &ImageFiles, args: &Args) -> anyhow::Result<Self> {
        let scale = args.disparity_scale.map(|scale| scale as f32);
        let own = args.estimate_scale.map(|scale| scale as f32);
        let read_truth = |path| disparities(path, MapScale::same(scale), true);
        let truth = read_truth(&files.truth)?;
        let of_estimate = MapScale {
            of_16_bits: own,
            of_8_bits: own.or(scale),
        };
        let estimate = disparities(&files.disparity, of_estimate, false)?;
        let given = args.max_disparity;
        let scaled = || {
            let size = estimate.width() as f64 / truth.width() as f64;
            files.ndisp.map(|ndisp| ndisp * size)
        };
        let max_disparity = given.or_else(scaled).map(|max| max as f32);
        let masks = files.masks.iter().map(|path| on_disk::read_mask(path));
        let mut masks = masks.collect::<Result<Vec<_>, _>>()?;
        if let Some(path) = &files.right_truth {
            let right = read_truth(path)?;
            masks.push(
                cross_check(&truth, &right)
                    .map_err(|e| anyhow::anyhow!("{}: {e}", path.display()))?,
            );
        }
        let objects = files.object_map.as_deref();
        let foreground = objects.map(on_disk::read_object_map).transpose()?;
        Ok(Self {
            estimate,
            truth,
            masks,
            foreground,
            max_disparity,
        })
    }

    /// The image of a column of the table, with the pixels that it scores.
    fn image(&self, column: usize) -> ProtocolImage<'_> {
        ProtocolImage {
            estimate: &self.estimate,
            truth: &self.truth,
            mask: self.masks.get(column),
            foreground: self.foreground.as_ref(),
            max_disparity: self.max_disparity,
        }
    }
}
