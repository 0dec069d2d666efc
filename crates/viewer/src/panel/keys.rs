//! Key bindings: one table for input, cheat sheet, tooltips and menus.

use eframe::egui::{Event, InputState, Key, KeyboardShortcut, Modifiers};
use lodsmith_core::Model;

use super::dock::Panel;
use crate::settings::playback::Playback;

/// Time step of a key: one frame at 24 frames per second.
const FRAME_SECS: f64 = 1.0 / 24.0;

/// Action of a key or button.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Action {
    /// Choose files to open.
    Open,
    /// Export the shown mesh.
    Export,
    /// Choose a session to open.
    OpenSession,
    /// Save the session.
    SaveSession,
    /// Reload the file.
    Reload,
    /// Close the file.
    Close,
    /// Close the window.
    Quit,
    /// Undo the last step.
    Undo,
    /// Redo the last undone step.
    Redo,
    /// Copy the command line.
    CopyCommand,
    /// Benchmark levels.
    Benchmark,
    /// Cancel running jobs.
    Cancel,
    /// Restore the original.
    Restore,
    /// Ten percent fewer.
    Fewer,
    /// Ten percent more.
    More,
    /// Switch between side by side, wipe, and one side.
    NextSides,
    /// Link or unlink the two cameras.
    Link,
    /// Toggle the wireframe.
    Wireframe,
    /// Set the shading.
    Shade(usize),
    /// Toggle open borders.
    Borders,
    /// Toggle defects.
    Defects,
    /// Go to the next border or defect.
    NextFlaw,
    /// Toggle the ground grid.
    Ground,
    /// Switch the environment.
    NextEnvironment,
    /// Toggle backface culling.
    Cull,
    /// Toggle automatic levels by distance.
    AutoLod,
    /// Play or pause the animation.
    Play,
    /// Go to the start.
    GoToStart,
    /// Go one frame forward or back.
    StepTime(i8),
    /// Double or halve the speed.
    Speed(i8),
    /// Toggle looping.
    Repeat,
    /// Switch to the next animation.
    NextClip,
    /// Frame the model.
    Frame,
    /// Look from a standard view.
    View(usize),
    /// Restore a saved camera.
    RestoreCamera(usize),
    /// Save the camera.
    SaveCamera(usize),
    /// Orbit the camera by a step: right, up.
    Orbit(i8, i8),
    /// Rotate the model by a step: right, up.
    TurnModel(i8, i8),
    /// Reset the rotation of the model.
    ResetRotation,
    /// Show or hide all panels.
    Panels,
    /// Show or hide a panel.
    Panel(Panel),
    /// Switch between dark and light theme.
    Theme,
    /// Save a screenshot.
    Screenshot,
    /// Show the cheat sheet.
    Help,
    /// Switch between the stage and the two sides.
    Stage,
    /// Walk through the copies in first person.
    Walk,
    /// Act on copies or keyframes.
    Copies(CopiesAction),
}

/// Action on the copies or keyframes of the stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CopiesAction {
    /// Switch between placing and selecting by click.
    Place,
    /// Scatter again with another seed.
    Scatter,
    /// Duplicate the selected copies.
    Duplicate,
    /// Delete the selected copies.
    Delete,
    /// Select all copies.
    All,
    /// Rotate the selected copies by steps.
    Turn(i8),
    /// Scale the selected copies by steps.
    Scale(i8),
    /// Toggle colours by level.
    Colors,
    /// Set a keyframe for the selected copies.
    Keyframe,
    /// Set a keyframe for the camera.
    CameraKeyframe,
    /// Go to the previous or next keyframe.
    ToKeyframe(i8),
    /// Switch between smooth and stepped interpolation.
    Curve,
    /// Switch between the keyframed camera and a free one.
    FreeCamera,
    /// Save a layout file.
    SaveLayout,
    /// Open a layout file.
    OpenLayout,
    /// Export the stage.
    Export,
}

/// Heading of the cheat sheet under which an action is listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Files.
    File,
    /// Level of detail.
    Detail,
    /// Animation.
    Animation,
    /// Appearance.
    Look,
    /// Camera.
    Camera,
    /// Stage.
    Stage,
    /// Window and panels.
    Window,
}

