//! The mesh of a finished engine: it has the positions and attributes of the input where they were kept.
//! Attributes that depend on a look at the input are added to the chosen result only.

use lodsmith_core::{Positions, PositionsView, TriMesh, VertexId, WedgeId};

use super::context::{MissingAttributes, Run, RunOutcome};
use super::start::Root;
use crate::SimplifyError;
use crate::attributes::recolor::{self, OwnParts};
use crate::attributes::{Rows, with_input_attributes};
use crate::collapse::attributes::Attributes;
use crate::collapse::order::NONE;
use crate::collapse::ordered_input::OriginalInput;
use crate::collapse::store::Store;
use crate::collapse::{Engine, components};
use crate::constraints::{HeldWedges, LockedWedges};
use crate::cost::metric::{Metric, VertexMemory};
use crate::methods::transfer::transfer_to_mesh;

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

    /// Returns the data for the attributes that [`Self::completed`] has to add to a result. The engine has values or
    /// wedges for all its corners; faces across moved seams, and colours of palettes, need a look at the input, which
    /// takes longer than a run.
    pub(super) fn missing_attributes<M: Metric>(
        &self,
        engine: &Engine<M>,
        root: &Root,
        held: &HeldWedges,
    ) -> Option<MissingAttributes> {
        let store = &engine.mesh.store;
        let moved = store.wedges.as_ref().filter(|_| engine.mesh.has_relaxed_seams());
        if moved.is_none() && self.input.data.textures.is_none() && held.is_empty() {
            return None;
        }
        let blended = moved.zip(engine.mesh.values.attributes.as_ref()).map(|(wedges, attributes)| {
            let width = root.rows.as_ref().map_or(0, Rows::width);
            wedges.as_flattened().iter().flat_map(|&w| &attributes.of(w)[..width]).copied().collect()
        });
        Some(MissingAttributes {
            places: store.v.iter().map(|x| store.place_of(x.origin)).collect(),
            has_moved_seams: moved.is_some(),
            blended,
            is_input_kept: root.is_kept,
        })
    }

    /// Adds the attributes that an outcome lacks.
    pub(super) fn completed(&self, mut outcome: RunOutcome) -> Result<RunOutcome, SimplifyError> {
        let Some(missing) = outcome.engine.missing.take() else { return Ok(outcome) };
        if missing.has_moved_seams {
            // A run that blends values keeps its own shading; a run that matches wedges has vertices of the
            // input.
            let kept = match missing.blended {
                Some(_) => vec![NONE; outcome.mesh.vertex_count()],
                None => missing.places.clone(),
            };
            let shading = missing.blended.as_deref();
            outcome.mesh = transfer_to_mesh(self.input, self.ordered, &outcome.mesh, kept, shading)?;
        }
        let is_plain = outcome.tally.pairs_contracted == 0;
        let own_parts = is_plain.then(|| self.own_parts(&missing)).flatten();
        outcome.mesh = recolor::recolored(outcome.mesh, self.input, &outcome.held, own_parts.as_ref())?;
        if let Some(input) = self.input.mesh {
            outcome.held.restore(&mut outcome.mesh, input);
        }
        Ok(outcome)
    }

    /// Returns the part of the input that each vertex of the input and of the result belongs to, if colours
    /// are needed. No pairs were contracted. Cost: O(n).
    fn own_parts(&self, missing: &MissingAttributes) -> Option<OwnParts> {
        let mesh = self.input.mesh.filter(|_| self.input.data.textures.is_some())?;
        let source = self.input_in_order(missing.is_input_kept);
        let of = source.visit(|points, faces| components::labels(points.len(), faces));
        let of_place = |place: VertexId| of.get(place.index()).copied();
        let of_vertex = |v: VertexId| of_place(self.ordered.rank[self.input.joined(v).index()]);
        let of_input = (0..mesh.vertex_count()).map(|v| of_vertex(VertexId::new(v))).collect();
        let of_result = missing.places.iter().map(|&place| of_place(place)).collect();
        Some(OwnParts { of_input, of_result })
    }

    /// Returns the input of the run; `is_kept` is true if the ordered input still has its points and faces.
    pub(super) fn input_in_order(&self, is_kept: bool) -> OriginalInput<'_> {
        OriginalInput { surface: &self.input.surface, ordered: self.ordered, is_kept }
    }
}
