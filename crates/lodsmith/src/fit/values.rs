//! Least-squares fit of attribute values to the samples that also move the vertices.
//!
//! A sample counts only for a triangle of its own chart: next to a seam the nearest triangle may lie on the
//! other side. Wedges are merged along triangles that have both, so a chart of the input is one of the
//! result.

use glam::Vec3;
use lodsmith_core::{DisjointSets, WedgeId};
use wide::f32x4;

use crate::collapse::attributes::Attributes;
use crate::collapse::ring::Corner;
use crate::cost::tensor::Tensor;

/// Fraction of its own weight that holds a wedge to its present value. (Guessed.)
const DAMPING: f32 = 0.02;
const TRUSTED_RESIDUAL_RMS: f64 = 1.5;
/// Gauss-Seidel sweeps. (As many as for the positions.)
const SWEEPS: usize = 2;

/// The attributes of the ordered input.
#[derive(Clone, Debug)]
pub(crate) struct Originals {
    /// The row of each corner.
    wedges: Vec<[WedgeId; 3]>,
    /// The values of each row.
    values: Vec<f32x4>,
    /// The chart of each row, identified by its lowest row.
    charts: Vec<WedgeId>,
}

impl Originals {
    /// Copies the attributes before a run changes them.
    pub(crate) fn new(attributes: &Attributes, wedges: &[[WedgeId; 3]]) -> Self {
        let values = attributes.all_values();
        let mut sets = DisjointSets::new(attributes.count());
        for [a, b, c] in wedges {
            sets.join(a.0, b.0);
            sets.join(a.0, c.0);
        }
        let charts = sets.into_representatives().into_iter().map(WedgeId).collect();
        Self { wedges: wedges.to_vec(), values, charts }
    }

    fn chart(&self, row: WedgeId) -> WedgeId {
        self.charts[row.index()]
    }

    #[inline(always)]
    fn of(&self, w: WedgeId, lanes: usize) -> &[f32x4] {
        &self.values[w.index() * lanes..][..lanes]
    }
}

/// Sorts the corners of triangles by wedge; a corner is encoded as four times the triangle plus 0, 1 or 2.
/// Returns the corners and the start of each wedge's range.
fn by_wedge(wedges: &[[WedgeId; 3]], count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut at = vec![0u32; count + 2];
    for w in wedges.as_flattened() {
        at[w.index() + 2] += 1;
    }
    for i in 2..count + 2 {
        at[i] += at[i - 1];
    }
    let mut corners = vec![0; 3 * wedges.len()];
    for (f, t) in wedges.iter().enumerate() {
        for (k, &w) in t.iter().enumerate() {
            let at = &mut at[w.index() + 1];
            corners[*at as usize] = (4 * f + k) as u32;
            *at += 1;
        }
    }
    (corners, at)
}

/// For each corner of a triangle the two others, and the index of their product with it in a tensor of
/// barycentric coordinates: xy, xz, yz are at 3, 4, 5.
const OTHER_CORNERS: [[(usize, usize); 2]; 4] =
    [[(1, 3), (2, 4)], [(0, 3), (2, 5)], [(0, 4), (1, 5)], [(0, 0); 2]];

/// Sums over the samples of the values, for each final triangle.
pub(crate) struct Values<'a> {
    surfaces: ValueSurfaces<'a>,
    /// Sums of weight · b bᵀ.
    bb: Vec<Tensor>,
    /// Weight that holds each corner to its present value: without trusted samples nearby nothing else acts
    /// on it.
    damping: Vec<Vec3>,
    /// Sums of weight · b · (value of the sample − value of the triangle there), for each corner.
    wanted: Vec<f32x4>,
    /// The largest residual of a sample, as far as it is trusted: no corner changes by more.
    max_residual: Vec<f32x4>,
}

