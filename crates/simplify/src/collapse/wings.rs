//! The triangles around a collapsing edge, before and after, four side by side.

use bytemuck::cast;
use glam::Vec3;
use lodsmith_core::VertexId;
use wide::{f32x4, u32x4};

use super::commit::{NO_AREA, SUSPECT_TURN};
use super::store::{Corner, Spoke, Store};
use crate::lanes::{self, cross, dot, sub};
use crate::metric::Memory;
use crate::report::Refusal;

/// A triangle of the star of a collapsing edge, before and after.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wing {
    pub(crate) corner: Corner,
    pub(crate) a: VertexId,
    pub(crate) b: VertexId,
    /// Normal before, of double length, and its length.
    pub(crate) normal: Vec3,
    pub(crate) length: f32,
    /// Normal after, of double length; zero if it goes.
    pub(crate) after: Vec3,
    /// It has both ends, and goes.
    pub(crate) both: bool,
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

/// What the triangles say of a collapse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Verdict {
    /// Twice the areas times the squared heights over the old planes, summed.
    pub(super) cost: f32,
    /// Twice the areas, summed.
    pub(super) area: f32,
    /// The largest squared height.
    pub(super) peak: f32,
    /// The worst squared shape of a new triangle.
    pub(super) shape: f32,
    /// Whether a triangle turns so far that folds must be looked for.
    pub(super) turns_far: bool,
}

impl<Q: Memory> Store<Q> {
    /// Looks at the triangles of one end as they are when it has gone to `at`: adds them to the wings and to the verdict.
    /// Says how far the farthest neighbour lies ahead of the end, along its step.
    #[inline(always)]
    pub(super) fn look_at_wings(
        &self,
        spokes: &[Spoke],
        end: &End,
        at: Vec3,
        max_turn: f32,
        wings: &mut Vec<Wing>,
        verdict: &mut Verdict,
    ) -> Result<f32, Refusal> {
        let (from, step, at) = (lanes::splat(end.from), lanes::splat(end.step), lanes::splat(at));
        let mut peak = f32x4::splat(verdict.peak);
        let mut shape = f32x4::splat(verdict.shape);
        let mut behind = f32x4::splat(f32::INFINITY);
        for few in spokes.chunks(4) {
            let last = few.len() - 1;
            let four = [few[0], few[1.min(last)], few[2.min(last)], few[3.min(last)]];
            let (a, b) = (four.map(|s| s.a), four.map(|s| s.b));
            let (pa, pb) = (lanes::gather(a.map(|w| self.p(w))), lanes::gather(b.map(|w| self.p(w))));
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
            peak = peak.fast_max(height * height);

            let (s, o) = (sub(&at, &pa), sub(&at, &pb));
            let after = cross(&e, &s);
            let (after_sq, along) = (dot(&after, &after), dot(&normal, &after));
            let (along_sq, both_sq) = (along * along, length_sq * after_sq);
            let keeps_side = along.simd_gt(f32x4::ZERO) & along_sq.simd_gt(both_sq * max_turn);
            let around = dot(&e, &e) + dot(&s, &s) + dot(&o, &o);
            let new_shape = after_sq * 12.0 / (around * around).fast_max(f32x4::splat(1e-37));
            shape = both.bitselect(shape, shape.fast_min(new_shape));
            let far = along_sq.simd_lt(both_sq * SUSPECT_TURN);
            let is_thin = new_shape.simd_lt(f32x4::splat(NO_AREA));
            let stays = !both.to_bitmask();
            verdict.turns_far |= far.to_bitmask() & stays != 0;
            let wrong = (!keeps_side.to_bitmask() | is_thin.to_bitmask()) & stays & 0xf;
            if wrong != 0 {
                let turned = !keeps_side.to_bitmask();
                self.ask_wrong(&four, wrong, turned, end.from, [length_sq, after_sq, new_shape])?;
            }
            let (loss, weight) = (loss.to_array(), weight.to_array());
            let normals = f32x4::transpose([normal[0], normal[1], normal[2], length]).map(f32x4::to_array);
            let after = after.map(|x| both.bitselect(f32x4::ZERO, x));
            let afters = f32x4::transpose([after[0], after[1], after[2], f32x4::ZERO]).map(f32x4::to_array);
            // (In the order of the ring, so that it does not matter how many lie side by side.)
            for (loss, weight) in loss.iter().zip(&weight).take(few.len()) {
                verdict.cost += loss;
                verdict.area += weight;
            }
            wings.extend(few.iter().zip(normals.iter().zip(&afters)).enumerate().map(
                |(i, (s, (n, after)))| Wing {
                    corner: s.corner,
                    a: s.a,
                    b: s.b,
                    normal: Vec3::new(n[0], n[1], n[2]),
                    length: n[3],
                    after: Vec3::new(after[0], after[1], after[2]),
                    both: stays & (1 << i) == 0,
                },
            ));
        }
        verdict.peak = peak.to_array().into_iter().fold(0.0, f32::max);
        verdict.shape = shape.to_array().into_iter().fold(1.0, f32::min);
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
