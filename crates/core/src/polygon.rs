//! Triangulation of polygons: quads and n-gons in files.

/// Triangulates polygons; reuses its scratch buffers between polygons.
///
/// ```
/// use lodsmith_core::polygon::Triangulator;
/// let mut triangles = Vec::new();
/// let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
/// Triangulator::default().triangulate(&square, &mut triangles);
/// assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Triangulator {
    /// Corners projected to a plane, counter-clockwise overall.
    flat: Vec<[f64; 2]>,
    /// The remaining corners, as a linked ring.
    before: Vec<u32>,
    after: Vec<u32>,
    /// True if a corner may lie inside another corner's ear: it is not convex, and still in the ring.
    blocks: Vec<bool>,
    grid: Grid,
}

impl Triangulator {
    /// Cuts a polygon of n corners into n - 2 triangles of indices into `points`; `out` is cleared first.
    ///
    /// Fewer than three corners make no triangle. Triangles have the winding of the polygon. A quad is split
    /// along the diagonal that gives both halves the winding of the whole (so concave quads come out right),
    /// along the shorter one if both do. Larger polygons are cut in the plane of their average normal; holes
    /// connected to the outer boundary by a bridge edge used in both directions are supported.
    /// Self-intersecting or non-finite polygons get the same number of triangles, which may overlap. The sum
    /// of the signed areas always equals the area of the polygon. Repeated and collinear corners are used
    /// too, in triangles without area if nothing else is possible. Cost: O(n) for convex polygons, else about
    /// O(n log n), O(n²) in the worst case; the work is limited, and what remains then is cut as a fan.
    ///
    /// # Panics
    /// If the number of corners does not fit 32 bits.
    ///
    /// Source: ear clipping after [Meisters 1975], the normal after Newell in [Sutherland 1974]; the grid,
    /// the order of the ears and the handling of bad input are ours.
    pub fn triangulate(&mut self, points: &[[f64; 3]], out: &mut Vec<[u32; 3]>) {
        out.clear();
        let n = u32::try_from(points.len()).expect("a polygon has fewer than 2^32 corners");
        match points {
            [] | [_] | [_, _] => {}
            [_, _, _] => out.push([0, 1, 2]),
            [a, b, c, d] => out.extend(split_quad([*a, *b, *c, *d])),
            _ => {
                out.reserve(points.len() - 2);
                if !self.flatten(points) {
                    out.extend((1..n - 1).map(|i| [0, i, i + 1]));
                } else if self.is_convex() {
                    halve(0, n - 1, out);
                } else {
                    self.clip_ears(out);
                }
            }
        }
    }

    /// Projects the corners to a plane, counter-clockwise; returns false if they have no plane.
    ///
    /// The plane is spanned by two of the axes: dropping a coordinate keeps the others exact, and ears stay
    /// ears in any projection.
    fn flatten(&mut self, points: &[[f64; 3]]) -> bool {
        let Some(scale) = scale_of(points) else { return false };
        let at = |i: usize| [0, 1, 2].map(|k| (points[i][k] - points[0][k]) * scale);
        let mut normal = [0.0; 3];
        let mut size = 0.0;
        for i in 1..points.len() - 1 {
            let turn = cross(at(i), at(i + 1));
            for k in 0..3 {
                normal[k] += turn[k];
                size += turn[k].abs();
            }
        }
        let axis = (0..3).fold(0, |a, b| if normal[b].abs() > normal[a].abs() { b } else { a });
        // A sum of opposite terms leaves only rounding errors.
        if normal[axis].abs() <= 1e-14 * size {
            return false;
        }
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let (u, v) = if normal[axis] > 0.0 { (u, v) } else { (v, u) };
        self.flat.clear();
        self.flat.extend(points.iter().map(|p| [p[u] * scale, p[v] * scale]));
        true
    }

    /// True if every corner is convex and the polygon winds around once.
    fn is_convex(&self) -> bool {
        let p = &self.flat;
        let n = p.len();
        let is_upward = |a: [f64; 2], b: [f64; 2]| b[1] > a[1] || (b[1] == a[1] && b[0] > a[0]);
        let mut switches = 0;
        let mut last = is_upward(p[n - 1], p[0]);
        for i in 0..n {
            let next = p[(i + 1) % n];
            if turn(p[(i + n - 1) % n], p[i], next) <= 0.0 {
                return false;
            }
            let upward = is_upward(p[i], next);
            switches += usize::from(upward != last);
            last = upward;
        }
        switches == 2
    }

