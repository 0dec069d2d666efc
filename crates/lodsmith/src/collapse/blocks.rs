//! Sweeps in blocks: the mesh is cut into blocks that own their vertices and faces, so that they can be swept side by
//! side.
//!
//! ```text
//! whole mesh --cut--> blocks --sweep, sweep, ...--> gather --> whole mesh --cut elsewhere--> ...
//! ```
//!
//! A vertex belongs to the block of its place in a grid, and a face to a block if its three vertices do. Vertices of
//! other faces are *frozen* until the mesh is gathered: they are neither moved nor merged. The next cut shifts the
//! grid, so they are free then. A collapse needs the faces of its two vertices only, and those of free vertices are
//! complete.
//!
//! A block is an engine of its own. Frozen vertices have the lowest numbers: an edge belongs to its lower end, and
//! frozen ends are never visited, so that no edge with a frozen end is evaluated.
//!
//! Blocks depend on the mesh alone, not on the number of threads, and each sweep has one threshold for all of them.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use glam::Vec3;
use lodsmith_core::VertexId;

use super::bound::{Histogram, UNKNOWN};
use super::order::NONE;
use super::store::Store;
use super::vertex::Vertex;
use super::visit::{VisitScratch, list_visits};
use super::{CollapseRules, Cost, Engine, LiveMesh, Scratch, Tally, Topology, WedgeValues};
use crate::chunks;
use crate::cost::metric::{Metric, VertexMemory};

/// Number of vertices or faces that are handed to a thread together while a mesh is cut or gathered.
const CHUNK_LEN: usize = 1 << 14;
/// Number of cells of the grid along each axis, and of those that the unit cube takes; the others are room for
/// shifts.
const GRID_SIZE: u32 = 64;
const UNIT_SIZE: f32 = 48.0;
/// Shift of the grid from one round to the next, in cells. (Nowhere near a simple fraction of the room for shifts.)
const SHIFT: [f32; 3] = [4.61, 7.23, 9.87];
/// Cell of a vertex that is always frozen, besides its number.
const STAYS: u32 = 1 << 31;
/// Number of blocks above which they become larger instead: fewer vertices are frozen then.
const MAX_BLOCKS: usize = 32;
/// The mesh is cut anew when fewer than this percentage of its faces are live.
const MIN_LIVE_PERCENT: usize = 60;
/// Block of a face between blocks.
const BETWEEN: u16 = u16::MAX;

/// A part of the mesh that is swept by itself.
struct Block<M: Metric> {
    engine: Engine<M>,
    names: Names,
    /// The first so many vertices are frozen.
    frozen: usize,
    scratch: VisitScratch,
    visits: Vec<VertexId>,
    /// Bounds of the free vertices after a sweep.
    bounds: Histogram,
}

/// What the elements of a block were before.
struct Names {
    /// For each vertex at the cut, its number in the ordered input, and in the mesh that was cut.
    origins: Vec<VertexId>,
    numbers: Vec<u32>,
    /// For each face at the cut, its number in the mesh that was cut.
    faces: Vec<u32>,
}

/// A mesh that is cut into blocks.
pub(super) struct Blocks<M: Metric> {
    all: Vec<Block<M>>,
    between: FacesBetween,
    /// Number of vertices and faces at the cut.
    vertices: usize,
    faces: usize,
}

/// Faces whose vertices belong to several blocks.
struct FacesBetween {
    /// Block and number there of each vertex.
    corners: Vec<[PlaceInPiece; 3]>,
    /// Number of each face in the mesh that was cut.
    numbers: Vec<u32>,
}

/// A mesh that is to be cut or gathered: its parts, with what their elements were before, and the faces between them.
/// A whole mesh is one part, whose elements are all live and keep their numbers.
struct MeshPieces<'a, Q: VertexMemory> {
    all: Vec<(&'a Store<Q>, Option<&'a Names>)>,
    between: Option<&'a FacesBetween>,
    /// Number of vertices and faces that the elements were before.
    counts: [usize; 2],
}

