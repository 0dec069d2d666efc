//! Proven, not sampled, bounds of the distance of a surface from another. [Sacht-Jacobson 2024]
//!
//! ```text
//! face ──► piece ── all corners within D of one face of the other surface? ── yes: all of the piece is
//!            ▲           │ no: is the middle farther than D from all faces?  ── yes: the answer is no
//!            └── parts ◄─┘
//! ```
//!
//! The distance to a face is convex because the face is, so over a convex piece it is largest at a corner. A
//! piece is cut along the prism over the face nearest to its middle, a little outside of it, so there are
//! about as many parts as faces below the piece; a piece much larger than that face is halved.

pub mod cover;
pub mod local;
pub mod map;
mod piece;
mod rule;
mod target;

use std::sync::atomic::{AtomicBool, Ordering};

use super::{Prepared, chunks};
use crate::geometry::triangle::{self, double_area_normal};
use crate::spatial::Hint;
use map::MapSide;
use piece::Piece;
use rule::{ByCorners, ByFace, Everywhere, Rule};
use target::Target;

/// Bounds of the largest distance from one surface to another, in the units of the positions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DistanceBounds {
    /// Lower bound: the largest distance that was found.
    pub seen: f64,
    /// Upper bound: no place is farther away.
    pub bound: f64,
}

/// Result of testing whether all of a surface lies within a distance of another.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum WithinResult {
    /// All of it does. Holds a proven upper bound of its distance, in the units of the positions, at most the
    /// tested one.
    Yes(f64),
    /// Some of it does not. Holds the distance of a place that is farther away, in the units of the
    /// positions.
    No(f64),
    /// Undecided within the work limit.
    Undecided,
}

/// Pieces whose corners are nearer to their middle than this, in the unit frame, are not cut any more: it is
/// close to the resolution of a double.
const MIN_PIECE_RADIUS: f64 = 1e-14;
/// Distances below this, in the unit frame, count as zero when searching for the largest one. (Guessed:
/// rounding of coordinates is a hundredth of it.)
const ZERO_DISTANCE: f64 = 1e-12;
/// Maximum number of steps of a proof for each face of both surfaces. (Measured on scans: .2 to 3.)
const MAX_STEPS_PER_FACE: usize = 256;
/// Base number of steps, whatever the number of faces.
const BASE_STEPS: usize = 1 << 20;
/// Number of faces, or of unfinished pieces, that one task takes at a time...
const FACES_PER_TASK: usize = 1024;
const PIECES_PER_TASK: usize = 128;
/// ... and the number of steps on them before the unfinished pieces are redistributed. (Guessed: a thousandth
/// of a second.)
const STEPS_PER_TASK: usize = 4096;
/// Offset of a cut outside of the face, as a share of how far outside a point at the height of the piece
/// could lie and still be within the distance. (Measured: .5 takes 9 % more steps, .85 31 %.)
const CUT_OFFSET: f64 = 0.3;
/// Cuts nearer to a corner than this share of the offset are skipped: the rest would be a sliver, and near
/// enough.
const MIN_CUT_SHARE: f64 = 0.2;
/// Pieces larger than this many times the face below them are halved and not cut along it. (Measured: 1 to 16
/// differ by less than 4 % in steps.)
const MAX_CUT_RADIUS: f64 = 2.0;
/// Faces smaller than this share of the distance are not cut along: halves are soon near enough.
const MIN_CUT_FACE: f64 = 0.5;

/// Proves that every point of `from` lies within a distance of `to`, or finds one that does not.
///
/// The distance is in the units of the positions. Deterministic at any number of threads. The rounding error
/// is some 1e-15 of the size of the surfaces. Cost: some steps of O(log n) for each face of either surface
/// that is near the other; a `No` is mostly quick.
pub fn prove_within(from: &Prepared, to: &Prepared, distance: f64) -> WithinResult {
    prove_within_until(from, to, distance, None, &mut || false).unwrap_or(WithinResult::Undecided)
}

