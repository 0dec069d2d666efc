//! A mesh as vertex buffers of a game engine, with weighted attributes: a seam has several vertices at one position.

use anyhow::Result;
use lodsmith_core::{Positions, TriMesh, VertexId, WedgeId};

/// Attribute weights that meshoptimizer's documentation suggests for normals and colours; the weights of texture
/// coordinates depend on their scale.
const NORMAL_WEIGHT: f32 = 0.5;
const COLOR_WEIGHT: f32 = 1.0;

/// Buffers of vertices and indices.
#[derive(Clone, Debug)]
pub struct VertexBuffers {
    /// One for each vertex.
    pub positions: Vec<[f32; 3]>,
    /// Three for each face.
    pub indices: Vec<u32>,
    /// Normal, texture coordinates and colour of each vertex; those that the mesh lacks are absent.
    pub values: Vec<f32>,
    /// The weight of each of these values.
    pub weights: Vec<f32>,
    widths: [usize; 3],
}

impl VertexBuffers {
    /// Returns the buffers of a mesh, with one vertex for each wedge.
    pub fn new(mesh: &TriMesh) -> Self {
        let position =
            |w: usize| mesh.positions().view().get(mesh.vertex_of(WedgeId::new(w))).map(|x| x as f32);
        let positions = (0..mesh.wedge_count()).map(position).collect();
        let widths =
            [mesh.normals().map_or(0, |_| 3), mesh.uvs().map_or(0, |_| 2), mesh.colors().map_or(0, |_| 3)];
        let mut weights = vec![NORMAL_WEIGHT; widths[0]];
        weights.extend(mesh.uvs().map(|uvs| [uv_weight(mesh, uvs); 2]).into_iter().flatten());
        weights.extend(vec![COLOR_WEIGHT; widths[2]]);
        let mut values = Vec::with_capacity(weights.len() * mesh.wedge_count());
        for w in 0..mesh.wedge_count() {
            values.extend(mesh.normals().iter().flat_map(|n| n[w]));
            values.extend(mesh.uvs().iter().flat_map(|t| t[w]));
            values.extend(mesh.colors().iter().flat_map(|c| [c[w][0], c[w][1], c[w][2]]));
        }
        let indices = mesh.triangles().iter().flatten().map(|w| w.0).collect();
        Self { positions, indices, values, weights, widths }
    }

    /// Number of triangles.
    pub fn face_count(&self) -> usize {
        self.indices.len() / 3
    }

    /// Returns the mesh of these buffers, with the same vertices.
    ///
    /// # Errors
    /// If an index is out of range.
    pub fn mesh(&self) -> Result<TriMesh> {
        let triangles = self.indices.as_chunks::<3>().0.iter().map(|t| t.map(VertexId)).collect();
        let mut mesh = TriMesh::new(Positions::F32(self.positions.clone()), triangles)?;
        let width = self.weights.len();
        let column = |from: usize, vertex: usize| &self.values[vertex * width + from..];
        let all = || 0..self.positions.len();
        let [normals, uvs, colors] = self.widths;
        if normals > 0 {
            let normal = |v| {
                let n = [0, 1, 2].map(|k| column(0, v)[k]);
                let length = n.iter().map(|x| x * x).sum::<f32>().sqrt();
                if length > 0.0 { n.map(|x| x / length) } else { n }
            };
            mesh.set_normals(Some(all().map(normal).collect()))?;
        }
        if uvs > 0 {
            mesh.set_uvs(Some(all().map(|v| [0, 1].map(|k| column(normals, v)[k])).collect()))?;
        }
        if colors > 0 {
            let color = |v| {
                let [r, g, b] = [0, 1, 2].map(|k| column(normals + uvs, v)[k]);
                [r, g, b, 1.0]
            };
            mesh.set_colors(Some(all().map(color).collect()))?;
        }
        Ok(mesh)
    }
}

/// Returns the weight of texture coordinates that meshoptimizer's documentation suggests: 1 / sqrt(mean area in texture
/// space), bounded for tiny areas.
fn uv_weight(mesh: &TriMesh, uvs: &[[f32; 2]]) -> f32 {
    let doubled = |t: &[WedgeId; 3]| {
        let [a, b, c] = t.map(|w| uvs[w.index()]);
        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
    };
    let area = mesh.triangles().iter().map(doubled).sum::<f32>() / 2.0 / mesh.face_count() as f32;
    0.01 / area.max(1e-8).sqrt()
}