/// The values of the original and of the final triangles.
pub(super) struct ValueSurfaces<'a> {
    originals: &'a Originals,
    attributes: &'a mut Attributes,
    /// Wedges of the final triangles, and their charts.
    wedges: Vec<[WedgeId; 3]>,
    charts: Vec<WedgeId>,
    lanes: usize,
    /// Weighted square of a residual that is still trusted.
    trusted_sq: f32,
}

impl<'a> Values<'a> {
    /// Starts the sums for final triangles with these wedges, of a surface at an RMS distance of about `away`
    /// from the original.
    pub(crate) fn new(
        originals: &'a Originals,
        attributes: &'a mut Attributes,
        wedges: Vec<[WedgeId; 3]>,
        away: f64,
    ) -> Self {
        let (lanes, count) = (attributes.lanes(), wedges.len());
        let trusted_sq = (TRUSTED_RESIDUAL_RMS * away).powi(2).clamp(1e-30, 1e30) as f32;
        let chart = |t: &[WedgeId; 3]| originals.charts[attributes.original(t[0]).index()];
        let charts = wedges.iter().map(chart).collect();
        Self {
            surfaces: ValueSurfaces { originals, attributes, wedges, charts, lanes, trusted_sq },
            bb: vec![Tensor::default(); count],
            damping: vec![Vec3::ZERO; count],
            wanted: vec![f32x4::ZERO; 3 * lanes * count],
            max_residual: vec![f32x4::ZERO; lanes * count],
        }
    }

    pub(super) fn surfaces(&self) -> &ValueSurfaces<'a> {
        &self.surfaces
    }

    /// Returns the sums of each run of `len` triangles.
    pub(super) fn parts(&mut self, len: usize) -> Vec<PartOfValues<'_, 'a>> {
        let Self { surfaces, bb, damping, wanted, max_residual } = self;
        let (surfaces, lanes) = (&*surfaces, surfaces.lanes);
        let (mut wanted, mut max_residual) = (&mut wanted[..], &mut max_residual[..]);
        let part = |(k, (bb, damping)): (usize, (_, _))| {
            let bb: &mut [Tensor] = bb;
            PartOfValues {
                surfaces,
                first: k * len,
                damping,
                wanted: front(&mut wanted, 3 * lanes * bb.len()),
                max_residual: front(&mut max_residual, lanes * bb.len()),
                residual: vec![f32x4::ZERO; lanes],
                bb,
            }
        };
        bb.chunks_mut(len).zip(damping.chunks_mut(len)).enumerate().map(part).collect()
    }
}

/// Splits the first items off.
fn front<'a, T>(items: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    items.split_off_mut(..count).expect("as long as its parts")
}

impl ValueSurfaces<'_> {
    /// Returns the corner of a final triangle that takes the values of a corner of the ordered input, given as face and
    /// corner number, whose home has exactly its position and these corners.
    pub(super) fn corner_at_home(&self, (of, k): (usize, usize), around: &[Corner]) -> Option<Corner> {
        let own = self.originals.chart(self.originals.wedges[of][k]);
        around.iter().copied().find(|c| self.charts[c.face()] == own)
    }
}

/// The sums of consecutive final triangles.
pub(super) struct PartOfValues<'b, 'a> {
    surfaces: &'b ValueSurfaces<'a>,
    /// The first of the triangles.
    first: usize,
    bb: &'b mut [Tensor],
    damping: &'b mut [Vec3],
    wanted: &'b mut [f32x4],
    max_residual: &'b mut [f32x4],
    /// Scratch: the residual of a sample.
    residual: Vec<f32x4>,
}

