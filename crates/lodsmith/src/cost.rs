//! Cost of a collapse: its formula, its constants and their reasons on one page.
//!
//! ```text
//! of a form (evaluate)    q · (1 + PEAK_GUESS · min(w / trace, PEAK_OF_STAR)) + tie
//! exact (commit, pairs)   Σ area · height² + lines + attributes + max(min(w, PEAK_OF_STAR · area) · peak, w · tip) + tie
//! of a pair               the same + GAP_WEIGHT · mean · gap²
//! sampled (late phase)    the same with w = 0, + LOSS_WEIGHT · growth of the loss + FARTHEST_WEIGHT · mean · farthest²
//!
//! q = y·A·y − 2 h·y + c   the form of the edge at the new position y: squared distances to the planes of both stars
//! trace, area             the size of A, and doubled areas of the star; `mean` is the mean doubled area of a live face
//! peak, tip               the largest squared distance from a plane, and the squared distance of an uncovered end
//! w = PEAK_WEIGHT · mean; tie = ½ · TIE · size · (|y|² + |y − d|²), with d from the kept to the removed end
//! ```
//!
//! The form is cheap and separates most edges; the exact cost is computed only for the best edge of a vertex.
//! Forms are evaluated one at a time and four side by side, by the same formula; a test compares the two.

pub(crate) mod guard;
pub(crate) mod lanes;
pub(crate) mod metric;
pub(crate) mod tensor;

use glam::Vec3;
use wide::f32x4;

use crate::cost::lanes::{Four, dot, sub};
use crate::cost::metric::Form;

/// Cost of length, a share of area · length²: decides among flat collapses only. (docs/decisions/0003)
pub(crate) const TIE: f32 = 1e-11;
/// Weight of the largest squared distance, times the mean area of a triangle: protects small features. (Measured on 12
/// cases: 0.1, 0.2 and 0.3 have equal means within a percent; from 0.2 on the largest distances are a third lower.)
const PEAK_WEIGHT: f32 = 0.2;
/// Limit of that weight, a share of the star's own area: on meshes with faces of all sizes the mean
/// triangle is far larger than the triangles of a fillet. Uncovered positions have no such limit: tips often
/// end in tiny faces. (Measured: docs/decisions/0001.)
const PEAK_OF_STAR: f32 = 0.3;
/// Assumed ratio of the largest to the mean squared distance, until it is computed. (docs/decisions/0001)
pub(crate) const PEAK_GUESS: f32 = 4.0;
/// Weight of the squared distance of an uncovered end relative to a squared distance from a plane. (Measured
/// on horse, horse400k, horse1.5m, nefertiti, brain_mri, bunny: the largest distances fall by up to ten, the
/// means stay within a percent.)
const TIP_WEIGHT: f32 = 4.0;
/// Weight of the squared gap that a pair closes, times the mean area of a triangle: two flat sheets side by side would
/// have no other cost. (Guessed, so that a gap costs about as much as an edge of its length where the surface is
/// slightly curved; flat places are merged before.)
const GAP_WEIGHT: f32 = 1e-4;
/// Weight of the growth of the sampled loss. (6 would make it count like area · height², whose integral is a
/// sixth; 3 to 6 give equal results.)
const LOSS_WEIGHT: f32 = 4.0;
/// Weight of the farthest sample's squared distance, times the mean area of a triangle. (Measured with the
/// samples: at this value, the largest distances of cow, bunny and brain588k at 100 faces and of horse and
/// fandisk at 1 % are all below the best rival's; at 0.4 to 0.7 means stay within noise.)
const FARTHEST_WEIGHT: f32 = 0.7;

/// Pull of the best position towards the middle of the edge, a share of the trace. (docs/decisions/0003)
const MIDPOINT_PULL: f32 = 1e-5;
/// Share of trace³ below which the system is not solved. (Guessed.)
const MIN_DET: f32 = 1e-9;
/// Maximum distance of the best position from the middle of the edge, a share of length², squared.
/// (Measured: 0.5 to 4 have equal means; 1 has the lowest maxima at 100 faces.)
const MAX_OFF_MIDPOINT_SQ: f32 = 1.0;
/// Share of trace · length² below which a difference of squares in single precision is noise. Such a cost is
/// taken as 0, so that the exact cost is computed at the commit: only that one separates flat from nearly
/// flat.
const CANCELLATION_NOISE: f32 = 1e-8;
/// Share of trace · length² above which a difference of squares is accurate to about a thousandth: then the
/// attribute cost need not be recomputed from the triangles.
const MIN_SIGNIFICANT: f32 = 1e-5;

