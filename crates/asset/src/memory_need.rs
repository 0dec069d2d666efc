//! Peak memory of each step in bytes, estimated from counts, including the meshes that were read. The constants
//! were measured: docs/decisions/0022.

use lodsmith::{Bound, Length, Measure, Method, OwnedMeshData, Remesh, SimplifyOptions, Textures};
use lodsmith_core::measure::CompareOptions;
use lodsmith_core::topology::size_of;
use lodsmith_core::{Splits, TriMesh};
use lodsmith_io::gltf::SceneMesh;

/// Number of faces above which copies are made when needed instead of being kept.
const MANY_FACES: u64 = 1_000_000;

/// Numbers of faces and of attribute values of meshes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Size {
    bytes: u64,
    faces: u64,
    /// Number of attribute values, summed over faces.
    values: u64,
}

impl Size {
    /// Returns the size of a mesh.
    pub fn of(mesh: &TriMesh) -> Self {
        let has = |is: bool, n: u64| if is { n } else { 0 };
        let width = has(mesh.normals().is_some(), 3)
            + has(mesh.uvs().is_some(), 2)
            + has(mesh.colors().is_some(), 4)
            + mesh.further_attributes().iter().map(|a| a.width as u64).sum::<u64>();
        let faces = mesh.face_count() as u64;
        // The constants below assume half a wedge for each face, as usual; a soup has three.
        let wedges = (2 * mesh.wedge_count() as u64).max(faces);
        Self { bytes: mesh.bytes(), faces, values: width.saturating_mul(wedges) }
    }

    /// Returns the size of all meshes together.
    pub fn of_all<'a>(meshes: impl IntoIterator<Item = &'a TriMesh>) -> Self {
        meshes.into_iter().map(Self::of).fold(Self::default(), |a, b| Self {
            bytes: a.bytes.saturating_add(b.bytes),
            faces: a.faces.saturating_add(b.faces),
            values: a.values.saturating_add(b.values),
        })
    }

    /// Returns the bytes of the buffers plus `face` bytes for each face and `value` bytes for each value; the
    /// second number of a pair applies above [`MANY_FACES`] faces.
    fn bytes_at(self, face: [u64; 2], value: [u64; 2]) -> u64 {
        let i = usize::from(self.faces > MANY_FACES);
        let own = self.faces.saturating_mul(face[i]).saturating_add(self.values.saturating_mul(value[i]));
        self.bytes.saturating_add(own)
    }
}

/// Bytes for an attribute value during edge collapse.
const VALUE_BYTES: [u64; 2] = [31, 22];

/// Returns the bytes for each face during a run of a method.
fn face_of(options: &SimplifyOptions) -> [u64; 2] {
    let own = match options.method {
        Method::Memoryless { .. }
        | Method::LindstromTurk
        | Method::Melax
        | Method::ShortestEdge { .. }
        | Method::Cluster { two_stage: true, .. } => [130, 90],
        Method::Quadric { .. } => [190, 120],
        Method::Cluster { .. } => [64, 44],
        Method::VertexRemoval { .. } | Method::Unsubdivide { .. } => [220, 220],
        Method::Planar { .. } => [400, 400],
        Method::Remesh(Remesh::OnSurface { .. }) => [300, 300],
        // Unknown methods count like the method that needs most.
        _ => [560, 560],
    };
    let is_measured =
        options.measure == Measure::Always || matches!(options.bound, Bound::OneSided | Bound::TwoSided);
    // A search for an error keeps copies of the engine and some results, and proves distances.
    let more = match options.stop.error {
        Some(_) => [790, 660],
        None if is_measured => [110, 110],
        None => [0, 0],
    };
    std::array::from_fn(|i| own[i] + more[i])
}

/// Returns the bytes of new elements of a remesh: the cells of a voxel grid, and faces of a given edge
/// length.
fn remesh_bytes(mesh: &TriMesh, options: &SimplifyOptions) -> u64 {
    let (voxel, edge_length) = match options.method {
        Method::Remesh(Remesh::Voxels { size }) => (Some(size), None),
        Method::Remesh(Remesh::OnSurface { edge_length: Some(length), .. }) => (None, Some(length)),
        _ => return 0,
    };
    let surface = mesh.surface();
    let Some(bounds) = surface.positions().bounds() else { return 0 };
    let squares = |length: Length| size_of(&surface).area / length.in_units(bounds.diagonal()).powi(2);
    // A surface passes through 1.5 cells for each square, an open surface through twice as many; the engine
    // refuses too many cells.
    let cells = voxel.map_or(0.0, |h| 400.0 * 3.0 * squares(h).min(8e6));
    let faces = edge_length.map_or(0.0, |l| 300.0 * 2.3 * squares(l));
    (cells + faces) as u64
}

/// Returns the bytes of the images whose colours a run keeps in place.
pub fn images(data: &[OwnedMeshData]) -> u64 {
    Textures::bytes_of_all(data.iter().filter_map(|own| own.textures.as_ref()))
}

/// Returns the peak memory of simplifying a mesh.
pub fn simplify(mesh: &TriMesh, options: &SimplifyOptions) -> u64 {
    let own = Size::of(mesh).bytes_at(face_of(options), VALUE_BYTES);
    own.saturating_add(remesh_bytes(mesh, options))
}

