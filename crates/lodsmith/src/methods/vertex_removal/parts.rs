//! Removal of whole components, when no vertex can be removed any more.

use lodsmith_core::VertexId;
use lodsmith_core::sorted::{indices_by_key, key_of};

use super::store::FaceStore;
use crate::methods::task::Task;

/// Removes components, smallest bounding box first, until the goal is met: never the largest, and none with a
/// locked vertex. Returns how many were removed. Cost: O(n log n).
pub(super) fn remove_cheapest(store: &mut FaceStore<'_>, task: &Task<'_>) -> usize {
    let mut root: Vec<VertexId> = (0..store.points.len()).map(VertexId::new).collect();
    let find = |root: &mut Vec<VertexId>, mut v: VertexId| {
        while root[v.index()] != v {
            root[v.index()] = root[root[v.index()].index()];
            v = root[v.index()];
        }
        v
    };
    for (_, [a, b, c]) in store.faces() {
        for (x, y) in [(a, b), (b, c)] {
            let (x, y) = (find(&mut root, x), find(&mut root, y));
            root[x.max(y).index()] = x.min(y);
        }
    }
    let mut faces: Vec<_> = store.faces().map(|(f, t)| (find(&mut root, t[0]), f)).collect();
    faces.sort_unstable();
    let locked = task.input.locked.as_deref();
    let parts: Vec<_> = faces
        .chunk_by(|a, b| a.0 == b.0)
        .map(|part| {
            let corners = || part.iter().flat_map(|x| store.face(x.1));
            let points = || corners().map(|v| store.point(v));
            let first = store.point(part[0].0);
            let (min, max) = points().fold((first, first), |(a, b), p| (a.min(p), b.max(p)));
            let is_held = locked.is_some_and(|l| corners().any(|v| l[v.index()]));
            ((max - min).length(), is_held, part)
        })
        .collect();
    let mut smallest_first = indices_by_key(parts.iter().map(|p| key_of(p.0)));
    smallest_first.pop();
    let mut removed = 0;
    for (_, _, part) in smallest_first.into_iter().map(|i| &parts[i]).filter(|p| !p.1) {
        if store.meets(&task.goal) {
            break;
        }
        part.iter().for_each(|x| store.remove(x.1));
        removed += 1;
    }
    removed
}
