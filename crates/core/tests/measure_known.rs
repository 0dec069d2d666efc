//! Comparisons whose true distances are known.

use glam::DVec3;
use lodsmith_core::measure::{
    CompareOptions, Comparison, MeasureError, Prepared, compare, compare_prepared, compare_until,
    rms_prepared_until, vertex_distances,
};
use lodsmith_core::{PositionsView, Surface, VertexId};

#[derive(Clone)]
struct Mesh {
    positions: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn surface(&self) -> Surface<'_> {
        let triangles: &[[VertexId; 3]] = bytemuck::cast_slice(&self.triangles);
        Surface::new(PositionsView::F64(&self.positions), triangles).unwrap()
    }
    fn map(mut self, f: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        self.positions.iter_mut().for_each(|p| *p = f(*p));
        self
    }
}

/// A square of n × n cells, two triangles each, in the plane z = 0, from 0 to 1.
fn plane(n: u32) -> Mesh {
    let at = |i: u32| f64::from(i) / f64::from(n);
    let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| [at(i), at(j), 0.0])).collect();
    let cell = |k: u32| {
        let a = k / n * (n + 1) + k % n;
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    };
    Mesh { positions, triangles: (0..n * n).flat_map(cell).collect() }
}

/// A sphere of radius 1: an octahedron whose faces are n × n triangles, projected to the sphere.
fn sphere(n: u32) -> Mesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for octant in 0..8u32 {
        let sign = [0, 1, 2].map(|k| if octant >> k & 1 == 0 { 1.0 } else { -1.0 });
        let is_mirrored = sign.iter().product::<f64>() < 0.0;
        let first = positions.len() as u32;
        let row = |j: u32| first + j * (2 * n + 3 - j) / 2;
        for j in 0..=n {
            for i in 0..=n - j {
                let p = [f64::from(i), f64::from(j), f64::from(n - i - j)];
                let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
                positions.push([0, 1, 2].map(|k| sign[k] * p[k] / length));
                let (a, b) = (row(j) + i, row(j + 1) + i);
                let mut push =
                    |[x, y, z]: [u32; 3]| triangles.push(if is_mirrored { [x, z, y] } else { [x, y, z] });
                if i + j < n {
                    push([a, a + 1, b]);
                }
                if i + j + 1 < n {
                    push([a + 1, b + 1, b]);
                }
            }
        }
    }
    Mesh { positions, triangles }
}

/// A sphere with bumps, so that coordinates are not round numbers.
fn bumpy(n: u32) -> Mesh {
    sphere(n).map(|[x, y, z]| {
        let r = 1.0 + 0.1 * (5.0 * x + 1.0).sin() * (4.0 * y).cos() * (3.0 * z + 0.5).cos();
        [r * x, r * y, r * z]
    })
}

fn options(samples: usize, seed: u64) -> CompareOptions {
    let mut options = CompareOptions::default();
    (options.samples, options.seed) = (samples, seed);
    options
}

fn measure(reference: &Mesh, candidate: &Mesh) -> Comparison {
    compare(&reference.surface(), &candidate.surface(), &options(20_000, 0)).unwrap()
}

/// The lengths and the angles of a comparison.
fn figures(c: &Comparison) -> ([f64; 13], [f64; 2]) {
    let [h, m, r, p] = [c.hausdorff, c.mean, c.rms, c.p99].map(|t| [t.forward, t.backward, t.symmetric]);
    let lengths = [h[0], h[1], h[2], m[0], m[1], m[2], r[0], r[1], r[2], p[0], p[1], p[2], c.diagonal];
    (lengths, [c.normal_mean_deg, c.normal_p95_deg])
}

fn assert_near(got: f64, wanted: f64, part: f64) {
    assert!((got - wanted).abs() <= part * wanted.abs(), "{got} should be {wanted} to {part}");
}

fn assert_same_but_for_scale(a: &Comparison, b: &Comparison, scale: f64, part: f64) {
    let ((a, a_deg), (b, b_deg)) = (figures(a), figures(b));
    for (a, b) in a.iter().zip(&b) {
        assert_near(*b, a * scale, part);
    }
    for (a, b) in a_deg.iter().zip(&b_deg) {
        assert_near(*b, *a, part);
    }
}

