//! Shapes with known counts, for tests and demonstrations.
//!
//! All are in single precision without attributes (except [`level`]), about one unit in size, and the same at
//! every call. Closed ones face outward.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use crate::ids::{VertexId, WedgeId};
use crate::mesh::{Positions, TriMesh};
use crate::sampling::Random;

/// Returns every shape at a small size, with its name; for contract tests.
pub fn all() -> Vec<(&'static str, TriMesh)> {
    vec![
        ("tetrahedron", tetrahedron()),
        ("cube", cube(1)),
        ("fine_cube", cube(6)),
        ("icosahedron", icosphere(0)),
        ("icosphere", icosphere(3)),
        ("noisy_sphere", noisy_sphere(3, 0.02, 1)),
        ("blob", blob(4, 1)),
        ("torus", torus(24, 12)),
        ("cylinder", cylinder(24, 6)),
        ("single_triangle", grid(0)),
        ("grid", grid(10)),
        ("wavy_sheet", wavy_sheet(16)),
        ("grid_with_holes", grid_with_holes(12)),
        ("mobius_strip", mobius_strip(24)),
        ("hourglass", hourglass()),
        ("bow_tie", bow_tie()),
        ("three_on_an_edge", book(3)),
        ("four_on_an_edge", book(4)),
        ("doubled_sheet", doubled_sheet(4)),
        ("two_far_parts", two_far_parts()),
        ("many_tetrahedra", tetrahedra(27)),
        ("soup", soup(40, 1)),
    ]
}