/// Proves like [`prove_within`], until `is_over` returns true: then `None`. It is called often, on this thread.
///
/// With a map, each point has its own limit: the distance times the value of the map, which is that of the point itself,
/// or of the point of `to` that is closest to it. A bound is of all distances; the distance of a `No` is a share of its
/// limit then. Where the map belongs to `to`, this costs a few times as much.
pub fn prove_within_until(
    from: &Prepared,
    to: &Prepared,
    distance: f64,
    map: Option<MapSide<'_>>,
    is_over: &mut dyn FnMut() -> bool,
) -> Option<WithinResult> {
    let frame = to.tree().frame();
    let limit = frame.unit_length(distance);
    if limit.is_nan() || limit < 0.0 {
        return Some(WithinResult::Undecided);
    }
    let is_found = AtomicBool::new(false);
    let limits = ProofLimits { limit, tolerance: None, is_found: &is_found };
    let (seen, bound) = match map {
        None => all_within(from, to, Everywhere, no_values, limits, is_over)?.bounds(),
        Some(MapSide::From(map)) => {
            all_within(from, to, ByCorners, |slot| map.of_slot(slot), limits, is_over)?.bounds()
        }
        Some(MapSide::To(map)) => all_within(from, to, ByFace(map), no_values, limits, is_over)?.bounds(),
    };
    Some(match () {
        () if seen > limit => WithinResult::No(frame.user_length(seen).max(distance)),
        () if bound <= limit => WithinResult::Yes(frame.user_length(bound).min(distance)),
        () => WithinResult::Undecided,
    })
}

/// Computes an upper bound of the distance of `from` to `to`, to a relative `tolerance`.
///
/// `seen` is a distance that some point is known to have, 0 if unknown; lengths are in the units of the
/// positions. The bound is at most `1 + tolerance` times the distance found, or some 1e-12 of the size of
/// `to`, unless the work limit is reached: then it is the best one so far. Deterministic; costs as much as
/// [`prove_within`] with the distance that is found.
pub fn bound_distance(from: &Prepared, to: &Prepared, seen: f64, tolerance: f64) -> DistanceBounds {
    bound_distance_until(from, to, seen, tolerance, &mut || false).expect("it ends only if it is asked to")
}

/// Computes like [`bound_distance`], until `is_over` returns true: then `None`. It is called often, on this thread.
pub fn bound_distance_until(
    from: &Prepared,
    to: &Prepared,
    seen: f64,
    tolerance: f64,
    is_over: &mut dyn FnMut() -> bool,
) -> Option<DistanceBounds> {
    let frame = to.tree().frame();
    let seen = seen.max(farthest_vertex(from, to, is_over)?);
    let unit = frame.unit_length(seen);
    if !unit.is_finite() || unit >= 1e90 {
        return Some(DistanceBounds { seen, bound: f64::INFINITY });
    }
    let tolerance = tolerance.max(1e-9);
    let limit = (unit * (1.0 + tolerance)).max(ZERO_DISTANCE);
    let is_found = AtomicBool::new(false);
    let limits = ProofLimits { limit, tolerance: Some(tolerance), is_found: &is_found };
    let all = all_within(from, to, Everywhere, no_values, limits, is_over)?;
    let seen = seen.max(frame.user_length(all.seen));
    Some(DistanceBounds { seen, bound: frame.user_length(all.bound).max(seen) })
}

/// Barycentric coordinates of the points of a face that [`samples_within`] tests besides its corners: its
/// middle, the middles of its sides, and the points halfway from its middle to its corners.
const FACE_SAMPLES: [[f64; 3]; 7] = {
    const HALF: f64 = 1.0 / 2.0;
    const THIRD: f64 = 1.0 / 3.0;
    const TWO_THIRDS: f64 = 2.0 / 3.0;
    const SIXTH: f64 = 1.0 / 6.0;
    [
        [THIRD, THIRD, THIRD],
        [HALF, HALF, 0.0],
        [0.0, HALF, HALF],
        [HALF, 0.0, HALF],
        [TWO_THIRDS, SIXTH, SIXTH],
        [SIXTH, TWO_THIRDS, SIXTH],
        [SIXTH, SIXTH, TWO_THIRDS],
    ]
};
/// With more faces than this no points inside faces are tested, with more than a fifth of this number only
/// the first four. (Guessed: few enough that simplifying to a face count takes longer.)
const MAX_FACES_FOR_MIDDLES: usize = 50_000;

