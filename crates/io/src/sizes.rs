//! Costs of a file: of drawing it, and of storing it.

use std::collections::HashSet;

use lodsmith_core::{RegionId, TriMesh};

use crate::material::Regions;

/// Costs of a file: of drawing it, and of storing it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Sizes {
    /// Triangles that are drawn, in all instances.
    pub triangles: u64,
    /// Draw calls: one for each primitive that a node places, or each material of a mesh.
    pub draw_calls: u64,
    /// Bytes of all used textures on a GPU: as RGBA with 8 bits per channel, with mipmaps.
    pub texture_bytes: u64,
    /// Bytes of the file, without the files that it refers to; `None` if it is not a file.
    pub file_bytes: Option<u64>,
}

impl Sizes {
    /// Returns the sizes of a mesh with its materials. Textures whose size cannot be read count as none.
    pub fn of_mesh(mesh: &TriMesh, regions: &Regions) -> Self {
        let materials: Vec<Option<&[u8]>> = regions.iter().map(|region| region.material).collect();
        let of_face = |r: &RegionId| materials.get(r.index()).copied().flatten();
        let used: HashSet<Option<&[u8]>> = match mesh.regions() {
            Some(of_faces) => of_faces.iter().map(of_face).collect(),
            None => HashSet::from([materials.first().copied().flatten()]),
        };
        Self {
            triangles: mesh.face_count() as u64,
            draw_calls: if mesh.face_count() == 0 { 0 } else { used.len() as u64 },
            texture_bytes: regions.texture_bytes(),
            file_bytes: None,
        }
    }
}
