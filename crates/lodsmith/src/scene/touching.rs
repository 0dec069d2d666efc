//! Borders of meshes that touch at the places of their copies: which meshes run together although their
//! origins differ, and which vertices are locked because another copy touches them.
//!
//! Two meshes that are placed once, with transforms that differ only by a translation, run together as if
//! they had one origin. In all other cases (copies of one mesh, mirrored and rotated meshes) a change of one
//! border would have to be made to the other too, so these vertices are locked.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use glam::{DMat3, DVec3};
use lodsmith_core::mesh::weld::weld_within;
use lodsmith_core::sorted::indices_by_key;
use lodsmith_core::{DisjointSets, Positions, TriMesh, VertexId};

use super::part::{Part, Place};
use crate::pipeline::borders::{self, BorderVertex, MIN_EDGE_RATIO, ROUNDING_SHARE};

/// Maximum number of border vertices of all copies among which touching ones are searched for. (Guessed: they
/// take half a gigabyte.)
const MAX_PLACED: usize = 1 << 23;

/// Where meshes of a scene touch.
pub(super) struct Touching {
    /// For each system that runs together with a lower-numbered one: that system, and the vector from its
    /// origin to this one's, in the coordinates of both.
    joined: BTreeMap<usize, (usize, DVec3)>,
    /// Places where meshes that do not run together touch, each as a list of vertices of parts.
    apart: Vec<Vec<(usize, VertexId)>>,
    /// Distance within which positions in the scene are equal up to rounding.
    pub(super) rounding: f64,
}

/// A copy of a part: its number, and its transform.
struct PlacedCopy {
    part: usize,
    place: Place,
}

