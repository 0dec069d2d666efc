//! Where the vertex of a cell goes: the least squared distance to the planes of its faces, and to its borders.

use glam::{DMat3, DVec3, UVec3, Vec3A, Vec3Swizzles, Vec4};

use super::model::{Model, Place};
use super::pieces;
use super::search::Clusters;

/// A vertex: its place in its cell, in edges of the cell, and the bits of the cell's number. One load of four.
#[derive(Clone, Copy, Default)]
struct Corner(Vec4);

impl Corner {
    fn new(place: DVec3, cluster: u32) -> Self {
        Self(place.as_vec3().extend(f32::from_bits(cluster)))
    }
    #[inline(always)]
    fn cluster(self) -> u32 {
        self.0.w.to_bits()
    }
    /// With nothing in the fourth lane: small whole numbers are floats that processors are slow with.
    #[inline(always)]
    fn place(self) -> Vec3A {
        Vec3A::from_vec4(self.0.with_w(0.0))
    }
}

/// Sums over the faces with a corner in a cell, in edges of the cell and from its least corner; four numbers side by side,
/// for the processor's sake. [Lindstrom 2000]
#[derive(Clone, Copy, Default)]
struct Sum {
    /// Squared distance to the planes, times doubled areas: x'Ax - 2b'x + c. Of A xx, yy, zz; and those areas.
    squares: Vec4,
    /// Of A xz, xy, yz; and c.
    products: Vec4,
    b: Vec3A,
    /// Corners in the cell, times doubled areas.
    corners: Vec3A,
    /// Directions and moments of the edges round the faces. Where two faces share an edge they cancel, so what is left
    /// belongs to open borders. [Lindstrom-Silva 2001]
    direction: Vec3A,
    moment: Vec3A,
}

/// Faces whose corners are fetched together: memory then answers many at once.
const AHEAD: usize = 32;
/// What borders count beside planes. (Measured: on terrain and on open scans 1 to 10 are alike.)
const BORDER: f64 = 3.0;
/// Directions in which the planes say less than this share of their sum are left at the mean. ([Lindstrom 2000] cuts
/// singular values off at this share; a gradual end is as good, as measured, and needs no eigenvectors.)
const LEAST: f64 = 1e-3;

/// Positions of the cells' vertices in user units, and the squared distance to the planes in the mean.
pub(super) struct Placed<P> {
    pub(super) points: Vec<P>,
    pub(super) mean_square: f64,
}

/// Places a vertex in each cluster; `borders` is what they count, times what they count by default. None leaves its cell. Cost: O(V + F).
pub(super) fn place<P: Place>(model: &Model<'_, P>, clusters: &Clusters, borders: f64) -> Placed<P> {
    let Clusters { grid, of, cells, .. } = clusters;
    let cell = |k: u32| UVec3::from(cells[k as usize]).as_dvec3();
    let mut corners = vec![Corner::default(); of.len()];
    pieces::fill(&mut corners, |start, piece| {
        for ((corner, p), &cluster) in piece.iter_mut().zip(&model.points[start..]).zip(&of[start..]) {
            *corner = Corner::new(grid.place(p.wide()) - cell(cluster), cluster);
        }
    });
    let sums = sums(model, &corners, of, cells);
    drop(corners);
    let placed = pieces::map(sums.len(), |range| {
        let (mut points, mut cost, mut weight) = (Vec::with_capacity(range.len()), 0.0, 0.0);
        for k in range {
            let (x, c) = sums[k].solve(borders);
            (cost, weight) = (cost + c, weight + f64::from(sums[k].squares.w));
            points.push(P::of(grid.user(cell(k as u32) + x)));
        }
        (points, cost, weight)
    });
    let (mut points, mut cost, mut weight) = (Vec::with_capacity(sums.len()), 0.0, 0.0);
    for (part, c, w) in placed {
        points.extend(part);
        (cost, weight) = (cost + c, weight + w);
    }
    let mean_square = if weight > 0.0 { cost / weight * grid.cell * grid.cell } else { 0.0 };
    Placed { points, mean_square }
}

