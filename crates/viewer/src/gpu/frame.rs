//! Frame description, and the collection of what has to be drawn.

use std::time::Duration;

use glam::{DMat4, DVec3};
use lodsmith_core::Bounds;
use lodsmith_core::model::Pose;
use lodsmith_render::{Background, Camera, Lighting, Look};

use super::environment::EnvironmentMap;
use super::matcap::Matcap;
use super::model::DrawModel;
use super::surface_shader::SurfaceShader;
use super::uniforms::{TINTS, ViewTransform, bounding_sphere};

/// Complete description of a picture.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// Models to draw.
    pub models: &'a [PlacedModel<'a>],
    /// Bounds in world coordinates that lights and the ground scale with: use the same for pictures to be
    /// compared.
    pub bounds: Bounds,
    /// The camera.
    pub camera: Camera,
    /// Appearance of surfaces.
    pub look: &'a Look,
    /// Lighting; lights beyond the eighth are left out, and counted in [`DrawStats::lights_left_out`].
    pub lighting: &'a Lighting,
    /// Background.
    pub background: Background,
    /// True to draw a ground grid.
    pub ground: bool,
    /// Image for [`Shading::Matcap`](lodsmith_render::Shading::Matcap); `None` uses a clay matcap.
    pub matcap: Option<&'a Matcap>,
    /// Environment map for reflections; `None` uses plain ambient light from above and below.
    pub environment: Option<&'a EnvironmentMap>,
    /// True to draw borders and defects in double width, and faintly where something hides them.
    pub marks_stand_out: bool,
    /// User's shader that replaces the shading of `look`.
    pub shader: Option<&'a SurfaceShader>,
}

impl<'a> Frame<'a> {
    /// Creates a frame with the default background and without ground, environment, matcap or custom shader.
    pub fn new(
        models: &'a [PlacedModel<'a>],
        bounds: Bounds,
        camera: Camera,
        look: &'a Look,
        lighting: &'a Lighting,
    ) -> Self {
        Self {
            models,
            bounds,
            camera,
            look,
            lighting,
            background: Background::default(),
            ground: false,
            matcap: None,
            environment: None,
            marks_stand_out: false,
            shader: None,
        }
    }
}

/// A placed model.
#[derive(Clone, Copy)]
pub struct PlacedModel<'a> {
    /// The model.
    pub model: &'a DrawModel,
    /// Its pose.
    pub pose: &'a Pose,
    /// Transform from model to world coordinates.
    pub world_from_model: DMat4,
    /// True if it is highlighted as selected.
    pub selected: bool,
    /// Index into [`TINTS`](super::TINTS), counted from 1, of the colour that replaces its surface colour; 0
    /// for none.
    pub tint: u8,
}

impl<'a> PlacedModel<'a> {
    /// Creates a placement at the position given by the file.
    pub fn new(model: &'a DrawModel, pose: &'a Pose) -> Self {
        Self { model, pose, world_from_model: DMat4::IDENTITY, selected: false, tint: 0 }
    }
}

/// Statistics of drawing a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct DrawStats {
    /// True if anything was drawn; false if the target already showed this same frame.
    pub drawn: bool,
    /// Triangles drawn, counting every instance, including those of earlier parts.
    pub triangles: u64,
    /// Triangles of the frame still to be drawn by [`Gpu::draw_in_parts`](super::Gpu::draw_in_parts).
    pub triangles_left: u64,
    /// Draw calls.
    pub calls: u32,
    /// Mesh instances outside the view, which were skipped.
    pub culled: u32,
    /// Lights beyond the maximum number.
    pub lights_left_out: u32,
    /// CPU time until submission, which may then block.
    pub cpu_time: Duration,
}

impl DrawStats {
    /// Returns the completed fraction of a picture drawn in parts; `None` for a complete one.
    pub fn completed_fraction(&self) -> Option<f64> {
        let all = self.triangles + self.triangles_left;
        (self.triangles_left > 0).then(|| self.triangles as f64 / all as f64)
    }
}

/// Owned copy of the frame that a target shows, for comparison.
pub(super) struct FrameSnapshot {
    size: [u32; 2],
    models: Vec<(u64, u64, Pose, DMat4, bool, u8)>,
    bounds: Bounds,
    camera: Camera,
    look: Look,
    lighting: Lighting,
    background: Background,
    ground: bool,
    matcap: Option<u64>,
    environment: Option<u64>,
    marks_stand_out: bool,
    shader: Option<u64>,
}

