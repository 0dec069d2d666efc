//! Creases: edges so sharp that normals computed from faces break there.

use crate::disjoint_sets::DisjointSets;
use crate::ids::{VertexId, WedgeId};
use crate::mesh::{Attribute, MeshError, Surface, TriMesh};

use super::normals::{cross, dot, sub, unit};
use super::weld::weld;

/// Number of faces of a mesh from which [`Creases::Auto`] examines only some of the edges. (Guessed: hundreds of
/// thousands of edges are enough for a share in percent.)
const SAMPLED_FACES: usize = 1 << 18;
/// No wedge.
const NONE: u32 = u32::MAX;

/// The angle between the normals of two faces, in degrees, above which their edge is drawn sharp. Cylinders with eleven
/// sides or more are round. (Between the 30° of Blender's "Shade Auto Smooth" and the 40° of CAD viewers.)
pub const CREASE_ANGLE_DEG: f64 = 35.0;

/// A face whose height is less than this fraction of the largest coordinate has no reliable normal: the rounding of its
/// corners is as large. (Six digits, which text formats commonly have.)
const MIN_HEIGHT: f64 = 1e-6;
/// Number of rounds in which such faces take the normal of a neighbour. (Guessed: they are seldom adjacent.)
const NEIGHBOUR_ROUNDS: usize = 3;

/// Computes a normal for each corner of each face: the mean of the normals of the faces around its vertex, weighted by
/// their angles there. Only faces count that can be reached from it without crossing a crease: an edge whose face
/// normals differ by more than `angle_deg` degrees.
///
/// `place` returns the representative of all vertices at the same position; the identity if vertices are already
/// welded. Normals are of unit length. A face whose normal is lost in the rounding of its positions takes the normal of
/// a neighbour, else the z axis. Cost: O(n), and O(v log v) at a vertex of v faces; some 150 bytes per face.
pub fn corner_normals(
    surface: &Surface<'_>,
    place: impl Fn(VertexId) -> VertexId,
    angle_deg: f64,
) -> Vec<[[f32; 3]; 3]> {
    let edges = Edges::new(surface, place, |_| true);
    let normals = edges.face_normals(surface);
    let mut groups = DisjointSets::new(3 * normals.len());
    let min_cosine = libm::cos(angle_deg.clamp(0.0, 180.0).to_radians());
    edges.for_each_pair(|one, two| {
        if let (Some(a), Some(b)) = (normals[one.face()], normals[two.face()])
            && dot(a, b) >= min_cosine
        {
            groups.join(one.low_corner, two.low_corner);
            groups.join(one.high_corner, two.high_corner);
        }
    });
    let groups = groups.into_representatives();
    let mut sums = vec![[0f64; 3]; groups.len()];
    let positions = surface.positions();
    for (face, (vertices, normal)) in surface.triangles().iter().zip(&normals).enumerate() {
        let Some(normal) = normal else { continue };
        let p = vertices.map(|v| positions.get(v));
        let sides = [0, 1, 2].map(|k| unit(sub(p[(k + 1) % 3], p[k])));
        for corner in 0..3 {
            let (Some(out), Some(back)) = (sides[corner], sides[(corner + 2) % 3]) else { continue };
            let angle = libm::acos((-dot(out, back)).clamp(-1.0, 1.0));
            let sum = &mut sums[groups[3 * face + corner] as usize];
            *sum = [0, 1, 2].map(|k| sum[k] + angle * normal[k]);
        }
    }
    let of_corner = |face: usize, corner: usize| {
        let mean = unit(sums[groups[3 * face + corner] as usize]);
        mean.or(normals[face]).unwrap_or([0.0, 0.0, 1.0]).map(|x| x as f32)
    };
    (0..normals.len()).map(|face| [0, 1, 2].map(|corner| of_corner(face, corner))).collect()
}

/// A mesh whose wedges are split where its normals are discontinuous.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SplitMesh {
    /// The mesh: its own wedges, with the same numbers, and copies of some of them.
    pub mesh: TriMesh,
    /// The original of each copy.
    pub copies: Vec<WedgeId>,
    /// The normal of each wedge, copies included.
    pub normals: Vec<[f32; 3]>,
}

