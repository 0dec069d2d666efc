//! Bounded collapses: while a limit is set, a collapse is only done if the input near it stays within a distance of
//! the result, and the result within that distance of the input.
//!
//! ```text
//! samples of the input belong to faces of the mesh; the samples of the star that changes
//!     move to the nearest new face, or to one around the star       one beyond the limit: refused
//! new faces                                                          proven within the limit of the input
//! faces of the input with a sample far from the result               proven within the limit of the result
//! ```
//!
//! A refused edge is not tried again until a star at one of its ends has changed.

use std::sync::Arc;

use glam::Vec3;
use lodsmith_core::geometry::UnitFrame;
use lodsmith_core::measure::Prepared;
use lodsmith_core::measure::proof::local::{BoxedFace, FaceTest};
use lodsmith_core::spatial::{Bvh, Hint};
use lodsmith_core::{FaceId, PositionsView, Surface, VertexId};

use super::bound::UNKNOWN;
use super::components::Component;
use super::kind::Kind;
use super::order::NONE;
use super::parts::all_but_most_expensive;
use super::ring::{Ring, distinct};
use super::store::Store;
use super::triangle;
use super::wings::Wings;
use super::{Engine, LiveMesh};
use crate::cost::metric::{Metric, VertexMemory};

/// End of a list.
const END: u32 = u32::MAX;
/// A face of the input is tested exactly if one of its samples is farther than this share of the limit. (Measured:
/// at .6 the proof of the whole fails, and at .3 it takes no less time.)
const EXACT_SHARE: f32 = 0.5;
/// Samples are at most this many limits apart...
const SPACING: f64 = 6.0;
/// ... but there are about this many on the whole input, if its faces are large.
const MAX_GRID_SAMPLES: f64 = 180_000.0;
/// Largest number of samples along a side of a face, and between two sides.
const MAX_GRID: usize = 256;
/// Samples are closer by this factor on a face each time that a result is beyond the limit there.
const DENSER: f64 = 8.0;
/// Smallest cosine between a face before and after a move of the fit.
const MIN_TURN_COS: f32 = 0.2;
/// Part of the limit that is left for rounding to single precision, in the unit frame.
const ROUNDING: f64 = 4e-7;

/// The faces of the input, in the unit frame.
struct InputFaces {
    points: Vec<Vec3>,
    faces: Vec<[VertexId; 3]>,
    /// First face of each vertex in `of_vertices`.
    first: Vec<u32>,
    of_vertices: Vec<u32>,
}

/// A sample of the input, in the list of a face of the mesh.
#[derive(Clone, Copy)]
struct FaceSample {
    p: Vec3,
    /// Upper bound of its squared distance to the mesh.
    distance_sq: f32,
    next: u32,
    /// The vertex of the input that it is, or the face that it lies in, counted from the number of vertices.
    home: u32,
}

/// The limit, and what is known about the mesh.
#[derive(Clone)]
pub(crate) struct Bounded {
    input: Arc<Prepared>,
    faces: Arc<InputFaces>,
    frame: UnitFrame,
    /// In user units, and in the unit frame.
    limit: f64,
    unit_limit: f64,
    limit_sq: f32,
    samples: Vec<FaceSample>,
    /// First sample of each face of the mesh, and the face of the input's tree that was near it, by name of the face.
    heads: Vec<u32>,
    near: Vec<u32>,
    /// Number of collapses so far.
    change: u32,
    /// By number in the ordered input: the last collapse that changed the star; the collapse and threshold up to which
    /// the edges of the vertex were tried; the sample that refused an edge last.
    changes: Vec<u32>,
    tried: Vec<(u32, f32)>,
    witness: Vec<u32>,
}

/// A sample that moves to a face.
#[derive(Clone, Copy)]
struct Moved {
    sample: u32,
    /// Index in the list of new faces, then of faces around.
    to: u32,
    distance_sq: f32,
}

/// A face of the mesh, after the collapse.
#[derive(Clone, Copy)]
struct NearFace {
    face: u32,
    corners: [Vec3; 3],
    /// Unit normal; zero without an area.
    normal: Vec3,
}

impl NearFace {
    fn new(face: usize, corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        Self { face: face as u32, corners, normal: (b - a).cross(c - a).normalize_or_zero() }
    }
}

