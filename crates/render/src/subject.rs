//! Subject of a picture: a model prepared for drawing.

use std::mem::take;
use std::sync::{Arc, OnceLock};

use glam::{DMat4, DVec3};
use lodsmith_core::mesh::creases::{Creases, corner_normals};
use lodsmith_core::mesh::normals::vertex_normals;
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::model::{Deformed, Pose, VertexColors};
use lodsmith_core::{Bounds, Model, TriMesh, WedgeId};

use rayon::prelude::*;

use crate::camera::Camera;
use crate::framing::Framing;
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
    creases: Creases,
    crease_deg: OnceLock<Option<f64>>,
}

/// A mesh and data derived from it.
#[derive(Debug)]
pub(crate) struct PreparedMesh {
    pub(crate) mesh: Arc<TriMesh>,
    pub(crate) materials: Vec<Option<usize>>,
    /// Index of the model's mesh that this is a deformed version of.
    deformed_from: Option<usize>,
    shape_normals: OnceLock<ShapeNormals>,
    /// Heat-map values, one for each vertex.
    pub(crate) values: Option<Vec<f32>>,
}

/// Normals computed from the shape of a mesh.
#[derive(Debug)]
pub(crate) enum ShapeNormals {
    OfVertices(Vec<[f32; 3]>),
    /// Normals at the corners of each face.
    OfCorners(Vec<[[f32; 3]; 3]>),
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
    /// Normals computed from the shape, smooth or discontinuous at creases.
    pub(crate) fn shape_normals(&self, crease_deg: Option<f64>) -> &ShapeNormals {
        self.shape_normals.get_or_init(|| {
            let surface = self.mesh.surface();
            let joined = weld(surface.positions());
            match crease_deg {
                None => ShapeNormals::OfVertices(vertex_normals(&surface, |v| joined.of(v))),
                Some(angle) => ShapeNormals::OfCorners(corner_normals(&surface, |v| joined.of(v), angle)),
            }
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
        Ok(Self {
            meshes,
            parts,
            surfaces,
            vertex_colors: model.vertex_colors,
            bounds: OnceLock::new(),
            creases: Creases::Auto,
            crease_deg: OnceLock::new(),
        })
    }

    /// Prepares a single mesh, with a plain surface.
    ///
    /// # Errors
    /// [`RenderError::TooManyFaces`].
    pub fn of_mesh(mesh: impl Into<Arc<TriMesh>>) -> Result<Self, RenderError> {
        Self::new(&Model::of_mesh(mesh))
    }

    /// Sets which edges are sharp in computed normals (for meshes without normals). The default is [`Creases::Auto`].
    /// For pictures that are compared, see [`Subject::creases`].
    pub fn with_creases(mut self, creases: Creases) -> Self {
        self.creases = creases;
        self.crease_deg = OnceLock::new();
        self.meshes.iter_mut().for_each(|mesh| mesh.shape_normals = OnceLock::new());
        self
    }

    /// Returns the resolved setting (never [`Creases::Auto`]): for shading another subject in the same way.
    ///
    /// Cost: O(n) the first time, for [`Creases::Auto`].
    pub fn creases(&self) -> Creases {
        self.crease_deg().map_or(Creases::Off, Creases::Above)
    }

    /// Returns the angle in degrees above which edges are sharp, determined from the meshes at rest.
    pub(crate) fn crease_deg(&self) -> Option<f64> {
        let at_rest = || self.meshes.iter().filter(|m| m.deformed_from.is_none()).map(|m| &*m.mesh);
        *self.crease_deg.get_or_init(|| self.creases.angle_deg(at_rest()))
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

    /// Builds the textures that [`Shading::Textured`](crate::Shading::Textured) reads, before the parallel work.
    pub(crate) fn prepare_textures(&self) {
        let materials = self.parts.iter().flat_map(|part| &self.meshes[part.mesh].materials);
        self.surfaces.prepare(materials.flatten().copied());
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

    /// Returns the bounding box of the corners of all faces, where they are drawn; `None` without faces.
    /// [`Self::bounds`] may be larger: it is computed from the boxes of the meshes, which may be rotated.
    ///
    /// Cost: O(n).
    pub fn exact_bounds(&self) -> Option<Bounds> {
        let mut bounds: Option<Bounds> = None;
        self.for_each_corner(|p| {
            if p.is_finite() {
                let p = p.to_array();
                bounds = Some(bounds.unwrap_or(Bounds { min: p, max: p }).with(p));
            }
        });
        bounds
    }

    /// Calls a function with each corner of each face, where it is placed.
    pub(crate) fn for_each_corner(&self, mut of: impl FnMut(DVec3)) {
        for part in &self.parts {
            let mesh = &self.meshes[part.mesh].mesh;
            let positions = mesh.positions().view();
            for &w in mesh.triangles().iter().flatten() {
                of(part.world_from_mesh.transform_point3(DVec3::from(positions.get(mesh.vertex_of(w)))));
            }
        }
    }

    /// Returns a camera with the same direction and lens, moved so that the subject fills a picture of
    /// `aspect` (width over height) except for a margin on each side, a fraction of the picture. Unchanged if
    /// there is nothing to see.
    ///
    /// Cost: O(n).
    pub fn framed(&self, camera: Camera, aspect: f64, margin: f64) -> Camera {
        let Some(bounds) = self.bounds() else { return camera };
        let start = Framing::new(camera, &bounds, aspect, margin);
        let mut all = start;
        for part in &self.parts {
            let mesh = &self.meshes[part.mesh].mesh;
            let positions = mesh.positions().view();
            let place = |w: WedgeId| {
                part.world_from_mesh.transform_point3(DVec3::from(positions.get(mesh.vertex_of(w))))
            };
            let reach = |some: &[[WedgeId; 3]]| {
                some.iter().flatten().fold(start, |framing, &w| framing.with(place(w)))
            };
            all =
                all.merged(mesh.triangles().par_chunks(1 << 14).map(reach).reduce(|| start, Framing::merged));
        }
        all.camera()
    }

    /// Returns the values at the ends of the colour map: the requested ones, or the range of the values
    /// including 0.
    pub fn heat_range(&self, requested: Option<[f32; 2]>) -> [f32; 2] {
        if let Some(range) = requested {
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
    // Deformation may split a vertex: all copies get its value.
    values.resize(deformed.vertex_count(), 0.0);
    for wedge in (0..deformed.wedge_count()).map(WedgeId::new) {
        values[deformed.vertex_of(wedge).index()] = values[rest.mesh.vertex_of(wedge).index()];
    }
    values
}

/// Returns the bounding box of the vertices that faces use: an unused vertex must not move the camera away.
fn used_bounds(mesh: &TriMesh) -> Option<Bounds> {
    let positions = mesh.positions().view();
    Bounds::of(mesh.triangles().iter().flatten().map(|&w| positions.get(mesh.vertex_of(w))))
}
