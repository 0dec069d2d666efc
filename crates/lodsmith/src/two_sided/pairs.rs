//! Finding pairs of faces on the same three positions with opposite windings, and the side of each that is
//! the front.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use glam::Vec3;
use lodsmith_core::{Surface, VertexId};

use crate::chunks;
use crate::collapse::order::Ordered;

/// Faces with a back: a triangle, or two triangles that make a quad whose back is cut along the other diagonal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FacePair {
    /// Faces of the input: of the front and of the back. For a triangle, the same face twice.
    sides: [[u32; 2]; 2],
}

impl FacePair {
    fn side(&self, side: usize) -> &[u32] {
        let faces = &self.sides[side];
        if faces[0] == faces[1] { &faces[..1] } else { faces }
    }
    pub(super) fn fronts(&self) -> &[u32] {
        self.side(0)
    }
    pub(super) fn backs(&self) -> &[u32] {
        self.side(1)
    }
}

/// The pairs of an input. The fronts of connected pairs have consistent windings.
#[derive(Debug, Default, PartialEq)]
pub(super) struct FacePairs {
    pub(super) pairs: Vec<FacePair>,
    /// Faces that repeat a face of a pair.
    pub(super) duplicates: Vec<u32>,
}

/// Returns the two vertices of a face other than its lowest, in the face's winding.
fn link(t: &[VertexId; 3]) -> [VertexId; 2] {
    match lowest(t) {
        low if low == t[0] => [t[1], t[2]],
        low if low == t[1] => [t[2], t[0]],
        _ => [t[0], t[1]],
    }
}

/// Number of faces with the same lowest vertex up to which all are compared with each other.
const COMPARE_ALL_MAX_FACES: usize = 16;
/// Number of faces with the same lowest vertex up to which quads are searched for: a fan has up to 30 on both
/// its sides. (Guessed.)
const QUAD_MAX_FACES: usize = 64;
/// Largest distance between the sides of a quad, in the unit frame: 1e-6 of the diagonal of a cube.
const MAX_GAP: f32 = 1.7e-6;
/// Largest distance between the sides of a quad that is connected with others, relative to its longest edge:
/// exporters cut the two sides of a bent quad along different diagonals. (Guessed: a bend of about ten
/// degrees.)
pub(super) const MAX_BENT_GAP: f32 = 0.1;
/// Minimum number of such quads in an input: fewer are coincidence, as in a jumble of loose faces. (Guessed.)
const MIN_BENT_QUADS: usize = 6;

/// Returns the lowest vertex of a face, by which the faces of the ordered input are sorted.
pub(super) fn lowest(t: &[VertexId; 3]) -> VertexId {
    t[0].min(t[1]).min(t[2])
}

/// Calls `group` with the range of faces of each lowest vertex that several faces share, until it returns
/// false.
fn each_group(faces: &[[VertexId; 3]], mut group: impl FnMut(Range<usize>) -> bool) {
    let mut first = 0;
    while first < faces.len() {
        let own = lowest(&faces[first]);
        let next = first + faces[first..].iter().take_while(|t| lowest(t) == own).count();
        if next - first > 1 && !group(first..next) {
            return;
        }
        first = next;
    }
}

/// A face of a group with one lowest vertex.
#[derive(Clone, Copy)]
struct GroupFace {
    /// The other two vertices, in the face's winding.
    link: [VertexId; 2],
    face: usize,
}

impl GroupFace {
    fn is_opposite(&self, other: &Self) -> bool {
        self.link == [other.link[1], other.link[0]]
    }
    /// The edge of the other two vertices, whatever the winding.
    fn edge(&self) -> u64 {
        let [a, b] = self.link.map(|v| u64::from(v.0));
        a.min(b) << 32 | a.max(b)
    }
    fn ascends(&self) -> bool {
        self.link[0] < self.link[1]
    }
}

