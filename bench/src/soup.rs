//! A mesh as plain buffers: single-precision positions and three indices per face.

use std::path::Path;

use anyhow::{Context, Result};
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::{MeshError, Positions, PositionsView, Surface, TriMesh, VertexId};
use lodsmith_io::{ReadOptions, read_path};

/// Positions and triangles only.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Soup {
    /// One for each vertex.
    pub positions: Vec<[f32; 3]>,
    /// Three for each face.
    pub indices: Vec<u32>,
}

impl Soup {
    /// Reads a file in any supported format and welds it, so that all simplifiers start from the same mesh.
    ///
    /// # Errors
    /// The errors of the reader.
    pub fn read(path: &Path) -> Result<Self> {
        let mut options = ReadOptions::default();
        options.folder = path.parent().map(Path::to_owned);
        let loaded = read_path(path, &options).with_context(|| format!("reading {}", path.display()))?;
        Ok(Self::of_mesh(&loaded.mesh).welded())
    }

    /// Returns the surface of a mesh in single precision.
    pub fn of_mesh(mesh: &TriMesh) -> Self {
        let surface = mesh.surface();
        let positions = match mesh.positions() {
            Positions::F32(p) => p.clone(),
            Positions::F64(p) => p.iter().map(|p| p.map(|x| x as f32)).collect(),
        };
        Self { positions, indices: bytemuck::cast_slice(surface.triangles()).to_vec() }
    }

    /// Returns the same surface with equal positions merged, without degenerate faces, non-finite faces and
    /// unused vertices. The remaining vertices keep their order.
    #[must_use]
    pub fn welded(&self) -> Self {
        let weld = weld(PositionsView::F32(&self.positions));
        let finite = |i: u32| self.positions[i as usize].iter().all(|x| x.is_finite());
        let mut indices: Vec<u32> = Vec::with_capacity(self.indices.len());
        for t in self.indices.chunks_exact(3) {
            let t = [t[0], t[1], t[2]].map(|i| weld.of(VertexId(i)).0);
            if t[0] != t[1] && t[1] != t[2] && t[2] != t[0] && t.iter().all(|&i| finite(i)) {
                indices.extend(t);
            }
        }
        Self { positions: self.positions.clone(), indices }.compacted()
    }

    /// Returns the same surface without unreferenced vertices; the others keep their order.
    #[must_use]
    pub fn compacted(&self) -> Self {
        let mut new = vec![u32::MAX; self.positions.len()];
        for &i in &self.indices {
            new[i as usize] = 0;
        }
        let mut positions = Vec::new();
        for (slot, p) in new.iter_mut().zip(&self.positions) {
            if *slot == 0 {
                *slot = positions.len() as u32;
                positions.push(*p);
            }
        }
        Self { positions, indices: self.indices.iter().map(|&i| new[i as usize]).collect() }
    }

    /// Borrows the surface.
    ///
    /// # Errors
    /// [`MeshError`] if an index is out of range.
    pub fn surface(&self) -> Result<Surface<'_>, MeshError> {
        Surface::new(PositionsView::F32(&self.positions), bytemuck::cast_slice(&self.indices))
    }

    /// Number of triangles.
    pub fn face_count(&self) -> usize {
        self.indices.len() / 3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn welding_merges_equal_positions_and_drops_degenerate_faces() {
        // Two triangles with separate corners, one of them with -0, and one face that has a position twice.
        let soup = Soup {
            positions: vec![
                [9.0; 3],
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [1.0, 0.0, -0.0],
                [1.0, 1.0, 0.0],
                [0.0, 1.0, 0.0],
            ],
            indices: vec![1, 2, 3, 4, 5, 6, 2, 4, 1],
        };
        let welded = soup.welded();
        assert_eq!(welded.positions.len(), 4);
        assert_eq!(welded.indices, [0, 1, 2, 1, 3, 2]);
        assert_eq!(welded.welded(), welded, "welding twice changes nothing");
    }
}
