//! Recording for progressive meshes: the state before each change of the mesh.
//!
//! The record keeps a copy of the mesh in the numbering of the input. After a change it compares the
//! touched faces with the copy, logs the old values where they differ, and updates the copy. So it does not
//! depend on the kind of change, and any change can be undone: collapses, cuts, pairs, removed parts, and
//! repairs at the start.

use std::collections::BTreeMap;

use lodsmith_core::geometry::UnitFrame;
use lodsmith_core::{FaceId, Positions, VertexId, WedgeId};

use super::attributes::Attributes;
use super::order::NONE;
use super::store::Store;
use crate::attributes::{RowPlaces, Rows};
use crate::cost::metric::VertexMemory;

/// Share of the bounds that one sweep takes in a recorded run: every level should be good, not only the last.
/// (Measured: at 0.7 levels have up to 1.6 times the RMS of single runs, at 0.25 up to 1.06, at 0.05 up to
/// 1.04; exactly flat parts need 0.05. docs/decisions/0018)
pub(super) const RECORD_QUANTILE: f64 = 0.05;

/// Log of all changes, as lists of entries; each change stores the ends of its ranges.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    /// Removed faces, with their corners.
    pub(crate) dead: Vec<(FaceId, [WedgeId; 3])>,
    /// Corners (three times the face, plus 0, 1 or 2) and their old wedges.
    pub(crate) corners: Vec<(u32, WedgeId)>,
    /// Wedges and their old vertices.
    pub(crate) owners: Vec<(WedgeId, VertexId)>,
    /// Wedges whose rows changed.
    pub(crate) rows: Vec<WedgeId>,
    /// Old values of these rows.
    pub(crate) values: Vec<f32>,
    /// Vertices that moved.
    pub(crate) places: Vec<VertexId>,
    /// Old positions of these vertices.
    pub(crate) positions: Vec<[f64; 3]>,
    /// Merged vertices of the ordered input, with the vertices that they were merged into.
    pub(crate) merged: Vec<(VertexId, VertexId)>,
    /// One entry for each change.
    pub(crate) steps: Vec<LoggedChange>,
}

/// One logged change.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoggedChange {
    /// Its own cost, or the largest cost of the changes that it depends on: changes may be applied in this
    /// order.
    pub(crate) key: f32,
    /// Increase of the accumulated cost of collapses, and of removed parts.
    pub(crate) spent: f32,
    pub(crate) lost: f32,
    /// Ends of its ranges: dead faces, corners, owners, rows, places, mergers.
    pub(crate) ends: [u32; 6],
}

/// Input numbers of the engine's elements.
#[derive(Clone)]
pub(crate) struct InputNames {
    /// Vertex of the input at each position.
    pub(crate) vertices: Vec<VertexId>,
    /// Wedge of the input for each wedge of the engine, or for each position if the engine has no wedges.
    pub(crate) wedges: Vec<WedgeId>,
    pub(crate) faces: Vec<FaceId>,
    /// True if the engine has wedges, and if those are the input's own.
    pub(crate) has_wedges: bool,
    pub(crate) keeps_wedges: bool,
}

/// The mesh in the numbering of the input; elements created during the run have higher numbers.
#[derive(Clone)]
pub(crate) struct MeshCopy {
    pub(crate) faces: Vec<[WedgeId; 3]>,
    pub(crate) vertex_of: Vec<VertexId>,
    pub(crate) width: usize,
    pub(crate) rows: Vec<f32>,
    pub(crate) positions: Positions,
}

#[derive(Clone)]
pub(crate) struct Record {
    pub(crate) names: InputNames,
    pub(crate) copy: MeshCopy,
    pub(crate) log: Log,
    /// Positions of the input.
    input: Positions,
    frame: UnitFrame,
    pub(crate) rows: Option<(Rows, RowPlaces)>,
    /// True if there are values that displace vertices as a whole.
    moves_whole: bool,
    /// Vertex of each wedge of the input, if wedges have the numbers of the input.
    home: Vec<VertexId>,
    /// Wedges of the input that are used at other vertices than their own.
    aliases: BTreeMap<(VertexId, WedgeId), WedgeId>,
    /// The largest key of a change that touched a vertex.
    pub(super) keys: Vec<f32>,
    /// Lower limit of all further keys.
    floor: f32,
    highest: f32,
    before: [f64; 2],
    seen: Vec<WedgeId>,
}

impl Record {
    /// Creates a record of a mesh that is still identical to the input.
    pub(crate) fn new(
        names: InputNames,
        copy: MeshCopy,
        frame: UnitFrame,
        rows: Option<(Rows, RowPlaces)>,
        home: Vec<VertexId>,
    ) -> Self {
        let (input, vertices) = (copy.positions.clone(), copy.positions.len());
        let moves_whole = !names.keeps_wedges && rows.as_ref().is_some_and(|r| r.0.moves_any_whole());
        Self {
            names,
            copy,
            log: Log::default(),
            input,
            frame,
            rows,
            moves_whole,
            home,
            aliases: BTreeMap::new(),
            keys: vec![f32::NEG_INFINITY; vertices],
            floor: f32::NEG_INFINITY,
            highest: f32::NEG_INFINITY,
            before: [0.0; 2],
            seen: Vec::new(),
        }
    }