fn group_faces(faces: &[[VertexId; 3]], range: Range<usize>, group: &mut Vec<GroupFace>) {
    group.clear();
    group.extend(range.map(|face| GroupFace { link: link(&faces[face]), face }));
}

/// Puts faces at one edge next to each other. (Not inlined, so that it is compiled once.)
#[inline(never)]
fn sort_by_edge(group: &mut [GroupFace]) {
    group.sort_unstable_by_key(GroupFace::edge);
}

/// True if two faces of a group are opposite. Sorts large groups.
fn has_opposite(group: &mut [GroupFace]) -> bool {
    if group.len() <= COMPARE_ALL_MAX_FACES {
        return group.iter().enumerate().any(|(i, a)| group[..i].iter().any(|b| a.is_opposite(b)));
    }
    sort_by_edge(group);
    let has_both = |same: &[GroupFace]| same.iter().any(|x| x.ascends() != same[0].ascends());
    group.chunk_by(|a, b| a.edge() == b.edge()).any(has_both)
}

/// Calls `found` with any three faces of a group that form a closed fan around its lowest vertex: with a
/// fourth face they bound a tetrahedron, which is a two-sided quad if it is flat. `found` returns true to end
/// the search.
fn each_closed_fan(group: &[GroupFace], mut found: impl FnMut([usize; 3]) -> bool) -> bool {
    if !(3..=QUAD_MAX_FACES).contains(&group.len()) {
        return false;
    }
    for (i, a) in group.iter().enumerate() {
        let [b, c] = a.link;
        // (Each fan is found at its lowest index.)
        for second in group[i + 1..].iter().filter(|x| x.link[0] == c) {
            let d = second.link[1];
            if let Some(third) = group[i + 1..].iter().find(|x| x.link == [d, b] && d != b)
                && found([a.face, second.face, third.face])
            {
                return true;
            }
        }
    }
    false
}

/// Number of faces that [`may_have_sheets`] samples to find their positions a second time: if one face in a
/// hundred belongs to a sheet, the sample misses all of them once in 30,000 inputs.
const SAMPLED_FACES: usize = 1024;

