//! Vertex splits of any mesh, by collapsing random pairs of vertices: the mesh before each collapse is
//! compared with the mesh after it, element by element.

use lodsmith_core::splits::{Changes, Checkpoint, Counts, Layout, NO_ORIGINAL, Original, SplitData, Splits};
use lodsmith_core::{FaceId, Positions, RegionId, TriMesh, VertexId, WedgeId};

/// A random generator that gives the same numbers on every machine.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % n.max(1)
    }
}

#[derive(Clone, PartialEq)]
struct State {
    faces: Vec<Option<[usize; 3]>>,
    vertex_of: Vec<Option<usize>>,
    rows: Vec<Vec<f32>>,
    places: Vec<Option<[f64; 3]>>,
}

impl State {
    fn of(mesh: &TriMesh) -> Self {
        let row = |w: usize| {
            let mut row: Vec<f32> = Vec::new();
            row.extend(mesh.normals().iter().flat_map(|n| n[w]));
            row.extend(mesh.uvs().iter().flat_map(|n| n[w]));
            row.extend(mesh.colors().iter().flat_map(|n| n[w]));
            let further = mesh.further_attributes().iter();
            row.extend(further.flat_map(|a| a.values[w * a.width..][..a.width].iter().copied()));
            row
        };
        let wedges = 0..mesh.wedge_count();
        Self {
            faces: mesh.triangles().iter().map(|t| Some(t.map(WedgeId::index))).collect(),
            vertex_of: wedges.clone().map(|w| Some(mesh.vertex_of(WedgeId::new(w)).index())).collect(),
            rows: wedges.map(row).collect(),
            places: mesh.positions().view().iter().map(Some).collect(),
        }
    }

    /// Collapses `gone` into `kept`: its wedges move there, or merge with existing ones.
    fn contract(&mut self, kept: usize, gone: usize, has_map: bool, dice: &mut Random) {
        let single = matches!(self.places[kept], Some(p) if p.iter().all(|x| (*x as f32) as f64 == *x));
        let (Some(p), Some(q)) = (self.places[kept], self.places[gone].take()) else { return };
        let middle = [0, 1, 2].map(|k| (p[k] + q[k]) / 2.0);
        self.places[kept] = Some(if single { middle.map(|x| f64::from(x as f32)) } else { middle });
        let own: Vec<usize> =
            (0..self.vertex_of.len()).filter(|&w| self.vertex_of[w] == Some(kept)).collect();
        for w in 0..self.vertex_of.len() {
            if self.vertex_of[w] != Some(gone) {
                continue;
            }
            if has_map && (own.is_empty() || dice.below(3) == 0) {
                self.vertex_of[w] = Some(kept);
                continue;
            }
            let into = own[dice.below(own.len())];
            self.vertex_of[w] = None;
            for corner in self.faces.iter_mut().flatten().flatten() {
                *corner = if *corner == w { into } else { *corner };
            }
            let row = self.rows[w].clone();
            for (a, b) in self.rows[into].iter_mut().zip(row) {
                *a = (*a + b) / 2.0;
            }
        }
        for face in &mut self.faces {
            let vertices = face.map(|f| f.map(|w| self.vertex_of[w]));
            *face = face.filter(|_| vertices.is_some_and(|[a, b, c]| a != b && b != c && c != a));
        }
    }
}

/// Collapses until `left` faces remain, several pairs in the first step, with two checkpoints.
pub(crate) fn record(mesh: &TriMesh, left: usize, seed: u64) -> Splits {
    let dice = &mut Random(seed);
    let has_map = mesh.vertex_map().is_some();
    let mut states = vec![State::of(mesh)];
    loop {
        let mut state = states[states.len() - 1].clone();
        let faces: Vec<[usize; 3]> = state.faces.iter().flatten().copied().collect();
        if faces.len() <= left {
            break;
        }
        for _ in 0..if states.len() == 1 { 4 } else { 1 } {
            let face = faces[dice.below(faces.len())];
            let k = dice.below(3);
            let mut ends = [face[k], face[(k + 1) % 3]].map(|w| state.vertex_of[w]);
            if dice.below(8) == 0 {
                ends[1] = state.vertex_of[faces[dice.below(faces.len())][0]];
            }
            if let [Some(kept), Some(gone)] = ends
                && kept != gone
            {
                state.contract(kept, gone, has_map, dice);
            }
        }
        states.push(state);
    }
    states.reverse();
    splits_of(&states, mesh, dice)
}

/// Numbers elements in the order of creation: returns the number of each element, and all elements in order.
fn births(
    states: &[State],
    count: usize,
    is_there: impl Fn(&State, usize) -> bool,
) -> (Vec<u32>, Vec<usize>) {
    let (mut numbers, mut order) = (vec![NO_ORIGINAL; count], Vec::new());
    for state in states {
        for (i, number) in numbers.iter_mut().enumerate() {
            if *number == NO_ORIGINAL && is_there(state, i) {
                *number = order.len() as u32;
                order.push(i);
            }
        }
    }
    (numbers, order)
}

