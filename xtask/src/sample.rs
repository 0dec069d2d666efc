//! The sample model of the README: a turned finial, computed from formulas and free to distribute.
//!
//! A stepped foot with crisp edges, a concave stem, a bead, an onion of eight twisted lobes that meet in
//! sharp valleys, a collar and a ball: smooth and sharp, flat and round in one closed surface.

use std::f64::consts::{PI, TAU};

/// The path of the file from the root of the repository.
pub(crate) const PATH: &str = "testdata/finial.ply";
/// A copy of the file in the folder of the viewer: a published crate can include only files of its own folder.
pub(crate) const PATH_IN_VIEWER: &str = "crates/viewer/assets/finial.ply";

const LOBES: usize = 8;
/// Number of columns. Valleys stay sharp because they lie on columns, which follow the twist.
const COLUMNS: usize = LOBES * 11;

/// A closed surface in single precision.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sample {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) triangles: Vec<[u16; 3]>,
}

/// One ring of the surface of revolution.
struct Ring {
    radius: f64,
    height: f64,
    /// Depth of the valleys as a fraction of the radius.
    depth: f64,
    /// Rotation of the columns, in radians.
    twist: f64,
}

/// Returns the profile from the foot to the top, without the two points on the axis.
fn outline() -> Vec<Ring> {
    let mut rings: Vec<Ring> = Vec::new();
    let mut plain = |radius, height| rings.push(Ring { radius, height, depth: 0.0, twist: 0.0 });
    let span = |n: usize| (1..=n).map(move |i| i as f64 / n as f64);
    // A disc, its rim, and a step.
    for t in span(4) {
        plain(0.70 * t, 0.0);
    }
    for t in span(2) {
        plain(0.70, 0.12 * t);
    }
    for t in span(2) {
        plain(0.70 - 0.10 * t, 0.12);
    }
    for t in span(1) {
        plain(0.60, 0.12 + 0.06 * t);
    }
    // The stem, a concave curve.
    for t in span(16) {
        plain(0.60 - 0.42 * (t * PI / 2.0).sin(), 0.72 - 0.54 * (t * PI / 2.0).cos());
    }
    // A bead between two fillets.
    plain(0.30, 0.72);
    for t in span(10) {
        let a = t * PI;
        plain(0.30 + 0.09 * a.sin(), 0.81 - 0.09 * a.cos());
    }
    plain(0.22, 0.90);
    // The onion.
    let rows = 40;
    for t in span(rows) {
        let belly = 0.62 * (PI * t.powf(0.62)).sin().max(0.0).powf(0.8);
        let tip = 0.22 * (1.0 - t) + 0.10 * t;
        let fade = (PI * t).sin().powf(0.7);
        rings.push(Ring {
            radius: tip + belly,
            height: 0.90 + 1.45 * t,
            depth: 0.30 * fade,
            twist: 2.2 * t * t,
        });
    }
    let twist = 2.2;
    let mut plain = |radius, height| rings.push(Ring { radius, height, depth: 0.0, twist });
    // A collar, and the ball up to just below its pole.
    plain(0.19, 2.35);
    plain(0.19, 2.39);
    plain(0.10, 2.39);
    let (ball, centre, start) = (0.17, 2.53, (0.10f64 / 0.17).asin());
    for t in span(13).filter(|&t| t < 1.0) {
        let a = start + (PI - start) * t;
        plain(ball * a.sin(), centre - ball * a.cos());
    }
    rings
}

/// Builds the sample. Coordinates are multiples of 1/4096, so that the last bits of the system's sine do not matter.
pub(crate) fn finial() -> Sample {
    let round = |x: f64| ((x * 4096.0).round() / 4096.0) as f32;
    let rings = outline();
    let mut sample = Sample::default();
    let mut add_vertex = |x: f64, y: f64, z: f64| {
        sample.positions.push([round(x), round(y), round(z)]);
        (sample.positions.len() - 1) as u16
    };
    let bottom = add_vertex(0.0, 0.0, 0.0);
    let mut ids: Vec<Vec<u16>> = Vec::new();
    for ring in &rings {
        let column = |c: usize| {
            let across = (c * LOBES % COLUMNS) as f64 / COLUMNS as f64;
            let radius = ring.radius * (1.0 - ring.depth * (1.0 - (PI * across).sin()));
            let a = c as f64 / COLUMNS as f64 * TAU + ring.twist;
            add_vertex(radius * a.cos(), ring.height, -radius * a.sin())
        };
        ids.push((0..COLUMNS).map(column).collect());
    }
    let top = add_vertex(0.0, 2.70, 0.0);

    let distance_sq = |a: u16, b: u16| {
        let (a, b) = (sample.positions[usize::from(a)], sample.positions[usize::from(b)]);
        (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).powi(2)).sum::<f64>()
    };
    let mut triangles = Vec::new();
    for c in 0..COLUMNS {
        let next = (c + 1) % COLUMNS;
        triangles.push([bottom, ids[0][next], ids[0][c]]);
        for pair in ids.windows(2) {
            let [a, b, up_a, up_b] = [pair[0][c], pair[0][next], pair[1][c], pair[1][next]];
            if distance_sq(a, up_b) <= distance_sq(b, up_a) {
                triangles.extend([[a, b, up_b], [a, up_b, up_a]]);
            } else {
                triangles.extend([[a, b, up_a], [b, up_b, up_a]]);
            }
        }
        let last = &ids[ids.len() - 1];
        triangles.push([last[c], last[next], top]);
    }
    sample.triangles = triangles;
    sample
}

/// Encodes the sample as binary PLY, little endian, with 16-bit indices: small, and readable by every PLY reader.
pub(crate) fn ply(sample: &Sample) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment CC0: made by `cargo xtask sample`\n\
         element vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar ushort vertex_indices\nend_header\n",
        sample.positions.len(),
        sample.triangles.len()
    )
    .into_bytes();
    bytes.extend(sample.positions.iter().flatten().flat_map(|x| x.to_le_bytes()));
    for triangle in &sample.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|i| i.to_le_bytes()));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn the_files_match_the_formulas() {
        for path in [PATH, PATH_IN_VIEWER] {
            let file = std::fs::read(crate::root().join(path)).unwrap();
            assert!(file == ply(&finial()), "{path}: run `cargo xtask sample`");
        }
    }

    #[test]
    fn the_sample_is_closed_and_oriented() {
        let sample = finial();
        let mut sides = HashMap::new();
        for t in &sample.triangles {
            for k in 0..3 {
                *sides.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        assert!(sides.iter().all(|(&(a, b), &n)| n == 1 && sides.contains_key(&(b, a))));
        // The Euler characteristic of a sphere.
        let (v, f) = (sample.positions.len() as i64, sample.triangles.len() as i64);
        assert_eq!(v - sides.len() as i64 / 2 + f, 2);
        // Six times the volume: positive if faces point outwards.
        let p = |i: u16| sample.positions[usize::from(i)].map(f64::from);
        let volume: f64 = sample
            .triangles
            .iter()
            .map(|&[a, b, c]| {
                let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) = (p(a), p(b), p(c));
                ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            })
            .sum();
        assert!(volume > 0.0);
        let mut positions: Vec<_> = sample.positions.iter().map(|p| p.map(f32::to_bits)).collect();
        positions.sort_unstable();
        positions.dedup();
        assert_eq!(positions.len(), sample.positions.len(), "no two vertices have equal positions");
    }
}