/// Scratch buffers of a test.
#[derive(Clone, Default)]
pub(super) struct BoundScratch {
    old: Vec<u32>,
    /// The new faces, then those around them.
    faces: Vec<NearFace>,
    new_count: usize,
    moved: Vec<Moved>,
    near: Vec<u32>,
    homes: Vec<(u32, u32)>,
    corners: Vec<BoxedFace>,
    test: FaceTest,
    /// The sample that refused the last collapse.
    pub(super) witness: u32,
}

/// Returns the nearest of some faces, if it is nearer than a squared distance, and that of it.
fn nearest(p: Vec3, faces: &[NearFace], mut best: (f32, u32), first: usize) -> (f32, u32) {
    for (i, f) in faces.iter().enumerate() {
        let height = f.normal.dot(p - f.corners[0]);
        if height * height >= best.0 {
            continue;
        }
        let [a, b, c] = f.corners;
        let distance_sq = triangle::closest(p, a, b, c).0;
        if distance_sq < best.0 {
            best = (distance_sq, (first + i) as u32);
        }
    }
    best
}

/// Calls `add` for samples of a face about this far apart, without its corners: rows along its longest side.
fn sample_face(corners: [Vec3; 3], spacing: f32, mut add: impl FnMut(Vec3)) {
    let side = |k: usize| corners[k].distance(corners[(k + 1) % 3]);
    let longest = if side(0) >= side(1).max(side(2)) {
        0
    } else if side(1) >= side(2) {
        1
    } else {
        2
    };
    let [a, b, c] = [0, 1, 2].map(|k| corners[(longest + k) % 3]);
    let base = a.distance(b);
    let height = (b - a).cross(c - a).length() / base.max(1e-30);
    let count = |length: f32| ((length / spacing).ceil() as usize).clamp(1, MAX_GRID);
    let (columns, rows) = (count(base), count(height));
    if columns == 1 {
        return add((a + b + c) / 3.0);
    }
    for row in 0..=rows {
        let up = row as f32 / rows as f32;
        let (from, to) = (a.lerp(c, up), b.lerp(c, up));
        let columns = count(base * (1.0 - up));
        for column in 0..=columns {
            let is_corner = (row == 0 && (column == 0 || column == columns)) || row == rows;
            if !is_corner {
                add(from.lerp(to, column as f32 / columns as f32));
            }
        }
    }
    if rows == 1 {
        // (Both rows are sides.)
        add((a + b + c) / 3.0);
    }
}

/// Returns the tree of a compact store.
fn tree_of<Q: VertexMemory>(store: &Store<Q>) -> Bvh {
    let positions: Vec<[f32; 3]> = store.v.iter().map(|x| x.p.to_array()).collect();
    Bvh::new(&Surface::new(PositionsView::F32(&positions), &store.t).expect("the faces of a store are sound"))
}

