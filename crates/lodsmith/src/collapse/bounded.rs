//! Samples of the input, kept with the faces of the mesh that they are near while a run has a limit.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use lodsmith_core::geometry::UnitFrame;
use lodsmith_core::geometry::triangle::weights_at;
use lodsmith_core::measure::Prepared;
use lodsmith_core::measure::proof::cover::{Cover, CoverScratch};
use lodsmith_core::measure::proof::local::{BoxedFace, FaceTest};
use lodsmith_core::measure::proof::map::LimitMap;
use lodsmith_core::spatial::{Bvh, Hint};
use lodsmith_core::{FaceId, HalfEdgeId, PositionsView, Surface, VertexId};

use super::ring::Ring;
use super::store::Store;
use super::triangle;
use super::wings::Wings;
use crate::chunks;
use crate::cost::metric::VertexMemory;

/// End of a list.
pub(super) const END: u32 = u32::MAX;
/// Samples are at most this many limits apart...
const SPACING: f64 = 6.0;
/// ... but there are about this many for each face of the input, or a given number on the whole of it, if its faces are
/// large.
const GRID_SAMPLES_PER_FACE: f64 = 4.0;
/// ... and on the sides of faces at which the surface turns by more than this angle (or ends) this many times closer:
/// that is where a result may be too far between two samples that are not. (Measured: without, four of ten runs had to be
/// repeated.)
const SHARP_COS: f32 = 0.9;
const SHARP_FACTOR: f64 = 3.0;
/// Largest number of samples along a side of a face, and between two sides.
const MAX_GRID: usize = 256;
/// Samples are closer by this factor on a face each time that a result is beyond the limit there.
const DENSER: f64 = 8.0;
/// Maximum number of faces of a star after a collapse, and of a vertex next to it whose faces are near it. Samples are
/// compared with all of them, so the work at a hub would be quadratic. (A vertex has more only as a hub: outputs of
/// other models stay the same.)
pub(super) const MAX_BOUNDED_STAR: usize = 128;
/// Numbers of samples, and of faces, that one thread compares in a row: each begins with what the one before found.
const SAMPLES_PER_PIECE: usize = 1 << 13;
const FACES_PER_PIECE: usize = 1 << 11;
/// Part of the limit that is left for rounding to single precision, in the unit frame.
const ROUNDING: f64 = 4e-7;

/// Spacing of the samples on the faces of the input.
#[derive(Clone, Copy)]
pub(crate) struct Sampling<'a> {
    /// Samples are closer together on these faces of the input, which are sorted, the more so the more often one is
    /// listed, and they are always tested exactly.
    pub(crate) dense: &'a [FaceId],
    /// Number of samples up to which they are as close together as the limit asks.
    pub(crate) samples: f64,
}

/// A sample of the input, in the list of a face of the mesh.
#[derive(Clone, Copy)]
pub(super) struct FaceSample {
    pub(super) p: Vec3,
    /// Upper bound of its squared distance to the mesh.
    pub(super) distance_sq: f32,
    pub(super) next: u32,
    /// The vertex of the input that it is, or the face that it lies in, counted from the number of vertices.
    pub(super) home: u32,
}

/// Faces of the input that were near a face of the mesh, to start with the next time.
#[derive(Clone, Copy)]
pub(super) struct NearInput {
    /// One that lies over it.
    pub(super) over: Option<FaceId>,
    /// One in the tree.
    pub(super) slot: u32,
}

/// Limits that vary over the input.
pub(super) struct VaryingLimit {
    /// By face of the input; the limit is that of the value 1.
    pub(super) map: LimitMap,
    /// The shares of the limit by vertex of the input, and their least limit in user units.
    shares: Vec<f32>,
    rounding: f64,
    /// By vertex of the input: the limit in the unit frame as a share of that of the value 1.
    values: Vec<f64>,
    /// By sample: its squared limit.
    limit_sq: Vec<f32>,
}

