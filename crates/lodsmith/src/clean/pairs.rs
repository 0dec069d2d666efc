//! Pairing of faces along non-manifold edges, and the vertices that result.
//!
//! Around an edge in angular order, each face that opens an inside is paired with the face that closes it,
//! like brackets; unpaired faces get a border. Corners connected across pairs share a vertex.

use glam::DVec3;
use lodsmith_core::mesh::weld::Weld;
use lodsmith_core::topology::Topology;
use lodsmith_core::{DisjointSets, FaceId, HalfEdgeId, Surface, VertexId};

const NO_PAIR: u32 = u32::MAX;

/// A cut surface: faces over vertices, some of them new.
pub(super) struct CutSurface {
    pub(super) faces: Vec<[VertexId; 3]>,
    /// For each new vertex, in order of index, the vertex whose position it copies.
    pub(super) copy_of: Vec<VertexId>,
}

/// Cuts a surface so that it becomes manifold and oriented, with borders.
pub(super) fn cut_non_manifold(surface: &Surface<'_>) -> CutSurface {
    let topology = Topology::unwelded(surface);
    let mut pair = vec![NO_PAIR; topology.face_count() * 3];
    let mut ring = Vec::new();
    for first in topology.edges() {
        ring.clear();
        ring.extend(topology.edge(first));
        match_ring(surface, &topology, &mut ring, |h, g| {
            pair[h.index()] = g.0;
            pair[g.index()] = h.0;
        });
    }
    // All rounds but the last separate pairs, and none creates any.
    let mut round = 0;
    loop {
        let parted = assign_vertices(surface, &topology, &pair);
        // An edge whose two pairs share both ends still has four faces.
        let triangles = parted.faces.clone();
        let places: Vec<[f64; 3]> = vec![[0.0; 3]; surface.positions().len() + parted.copy_of.len()];
        let positions = lodsmith_core::PositionsView::F64(&places);
        let Ok(whole) = Surface::with_triangles(positions, triangles) else { return parted };
        let now = Topology::unwelded(&whole);
        let is_bad = |h: HalfEdgeId| match now.twin(h) {
            // Two unpaired half-edges may still coincide: the two ends of one fan.
            Some(g) => {
                pair[h.index()] != g.0 && pair[h.index()] & pair[g.index()] != NO_PAIR
                    || now.origin(h) == now.origin(g)
            }
            None => pair[h.index()] != NO_PAIR || now.edge(h).nth(1).is_some(),
        };
        let bad: Vec<HalfEdgeId> = now.edges().filter(|&h| is_bad(h)).collect();
        let mut unpaired = false;
        let mut ends = Vec::new();
        for h in bad.into_iter().flat_map(|h| now.edge(h)) {
            if round == 0 {
                unpaired |= unpair(&mut pair, h);
            }
            ends.extend([topology.origin(h), topology.target(h)]);
        }
        if !unpaired {
            // Separates all faces around both ends: then no edge there can be wrong.
            ends.sort_unstable();
            ends.dedup();
            for c in ends.iter().flat_map(|&v| topology.vertex(v).corners()) {
                unpaired |= unpair(&mut pair, *c) | unpair(&mut pair, c.prev());
            }
        }
        if !unpaired {
            return parted;
        }
        round += 1;
    }
}

/// Dissolves the pair of a half-edge. Returns true if it had one.
fn unpair(pair: &mut [u32], h: HalfEdgeId) -> bool {
    let g = std::mem::replace(&mut pair[h.index()], NO_PAIR);
    if g != NO_PAIR {
        pair[g as usize] = NO_PAIR;
    }
    g != NO_PAIR
}