impl Bounded {
    /// Gives the samples of an input to the faces of a compact store, whose faces are named by their place. Samples are
    /// closer together on the `dense` faces of the input, which are sorted, each as often as it is too far; without them there are none, and only the result has to
    /// stay within the limit.
    ///
    /// Cost: O(n log n).
    pub(crate) fn new<Q: VertexMemory>(
        input: Arc<Prepared>,
        frame: UnitFrame,
        limit: f64,
        (points, faces): (&[Vec3], &[[VertexId; 3]]),
        dense: Option<&[u32]>,
        store: &Store<Q>,
    ) -> Self {
        let unit_limit = (frame.unit_length(limit) - ROUNDING).max(0.0);
        let limit = frame.user_length(unit_limit);
        let mut first = vec![0u32; points.len() + 1];
        faces.as_flattened().iter().for_each(|v| first[v.index() + 1] += 1);
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut at = first.clone();
        let mut of_vertices = vec![0u32; 3 * faces.len()];
        for (i, v) in faces.iter().enumerate().flat_map(|(i, t)| t.iter().map(move |v| (i, v))) {
            of_vertices[at[v.index()] as usize] = i as u32;
            at[v.index()] += 1;
        }
        let mut samples = Vec::with_capacity(points.len() + faces.len());
        let mut add = |p: Vec3, home: usize| {
            samples.push(FaceSample { p, distance_sq: 0.0, next: END, home: home as u32 });
        };
        for (i, p) in points.iter().enumerate() {
            if dense.is_some() && first[i] < first[i + 1] {
                add(*p, i);
            }
        }
        let area = |[a, b, c]: [Vec3; 3]| f64::from((b - a).cross(c - a).length()) / 2.0;
        let total: f64 = faces.iter().map(|t| area(t.map(|v| points[v.index()]))).sum();
        let spacing = (SPACING * unit_limit).max((total / MAX_GRID_SAMPLES).sqrt());
        for (i, t) in faces.iter().enumerate().filter(|_| dense.is_some()) {
            let corners = t.map(|v| points[v.index()]);
            let times = dense.map_or(0, |all| {
                all[all.partition_point(|f| *f < i as u32)..].iter().take_while(|f| **f == i as u32).count()
            });
            let spacing = spacing / DENSER.powi(times as i32);
            sample_face(corners, spacing as f32, |p| add(p, points.len() + i));
        }
        let tree = tree_of(store);
        let mut heads = vec![END; store.t.len()];
        let mut hint = Hint::default();
        for (i, s) in samples.iter_mut().enumerate() {
            let Some(hit) = tree.closest_from(s.p.as_dvec3().to_array(), &mut hint) else { continue };
            s.distance_sq = hit.distance_sq as f32;
            s.next = std::mem::replace(&mut heads[hit.face.index()], i as u32);
        }
        let faces = InputFaces { points: points.to_vec(), faces: faces.to_vec(), first, of_vertices };
        Self {
            input,
            faces: Arc::new(faces),
            frame,
            limit,
            unit_limit,
            limit_sq: (unit_limit * unit_limit) as f32,
            samples,
            near: vec![u32::MAX; heads.len()],
            heads,
            change: 1,
            changes: vec![1; store.merged_into.len()],
            tried: vec![(0, 0.0); store.merged_into.len()],
            witness: vec![END; store.merged_into.len()],
        }
    }

    /// True if the edge between two vertices, by number in the ordered input, was refused at a cost up to this one and
    /// nothing around it has changed since.
    pub(super) fn was_refused(&self, [u, v]: [VertexId; 2], cost: f32) -> bool {
        let (change, tau) = self.tried[u.index()];
        self.changes[u.index()] <= change && self.changes[v.index()] <= change && cost <= tau
    }

    /// Notes that all edges of a vertex that cost at most tau were tried.
    pub(super) fn set_tried(&mut self, u: VertexId, tau: f32) {
        self.tried[u.index()] = (self.change, tau);
    }

    /// Notes the sample that refused an edge; [`END`] if it was none.
    pub(super) fn set_witness(&mut self, ends: [VertexId; 2], sample: u32) {
        if sample != END {
            for end in ends {
                self.witness[end.index()] = sample;
            }
        }
    }

    /// Returns the faces of the input that are not proven to be within a distance of a result, in user units.
    pub(crate) fn faces_beyond(&self, made: &Prepared, limit: f64) -> Vec<u32> {
        let mut test = FaceTest::default();
        let mut near = u32::MAX;
        let mut is_beyond = |face: &u32| {
            let t = self.faces.faces[*face as usize];
            let user = t.map(|v| self.frame.user_from_unit(self.faces.points[v.index()].as_dvec3()));
            !test.is_within(user, made, limit, &mut near)
        };
        (0..self.faces.faces.len() as u32).filter(|face| is_beyond(face)).collect()
    }

    /// Lists the faces of the input around a sample.
    fn homes(&self, sample: &FaceSample) -> impl Iterator<Item = u32> + '_ {
        let home = sample.home as usize;
        let count = self.faces.points.len();
        let (of_vertex, own) = match home.checked_sub(count) {
            None => (self.faces.first[home]..self.faces.first[home + 1], None),
            Some(face) => (0..0, Some(face as u32)),
        };
        of_vertex.map(|i| self.faces.of_vertices[i as usize]).chain(own)
    }
}

impl<M: Metric> Engine<M> {
    /// Sets a limit, after a compaction.
    pub(crate) fn set_limit(&mut self, bounded: Bounded) {
        self.mesh.store.names = Some((0..self.mesh.store.t.len() as u32).collect());
        self.mesh.store.bound.fill(UNKNOWN);
        self.mesh.constraints.keeps_parts = true;
        self.mesh.constraints.cuts_necks = false;
        self.mesh.topology = super::Topology::default();
        self.mesh.bounded = Some(Box::new(bounded));
    }
}

