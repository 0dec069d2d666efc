//! Order of triangles and vertices for GPU caches, and measures of such orders.
//!
//! Sources: T. Forsyth, "Linear-speed vertex cache optimisation", 2006; the measures are the same as in
//! meshoptimizer.

use std::ops::Range;

use lodsmith_core::TriMesh;

/// Entries of the cache that the order is made for.
const CACHE: usize = 16;
/// Vertices with more triangles than this are ranked by a constant, so that the time stays linear. (Guessed:
/// ten times the usual number.)
const HUB: usize = 64;
/// Triangles of such a vertex that are candidates at a time. (Guessed.)
const HUB_CANDIDATES: usize = 4;

/// The purpose of an order of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OrderFor {
    /// Few transformed vertices on a GPU.
    Gpu,
    /// Few bytes after compression of the indices: triangles that share an edge follow each other.
    Size,
}

/// Scores of vertices, by their position in the cache and by their number of remaining triangles.
struct Scores {
    cached: [f32; CACHE],
    left: [f32; 9],
}

/// Vertices of the last triangle have equal scores, others less with their age; a vertex with few remaining
/// triangles is finished first. (Formulas and constants of the paper: ¾, (1 - age)^1.5, and 2 / √n.)
const GPU: Scores = Scores {
    cached: [
        0.75, 0.75, 0.75, 1.0, 0.887, 0.779, 0.675, 0.577, 0.484, 0.398, 0.316, 0.242, 0.174, 0.114, 0.0604,
        0.0213,
    ],
    left: [0.0, 2.0, 1.414, 1.155, 1.0, 0.894, 0.816, 0.756, 0.707],
};

/// The same with a strong preference for the last triangle. (It gives fewer bytes than
/// the table above for the models of `bench/gltfpack.py`; no others were tried.)
const SIZE: Scores = Scores {
    cached: [1.0, 1.0, 1.0, 0.5, 0.48, 0.46, 0.44, 0.4, 0.36, 0.32, 0.28, 0.24, 0.2, 0.16, 0.12, 0.08],
    left: [0.0, 1.0, 0.8, 0.6, 0.56, 0.54, 0.52, 0.5, 0.49],
};

/// State of ordering.
struct Ordering<'t> {
    triangles: &'t [[u32; 3]],
    scores: Scores,
    /// Start of the triangles of each vertex in `around`; the end is the next start.
    starts: Vec<u32>,
    around: Vec<u32>,
    /// Number of remaining triangles of each vertex: the first of its list. For a hub, the start of the rest
    /// of its list.
    left: Vec<u32>,
    score_of_vertex: Vec<f32>,
    score_of_triangle: Vec<f32>,
    is_done: Vec<bool>,
}

/// Returns the triangles in an order that reuses vertices while they are in a cache. Each triangle keeps its
/// corners and their order. Cost: O(triangles + vertices).
///
/// # Panics
/// If a triangle refers to a vertex from `vertices` on.
pub fn ordered(triangles: &[[u32; 3]], vertices: usize, purpose: OrderFor) -> Vec<[u32; 3]> {
    let mut state = Ordering::new(triangles, vertices, purpose);
    let mut out = Vec::with_capacity(triangles.len());
    let mut cache: Vec<u32> = Vec::with_capacity(CACHE + 3);
    let mut next_in_file = 0;
    let mut next = None;
    while out.len() < triangles.len() {
        let chosen = next.unwrap_or_else(|| {
            while state.is_done[next_in_file] {
                next_in_file += 1;
            }
            next_in_file
        });
        let triangle = triangles[chosen];
        out.push(triangle);
        state.finish(chosen);
        let mut newer: Vec<u32> = Vec::with_capacity(CACHE + 3);
        for vertex in triangle.into_iter().chain(cache.iter().copied()) {
            if !newer.contains(&vertex) {
                newer.push(vertex);
            }
        }
        next = state.rank(&newer);
        newer.truncate(CACHE);
        cache = newer;
    }
    out
}