    /// Makes all later changes depend on all earlier ones.
    pub(crate) fn raise_floor(&mut self) {
        self.floor = self.highest;
    }

    pub(super) fn merge(&mut self, gone: VertexId, into: VertexId) {
        self.log.merged.push((gone, into));
    }

    /// Returns the input number of a vertex, by its number in the ordered input.
    pub(crate) fn vertex(&mut self, origin: VertexId) -> VertexId {
        while self.names.vertices.len() <= origin.index() {
            let new = VertexId::new(self.copy.positions.len());
            self.names.vertices.push(new);
            match &mut self.copy.positions {
                Positions::F32(p) => p.push([0.0; 3]),
                Positions::F64(p) => p.push([0.0; 3]),
            }
            self.keys.push(f32::NEG_INFINITY);
            if !self.names.has_wedges {
                let wedge = self.new_wedge(new, None);
                self.names.wedges.push(wedge);
            }
        }
        self.names.vertices[origin.index()]
    }

    fn new_wedge(&mut self, vertex: VertexId, like: Option<WedgeId>) -> WedgeId {
        let new = WedgeId::new(self.copy.vertex_of.len());
        let width = self.copy.width;
        self.copy.vertex_of.push(vertex);
        match like {
            Some(w) => self.copy.rows.extend_from_within(w.index() * width..(w.index() + 1) * width),
            None => self.copy.rows.resize(self.copy.rows.len() + width, 0.0),
        }
        new
    }

    /// Returns the input number of a wedge of a vertex of the ordered input.
    fn wedge(
        &mut self,
        origin: VertexId,
        wedge: Option<WedgeId>,
        attributes: Option<&Attributes>,
    ) -> WedgeId {
        let vertex = self.vertex(origin);
        let Some(w) = wedge.filter(|_| self.names.has_wedges) else {
            return self.names.wedges[origin.index()];
        };
        if self.names.keeps_wedges {
            if self.home[w.index()] == vertex {
                return w;
            }
            if let Some(&known) = self.aliases.get(&(vertex, w)) {
                return known;
            }
            let new = self.new_wedge(vertex, Some(w));
            self.aliases.insert((vertex, w), new);
            return new;
        }
        while self.names.wedges.len() <= w.index() {
            let copied = attributes.map(|a| a.original(WedgeId::new(self.names.wedges.len())));
            let like = copied.map(|c| self.names.wedges[c.index()]);
            let new = self.new_wedge(vertex, like);
            self.names.wedges.push(new);
            self.write(attributes, new, w);
        }
        self.names.wedges[w.index()]
    }

    /// Logs the differences at these faces of the store, which was not compacted since; `moved` are the
    /// vertices whose positions or values may have changed.
    pub(super) fn log_change<Q: VertexMemory>(
        &mut self,
        store: &Store<Q>,
        attributes: Option<&Attributes>,
        (faces, moved): (&[usize], &[VertexId]),
        (cost, spent, lost): (f32, f64, f64),
    ) {
        let mut key = cost.max(self.floor);
        let Some(names) = &store.names else { return };
        self.seen.clear();
        let (first, first_row) = (self.log.dead.len(), self.log.rows.len());
        let (wedges_before, vertices_before) = (self.copy.vertex_of.len(), self.copy.positions.len());
        for &f in faces {
            let face = self.names.faces[names[f] as usize];
            key = self.log_face(store, attributes, (f, face), moved, (key, wedges_before));
        }
        if self.moves_whole {
            self.average_movement(store, (faces, moved), (first_row, wedges_before));
        }
        for &slot in moved {
            self.log_place(store, slot, vertices_before);
        }
        self.highest = self.highest.max(key);
        for i in first..self.log.dead.len() {
            for w in self.log.dead[i].1 {
                self.keys[self.copy.vertex_of[w.index()].index()] = key;
            }
        }
        for &f in faces {
            for w in self.copy.faces[self.names.faces[names[f] as usize].index()] {
                self.keys[self.copy.vertex_of[w.index()].index()] = key;
            }
        }
        self.end(key, spent, lost);
    }

    /// Logs the differences at the corners of a face, by its numbers in the store and in the input. Returns
    /// the key, raised to the keys of the face's vertices before and after. Rows of wedges created by the
    /// same change, from `wedges_before` on, are new and not logged.
    fn log_face<Q: VertexMemory>(
        &mut self,
        store: &Store<Q>,
        attributes: Option<&Attributes>,
        (f, face): (usize, FaceId),
        moved: &[VertexId],
        (mut key, wedges_before): (f32, usize),
    ) -> f32 {
        let before = self.copy.faces[face.index()];
        for w in before {
            key = key.max(self.keys[self.copy.vertex_of[w.index()].index()]);
        }
        if store.t[f][0] == NONE {
            self.log.dead.push((face, before));
            return key;
        }
        for k in 0..3 {
            let slot = store.t[f][k];
            let origin = store.v[slot.index()].origin;
            let own = store.wedges.as_ref().map(|w| w[f][k]);
            let now = self.wedge(origin, own, attributes);
            let vertex = self.vertex(origin);
            key = key.max(self.keys[vertex.index()]);
            if now != before[k] {
                self.log.corners.push((face.0 * 3 + k as u32, before[k]));
                self.copy.faces[face.index()][k] = now;
            }
            let owner = self.copy.vertex_of[now.index()];
            if owner != vertex {
                self.log.owners.push((now, owner));
                self.copy.vertex_of[now.index()] = vertex;
            }
            if let (Some(w), true) = (own, now.index() < wedges_before && moved.contains(&slot)) {
                self.log_row(attributes, now, w);
            }
        }
        key
    }

