//! svl's viewer layouts (blueprints) for a run and for a recording.

use crate::blueprint::{self, LayoutNode, LayoutView};
use crate::info::AlgorithmPath;
use crate::picture::LEGEND_SHARE;
use crate::target::Destination;
use crate::{CAMERA, IMAGE, LEGEND};
use rerun::datatypes::Range2D;
use rerun::external::re_sdk_types::blueprint::archetypes::{
    Background, EyeControls3D, LineGrid3D, PlotLegend, ScalarAxis, SpatialInformation,
    VisualBounds2D,
};
use rerun::external::re_sdk_types::blueprint::components::{BackgroundKind, Corner2D};
use rerun::{ApplicationId, Rgba32, components::Color};
use std::path::Path;
use svl_bench::sink::RerunTarget;
use svl_core::Result;
use svl_score::judge::{Metric, MetricUnit};

/// Contents of the first frame. A view without data would only be a hole in the layout.
pub(crate) struct Facts {
    /// Name of its truth, if it has one.
    pub truth: Option<String>,
    pub rig: bool,
    /// Size of the images, unless they come from several scenes.
    pub size: Option<(usize, usize)>,
    /// Position and target of the 3D view, world frame, metres.
    pub eye: [[f32; 3]; 2],
    /// The plotted metrics.
    pub plots: Vec<&'static Metric>,
}

/// The layout of a run: the world and the overlays above, the maps below them, plots and text at
/// the bottom.
pub(crate) fn run(algorithms: &[AlgorithmPath], facts: &Facts) -> LayoutNode {
    let one = algorithms.len() == 1;
    let truth = facts.truth.as_deref();
    let truth_overlay = truth.map(|name| picture(name, "truth/overlay"));
    let overlays: Vec<LayoutNode> = algorithms
        .iter()
        .map(|a| picture(&a.label, &a.path("overlay")))
        .chain(truth_overlay)
        .collect();
    let overlays = if overlays.len() <= 2 {
        LayoutNode::row("overlays", overlays, &[])
    } else {
        LayoutNode::grid("overlays", overlays)
    };
    let worlds: Vec<LayoutNode> = algorithms.iter().map(|a| world(a, facts, one)).collect();
    let top = if facts.rig {
        LayoutNode::row(
            "scene",
            vec![LayoutNode::tabs("worlds", worlds), overlays],
            &[if one { 0.7 } else { 0.5 }, 1.0],
        )
    } else {
        overlays
    };
    let shares: &[f32] = if algorithms.len() > 2 {
        &[5.0, 3.0, 2.0]
    } else {
        &[4.0, 3.0, 2.0]
    };
    LayoutNode::column(
        "svl",
        vec![top, maps(algorithms, facts), bottom(algorithms, facts)],
        shares,
    )
}

/// The maps: side by side for one algorithm; for several a tab per kind, which compares like with
/// like.
fn maps(algorithms: &[AlgorithmPath], facts: &Facts) -> LayoutNode {
    let kinds = ["depth", "disparity", "why", "ssdpi"]
        .into_iter()
        .filter(|&kind| kind != "depth" || facts.rig);
    let one = algorithms.len() == 1;
    let mut nodes = Vec::new();
    for kind in kinds {
        let shown = |algorithm: &&AlgorithmPath| kind != "ssdpi" || algorithm.extra.ssdpi;
        let views = algorithms.iter().filter(shown).map(|algorithm| {
            let name = if one { kind } else { &algorithm.label };
            let path = algorithm.path(kind);
            if kind == "why" {
                reasons(name, &path, facts)
            } else {
                map(name, &path)
            }
        });
        let truth = facts.truth.as_deref().filter(|_| kind == "depth");
        let truth = truth.map(|name| match (one, name) {
            (true, "truth") => map("true depth", "truth/depth"),
            (_, name) => map(name, "truth/depth"),
        });
        let views: Vec<LayoutNode> = views.chain(truth).collect();
        if one {
            nodes.extend(views);
        } else if !views.is_empty() {
            nodes.push(LayoutNode::row(kind, views, &[]));
        }
    }
    if one {
        LayoutNode::row("maps", nodes, &[])
    } else {
        LayoutNode::tabs("maps", nodes)
    }
}