impl<Q: VertexMemory> MeshPieces<'_, Q> {
    /// Returns the vertices that are live, in the order that they had before.
    fn live_vertices(&self) -> Vec<PlaceInPiece> {
        if self.between.is_none() {
            return chunks::list(self.counts[0], |k| PlaceInPiece::new(0, k));
        }
        let at = PlacesByNumber::unset(self.counts[0]);
        let chunks = chunks_of(self.all.iter().map(|part| part.0.v.len()));
        chunks::each(chunks.len(), |c| {
            let (part, range) = &chunks[c];
            let (store, names) = self.all[*part];
            for k in range.clone().filter(|&k| !store.v[k].kind.is_gone()) {
                at.set(names.map_or(k, |names| names.numbers[k] as usize), PlaceInPiece::new(*part, k));
            }
        });
        at.in_order()
    }

    /// Returns the faces that are live, in the order that they had before; those between parts come after the last
    /// part.
    fn live_faces(&self) -> Vec<PlaceInPiece> {
        let at = PlacesByNumber::unset(self.counts[1]);
        let chunks = chunks_of(self.all.iter().map(|part| part.0.t.len()));
        chunks::each(chunks.len(), |c| {
            let (part, range) = &chunks[c];
            let (store, names) = self.all[*part];
            for face in range.clone().filter(|&face| store.t[face][0] != NONE) {
                at.set(
                    names.map_or(face, |names| names.faces[face] as usize),
                    PlaceInPiece::new(*part, face),
                );
            }
        });
        for (k, &number) in self.between.iter().flat_map(|between| &between.numbers).enumerate() {
            at.set(number as usize, PlaceInPiece::new(self.all.len(), k));
        }
        at.in_order()
    }

    /// Returns the faces that are live, with the numbers of their vertices among `living`.
    fn renumbered_faces(&self, living: &[PlaceInPiece]) -> Cow<'_, [[VertexId; 3]]> {
        if self.between.is_none() {
            return Cow::Borrowed(&self.all[0].0.t);
        }
        let before = sums_before(self.all.iter().map(|part| part.0.v.len()));
        let number = chunks::list(before.last().copied().unwrap_or_default(), |_| AtomicU32::new(0));
        let starts: Vec<usize> = (0..living.len()).step_by(CHUNK_LEN).collect();
        chunks::each(starts.len(), |c| {
            for (n, at) in (starts[c]..).zip(&living[starts[c]..]).take(CHUNK_LEN) {
                number[before[at.part()] + at.index()].store(n as u32, Ordering::Relaxed);
            }
        });
        let number = |k: usize| VertexId(number[k].load(Ordering::Relaxed));
        let faces = self.live_faces();
        let between = self.between.map_or(&[][..], |between| &between.corners);
        let faces = chunks::list(faces.len(), |i| {
            let (part, face) = (faces[i].part(), faces[i].index());
            match self.all.get(part) {
                Some((store, _)) => store.t[face].map(|w| number(before[part] + w.index())),
                None => between[face].map(|at| number(before[at.part()] + at.index())),
            }
        });
        Cow::Owned(faces)
    }

    /// Returns a vertex with its number in the ordered input, and its bound.
    fn vertex(&self, at: PlaceInPiece) -> (Vertex<Q>, f32) {
        let ((store, names), k) = (self.all[at.part()], at.index());
        let x = store.v[k];
        let origin = names.map_or(x.origin, |names| names.origins[x.origin.index()]);
        (Vertex { origin, ..x }, store.bound[k])
    }
}

/// PlaceInPiece of a vertex or face: its part and its number there.
#[derive(Clone, Copy)]
struct PlaceInPiece(u64);

impl PlaceInPiece {
    fn new(part: usize, index: usize) -> Self {
        Self((part as u64) << 32 | index as u64)
    }
    #[inline(always)]
    fn part(self) -> usize {
        (self.0 >> 32) as usize
    }
    #[inline(always)]
    fn index(self) -> usize {
        self.0 as u32 as usize
    }
}