#[test]
fn the_distance_of_concentric_spheres_is_the_difference_of_radii() {
    let (small, large) = (sphere(40), sphere(40).map(|p| p.map(|x| 1.1 * x)));
    let c = measure(&small, &large);
    // Facets of 1/40 of a quarter turn deviate by less than 3e-4 of the radius.
    for t in [c.hausdorff, c.mean, c.rms, c.p99] {
        for d in [t.forward, t.backward, t.symmetric] {
            assert!((d - 0.1).abs() < 1.2e-3, "{c:?}");
        }
    }
    assert_near(c.diagonal, 12f64.sqrt(), 1e-12);
    assert!(c.normal_mean_deg < 1.0, "{c:?}");
    assert_eq!((c.samples, c.seed), (20_000, 0));
}

#[test]
fn a_shifted_plane_lies_the_shift_away() {
    let c = measure(&plane(7), &plane(5).map(|[x, y, z]| [x, y, z - 0.25]));
    for t in [c.hausdorff, c.mean, c.rms, c.p99] {
        assert_eq!((t.forward, t.backward), (0.25, 0.25));
        assert_near(t.symmetric, 0.25, 1e-15);
    }
    assert_eq!((c.normal_mean_deg, c.normal_p95_deg), (0.0, 0.0));
}

#[test]
fn a_tilted_plane_has_the_angle_and_the_integral() {
    // Hinged at x = 0: the height above the flat plane rises linearly from 0 to the sine.
    let angle = 0.01f64;
    let tilted = plane(4).map(|[x, y, _]| [x * angle.cos(), y, x * angle.sin()]);
    let c = compare(&plane(9).surface(), &tilted.surface(), &options(50_000, 3)).unwrap();
    let top = angle.sin();
    assert_near(c.mean.backward, top / 2.0, 1e-3);
    assert_near(c.rms.backward, top / 3f64.sqrt(), 1e-3);
    assert_near(c.p99.backward, top * 0.99, 1e-3);
    assert_near(c.hausdorff.backward, top, 1e-12);
    assert_near(c.normal_mean_deg, angle.to_degrees(), 1e-9);
    assert_near(c.normal_p95_deg, angle.to_degrees(), 1e-9);
}

#[test]
fn a_mesh_lies_on_itself() {
    let mesh = bumpy(20);
    let c = measure(&mesh, &mesh);
    assert!(c.hausdorff.symmetric < 1e-14 && c.normal_p95_deg == 0.0, "{c:?}");
    let prepared = Prepared::new(&mesh.surface()).unwrap();
    assert!(vertex_distances(&mesh.surface(), &prepared).iter().all(|&d| d == 0.0));
}

#[test]
fn a_missing_part_is_seen_one_way_only() {
    // Two squares against one of them: half of the reference is 2 to 3 away.
    let mut both = plane(10);
    let far = both.clone().map(|[x, y, z]| [x + 3.0, y, z]);
    let first = both.positions.len() as u32;
    both.positions.extend(far.positions);
    both.triangles.extend(far.triangles.iter().map(|t| t.map(|v| v + first)));
    let c = measure(&both, &plane(10));
    assert!(c.hausdorff.backward < 1e-15, "{c:?}");
    assert_near(c.hausdorff.forward, 3.0, 1e-15);
    assert_eq!(c.hausdorff.symmetric, c.hausdorff.forward);
    // Half of the reference lies on the candidate, the other half 2.5 away on average.
    assert_near(c.mean.forward, 1.25, 1e-3);
    assert_near(c.mean.symmetric, 0.625, 1e-3);
    assert_near(c.rms.forward, (0.5 * (27.0 - 8.0) / 3.0f64).sqrt(), 1e-3);
    assert_near(c.rms.symmetric, c.rms.forward / 2f64.sqrt(), 1e-12);
}

