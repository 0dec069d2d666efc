//! Panels around the pictures. They read the document and push requests; none changes it.

pub mod bake;
pub mod benchmark;
mod dock;
pub mod error;
pub mod export;
pub mod files;
pub mod help;
pub mod info;
pub mod keys;
mod lamp;
pub mod log;
pub mod look;
pub mod method;
pub mod report;
pub mod stage;
pub mod target;
pub mod timeline;
pub mod top;
pub mod widgets;

use eframe::egui::{Button, Ui};

pub use dock::{Dock, Panel};

use crate::command::Command;
use crate::content::difference::DifferenceView;
use crate::document::Document;
use crate::document::target_scale::Unit;
use crate::panel::keys::Action;
use crate::stage::scatter::Scatter;
use crate::stage::status::{KeyframeSelection, StageStatus};

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
    /// Bake maps (true), or remove them.
    Bake(bool),
    /// Draw a difference picture.
    Difference(Box<DifferenceView>),
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
    /// Draws a button of an action, with its key in the tooltip.
    pub fn button(&mut self, ui: &mut Ui, action: Action, text: &str, tip: &str, is_enabled: bool) {
        let tip = action.tip(tip);
        let response = ui.add_enabled(is_enabled, Button::new(text));
        if response.on_hover_text(&tip).on_disabled_hover_text(tip).clicked() {
            self.action(action);
        }
    }
    /// Draws a button of an action that marks a state, with its key in the tooltip.
    pub fn toggle(&mut self, ui: &mut Ui, action: Action, text: &str, tip: &str, is_on: bool) {
        if widgets::segment(ui, text, is_on, &action.tip(tip)) {
            self.action(action);
        }
    }
}

/// State of the window that is not part of the document.
#[derive(Clone, Debug, Default)]
pub struct WindowState {
    /// Recent files, newest first.
    pub recent: Vec<std::path::PathBuf>,
    /// Name of the adapter.
    pub adapter: String,
    /// Median CPU time of the last frames in seconds.
    pub frame_secs: f64,
    /// Longest of these times.
    pub longest_frame_secs: f64,
    /// Number of triangles drawn last.
    pub triangles_drawn: u64,
    /// Error in the user's own appearance files.
    pub shader_error: Option<String>,
    /// Error of the result in pixels, from the present camera.
    pub error_px: Option<f64>,
    /// Number of the border or defect that was visited last.
    pub flaw: Option<usize>,
    /// Unit of the slider.
    pub unit: Unit,
    /// State of the stage view.
    pub stage: StageStatus,
    /// True inside a page of a browser, where benchmarks and the user's own shaders are not available.
    pub is_on_page: bool,
}