impl Group {
    /// All groups with their names.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::File, "Files"),
        (Self::Detail, "Detail"),
        (Self::Animation, "Animation"),
        (Self::Look, "Look"),
        (Self::Camera, "Camera"),
        (Self::Stage, "Stage"),
        (Self::Window, "Window"),
    ];
}

/// A key binding.
#[derive(Clone, Copy, Debug)]
pub struct Binding {
    /// The action.
    pub action: Action,
    /// The key.
    pub shortcut: KeyboardShortcut,
    /// A short description.
    pub name: &'static str,
    /// Group in the cheat sheet.
    pub group: Group,
}

const fn bind(group: Group, modifiers: Modifiers, key: Key, action: Action, name: &'static str) -> Binding {
    Binding { action, shortcut: KeyboardShortcut::new(modifiers, key), name, group }
}

const NONE: Modifiers = Modifiers::NONE;
const CTRL: Modifiers = Modifiers::COMMAND;
const CTRL_SHIFT: Modifiers = Modifiers::COMMAND.plus(Modifiers::SHIFT);
const SHIFT: Modifiers = Modifiers::SHIFT;

const fn copies(modifiers: Modifiers, key: Key, action: CopiesAction, name: &'static str) -> Binding {
    bind(Group::Stage, modifiers, key, Action::Copies(action), name)
}

const fn keyframes(modifiers: Modifiers, key: Key, action: CopiesAction, name: &'static str) -> Binding {
    bind(Group::Animation, modifiers, key, Action::Copies(action), name)
}