/// Returns the weight of a largest squared distance, by the mean doubled area of a live face.
#[inline(always)]
pub(crate) fn peak_weight(mean: f32) -> f32 {
    PEAK_WEIGHT * mean
}

/// Returns the cost of the largest squared distance from a plane of a star with this doubled area.
#[inline(always)]
pub(crate) fn of_peak(peak_weight: f32, area: f32, peak: f32) -> f32 {
    peak_weight.min(PEAK_OF_STAR * area) * peak
}

/// Returns the weighted squared distance of an uncovered end.
#[inline(always)]
pub(crate) fn of_tip(distance_sq: f32) -> f32 {
    TIP_WEIGHT * distance_sq
}

/// Returns the cost of the lengths of the displacements of both ends; `size` is an area.
#[inline(always)]
pub(crate) fn of_steps(size: f32, y: Vec3, off: Vec3) -> f32 {
    0.5 * TIE * size * (y.length_squared() + off.length_squared())
}

/// Returns the cost of the gap between the ends of a pair.
pub(crate) fn of_gap(mean: f32, gap_sq: f32) -> f32 {
    GAP_WEIGHT * mean * gap_sq
}

/// Returns a cost plus the cost of the samples: their loss before and after, and the squared distance of the
/// farthest one.
#[inline(always)]
pub(crate) fn with_samples(cost: f32, [before, loss]: [f32; 2], mean: f32, farthest_sq: f32) -> f32 {
    cost + LOSS_WEIGHT * (loss - before).max(0.0) + FARTHEST_WEIGHT * mean * farthest_sq
}

/// Returns the loss of the samples at which a cost reaches `max_cost`.
#[inline(always)]
pub(crate) fn loss_limit(cost: f32, before: f32, max_cost: f32) -> f32 {
    before + (max_cost - cost) / LOSS_WEIGHT
}

/// Returns the cost of a form at `y` for edge vector `d`, of a metric without memory.
#[inline(always)]
pub(crate) fn of_form(form: &Form, d: Vec3, y: Vec3, peak_weight: f32) -> f32 {
    let (q, trace, tie) = parts_of_form(form, d, y);
    let peak = 1.0 + PEAK_GUESS * (peak_weight / trace.max(1e-37)).min(PEAK_OF_STAR);
    let q = if q > CANCELLATION_NOISE * trace * d.length_squared() { q } else { 0.0 };
    q * peak + tie
}

/// Returns the cost of a form at `y` for edge vector `d`, of a metric with memory.
#[inline(always)]
pub(crate) fn of_accumulated_form(form: &Form, d: Vec3, y: Vec3) -> f32 {
    let (q, _, tie) = parts_of_form(form, d, y);
    q.max(0.0) + tie
}

/// Returns the form at `y`, its trace, and the cost of the displacements.
#[inline(always)]
fn parts_of_form(form: &Form, d: Vec3, y: Vec3) -> (f32, f32, f32) {
    let Form { a, h, c } = form;
    let trace = a.trace().max(0.0);
    let q = c - 2.0 * h.dot(y) + a.times(y).dot(y);
    (q, trace, of_steps(trace, y, y - d))
}

/// Returns the position of least cost by a form for edge vector `d`, unless the system is singular or it is
/// far from the middle.
#[inline(always)]
pub(crate) fn best_place(form: &Form, d: Vec3) -> Option<Vec3> {
    let Form { a, h, .. } = form;
    let (trace, mid) = (a.trace(), d * 0.5);
    let r = MIDPOINT_PULL * trace;
    let (adjugate, det) = a.damped(r).adjugate();
    if det > MIN_DET * trace * trace * trace {
        let y = adjugate.times(*h + mid * r) * (1.0 / det);
        if (y - mid).length_squared() < MAX_OFF_MIDPOINT_SQ * d.length_squared() {
            return Some(y);
        }
    }
    None
}

/// Four forms side by side.
pub(crate) struct FourForms {
    pub(crate) a: [f32x4; 6],
    pub(crate) h: Four,
    pub(crate) c: f32x4,
}

/// Costs of four edges side by side, each at its best position.
pub(crate) struct FourCosts {
    pub(crate) cost: f32x4,
    pub(crate) step: Four,
    /// The forms there, if they are accurate to a few digits and wanted; else 0.
    pub(crate) form_cost: f32x4,
    /// Mask of the lanes whose system could be solved.
    pub(crate) solved: f32x4,
}

