//! Grouping of clusters that share much border, and the borders between groups.

use lodsmith_core::VertexId;

use super::hierarchy::{Build, Front};

/// Weight of a shared edge that was on the border of two groups before: it was locked, and should become
/// free. (Guessed.)
const OLD_BORDER: u32 = 2;

/// An edge as a vertex pair, lower index first.
pub(super) type VertexPair = [VertexId; 2];

/// An edge of a cluster that may be shared with other clusters.
struct OpenEdge {
    edge: VertexPair,
    member: u32,
}

/// Returns the open edges of each cluster: edges that are not between exactly two of its faces with
/// consistent orientation.
fn open_edges(build: &Build, front: &[Front]) -> Vec<OpenEdge> {
    let per_cluster = crate::chunks::each(front.len(), |member| {
        let mut edges: Vec<(VertexPair, i32)> = Vec::new();
        for &f in &front[member].faces {
            edges.extend(directed(build.vertices(f)));
        }
        edges.sort_unstable();
        let runs = edges.chunk_by(|a, b| a.0 == b.0);
        let open = runs.filter(|run| run.len() != 2 || run.iter().map(|e| e.1).sum::<i32>() != 0);
        open.map(|run| OpenEdge { edge: run[0].0, member: member as u32 }).collect::<Vec<_>>()
    });
    let mut all: Vec<OpenEdge> = per_cluster.into_iter().flatten().collect();
    all.sort_unstable_by_key(|r| (r.edge, r.member));
    all
}

/// Returns the edges of a face, with 1 or -1 for their direction.
pub(super) fn directed(t: [VertexId; 3]) -> [(VertexPair, i32); 3] {
    [0, 1, 2].map(|k| {
        let (a, b) = (t[k], t[(k + 1) % 3]);
        if a < b { ([a, b], 1) } else { ([b, a], -1) }
    })
}

/// Returns the length of the border shared by each pair of clusters, in both directions, sorted.
fn links(build: &Build, front: &[Front]) -> Vec<(u32, u32, u32)> {
    let open = open_edges(build, front);
    let from = |i: u32| build.clusters[front[i as usize].cluster].from;
    let mut links: Vec<(u32, u32, u32)> = Vec::new();
    for run in open.chunk_by(|a, b| a.edge == b.edge) {
        for pair in run.windows(2) {
            let (a, b) = (pair[0].member, pair[1].member);
            let weight = if from(a) == from(b) { 1 } else { OLD_BORDER };
            links.extend([(a, b, weight), (b, a, weight)]);
        }
    }
    links.sort_unstable();
    let sums = links.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
    sums.map(|run| (run[0].0, run[0].1, run.iter().map(|l| l.2).sum())).collect()
}

/// Partitions clusters, given by indices into the front, into groups: about `wanted` in each, half to twice
/// as many.
pub(super) fn group(build: &Build, front: &[Front], wanted: usize) -> Vec<Vec<usize>> {
    if front.len() <= 2 * wanted {
        return vec![(0..front.len()).collect()];
    }
    let links = links(build, front);
    let of = |i: usize| {
        let first = links.partition_point(|l| (l.0 as usize) < i);
        links[first..].iter().take_while(move |l| l.0 as usize == i)
    };
    const NONE: usize = usize::MAX;
    let mut group_of = vec![NONE; front.len()];
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut beside: Vec<(usize, u32)> = Vec::new();
    for seed in 0..front.len() {
        if group_of[seed] != NONE {
            continue;
        }
        let (own, mut members) = (groups.len(), Vec::with_capacity(wanted));
        beside.clear();
        let mut next = Some(seed);
        while let Some(i) = next {
            group_of[i] = own;
            members.push(i);
            beside.retain(|b| b.0 != i);
            for l in of(i).filter(|l| group_of[l.1 as usize] == NONE) {
                let j = l.1 as usize;
                match beside.iter_mut().find(|b| b.0 == j) {
                    Some(b) => b.1 += l.2,
                    None => beside.push((j, l.2)),
                }
            }
            let best = beside.iter().max_by_key(|b| (b.1, std::cmp::Reverse(b.0)));
            next = best.map(|b| b.0).filter(|_| members.len() < wanted);
        }
        groups.push(members);
    }
    join_small(&mut groups, &mut group_of, of, wanted);
    groups.retain(|g| !g.is_empty());
    groups
}