impl Touching {
    /// Finds where the copies of parts touch; with `runs_apart`, no two parts run together. `None` if no
    /// parts touch. Cost: O(n), and for each copy O(vertices on its border).
    pub(super) fn find(parts: &[Part<'_>], runs_apart: bool) -> Option<Self> {
        let copies = placed_copies(parts);
        if copies.len() < 2 {
            return None;
        }
        let borders: Vec<Vec<BorderVertex>> = parts.iter().map(|p| borders::of(&p.mesh.surface())).collect();
        if copies.iter().map(|c| borders[c.part].len()).fold(0, usize::saturating_add) > MAX_PLACED {
            return None;
        }
        let mut largest = 0f64;
        let (mut owners, mut points) = (Vec::new(), Vec::new());
        for (c, copy) in copies.iter().enumerate() {
            let part = &parts[copy.part];
            let view = part.mesh.positions().view();
            largest = largest.max(borders::rounding(view) / ROUNDING_SHARE * part.scale);
            for b in &borders[copy.part] {
                let p = moved(&copy.place, view.get(b.vertex));
                largest = p.iter().fold(largest, |most, x| most.max(x.abs()));
                owners.push((c, b));
                points.push(p);
            }
        }
        let rounding = largest * ROUNDING_SHARE;
        if !rounding.is_finite() {
            return None;
        }
        let near = weld_within(Positions::F64(points).view(), rounding);
        let is_coarse = |&i: &usize| {
            let (c, b) = owners[i];
            b.shortest_edge * parts[copies[c].part].scale > MIN_EDGE_RATIO * rounding
        };
        let coarse: Vec<usize> = (0..owners.len()).filter(is_coarse).collect();
        let place_of = |i: usize| near.of(VertexId::new(i));
        let by_place = indices_by_key(coarse.iter().map(|&i| u64::from(place_of(i).0)));
        let at: Vec<usize> = by_place.into_iter().map(|k| coarse[k]).collect();
        let is_met = |at: &&[usize]| at.iter().any(|&i| owners[i].0 != owners[at[0]].0);
        let met: Vec<&[usize]> = at.chunk_by(|&i, &j| place_of(i) == place_of(j)).filter(is_met).collect();
        if met.is_empty() {
            return None;
        }

        let system_of = |i: usize| parts[copies[owners[i].0].part].system;
        let mut together = Together::new(parts, &copies);
        if !runs_apart {
            for at in &met {
                let systems: BTreeSet<usize> = at.iter().filter_map(|&i| system_of(i)).collect();
                let systems: Vec<usize> = systems.into_iter().collect();
                for (k, &a) in systems.iter().enumerate() {
                    systems[k + 1..].iter().for_each(|&b| together.join(a, b));
                }
            }
        }
        let mut apart = Vec::new();
        for at in met {
            let mut root = |i: usize| system_of(i).filter(|_| !runs_apart).map(|s| together.root(s));
            let first = root(at[0]);
            if first.is_none() || at.iter().any(|&i| root(i) != first) {
                let mut members: Vec<(usize, VertexId)> =
                    at.iter().map(|&i| (copies[owners[i].0].part, owners[i].1.vertex)).collect();
                members.sort_unstable();
                members.dedup();
                apart.push(members);
            }
        }
        apart.sort_unstable();
        apart.dedup();
        Some(Self { joined: together.into_offsets(), apart, rounding })
    }

    /// Returns the system that a system runs together with, and the vector from its origin to this one's.
    pub(super) fn root(&self, system: usize) -> (usize, [f64; 3]) {
        let (root, offset) = self.joined.get(&system).copied().unwrap_or((system, DVec3::ZERO));
        (root, offset.to_array())
    }

    /// True if meshes with different origins run together.
    pub(super) fn joins(&self) -> bool {
        !self.joined.is_empty()
    }

    /// Locks the vertices at which meshes touch without running together, in a list of all vertices, part
    /// after part.
    pub(super) fn add_locks(&self, parts: &[Part<'_>], locked: Option<Vec<bool>>) -> Option<Vec<bool>> {
        if self.apart.is_empty() {
            return locked;
        }
        let count = parts.iter().map(|p| p.mesh.vertex_count()).sum();
        let mut all = locked.unwrap_or_else(|| vec![false; count]);
        let mut first = Vec::with_capacity(parts.len());
        let mut next = 0;
        for part in parts {
            first.push(next);
            next += part.mesh.vertex_count();
        }
        for &(part, v) in self.apart.iter().flatten() {
            all[first[part] + v.index()] = true;
        }
        Some(all)
    }

    /// Returns the number of places where meshes touched without running together, and no longer do: a mesh
    /// that still has faces has no vertex at that position any more.
    pub(super) fn gaps(&self, parts: &[Part<'_>], results: &[TriMesh]) -> usize {
        let bits = |p: [f64; 3]| p.map(|x| (x + 0.0).to_bits());
        let mut left: BTreeMap<usize, HashSet<[u64; 3]>> = BTreeMap::new();
        for &(part, _) in self.apart.iter().flatten() {
            left.entry(part).or_insert_with(|| results[part].positions().view().iter().map(bits).collect());
        }
        let is_gone = |&(part, v): &(usize, VertexId)| {
            let place = bits(parts[part].mesh.positions().view().get(v));
            results[part].face_count() > 0 && !left[&part].contains(&place)
        };
        self.apart.iter().filter(|at| at.iter().any(is_gone)).count()
    }
}

/// Returns the copies of all parts that have faces; copies of a part at the same place count once.
fn placed_copies(parts: &[Part<'_>]) -> Vec<PlacedCopy> {
    let mut copies = Vec::new();
    for (i, part) in parts.iter().enumerate().filter(|(_, p)| p.mesh.face_count() > 0) {
        let mut known = HashSet::new();
        for place in part.places {
            if known.insert(place.map(|row| row.map(f64::to_bits))) {
                copies.push(PlacedCopy { part: i, place: *place });
            }
        }
    }
    copies
}

pub(super) fn moved(place: &Place, p: [f64; 3]) -> [f64; 3] {
    place.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3])
}

/// Systems that run together.
struct Together {
    /// The transform of each system that is placed once.
    systems: BTreeMap<usize, Place>,
    /// The systems in order, and the sets of their numbers there.
    order: Vec<usize>,
    sets: DisjointSets,
}

impl Together {
    fn new(parts: &[Part<'_>], copies: &[PlacedCopy]) -> Self {
        let mut systems = BTreeMap::new();
        for copy in copies {
            if let Some(system) = parts[copy.part].system {
                systems.entry(system).or_insert(copy.place);
            }
        }
        let order: Vec<usize> = systems.keys().copied().collect();
        let sets = DisjointSets::new(order.len());
        Self { systems, order, sets }
    }

    fn number(&self, system: usize) -> u32 {
        self.order.partition_point(|&s| s < system) as u32
    }

    /// Lets two systems run together if their transforms differ only by a translation.
    fn join(&mut self, a: usize, b: usize) {
        if differ_by_translation(&self.systems[&a], &self.systems[&b]) {
            let (a, b) = (self.number(a), self.number(b));
            self.sets.join(a, b);
        }
    }

    fn root(&mut self, system: usize) -> usize {
        let number = self.number(system);
        self.order[self.sets.find(number) as usize]
    }

    fn into_offsets(mut self) -> BTreeMap<usize, (usize, DVec3)> {
        let mut all = BTreeMap::new();
        for system in self.order.clone() {
            let root = self.root(system);
            if root != system {
                let [from, to] = [root, system].map(|s| self.systems[&s].map(|row| row[3]));
                let between = DVec3::from(to) - DVec3::from(from);
                all.insert(system, (root, linear(&self.systems[&root]).inverse() * between));
            }
        }
        all
    }
}

/// Returns the linear part of a transform.
fn linear(place: &Place) -> DMat3 {
    DMat3::from_cols_array_2d(&place.map(|row| [row[0], row[1], row[2]])).transpose()
}

/// True if the linear parts of two transforms are equal up to rounding, and invertible.
fn differ_by_translation(a: &Place, b: &Place) -> bool {
    let entries = |place: &Place| linear(place).to_cols_array();
    let size = entries(a).iter().fold(0f64, |most, x| most.max(x.abs()));
    let mut pairs = entries(a).into_iter().zip(entries(b));
    // Their difference must stay below the rounding of the positions that they transform.
    let is_same = pairs.all(|(x, y)| (x - y).abs() <= 0.25 * ROUNDING_SHARE * size);
    // Guessed: with a determinant this small the inverse is rounding.
    is_same && size.is_finite() && (linear(a) * (1.0 / size)).determinant().abs() > 1e-6
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;

    fn at(x: f64, y: f64) -> Place {
        [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, 0.0]]
    }

    fn part<'a>(mesh: &'a TriMesh, places: &'a [Place], system: Option<usize>) -> Part<'a> {
        Part { instances: places.len(), system, places, ..Part::new(mesh) }
    }

    /// Width of a grid.
    fn width(mesh: &TriMesh) -> f64 {
        let bounds = mesh.positions().view().bounds().expect("the mesh has vertices");
        bounds.max[0] - bounds.min[0]
    }

    #[test]
    fn meshes_with_different_origins_run_together() {
        let mesh = shapes::grid(4);
        let w = width(&mesh);
        let places = [[at(0.0, 0.0)], [at(w, 0.0)], [at(9.0 * w, 0.0)]];
        let parts = [0, 1, 2].map(|i| part(&mesh, &places[i], Some(i)));
        let touching = Touching::find(&parts, false).expect("two of them touch");
        assert!(touching.joins() && touching.apart.is_empty());
        assert_eq!((touching.root(1), touching.root(2).0), ((0, [w, 0.0, 0.0]), 2));
        assert!(touching.add_locks(&parts, None).is_none());
        // If they run separately, the five places of the common side are counted.
        assert_eq!(Touching::find(&parts, true).map(|t| (t.joins(), t.apart.len())), Some((false, 5)));
        assert!(Touching::find(&parts[1..], false).is_none());
    }

    #[test]
    fn vertices_are_locked_where_copies_touch() {
        let mesh = shapes::grid(4);
        let w = width(&mesh);
        // The left side touches the right side.
        let row = [at(0.0, 0.0), at(w, 0.0), at(2.0 * w, 0.0)];
        let parts = [part(&mesh, &row, None)];
        let touching = Touching::find(&parts, false).expect("they touch");
        let locked = touching.add_locks(&parts, None).expect("some");
        assert_eq!((touching.joins(), locked.iter().filter(|l| **l).count()), (false, 10));
        assert_eq!(touching.gaps(&parts, std::slice::from_ref(&mesh)), 0);
        let mut other = mesh.clone();
        other.map_positions(|p| [p[0], p[1], p[2] + 1e-3]);
        assert_eq!(touching.gaps(&parts, std::slice::from_ref(&other)), touching.apart.len());
        // Two copies at one place cannot be separated.
        assert!(Touching::find(&[part(&mesh, &[at(0.0, 0.0); 2], None)], false).is_none());
    }

    #[test]
    fn vertices_are_locked_where_a_mirrored_copy_touches() {
        let mesh = shapes::grid(4);
        let bounds = mesh.positions().view().bounds().expect("the mesh has vertices");
        // Mirrored at the plane of the right side.
        let mirrored = [[-1.0, 0.0, 0.0, 2.0 * bounds.max[0]], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let places = [[at(0.0, 0.0)], [mirrored]];
        let parts = [part(&mesh, &places[0], Some(0)), part(&mesh, &places[1], Some(1))];
        let touching = Touching::find(&parts, false).expect("they touch");
        let locked = touching.add_locks(&parts, None).expect("some");
        assert_eq!((touching.joins(), locked.iter().filter(|l| **l).count()), (false, 10));
    }
}
