//! Subject of a picture: a model prepared for drawing.

use std::mem::take;
use std::sync::{Arc, OnceLock};

use glam::{DMat4, DVec3};
use lodsmith_core::mesh::normals::vertex_normals;
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::model::{Deformed, Pose, VertexColors};
use lodsmith_core::{Bounds, Model, TriMesh, WedgeId};

use rayon::prelude::*;

use crate::camera::{Camera, Lens};
use crate::surfaces::MaterialSet;
use crate::view::RenderError;

/// A model prepared for drawing from any side. Data that only some looks need is computed on demand.
#[derive(Debug)]
pub struct Subject {
    /// The meshes of the model, then deformed ones.
    pub(crate) meshes: Vec<PreparedMesh>,
    pub(crate) parts: Vec<PlacedMesh>,
    pub(crate) surfaces: MaterialSet,
    pub(crate) vertex_colors: VertexColors,
    bounds: OnceLock<Option<Bounds>>,
}

/// A mesh and data derived from it.
#[derive(Debug)]
pub(crate) struct PreparedMesh {
    pub(crate) mesh: Arc<TriMesh>,
    pub(crate) materials: Vec<Option<usize>>,
    /// Index of the model's mesh that this is a deformed version of.
    deformed_from: Option<usize>,
    shape_normals: OnceLock<Vec<[f32; 3]>>,
    /// Heat-map values, one for each vertex.
    pub(crate) values: Option<Vec<f32>>,
}

/// A mesh as placed by a node.
#[derive(Clone, Debug)]
pub(crate) struct PlacedMesh {
    pub(crate) mesh: usize,
    pub(crate) world_from_mesh: DMat4,
    /// Number of its first face among all faces of the picture.
    pub(crate) first_face: u32,
}

impl PreparedMesh {
    /// Normals computed from the shape, one for each vertex.
    pub(crate) fn shape_normals(&self) -> &[[f32; 3]] {
        self.shape_normals.get_or_init(|| {
            let surface = self.mesh.surface();
            let joined = weld(surface.positions());
            vertex_normals(&surface, |v| joined.of(v))
        })
    }
}

impl Subject {
    /// Prepares a model at rest.
    ///
    /// # Errors
    /// [`RenderError::TooManyFaces`].
    pub fn new(model: &Model) -> Result<Self, RenderError> {
        Self::posed(model, &Pose::default())
    }

    /// Prepares a model in a pose.
    ///
    /// # Errors
    /// [`RenderError::TooManyFaces`].
    pub fn posed(model: &Model, pose: &Pose) -> Result<Self, RenderError> {
        let drawn = |of: usize, mesh: Arc<TriMesh>, deformed_from: Option<usize>| PreparedMesh {
            mesh,
            materials: model.meshes[of].materials.clone(),
            deformed_from,
            shape_normals: OnceLock::new(),
            values: None,
        };
        let at_rest = model.meshes.iter().enumerate();
        let mut meshes: Vec<PreparedMesh> = at_rest.map(|(i, m)| drawn(i, m.mesh.clone(), None)).collect();
        let mut parts = Vec::new();
        let mut faces = 0usize;
        let (world_from_nodes, mut deformed) = (model.world_from_nodes(pose), Deformed::default());
        for instance in model.instances(pose) {
            let (mut mesh, mut world_from_mesh) = (instance.mesh, instance.world_from_mesh);
            if model.deform(&instance, pose, &world_from_nodes, &mut deformed) {
                let made = deformed_mesh(&meshes[mesh].mesh, &mut deformed);
                meshes.push(drawn(mesh, Arc::new(made), Some(mesh)));
                (mesh, world_from_mesh) = (meshes.len() - 1, deformed.world_from_mesh);
            }
            parts.push(PlacedMesh { mesh, world_from_mesh, first_face: faces as u32 });
            faces = faces.saturating_add(meshes[mesh].mesh.face_count());
            // The largest numbers mark "none" and clipped faces.
            if faces >= 1 << 31 {
                return Err(RenderError::TooManyFaces { faces });
            }
        }
        let surfaces = MaterialSet::new(&model.materials, &model.images);
        Ok(Self { meshes, parts, surfaces, vertex_colors: model.vertex_colors, bounds: OnceLock::new() })
    }

