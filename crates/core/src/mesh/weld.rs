//! Welding: vertices at the same position become one.

use crate::ids::{VertexId, WedgeId};
use crate::mesh::{Attribute, Positions, PositionsView, TriMesh};

/// Representative of each vertex: the result of [`weld`] and [`weld_within`].
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Weld {
    /// The representative of each vertex: the lowest vertex of its group, never a higher number than its own,
    /// and its own representative.
    pub representative: Vec<VertexId>,
    /// Number of vertices that represent themselves: the distinct positions.
    pub distinct_count: usize,
}

impl Weld {
    /// Makes a weld from representatives that were found elsewhere.
    ///
    /// # Panics
    /// If a representative has a higher number than its vertex, or does not represent itself.
    pub fn from_representatives(representative: Vec<VertexId>) -> Self {
        let is_valid = |(i, r): (usize, &VertexId)| r.index() <= i && representative[r.index()] == *r;
        assert!(
            representative.iter().enumerate().all(is_valid),
            "the lowest vertex of a group represents it"
        );
        let distinct_count = representative.iter().enumerate().filter(|(i, r)| r.index() == *i).count();
        Self { representative, distinct_count }
    }
    /// Number of vertices that were merged into another.
    pub fn merged_count(&self) -> usize {
        self.representative.len() - self.distinct_count
    }
    /// True if every vertex represents itself.
    pub fn is_identity(&self) -> bool {
        self.merged_count() == 0
    }
    /// The representative of `vertex`.
    ///
    /// # Panics
    /// If there is no such vertex.
    #[inline]
    pub fn of(&self, vertex: VertexId) -> VertexId {
        self.representative[vertex.index()]
    }
}

/// Finds vertices of exactly equal position.
///
/// Positions are equal if their bits are, except that -0.0 equals 0.0; so two NaN are equal only if they are
/// the same NaN. Representatives are the lowest index of their group. Cost: O(n); six bytes per vertex
/// besides the result.
pub fn weld(positions: PositionsView<'_>) -> Weld {
    let (first, distinct_count) = match positions {
        PositionsView::F32(p) => {
            first_equal(p.len(), |i| hash(p[i].map(|x| u64::from(bits32(x)))), |a, b| same32(&p[a], &p[b]))
        }
        PositionsView::F64(p) => {
            first_equal(p.len(), |i| hash(p[i].map(bits64)), |a, b| same64(&p[a], &p[b]))
        }
    };
    Weld { representative: bytemuck::allocation::cast_vec(first), distinct_count }
}

/// Finds vertices closer than `distance`, in the units of the positions.
///
/// Vertices are processed in order of their index: each joins the lowest representative within `distance`
/// (inclusive), or becomes one itself. So chains of short steps do not pull distant vertices together: every
/// vertex lies within `distance` of its representative, and no two representatives are that close. The
/// drawback is that two vertices closer than `distance` may have different representatives. Non-finite
/// vertices join only exact equals. If the distance is zero, negative or NaN, this is [`weld`]. Cost: O(n)
/// for distances up to the spacing of the vertices.
pub fn weld_within(positions: PositionsView<'_>, distance: f64) -> Weld {
    let mut result = weld(positions);
    if distance.is_nan() || distance <= 0.0 {
        return result;
    }
    // Four times the distance: a ball then overlaps 3.4 cells on average, and a cell holds few
    // representatives.
    let cell = distance * 4.0;
    let mut near = CellTable::new(result.distinct_count);
    let mut distinct_count = 0;
    for i in 0..positions.len() {
        let own = VertexId(i as u32);
        let exact = result.representative[i];
        if exact != own {
            // An exactly equal vertex was processed earlier.
            result.representative[i] = result.representative[exact.index()];
            continue;
        }
        let p = positions.get(own);
        if p.iter().any(|x| !x.is_finite()) {
            distinct_count += 1;
            continue;
        }
        let mut best = NONE;
        let low = p.map(|x| cell_key(x - distance, cell));
        let high = p.map(|x| cell_key(x + distance, cell));
        let ends = |k: usize| if low[k] == high[k] { 1 } else { 2 };
        for x in &[low[0], high[0]][..ends(0)] {
            for y in &[low[1], high[1]][..ends(1)] {
                for z in &[low[2], high[2]][..ends(2)] {
                    near.each(hash([*x, *y, *z]), |other| {
                        if other < best && is_within(p, positions.get(VertexId(other)), distance) {
                            best = other;
                        }
                    });
                }
            }
        }
        if best == NONE {
            near.push(hash(p.map(|x| cell_key(x, cell))), own.0);
            distinct_count += 1;
        } else {
            result.representative[i] = VertexId(best);
        }
    }
    result.distinct_count = distinct_count;
    result
}