/// The limit, and what is known about the mesh.
#[derive(Clone)]
pub(crate) struct Bounded {
    pub(super) input: Arc<Prepared>,
    pub(super) cover: Arc<Cover>,
    /// By face of the input: true if it is tested exactly whenever one of its samples moves. Empty if none is.
    pub(super) is_exact: Arc<[bool]>,
    pub(super) frame: UnitFrame,
    /// In user units, and in the unit frame.
    pub(super) limit: f64,
    pub(super) unit_limit: f64,
    pub(super) limit_sq: f32,
    /// Set if the limit is not the same everywhere; the limits above are the largest then.
    pub(super) varying: Option<Arc<VaryingLimit>>,
    pub(super) samples: Vec<FaceSample>,
    /// By name of a face of the mesh: its first sample, and what was near it.
    pub(super) heads: Vec<u32>,
    pub(super) near: Vec<NearInput>,
    /// Number of collapses refused by the limit after which the sweeps end.
    pub(crate) max_refusals: u64,
    /// Number of collapses so far.
    pub(super) change: u32,
    /// By number in the ordered input: the last collapse that changed the star; the collapse and threshold up to which
    /// the edges of the vertex were tried; the sample that refused an edge last.
    pub(super) changes: Vec<u32>,
    pub(super) tried: Vec<(u32, f32)>,
    pub(super) witness: Vec<u32>,
}

/// A sample that moves to a face.
#[derive(Clone, Copy)]
pub(super) struct Moved {
    pub(super) sample: u32,
    /// Index in the list of new faces, then of faces around.
    pub(super) to: u32,
    pub(super) distance_sq: f32,
}

/// A face of the mesh, after the collapse.
#[derive(Clone, Copy)]
pub(super) struct NearFace {
    pub(super) face: u32,
    pub(super) corners: [Vec3; 3],
    /// Unit normal; zero without an area.
    pub(super) normal: Vec3,
}

impl NearFace {
    pub(super) fn new(face: usize, corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        Self { face: face as u32, corners, normal: (b - a).cross(c - a).normalize_or_zero() }
    }
}

/// A star after a collapse.
#[derive(Clone, Default)]
pub(super) struct StarAfter {
    /// The faces before the collapse.
    pub(super) old: Vec<u32>,
    /// The new faces, then those around them, once they were needed.
    pub(super) faces: Vec<NearFace>,
    pub(super) new_count: usize,
    around: Vec<u32>,
    /// Number of faces that were visited in tests so far.
    pub(super) visited: u64,
}

impl StarAfter {
    /// Sets the star after the ends of an edge are merged at `at`.
    pub(super) fn set<Q: VertexMemory>(&mut self, store: &Store<Q>, at: Vec3, wings: &Wings) {
        self.old.clear();
        self.faces.clear();
        for w in wings.iter() {
            let face = w.corner.face();
            self.old.push(face as u32);
            if !w.both {
                self.faces.push(NearFace::new(face, [at, store.p(w.a), store.p(w.b)]));
            }
        }
        self.new_count = self.faces.len();
    }

    pub(super) fn new_faces(&self) -> &[NearFace] {
        &self.faces[..self.new_count]
    }

    /// Adds the faces around the star, once.
    pub(super) fn add_around<Q: VertexMemory>(&mut self, store: &Store<Q>, wings: &Wings) {
        if self.faces.len() > self.new_count {
            return;
        }
        self.around.clear();
        for w in wings.iter().filter(|w| !w.both).flat_map(|w| [w.a, w.b]) {
            // (The faces of a hub that are next to the star are also those of others.)
            let listed = store.listed(w);
            if listed.len() <= MAX_BOUNDED_STAR {
                self.around.extend(listed.iter().map(|c| c.face() as u32));
            }
        }
        self.visited += self.around.len() as u64;
        self.around.sort_unstable();
        self.around.dedup();
        for &face in self.around.iter().filter(|face| !self.old.contains(face)) {
            self.faces.push(NearFace::new(face as usize, store.t[face as usize].map(|v| store.p(v))));
        }
    }