/// Splits the wedges of a mesh so that each has one of the [`corner_normals`]; coincident vertices count as one.
///
/// Cost: as [`corner_normals`], and a copy of the mesh.
///
/// # Errors
/// [`MeshError::TooLarge`].
pub fn split_at_creases(mesh: &TriMesh, angle_deg: f64) -> Result<SplitMesh, MeshError> {
    let surface = mesh.surface();
    let joined = weld(surface.positions());
    let of_corners = corner_normals(&surface, |v| joined.of(v), angle_deg);
    let count = mesh.wedge_count();
    let mut copies: Vec<WedgeId> = Vec::new();
    let mut normals = vec![[0f32; 3]; count];
    let mut is_used = vec![false; count];
    // The next copy of the same original.
    let mut next = vec![NONE; count];
    let mut triangles = mesh.triangles().to_vec();
    for (wedge, &normal) in triangles.as_flattened_mut().iter_mut().zip(of_corners.as_flattened()) {
        let original = *wedge;
        if !std::mem::replace(&mut is_used[original.index()], true) {
            normals[original.index()] = normal;
        }
        // A wedge seldom has more than a few copies.
        while normals[wedge.index()] != normal {
            if next[wedge.index()] == NONE {
                next[wedge.index()] = normals.len() as u32;
                normals.push(normal);
                next.push(NONE);
                copies.push(original);
            }
            *wedge = WedgeId(next[wedge.index()]);
        }
    }
    let of_wedge = |wedge: usize| copies[wedge - count];
    let vertex_of =
        |wedge: usize| mesh.vertex_of(if wedge < count { WedgeId::new(wedge) } else { of_wedge(wedge) });
    let vertex_map = (0..normals.len()).map(vertex_of).collect();
    let mut split = TriMesh::with_wedges(mesh.positions().clone(), vertex_map, triangles)?;
    split.set_uvs(mesh.uvs().map(|all| with_copies(all, 1, &copies)))?;
    split.set_colors(mesh.colors().map(|all| with_copies(all, 1, &copies)))?;
    split.set_regions(mesh.regions().map(<[_]>::to_vec))?;
    for attribute in mesh.further_attributes() {
        let values = with_copies(&attribute.values, attribute.width, &copies);
        split.add_attribute(Attribute { values, ..attribute.clone() })?;
    }
    Ok(SplitMesh { mesh: split, copies, normals })
}

/// Returns per-wedge values, `width` for each wedge, followed by the values of the copies.
pub fn with_copies<T: Copy>(values: &[T], width: usize, copies: &[WedgeId]) -> Vec<T> {
    let of_copies = copies.iter().flat_map(|w| &values[w.index() * width..][..width]);
    values.iter().chain(of_copies).copied().collect()
}

/// How edges of meshes without normals are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Creases {
    /// Sharp above [`CREASE_ANGLE_DEG`] if the shape is made of surfaces that meet in sharp edges, else smooth:
    /// [`EdgeAngles::are_creased`].
    #[default]
    Auto,
    /// All smooth.
    Off,
    /// Sharp if the normals of their faces differ by more than this angle in degrees.
    Above(f64),
}

impl Creases {
    /// Returns the angle in degrees above which edges of these meshes are sharp; `None` if all are smooth. Meshes with
    /// normals do not count.
    ///
    /// Cost: O(n) for [`Creases::Auto`].
    pub fn angle_deg<'m>(self, meshes: impl IntoIterator<Item = &'m TriMesh>) -> Option<f64> {
        match self {
            Self::Off => None,
            Self::Above(angle_deg) => Some(angle_deg),
            Self::Auto => {
                let mut angles = EdgeAngles::default();
                for mesh in meshes.into_iter().filter(|mesh| mesh.normals().is_none()) {
                    let surface = mesh.surface();
                    let joined = weld(surface.positions());
                    angles.add(&surface, |v| joined.of(v));
                }
                angles.are_creased().then_some(CREASE_ANGLE_DEG)
            }
        }
    }
}

/// The shares of flat and of sharp edges in meshes.
#[derive(Clone, Copy, Debug, Default)]
pub struct EdgeAngles {
    /// Length of all edges, relative to their mesh.
    all: f64,
    /// Length of the edges between coplanar faces.
    flat: f64,
    /// Length of the edges above [`CREASE_ANGLE_DEG`].
    sharp: f64,
}

/// The angle in degrees below which two faces count as coplanar.
const FLAT_DEG: f64 = 0.5;
/// Share of flat edges from which a shape counts as made of surfaces that meet in sharp edges, if there are sharp
/// edges. (Measured with the test models: CAD models and other constructed models have 35 to 92 %; scans and terrains
/// 0.6 to 14 %, and less once they are simplified. The share of sharp edges says little: it falls as the triangles
/// become smaller.)
const MIN_FLAT_SHARE: f64 = 0.2;
/// Share of sharp edges from which all edges are meant to be sharp: a box, a pyramid, an icosahedron. (Guessed; organic
/// shapes reduced to a hundred triangles have up to 72 %.)
const ALL_SHARP_SHARE: f64 = 0.95;

