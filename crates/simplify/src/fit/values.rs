//! Least squares of the attributes: the samples that move the vertices say which values their wedges ought to have.
//!
//! A sample counts for a triangle of its own chart only: beside a seam the nearest triangle may lie on the other side.
//! Wedges are merged along triangles that have both, so a chart of the input is one of the result.

use glam::Vec3;
use lodsmith_core::WedgeId;
use wide::f32x4;

use crate::collapse::attributes::Attributes;
use crate::collapse::store::Corner;
use crate::tensor::Tensor;

/// Share of its own weight that holds a wedge to the value that it has. (Guessed.)
const DAMPING: f32 = 0.02;
const BELIEVED: f64 = 1.5;
/// Gauss-Seidel sweeps. (As many as for the positions.)
const SWEEPS: usize = 2;

/// The attributes of the ordered input.
#[derive(Clone, Debug)]
pub(crate) struct Originals {
    /// The row of each corner.
    wedges: Vec<[WedgeId; 3]>,
    /// The values of each row.
    values: Vec<f32x4>,
    /// The chart of each row, by its least row.
    charts: Vec<WedgeId>,
}

impl Originals {
    /// Copies what a run is about to change.
    pub(crate) fn new(attributes: &Attributes, wedges: &[[WedgeId; 3]]) -> Self {
        let values = attributes.all_values();
        let count = attributes.count();
        let mut charts: Vec<WedgeId> = (0..count as u32).map(WedgeId).collect();
        for t in wedges {
            let [a, b, c] = t.map(|w| root(&mut charts, w));
            let least = a.min(b).min(c);
            for w in [a, b, c] {
                charts[w.index()] = least;
            }
        }
        for w in (0..count as u32).map(WedgeId) {
            charts[w.index()] = root(&mut charts, w);
        }
        Self { wedges: wedges.to_vec(), values, charts }
    }

    fn of(&self, w: WedgeId, lanes: usize) -> &[f32x4] {
        &self.values[w.index() * lanes..][..lanes]
    }
}

fn root(charts: &mut [WedgeId], mut w: WedgeId) -> WedgeId {
    while charts[w.index()] != w {
        let next = charts[charts[w.index()].index()];
        charts[w.index()] = next;
        w = next;
    }
    w
}

/// The corners of triangles in the order of their wedges, each with its wedge; a corner is four times the triangle, and
/// 0, 1 or 2.
fn by_wedge(wedges: &[[WedgeId; 3]], count: usize) -> Vec<(WedgeId, u32)> {
    let mut at = vec![0u32; count + 1];
    for w in wedges.as_flattened() {
        at[w.index() + 1] += 1;
    }
    for i in 0..count {
        at[i + 1] += at[i];
    }
    let mut corners = vec![(WedgeId(0), 0); 3 * wedges.len()];
    for (f, t) in wedges.iter().enumerate() {
        for (k, &w) in t.iter().enumerate() {
            corners[at[w.index()] as usize] = (w, (4 * f + k) as u32);
            at[w.index()] += 1;
        }
    }
    corners
}

/// What the samples say of the values, for each final triangle.
pub(crate) struct Values<'a> {
    originals: &'a Originals,
    attributes: &'a mut Attributes,
    /// Wedges of the final triangles.
    wedges: Vec<[WedgeId; 3]>,
    lanes: usize,
    /// Sums of weight · b bᵀ.
    bb: Vec<Tensor>,
    /// What holds each corner to the value that it has: where few samples are near it, or believed, it is all there is.
    held: Vec<Vec3>,
    /// Sums of weight · b · (value there − value that the triangle says), for each corner.
    wanted: Vec<f32x4>,
    /// The farthest that a sample is off, as far as it is believed: no corner moves farther.
    worst: Vec<f32x4>,
    /// What a sample is off.
    off: Vec<f32x4>,
    /// Weighted square of an error that is still believed.
    usual: f32,
}

impl<'a> Values<'a> {
    /// For final triangles with these wedges, of a surface that is about `away` (RMS) from the original.
    pub(crate) fn new(
        originals: &'a Originals,
        attributes: &'a mut Attributes,
        wedges: Vec<[WedgeId; 3]>,
        away: f64,
    ) -> Self {
        let lanes = attributes.lanes();
        let (bb, wanted) =
            (vec![Tensor::default(); wedges.len()], vec![f32x4::ZERO; 3 * lanes * wedges.len()]);
        let usual = (BELIEVED * away).powi(2).clamp(1e-30, 1e30) as f32;
        let off = vec![f32x4::ZERO; lanes];
        let held = vec![Vec3::ZERO; wedges.len()];
        let worst = vec![f32x4::ZERO; lanes * wedges.len()];
        Self { originals, attributes, wedges, lanes, bb, held, wanted, worst, off, usual }
    }

    /// Adds the centre of a face of the ordered input.
    pub(super) fn add_centre(&mut self, of: usize, face: usize, b: Vec3, weight: f32) {
        let rows = self.originals.wedges[of];
        self.add(rows, 1.0 / 3.0, face, b, weight);
    }