/// Returns the costs of four forms for the edge vectors `d` at their best positions: [`best_place`] and [`of_form`] in
/// lanes.
#[inline(always)]
pub(crate) fn of_four(
    FourForms { a, h, c }: &FourForms,
    d: &Four,
    peak_weight: f32,
    wants_forms: bool,
) -> FourCosts {
    // (Rounding errors left by large attribute values that were subtracted again may be negative.)
    let trace = (a[0] + a[1] + a[2]).fast_max(f32x4::ZERO);
    let r = trace * MIDPOINT_PULL;
    let (m0, m1, m2) = (a[0] + r, a[1] + r, a[2] + r);
    let adjugate = [
        m1 * m2 - a[5] * a[5],
        m0 * m2 - a[4] * a[4],
        m0 * m1 - a[3] * a[3],
        a[5] * a[4] - a[3] * m2,
        a[3] * a[5] - m1 * a[4],
        a[3] * a[4] - m0 * a[5],
    ];
    let det = m0 * adjugate[0] + a[3] * adjugate[3] + a[4] * adjugate[4];
    let half = r * 0.5;
    let wish = [h[0] + d[0] * half, h[1] + d[1] * half, h[2] + d[2] * half];
    let y = times(&adjugate, &wish).map(|w| w / det);
    let from_mid = sub(&y, &d.map(|k| k * 0.5));
    let (from_mid_sq, d_sq) = (dot(&from_mid, &from_mid), dot(d, d));
    let solved =
        det.simd_gt(trace * trace * trace * MIN_DET) & from_mid_sq.simd_lt(d_sq * MAX_OFF_MIDPOINT_SQ);
    let peak = f32x4::splat(PEAK_GUESS * peak_weight) / trace.fast_max(f32x4::splat(1e-37));
    let peak = f32x4::ONE + peak.fast_min(f32x4::splat(PEAK_GUESS * PEAK_OF_STAR));
    let q = *c - dot(h, &y) * 2.0 + dot(&times(a, &y), &y);
    let size = trace * d_sq;
    let form_cost = match wants_forms {
        true => q.simd_gt(size * MIN_SIGNIFICANT) & q,
        false => f32x4::ZERO,
    };
    let q = q.simd_gt(size * CANCELLATION_NOISE) & q;
    // |y|² + |y - d|², from the middle.
    let spread = from_mid_sq + from_mid_sq + d_sq * 0.5;
    let tie = trace * (0.5 * TIE) * spread;
    FourCosts { cost: q * peak + tie, step: y, form_cost, solved }
}

/// Returns the costs of four forms for the edge vectors `d` at the better of the two ends, the kept one if they are
/// equal: [`of_form`] in lanes.
#[inline(always)]
pub(crate) fn of_four_ends(
    FourForms { a, h, c }: &FourForms,
    d: &Four,
    peak_weight: f32,
    wants_forms: bool,
) -> FourCosts {
    let trace = (a[0] + a[1] + a[2]).fast_max(f32x4::ZERO);
    let peak = f32x4::splat(PEAK_GUESS * peak_weight) / trace.fast_max(f32x4::splat(1e-37));
    let peak = f32x4::ONE + peak.fast_min(f32x4::splat(PEAK_GUESS * PEAK_OF_STAR));
    let d_sq = dot(d, d);
    let size = trace * d_sq;
    let significant = |q: f32x4, share: f32| q.simd_gt(size * share) & q;
    let there = *c - dot(h, d) * 2.0 + dot(&times(a, d), d);
    let (q, other) = (significant(*c, CANCELLATION_NOISE), significant(there, CANCELLATION_NOISE));
    let is_there = other.simd_lt(q);
    let form_cost = match wants_forms {
        true => significant(is_there.bitselect(there, *c), MIN_SIGNIFICANT),
        false => f32x4::ZERO,
    };
    let cost = q.fast_min(other) * peak + trace * (0.5 * TIE) * d_sq;
    let solved = f32x4::ZERO.simd_eq(f32x4::ZERO);
    FourCosts { cost, step: d.map(|x| is_there & x), form_cost, solved }
}