/// PlacesByNumber of elements by number, filled by several threads.
struct PlacesByNumber(Vec<AtomicU64>);

impl PlacesByNumber {
    const UNSET: u64 = u64::MAX;

    fn unset(count: usize) -> Self {
        Self(chunks::list(count, |_| AtomicU64::new(Self::UNSET)))
    }

    #[inline(always)]
    fn set(&self, number: usize, place: PlaceInPiece) {
        self.0[number].store(place.0, Ordering::Relaxed);
    }

    /// Returns the places that are set, in order.
    fn in_order(&self) -> Vec<PlaceInPiece> {
        let chunks: Vec<&[AtomicU64]> = self.0.chunks(CHUNK_LEN).collect();
        let of_chunks = chunks::each(chunks.len(), |c| {
            let set = chunks[c].iter().map(|at| at.load(Ordering::Relaxed)).filter(|at| *at != Self::UNSET);
            set.map(PlaceInPiece).collect::<Vec<_>>()
        });
        of_chunks.concat()
    }
}

/// Grid that cuts a mesh in the unit frame, in cells along a Morton curve.
struct Grid {
    shift: Vec3,
}

impl Grid {
    /// Returns the grid of a round.
    fn of(round: usize) -> Self {
        let room = GRID_SIZE as f32 - UNIT_SIZE;
        Self { shift: Vec3::from(SHIFT.map(|x| x * round as f32 % room)) }
    }

    fn cell(&self, p: Vec3) -> u32 {
        let at = (p + Vec3::ONE) * (0.5 * UNIT_SIZE) + self.shift;
        let [x, y, z] = at.to_array().map(|x| spread((x as u32).min(GRID_SIZE - 1)));
        x | y << 1 | z << 2
    }
}

/// Returns six bits with two zeros between neighbours.
fn spread(x: u32) -> u32 {
    let x = (x | x << 8) & 0x300f;
    let x = (x | x << 4) & 0x30c3;
    (x | x << 2) & 0x9249
}

/// Splits parts of these lengths into chunks: the part, and a range in it.
fn chunks_of(lengths: impl Iterator<Item = usize>) -> Vec<(usize, Range<usize>)> {
    let of_part = |(part, len): (usize, usize)| {
        (0..len).step_by(CHUNK_LEN).map(move |start| (part, start..len.min(start + CHUNK_LEN)))
    };
    lengths.enumerate().flat_map(of_part).collect()
}

/// Returns the sums of the numbers before each, and the sum of all.
fn sums_before(counts: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut sums = vec![0];
    sums.extend(counts.scan(0, |sum, n| {
        *sum += n;
        Some(*sum)
    }));
    sums
}

/// Returns for each block the chunks that contain elements of it.
fn chunks_of_blocks(of: &[u16], blocks: usize) -> Vec<Vec<usize>> {
    let of_chunk = chunks::each(of.len().div_ceil(CHUNK_LEN), |k| {
        let mut different: Vec<u16> = Vec::new();
        for same in of[k * CHUNK_LEN..of.len().min((k + 1) * CHUNK_LEN)].chunk_by(|a, b| a == b) {
            if !different.contains(&same[0]) {
                different.push(same[0]);
            }
        }
        different
    });
    let mut chunks = vec![Vec::new(); blocks];
    for (k, different) in of_chunk.iter().enumerate() {
        for &block in different.iter().filter(|block| **block != BETWEEN) {
            chunks[usize::from(block)].push(k);
        }
    }
    chunks
}

/// Returns the elements of a block within these chunks, in order.
fn elements(of: &[u16], block: usize, chunks: &[usize]) -> impl Iterator<Item = usize> {
    chunks.iter().flat_map(move |&k| {
        let start = k * CHUNK_LEN;
        let chunk = &of[start..of.len().min(start + CHUNK_LEN)];
        chunk.iter().enumerate().filter(move |x| usize::from(*x.1) == block).map(move |x| start + x.0)
    })
}

