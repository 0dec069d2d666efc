//! Conversion of a record to a base mesh and splits.

use lodsmith_core::splits::{Changes, Counts, Layout, NO_ORIGINAL, Original, SplitData};
use lodsmith_core::{FaceId, Positions, RegionId, TriMesh, VertexId, WedgeId};

use crate::collapse::record::{Log, LoggedChange, MeshCopy};

/// Splits, and the numbers of their elements in the record.
pub(super) struct Arranged {
    pub(super) data: SplitData,
    /// The changes of the record, first contraction first: as many as there are splits.
    pub(super) order: Vec<usize>,
    /// The face of the input for each face of the splits.
    pub(super) faces: Vec<FaceId>,
    /// The number of each vertex and of each wedge in the record.
    pub(super) vertices: Vec<VertexId>,
    pub(super) wedges: Vec<WedgeId>,
}

/// Marks an element without a number.
const NO_NUMBER: u32 = u32::MAX;

/// Returns the layout of the values of a mesh.
pub(super) fn layout(mesh: &TriMesh) -> Layout {
    Layout {
        has_normals: mesh.normals().is_some(),
        has_uvs: mesh.uvs().is_some(),
        has_colors: mesh.colors().is_some(),
        further: mesh.further_attributes().iter().map(|a| (a.semantic.clone(), a.width)).collect(),
    }
}

/// Returns the rows of a mesh, wedge after wedge.
pub(super) fn rows(mesh: &TriMesh) -> Vec<f32> {
    let mut rows = Vec::with_capacity(mesh.wedge_count() * layout(mesh).width());
    for w in (0..mesh.wedge_count() as u32).map(WedgeId) {
        rows.extend(mesh.normals().iter().flat_map(|n| n[w.index()]));
        rows.extend(mesh.uvs().iter().flat_map(|t| t[w.index()]));
        rows.extend(mesh.colors().iter().flat_map(|c| c[w.index()]));
        rows.extend(mesh.further_attributes().iter().flat_map(|a| a.of(w)));
    }
    rows
}

/// Returns a progressive mesh of one level: the mesh unchanged.
pub(super) fn single_level(mesh: &TriMesh) -> SplitData {
    let counts = [mesh.face_count(), mesh.wedge_count(), mesh.vertex_count()].map(|n| n as u32);
    fn none<A, T>(to: T) -> Changes<A, T> {
        Changes { ends: vec![0], at: Vec::new(), to }
    }
    let places = match mesh.positions() {
        Positions::F32(_) => Positions::F32(Vec::new()),
        Positions::F64(_) => Positions::F64(Vec::new()),
    };
    SplitData {
        counts: vec![Counts { faces: counts[0], wedges: counts[1], vertices: counts[2] }],
        faces: mesh.triangles().to_vec(),
        regions: mesh.regions().map(<[_]>::to_vec),
        vertex_of: mesh.vertex_map().map(<[_]>::to_vec),
        layout: layout(mesh),
        values: rows(mesh),
        positions: mesh.positions().clone(),
        corners: none(Vec::new()),
        owners: none(Vec::new()),
        rows: none(Vec::new()),
        places: none(places),
        checkpoints: Vec::new(),
        original: Some(Original {
            vertices: (0..counts[2]).map(VertexId).collect(),
            wedges: (0..counts[1]).map(WedgeId).collect(),
            faces: (0..counts[0]).map(FaceId).collect(),
            has_vertex_map: mesh.vertex_map().is_some(),
        }),
    }
}

/// Returns the range of a change's entries in a list of the log.
fn entries(steps: &[LoggedChange], change: usize, list: usize) -> std::ops::Range<usize> {
    let before = change.checked_sub(1).map_or(0, |i| steps[i].ends[list]);
    before as usize..steps[change].ends[list] as usize
}

/// Returns the merged vertices of a change.
pub(super) fn merged(log: &Log, change: usize) -> &[(VertexId, VertexId)] {
    &log.merged[entries(&log.steps, change, 5)]
}

