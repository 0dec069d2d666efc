//! Meshes without numbers that are NaN or infinite, which no writer gets.

use std::borrow::Cow;

use lodsmith_core::mesh::part::extract_faces;
use lodsmith_core::numbers::counted;
use lodsmith_core::{FaceId, Semantic, TriMesh, VertexId};

use crate::error::Warning;
use crate::format::Format;

/// Counts of what was removed or replaced.
#[derive(Default)]
pub(crate) struct NonFinite {
    vertices: usize,
    faces: usize,
    /// Names of attributes.
    replaced: Vec<&'static str>,
}

impl NonFinite {
    /// Returns a mesh without the vertices whose positions a format would store as NaN or infinity, and without the
    /// faces that use them; for formats that forbid such numbers everywhere also with replacements in attributes. Named
    /// attributes stay: NaN is a missing value there. Cost: O(n), and no copy of a mesh that is finite.
    pub(crate) fn removed_from<'m>(&mut self, mesh: &'m TriMesh, format: Format) -> Cow<'m, TriMesh> {
        let mut finite = Cow::Borrowed(mesh);
        let is_single = is_single(format);
        let holds = |x: f64| x.is_finite() && (!is_single || (x as f32).is_finite());
        let positions = mesh.positions().view();
        let is_bad = |v: VertexId| !positions.get(v).into_iter().all(holds);
        let vertices = (0..positions.len()).map(VertexId::new).filter(|&v| is_bad(v)).count();
        if vertices > 0 {
            let keeps = |f: &FaceId| !mesh.triangles()[f.index()].iter().any(|&w| is_bad(mesh.vertex_of(w)));
            let kept: Vec<FaceId> = (0..mesh.face_count()).map(FaceId::new).filter(keeps).collect();
            self.vertices += vertices;
            self.faces += mesh.face_count() - kept.len();
            finite = Cow::Owned(extract_faces(mesh, &kept).mesh);
        }
        if matches!(format, Format::Gltf | Format::Glb | Format::ThreeMf) {
            for name in replace_in_attributes(&mut finite) {
                if !self.replaced.contains(&name) {
                    self.replaced.push(name);
                }
            }
        }
        finite
    }

    /// Returns the warnings about a file in a format.
    pub(crate) fn warnings(&self, format: Format) -> Vec<Warning> {
        let mut warnings = Vec::new();
        if self.vertices > 0 {
            let vertices =
                counted(self.vertices, "vertex has a position that is", "vertices have positions that are");
            let limit = if is_single(format) { " within single precision" } else { "" };
            let faces = counted(self.faces, "face", "faces");
            warnings.push(Warning::lost(format!("{vertices} not finite{limit}: removed, with {faces}")));
        }
        if !self.replaced.is_empty() {
            let text = format!("{} that are not finite: replaced by zeros", self.replaced.join(", "));
            warnings.push(Warning::lost(text));
        }
        warnings
    }
}

/// Returns true if a format stores single precision only.
fn is_single(format: Format) -> bool {
    matches!(format, Format::Stl | Format::Gltf | Format::Glb | Format::ThreeMf)
}

/// Replaces numbers that are not finite in attributes of the surface; returns the names of these attributes.
fn replace_in_attributes(mesh: &mut Cow<'_, TriMesh>) -> Vec<&'static str> {
    fn bad<const N: usize>(values: Option<&[[f32; N]]>) -> bool {
        values.is_some_and(|all| all.as_flattened().iter().any(|x| !x.is_finite()))
    }
    fn replaced<const N: usize>(values: Option<&[[f32; N]]>) -> Option<Vec<[f32; N]>> {
        values.map(|all| all.iter().map(|value| value.map(|x| if x.is_finite() { x } else { 0.0 })).collect())
    }
    let mut names = Vec::new();
    // The counts of values do not change, so setting them cannot fail.
    if bad(mesh.normals()) {
        let values = replaced(mesh.normals());
        names.extend(mesh.to_mut().set_normals(values).is_ok().then_some("normals"));
    }
    if bad(mesh.uvs()) {
        let values = replaced(mesh.uvs());
        names.extend(mesh.to_mut().set_uvs(values).is_ok().then_some("texture coordinates"));
    }
    if bad(mesh.colors()) {
        let values = replaced(mesh.colors());
        names.extend(mesh.to_mut().set_colors(values).is_ok().then_some("colours"));
    }
    for at in 0..mesh.further_attributes().len() {
        let attribute = &mesh.further_attributes()[at];
        let name = match attribute.semantic {
            Semantic::Custom(_) | Semantic::Discrete { .. } => continue,
            Semantic::Tangent => "tangents",
            Semantic::Uv(_) => "texture coordinates",
            Semantic::Color(_) => "colours",
            _ => "joints and morph targets",
        };
        if attribute.values.iter().all(|x| x.is_finite()) {
            continue;
        }
        for x in mesh.to_mut().further_values_mut(at).iter_mut().filter(|x| !x.is_finite()) {
            *x = 0.0;
        }
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}