impl FrameSnapshot {
    pub(super) fn new(frame: &Frame<'_>, size: [u32; 2]) -> Self {
        let model = |p: &PlacedModel<'_>| {
            let (id, revision) = p.model.version();
            (id, revision, p.pose.clone(), p.world_from_model, p.selected, p.tint)
        };
        Self {
            size,
            models: frame.models.iter().map(model).collect(),
            bounds: frame.bounds,
            camera: frame.camera,
            look: frame.look.clone(),
            lighting: frame.lighting.clone(),
            background: frame.background,
            ground: frame.ground,
            matcap: frame.matcap.map(Matcap::id),
            environment: frame.environment.map(EnvironmentMap::id),
            marks_stand_out: frame.marks_stand_out,
            shader: frame.shader.map(SurfaceShader::id),
        }
    }

    pub(super) fn has(&self, model: u64) -> bool {
        self.models.iter().any(|(id, ..)| *id == model)
    }

    pub(super) fn is(&self, frame: &Frame<'_>, size: [u32; 2]) -> bool {
        let same = |(id, revision, pose, matrix, selected, tint): &(u64, u64, Pose, DMat4, bool, u8),
                    p: &PlacedModel<'_>| {
            (*id, *revision) == p.model.version()
                && pose == p.pose
                && *matrix == p.world_from_model
                && *selected == p.selected
                && *tint == p.tint
        };
        self.size == size
            && self.camera == frame.camera
            && self.bounds == frame.bounds
            && self.look == *frame.look
            && self.lighting == *frame.lighting
            && self.background == frame.background
            && self.ground == frame.ground
            && self.matcap == frame.matcap.map(Matcap::id)
            && self.environment == frame.environment.map(EnvironmentMap::id)
            && self.marks_stand_out == frame.marks_stand_out
            && self.shader == frame.shader.map(SurfaceShader::id)
            && self.models.len() == frame.models.len()
            && self.models.iter().zip(frame.models).all(|(was, is)| same(was, is))
    }
}

/// A mesh instance, in the order of `vertex.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct GpuInstance {
    rows: [[f32; 4]; 3],
    normal_rows: [[f32; 4]; 3],
    ids: [u32; 4],
}

const SKINNED: u32 = 0x10000;
const MIRRORED: u32 = 0x20000;
const SELECTED: u32 = 0x40000;
const HAS_HEAT: u32 = 0x80000;
const HAS_COLORS: u32 = 0x10_0000;
const LINEAR_COLORS: u32 = 0x20_0000;
const OWN_NORMALS: u32 = 0x40_0000;
/// Lowest bit of the tint index in the flags.
const TINT_SHIFT: u32 = 24;
/// Maximum number of active morph targets of an instance; their count is stored in the lower half of the
/// flags.
const MAX_ACTIVE_MORPHS: usize = 0xffff;

/// Instances of one mesh, drawn together.
pub(super) struct Batch<'a> {
    pub(super) model: &'a DrawModel,
    pub(super) mesh: usize,
    /// Range in [`DrawList::instances`].
    pub(super) instances: std::ops::Range<u32>,
}

/// Visible content of a frame.
pub(super) struct DrawList<'a> {
    pub(super) batches: Vec<Batch<'a>>,
    pub(super) instances: Vec<GpuInstance>,
    pub(super) palette: Vec<[f32; 4]>,
    pub(super) culled: u32,
}

