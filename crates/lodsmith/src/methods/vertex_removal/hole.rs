//! Hole triangulation with the least bend and the best triangle shapes, optimal for small holes.

use glam::DVec3;

/// Loops up to this length are triangulated optimally; ears are cut off longer ones first. Twelve vertices
/// have 220 triangles and 16,796 triangulations.
const MAX_OPTIMAL_LOOP: usize = 12;
/// Weight of the shape of a triangle, relative to the bend of its edges. (Guessed.)
const SHAPE_WEIGHT: f64 = 0.1;
/// Cosine of the deviation from the normal of the replaced faces beyond which a triangle counts as flipped.
/// (Guessed.)
const MIN_TURN_COS: f64 = 0.1;
/// Triangles whose height is less than this share of their longest edge are rejected as degenerate.
const MIN_RELATIVE_HEIGHT: f64 = 1e-9;

/// Requirements on the triangles of a hole.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Cosine of the largest angle to the replaced faces.
    pub(super) turn_cos: f64,
    /// Minimum quality: 1 is equilateral.
    pub(super) quality: f64,
}

impl Limits {
    pub(super) fn new(max_normal_deg: Option<f64>, min_quality: Option<f64>) -> Self {
        let turn_cos =
            max_normal_deg.map_or(MIN_TURN_COS, |deg| libm::cos(deg.to_radians()).max(MIN_TURN_COS));
        Self { turn_cos, quality: min_quality.unwrap_or(0.0) }
    }
}

/// Reasons why triangles were rejected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RejectReasons {
    pub(super) edges: bool,
    pub(super) turned: bool,
    pub(super) shape: bool,
}

/// The ring around a removed vertex, addressed by index.
#[derive(Default)]
pub(super) struct HoleRing {
    pub(super) points: Vec<DVec3>,
    /// Normal of the face beyond the edge to the next vertex, if there is one to consider.
    pub(super) beyond: Vec<Option<DVec3>>,
    /// For each vertex a bit set of the others to which no new edge is allowed.
    pub(super) barred: Vec<u64>,
}

impl HoleRing {
    pub(super) fn is_barred(&self, a: usize, b: usize) -> bool {
        self.barred[a] >> b & 1 == 1
    }
}

/// The best triangulation between two vertices of a loop, as seen from the edge between them.
#[derive(Clone, Copy)]
struct Best {
    cost: f64,
    apex: usize,
    normal: DVec3,
}

const NONE: Best = Best { cost: f64::INFINITY, apex: 0, normal: DVec3::ZERO };

/// Triangulates loops; holds reusable tables.
pub(super) struct HoleFiller {
    limits: Limits,
    table: Vec<Best>,
    work: Vec<(usize, Option<DVec3>)>,
    todo: Vec<(usize, usize)>,
    /// Reasons for rejections since the last reset.
    pub(super) why: RejectReasons,
}

impl HoleFiller {
    pub(super) fn new(limits: Limits) -> Self {
        let table = vec![NONE; MAX_OPTIMAL_LOOP * MAX_OPTIMAL_LOOP];
        Self { limits, table, work: Vec::new(), todo: Vec::new(), why: RejectReasons::default() }
    }

    /// Triangulates a loop of the ring, with normals roughly along `side`, a unit normal; adds triangles of
    /// ring indices to `out`. The edge from the last vertex to the first is exempt from `barred`. Returns
    /// true on success.
    ///
    /// Source: dynamic programming over sub-loops, as for the minimum-weight triangulation of a polygon
    /// [Klincsek 1980]; the weights are ours.
    pub(super) fn fill(
        &mut self,
        ring: &HoleRing,
        around: impl Iterator<Item = usize>,
        side: DVec3,
        out: &mut Vec<[usize; 3]>,
    ) -> bool {
        self.work.clear();
        self.work.extend(around.map(|i| (i, ring.beyond[i])));
        let ring_len = ring.points.len();
        let count = self.work.len();
        for j in 0..count {
            // This is not an edge of the ring: its other side is filled separately.
            if self.work[(j + 1) % count].0 != (self.work[j].0 + 1) % ring_len {
                self.work[j].1 = None;
            }
        }
        while self.work.len() > MAX_OPTIMAL_LOOP {
            if !self.cut_ear(ring, side, out) {
                return false;
            }
        }
        self.fill_best(ring, side, out)
    }