/// The layout during tuning: a column per algorithm, and one for the truth or the images; overlays
/// at the top, disparities below them, and the reasons of invalid pixels at the bottom.
pub(crate) fn tuning(algorithms: &[AlgorithmPath], facts: &Facts) -> LayoutNode {
    let each = |view: &dyn Fn(&AlgorithmPath) -> LayoutNode| -> Vec<LayoutNode> {
        algorithms.iter().map(view).collect()
    };
    let mut overlays = each(&|a| picture(&a.label, &a.path("overlay")));
    let mut disparities = each(&|a| map(&format!("disparity, {}", a.label), &a.path("disparity")));
    let mut whys = each(&|a| reasons(&format!("why, {}", a.label), &a.path("why"), facts));
    match &facts.truth {
        Some(name) => {
            overlays.push(picture(name, "truth/overlay"));
            let depth = facts.rig.then(|| map("true depth", "truth/depth"));
            disparities.extend(depth);
        }
        None => overlays.push(map("left", IMAGE)),
    }
    let settings = LayoutView::new("TextDocument", "settings", "run/parameters", ["$origin"]);
    whys.push(settings.into());
    let rows = [
        ("overlays", overlays),
        ("disparities", disparities),
        ("why", whys),
    ];
    let rows = rows.map(|(name, views)| LayoutNode::row(name, views, &[]));
    LayoutNode::column("tuning", rows.into(), &[])
}

fn bottom(algorithms: &[AlgorithmPath], facts: &Facts) -> LayoutNode {
    let stages = |a: &AlgorithmPath| [format!("{}/**", a.path("latency"))];
    let latency = match algorithms {
        [only] => plot("latency, ms", stages(only), true).into(),
        _ => {
            let totals = plot(
                "latency, ms",
                algorithms.iter().map(|a| a.path("latency/total")),
                true,
            );
            let each = algorithms
                .iter()
                .map(|a| plot(&format!("{}, ms", a.label), stages(a), true));
            LayoutNode::tabs(
                "latency",
                std::iter::once(totals)
                    .chain(each)
                    .map(LayoutNode::from)
                    .collect(),
            )
        }
    };
    let metric = |metric: &&'static Metric| {
        let plots = metric.plot.into_iter();
        let paths = plots.flat_map(|plot| algorithms.iter().map(move |a| a.path(plot)));
        let view = if metric.counts() {
            plot(metric.words, paths, false)
        } else if metric.unit == MetricUnit::Share {
            plot(&format!("{}, %", metric.words), paths, false)
                .with("ScalarAxis", ScalarAxis::new().with_range([0.0, 100.0]))
        } else {
            plot(&format!("{}, px", metric.words), paths, false)
        };
        view.into()
    };
    // The fractions first, as they are always there.
    let (counts, others): (Vec<_>, Vec<_>) = facts.plots.iter().partition(|m| m.counts());
    let mut nodes = vec![latency];
    nodes.extend(others.iter().chain(&counts).map(metric));
    let texts: Vec<LayoutNode> = vec![
        LayoutView::new("TextDocument", "verdicts", "run/verdicts", ["$origin"]).into(),
        LayoutView::new("TextDocument", "parameters", "run/parameters", ["$origin"]).into(),
        LayoutView::new("TextLog", "frames", "run/frames", ["$origin"]).into(),
    ];
    nodes.push(LayoutNode::tabs("text", texts));
    LayoutNode::row("numbers", nodes, &[])
}