/// True if some sampled faces occur twice, for methods that do not need an ordered input. Cost: O(F), a
/// fraction of the cost of ordering.
pub(super) fn may_have_sheets(surface: &Surface<'_>) -> bool {
    let positions = surface.positions();
    // Regardless of the first corner and the winding.
    let key = |t: &[VertexId; 3]| {
        let corner = |v: &VertexId| {
            let mix = |h: u64, x: f64| {
                (h ^ (x + 0.0).to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
            };
            positions.get(*v).into_iter().fold(0, mix)
        };
        t.iter().map(corner).fold(0u64, u64::wrapping_add)
    };
    let faces = surface.triangles();
    let step = faces.len().div_ceil(SAMPLED_FACES).max(1);
    let sample: HashSet<u64> = faces.iter().step_by(step).map(key).collect();
    let mut seen = HashSet::new();
    faces.iter().map(key).filter(|k| sample.contains(k)).any(|k| !seen.insert(k))
}

/// True if any faces lie on each other with opposite windings. Cost: O(F), in the order of the faces.
fn has_sheets(faces: &[[VertexId; 3]]) -> bool {
    // (A group belongs to the chunk of its first face.)
    let start_of_group = |mut i: usize| {
        while i > 0 && i < faces.len() && lowest(&faces[i]) == lowest(&faces[i - 1]) {
            i += 1;
        }
        i
    };
    let found = chunks::map(faces.len(), |range| {
        let own = &faces[start_of_group(range.start)..start_of_group(range.end)];
        let mut any = false;
        let mut group: Vec<GroupFace> = Vec::new();
        each_group(own, |range| {
            group_faces(own, range, &mut group);
            any = has_opposite(&mut group) || each_closed_fan(&group, |_| true);
            !any
        });
        any
    });
    found.contains(&true)
}

/// Returns the pairs of an ordered input that still has its faces and points, if there are any. `may_pair`
/// decides whether some faces of the input may be the front of others; `max_bent_gap` is the largest distance
/// between the sides of a bent quad, relative to its longest edge. Cost: O(F) in the order of the faces, and
/// O(n log n) for n pairs.
pub(super) fn find(
    surface: &Surface<'_>,
    ordered: &Ordered,
    max_bent_gap: f32,
    may_pair: &dyn Fn(&FacePair) -> bool,
) -> Option<FacePairs> {
    let faces = &ordered.faces;
    if !has_sheets(faces) {
        return None;
    }
    let index = ordered.of_faces(surface, |i| i as u32);
    let mut found = FacePairs::default();
    // The border of the first side of each pair.
    let mut borders: Vec<PairBorder> = Vec::new();
    let mut is_taken = vec![false; faces.len()];
    let mut group: Vec<GroupFace> = Vec::new();
    let mut fans: Vec<[usize; 3]> = Vec::new();
    each_group(faces, |range| {
        group_faces(faces, range, &mut group);
        sort_by_edge(&mut group);
        for same in group.chunk_by(|a, b| a.edge() == b.edge()) {
            // Of equal faces, the first in the input.
            let first =
                |ascends: bool| same.iter().filter(|x| x.ascends() == ascends).min_by_key(|x| index[x.face]);
            let (Some(a), Some(b)) = (first(false), first(true)) else { continue };
            let pair = FacePair { sides: [[index[a.face]; 2], [index[b.face]; 2]] };
            if may_pair(&pair) {
                found.pairs.push(pair);
                borders.push(border_of(&[faces[a.face]]));
                let others = same.iter().filter(|x| ![a.face, b.face].contains(&x.face));
                found.duplicates.extend(others.map(|x| index[x.face]));
                same.iter().for_each(|x| is_taken[x.face] = true);
            }
        }
        group.retain(|x| !is_taken[x.face]);
        each_closed_fan(&group, |fan| {
            fans.push(fan);
            false
        });
        true
    });
    for quad in quads(faces, &ordered.points, &fans, max_bent_gap) {
        let pair = FacePair { sides: quad.map(|side| side.map(|f| index[f])) };
        if quad.iter().flatten().all(|f| !is_taken[*f]) && may_pair(&pair) {
            quad.iter().flatten().for_each(|f| is_taken[*f] = true);
            borders.push(border_of(&quad[0].map(|f| faces[f])));
            found.pairs.push(pair);
        }
    }
    if found.pairs.is_empty() {
        return None;
    }
    orient(&mut found, &borders, surface, ordered);
    (!found.pairs.is_empty()).then_some(found)
}

/// Returns the two sides of each quad among tetrahedra of which three faces are known.
fn quads(
    faces: &[[VertexId; 3]],
    points: &[Vec3],
    fans: &[[usize; 3]],
    max_bent_gap: f32,
) -> Vec<[[usize; 2]; 2]> {
    if fans.is_empty() {
        return Vec::new();
    }
    // The fourth face of each is wound opposite to the links of the three.
    let rotated = |t: [VertexId; 3]| {
        let [a, b] = link(&t);
        [lowest(&t), a, b]
    };
    let fourth = |fan: &[usize; 3]| {
        let [b, c, d] = fan.map(|f| link(&faces[f])[0]);
        rotated([b, d, c])
    };
    let mut known: HashMap<[VertexId; 3], Option<usize>> =
        fans.iter().map(|fan| (fourth(fan), None)).collect();
    let mut lows: Vec<VertexId> = known.keys().map(|face| face[0]).collect();
    lows.sort_unstable();
    lows.dedup();
    for low in lows {
        let first = faces.partition_point(|t| lowest(t) < low);
        for (f, t) in faces.iter().enumerate().skip(first).take_while(|(_, t)| lowest(t) == low) {
            if let Some(place) = known.get_mut(&rotated(*t)) {
                place.get_or_insert(f);
            }
        }
    }
    let tetrahedra: Vec<[usize; 4]> = fans
        .iter()
        .filter_map(|fan| Some([fan[0], fan[1], fan[2], known.get(&fourth(fan)).copied().flatten()?]))
        .collect();
    if tetrahedra.is_empty() {
        return Vec::new();
    }
    let six_edges = |all: &[usize; 4]| all.map(|f| edges(faces[f])).into_iter().flatten();
    let mut uses: HashMap<[VertexId; 2], usize> =
        tetrahedra.iter().flat_map(six_edges).map(|(edge, _)| (edge, 0)).collect();
    for (edge, _) in faces.iter().flat_map(|t| edges(*t)) {
        if let Some(count) = uses.get_mut(&edge) {
            *count += 1;
        }
    }
    let quad = |all: &[usize; 4]| {
        let normal = |f: usize| {
            let [a, b, c] = faces[f].map(|v| points[v.index()]);
            (b - a).cross(c - a)
        };
        let reference = normal(all[0]);
        let mut sides = all.iter().copied().partition::<Vec<usize>, _>(|f| normal(*f).dot(reference) > 0.0);
        if sides.0.len() != 2 {
            return None;
        }
        sides.0.sort_unstable();
        // The distance between two opposite edges of the tetrahedron, which are the diagonals of the quad.
        let mut corners: Vec<VertexId> = all.iter().flat_map(|f| faces[*f]).collect();
        corners.sort_unstable();
        corners.dedup();
        let p: Vec<Vec3> = corners.iter().map(|v| points[v.index()]).collect();
        let volume = (p[1] - p[0]).cross(p[2] - p[0]).dot(p[3] - p[0]).abs();
        let area = sides.0.iter().map(|f| normal(*f)).sum::<Vec3>().length();
        let longest = (0..4)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| p[i].distance(p[j]))
            .fold(0f32, f32::max);
        let gap = volume / area;
        let is_connected = six_edges(all).any(|(edge, _)| uses.get(&edge).is_some_and(|n| *n > 2));
        let is_flat =
            gap <= MAX_GAP || is_connected && fans.len() >= MIN_BENT_QUADS && gap <= max_bent_gap * longest;
        is_flat.then(|| [[sides.0[0], sides.0[1]], [sides.1[0], sides.1[1]]])
    };
    tetrahedra.iter().filter_map(quad).collect()
}