impl<'t> Ordering<'t> {
    fn new(triangles: &'t [[u32; 3]], vertices: usize, purpose: OrderFor) -> Self {
        let mut left = vec![0u32; vertices];
        triangles.as_flattened().iter().for_each(|v| left[*v as usize] += 1);
        let mut starts = Vec::with_capacity(vertices + 1);
        let mut sum = 0;
        for count in &left {
            starts.push(sum);
            sum += count;
        }
        starts.push(sum);
        let mut around = vec![0; sum as usize];
        let mut filled = starts.clone();
        for (t, triangle) in (0u32..).zip(triangles) {
            for v in triangle {
                around[filled[*v as usize] as usize] = t;
                filled[*v as usize] += 1;
            }
        }
        let scores = if purpose == OrderFor::Gpu { GPU } else { SIZE };
        let score_of_vertex: Vec<f32> = left.iter().map(|n| scores.left[(*n as usize).min(8)]).collect();
        let score = |t: &[u32; 3]| t.iter().map(|v| score_of_vertex[*v as usize]).sum();
        let score_of_triangle = triangles.iter().map(score).collect();
        let is_done = vec![false; triangles.len()];
        let mut state =
            Self { triangles, scores, starts, around, left, score_of_vertex, score_of_triangle, is_done };
        for v in 0..vertices {
            if state.is_hub(v) {
                state.left[v] = state.starts[v];
            }
        }
        state
    }

    fn is_hub(&self, v: usize) -> bool {
        (self.starts[v + 1] - self.starts[v]) as usize > HUB
    }

    /// Takes a triangle out of the lists of its vertices.
    fn finish(&mut self, t: usize) {
        self.is_done[t] = true;
        for v in self.triangles[t] {
            let v = v as usize;
            let (start, end) = (self.starts[v], self.starts[v + 1]);
            if self.is_hub(v) {
                while self.left[v] < end && self.is_done[self.around[self.left[v] as usize] as usize] {
                    self.left[v] += 1;
                }
                continue;
            }
            let list = &mut self.around[start as usize..(start + self.left[v]) as usize];
            if let Some(at) = list.iter().position(|other| *other as usize == t) {
                let last = list.len() - 1;
                list.swap(at, last);
                self.left[v] -= 1;
            }
        }
    }

    /// Returns the range in `around` of the remaining triangles of a vertex; for a hub, of a few of them.
    fn candidates(&self, v: usize) -> Range<usize> {
        let (start, end, left) =
            (self.starts[v] as usize, self.starts[v + 1] as usize, self.left[v] as usize);
        if self.is_hub(v) { left..(left + HUB_CANDIDATES).min(end) } else { start..start + left }
    }

    /// Scores the vertices of the cache, and returns the best of their triangles.
    fn rank(&mut self, cache: &[u32]) -> Option<usize> {
        for (place, &v) in cache.iter().enumerate() {
            let v = v as usize;
            if self.is_hub(v) {
                continue;
            }
            let cached = self.scores.cached.get(place).copied().unwrap_or(0.0);
            let left = (self.left[v] as usize).min(8);
            let score = if left == 0 { 0.0 } else { cached + self.scores.left[left] };
            let gain = score - self.score_of_vertex[v];
            self.score_of_vertex[v] = score;
            for at in self.candidates(v) {
                self.score_of_triangle[self.around[at] as usize] += gain;
            }
        }
        let mut best: Option<(f32, usize)> = None;
        for at in cache.iter().flat_map(|v| self.candidates(*v as usize)) {
            let t = self.around[at] as usize;
            let score = self.score_of_triangle[t];
            if !self.is_done[t] && best.is_none_or(|(other, _)| score > other) {
                best = Some((score, t));
            }
        }
        best.map(|(_, t)| t)
    }
}

/// Returns the vertices in the order in which triangles first use them; others are left out.
pub fn fetch_order(triangles: &[[u32; 3]], vertices: usize) -> Vec<u32> {
    let mut is_used = vec![false; vertices];
    let first = |v: &u32| !std::mem::replace(&mut is_used[*v as usize], true);
    triangles.as_flattened().iter().copied().filter(first).collect()
}

/// Measures of how well the order of a mesh suits the caches of a GPU.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct CacheUse {
    /// Triangles of all meshes.
    pub triangles: usize,
    /// Vertices that triangles use.
    pub vertices: usize,
    /// Vertices that are transformed, with a cache of 16 entries, first in, first out.
    pub transformed: usize,
    /// Bytes of these vertices.
    pub vertex_bytes: u64,
    /// Bytes that are read from memory for them, in lines of 64 bytes, with a cache of 128 KiB.
    pub fetched_bytes: u64,
}