/// All key bindings.
pub const BINDINGS: &[Binding] = &[
    bind(Group::File, CTRL_SHIFT, Key::O, Action::OpenSession, "Open session"),
    bind(Group::File, CTRL_SHIFT, Key::S, Action::SaveSession, "Save session"),
    bind(Group::File, CTRL_SHIFT, Key::C, Action::CopyCommand, "Copy command line"),
    bind(Group::File, CTRL, Key::O, Action::Open, "Open"),
    bind(Group::File, CTRL, Key::S, Action::Export, "Export"),
    bind(Group::File, CTRL, Key::R, Action::Reload, "Reload"),
    bind(Group::File, CTRL, Key::W, Action::Close, "Close file"),
    bind(Group::File, CTRL, Key::Q, Action::Quit, "Quit"),
    bind(Group::Detail, CTRL, Key::Z, Action::Undo, "Undo"),
    bind(Group::Detail, CTRL, Key::Y, Action::Redo, "Redo"),
    bind(Group::Detail, NONE, Key::R, Action::Restore, "Back to original"),
    bind(Group::Detail, NONE, Key::Minus, Action::Fewer, "10 % fewer"),
    bind(Group::Detail, NONE, Key::Plus, Action::More, "10 % more"),
    bind(Group::Detail, NONE, Key::A, Action::AutoLod, "Auto LOD"),
    bind(Group::Detail, CTRL, Key::B, Action::Benchmark, "Run benchmark"),
    bind(Group::Detail, NONE, Key::Escape, Action::Cancel, "Cancel running jobs"),
    bind(Group::Animation, Modifiers::SHIFT, Key::P, Action::Repeat, "Loop"),
    bind(Group::Animation, Modifiers::SHIFT, Key::PageUp, Action::Speed(-1), "Half speed"),
    bind(Group::Animation, Modifiers::SHIFT, Key::PageDown, Action::Speed(1), "Double speed"),
    bind(Group::Animation, NONE, Key::P, Action::Play, "Play or pause"),
    bind(Group::Animation, NONE, Key::Home, Action::GoToStart, "Go to start"),
    bind(Group::Animation, NONE, Key::PageUp, Action::StepTime(-1), "Previous frame"),
    bind(Group::Animation, NONE, Key::PageDown, Action::StepTime(1), "Next frame"),
    bind(Group::Animation, NONE, Key::J, Action::NextClip, "Next animation"),
    keyframes(SHIFT, Key::K, CopiesAction::Keyframe, "Keyframe selected copies"),
    keyframes(CTRL, Key::K, CopiesAction::CameraKeyframe, "Keyframe stage camera"),
    keyframes(CTRL, Key::PageUp, CopiesAction::ToKeyframe(-1), "Previous keyframe"),
    keyframes(CTRL, Key::PageDown, CopiesAction::ToKeyframe(1), "Next keyframe"),
    keyframes(SHIFT, Key::L, CopiesAction::Curve, "Smooth or stepped motion"),
    keyframes(SHIFT, Key::V, CopiesAction::FreeCamera, "Animated or free camera"),
    bind(Group::Look, NONE, Key::W, Action::Wireframe, "Wireframe"),
    bind(Group::Look, NONE, Key::S, Action::Shade(0), "Smooth"),
    bind(Group::Look, NONE, Key::D, Action::Shade(1), "Flat"),
    bind(Group::Look, NONE, Key::T, Action::Shade(2), "Textured"),
    bind(Group::Look, NONE, Key::C, Action::Shade(3), "Vertex colours"),
    bind(Group::Look, NONE, Key::N, Action::Shade(4), "Normals"),
    bind(Group::Look, NONE, Key::K, Action::Shade(5), "Matcap"),
    bind(Group::Look, NONE, Key::E, Action::Shade(6), "Error heat map"),
    bind(Group::Look, NONE, Key::B, Action::Borders, "Open borders"),
    bind(Group::Look, NONE, Key::X, Action::Defects, "Defects"),
    bind(Group::Look, SHIFT, Key::X, Action::NextFlaw, "Next border or defect"),
    bind(Group::Look, NONE, Key::G, Action::Ground, "Ground grid"),
    bind(Group::Look, SHIFT, Key::E, Action::NextEnvironment, "Environment: auto, plain, studio"),
    bind(Group::Look, NONE, Key::U, Action::Cull, "Backface culling"),
    bind(Group::Look, NONE, Key::V, Action::NextSides, "Side by side, wipe, single"),
    bind(Group::Look, NONE, Key::L, Action::Link, "Link cameras"),
    bind(Group::Camera, NONE, Key::F, Action::Frame, "Frame model"),
    bind(Group::Camera, NONE, Key::Num0, Action::View(0), "Isometric"),
    bind(Group::Camera, NONE, Key::Num1, Action::View(1), "Front"),
    bind(Group::Camera, SHIFT, Key::Num1, Action::View(2), "Back"),
    bind(Group::Camera, NONE, Key::Num3, Action::View(4), "Right"),
    bind(Group::Camera, SHIFT, Key::Num3, Action::View(3), "Left"),
    bind(Group::Camera, NONE, Key::Num7, Action::View(5), "Top"),
    bind(Group::Camera, SHIFT, Key::Num7, Action::View(6), "Bottom"),
    bind(Group::Camera, Modifiers::ALT, Key::ArrowLeft, Action::TurnModel(-1, 0), "Rotate model left"),
    bind(Group::Camera, Modifiers::ALT, Key::ArrowRight, Action::TurnModel(1, 0), "Rotate model right"),
    bind(Group::Camera, Modifiers::ALT, Key::ArrowUp, Action::TurnModel(0, 1), "Rotate model up"),
    bind(Group::Camera, Modifiers::ALT, Key::ArrowDown, Action::TurnModel(0, -1), "Rotate model down"),
    bind(Group::Camera, Modifiers::ALT, Key::Num0, Action::ResetRotation, "Reset rotation"),
    bind(Group::Camera, NONE, Key::ArrowLeft, Action::Orbit(-1, 0), "Orbit left"),
    bind(Group::Camera, NONE, Key::ArrowRight, Action::Orbit(1, 0), "Orbit right"),
    bind(Group::Camera, NONE, Key::ArrowUp, Action::Orbit(0, 1), "Orbit up"),
    bind(Group::Camera, NONE, Key::ArrowDown, Action::Orbit(0, -1), "Orbit down"),
    bind(Group::Camera, CTRL_SHIFT, Key::Num1, Action::SaveCamera(0), "Save camera 1"),
    bind(Group::Camera, CTRL_SHIFT, Key::Num2, Action::SaveCamera(1), "Save camera 2"),
    bind(Group::Camera, CTRL_SHIFT, Key::Num3, Action::SaveCamera(2), "Save camera 3"),
    bind(Group::Camera, CTRL_SHIFT, Key::Num4, Action::SaveCamera(3), "Save camera 4"),
    bind(Group::Camera, CTRL, Key::Num1, Action::RestoreCamera(0), "Restore camera 1"),
    bind(Group::Camera, CTRL, Key::Num2, Action::RestoreCamera(1), "Restore camera 2"),
    bind(Group::Camera, CTRL, Key::Num3, Action::RestoreCamera(2), "Restore camera 3"),
    bind(Group::Camera, CTRL, Key::Num4, Action::RestoreCamera(3), "Restore camera 4"),
    bind(Group::Stage, NONE, Key::Y, Action::Stage, "Show or exit stage"),
    bind(Group::Stage, NONE, Key::I, Action::Walk, "Walk mode"),
    copies(SHIFT, Key::A, CopiesAction::Place, "Place or select copies"),
    copies(SHIFT, Key::S, CopiesAction::Scatter, "Reshuffle copies"),
    copies(SHIFT, Key::D, CopiesAction::Duplicate, "Duplicate selected copies"),
    copies(SHIFT, Key::C, CopiesAction::Colors, "Colour by level"),
    copies(CTRL, Key::A, CopiesAction::All, "Select all copies"),
    copies(NONE, Key::Delete, CopiesAction::Delete, "Delete selected copies"),
    copies(SHIFT, Key::ArrowLeft, CopiesAction::Turn(1), "Rotate copies left"),
    copies(SHIFT, Key::ArrowRight, CopiesAction::Turn(-1), "Rotate copies right"),
    copies(SHIFT, Key::ArrowDown, CopiesAction::Scale(-1), "Scale copies down"),
    copies(SHIFT, Key::ArrowUp, CopiesAction::Scale(1), "Scale copies up"),
    bind(Group::Window, NONE, Key::Tab, Action::Panels, "Show or hide all panels"),
    bind(Group::Window, NONE, Key::F2, Action::Panel(Panel::Files), "Files"),
    bind(Group::Window, NONE, Key::F3, Action::Panel(Panel::Method), "Method"),
    bind(Group::Window, NONE, Key::F4, Action::Panel(Panel::Report), "Report"),
    bind(Group::Window, SHIFT, Key::F4, Action::Panel(Panel::Bake), "Bake"),
    bind(Group::Window, NONE, Key::F5, Action::Panel(Panel::Info), "Info"),
    bind(Group::Window, NONE, Key::F6, Action::Panel(Panel::Look), "Look"),
    bind(Group::Window, NONE, Key::F7, Action::Panel(Panel::Error), "Error"),
    bind(Group::Window, NONE, Key::F8, Action::Panel(Panel::Log), "Log"),
    bind(Group::Window, NONE, Key::F11, Action::Panel(Panel::Stage), "Stage"),
    bind(Group::Window, NONE, Key::F9, Action::Panel(Panel::Timeline), "Timeline"),
    bind(Group::Window, NONE, Key::F10, Action::Panel(Panel::Benchmark), "Benchmarks"),
    bind(Group::Window, CTRL, Key::T, Action::Theme, "Dark or light theme"),
    bind(Group::Window, NONE, Key::F12, Action::Screenshot, "Screenshot"),
    bind(Group::Window, NONE, Key::H, Action::Help, "Keys and mouse"),
];

