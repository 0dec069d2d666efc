//! Commands that change a document. They are data: a list of them replays a session.

use std::path::PathBuf;

use lodsmith::{Length, Stop};
use serde::{Deserialize, Serialize};

use crate::settings::bake::BakeSettings;
use crate::settings::playback::Playback;
use crate::settings::simplification::Simplification;
use crate::settings::up_axis::UpAxis;
use crate::settings::{Appearance, AutoLod, Layout, Pose, Settings, Turn};
use crate::stage::motion::Motion;
use crate::stage::{Copies, StageChange};

/// One change of a document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Command {
    /// Opens these files beside those that are open, shows the first of them, and resets the target. If no file is
    /// open, cameras and stage are reset too.
    Open(Vec<PathBuf>),
    /// Shows another of the open files.
    Show(usize),
    /// Closes one of the open files.
    CloseFile(usize),
    /// Closes all files.
    Close,
    /// Sets the target.
    Target(SimplifyTarget),
    /// Sets the method and its options; keeps the target.
    Method(Box<Simplification>),
    /// Sets the maps that are baked.
    Bake(BakeSettings),
    /// Sets the appearance of surfaces.
    Look(Appearance),
    /// Sets the layout of the two sides.
    Layout(Layout),
    /// Sets the axis of the model that points up.
    Up(UpAxis),
    /// Sets the rotation of the model.
    Turn(Turn),
    /// Saves a camera in a slot, or clears the slot.
    KeepCamera(usize, Option<Pose>),
    /// Sets the selection of levels by distance.
    AutoLod(AutoLod),
    /// Changes the stage: copies of the model on a ground, and how they are shown.
    Stage(StageChange),
    /// Sets animation, time and speed.
    Playback(Playback),
    /// Replaces all settings by those of an opened session.
    Session(Box<Settings>),
}

/// The target of a run, as the slider under the pictures sets it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum SimplifyTarget {
    /// The original, unsimplified.
    Original,
    /// Number of triangles.
    Faces(usize),
    /// Number of vertices.
    Vertices(usize),
    /// Fraction of the triangles.
    Ratio(f64),
    /// Deviation, as a fraction of the diagonal.
    Error(f64),
    /// Deviation, in units of the file.
    Distance(f64),
}

impl SimplifyTarget {
    /// Returns the stop of the engine.
    pub fn stop(self) -> Stop {
        match self {
            Self::Original => Stop::default(),
            Self::Faces(n) => Stop::faces(n),
            Self::Vertices(n) => Stop::vertices(n),
            Self::Ratio(r) => Stop::ratio(r),
            Self::Error(share) => Stop::error(Length::OfDiagonal(share)),
            Self::Distance(distance) => Stop::error(Length::Units(distance)),
        }
    }
}

impl Command {
    /// Returns its name, for the menu.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Open(_) => "open",
            Self::Show(_) => "switch file",
            Self::CloseFile(_) => "close file",
            Self::Close => "close",
            Self::Target(_) => "simplification target",
            Self::Method(_) => "method",
            Self::Bake(_) => "bake settings",
            Self::Look(_) => "look",
            Self::Layout(_) => "layout",
            Self::Up(_) => "up axis",
            Self::Turn(_) => "rotation",
            Self::KeepCamera(..) => "save camera",
            Self::AutoLod(_) => "auto LOD",
            Self::Stage(change) => change.name(),
            Self::Playback(_) => PLAYBACK_NAME,
            Self::Session(_) => "session",
        }
    }

    /// Changes the settings.
    pub fn apply(&self, settings: &mut Settings) {
        match self {
            Self::Open(files) => {
                if settings.files.is_empty() {
                    settings.cameras = [None; 4];
                    // Positions of copies are in units of their model.
                    StageChange::Replace(Copies::default(), Motion::default()).apply(&mut settings.stage);
                    settings.stage.is_on = false;
                }
                for file in files {
                    if !settings.files.contains(file) {
                        settings.files.push(file.clone());
                    }
                }
                let first = settings.files.iter().position(|file| Some(file) == files.first());
                settings.turn = Turn::default();
                Self::Show(first.unwrap_or(settings.shown)).apply(settings);
            }
            Self::Show(which) => {
                settings.shown = (*which).min(settings.files.len().saturating_sub(1));
                settings.up = UpAxis::default();
                settings.simplify.options.stop = Stop::default();
                settings.playback = settings.playback.reset();
            }
            Self::CloseFile(which) => {
                if *which < settings.files.len() {
                    settings.files.remove(*which);
                }
                // The next file takes the place of a closed one, else the previous file.
                if *which == settings.shown {
                    Self::Show(*which).apply(settings);
                } else if *which < settings.shown {
                    settings.shown -= 1;
                }
            }
            Self::Close => {
                settings.files.clear();
                settings.shown = 0;
                settings.simplify.options.stop = Stop::default();
                settings.playback = settings.playback.reset();
            }
            Self::Target(target) => settings.simplify.options.stop = target.stop(),
            Self::Method(how) => {
                let stop = settings.simplify.options.stop;
                settings.simplify = Simplification::clone(how);
                settings.simplify.options.stop = stop;
            }
            Self::Bake(bake) => settings.bake = bake.clone(),
            Self::Look(look) => settings.look = look.clone(),
            Self::Layout(layout) => settings.layout = *layout,
            Self::Up(up) => settings.up = *up,
            Self::Turn(turn) => settings.turn = *turn,
            Self::KeepCamera(slot, pose) => {
                if let Some(kept) = settings.cameras.get_mut(*slot) {
                    *kept = *pose;
                }
            }
            Self::AutoLod(auto) => settings.auto_lod = *auto,
            Self::Stage(change) => change.apply(&mut settings.stage),
            Self::Playback(playback) => settings.playback = *playback,
            Self::Session(all) => settings.clone_from(all),
        }
    }
}

