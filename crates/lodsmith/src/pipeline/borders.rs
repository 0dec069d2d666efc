//! Borders whose two sides differ only by rounding, such as a texture seam computed from both ends: their
//! vertices are merged.

use glam::DVec3;
use lodsmith_core::mesh::weld::{Weld, weld, weld_within};
use lodsmith_core::{Positions, PositionsView, Surface, VertexId};

/// Distance within which two coordinates are equal up to rounding, as a share of the largest: 2^-22, which is two
/// to four steps of single precision. (A cylinder whose seam is at the sines of 0 and of 2 π in single precision is
/// open by 1.5 steps, and products and sums add half a step each.)
pub(crate) const ROUNDING_SHARE: f64 = 1.0 / 4_194_304.0;
/// Border vertices are joined only if all border edges at them are longer than this many times the distance.
/// (Guessed: shorter edges are detail of the size of the rounding, and the two ends of one edge must not be
/// merged.)
pub(crate) const MIN_EDGE_RATIO: f64 = 4.0;

/// A vertex at which an edge with a single face ends.
#[derive(Clone, Copy)]
pub(crate) struct BorderVertex {
    /// The first vertex at its position.
    pub(crate) vertex: VertexId,
    /// Length of the shortest border edge at it.
    pub(crate) shortest_edge: f64,
}

/// Returns the distance within which positions are equal up to rounding: [`ROUNDING_SHARE`] of the largest
/// coordinate, or in double precision of the extent, since that is the precision of a run.
pub(crate) fn rounding(positions: PositionsView<'_>) -> f64 {
    let Some(bounds) = positions.bounds() else { return 0.0 };
    let largest = match positions {
        PositionsView::F32(_) => bounds.min.iter().chain(&bounds.max).fold(0f64, |most, x| most.max(x.abs())),
        PositionsView::F64(_) => (0..3).fold(0f64, |most, k| most.max(bounds.max[k] - bounds.min[k])),
    };
    largest * ROUNDING_SHARE
}

/// Returns the weld of the border vertices of a surface whose positions are equal up to [`rounding`], each
/// onto the first of them; `None` if there are none. Cost: O(n); for a surface that is closed by its indices,
/// one pass over the faces.
pub(crate) fn joined(surface: &Surface<'_>) -> Option<Weld> {
    unbalanced(surface, |v| v)?;
    let positions = surface.positions();
    let same = weld(positions);
    let distance = rounding(positions);
    let mut border = border_vertices(surface, &same);
    border.retain(|b| b.shortest_edge > MIN_EDGE_RATIO * distance);
    let places = border.iter().map(|b| positions.get(b.vertex)).collect();
    let near = weld_within(Positions::F64(places).view(), distance);
    if near.is_identity() {
        return None;
    }
    let mut to: Vec<VertexId> = (0..positions.len()).map(VertexId::new).collect();
    for (i, b) in border.iter().enumerate() {
        to[b.vertex.index()] = border[near.of(VertexId::new(i)).index()].vertex;
    }
    for v in 0..to.len() {
        let first = same.of(VertexId::new(v));
        if to[first.index()] != first {
            to[v] = to[first.index()];
        }
    }
    Some(Weld::from_representatives(to))
}

/// Returns the border vertices of a surface, equal positions joined, in order. Cost: O(n); for a surface that
/// is closed by its indices, one pass over the faces.
pub(crate) fn of(surface: &Surface<'_>) -> Vec<BorderVertex> {
    match unbalanced(surface, |v| v) {
        Some(_) => border_vertices(surface, &weld(surface.positions())),
        None => Vec::new(),
    }
}

/// Returns the border vertices of a surface whose equal positions `same` joins, in order.
fn border_vertices(surface: &Surface<'_>, same: &Weld) -> Vec<BorderVertex> {
    let Some(is_unbalanced) = unbalanced(surface, |v| same.of(v)) else { return Vec::new() };
    let mut edges: Vec<[VertexId; 2]> = Vec::new();
    for t in surface.triangles() {
        let t = t.map(|v| same.of(v));
        for [a, b] in sides(t) {
            if is_unbalanced[a.index()] && is_unbalanced[b.index()] {
                edges.push([a.min(b), a.max(b)]);
            }
        }
    }
    edges.sort_unstable();
    let positions = surface.positions();
    let mut ends: Vec<(VertexId, f64)> = Vec::new();
    for edge in edges.chunk_by(|a, b| a == b).filter(|edge| edge.len() == 1) {
        let [a, b] = edge[0];
        let [p, q] = [a, b].map(|v| DVec3::from(positions.get(v)));
        ends.extend([(a, p.distance(q)), (b, p.distance(q))]);
    }
    ends.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let of_vertex = ends.chunk_by(|a, b| a.0 == b.0);
    of_vertex.map(|of| BorderVertex { vertex: of[0].0, shortest_edge: of[0].1 }).collect()
}

