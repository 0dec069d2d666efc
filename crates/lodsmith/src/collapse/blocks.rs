//! Sweeps in blocks: the mesh is cut into blocks that own their vertices and faces, so that they can be swept side by
//! side.
//!
//! ```text
//! mesh --cut--> blocks --sweep, sweep, ...--> cut elsewhere --> blocks --sweep, ...--> gather --> mesh
//! ```
//!
//! A vertex belongs to the block of its cell in a grid, and a face to a block if its three vertices do. Vertices of
//! other faces are *frozen* until the next cut: they are neither moved nor merged. Each cut shifts the grid, so that
//! most of them are free after it. A collapse needs the faces of its two vertices only, and free vertices have all
//! their faces in the block.
//!
//! A block is an engine of its own. Frozen vertices have the lowest numbers: an edge belongs to its lower end, and
//! frozen ends are never visited, so that no edge with a frozen end is evaluated.
//!
//! Blocks depend on the mesh and the options, not on the number of threads, and each sweep has one threshold for all of
//! them.

mod elements;
mod values;

use std::borrow::Cow;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::Vec3;
use lodsmith_core::{VertexId, WedgeId};

use super::attributes::{Attributes, NO_WEDGE};
use super::bound::{Histogram, UNKNOWN};
use super::bounded::Bounded;
use super::hub_budget::HubBudget;
use super::order::{MORTON_BITS, NONE, morton_code};
use super::store::Store;
use super::vertex::Vertex;
use super::visit::{VisitScratch, list_visits};
use super::{CollapseRules, Cost, Engine, LiveMesh, Scratch, Tally, Topology, WedgeValues};
use crate::chunks;
use crate::cost::metric::Metric;
use elements::{ByNumber, InBlock};
use values::{BlockWedges, FaceValues};

/// Number of vertices or faces whose blocks are listed together.
const CHUNK_LEN: usize = 1 << 14;
/// Number of cells of the grid along each axis, and of those that the unit cube takes; the others are room for
/// shifts.
const GRID_SIZE: u32 = 64;
const UNIT_SIZE: f32 = 48.0;
/// Shift of the grid from one round to the next, in cells. (Nowhere near a simple fraction of the room for shifts.)
const SHIFT: [f32; 3] = [4.61, 7.23, 9.87];
/// Mark of the cell of a vertex that is always frozen.
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
    before: NumbersBefore,
    scratch: VisitScratch,
    visits: Vec<VertexId>,
    /// Bounds of the free vertices after a sweep.
    bounds: Histogram,
}

/// Numbers that the elements of a block had before it was cut out.
struct NumbersBefore {
    /// Of each vertex: in the ordered input, and in the mesh that was cut.
    origins: Vec<VertexId>,
    vertices: Vec<u32>,
    /// Of each face, in the mesh that was cut.
    faces: Vec<u32>,
    /// Of each wedge, in the run.
    wedges: Vec<WedgeId>,
}

/// A mesh that is cut into blocks.
pub(super) struct Blocks<M: Metric> {
    all: Vec<Block<M>>,
    between: FacesBetween,
    /// Number of vertices and of faces at the cut.
    vertices: usize,
    faces: usize,
}

/// Faces whose vertices belong to several blocks.
struct FacesBetween {
    corners: Vec<[InBlock; 3]>,
    /// Number of each face in the mesh that was cut.
    numbers: Vec<u32>,
    values: FaceValues<'static>,
    bounded: Option<Box<Bounded>>,
}

impl<M: Metric> Blocks<M> {
    /// Returns the live vertices, in the order of the mesh that was cut.
    fn live_vertices(&self) -> Vec<InBlock> {
        let found = ByNumber::new(self.vertices);
        chunks::each(self.all.len(), |b| {
            let Block { engine, before, .. } = &self.all[b];
            for (k, _) in engine.mesh.store.v.iter().enumerate().filter(|x| !x.1.kind.is_gone()) {
                found.set(before.vertices[k], InBlock::new(b, k));
            }
        });
        found.in_order()
    }

