//! All placed meshes of a model as one surface, in model coordinates.

use glam::{DMat3, DMat4, DVec3, Vec3};
use lodsmith_core::geometry::triangle::double_area_normal;
use lodsmith_core::model::{Deformed, Instance, Pose};
use lodsmith_core::{Model, Positions, RegionId, TriMesh, VertexId, WedgeId};

use crate::normals::creased_normals;

/// Marks a face without a material.
pub(crate) const NO_MATERIAL: u32 = u32::MAX;

/// A placed mesh within a [`Flat`].
pub(crate) struct Piece {
    /// Index of the mesh in the model.
    pub(crate) mesh: usize,
    /// Numbers of its first face and its first wedge.
    pub(crate) first_face: usize,
    pub(crate) first_wedge: usize,
    /// Transform of directions on the surface, such as tangents.
    pub(crate) linear: DMat3,
    /// Transform of normals; unit length is lost.
    pub(crate) normal: DMat3,
}

/// A model as one surface.
pub(crate) struct Flat {
    /// Positions in double precision; texture coordinates and colours if any mesh has them. Faces are the faces of the
    /// pieces in their order; if a transform mirrors, their last two corners are exchanged.
    pub(crate) mesh: TriMesh,
    /// Positions of the corners of each face.
    pub(crate) corners: Vec<[DVec3; 3]>,
    /// Normals at the corners of each face, of unit length.
    pub(crate) normals: Vec<[Vec3; 3]>,
    /// The material of each face.
    pub(crate) materials: Vec<u32>,
    pub(crate) pieces: Vec<Piece>,
}

/// The instances and the texture coordinates of a flattened model.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Taken {
    /// The first instance of each mesh. Meshes with skins or morph targets are in mesh coordinates.
    FirstInMeshCoordinates,
    /// The first instance of each mesh, as placed and deformed at rest.
    First,
    /// All instances, as placed and deformed at rest.
    All,
}

impl Flat {
    /// Flattens a model. Cost: O(faces).
    pub(crate) fn new(model: &Model, taken: Taken) -> Self {
        let pose = Pose::default();
        let world = model.world_from_nodes(&pose);
        let mut is_known = vec![false; model.meshes.len()];
        let mut builder = FlatBuilder::new(model);
        for instance in model.instances(&pose) {
            let is_first = !std::mem::replace(&mut is_known[instance.mesh], true);
            if model.meshes[instance.mesh].mesh.face_count() == 0 || !is_first && taken != Taken::All {
                continue;
            }
            let mut deformed = Deformed::default();
            if !model.deform(&instance, &pose, &world, &mut deformed) {
                builder.add(&instance, instance.world_from_mesh, None);
            } else if taken == Taken::FirstInMeshCoordinates {
                builder.add(&instance, DMat4::IDENTITY, None);
            } else {
                builder.add(&instance, deformed.world_from_mesh, Some(&deformed));
            }
        }
        builder.finish()
    }

    /// Corners of a face.
    #[inline]
    pub(crate) fn corners(&self, face: usize) -> [DVec3; 3] {
        self.corners[face]
    }

    /// Returns the mesh and the region of a face, as an index into the materials of that mesh.
    pub(crate) fn piece_of(&self, face: usize) -> &Piece {
        let after = self.pieces.partition_point(|p| p.first_face <= face);
        &self.pieces[after - 1]
    }
}

struct FlatBuilder<'a> {
    model: &'a Model,
    positions: Vec<[f64; 3]>,
    vertex_of: Vec<VertexId>,
    triangles: Vec<[WedgeId; 3]>,
    uvs: Option<Vec<[f32; 2]>>,
    colors: Option<Vec<[f32; 4]>>,
    regions: Vec<RegionId>,
    /// The first region of each mesh in the flat surface.
    first_region: Vec<u32>,
    normals: Vec<[Vec3; 3]>,
    materials: Vec<u32>,
    pieces: Vec<Piece>,
}

impl<'a> FlatBuilder<'a> {
    fn new(model: &'a Model) -> Self {
        let mut count = 0;
        let first_region = model.meshes.iter().map(|m| {
            count += m.materials.len().max(1) as u32;
            count - m.materials.len().max(1) as u32
        });
        Self {
            model,
            positions: Vec::new(),
            vertex_of: Vec::new(),
            triangles: Vec::new(),
            uvs: model.meshes.iter().any(|m| m.mesh.uvs().is_some()).then(Vec::new),
            colors: model.meshes.iter().any(|m| m.mesh.colors().is_some()).then(Vec::new),
            regions: Vec::new(),
            first_region: first_region.collect(),
            normals: Vec::new(),
            materials: Vec::new(),
            pieces: Vec::new(),
        }
    }

