//! Names of the panels, and their places in the window.

use serde::{Deserialize, Serialize};

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
    /// Maps baked for the result.
    Bake,
}

impl Panel {
    /// All panels, in the order of the menu.
    pub const ALL: [Self; 11] = [
        Self::Files,
        Self::Stage,
        Self::Method,
        Self::Report,
        Self::Bake,
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
            Self::Bake => "Bake",
        }
    }

    /// Returns the dock of the panel.
    pub fn dock(self) -> Dock {
        match self {
            Self::Files | Self::Stage | Self::Method | Self::Report | Self::Bake => Dock::Left,
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