impl<M: Metric> Engine<M> {
    /// Removes parts of a compact mesh of which all samples are within the limit of the other parts, the cheapest
    /// first. One part stays.
    ///
    /// Cost: O(n log n).
    pub(crate) fn remove_parts_within(&mut self) {
        let (part_of, parts) = self.mesh.find_parts();
        let LiveMesh { store, bounded: Some(bounded), .. } = &mut self.mesh else { return };
        if parts.len() < 2 || bounded.samples.is_empty() {
            return;
        }
        let Some(names) = &store.names else { return };
        let tree = tree_of(store);
        let part_of = |t: &[VertexId; 3]| part_of[t[0].index()] as usize;
        let mut faces_of = vec![Vec::new(); parts.len()];
        for (face, t) in store.t.iter().enumerate() {
            faces_of[part_of(t)].push(face);
        }
        let cost: Vec<f32> = parts.iter().map(Component::weighted_cost).collect();
        let mut is_gone = vec![false; parts.len()];
        let mut moved = Vec::new();
        for part in all_but_most_expensive((0..parts.len()).collect(), &cost) {
            moved.clear();
            if !cost[part].is_finite() {
                continue;
            }
            let stays = |face: FaceId| {
                let other = part_of(&store.t[face.index()]);
                other != part && !is_gone[other]
            };
            let mut is_within = true;
            'faces: for &face in &faces_of[part] {
                let mut i = bounded.heads[names[face] as usize];
                while i != END {
                    let s = &bounded.samples[i as usize];
                    let p = s.p.as_dvec3().to_array();
                    let Some(hit) = tree.closest_of_within(p, bounded.unit_limit, stays) else {
                        is_within = false;
                        break 'faces;
                    };
                    moved.push((i, hit.face, hit.distance_sq as f32));
                    i = s.next;
                }
            }
            if !is_within {
                continue;
            }
            is_gone[part] = true;
            self.tally.parts_removed += 1;
            for &face in &faces_of[part] {
                bounded.heads[names[face] as usize] = END;
            }
            for &(i, face, distance_sq) in &moved {
                let next = std::mem::replace(&mut bounded.heads[names[face.index()] as usize], i);
                let s = &mut bounded.samples[i as usize];
                (s.distance_sq, s.next) = (distance_sq, next);
            }
        }
        if !is_gone.contains(&true) {
            return;
        }
        let gone: Vec<usize> = (0..store.t.len()).filter(|&face| is_gone[part_of(&store.t[face])]).collect();
        store.live_faces -= gone.len();
        gone.into_iter().for_each(|face| store.t[face][0] = NONE);
        let is_used = |t: &&[VertexId; 3]| t[0] != NONE;
        let mut used = vec![false; store.v.len()];
        store.t.iter().filter(is_used).flatten().for_each(|v| used[v.index()] = true);
        store.live_vertices = used.iter().filter(|used| **used).count();
        store.compact();
    }
}

