//! Flags of index calls that change which vertices are kept.

use lodsmith_c::{
    IndexCall, LODSMITH_SIMPLIFY_PRUNE, LODSMITH_SIMPLIFY_REGULARIZE, LODSMITH_SIMPLIFY_REGULARIZE_LIGHT,
    LODSMITH_VERTEX_PRIORITY,
};

/// Vertices along a side of the sheet.
const SIDE: u32 = 33;

/// Returns the positions and indices of a sheet with this height.
fn sheet(height: impl Fn(f32, f32) -> f32) -> (Vec<[f32; 3]>, Vec<u32>) {
    let at = |i: u32| [(i % SIDE) as f32, (i / SIDE) as f32];
    let positions = (0..SIDE * SIDE).map(|i| [at(i)[0], at(i)[1], height(at(i)[0], at(i)[1])]).collect();
    let cells = (0..SIDE * (SIDE - 1)).filter(|i| i % SIDE < SIDE - 1);
    let indices = cells.flat_map(|a| [a, a + 1, a + SIDE + 1, a, a + SIDE + 1, a + SIDE]).collect();
    (positions, indices)
}

#[test]
fn vertices_with_priority_are_kept_longer() {
    let (positions, indices) = sheet(|_, _| 0.0);
    let marked: Vec<u32> = (0..8).map(|k| (4 + 3 * k) * SIDE + 30 - 3 * k).collect();
    let mut locks = vec![0; positions.len()];
    let run = |locks: &[u8]| {
        let call = IndexCall {
            indices: &indices,
            positions: &positions,
            locks,
            target_index_count: 150,
            target_error: f32::MAX,
            ..IndexCall::default()
        };
        let result = call.with_attributes().unwrap();
        assert!(
            result.indices.len() <= 150 && result.error < 1e-4,
            "{} {}",
            result.indices.len(),
            result.error
        );
        marked.iter().filter(|v| result.indices.contains(v)).count()
    };
    let before = run(&locks);
    marked.iter().for_each(|&v| locks[v as usize] = LODSMITH_VERTEX_PRIORITY);
    let after = run(&locks);
    assert!(before < 6 && after == marked.len(), "{before} before, {after} after");
}

#[test]
fn regular_faces_are_rounder() {
    let (positions, indices) = sheet(|x, y| 0.3 * (0.4 * x).sin() + 0.02 * y);
    let roundness = |options: u32| {
        let call = IndexCall {
            indices: &indices,
            positions: &positions,
            target_index_count: 900,
            target_error: f32::MAX,
            options,
            ..IndexCall::default()
        };
        let result = call.simplify().unwrap();
        let quality = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            let edge = |p: [f32; 3], q: [f32; 3]| [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
            let (u, v, w) = (edge(a, b), edge(a, c), edge(b, c));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let square = |x: [f32; 3]| x.iter().map(|x| x * x).sum::<f32>();
            2.0 * 3.0f32.sqrt() * square(n).sqrt() / (square(u) + square(v) + square(w))
        };
        let faces = result.indices.as_chunks::<3>().0;
        faces.iter().map(quality).sum::<f32>() / faces.len() as f32
    };
    let [none, light, full] =
        [0, LODSMITH_SIMPLIFY_REGULARIZE_LIGHT, LODSMITH_SIMPLIFY_REGULARIZE].map(roundness);
    assert!(none + 0.05 < light && light < full, "{none} {light} {full}");
}

#[test]
fn parts_are_removed_within_the_error_only() {
    // A bumpy sheet, a part as large as a cell, and a part a quarter as large as the sheet.
    let (mut positions, mut indices) = sheet(|x, y| 0.5 * (0.5 * x).sin() * (0.4 * y).cos());
    for (first, scale, at) in [(positions.len() as u32, 0.02, 2.0), (2 * positions.len() as u32, 0.25, 40.0)]
    {
        let (small, faces) = sheet(|x, y| 0.5 * (0.5 * x).sin() * (0.4 * y).cos());
        positions.extend(small.iter().map(|p| [p[0] * scale + at, p[1] * scale, p[2] * scale + 5.0]));
        indices.extend(faces.iter().map(|i| i + first));
    }
    let parts = |target_error: f32| {
        let options = LODSMITH_SIMPLIFY_PRUNE;
        let call = IndexCall {
            indices: &indices,
            positions: &positions,
            target_error,
            options,
            ..IndexCall::default()
        };
        let result = call.simplify().unwrap();
        assert!(result.error <= target_error, "{} of {target_error}", result.error);
        let count = |part: u32| result.indices.iter().filter(|i| *i / (SIDE * SIDE) == part).count() / 3;
        [count(0), count(1), count(2)]
    };
    let [sheet, small, large] = parts(1e-4);
    assert!(sheet > 500 && small > 0 && large > 20, "{sheet} {small} {large}");
    let [sheet, small, large] = parts(0.01);
    assert!(sheet > 20 && small == 0 && large > 0, "{sheet} {small} {large}");
}