/// Returns the block of each vertex, by its cell, and the number of blocks.
fn blocks_of(cells: &[u32], min_vertices: usize) -> (Vec<u16>, usize) {
    let mut counts = vec![0u32; (GRID_SIZE * GRID_SIZE * GRID_SIZE) as usize];
    for &cell in cells {
        counts[(cell & !STAYS) as usize] += 1;
    }
    let (mut block, mut size, mut left) = (0u16, 0, cells.len());
    let next = |count: u32| {
        // (The last block takes what would be too small for one of its own.)
        if size >= min_vertices && left >= min_vertices && block + 1 < BETWEEN {
            (block, size) = (block + 1, 0);
        }
        size += count as usize;
        left -= count as usize;
        block
    };
    let block_of_cell: Vec<u16> = counts.into_iter().map(next).collect();
    let of = chunks::list(cells.len(), |i| block_of_cell[(cells[i] & !STAYS) as usize]);
    (of, usize::from(block) + 1)
}

impl<M: Metric> Engine<M> {
    /// Cuts the mesh into blocks: that of the store, whose elements are all live, or the mesh that is cut already. Returns `None` if it would be one
    /// block only.
    pub(super) fn cut_into_blocks(
        &mut self,
        cut: Option<&Blocks<M>>,
        round: usize,
        min_vertices: usize,
    ) -> Option<Blocks<M>> {
        let store = &self.mesh.store;
        let counts = [store.v.len(), store.t.len()];
        let whole = || MeshPieces { all: vec![(store, None)], between: None, counts };
        let parts = cut.map_or_else(whole, Blocks::parts);
        let (living, grid) = (parts.live_vertices(), Grid::of(round));
        let cells = chunks::list(living.len(), |i| {
            let x = &parts.all[living[i].part()].0.v[living[i].index()];
            // (Non-manifold vertices change the kinds of their neighbours, some of which may have other faces.)
            grid.cell(x.p) | if x.kind.is_complex() { STAYS } else { 0 }
        });
        let (block_of, count) = blocks_of(&cells, min_vertices.max(cells.len() / MAX_BLOCKS));
        if count < 2 {
            return None;
        }
        let faces = parts.renumbered_faces(&living);
        let block_of_face = chunks::list(faces.len(), |i| {
            let [a, b, c] = faces[i].map(|w| block_of[w.index()]);
            if a == b && b == c { a } else { BETWEEN }
        });
        let mut is_frozen = chunks::list(cells.len(), |i| cells[i] & STAYS != 0);
        let crossing: Vec<usize> = (0..faces.len()).filter(|&i| block_of_face[i] == BETWEEN).collect();
        for &i in &crossing {
            faces[i].iter().for_each(|w| is_frozen[w.index()] = true);
        }
        let vertex_chunks = chunks_of_blocks(&block_of, count);
        let face_chunks = chunks_of_blocks(&block_of_face, count);
        let local: Vec<AtomicU32> = chunks::list(living.len(), |_| AtomicU32::new(0));
        let all = chunks::each(count, |b| {
            let of_block = elements(&block_of, b, &vertex_chunks[b]).map(|i| i as u32);
            let (mut numbers, free): (Vec<u32>, Vec<u32>) = of_block.partition(|&i| is_frozen[i as usize]);
            let frozen = numbers.len();
            numbers.extend(free);
            let (mut v, mut bound) = (Vec::with_capacity(numbers.len()), Vec::with_capacity(numbers.len()));
            let mut origins = Vec::with_capacity(numbers.len());
            for (k, &i) in numbers.iter().enumerate() {
                local[i as usize].store(k as u32, Ordering::Relaxed);
                let (x, least) = parts.vertex(living[i as usize]);
                origins.push(x.origin);
                v.push(Vertex { origin: VertexId::new(k), ..x });
                bound.push(if k < frozen { f32::INFINITY } else { least });
            }
            let (mut t, mut of_faces) =
                (Vec::with_capacity(2 * numbers.len()), Vec::with_capacity(2 * numbers.len()));
            for i in elements(&block_of_face, b, &face_chunks[b]) {
                t.push(faces[i].map(|w| VertexId(local[w.index()].load(Ordering::Relaxed))));
                of_faces.push(i as u32);
            }
            let mut store = Store::of_vertices(v, bound, t);
            store.link();
            let cost_factors = self.mesh.constraints.cost_factors.as_ref();
            let cost_factors = cost_factors.map(|all| origins.iter().map(|o| all[o.index()]).collect());
            let engine = self.mesh.engine_of_block(store, cost_factors);
            let names = Names { origins, numbers, faces: of_faces };
            Block {
                engine,
                names,
                frozen,
                scratch: VisitScratch::default(),
                visits: Vec::new(),
                bounds: Histogram::of(&[]),
            }
        });
        let corner = |w: VertexId| {
            PlaceInPiece::new(
                usize::from(block_of[w.index()]),
                local[w.index()].load(Ordering::Relaxed) as usize,
            )
        };
        let between = FacesBetween {
            corners: crossing.iter().map(|&i| faces[i].map(corner)).collect(),
            numbers: crossing.iter().map(|&i| i as u32).collect(),
        };
        Some(Blocks { all, between, vertices: living.len(), faces: faces.len() })
    }