/// Name of playback commands in the history.
const PLAYBACK_NAME: &str = "animation";

/// Undo history.
#[derive(Debug, Default)]
pub struct History {
    undone: Vec<UndoStep>,
    done: Vec<UndoStep>,
    /// True while further commands of the same name join the last step, as while a slider is held.
    is_open: bool,
}

#[derive(Debug)]
struct UndoStep {
    name: &'static str,
    settings: Settings,
}

/// Number of undo steps that are kept. Guessed; each holds a few hundred bytes.
const MAX_UNDO_STEPS: usize = 500;

impl History {
    /// Runs a command. Commands of one kind are one step until [`History::seal`].
    pub fn run(&mut self, command: &Command, settings: &mut Settings) {
        let before = settings.clone();
        command.apply(settings);
        if *settings == before {
            return;
        }
        self.undone.clear();
        let goes_on = self.is_open && self.done.last().is_some_and(|s| s.name == command.name());
        if !goes_on {
            self.done.push(UndoStep { name: command.name(), settings: before });
            if self.done.len() > MAX_UNDO_STEPS {
                self.done.remove(0);
            }
        }
        self.is_open = true;
    }

    /// Makes the next command a step of its own.
    pub fn seal(&mut self) {
        self.is_open = false;
    }

    /// Undoes a step; returns false if there is none.
    pub fn undo(&mut self, settings: &mut Settings) -> bool {
        Self::swap(&mut self.done, &mut self.undone, settings)
    }

    /// Redoes a step; returns false if there is none.
    pub fn redo(&mut self, settings: &mut Settings) -> bool {
        Self::swap(&mut self.undone, &mut self.done, settings)
    }

    fn swap(from: &mut Vec<UndoStep>, to: &mut Vec<UndoStep>, settings: &mut Settings) -> bool {
        let Some(mut step) = from.pop() else { return false };
        // The time is kept: only playback steps change it.
        let was = &mut step.settings;
        if step.name != PLAYBACK_NAME && was.file() == settings.file() {
            was.playback.seconds = settings.playback.seconds;
        }
        let now = std::mem::replace(settings, step.settings);
        to.push(UndoStep { name: step.name, settings: now });
        true
    }

    /// Returns the names of the next undo step and the next redo step.
    pub fn names(&self) -> (Option<&'static str>, Option<&'static str>) {
        (self.done.last().map(|s| s.name), self.undone.last().map(|s| s.name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drag_is_one_step() {
        let (mut settings, mut history) = (Settings::default(), History::default());
        for n in [900, 800, 700] {
            history.run(&Command::Target(SimplifyTarget::Faces(n)), &mut settings);
        }
        history.seal();
        history.run(&Command::Target(SimplifyTarget::Faces(100)), &mut settings);
        assert!(history.undo(&mut settings));
        assert_eq!(settings.simplify.options.stop.faces, Some(700));
        assert!(history.undo(&mut settings));
        assert_eq!(settings, Settings::default());
        assert!(!history.undo(&mut settings));
        assert!(history.redo(&mut settings) && history.redo(&mut settings));
        assert_eq!(settings.simplify.options.stop.faces, Some(100));
    }

    #[test]
    fn playback_continues_when_another_step_is_undone() {
        let (mut settings, mut history) = (Settings::default(), History::default());
        let at = |seconds| Playback { seconds, ..Playback::default() };
        history.run(&Command::Playback(at(1.0)), &mut settings);
        history.run(&Command::Target(SimplifyTarget::Faces(900)), &mut settings);
        settings.playback.seconds = 1.5;
        assert!(history.undo(&mut settings));
        assert_eq!((settings.playback, settings.simplify.options.stop.faces), (at(1.5), None));
        assert!(history.undo(&mut settings));
        assert_eq!(settings.playback, at(0.0));
        assert!(history.redo(&mut settings) && history.redo(&mut settings));
        assert_eq!((settings.playback, settings.simplify.options.stop.faces), (at(1.5), Some(900)));
    }

    #[test]
    fn files_are_opened_beside_others_and_closed_one_by_one() {
        let mut settings = Settings::default();
        let files = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let pose = Pose { eye: [3.0; 3], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov_y_rad: 0.6 };
        let mut run = |command: Command, names: &[&str], shown: usize| {
            command.apply(&mut settings);
            assert_eq!((&settings.files, settings.shown), (&files(names), shown), "{command:?}");
            settings.cameras[0].is_some()
        };
        run(Command::Open(files(&["a", "b"])), &["a", "b"], 0);
        run(Command::KeepCamera(0, Some(pose)), &["a", "b"], 0);
        assert!(run(Command::Open(files(&["c", "b"])), &["a", "b", "c"], 2));
        run(Command::Open(files(&["b"])), &["a", "b", "c"], 1);
        run(Command::CloseFile(0), &["b", "c"], 0);
        run(Command::CloseFile(0), &["c"], 0);
        run(Command::CloseFile(7), &["c"], 0);
        run(Command::CloseFile(0), &[], 0);
        assert!(!run(Command::Open(files(&["d"])), &["d"], 0), "cameras are those of other files");
    }

    #[test]
    fn a_command_without_effect_is_no_undo_step() {
        let (mut settings, mut history) = (Settings::default(), History::default());
        history.run(&Command::Target(SimplifyTarget::Original), &mut settings);
        history.run(&Command::KeepCamera(9, None), &mut settings);
        assert_eq!(history.names(), (None, None));
    }
}