/// A symmetric matrix (xx, yy, zz, xy, xz, yz) times a vector, four side by side.
#[inline(always)]
pub(crate) fn times(a: &[f32x4; 6], d: &Four) -> Four {
    [
        a[0] * d[0] + a[3] * d[1] + a[4] * d[2],
        a[3] * d[0] + a[1] * d[1] + a[5] * d[2],
        a[4] * d[0] + a[5] * d[1] + a[2] * d[2],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::tensor::Tensor;

    /// Returns the form of planes, each given by a unit normal, the distance of the origin from it, and a weight.
    fn planes(all: &[(Vec3, f32, f32)]) -> Form {
        let mut form = Form::default();
        for &(n, distance, weight) in all {
            form.a.add(&Tensor::outer(n, weight));
            form.h += n * (distance * weight);
            form.c += weight * distance * distance;
        }
        form
    }

    fn assert_near(is: f32, wanted: f32) {
        assert!((is - wanted).abs() <= 1e-4 * wanted.abs(), "{is} instead of {wanted}");
    }

    #[test]
    fn a_form_costs_its_planes_the_guess_and_the_lengths() {
        // The planes z = 0.5 with weight 3 and x = 0 with weight 1, for an edge of length 2 along y.
        let form = planes(&[(Vec3::Z, 0.5, 3.0), (Vec3::X, 0.0, 1.0)]);
        let (d, y) = (Vec3::Y * 2.0, Vec3::new(0.25, 1.0, 0.0));
        let squares = 3.0 * 0.25 + 0.0625;
        assert_near(of_accumulated_form(&form, d, y), squares);
        assert_near(of_form(&form, d, y, 0.0), squares);
        // Four times the weight over the trace, which is 4; but at most four times .3.
        assert_near(of_form(&form, d, y, 0.1), squares * (1.0 + 4.0 * 0.025));
        assert_near(of_form(&form, d, y, 100.0), squares * (1.0 + 4.0 * 0.3));
        // On both planes only the lengths count: half of 1e-11 of the trace.
        let flat = planes(&[(Vec3::Z, 0.0, 3.0)]);
        assert_near(of_form(&flat, d, Vec3::Y, 0.1), 0.5e-11 * 3.0 * 2.0);
        assert_near(of_form(&flat, d, Vec3::ZERO, 0.1), 0.5e-11 * 3.0 * 4.0);
    }

    #[test]
    fn the_best_place_is_where_three_planes_meet() {
        let corner = planes(&[(Vec3::X, 0.5, 2.0), (Vec3::Y, -0.25, 1.0), (Vec3::Z, 0.125, 3.0)]);
        let found = best_place(&corner, Vec3::X).expect("a corner is a point");
        // (Pulled towards the middle of the edge by a hundred-thousandth of the trace.)
        assert!((found - Vec3::new(0.5, -0.25, 0.125)).length() < 1e-4, "{found}");
        // On the line of two planes it is the point nearest the middle of the edge.
        let line = planes(&[(Vec3::Y, 0.0, 1.0), (Vec3::Z, 0.0, 1.0)]);
        assert!((best_place(&line, Vec3::X).expect("pulled to the middle") - Vec3::X * 0.5).length() < 1e-4);
        // A single plane does not determine a position, and a position farther from the middle than the
        // length of the edge is rejected.
        assert_eq!(best_place(&planes(&[(Vec3::Z, 0.0, 1.0)]), Vec3::X), None);
        let beyond = |x: f32| {
            let planes = planes(&[(Vec3::X, x, 1.0), (Vec3::Y, 0.0, 1.0), (Vec3::Z, 0.0, 1.0)]);
            best_place(&planes, Vec3::X).is_some()
        };
        assert!(beyond(1.49) && !beyond(1.51) && beyond(-0.49) && !beyond(-0.51));
    }

    #[test]
    fn the_parts_of_a_cost_have_their_weights() {
        assert_near(peak_weight(2.0), 0.4);
        assert_near(of_peak(0.4, 10.0, 3.0), 1.2);
        assert_near(of_peak(0.4, 1.0, 3.0), 0.9);
        assert_near(of_tip(0.5), 2.0);
        assert_near(of_gap(2.0, 0.25), 0.5e-4);
        assert_near(of_steps(2.0, Vec3::X, Vec3::Y * 2.0), 1e-11 * 5.0);
        // Four times the growth of the loss, which never pays back, and .7 of the farthest.
        assert_near(with_samples(1.0, [2.0, 2.5], 3.0, 0.5), 1.0 + 2.0 + 1.05);
        assert_near(with_samples(1.0, [2.0, 1.5], 3.0, 0.0), 1.0);
        // At the limit of the loss, the cost reaches its maximum.
        let limit = loss_limit(1.0, 2.0, 4.0);
        assert_near(with_samples(1.0, [2.0, limit], 3.0, 0.0), 4.0);
    }
}
