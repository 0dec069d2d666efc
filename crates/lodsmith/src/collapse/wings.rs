//! The triangles around a collapsing edge, before and after, four side by side.

use bytemuck::cast;
use glam::Vec3;
use lodsmith_core::VertexId;
use wide::{f32x4, i32x4, u32x4};

use super::ring::{Corner, Ring, Spoke};
use super::store::Store;
use crate::cost::lanes::{self, Four, cross, dot, sub};
use crate::cost::metric::VertexMemory;
use crate::cost::tensor::Tensor;
use crate::report::Refusal;

/// Squared quality below which a new triangle counts as having no area, unless it was no better before: just
/// above the resolution of single precision. (Measured: at 1e-7 fans of slivers block each other, and
/// brain588k at 100 faces is four times worse.)
pub(super) const MIN_SHAPE_SQ: f32 = 1e-11;
/// Squared cosine of the rotation above which folds with the adjacent faces are checked: 45 degrees.
pub(super) const FOLD_CHECK_COS_SQ: f32 = 0.5;

/// A triangle of the star of a collapsing edge, before and after.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wing {
    pub(crate) corner: Corner,
    pub(crate) a: VertexId,
    pub(crate) b: VertexId,
    /// Its normal afterwards, twice its area long; zero if it is removed.
    pub(crate) after: Vec3,
    /// True if it contains both ends, and is removed.
    pub(crate) both: bool,
}

/// The triangles of the star of a collapsing edge, in the order of the rings of its ends.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wings {
    /// Groups of four; the first `used` are valid. Written in place.
    fours: Vec<FourWings>,
    used: usize,
}

/// Up to four wings side by side, at one end. Unused lanes repeat the last one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FourWings {
    pub(super) spokes: [Spoke; 4],
    pub(super) count: usize,
    pub(super) normal: Four,
    pub(super) length: f32x4,
    pub(super) after: Four,
    /// Bit mask of the wings that are not removed.
    pub(super) stays: u32,
}

impl Wings {
    pub(crate) fn clear(&mut self) {
        self.used = 0;
    }

    /// Returns the next group to be written.
    #[inline(always)]
    fn slot(&mut self) -> &mut FourWings {
        if self.used == self.fours.len() {
            self.grow();
        }
        self.used += 1;
        &mut self.fours[self.used - 1]
    }

    #[cold]
    #[inline(never)]
    fn grow(&mut self) {
        self.fours.resize(2 * self.used + 8, FourWings::default());
    }

    /// Adds triangles of which only the rim is used.
    pub(crate) fn add_rim(&mut self, ring: &Ring, goes: impl Fn(&Spoke) -> bool) {
        for few in ring.chunks(4) {
            let spokes = [0, 1, 2, 3].map(|i: usize| few[i.min(few.len() - 1)]);
            let (count, none) = (few.len(), [f32x4::ZERO; 3]);
            let stays = (0..4).filter(|&i| !goes(&spokes[i])).fold(0, |bits, i| bits | 1 << i);
            *self.slot() = FourWings { spokes, count, normal: none, length: f32x4::ZERO, after: none, stays };
        }
    }

    /// Iterates over the wings.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Wing> + '_ {
        self.fours[..self.used].iter().flat_map(|four| (0..four.count).map(|i| four.wing(i)))
    }

    /// Returns the groups of four; the groups of the kept end come first.
    #[inline(always)]
    pub(super) fn fours(&self) -> &[FourWings] {
        &self.fours[..self.used]
    }

    /// For each wing, calls `swap` with the change of the tensors at its rim after the collapse, and the
    /// tensor that the merged vertex gains. `weigh` returns the weight of n nᵀ from the lengths of normals.
    #[inline(always)]
    pub(super) fn swaps(
        &self,
        weigh: impl Fn(f32x4) -> f32x4,
        mut swap: impl FnMut([VertexId; 2], &Tensor, &Tensor),
    ) {
        for four in &self.fours[..self.used] {
            let old = lanes::outer(&four.normal, -weigh(four.length));
            // (Zero for removed ones.)
            let new = lanes::outer(&four.after, weigh(dot(&four.after, &four.after).sqrt()));
            let change = lanes::tensors(std::array::from_fn(|k| old[k] + new[k]));
            let new = lanes::tensors(new);
            for i in 0..four.count.min(4) {
                swap([four.spokes[i].a, four.spokes[i].b], &change[i], &new[i]);
            }
        }
    }
}