/// The splits being built, and the mesh at the current level in the numbering of the record.
struct Builder<'a> {
    copy: MeshCopy,
    input: &'a TriMesh,
    number_of_wedge: Vec<u32>,
    number_of_vertex: Vec<u32>,
    number_of_face: Vec<u32>,
    wedges: Vec<WedgeId>,
    vertices: Vec<VertexId>,
    faces: Vec<FaceId>,
    data: SplitData,
}

/// Puts changes in an order in which each level is a good mesh, and elements in the order in which they
/// become live. `copy` is the mesh at the end of the record; `by_place` has the faces of the input in an
/// order that is local in space.
pub(super) fn build_splits(input: &TriMesh, copy: MeshCopy, log: &Log, by_place: &[FaceId]) -> Arranged {
    let steps = &log.steps;
    let mut order: Vec<usize> = (0..steps.len()).collect();
    order.sort_by(|&i, &j| steps[i].key.total_cmp(&steps[j].key).then(i.cmp(&j)));
    let mut is_used = vec![false; input.wedge_count()];
    input.triangles().iter().flatten().for_each(|w| is_used[w.index()] = true);
    let mut has_wedge = vec![false; input.vertex_count()];
    for w in (0..is_used.len()).filter(|&w| is_used[w]).map(WedgeId::new) {
        has_wedge[input.vertex_of(w).index()] = true;
    }
    let is_all = is_used.iter().chain(&has_wedge).all(|x| *x);
    // The first change is the cleanup at the start, which may be empty.
    if is_all && (0..5).all(|list| entries(steps, 0, list).is_empty()) {
        order.retain(|&i| i != 0);
    }
    let mut b = Builder::new(input, copy);
    let mut is_alive = vec![true; input.face_count()];
    log.dead.iter().for_each(|d| is_alive[d.0.index()] = false);
    for &f in by_place.iter().filter(|f| is_alive[f.index()]) {
        b.add_face(f);
    }
    b.count();
    for (i, &change) in order.iter().enumerate().rev() {
        b.split(log, change);
        if i == 0 {
            b.add_unused();
        }
        b.count();
    }
    if order.is_empty() {
        b.add_unused();
        b.data.counts.clear();
        b.count();
        b.data.corners.ends.truncate(1);
        b.data.owners.ends.truncate(1);
        b.data.rows.ends.truncate(1);
        b.data.places.ends.truncate(1);
    }
    b.finish(order)
}

impl<'a> Builder<'a> {
    fn new(input: &'a TriMesh, copy: MeshCopy) -> Self {
        let empty = |p: &Positions| match p {
            Positions::F32(_) => Positions::F32(Vec::new()),
            Positions::F64(_) => Positions::F64(Vec::new()),
        };
        let (positions, moved) = (empty(&copy.positions), empty(&copy.positions));
        let data = SplitData {
            counts: Vec::new(),
            faces: Vec::with_capacity(copy.faces.len()),
            regions: None,
            vertex_of: Some(Vec::new()),
            layout: layout(input),
            values: Vec::with_capacity(copy.rows.len()),
            positions,
            corners: Changes::default(),
            owners: Changes::default(),
            rows: Changes::default(),
            places: Changes { ends: Vec::new(), at: Vec::new(), to: moved },
            checkpoints: Vec::new(),
            original: None,
        };
        Self {
            number_of_wedge: vec![NO_NUMBER; copy.vertex_of.len()],
            number_of_vertex: vec![NO_NUMBER; copy.positions.len()],
            number_of_face: vec![NO_NUMBER; copy.faces.len()],
            wedges: Vec::with_capacity(copy.vertex_of.len()),
            vertices: Vec::with_capacity(copy.positions.len()),
            faces: Vec::with_capacity(copy.faces.len()),
            copy,
            input,
            data,
        }
    }