impl PartOfValues<'_, '_> {
    pub(super) fn surfaces(&self) -> &ValueSurfaces<'_> {
        self.surfaces
    }

    /// Adds the centre of a face of the ordered input.
    pub(super) fn add_centre(&mut self, of: usize, face: usize, b: Vec3, weight: f32) {
        self.add(self.surfaces.originals.wedges[of], 1.0 / 3.0, face, b, weight);
    }

    /// Adds a corner of the ordered input, given as face and corner number.
    pub(super) fn add_corner(&mut self, (of, k): (usize, usize), face: usize, b: Vec3, weight: f32) {
        self.add([self.surfaces.originals.wedges[of][k]], 1.0, face, b, weight);
    }

    /// Adds a corner of the ordered input at a corner of a final triangle.
    pub(super) fn add_at_corner(&mut self, of: (usize, usize), corner: Corner, weight: f32) {
        let mut b = [0.0; 3];
        b[corner.k()] = 1.0;
        self.add_corner(of, corner.face(), b.into(), weight);
    }

    #[inline(always)]
    fn add<const R: usize>(&mut self, rows: [WedgeId; R], share: f32, face: usize, b: Vec3, weight: f32) {
        if self.surfaces.originals.chart(rows[0]) != self.surfaces.charts[face] {
            return;
        }
        // (Loops over one or two vectors are unrolled.)
        match self.surfaces.lanes {
            1 => self.add_lanes::<R, 1>(rows, share, face, b, weight),
            2 => self.add_lanes::<R, 2>(rows, share, face, b, weight),
            _ => self.add_lanes::<R, 0>(rows, share, face, b, weight),
        }
    }

    #[inline(always)]
    fn add_lanes<const R: usize, const N: usize>(
        &mut self,
        rows: [WedgeId; R],
        share: f32,
        face: usize,
        b: Vec3,
        weight: f32,
    ) {
        let ValueSurfaces { originals, attributes, wedges, lanes, trusted_sq, .. } = self.surfaces;
        let lanes = if N == 0 { *lanes } else { N };
        let corners = b.to_array();
        let [o, a, c] = wedges[face];
        let finals =
            (attributes.values_of(lanes, o), attributes.values_of(lanes, a), attributes.values_of(lanes, c));
        // (Small buffers stay in registers.)
        let mut few = [f32x4::ZERO; 2];
        let off = if N == 0 { &mut self.residual[..lanes] } else { &mut few[..N] };
        let mut far = f32x4::ZERO;
        for (i, off) in off.iter_mut().enumerate() {
            let mut sum = f32x4::ZERO;
            for row in rows {
                sum += originals.of(row, lanes)[i];
            }
            let value = sum * share;
            // Written so that the sum is exactly zero if all values are equal.
            let mut own = f32x4::ZERO;
            own += (value - finals.0[i]) * corners[0];
            own += (value - finals.1[i]) * corners[1];
            own += (value - finals.2[i]) * corners[2];
            far += own * own * attributes.weight(i);
            *off = own;
        }
        // A large residual means that the face is near in space only.
        let trust = trusted_sq / (trusted_sq + far.reduce_add());
        let at = face - self.first;
        self.damping[at] += b.max(Vec3::ZERO) * (weight * DAMPING);
        let weight = weight * trust * trust;
        self.bb[at].add(&Tensor::outer(b, weight));
        let worst = &mut self.max_residual[at * lanes..][..lanes];
        let wanted = &mut self.wanted[at * 3 * lanes..][..3 * lanes];
        for (i, off) in off.iter().enumerate() {
            worst[i] = worst[i].fast_max(off.abs() * trust);
            for (k, b) in corners.into_iter().enumerate() {
                wanted[k * lanes + i] += *off * (b * weight);
            }
        }
    }
}

