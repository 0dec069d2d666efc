//! Inspection of files: content and defects.

use lodsmith_core::mesh::defects::defects;
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::topology::{Size, Topology, TopologyCounts, size_of};
use lodsmith_core::{Bounds, PositionsView, Surface, TriMesh, VertexId};
use lodsmith_io::vertex_cache::CacheUse;
use lodsmith_io::{Contents, Format, Loaded, ReadOptions, Sizes, Warning};
use serde_json::{Value, json};

use crate::asset::Asset;
use crate::error::AssetError;
use crate::job::{Job, StageClock, Step};
use crate::memory_need;
use crate::paths::Source;
use crate::report_json;
use crate::sizes;
use crate::warnings::texts;

/// Counts, defects and sizes of a mesh.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MeshFacts {
    /// Number of triangles.
    pub faces: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of distinct positions.
    pub places: usize,
    /// Counts of the topology.
    pub topology: TopologyCounts,
    /// Number of faces with the same three positions as an earlier face, in either winding.
    pub duplicate_faces: usize,
    /// Number of vertices without a face.
    pub unused_vertices: usize,
    /// Number of vertices with a coordinate that is infinite or NaN.
    pub non_finite_vertices: usize,
    /// Bounding box.
    pub bounds: Option<Bounds>,
    /// Area and volume.
    pub size: Size,
}

impl MeshFacts {
    /// Inspects a mesh. Cost: O(n log n).
    pub fn of(mesh: &TriMesh) -> Self {
        let surface = mesh.surface();
        let positions = surface.positions();
        let defects = defects(&surface);
        Self {
            faces: mesh.face_count(),
            vertices: mesh.vertex_count(),
            places: weld(positions).distinct_count,
            topology: Topology::new(&surface).counts(),
            duplicate_faces: defects.duplicate_face_count(),
            unused_vertices: defects.unused_vertex_count,
            non_finite_vertices: defects.non_finite_vertex_count,
            bounds: positions.bounds(),
            size: size_of(&surface),
        }
    }

    /// Returns the facts as JSON, with the keys of the report of `info`.
    pub fn to_json(&self) -> Value {
        let t = &self.topology;
        let corners = |f: fn(&Bounds) -> [f64; 3]| self.bounds.as_ref().map(f);
        json!({
            "faces": self.faces,
            "vertices": self.vertices,
            "positions": self.places,
            "components": t.component_count,
            "border_edges": t.border_edge_count,
            "border_loops": t.border_loop_count,
            "non_manifold_edges": t.non_manifold_edge_count,
            "non_manifold_vertices": t.non_manifold_vertex_count,
            "degenerate_faces": t.degenerate_face_count,
            "duplicate_faces": self.duplicate_faces,
            "unused_vertices": self.unused_vertices,
            "non_finite_vertices": self.non_finite_vertices,
            "closed": t.is_closed(),
            "manifold": t.is_manifold(),
            "oriented": t.is_oriented(),
            "genus": t.genus(),
            "bounds": {
                "min": corners(|b| b.min), "max": corners(|b| b.max),
                "diagonal": self.bounds.as_ref().map(Bounds::diagonal),
            },
            "area": self.size.area,
            "volume": self.size.volume,
        })
    }
}

/// Facts about a file.
#[derive(Debug)]
#[non_exhaustive]
pub struct Info {
    /// The format.
    pub format: Format,
    /// The contents other than the mesh.
    pub contents: Contents,
    /// Warnings of reading.
    pub warnings: Vec<Warning>,
    /// Facts about all instances as one mesh.
    pub mesh: MeshFacts,
    /// True if the surface is closed without merging vertices at equal positions; `None` for formats without indices.
    pub closed_by_index: Option<bool>,
    /// Number of faces of two-sided sheets.
    pub two_sided_faces: usize,
    /// Sizes of the file; `None` if they are not known.
    pub sizes: Option<Sizes>,
    /// Efficiency of GPU caches with this order of triangles.
    pub cache: CacheUse,
    /// Seconds by stage.
    pub clock: StageClock,
}