    /// Returns the number of a vertex, which becomes live now unless it is already.
    fn vertex(&mut self, name: VertexId) -> VertexId {
        let number = &mut self.number_of_vertex[name.index()];
        if *number == NO_NUMBER {
            *number = self.vertices.len() as u32;
            self.vertices.push(name);
            match (&mut self.data.positions, &self.copy.positions) {
                (Positions::F32(all), Positions::F32(p)) => all.push(p[name.index()]),
                (Positions::F64(all), Positions::F64(p)) => all.push(p[name.index()]),
                (all, p) => push(all, p.view().get(name)),
            }
        }
        VertexId(*number)
    }

    /// Returns the number of a wedge, which becomes live now unless it is already.
    fn wedge(&mut self, name: WedgeId) -> WedgeId {
        if self.number_of_wedge[name.index()] == NO_NUMBER {
            self.number_of_wedge[name.index()] = self.wedges.len() as u32;
            self.wedges.push(name);
            let width = self.copy.width;
            self.data.values.extend_from_slice(&self.copy.rows[name.index() * width..][..width]);
            let vertex = self.vertex(self.copy.vertex_of[name.index()]);
            self.data.vertex_of.iter_mut().for_each(|all| all.push(vertex));
        }
        WedgeId(self.number_of_wedge[name.index()])
    }

    fn add_face(&mut self, name: FaceId) {
        let corners = self.copy.faces[name.index()].map(|w| self.wedge(w));
        self.number_of_face[name.index()] = self.faces.len() as u32;
        self.faces.push(name);
        self.data.faces.push(corners);
    }

    /// Undoes a change.
    fn split(&mut self, log: &Log, change: usize) {
        let before = self.data.counts.last().copied().unwrap_or_default();
        let is_older = |number: u32, count: u32| number < count;
        let of = |list: usize| entries(&log.steps, change, list);
        for &(w, v) in &log.owners[of(2)] {
            self.copy.vertex_of[w.index()] = v;
        }
        let width = self.copy.width;
        for i in of(3) {
            let w = log.rows[i];
            let row = &log.values[i * width..][..width];
            self.copy.rows[w.index() * width..][..width].copy_from_slice(row);
            if is_older(self.number_of_wedge[w.index()], before.wedges) {
                self.data.rows.at.push(WedgeId(self.number_of_wedge[w.index()]));
                self.data.rows.to.extend_from_slice(row);
            }
        }
        for i in of(4) {
            let (v, p) = (log.places[i], log.positions[i]);
            set(&mut self.copy.positions, v, p);
            if is_older(self.number_of_vertex[v.index()], before.vertices) {
                self.data.places.at.push(VertexId(self.number_of_vertex[v.index()]));
                push(&mut self.data.places.to, p);
            }
        }
        for &(at, w) in &log.corners[of(1)] {
            let face = at as usize / 3;
            self.copy.faces[face][at as usize % 3] = w;
            let wedge = self.wedge(w);
            self.data.corners.at.push(self.number_of_face[face] * 3 + at % 3);
            self.data.corners.to.push(wedge);
        }
        for &(w, v) in &log.owners[of(2)] {
            let number = self.number_of_wedge[w.index()];
            if is_older(number, before.wedges) {
                let vertex = self.vertex(v);
                self.data.owners.at.push(WedgeId(number));
                self.data.owners.to.push(vertex);
            }
        }
        for &(f, corners) in &log.dead[of(0)] {
            self.copy.faces[f.index()] = corners;
            self.add_face(f);
        }
    }

    /// Adds the elements that no face of the input uses.
    fn add_unused(&mut self) {
        for w in 0..self.input.wedge_count() as u32 {
            self.wedge(WedgeId(w));
        }
        for v in 0..self.input.vertex_count() as u32 {
            self.vertex(VertexId(v));
        }
    }