fn splits_of(states: &[State], mesh: &TriMesh, dice: &mut Random) -> Splits {
    let has_map = mesh.vertex_map().is_some();
    let full = &states[states.len() - 1];
    let (face_at, face_order) = births(states, full.faces.len(), |s, f| s.faces[f].is_some());
    let (mut wedge_at, mut wedge_order) =
        births(states, full.vertex_of.len(), |s, w| s.vertex_of[w].is_some());
    let (vertex_at, vertex_order) = births(states, full.places.len(), |s, v| s.places[v].is_some());
    if !has_map {
        (wedge_at, wedge_order) = (vertex_at.clone(), vertex_order.clone());
    }
    let mut layout = Layout {
        has_normals: mesh.normals().is_some(),
        has_uvs: mesh.uvs().is_some(),
        has_colors: mesh.colors().is_some(),
        further: Vec::new(),
    };
    layout.further = mesh.further_attributes().iter().map(|a| (a.semantic.clone(), a.width)).collect();
    let born = |is_there: &dyn Fn(&State) -> bool| states.iter().find(|s| is_there(s)).unwrap();
    let positions = |all: Vec<[f64; 3]>| match mesh.positions() {
        Positions::F32(_) => Positions::F32(all.into_iter().map(|p| p.map(|x| x as f32)).collect()),
        Positions::F64(_) => Positions::F64(all),
    };
    let face_of = |f: [usize; 3]| f.map(|w| WedgeId(wedge_at[w]));
    let width = layout.width();
    let mut data = SplitData {
        counts: states
            .iter()
            .map(|s| Counts {
                faces: s.faces.iter().flatten().count() as u32,
                wedges: s.vertex_of.iter().flatten().count() as u32,
                vertices: s.places.iter().flatten().count() as u32,
            })
            .collect(),
        faces: face_order
            .iter()
            .map(|&f| face_of(born(&|s| s.faces[f].is_some()).faces[f].unwrap()))
            .collect(),
        regions: mesh.regions().map(|r| face_order.iter().map(|&f| r[f]).collect::<Vec<RegionId>>()),
        vertex_of: has_map.then(|| {
            let of = |&w: &usize| born(&|s| s.vertex_of[w].is_some()).vertex_of[w].unwrap();
            wedge_order.iter().map(|w| VertexId(vertex_at[of(w)])).collect()
        }),
        layout,
        values: wedge_order
            .iter()
            .flat_map(|&w| born(&|s| s.vertex_of[w].is_some()).rows[w].clone())
            .collect(),
        positions: positions(
            vertex_order.iter().map(|&v| born(&|s| s.places[v].is_some()).places[v].unwrap()).collect(),
        ),
        corners: Changes { ends: vec![0], at: Vec::new(), to: Vec::new() },
        owners: Changes { ends: vec![0], at: Vec::new(), to: Vec::new() },
        rows: Changes { ends: vec![0], at: Vec::new(), to: Vec::new() },
        places: Changes { ends: vec![0], at: Vec::new(), to: positions(Vec::new()) },
        checkpoints: Vec::new(),
        original: None,
    };
    let mut moved = Vec::new();
    for pair in states.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        for &f in &face_order {
            if let (Some(before), Some(after)) = (a.faces[f], b.faces[f]) {
                for k in (0..3).filter(|&k| before[k] != after[k]) {
                    data.corners.at.push(face_at[f] * 3 + k as u32);
                    data.corners.to.push(WedgeId(wedge_at[after[k]]));
                }
            }
        }
        data.corners.ends.push(data.corners.at.len() as u32);
        for &w in &wedge_order {
            let (Some(before), Some(after)) = (a.vertex_of[w], b.vertex_of[w]) else { continue };
            if before != after {
                data.owners.at.push(WedgeId(wedge_at[w]));
                data.owners.to.push(VertexId(vertex_at[after]));
            }
            if a.rows[w] != b.rows[w] {
                data.rows.at.push(WedgeId(wedge_at[w]));
                data.rows.to.extend(&b.rows[w]);
            }
        }
        data.owners.ends.push(data.owners.at.len() as u32);
        data.rows.ends.push(data.rows.at.len() as u32);
        for &v in &vertex_order {
            let (Some(before), Some(after)) = (a.places[v], b.places[v]) else { continue };
            if before != after {
                data.places.at.push(VertexId(vertex_at[v]));
                moved.push(after);
            }
        }
        data.places.ends.push(data.places.at.len() as u32);
    }
    data.places.to = positions(moved);
    for (level, error) in [(0, 0.5), (states.len() / 2, 0.25)] {
        let counts = data.counts[level];
        let vertices: Vec<_> = (0..counts.vertices).filter(|_| dice.below(4) > 0).map(VertexId).collect();
        let wedges: Vec<_> =
            (0..counts.wedges).filter(|_| width > 0 && dice.below(4) > 0).map(WedgeId).collect();
        let small = |dice: &mut Random| (dice.below(2001) as f32 - 1000.0) / 100_000.0;
        data.checkpoints.push(Checkpoint {
            level: level as u32,
            error,
            moves: vertices.iter().map(|_| [0; 3].map(|_| small(dice))).collect(),
            changes: (0..wedges.len() * width).map(|_| small(dice)).collect(),
            vertices,
            wedges,
        });
    }
    if states.len() / 2 == 0 {
        data.checkpoints.pop();
    }
    data.original = Some(Original {
        vertices: vertex_order.iter().map(|&v| VertexId::new(v)).collect(),
        wedges: wedge_order.iter().map(|&w| WedgeId::new(w)).collect(),
        faces: face_order.iter().map(|&f| FaceId::new(f)).collect(),
        has_vertex_map: has_map,
    });
    Splits::new(data).expect("what was recorded fits together")
}