#[test]
fn a_spike_is_found_at_its_vertex() {
    // One vertex of ten thousand is displaced; hardly a sample comes near its tip.
    let flat = plane(100);
    let mut spiked = flat.clone();
    spiked.positions[5000][2] = 0.5;
    let c = measure(&flat, &spiked);
    assert_eq!(c.hausdorff.backward, 0.5);
    let distances = vertex_distances(&spiked.surface(), &Prepared::new(&flat.surface()).unwrap());
    assert_eq!((distances[5000], distances[4999], distances.len()), (0.5, 0.0, 101 * 101));
}

/// Distance of a point from the nearest face, one after the other.
fn distance_by_brute_force(p: [f64; 3], mesh: &Mesh) -> f64 {
    let p = DVec3::from(p);
    let to_face = |t: &[VertexId; 3]| {
        let [a, b, c] = t.map(|v| DVec3::from(mesh.positions[v.index()]));
        let side = |a: DVec3, b: DVec3| {
            let along = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            p.distance(a + (b - a) * along)
        };
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let is_over =
            [(a, b), (b, c), (c, a)].iter().all(|(a, b)| (*b - *a).cross(p - *a).dot(normal) >= 0.0);
        if is_over { (p - a).dot(normal).abs() } else { side(a, b).min(side(b, c)).min(side(c, a)) }
    };
    mesh.surface().triangles().iter().map(to_face).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_farthest_point_is_as_far_as_the_largest_distance() {
    let mut spiked = plane(20);
    spiked.positions[123][2] = 0.5;
    let moved = |mesh: &Mesh| mesh.clone().map(|[x, y, z]| [3.0 * x + 100.0, 3.0 * y, 3.0 * z - 7.0]);
    let pairs = [
        (bumpy(20), bumpy(4)),
        (bumpy(3), bumpy(20)),
        (plane(20), spiked.clone()),
        (spiked, plane(3)),
        (moved(&bumpy(11)), moved(&bumpy(5))),
    ];
    let mut directions = Vec::new();
    for (reference, candidate) in &pairs {
        let c = measure(reference, candidate);
        let farthest = c.farthest.expect("they differ");
        let (own, other) = if farthest.is_forward { (reference, candidate) } else { (candidate, reference) };
        let way = if farthest.is_forward { c.hausdorff.forward } else { c.hausdorff.backward };
        assert_eq!(way, c.hausdorff.symmetric);
        assert_near(distance_by_brute_force(farthest.point, other), way, 1e-9);
        assert_near(DVec3::from(farthest.point).distance(farthest.nearest.unwrap().into()), way, 1e-9);
        assert!(distance_by_brute_force(farthest.point, own) < 1e-9 * c.diagonal);
        assert!(distance_by_brute_force(farthest.nearest.unwrap(), other) < 1e-9 * c.diagonal);
        directions.push(farthest.direction());
    }
    assert!(directions.contains(&"forward") && directions.contains(&"backward"), "{directions:?}");
}

#[test]
fn the_farthest_point_is_the_first_of_equally_far_ones() {
    // Both directions, all vertices and all samples are equally far.
    let (low, high) = (plane(3), plane(3).map(|[x, y, z]| [x, y, z + 0.25]));
    let c = measure(&low, &high);
    let farthest = c.farthest.expect("they differ");
    assert!(farthest.is_forward && low.positions.contains(&farthest.point), "{farthest:?}");
    let [x, y, _] = farthest.point;
    assert_eq!(farthest.nearest, Some([x, y, 0.25]));
    // There is none without a distance, or with one that is too large for its square.
    let point = plane(1).map(|_| [0.5; 3]);
    assert_eq!(measure(&point, &point).farthest, None);
    let unrelated = low.clone().map(|p| p.map(|x| x * 1e-180 + 1.0));
    assert_eq!(measure(&unrelated, &low.map(|p| p.map(|x| x * 1e-180))).farthest, None);
}

#[test]
fn the_farthest_place_inside_a_face_is_climbed_to() {
    // Two planes rise from a flat face's edges and meet over its middle line: no vertex of the face is far from them.
    //
    //        /\
    //      /    \          12 samples on two faces are 0.3 apart.
    //    /________\
    let roof = Mesh {
        positions: vec![
            [0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.47, 0.0, 0.47],
            [0.47, 1.0, 0.47],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
        ],
        triangles: vec![[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]],
    };
    let c = compare(&roof.surface(), &plane(1).surface(), &options(12, 0)).unwrap();
    // Equally far from both slopes, at angles a and b: x sin a = (1 - x) sin b.
    let (a, b) = (0.5f64.sqrt(), (0.47f64).atan2(0.53).sin());
    assert_near(c.hausdorff.backward, a * b / (a + b), 2e-3);
}

#[test]
fn equal_seeds_give_equal_numbers_and_others_nearly() {
    let (a, b) = (bumpy(30), bumpy(9));
    let with = |seed| compare(&a.surface(), &b.surface(), &options(20_000, seed)).unwrap();
    assert_eq!(with(5), with(5));
    let (one, two) = (with(5), with(6));
    assert_ne!(one.mean, two.mean);
    assert_near(one.mean.symmetric, two.mean.symmetric, 2e-3);
    assert_near(one.rms.symmetric, two.rms.symmetric, 2e-3);
}

#[test]
fn prepared_surfaces_give_the_same_numbers() {
    let (a, b) = (bumpy(12), bumpy(5));
    let prepared = [&a, &b].map(|m| Prepared::new(&m.surface()).unwrap());
    assert_eq!(compare_prepared(&prepared[0], &prepared[1], &options(20_000, 0)), measure(&a, &b));
}

#[test]
fn a_comparison_ends_when_it_is_cancelled() {
    let (a, b) = (bumpy(12), bumpy(5));
    // More samples than there is memory for.
    let many = options(1 << 32, 0);
    let mut calls = 0;
    let made = compare_until(&a.surface(), &b.surface(), &many, &mut || {
        calls += 1;
        calls > 3
    });
    assert_eq!((made, calls), (Err(MeasureError::Cancelled), 4));
    let all = compare_until(&a.surface(), &b.surface(), &options(20_000, 0), &mut || false);
    assert_eq!(all, Ok(measure(&a, &b)));
}

#[cfg(feature = "rayon")]
#[test]
fn any_number_of_threads_gives_the_same_numbers() {
    // More than 16,384 faces, so that building the tree is parallel too.
    let (a, b) = (bumpy(60), bumpy(9));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            (measure(&a, &b), vertex_distances(&a.surface(), &Prepared::new(&b.surface()).unwrap()))
        })
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn far_from_the_origin_is_as_good_as_near() {
    // Shifted by a power of two, so that the positions, which are rounded here to 2^-20, shift without loss.
    let round = |mesh: Mesh| mesh.map(|p| p.map(|x| (x * 1048576.0).round() / 1048576.0));
    let (a, b) = (round(bumpy(20)), round(bumpy(8)));
    let near = measure(&a, &b);
    let moved = |mesh: &Mesh| mesh.clone().map(|[x, y, z]| [x + 524_288.0, y + 4_194_304.0, z + 256.0]);
    assert_same_but_for_scale(&near, &measure(&moved(&a), &moved(&b)), 1.0, 1e-12);
}

