//! Defects of a mesh: counting them, and removing defects that engines cannot handle.

use crate::ids::{FaceId, VertexId};
use crate::mesh::weld::{Weld, weld, weld_within};
use crate::mesh::{PositionsView, Surface};

/// A face has no area if its doubled area is below this fraction of its squared longest edge.
///
/// Rounding of positions in double precision stays below it; no face of a real mesh comes near.
pub const ZERO_AREA: f64 = 1e-14;

/// Defects of a surface, counted after welding equal positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Defects {
    /// Faces that use a vertex twice.
    pub degenerate_face_count: usize,
    /// Faces without area (see [`ZERO_AREA`]), including the degenerate ones.
    pub zero_area_face_count: usize,
    /// Faces over the same three vertices as an earlier face with the same winding. Degenerate faces are not
    /// counted again here or below.
    pub same_winding_duplicate_count: usize,
    /// Faces over the same three vertices as earlier faces, all of which have the opposite winding.
    pub opposite_duplicate_count: usize,
    /// Faces with a non-finite vertex.
    pub non_finite_face_count: usize,
    /// Vertices with a non-finite coordinate, counted before welding.
    pub non_finite_vertex_count: usize,
    /// Vertices that no face uses, counted before welding.
    pub unused_vertex_count: usize,
}

impl Defects {
    /// Number of faces over the same three vertices as an earlier face, with either winding.
    pub fn duplicate_face_count(&self) -> usize {
        self.same_winding_duplicate_count + self.opposite_duplicate_count
    }
    /// True if there are no defects.
    pub fn is_clean(&self) -> bool {
        *self == Self::default()
    }
}

/// Counts the defects of a surface, after welding equal positions.
///
/// Cost: O(n); about 20 bytes per face.
pub fn defects(surface: &Surface<'_>) -> Defects {
    let positions = surface.positions();
    let welded = weld(positions);
    let mut found = Defects { non_finite_vertex_count: non_finite(positions).count(), ..Defects::default() };
    let mut used = vec![false; positions.len()];
    let mut triangles = Vec::with_capacity(surface.triangles().len());
    for t in surface.triangles() {
        t.iter().for_each(|v| used[v.index()] = true);
        let t = t.map(|v| welded.of(v));
        found.degenerate_face_count += usize::from(repeats(t));
        let p = t.map(|v| positions.get(v));
        if p.iter().flatten().all(|x| x.is_finite()) {
            found.zero_area_face_count += usize::from(repeats(t) || is_zero_area(p));
        } else {
            found.non_finite_face_count += 1;
            found.zero_area_face_count += usize::from(repeats(t));
        }
        if !repeats(t) {
            triangles.push(t);
        }
    }
    found.unused_vertex_count = used.iter().filter(|u| !**u).count();
    let duplicates = duplicates(&triangles, positions.len());
    found.same_winding_duplicate_count = duplicates.same_winding.len();
    found.opposite_duplicate_count = duplicates.opposite.len();
    found
}

/// True if a triangle has no area: twice its area is below [`ZERO_AREA`] of its squared longest edge, at any
/// scale.
///
/// False for a non-finite triangle.
pub fn is_zero_area(p: [[f64; 3]; 3]) -> bool {
    let to = |a: usize, b: usize| [0, 1, 2].map(|k| p[b][k] - p[a][k]);
    let edges = [to(0, 1), to(1, 2), to(2, 0)];
    let size = edges.iter().flatten().fold(0f64, |a, x| a.max(x.abs()));
    if size == 0.0 {
        return p.iter().flatten().all(|x| x.is_finite());
    }
    // Divided first, so that squares neither underflow nor overflow.
    let [a, b, c] = edges.map(|e| e.map(|x| x / size));
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    dot(n, n).sqrt() < ZERO_AREA * dot(a, a).max(dot(b, b)).max(dot(c, c))
}

/// Faces that repeat earlier ones, in order of the face.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Duplicates {
    /// An earlier face has the same vertices and the same winding.
    pub same_winding: Vec<FaceId>,
    /// Earlier faces have the same vertices, all with the opposite winding.
    pub opposite: Vec<FaceId>,
}