impl FourWings {
    fn wing(&self, i: usize) -> Wing {
        let of = |four: &Four| Vec3::from(four.map(|x| x.to_array()[i]));
        let Spoke { corner, a, b } = self.spokes[i];
        Wing { corner, a, b, after: of(&self.after), both: self.stays & (1 << i) == 0 }
    }
}

/// An end of a collapsing edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeEnd {
    pub(super) from: Vec3,
    /// Displacement to the merged vertex.
    pub(super) step: Vec3,
    /// The other end, if triangles that contain both ends are counted at this end (twice).
    pub(super) other: Option<VertexId>,
}

/// Statistics of the triangles of a collapse, by lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct StarStats {
    /// Sum of twice the areas times the squared heights over the old planes.
    cost: f32x4,
    /// Sum of twice the areas.
    area: f32x4,
    /// The largest squared height.
    peak: f32x4,
    /// True if a triangle turns so far that folds must be checked.
    pub(super) turns_far: bool,
}

impl Default for StarStats {
    fn default() -> Self {
        let zero = f32x4::ZERO;
        Self { cost: zero, area: zero, peak: zero, turns_far: false }
    }
}

impl StarStats {
    /// Returns the cost, the area and the largest squared height.
    #[inline(always)]
    pub(super) fn sum(&self) -> (f32, f32, f32) {
        let peak = self.peak.to_array().into_iter().fold(0.0, f32::max);
        (self.cost.reduce_add(), self.area.reduce_add(), peak)
    }
}

impl<Q: VertexMemory> Store<Q> {
    /// Evaluates the triangles of one end for its new position `at`: adds them to the wings and to the
    /// stats. Returns how far the farthest neighbour is ahead of the end, along its displacement.
    #[inline(always)]
    pub(super) fn evaluate_wings(
        &self,
        spokes: &Ring,
        end: &EdgeEnd,
        at: Vec3,
        max_turn: f32,
        wings: &mut Wings,
        stats: &mut StarStats,
    ) -> Result<f32, Refusal> {
        let (from, step, at) = (lanes::splat(end.from), lanes::splat(end.step), lanes::splat(at));
        let mut behind = f32x4::splat(f32::INFINITY);
        for (i, four) in spokes.fours().iter().enumerate() {
            let left = spokes.len() - 4 * i;
            let (a, b) = (four.map(|s| s.a), four.map(|s| s.b));
            let (pa, pb) = (self.four(a), self.four(b));
            let both = match end.other {
                Some(other) => {
                    let is_other =
                        |w: [VertexId; 4]| u32x4::new(w.map(|w| w.0)).simd_eq(u32x4::splat(other.0));
                    cast(is_other(a) | is_other(b))
                }
                None => f32x4::ZERO,
            };
            let (e, back) = (sub(&pb, &pa), sub(&from, &pa));
            behind = behind.fast_min(-dot(&back, &step));
            let normal = cross(&e, &back);
            let length_sq = dot(&normal, &normal);
            let length = length_sq.sqrt();
            let height = dot(&normal, &step) / length.fast_max(f32x4::splat(1e-30));
            let weight = both.bitselect(length + length, length);
            let loss = weight * height * height;
            stats.peak = stats.peak.fast_max(height * height);

            let (s, o) = (sub(&at, &pa), sub(&at, &pb));
            let after = cross(&e, &s);
            let (after_sq, along) = (dot(&after, &after), dot(&normal, &after));
            let (along_sq, both_sq) = (along * along, length_sq * after_sq);
            let keeps_side = along.simd_gt(f32x4::ZERO) & along_sq.simd_gt(both_sq * max_turn);
            let around = dot(&e, &e) + dot(&s, &s) + dot(&o, &o);
            let new_shape = after_sq * 12.0 / (around * around).fast_max(f32x4::splat(1e-37));
            let far = along_sq.simd_lt(both_sq * FOLD_CHECK_COS_SQ);
            let is_thin = new_shape.simd_lt(f32x4::splat(MIN_SHAPE_SQ));
            let stays = !both.to_bitmask();
            stats.turns_far |= far.to_bitmask() & stays != 0;
            let wrong = (!keeps_side.to_bitmask() | is_thin.to_bitmask()) & stays & 0xf;
            if wrong != 0 {
                let turned = !keeps_side.to_bitmask();
                self.check_turn_and_shape(four, wrong, turned, end.from, [length_sq, after_sq, new_shape])?;
            }
            // Lanes that repeat the last one add nothing.
            let counts: f32x4 = cast(i32x4::new([0, 1, 2, 3]).simd_lt(i32x4::splat(left as i32)));
            stats.cost += loss & counts;
            stats.area += weight & counts;
            let after = after.map(|x| both.bitselect(f32x4::ZERO, x));
            let slot = wings.slot();
            (slot.spokes, slot.count, slot.stays) = (*four, left.min(4), stays);
            (slot.normal, slot.length, slot.after) = (normal, length, after);
        }
        Ok(behind.to_array().into_iter().fold(f32::INFINITY, f32::min))
    }

