//! State of the stage that panels read: selected copies and keyframes, and the levels of the last frame.

use super::levels::LevelSelection;
use super::motion::{KeyframeId, Motion};
use super::scatter::Scatter;

/// Keyframes that are selected in the timeline, and those being dragged.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeyframeSelection {
    /// Selected keyframes.
    pub chosen: Vec<KeyframeId>,
    /// Drag in progress.
    pub drag: Option<KeyframeDrag>,
}

/// Keyframes that are being dragged.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyframeDrag {
    /// Motion before the drag.
    pub before: Motion,
    /// Dragged keyframes.
    pub names: Vec<KeyframeId>,
    /// Time under the pointer at the start of the drag.
    pub from_secs: f64,
    /// True if the original keyframes are kept.
    pub keeps: bool,
}

/// State of the stage for panels.
#[derive(Clone, Debug, Default)]
pub struct StageStatus {
    /// Numbers of the selected copies.
    pub selected: Vec<usize>,
    /// True if a click places a copy.
    pub is_placing: bool,
    /// True if the camera is in walk mode.
    pub is_walking: bool,
    /// The levels, from the finest.
    pub levels: Vec<LevelStatus>,
    /// Copies and levels of the last frame.
    pub chosen: LevelSelection,
    /// CPU time to select the levels and submit the drawing.
    pub secs: f64,
    /// Maximum of this time since the stage was opened.
    pub longest_secs: f64,
    /// Scatter settings of the panel that are not applied yet.
    pub form: Option<Scatter>,
    /// Selected and dragged keyframes.
    pub keyframes: KeyframeSelection,
}

/// State of a level for panels.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelStatus {
    /// Number of triangles.
    pub faces: u64,
    /// Distance from which a copy of scale 1 is shown in this level, in units of the model.
    pub distance: f64,
    /// Number of copies shown in this level.
    pub copies: usize,
}