    fn clip_ears(&mut self, out: &mut Vec<[u32; 3]>) {
        let n = self.flat.len() as u32;
        self.before.clear();
        self.before.extend((0..n).map(|i| if i == 0 { n - 1 } else { i - 1 }));
        self.after.clear();
        self.after.extend((0..n).map(|i| if i + 1 == n { 0 } else { i + 1 }));
        let mut left = n;
        // Corners that repeat their neighbour give triangles without area in any case: cut them off first.
        let mut at = 0;
        for _ in 0..n {
            let next = self.after[at as usize];
            if left > 3 && self.flat[at as usize] == self.flat[next as usize] {
                out.push([self.before[at as usize], at, next]);
                self.unlink(at);
                left -= 1;
            }
            at = next;
        }
        self.blocks.clear();
        self.blocks.resize(n as usize, false);
        let start = at;
        loop {
            self.blocks[at as usize] = self.turn_at(at) <= 0.0;
            at = self.after[at as usize];
            if at == start {
                break;
            }
        }
        self.grid.build(&self.flat, &self.blocks);

        // A second of work at most; polygons of ten thousand corners reach it only if constructed to.
        let mut budget = 100_000_000u64 + 100 * u64::from(n);
        let mut criterion = EarCriterion::Strict;
        let mut tried = 0;
        while left > 3 {
            let is_ear = self.is_ear(at, criterion, &mut budget);
            if budget == 0 {
                break;
            }
            if is_ear {
                let (b, a) = (self.before[at as usize], self.after[at as usize]);
                out.push([b, at, a]);
                self.unlink(at);
                left -= 1;
                self.grid.remove(&mut self.blocks, at);
                for corner in [b, a] {
                    if self.blocks[corner as usize] && self.turn_at(corner) > 0.0 {
                        self.grid.remove(&mut self.blocks, corner);
                    }
                }
                if self.grid.is_stale() {
                    self.grid.build(&self.flat, &self.blocks);
                }
                criterion = EarCriterion::Strict;
                tried = 0;
                // Skipping the next corner gives better shapes than a fan around one.
                at = self.after[a as usize];
            } else {
                tried += 1;
                at = self.after[at as usize];
                if tried > left {
                    tried = 0;
                    criterion = match criterion {
                        EarCriterion::Strict => EarCriterion::Touching,
                        EarCriterion::Touching => EarCriterion::Straight,
                        EarCriterion::Straight => EarCriterion::Any,
                        EarCriterion::Any => break,
                    };
                }
            }
        }
        // The last triangle, or a fan over what could not be cut.
        let hub = at;
        let mut a = self.after[hub as usize];
        let mut b = self.after[a as usize];
        while b != hub {
            out.push([hub, a, b]);
            (a, b) = (b, self.after[b as usize]);
        }
    }

    fn unlink(&mut self, at: u32) {
        let (b, a) = (self.before[at as usize], self.after[at as usize]);
        self.after[b as usize] = a;
        self.before[a as usize] = b;
    }

    fn turn_at(&self, at: u32) -> f64 {
        let p = |i: u32| self.flat[i as usize];
        turn(p(self.before[at as usize]), p(at), p(self.after[at as usize]))
    }

    fn is_ear(&self, at: u32, criterion: EarCriterion, budget: &mut u64) -> bool {
        *budget = budget.saturating_sub(1);
        let t = self.turn_at(at);
        match criterion {
            EarCriterion::Straight => t == 0.0,
            EarCriterion::Any => t > 0.0,
            EarCriterion::Strict | EarCriterion::Touching => {
                t > 0.0 && !self.is_blocked(at, criterion == EarCriterion::Touching, budget)
            }
        }
    }

    /// True if a corner, or another part of the outline through the tip, lies in the triangle at `at`.
    fn is_blocked(&self, at: u32, touching_is_fine: bool, budget: &mut u64) -> bool {
        let (before, after) = (self.before[at as usize], self.after[at as usize]);
        let p = |i: u32| self.flat[i as usize];
        let (a, b, c) = (p(before), p(at), p(after));
        self.grid.any_in([a, b, c], |q| {
            *budget = budget.saturating_sub(1);
            if !self.blocks[q as usize] || q == before || q == after || q == at {
                return false;
            }
            let x = p(q);
            if x == a || x == c {
                return false;
            }
            if x == b {
                // Another corner at the position of the tip: it matters if its outline comes from inside the
                // ear.
                return [self.before[q as usize], self.after[q as usize]]
                    .into_iter()
                    .any(|r| turn(a, b, p(r)) > 0.0 && turn(p(r), b, c) < 0.0 && turn(b, c, p(r)) > 0.0);
            }
            let sides = [turn(a, b, x), turn(b, c, x), turn(c, a, x)];
            if touching_is_fine { sides.iter().all(|&s| s > 0.0) } else { sides.iter().all(|&s| s >= 0.0) }
        })
    }
}