    /// Adds the first corner of a face of the ordered input.
    pub(super) fn add_corner(&mut self, of: usize, face: usize, b: Vec3, weight: f32) {
        let row = self.originals.wedges[of][0];
        self.add([row], 1.0, face, b, weight);
    }

    /// Adds the first corner of a face of the ordered input where a final vertex, with these corners, has its very place.
    pub(super) fn add_at_home(&mut self, of: usize, around: &[Corner], weight: f32) {
        let chart = |w: WedgeId| self.originals.charts[self.attributes.original(w).index()];
        let own = chart(self.originals.wedges[of][0]);
        if let Some(corner) = around.iter().find(|c| chart(self.wedges[c.face()][0]) == own) {
            let mut b = [0.0; 3];
            b[corner.k()] = 1.0;
            self.add_corner(of, corner.face(), b.into(), weight);
        }
    }

    #[inline(always)]
    fn add<const N: usize>(&mut self, rows: [WedgeId; N], share: f32, face: usize, b: Vec3, weight: f32) {
        let finals = self.wedges[face];
        let chart = |w: WedgeId| self.originals.charts[self.attributes.original(w).index()];
        if chart(rows[0]) != chart(finals[0]) {
            return;
        }
        let corners = b.to_array();
        let (of_rows, of_finals) =
            (rows.map(|w| self.originals.of(w, self.lanes)), finals.map(|w| self.attributes.values(w)));
        let mut far = f32x4::ZERO;
        for (i, off) in self.off.iter_mut().enumerate() {
            let sum = of_rows.iter().fold(f32x4::ZERO, |sum, row| sum + row[i]);
            let value = sum * share;
            // So that nothing is wanted where all are the same.
            *off = (0..3).fold(f32x4::ZERO, |off, k| off + (value - of_finals[k][i]) * corners[k]);
            far += *off * *off * self.attributes.weight(i);
        }
        // Far off is what came to a face that is near in space only.
        let trust = self.usual / (self.usual + far.reduce_add());
        self.held[face] += b.max(Vec3::ZERO) * (weight * DAMPING);
        let weight = weight * trust * trust;
        self.bb[face].add(&Tensor::outer(b, weight));
        for (worst, off) in self.worst[face * self.lanes..].iter_mut().zip(&self.off) {
            *worst = worst.fast_max(off.abs() * trust);
        }
        let wanted = &mut self.wanted[face * 3 * self.lanes..][..3 * self.lanes];
        for (k, b) in corners.into_iter().enumerate() {
            for (wanted, off) in wanted[k * self.lanes..].iter_mut().zip(&self.off) {
                *wanted += *off * (b * weight);
            }
        }
    }

    /// Moves the values of all wedges to what the samples say. The samples spoke of the places before the fit; from there
    /// the corners of a triangle went `moved`; those without a move are locked.
    pub(crate) fn solve(self, moved: impl Fn(usize, usize) -> Option<Vec3>) {
        let lanes = self.lanes;
        let corners = by_wedge(&self.wedges, self.attributes.count());
        let mut shifts = vec![f32x4::ZERO; self.attributes.count() * lanes];
        let (mut sum, mut most) = (vec![f32x4::ZERO; lanes], vec![f32x4::ZERO; lanes]);
        for _ in 0..SWEEPS {
            for of_wedge in corners.chunk_by(|a, b| a.0 == b.0) {
                let (mut own, mut held) = (0f32, 0f32);
                sum.fill(f32x4::ZERO);
                most.fill(f32x4::ZERO);
                for &(_, corner) in of_wedge {
                    let (f, k) = (corner as usize >> 2, corner as usize & 3);
                    let bb = &self.bb[f].0;
                    own += bb[k];
                    held += self.held[f][k];
                    // xy, xz, yz of the tensor stand at 3, 4, 5.
                    let others = [[(1, 3), (2, 4)], [(0, 3), (2, 5)], [(0, 4), (1, 5)]][k];
                    let wanted = &self.wanted[(3 * f + k) * lanes..][..lanes];
                    for (i, sum) in sum.iter_mut().enumerate() {
                        *sum += wanted[i];
                        most[i] = most[i].fast_max(self.worst[f * lanes + i]);
                        for (j, at) in others {
                            *sum -= shifts[self.wedges[f][j].index() * lanes + i] * bb[at];
                        }
                    }
                }
                let corner = of_wedge[0].1 as usize;
                if own > 0.0 && moved(corner >> 2, corner & 3).is_some() {
                    let scale = 1.0 / (own + held).max(1e-30);
                    let at = of_wedge[0].0.index() * lanes;
                    for (i, (sum, most)) in sum.iter().zip(&most).enumerate() {
                        shifts[at + i] = (*sum * scale).fast_max(-*most).fast_min(*most);
                    }
                }
            }
        }
        for of_wedge in corners.chunk_by(|a, b| a.0 == b.0) {
            let (w, corner) = of_wedge[0];
            if let Some(moved) = moved(corner as usize >> 2, corner as usize & 3) {
                self.attributes.shift(w, &shifts[w.index() * lanes..][..lanes], moved);
            }
        }
    }
}