/// A mesh whose vertices have been welded, and the numbers of merged elements.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WeldedMesh {
    /// The mesh, with all triangles of the source in the same order.
    pub mesh: TriMesh,
    /// Number of vertices that were merged into another.
    pub merged_vertex_count: usize,
    /// Number of wedges that were merged into another.
    pub merged_wedge_count: usize,
}

/// Welds the vertices of a mesh: exactly, or within a distance in the units of the positions.
///
/// Wedges stay apart unless they are at the same vertex and all their attributes are equal, so seams survive.
/// Vertices and wedges keep their order; unused ones stay (see [`compact`](crate::mesh::compact)). Cost:
/// O(n).
pub fn weld_mesh(mesh: &TriMesh, distance: Option<f64>) -> WeldedMesh {
    let view = mesh.positions.view();
    let welded = match distance {
        Some(d) => weld_within(view, d),
        None => weld(view),
    };
    weld_mesh_by(mesh, &welded)
}

/// Welds the vertices of a mesh by a given weld; a vertex moves to the position of its representative.
///
/// # Panics
/// If the weld is for a different number of vertices.
pub fn weld_mesh_by(mesh: &TriMesh, welded: &Weld) -> WeldedMesh {
    assert_eq!(welded.representative.len(), mesh.vertex_count(), "a weld has one entry per vertex");
    let vertex = |w: usize| welded.of(mesh.vertex_of(WedgeId(w as u32)));
    let (first_wedge, wedge_count) = if mesh.has_attributes() {
        let attributes = |w: usize| {
            let normal = mesh.normals().map_or([0; 3], |n| n[w].map(bits32));
            let uv = mesh.uvs().map_or([0; 2], |t| t[w].map(bits32));
            let color = mesh.colors().map_or([0; 4], |c| c[w].map(bits32));
            (normal, uv, color)
        };
        let hash_of = |w: usize| {
            let (n, t, c) = attributes(w);
            let pair = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
            let head = hash([u64::from(vertex(w).0), pair(n[0], n[1]), pair(n[2], t[0])]);
            hash([head, pair(t[1], c[0]), pair(c[1], c[2]) ^ u64::from(c[3]).rotate_left(17)])
        };
        let bits =
            |a: &Attribute, w: usize| a.of(WedgeId(w as u32)).iter().map(|x| bits32(*x)).collect::<Vec<_>>();
        let further = |a: usize, b: usize| mesh.further.iter().all(|x| bits(x, a) == bits(x, b));
        let equal =
            |a: usize, b: usize| vertex(a) == vertex(b) && attributes(a) == attributes(b) && further(a, b);
        first_equal(mesh.wedge_count(), hash_of, equal)
    } else {
        // Without attributes one wedge per vertex is enough.
        let hash_of = |w: usize| hash([u64::from(vertex(w).0), 0, 0]);
        first_equal(mesh.wedge_count(), hash_of, |a, b| vertex(a) == vertex(b))
    };

    let vertex_number = numbers(bytemuck::cast_slice(&welded.representative));
    let wedge_number = numbers(&first_wedge);
    let stays = |i: usize| welded.representative[i].index() == i;
    let wedge_stays = |w: usize| first_wedge[w] as usize == w;
    let vertex_of: Vec<VertexId> = (0..mesh.wedge_count())
        .filter(|&w| wedge_stays(w))
        .map(|w| VertexId(vertex_number[vertex(w).index()]))
        .collect();
    let is_plain =
        vertex_of.len() == welded.distinct_count && vertex_of.iter().enumerate().all(|(w, v)| v.index() == w);
    let vertex_of = (!is_plain).then_some(vertex_of);
    let result = renumbered(mesh, stays, wedge_stays, &wedge_number, vertex_of);
    WeldedMesh {
        merged_vertex_count: welded.merged_count(),
        merged_wedge_count: mesh.wedge_count() - wedge_count,
        mesh: result,
    }
}

