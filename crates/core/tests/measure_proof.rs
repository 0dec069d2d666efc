//! Proven bounds of the largest distance: never below the true distance, and close to it.

use lodsmith_core::measure::proof::{
    DistanceBounds, WithinResult, bound_distance, bound_distance_until, prove_within, prove_within_until,
    samples_within, samples_within_until,
};
use lodsmith_core::measure::{CompareOptions, Prepared, compare_prepared};
use lodsmith_core::{PositionsView, Surface, TriMesh, VertexId, shapes};

type Triangles = Vec<[[f64; 3]; 3]>;

fn prepared(triangles: &[[[f64; 3]; 3]]) -> Prepared {
    let positions: Vec<[f64; 3]> = triangles.iter().flatten().copied().collect();
    let faces: Vec<[VertexId; 3]> =
        (0..triangles.len()).map(|f| [0, 1, 2].map(|k| VertexId::new(3 * f + k))).collect();
    Prepared::new(&Surface::new(PositionsView::F64(&positions), &faces).unwrap()).unwrap()
}

fn of(mesh: &TriMesh) -> Prepared {
    Prepared::new(&mesh.surface()).unwrap()
}

/// A square of n × n cells, with height `z` at each position.
fn square(n: u32, z: impl Fn(f64, f64) -> f64) -> Triangles {
    let at = |i: u32, j: u32| {
        let (x, y) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
        [x, y, z(x, y)]
    };
    let cell = |k: u32| {
        let (i, j) = (k % n, k / n);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..n * n).flat_map(cell).collect()
}

fn check(from: &Prepared, to: &Prepared, wanted: f64) {
    let DistanceBounds { seen, bound } = bound_distance(from, to, 0.0, 0.01);
    assert!(seen <= wanted * (1.0 + 1e-9) + 1e-12, "{seen} is more than {wanted}");
    assert!(bound >= wanted * (1.0 - 1e-9) - 1e-12, "{bound} is less than {wanted}");
    assert!(bound <= 1.02 * wanted + 1e-10, "{bound} is far more than {wanted}");
    let more = wanted * 1.001 + 1e-9;
    assert!(
        matches!(prove_within(from, to, more), WithinResult::Yes(b) if b <= more && b >= wanted * (1.0 - 1e-9))
    );
    if wanted > 0.0 {
        let less = wanted * 0.999;
        assert!(matches!(prove_within(from, to, less), WithinResult::No(d) if d >= less), "{wanted}");
    }
}

#[test]
fn parallel_planes_have_their_distance() {
    for n in [1, 2, 7, 40] {
        for m in [1, 3, 8, 33] {
            let (a, b) = (prepared(&square(n, |_, _| 0.0)), prepared(&square(m, |_, _| 0.1)));
            check(&a, &b, 0.1);
            check(&b, &a, 0.1);
            let tilted = prepared(&square(m, |x, _| 0.25 * x));
            check(&tilted, &a, 0.25);
        }
    }
}

#[test]
fn a_peak_between_corners_is_found() {
    // The middle of the large triangle lies above the bottom of a valley, its corners on the ridges.
    let valley = prepared(&square(20, |x, _| (x - 0.5).abs() * 0.2));
    let flat = prepared(&[[[0.0, 0.0, 0.1], [1.0, 0.0, 0.1], [0.5, 1.0, 0.1]]]);
    // Perpendicular to the sides of the valley.
    let depth = 0.1 / (1f64 + 0.04).sqrt();
    check(&flat, &valley, depth);
}

#[test]
fn spheres_keep_the_height_of_their_caps() {
    let (coarse, fine) = (shapes::icosphere(2), shapes::icosphere(5));
    let (a, b) = (of(&coarse), of(&fine));
    let mut options = CompareOptions::default();
    options.samples = 100_000;
    let measured = compare_prepared(&a, &b, &options);
    for (from, to, seen) in [(&a, &b, measured.hausdorff.forward), (&b, &a, measured.hausdorff.backward)] {
        let got = bound_distance(from, to, seen, 0.01);
        assert!(got.seen >= seen && got.bound >= got.seen && got.bound <= 1.03 * seen, "{got:?} {seen}");
    }
}

#[test]
fn a_surface_lies_on_itself_however_it_is_cut() {
    let one = prepared(&square(1, |x, y| 0.3 * x - 0.7 * y));
    let many = prepared(&square(60, |x, y| 0.3 * x - 0.7 * y));
    for (from, to) in [(&one, &many), (&many, &one), (&one, &one)] {
        let got = bound_distance(from, to, 0.0, 0.01);
        assert!(got.bound < 1e-10, "{got:?}");
        assert!(matches!(prove_within(from, to, 1e-9), WithinResult::Yes(_)));
    }
}

