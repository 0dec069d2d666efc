//! The triangles around a collapsing edge, before and after, four side by side.

use bytemuck::cast;
use glam::Vec3;
use lodsmith_core::VertexId;
use wide::{f32x4, i32x4, u32x4};

use super::commit::{NO_AREA, SUSPECT_TURN};
use super::store::{Corner, Ring, Spoke, Store};
use crate::lanes::{self, Four, cross, dot, sub};
use crate::metric::Memory;
use crate::report::Refusal;
use crate::tensor::Tensor;

/// A triangle of the star of a collapsing edge, before and after.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wing {
    pub(crate) corner: Corner,
    pub(crate) a: VertexId,
    pub(crate) b: VertexId,
    /// Normal after, of double length; zero if it goes.
    pub(crate) after: Vec3,
    /// It has both ends, and goes.
    pub(crate) both: bool,
}

/// The triangles of the star of a collapsing edge, in the order of the rings of its ends.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wings {
    /// The first `used` of them; written where they stay.
    fours: Vec<FourWings>,
    used: usize,
}

/// Up to four of them side by side, at one end. Lanes that are not used repeat the last one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FourWings {
    pub(super) spokes: [Spoke; 4],
    pub(super) count: usize,
    pub(super) normal: Four,
    pub(super) length: f32x4,
    pub(super) after: Four,
    /// A bit for each that does not go.
    pub(super) stays: u32,
}

impl Wings {
    pub(crate) fn clear(&mut self) {
        self.used = 0;
    }

    /// The next one, to be written.
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

    /// Adds triangles that share no more than their rim with what they become.
    pub(crate) fn add_rim(&mut self, ring: &Ring, goes: impl Fn(&Spoke) -> bool) {
        for few in ring.chunks(4) {
            let spokes = [0, 1, 2, 3].map(|i: usize| few[i.min(few.len() - 1)]);
            let (count, none) = (few.len(), [f32x4::ZERO; 3]);
            let stays = (0..4).filter(|&i| !goes(&spokes[i])).fold(0, |bits, i| bits | 1 << i);
            *self.slot() = FourWings { spokes, count, normal: none, length: f32x4::ZERO, after: none, stays };
        }
    }

    /// One after the other.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Wing> + '_ {
        self.fours[..self.used].iter().flat_map(|four| (0..four.count).map(|i| four.wing(i)))
    }

    /// Four by four; those of the kept end first.
    #[inline(always)]
    pub(super) fn fours(&self) -> &[FourWings] {
        &self.fours[..self.used]
    }

    /// Of each, what the tensors around it lose and gain when the collapse is done, and what the merged vertex gains.
    /// `weigh` says what n nᵀ counts, by the lengths of normals.
    #[inline(always)]
    pub(super) fn swaps(
        &self,
        weigh: impl Fn(f32x4) -> f32x4,
        mut swap: impl FnMut([VertexId; 2], &Tensor, &Tensor),
    ) {
        for four in &self.fours[..self.used] {
            let old = lanes::outer(&four.normal, -weigh(four.length));
            // (Of those that go, nothing.)
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
pub(super) struct End {
    pub(super) from: Vec3,
    /// Where the merged vertex goes, from here.
    pub(super) step: Vec3,
    /// The other end, where triangles with both count here: twice.
    pub(super) other: Option<VertexId>,
}

/// What the triangles say of a collapse, each lane of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Verdict {
    /// Twice the areas times the squared heights over the old planes, summed.
    cost: f32x4,
    /// Twice the areas, summed.
    area: f32x4,
    /// The largest squared height.
    peak: f32x4,
    /// The worst squared shape of a new triangle.
    shape: f32x4,
    /// Whether a triangle turns so far that folds must be looked for.
    pub(super) turns_far: bool,
}

impl Default for Verdict {
    fn default() -> Self {
        let zero = f32x4::ZERO;
        Self { cost: zero, area: zero, peak: zero, shape: f32x4::ONE, turns_far: false }
    }
}

impl Verdict {
    /// Cost, area, largest squared height and worst squared shape of all.
    #[inline(always)]
    pub(super) fn sum(&self) -> (f32, f32, f32, f32) {
        let peak = self.peak.to_array().into_iter().fold(0.0, f32::max);
        let shape = self.shape.to_array().into_iter().fold(1.0, f32::min);
        (self.cost.reduce_add(), self.area.reduce_add(), peak, shape)
    }
}

impl<Q: Memory> Store<Q> {
    /// Looks at the triangles of one end as they are when it has gone to `at`: adds them to the wings and to the verdict.
    /// Says how far the farthest neighbour lies ahead of the end, along its step.
    #[inline(always)]
    pub(super) fn look_at_wings(
        &self,
        spokes: &Ring,
        end: &End,
        at: Vec3,
        max_turn: f32,
        wings: &mut Wings,
        verdict: &mut Verdict,
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
            verdict.peak = verdict.peak.fast_max(height * height);

            let (s, o) = (sub(&at, &pa), sub(&at, &pb));
            let after = cross(&e, &s);
            let (after_sq, along) = (dot(&after, &after), dot(&normal, &after));
            let (along_sq, both_sq) = (along * along, length_sq * after_sq);
            let keeps_side = along.simd_gt(f32x4::ZERO) & along_sq.simd_gt(both_sq * max_turn);
            let around = dot(&e, &e) + dot(&s, &s) + dot(&o, &o);
            let new_shape = after_sq * 12.0 / (around * around).fast_max(f32x4::splat(1e-37));
            verdict.shape = both.bitselect(verdict.shape, verdict.shape.fast_min(new_shape));
            let far = along_sq.simd_lt(both_sq * SUSPECT_TURN);
            let is_thin = new_shape.simd_lt(f32x4::splat(NO_AREA));
            let stays = !both.to_bitmask();
            verdict.turns_far |= far.to_bitmask() & stays != 0;
            let wrong = (!keeps_side.to_bitmask() | is_thin.to_bitmask()) & stays & 0xf;
            if wrong != 0 {
                let turned = !keeps_side.to_bitmask();
                self.ask_wrong(four, wrong, turned, end.from, [length_sq, after_sq, new_shape])?;
            }
            // What repeats adds nothing.
            let counts: f32x4 = cast(i32x4::new([0, 1, 2, 3]).simd_lt(i32x4::splat(left as i32)));
            verdict.cost += loss & counts;
            verdict.area += weight & counts;
            let after = after.map(|x| both.bitselect(f32x4::ZERO, x));
            let slot = wings.slot();
            (slot.spokes, slot.count, slot.stays) = (*four, left.min(4), stays);
            (slot.normal, slot.length, slot.after) = (normal, length, after);
        }
        Ok(behind.to_array().into_iter().fold(f32::INFINITY, f32::min))
    }

    /// What is wrong with triangles that turn (`turned`) or get too thin, if it is the collapse that makes them so.
    #[cold]
    #[inline(never)]
    fn ask_wrong(
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
            // A face without area has no normal that could turn.
            if turned & (1 << i) != 0 && (length_sq[i] > NO_AREA * e_sq * e_sq || after_sq[i] == 0.0) {
                return Err(Refusal::NormalFlip);
            }
            let before = e_sq + (from - pa).length_squared() + (from - pb).length_squared();
            if new_shape[i] < NO_AREA && 12.0 * length_sq[i] > new_shape[i] * before * before {
                return Err(Refusal::Quality);
            }
        }
        Ok(())
    }
}