    /// Prepares blocks for the next cut, or for being gathered. Takes what their collapses changed beside their stores.
    pub(super) fn end_round(&mut self, blocks: &mut Blocks<M>) {
        for block in &mut blocks.all {
            block.forget_frozen();
            let (origins, mesh) = (&block.names.origins, &block.engine.mesh);
            for (k, &root) in mesh.store.merged_into.iter().enumerate().filter(|x| x.1.index() != x.0) {
                self.mesh.store.merged_into[origins[k].index()] = origins[root.index()];
            }
            if let (Some(all), Some(own)) =
                (&mut self.mesh.constraints.cost_factors, &mesh.constraints.cost_factors)
            {
                for (origin, &factor) in origins.iter().zip(own) {
                    all[origin.index()] = factor;
                }
            }
        }
    }

    /// Makes one mesh of the blocks again, in the order that it had.
    pub(super) fn gather(&mut self, blocks: &Blocks<M>) {
        let parts = blocks.parts();
        let living = parts.live_vertices();
        let v = chunks::list(living.len(), |i| parts.vertex(living[i]).0);
        let bound = chunks::list(living.len(), |i| parts.vertex(living[i]).1);
        let t = parts.renumbered_faces(&living).into_owned();
        self.mesh.store.put_elements(v, bound, t);
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Returns an engine for a block, with the rules and the reference sizes of the whole mesh.
    fn engine_of_block(&self, store: Store<M::Memory>, cost_factors: Option<Vec<f32>>) -> Engine<M> {
        let Cost { metric, area, total_area, mean_face, .. } = self.cost;
        let CollapseRules { rules, looseness, keeps_parts, .. } = self.constraints;
        Engine {
            mesh: Self {
                store,
                cost: Cost { metric, area, total_area, mean_face, lines: Vec::new() },
                constraints: CollapseRules {
                    rules,
                    looseness,
                    cost_factors,
                    details: None,
                    cuts_necks: false,
                    keeps_parts,
                },
                values: WedgeValues { attributes: None, wedge_data: None },
                sampled: None,
                bounded: None,
                topology: Topology::default(),
            },
            record: None,
            tally: Tally::default(),
            scratch: Scratch::default(),
            checks: None,
        }
    }
}

impl<M: Metric> Blocks<M> {
    fn parts(&self) -> MeshPieces<'_, M::Memory> {
        let all = self.all.iter().map(|block| (&block.engine.mesh.store, Some(&block.names)));
        MeshPieces { all: all.collect(), between: Some(&self.between), counts: [self.vertices, self.faces] }
    }

    /// True if so few elements are live that the mesh should be cut anew.
    pub(super) fn is_sparse(&self, live_faces: usize) -> bool {
        live_faces * 100 < self.faces * MIN_LIVE_PERCENT
    }