#[test]
fn scale_changes_nothing_but_the_unit() {
    let (a, b) = (bumpy(20), bumpy(8));
    let c = measure(&a, &b);
    let at = |scale: f64| {
        let scaled = |mesh: &Mesh| mesh.clone().map(|p| p.map(|x| x * scale));
        measure(&scaled(&a), &scaled(&b))
    };
    for power in [-20, 50, -660, 660] {
        let scale = 2f64.powi(power);
        assert_same_but_for_scale(&c, &at(scale), scale, 1e-15);
    }
    // Here the positions are rounded again: faces that tie may swap, and with them the samples.
    for scale in [1e-6, 1e15, 1e-200, 1e200] {
        assert_same_but_for_scale(&c, &at(scale), scale, 3e-3);
        assert_near(at(scale).hausdorff.symmetric, c.hausdorff.symmetric * scale, 1e-12);
    }
}

#[test]
fn meshes_without_area_have_distances_all_the_same() {
    let line = Mesh { positions: vec![[0.0; 3], [1.0, 0.0, 0.0]], triangles: vec![[0, 1, 1]] };
    let point = Mesh { positions: vec![[0.0, 0.0, 2.0]; 3], triangles: vec![[0, 1, 2]] };
    let c = measure(&line, &point);
    assert_eq!((c.hausdorff.forward, c.hausdorff.backward), (5f64.sqrt(), 2.0));
    assert!(c.mean.forward > 2.0 && c.mean.forward < 5f64.sqrt() && c.rms.backward == 2.0, "{c:?}");
    assert_eq!((c.normal_mean_deg, c.normal_p95_deg), (0.0, 0.0));
    let c = measure(&point, &point);
    assert_eq!((c.hausdorff.symmetric, c.mean.symmetric, c.rms.symmetric, c.diagonal), (0.0, 0.0, 0.0, 0.0));
}