/// Criterion for ears. Relaxed each time a full round finds none.
#[derive(Clone, Copy, PartialEq)]
enum EarCriterion {
    /// Convex, with no corner inside or on its boundary.
    Strict,
    /// Convex, with no corner inside.
    Touching,
    /// Collinear: a triangle without area.
    Straight,
    /// Convex.
    Any,
}

/// Uniform grid of the corners that may block ears.
#[derive(Clone, Debug, Default)]
struct Grid {
    low: [f64; 2],
    /// Cells per unit, along each axis.
    per_unit: [f64; 2],
    /// Number of cells along each axis.
    side: usize,
    /// Start of each cell in `corners`; one more entry than cells.
    start: Vec<u32>,
    corners: Vec<u32>,
    live: usize,
}

impl Grid {
    fn build(&mut self, points: &[[f64; 2]], blocks: &[bool]) {
        let of = || (0..points.len()).filter(|&i| blocks[i]);
        self.live = of().count();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for i in of() {
            for k in 0..2 {
                low[k] = low[k].min(points[i][k]);
                high[k] = high[k].max(points[i][k]);
            }
        }
        // About two corners per cell, and at most a million cells.
        self.side = ((self.live as f64 / 2.0).sqrt() as usize).clamp(1, 1000);
        self.low = low;
        self.per_unit = [0, 1].map(|k| {
            let width = high[k] - low[k];
            if width > 0.0 { self.side as f64 / width } else { 0.0 }
        });
        self.start.clear();
        self.start.resize(self.side * self.side + 1, 0);
        for i in of() {
            let cell = self.cell(points[i]);
            self.start[cell + 1] += 1;
        }
        for c in 0..self.side * self.side {
            self.start[c + 1] += self.start[c];
        }
        self.corners.clear();
        self.corners.resize(self.live, 0);
        // Filled from the back: each `end` finishes at the start of its cell.
        let mut end: Vec<u32> = self.start[1..].to_vec();
        for i in of() {
            let slot = &mut end[self.cell(points[i])];
            *slot -= 1;
            self.corners[*slot as usize] = i as u32;
        }
    }

    fn column(&self, x: f64, k: usize) -> usize {
        // Float casts saturate, so outside points fall into the outermost cells.
        (((x - self.low[k]) * self.per_unit[k]) as usize).min(self.side - 1)
    }

    fn cell(&self, p: [f64; 2]) -> usize {
        self.column(p[1], 1) * self.side + self.column(p[0], 0)
    }

    fn remove(&mut self, blocks: &mut [bool], corner: u32) {
        if std::mem::take(&mut blocks[corner as usize]) {
            self.live -= 1;
        }
    }

    /// True if most of its corners are no longer in the ring.
    fn is_stale(&self) -> bool {
        self.corners.len() > 16 && self.live < self.corners.len() / 2
    }

    /// True if `test` holds for a corner whose cell overlaps the bounding box of a triangle.
    fn any_in(&self, triangle: [[f64; 2]; 3], mut test: impl FnMut(u32) -> bool) -> bool {
        let [a, b, c] = triangle;
        let low = [0, 1].map(|k| self.column(a[k].min(b[k]).min(c[k]), k));
        let high = [0, 1].map(|k| self.column(a[k].max(b[k]).max(c[k]), k));
        (low[1]..=high[1]).any(|row| {
            let first = self.start[row * self.side + low[0]] as usize;
            let last = self.start[row * self.side + high[0] + 1] as usize;
            self.corners[first..last].iter().any(|&q| test(q))
        })
    }
}

/// Cuts the convex chain from corner `first` to corner `last` by halving, which gives better shapes than a
/// fan.
fn halve(first: u32, last: u32, out: &mut Vec<[u32; 3]>) {
    if last - first >= 2 {
        let middle = first + (last - first) / 2;
        out.push([first, middle, last]);
        halve(first, middle, out);
        halve(middle, last, out);
    }
}

