//! What a picture is to show, and what of it must be drawn.

use std::time::Duration;

use glam::{DMat4, DVec3};
use lodsmith_core::Bounds;
use lodsmith_core::model::Pose;
use lodsmith_render::{Background, Camera, Lighting, Look};

use super::environment::Surroundings;
use super::model::DrawModel;
use super::renderer::Matcap;
use super::surface_shader::SurfaceShader;
use super::uniforms::{TINTS, View, ball};

/// Everything that a picture shows.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// What is to be seen.
    pub models: &'a [Placed<'a>],
    /// What lights and the ground are measured by, in world coordinates: the same for pictures to be compared.
    pub bounds: Bounds,
    /// From where.
    pub camera: Camera,
    /// How surfaces are shown.
    pub look: &'a Look,
    /// What they are lit by; lights beyond the eighth are left out, and counted in [`Drawn::lights_left_out`].
    pub lighting: &'a Lighting,
    /// What lies behind.
    pub background: Background,
    /// Whether a grid lies under the model.
    pub ground: bool,
    /// The lit ball of [`Shading::Matcap`](lodsmith_render::Shading::Matcap); `None` takes one of clay.
    pub matcap: Option<&'a Matcap>,
    /// What materials mirror; `None` is the plain light from above and below.
    pub environment: Option<&'a Surroundings>,
    /// Colours surfaces instead of the look's shading.
    pub shader: Option<&'a SurfaceShader>,
}

impl<'a> Frame<'a> {
    /// Models from there, on the usual background; no ground, no surroundings, and no looks of the user's.
    pub fn new(
        models: &'a [Placed<'a>],
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
            shader: None,
        }
    }
}

/// A model somewhere.
#[derive(Clone, Copy)]
pub struct Placed<'a> {
    /// The model.
    pub model: &'a DrawModel,
    /// How it stands.
    pub pose: &'a Pose,
    /// From the coordinates of the model to those of the world.
    pub world_from_model: DMat4,
    /// Whether it is marked as chosen.
    pub selected: bool,
    /// A number of [`TINTS`](super::TINTS), counted from 1, whose colour stands in for that of its surface; 0 for none.
    pub tint: u8,
}

impl<'a> Placed<'a> {
    /// A model where its file puts it.
    pub fn new(model: &'a DrawModel, pose: &'a Pose) -> Self {
        Self { model, pose, world_from_model: DMat4::IDENTITY, selected: false, tint: 0 }
    }
}

/// What drawing a frame came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Drawn {
    /// Whether anything was drawn; the target may have shown this very frame already.
    pub drawn: bool,
    /// Triangles sent, as often as they are placed, with those of the parts before.
    pub triangles: u64,
    /// Triangles of the frame that are still to be drawn, by [`Gpu::draw_in_parts`](super::Gpu::draw_in_parts).
    pub triangles_left: u64,
    /// Draw calls.
    pub calls: u32,
    /// Meshes placed outside the picture, which were left out.
    pub culled: u32,
    /// Lights beyond what shaders have room for.
    pub lights_left_out: u32,
    /// Time until all was ready to be handed to the adapter, which may then let one wait.
    pub own: Duration,
}

impl Drawn {
    /// How much of a picture is there that comes in parts; `None` for a whole one.
    pub fn share(&self) -> Option<f64> {
        let all = self.triangles + self.triangles_left;
        (self.triangles_left > 0).then(|| self.triangles as f64 / all as f64)
    }
}

/// What a target shows, kept to be compared.
pub(super) struct Shown {
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
    shader: Option<u64>,
}

impl Shown {
    pub(super) fn new(frame: &Frame<'_>, size: [u32; 2]) -> Self {
        let model = |p: &Placed<'_>| {
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
            environment: frame.environment.map(Surroundings::id),
            shader: frame.shader.map(SurfaceShader::id),
        }
    }

    pub(super) fn has(&self, model: u64) -> bool {
        self.models.iter().any(|(id, ..)| *id == model)
    }

    pub(super) fn is(&self, frame: &Frame<'_>, size: [u32; 2]) -> bool {
        let same = |(id, revision, pose, matrix, selected, tint): &(u64, u64, Pose, DMat4, bool, u8),
                    p: &Placed<'_>| {
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
            && self.environment == frame.environment.map(Surroundings::id)
            && self.shader == frame.shader.map(SurfaceShader::id)
            && self.models.len() == frame.models.len()
            && self.models.iter().zip(frame.models).all(|(was, is)| same(was, is))
    }
}