/// Merges groups that are too small into the neighbour with which they share the most border; isolated ones
/// are merged with each other.
fn join_small<'a, L: Iterator<Item = &'a (u32, u32, u32)>>(
    groups: &mut [Vec<usize>],
    group_of: &mut [usize],
    of: impl Fn(usize) -> L,
    wanted: usize,
) {
    let mut alone: Option<usize> = None;
    for own in 0..groups.len() {
        if groups[own].len() >= wanted.div_ceil(2) {
            continue;
        }
        let mut shared: Vec<(usize, u32)> = Vec::new();
        for l in groups[own].iter().flat_map(|&i| of(i)) {
            let other = group_of[l.1 as usize];
            if other != own {
                match shared.iter_mut().find(|s| s.0 == other) {
                    Some(s) => s.1 += l.2,
                    None => shared.push((other, l.2)),
                }
            }
        }
        let has_room = |other: usize| groups[other].len() + groups[own].len() <= 2 * wanted;
        let best = shared.iter().filter(|s| has_room(s.0)).max_by_key(|s| (s.1, std::cmp::Reverse(s.0)));
        let to = match best {
            Some(best) => Some(best.0),
            None if shared.is_empty() => {
                let to = alone.filter(|&other| groups[other].len() + groups[own].len() <= wanted);
                alone = to.or(Some(own));
                to
            }
            None => None,
        };
        if let Some(to) = to {
            let members = std::mem::take(&mut groups[own]);
            members.iter().for_each(|&i| group_of[i] = to);
            groups[to].extend(members);
        }
    }
}

/// Borders between all groups.
pub(super) struct Borders {
    /// True for vertices of the pool that several groups use.
    shared: Vec<bool>,
    /// Edges shared by several groups, each with the index of the group.
    edges: Vec<(u32, VertexPair)>,
}

/// Border of one group.
pub(super) struct Border<'a> {
    shared: &'a [bool],
    /// Edges shared with other groups, sorted.
    edges: &'a [(u32, VertexPair)],
}

impl Borders {
    pub(super) fn of(&self, group: usize) -> Border<'_> {
        let from = self.edges.partition_point(|e| (e.0 as usize) < group);
        let to = self.edges.partition_point(|e| e.0 as usize <= group);
        Border { shared: &self.shared, edges: &self.edges[from..to] }
    }
}

impl Border<'_> {
    pub(super) fn is_shared(&self, vertex: VertexId) -> bool {
        self.shared[vertex.index()]
    }
    /// True if the group shares any edge.
    pub(super) fn is_any(&self) -> bool {
        !self.edges.is_empty()
    }
    pub(super) fn has(&self, edge: &VertexPair) -> bool {
        self.edges.binary_search_by(|e| e.1.cmp(edge)).is_ok()
    }
    pub(super) fn edges(&self) -> impl Iterator<Item = VertexPair> {
        self.edges.iter().map(|e| e.1)
    }
}

/// Finds the vertices and edges that groups share.
pub(super) fn borders(build: &Build, front: &[Front], groups: &[Vec<usize>]) -> Borders {
    const NONE: u32 = u32::MAX;
    let mut owner = vec![NONE; build.pool.vertex_count()];
    let mut shared = vec![false; build.pool.vertex_count()];
    let mut group_of = vec![NONE; front.len()];
    for (g, members) in groups.iter().enumerate() {
        for &i in members {
            group_of[i] = g as u32;
            for v in front[i].faces.iter().flat_map(|&f| build.vertices(f)) {
                let owner = &mut owner[v.index()];
                shared[v.index()] |= *owner != NONE && *owner != g as u32;
                *owner = g as u32;
            }
        }
    }
    let mut edges = Vec::new();
    let open = open_edges(build, front);
    for run in open.chunk_by(|a, b| a.edge == b.edge) {
        let group = |r: &OpenEdge| group_of[r.member as usize];
        if run.iter().any(|r| group(r) != group(&run[0])) {
            edges.extend(run.iter().map(|r| (group(r), r.edge)));
        }
    }
    edges.sort_unstable();
    edges.dedup();
    Borders { shared, edges }
}