    fn add(&mut self, instance: &Instance, world: DMat4, deformed: Option<&Deformed>) {
        let source = &self.model.meshes[instance.mesh];
        let mesh = &*source.mesh;
        let linear = DMat3::from_mat4(world);
        let is_mirrored = linear.determinant() < 0.0;
        // The cofactors are the inverse transpose up to a factor, and exist for flat transforms too.
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
        let sign = if is_mirrored { -1.0 } else { 1.0 };
        let normal = DMat3::from_cols(y.cross(z) * sign, z.cross(x) * sign, x.cross(y) * sign);
        let (first_face, first_wedge) = (self.triangles.len(), self.vertex_of.len());
        self.pieces.push(Piece { mesh: instance.mesh, first_face, first_wedge, linear, normal });

        let first_vertex = self.positions.len();
        let view = mesh.positions().view();
        match deformed {
            // Deformed wedges at one vertex may lie apart.
            Some(deformed) => {
                let place = |p: &[f32; 3]| world.transform_point3(p.map(f64::from).into()).to_array();
                self.positions.extend(deformed.positions.iter().map(place));
                self.vertex_of.extend((0..mesh.wedge_count()).map(|w| VertexId::new(first_vertex + w)));
            }
            None => {
                self.positions.extend(view.iter().map(|p| world.transform_point3(p.into()).to_array()));
                let vertex = |w| VertexId::new(first_vertex + mesh.vertex_of(WedgeId::new(w)).index());
                self.vertex_of.extend((0..mesh.wedge_count()).map(vertex));
            }
        }
        if let Some(all) = &mut self.uvs {
            all.extend(mesh.uvs().unwrap_or_default());
            all.resize(self.vertex_of.len(), [0.0; 2]);
        }
        if let Some(all) = &mut self.colors {
            all.extend(mesh.colors().unwrap_or_default());
            all.resize(self.vertex_of.len(), [1.0; 4]);
        }
        let order = if is_mirrored { [0, 2, 1] } else { [0, 1, 2] };
        let wedge_normals = deformed.map(|d| &*d.normals).filter(|n| !n.is_empty()).or(mesh.normals());
        let own_normals = wedge_normals.is_none().then(|| creased_normals(&mesh.surface()));
        for (f, wedges) in mesh.triangles().iter().enumerate() {
            self.triangles.push(order.map(|k| WedgeId::new(first_wedge + wedges[k].index())));
            let region = mesh.regions().map_or(0, |r| r[f].index());
            let material = source.materials.get(region).copied().flatten();
            self.materials.push(material.map_or(NO_MATERIAL, |m| m as u32));
            self.regions.push(RegionId(self.first_region[instance.mesh] + region as u32));
            let at = |k: usize| match (wedge_normals, &own_normals) {
                (Some(all), _) => Vec3::from(all[wedges[k].index()]),
                (None, Some(own)) => own[f][k],
                (None, None) => Vec3::Z,
            };
            self.normals.push(order.map(|k| (normal * at(k).as_dvec3()).normalize_or_zero().as_vec3()));
        }
        // A normal of length zero is replaced by the face normal.
        for face in first_face..self.triangles.len() {
            if self.normals[face].contains(&Vec3::ZERO) {
                let corners = self.triangles[face].map(|w| self.positions[self.vertex_of[w.index()].index()]);
                let flat = double_area_normal(corners.map(DVec3::from)).normalize_or(DVec3::Z).as_vec3();
                for n in &mut self.normals[face] {
                    *n = if *n == Vec3::ZERO { flat } else { *n };
                }
            }
        }
    }

    fn finish(self) -> Flat {
        let mut mesh = TriMesh::with_wedges(Positions::F64(self.positions), self.vertex_of, self.triangles)
            .expect("indices are those of valid meshes, with an offset");
        mesh.set_uvs(self.uvs).expect("there is one for each wedge");
        mesh.set_colors(self.colors).expect("there is one for each wedge");
        mesh.set_regions(Some(self.regions)).expect("there is one for each face");
        let view = mesh.positions().view();
        let corner = |w: WedgeId| DVec3::from(view.get(mesh.vertex_of(w)));
        let corners = mesh.triangles().iter().map(|&[a, b, c]| [corner(a), corner(b), corner(c)]).collect();
        Flat { mesh, corners, normals: self.normals, materials: self.materials, pieces: self.pieces }
    }
}
