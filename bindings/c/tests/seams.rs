//! Index calls on meshes with seams: several vertices at the same position.

use std::collections::HashMap;
use std::f32::consts::TAU;

use lodsmith_c::{IndexCall, LODSMITH_SIMPLIFY_PERMISSIVE};

/// No error limit.
const ANY: f32 = f32::MAX;

struct Textured {
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

impl Textured {
    /// Returns a grid of `n` by `m` cells.
    fn grid(n: u32, m: u32, place: impl Fn(f32, f32) -> [f32; 3]) -> Self {
        let mut mesh = Self { positions: Vec::new(), uvs: Vec::new(), indices: Vec::new() };
        for j in 0..=m {
            for i in 0..=n {
                let uv = [i as f32 / n as f32, j as f32 / m as f32];
                mesh.uvs.push(uv);
                // In a closed surface, the last row and column have the positions of the first.
                mesh.positions.push(place(uv[0], uv[1]));
            }
        }
        for (j, i) in (0..m).flat_map(|j| (0..n).map(move |i| (j, i))) {
            let a = j * (n + 1) + i;
            let [b, c, d] = [a + 1, a + n + 2, a + n + 1];
            mesh.indices.extend([a, b, c, a, c, d]);
        }
        mesh
    }

    /// Returns a bumpy torus with a texture around it: a seam along the ring and one around the tube, with four
    /// vertices where they cross.
    fn torus() -> Self {
        Self::grid(64, 32, |u, v| {
            let (s, t) = ((u % 1.0) * TAU, (v % 1.0) * TAU);
            let tube = 0.4 + 0.03 * (5.0 * s).sin() * (3.0 * t).sin();
            let ring = 1.0 + tube * t.cos();
            [ring * s.cos(), ring * s.sin(), tube * t.sin()]
        })
    }

    fn call(&self, target_faces: usize) -> IndexCall<'_> {
        IndexCall {
            indices: &self.indices,
            positions: &self.positions,
            target_index_count: 3 * target_faces,
            target_error: ANY,
            ..IndexCall::default()
        }
    }

    /// Returns the faces of an index buffer with one index for each position.
    fn welded(&self, indices: &[u32]) -> Vec<[u32; 3]> {
        let mut number = HashMap::new();
        let key = |i: u32| self.positions[i as usize].map(|x| (x + 0.0).to_bits());
        let mut of = |i: u32| {
            let next = number.len() as u32;
            *number.entry(key(i)).or_insert(next)
        };
        indices.as_chunks::<3>().0.iter().map(|t| t.map(&mut of)).collect()
    }

    /// Returns the sum of the areas of the faces in texture space, negative for flipped faces.
    fn texture_area(&self, indices: &[u32]) -> f32 {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.uvs[i as usize]);
            0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
        };
        indices.as_chunks::<3>().0.iter().map(area).sum()
    }
}

/// Returns the Euler characteristic of a closed surface. Checks that each half-edge has exactly one twin.
fn characteristic_of_closed(faces: &[[u32; 3]]) -> i64 {
    let mut edges = HashMap::new();
    let mut vertices = HashMap::new();
    for &[a, b, c] in faces {
        assert!(a != b && b != c && c != a, "a face without area");
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_insert(0) += 1;
            vertices.insert(edge.0, ());
        }
    }
    for (&(a, b), &count) in &edges {
        assert_eq!((count, edges.get(&(b, a))), (1, Some(&1)), "the surface is torn or folded");
    }
    vertices.len() as i64 - edges.len() as i64 / 2 + faces.len() as i64
}

#[test]
fn the_surface_stays_closed_at_seams_and_covers_the_texture() {
    let mesh = Textured::torus();
    assert_eq!(characteristic_of_closed(&mesh.welded(&mesh.indices)), 0);
    for target in [2000, 800, 300] {
        let mut call = mesh.call(target);
        let plain = call.simplify().unwrap();
        let values: Vec<f32> = mesh.uvs.iter().flatten().copied().collect();
        (call.attributes, call.weights) = (&values, &[0.5; 2]);
        let with_attributes = call.with_attributes().unwrap();
        for result in [plain, with_attributes] {
            assert!(result.indices.len() <= 3 * target, "{} of {target}", result.indices.len() / 3);
            assert_eq!(characteristic_of_closed(&mesh.welded(&result.indices)), 0);
            let area = mesh.texture_area(&result.indices);
            assert!((area - 1.0).abs() < 1e-4, "{area} of the texture is left");
        }
    }
}

#[test]
fn permissive_seams_may_open_in_texture_space_but_not_in_the_surface() {
    let mesh = Textured::torus();
    let result = IndexCall { options: LODSMITH_SIMPLIFY_PERMISSIVE, ..mesh.call(300) }.simplify().unwrap();
    assert!(result.indices.len() <= 900);
    assert_eq!(characteristic_of_closed(&mesh.welded(&result.indices)), 0);
}

#[test]
fn a_seam_keeps_its_line_on_a_flat_surface() {
    // Two sheets in the same plane that meet along a wave.
    let wave = |x: f32| 0.15 * (2.0 * TAU * x).sin();
    let below = Textured::grid(64, 12, |u, v| [u, (v - 1.0) * (1.0 + wave(u)) + wave(u), 0.0]);
    let above = Textured::grid(64, 12, |u, v| [u, v * (1.0 - wave(u)) + wave(u), 0.0]);
    let first = below.positions.len() as u32;
    let mesh = Textured {
        positions: [below.positions, above.positions].concat(),
        uvs: [below.uvs, above.uvs].concat(),
        indices: below.indices.into_iter().chain(above.indices.into_iter().map(|i| i + first)).collect(),
    };
    // (Both sheets have the same positions there.)
    let result = mesh.call(200).simplify().unwrap();
    let faces = result.indices.len() / 3;
    assert!(faces <= 200 && faces > 150, "{faces}");
    // Area that one sheet covers beyond the wave, in both directions: the area of its faces minus the true area.
    let area = |is_above: bool| {
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
        };
        let faces = result.indices.as_chunks::<3>().0;
        faces.iter().filter(|t| (t[0] >= first) == is_above).map(of).sum::<f32>()
    };
    assert!((area(false) + area(true) - 2.0).abs() < 1e-4);
    // Distance of the seam from the wave, at the midpoint of each seam edge.
    let mut line: Vec<[f32; 2]> = Vec::new();
    for t in result.indices.as_chunks::<3>().0.iter().filter(|t| t[0] >= first) {
        for i in t.iter().filter(|&&i| i - first <= 64) {
            let [x, y, _] = mesh.positions[*i as usize];
            line.push([x, y]);
        }
    }
    line.sort_by(|a, b| a[0].total_cmp(&b[0]));
    line.dedup();
    let off = line.windows(2).map(|e| {
        let middle = [0, 1].map(|k| 0.5 * (e[0][k] + e[1][k]));
        (middle[1] - wave(middle[0])).abs()
    });
    let farthest = off.fold(0.0, f32::max);
    assert!(farthest < 0.01, "the seam leaves its line by {farthest}");
}