/// True if all tested places of `from` lie within a distance of `to`: the vertices, and up to seven points of
/// each face.
///
/// The places do not depend on the distance, so a false result is also false for any shorter distance; and if
/// [`prove_within`] proves a distance, the result is true. Lengths are in the units of the positions. Cost:
/// O(log n) per place.
pub fn samples_within(from: &Prepared, to: &Prepared, distance: f64) -> bool {
    samples_within_until(from, to, distance, None, &mut || false).unwrap_or(false)
}

/// Tests like [`samples_within`], with the limits of [`prove_within_until`], until `is_over` returns true: then `None`. It is
/// called often, on this thread.
pub fn samples_within_until(
    from: &Prepared,
    to: &Prepared,
    distance: f64,
    map: Option<MapSide<'_>>,
    is_over: &mut dyn FnMut() -> bool,
) -> Option<bool> {
    let (source, target) = (from.tree(), to.tree());
    let limit = target.frame().unit_length(distance);
    let limit_sq = limit * limit;
    let is_beyond = AtomicBool::new(limit.is_nan() || limit < 0.0);
    let is_far = |p: glam::DVec3, slot_of_p: u32, near: &mut u32| {
        let limit_sq = match map {
            None => limit_sq,
            Some(MapSide::From(map)) => {
                let limit = limit * map.at(slot_of_p, source.slot_corners(slot_of_p), p);
                limit * limit
            }
            Some(MapSide::To(map)) => {
                let p = source.frame().to(target.frame(), p);
                let hit = target.closest_slot(p, f64::INFINITY, &mut Hint::at(*near));
                return hit.is_none_or(|hit| {
                    *near = hit.slot;
                    hit.distance_sq.sqrt() > limit * map.at(hit.slot, target.slot_corners(hit.slot), p)
                });
            }
        };
        let p = source.frame().to(target.frame(), p);
        let is_near = |slot| triangle::nearest(p, target.slot_corners(slot)).distance_sq <= limit_sq;
        if is_near(*near) {
            return false;
        }
        let mut is_found = false;
        // Just above the limit, so that faces exactly at the limit are visited.
        target.visit(p, limit_sq.next_up(), |slot| {
            if !is_found && is_near(slot) {
                (*near, is_found) = (slot, true);
            }
            is_found.then_some(0.0)
        });
        !is_found
    };
    let vertices = source.vertices();
    let slots = if matches!(map, Some(MapSide::From(_))) { source.slots_of_vertices() } else { Vec::new() };
    chunks::map_until(FACES_PER_TASK, vertices.len(), is_over, |range| {
        let mut near = 0;
        for i in range {
            let slot = slots.get(i).copied().unwrap_or(0);
            if is_beyond.load(Ordering::Relaxed) || is_far(vertices[i], slot, &mut near) {
                return is_beyond.store(true, Ordering::Relaxed);
            }
        }
    })?;
    let places = match source.face_count() {
        n if n > MAX_FACES_FOR_MIDDLES => &[],
        n if n > MAX_FACES_FOR_MIDDLES / 5 => &FACE_SAMPLES[..4],
        _ => &FACE_SAMPLES[..],
    };
    chunks::map_until(FACES_PER_TASK, source.face_count(), is_over, |faces| {
        let mut near = 0;
        for slot in faces {
            let [a, b, c] = source.slot_corners(slot as u32);
            for [u, v, w] in places {
                let p = a * *u + b * *v + c * *w;
                if is_beyond.load(Ordering::Relaxed) || is_far(p, slot as u32, &mut near) {
                    return is_beyond.store(true, Ordering::Relaxed);
                }
            }
        }
    })?;
    Some(!is_beyond.into_inner())
}