impl<M: Metric> LiveMesh<M> {
    /// True if the mesh stays within the limit when the ends of an edge are merged at `at`, with the triangles of the
    /// star in the wings. The buffers then say where the samples go. Otherwise returns the sample that is too far, or
    /// [`END`].
    pub(super) fn stays_within(
        &self,
        bounded: &Bounded,
        ends: [VertexId; 2],
        at: Vec3,
        wings: &Wings,
        buffers: &mut BoundScratch,
    ) -> Result<(), u32> {
        let names = self.store.names.as_ref().expect("faces of a bounded run have names");
        let BoundScratch { old, faces, new_count, moved, near, homes, corners, test, .. } = buffers;
        old.clear();
        faces.clear();
        moved.clear();
        near.clear();
        for w in wings.iter() {
            let face = w.corner.face();
            old.push(face as u32);
            if !w.both {
                faces.push(NearFace::new(face, [at, self.store.p(w.a), self.store.p(w.b)]));
            }
        }
        *new_count = faces.len();
        // The sample that refused last is likely to refuse again.
        for end in ends {
            let i = bounded.witness[end.index()];
            if let Some(s) = bounded.samples.get(i as usize) {
                let limit_sq = bounded.limit_sq.max(s.distance_sq);
                if nearest(s.p, faces, (f32::INFINITY, 0), 0).0 > limit_sq {
                    self.add_around(old, wings, faces, *new_count);
                    if nearest(s.p, faces, (f32::INFINITY, 0), 0).0 > limit_sq {
                        return Err(i);
                    }
                }
            }
        }
        for &face in old.iter() {
            let mut i = bounded.heads[names[face as usize] as usize];
            while i != END {
                let s = &bounded.samples[i as usize];
                let limit_sq = bounded.limit_sq.max(s.distance_sq);
                let mut best = nearest(s.p, &faces[..*new_count], (f32::INFINITY, 0), 0);
                if best.0 > limit_sq {
                    self.add_around(old, wings, faces, *new_count);
                    best = nearest(s.p, &faces[*new_count..], best, *new_count);
                    if best.0 > limit_sq {
                        return Err(i);
                    }
                }
                moved.push(Moved { sample: i, to: best.1, distance_sq: best.0 });
                i = s.next;
            }
        }
        homes.clear();
        let far_sq = EXACT_SHARE * EXACT_SHARE * bounded.limit_sq;
        for m in moved.iter().filter(|m| m.distance_sq > far_sq) {
            homes.extend(bounded.homes(&bounded.samples[m.sample as usize]).map(|face| (face, m.to)));
        }
        if !homes.is_empty() {
            homes.sort_unstable();
            homes.dedup_by_key(|home| home.0);
            self.add_around(old, wings, faces, *new_count);
        }
        corners.clear();
        corners.extend(faces.iter().map(|f| BoxedFace::new(f.corners.map(Vec3::as_dvec3))));
        for &(face, to) in homes.iter() {
            let mut hint = to;
            let input = &bounded.faces;
            let face = input.faces[face as usize].map(|v| input.points[v.index()].as_dvec3());
            if !test.is_within_few(face, corners, bounded.unit_limit, &mut hint) {
                return Err(END);
            }
        }
        for f in &faces[..*new_count] {
            let mut hint = bounded.near[names[f.face as usize] as usize];
            let user = f.corners.map(|p| bounded.frame.user_from_unit(p.as_dvec3()));
            if !test.is_within(user, &bounded.input, bounded.limit, &mut hint) {
                return Err(END);
            }
            near.push(hint);
        }
        Ok(())
    }

    /// Adds the faces around the star to the new faces, once.
    fn add_around(&self, old: &[u32], wings: &Wings, faces: &mut Vec<NearFace>, new_count: usize) {
        if faces.len() > new_count {
            return;
        }
        let mut around: Vec<u32> = Vec::new();
        let rim = wings.iter().filter(|w| !w.both).flat_map(|w| [w.a, w.b]);
        for w in rim {
            around.extend(self.store.listed(w).iter().map(|c| c.face() as u32));
        }
        around.sort_unstable();
        around.dedup();
        for face in around.into_iter().filter(|face| !old.contains(face)) {
            faces.push(NearFace::new(face as usize, self.store.t[face as usize].map(|v| self.store.p(v))));
        }
    }

    /// Takes moves of vertices back as far as the limit requires: all of a move, half of it, or none. `before` has the
    /// positions and kinds before the moves.
    pub(crate) fn hold_back(&mut self, before: &[(Vec3, Kind)]) {
        let mut moves = Vec::new();
        for (i, (x, &(p, kind))) in self.store.v.iter_mut().zip(before).enumerate() {
            if x.p != p {
                moves.push((VertexId(i as u32), x.p, x.kind));
                (x.p, x.kind) = (p, kind);
            }
        }
        let (mut ring, mut wings, mut buffers) = (Ring::default(), Wings::default(), BoundScratch::default());
        for (u, to, kind) in moves {
            self.store.ring(u, &mut ring);
            wings.clear();
            wings.add_rim(&ring, |_| false);
            let x = &self.store.v[u.index()];
            let (from, origin) = (x.p, x.origin);
            for at in [to, from.lerp(to, 0.5)] {
                let is_upright = wings.iter().all(|w| {
                    let [a, b] = [w.a, w.b].map(|w| self.store.p(w));
                    let [old, new] = [from, at].map(|p| (a - p).cross(b - p));
                    old.dot(new) > MIN_TURN_COS * old.length() * new.length() || old == Vec3::ZERO
                });
                let bounded = self.bounded.as_ref().expect("a limit is set");
                if is_upright && self.stays_within(bounded, [origin; 2], at, &wings, &mut buffers).is_ok() {
                    let x = &mut self.store.v[u.index()];
                    (x.p, x.kind) = (at, kind);
                    self.move_samples(&buffers);
                    break;
                }
            }
        }
    }

