//! A viewer layout (blueprint) as a tree, written to a stream or a file.
//!
//! The SDK's own blueprint types cannot yet set a view's properties (axes, legends, the eye in 3D)
//! or write a layout file, so this writes the blueprint's entities directly, like the Python SDK.

use rerun::external::re_log_types::BlueprintActivationCommand;
use rerun::external::re_sdk_types::blueprint::archetypes::{
    ContainerBlueprint, PanelBlueprint, TimePanelBlueprint, ViewBlueprint, ViewContents,
    ViewportBlueprint, VisibleTimeRanges,
};
use rerun::external::re_sdk_types::blueprint::components::{
    ColumnShare, ContainerKind, LoopMode, PanelState, PlayState, RootContainer, RowShare,
    VisibleTimeRange,
};
use rerun::external::re_sdk_types::external::uuid::Uuid;
use rerun::external::re_types_core::datatypes::{
    TimeInt, TimeRange, TimeRangeBoundary, VisibleTimeRange as VisibleTimeRangeOn,
};
use rerun::{
    ApplicationId, AsComponents, EntityPath, RecordingStream, RecordingStreamBuilder,
    RecordingStreamResult,
};
use std::path::Path;

/// A container or a view.
pub(crate) enum LayoutNode {
    Container {
        kind: ContainerKind,
        name: String,
        children: Vec<LayoutNode>,
        shares: Vec<f32>,
    },
    LayoutView(LayoutView),
}

/// A view of some entities.
pub(crate) struct LayoutView {
    class: &'static str,
    name: String,
    origin: String,
    contents: Vec<String>,
    properties: Vec<(&'static str, Box<dyn AsComponents>)>,
    pasts: Vec<String>,
}

impl LayoutNode {
    /// Children from left to right, with their fractions of the width; equal ones if empty.
    pub(crate) fn row(name: &str, children: Vec<LayoutNode>, shares: &[f32]) -> Self {
        Self::container(ContainerKind::Horizontal, name, children, shares)
    }

    /// Children from top to bottom, with their fractions of the height.
    pub(crate) fn column(name: &str, children: Vec<LayoutNode>, shares: &[f32]) -> Self {
        Self::container(ContainerKind::Vertical, name, children, shares)
    }

    /// Children as tabs, the first in front; an only child is shown alone.
    pub(crate) fn tabs(name: &str, mut children: Vec<LayoutNode>) -> Self {
        match children.len() {
            1 => children.remove(0),
            _ => Self::container(ContainerKind::Tabs, name, children, &[]),
        }
    }

    /// Children in rows of about equal length.
    pub(crate) fn grid(name: &str, children: Vec<LayoutNode>) -> Self {
        Self::container(ContainerKind::Grid, name, children, &[])
    }

    fn container(
        kind: ContainerKind,
        name: &str,
        children: Vec<LayoutNode>,
        shares: &[f32],
    ) -> Self {
        Self::Container {
            kind,
            name: name.to_owned(),
            children,
            shares: shares.to_vec(),
        }
    }

    /// Logs the subtree; returns path and id of its root.
    fn log(&self, stream: &RecordingStream) -> RecordingStreamResult<(EntityPath, Uuid)> {
        let id = Uuid::new_v4();
        let path = match self {
            Self::Container {
                kind,
                name,
                children,
                shares,
            } => {
                let children = children
                    .iter()
                    .map(|c| c.log(stream))
                    .collect::<RecordingStreamResult<Vec<_>>>()?;
                let mut container = ContainerBlueprint::new(*kind)
                    .with_contents(children.iter().map(|(path, _)| path.to_string()))
                    .with_display_name(name.as_str());
                if let Some((first, _)) = children.first().filter(|_| *kind == ContainerKind::Tabs)
                {
                    container = container.with_active_tab(first.to_string());
                }
                if !shares.is_empty() {
                    container = container
                        .with_col_shares(shares.iter().map(|&s| ColumnShare(s.into())))
                        .with_row_shares(shares.iter().map(|&s| RowShare(s.into())));
                }
                let path = EntityPath::from(format!("container/{id}"));
                stream.log(path.clone(), &container)?;
                path
            }
            Self::LayoutView(view) => view.log(id, stream)?,
        };
        Ok((path, id))
    }
}

impl LayoutView {
    /// A view of Rerun's class `class` (`2D`, `3D`, `TimeSeries`, `TextDocument`, `TextLog`)
    /// showing the entities listed in `contents`, relative to `origin`.
    pub(crate) fn new<S: Into<String>>(
        class: &'static str,
        name: &str,
        origin: &str,
        contents: impl IntoIterator<Item = S>,
    ) -> Self {
        let contents = contents.into_iter().map(Into::into).collect();
        let (name, origin) = (name.to_owned(), origin.to_owned());
        Self {
            class,
            name,
            origin,
            contents,
            properties: Vec::new(),
            pasts: Vec::new(),
        }
    }