/// Returns the largest distance of a vertex of `from`, in user units: a first guess.
fn farthest_vertex(from: &Prepared, to: &Prepared, is_over: &mut dyn FnMut() -> bool) -> Option<f64> {
    let (source, target) = (from.tree(), to.tree());
    let vertices = source.vertices();
    let parts = chunks::map_until(chunks::CHUNK_LENGTH, vertices.len(), is_over, |range| {
        let mut hint = Hint::default();
        let far = |p: &glam::DVec3| {
            let p = source.frame().to(target.frame(), *p);
            target.closest_slot(p, f64::INFINITY, &mut hint).map_or(f64::INFINITY, |hit| hit.distance_sq)
        };
        vertices[range].iter().map(far).fold(0.0, f64::max)
    })?;
    Some(target.frame().user_length(parts.into_iter().fold(0.0, f64::max).sqrt()))
}

/// Limits for all pieces; lengths in the unit frame of the target surface.
#[derive(Clone, Copy)]
struct ProofLimits<'a> {
    limit: f64,
    /// If set, a place beyond the limit raises the limit to its distance times one plus this. Else it ends
    /// the search.
    tolerance: Option<f64>,
    is_found: &'a AtomicBool,
}

/// Results for some pieces.
struct ProofState<V> {
    seen: f64,
    bound: f64,
    steps: usize,
    left: Vec<Piece<V>>,
}

/// The values of a face for rules that need none.
fn no_values(_slot: u32) -> [(); 3] {
    [(); 3]
}

/// `values` returns the values at the corners of a slot of `from`. Returns `None` once `is_over` has returned true.
fn all_within<R: Rule>(
    from: &Prepared,
    to: &Prepared,
    rule: R,
    values: impl Fn(u32) -> [R::Value; 3] + Sync,
    mut limits: ProofLimits<'_>,
    is_over: &mut dyn FnMut() -> bool,
) -> Option<ProofState<R::Value>> {
    let (source, target) = (from.tree(), to.tree());
    let count = source.face_count();
    let max_steps = BASE_STEPS.saturating_add(MAX_STEPS_PER_FACE.saturating_mul(count + target.face_count()));
    let mut all = ProofState { seen: 0.0, bound: 0.0, steps: 0, left: Vec::new() };
    let first = chunks::map_until(FACES_PER_TASK, count, is_over, |faces| {
        let mut search = PieceSearch::new(target, rule, limits);
        let mut hint = u32::MAX;
        for slot in faces {
            let corners = source.slot_corners(slot as u32).map(|p| source.frame().to(target.frame(), p));
            search.pieces.push(Piece::of_face(corners, values(slot as u32), hint));
            hint = search.run(STEPS_PER_TASK * (1 + slot % FACES_PER_TASK) / FACES_PER_TASK + 64);
        }
        search.found()
    })?;
    all.add(first);
    while !all.left.is_empty() && !limits.is_found.load(Ordering::Relaxed) {
        if let Some(tolerance) = limits.tolerance {
            limits.limit = limits.limit.max(all.seen * (1.0 + tolerance));
        }
        let pieces = std::mem::take(&mut all.left);
        let is_last = all.steps > max_steps;
        let parts = chunks::map_until(PIECES_PER_TASK, pieces.len(), is_over, |range| {
            let mut search = PieceSearch::new(target, rule, limits);
            if is_last {
                pieces[range].iter().for_each(|piece| search.bound_piece(piece));
            } else {
                // Pieces are popped from the end: reversed, so that the first comes first.
                search.pieces.extend(pieces[range].iter().rev().copied());
                search.run(STEPS_PER_TASK);
            }
            search.found()
        })?;
        all.add(parts);
    }
    if !all.left.is_empty() {
        all.bound = f64::INFINITY;
    }
    Some(all)
}

impl<V> ProofState<V> {
    fn bounds(&self) -> (f64, f64) {
        (self.seen, self.bound)
    }