    /// Sweeps all blocks with one threshold, each to at most its share of `needed` collapses. `area` is the mean of
    /// twice the area of a face.
    pub(super) fn sweep(&mut self, tau: f32, area: f32, needed: Option<usize>) {
        let total: usize = self.all.iter().map(|block| block.engine.mesh.store.live_vertices).sum();
        chunks::over(self.all.iter_mut().collect(), |_, block: &mut Block<M>| {
            let own = block.engine.mesh.store.live_vertices;
            let quota = needed.map_or(u64::MAX, |n| n as u64 * own as u64 / total.max(1) as u64);
            block.engine.mesh.cost.area = area;
            block.sweep(tau, quota);
        });
    }

    /// Returns the bounds of the free vertices.
    pub(super) fn bounds(&self) -> Histogram {
        Histogram::sum(self.all.iter().map(|block| &block.bounds))
    }

    /// Takes the counts of the last sweeps of all blocks.
    pub(super) fn take_tally(&mut self, into: &mut Tally) -> [usize; 2] {
        let (mut faces, mut vertices) = (self.between.corners.len(), 0);
        for block in &mut self.all {
            into.add(&std::mem::take(&mut block.engine.tally));
            faces += block.engine.mesh.store.live_faces;
            vertices += block.engine.mesh.store.live_vertices;
        }
        [faces, vertices]
    }
}

impl<M: Metric> Block<M> {
    /// Marks frozen vertices and their neighbours as not visited: edges between them have not been evaluated.
    fn forget_frozen(&mut self) {
        let store = &mut self.engine.mesh.store;
        for u in (0..self.frozen).map(VertexId::new) {
            store.bound[u.index()] = UNKNOWN;
            for k in 0..store.listed(u).len() {
                let (a, b) = store.others_at(store.listed(u)[k]);
                (store.bound[a.index()], store.bound[b.index()]) = (UNKNOWN, UNKNOWN);
            }
        }
    }

