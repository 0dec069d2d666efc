//! The mesh of a finished engine: it has the positions and attributes of the input where they were kept.

use lodsmith_core::{Positions, PositionsView, TriMesh, WedgeId};

use super::context::Run;
use crate::SimplifyError;
use crate::attributes::{Rows, with_input_attributes};
use crate::collapse::attributes::Attributes;
use crate::collapse::order::NONE;
use crate::collapse::store::Store;
use crate::constraints::{HeldWedges, LockedWedges};
use crate::cost::metric::VertexMemory;

impl Run<'_, '_> {
    /// Returns the input wedges of locked vertices at the corners of the result.
    pub(super) fn held<Q: VertexMemory>(&self, store: &Store<Q>, rows: Option<&Rows>) -> HeldWedges {
        let (Some(locked), Some(mesh)) = (self.constraints.locked(), self.input.mesh) else {
            return HeldWedges::default();
        };
        let carried = store.wedges.as_deref();
        let rank_of = |w: WedgeId| self.place(mesh, w);
        // Index of a wedge in the engine, at a corner of the input: a row of values, or the wedge or vertex
        // itself.
        let name = |w: WedgeId| match (rows, carried) {
            (Some(rows), Some(_)) => rows.wedge_rows[w.index()].0,
            (None, Some(_)) => w.0,
            (_, None) => rank_of(w).0,
        };
        let mut known = LockedWedges::default();
        for (f, t) in mesh.triangles().iter().enumerate() {
            let region = mesh.regions().map(|r| r[f]);
            for &w in t {
                let rank = rank_of(w);
                if rank != NONE && locked[rank.index()] {
                    known.add(name(w), region, w);
                }
            }
        }
        HeldWedges::new(store.t.iter().enumerate().map(|(f, t)| {
            let region = store.regions.as_ref().map(|r| r[f]);
            [0, 1, 2].map(|k| {
                let x = &store.v[t[k].index()];
                let name = carried.map_or(x.origin.0, |wedges| wedges[f][k].0);
                x.kind.is_locked().then(|| known.get(name, region)).flatten()
            })
        }))
    }

    /// Builds the mesh of a compact store. Vertices that kept their position have the bits of the input.
    pub(super) fn result<Q: VertexMemory>(
        &self,
        store: &Store<Q>,
        attributes: Option<&Attributes>,
        rows: Option<&Rows>,
    ) -> Result<TriMesh, SimplifyError> {
        let input_positions = self.input.surface.positions();
        let first = self.ordered.first_vertices();
        let frame = self.ordered.frame;
        let place = |i: usize| {
            let x = &store.v[i];
            if x.kind.is_moved() {
                frame.user_from_unit(x.p.as_dvec3())
            } else {
                input_positions.get(first[store.place_of(x.origin).index()])
            }
        };
        let places = (0..store.v.len()).map(place);
        let positions = match input_positions {
            PositionsView::F32(_) => Positions::F32(places.map(|p| p.map(|x| x as f32)).collect()),
            PositionsView::F64(_) => Positions::F64(places.collect()),
        };
        let mut result = match (&store.wedges, self.input.mesh, rows, attributes) {
            (Some(wedges), _, Some(rows), attributes @ Some(_)) => {
                rows.mesh(attributes, positions, &store.t, wedges)?
            }
            (None, _, Some(rows), None) => {
                rows.mesh(None, positions, &store.t, bytemuck::cast_slice(&store.t))?
            }
            (Some(wedges), Some(mesh), None, _) => with_input_attributes(mesh, positions, &store.t, wedges)?,
            _ => TriMesh::new(positions, store.t.clone())?,
        };
        match (&store.regions, self.input.mesh.and_then(TriMesh::regions)) {
            (Some(regions), _) => result.set_regions(Some(regions.clone()))?,
            (None, Some(all)) => result.set_regions(all.first().map(|&r| vec![r; store.t.len()]))?,
            (None, None) => {}
        }
        Ok(result)
    }
}