fn split_quad(p: [[f64; 3]; 4]) -> [[u32; 3]; 2] {
    let even = [[0, 1, 2], [0, 2, 3]];
    let odd = [[0, 1, 3], [1, 2, 3]];
    let Some(scale) = scale_of(&p) else { return even };
    let to = |a: usize, b: usize| [0, 1, 2].map(|k| (p[b][k] - p[a][k]) * scale);
    let (d02, d13) = (to(0, 2), to(1, 3));
    let normal = cross(d02, d13);
    // Four times the product of the areas of the whole and its smaller half.
    let worst = |halves: [[u32; 3]; 2]| {
        let area = halves.map(|t| {
            let [a, b, c] = t.map(|i| i as usize);
            dot(cross(to(a, b), to(a, c)), normal)
        });
        area[0].min(area[1])
    };
    let (even_worst, odd_worst) = (worst(even), worst(odd));
    // Halves thinner than this fraction of the whole do not count as correctly wound. Guessed.
    let least = 1e-6 * dot(normal, normal);
    match (even_worst > least, odd_worst > least) {
        (true, false) => even,
        (false, true) => odd,
        // Rounding in single precision must not decide between equal diagonals.
        (true, true) if dot(d02, d02) <= dot(d13, d13) * (1.0 + 1e-6) => even,
        (true, true) => odd,
        (false, false) if odd_worst > even_worst => odd,
        (false, false) => even,
    }
}

/// Returns a power of two that scales the polygon to about size one without rounding; `None` if its size is
/// not finite.
fn scale_of(points: &[[f64; 3]]) -> Option<f64> {
    let mut size = 0f64;
    for p in points {
        for x in p {
            if !x.is_finite() {
                return None;
            }
            size = size.max(x.abs());
        }
    }
    // Beyond these sizes the scale itself would overflow.
    (1e-290..1e290).contains(&size).then(|| libm::exp2(-libm::log2(size).round()))
}