    /// Prepares a single mesh, with a plain surface.
    ///
    /// # Errors
    /// [`RenderError::TooManyFaces`].
    pub fn of_mesh(mesh: impl Into<Arc<TriMesh>>) -> Result<Self, RenderError> {
        Self::new(&Model::of_mesh(mesh))
    }

    /// Adds values for [`Shading::Heat`](crate::Shading::Heat): one for each vertex of each mesh of the
    /// model.
    ///
    /// # Errors
    /// [`RenderError::Values`] if the number of values differs.
    pub fn with_values(mut self, values: Vec<Vec<f32>>) -> Result<Self, RenderError> {
        let mut values = values.into_iter();
        for i in 0..self.meshes.len() {
            let (before, from_here) = self.meshes.split_at_mut(i);
            let drawn = &mut from_here[0];
            let vertices = drawn.mesh.vertex_count();
            let own = match drawn.deformed_from {
                None => values.next().unwrap_or_default(),
                Some(from) => transferred_values(&before[from], &drawn.mesh),
            };
            if own.len() != vertices {
                return Err(RenderError::Values { mesh: i, vertices, values: own.len() });
            }
            drawn.values = Some(own);
        }
        Ok(self)
    }

    /// Number of faces to be drawn.
    pub fn face_count(&self) -> usize {
        self.parts.iter().map(|p| self.meshes[p.mesh].mesh.face_count()).sum()
    }

    /// Returns the bounding box of everything placed; `None` if there is nothing.
    ///
    /// For a rotated mesh it is the box of its rotated box: a little too large. Cost: O(n) the first time.
    pub fn bounds(&self) -> Option<Bounds> {
        *self.bounds.get_or_init(|| self.measured_bounds())
    }

    fn measured_bounds(&self) -> Option<Bounds> {
        let mut whole: Option<[DVec3; 2]> = None;
        for part in &self.parts {
            let Some(b) = used_bounds(&self.meshes[part.mesh].mesh) else { continue };
            for corner in 0..8 {
                let pick = |k: usize| if corner >> k & 1 == 0 { b.min[k] } else { b.max[k] };
                let p = part.world_from_mesh.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
                if p.is_finite() {
                    whole = Some(whole.map_or([p, p], |[min, max]| [min.min(p), max.max(p)]));
                }
            }
        }
        whole.map(|[min, max]| Bounds { min: min.to_array(), max: max.to_array() })
    }