/// Gestures for the cheat sheet; views and the app handle them directly.
pub const GESTURES: &[(Group, &str, &str)] = &[
    (Group::Detail, "Hold M", "Keep simplifying"),
    (Group::Detail, "Ctrl or Alt + drag", "More or less detail"),
    (Group::Animation, "Drag a keyframe", "Move in time; Alt copies"),
    (Group::Look, "Hold Space", "Hold to flip A/B"),
    (Group::Look, "Ctrl+Shift + drag", "Move the light"),
    (Group::Camera, "Drag", "Orbit"),
    (Group::Camera, "Shift + drag, middle", "Pan"),
    (Group::Camera, "Scroll, pinch", "Zoom to pointer"),
    (Group::Camera, "Double click", "Centre on that point"),
    (Group::Stage, "Click, Shift + click", "Select copy, add to selection"),
    (Group::Stage, "Drag a copy", "Move selected copies"),
    (Group::Stage, "Ctrl or Alt + drag", "Rotate; up/down scales"),
    (Group::Stage, "W A S D, arrows", "Walk (walk mode)"),
    (Group::Stage, "Q, E", "Move down, up (walk mode)"),
    (Group::Stage, "Esc", "Exit walk mode"),
];

impl Action {
    /// Returns the key binding of the action.
    pub fn binding(self) -> Option<&'static Binding> {
        BINDINGS.iter().find(|b| b.action == self)
    }

    /// Returns a tooltip: a text with the key of the action.
    pub fn tip(self, text: &str) -> String {
        format!("{text} ({})", self.key())
    }
    /// Returns the key of the action for display; empty without one.
    pub fn key(self) -> String {
        self.binding().map(|b| text(&b.shortcut)).unwrap_or_default()
    }
}