    /// Ends a level.
    fn count(&mut self) {
        let [faces, wedges, vertices] =
            [self.faces.len(), self.wedges.len(), self.vertices.len()].map(|n| n as u32);
        self.data.counts.push(Counts { faces, wedges, vertices });
        self.data.corners.ends.push(self.data.corners.at.len() as u32);
        self.data.owners.ends.push(self.data.owners.at.len() as u32);
        self.data.rows.ends.push(self.data.rows.at.len() as u32);
        self.data.places.ends.push(self.data.places.at.len() as u32);
    }

    fn finish(self, order: Vec<usize>) -> Arranged {
        let (mut data, input) = (self.data, self.input);
        let of_input = |name: u32, count: usize| if (name as usize) < count { name } else { NO_ORIGINAL };
        data.original = Some(Original {
            vertices: self.vertices.iter().map(|v| VertexId(of_input(v.0, input.vertex_count()))).collect(),
            wedges: self.wedges.iter().map(|w| WedgeId(of_input(w.0, input.wedge_count()))).collect(),
            faces: self.faces.clone(),
            has_vertex_map: input.vertex_map().is_some(),
        });
        let regions = |r: &[RegionId]| self.faces.iter().map(|f| r[f.index()]).collect();
        data.regions = input.regions().map(regions);
        let is_same = |all: &Vec<VertexId>| all.iter().enumerate().all(|(w, v)| v.index() == w);
        let counts_agree = data.counts.iter().all(|c| c.wedges == c.vertices);
        if counts_agree && data.owners.at.is_empty() && data.vertex_of.as_ref().is_some_and(is_same) {
            data.vertex_of = None;
        }
        Arranged { data, order, faces: self.faces, vertices: self.vertices, wedges: self.wedges }
    }
}

fn push(all: &mut Positions, p: [f64; 3]) {
    match all {
        Positions::F32(all) => all.push(p.map(|x| x as f32)),
        Positions::F64(all) => all.push(p),
    }
}