    /// Returns the squared distance of a sample and the index of the nearest face: a new one, or one around them if all
    /// new ones are beyond the limit; `None` if those are too.
    pub(super) fn nearest<Q: VertexMemory>(
        &mut self,
        sample: &FaceSample,
        limit_sq: f32,
        store: &Store<Q>,
        wings: &Wings,
    ) -> Option<(f32, u32)> {
        let limit_sq = limit_sq.max(sample.distance_sq);
        let mut best = nearest(sample.p, self.new_faces(), (f32::INFINITY, 0), 0);
        self.visited += self.new_count as u64;
        if best.0 > limit_sq {
            self.add_around(store, wings);
            self.visited += (self.faces.len() - self.new_count) as u64;
            best = nearest(sample.p, &self.faces[self.new_count..], best, self.new_count);
        }
        (best.0 <= limit_sq).then_some(best)
    }
}

/// Scratch buffers of a test.
#[derive(Clone, Default)]
pub(super) struct BoundScratch {
    pub(super) star: StarAfter,
    pub(super) moved: Vec<Moved>,
    pub(super) near: Vec<NearInput>,
    /// Faces of the input to test, and the face of the star that is near.
    pub(super) input_faces: Vec<(FaceId, u32)>,
    pub(super) corners: Vec<BoxedFace>,
    pub(super) test: FaceTest,
    pub(super) cover: CoverScratch,
    pub(super) rings: [Ring; 2],
    /// The sample that refused the last collapse.
    pub(super) witness: u32,
}

/// Returns the nearest of some faces, if it is nearer than a squared distance, and that of it.
pub(super) fn nearest(p: Vec3, faces: &[NearFace], mut best: (f32, u32), first: usize) -> (f32, u32) {
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
pub(super) fn tree_of<Q: VertexMemory>(store: &Store<Q>) -> Bvh {
    let positions: Vec<[f32; 3]> = store.v.iter().map(|x| x.p.to_array()).collect();
    Bvh::new(&Surface::new(PositionsView::F32(&positions), &store.t).expect("the faces of a store are sound"))
}

/// Returns the faces of the input around a sample.
pub(super) fn homes<'a>(cover: &'a Cover, sample: &FaceSample) -> impl Iterator<Item = FaceId> + 'a {
    let home = sample.home as usize;
    let (vertex, face) = match home.checked_sub(cover.topology().vertex_count()) {
        None => (Some(VertexId::new(home)), None),
        Some(face) => (None, Some(FaceId::new(face))),
    };
    vertex.into_iter().flat_map(|v| cover.around(v)).chain(face)
}

/// Samples the vertices of the input and, if it is asked for, also its faces and sharp sides.
fn sample_input(cover: &Cover, unit_limit: f64, sampling: Option<Sampling<'_>>) -> Vec<FaceSample> {
    let (vertex_count, face_count) = (cover.topology().vertex_count(), cover.topology().face_count());
    let mut samples = Vec::with_capacity(vertex_count + face_count);
    let mut add = |p: Vec3, home: usize| {
        samples.push(FaceSample { p, distance_sq: 0.0, next: END, home: home as u32 });
    };
    for v in (0..vertex_count).map(VertexId::new).filter(|v| cover.around(*v).next().is_some()) {
        add(cover.point(v), v.index());
    }
    let Some(Sampling { dense, samples: least }) = sampling else { return samples };
    let faces = || (0..face_count).map(FaceId::new);
    let area: f64 = faces().map(|face| f64::from(cover.normal(face).length()) / 2.0).sum();
    let most = least.max(GRID_SAMPLES_PER_FACE * face_count as f64);
    let spacing = (SPACING * unit_limit).max((area / most).sqrt());
    for face in faces() {
        let listed = &dense[dense.partition_point(|f| *f < face)..];
        let times = listed.iter().take_while(|f| **f == face).count();
        let spacing = spacing / DENSER.powi(times as i32);
        sample_face(cover.corners(face), spacing as f32, |p| add(p, vertex_count + face.index()));
    }
    let sharp_spacing = (spacing / SHARP_FACTOR) as f32;
    for side in (0..3 * face_count as u32).map(HalfEdgeId).filter(|h| cover.is_sharp(*h, SHARP_COS)) {
        let topology = cover.topology();
        let [from, to] = [topology.origin(side), topology.target(side)].map(|v| cover.point(v));
        let count = ((from.distance(to) / sharp_spacing).ceil() as usize).min(MAX_GRID);
        (1..count)
            .for_each(|j| add(from.lerp(to, j as f32 / count as f32), vertex_count + side.face().index()));
    }
    samples
}

