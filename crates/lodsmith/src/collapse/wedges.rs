//! Wedges in collapses onto endpoints: attributes are kept, seams stay closed.

use std::sync::Arc;

use glam::Vec3;
use lodsmith_core::{VertexId, WedgeId};

use super::ring::Corner;
use super::store::Store;
use crate::attributes::sides::SideValues;
use crate::cost::metric::VertexMemory;

/// Attributes of the input's wedges that matching needs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wedges {
    pub(crate) sides: SideValues,
    pub(crate) normals: Option<Vec<[f32; 3]>>,
    /// Values that count in the cost, `width` for each wedge, as lengths in the unit frame.
    pub(crate) values: Option<Arc<[f32]>>,
    pub(crate) width: usize,
    /// True if seams have lines; then they do not give way either.
    pub(crate) has_seam_lines: bool,
    /// True for vertices of the ordered input whose wedges lie on several sides of a seam; `None` if seams
    /// have no lines or there are no seams.
    pub(crate) is_split: Option<Vec<bool>>,
}

impl Wedges {
    /// Returns the values of a wedge that count in the cost; none if there are not enough.
    #[inline(always)]
    pub(super) fn values(&self, w: WedgeId) -> &[f32] {
        let all = self.values.as_deref().unwrap_or_default();
        all.get(w.index() * self.width..(w.index() + 1) * self.width).unwrap_or_default()
    }

    /// Finds the vertices on seams, if seams have lines.
    pub(super) fn find_split<Q: VertexMemory>(&mut self, store: &Store<Q>) {
        self.is_split = None;
        let Some(wedges) = store.wedges.as_ref().filter(|_| self.has_seam_lines) else { return };
        let count = store.v.iter().map(|x| x.origin.index() + 1).max().unwrap_or(0);
        let mut first = vec![None; count];
        let mut is_split = vec![false; count];
        for (v, &w) in store.t.as_flattened().iter().zip(wedges.as_flattened()) {
            let origin = store.v[v.index()].origin.index();
            let known = *first[origin].get_or_insert(w);
            is_split[origin] |= !self.sides.same(known, w);
        }
        self.is_split = is_split.contains(&true).then_some(is_split);
    }

    /// Returns the wedge among `choices` whose normal is closest to the normal of `of`, among those on the
    /// same side of every seam as `like`, if that is given.
    pub(super) fn best(&self, choices: &[WedgeId], like: Option<WedgeId>, of: WedgeId) -> Option<WedgeId> {
        let turn = |w: WedgeId| match &self.normals {
            None => 0.0,
            Some(n) => -Vec3::from(n[w.index()]).dot(Vec3::from(n[of.index()])),
        };
        let sides = choices.iter().copied().filter(|&w| like.is_none_or(|like| self.sides.same(w, like)));
        sides.min_by(|&a, &b| turn(a).total_cmp(&turn(b)).then(a.cmp(&b)))
    }
}

impl<Q: VertexMemory> Store<Q> {
    pub(super) fn wedge(&self, face: usize, w: VertexId) -> Option<WedgeId> {
        let k = self.t[face].iter().position(|&x| x == w)?;
        Some(self.wedges.as_ref()?[face][k])
    }
}

/// Corners at the removed position, and their new wedges.
pub(crate) type HandedOver = Vec<(Corner, WedgeId)>;