    /// Returns a camera with the same direction and lens, moved so that the subject fills a picture of
    /// `aspect` (width over height) except for a margin on each side, a fraction of the picture. Unchanged if
    /// there is nothing to see.
    ///
    /// Cost: O(n).
    pub fn framed(&self, camera: Camera, aspect: f64, margin: f64) -> Camera {
        let Some(bounds) = self.bounds() else { return camera };
        let camera = camera.framing(&bounds, aspect);
        let room = 1.0 - 2.0 * margin.clamp(0.0, 0.45);
        let unit = camera.distance();
        let [right, up, back] = camera.axes();
        // Distance by which each side of the picture must move outwards: along the screen, and with the depth
        // for a perspective.
        let height = match camera.lens {
            Lens::Perspective { fov_y_rad } => (0.5 * fov_y_rad).tan(),
            Lens::Parallel { height } => 0.5 * height / unit,
        };
        let slopes = match camera.lens {
            Lens::Perspective { .. } => [height * aspect * room, height * room],
            Lens::Parallel { .. } => [0.0; 2],
        };
        let none = [f64::NEG_INFINITY; 5];
        let outer = |a: [f64; 5], b: [f64; 5]| [0, 1, 2, 3, 4].map(|k| a[k].max(b[k]));
        let mut sides = none;
        for part in &self.parts {
            let mesh = &self.meshes[part.mesh].mesh;
            let positions = mesh.positions().view();
            let reach = |all: &[[WedgeId; 3]]| {
                all.iter().flatten().fold(none, |sides, &w| {
                    let p =
                        part.world_from_mesh.transform_point3(DVec3::from(positions.get(mesh.vertex_of(w))));
                    // The target is subtracted first, and everything divided, to avoid overflow.
                    let p = (p - camera.target) / unit;
                    if !p.is_finite() {
                        return sides;
                    }
                    let (x, y, z) = (p.dot(right), p.dot(up), p.dot(back));
                    let [sx, sy] = [slopes[0] * z, slopes[1] * z];
                    outer(sides, [x + sx, -x + sx, y + sy, -y + sy, z])
                })
            };
            sides = outer(sides, mesh.triangles().par_chunks(1 << 14).map(reach).reduce(|| none, outer));
        }
        if !sides.iter().all(|s| s.is_finite()) {
            return camera;
        }
        let [right_side, left, upper, lower, nearest] = sides;
        let (across, along) = (0.5 * (right_side - left), 0.5 * (upper - lower));
        let aside = (right * across + up * along) * unit;
        match camera.lens {
            Lens::Perspective { .. } => {
                let away = [(right_side + left) / slopes[0], (upper + lower) / slopes[1]].map(|d| 0.5 * d);
                // Not closer than the nearest point, however thin the subject is.
                let away = away[0].max(away[1]).max(nearest + 0.05);
                let target = camera.target + aside;
                Camera { eye: target + back * (away * unit), target, ..camera }
            }
            Lens::Parallel { .. } => {
                let wanted = ((right_side + left) / aspect).max(upper + lower) / room * unit;
                let lens = Lens::Parallel { height: if wanted > 0.0 { wanted } else { 2.0 * height * unit } };
                Camera { eye: camera.eye + aside, target: camera.target + aside, lens, ..camera }
            }
        }
    }

    /// Returns the values at the ends of the colour map: those asked for, or the range of the values
    /// including 0.
    pub fn heat_range(&self, asked: Option<[f32; 2]>) -> [f32; 2] {
        if let Some(range) = asked {
            return range;
        }
        let all = self.meshes.iter().flat_map(|m| m.values.iter().flatten());
        let (low, high) =
            all.filter(|v| v.is_finite()).fold((0f32, 0f32), |(low, high), &v| (low.min(v), high.max(v)));
        [low, high]
    }
}

/// Returns a copy of a mesh with deformed positions and normals.
fn deformed_mesh(mesh: &TriMesh, deformed: &mut Deformed) -> TriMesh {
    let mut made = mesh.clone();
    let (places, normals) = (take(&mut deformed.positions), take(&mut deformed.normals));
    made.set_wedge_positions(places).expect("there is a place for each wedge");
    made.set_normals((!normals.is_empty()).then_some(normals)).expect("there is a normal for each wedge");
    made
}

/// Transfers the values of a mesh at rest to the vertices of its deformed version.
fn transferred_values(rest: &PreparedMesh, deformed: &TriMesh) -> Vec<f32> {
    let mut values = rest.values.clone().unwrap_or_default();
    // Deformation may split a vertex: all its copies get its value.
    values.resize(deformed.vertex_count(), 0.0);
    for wedge in (0..deformed.wedge_count()).map(WedgeId::new) {
        values[deformed.vertex_of(wedge).index()] = values[rest.mesh.vertex_of(wedge).index()];
    }
    values
}

/// Returns the bounding box of the vertices that faces use: a stray vertex must not move the camera away.
fn used_bounds(mesh: &TriMesh) -> Option<Bounds> {
    let positions = mesh.positions().view();
    Bounds::of(mesh.triangles().iter().flatten().map(|&w| positions.get(mesh.vertex_of(w))))
}
