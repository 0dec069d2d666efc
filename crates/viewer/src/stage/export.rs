//! Export of the stage as one glTF file: a node per copy, shared meshes and materials, levels as `MSFT_lod`.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context as _, bail};
use glam::{DQuat, DVec3};
use lodsmith::Screen;
use lodsmith_asset::coverage;
use lodsmith_io::gltf::{CopyPlace, MovingNode, Scene, SceneCamera, SceneLevels, SceneMotion};
use lodsmith_io::{Format, ModelFile, ModelSource, ReadOptions, WriteOptions};
use serde::{Deserialize, Serialize};

use super::motion::{ChannelNodes, KeyframeValue, Motion};
use super::{Copies, ModelBase, Placement};
use crate::content::export::{Written, embed, own_meshes};
use crate::content::{Lighter, Original, level_ratios};
use crate::job::JobControl;
use crate::numbers::grouped;
use crate::settings::simplification::Simplification;

/// A stage and its output file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StageExport {
    /// The output file: glTF if its extension is `gltf`, else GLB.
    pub path: PathBuf,
    /// The copies.
    pub copies: Copies,
    /// Motion of the copies and the camera.
    pub motion: Motion,
    /// Orientation and size of the model.
    pub base: ModelBase,
    /// Viewing conditions for the switching of levels.
    pub viewing: ViewingConditions,
}

/// Viewing conditions for which levels switch; they determine the screen coverage written for each level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewingConditions {
    /// Pixels that an error may cover in a picture 1080 pixels high.
    pub pixels: f64,
    /// Vertical field of view of the picture.
    pub fov_y_rad: f64,
}

/// A copy at the origin, neither rotated nor scaled.
const IDENTITY_PLACEMENT: Placement = Placement { x: 0.0, z: 0.0, turn_deg: 0.0, scale: 1.0 };
/// Near plane of the exported camera, as a fraction of the model's size. (Guessed.)
const CAMERA_NEAR_FACTOR: f64 = 0.001;
/// Maximum number of nodes in a file: more would be hundreds of megabytes of text.
const MAX_NODES: usize = 1_000_000;

impl StageExport {
    /// Writes the file. `levels` are the levels of the original, if already built.
    ///
    /// # Errors
    /// Input and output errors and errors of the engine; an existing file is then left unchanged.
    pub fn write(
        &self,
        original: &Original,
        levels: &[Arc<Lighter>],
        how: &Simplification,
        watch: &mut JobControl,
    ) -> anyhow::Result<Written> {
        if self.copies.is_empty() {
            bail!("{}: there is no copy on the stage", self.path.display());
        }
        let mut warnings = Vec::new();
        let as_scene;
        let (original, mut made) = match &original.file.source {
            ModelSource::Scene(_) => (original, levels.to_vec()),
            _ => {
                as_scene = self.as_scene(original, &mut warnings)?;
                // The writer changes the vertices of a mesh, so existing levels do not fit: they are built
                // anew.
                (&as_scene, Vec::new())
            }
        };
        let ModelSource::Scene(scene) = &original.file.source else {
            bail!("{}: cannot be converted to a scene", original.path.display())
        };
        if scene.has_levels() {
            bail!(
                "{}: already has levels of detail (MSFT_lod): open a file without them",
                original.path.display()
            );
        }
        let ratios = level_ratios(original.faces);
        if made.is_empty() && !ratios.is_empty() {
            made = Lighter::chain(original, how, &ratios, watch)?.into_iter().map(Arc::new).collect();
        }
        let nodes = (original.model().nodes.len() + 1) * (made.len() + 1) * self.copies.len();
        if nodes > MAX_NODES {
            let (all, most) = (grouped(nodes), grouped(MAX_NODES));
            bail!(
                "the stage would have {all} nodes, more than {most}: place fewer copies, or merge the parts \
                 of the model"
            );
        }
        let mut scene = Scene::clone(scene);
        warnings.extend(embed(&mut scene).iter().map(ToString::to_string));
        let levels = self.levels(original, &scene, &made);
        let moves = |k: &usize| self.motion.copies.contains_key(k);
        // A moving copy is placed at the origin of a node that moves.
        let of = |(k, c): (usize, &Placement)| {
            copy_place(&self.base, k, if moves(&k) { &IDENTITY_PLACEMENT } else { c })
        };
        let places: Vec<_> = self.copies.iter().enumerate().map(of).collect();
        let staged = scene.with_copies(&places).context("the model cannot be copied")?;
        let staged = staged.with_motion(&self.motion_nodes()).context("the copies cannot be animated")?;
        let mut options = WriteOptions::default();
        let is_text = self.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf"));
        options.format = Some(if is_text { Format::Gltf } else { Format::Glb });
        let lost =
            lodsmith_io::write_levels_path(&staged, &levels, &self.path, &options, &|_| None)?.warnings;
        warnings.extend(lost.iter().map(ToString::to_string));
        let mut summary = format!("{} copies, {} levels", grouped(self.copies.len()), made.len() + 1);
        match (self.motion.copies.len(), self.motion.camera.is_empty()) {
            (0, true) => {}
            (0, false) => summary += ", animated camera",
            (n, true) => summary += &format!(", {} animated", grouped(n)),
            (n, false) => summary += &format!(", {} and the camera animated", grouped(n)),
        }
        Ok(Written { summary, warnings })
    }

