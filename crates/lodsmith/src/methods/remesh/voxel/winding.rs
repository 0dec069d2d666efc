//! Generalised winding numbers of a triangle set.

use glam::DVec3;

/// Faces in a leaf. Guessed.
const LEAF_FACES: usize = 8;
/// Beyond this many of its radii, a node is approximated by its dipole. [Barill et al. 2018] take 2.
const DIPOLE_RADII: f64 = 2.0;

struct Node {
    /// Area-weighted centroid, and the sum of area times normal.
    centre: DVec3,
    dipole: DVec3,
    /// Largest distance of a corner from the centre.
    radius: f64,
    /// Face range of a leaf, or indices of the two children.
    range: (u32, u32),
    is_leaf: bool,
}

/// Bounding hierarchy for generalised winding numbers. [Barill et al. 2018]
pub(super) struct WindingTree {
    nodes: Vec<Node>,
    faces: Vec<[DVec3; 3]>,
}

impl WindingTree {
    /// Cost: O(n log n).
    pub(super) fn new(mut faces: Vec<[DVec3; 3]>) -> Self {
        let mut nodes = Vec::new();
        if !faces.is_empty() {
            nodes.push(summed(&faces, 0));
            // Children come after their parents: iterative instead of recursive.
            let mut next = 0;
            while next < nodes.len() {
                let (from, to) = nodes[next].range;
                let (from, to) = (from as usize, to as usize);
                if to - from > LEAF_FACES {
                    let own = &mut faces[from..to];
                    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
                    for t in own.iter() {
                        let c = t[0] + t[1] + t[2];
                        (min, max) = (min.min(c), max.max(c));
                    }
                    let d = max - min;
                    let axis = if d.x >= d.y && d.x >= d.z {
                        0
                    } else if d.y >= d.z {
                        1
                    } else {
                        2
                    };
                    let middle = own.len() / 2;
                    let key = |t: &[DVec3; 3]| t[0][axis] + t[1][axis] + t[2][axis];
                    own.select_nth_unstable_by(middle, |a, b| {
                        let all = |t: &[DVec3; 3]| t.map(|p| p.to_array());
                        key(a).total_cmp(&key(b)).then_with(|| {
                            all(a)
                                .as_flattened()
                                .iter()
                                .zip(all(b).as_flattened())
                                .fold(std::cmp::Ordering::Equal, |o, (x, y)| o.then(x.total_cmp(y)))
                        })
                    });
                    let first = nodes.len() as u32;
                    let halves = [
                        summed(&faces[from..from + middle], from),
                        summed(&faces[from + middle..to], from + middle),
                    ];
                    nodes.extend(halves);
                    nodes[next].range = (first, first + 1);
                    nodes[next].is_leaf = false;
                }
                next += 1;
            }
        }
        Self { nodes, faces }
    }

    /// Returns the winding number of a point: 1 inside a closed surface oriented outward, 0 outside,
    /// fractional around an open one.
    pub(super) fn at(&self, p: DVec3) -> f64 {
        let mut sum = 0.0;
        let mut stack = [0u32; 128];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            let node = &self.nodes[stack[waiting] as usize];
            let d = node.centre - p;
            let distance_sq = d.length_squared();
            if distance_sq > (DIPOLE_RADII * node.radius) * (DIPOLE_RADII * node.radius) {
                sum += node.dipole.dot(d) / (distance_sq * distance_sq.sqrt());
            } else if node.is_leaf {
                let (from, to) = node.range;
                sum += self.faces[from as usize..to as usize].iter().map(|t| solid_angle(p, t)).sum::<f64>();
            } else {
                [stack[waiting], stack[waiting + 1]] = [node.range.1, node.range.0];
                waiting += 2;
            }
        }
        sum / (4.0 * std::f64::consts::PI)
    }
}

fn summed(faces: &[[DVec3; 3]], first: usize) -> Node {
    let (mut centre, mut dipole, mut area) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for [a, b, c] in faces {
        let normal = (b - a).cross(c - a) / 2.0;
        let own = normal.length();
        dipole += normal;
        centre += (a + b + c) / 3.0 * own;
        area += own;
    }
    let centre = if area > 0.0 { centre / area } else { faces[0][0] };
    let radius = faces.iter().flatten().map(|p| p.distance_squared(centre)).fold(0f64, f64::max).sqrt();
    Node { centre, dipole, radius, range: (first as u32, (first + faces.len()) as u32), is_leaf: true }
}

/// The signed solid angle of a triangle. [Van Oosterom-Strackee 1983]
fn solid_angle(p: DVec3, corners: &[DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|q| q - p);
    let (x, y, z) = (a.length(), b.length(), c.length());
    let below = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
    2.0 * libm::atan2(a.dot(b.cross(c)), below)
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;

    #[test]
    fn a_sphere_has_winding_number_one_inside() {
        let mesh = shapes::icosphere(4);
        let view = mesh.positions().view();
        let faces = mesh.triangles().iter().map(|t| t.map(|w| view.get(mesh.vertex_of(w)).into())).collect();
        let tree = WindingTree::new(faces);
        for (r, wanted) in [(0.0, 1.0), (0.5, 1.0), (0.98, 1.0), (1.02, 0.0), (1.5, 0.0), (9.0, 0.0)] {
            for d in [DVec3::X, DVec3::new(0.6, -0.48, 0.64), DVec3::NEG_Z] {
                // Nodes approximated by a dipole are off by a few percent; only the 0.5 threshold matters.
                assert!((tree.at(d * r) - wanted).abs() < 0.05, "{r} {}", tree.at(d * r));
            }
        }
        assert_eq!(WindingTree::new(Vec::new()).at(DVec3::ZERO), 0.0);
    }
}