    fn add(&mut self, parts: Vec<Self>) {
        for mut part in parts {
            self.seen = self.seen.max(part.seen);
            self.bound = self.bound.max(part.bound);
            self.steps += part.steps;
            self.left.append(&mut part.left);
        }
    }
}

/// A depth-first search; the last piece is handled first.
struct PieceSearch<'a, T: Target, R: Rule> {
    to: &'a T,
    rule: R,
    limits: ProofLimits<'a>,
    pieces: Vec<Piece<R::Value>>,
    seen: f64,
    bound: f64,
    steps: usize,
    /// The face that was nearest last.
    near: u32,
}

impl<'a, T: Target, R: Rule> PieceSearch<'a, T, R> {
    fn new(to: &'a T, rule: R, limits: ProofLimits<'a>) -> Self {
        Self { to, rule, limits, pieces: Vec::new(), seen: 0.0, bound: 0.0, steps: 0, near: u32::MAX }
    }

    fn found(self) -> ProofState<R::Value> {
        ProofState { seen: self.seen, bound: self.bound, steps: self.steps, left: self.pieces }
    }

    /// Runs until no piece is left, or `steps` steps are taken in total. Returns the face that was nearest
    /// last.
    fn run(&mut self, steps: usize) -> u32 {
        while self.steps < steps && !self.limits.is_found.load(Ordering::Relaxed) {
            let Some(piece) = self.pieces.pop() else { break };
            self.steps += 1;
            self.process_piece(piece);
        }
        self.near
    }

    /// Adds the bound of a piece without cutting it: the distance of its corners to one face bounds all of
    /// it.
    fn bound_piece(&mut self, piece: &Piece<R::Value>) {
        if !R::IS_UNIFORM {
            self.bound = f64::INFINITY;
            return;
        }
        let mut hint = Hint::at(piece.near);
        let near = self.to.closest(piece.middle(), &mut hint);
        let bound = near.map_or(f64::INFINITY, |hit| {
            let by_size = hit.distance_sq.sqrt() + piece.radius(piece.middle());
            self.farthest_corner(piece, hit.slot).min(by_size)
        });
        self.bound = self.bound.max(bound);
    }

    /// Returns the largest distance of a corner to a face.
    fn farthest_corner(&self, piece: &Piece<R::Value>, slot: u32) -> f64 {
        let face = self.to.corners(slot);
        let far = piece.corners().iter().map(|p| triangle::nearest(*p, face).distance_sq);
        far.fold(0.0, f64::max).sqrt()
    }

    /// True if all corners lie within the limit of one face. Most faces fail at the first corner.
    fn is_near(&mut self, piece: &Piece<R::Value>, slot: u32) -> bool {
        let face = self.to.corners(slot);
        let mut far = 0f64;
        for (p, value) in piece.corners().iter().zip(piece.values()) {
            let limit = self.rule.at(self.limits.limit, *value);
            let distance_sq = triangle::nearest(*p, face).distance_sq;
            far = far.max(distance_sq);
            if distance_sq > limit * limit {
                return false;
            }
        }
        if !self.rule.holds(self.to, piece, slot, self.limits.limit) {
            return false;
        }
        self.accept(far.sqrt(), slot);
        true
    }

    fn accept(&mut self, bound: f64, slot: u32) {
        // The root of a number below the square of the limit may round to above the limit.
        self.bound = self.bound.max(bound.min(self.limits.limit));
        self.near = slot;
    }