    /// Returns the cost and normal of a triangle, without the bends of its edges.
    fn triangle(&mut self, ring: &HoleRing, t: [usize; 3], side: DVec3) -> Option<(f64, DVec3)> {
        let [a, b, c] = t.map(|i| ring.points[i]);
        let (ab, bc, ca) = (b - a, c - b, a - c);
        let across = ab.cross(bc);
        let double_area = across.length();
        let [x, y, z] = [ab, bc, ca].map(|e| e.length_squared());
        if double_area <= MIN_RELATIVE_HEIGHT * x.max(y).max(z) {
            self.why.shape = true;
            return None;
        }
        let normal = across / double_area;
        if normal.dot(side) < self.limits.turn_cos {
            self.why.turned = true;
            return None;
        }
        let sum = x + y + z;
        let quality = 2.0 * 3f64.sqrt() * double_area / sum;
        if quality < self.limits.quality {
            self.why.shape = true;
            return None;
        }
        Some((SHAPE_WEIGHT * (1.0 - quality) * sum.sqrt(), normal))
    }

    fn fill_best(&mut self, ring: &HoleRing, side: DVec3, out: &mut Vec<[usize; 3]>) -> bool {
        let n = self.work.len();
        if n < 3 {
            return true;
        }
        let at = |i: usize, k: usize| i * MAX_OPTIMAL_LOOP + k;
        for gap in 2..n {
            for i in 0..n - gap {
                let k = i + gap;
                let [a, c] = [i, k].map(|x| self.work[x].0);
                let mut best = NONE;
                let is_own = gap == n - 1;
                if is_own || !ring.is_barred(a, c) {
                    for m in i + 1..k {
                        let below =
                            |x: usize, y: usize| if y == x + 1 { 0.0 } else { self.table[at(x, y)].cost };
                        let sum = below(i, m) + below(m, k);
                        if sum >= best.cost {
                            continue;
                        }
                        let b = self.work[m].0;
                        let Some((shape, normal)) = self.triangle(ring, [a, b, c], side) else {
                            continue;
                        };
                        let beyond = |x: usize, y: usize| match y == x + 1 {
                            true => self.work[x].1,
                            false => Some(self.table[at(x, y)].normal),
                        };
                        let [p, q, r] = [a, b, c].map(|x| ring.points[x]);
                        let mut cost = sum
                            + shape
                            + bend(normal, beyond(i, m), q - p)
                            + bend(normal, beyond(m, k), r - q);
                        if is_own {
                            cost += bend(normal, self.work[k].1, p - r);
                        }
                        if cost < best.cost {
                            best = Best { cost, apex: m, normal };
                        }
                    }
                } else {
                    self.why.edges = true;
                }
                self.table[at(i, k)] = best;
            }
        }
        if self.table[at(0, n - 1)].cost == f64::INFINITY {
            return false;
        }
        self.todo.clear();
        self.todo.push((0, n - 1));
        while let Some((i, k)) = self.todo.pop() {
            if k - i < 2 {
                continue;
            }
            let m = self.table[at(i, k)].apex;
            out.push([i, m, k].map(|x| self.work[x].0));
            self.todo.extend([(i, m), (m, k)]);
        }
        true
    }

    /// Cuts off the cheapest ear.
    fn cut_ear(&mut self, ring: &HoleRing, side: DVec3, out: &mut Vec<[usize; 3]>) -> bool {
        let n = self.work.len();
        let mut best: Option<(f64, usize, DVec3)> = None;
        for j in 0..n {
            let [a, b, c] = [(j + n - 1) % n, j, (j + 1) % n];
            let t = [a, b, c].map(|x| self.work[x].0);
            if ring.is_barred(t[0], t[2]) {
                self.why.edges = true;
                continue;
            }
            let Some((shape, normal)) = self.triangle(ring, t, side) else { continue };
            let [p, q, r] = t.map(|x| ring.points[x]);
            let cost = shape + bend(normal, self.work[a].1, q - p) + bend(normal, self.work[b].1, r - q);
            // An ear contains no other vertex, seen along the normal.
            let holds = |x: DVec3| {
                [(p, q), (q, r), (r, p)].iter().all(|&(u, w)| (w - u).cross(x - u).dot(normal) >= 0.0)
            };
            let others = self.work.iter().enumerate().filter(|x| ![a, b, c].contains(&x.0));
            if best.is_none_or(|best| cost < best.0) && !others.map(|x| ring.points[x.1.0]).any(holds) {
                best = Some((cost, j, normal));
            }
        }
        let Some((_, j, normal)) = best else { return false };
        let before = (j + n - 1) % n;
        out.push([before, j, (j + 1) % n].map(|x| self.work[x].0));
        self.work[before].1 = Some(normal);
        self.work.remove(j);
        true
    }
}

/// Cost of the bend at an edge; 0 at a border.
fn bend(normal: DVec3, beyond: Option<DVec3>, edge: DVec3) -> f64 {
    beyond.map_or(0.0, |other| (1.0 - normal.dot(other)) * edge.length())
}