impl Values<'_> {
    /// Fits the values of all wedges. The samples refer to the positions before the fit of positions; `moved`
    /// returns the move of a triangle's corner since, or `None` if it is locked.
    pub(crate) fn solve(self, moved: impl Fn(usize, usize) -> Option<Vec3>) {
        match self.surfaces.lanes {
            1 => self.solve_lanes::<1>(moved),
            2 => self.solve_lanes::<2>(moved),
            _ => self.solve_lanes::<0>(moved),
        }
    }

    #[inline(always)]
    fn solve_lanes<const N: usize>(self, moved: impl Fn(usize, usize) -> Option<Vec3>) {
        let ValueSurfaces { attributes, wedges, lanes, .. } = self.surfaces;
        let lanes = if N == 0 { lanes } else { N };
        let count = attributes.count();
        let (corners, at) = by_wedge(&wedges, count);
        let of_wedge = |w: usize| &corners[at[w] as usize..at[w + 1] as usize];
        let mut shifts = vec![f32x4::ZERO; count * lanes];
        // Constant from sweep to sweep.
        let mut scales = vec![0f32; count];
        let mut max_shift = vec![f32x4::ZERO; count * lanes];
        // (Small buffers stay in registers.)
        let (mut few, mut many) = ([f32x4::ZERO; 2], vec![f32x4::ZERO; if N == 0 { lanes } else { 0 }]);
        let sums = if N == 0 { &mut many[..] } else { &mut few[..N] };
        for sweep in 0..SWEEPS {
            for (w, scale) in scales.iter_mut().enumerate() {
                let corners = of_wedge(w);
                let max_shift = &mut max_shift[w * lanes..][..lanes];
                if sweep == 0 && !corners.is_empty() {
                    let (mut own, mut held) = (0f32, 0f32);
                    for &corner in corners {
                        let (f, k) = (corner as usize >> 2, corner as usize & 3);
                        own += self.bb[f].0[k];
                        held += self.damping[f][k];
                        let worst = &self.max_residual[f * lanes..][..lanes];
                        for i in 0..lanes {
                            max_shift[i] = max_shift[i].fast_max(worst[i]);
                        }
                    }
                    let corner = corners[0] as usize;
                    if own > 0.0 && moved(corner >> 2, corner & 3).is_some() {
                        *scale = 1.0 / (own + held).max(1e-30);
                    }
                }
                if *scale == 0.0 {
                    continue;
                }
                sums.fill(f32x4::ZERO);
                for &corner in corners {
                    let (f, k) = (corner as usize >> 2, corner as usize & 3);
                    let wanted = &self.wanted[(3 * f + k) * lanes..][..lanes];
                    let [(one, at_one), (other, at_other)] = OTHER_CORNERS[k];
                    let (wedges, bb) = (&wedges[f], &self.bb[f].0);
                    let (by_one, by_other) = (bb[at_one], bb[at_other]);
                    let one = &shifts[wedges[one].index() * lanes..][..lanes];
                    let other = &shifts[wedges[other].index() * lanes..][..lanes];
                    for i in 0..lanes {
                        sums[i] = sums[i] + wanted[i] - one[i] * by_one - other[i] * by_other;
                    }
                }
                let shift = &mut shifts[w * lanes..][..lanes];
                for i in 0..lanes {
                    shift[i] = limited(sums[i] * *scale, max_shift[i]);
                }
            }
        }
        for w in 0..count {
            let Some(&corner) = of_wedge(w).first() else { continue };
            if let Some(moved) = moved(corner as usize >> 2, corner as usize & 3) {
                let shift = &shifts[w * lanes..][..lanes];
                attributes.shift(WedgeId(w as u32), shift, moved);
            }
        }
    }
}

/// Limits shifts to `max_shift` in either direction. The result is never a negative zero: which of two zeros
/// is the larger depends on the processor, and a sum of two negative zeros would show it.
#[inline(always)]
fn limited(shift: f32x4, max_shift: f32x4) -> f32x4 {
    shift.fast_max(-max_shift).fast_min(max_shift) + f32x4::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limited_shifts_have_no_negative_zeros() {
        let shifts = f32x4::new([-0.0, 0.0, -2.0, 2.0]);
        assert_eq!(limited(shifts, f32x4::ZERO).to_array().map(f32::to_bits), [0; 4]);
        assert_eq!(limited(shifts, f32x4::splat(1.5)).to_array(), [0.0, 0.0, -1.5, 1.5]);
    }
}
