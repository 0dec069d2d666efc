//! Extraction of some faces of a mesh as a mesh of their own, and appending a modified part to a mesh.

use std::collections::HashMap;

use crate::ids::{FaceId, VertexId, WedgeId};
use crate::mesh::{Attribute, MeshError, Positions, TriMesh, check_size};

/// Some faces of a mesh as a mesh, with the ids of its vertices and wedges in the whole.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Part {
    /// The faces, in the order in which they were given; every vertex and wedge is used.
    pub mesh: TriMesh,
    /// The vertex of the whole for each vertex of the part; ascending.
    pub vertices: Vec<VertexId>,
    /// The wedge of the whole for each wedge of the part; ascending.
    pub wedges: Vec<WedgeId>,
}

/// Vertices and wedges that a mesh shares with another: the other's id for each of its own, if any.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SharedIds {
    /// One entry for each vertex.
    pub vertices: Vec<Option<VertexId>>,
    /// One entry for each wedge.
    pub wedges: Vec<Option<WedgeId>>,
}

/// Extracts some faces. The cost depends on the part alone: O(n log n) for its n faces.
///
/// # Panics
/// If there is no such face.
pub fn extract_faces(whole: &TriMesh, faces: &[FaceId]) -> Part {
    let mut wedges: Vec<WedgeId> = faces.iter().flat_map(|f| whole.triangles[f.index()]).collect();
    sorted_once(&mut wedges);
    let mut vertices: Vec<VertexId> = wedges.iter().map(|&w| whole.vertex_of(w)).collect();
    sorted_once(&mut vertices);
    let wedge = |w: WedgeId| WedgeId::new(wedges.binary_search(&w).expect("it was collected above"));
    let vertex = |v: VertexId| VertexId::new(vertices.binary_search(&v).expect("it was collected above"));
    let vertex_of = whole
        .vertex_of
        .as_ref()
        .map(|map| wedges.iter().map(|w| vertex(map[w.index()])).collect::<Vec<_>>())
        .filter(|map| map.iter().enumerate().any(|(w, v)| v.index() != w) || map.len() != vertices.len());
    fn of_wedges<T: Copy>(all: Option<&[T]>, wedges: &[WedgeId]) -> Option<Vec<T>> {
        all.map(|all| wedges.iter().map(|w| all[w.index()]).collect())
    }
    let of_further = |a: &Attribute| Attribute {
        values: wedges.iter().flat_map(|&w| a.of(w)).copied().collect(),
        semantic: a.semantic.clone(),
        width: a.width,
    };
    let mesh = TriMesh {
        triangles: faces.iter().map(|f| whole.triangles[f.index()].map(wedge)).collect(),
        vertex_of,
        positions: match &whole.positions {
            Positions::F32(p) => Positions::F32(vertices.iter().map(|v| p[v.index()]).collect()),
            Positions::F64(p) => Positions::F64(vertices.iter().map(|v| p[v.index()]).collect()),
        },
        normals: of_wedges(whole.normals(), &wedges),
        uvs: of_wedges(whole.uvs(), &wedges),
        colors: of_wedges(whole.colors(), &wedges),
        further: whole.further.iter().map(of_further).collect(),
        regions: whole.regions().map(|r| faces.iter().map(|f| r[f.index()]).collect()),
    };
    Part { mesh, vertices, wedges }
}

fn sorted_once<T: Ord>(items: &mut Vec<T>) {
    items.sort_unstable();
    items.dedup();
}

