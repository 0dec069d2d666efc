//! Actions of keys and buttons on keyframes.

use eframe::egui;

use super::App;
use crate::command::Command;
use crate::panel::Panel;
use crate::panel::keys::CopiesAction;
use crate::stage::StageChange;
use crate::stage::motion::{CameraPlacement, Curve, KeyframeId, Motion, Mover, Tracks, rounded_secs};
use crate::stage::status::KeyframeSelection;

impl App {
    /// Carries out an action if it is one of keyframes; returns true if so.
    pub(super) fn act_on_keyframes(&mut self, ctx: &egui::Context, action: CopiesAction) -> bool {
        let motion = self.document.settings().stage.motion.clone();
        let secs = self.document.moment();
        let chosen = self.pictures.stage.keyframes.chosen.clone();
        match action {
            CopiesAction::Keyframe => {
                let selected = self.pictures.stage.selected(&self.document);
                if selected.is_empty() {
                    self.document.log.note("select copies first to set a keyframe for them");
                    return true;
                }
                let names: Vec<KeyframeId> =
                    selected.iter().map(|s| (Mover::Copy(s.0), rounded_secs(secs))).collect();
                let with = motion.with(|m| {
                    selected.iter().for_each(|(n, p)| m.copies.entry(*n).or_default().set(secs, *p));
                });
                self.set_keyframes(with, names);
            }
            CopiesAction::CameraKeyframe => {
                let placement = CameraPlacement::of_orbit(&self.pictures.stage.orbit());
                let with = motion.with(|m| m.camera.set(secs, placement));
                self.set_keyframes(with, vec![(Mover::Camera, rounded_secs(secs))]);
            }
            CopiesAction::ToKeyframe(by) => {
                if let Some(to) = motion.next_moment(secs, by > 0) {
                    self.document.play(false);
                    let playback = self.document.settings().playback;
                    let length = self.document.timeline_secs();
                    self.document.run(Command::Playback(playback.at(length, to)));
                }
            }
            CopiesAction::Curve => {
                let movers = self.affected_movers(&motion, &chosen);
                let is_smooth = movers.iter().all(|m| motion.curve(*m) == Curve::Smooth);
                let curve = if is_smooth { Curve::Step } else { Curve::Smooth };
                let change = |m: &mut Tracks| movers.iter().for_each(|mover| m.set_curve(*mover, curve));
                self.set_keyframes(motion.with(change), chosen);
            }
            CopiesAction::FreeCamera => {
                let with = motion.with(|m| m.has_free_camera = !m.has_free_camera);
                self.set_keyframes(with, chosen);
            }
            CopiesAction::Delete if !chosen.is_empty() => {
                self.set_keyframes(motion.with(|m| m.remove(&chosen)), Vec::new());
            }
            CopiesAction::Duplicate if !chosen.is_empty() => {
                let first = chosen.iter().map(|n| n.1).fold(f64::INFINITY, f64::min);
                let mut new = Vec::new();
                let with = motion.with(|m| new = m.shift(&chosen, secs - first, true));
                self.set_keyframes(with, new);
            }
            _ => return false,
        }
        ctx.request_repaint();
        true
    }

    fn set_keyframes(&mut self, motion: Motion, chosen: Vec<KeyframeId>) {
        self.shown.insert(Panel::Timeline);
        self.has_own_timeline = false;
        self.change_stage(StageChange::Motion(motion));
        self.pictures.stage.keyframes = KeyframeSelection { chosen, drag: None };
    }

    /// Returns what a change of the curve applies to: the tracks of the chosen keyframes, else of the chosen
    /// copies, else all tracks.
    fn affected_movers(&self, motion: &Motion, chosen: &[KeyframeId]) -> Vec<Mover> {
        let mut movers: Vec<Mover> = chosen.iter().map(|n| n.0).collect();
        movers.dedup();
        if movers.is_empty() {
            let selected = self.pictures.stage.selected(&self.document);
            let copies = selected.into_iter().map(|s| s.0).filter(|n| motion.copies.contains_key(n));
            movers = copies.map(Mover::Copy).collect();
        }
        if movers.is_empty() {
            movers =
                std::iter::once(Mover::Camera).chain(motion.copies.keys().map(|n| Mover::Copy(*n))).collect();
        }
        movers
    }
}