    /// Refuses triangles that turn over (`turned`) or become too thin, if the collapse makes them so.
    #[cold]
    #[inline(never)]
    fn check_turn_and_shape(
        &self,
        spokes: &[Spoke; 4],
        wrong: u32,
        turned: u32,
        from: Vec3,
        [length_sq, after_sq, new_shape]: [f32x4; 3],
    ) -> Result<(), Refusal> {
        let (length_sq, after_sq, new_shape) =
            (length_sq.to_array(), after_sq.to_array(), new_shape.to_array());
        for i in (0..4).filter(|i| wrong & (1 << i) != 0) {
            let (pa, pb) = (self.p(spokes[i].a), self.p(spokes[i].b));
            let e_sq = (pb - pa).length_squared();
            // A face without area has no normal to turn.
            if turned & (1 << i) != 0 && (length_sq[i] > MIN_SHAPE_SQ * e_sq * e_sq || after_sq[i] == 0.0) {
                return Err(Refusal::NormalFlip);
            }
            let before = e_sq + (from - pa).length_squared() + (from - pb).length_squared();
            if new_shape[i] < MIN_SHAPE_SQ && 12.0 * length_sq[i] > new_shape[i] * before * before {
                return Err(Refusal::Quality);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::VertexId;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::cost::metric::{Memoryless, Metric};
    use crate::test_support::{bits, tame_vector, vector};

    /// Results for one triangle.
    struct ExpectedWing {
        weight: f32,
        height: f32,
        normal: Vec3,
        after: Vec3,
        turns_far: bool,
        refused: Option<Refusal>,
        behind: f32,
    }

    /// Evaluates one triangle at `from`, which moves to `at`, as [`Store::evaluate_wings`] does.
    fn expected_wing(
        [from, step, at]: [Vec3; 3],
        [a, b]: [Vec3; 2],
        both: bool,
        max_turn: f32,
    ) -> ExpectedWing {
        let (e, back) = (b - a, from - a);
        let normal = e.cross(back);
        let length = normal.length();
        let after = e.cross(at - a);
        let (length_sq, after_sq) = (normal.length_squared(), after.length_squared());
        let (along, both_sq) = (normal.dot(after), length_sq * after_sq);
        let around = e.length_squared() + (at - a).length_squared() + (at - b).length_squared();
        let shape = after_sq * 12.0 / (around * around).max(1e-37);
        let keeps_side = along > 0.0 && along * along > both_sq * max_turn;
        let before = e.length_squared() + back.length_squared() + (from - b).length_squared();
        let had_area = length_sq > MIN_SHAPE_SQ * e.length_squared() * e.length_squared();
        let refused = if both {
            None
        } else if !keeps_side && (had_area || after_sq == 0.0) {
            Some(Refusal::NormalFlip)
        } else {
            (shape < MIN_SHAPE_SQ && 12.0 * length_sq > shape * before * before).then_some(Refusal::Quality)
        };
        ExpectedWing {
            weight: if both { length + length } else { length },
            height: normal.dot(step) / length.max(1e-30),
            normal,
            after: if both { Vec3::ZERO } else { after },
            turns_far: !both && along * along < both_sq * FOLD_CHECK_COS_SQ,
            refused,
            behind: -back.dot(step),
        }
    }

    /// Returns a fan of vertex 0 with this rim, numbered from 1, closed if `is_closed`.
    fn fan(centre: Vec3, rim: &[Vec3], is_closed: bool) -> (Store<Tensor>, Ring) {
        let points: Vec<Vec3> = std::iter::once(centre).chain(rim.iter().copied()).collect();
        let n = rim.len() as u32;
        let count = if is_closed { n } else { n - 1 };
        let faces = (0..count).map(|i| [0, 1 + i, 1 + (i + 1) % n].map(VertexId)).collect();
        let mut store = Store::new(&points, faces, None, None);
        store.link();
        let mut ring = Ring::default();
        store.ring(VertexId(0), &mut ring);
        (store, ring)
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1024) })]

