//! Wedges in collapses onto endpoints: attributes are kept, seams stay closed.

use glam::Vec3;
use lodsmith_core::{VertexId, WedgeId};

use super::LiveMesh;
use super::store::{Corner, Ring, Spoke, Store};
use crate::metric::{Metric, VertexMemory};
use crate::report::Refusal;

/// Attributes of the input's wedges that matching needs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wedges {
    pub(crate) uvs: Option<Vec<[f32; 2]>>,
    pub(crate) normals: Option<Vec<[f32; 3]>>,
}

impl Wedges {
    fn same_uv(&self, a: WedgeId, b: WedgeId) -> bool {
        self.uvs.as_ref().is_none_or(|uv| uv[a.index()] == uv[b.index()])
    }
    /// Returns the one among `choices` on the same side of every UV seam as `like`, with the closest normal
    /// to `of`.
    fn best(&self, choices: &[WedgeId], like: WedgeId, of: WedgeId) -> Option<WedgeId> {
        let turn = |w: WedgeId| match &self.normals {
            None => 0.0,
            Some(n) => -Vec3::from(n[w.index()]).dot(Vec3::from(n[of.index()])),
        };
        let sides = choices.iter().copied().filter(|&w| self.same_uv(w, like));
        sides.min_by(|&a, &b| turn(a).total_cmp(&turn(b)).then(a.cmp(&b)))
    }
}

impl<Q: VertexMemory> Store<Q> {
    fn wedge(&self, face: usize, w: VertexId) -> Option<WedgeId> {
        let k = self.t[face].iter().position(|&x| x == w)?;
        Some(self.wedges.as_ref()?[face][k])
    }
}

/// Corners of the removed position, and their new wedges.
pub(crate) type HandedOver = Vec<(Corner, WedgeId)>;

impl<M: Metric> LiveMesh<M> {
    /// Returns the corners of the end whose position is removed, with the wedges of the other end that
    /// replace theirs. Wedges are paired where a triangle contains both; a wedge without a partner would be
    /// separated from its side of a seam, so the collapse is refused.
    #[inline(always)]
    pub(crate) fn wedges_to_hand_over(
        &self,
        u: VertexId,
        v: VertexId,
        step: Vec3,
        off: Vec3,
        ru: &Ring,
        rv: &Ring,
    ) -> Result<HandedOver, Refusal> {
        match (&self.values.wedge_data, &self.store.wedges) {
            (Some(data), Some(_)) => self.exchange_wedges(data, u, v, step, off, ru, rv),
            _ => Ok(Vec::new()),
        }
    }

    #[inline(never)]
    #[expect(clippy::too_many_arguments, reason = "those of a collapse, and the attributes")]
    fn exchange_wedges(
        &self,
        data: &Wedges,
        u: VertexId,
        v: VertexId,
        step: Vec3,
        off: Vec3,
        ru: &Ring,
        rv: &Ring,
    ) -> Result<HandedOver, Refusal> {
        // The end that keeps its position.
        let (kept, gone, kept_ring, gone_ring) =
            if step == Vec3::ZERO || off != Vec3::ZERO { (u, v, ru, rv) } else { (v, u, rv, ru) };
        let at = |r: &Spoke, w: VertexId| self.store.wedge(r.corner.face(), w);
        let pairs: Vec<(WedgeId, WedgeId)> = gone_ring
            .iter()
            .filter(|r| r.has(kept))
            .filter_map(|r| Some((at(r, gone)?, at(r, kept)?)))
            .collect();
        let choices: Vec<WedgeId> = kept_ring.iter().filter_map(|r| at(r, kept)).collect();
        let mut changes = Vec::new();
        for r in gone_ring.iter().filter(|r| !r.has(kept)) {
            let Some(old) = at(r, gone) else { continue };
            let same = pairs.iter().find(|p| p.0 == old).map(|p| p.1);
            let new = same.or_else(|| {
                let side = pairs.iter().find(|p| data.same_uv(p.0, old))?;
                data.best(&choices, side.1, old)
            });
            match new {
                Some(new) => changes.push((r.corner, new)),
                None => return Err(Refusal::Seam),
            }
        }
        Ok(changes)
    }

    /// Applies the changes.
    #[inline(always)]
    pub(crate) fn hand_over_wedges(&mut self, changes: &HandedOver) {
        if let Some(wedges) = &mut self.store.wedges {
            for &(corner, wedge) in changes {
                wedges[corner.face()][corner.k()] = wedge;
            }
        }
    }
}
