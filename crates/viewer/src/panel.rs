//! Panels round the pictures. They read the document and push requests; none changes it.

pub mod benchmark;
pub mod error;
pub mod export;
pub mod files;
pub mod help;
pub mod info;
pub mod log;
pub mod look;
pub mod method;
pub mod report;
pub mod stage;
pub mod target;
pub mod timeline;
pub mod top;
pub mod widgets;

use serde::{Deserialize, Serialize};

use crate::command::Command;
use crate::document::Document;
use crate::keys::Action;
use crate::stage::picture::KeyframeSelection;
use crate::stage::scatter::Scatter;

/// A panel that can be shown and hidden.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Panel {
    /// Open files and recent ones.
    Files,
    /// Method and its options.
    Method,
    /// Report of the engine.
    Report,
    /// Counts and times.
    Info,
    /// Appearance.
    Look,
    /// Distances between result and original.
    Error,
    /// Log messages.
    Log,
    /// Copies on the stage.
    Stage,
    /// Timeline of animations and keyframes.
    Timeline,
    /// Benchmark of levels.
    Benchmark,
}

impl Panel {
    /// All panels, in the order of the menu.
    pub const ALL: [Self; 10] = [
        Self::Files,
        Self::Stage,
        Self::Method,
        Self::Report,
        Self::Error,
        Self::Info,
        Self::Look,
        Self::Timeline,
        Self::Benchmark,
        Self::Log,
    ];

    /// Returns its name.
    pub fn title(self) -> &'static str {
        match self {
            Self::Files => "Files",
            Self::Method => "Method",
            Self::Report => "Report",
            Self::Info => "Info",
            Self::Look => "Look",
            Self::Error => "Error",
            Self::Log => "Log",
            Self::Stage => "Stage",
            Self::Timeline => "Timeline",
            Self::Benchmark => "Benchmarks",
        }
    }

    /// Returns the dock of the panel.
    pub fn dock(self) -> Dock {
        match self {
            Self::Files | Self::Stage | Self::Method | Self::Report => Dock::Left,
            Self::Info | Self::Look | Self::Error => Dock::Right,
            Self::Timeline | Self::Benchmark => Dock::Middle,
            Self::Log => Dock::Bottom,
        }
    }

    /// Returns true if it is shown by default.
    pub fn is_shown_by_default(self) -> bool {
        matches!(self, Self::Method | Self::Report | Self::Info | Self::Look)
    }
}

/// A place for panels in the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dock {
    /// Left: input and method.
    Left,
    /// Right: result and appearance.
    Right,
    /// Below the pictures, above the slider.
    Middle,
    /// Bottom: the log.
    Bottom,
}

/// Data that panels read, and their requests.
pub struct PanelContext<'a> {
    /// The document.
    pub document: &'a Document,
    /// State of the window that is not part of the document.
    pub facts: &'a WindowState,
    /// Requests of the panels, in order.
    pub requests: Vec<UiRequest>,
}

/// A request of a panel.
#[derive(Clone, Debug, PartialEq)]
pub enum UiRequest {
    /// Run a command.
    Command(Command),
    /// Carry out an action.
    Action(Action),
    /// Open a file.
    OpenFile(std::path::PathBuf),
    /// Open the sample model.
    OpenSample,
    /// Choose a matcap.
    ChooseMatcap,
    /// Choose an environment.
    ChooseEnvironment,
    /// Choose a shader.
    ChooseShader,
    /// Copy text to the clipboard.
    Copy(String),
    /// Scatter copies on the stage.
    Scatter(Scatter),
    /// Set the form of the next scattering.
    ScatterForm(Scatter),
    /// Set the keyframe selection and drag.
    KeyframeSelection(KeyframeSelection),
}

impl PanelContext<'_> {
    /// Requests a command.
    pub fn command(&mut self, command: Command) {
        self.requests.push(UiRequest::Command(command));
    }
    /// Requests an action.
    pub fn action(&mut self, action: Action) {
        self.requests.push(UiRequest::Action(action));
    }
}

/// State of the window that is not part of the document.
#[derive(Clone, Debug, Default)]
pub struct WindowState {
    /// Recent files, newest first.
    pub recent: Vec<std::path::PathBuf>,
    /// Name of the adapter.
    pub adapter: String,
    /// CPU time of the last frame in seconds.
    pub frame_secs: f64,
    /// Longest such time since the file was opened.
    pub longest_frame_secs: f64,
    /// Number of triangles drawn last.
    pub triangles_drawn: u64,
    /// Error in the user's own appearance files.
    pub shader_error: Option<String>,
    /// Error of the result in pixels, from the present camera.
    pub error_px: Option<f64>,
    /// Unit of the slider.
    pub unit: target::Unit,
    /// State of the stage view.
    pub stage: crate::stage::picture::StageStatus,
}