impl EdgeAngles {
    /// Adds the edges of a surface, or some of them if it is large; `place` as in [`corner_normals`].
    pub fn add(&mut self, surface: &Surface<'_>, place: impl Fn(VertexId) -> VertexId) {
        let share = (surface.triangles().len() / SAMPLED_FACES + 1) as u32;
        // Scattered by the golden ratio: vertices of one part of the shape often follow each other.
        let edges = Edges::new(surface, place, |v| v.0.wrapping_mul(2_654_435_769) >> 8 < (1 << 24) / share);
        let (positions, triangles) = (surface.positions(), surface.triangles());
        let extent = extent(surface);
        let at = |corner: u32| {
            positions.get(triangles[corner as usize / 3][corner as usize % 3]).map(|x| x / extent)
        };
        edges.for_each_pair(|one, two| {
            let [a, b] = [one, two].map(|side| face_normal(surface, side.face(), extent));
            if let (Some(a), Some(b)) = (a, b) {
                let side = sub(at(one.low_corner), at(one.high_corner));
                let length = dot(side, side).sqrt();
                let angle = libm::atan2(dot(cross(a, b), cross(a, b)).sqrt(), dot(a, b)).to_degrees();
                self.all += length;
                self.flat += if angle < FLAT_DEG { length } else { 0.0 };
                self.sharp += if angle > CREASE_ANGLE_DEG { length } else { 0.0 };
            }
        });
    }

    /// Returns true if the shape is made of surfaces that meet in sharp edges.
    pub fn are_creased(&self) -> bool {
        let is_constructed = self.flat >= MIN_FLAT_SHARE * self.all;
        self.sharp > 0.0 && (is_constructed || self.sharp >= ALL_SHARP_SHARE * self.all)
    }
}

/// A side of a face; its corners are numbered `3 * face + k`.
#[derive(Clone, Copy)]
struct Side {
    /// Its end with the higher number.
    high: VertexId,
    low_corner: u32,
    high_corner: u32,
}

impl Side {
    fn face(&self) -> usize {
        self.low_corner as usize / 3
    }
}

/// The sides of all faces, by the end with the lower number.
struct Edges {
    sides: Vec<Side>,
    /// Where the sides of each vertex begin, and the end.
    starts: Vec<u32>,
}

impl Edges {
    /// Collects the sides whose lower ends are wanted.
    fn new(
        surface: &Surface<'_>,
        place: impl Fn(VertexId) -> VertexId,
        is_wanted: impl Fn(VertexId) -> bool,
    ) -> Self {
        let each = |add: &mut dyn FnMut(VertexId, Side)| {
            for (face, vertices) in surface.triangles().iter().enumerate() {
                let places = vertices.map(&place);
                for k in 0..3 {
                    let [(a, one), (b, two)] = [k, (k + 1) % 3].map(|k| (places[k], (3 * face + k) as u32));
                    if a < b && is_wanted(a) {
                        add(a, Side { high: b, low_corner: one, high_corner: two });
                    } else if b < a && is_wanted(b) {
                        add(b, Side { high: a, low_corner: two, high_corner: one });
                    }
                }
            }
        };
        let mut starts = vec![0u32; surface.positions().len() + 1];
        each(&mut |low, _| starts[low.index() + 1] += 1);
        for v in 1..starts.len() {
            starts[v] += starts[v - 1];
        }
        let nowhere = Side { high: VertexId(0), low_corner: 0, high_corner: 0 };
        let mut sides = vec![nowhere; starts[starts.len() - 1] as usize];
        let mut next = starts.clone();
        each(&mut |low, side| {
            sides[next[low.index()] as usize] = side;
            next[low.index()] += 1;
        });
        for range in starts.windows(2) {
            sides[range[0] as usize..range[1] as usize].sort_unstable_by_key(|s| (s.high, s.low_corner));
        }
        Self { sides, starts }
    }

    /// Calls a function with pairs of sides of each edge: if an edge has more than two sides, each side with
    /// the next.
    fn for_each_pair(&self, mut of: impl FnMut(Side, Side)) {
        for range in self.starts.windows(2) {
            for pair in self.sides[range[0] as usize..range[1] as usize].windows(2) {
                if pair[0].high == pair[1].high {
                    of(pair[0], pair[1]);
                }
            }
        }
    }