    /// Logs the old position of a vertex, if the position has changed and the vertex is older than the
    /// change.
    fn log_place<Q: VertexMemory>(&mut self, store: &Store<Q>, slot: VertexId, vertices_before: usize) {
        let x = &store.v[slot.index()];
        if x.kind.is_gone() {
            return;
        }
        let vertex = self.vertex(x.origin);
        let at = match x.kind.is_moved() {
            true => self.frame.user_from_unit(x.p.as_dvec3()),
            false => {
                let place = self.names.vertices[store.place_of(x.origin).index()];
                self.input.view().get(place)
            }
        };
        let before = self.copy.positions.view().get(vertex);
        let now = match &mut self.copy.positions {
            Positions::F32(p) => {
                p[vertex.index()] = at.map(|x| x as f32);
                p[vertex.index()].map(f64::from)
            }
            Positions::F64(p) => {
                p[vertex.index()] = at;
                at
            }
        };
        if vertex.index() < vertices_before && now.map(f64::to_bits) != before.map(f64::to_bits) {
            self.log.places.push(vertex);
            self.log.positions.push(before);
        }
    }

    /// Averages the values that displace a vertex as a whole over the wedges of each vertex that a change
    /// moved. The rows logged by the change start at `first_row`, the wedges created by it at `there`.
    fn average_movement<Q: VertexMemory>(
        &mut self,
        store: &Store<Q>,
        (faces, moved): (&[usize], &[VertexId]),
        (first_row, there): (usize, usize),
    ) {
        let (Some((rows, places)), Some(names)) = (&self.rows, &store.names) else { return };
        let width = self.copy.width;
        for &slot in moved {
            let mut wedges: Vec<WedgeId> = Vec::new();
            for &f in faces.iter().filter(|f| store.t[**f][0] != NONE) {
                let face = self.copy.faces[self.names.faces[names[f] as usize].index()];
                wedges.extend((0..3).filter(|&k| store.t[f][k] == slot).map(|k| face[k]));
            }
            wedges.sort_unstable();
            wedges.dedup();
            let row = |w: &WedgeId| self.copy.rows[w.index() * width..][..width].to_vec();
            let before: Vec<Vec<f32>> = wedges.iter().map(row).collect();
            let mut after = before.clone();
            rows.average_movement(places, &mut after);
            for ((w, before), after) in wedges.into_iter().zip(before).zip(after).filter(|r| r.0.1 != r.1) {
                if w.index() < there && !self.log.rows[first_row..].contains(&w) {
                    self.log.rows.push(w);
                    self.log.values.extend(before);
                }
                self.copy.rows[w.index() * width..][..width].copy_from_slice(&after);
            }
        }
    }

    fn log_row(&mut self, attributes: Option<&Attributes>, name: WedgeId, w: WedgeId) {
        if self.seen.contains(&name) {
            return;
        }
        self.seen.push(name);
        let (width, start) = (self.copy.width, self.log.values.len());
        let range = name.index() * width..(name.index() + 1) * width;
        self.log.values.extend_from_slice(&self.copy.rows[range.clone()]);
        self.write(attributes, name, w);
        let bits = |row: &[f32]| row.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        if bits(&self.copy.rows[range]) == bits(&self.log.values[start..]) {
            self.log.values.truncate(start);
        } else {
            self.log.rows.push(name);
        }
    }

    /// Copies the engine's values of a wedge to the row of its input number.
    fn write(&mut self, attributes: Option<&Attributes>, name: WedgeId, w: WedgeId) {
        let width = self.copy.width;
        if let (Some((rows, places)), Some(attributes)) = (&self.rows, attributes) {
            rows.write(attributes, w, places, &mut self.copy.rows[name.index() * width..][..width]);
        }
    }

    fn end(&mut self, key: f32, spent: f64, lost: f64) {
        let log = &mut self.log;
        let (rows, places) = (log.rows.len(), log.places.len());
        let ends = [log.dead.len(), log.corners.len(), log.owners.len(), rows, places, log.merged.len()]
            .map(|n| n as u32);
        let [spent_before, lost_before] = std::mem::replace(&mut self.before, [spent, lost]);
        let (spent, lost) = ((spent - spent_before) as f32, (lost - lost_before) as f32);
        log.steps.push(LoggedChange { key, spent, lost, ends });
    }
}

#[cfg(test)]
mod tests;