/// Finds faces over the same three vertices, whichever corner they start with.
///
/// `vertex_count` is more than any index in `triangles`. The lowest face of a group is never among the
/// duplicates. Cost: O(n log k), where k is the number of faces at a vertex; four bytes per face and four per
/// vertex.
///
/// # Panics
/// If a triangle refers to a vertex beyond `vertex_count`.
pub fn duplicates(triangles: &[[VertexId; 3]], vertex_count: usize) -> Duplicates {
    let mut found = Duplicates::default();
    // Faces by their lowest vertex: equal faces fall into the same bucket, and buckets are small.
    let mut start = vec![0u32; vertex_count + 1];
    for t in triangles {
        start[least(*t).index()] += 1;
    }
    let mut sum = 0;
    for s in &mut start {
        sum += *s;
        *s = sum;
    }
    let mut faces = vec![0u32; triangles.len()];
    for (face, t) in triangles.iter().enumerate().rev() {
        let slot = &mut start[least(*t).index()];
        *slot -= 1;
        faces[*slot as usize] = face as u32;
    }
    let mut sorted = Vec::new();
    for bucket in start.windows(2).map(|w| &faces[w[0] as usize..w[1] as usize]) {
        if bucket.len() < 2 {
            continue;
        }
        sorted.clear();
        sorted.extend(bucket.iter().map(|&f| {
            let [_, b, c] = turned_to_least(triangles[f as usize]);
            (b.min(c), b.max(c), f, b <= c)
        }));
        sorted.sort_unstable();
        for group in sorted.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|g| g.len() > 1) {
            let mut seen = [false; 2];
            for &(_, _, face, is_forward) in group {
                if seen[usize::from(is_forward)] {
                    found.same_winding.push(FaceId(face));
                } else if seen[usize::from(!is_forward)] {
                    found.opposite.push(FaceId(face));
                }
                seen[usize::from(is_forward)] = true;
            }
        }
    }
    found.same_winding.sort_unstable();
    found.opposite.sort_unstable();
    found
}

/// A surface that engines can work on, and the counts of what was dropped.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct CleanSurface {
    /// The remaining faces, in their order, over vertices that represent themselves in `weld`; each starts
    /// with the same corner as in the source.
    pub triangles: Vec<[VertexId; 3]>,
    /// The weld. It uses the numbers of the source positions: nothing is moved.
    pub weld: Weld,
    /// Number of vertices that the faces use.
    pub vertex_count: usize,
    /// Faces dropped because they use a vertex twice after welding.
    pub degenerate_count: usize,
    /// Faces dropped because an earlier one has the same vertices and winding.
    pub duplicate_count: usize,
    /// Faces dropped because of a non-finite vertex.
    pub non_finite_count: usize,
}

impl CleanSurface {
    /// Number of faces that were dropped.
    pub fn dropped_face_count(&self) -> usize {
        self.degenerate_count + self.duplicate_count + self.non_finite_count
    }
}

/// Welds a surface and drops faces that are degenerate, non-finite, or duplicates with the same winding.
///
/// Vertices are welded if their positions are equal, or within `weld_distance` in the units of the positions.
/// Faces without area stay: dropping them would open the surface. Duplicates with opposite winding stay too:
/// they are the two sides of a sheet. Cost: O(n); about 20 bytes per face at the peak, 14 of them in the
/// result; 30 for a soup that shares no vertex.
pub fn clean_surface(surface: &Surface<'_>, weld_distance: Option<f64>) -> CleanSurface {
    let positions = surface.positions();
    let weld = match weld_distance {
        Some(distance) => weld_within(positions, distance),
        None => weld(positions),
    };
    let mut is_bad = Vec::new();
    for v in non_finite(positions) {
        is_bad.resize(positions.len(), false);
        is_bad[v.index()] = true;
    }
    let mut degenerate_count = 0;
    let mut non_finite_count = 0;
    let mut triangles = Vec::with_capacity(surface.triangles().len());
    for t in surface.triangles() {
        let t = t.map(|v| weld.of(v));
        if !is_bad.is_empty() && t.iter().any(|v| is_bad[v.index()]) {
            non_finite_count += 1;
        } else if repeats(t) {
            degenerate_count += 1;
        } else {
            triangles.push(t);
        }
    }
    let twice = duplicates(&triangles, positions.len()).same_winding;
    if !twice.is_empty() {
        let mut skip = twice.iter().peekable();
        let mut face = 0;
        triangles.retain(|_| {
            let own = FaceId(face);
            face += 1;
            skip.next_if_eq(&&own).is_none()
        });
    }
    let mut used = vec![false; positions.len()];
    for v in triangles.iter().flatten() {
        used[v.index()] = true;
    }
    CleanSurface {
        vertex_count: used.iter().filter(|u| **u).count(),
        triangles,
        weld,
        degenerate_count,
        duplicate_count: twice.len(),
        non_finite_count,
    }
}