    /// Returns the normal of each face; a face without a normal takes that of a neighbour.
    fn face_normals(&self, surface: &Surface<'_>) -> Vec<Option<[f64; 3]>> {
        let extent = extent(surface);
        let mut normals: Vec<Option<[f64; 3]>> =
            (0..surface.triangles().len()).map(|face| face_normal(surface, face, extent)).collect();
        for _ in 0..NEIGHBOUR_ROUNDS {
            let mut is_changed = false;
            self.for_each_pair(|one, two| match (normals[one.face()], normals[two.face()]) {
                (None, known @ Some(_)) => (normals[one.face()], is_changed) = (known, true),
                (known @ Some(_), None) => (normals[two.face()], is_changed) = (known, true),
                _ => {}
            });
            if !is_changed {
                break;
            }
        }
        normals
    }
}

/// Returns the largest coordinate that a face uses.
fn extent(surface: &Surface<'_>) -> f64 {
    let positions = surface.positions();
    let finite = |v: &VertexId| positions.get(*v).into_iter().map(f64::abs).filter(|x| x.is_finite());
    surface.triangles().iter().flatten().flat_map(finite).fold(0f64, f64::max)
}

/// Returns the normal of a face; `None` if it is lost in the rounding of the positions.
fn face_normal(surface: &Surface<'_>, face: usize, extent: f64) -> Option<[f64; 3]> {
    // Divided first: then neither huge nor tiny coordinates leave the range of a double.
    let p = surface.triangles()[face].map(|v| surface.positions().get(v).map(|x| x / extent));
    let sides = [0, 1, 2].map(|k| sub(p[(k + 1) % 3], p[k]));
    let normal = cross(sides[0], sides[1]);
    let longest_sq = sides.map(|s| dot(s, s)).into_iter().fold(0f64, f64::max);
    (dot(normal, normal) > MIN_HEIGHT * MIN_HEIGHT * longest_sq).then(|| unit(normal)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    fn normals(mesh: &TriMesh, angle_deg: f64) -> Vec<[[f32; 3]; 3]> {
        let joined = weld(mesh.positions().view());
        corner_normals(&mesh.surface(), |v| joined.of(v), angle_deg)
    }

    fn auto(mesh: &TriMesh) -> Option<f64> {
        Creases::Auto.angle_deg([mesh])
    }

    fn degrees_between(a: [f32; 3], b: [f32; 3]) -> f64 {
        libm::acos(dot(a.map(f64::from), b.map(f64::from)).clamp(-1.0, 1.0)).to_degrees()
    }

    /// A copy in which each corner has a vertex of its own, as in STL.
    fn soup(mesh: &TriMesh) -> TriMesh {
        let surface = mesh.surface();
        let places = surface.triangles().iter().flatten().map(|v| surface.positions().get(*v)).collect();
        let faces = (0..mesh.face_count() as u32).map(|f| [0, 1, 2].map(|k| VertexId(3 * f + k))).collect();
        TriMesh::new(crate::Positions::F64(places), faces).unwrap()
    }

    #[test]
    fn a_box_has_the_normals_of_its_faces() {
        for mesh in [shapes::cube(4), soup(&shapes::cube(4))] {
            for (face, corners) in normals(&mesh, 35.0).into_iter().enumerate() {
                let flat = face_normal(&mesh.surface(), face, 1.0).unwrap().map(|x| x as f32);
                assert!(corners.into_iter().all(|n| degrees_between(n, flat) < 1e-3), "{face}: {corners:?}");
            }
        }
    }

    #[test]
    fn a_tube_of_many_sides_is_round() {
        let mesh = shapes::cylinder(24, 3);
        let (surface, all) = (mesh.surface(), normals(&mesh, 35.0));
        for (face, corners) in all.into_iter().enumerate() {
            let flat = face_normal(&surface, face, 1.0).unwrap().map(|x| x as f32);
            for (v, n) in surface.triangles()[face].into_iter().zip(corners) {
                let [x, y, z] = surface.positions().get(v).map(|x| x as f32);
                let turn = degrees_between(n, flat);
                // Half the angle between two sides.
                assert!(turn < 7.6, "{turn} at {x} {y} {z}");
            }
        }
    }

    #[test]
    fn without_creases_corner_normals_are_vertex_normals() {
        for mesh in [shapes::cube(3), shapes::blob(3, 4), shapes::torus(20, 12)] {
            let of_vertex = super::super::normals::vertex_normals(&mesh.surface(), |v| v);
            for (vertices, corners) in mesh.surface().triangles().iter().zip(normals(&mesh, 180.0)) {
                for (v, n) in vertices.iter().zip(corners) {
                    assert!(degrees_between(of_vertex[v.index()], n) < 0.03);
                }
            }
        }
    }

    #[test]
    fn a_face_without_a_normal_joins_its_neighbours_and_does_not_round_an_edge() {
        // Two halves of a square with a sliver along their diagonal, and a wall at its right side with another.
        let places = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.5, 0.5, 0.0],
            [1.0, 0.5, 0.0],
            [1.0, 0.0, -1.0],
            [1.0, 1.0, -1.0],
        ];
        let faces = [[0, 1, 2], [0, 2, 4], [0, 4, 3], [4, 2, 3], [1, 5, 2], [1, 6, 5], [5, 6, 7], [5, 7, 2]];
        let mesh = TriMesh::new(
            crate::Positions::F64(places.to_vec()),
            faces.iter().map(|f| f.map(VertexId)).collect(),
        )
        .unwrap();
        let all = normals(&mesh, 35.0);
        for face in [0, 1, 2, 3] {
            assert!(all[face].iter().all(|n| degrees_between(*n, [0.0, 0.0, 1.0]) < 1e-3), "{face}");
        }
        for face in [5, 6, 7] {
            assert!(all[face].iter().all(|n| degrees_between(*n, [1.0, 0.0, 0.0]) < 1e-3), "{face}");
        }
    }

    #[test]
    fn extreme_input_has_finite_normals() {
        let triangle = |p: [[f64; 3]; 3]| {
            TriMesh::new(crate::Positions::F64(p.to_vec()), vec![[0, 1, 2].map(VertexId)]).unwrap()
        };
        for mesh in [
            triangle([[0.0; 3]; 3]),
            triangle([[f64::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
            triangle([[0.0; 3], [1e300, 0.0, 0.0], [0.0, 1e300, 0.0]]),
            triangle([[0.0; 3], [1e-300, 0.0, 0.0], [0.0, 1e-300, 0.0]]),
            TriMesh::new(crate::Positions::F64(Vec::new()), Vec::new()).unwrap(),
        ] {
            for n in normals(&mesh, 35.0).as_flattened() {
                assert!((degrees_between(*n, [0.0, 0.0, 1.0])) < 1e-3, "{n:?}");
            }
            assert!(!EdgeAngles::default().are_creased() && auto(&mesh).is_none());
        }
    }

    #[test]
    fn constructed_shapes_have_creases_and_organic_ones_have_none() {
        for mesh in [shapes::cube(1), shapes::cube(8), shapes::tetrahedron(), shapes::icosphere(0)] {
            assert_eq!(auto(&mesh), Some(CREASE_ANGLE_DEG));
            assert_eq!(auto(&soup(&mesh)), Some(CREASE_ANGLE_DEG));
        }
        for mesh in [
            shapes::icosphere(4),
            shapes::blob(4, 3),
            shapes::torus(60, 40),
            shapes::noisy_sphere(5, 0.02, 1),
        ] {
            assert_eq!(auto(&mesh), None);
        }
        let mut given = shapes::cube(2);
        given.set_normals(Some(vec![[0.0, 0.0, 1.0]; given.wedge_count()])).unwrap();
        assert_eq!(auto(&given), None);
        assert_eq!(Creases::Above(20.0).angle_deg([&given]), Some(20.0));
        // Only some edges of a large mesh are examined.
        assert_eq!(auto(&shapes::cube(160)), Some(CREASE_ANGLE_DEG));
    }

    #[test]
    fn split_wedges_have_the_normals_of_their_corners() {
        let mut mesh = shapes::cube(3);
        let uvs = (0..mesh.wedge_count()).map(|w| [w as f32, 0.5]).collect();
        mesh.set_uvs(Some(uvs)).unwrap();
        let split = split_at_creases(&mesh, 35.0).unwrap();
        assert_eq!(split.mesh.wedge_count(), mesh.wedge_count() + split.copies.len());
        // Vertices on edges of the cube have two normals, its corners three.
        let (corners, on_edges) = (8, 12 * 2);
        assert_eq!(split.copies.len(), 2 * corners + on_edges);
        let wanted = normals(&mesh, 35.0);
        for (face, wedges) in split.mesh.triangles().iter().enumerate() {
            assert_eq!(wedges.map(|w| split.normals[w.index()]), wanted[face]);
            let before = mesh.triangles()[face];
            assert_eq!(wedges.map(|w| split.mesh.vertex_of(w)), before.map(|w| mesh.vertex_of(w)));
            let uvs = split.mesh.uvs().unwrap();
            assert_eq!(wedges.map(|w| uvs[w.index()]), before.map(|w| mesh.uvs().unwrap()[w.index()]));
        }
        assert!(split_at_creases(&shapes::icosphere(3), 35.0).unwrap().copies.is_empty());
    }
}