    /// Returns the live faces, in the order of the mesh that was cut; those between blocks have one more than the
    /// highest block.
    fn live_faces(&self) -> Vec<InBlock> {
        let found = ByNumber::new(self.faces);
        chunks::each(self.all.len(), |b| {
            let Block { engine, before, .. } = &self.all[b];
            for (k, _) in engine.mesh.store.t.iter().enumerate().filter(|t| t.1[0] != NONE) {
                found.set(before.faces[k], InBlock::new(b, k));
            }
        });
        for (k, &number) in self.between.numbers.iter().enumerate() {
            found.set(number, InBlock::new(self.all.len(), k));
        }
        found.in_order()
    }

    /// Returns the corners of these faces, with numbers among the live vertices.
    fn renumbered(&self, faces: &[InBlock], living: &[InBlock]) -> Vec<[VertexId; 3]> {
        // Vertices of all blocks, one block after another.
        let mut starts = vec![0];
        for block in &self.all {
            starts.push(starts[starts.len() - 1] + block.before.vertices.len());
        }
        let number = chunks::list(starts[self.all.len()], |_| AtomicU32::new(0));
        let at = |element: InBlock| &number[starts[element.block()] + element.index()];
        chunks::map(living.len(), |range| {
            for n in range {
                at(living[n]).store(n as u32, Ordering::Relaxed);
            }
        });
        let number = |element: InBlock| VertexId(at(element).load(Ordering::Relaxed));
        chunks::list(faces.len(), |i| {
            let (b, k) = (faces[i].block(), faces[i].index());
            match self.all.get(b) {
                Some(block) => block.engine.mesh.store.t[k].map(|w| number(InBlock::new(b, w.index()))),
                None => self.between.corners[k].map(number),
            }
        })
    }

