//! From the parsed contents of an OBJ file to a mesh.

use lodsmith_core::mesh::MeshError;
use lodsmith_core::numbers::counted;
use lodsmith_core::polygon::Triangulator;
use lodsmith_core::{TriMesh, VertexId};

use super::{Section, Storage};
use crate::attributes::{NO_COLOR, unit_colors, unit_normals};
use crate::error::{ReadError, Warning};
use crate::format::Format;
use crate::loaded::{Contents, Loaded};
use crate::material::{counts, read_libraries};
use crate::obj::wedges::{Indices, NONE, number_wedges};
use crate::options::ReadOptions;

impl Section {
    /// Cuts the polygons into triangles and inserts these between the others.
    fn cut_polygons(&mut self) {
        if self.polygons.is_empty() {
            return;
        }
        let is_used = [0, 1, 2].map(|kind| {
            let in_polygons = || self.polygon_corners.iter().any(|c| c[kind] != NONE);
            kind == 0 || self.storage[kind] != Storage::Absent || in_polygons()
        });
        for kind in (1..3).filter(|&kind| is_used[kind]) {
            self.make_own_buffer(kind);
        }
        let old = std::mem::take(&mut self.triangles);
        let total = old[0].len() + self.polygon_corners.len() - 2 * self.polygons.len();
        for kind in (0..3).filter(|&kind| is_used[kind]) {
            self.triangles[kind].reserve_exact(total);
        }
        let view = self.positions.view();
        let mut triangulator = Triangulator::default();
        let (mut points, mut cut) = (Vec::new(), Vec::new());
        let (mut taken, mut corners) = (0, &self.polygon_corners[..]);
        let mut take = |triangles: &mut [Vec<[u32; 3]>; 3], to: usize| {
            for kind in (0..3).filter(|&kind| is_used[kind]) {
                triangles[kind].extend_from_slice(&old[kind][taken..to]);
            }
            taken = to;
        };
        for polygon in &self.polygons {
            take(&mut self.triangles, polygon.after);
            let (these, rest) = corners.split_at(polygon.size);
            corners = rest;
            points.clear();
            points.extend(these.iter().map(|c| view.get(VertexId(c[0]))));
            triangulator.triangulate(&points, &mut cut);
            for kind in (0..3).filter(|&kind| is_used[kind]) {
                self.triangles[kind].extend(cut.iter().map(|t| t.map(|k| these[k as usize][kind])));
            }
        }
        take(&mut self.triangles, old[0].len());
    }

    /// Makes a mesh of the whole file.
    pub(in crate::obj) fn finish(mut self, options: &ReadOptions) -> Result<Loaded, ReadError> {
        let polygons = self.triangles[0].len() + self.polygons.len();
        self.cut_polygons();
        let [mut triangles, uv_of, normal_of] = std::mem::take(&mut self.triangles);
        // Wedges have 32-bit numbers, which could overflow before the mesh checks its size.
        if triangles.len() >= (u32::MAX / 3) as usize {
            return Err(MeshError::TooLarge { what: "triangles", count: triangles.len() }.into());
        }
        let mut warnings = self.notes.warnings();
        let sizes = self.polygons.iter().map(|p| p.size);
        let (regions, of_faces) = std::mem::take(&mut self.headings).resolve(sizes, triangles.len());
        let vertex_count = self.positions.len();
        unit_normals(&mut self.normals);
        if !self.colors.is_empty() {
            let bare = vertex_count - self.notes.colored;
            self.colors.resize(vertex_count, NO_COLOR);
            if bare > 0 {
                warnings.push(Warning::note(format!(
                    "{} without a colour: made white",
                    counted(bare, "vertex", "vertices")
                )));
            }
            if unit_colors(&mut self.colors) {
                warnings.push(Warning::note("colours range up to 255: divided by 255"));
            }
        }
        let is_same =
            |kind: usize, buffer: &Vec<[u32; 3]>| self.storage[kind] != Storage::Own || *buffer == triangles;
        let (has_uvs, has_normals) = (self.storage[1] != Storage::Absent, self.storage[2] != Storage::Absent);
        let mut vertex_of = None;
        let (uvs, normals);
        if is_same(1, &uv_of) && is_same(2, &normal_of) {
            self.uvs.resize(vertex_count, [0.0; 2]);
            self.normals.resize(vertex_count, [0.0; 3]);
            uvs = has_uvs.then_some(self.uvs);
            normals = has_normals.then_some(self.normals);
        } else {
            for (buffer, what) in [(&uv_of, "texture coordinates"), (&normal_of, "a normal")] {
                let bare = buffer.iter().flatten().filter(|&&i| i == NONE).count();
                if bare > 0 {
                    let corners = counted(bare, "corner", "corners");
                    warnings.push(Warning::note(format!("{corners} without {what}: filled with zeros")));
                }
            }
            let indices = |kind: usize, buffer| match self.storage[kind] {
                Storage::Absent => Indices::Absent,
                Storage::Same => Indices::Same,
                Storage::Own => Indices::Own(buffer),
            };
            let wedges =
                number_wedges(&mut triangles, indices(1, &uv_of), indices(2, &normal_of), vertex_count);
            vertex_of = wedges.vertex_of;
            let of = &wedges.attributes;
            uvs = has_uvs.then(|| of.iter().map(|a| get_or_zero(&self.uvs, a[0])).collect());
            normals = has_normals.then(|| of.iter().map(|a| get_or_zero(&self.normals, a[1])).collect());
        }
        let colors = match &vertex_of {
            _ if self.colors.is_empty() => None,
            None => Some(self.colors),
            Some(map) => Some(map.iter().map(|&v| self.colors[v as usize]).collect()),
        };
        let positions = self.positions;
        let mut mesh = match vertex_of {
            None => TriMesh::new(positions, bytemuck::allocation::cast_vec(triangles))?,
            Some(map) => {
                let map: Vec<VertexId> = bytemuck::allocation::cast_vec(map);
                TriMesh::with_wedges(positions, map, bytemuck::allocation::cast_vec(triangles))?
            }
        };
        mesh.set_uvs(uvs)?;
        mesh.set_normals(normals)?;
        mesh.set_colors(colors)?;
        mesh.set_regions(of_faces)?;
        let present = [("normals", mesh.normals().is_some()), ("uvs", mesh.uvs().is_some())];
        let present = present.into_iter().chain([("colors", mesh.colors().is_some())]);
        let contents = Contents {
            meshes: self.notes.objects.max(1),
            polygons,
            attributes: present.filter(|(_, is)| *is).map(|(name, _)| name.to_owned()).collect(),
            ..Contents::default()
        };
        let mut loaded = Loaded { regions, ..Loaded::new(mesh, Format::Obj, contents, warnings) };
        let libraries = &mut loaded.regions.libraries;
        loaded.warnings.extend(read_libraries(libraries, &options.files(), options.limits));
        (loaded.contents.materials, loaded.contents.textures) = counts(&loaded.regions);
        Ok(loaded)
    }
}

fn get_or_zero<const N: usize>(buffer: &[[f32; N]], index: u32) -> [f32; N] {
    buffer.get(index as usize).copied().unwrap_or([0.0; N])
}