impl CacheUse {
    /// Measures some triangles over vertices of `stride` bytes. Cost: O(triangles + vertices).
    ///
    /// # Panics
    /// If a triangle refers to a vertex from `vertices` on.
    pub fn of(triangles: &[[u32; 3]], vertices: usize, stride: usize) -> Self {
        const ENTRIES: u32 = 16;
        const LINE: usize = 64;
        const LINES: usize = (128 << 10) / LINE;
        let mut loaded_at = vec![0u32; vertices];
        // Vertices that were never loaded are far back.
        let mut clock = ENTRIES + 1;
        let mut lines = vec![usize::MAX; LINES];
        let mut found = Self { triangles: triangles.len(), ..Self::default() };
        for &v in triangles.as_flattened() {
            let v = v as usize;
            found.vertices += usize::from(loaded_at[v] == 0);
            if clock - loaded_at[v] <= ENTRIES {
                continue;
            }
            loaded_at[v] = clock;
            clock += 1;
            found.transformed += 1;
            for line in v * stride / LINE..=((v + 1) * stride).saturating_sub(1) / LINE {
                if std::mem::replace(&mut lines[line % LINES], line) != line {
                    found.fetched_bytes += LINE as u64;
                }
            }
        }
        found.vertex_bytes = found.vertices as u64 * stride as u64;
        found
    }

    /// Measures a mesh with its normals, texture coordinates and colours, as floats.
    pub fn of_mesh(mesh: &TriMesh) -> Self {
        let numbers = [
            3,
            3 * usize::from(mesh.normals().is_some()),
            2 * usize::from(mesh.uvs().is_some()),
            4 * usize::from(mesh.colors().is_some()),
        ];
        let stride = 4 * numbers.into_iter().sum::<usize>();
        Self::of(bytemuck::cast_slice(mesh.triangles()), mesh.wedge_count(), stride)
    }

    /// Adds the counts of another mesh.
    pub fn add(&mut self, other: Self) {
        self.triangles += other.triangles;
        self.vertices += other.vertices;
        self.transformed += other.transformed;
        self.vertex_bytes += other.vertex_bytes;
        self.fetched_bytes += other.fetched_bytes;
    }

    /// Returns the transformed vertices per triangle (average cache miss ratio): from 0.5 to 3.
    pub fn acmr(&self) -> f64 {
        self.transformed as f64 / self.triangles.max(1) as f64
    }

    /// Returns the transformed vertices per vertex: from 1.
    pub fn atvr(&self) -> f64 {
        self.transformed as f64 / self.vertices.max(1) as f64
    }

    /// Returns the bytes read from memory per byte of the vertices: from 1.
    pub fn overfetch(&self) -> f64 {
        self.fetched_bytes as f64 / self.vertex_bytes.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Triangles of a grid of n × n squares, in an order that suits no cache.
    fn shuffled_grid(n: u32) -> (Vec<[u32; 3]>, usize) {
        let at = |x: u32, y: u32| y * (n + 1) + x;
        let mut all = Vec::new();
        for y in 0..n {
            for x in 0..n {
                all.push([at(x, y), at(x + 1, y), at(x, y + 1)]);
                all.push([at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]);
            }
        }
        let count = all.len();
        // Near the golden ratio, and coprime to the count.
        let step = 1977;
        ((0..count).map(|i| all[i * step % count]).collect(), ((n + 1) * (n + 1)) as usize)
    }

    #[test]
    fn a_grid_uses_the_cache() {
        let (grid, vertices) = shuffled_grid(40);
        let before = CacheUse::of(&grid, vertices, 32);
        for (purpose, most) in [(OrderFor::Gpu, 1.0), (OrderFor::Size, 1.2)] {
            let after = ordered(&grid, vertices, purpose);
            let new_ids = fetch_order(&after, vertices);
            let mut place = vec![0; vertices];
            new_ids.iter().enumerate().for_each(|(i, v)| place[*v as usize] = i as u32);
            let after: Vec<_> = after.iter().map(|t| t.map(|v| place[v as usize])).collect();
            let cache = CacheUse::of(&after, vertices, 32);
            assert!(before.acmr() > 1.5 && cache.acmr() < most, "{before:?} {cache:?}");
            assert!(cache.overfetch() < 1.3, "{cache:?}");
            assert!(cache.atvr() >= 1.0);
        }
    }

    #[test]
    fn a_hub_takes_no_longer() {
        let fan: Vec<[u32; 3]> = (1..300_000).map(|i| [0, i, i + 1]).collect();
        let got = ordered(&fan, 300_001, OrderFor::Size);
        assert_eq!(got.len(), fan.len());
        assert!(CacheUse::of(&got, 300_001, 12).acmr() < 1.2);
    }

    proptest! {
        #[test]
        fn triangles_are_all_there(triangles in prop::collection::vec(prop::array::uniform3(0u32..40), 0..200)) {
            let mut got = ordered(&triangles, 40, OrderFor::Gpu);
            let mut wanted = triangles;
            got.sort_unstable();
            wanted.sort_unstable();
            prop_assert_eq!(got, wanted);
        }
    }
}
