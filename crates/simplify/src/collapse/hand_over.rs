//! Handing wedges over in a collapse onto an end: attributes are kept, and seams are not torn.

use glam::Vec3;
use lodsmith_core::{VertexId, WedgeId};

use super::LiveMesh;
use super::ring::{Ring, Spoke};
use super::wedges::{HandedOver, Wedges};
use crate::metric::Metric;
use crate::report::Refusal;

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
