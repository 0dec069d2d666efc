//! What stands round the pictures. Panels read the document and say what is to be done; none changes it.

pub mod benchmark;
pub mod error;
pub mod export;
pub mod files;
pub mod help;
pub mod info;
pub mod log;
pub mod look;
pub mod method;
pub mod parts;
pub mod report;
pub mod stage;
pub mod target;
pub mod timeline;
pub mod top;

use serde::{Deserialize, Serialize};

use crate::command::Command;
use crate::document::Document;
use crate::keys::Action;
use crate::stage::picture::KeyframeDesk;
use crate::stage::scatter::Scatter;

/// A panel that can be shown and hidden.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Panel {
    /// Files that are open, and recent ones.
    Files,
    /// How to simplify.
    Method,
    /// What the engine says.
    Report,
    /// Counts and times.
    Info,
    /// How surfaces are shown.
    Look,
    /// How far the result lies from the original.
    Error,
    /// What was said.
    Log,
    /// Copies on a ground.
    Stage,
    /// What moves when.
    Timeline,
    /// Times of levels.
    Benchmark,
}

impl Panel {
    /// All of them, in the order of the menu.
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

    /// Its name.
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

    /// Where it stands.
    pub fn dock(self) -> Dock {
        match self {
            Self::Files | Self::Stage | Self::Method | Self::Report => Dock::Left,
            Self::Info | Self::Look | Self::Error => Dock::Right,
            Self::Timeline | Self::Benchmark => Dock::Middle,
            Self::Log => Dock::Bottom,
        }
    }

    /// Whether it is there when nothing else was said.
    pub fn is_there_at_first(self) -> bool {
        matches!(self, Self::Method | Self::Report | Self::Info | Self::Look)
    }
}

/// A side of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dock {
    /// What goes in.
    Left,
    /// What comes out.
    Right,
    /// Under the pictures, above the slider.
    Middle,
    /// What was said.
    Bottom,
}

/// What panels know, and what they say.
pub struct Scope<'a> {
    /// The document.
    pub document: &'a Document,
    /// What the window knows beside it.
    pub facts: &'a Facts,
    /// What is to be done, in this order.
    pub says: Vec<Say>,
}

/// Something that is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Say {
    /// A change of the document.
    Command(Command),
    /// What a key would do.
    Action(Action),
    /// A file to open.
    OpenFile(std::path::PathBuf),
    /// The example.
    OpenSample,
    /// Choose a picture of a lit ball.
    ChooseMatcap,
    /// Choose a picture of all directions.
    ChooseAround,
    /// Choose a shader.
    ChooseShader,
    /// Into the clipboard.
    Copy(String),
    /// Copies on the stage, by chance.
    Scatter(Scatter),
    /// How they will be.
    ScatterForm(Scatter),
    /// Which keyframes are chosen and held.
    Keyframes(KeyframeDesk),
}

impl Scope<'_> {
    /// Says a change.
    pub fn command(&mut self, command: Command) {
        self.says.push(Say::Command(command));
    }
    /// Says what a key would do.
    pub fn action(&mut self, action: Action) {
        self.says.push(Say::Action(action));
    }
}

/// What the window knows beside the document.
#[derive(Clone, Debug, Default)]
pub struct Facts {
    /// Files that were open before, newest first.
    pub recent: Vec<std::path::PathBuf>,
    /// Name of the adapter.
    pub adapter: String,
    /// Time of our own that the last frame took.
    pub frame_secs: f64,
    /// The longest since the file was opened.
    pub longest_frame_secs: f64,
    /// Triangles drawn last.
    pub triangles_drawn: u64,
    /// What is wrong with the shader of the user's.
    pub shader_error: Option<String>,
    /// Pixels that the error of the result covers, seen from here.
    pub error_px: Option<f64>,
    /// The unit of the slider.
    pub unit: target::Unit,
    /// The stage.
    pub stage: crate::stage::picture::Facts,
}