/// Returns for each face of the input whether it is at a hub, if a compact store still has all of them: their samples need
/// no search, which near a hub would visit all of its faces. Empty if not, or if there is no hub.
fn faces_at_hubs<Q: VertexMemory>(points: &[Vec3], faces: &[[VertexId; 3]], store: &Store<Q>) -> Vec<bool> {
    let is_hub: Vec<bool> =
        (0..store.v.len()).map(|v| store.listed(VertexId::new(v)).len() > MAX_BOUNDED_STAR).collect();
    let is_same = || store.t == faces && store.v.iter().map(|x| &x.p).eq(points);
    if !is_hub.contains(&true) || !is_same() {
        return Vec::new();
    }
    faces.iter().map(|t| t.iter().any(|v| is_hub[v.index()])).collect()
}

/// Lists the samples from a head, with their numbers.
fn listed(samples: &[FaceSample], head: u32) -> impl Iterator<Item = (u32, &FaceSample)> {
    let mut next = head;
    std::iter::from_fn(move || {
        let i = next;
        let s = samples.get(i as usize)?;
        next = s.next;
        Some((i, s))
    })
}

impl Bounded {
    /// Gives the samples of an input to the faces of a compact store, whose faces are named by their place. Without
    /// samples only the result has to stay within the limit.
    ///
    /// Cost: O(n log n).
    pub(crate) fn new<Q: VertexMemory>(
        input: Arc<Prepared>,
        frame: UnitFrame,
        limit: f64,
        (points, faces): (&[Vec3], &[[VertexId; 3]]),
        sampling: Option<Sampling<'_>>,
        store: &Store<Q>,
    ) -> Self {
        let unit_limit = (frame.unit_length(limit) - ROUNDING).max(0.0);
        let limit = frame.user_length(unit_limit);
        let positions: Vec<[f32; 3]> = points.iter().map(Vec3::to_array).collect();
        let surface =
            Surface::new(PositionsView::F32(&positions), faces).expect("the faces of the input are sound");
        let cover = Cover::new(&surface);
        let mut is_exact = Vec::new();
        if let Some(Sampling { dense: dense @ [_, ..], .. }) = sampling {
            is_exact = vec![false; faces.len()];
            dense.iter().for_each(|face| is_exact[face.index()] = true);
        }
        let mut samples = sample_input(&cover, unit_limit, sampling);
        let tree = tree_of(store);
        let mut heads = vec![END; store.t.len()];
        let at_hubs = faces_at_hubs(points, faces, store);
        let nearest = chunks::shared(&mut samples, SAMPLES_PER_PIECE, |_, piece| {
            let mut hint = Hint::default();
            let mut nearest = |s: &mut FaceSample| {
                let own = homes(&cover, s).next().filter(|face| at_hubs.get(face.index()) == Some(&true));
                own.or_else(|| {
                    let hit = tree.closest_from(s.p.as_dvec3().to_array(), &mut hint)?;
                    s.distance_sq = hit.distance_sq as f32;
                    Some(hit.face)
                })
            };
            piece.iter_mut().map(&mut nearest).collect::<Vec<_>>()
        });
        for (i, (s, face)) in samples.iter_mut().zip(nearest.iter().flatten()).enumerate() {
            if let Some(face) = face {
                s.next = std::mem::replace(&mut heads[face.index()], i as u32);
            }
        }
        // Of the faces of the input near a face, the one that is turned like it.
        let over = |i: usize| {
            let [a, b, c] = store.t[i].map(|v| store.p(v));
            let normal = (b - a).cross(c - a);
            let near = listed(&samples, heads[i]).flat_map(|(_, s)| homes(&cover, s));
            let turned = |&face: &FaceId| cover.normal(face).normalize_or_zero().dot(normal);
            near.max_by(|x, y| turned(x).total_cmp(&turned(y)))
        };
        let near = chunks::list(heads.len(), |i| NearInput { over: over(i), slot: u32::MAX });
        if sampling.is_none() {
            samples.clear();
            heads.fill(END);
        }
        Self {
            input,
            cover: Arc::new(cover),
            is_exact: is_exact.into(),
            frame,
            limit,
            unit_limit,
            limit_sq: (unit_limit * unit_limit) as f32,
            varying: None,
            samples,
            near,
            heads,
            max_refusals: u64::MAX,
            change: 1,
            changes: vec![1; store.merged_into.len()],
            tried: vec![(0, 0.0); store.merged_into.len()],
            witness: vec![END; store.merged_into.len()],
        }
    }