fn set(all: &mut Positions, v: VertexId, p: [f64; 3]) {
    match all {
        Positions::F32(all) => all[v.index()] = p.map(|x| x as f32),
        Positions::F64(all) => all[v.index()] = p,
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{Attribute, Semantic, Splits};

    use super::*;
    use crate::test_support::pyramid;

    /// Returns the log of one collapse of the apex of a pyramid into corner 1, which moves, and the mesh after it.
    fn collapsed(input: &TriMesh) -> (MeshCopy, Log) {
        let wedges = |t: [u32; 3]| t.map(WedgeId);
        let mut positions = input.positions().clone();
        set(&mut positions, VertexId(1), [0.5, 0.5, 0.25]);
        let mut faces = input.triangles().to_vec();
        (faces[1], faces[2]) = (wedges([1, 2, 3]), wedges([1, 3, 4]));
        let copy = MeshCopy {
            faces,
            vertex_of: (0..5).map(VertexId).collect(),
            width: 0,
            rows: Vec::new(),
            positions,
        };
        let step = |key, ends| LoggedChange { key, spent: 0.0, lost: 0.0, ends };
        let log = Log {
            dead: vec![(FaceId(0), wedges([0, 1, 2])), (FaceId(3), wedges([0, 4, 1]))],
            corners: vec![(3, WedgeId(0)), (6, WedgeId(0))],
            places: vec![VertexId(1)],
            positions: vec![[1.0, 1.0, 0.0]],
            merged: vec![(VertexId(0), VertexId(1))],
            steps: vec![step(f32::NEG_INFINITY, [0; 6]), step(1.0, [2, 2, 0, 0, 1, 1])],
            ..Log::default()
        };
        (copy, log)
    }

    #[test]
    fn elements_are_numbered_as_they_become_live() {
        let input = pyramid(0.5).mesh();
        let (copy, log) = collapsed(&input);
        let by_place: Vec<FaceId> = (0..4).map(FaceId).collect();
        let Arranged { data, order, faces, vertices, wedges } = build_splits(&input, copy, &log, &by_place);
        // The empty cleanup is no split.
        assert_eq!(order, [1]);
        assert_eq!(merged(&log, 1), [(VertexId(0), VertexId(1))]);
        // Two faces of the base, then the removed ones; the apex comes last.
        assert_eq!(faces, [1, 2, 0, 3].map(FaceId));
        assert_eq!(vertices, [1, 2, 3, 4, 0].map(VertexId));
        assert_eq!(wedges, [1, 2, 3, 4, 0].map(WedgeId));
        let counts = |faces, vertices| Counts { faces, wedges: vertices, vertices };
        assert_eq!(data.counts, [counts(2, 4), counts(4, 5)]);
        assert_eq!(data.faces, [[0, 1, 2], [0, 2, 3], [4, 0, 1], [4, 3, 0]].map(|t| t.map(WedgeId)));
        assert_eq!((&data.corners.at[..], &data.corners.to[..]), (&[0, 3][..], &[WedgeId(4); 2][..]));
        assert_eq!((&data.corners.ends[..], &data.places.ends[..]), (&[0, 2][..], &[0, 1][..]));
        assert_eq!(
            (&data.places.at[..], data.places.to.view().get(VertexId(0))),
            (&[VertexId(0)][..], [1.0, 1.0, 0.0])
        );
        assert_eq!(data.positions.view().get(VertexId(0)), [0.5, 0.5, 0.25]);
        assert_eq!(data.vertex_of, None);
        let progressive = crate::Progressive::new(Splits::new(data).expect("sound splits"));
        assert_eq!(progressive.mesh().expect("a mesh"), input);
    }

    #[test]
    fn changes_are_ordered_by_their_keys() {
        // Two changes of one face each: the later one is cheaper, and is done first.
        let input = pyramid(0.5).mesh();
        let dead = |f: usize| (FaceId::new(f), input.triangles()[f]);
        let step = |key, dead| LoggedChange { key, spent: 0.0, lost: 0.0, ends: [dead, 0, 0, 0, 0, 0] };
        let log = Log {
            dead: vec![dead(0), dead(1)],
            steps: vec![step(f32::NEG_INFINITY, 0), step(2.0, 1), step(1.0, 2)],
            ..Log::default()
        };
        let copy = MeshCopy {
            faces: input.triangles().to_vec(),
            vertex_of: (0..5).map(VertexId).collect(),
            width: 0,
            rows: Vec::new(),
            positions: input.positions().clone(),
        };
        let by_place: Vec<FaceId> = (0..4).rev().map(FaceId).collect();
        let arranged = build_splits(&input, copy, &log, &by_place);
        assert_eq!(arranged.order, [2, 1]);
        // The base in spatial order, then the most expensive change.
        assert_eq!(arranged.faces, [3, 2, 0, 1].map(FaceId));
    }

    #[test]
    fn rows_contain_all_attributes_of_a_wedge_in_order() {
        let mut mesh = pyramid(0.5).mesh();
        let value = |w: u32, i: u32| (10 * w + i) as f32;
        mesh.set_normals(Some((0..5).map(|w| [0, 1, 2].map(|i| value(w, i))).collect()))
            .expect("one for each wedge");
        mesh.set_uvs(Some((0..5).map(|w| [3, 4].map(|i| value(w, i))).collect()))
            .expect("one for each wedge");
        let values = (0..5).map(|w| value(w, 5)).collect();
        let own = Attribute { semantic: Semantic::Custom("_HEAT".into()), width: 1, values };
        mesh.add_attribute(own).expect("one for each wedge");
        assert_eq!(layout(&mesh).width(), 6);
        assert_eq!(rows(&mesh), (0..5).flat_map(|w| (0..6).map(move |i| value(w, i))).collect::<Vec<_>>());
        let single =
            crate::Progressive::new(Splits::new(single_level(&mesh)).expect("splits of a valid mesh"));
        assert_eq!((single.top(), single.mesh().expect("a mesh")), (0, mesh));
    }
}