/// Returns the vertices with a non-finite coordinate, in order.
fn non_finite(positions: PositionsView<'_>) -> impl Iterator<Item = VertexId> + '_ {
    (0..positions.len() as u32)
        .map(VertexId)
        .filter(move |&v| positions.get(v).iter().any(|x| !x.is_finite()))
}

/// True if a triangle uses a vertex twice.
#[inline]
pub(crate) fn repeats(t: [VertexId; 3]) -> bool {
    t[0] == t[1] || t[1] == t[2] || t[2] == t[0]
}

fn least(t: [VertexId; 3]) -> VertexId {
    t[0].min(t[1]).min(t[2])
}

/// Returns the rotation of a triangle that starts with its lowest vertex.
fn turned_to_least([a, b, c]: [VertexId; 3]) -> [VertexId; 3] {
    [a, b, c].min([b, c, a]).min([c, a, b])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(list: &[[u32; 3]]) -> Vec<[VertexId; 3]> {
        list.iter().map(|t| t.map(VertexId)).collect()
    }

    #[test]
    fn all_defects_are_counted() {
        let p = [
            [0.0, 0.0, 0.0f32],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0],
            [f32::NAN, 0.0, 0.0],
            [5.0, 5.0, 5.0],
            [2.0, 0.0, 0.0],
        ];
        let list = triangles(&[
            [0, 1, 2], // good
            [1, 2, 3], // duplicate after welding, with another first corner
            [0, 2, 1], // opposite winding
            [0, 3, 1], // degenerate once welded
            [0, 1, 4], // NaN
            [0, 1, 6], // no area
        ]);
        let surface = Surface::new(PositionsView::F32(&p), &list).unwrap();
        let got = defects(&surface);
        let want = Defects {
            degenerate_face_count: 1,
            zero_area_face_count: 2,
            same_winding_duplicate_count: 1,
            opposite_duplicate_count: 1,
            non_finite_face_count: 1,
            non_finite_vertex_count: 1,
            unused_vertex_count: 1,
        };
        assert_eq!(got, want);
        assert_eq!(got.duplicate_face_count(), 2);
        let cleaned = clean_surface(&surface, None);
        assert_eq!(cleaned.triangles, triangles(&[[0, 1, 2], [0, 2, 1], [0, 1, 6]]));
        assert_eq!((cleaned.degenerate_count, cleaned.duplicate_count, cleaned.non_finite_count), (1, 1, 1));
        assert_eq!((cleaned.vertex_count, cleaned.weld.merged_count()), (4, 1));
        assert_eq!(cleaned.dropped_face_count(), 3);
    }

    #[test]
    fn nothing_happens_to_a_clean_surface() {
        let p = [[0.0, 0.0, 0.0f64], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let list = triangles(&[[0, 2, 1], [3, 0, 1], [1, 2, 3], [2, 0, 3]]);
        let surface = Surface::new(PositionsView::F64(&p), &list).unwrap();
        assert!(defects(&surface).is_clean());
        let cleaned = clean_surface(&surface, Some(0.1));
        assert_eq!((cleaned.triangles, cleaned.vertex_count), (list, 4));
    }

    #[test]
    fn zero_area_is_the_same_at_any_scale() {
        for scale in [1e-200, 1e-15, 1.0, 1e15, 1e200] {
            let p = |y: f64| [[0.0; 3], [scale, 0.0, 0.0], [scale * 0.5, scale * y, 0.0]];
            assert!(is_zero_area(p(1e-15)));
            assert!(!is_zero_area(p(1e-13)));
        }
        assert!(is_zero_area([[3.0; 3]; 3]));
        assert!(!is_zero_area([[f64::NAN; 3]; 3]));
    }
}