/// The edges around one side of a pair, in its winding.
type PairBorder = Vec<([VertexId; 2], bool)>;

/// Returns the edges of a face, each with its lower vertex first, and true if that is its direction.
pub(super) fn edges(t: [VertexId; 3]) -> [([VertexId; 2], bool); 3] {
    [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]
        .map(|[a, b]| if a < b { ([a, b], true) } else { ([b, a], false) })
}

/// Returns the edges of one or two faces that only one of them has.
fn border_of(faces: &[[VertexId; 3]]) -> PairBorder {
    let all: PairBorder = faces.iter().flat_map(|t| edges(*t)).collect();
    let is_single = |edge: &[VertexId; 2]| all.iter().filter(|e| e.0 == *edge).count() == 1;
    all.iter().filter(|e| is_single(&e.0)).copied().collect()
}

/// Chooses the fronts: consistent among pairs that meet at an edge of two pairs, on the side of the first face of the
/// input. Leaves out sheets that touch an open surface.
fn orient(found: &mut FacePairs, borders: &[PairBorder], surface: &Surface<'_>, ordered: &Ordered) {
    // The pairs at each edge, with the direction of the first side of each there.
    let mut at: HashMap<[VertexId; 2], Vec<(u32, bool)>> = HashMap::with_capacity(2 * borders.len());
    for (i, border) in borders.iter().enumerate() {
        for (edge, ascends) in border {
            at.entry(*edge).or_default().push((i as u32, *ascends));
        }
    }
    // Sheets: pairs that are connected by edges of two pairs.
    let mut sheet = vec![u32::MAX; borders.len()];
    let mut is_flipped = vec![false; borders.len()];
    let mut sheets = 0u32;
    let mut open: Vec<u32> = Vec::new();
    for seed in 0..borders.len() {
        if sheet[seed] != u32::MAX {
            continue;
        }
        sheet[seed] = sheets;
        open.push(seed as u32);
        while let Some(i) = open.pop() {
            for (edge, ascends) in &borders[i as usize] {
                let [a, b] = at[edge][..] else { continue };
                let (other, there) = if a.0 == i { b } else { a };
                if sheet[other as usize] == u32::MAX {
                    sheet[other as usize] = sheets;
                    // Consistently wound faces use a common edge in opposite directions.
                    is_flipped[other as usize] = is_flipped[i as usize] ^ (*ascends == there);
                    open.push(other);
                }
            }
        }
        sheets += 1;
    }
    // Sheets that touch single faces are left out if these have borders: the whole could then get a border
    // where a sheet ends. (Collapses map closed surfaces to closed ones.)
    let mut is_joined = vec![false; sheets as usize];
    let mut is_paired = vec![false; surface.triangles().len()];
    let members = found.pairs.iter().flat_map(|p| p.fronts().iter().chain(p.backs()));
    for f in members.chain(&found.duplicates) {
        is_paired[*f as usize] = true;
    }
    let single = |(f, t): (usize, &[VertexId; 3])| ordered.face(t).filter(|_| !is_paired[f]);
    let singles = || surface.triangles().iter().enumerate().filter_map(single);
    let mut is_odd: HashMap<[VertexId; 2], bool> = HashMap::new();
    for (edge, _) in singles().flat_map(edges) {
        let is_odd = is_odd.entry(edge).or_default();
        *is_odd = !*is_odd;
    }
    if is_odd.into_values().any(|is_odd| is_odd) {
        let touched: HashSet<VertexId> = singles().flatten().collect();
        for (i, border) in borders.iter().enumerate() {
            is_joined[sheet[i] as usize] |=
                border.iter().flat_map(|(edge, _)| edge).any(|v| touched.contains(v));
        }
    }
    // The side of the lowest face of the input is the front.
    let mut lowest = vec![(u32::MAX, false); sheets as usize];
    for (i, pair) in found.pairs.iter().enumerate() {
        let [a, b] = [pair.fronts(), pair.backs()].map(|side| side.iter().copied().min().unwrap_or(u32::MAX));
        let own = &mut lowest[sheet[i] as usize];
        *own = (*own).min((a.min(b), (b < a) ^ is_flipped[i]));
    }
    for (i, pair) in found.pairs.iter_mut().enumerate() {
        if is_flipped[i] ^ lowest[sheet[i] as usize].1 {
            pair.sides.reverse();
        }
    }
    let mut sheet_of = sheet.iter();
    found.pairs.retain(|_| sheet_of.next().is_some_and(|s| !is_joined[*s as usize]));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheets_are_found_wherever_their_faces_lie_in_the_order() {
        // Three faces for each lowest vertex. Several threads search in chunks of some thousand faces.
        let fan = |i: u32| [1, 2, 3].map(|k| [i, i + k, i + k + 1].map(VertexId));
        let faces: Vec<[VertexId; 3]> = (0..5000).flat_map(fan).collect();
        assert!(!has_sheets(&faces));
        // The last face of each of these groups gets an opposite one, in the same group.
        let near_ends = (1..8).flat_map(|k| 2048 * k / 3 - 4..2048 * k / 3 + 4);
        for group in near_ends.chain([0, 4999]) {
            let mut faces = faces.clone();
            let [a, b, c] = faces[3 * group + 2];
            faces.insert(3 * group + 3, [a, c, b]);
            assert!(has_sheets(&faces), "group {group}");
        }
    }
}