impl Part {
    /// Finds what a mesh made from this part still shares with the whole: vertices whose positions are equal
    /// bit for bit, and wedges there with the same attributes.
    pub fn shared_with(&self, made: &TriMesh) -> SharedIds {
        let place = |p: [f64; 3]| p.map(|x| (x + 0.0).to_bits());
        let places: HashMap<[u64; 3], u32> = self.mesh.positions.view().iter().map(place).zip(0..).collect();
        let local: Vec<Option<u32>> =
            made.positions.view().iter().map(|p| places.get(&place(p)).copied()).collect();
        let vertices = local.iter().map(|v| v.map(|v| self.vertices[v as usize])).collect();
        let mut by_vertex: Vec<(VertexId, WedgeId)> =
            (0..self.wedges.len()).map(WedgeId::new).map(|w| (self.mesh.vertex_of(w), w)).collect();
        by_vertex.sort_unstable();
        let counterparts = counterparts(&self.mesh, made);
        let same = |own: WedgeId, other: WedgeId| {
            let (i, j) = (own.index(), other.index());
            let (a, b) = (&self.mesh, made);
            a.normals().map(|x| x[i].map(f32::to_bits)) == b.normals().map(|x| x[j].map(f32::to_bits))
                && a.uvs().map(|x| x[i].map(f32::to_bits)) == b.uvs().map(|x| x[j].map(f32::to_bits))
                && a.colors().map(|x| x[i].map(f32::to_bits)) == b.colors().map(|x| x[j].map(f32::to_bits))
                && a.further.iter().zip(&counterparts).all(|(x, at)| {
                    at.is_some_and(|at| {
                        let (x, y) = (x.of(own), b.further[at].of(other));
                        x.iter().zip(y).all(|(x, y)| x.to_bits() == y.to_bits())
                    })
                })
        };
        let wedge = |w: WedgeId| {
            let v = VertexId(local[made.vertex_of(w).index()]?);
            let first = by_vertex.partition_point(|x| x.0 < v);
            let own = by_vertex[first..].iter().take_while(|x| x.0 == v).find(|x| same(x.1, w))?;
            Some(self.wedges[own.1.index()])
        };
        SharedIds { vertices, wedges: (0..made.wedge_count()).map(WedgeId::new).map(wedge).collect() }
    }
}

/// Returns, for each further attribute of `of`, the index of the same attribute of `on`, if it has one.
fn counterparts(of: &TriMesh, on: &TriMesh) -> Vec<Option<usize>> {
    let alike = |a: &Attribute, b: &Attribute| (&a.semantic, a.width) == (&b.semantic, b.width);
    of.further.iter().map(|a| on.further.iter().position(|b| alike(a, b))).collect()
}

/// Appends the faces of `more` to `whole`; vertices and wedges in `known` are reused.
///
/// `more` must have the same normals, texture coordinates, colours and regions as `whole`, and all its
/// further attributes. If `whole` has no attributes, wedges stay identical to vertices.
///
/// # Errors
/// [`MeshError::WrongLength`] if an attribute is missing, [`MeshError::TooLarge`]; then `whole` is unchanged.
pub fn append(whole: &mut TriMesh, more: &TriMesh, known: &SharedIds) -> Result<(), MeshError> {
    check_size("corners", (whole.triangles.len() + more.triangles.len()).saturating_mul(3))?;
    check_size("vertices", whole.vertex_count() + more.vertex_count())?;
    check_size("wedges", whole.wedge_count() + more.wedge_count())?;
    let lengths = [
        ("known vertices", known.vertices.len(), more.vertex_count()),
        ("known wedges", known.wedges.len(), more.wedge_count()),
        ("normals", more.normals().map_or(0, <[_]>::len), whole.normals().map_or(0, |_| more.wedge_count())),
        (
            "texture coordinates",
            more.uvs().map_or(0, <[_]>::len),
            whole.uvs().map_or(0, |_| more.wedge_count()),
        ),
        ("colours", more.colors().map_or(0, <[_]>::len), whole.colors().map_or(0, |_| more.wedge_count())),
        ("regions", more.regions().map_or(0, <[_]>::len), whole.regions().map_or(0, |_| more.face_count())),
    ];
    let counterparts = counterparts(whole, more);
    let missing = counterparts.iter().position(Option::is_none);
    let missing = missing.map(|i| (whole.further[i].semantic.title(), 0, more.wedge_count()));
    if let Some((name, got, wanted)) = lengths.into_iter().find(|x| x.1 != x.2).or(missing) {
        return Err(MeshError::WrongLength { name, got, wanted });
    }

    let before = whole.vertex_count();
    let mut vertices = Vec::with_capacity(more.vertex_count());
    for (v, known) in known.vertices.iter().enumerate() {
        vertices.push(known.unwrap_or_else(|| {
            let p = more.positions.view().get(VertexId::new(v));
            match &mut whole.positions {
                Positions::F32(all) => all.push(p.map(|x| x as f32)),
                Positions::F64(all) => all.push(p),
            }
            VertexId::new(whole.positions.len() - 1)
        }));
    }
    let is_plain = !whole.has_attributes() && whole.vertex_of.is_none();
    let mut wedges = Vec::with_capacity(more.wedge_count());
    if !is_plain && whole.vertex_of.is_none() {
        // For existing wedges, wedge i is vertex i.
        whole.vertex_of = Some((0..before).map(VertexId::new).collect());
    }
    for (w, known) in known.wedges.iter().enumerate() {
        let vertex = vertices[more.vertex_of(WedgeId::new(w)).index()];
        let Some(map) = &mut whole.vertex_of else {
            wedges.push(WedgeId(vertex.0));
            continue;
        };
        if let Some(known) = known {
            wedges.push(*known);
            continue;
        }
        wedges.push(WedgeId::new(map.len()));
        map.push(vertex);
        push(&mut whole.normals, more.normals(), w);
        push(&mut whole.uvs, more.uvs(), w);
        push(&mut whole.colors, more.colors(), w);
        for (a, at) in whole.further.iter_mut().zip(&counterparts) {
            let from = &more.further[at.expect("missing attributes were rejected above")];
            a.values.extend_from_slice(from.of(WedgeId::new(w)));
        }
    }
    whole.triangles.extend(more.triangles.iter().map(|t| t.map(|w| wedges[w.index()])));
    if let (Some(all), Some(own)) = (&mut whole.regions, more.regions()) {
        all.extend_from_slice(own);
    }
    Ok(())
}