/// Returns twice the signed area of a triangle, or zero if its sign may come from rounding.
#[inline]
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let left = (b[0] - a[0]) * (c[1] - a[1]);
    let right = (b[1] - a[1]) * (c[0] - a[0]);
    let turn = left - right;
    // Three roundings each at half of 2^-52, and one for the difference.
    if turn.abs() <= 4.0 * f64::EPSILON * (left.abs() + right.abs()) { 0.0 } else { turn }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn cut(points: &[[f64; 3]]) -> Vec<[u32; 3]> {
        let mut out = vec![[9; 3]];
        Triangulator::default().triangulate(points, &mut out);
        assert_eq!(out.len(), points.len().saturating_sub(2));
        out
    }

    /// Sum of unsigned areas, and the area of the polygon.
    fn areas(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> (f64, f64) {
        let area = |t: [u32; 3]| {
            let [a, b, c] = t.map(|i| points[i as usize]);
            let to = |p: [f64; 3]| [0, 1, 2].map(|k| p[k] - a[k]);
            cross(to(b), to(c))
        };
        let sum = triangles.iter().map(|&t| dot(area(t), area(t)).sqrt() / 2.0).sum();
        let mut whole = [0.0; 3];
        for i in 1..points.len() - 1 {
            let n = area([0, i as u32, i as u32 + 1]);
            whole = [0, 1, 2].map(|k| whole[k] + n[k] / 2.0);
        }
        (sum, dot(whole, whole).sqrt())
    }

    fn assert_tiles(points: &[[f64; 3]]) {
        let triangles = cut(points);
        let (sum, whole) = areas(points, &triangles);
        assert!((sum - whole).abs() <= 1e-9 * whole, "{sum} instead of {whole}");
    }

    fn tilted(points: &[[f64; 2]]) -> Vec<[f64; 3]> {
        points.iter().map(|p| [p[0], p[1], 0.5 * p[0] - 0.25 * p[1]]).collect()
    }

    #[test]
    fn few_corners_make_no_triangle() {
        assert!(cut(&[]).is_empty());
        assert!(cut(&[[0.0; 3]; 2]).is_empty());
        assert_eq!(cut(&[[0.0; 3]; 3]), [[0, 1, 2]]);
    }

    #[test]
    fn a_concave_quad_is_cut_at_its_dent() {
        //  0 ---- 1
        //   \ 3  /      3 lies inside 0 1 2: only 1-3 does not leave the quad.
        //    \| /
        //     2
        let p = [[0.0, 2.0, 0.0], [2.0, 2.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.5, 0.0]];
        assert_eq!(cut(&p), [[0, 1, 3], [1, 2, 3]]);
        let p = [p[1], p[2], p[3], p[0]];
        assert_eq!(cut(&p), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_convex_quad_takes_the_shorter_diagonal_and_never_a_flat_half() {
        let p = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        assert_eq!(cut(&p), [[0, 1, 3], [1, 2, 3]]);
        // 1 lies between 0 and 2.
        let p = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 9.0, 0.0]];
        assert_eq!(cut(&p), [[0, 1, 3], [1, 2, 3]]);
    }

    #[test]
    fn a_rectangle_with_many_corners_on_its_sides_has_no_flat_triangle() {
        let mut p: Vec<[f64; 2]> = (0..10).map(|i| [f64::from(i), 0.0]).collect();
        p.extend((0..5).map(|i| [10.0, f64::from(i)]));
        p.extend((0..10).map(|i| [10.0 - f64::from(i), 5.0]));
        p.extend((0..5).map(|i| [0.0, 5.0 - f64::from(i)]));
        let p = tilted(&p);
        assert_tiles(&p);
        for t in cut(&p) {
            assert!(areas(&p, &[t]).0 > 1e-3);
        }
    }

    #[test]
    fn a_ring_cut_open_by_a_bridge_is_tiled() {
        // Twelve outer corners, twelve inner ones in reverse; the bridge's two ends come twice.
        let circle = |r: f64, i: f64| [r * (i * PI / 6.0).cos(), r * (i * PI / 6.0).sin()];
        let mut p: Vec<[f64; 2]> = (0..12).map(|i| circle(2.0, f64::from(i))).collect();
        p.push(p[0]);
        p.extend((0..13).map(|i| circle(0.9, f64::from(-(i % 12)))));
        for k in 0..p.len() {
            p.rotate_left(1);
            let p = tilted(&p);
            assert_eq!(cut(&p).len(), 24, "{k}");
            assert_tiles(&p);
            for t in cut(&p) {
                assert!(areas(&p, &[t]).0 > 1e-3);
            }
        }
    }

    #[test]
    fn a_comb_and_a_spiral_are_tiled() {
        let mut comb = vec![[0.0, -1.0], [100.0, -1.0]];
        for i in (0..50).rev() {
            comb.push([2.0 * f64::from(i) + 1.0, 10.0]);
            comb.push([2.0 * f64::from(i), 0.0]);
        }
        assert_tiles(&tilted(&comb));
        let arm = |r: f64, i: f64| [(r + i) * (i * 0.1).cos(), (r + i) * (i * 0.1).sin()];
        let mut spiral: Vec<[f64; 2]> = (0..400).map(|i| arm(40.0, f64::from(i))).collect();
        spiral.extend((0..400).rev().map(|i| arm(20.0, f64::from(i))));
        assert_tiles(&tilted(&spiral));
        spiral.reverse();
        assert_tiles(&tilted(&spiral));
    }

    #[test]
    fn scale_does_not_matter() {
        let star: Vec<[f64; 2]> = (0..40)
            .map(|i| {
                let (r, a) = (if i % 2 == 0 { 3.0 } else { 1.0 }, f64::from(i) * 0.157);
                [r * a.cos(), r * a.sin()]
            })
            .collect();
        let usual = cut(&tilted(&star));
        for scale in [1e-70, 1e-15, 1e15, 1e70] {
            let p: Vec<[f64; 3]> = tilted(&star).iter().map(|p| p.map(|x| x * scale)).collect();
            assert_eq!(cut(&p).len(), usual.len());
            let (sum, whole) = areas(&p, &cut(&p));
            assert!((sum / whole - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn bad_polygons_are_triangulated_too() {
        cut(&[[0.0; 3]; 7]);
        cut(&[[f64::NAN; 3]; 5]);
        cut(&[[f64::INFINITY, 0.0, 0.0]; 5]);
        let line: Vec<[f64; 3]> = (0..50).map(|i| [f64::from(i % 7), 0.0, 0.0]).collect();
        cut(&line);
        // A pentagram intersects itself; a bow tie of six corners has no plane.
        let star: Vec<[f64; 2]> =
            (0..5).map(|i| [(f64::from(i) * 2.5133).cos(), (f64::from(i) * 2.5133).sin()]).collect();
        cut(&tilted(&star));
        let tie = [[0.0, 0.0], [1.0, 1.0], [2.0, 0.0], [2.0, 2.0], [1.0, 1.0], [0.0, 2.0]];
        cut(&tilted(&tie));
        let zigzag: Vec<[f64; 3]> =
            (0..3000).map(|i| [f64::from(i * 7919 % 3001), f64::from(i * 104_729 % 2999), 0.0]).collect();
        cut(&zigzag);
    }

    #[test]
    fn a_huge_star_is_quick() {
        let n = 60_000;
        let star: Vec<[f64; 2]> = (0..n)
            .map(|i| {
                let (r, a) =
                    (if i % 2 == 0 { 3.0 } else { 2.0 }, f64::from(i) * std::f64::consts::TAU / f64::from(n));
                [r * a.cos(), r * a.sin()]
            })
            .collect();
        assert_tiles(&tilted(&star));
    }
}