fn sums<P: Place>(model: &Model<'_, P>, corners: &[Corner], of: &[u32], cells: &[[u32; 3]]) -> Vec<Sum> {
    let mut sums = vec![Sum::default(); cells.len()];
    let shares = pieces::shares(model.faces.len());
    if shares == 1 {
        let mut ready = [[Corner::default(); 3]; AHEAD];
        for batch in model.faces.chunks(AHEAD) {
            for (ready, t) in ready.iter_mut().zip(batch) {
                *ready = t.map(|v| corners[v.index()]);
            }
            ready[..batch.len()].iter().for_each(|t| add(&mut sums, 0, cells, t));
        }
        return sums;
    }
    // Each share has the faces with a corner in its cells, in their order, so every sum has one order of its own.
    let (shift, shares) = pieces::split(cells.len(), shares);
    let lists: Vec<Vec<Vec<u32>>> = pieces::map(model.faces.len(), |range| {
        let mut lists = vec![Vec::new(); shares];
        for f in range {
            let [a, b, c] = model.faces[f].map(|v| of[v.index()] as usize >> shift);
            lists[a].push(f as u32);
            if b != a {
                lists[b].push(f as u32);
            }
            if c != a && c != b {
                lists[c].push(f as u32);
            }
        }
        lists
    });
    pieces::shared(&mut sums, 1 << shift, |k, own| {
        let mut ready = [[Corner::default(); 3]; AHEAD];
        for batch in lists.iter().flat_map(|list| list[k].chunks(AHEAD)) {
            for (ready, &f) in ready.iter_mut().zip(batch) {
                *ready = model.faces[f as usize].map(|v| corners[v.index()]);
            }
            ready[..batch.len()].iter().for_each(|t| add(own, (k << shift) as u32, cells, t));
        }
    });
    sums
}

/// Adds a face to those of its cells that `sums` holds, from cell `first` on.
#[inline(always)]
fn add(sums: &mut [Sum], first: u32, cells: &[[u32; 3]], &[a, b, c]: &[Corner; 3]) {
    let slot = |x: Corner| x.cluster().wrapping_sub(first) as usize;
    let is_inside = a.cluster() == b.cluster() && b.cluster() == c.cluster();
    let at = a.place();
    let (mut u, mut v) = (b.place() - at, c.place() - at);
    if !is_inside {
        let [a, b, c] = [a, b, c].map(|x| UVec3::from(cells[x.cluster() as usize]).as_ivec3());
        (u, v) = (u + (b - a).as_vec3a(), v + (c - a).as_vec3a());
    }
    let normal = u.cross(v);
    let doubled = normal.length();
    let unit = normal * (1.0 / doubled.max(f32::MIN_POSITIVE));
    let planes = Planes {
        squares: (normal * unit).extend(doubled),
        // zx, xy, yz.
        products: normal * unit.zxy(),
        normal,
        unit,
    };
    if is_inside {
        if let Some(sum) = sums.get_mut(slot(a)) {
            sum.add(&planes, 3.0, at);
            sum.corners += (3.0 * at + u + v) * doubled;
            sum.moment += 2.0 * normal;
        }
        return;
    }
    // Corner by corner, whether two share a cell or not: which it is, no processor could guess.
    for (x, next, after) in [(a, u, v), (b, v - u, -u), (c, -v, u - v)] {
        if let Some(sum) = sums.get_mut(slot(x)) {
            let at = x.place();
            sum.add(&planes, 1.0, at);
            sum.corners += at * doubled;
            // The two edges that end here: out to the next corner, and in from the one after.
            sum.direction += next - after;
            sum.moment += normal - (at + next).cross(at + after);
        }
    }
}

/// What a face adds to the sums of its cells, but for where it lies in them.
struct Planes {
    squares: Vec4,
    products: Vec3A,
    normal: Vec3A,
    unit: Vec3A,
}

impl Sum {
    /// Adds a plane through a place, for so many corners. (No lane is written alone: a load of four after that would wait.)
    #[inline(always)]
    fn add(&mut self, planes: &Planes, corners: f32, at: Vec3A) {
        let distance = planes.unit.dot(at);
        self.squares += planes.squares * corners;
        self.products += planes.products.extend(planes.squares.w * distance * distance) * corners;
        self.b += planes.normal * (distance * corners);
    }
    /// The place in the cell, and what it costs.
    fn solve(&self, borders: f64) -> (DVec3, f64) {
        let [xx, yy, zz, weight] = self.squares.as_dvec4().to_array();
        if weight <= 0.0 {
            return (DVec3::splat(0.5), 0.0);
        }
        let [xz, xy, yz, c] = self.products.as_dvec4().to_array();
        let planes = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let three = |v: Vec3A| v.as_dvec3();
        let (b, direction, moment) = (three(self.b), three(self.direction), three(self.moment));
        let mean = (three(self.corners) / weight).clamp(DVec3::ZERO, DVec3::ONE);
        let length = direction.length();
        let (mut a, mut rest) = (planes, b);
        if length > 0.0 {
            let share = BORDER * borders / length;
            let outer =
                DMat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z);
            a += (DMat3::from_diagonal(DVec3::splat(length * length)) - outer) * share;
            rest += direction.cross(moment) * share;
        }
        let trace = a.x_axis.x + a.y_axis.y + a.z_axis.z;
        let damped = a + DMat3::from_diagonal(DVec3::splat(LEAST * trace));
        let step = damped.inverse() * (rest - a * mean);
        let x = if step.is_finite() { mean + step } else { mean }.clamp(DVec3::ZERO, DVec3::ONE);
        let cost = x.dot(planes * x) - 2.0 * b.dot(x) + c;
        (x, cost.max(0.0))
    }
}