    /// Returns the values of these faces.
    fn face_values(&self, faces: &[InBlock]) -> FaceValues<'static> {
        let numbers = self.all.iter().map(|block| &block.before.wedges[..]).collect();
        let inside = self.all.iter().map(|block| FaceValues::of(&block.engine.mesh.store));
        FaceValues::joined(inside.chain([self.between.values.borrowed()]).collect(), numbers, faces)
    }

    /// Returns the limit, if there is one, with the samples of a face and others, and the name of that face.
    fn samples(&self, at: InBlock) -> Option<(&Bounded, u32)> {
        match self.all.get(at.block()) {
            None => Some((self.between.bounded.as_deref()?, at.index() as u32)),
            Some(Block { engine, .. }) => {
                let LiveMesh { store, bounded, .. } = &engine.mesh;
                Some((bounded.as_deref()?, store.names.as_ref()?[at.index()]))
            }
        }
    }

    /// Returns the limit, if there is one, with what is known about a vertex, and its number there.
    fn tried(&self, at: InBlock) -> Option<(&Bounded, VertexId)> {
        let LiveMesh { store, bounded, .. } = &self.all[at.block()].engine.mesh;
        Some((bounded.as_deref()?, store.v[at.index()].origin))
    }

    /// Returns the attributes with the wedges of a vertex, the first of these, and the numbers of all wedges in the run.
    fn wedges(&self, at: InBlock) -> Option<(&Attributes, WedgeId, &[WedgeId])> {
        let Block { engine, before, .. } = &self.all[at.block()];
        let LiveMesh { values, store, .. } = &engine.mesh;
        Some((values.attributes.as_ref()?, *store.first_wedge.get(at.index())?, &before.wedges))
    }

    /// Returns a vertex with its number in the ordered input, and its bound.
    fn vertex(&self, at: InBlock) -> (Vertex<M::Memory>, f32) {
        let (Block { engine, before, .. }, k) = (&self.all[at.block()], at.index());
        let x = engine.mesh.store.v[k];
        (Vertex { origin: before.origins[x.origin.index()], ..x }, engine.mesh.store.bound[k])
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

    /// Returns the code of a point's cell.
    fn cell(&self, p: Vec3) -> u32 {
        let at = (p + Vec3::ONE) * (0.5 * UNIT_SIZE) + self.shift;
        morton_code(at / GRID_SIZE as f32 - 0.5) >> (MORTON_BITS - 3 * GRID_SIZE.ilog2())
    }
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
    /// Cuts a mesh into blocks: the mesh of the store, whose elements are all live, or one that is cut already. Returns
    /// `None` if there would be one block only.
    pub(super) fn cut_into_blocks(
        &self,
        cut: Option<&Blocks<M>>,
        round: usize,
        min_vertices: usize,
    ) -> Option<Blocks<M>> {
        let (store, grid) = (&self.mesh.store, Grid::of(round));
        let living = cut.map(Blocks::live_vertices).unwrap_or_default();
        let vertices = cut.map_or(store.v.len(), |_| living.len());
        let cells = chunks::list(vertices, |i| {
            let x = match cut {
                None => &store.v[i],
                Some(cut) => &cut.all[living[i].block()].engine.mesh.store.v[living[i].index()],
            };
            // (Non-manifold vertices change the kinds of their neighbours, some of which may have other faces. Blocks have
            // no budget for hubs.)
            let stays = x.kind.is_complex() || HubBudget::may_be_hub(x.count as usize);
            grid.cell(x.p) | if stays { STAYS } else { 0 }
        });
        let (block_of, count) = blocks_of(&cells, min_vertices.max(cells.len() / MAX_BLOCKS));
        if count < 2 {
            return None;
        }
        let living_faces = cut.map(Blocks::live_faces).unwrap_or_default();
        let (faces, values) = match cut {
            None => (Cow::Borrowed(&store.t), FaceValues::of(store)),
            Some(cut) => (Cow::Owned(cut.renumbered(&living_faces, &living)), cut.face_values(&living_faces)),
        };
        let bounded_of = |faces: &[u32], vertices: &[u32]| {
            let all = self.mesh.bounded.as_deref()?;
            let of_face = |&i: &u32| match cut {
                None => Some((all, store.names.as_ref()?[i as usize])),
                Some(cut) => cut.samples(living_faces[i as usize]),
            };
            let of_vertex = |&i: &u32| match cut {
                None => Some((all, store.v[i as usize].origin)),
                Some(cut) => cut.tried(living[i as usize]),
            };
            let vertices = vertices.iter().filter_map(of_vertex);
            Some(Box::new(all.of_some(faces.iter().filter_map(of_face), vertices)))
        };
        let block_of_face = chunks::list(faces.len(), |i| {
            let [a, b, c] = faces[i].map(|w| block_of[w.index()]);
            if a == b && b == c { a } else { BETWEEN }
        });
        let mut is_frozen: Vec<bool> = cells.iter().map(|cell| cell & STAYS != 0).collect();
        let is_between = |&i: &u32| block_of_face[i as usize] == BETWEEN;
        let crossing: Vec<u32> = (0..faces.len() as u32).filter(is_between).collect();
        for &i in &crossing {
            faces[i as usize].iter().for_each(|w| is_frozen[w.index()] = true);
        }
        let vertex_chunks = chunks_of_blocks(&block_of, count);
        let face_chunks = chunks_of_blocks(&block_of_face, count);
        let local: Vec<AtomicU32> = chunks::list(vertices, |_| AtomicU32::new(0));
        let wedges = self.mesh.values.attributes.as_ref().map_or(0, Attributes::count);
        let local_wedge: Vec<AtomicU32> = chunks::list(wedges, |_| AtomicU32::new(0));
        let all = chunks::each(count, |b| {
            let of_block = elements(&block_of, b, &vertex_chunks[b]).map(|i| i as u32);
            let (mut numbers, free): (Vec<u32>, Vec<u32>) = of_block.partition(|&i| is_frozen[i as usize]);
            let frozen = numbers.len();
            numbers.extend(free);
            let (mut v, mut bound) = (Vec::with_capacity(numbers.len()), Vec::with_capacity(numbers.len()));
            let mut origins = Vec::with_capacity(numbers.len());
            for (k, &i) in numbers.iter().enumerate() {
                local[i as usize].store(k as u32, Ordering::Relaxed);
                let (x, least) = match cut {
                    None => (store.v[i as usize], store.bound[i as usize]),
                    Some(cut) => cut.vertex(living[i as usize]),
                };
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
            let mut own = Store::of_vertices(v, bound, t);
            own.link();
            values.of_some(&of_faces).put_into(&mut own);
            own.classes.clone_from(&store.classes);
            let (mut attributes, mut wedges) = (None, Vec::new());
            if let Some(all) = &self.mesh.values.attributes {
                let chains = numbers.iter().map(|&i| match cut {
                    None => Some((all, store.first_wedge[i as usize], &[][..])),
                    Some(cut) => cut.wedges(living[i as usize]),
                });
                let found = BlockWedges::of(all, chains.flatten(), numbers.len());
                for (k, w) in found.numbers.iter().enumerate() {
                    local_wedge[w.index()].store(k as u32, Ordering::Relaxed);
                }
                for w in own.wedges.iter_mut().flatten().flatten() {
                    *w = WedgeId(local_wedge[w.index()].load(Ordering::Relaxed));
                }
                (own.first_wedge, attributes, wedges) = (found.first, Some(found.attributes), found.numbers);
            }
            let cost_factors = self.mesh.constraints.cost_factors.as_ref();
            let cost_factors = cost_factors.map(|all| origins.iter().map(|o| all[o.index()]).collect());
            let bounded = bounded_of(&of_faces, &numbers);
            own.names = bounded.is_some().then(|| (0..of_faces.len() as u32).collect());
            let mut engine = self.mesh.engine_of_block(own, frozen, cost_factors, attributes);
            engine.mesh.bounded = bounded;
            Block {
                engine,
                before: NumbersBefore { origins, vertices: numbers, faces: of_faces, wedges },
                scratch: VisitScratch::default(),
                visits: Vec::new(),
                bounds: Histogram::of(&[]),
            }
        });
        let corner = |w: VertexId| {
            let k = local[w.index()].load(Ordering::Relaxed);
            InBlock::new(usize::from(block_of[w.index()]), k as usize)
        };
        let between = FacesBetween {
            corners: crossing.iter().map(|&i| faces[i as usize].map(corner)).collect(),
            values: values.of_some(&crossing),
            bounded: bounded_of(&crossing, &[]),
            numbers: crossing,
        };
        Some(Blocks { all, between, vertices, faces: faces.len() })
    }

    /// Prepares blocks for the next cut, or for being gathered. Takes what their collapses changed beside their stores.
    pub(super) fn end_round(&mut self, blocks: &mut Blocks<M>) {
        for block in &mut blocks.all {
            block.forget_frozen();
            let (origins, mesh) = (&block.before.origins, &block.engine.mesh);
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

    /// Releases elements that are in blocks.
    pub(super) fn release_elements(&mut self) {
        self.mesh.store.release_elements();
        self.mesh.values.attributes.iter_mut().for_each(Attributes::take_rows);
        self.mesh.bounded.iter_mut().for_each(|bounded| bounded.release_samples());
    }

    /// Makes one mesh of the blocks again, in the order that it had.
    pub(super) fn gather(&mut self, blocks: &Blocks<M>) {
        let living = blocks.live_vertices();
        let v = chunks::list(living.len(), |i| blocks.vertex(living[i]).0);
        let bound = chunks::list(living.len(), |i| blocks.vertex(living[i]).1);
        let faces = blocks.live_faces();
        self.mesh.store.put_elements(v, bound, blocks.renumbered(&faces, &living));
        blocks.face_values(&faces).put_into(&mut self.mesh.store);
        self.take_wedges(blocks, &living);
        if let Some(all) = &self.mesh.bounded {
            let samples = faces.iter().filter_map(|&at| blocks.samples(at));
            let tried = living.iter().filter_map(|&at| blocks.tried(at));
            let found = all.of_some(samples, tried);
            let LiveMesh { store, bounded, .. } = &mut self.mesh;
            let numbers = store.v.iter().map(|x| x.origin);
            *bounded = Some(Box::new(found.renumbered(numbers, store.merged_into.len())));
            store.names = Some((0..faces.len() as u32).collect());
        }
    }

    /// Takes the wedges of all blocks back; the vertices are `living`.
    fn take_wedges(&mut self, blocks: &Blocks<M>, living: &[InBlock]) {
        let Some(all) = &mut self.mesh.values.attributes else { return };
        all.make_room();
        for (own, first, numbers) in living.iter().filter_map(|&at| blocks.wedges(at)) {
            own.chain(first).for_each(|w| all.put(own, w, numbers));
        }
        self.mesh.store.first_wedge = chunks::list(living.len(), |i| match blocks.wedges(living[i]) {
            Some((_, first, numbers)) if first != NO_WEDGE => numbers[first.index()],
            _ => NO_WEDGE,
        });
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Returns an engine for a block, with the rules and the reference sizes of the whole mesh.
    fn engine_of_block(
        &self,
        store: Store<M::Memory>,
        frozen: usize,
        cost_factors: Option<Vec<f32>>,
        attributes: Option<Attributes>,
    ) -> Engine<M> {
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
                    frozen,
                    keeps_parts,
                },
                values: WedgeValues { attributes, wedge_data: None },
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
    /// True if so few elements are live that the mesh should be cut anew.
    pub(super) fn is_sparse(&self, live_faces: usize) -> bool {
        live_faces * 100 < self.faces * MIN_LIVE_PERCENT
    }

    /// Returns the share of the live vertices that are not frozen.
    pub(super) fn free_share(&self, live_vertices: usize) -> f64 {
        let frozen: usize = self.all.iter().map(|block| block.engine.mesh.constraints.frozen).sum();
        1.0 - frozen as f64 / live_vertices.max(1) as f64
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

    /// Adds the counts of the last sweep of all blocks to a tally. Returns the numbers of live faces and vertices.
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
        let LiveMesh { store, constraints, bounded, .. } = &mut self.engine.mesh;
        let mut forget = |store: &mut Store<M::Memory>, u: VertexId| {
            store.bound[u.index()] = UNKNOWN;
            let origin = store.v[u.index()].origin;
            bounded.iter_mut().for_each(|bounded| bounded.forget_tried(origin));
        };
        for u in (0..constraints.frozen).map(VertexId::new) {
            forget(store, u);
            for k in 0..store.listed(u).len() {
                let (a, b) = store.others_at(store.listed(u)[k]);
                forget(store, a);
                forget(store, b);
            }
        }
    }

    /// Sweeps once over the free vertices, until `quota` collapses are done.
    fn sweep(&mut self, tau: f32, quota: u64) {
        let Self { engine, scratch, visits, .. } = self;
        let frozen = engine.mesh.constraints.frozen;
        let quota = engine.tally.collapses.saturating_add(quota);
        list_visits(&engine.mesh.store.bound[frozen..], frozen, tau, false, visits);
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
        self.bounds = Histogram::of(&engine.mesh.store.bound[frozen..]);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use std::f64::consts::TAU;

    use lodsmith_core::{Positions, RegionId, TriMesh, shapes};

    use super::*;
    use crate::collapse::invariants::Checks;
    use crate::cost::metric::{MELAX, Memoryless, Quadric};
    use crate::options::SimplifyOptions;
    use crate::test_support::{in_two_charts, with_engine};

    const VERTICES: usize = 200;

    /// Returns everything that a cut and a gathering keep: of vertices, of faces, and of the wedges of each vertex.
    fn elements_of<M: Metric>(engine: &Engine<M>) -> [Vec<Vec<u32>>; 3] {
        let store = &engine.mesh.store;
        let vertex = |x: &Vertex<M::Memory>| {
            let [a, b, c] = x.p.to_array().map(f32::to_bits);
            vec![a, b, c, x.origin.0]
        };
        let face = |i: usize| {
            let mut all = store.t[i].map(|v| v.0).to_vec();
            all.extend(store.wedges.iter().flat_map(|wedges| wedges[i].map(|w| w.0)));
            all.extend(store.regions.iter().map(|regions| regions[i].0));
            all.extend(store.creases.iter().map(|bits| u32::from(bits[i])));
            all
        };
        let chain = |&first: &WedgeId| {
            let attributes = engine.mesh.values.attributes.as_ref().expect("values of the wedges");
            let of = |w: WedgeId| attributes.of(w).iter().map(|x| x.to_bits()).chain([w.0]);
            attributes.chain(first).flat_map(of).collect()
        };
        [
            store.v.iter().map(vertex).collect(),
            (0..store.t.len()).map(face).collect(),
            store.first_wedge.iter().map(chain).collect(),
        ]
    }

    #[test]
    fn a_mesh_that_is_cut_and_gathered_is_the_same() {
        let mut cuts = 0;
        for (name, plain) in shapes::all() {
            let mut valued = in_two_charts(&plain);
            let regions = (0..valued.face_count() as u32).map(|i| RegionId(i / 8 % 3)).collect();
            valued.set_regions(Some(regions)).expect("one for each face");
            for mesh in [plain, valued] {
                let options = SimplifyOptions { sharp_deg: Some(20.0), ..SimplifyOptions::default() };
                with_engine(Memoryless, &mesh, &options, &mut |engine, _| {
                    engine.mesh.store.compact();
                    let before = elements_of(engine);
                    let Some(first) = engine.cut_into_blocks(None, 0, 50) else { return };
                    engine.release_elements();
                    let second = engine.cut_into_blocks(Some(&first), 1, 30);
                    engine.gather(second.as_ref().unwrap_or(&first));
                    assert_eq!(elements_of(engine), before, "{name}");
                    cuts += 1;
                });
            }
        }
        assert!(cuts > 10, "{cuts}");
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
                for Block { engine, before, .. } in &blocks.all {
                    let first = engine.mesh.constraints.frozen;
                    assert!(engine.mesh.store.v.len() >= 1000);
                    seen.extend(before.vertices.iter().copied());
                    frozen.extend(before.vertices[..first].iter().copied());
                    for u in first..before.vertices.len() {
                        let degree = engine.mesh.store.listed(VertexId::new(u)).len();
                        assert_eq!(degree, degrees[before.vertices[u] as usize]);
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

    #[test]
    fn hubs_are_frozen() {
        // A cone of 600 sides in six rings: one block has the tip, and 600 faces there.
        let around = 600;
        let ring = |k: u32| (0..around).map(move |i| (f64::from(i) * TAU / f64::from(around), f64::from(k)));
        let rings = (1..=6).flat_map(ring).map(|(angle, r)| [r * libm::cos(angle), r * libm::sin(angle), -r]);
        let points: Vec<[f64; 3]> = [[0.0; 3]].into_iter().chain(rings).collect();
        let at = |k: u32, i: u32| WedgeId(1 + k * around + i % around);
        let tip = (0..around).map(|i| [WedgeId(0), at(0, i), at(0, i + 1)]);
        let bands = (0..5).flat_map(|k| (0..around).map(move |i| (k, i)));
        let quads = bands.flat_map(|(k, i)| {
            let [a, b, c, d] = [at(k, i), at(k + 1, i), at(k + 1, i + 1), at(k, i + 1)];
            [[a, b, c], [a, c, d]]
        });
        let faces: Vec<[VertexId; 3]> = tip.chain(quads).map(|t| t.map(|w| VertexId(w.0))).collect();
        let mesh = TriMesh::new(Positions::F64(points), faces).expect("a sound mesh");
        with_engine(Memoryless, &mesh, &SimplifyOptions::default(), &mut |engine, _| {
            for round in 0..3 {
                let blocks = engine.cut_into_blocks(None, round, 500).expect("several blocks");
                let free = blocks.all.iter().flat_map(|block| {
                    let LiveMesh { store, constraints, .. } = &block.engine.mesh;
                    (constraints.frozen..store.v.len()).map(|u| store.listed(VertexId::new(u)).len())
                });
                assert!(free.max().is_some_and(|most| most < 20));
            }
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
                engine.release_elements();
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