/// Returns the vertices that are not entered as often as they are left by the edges to each of their neighbours: all
/// border vertices, and some others if windings differ. `None` if there are none.
fn unbalanced(surface: &Surface<'_>, of: impl Fn(VertexId) -> VertexId) -> Option<Vec<bool>> {
    let mut sums = vec![0u64; surface.positions().len()];
    for t in surface.triangles() {
        for [a, b] in sides(t.map(&of)) {
            sums[a.index()] = sums[a.index()].wrapping_add(mixed(b));
            sums[b.index()] = sums[b.index()].wrapping_sub(mixed(a));
        }
    }
    sums.iter().any(|sum| *sum != 0).then(|| sums.iter().map(|sum| *sum != 0).collect())
}

/// Mixes the bits of a number, so that sums of different ones differ. (The finaliser of SplitMix64.)
fn mixed(v: VertexId) -> u64 {
    let x = (u64::from(v.0) + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

/// Returns the edges of a face; none if it uses a vertex twice.
fn sides([a, b, c]: [VertexId; 3]) -> impl Iterator<Item = [VertexId; 2]> {
    let is_face = a != b && b != c && c != a;
    [[a, b], [b, c], [c, a]].into_iter().filter(move |_| is_face)
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{TriMesh, shapes};

    use super::*;

    /// A tube around the z axis that is closed only up to rounding: its first and last columns are a step
    /// apart.
    fn tube() -> TriMesh {
        let mut positions = Vec::new();
        for column in 0..=12u32 {
            let angle = column as f32 / 12.0 * std::f32::consts::TAU;
            positions.extend((0..3u32).map(|row| [angle.cos(), angle.sin(), row as f32]));
        }
        let v = |column: u32, row: u32| VertexId(3 * column + row);
        let quads = (0..12).flat_map(|c| [(c, 0), (c, 1)]);
        let faces = quads.flat_map(|(c, r)| {
            [[v(c, r), v(c + 1, r), v(c + 1, r + 1)], [v(c, r), v(c + 1, r + 1), v(c, r + 1)]]
        });
        TriMesh::new(Positions::F32(positions), faces.collect()).expect("a tube")
    }

    #[test]
    fn two_sides_of_a_seam_are_joined() {
        let mesh = tube();
        let joined = joined(&mesh.surface()).expect("its ends differ by rounding");
        assert_eq!(joined.merged_count(), 3);
        assert_eq!([36, 37, 38].map(|v| joined.of(VertexId(v)).0), [0, 1, 2]);
    }

    #[test]
    fn vertices_apart_by_more_than_rounding_stay_apart() {
        let mut mesh = tube();
        // The largest coordinate is 2: its rounding is .5e-6.
        mesh.map_positions(|p| {
            if p[1].abs() < 1e-3 && p[0] > 0.0 && p[1] != 0.0 { [1.000_001, 0.0, p[2]] } else { p }
        });
        assert!(joined(&mesh.surface()).is_none());
        for closed in [shapes::cube(3), shapes::icosphere(2), shapes::hourglass(), shapes::book(3)] {
            assert!(joined(&closed.surface()).is_none());
        }
    }

    #[test]
    fn detail_of_the_size_of_rounding_is_kept() {
        // A strip in single precision, far from the origin, whose border edges are three steps long.
        let step = 0.0625f32;
        let positions: Vec<[f32; 3]> =
            (0..10u32).map(|i| [1e6 + (i / 2) as f32 * 3.0 * step, (i % 2) as f32 * step, 0.0]).collect();
        let faces = (0..8).map(|i| [0, 1, 2].map(|k| VertexId(i + k))).collect();
        let mesh = TriMesh::new(Positions::F32(positions), faces).expect("a strip");
        assert!(joined(&mesh.surface()).is_none());
    }

    #[test]
    fn border_vertices_are_the_ends_of_edges_with_one_face() {
        for (mesh, wanted) in [(shapes::grid(4), 16), (shapes::cube(3), 0), (shapes::tetrahedron(), 0)] {
            let surface = mesh.surface();
            assert_eq!(border_vertices(&surface, &weld(surface.positions())).len(), wanted);
        }
    }
}