        #[test]
        fn four_triangles_at_once_give_the_result_of_each(
            centre in tame_vector(),
            // Well-shaped ones, of which few are refused, and arbitrary ones.
            rim in prop_oneof![vec(tame_vector(), 3..14), vec(vector(), 3..14)],
            step in prop_oneof![3 => tame_vector().prop_map(|x| x * 0.1), 1 => vector()],
            is_closed in any::<bool>(),
            other in prop::option::of(1u32..14),
            max_turn in prop_oneof![Just(0.04f32), Just(0.0), Just(0.9)],
        ) {
            let (store, ring) = fan(centre, &rim, is_closed);
            let other = other.filter(|&w| (w as usize) <= rim.len()).map(VertexId);
            let (end, at) = (EdgeEnd { from: centre, step, other }, centre + step);
            let (mut wings, mut stats) = (Wings::default(), StarStats::default());
            let found = store.evaluate_wings(&ring, &end, at, max_turn, &mut wings, &mut stats);

            let each: Vec<ExpectedWing> = ring
                .iter()
                .map(|r| {
                    let both = other.is_some_and(|w| r.has(w));
                    expected_wing([centre, step, at], [store.p(r.a), store.p(r.b)], both, max_turn)
                })
                .collect();
            if let Some(first) = each.iter().find_map(|t| t.refused) {
                prop_assert_eq!(found, Err(first));
                return Ok(());
            }
            let behind = each.iter().map(|t| t.behind).fold(f32::INFINITY, f32::min);
            // (Which of the two zeros is smaller depends on the order.)
            prop_assert_eq!(found.map(|x| bits([x])), Ok(bits([behind])));
            let (cost, area, peak) = stats.sum();
            let losses = || each.iter().map(|t| t.weight * t.height * t.height);
            // The same summands in another order.
            let is_near = |a: f32, b: f32| a == b || (a - b).abs() <= 1e-5 * b;
            prop_assert!(is_near(cost, losses().sum()), "{cost} {}", losses().sum::<f32>());
            prop_assert!(is_near(area, each.iter().map(|t| t.weight).sum()));
            let highest = each.iter().map(|t| t.height * t.height).fold(0.0, f32::max);
            prop_assert_eq!(peak.to_bits(), highest.to_bits());
            prop_assert_eq!(stats.turns_far, each.iter().any(|t| t.turns_far));

            let all: Vec<Wing> = wings.iter().collect();
            prop_assert_eq!(all.len(), each.len());
            for ((wing, expected), spoke) in all.iter().zip(&each).zip(&ring) {
                prop_assert_eq!((wing.a, wing.b, wing.corner), (spoke.a, spoke.b, spoke.corner));
                prop_assert_eq!(bits(wing.after.to_array()), bits(expected.after.to_array()));
                prop_assert_eq!(wing.both, other.is_some_and(|w| spoke.has(w)));
            }

            // Tensor changes at the rim.
            let mut swapped = Vec::new();
            let weigh = |lengths| Memoryless.plane_weights(lengths, 1.0);
            wings.swaps(weigh, |rim, change, new| swapped.push((rim, *change, *new)));
            prop_assert_eq!(swapped.len(), each.len());
            for ((rim, change, new), (expected, spoke)) in swapped.iter().zip(each.iter().zip(&ring)) {
                let outer = |n: Vec3| Tensor::outer(n, Memoryless.plane_weight(n.length(), 1.0));
                let (old, wanted) = (outer(expected.normal), outer(expected.after));
                prop_assert_eq!(*rim, [spoke.a, spoke.b]);
                let off = wanted.less(&old).less(change).0.into_iter().chain(wanted.less(new).0);
                let size = old.trace() + wanted.trace();
                prop_assert!(off.into_iter().all(|x| x.abs() <= 1e-6 * size), "{change:?} {new:?}");
            }
        }
    }
}