/// Returns the mesh with some of its vertices and wedges, in order. `wedge_number` is the new number of each
/// wedge that a triangle uses, `vertex_of` the new map from wedges to vertices.
pub(crate) fn renumbered(
    mesh: &TriMesh,
    keeps_vertex: impl Fn(usize) -> bool,
    keeps_wedge: impl Fn(usize) -> bool,
    wedge_number: &[u32],
    vertex_of: Option<Vec<VertexId>>,
) -> TriMesh {
    TriMesh {
        triangles: mesh.triangles.iter().map(|t| t.map(|w| WedgeId(wedge_number[w.index()]))).collect(),
        vertex_of,
        positions: match &mesh.positions {
            Positions::F32(p) => Positions::F32(kept(p, keeps_vertex)),
            Positions::F64(p) => Positions::F64(kept(p, keeps_vertex)),
        },
        normals: mesh.normals.as_deref().map(|n| kept(n, &keeps_wedge)),
        uvs: mesh.uvs.as_deref().map(|t| kept(t, &keeps_wedge)),
        colors: mesh.colors.as_deref().map(|c| kept(c, &keeps_wedge)),
        further: mesh
            .further
            .iter()
            .map(|a| Attribute { values: kept(&a.values, |i| keeps_wedge(i / a.width)), ..a.clone() })
            .collect(),
        regions: mesh.regions.clone(),
    }
}

/// Returns the entries of a buffer whose index is kept, in order.
pub(crate) fn kept<T: Copy>(buffer: &[T], stays: impl Fn(usize) -> bool) -> Vec<T> {
    buffer.iter().enumerate().filter(|(i, _)| stays(*i)).map(|(_, &x)| x).collect()
}

/// Converts a map to representatives into new numbers: representatives are numbered from zero in order.
fn numbers(first: &[u32]) -> Vec<u32> {
    let mut number = vec![0; first.len()];
    let mut next = 0;
    for (i, &f) in first.iter().enumerate() {
        if f as usize == i {
            number[i] = next;
            next += 1;
        } else {
            // Representatives have lower indices, so their number is known.
            number[i] = number[f as usize];
        }
    }
    number
}

/// Marks an empty slot; meshes have fewer elements.
const NONE: u32 = u32::MAX;

/// Number of elements that are looked up together. Guessed: enough loads in flight to hide the memory
/// latency, few enough to stay in the L1 cache.
const PREFETCH_BLOCK: usize = 64;

/// Finds the first equal element for each of `count` elements, and the number of distinct ones.
///
/// An open-addressing table of indices with linear probing; the hashes of a block are computed and their
/// slots prefetched before any is used, so that the cache misses of a block overlap.
pub(crate) fn first_equal(
    count: usize,
    hash_of: impl Fn(usize) -> u64,
    equal: impl Fn(usize, usize) -> bool,
) -> (Vec<u32>, usize) {
    // Load factor 2/3 if all differ; a power of two could take twice the memory.
    let slots = count + count / 2 + 1;
    let slot_of = |hash: u64| ((u128::from(hash) * slots as u128) >> 64) as usize;
    let mut table = vec![NONE; slots];
    let mut first = Vec::with_capacity(count);
    let mut distinct = 0;
    let mut start = [0usize; PREFETCH_BLOCK];
    let mut block = 0;
    while block < count {
        let size = PREFETCH_BLOCK.min(count - block);
        let mut touched = 0;
        for (k, slot) in start[..size].iter_mut().enumerate() {
            *slot = slot_of(hash_of(block + k));
            touched ^= table[*slot];
        }
        // Keeps the compiler from removing the loads above.
        std::hint::black_box(touched);
        for (k, &slot) in start[..size].iter().enumerate() {
            let own = block + k;
            let mut slot = slot;
            let found = loop {
                let there = table[slot];
                if there == NONE {
                    table[slot] = own as u32;
                    distinct += 1;
                    break own as u32;
                }
                if equal(there as usize, own) {
                    break there;
                }
                slot = if slot + 1 == slots { 0 } else { slot + 1 };
            };
            first.push(found);
        }
        block += size;
    }
    (first, distinct)
}