/// Collects the visible mesh instances of a frame, with their matrices, joints and morph weights.
///
/// Cost: O(n log n) for n mesh instances, plus their joints.
pub(super) fn build_draw_list<'a>(frame: &Frame<'a>, view: &ViewTransform) -> DrawList<'a> {
    let mut found: Vec<((u64, usize), &'a DrawModel, GpuInstance)> = Vec::new();
    let mut palette = Vec::new();
    let mut culled = 0;
    for (number, placed) in frame.models.iter().enumerate() {
        let model = placed.model;
        let view_from_model = view.view_from_world * placed.world_from_model;
        let mut nodes: Option<Vec<DMat4>> = None;
        for instance in model.instances(placed.pose).iter() {
            let mesh = &model.meshes[instance.mesh];
            let weights = model.morph_weights(placed.pose, instance);
            let morphs =
                weights.iter().enumerate().take(mesh.morph_targets as usize).filter(|(_, w)| **w != 0.0);
            let morphs: Vec<(usize, f32)> = morphs.map(|(k, w)| (k, *w)).take(MAX_ACTIVE_MORPHS).collect();
            let skin = model.skin(instance);
            let matrix = view_from_model * instance.world_from_mesh * mesh.user_from_unit;
            let mirrored = matrix.determinant() < 0.0;
            if skin.is_none() && morphs.is_empty() {
                let largest = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|a| a.truncate().length());
                let largest = largest.into_iter().fold(0.0, f64::max);
                if !view.sees(matrix.w_axis.truncate(), mesh.radius * largest) {
                    culled += 1;
                    continue;
                }
            }
            let mut flags = morphs.len() as u32;
            flags |= if placed.selected { SELECTED } else { 0 };
            flags |= u32::from(placed.tint.min(TINTS.len() as u8)) << TINT_SHIFT;
            flags |= if mesh.heat_max.is_some() { HAS_HEAT } else { 0 };
            flags |= if mesh.has_colors { HAS_COLORS } else { 0 };
            flags |= if model.has_linear_colors { LINEAR_COLORS } else { 0 };
            flags |= if mesh.has_own_normals { OWN_NORMALS } else { 0 };
            let first_joint = palette.len() as u32;
            if let Some(skin) = skin {
                flags |= SKINNED;
                let nodes = nodes.get_or_insert_with(|| model.world_from_nodes(placed.pose));
                for (joint, joint_from_mesh) in skin.joints.iter().zip(&skin.joint_from_mesh) {
                    let m = view_from_model * nodes[*joint] * *joint_from_mesh * mesh.user_from_unit;
                    palette.extend(rows(&m));
                }
            } else if mirrored {
                flags |= MIRRORED;
            }
            let first_morph = palette.len() as u32;
            palette.extend(morphs.iter().map(|(k, w)| [f32::from_bits(*k as u32), *w, 0.0, 0.0]));
            let gpu = GpuInstance {
                rows: rows(&matrix),
                normal_rows: rows(&normal_matrix(&matrix)),
                ids: [number as u32, first_joint, first_morph, flags],
            };
            found.push(((model.version().0, instance.mesh), model, gpu));
        }
    }
    // Groups the instances of each mesh; the sort is stable.
    found.sort_by_key(|(key, ..)| *key);
    let mut batches: Vec<Batch<'a>> = Vec::new();
    let mut last = None;
    for (k, (key, model, _)) in found.iter().enumerate() {
        if last != Some(*key) {
            batches.push(Batch { model, mesh: key.1, instances: k as u32..k as u32 });
            last = Some(*key);
        }
        if let Some(batch) = batches.last_mut() {
            batch.instances.end = k as u32 + 1;
        }
    }
    let instances = found.into_iter().map(|(_, _, gpu)| gpu).collect();
    DrawList { batches, instances, palette, culled }
}

/// Returns the number of triangles of all instances, visible or not.
pub(super) fn triangle_count(frame: &Frame<'_>) -> u64 {
    let of = |p: &PlacedModel<'_>| -> u64 {
        p.model.instances(p.pose).iter().map(|i| p.model.face_count(i.mesh) as u64).sum()
    };
    frame.models.iter().map(of).sum()
}

/// Returns the value range of the heat colours: that of the look, or from 0 to the maximum of all models.
pub(super) fn heat_range(frame: &Frame<'_>) -> [f32; 2] {
    frame.look.heat_range.unwrap_or_else(|| {
        let of = |p: &PlacedModel<'_>| p.model.meshes.iter().filter_map(|m| m.heat_max).fold(0.0, f32::max);
        [0.0, frame.models.iter().map(of).fold(0.0, f32::max)]
    })
}

/// Returns an upper bound for the distance from the eye to everything in the frame.
pub(super) fn max_distance(frame: &Frame<'_>) -> f64 {
    let mut reach = frame.camera.distance();
    let mut hold = |centre: DVec3, radius: f64| {
        let distance = frame.camera.eye.distance(centre) + radius;
        reach = if distance.is_finite() { reach.max(distance) } else { reach };
    };
    let (centre, radius) = bounding_sphere(&frame.bounds);
    hold(centre, radius);
    for placed in frame.models {
        for instance in placed.model.instances(placed.pose).iter() {
            let mesh = &placed.model.meshes[instance.mesh];
            let m = placed.world_from_model * instance.world_from_mesh * mesh.user_from_unit;
            hold(m.w_axis.truncate(), m.x_axis.truncate().length() * mesh.radius);
        }
    }
    // Joints may move a mesh beyond its bounding sphere at rest. (Guessed.)
    4.0 * reach
}

fn rows(m: &DMat4) -> [[f32; 4]; 3] {
    let t = m.transpose();
    [t.x_axis, t.y_axis, t.z_axis].map(|row| row.as_vec4().to_array())
}

/// Returns the inverse transpose up to a positive factor, without division by the determinant: cross products
/// of columns.
fn normal_matrix(m: &DMat4) -> DMat4 {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|a| a.truncate());
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    let scale = x.length().max(y.length()).max(z.length());
    let scale = if scale > 0.0 { sign / (scale * scale) } else { sign };
    let column = |v: DVec3| (v * scale).extend(0.0);
    DMat4::from_cols(column(y.cross(z)), column(z.cross(x)), column(x.cross(y)), glam::DVec4::W)
}