/// Formats a shortcut for display.
pub fn text(shortcut: &KeyboardShortcut) -> String {
    let mut text = String::new();
    let m = shortcut.modifiers;
    let command = if cfg!(target_os = "macos") { "Cmd" } else { "Ctrl" };
    for (is, word) in [(m.command, command), (m.alt, "Alt"), (m.shift, "Shift")] {
        if is {
            text += word;
            text.push('+');
        }
    }
    text += match shortcut.logical_key {
        Key::Minus => "-",
        Key::Plus => "+",
        Key::Escape => "Esc",
        Key::ArrowLeft => "Left",
        Key::ArrowRight => "Right",
        Key::ArrowUp => "Up",
        Key::ArrowDown => "Down",
        key => key.name(),
    };
    text
}

/// Keys with digits that have bindings.
const DIGITS: [Key; 6] = [Key::Num0, Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num7];

/// Returns the actions whose keys were pressed, and consumes these keys. The modifiers are those at the time of
/// each press: a frame may be so long that they are released within it.
pub fn pressed(input: &mut InputState) -> Vec<Action> {
    let mut actions = Vec::new();
    input.events.retain(|event| {
        let Event::Key { key, physical_key, pressed: true, modifiers, .. } = event else { return true };
        // With Shift, digits are other characters on most keyboards.
        let digit = physical_key.filter(|key| DIGITS.contains(key));
        let action = action_of(digit.unwrap_or(*key), *modifiers);
        actions.extend(action);
        action.is_none()
    });
    actions
}

/// Returns the action of a key.
fn action_of(key: Key, modifiers: Modifiers) -> Option<Action> {
    let is = |wanted: Modifiers| modifiers.matches_exact(wanted);
    let own = BINDINGS.iter().find(|b| b.shortcut.logical_key == key && is(b.shortcut.modifiers));
    own.map(|b| b.action).or(match key {
        // Some layouts need Shift for `+`; `=` is `+` without Shift on most keyboards.
        Key::Plus if is(SHIFT) => Some(Action::More),
        Key::Equals if is(NONE) => Some(Action::More),
        // Some keyboards have no Delete key.
        Key::Backspace if is(NONE) => Some(Action::Copies(CopiesAction::Delete)),
        Key::Z if is(CTRL_SHIFT) => Some(Action::Redo),
        _ => None,
    })
}

/// Returns the playback after an action; `None` for actions that do not change it.
pub fn playback_after(playback: Playback, model: &Model, length: f64, action: Action) -> Option<Playback> {
    Some(match action {
        Action::GoToStart => playback.at(length, 0.0),
        Action::StepTime(by) => playback.at(length, playback.moment(length) + f64::from(by) * FRAME_SECS),
        Action::Speed(by) => playback.at_speed(playback.speed * 2f64.powi(i32::from(by))),
        Action::Repeat => Playback { repeats: !playback.repeats, ..playback },
        Action::NextClip => playback.next_clip(model),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_has_one_action_and_every_action_one_name() {
        for (i, a) in BINDINGS.iter().enumerate() {
            for b in &BINDINGS[i + 1..] {
                assert_ne!(a.shortcut, b.shortcut, "{} and {}", a.name, b.name);
                assert_ne!(a.action, b.action, "{}", a.name);
            }
        }
    }

    #[test]
    fn modifiers_count_as_they_were_when_the_key_was_pressed() {
        assert_eq!(action_of(Key::X, NONE), Some(Action::Defects));
        assert_eq!(action_of(Key::X, SHIFT), Some(Action::NextFlaw));
        assert_eq!(action_of(Key::X, CTRL), None);
        assert_eq!(action_of(Key::Num1, SHIFT), Some(Action::View(2)));
        assert_eq!(action_of(Key::Num1, CTRL_SHIFT), Some(Action::SaveCamera(0)));
        assert_eq!(action_of(Key::Plus, SHIFT), Some(Action::More));
    }

    #[test]
    fn every_panel_has_a_key() {
        for panel in Panel::ALL {
            assert!(Action::Panel(panel).binding().is_some(), "{panel:?}");
        }
    }
}