/// Mixes three words into one with well-mixed high bits.
#[inline]
pub(crate) fn hash(words: [u64; 3]) -> u64 {
    // Arbitrary odd constants (digits of the square roots of 2, 3 and 5, the last of the golden ratio);
    // folding the 128-bit product spreads every bit of its factors.
    let fold = |a: u64, b: u64| {
        let product = u128::from(a) * u128::from(b);
        (product >> 64) as u64 ^ product as u64
    };
    let ab = fold(words[0] ^ 0x6A09_E667_F3BC_C909, words[1] ^ 0xBB67_AE85_84CA_A73B);
    fold(ab ^ words[2].rotate_left(32) ^ 0x3C6E_F372_FE94_F82B, 0x9E37_79B9_7F4A_7C15)
}

/// The bits of a number; -0.0 as 0.0.
#[inline]
fn bits32(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits == 1 << 31 { 0 } else { bits }
}

/// The bits of a number; -0.0 as 0.0.
#[inline]
fn bits64(x: f64) -> u64 {
    let bits = x.to_bits();
    if bits == 1 << 63 { 0 } else { bits }
}

#[inline]
fn same32(a: &[f32; 3], b: &[f32; 3]) -> bool {
    (0..3).all(|k| bits32(a[k]) == bits32(b[k]))
}

#[inline]
fn same64(a: &[f64; 3], b: &[f64; 3]) -> bool {
    (0..3).all(|k| bits64(a[k]) == bits64(b[k]))
}

/// Returns the key of the cell that contains a coordinate.
///
/// If cells are finer than the resolution of the numbers, each number is its own cell: then only equal
/// coordinates lie within a distance, and a cell index would overflow.
#[inline]
fn cell_key(x: f64, cell: f64) -> u64 {
    // From 2^53 on a double has no fraction.
    const LIMIT: f64 = (1u64 << 53) as f64;
    let t = x / cell;
    if t.abs() < LIMIT { bits64(t.floor()) } else { bits64(x) }
}

fn is_within(p: [f64; 3], q: [f64; 3], distance: f64) -> bool {
    // Divided first, so that squares neither underflow nor overflow.
    let d = [0, 1, 2].map(|k| (p[k] - q[k]) / distance);
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= 1.0
}

/// Hash table from cells to linked lists of vertices.
struct CellTable {
    head: Vec<u32>,
    /// The vertex and the index of the next entry of the same list.
    entries: Vec<[u32; 2]>,
    shift: u32,
}

