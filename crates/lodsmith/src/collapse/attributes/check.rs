//! Check of every invariant of the wedges in a run. Nothing here panics if the store is sound.

use lodsmith_core::{VertexId, WedgeId};
use wide::f32x4;

use super::{Attributes, NO_WEDGE, Slopes};
use crate::collapse::invariants::{Checks, need};
use crate::collapse::order::NONE;
use crate::collapse::store::Store;
use crate::cost::metric::VertexMemory;

/// Tolerance between a sum updated over many collapses and the recomputed sum, as a share of the sizes of all
/// summands. (Measured on the shapes and soups of the tests: areas up to 4e-6.)
const DRIFT_TOLERANCE: f32 = 1e-3;
/// Tolerance as a share of the largest value so far, and of the unit frame: large values that are
/// subtracted again leave rounding errors of single precision behind, 6e-8 of the value for each change.
const ROUNDING_TOLERANCE: f32 = 4e-6;
/// [`ROUNDING_TOLERANCE`] once there have been thin faces: gradients along them are up to a thousand times
/// less precise.
const THIN_ROUNDING_TOLERANCE: f32 = 4e-3;

impl Attributes {
    /// Returns an error that names the first broken invariant of the wedges, if any. The store must be
    /// sound.
    ///
    /// Cost: O(n).
    pub(in crate::collapse) fn check<Q: VertexMemory>(
        &self,
        store: &Store<Q>,
        checks: &mut Checks,
    ) -> Result<(), String> {
        let Some(wedges) = &store.wedges else {
            return Err("there are attributes, and no face has wedges".to_owned());
        };
        self.check_lengths()?;
        let owners = self.owners(store)?;
        let mut faces = vec![0u32; self.count()];
        for (f, (t, own)) in store.t.iter().zip(wedges).enumerate().filter(|x| x.1.0[0] != NONE) {
            for (v, w) in t.iter().zip(own) {
                let owner = owners.get(w.index()).copied();
                need(owner == Some(*v), || match owner {
                    Some(NONE) => format!("face {f} has wedge {w} at vertex {v}, in no chain"),
                    Some(other) => format!("face {f} has wedge {w} at vertex {v}, in the chain of {other}"),
                    None => format!("face {f} has wedge {w} of {}", owners.len()),
                })?;
                faces[w.index()] += 1;
            }
        }
        for (w, &count) in faces.iter().enumerate().filter(|w| owners[w.0] != NONE) {
            let recorded = self.heads[w].faces;
            need(recorded == count && count > 0, || {
                format!("wedge {w} has {count} faces, its head records {recorded}")
            })?;
        }
        checks.values.resize(self.lanes, f32x4::ZERO);
        for w in (0..self.count()).map(WedgeId::new) {
            let values = checks.values.iter_mut().zip(self.values(w));
            values.for_each(|(most, x)| *most = most.max(x.abs()));
        }
        self.check_sums(store, wedges, &owners, checks)
    }

    fn check_lengths(&self) -> Result<(), String> {
        let count = self.count();
        let parts = [
            ("rows", self.rows.len(), count * 4 * self.lanes),
            ("tensors", self.reductions.len(), count),
            ("weights", self.weights.len(), self.lanes),
            ("joints", self.joint_weights.len(), if self.joint_weights.is_empty() { 0 } else { count }),
            ("copies", self.copied.len(), self.copied.len().min(count)),
        ];
        for (name, length, wanted) in parts {
            need(length == wanted, || format!("{count} wedges have {length} {name}, not {wanted}"))?;
        }
        Ok(())
    }

    /// Returns the vertex in whose chain each wedge is, or [`NONE`].
    fn owners<Q: VertexMemory>(&self, store: &Store<Q>) -> Result<Vec<VertexId>, String> {
        let mut owners = vec![NONE; self.count()];
        for u in store.living() {
            let Some(&first) = store.first_wedge.get(u.index()) else {
                return Err(format!("vertex {u} has no place for its first wedge"));
            };
            need(first != NO_WEDGE, || format!("vertex {u} has no wedge"))?;
            let mut w = first;
            while w != NO_WEDGE {
                let Some(owner) = owners.get_mut(w.index()) else {
                    return Err(format!("vertex {u} has wedge {w} of {}", self.count()));
                };
                let other = std::mem::replace(owner, u);
                need(other == NONE, || format!("wedge {w} is in the chains of {other} and {u}"))?;
                w = self.heads[w.index()].next;
            }
        }
        Ok(owners)
    }

    /// Checks that areas and sums match the current triangles, and that cached tensors of wedges are up to
    /// date.
    fn check_sums<Q: VertexMemory>(
        &self,
        store: &Store<Q>,
        wedges: &[[WedgeId; 3]],
        owners: &[VertexId],
        checks: &Checks,
    ) -> Result<(), String> {
        let n = self.lanes;
        let mut areas = vec![0f32; self.count()];
        let mut sums = vec![f32x4::ZERO; self.count() * 3 * n];
        let mut sizes = vec![f32x4::ZERO; self.count() * n];
        for (t, own) in store.t.iter().zip(wedges).filter(|t| t.0[0] != NONE) {
            let s = Slopes::new(t.map(|v| store.p(v)));
            let [o, a, b] = own.map(|w| self.values(w));
            for i in 0..n {
                let (a, b) = ((a[i] - o[i]) * s.area, (b[i] - o[i]) * s.area);
                let size = a.abs() * s.a.length() + b.abs() * s.b.length();
                for w in own {
                    for k in 0..3 {
                        sums[(w.index() * 3 + k) * n + i] += a * s.a[k] + b * s.b[k];
                    }
                    sizes[w.index() * n + i] += size;
                }
            }
            own.iter().for_each(|w| areas[w.index()] += s.area);
        }
        let rounding = if checks.has_thin { THIN_ROUNDING_TOLERANCE } else { ROUNDING_TOLERANCE };
        for w in (0..self.count()).filter(|&w| owners[w] != NONE) {
            let (id, head) = (WedgeId::new(w), &self.heads[w]);
            need((head.area - areas[w]).abs() <= DRIFT_TOLERANCE * areas[w] + ROUNDING_TOLERANCE, || {
                format!("wedge {w} has twice the area {}, its head records {}", areas[w], head.area)
            })?;
            for (i, &largest) in checks.values.iter().enumerate() {
                // (Subnormal numbers have no relative precision.)
                let within = sizes[w * n + i] * DRIFT_TOLERANCE + largest * rounding + f32::MIN_POSITIVE;
                for k in 0..3 {
                    let (recorded, sum) = (self.row(id)[(k + 1) * n + i], sums[(w * 3 + k) * n + i]);
                    // (Values that are not finite, or nearly overflow, cannot be checked.)
                    let is_within =
                        (recorded - sum).abs().simd_le(within) | !within.simd_lt(f32x4::splat(f32::MAX));
                    need(is_within.all(), || {
                        format!(
                            "wedge {w} gains {sum:?} along axis {k} in lane {i}, its row has {recorded:?}"
                        )
                    })?;
                }
            }
            if head.has_reduction {
                let (recorded, now) = (self.reductions[w], self.reduction(id));
                let bits = |t: &crate::cost::tensor::Tensor| t.0.map(f32::to_bits);
                need(bits(&recorded) == bits(&now), || {
                    format!("wedge {w} by itself reduces the cost by {now:?}, cached is {recorded:?}")
                })?;
            }
        }
        Ok(())
    }
}
