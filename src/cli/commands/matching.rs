//! `svl match`: one pair of image files through one algorithm.

use crate::cli::shared::progress::listen_for_interrupt;
use crate::cli::shared::terminal::{print_error, print_value};
use crate::cli::shared::usage;
use anyhow::bail;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;
use std::time::Duration;
use svl::calibrate::files::inputs;
use svl::depth::GridSettings;
use svl::depth::decision::{BINS_PER_PX, SafeChoice, VerdictTable};
use svl::doubt::Doubt;
use svl::matcher::{Algorithm, MatchContext, MatchOutput, has_small_cells};
use svl::notice::NoticeLog;
use svl::outputs::Outputs;
use svl::recording::CellReport;
use svl::runs::refuse_recorded;
use svl::scenario::SourceOptions;
use svl::source::{Request, only_pair, open_pair};
use svl::stereo::{
    Cell, CellState, DepthGrid, DisparityMap, Frame, Reason, RectifiedPair, Rig, StereoPair,
};
use svl::stereo::{LevelCell, LevelVerdict, hash_words};
use svl::timing::Stage;
use svl::{depth, files, overlay};

/// Match one rectified pair of images
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl match im0.png im1.png --algo v3 -o disparity.pfm
  svl match im0.png im1.png --algo v3:max_disparity=64 -o d.png \\
      --why why.png --preview p.png
  svl match im0.png im1.png -o d.pfm --calib calib.txt     distances too
  svl match im0.png im1.png -o cloud.ply --calib calib.txt
  svl match im0.png im1.png --algo v5 -o d.pfm --json    why cells are known

OUT.png is 16-bit, KITTI's form: 256·disparity, 0 = none. OUT.pfm has +inf
for none. CLOUD.ply has a point in metres and its grey value per pixel with
a distance. WHY.png holds reason codes: 0 valid, 1 border, 2 untextured,
3 ambiguous, 4 inconsistent, 5 self-check, 6 unmatched.")]
pub(crate) struct Args {
    /// Left image, the reference (PNG, JPEG, PNM, TIFF, BMP, WebP; colour becomes grey)
    left: PathBuf,
    /// Right image, of the same size
    right: PathBuf,
    /// Algorithm, as NAME[:key=value,…]; `svl algos` lists them
    #[arg(
        long, value_name = "ALGO", default_value = "v5", value_parser = usage::algorithm,
        help_heading = "Input"
    )]
    algo: Algorithm,
    /// File of the disparities, or of the point cloud
    #[arg(
        short, long, value_name = "OUT.pfm|OUT.png|CLOUD.ply",
        value_parser = usage::ending(&["pfm", "png", "ply"]), help_heading = "Output"
    )]
    output: PathBuf,
    /// File of the reason of each invalid pixel
    #[arg(
        long, value_name = "WHY.png", value_parser = usage::ending(&["png"]),
        help_heading = "Output"
    )]
    why: Option<PathBuf>,
    /// Picture of the disparities
    #[arg(
        long, value_name = "P.png", value_parser = usage::ending(&["png"]), help_heading = "Output"
    )]
    preview: Option<PathBuf>,
    /// Calibration, for distances; of raw cameras, the images are rectified first
    ///
    /// Any format that `svl calibrate convert` reads. Write two files as left.yaml,right.yaml.
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    calib: Option<PathBuf>,
    /// Bits that 16-bit images use [default: 10, 12, 14 or 16, by their values]
    #[arg(long, value_name = "N", value_parser = usage::within(8..=16u8), help_heading = "Input")]
    bits: Option<u8>,
    /// Shrink the rectified images before they are matched: their new size over the old, at most 1
    ///
    /// The map has the new size and its pixels.
    #[arg(
        long,
        value_name = "FACTOR",
        allow_negative_numbers = true,
        help_heading = "Input"
    )]
    scale: Option<f64>,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
}