    /// Returns nodes for everything with keyframes, and the animation that moves them.
    fn motion_nodes(&self) -> SceneMotion {
        let mut motion = SceneMotion { name: "stage".to_owned(), ..SceneMotion::default() };
        for (n, track) in &self.motion.copies {
            let Some(first) = track.values().next() else { continue };
            let node = motion.nodes.len();
            motion.nodes.push(MovingNode {
                name: format!("copy_{}_moves", n + 1),
                child_root: Some(*n),
                translation: [first.x, 0.0, first.z],
                rotation: DQuat::from_rotation_y(first.turn_deg.to_radians()).to_array(),
                scale: first.scale,
                ..MovingNode::default()
            });
            motion.channels.extend(ChannelNodes { node, tilted: None, is_scaled: true }.channels_of(track));
        }
        if let Some(first) = self.motion.camera.values().next() {
            let [yaw, pitch] = first.components().turns_deg.map(f64::to_radians);
            let node = motion.nodes.len();
            motion.nodes.push(MovingNode {
                name: "camera_moves".to_owned(),
                translation: [first.x, first.y, first.z],
                rotation: DQuat::from_rotation_y(yaw).to_array(),
                ..MovingNode::default()
            });
            motion.nodes.push(MovingNode {
                name: "camera".to_owned(),
                parent: Some(node),
                rotation: DQuat::from_rotation_x(pitch).to_array(),
                camera: Some(SceneCamera {
                    fov_y_rad: self.viewing.fov_y_rad,
                    near: CAMERA_NEAR_FACTOR * self.base.length(),
                }),
                ..MovingNode::default()
            });
            let channels = ChannelNodes { node, tilted: Some(node + 1), is_scaled: false };
            motion.channels.extend(channels.channels_of(&self.motion.camera));
        }
        motion
    }

    /// Converts a mesh to a scene.
    fn as_scene(&self, original: &Original, warnings: &mut Vec<String>) -> anyhow::Result<Original> {
        let mut options = WriteOptions::default();
        if let ModelSource::Mesh(loaded) = &original.file.source {
            options.regions = Some(Arc::new(loaded.regions.clone()));
        }
        let (scene, lost) =
            Scene::of_mesh(&original.model().meshes[0].mesh, &options, ReadOptions::default().limits)?;
        warnings.extend(lost.iter().map(ToString::to_string));
        Ok(Original::of_file(original.path.clone(), ModelFile::from(scene), 0.0))
    }

    fn levels(&self, original: &Original, scene: &Scene, made: &[Arc<Lighter>]) -> SceneLevels {
        let count = scene.meshes().len();
        let lighter = made.iter().map(|level| own_meshes(original, level));
        let mut levels = SceneLevels::new(std::iter::once(vec![None; count]).chain(lighter).collect());
        let ViewingConditions { pixels, fov_y_rad } = self.viewing;
        let screen =
            Screen::new(fov_y_rad.to_degrees(), Screen::default().height_px, pixels).unwrap_or_default();
        let distances: Vec<f64> = made.iter().map(|level| screen.distance(level.error())).collect();
        levels.coverage = coverage(scene, &distances, &screen);
        levels
    }
}

/// Returns the transform of the model's scene that places it like this copy.
fn copy_place(base: &ModelBase, number: usize, copy: &Placement) -> CopyPlace {
    let turn = DQuat::from_rotation_y(copy.turn_deg.to_radians());
    let own = base.stage_from_model.transform_point3(DVec3::ZERO);
    let at = DVec3::new(copy.x, 0.0, copy.z) + turn * (own * copy.scale);
    CopyPlace {
        name: format!("copy_{}", number + 1),
        translation: at.to_array(),
        rotation: (turn * base.turn).normalize().to_array(),
        scale: copy.scale,
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat4;
    use lodsmith_core::Bounds;

    use super::*;

    #[test]
    fn a_copy_is_written_at_its_position() {
        let bounds = Bounds { min: [1.0, 2.0, 3.0], max: [4.0, 4.0, 5.0] };
        let base = ModelBase::new(&bounds, DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.0, -0.7));
        let copy = Placement { turn_deg: 130.0, scale: 2.5, ..Placement::at(-3.0, 8.0) };
        let CopyPlace { translation, rotation, scale, .. } = copy_place(&base, 0, &copy);
        let written = DMat4::from_scale_rotation_translation(
            DVec3::splat(scale),
            DQuat::from_array(rotation),
            translation.into(),
        );
        for p in [DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 2.0, 5.0)] {
            let (a, b) = (written.transform_point3(p), base.stage_from(&copy).transform_point3(p));
            assert!(a.distance(b) < 1e-9, "{a} {b}");
        }
    }
}