    /// Moves the samples after a collapse that was tested, and marks what has changed around the merged vertex `u`.
    pub(super) fn note_bounded(&mut self, u: VertexId, buffers: &BoundScratch) {
        self.move_samples(buffers);
        let Self { store, bounded, .. } = self;
        let Some(bounded) = bounded else { return };
        bounded.change += 1;
        let (mut around, mut beyond) = (Ring::default(), Ring::default());
        store.ring(u, &mut around);
        for w in distinct(&around).chain([u]) {
            bounded.changes[store.v[w.index()].origin.index()] = bounded.change;
            store.ring(w, &mut beyond);
            for x in beyond.iter().flat_map(|r| [r.a, r.b]).chain([w]) {
                let bound = &mut store.bound[x.index()];
                if *bound == f32::INFINITY && x != NONE {
                    *bound = UNKNOWN;
                }
            }
        }
    }

    /// Gives samples to the faces that a test found.
    fn move_samples(&mut self, buffers: &BoundScratch) {
        let (Some(bounded), Some(names)) = (&mut self.bounded, &self.store.names) else { return };
        let BoundScratch { old, faces, new_count, moved, near, .. } = buffers;
        for &face in old {
            bounded.heads[names[face as usize] as usize] = END;
        }
        for m in moved {
            let head = &mut bounded.heads[names[faces[m.to as usize].face as usize] as usize];
            let s = &mut bounded.samples[m.sample as usize];
            (s.distance_sq, s.next) = (m.distance_sq, std::mem::replace(head, m.sample));
        }
        for (f, near) in faces[..*new_count].iter().zip(near) {
            bounded.near[names[f.face as usize] as usize] = *near;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapse::Engine;
    use crate::collapse::candidate::CollapseOutcome;
    use crate::collapse::test_support::{checked, engine_of, try_at, without_lines};
    use crate::cost::metric::Memoryless;
    use crate::report::Refusal;
    use crate::test_support::{SmallMesh, sheet};

    const FRAME: UnitFrame = UnitFrame::with_size([0.0; 3], 1.0);

    /// Returns an engine of a flat sheet of 5 × 5 cells that has to stay within a distance of itself.
    fn bounded(limit: f64, is_two_sided: bool) -> (SmallMesh, Engine<Memoryless>) {
        let small = sheet(5);
        let mut engine = engine_of(Memoryless, &small, &without_lines());
        let mesh = small.mesh();
        let input = Arc::new(Prepared::new(&mesh.surface()).expect("there are faces"));
        let given = (&small.points[..], &small.triangles()[..]);
        let kept = is_two_sided.then_some(&[][..]);
        let bounded = Bounded::new(input, FRAME, limit, given, kept, &engine.mesh.store);
        engine.set_limit(bounded);
        (small, engine)
    }

    /// Counts the samples in all lists.
    fn listed(engine: &Engine<Memoryless>) -> usize {
        let bounded = engine.mesh.bounded.as_ref().expect("a limit is set");
        let mut count = 0;
        for &head in &bounded.heads {
            let mut i = head;
            while i != END {
                (i, count) = (bounded.samples[i as usize].next, count + 1);
            }
        }
        count
    }

    #[test]
    fn a_collapse_beyond_the_limit_is_refused_and_changes_nothing() {
        for is_two_sided in [true, false] {
            let (_, mut engine) = bounded(0.1, is_two_sided);
            let samples = listed(&engine);
            // (36 vertices, and at least the centres of 50 faces.)
            assert_eq!(samples >= 86, is_two_sided, "{samples}");
            let before = engine.mesh.store.t.clone();
            let outcome = try_at(&mut engine, [14, 15], Vec3::new(0.5, 0.0, 0.12), f32::MAX);
            assert!(matches!(outcome, CollapseOutcome::Refused(Refusal::Cost)));
            assert_eq!((engine.mesh.store.t == before, listed(&engine)), (true, samples));
            let outcome = try_at(&mut engine, [14, 15], Vec3::new(0.5, 0.0, 0.09), f32::MAX);
            assert!(matches!(outcome, CollapseOutcome::Done));
            // No sample is lost, and each knows its new distance.
            assert_eq!(listed(&engine), samples);
            let farthest =
                |bounded: &Bounded| bounded.samples.iter().map(|s| s.distance_sq).fold(0.0, f32::max).sqrt();
            let farthest = farthest(engine.mesh.bounded.as_ref().expect("a limit is set"));
            assert!(
                if is_two_sided { (0.05..0.1).contains(&farthest) } else { farthest == 0.0 },
                "{farthest}"
            );
            assert_eq!(checked(&engine), Ok(()));
        }
    }

    #[test]
    fn a_refused_edge_waits_until_a_star_at_its_ends_changes() {
        let (_, mut engine) = bounded(0.1, true);
        let ends = [14, 15].map(VertexId);
        let was_refused = |engine: &Engine<Memoryless>, cost| {
            engine.mesh.bounded.as_ref().is_some_and(|bounded| bounded.was_refused(ends, cost))
        };
        assert!(!was_refused(&engine, 1.0));
        engine.mesh.bounded.as_mut().expect("a limit is set").set_tried(ends[0], 2.0);
        engine.mesh.store.bound[7] = f32::INFINITY;
        engine.mesh.store.bound[5] = f32::INFINITY;
        assert!(was_refused(&engine, 1.0) && !was_refused(&engine, 3.0));
        // Far away, and next to it: the vertices around are tried again.
        assert!(matches!(try_at(&mut engine, [32, 33], Vec3::X * 0.5, f32::MAX), CollapseOutcome::Done));
        assert!(was_refused(&engine, 1.0) && engine.mesh.store.bound[7] == f32::INFINITY);
        assert!(matches!(try_at(&mut engine, [8, 9], Vec3::X * 0.5, f32::MAX), CollapseOutcome::Done));
        assert!(!was_refused(&engine, 1.0) && engine.mesh.store.bound[7] == UNKNOWN);
        assert_eq!(engine.mesh.store.bound[5], f32::INFINITY);
    }

    #[test]
    fn moves_of_the_fit_are_taken_back_as_far_as_the_limit_requires() {
        let (_, mut engine) = bounded(0.1, true);
        let before: Vec<_> = engine.mesh.store.v.iter().map(|x| (x.p, x.kind)).collect();
        for (u, height) in [(7, 0.05), (16, 0.15), (28, 0.5)] {
            let x = &mut engine.mesh.store.v[u];
            (x.p.z, x.kind) = (height, x.kind.moved(true));
        }
        engine.mesh.hold_back(&before);
        let height = |u: usize| (engine.mesh.store.v[u].p.z, engine.mesh.store.v[u].kind.is_moved());
        assert_eq!([height(7), height(16), height(28)], [(0.05, true), (0.075, true), (0.0, false)]);
    }

    #[test]
    fn samples_of_a_face_are_no_farther_apart_than_asked() {
        let faces = [
            [Vec3::ZERO, Vec3::X, Vec3::Y],
            [Vec3::ZERO, Vec3::X * 3.0, Vec3::new(1.5, 0.01, 0.0)],
            [Vec3::ZERO, Vec3::X * 0.01, Vec3::Y * 0.01],
        ];
        for [a, b, c] in faces {
            let spacing = 0.1;
            let mut samples = vec![a, b, c];
            sample_face([a, b, c], spacing, |p| samples.push(p));
            assert!(samples.len() > 3 && samples[3..].iter().all(|p| ![a, b, c].contains(p)));
            for (i, j) in (0..=40).flat_map(|i| (0..=40 - i).map(move |j| (i, j))) {
                let p = (a * i as f32 + b * j as f32 + c * (40 - i - j) as f32) / 40.0;
                let near = samples.iter().map(|s| s.distance(p)).fold(f32::INFINITY, f32::min);
                assert!(near < spacing, "{p} is {near} from all samples");
            }
        }
    }
}
