//! `svl algos`: the registry, printed.

use crate::cli::shared::terminal::{print, print_json, width, wrapped};
use crate::cli::shared::usage;
use serde::Serialize;
use serde_json::Value;
use svl::matcher::{self, MATCHERS, MatcherSpec, Range};

/// List the algorithms, or one with its parameters
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  svl algos\n  svl algos v3\n  svl algos --json\n  \
                  svl algos exec --example python > svl_bench/matcher.py"
)]
pub(crate) struct Args {
    /// Algorithm to show
    #[arg(value_parser = matcher::find)]
    name: Option<&'static MatcherSpec>,

    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,

    /// Print a file for programs behind exec: the Python module, the C++ header, or a program that
    /// runs networks in ONNX or PyTorch, or OpenCV's matchers
    #[arg(
        long,
        value_name = "KIND",
        conflicts_with = "json",
        help_heading = "Output"
    )]
    example: Option<Example>,
}

/// The files of `adapters/`, so that an installed svl has them.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Example {
    Python,
    Cpp,
    Onnx,
    Torch,
    Opencv,
}

impl Example {
    fn text(self) -> &'static str {
        match self {
            Self::Python => include_str!("../../../adapters/matcher.py"),
            Self::Cpp => include_str!("../../../adapters/cpp/svl_matcher.hpp"),
            Self::Onnx => include_str!("../../../adapters/svl_onnx.py"),
            Self::Torch => include_str!("../../../adapters/svl_torch.py"),
            Self::Opencv => include_str!("../../../adapters/opencv.py"),
        }
    }
}

#[derive(Serialize)]
struct AlgorithmEntry {
    name: &'static str,
    aliases: &'static [&'static str],
    summary: &'static str,
    paper: &'static str,
    parameters: Vec<ParameterEntry>,
}

#[derive(Serialize)]
struct ParameterEntry {
    name: &'static str,
    unit: &'static str,
    default: Value,
    min: Value,
    max: Value,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    options: &'static [&'static str],
    description: &'static str,
}

impl AlgorithmEntry {
    fn new(spec: &MatcherSpec) -> Self {
        let parameters = spec.parameters.iter().map(|p| {
            let (default, min, max) = match p.range {
                Range::Int { default, min, max } => (default.into(), min.into(), max.into()),
                Range::Real { default, min, max } => (default.into(), min.into(), max.into()),
                Range::Flag { default } => (default.into(), false.into(), true.into()),
                Range::Text { default } | Range::Choice { default, .. } => {
                    (default.into(), Value::Null, Value::Null)
                }
                Range::File | Range::Topic | Range::Pattern => Default::default(),
            };
            let options = match p.range {
                Range::Choice { options, .. } => options,
                _ => &[],
            };
            ParameterEntry {
                name: p.name,
                unit: p.unit,
                default,
                min,
                max,
                options,
                description: p.description,
            }
        });
        Self {
            name: spec.name,
            aliases: spec.aliases,
            summary: spec.summary,
            paper: spec.paper,
            parameters: parameters.collect(),
        }
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(example) = args.example {
        if !args.name.is_some_and(MatcherSpec::is_program) {
            let words = "--example needs a kind of program: svl algos exec --example KIND";
            return Err(usage::wrong(words.to_owned()));
        }
        return print(example.text());
    }
    let specs = args
        .name
        .map_or_else(|| MATCHERS.iter().collect(), |spec| vec![spec]);
    if args.json {
        let entries: Vec<_> = specs.iter().map(|spec| AlgorithmEntry::new(spec)).collect();
        return print_json(&entries);
    }
    let last = width();
    let mut text: String = specs.iter().map(|spec| describe(spec, last)).collect();
    if let Some(spec) = args.name.filter(|spec| !spec.about.is_empty()) {
        text += &wrapped("", 0, spec.about, last);
        text.push('\n');
    }
    let usage = "Use as NAME:key=value,key=value, for instance --algo v3:max_disparity=64";
    text += &wrapped("", 0, usage, last);
    print(&text)
}

/// Column where the description of an algorithm begins.
const COLUMN: usize = 7;
/// Smallest width of the column of descriptions beside names and values of parameters.
const MIN_DESCRIPTION_COLUMN: usize = 30;

fn describe(spec: &MatcherSpec, last: usize) -> String {
    let mut text = wrapped(spec.name, COLUMN, spec.summary, last);
    text += &wrapped("", COLUMN, spec.paper, last);
    if !spec.aliases.is_empty() {
        let also = format!("also called {}", spec.aliases.join(", "));
        text += &wrapped("", COLUMN, &also, last);
    }
    text.push('\n');
    let width =
        |f: fn(&matcher::Parameter) -> usize| spec.parameters.iter().map(f).max().unwrap_or(0);
    let (names, values) = (width(|p| p.name.len()), width(|p| setting(p).len()));
    let beside = COLUMN + names + 2 + values + 2;
    for p in spec.parameters {
        let head = format!("{:COLUMN$}{:<names$}  {}", "", p.name, setting(p));
        if beside + MIN_DESCRIPTION_COLUMN <= last {
            text += &wrapped(&head, beside, p.description, last);
        } else {
            text += &format!("{head}\n");
            text += &wrapped("", COLUMN + 4, p.description, last);
        }
    }
    text.push('\n');
    text
}

/// Default and range of a parameter with its unit: `80 px (-512..=512)`.
fn setting(p: &matcher::Parameter) -> String {
    let unit = if p.unit.is_empty() {
        String::new()
    } else {
        format!(" {}", p.unit)
    };
    let range = match p.range {
        Range::Int { min, max, .. } => format!("{min}..={max}"),
        Range::Real { min, max, .. } => format!("{min}..={max}"),
        Range::Flag { .. } => "true, false".to_owned(),
        Range::Text { .. } => return "text".to_owned(),
        Range::File => return "file".to_owned(),
        Range::Topic => return "topic".to_owned(),
        Range::Pattern => return "files".to_owned(),
        Range::Choice { options, .. } => options.join(", "),
    };
    format!("{}{unit} ({range})", p.range.default())
}