    /// Sets a property archetype of the view, under Rerun's name for it.
    pub(crate) fn with(
        mut self,
        name: &'static str,
        property: impl AsComponents + 'static,
    ) -> Self {
        self.properties.push((name, Box::new(property)));
        self
    }

    /// Shows the whole history of the entity up to the time cursor, not only its latest state.
    pub(crate) fn with_past(mut self, entity: &str) -> Self {
        self.pasts.push(entity.to_owned());
        self
    }

    fn log(&self, id: Uuid, stream: &RecordingStream) -> RecordingStreamResult<EntityPath> {
        let path = format!("view/{id}");
        let contents = ViewContents::new(self.contents.iter().map(String::as_str));
        stream.log(format!("{path}/ViewContents"), &contents)?;
        let view = ViewBlueprint::new(self.class)
            .with_display_name(self.name.as_str())
            .with_space_origin(self.origin.as_str());
        stream.log(path.as_str(), &view)?;
        for (name, property) in &self.properties {
            stream.log(format!("{path}/{name}"), property.as_ref())?;
        }
        for entity in &self.pasts {
            let past = VisibleTimeRanges::new(crate::TIMELINES.map(until_now));
            let path = ViewContents::blueprint_base_visualizer_path_for_entity(
                id,
                &EntityPath::from(entity.as_str()),
            );
            stream.log(path, &past)?;
        }
        Ok(path.into())
    }
}

fn until_now(timeline: &str) -> VisibleTimeRange {
    let range = TimeRange {
        start: TimeRangeBoundary::Infinite,
        end: TimeRangeBoundary::CursorRelative(TimeInt(0)),
    };
    VisibleTimeRange(VisibleTimeRangeOn {
        timeline: timeline.into(),
        range,
    })
}

impl From<LayoutView> for LayoutNode {
    fn from(view: LayoutView) -> Self {
        Self::LayoutView(view)
    }
}

/// Position of the time cursor when the viewer opens.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum TimeCursor {
    /// At the first frame, paused.
    First,
    /// At the last frame, following new ones.
    Last,
}

/// Writes the layout `root`, with its panels collapsed and its time cursor on `timeline`, into a
/// blueprint's stream.
fn log(
    root: &LayoutNode,
    timeline: &str,
    cursor: TimeCursor,
    stream: &RecordingStream,
) -> RecordingStreamResult<()> {
    // The viewer reads a blueprint at its latest moment of this timeline.
    stream.set_time_sequence("blueprint", 0);
    let (_, root) = root.log(stream)?;
    let viewport = ViewportBlueprint::new()
        .with_root_container(RootContainer(root.into()))
        .with_auto_layout(false)
        .with_auto_views(false);
    stream.log("viewport", &viewport)?;
    stream.log(
        "blueprint_panel",
        &PanelBlueprint::new().with_state(PanelState::Collapsed),
    )?;
    stream.log(
        "selection_panel",
        &PanelBlueprint::new().with_state(PanelState::Collapsed),
    )?;
    let mut time = TimePanelBlueprint::new()
        .with_state(PanelState::Collapsed)
        .with_timeline(timeline);
    if cursor == TimeCursor::First {
        // Paused alone would stop at the last frame read by then.
        time = time
            .with_play_state(PlayState::Paused)
            .with_loop_mode(LoopMode::All);
    }
    stream.log("time_panel", &time)
}

fn builder(app: ApplicationId) -> RecordingStreamBuilder {
    RecordingStreamBuilder::new(app)
        .recording_id(Uuid::new_v4().to_string())
        .blueprint()
}

/// Sends the layout along with the recording `stream` of `app`. It becomes the active one: a layout
/// left over from a run with other algorithms would show empty views.
pub(crate) fn send(
    root: &LayoutNode,
    app: ApplicationId,
    timeline: &str,
    cursor: TimeCursor,
    stream: &RecordingStream,
) -> RecordingStreamResult<()> {
    let (blueprint, storage) = builder(app).memory()?;
    log(root, timeline, cursor, &blueprint)?;
    let messages = storage.take();
    let Some(id) = messages.first().map(|message| message.store_id().clone()) else {
        return Ok(());
    };
    stream.send_blueprint(messages, BlueprintActivationCommand::make_active(id));
    Ok(())
}

/// Writes the layout to the file `path`, by custom `*.rbl`, for recordings of `app`.
pub(crate) fn save(
    root: &LayoutNode,
    app: ApplicationId,
    timeline: &str,
    path: &Path,
) -> RecordingStreamResult<()> {
    let blueprint = crate::file::open(builder(app), path)?;
    log(root, timeline, TimeCursor::Last, &blueprint)?;
    // The viewer activates what it has read so far. A failure appears again below.
    let _ = blueprint.flush_blocking();
    if let Some(info) = blueprint.store_info() {
        blueprint.record_msg(BlueprintActivationCommand::make_active(info.store_id).into());
    }
    blueprint.finalize_deferred_sinks();
    Ok(())
}
