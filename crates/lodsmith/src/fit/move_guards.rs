//! Guards for moves of single vertices.
//!
//! A collapse checks the guards for the faces that it makes; a move checks them for the faces that it
//! changes. A face or an edge that already breaks a guard may stay as it is, but no move may make it worse.
//! So every guard that holds before the fit holds after it.

use glam::Vec3;
use lodsmith_core::VertexId;

use crate::collapse::store::Store;
use crate::cost::guard::Rules;
use crate::cost::metric::VertexMemory;

/// Fractions of a move that are tried, the longest first: most moves that a guard refuses break it only near
/// their end. (Guessed.)
const MOVE_SHARES: [f32; 3] = [1.0, 0.5, 0.25];

/// The guards that a move can break. The valence is not among them: no move changes it.
pub(crate) struct MoveGuards {
    /// Square of the least quality of a face.
    min_shape: f32,
    max_edge_sq: f32,
    turn: Option<RotationLimit>,
}

/// Limit on the rotation of faces since the guards were made.
struct RotationLimit {
    /// Squared cosine of the largest angle.
    min_cos_sq: f32,
    /// Normals of the faces; their length is twice the area.
    normals: Vec<Vec3>,
}

impl MoveGuards {
    /// Returns the guards of a run; `None` if its options set none, so that nothing has to be checked.
    /// Rotations are relative to the faces as they are now.
    pub(crate) fn new<Q: VertexMemory>(rules: &Rules, store: &Store<Q>) -> Option<Self> {
        if !rules.guards_moves() {
            return None;
        }
        let normal = |t: &[VertexId; 3]| {
            let [a, b, c] = t.map(|v| store.p(v));
            (b - a).cross(c - a)
        };
        let turn = rules.guards_turns().then(|| RotationLimit {
            min_cos_sq: rules.max_turn,
            normals: store.t.iter().map(normal).collect(),
        });
        Some(Self { min_shape: rules.min_shape, max_edge_sq: rules.max_edge_sq, turn })
    }

    /// Returns true if a vertex may move to a position: each face and edge there keeps the guards, or is no
    /// worse than now.
    pub(crate) fn allow<Q: VertexMemory>(&self, store: &Store<Q>, u: VertexId, place: Vec3) -> bool {
        let from = store.p(u);
        store.listed(u).iter().all(|&corner| {
            let (a, b) = store.others_at(corner);
            let (a, b) = (store.p(a), store.p(b));
            let length_sq = |end: Vec3| [(end - a).length_squared(), (end - b).length_squared()];
            let ([near, far], [near_now, far_now]) = (length_sq(place), length_sq(from));
            let is_short = |length_sq: f32, now: f32| length_sq <= self.max_edge_sq || length_sq <= now;
            if !(is_short(near, near_now) && is_short(far, far_now)) {
                return false;
            }
            let after = shape(place, a, b);
            if after < self.min_shape && after < shape(from, a, b) {
                return false;
            }
            self.turn.as_ref().is_none_or(|turn| turn.allows(corner.face(), [from, place], a, b))
        })
    }

    /// Returns the farthest of some positions between here and `last` that the guards permit and `is_fine`
    /// accepts.
    pub(crate) fn farthest<Q: VertexMemory>(
        &self,
        store: &Store<Q>,
        u: VertexId,
        last: Vec3,
        is_fine: impl Fn(Vec3) -> bool,
    ) -> Option<Vec3> {
        let from = store.p(u);
        let place = |share: f32| if share == 1.0 { last } else { from + (last - from) * share };
        MOVE_SHARES.into_iter().map(place).find(|&p| p != from && is_fine(p) && self.allow(store, u, p))
    }
}

impl RotationLimit {
    fn allows(&self, face: usize, [from, place]: [Vec3; 2], a: Vec3, b: Vec3) -> bool {
        let before = self.normals[face];
        // Signed square of the cosine, times the square of the length before.
        let facing = |at: Vec3| {
            let normal = (b - a).cross(at - a);
            let along = before.dot(normal);
            along * along.abs() / normal.length_squared().max(f32::MIN_POSITIVE)
        };
        let least = self.min_cos_sq * before.length_squared();
        let after = facing(place);
        after >= least || after >= facing(from)
    }
}

/// Returns the squared quality of a triangle: 1 is equilateral, 0 flat.
fn shape(a: Vec3, b: Vec3, c: Vec3) -> f32 {
    let around = (b - a).length_squared() + (c - b).length_squared() + (a - c).length_squared();
    12.0 * (b - a).cross(c - a).length_squared() / (around * around).max(1e-37)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::tensor::Tensor;

    /// Returns four triangles around a vertex in the middle of a square.
    fn square() -> Store<Tensor> {
        let points =
            [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]];
        let faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]].map(|t| t.map(VertexId));
        let mut store = Store::<Tensor>::new(&points.map(Vec3::from), faces.to_vec(), None, None);
        store.link();
        store
    }

    fn allows(guards: &MoveGuards, store: &Store<Tensor>, place: [f32; 3]) -> bool {
        guards.allow(store, VertexId(0), place.into())
    }

    #[test]
    fn an_edge_may_grow_only_up_to_the_limit() {
        let mut store = square();
        let guards = MoveGuards { min_shape: 0.0, max_edge_sq: 1.5f32.powi(2), turn: None };
        assert!(allows(&guards, &store, [0.05, 0.0, 0.0]));
        assert!(!allows(&guards, &store, [0.5, 0.0, 0.0]));
        // Too long already: it may get shorter, but not longer.
        store.v[0].p = Vec3::new(0.5, 0.0, 0.0);
        assert!(!allows(&guards, &store, [0.6, 0.0, 0.0]));
        assert!(allows(&guards, &store, [0.4, 0.0, 0.0]));
        let farthest = guards.farthest(&store, VertexId(0), Vec3::new(-0.5, 0.0, 0.0), |_| true);
        assert_eq!(farthest, Some(Vec3::ZERO));
    }

    #[test]
    fn a_face_may_get_worse_only_down_to_the_limit() {
        let mut store = square();
        let guards = MoveGuards { min_shape: 0.5f32.powi(2), max_edge_sq: f32::INFINITY, turn: None };
        assert!(allows(&guards, &store, [0.1, 0.0, 0.0]));
        assert!(!allows(&guards, &store, [0.9, 0.0, 0.0]));
        store.v[0].p = Vec3::new(0.9, 0.0, 0.0);
        assert!(!allows(&guards, &store, [0.95, 0.0, 0.0]));
        assert!(allows(&guards, &store, [0.85, 0.0, 0.0]));
    }

    #[test]
    fn a_face_may_rotate_only_up_to_the_limit() {
        let mut store = square();
        let normals = vec![Vec3::Z * 2.0; 4];
        let turn = Some(RotationLimit { min_cos_sq: 30f32.to_radians().cos().powi(2), normals });
        let guards = MoveGuards { min_shape: 0.0, max_edge_sq: f32::INFINITY, turn };
        assert!(allows(&guards, &store, [0.0, 0.0, 0.5]));
        assert!(!allows(&guards, &store, [0.0, 0.0, 0.7]));
        store.v[0].p = Vec3::new(0.0, 0.0, 0.7);
        assert!(!allows(&guards, &store, [0.0, 0.0, 0.75]));
        assert!(allows(&guards, &store, [0.0, 0.0, 0.65]));
    }
}