#[derive(Serialize)]
struct MatchReport<'a> {
    algorithm: &'a str,
    parameters: String,
    width: usize,
    height: usize,
    coverage: f64,
    pixels: Vec<(&'static str, usize)>,
    total_ms: f64,
    stages_ms: Vec<(&'static str, f64)>,
    hash: String,
    /// The vertical misalignment, where the algorithm measures it.
    #[serde(skip_serializing_if = "Option::is_none")]
    median_row_offset: Option<i8>,
    distances_m: Option<Vec<Vec<Option<f64>>>>,
    cells: Vec<MatchCell>,
    /// Quantities of the pair and its calibration that cannot be right.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    doubts: Vec<Doubt>,
}

/// A cell, with the reason of its state.
#[derive(Serialize)]
struct MatchCell {
    #[serde(flatten)]
    report: CellReport,
    /// Reason why the cell is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<&'static str>,
    /// The parts of the log odds that its report is right, if v5's decision computed them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    score: Vec<ScorePart>,
    /// The decisions at several sizes of the image, finest first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    levels: Vec<LevelPart>,
}

/// The decision on a cell at one size of the image.
#[derive(Serialize)]
struct LevelPart {
    level: u8,
    /// The report, pixels of the pair; absent if nothing was seen.
    #[serde(skip_serializing_if = "Option::is_none")]
    disparity_px: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    log_odds: Option<f64>,
    /// Test that the level failed, or `passed`.
    verdict: LevelVerdict,
}

/// A part of the log odds that a report is right.
#[derive(Serialize)]
struct ScorePart {
    name: &'static str,
    /// The measured value; the base has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<i64>,
    #[serde(skip_serializing_if = "str::is_empty")]
    unit: &'static str,
    log_odds: f64,
}

impl MatchCell {
    fn new(
        report: CellReport,
        cell: &Cell,
        reason: Reason,
        (table, levels): (Option<&VerdictTable>, &[LevelCell]),
    ) -> Self {
        let evidence = cell.evidence.as_ref();
        let score = table.zip(evidence).map(|(table, evidence)| {
            let base = ScorePart::new("base", None, "", table.base);
            let parts = table.parts(evidence).map(|(feature, value, score)| {
                ScorePart::new(feature.name(), Some(value), feature.unit(), score)
            });
            std::iter::once(base).chain(parts).collect()
        });
        Self {
            report,
            reason: cell.depth.is_none().then(|| reason.name()),
            score: score.unwrap_or_default(),
            levels: match levels {
                [LevelCell { level: 0, .. }] => Vec::new(),
                levels => levels.iter().map(LevelPart::new).collect(),
            },
        }
    }

    /// The cells of a grid in raster order.
    fn all(map: &DisparityMap, grid: &DepthGrid, choice: Option<&SafeChoice>) -> Vec<Self> {
        let is_small = has_small_cells(map.size(), grid.shape().cells());
        let levels: Vec<_> = grid.levels().collect();
        let min_valid = GridSettings::default().min_valid;
        let reports = CellReport::from_grid(grid).into_iter().zip(grid.iter());
        let cells = reports.enumerate().map(|(i, (report, (place, cell)))| {
            let by_pixels = map.cell_reason(grid.shape(), place, min_valid);
            let reason = cell.reason.unwrap_or(by_pixels);
            let levels = levels.get(i).copied().unwrap_or_default();
            let count = levels.last().map_or(1, |last| usize::from(last.level) + 1);
            let table =
                choice.map(|choice| choice.table_of_level(cell.level.into(), count, is_small));
            Self::new(report, cell, reason, (table, levels))
        });
        cells.collect()
    }
}

impl LevelPart {
    fn new(level: &LevelCell) -> Self {
        let px = |report: i64| (report << level.level) as f64 / f64::from(BINS_PER_PX);
        let evidence = level.evidence.as_ref();
        Self {
            level: level.level,
            disparity_px: evidence.map(|evidence| px(evidence.report)),
            log_odds: evidence.map(|_| level.scores[1] as f64 / 1000.0),
            verdict: level.verdict,
        }
    }
}

impl ScorePart {
    /// `score` in thousandths of log odds.
    fn new(name: &'static str, value: Option<i64>, unit: &'static str, score: i64) -> Self {
        Self {
            name,
            value,
            unit,
            log_odds: score as f64 / 1000.0,
        }
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    check(args)?;
    let choice = args.algo.safe_choice()?;
    refuse_recorded(std::slice::from_ref(&args.algo))?;
    let mut outputs = claim(args)?;
    if args.algo.spec().is_program() {
        // svl has to end the program, so Ctrl-C must not end svl at once.
        listen_for_interrupt();
    }
    let mut matcher = args.algo.build()?;
    let mut output = MatchOutput::new()?;
    let frame = read(args)?;
    let (pair, rig) = (&frame.pair, frame.rig());
    let context = MatchContext {
        color: frame.color.as_ref(),
        rig: rig.copied(),
        ..MatchContext::default()
    };
    output.begin();
    matcher.compute(RectifiedPair::assume(pair), &context, &mut output)?;

    outputs.begin()?;
    if rig.is_none() && files::has_ending(&args.output, "ply") {
        let output = args.output.display();
        bail!("{output}: a point cloud needs a calibration in metres");
    }
    write_maps(args, &outputs, &output.disparity, pair, rig)?;
    let own_grid = output.grid.take();
    let grid = own_grid.unwrap_or_else(|| {
        let map = output.disparity.disparity();
        depth::grid(map, GridSettings::default(), rig)
    });
    outputs.commit()?;
    let report = MatchReport::new(&args.algo, &output, &grid, choice.as_ref(), rig);
    print_value(args.json, &report, || report.text())
}

/// The pair, rectified unless the calibration is of rectified cameras.
fn read(args: &Args) -> anyhow::Result<Frame> {
    let request = Request {
        options: SourceOptions {
            calib: args.calib.as_ref().map(|path| path.display().to_string()),
            bits: args.bits,
            scale: args.scale,
            ..SourceOptions::default()
        },
        ..Request::default()
    };
    request.options.check()?;
    let opened = open_pair([&args.left, &args.right], &request)?;
    opened.notes.iter().for_each(print_error);
    // The map has only the disparities that are searched, whatever the cells see.
    let range = args.algo.range().unwrap_or(0..=i32::MAX);
    Ok(only_pair(opened.source, range)?)
}

/// Checks that the options go together.
fn check(args: &Args) -> anyhow::Result<()> {
    if files::has_ending(&args.output, "ply") && args.calib.is_none() {
        let cure = "a point cloud needs --calib FILE, for distances";
        return Err(usage::wrong(format!("{}: {cure}", args.output.display())));
    }
    Ok(())
}

fn claim(args: &Args) -> svl::Result<Outputs> {
    let outputs = [Some(&args.output), args.why.as_ref(), args.preview.as_ref()];
    let calibration = args.calib.as_deref().map(inputs).transpose()?;
    let images = [&args.left, &args.right].into_iter();
    let read = images.chain(calibration.iter().flatten());
    Outputs::claim(
        args.force,
        read.map(PathBuf::as_path),
        outputs.into_iter().flatten().map(PathBuf::as_path),
    )
}

/// Writes the files that are made from the disparities alone.
fn write_maps(
    args: &Args,
    outputs: &Outputs,
    map: &DisparityMap,
    pair: &StereoPair,
    rig: Option<&Rig>,
) -> anyhow::Result<()> {
    let (width, height) = pair.size();
    let place = outputs.place(&args.output);
    match rig.filter(|_| files::has_ending(&place, "ply")) {
        Some(rig) => files::write_ply(&place, map.disparity(), pair.left(), rig)?,
        None => files::write_disparity(&place, map)?,
    }
    if let Some(path) = &args.why {
        files::write_why(&outputs.place(path), map)?;
    }
    if let Some(path) = &args.preview {
        let finite = map.disparity().pixels().filter(|d| d.is_finite());
        let max_px = finite.fold(1.0, f32::max);
        let preview = overlay::preview(map, max_px);
        files::write_png(&outputs.place(path), width, height, &preview)?;
    }
    Ok(())
}

impl<'a> MatchReport<'a> {
    fn new(
        algorithm: &'a Algorithm,
        output: &MatchOutput,
        grid: &DepthGrid,
        choice: Option<&SafeChoice>,
        rig: Option<&Rig>,
    ) -> Self {
        let (map, times) = (&output.disparity, output.clock.times());
        let (width, height) = map.disparity().size();
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let pixels = Reason::PIXELS.iter();
        let stages = Stage::ALL.iter();
        Self {
            algorithm: algorithm.label(),
            parameters: algorithm.parameters().to_string(),
            width,
            height,
            coverage: map.coverage(),
            pixels: pixels
                .map(|r| (r.name(), map.tally()[*r as usize]))
                .collect(),
            total_ms: ms(times.total()),
            stages_ms: stages.map(|s| (s.name(), ms(times.get(*s)))).collect(),
            hash: hash_words(map.hash()),
            median_row_offset: map.median_row_offset(),
            distances_m: rig.map(|_| distances(grid)),
            cells: MatchCell::all(map, grid, choice),
            doubts: NoticeLog::current().doubts(),
        }
    }
}

/// Distances row by row, none if unknown.
fn distances(grid: &DepthGrid) -> Vec<Vec<Option<f64>>> {
    let cells = grid.iter().map(|(_, cell)| cell.depth?.distance_m);
    let cells: Vec<_> = cells.collect();
    let rows = cells.chunks(grid.shape().columns);
    rows.map(<[_]>::to_vec).collect()
}

impl MatchReport<'_> {
    fn text(&self) -> Result<String, std::fmt::Error> {
        let mut text = String::new();
        let (algorithm, width, height) = (self.algorithm, self.width, self.height);
        let (covered, ms) = (100.0 * self.coverage, self.total_ms);
        writeln!(
            text,
            "{algorithm} on {width}x{height}: {covered:.1} % of the pixels, {ms:.2} ms"
        )?;
        for (reason, pixels) in self.pixels.iter().filter(|(_, pixels)| *pixels > 0) {
            let percent = 100.0 * *pixels as f64 / (width * height) as f64;
            writeln!(text, "  {reason:<12} {percent:>6.2} %  {pixels}")?;
        }
        let mut states = self.cells.iter().map(|cell| cell.report.state);
        for row in self.distances_m.iter().flatten() {
            let cell = |d: &Option<f64>| match (d, states.next()) {
                (Some(d), _) => format!("{d:6.2}"),
                (None, Some(state @ (CellState::Near | CellState::Far))) => {
                    format!("{:>6}", state.name())
                }
                (None, _) => "     ?".to_owned(),
            };
            let cells: Vec<_> = row.iter().map(cell).collect();
            writeln!(text, "  {} m", cells.join(" "))?;
        }
        if let Some(rows) = self.median_row_offset {
            writeln!(
                text,
                "  vertical misalignment: right image {rows:+} px lower"
            )?;
        }
        writeln!(text, "  hash {}", self.hash)?;
        Ok(text)
    }
}