fn push<T: Copy>(all: &mut Option<Vec<T>>, own: Option<&[T]>, w: usize) {
    if let (Some(all), Some(own)) = (all, own) {
        all.push(own[w]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    #[test]
    fn a_part_put_back_adds_only_its_faces() {
        let mut whole = shapes::torus(12, 8);
        let uvs = (0..whole.wedge_count()).map(|w| [w as f32, 0.5]).collect();
        whole.set_uvs(Some(uvs)).unwrap();
        let faces: Vec<FaceId> = [7, 3, 60, 4].map(FaceId).to_vec();
        let taken = extract_faces(&whole, &faces);
        assert_eq!(taken.mesh.face_count(), 4);
        for (own, f) in taken.mesh.triangles().iter().zip(&faces) {
            assert_eq!(own.map(|w| taken.wedges[w.index()]), whole.triangles()[f.index()]);
        }
        let mut both = whole.clone();
        append(&mut both, &taken.mesh, &taken.shared_with(&taken.mesh)).unwrap();
        assert_eq!((both.vertex_count(), both.wedge_count()), (whole.vertex_count(), whole.wedge_count()));
        assert_eq!(both.face_count(), whole.face_count() + 4);
        assert_eq!(extract_faces(&both, &(192..196).map(FaceId).collect::<Vec<_>>()), taken);
    }

    #[test]
    fn what_is_new_is_added_and_what_is_missing_is_named() {
        let whole = shapes::tetrahedron();
        let taken = extract_faces(&whole, &[FaceId(0)]);
        let mut moved = taken.mesh.clone();
        moved.map_positions(
            |p| if p == whole.positions().view().get(taken.vertices[0]) { [9.0; 3] } else { p },
        );
        let known = taken.shared_with(&moved);
        assert_eq!(known.vertices.iter().filter(|v| v.is_none()).count(), 1);
        let mut both = whole.clone();
        append(&mut both, &moved, &known).unwrap();
        assert_eq!((both.vertex_count(), both.face_count()), (5, 5));
        assert_eq!(both.vertex_map(), None);
        let mut shaded = whole.clone();
        shaded.set_normals(Some(vec![[0.0, 0.0, 1.0]; 4])).unwrap();
        let before = shaded.clone();
        let error = append(&mut shaded, &moved, &known).unwrap_err();
        assert!(matches!(error, MeshError::WrongLength { name: "normals", .. }));
        assert_eq!(shaded, before);
    }
}