impl CellTable {
    fn new(count: usize) -> Self {
        let slots = count.max(1).next_power_of_two().max(2);
        Self { head: vec![NONE; slots], entries: Vec::new(), shift: 64 - slots.trailing_zeros() }
    }
    fn push(&mut self, hash: u64, vertex: u32) {
        let head = &mut self.head[(hash >> self.shift) as usize];
        self.entries.push([vertex, *head]);
        *head = (self.entries.len() - 1) as u32;
    }
    fn each(&self, hash: u64, mut visit: impl FnMut(u32)) {
        let mut at = self.head[(hash >> self.shift) as usize];
        while at != NONE {
            let [vertex, next] = self.entries[at as usize];
            visit(vertex);
            at = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids(list: &[u32]) -> Vec<VertexId> {
        list.iter().map(|&i| VertexId(i)).collect()
    }

    #[test]
    fn zeros_are_equal_and_nans_only_to_themselves() {
        let quiet = f32::from_bits(0x7FC0_0000);
        let other = f32::from_bits(0x7FC0_0001);
        let p = [[0.0, 1.0, 2.0], [-0.0, 1.0, 2.0], [quiet, 0.0, 0.0], [other, 0.0, 0.0], [quiet, -0.0, 0.0]];
        let got = weld(PositionsView::F32(&p));
        assert_eq!(got.representative, ids(&[0, 0, 2, 3, 2]));
        assert_eq!(got.distinct_count, 3);
    }

    #[test]
    fn nothing_happens_to_distinct_vertices() {
        let p: Vec<[f64; 3]> = (0..1000).map(|i| [f64::from(i), 0.5, -f64::from(i)]).collect();
        let got = weld(PositionsView::F64(&p));
        assert!(got.is_identity());
        assert!(weld(PositionsView::F64(&[])).is_identity());
    }

    #[test]
    fn a_tolerance_makes_no_chains() {
        // 0 ·····1·····2·····3: each 0.6 from its neighbour. 1 joins 0; 2 is too far from 0, so it stays; 3 joins 2.
        let p: Vec<[f32; 3]> = (0..4).map(|i| [0.6 * i as f32, 0.0, 0.0]).collect();
        let got = weld_within(PositionsView::F32(&p), 1.0);
        assert_eq!(got.representative, ids(&[0, 0, 2, 2]));
        assert_eq!(got.distinct_count, 2);
    }

    #[test]
    fn a_tolerance_works_at_any_scale() {
        for scale in [1e-30, 1e-6, 1.0, 1e15, 1e30, 1e200] {
            let p = [[scale, 0.0, 0.0], [scale * (1.0 + 1e-9), 0.0, 0.0], [scale * 1.1, 0.0, 0.0]];
            let got = weld_within(PositionsView::F64(&p), scale * 1e-6);
            assert_eq!(got.representative, ids(&[0, 0, 2]), "{scale}");
            let got = weld_within(PositionsView::F64(&p), f64::MIN_POSITIVE);
            assert!(got.is_identity() || scale < 1e-29, "{scale}");
        }
        let p = [[f64::INFINITY, 0.0, 0.0], [f64::NAN, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0]];
        assert_eq!(weld_within(PositionsView::F64(&p), 1.0).representative, ids(&[0, 1, 0]));
    }

    #[test]
    fn wedges_stay_unless_all_attributes_are_equal() {
        // Two triangles with three vertices of their own each meet along an edge: at one end the texture
        // coordinates are equal.
        let p = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0f32]];
        let p = vec![p[0], p[1], p[2], p[1], p[0], [0.0, -1.0, 0.0]];
        let t = vec![[VertexId(0), VertexId(1), VertexId(2)], [VertexId(4), VertexId(5), VertexId(3)]];
        let mut mesh = TriMesh::new(Positions::F32(p), t).unwrap();
        let uvs = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.5, 0.5], [0.0, 0.0]];
        mesh.set_uvs(Some(uvs)).unwrap();
        let got = weld_mesh(&mesh, None);
        assert_eq!((got.merged_vertex_count, got.merged_wedge_count), (2, 1));
        assert_eq!((got.mesh.vertex_count(), got.mesh.wedge_count()), (4, 5));
        assert_eq!(got.mesh.vertex_map(), Some(&ids(&[0, 1, 2, 0, 3])[..]));
        assert_eq!(got.mesh.triangles()[1], [WedgeId(3), WedgeId(4), WedgeId(1)]);
        mesh.set_uvs(None).unwrap();
        let got = weld_mesh(&mesh, Some(1e-3));
        assert_eq!((got.mesh.vertex_count(), got.mesh.wedge_count()), (4, 4));
        assert_eq!(got.mesh.vertex_map(), None);
    }
}