#[test]
fn the_error_says_which_mesh_has_no_face() {
    let none = Mesh { positions: vec![[0.0; 3]], triangles: vec![] };
    let broken = Mesh { positions: vec![[f64::NAN; 3]], triangles: vec![[0, 0, 0]] };
    let good = plane(1);
    let of =
        |a: &Mesh, b: &Mesh| compare(&a.surface(), &b.surface(), &CompareOptions::default()).unwrap_err();
    assert_eq!(of(&none, &good), MeasureError::Empty { which: "reference" });
    assert_eq!(of(&good, &broken), MeasureError::Empty { which: "candidate" });
    assert!(Prepared::new(&none.surface()).is_err());
}

#[test]
fn a_broken_face_does_not_spoil_the_rest() {
    let good = plane(4);
    let mut broken = good.clone();
    broken.positions.push([f64::INFINITY, f64::NAN, 0.0]);
    broken.triangles.insert(0, [0, 1, 25]);
    broken.triangles.push([25, 25, 25]);
    let c = measure(&good, &broken);
    assert_eq!((c.hausdorff.symmetric, c.mean.symmetric), (0.0, 0.0));
    let distances = vertex_distances(&broken.surface(), &Prepared::new(&good.surface()).unwrap());
    assert!(distances[25].is_nan() && distances[..25].iter().all(|&d| d == 0.0));
}

#[test]
fn the_rms_alone_is_that_of_a_comparison() {
    // (Squares of the smallest and largest distances leave the range of a double.)
    for scale in [1.0, 1e-170, 1e200] {
        let [a, b] = [sphere(8), sphere(3)].map(|m| m.map(|p| p.map(|x| scale * x)));
        let [a, b] = [&a, &b].map(|m| Prepared::new(&m.surface()).unwrap());
        let mut options = CompareOptions::default();
        options.samples = 5_000;
        let whole = compare_prepared(&a, &b, &options).rms.symmetric;
        let alone = rms_prepared_until(&a, &b, &options, &mut || false).unwrap();
        assert!((alone.rms / whole - 1.0).abs() < 1e-12 && whole > 0.01 * scale, "{alone:?} and {whole}");
        // The same estimate from other samples, some twenty times.
        let of_seed = |seed| {
            options.seed = seed;
            rms_prepared_until(&a, &b, &options, &mut || false).unwrap().rms / whole - 1.0
        };
        let spread = (1..20).map(of_seed).map(|x| x * x).sum::<f64>().sqrt() / 19f64.sqrt();
        assert!(spread < alone.relative_deviation && alone.relative_deviation < 0.05, "{spread} {alone:?}");
        assert_eq!(rms_prepared_until(&a, &b, &options, &mut || true), None);
    }
    let flat = Prepared::new(&plane(3).surface()).unwrap();
    let none = rms_prepared_until(&flat, &flat, &CompareOptions::default(), &mut || false).unwrap();
    assert_eq!((none.rms, none.relative_deviation), (0.0, 0.0));
}