/// A tetrahedron: 4 vertices, 4 faces.
pub fn tetrahedron() -> TriMesh {
    let s = 0.5;
    let p = vec![[s, s, s], [s, -s, -s], [-s, s, -s], [-s, -s, s]];
    mesh(p, vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
}

/// The unit cube, each side `n` by `n` squares: 6 n² + 2 vertices, 12 n² faces.
///
/// # Panics
/// If `n` is zero.
pub fn cube(n: u32) -> TriMesh {
    assert!(n > 0, "a cube needs at least one square on each side");
    let mut numbers = HashMap::new();
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    // Each side as its axis, and whether it is at the far end.
    for (axis, far) in [(0, false), (0, true), (1, false), (1, true), (2, false), (2, true)] {
        let mut at = |i: u32, j: u32| {
            let mut place = [0; 3];
            place[axis] = if far { n } else { 0 };
            // Swapped so that each side faces outward.
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            (place[u], place[v]) = if far { (i, j) } else { (j, i) };
            *numbers.entry(place).or_insert_with(|| {
                points.push(place.map(|x| f64::from(x) / f64::from(n) - 0.5));
                points.len() as u32 - 1
            })
        };
        for j in 0..n {
            for i in 0..n {
                let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    mesh(points, triangles)
}

/// A sphere of radius one: an icosahedron whose faces were subdivided `n` times: 10·4ⁿ + 2 vertices, 20·4ⁿ
/// faces.
pub fn icosphere(n: u32) -> TriMesh {
    let (points, triangles) = icosphere_parts(n);
    mesh(points, triangles)
}

/// An [`icosphere`] whose vertices were moved along their normals by up to `noise`, uniformly.
pub fn noisy_sphere(n: u32, noise: f64, seed: u64) -> TriMesh {
    let (mut points, triangles) = icosphere_parts(n);
    let mut random = Random::new(seed);
    for p in &mut points {
        let r = 1.0 + noise * (2.0 * random.unit() - 1.0);
        *p = p.map(|x| x * r);
    }
    mesh(points, triangles)
}

/// A smooth lump like a scanned animal: an [`icosphere`] with seeded bumps of several sizes, and two ears.
pub fn blob(n: u32, seed: u64) -> TriMesh {
    let (mut points, triangles) = icosphere_parts(n);
    let mut random = Random::new(seed);
    let mut direction = || loop {
        let d = [0; 3].map(|_| 2.0 * random.unit() - 1.0);
        let length = dot(d, d).sqrt();
        if length > 0.1 && length < 1.0 {
            break d.map(|x| x / length);
        }
    };
    // Waves along random directions, each with half the amplitude and twice the frequency of the previous
    // one.
    let waves: Vec<([f64; 3], f64, f64)> = (0..12)
        .map(|i| {
            let octave = f64::from(1u32 << (i / 3));
            (direction(), 0.06 / octave, 3.0 * octave)
        })
        .collect();
    let ears = [[0.35, 0.2, 0.92], [-0.35, 0.2, 0.92]];
    for p in &mut points {
        let mut r = 1.0;
        for (along, height, speed) in &waves {
            r += height * libm::sin(speed * dot(*p, *along));
        }
        for ear in ears {
            let d = [0, 1, 2].map(|k| p[k] - ear[k]);
            r += 0.9 * libm::exp(-dot(d, d) / 0.03);
        }
        *p = p.map(|x| x * r);
    }
    mesh(points, triangles)
}

/// A torus of radii 1 and 0.4, with `m` steps around the ring and `n` around the tube: m·n vertices, 2·m·n
/// faces.
///
/// # Panics
/// If `m` or `n` is below three.
pub fn torus(m: u32, n: u32) -> TriMesh {
    assert!(m >= 3 && n >= 3, "a torus needs at least three steps in each direction");
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..m {
        for j in 0..n {
            let (a, b) = (TAU * f64::from(i) / f64::from(m), TAU * f64::from(j) / f64::from(n));
            let r = 1.0 + 0.4 * libm::cos(b);
            points.push([r * libm::cos(a), r * libm::sin(a), 0.4 * libm::sin(b)]);
            let at = |i: u32, j: u32| (i % m) * n + j % n;
            let (p, q, r, s) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            triangles.extend([[p, q, r], [p, r, s]]);
        }
    }
    mesh(points, triangles)
}

/// An open tube of radius 0.5 and height one, with `around` steps around and `up` steps high: around·(up + 1)
/// vertices, 2·around·up faces, two border loops.
///
/// # Panics
/// If `around` is below three or `up` is zero.
pub fn cylinder(around: u32, up: u32) -> TriMesh {
    assert!(around >= 3 && up > 0, "a tube needs at least three steps around and one up");
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for j in 0..=up {
        for i in 0..around {
            let a = TAU * f64::from(i) / f64::from(around);
            points.push([0.5 * libm::cos(a), 0.5 * libm::sin(a), f64::from(j) / f64::from(up) - 0.5]);
            if j < up {
                let at = |i: u32, j: u32| j * around + i % around;
                let (p, q, r, s) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                triangles.extend([[p, q, r], [p, r, s]]);
            }
        }
    }
    mesh(points, triangles)
}

/// The flat unit square, `n` by `n` squares: (n + 1)² vertices, 2 n² faces, 4 n border edges. A single triangle if `n`
/// is zero.
pub fn grid(n: u32) -> TriMesh {
    if n == 0 {
        return mesh(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]);
    }
    let (points, triangles) = grid_parts(n, |_, _| true);
    mesh(points, triangles)
}

/// A [`grid`] with waves of height 0.1.
///
/// # Panics
/// If `n` is zero.
pub fn wavy_sheet(n: u32) -> TriMesh {
    let (mut points, triangles) = grid_parts(n, |_, _| true);
    for p in &mut points {
        p[2] = 0.1 * libm::sin(7.0 * p[0]) * libm::cos(5.0 * p[1]);
    }
    mesh(points, triangles)
}

/// A [`grid`] of `n` by `n` squares without two blocks of (n / 4)² squares: three border loops, and vertices inside
/// the holes that no face uses.
///
/// # Panics
/// If `n` is below eight.
pub fn grid_with_holes(n: u32) -> TriMesh {
    assert!(n >= 8, "two holes need at least eight squares");
    let hole = n / 4;
    let is_in = |x: u32, from: u32| (from..from + hole).contains(&x);
    let (points, triangles) = grid_parts(n, |i, j| {
        let first = is_in(i, 1) && is_in(j, 1);
        let second = is_in(i, n - hole - 1) && is_in(j, n - hole - 1);
        !first && !second
    });
    mesh(points, triangles)
}

/// A strip with one half twist, `n` squares long and one wide: 2 n vertices, 2 n faces, 2 n border edges in one loop,
/// one misoriented edge, not orientable.
///
/// # Panics
/// If `n` is below three.
pub fn mobius_strip(n: u32) -> TriMesh {
    assert!(n >= 3, "a strip needs at least three squares");
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..n {
        let a = TAU * f64::from(i) / f64::from(n);
        for side in [-0.3, 0.3] {
            let r = 1.0 + side * libm::cos(a / 2.0);
            points.push([r * libm::cos(a), r * libm::sin(a), side * libm::sin(a / 2.0)]);
        }
        let (p, q) = (2 * i, 2 * i + 1);
        let (r, s) = if i + 1 < n { (p + 2, q + 2) } else { (1, 0) };
        triangles.extend([[p, r, s], [p, s, q]]);
    }
    mesh(points, triangles)
}

/// Two tetrahedra that touch in a vertex: 7 vertices, 8 faces, closed, one pinched vertex.
pub fn hourglass() -> TriMesh {
    let p = vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 1.0],
        [-0.5, 0.8, 1.0],
        [-0.5, -0.8, 1.0],
        [1.0, 0.0, -1.0],
        [-0.5, 0.8, -1.0],
        [-0.5, -0.8, -1.0],
    ];
    let t = vec![[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3], [0, 4, 5], [0, 5, 6], [0, 6, 4], [4, 6, 5]];
    mesh(p, t)
}

/// Two triangles that touch in a vertex: 5 vertices, 2 faces, one pinched vertex.
pub fn bow_tie() -> TriMesh {
    let p = vec![[0.0, 0.0, 0.0], [1.0, -0.5, 0.0], [1.0, 0.5, 0.0], [-1.0, 0.5, 0.0], [-1.0, -0.5, 0.0]];
    mesh(p, vec![[0, 1, 2], [0, 3, 4]])
}

/// A number of triangles (`pages`) on one shared edge: pages + 2 vertices.
pub fn book(pages: u32) -> TriMesh {
    let mut points = vec![[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let mut triangles = Vec::new();
    for i in 0..pages {
        let a = PI * f64::from(i) / f64::from(pages);
        points.push([libm::cos(a), libm::sin(a), 0.5]);
        triangles.push([0, 1, i + 2]);
    }
    mesh(points, triangles)
}

/// A [`grid`] with each face duplicated in reverse: (n + 1)² vertices, 4 n² faces, half of them duplicates.
///
/// # Panics
/// If `n` is zero.
pub fn doubled_sheet(n: u32) -> TriMesh {
    let (points, mut triangles) = grid_parts(n, |_, _| true);
    let backs: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    triangles.extend(backs);
    mesh(points, triangles)
}

/// A [`cube`] of 12 by 12 squares a side, with four bent fins on its upper side that share vertices with it. The backs
/// of the fins are the last faces; except at their feet they have vertices of their own. 866 + 288 vertices and 1,728 +
/// 512 faces; with backs 288 and 512 more.
pub fn box_with_fins(has_backs: bool) -> TriMesh {
    const SQUARES: u32 = 12;
    const ROWS: u32 = 8;
    let cube = cube(SQUARES);
    let mut points: Vec<[f64; 3]> = cube.positions().view().iter().collect();
    let mut triangles: Vec<[u32; 3]> = cube.triangles().iter().map(|t| t.map(|w| w.0)).collect();
    // Vertices of the upper side, by their column and row.
    let place = |p: &[f64; 3]| p.map(|x| libm::round((x + 0.5) * f64::from(SQUARES)) as u32);
    let upper: HashMap<[u32; 3], u32> = (0..).zip(&points).map(|(v, p)| (place(p), v)).collect();
    for is_back in [false, true].into_iter().filter(|is_back| has_backs || !is_back) {
        for fin in 0..4 {
            let foot: Vec<u32> = (2..SQUARES - 1).map(|i| upper[&[i, 3 * fin + 1, SQUARES]]).collect();
            let mut below = foot.clone();
            for row in 1..=ROWS {
                let height = f64::from(row) / f64::from(ROWS);
                let first = points.len() as u32;
                for v in &foot {
                    let [x, y, z] = points[*v as usize];
                    points.push([x, y + 0.15 * height * height, z + height]);
                }
                let above: Vec<u32> = (first..points.len() as u32).collect();
                for i in 1..foot.len() {
                    let [a, b, c, d] = [below[i - 1], below[i], above[i], above[i - 1]];
                    let two = [[a, b, c], [a, c, d]];
                    triangles.extend(two.map(|t| if is_back { [t[0], t[2], t[1]] } else { t }));
                }
                below = above;
            }
        }
    }
    mesh(points, triangles)
}

/// Two small spheres a thousand units apart: 84 vertices, 160 faces.
pub fn two_far_parts() -> TriMesh {
    let (mut points, mut triangles) = icosphere_parts(1);
    let count = points.len() as u32;
    let far: Vec<[f64; 3]> = points.iter().map(|p| [p[0] + 1000.0, p[1], p[2]]).collect();
    points.extend(far);
    let second: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|i| i + count)).collect();
    triangles.extend(second);
    mesh(points, triangles)
}

/// A number of separate tetrahedra (`count`) in a cubic pattern: 4 vertices and 4 faces each.
pub fn tetrahedra(count: u32) -> TriMesh {
    let one = tetrahedron();
    let side = (1..).find(|s| s * s * s >= count).unwrap_or(1);
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..count {
        let at = [i % side, i / side % side, i / side / side].map(|x| 2.0 * f64::from(x));
        points.extend(one.positions().view().iter().map(|p| [0, 1, 2].map(|k| p[k] + at[k])));
        triangles.extend(one.triangles().iter().map(|t| t.map(|w| w.0 + 4 * i)));
    }
    mesh(points, triangles)
}

/// A number of random triangles (`count`) that share nothing, in the unit cube: 3 vertices each.
pub fn soup(count: u32, seed: u64) -> TriMesh {
    let mut random = Random::new(seed);
    let mut points = Vec::new();
    for _ in 0..count {
        let middle = [0; 3].map(|_| random.unit());
        points.extend([0; 3].map(|_| middle.map(|x| x + 0.2 * (random.unit() - 0.5))));
    }
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    mesh(points, triangles)
}

/// A small game level: a [`wavy_sheet`] of `n` by `n` squares with `boxes` closed boxes on it, each 0.4 to
/// 2.4 % as wide as the sheet. All have texture coordinates; each of the six sides of a box has its own
/// chart, so that every edge between two sides is a seam. (n + 1)² + 8 `boxes` vertices, 2 n² + 12 `boxes`
/// faces.
///
/// # Panics
/// If `n` is zero.
pub fn level(n: u32, boxes: u32) -> TriMesh {
    const SIDES: [[u32; 4]; 6] =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let (mut points, triangles) = grid_parts(n, |_, _| true);
    let mut uvs: Vec<[f32; 2]> = points.iter().map(|p| [p[0] as f32, p[1] as f32]).collect();
    let height = |x: f64, y: f64| 0.1 * libm::sin(7.0 * x) * libm::cos(5.0 * y);
    points.iter_mut().for_each(|p| p[2] = height(p[0], p[1]));
    let mut vertex_of: Vec<VertexId> = (0..points.len()).map(VertexId::new).collect();
    let mut triangles: Vec<[WedgeId; 3]> = triangles.into_iter().map(|t| t.map(WedgeId)).collect();
    let mut random = Random::new(7);
    for _ in 0..boxes {
        let (x, y) = (random.unit(), random.unit());
        let size = 0.004 + 0.02 * random.unit().powi(2);
        let first = points.len() as u32;
        points.extend((0..8u32).map(|i| {
            let at = |axis: u32| size * (f64::from(i >> axis & 1) - 0.5);
            [x + at(0), y + at(1), height(x, y) + at(2) + 0.5 * size]
        }));
        for (side, corners) in SIDES.into_iter().enumerate() {
            let w = vertex_of.len() as u32;
            vertex_of.extend(corners.map(|c| VertexId(first + c)));
            let (u, v) = ((side % 3) as f32 / 3.0, (side / 3) as f32 / 2.0);
            uvs.extend([[u, v], [u + 0.3, v], [u + 0.3, v + 0.45], [u, v + 0.45]]);
            triangles.extend([[w, w + 1, w + 2], [w, w + 2, w + 3]].map(|t| t.map(WedgeId)));
        }
    }
    let positions = Positions::F32(points.iter().map(|p| p.map(|x| x as f32)).collect());
    let mut mesh = TriMesh::with_wedges(positions, vertex_of, triangles).expect("all wedges have a vertex");
    mesh.set_uvs(Some(uvs)).expect("as many as wedges");
    mesh
}

fn mesh(points: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> TriMesh {
    let positions = Positions::F32(points.iter().map(|p| p.map(|x| x as f32)).collect());
    let triangles = triangles.into_iter().map(|t| t.map(VertexId)).collect();
    TriMesh::new(positions, triangles).expect("shapes use existing vertices")
}

type Parts = (Vec<[f64; 3]>, Vec<[u32; 3]>);

fn grid_parts(n: u32, stays: impl Fn(u32, u32) -> bool) -> Parts {
    assert!(n > 0, "a sheet needs at least one square on each side");
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            points.push([f64::from(i) / f64::from(n), f64::from(j) / f64::from(n), 0.0]);
            if i < n && j < n && stays(i, j) {
                let a = j * (n + 1) + i;
                triangles.extend([[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]);
            }
        }
    }
    (points, triangles)
}

fn icosphere_parts(n: u32) -> Parts {
    // Corners of three golden rectangles.
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points = Vec::new();
    for [a, b] in [[1.0, g], [-1.0, g], [1.0, -g], [-1.0, -g]] {
        points.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    }
    // Three vertices at the smallest distance, two, make a face; the normal decides the winding.
    let is_edge = |a: [f64; 3], b: [f64; 3]| {
        let d = [0, 1, 2].map(|k| a[k] - b[k]);
        (dot(d, d) - 4.0).abs() < 1e-9
    };
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|i: usize| points[i]);
                if is_edge(p, q) && is_edge(q, r) && is_edge(r, p) {
                    let n = [q[1] * r[2] - q[2] * r[1], q[2] * r[0] - q[0] * r[2], q[0] * r[1] - q[1] * r[0]];
                    let (b, c) = if dot(p, n) > 0.0 { (b, c) } else { (c, b) };
                    triangles.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    for _ in 0..n {
        let mut middles = HashMap::new();
        let mut finer = Vec::with_capacity(triangles.len() * 4);
        for [a, b, c] in triangles {
            let mut middle = |i: u32, j: u32| {
                *middles.entry([i.min(j), i.max(j)]).or_insert_with(|| {
                    let (p, q) = (points[i as usize], points[j as usize]);
                    points.push([0, 1, 2].map(|k| (p[k] + q[k]) / 2.0));
                    points.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
        for p in &mut points {
            *p = on_sphere(*p);
        }
    }
    (points.into_iter().map(on_sphere).collect(), triangles)
}

fn on_sphere(p: [f64; 3]) -> [f64; 3] {
    let length = dot(p, p).sqrt();
    p.map(|x| x / length)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::{Topology, TopologyCounts, size_of};

    fn counts(mesh: &TriMesh) -> TopologyCounts {
        let topology = Topology::new(&mesh.surface());
        topology.check();
        topology.counts()
    }

    /// Vertices, faces, Euler number, border loops, genus.
    fn summary(mesh: &TriMesh) -> (usize, usize, i64, usize, Option<u64>) {
        let c = counts(mesh);
        (c.vertex_count, c.face_count, c.euler(), c.border_loop_count, c.genus())
    }

    #[test]
    fn counts_are_as_documented() {
        assert_eq!(summary(&tetrahedron()), (4, 4, 2, 0, Some(0)));
        assert_eq!(summary(&cube(1)), (8, 12, 2, 0, Some(0)));
        assert_eq!(summary(&cube(6)), (218, 432, 2, 0, Some(0)));
        assert_eq!(summary(&icosphere(0)), (12, 20, 2, 0, Some(0)));
        assert_eq!(summary(&icosphere(3)), (642, 1280, 2, 0, Some(0)));
        assert_eq!(summary(&torus(24, 12)), (288, 576, 0, 0, Some(1)));
        assert_eq!(summary(&cylinder(24, 6)), (168, 288, 0, 2, Some(0)));
        assert_eq!(summary(&grid(10)), (121, 200, 1, 1, Some(0)));
        assert_eq!(summary(&wavy_sheet(16)), (289, 512, 1, 1, Some(0)));
        assert_eq!(summary(&grid_with_holes(12)), (161, 252, -1, 3, Some(0)));
        assert_eq!(summary(&mobius_strip(24)), (48, 48, 0, 1, None));
        assert_eq!(summary(&hourglass()), (7, 8, 3, 0, None));
        assert_eq!(summary(&two_far_parts()), (84, 160, 4, 0, Some(0)));
        assert_eq!(summary(&tetrahedra(1000)), (4000, 4000, 2000, 0, Some(0)));
        assert_eq!(summary(&soup(40, 1)), (120, 40, 40, 40, Some(0)));
    }

    #[test]
    fn defects_are_as_documented() {
        let c = counts(&hourglass());
        assert_eq!((c.pinched_vertex_count, c.non_manifold_vertex_count, c.is_closed()), (1, 1, true));
        assert!(c.is_oriented() && !c.is_manifold());
        let c = counts(&bow_tie());
        assert_eq!((c.pinched_vertex_count, c.component_count, c.border_loop_count), (1, 1, 1));
        for pages in [3, 4] {
            let c = counts(&book(pages));
            assert_eq!((c.non_manifold_edge_count, c.border_edge_count), (1, 2 * pages as usize));
            // Its ends have several fans, but no vertex is pinched.
            assert_eq!((c.non_manifold_vertex_count, c.pinched_vertex_count), (2, 0));
        }
        let c = counts(&mobius_strip(24));
        assert_eq!((c.misoriented_edge_count, c.border_edge_count, c.is_orientable), (1, 48, false));
        let c = counts(&doubled_sheet(4));
        assert_eq!((c.border_edge_count, c.non_manifold_edge_count), (0, 40));
    }

    #[test]
    fn closed_shapes_face_outward() {
        for (name, mesh) in all() {
            let c = counts(&mesh);
            if c.is_closed() {
                assert!(c.is_oriented(), "{name}");
                assert!(size_of(&mesh.surface()).volume > 0.0, "{name}");
            }
        }
        let size = size_of(&cube(3).surface());
        assert!((size.area - 6.0).abs() < 1e-6 && (size.volume - 1.0).abs() < 1e-6);
        let size = size_of(&torus(200, 100).surface());
        assert!((size.volume / (2.0 * PI * PI * 0.16) - 1.0).abs() < 2e-3);
    }

    #[test]
    fn shapes_are_the_same_at_every_call() {
        assert_eq!(all(), all());
        assert_ne!(noisy_sphere(2, 0.1, 1), noisy_sphere(2, 0.1, 2));
    }
}