/// Reads a file and inspects it.
///
/// # Errors
/// Those of [`Asset::read`]; [`AssetError::Memory`].
pub fn info(source: &Source, reading: &ReadOptions, job: &mut Job<'_>) -> Result<Info, AssetError> {
    job.enter(Step::Read);
    let asset = Asset::read(source, reading, false, job)?;
    let sizes = asset.sizes();
    let loaded = asset.into_loaded().expect("the file is read as one mesh");
    job.check_memory("info", memory_need::info(memory_need::Size::of(&loaded.mesh)))?;
    job.enter(Step::Inspect);
    Ok(Info {
        mesh: MeshFacts::of(&loaded.mesh),
        closed_by_index: is_closed_by_index(&loaded),
        two_sided_faces: lodsmith::two_sided_faces(&loaded.mesh.surface()),
        sizes,
        cache: CacheUse::of_mesh(&loaded.mesh),
        format: loaded.format,
        contents: loaded.contents,
        warnings: loaded.warnings,
        clock: job.times(),
    })
}

/// True if a surface is closed without merging vertices at equal positions; `None` if the format has no indices.
/// In glTF, a vertex is a position with its attributes.
fn is_closed_by_index(loaded: &Loaded) -> Option<bool> {
    if loaded.format == Format::Stl {
        return None;
    }
    let mesh = &loaded.mesh;
    Some(match (loaded.format, mesh.vertex_map()) {
        (Format::Gltf | Format::Glb, Some(map)) => {
            let positions = mesh.positions().view();
            let positions: Vec<[f64; 3]> = map.iter().map(|v| positions.get(*v)).collect();
            let faces = mesh.triangles().iter().map(|t| t.map(|w| VertexId(w.0))).collect();
            let surface = Surface::with_triangles(PositionsView::F64(&positions), faces);
            surface.is_ok_and(|surface| Topology::unwelded(&surface).counts().is_closed())
        }
        _ => Topology::unwelded(&mesh.surface()).counts().is_closed(),
    })
}

impl Info {
    /// Returns the report, with this path.
    pub fn to_json(&self, path: &str) -> Value {
        let c = &self.contents;
        let mut report = json!({ "path": path, "format": self.format.name(), "meshes": c.meshes });
        for (key, value) in self.mesh.to_json().as_object().into_iter().flatten() {
            report[key] = value.clone();
            match key.as_str() {
                "faces" => report["polygons"] = c.polygons.into(),
                "duplicate_faces" => report["two_sided_faces"] = self.two_sided_faces.into(),
                "closed" => report["closed_by_index"] = self.closed_by_index.into(),
                _ => {}
            }
        }
        let of_file = json!({
            "attributes": c.attributes,
            "materials": c.materials,
            "textures": c.textures,
            "skins": c.skins,
            "animations": c.animations,
            "morph_targets": c.morph_targets,
            "sizes": sizes::to_json(self.sizes),
            "cache": sizes::cache_json(&self.cache),
            "warnings": texts(&self.warnings),
        });
        report_json::extend(&mut report, of_file);
        if c.instances > 0 {
            report["distinct_meshes"] = c.distinct_meshes.into();
            report["instances"] = c.instances.into();
        }
        report
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{Positions, TriMesh};

    use super::*;

    #[test]
    fn duplicates_are_found_by_position_in_either_winding() {
        let mut positions = vec![[0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        positions.extend(positions.clone());
        let face = |a, b, c| [VertexId(a), VertexId(b), VertexId(c)];
        // The last face is degenerate after welding.
        let faces = vec![face(0, 1, 2), face(5, 4, 3), face(1, 2, 3), face(0, 3, 1)];
        let mesh = TriMesh::new(Positions::F32(positions), faces).unwrap();
        assert_eq!(MeshFacts::of(&mesh).duplicate_faces, 2);
    }
}