/// A placed mesh, in the order of `vertex.wgsl`.
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
/// Where in the flags the number of the tint begins.
const TINT_SHIFT: u32 = 24;
/// Morph targets that pull at once at one place; what a shader counts in the lower half of its flags.
const MORPHS_MAX: usize = 0xffff;

/// Copies of one mesh that are drawn together.
pub(super) struct Batch<'a> {
    pub(super) model: &'a DrawModel,
    pub(super) mesh: usize,
    /// Places in [`Gathered::instances`].
    pub(super) instances: std::ops::Range<u32>,
}

/// What of a frame must be drawn.
pub(super) struct Gathered<'a> {
    pub(super) batches: Vec<Batch<'a>>,
    pub(super) instances: Vec<GpuInstance>,
    pub(super) palette: Vec<[f32; 4]>,
    pub(super) culled: u32,
}

/// Walks a frame: which meshes are in the picture, where, and pulled by what.
///
/// Cost: O(placed meshes · log), and the joints of those that have any.
pub(super) fn gather<'a>(frame: &Frame<'a>, view: &View) -> Gathered<'a> {
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
            let morphs: Vec<(usize, f32)> = morphs.map(|(k, w)| (k, *w)).take(MORPHS_MAX).collect();
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
    // Copies of one mesh come together; within them, and where pictures overlap, the order stays.
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
    Gathered { batches, instances, palette, culled }
}

/// Triangles of all that is placed, in sight or not.
pub(super) fn triangles(frame: &Frame<'_>) -> u64 {
    let of = |p: &Placed<'_>| -> u64 {
        p.model.instances(p.pose).iter().map(|i| p.model.face_count(i.mesh) as u64).sum()
    };
    frame.models.iter().map(of).sum()
}

/// Values at the ends of the colours of heat: those of the look, or from none to the greatest of all models.
pub(super) fn heat_range(frame: &Frame<'_>) -> [f32; 2] {
    frame.look.heat_range.unwrap_or_else(|| {
        let of = |p: &Placed<'_>| p.model.meshes.iter().filter_map(|m| m.heat_max).fold(0.0, f32::max);
        [0.0, frame.models.iter().map(of).fold(0.0, f32::max)]
    })
}

/// How far from the eye anything lies that is to be seen.
pub(super) fn reach(frame: &Frame<'_>) -> f64 {
    let mut reach = frame.camera.distance();
    let mut hold = |centre: DVec3, radius: f64| {
        let distance = frame.camera.eye.distance(centre) + radius;
        reach = if distance.is_finite() { reach.max(distance) } else { reach };
    };
    let (centre, radius) = ball(&frame.bounds);
    hold(centre, radius);
    for placed in frame.models {
        for instance in placed.model.instances(placed.pose).iter() {
            let mesh = &placed.model.meshes[instance.mesh];
            let m = placed.world_from_model * instance.world_from_mesh * mesh.user_from_unit;
            hold(m.w_axis.truncate(), m.x_axis.truncate().length() * mesh.radius);
        }
    }
    // Joints may carry a mesh beyond its ball at rest; guessed.
    4.0 * reach
}

fn rows(m: &DMat4) -> [[f32; 4]; 3] {
    let t = m.transpose();
    [t.x_axis, t.y_axis, t.z_axis].map(|row| row.as_vec4().to_array())
}

/// The inverse transposed but for a positive factor, so that nothing is divided by: cross products of columns.
fn normal_matrix(m: &DMat4) -> DMat4 {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|a| a.truncate());
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    let scale = x.length().max(y.length()).max(z.length());
    let scale = if scale > 0.0 { sign / (scale * scale) } else { sign };
    let column = |v: DVec3| (v * scale).extend(0.0);
    DMat4::from_cols(column(y.cross(z)), column(z.cross(x)), column(x.cross(y)), glam::DVec4::W)
}