/// Returns the peak memory of simplifying the meshes of a scene: they are joined, and the buffers of the file stay
/// in memory.
pub fn simplify_scene(meshes: &[SceneMesh], buffers: u64, options: &SimplifyOptions) -> u64 {
    let size = Size::of_all(meshes.iter().map(|m| &*m.mesh));
    let own = size.bytes_at(face_of(options).map(|n| n + 60), VALUE_BYTES);
    own.saturating_add(buffers)
}

/// Returns the peak memory of a chain of levels, all of which are kept.
pub fn lod(size: Size, options: &SimplifyOptions) -> u64 {
    size.bytes_at(face_of(options).map(|n| n + 140), VALUE_BYTES.map(|n| n + 10))
}

/// Returns the peak memory of a chain of levels that becomes one scene.
pub fn lod_scene(size: Size, options: &SimplifyOptions) -> u64 {
    size.bytes_at(face_of(options).map(|n| n + 330), VALUE_BYTES.map(|n| n + 10))
}

/// Returns the peak memory of cleaning a mesh, including the result.
pub fn clean(size: Size) -> u64 {
    size.bytes_at([115, 95], [4, 4]).saturating_add(size.bytes)
}

/// Returns the peak memory of inspecting a mesh.
pub fn info(size: Size) -> u64 {
    size.bytes_at([60, 54], [0, 0])
}

/// Returns the peak memory of measuring one mesh against another.
pub fn compare(reference: Size, candidate: Size, options: &CompareOptions) -> u64 {
    let both = |face| reference.bytes_at(face, [2, 2]).saturating_add(candidate.bytes_at(face, [2, 2]));
    both([115, 112]).saturating_add((options.samples as u64).saturating_mul(50))
}

/// Returns the peak memory of running every method on one mesh and measuring each result.
pub fn methods(mesh: &TriMesh, largest_need: u64, options: &CompareOptions) -> u64 {
    let size = Size::of(mesh);
    // The results have fewer faces, and what a run needs is free again when its result is measured.
    largest_need.max(compare(size, size, options)).saturating_add(size.bytes_at([110, 110], [4, 4]))
}

/// Returns the peak memory of a recorded run and the splits made of it.
pub fn progressive(size: Size, options: &SimplifyOptions) -> u64 {
    size.bytes_at(face_of(options).map(|n| n + 310), [48, 48])
}

/// Returns the peak memory of extracting a level, including the splits.
pub fn extract(splits: &Splits) -> u64 {
    let faces = splits.faces.len() as u64;
    faces.saturating_mul(215).saturating_add((splits.values.len() as u64).saturating_mul(8))
}

/// Returns the peak memory of the triangle trees for distances of vertices, without the meshes.
pub fn distances(size: Size) -> u64 {
    size.faces.saturating_mul(110)
}

/// Returns the peak memory of rendering `count` pictures of this size, with their models.
pub fn render(size: Size, pixels: [usize; 2], count: usize, is_occluded: bool) -> u64 {
    let all = (pixels[0] as u64).saturating_mul(pixels[1] as u64);
    let each = if is_occluded { 36 } else { 8 };
    let kept = if count > 1 { 8 } else { 0 };
    let pictures = all.saturating_mul((count as u64).saturating_mul(kept).saturating_add(each));
    size.bytes_at([60, 38], [0, 0]).saturating_add(pictures)
}

/// Returns the peak memory of comparing pictures of two meshes from `count` directions, which are kept for a sheet.
pub fn views(size: Size, pixels: [usize; 2], count: usize, are_kept: bool) -> u64 {
    let pictures = if are_kept { count.saturating_mul(2) } else { 2 };
    // A camera and the differences of each view.
    render(size, pixels, pictures, false).saturating_add((count as u64).saturating_mul(160))
}

#[cfg(test)]
mod tests {
    use lodsmith::{MethodKind, Stop};
    use lodsmith_core::shapes;

    use super::*;

    #[test]
    fn larger_inputs_need_more() {
        let options = SimplifyOptions::new(Stop::ratio(0.5));
        let (small, mut large) = (shapes::icosphere(2), shapes::icosphere(3));
        let bare = simplify(&large, &options);
        assert!(simplify(&small, &options) < bare);
        large.set_uvs(Some(vec![[0.0; 2]; large.wedge_count()])).expect("one for each wedge");
        assert!(simplify(&large, &options) > bare);
        let mut measured = options.clone();
        measured.measure = Measure::Always;
        assert!(simplify(&large, &measured) > simplify(&large, &options));
    }

    #[test]
    fn short_edges_and_small_voxels_need_more() {
        let mesh = shapes::icosphere(2);
        let mut options = SimplifyOptions::default();
        options.method = MethodKind::Remesh.into();
        let plain = simplify(&mesh, &options);
        if let Method::Remesh(Remesh::OnSurface { edge_length, .. }) = &mut options.method {
            *edge_length = Some(Length::OfDiagonal(1e-4));
        }
        assert!(simplify(&mesh, &options) > plain + (1 << 30));
        options.method = Method::Remesh(Remesh::Voxels { size: Length::OfDiagonal(1e-3) });
        assert!(simplify(&mesh, &options) > plain + (100 << 20));
    }
}