/// Sews coincident borders, two half-edges per edge. Returns the vertices to merge and the number of sewn
/// edges.
pub(super) fn sew_borders(surface: &Surface<'_>, place: &Weld) -> (Weld, usize) {
    let triangles = surface.triangles().iter().map(|t| t.map(|v| place.of(v))).collect();
    let mut sets = DisjointSets::new(surface.positions().len());
    let weld_of = |sets: DisjointSets| {
        let all = sets.into_representatives().into_iter().map(VertexId).collect();
        Weld::from_representatives(all)
    };
    let Ok(joined) = Surface::with_triangles(surface.positions(), triangles) else {
        return (weld_of(sets), 0);
    };
    let by_place = Topology::unwelded(&joined);
    let own = Topology::unwelded(surface);
    let mut ring = Vec::new();
    let mut count = 0;
    for first in by_place.edges() {
        ring.clear();
        ring.extend(by_place.edge(first).filter(|&h| own.edge(h).nth(1).is_none()));
        match_ring(&joined, &by_place, &mut ring, |h, g| {
            count += 1;
            sets.join(own.origin(h).0, own.target(g).0);
            sets.join(own.target(h).0, own.origin(g).0);
        });
    }
    (weld_of(sets), count)
}

/// Pairs the opposite half-edges of an edge.
fn match_ring(
    surface: &Surface<'_>,
    topology: &Topology,
    ring: &mut [HalfEdgeId],
    mut paired: impl FnMut(HalfEdgeId, HalfEdgeId),
) {
    match *ring {
        [] | [_] => return,
        [h, g] => {
            if topology.origin(h) != topology.origin(g) {
                paired(h, g);
            }
            return;
        }
        _ => {}
    }
    let (from, to) = (topology.origin(ring[0]), topology.target(ring[0]));
    let at = |v: VertexId| DVec3::from(surface.positions().get(v));
    let axis = (at(to) - at(from)).normalize_or(DVec3::X);
    let (x, y) = axis.any_orthonormal_pair();
    let is_along = |h: HalfEdgeId| topology.origin(h) == from;
    let angle = |h: HalfEdgeId| {
        let d = at(topology.target(h.next())) - at(from);
        libm::atan2(d.dot(y), d.dot(x))
    };
    // The inside lies behind a face: towards larger angles for a face against the axis. At equal angles an
    // inside closes first.
    let mut sorted: Vec<(f64, bool, HalfEdgeId)> =
        ring.iter().map(|&h| (angle(h), !is_along(h), h)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
    let mut open: Vec<HalfEdgeId> = Vec::new();
    let mut unmatched = Vec::new();
    for &(_, begins, h) in &sorted {
        match (begins, open.is_empty()) {
            (true, _) => open.push(h),
            (false, true) => unmatched.push(h),
            (false, false) => paired(open.pop().expect("it is not empty"), h),
        }
    }
    // The last ones that opened pair with the first ones that closed, across the end of the circle.
    for h in unmatched {
        let Some(g) = open.pop() else { break };
        paired(g, h);
    }
}

/// Assigns vertices to connected corners: the first fan keeps the vertex, further ones get new ones.
fn assign_vertices(surface: &Surface<'_>, topology: &Topology, pair: &[u32]) -> CutSurface {
    let mut fans = DisjointSets::new(pair.len());
    for h in (0..pair.len()).map(HalfEdgeId::new) {
        if pair[h.index()] != NO_PAIR {
            let g = HalfEdgeId(pair[h.index()]);
            fans.join(h.0, g.next().0);
            fans.join(h.next().0, g.0);
        }
    }
    let vertex_count = surface.positions().len();
    let mut first = vec![NO_PAIR; vertex_count];
    let mut named = vec![VertexId(NO_PAIR); pair.len()];
    let mut copy_of = Vec::new();
    let faces = (0..topology.face_count()).map(|f| {
        [0, 1, 2].map(|k| {
            let corner = HalfEdgeId::of(FaceId::new(f), k);
            let fan = fans.find(corner.0);
            let v = topology.origin(corner);
            if named[fan as usize] == VertexId(NO_PAIR) {
                named[fan as usize] = if first[v.index()] == NO_PAIR {
                    first[v.index()] = fan;
                    v
                } else {
                    copy_of.push(v);
                    VertexId::new(vertex_count + copy_of.len() - 1)
                };
            }
            named[fan as usize]
        })
    });
    let faces = faces.collect();
    CutSurface { faces, copy_of }
}
