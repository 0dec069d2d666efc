//! Whole parts: what goes when the target cannot be met otherwise.

use glam::Vec3;
use lodsmith_core::VertexId;

use super::order::NONE;
use super::{Engine, Goal};
use crate::metric::Metric;
use crate::options::TopologyPolicy;

/// A connected part of the live mesh.
#[derive(Clone, Copy)]
struct Part {
    faces: usize,
    vertices: usize,
    area: f32,
    min: Vec3,
    max: Vec3,
}

impl Part {
    /// What its absence costs: its area times the square of its size, as if all else were that far away.
    fn cost(&self) -> f32 {
        self.area * (self.max - self.min).length_squared()
    }
}

impl<M: Metric> Engine<M> {
    /// Removes whole parts, the cheapest first, until the goal is met or one part is left. Says whether it is met.
    pub(crate) fn remove_parts(&mut self, goal: &Goal) -> bool {
        if self.rules.topology == TopologyPolicy::Preserve || self.needed(goal).is_none() {
            return false;
        }
        self.store.compact();
        let label = self.label_parts();
        let blank = Part {
            faces: 0,
            vertices: 0,
            area: 0.0,
            min: Vec3::splat(f32::INFINITY),
            max: Vec3::splat(f32::NEG_INFINITY),
        };
        let mut parts = vec![blank; label.iter().copied().max().map_or(0, |m| m as usize + 1)];
        for (x, &l) in self.store.v.iter().zip(&label) {
            let part = &mut parts[l as usize];
            part.vertices += 1;
            (part.min, part.max) = (part.min.min(x.p), part.max.max(x.p));
        }
        for t in &self.store.t {
            let [a, b, c] = t.map(|w| self.store.p(w));
            let part = &mut parts[label[t[0].index()] as usize];
            part.faces += 1;
            part.area += (b - a).cross(c - a).length();
        }
        let mut order: Vec<usize> = (0..parts.len()).collect();
        order.sort_by(|&i, &j| parts[i].cost().total_cmp(&parts[j].cost()).then(i.cmp(&j)));
        order.pop(); // the dearest stays
        let mut gone = vec![false; parts.len()];
        for i in order {
            if self.needed(goal) == Some(0) {
                break;
            }
            gone[i] = true;
            self.store.live_faces -= parts[i].faces;
            self.store.live_vertices -= parts[i].vertices;
            self.parts_removed += 1;
        }
        for t in &mut self.store.t {
            if gone[label[t[0].index()] as usize] {
                t[0] = NONE;
            }
        }
        self.store.compact();
        self.needed(goal) == Some(0)
    }

    /// The number of the part of each vertex, parts counted in the order of their first vertex.
    fn label_parts(&self) -> Vec<u32> {
        let mut root: Vec<VertexId> = (0..self.store.v.len() as u32).map(VertexId).collect();
        fn find(root: &mut [VertexId], mut i: VertexId) -> VertexId {
            while root[i.index()] != i {
                root[i.index()] = root[root[i.index()].index()];
                i = root[i.index()];
            }
            i
        }
        for t in &self.store.t {
            let a = find(&mut root, t[0]);
            for &w in &t[1..] {
                let b = find(&mut root, w);
                let a = find(&mut root, a);
                let (low, high) = (a.min(b), a.max(b));
                root[high.index()] = low;
            }
        }
        let mut label = vec![u32::MAX; root.len()];
        let mut count = 0;
        for i in 0..root.len() {
            let r = find(&mut root, VertexId(i as u32)).index();
            if label[r] == u32::MAX {
                label[r] = count;
                count += 1;
            }
            label[i] = label[r];
        }
        label
    }
}