    /// Returns the same limit with the samples of these faces only, each of a mesh with a name there, and what is known
    /// about these vertices, each of a mesh with a number there. Faces and vertices are named by their place.
    pub(super) fn of_some<'a>(
        &self,
        faces: impl Iterator<Item = (&'a Self, u32)>,
        vertices: impl Iterator<Item = (&'a Self, VertexId)>,
    ) -> Self {
        let (mut samples, mut heads, mut near) = (Vec::new(), Vec::new(), Vec::new());
        for (from, name) in faces {
            let first = samples.len();
            let own = from.listed(name).map(|(_, sample)| *sample);
            samples.extend((first as u32 + 1..).zip(own).map(|(next, sample)| FaceSample { next, ..sample }));
            heads.push(if samples.len() > first { first as u32 } else { END });
            if let Some(last) = samples[first..].last_mut() {
                last.next = END;
            }
            near.push(from.near[name as usize]);
        }
        let (mut change, mut changes, mut tried) = (1, Vec::new(), Vec::new());
        for (from, v) in vertices {
            change = from.change.max(change);
            changes.push(from.changes[v.index()]);
            tried.push(from.tried[v.index()]);
        }
        Self {
            input: Arc::clone(&self.input),
            cover: Arc::clone(&self.cover),
            is_exact: Arc::clone(&self.is_exact),
            varying: self.varying.clone(),
            samples,
            heads,
            near,
            change,
            witness: vec![END; changes.len()],
            changes,
            tried,
            ..*self
        }
    }

    /// Gives the vertices these numbers, of `count` that there are.
    pub(super) fn renumbered(self, numbers: impl Iterator<Item = VertexId>, count: usize) -> Self {
        let (mut changes, mut tried) = (vec![1; count], vec![(0, 0.0); count]);
        for (k, v) in numbers.enumerate() {
            (changes[v.index()], tried[v.index()]) = (self.changes[k], self.tried[k]);
        }
        Self { changes, tried, witness: vec![END; count], ..self }
    }

    /// Releases the samples, which are elsewhere.
    pub(super) fn release_samples(&mut self) {
        (self.samples, self.heads, self.near) = Default::default();
    }

    /// Makes the limit vary: by shares of the vertices of the input, and by the same as a map, with the least limit of
    /// any place in user units.
    ///
    /// Cost: O(n).
    pub(crate) fn with_map(mut self, map: Option<(&[f32], (&LimitMap, f64))>) -> Self {
        let Some((shares, (map, rounding))) = map else { return self };
        // The least limit, less what the largest was reduced by, and less the rounding of the result.
        let least = (self.frame.unit_length(rounding) - 2.0 * ROUNDING).max(0.0);
        let floor = if least < self.unit_limit { least / self.unit_limit } else { 1.0 };
        let value = |share: &f32| floor + (1.0 - floor) * f64::from(*share);
        let mut varying = VaryingLimit {
            map: map.with_floor(floor),
            values: shares.iter().map(value).collect(),
            shares: shares.to_vec(),
            rounding,
            limit_sq: Vec::new(),
        };
        let vertex_count = self.cover.topology().vertex_count();
        let limit_sq = |s: &FaceSample| {
            let value = match (s.home as usize).checked_sub(vertex_count) {
                None => varying.values[s.home as usize],
                Some(face) => {
                    let face = FaceId::new(face);
                    let corners = self.cover.corners(face).map(Vec3::as_dvec3);
                    let values = self.cover.topology().triangle(face).map(|v| varying.values[v.index()]);
                    let shares = weights_at(s.p.as_dvec3(), corners);
                    values.iter().zip(shares).map(|(x, share)| x * share).sum()
                }
            };
            let limit = self.unit_limit * value;
            (limit * limit) as f32
        };
        varying.limit_sq = self.samples.iter().map(limit_sq).collect();
        self.varying = Some(Arc::new(varying));
        self
    }

    /// Returns the squared limit of a sample.
    #[inline]
    pub(super) fn limit_sq_of(&self, sample: u32) -> f32 {
        match &self.varying {
            None => self.limit_sq,
            Some(varying) => varying.limit_sq[sample as usize],
        }
    }

    /// Returns a share of the largest limit that is no more than that of any point of the input that may be the closest
    /// one to a point of a face within the limit.
    #[inline]
    pub(super) fn least_near(&self, [a, b, c]: [DVec3; 3]) -> f64 {
        let Some(varying) = &self.varying else { return 1.0 };
        let middle = (a + b + c) / 3.0;
        let radius = [a, b, c].iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        let reach = self.frame.user_length(radius) + self.limit;
        varying.map.least_near(&self.input, self.frame.user_from_unit(middle), reach)
    }

    /// Returns the limits at the corners of a face of the input as shares of the largest, if they vary.
    pub(super) fn values_of(&self, face: FaceId) -> Option<[f64; 3]> {
        let varying = self.varying.as_ref()?;
        Some(self.cover.topology().triangle(face).map(|v| varying.values[v.index()]))
    }

    /// Lists the samples of a face of the mesh, by its name, with their numbers.
    pub(super) fn listed(&self, name: u32) -> impl Iterator<Item = (u32, &FaceSample)> {
        listed(&self.samples, self.heads[name as usize])
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

    /// Notes that edges of a vertex may not have been tried.
    pub(super) fn forget_tried(&mut self, u: VertexId) {
        self.tried[u.index()] = (0, 0.0);
    }

    /// Notes the sample that refused an edge; [`END`] if it was none.
    pub(super) fn set_witness(&mut self, ends: [VertexId; 2], sample: u32) {
        if sample != END {
            for end in ends {
                self.witness[end.index()] = sample;
            }
        }
    }

    /// Returns the faces of the input that are not proven to be within a distance of a result, in user units, and those
    /// around them.
    pub(crate) fn faces_beyond(&self, made: &Prepared, limit: f64) -> Vec<FaceId> {
        let is_beyond = |face: &FaceId, (test, near): &mut (FaceTest, u32)| {
            let user = self.cover.corners(*face).map(|p| self.frame.user_from_unit(p.as_dvec3()));
            let Some(varying) = &self.varying else { return !test.is_within(user, made, limit, near) };
            let floor = (varying.rounding / limit).min(1.0);
            let value = |v: VertexId| floor + (1.0 - floor) * f64::from(varying.shares[v.index()]);
            let values = self.cover.topology().triangle(*face).map(value);
            !test.is_within_own(user, values, made, limit, near)
        };
        let topology = self.cover.topology();
        let count = topology.face_count();
        let beyond = chunks::each(count.div_ceil(FACES_PER_PIECE), |k| {
            let faces = k * FACES_PER_PIECE..count.min((k + 1) * FACES_PER_PIECE);
            let mut known = (FaceTest::default(), u32::MAX);
            faces.map(FaceId::new).filter(|face| is_beyond(face, &mut known)).collect::<Vec<_>>()
        });
        let corners = beyond.into_iter().flatten().flat_map(|face| topology.triangle(face));
        let mut around: Vec<FaceId> = corners.flat_map(|v| self.cover.around(v)).collect();
        around.sort_unstable();
        around.dedup();
        around
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