#[test]
fn points_segments_and_needles_are_proven_too() {
    let flat = prepared(&square(5, |_, _| 0.0));
    let p = [0.3, 0.4, 0.2];
    check(&prepared(&[[p; 3]]), &flat, 0.2);
    check(&prepared(&[[p, [0.9, 0.1, 0.3], p]]), &flat, 0.3);
    check(&prepared(&[[[0.1, 0.1, 0.1], [0.9, 0.9, 0.1], [0.5, 0.5 + 1e-13, 0.1]]]), &flat, 0.1);
    // Distance to a point or a segment: largest at the corners.
    let far = |x: f64, y: f64, z: f64| (x * x + y * y + z * z).sqrt();
    check(&flat, &prepared(&[[[0.0, 0.0, 0.5]; 3]]), far(1.0, 1.0, 0.5));
    check(&flat, &prepared(&[[[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [0.4, 0.0, 0.5]]]), far(0.0, 1.0, 0.5));
}

#[test]
fn extreme_coordinates_give_a_result() {
    let near = prepared(&square(2, |_, _| 0.0));
    let far = prepared(&[[[1e200, 0.0, 0.0], [0.0, 1e200, 0.0], [0.0, 0.0, 1e200]]]);
    assert!(matches!(prove_within(&far, &near, 1.0), WithinResult::No(_)));
    assert_eq!(bound_distance(&far, &near, 0.0, 0.01).bound, f64::INFINITY);
    assert_eq!(prove_within(&near, &near, f64::NAN), WithinResult::Undecided);
    assert!(matches!(prove_within(&near, &near, 0.0), WithinResult::Yes(b) if b == 0.0));
}

fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*state >> 11) as f64 / (1u64 << 53) as f64
}

/// Random triangles, of all sizes, some of them without area.
fn soup(count: usize, state: &mut u64) -> Triangles {
    let triangle = |_| {
        let size = 0.5 * random(state).powi(3);
        let at = [(); 3].map(|()| random(state));
        let mut corners = [(); 3].map(|()| at.map(|x| x + size * (random(state) - 0.5)));
        match random(state) {
            x if x < 0.1 => corners[2] = corners[0],
            x if x < 0.2 => corners[1] = [0, 1, 2].map(|k| 0.5 * (corners[0][k] + corners[2][k])),
            _ => {}
        }
        corners
    };
    (0..count).map(triangle).collect()
}

#[test]
fn no_sample_of_a_soup_lies_beyond_its_bound() {
    let state = &mut 7;
    for round in 0..40 {
        let (a, b) = (soup(1 + 3 * round, state), soup(1 + 2 * round, state));
        let (from, to) = (prepared(&a), prepared(&b));
        let got = bound_distance(&from, &to, 0.0, 0.01);
        assert!(got.bound <= 1.011 * got.seen, "{got:?}");
        let mut largest = 0f64;
        for t in &a {
            for _ in 0..200 {
                let (mut u, mut v) = (random(state), random(state));
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                let p = [0, 1, 2].map(|k| t[0][k] + u * (t[1][k] - t[0][k]) + v * (t[2][k] - t[0][k]));
                largest = largest.max(to.tree().closest(p).unwrap().distance);
            }
        }
        assert!(largest <= got.bound * (1.0 + 1e-12) && got.seen >= 0.9 * largest, "{largest} {got:?}");
        // Slightly more: the square of a root may be less than its argument.
        let bound = got.bound * (1.0 + 1e-12);
        assert!(matches!(prove_within(&from, &to, bound), WithinResult::Yes(_)), "{got:?}");
        assert!(matches!(prove_within(&from, &to, 0.995 * got.seen), WithinResult::No(_)), "{got:?}");
        // A rejection by samples is never wrong, and holds for any shorter distance.
        assert!(samples_within(&from, &to, bound));
        let seen: Vec<bool> = (0..20).map(|k| samples_within(&from, &to, bound * 0.8f64.powi(k))).collect();
        assert!(seen.is_sorted_by(|a, b| a >= b) && (got.seen < 1e-9 || !seen[19]), "{seen:?}");
    }
}

#[test]
fn results_do_not_depend_on_the_order_of_the_faces() {
    // Threads take pieces of fixed size; the tree sorts the faces.
    let state = &mut 3;
    let (mut a, b) = (soup(3000, state), soup(500, state));
    let first = bound_distance(&prepared(&a), &prepared(&b), 0.0, 0.01);
    a.reverse();
    let second = bound_distance(&prepared(&a), &prepared(&b), 0.0, 0.01);
    assert!(
        (first.seen / second.seen - 1.0).abs() < 0.011 && (first.bound / second.bound - 1.0).abs() < 0.011
    );
    assert_eq!(first, bound_distance(&prepared(&soup(3000, &mut 3)), &prepared(&b), 0.0, 0.01));
}

/// Returns true if work ends whichever of its questions is answered with yes, and gives `all` if none is.
fn ends_at_each_question<T: PartialEq>(all: T, work: impl Fn(&mut dyn FnMut() -> bool) -> Option<T>) -> bool {
    let ended_at = |last: usize| {
        let mut asked = 0;
        let made = work(&mut || {
            asked += 1;
            asked > last
        });
        (made, asked)
    };
    let (made, asked) = ended_at(usize::MAX);
    let ends = |last: usize| ended_at(last) == (None, last + 1);
    made == Some(all) && asked > 0 && (0..asked).all(ends)
}

#[test]
fn proofs_end_when_they_are_asked_to() {
    let (from, to) = (prepared(&square(40, |x, y| 0.1 * x * y)), prepared(&square(33, |_, _| 0.0)));
    let wanted = bound_distance(&from, &to, 0.0, 0.01);
    assert!(ends_at_each_question(wanted, |is_over| bound_distance_until(&from, &to, 0.0, 0.01, is_over)));
    let distance = wanted.bound;
    let proven = prove_within(&from, &to, distance);
    assert!(matches!(proven, WithinResult::Yes(_)));
    let prove = |is_over: &mut dyn FnMut() -> bool| prove_within_until(&from, &to, distance, None, is_over);
    assert!(ends_at_each_question(proven, prove));
    let test = |is_over: &mut dyn FnMut() -> bool| samples_within_until(&from, &to, distance, None, is_over);
    assert!(ends_at_each_question(true, test));
}