/// A recording with these topics, named in the viewer as in the recording: both images, the true
/// depth, and the cameras in the frame `world`. `None` if no image is on a topic svl knows.
fn recording(topics: &[String]) -> Option<LayoutNode> {
    let view = |(name, topic): (&str, &str)| {
        let known = topics.iter().any(|t| t == topic);
        known.then(|| {
            LayoutView::new("2D", name, topic, ["$origin"])
                .with("Background", dark())
                .into()
        })
    };
    let images: Vec<LayoutNode> = [
        ("left", "/stereo/left/image"),
        ("right", "/stereo/right/image"),
    ]
    .into_iter()
    .filter_map(view)
    .collect();
    if images.is_empty() {
        return None;
    }
    let mut rows = vec![LayoutNode::row("pair", images, &[])];
    let mut scene: Vec<LayoutNode> = view(("true depth", "/truth/depth")).into_iter().collect();
    if topics.iter().any(|topic| topic == "/rig/pose") {
        let world = LayoutView::new(
            "3D",
            "world",
            "/",
            ["+ /rig/**", "+ /stereo/left/**", "+ /truth/depth"],
        )
        .with("SpatialInformation", SpatialInformation::new("world"))
        .with("Background", dark());
        scene.push(world.into());
    }
    if !scene.is_empty() {
        rows.push(LayoutNode::row("scene", scene, &[]));
    }
    Some(LayoutNode::column("svl", rows, &[]))
}

/// Writes a viewer layout for the recording `file` (MCAP) with these topics to `layout`, by custom
/// `*.rbl`, and returns true if it did: a recording without svl's topics keeps the viewer's
/// automatic layout.
///
/// # Errors
/// If the layout cannot be written.
pub(crate) fn save_recording_layout(file: &Path, topics: &[String], layout: &Path) -> Result<bool> {
    let Some(root) = recording(topics) else {
        return Ok(false);
    };
    // The viewer uses the file name as application id, and a layout belongs to an application.
    let app = ApplicationId::new_or_unknown(file.file_stem().unwrap_or_default().to_string_lossy());
    blueprint::save(&root, app, "message_log_time", layout)
        .map_err(|error| Destination(RerunTarget::File(layout.to_owned())).failed(error))?;
    Ok(true)
}

/// The left image with an entity over it.
fn picture(name: &str, over: &str) -> LayoutNode {
    through_camera(name, [IMAGE, over]).into()
}

/// The reasons on the left image, with their legend below, if all frames have one size.
fn reasons(name: &str, path: &str, facts: &Facts) -> LayoutNode {
    let Some((width, height)) = facts.size else {
        return picture(name, path);
    };
    let range = Range2D {
        x_range: [0.0, width as f64].into(),
        y_range: [0.0, height as f64 * (1.0 + LEGEND_SHARE)].into(),
    };
    through_camera(name, [IMAGE, path, LEGEND])
        .with("VisualBounds2D", VisualBounds2D::new(range))
        .into()
}

/// A map alone.
fn map(name: &str, path: &str) -> LayoutNode {
    through_camera(name, [path]).into()
}

/// Entities in the image of the camera.
fn through_camera<const N: usize>(name: &str, paths: [&str; N]) -> LayoutView {
    let contents = paths.map(|path| format!("+ /{path}/**"));
    LayoutView::new("2D", name, CAMERA, contents).with("Background", dark())
}

fn world(algorithm: &AlgorithmPath, facts: &Facts, one: bool) -> LayoutNode {
    let name = if one {
        "world".to_owned()
    } else {
        format!("world, {}", algorithm.label)
    };
    let [position, target] = facts.eye;
    LayoutView::new(
        "3D",
        &name,
        "world",
        [
            "+ $origin/**".to_owned(),
            format!("+ /{}/**", algorithm.path("points")),
        ],
    )
    .with(
        "EyeControls3D",
        EyeControls3D::new()
            .with_position(position)
            .with_look_target(target),
    )
    .with("LineGrid3D", LineGrid3D::new().with_visible(false))
    .with("Background", dark())
    .with_past("world/trail")
    .into()
}

/// Lines over time. One legend suffices for all plots of the algorithms, whose colours are the same
/// everywhere.
fn plot(name: &str, entities: impl IntoIterator<Item = String>, legend: bool) -> LayoutView {
    LayoutView::new(
        "TimeSeries",
        name,
        "/",
        entities.into_iter().map(|path| format!("+ /{path}")),
    )
    .with(
        "PlotLegend",
        PlotLegend::new()
            .with_visible(legend)
            .with_corner(Corner2D::LeftTop),
    )
}

fn dark() -> Background {
    Background::new(BackgroundKind::SolidColor).with_color(Color(Rgba32::from_rgb(16, 17, 20)))
}