    /// Sweeps once over the free vertices, until `quota` collapses are done.
    fn sweep(&mut self, tau: f32, quota: u64) {
        let Self { engine, scratch, visits, frozen, .. } = self;
        let quota = engine.tally.collapses.saturating_add(quota);
        list_visits(&engine.mesh.store.bound[*frozen..], *frozen, tau, false, visits);
        for (at, &u) in visits.iter().enumerate() {
            engine.mesh.store.prefetch(visits, at);
            if engine.tally.collapses >= quota {
                break;
            }
            if engine.mesh.store.v[u.index()].kind.is_gone() {
                continue;
            }
            engine.visit(u, tau, false, scratch);
            if engine.mesh.store.is_full() {
                engine.mesh.store.repack();
            }
        }
        self.bounds = Histogram::of(&engine.mesh.store.bound[*frozen..]);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use lodsmith_core::{TriMesh, shapes};

    use super::*;
    use crate::collapse::invariants::Checks;
    use crate::cost::metric::{MELAX, Memoryless, Quadric};
    use crate::options::SimplifyOptions;
    use crate::test_support::with_engine;

    const VERTICES: usize = 200;

    /// Returns everything that a cut and a gathering keep.
    fn elements_of<M: Metric>(engine: &Engine<M>) -> (Vec<[u32; 4]>, Vec<[VertexId; 3]>) {
        let store = &engine.mesh.store;
        let vertex = |x: &Vertex<M::Memory>| {
            let [a, b, c] = x.p.to_array().map(f32::to_bits);
            [a, b, c, x.origin.0]
        };
        (store.v.iter().map(vertex).collect(), store.t.clone())
    }

    #[test]
    fn a_mesh_that_is_cut_and_gathered_is_the_same() {
        for (name, mesh) in shapes::all() {
            with_engine(Memoryless, &mesh, &SimplifyOptions::default(), &mut |engine, _| {
                engine.mesh.store.compact();
                let before = elements_of(engine);
                let Some(first) = engine.cut_into_blocks(None, 0, 50) else { return };
                engine.mesh.store.take_elements();
                let second = engine.cut_into_blocks(Some(&first), 1, 30);
                engine.gather(second.as_ref().unwrap_or(&first));
                assert_eq!(elements_of(engine), before, "{name}");
            });
        }
    }

    #[test]
    fn blocks_have_each_vertex_once_and_only_whole_stars_are_free() {
        let mesh = shapes::noisy_sphere(5, 0.05, 3);
        with_engine(Memoryless, &mesh, &SimplifyOptions::default(), &mut |engine, _| {
            let (count, faces) = (engine.mesh.store.v.len(), engine.mesh.store.t.len());
            let degrees: Vec<usize> =
                (0..count).map(|u| engine.mesh.store.listed(VertexId::new(u)).len()).collect();
            let frozen = [0, 1].map(|round| {
                let blocks = engine.cut_into_blocks(None, round, 1000).expect("several blocks");
                assert!(blocks.all.len() > 5);
                let mut seen = BTreeSet::new();
                let mut frozen = BTreeSet::new();
                for Block { engine, names, frozen: first, .. } in &blocks.all {
                    assert!(engine.mesh.store.v.len() >= 1000);
                    seen.extend(names.numbers.iter().copied());
                    frozen.extend(names.numbers[..*first].iter().copied());
                    for u in *first..names.numbers.len() {
                        let degree = engine.mesh.store.listed(VertexId::new(u)).len();
                        assert_eq!(degree, degrees[names.numbers[u] as usize]);
                    }
                }
                assert_eq!(seen.len(), count);
                let inside: usize = blocks.all.iter().map(|block| block.engine.mesh.store.t.len()).sum();
                assert_eq!(inside + blocks.between.corners.len(), faces);
                frozen
            });
            // The next cut frees most of them.
            let [first, second] = &frozen;
            let stay = first.intersection(second).count();
            assert!(first.len() < count / 4 && stay < first.len() / 2, "{stay} of {}", first.len());
        });
    }

    /// Sweeps several rounds and checks the mesh.
    fn swept<M: Metric>(metric: M, mesh: &TriMesh) -> usize {
        let mut left = 0;
        with_engine(metric, mesh, &SimplifyOptions::default(), &mut |engine, _| {
            let (before, mut cut) = (engine.mesh.store.live_faces, None);
            let mut bounds: Vec<f32> = Vec::new();
            for round in 0..3 {
                let Some(mut blocks) = engine.cut_into_blocks(cut.as_ref(), round, VERTICES) else { break };
                engine.mesh.store.take_elements();
                let live = engine.mesh.store.live_faces;
                let area = (engine.mesh.cost.total_area / live as f64) as f32;
                let tau = if bounds.is_empty() { 1e-7 } else { f32::MAX };
                blocks.sweep(tau, area, Some(live / 8));
                let counts = blocks.take_tally(&mut engine.tally);
                [engine.mesh.store.live_faces, engine.mesh.store.live_vertices] = counts;
                assert!(blocks.bounds().known() > 0);
                bounds.push(tau);
                engine.end_round(&mut blocks);
                cut = Some(blocks);
            }
            let Some(blocks) = cut else { return };
            let counts = [engine.mesh.store.live_faces, engine.mesh.store.live_vertices];
            engine.gather(&blocks);
            engine.mesh.store.link();
            assert_eq!([engine.mesh.store.live_faces, engine.mesh.store.live_vertices], counts);
            engine.check(&mut Checks::default()).expect("a sound mesh");
            let homes = engine.mesh.store.homes();
            assert!(homes.iter().all(|home| *home != NONE));
            left = counts[0];
            assert!(left < before);
            // (No block does more than its share.)
            assert!(engine.tally.collapses as usize <= 3 * before / 8 && left >= before / 4);
        });
        left
    }

    #[test]
    fn sweeps_in_blocks_leave_a_sound_mesh() {
        for mesh in [shapes::noisy_sphere(5, 0.05, 3), shapes::blob(5, 2), shapes::wavy_sheet(60)] {
            for left in [swept(Memoryless, &mesh), swept(Quadric, &mesh), swept(MELAX, &mesh)] {
                assert!(left > 0, "it was cut");
            }
        }
    }
}