    fn process_piece(&mut self, piece: Piece<R::Value>) {
        let tried = piece.near;
        let is_first = (tried as usize) < self.to.count() && !piece.is_tried;
        if is_first && self.is_near(&piece, tried) {
            return;
        }
        let middle = piece.middle();
        let to = self.to;
        // Faces within the limit of the middle, nearest first: one of them may suffice for the whole piece.
        let limit = self.rule.at_middle(self.limits.limit, &piece);
        let limit_sq = limit * limit;
        let (mut nearest_sq, mut slot, mut is_done) = (f64::INFINITY, u32::MAX, false);
        to.visit_near(middle, limit_sq, |near| {
            let distance_sq = triangle::nearest(middle, to.corners(near)).distance_sq;
            if distance_sq < nearest_sq {
                (nearest_sq, slot) = (distance_sq, near);
                if near != tried && self.is_near(&piece, near) {
                    is_done = true;
                    return Some(0.0);
                }
            }
            Some(nearest_sq.min(limit_sq))
        });
        if is_done {
            return;
        }
        if nearest_sq > limit_sq {
            let Some(hit) = to.closest(middle, &mut Hint::at(tried)) else {
                // Too far away for the square to fit a double.
                (self.seen, self.bound) = (f64::INFINITY, f64::INFINITY);
                self.limits.is_found.store(true, Ordering::Relaxed);
                return;
            };
            (nearest_sq, slot) = (hit.distance_sq, hit.slot);
            // Within the limit after all, if the distance is zero.
            if nearest_sq <= limit_sq && slot != tried && self.is_near(&piece, slot) {
                return;
            }
        }
        let height = nearest_sq.sqrt();
        self.seen = self.seen.max(height);
        if nearest_sq > limit_sq || self.rule.is_beyond(self.to, slot, middle, (height, self.limits.limit)) {
            match self.limits.tolerance {
                Some(tolerance) => self.limits.limit = height * (1.0 + tolerance),
                None => {
                    // The root may have been rounded down.
                    self.seen = self.seen.max(self.limits.limit.next_up());
                    return self.limits.is_found.store(true, Ordering::Relaxed);
                }
            }
        }
        let radius = piece.radius(middle);
        let bound = height + radius;
        if bound <= self.rule.at_all(self.limits.limit, &piece) || radius <= MIN_PIECE_RADIUS {
            self.bound = self.bound.max(bound);
            self.near = slot;
            return;
        }
        self.cut(piece, slot, height, radius);
    }

    /// Replaces a piece by its parts outside the prism over a face and the one inside, or by halves.
    fn cut(&mut self, piece: Piece<R::Value>, slot: u32, height: f64, radius: f64) {
        let face = self.to.corners(slot);
        let normal = double_area_normal(face).normalize_or_zero();
        let longest = (0..3).map(|k| face[k].distance(face[(k + 1) % 3])).fold(0.0, f64::max);
        let limit = self.rule.near_face(self.to, slot, &piece, self.limits.limit);
        let is_useful =
            piece.cut_by != slot && longest >= MIN_CUT_FACE * limit && radius <= MAX_CUT_RADIUS * longest;
        if !is_useful || normal == glam::DVec3::ZERO || !piece.has_room() {
            return self.halve(piece, slot);
        }
        let heights = piece.corners().iter().map(|p| (*p - face[0]).dot(normal).abs());
        let over = heights.fold(0.0, f64::max);
        let over = if over < limit { over } else { height.min(limit) };
        let offset = CUT_OFFSET * (limit * limit - over * over).max(0.0).sqrt();
        let sliver = MIN_CUT_SHARE * offset + f64::EPSILON;
        let mut inside = piece;
        for k in 0..3 {
            let out = (face[(k + 1) % 3] - face[k]).cross(normal).normalize_or_zero();
            let Some((within, mut beyond)) = inside.cut(face[k] + out * offset, out, sliver) else {
                continue;
            };
            inside = within;
            (beyond.near, beyond.is_tried, beyond.cut_by) = (slot, true, u32::MAX);
            self.pieces.push(beyond);
        }
        if inside.has_same_corners(&piece) {
            return self.halve(piece, slot);
        }
        (inside.near, inside.is_tried, inside.cut_by) = (slot, false, slot);
        self.pieces.push(inside);
    }

    fn halve(&mut self, piece: Piece<R::Value>, slot: u32) {
        for mut half in piece.halves() {
            (half.near, half.is_tried) = (slot, false);
            self.pieces.push(half);
        }
    }
}
