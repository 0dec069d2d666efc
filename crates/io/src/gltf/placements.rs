//! Placements of meshes: world transforms computed from the trees of nodes.

use serde_json::Value;

use super::container::{entry, list, whole};
use super::lod::nodes_of_levels;
use crate::error::ReadError;

/// An affine map: three rows of four.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine(pub(super) [[f64; 4]; 3]);

impl Affine {
    pub(super) const IDENTITY: Self =
        Self([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);

    /// Returns the composition: first `inner`, then this.
    pub(super) fn after(&self, inner: &Self) -> Self {
        let (a, b) = (&self.0, &inner.0);
        Self([0, 1, 2].map(|r| {
            [0, 1, 2, 3].map(|c| {
                let moved = if c == 3 { a[r][3] } else { 0.0 };
                a[r][0] * b[0][c] + a[r][1] * b[1][c] + a[r][2] * b[2][c] + moved
            })
        }))
    }

    #[inline]
    pub(super) fn point(&self, p: [f64; 3]) -> [f64; 3] {
        self.0.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3])
    }

    pub(super) fn translation(&self) -> [f64; 3] {
        self.0.map(|r| r[3])
    }

    /// Returns the signed volume of the unit cube's image; negative for a mirror.
    pub(super) fn determinant(&self) -> f64 {
        let m = &self.0;
        let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    }

    /// Returns the largest factor by which it scales a length: its largest singular value.
    pub(super) fn largest_scale(&self) -> f64 {
        let m = &self.0;
        let column = |c: usize| [m[0][c], m[1][c], m[2][c]];
        let largest = (0..3).flat_map(column).fold(0f64, |a, x| a.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) {
            return largest;
        }
        // Scaled first, so that squares neither overflow nor underflow.
        let dot = |a: usize, b: usize| {
            (0..3).map(|k| column(a)[k] / largest * (column(b)[k] / largest)).sum::<f64>()
        };
        let (a, b, c) = (dot(0, 0), dot(1, 1), dot(2, 2));
        let (d, e, f) = (dot(0, 1), dot(1, 2), dot(0, 2));
        // Largest eigenvalue of the symmetric matrix of dot products, by the trigonometric formula.
        let mean = (a + b + c) / 3.0;
        let spread =
            ((a - mean).powi(2) + (b - mean).powi(2) + (c - mean).powi(2) + 2.0 * (d * d + e * e + f * f))
                / 6.0;
        let p = spread.sqrt();
        // Guessed: a spread this small is rounding error, and the matrix a rotation with uniform scale.
        if p <= 1e-12 * mean {
            return largest * mean.sqrt();
        }
        let [a, b, c] = [a, b, c].map(|x| (x - mean) / p);
        let [d, e, f] = [d, e, f].map(|x| x / p);
        let half_det = (a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)) / 2.0;
        let angle = half_det.clamp(-1.0, 1.0).acos() / 3.0;
        largest * (mean + 2.0 * p * angle.cos()).max(0.0).sqrt()
    }

    /// Returns the matrix for normals: the inverse transpose up to a positive factor.
    pub(super) fn normal_matrix(&self) -> [[f64; 3]; 3] {
        let m = &self.0;
        let sign = if self.determinant() < 0.0 { -1.0 } else { 1.0 };
        let cofactor = |r: usize, c: usize| {
            let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
            sign * (m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1])
        };
        [0, 1, 2].map(|r| [0, 1, 2].map(|c| cofactor(r, c)))
    }
}

/// Maximum number of faces, and of vertices, that the nodes of one file may place: a small file can instance
/// a large mesh very often. Guessed: more than any user has needed, within the memory of a workstation.
const MAX_PLACED: u64 = 1 << 28;

/// Maximum number of placed faces, and of vertices, per byte of the file, or of its buffers if they are
/// larger: a few kilobytes must not ask for gigabytes. Guessed: a mesh has some 20 bytes per triangle, so
/// this allows a thousand copies; a million faces are always allowed.
const MAX_PLACED_PER_BYTE: u64 = 64;
const ALWAYS_PLACED: u64 = 1 << 20;

/// Returns an error if the nodes of a file of this size place too many faces or vertices. Shared by all
/// callers that process each instance, whether they merge or draw them.
pub(super) fn check_placed(faces: u64, vertices: u64, bytes: usize) -> Result<(), ReadError> {
    let by_bytes = (bytes as u64).saturating_mul(MAX_PLACED_PER_BYTE).saturating_add(ALWAYS_PLACED);
    let limit = MAX_PLACED.min(by_bytes);
    let [many_faces, many_vertices] = if by_bytes < MAX_PLACED {
        [
            "number of triangles placed by nodes, for a file of this size,",
            "number of vertices placed by nodes, for a file of this size,",
        ]
    } else {
        ["number of triangles placed by nodes", "number of vertices placed by nodes"]
    };
    for (what, size) in [(many_faces, faces), (many_vertices, vertices)] {
        if size > limit {
            return Err(ReadError::Limit { what, size, limit });
        }
    }
    Ok(())
}

/// A mesh with its world transform.
#[derive(Clone, Debug)]
pub(super) struct Placement {
    pub(super) node: Option<usize>,
    pub(super) mesh: usize,
    pub(super) world_from_mesh: Affine,
}

/// Returns the meshes of the default scene; of all roots if there is no scene; all meshes, untransformed, if
/// no node refers to one.
pub(super) fn placements(json: &Value) -> Result<Vec<Placement>, ReadError> {
    let mut placements = placed(json)?;
    if placements.is_empty() {
        let all = 0..list(json, "meshes").len();
        placements.extend(all.map(|mesh| Placement { node: None, mesh, world_from_mesh: Affine::IDENTITY }));
    }
    Ok(placements)
}

/// Returns the meshes that nodes of the default scene place; of all roots if there is no scene.
pub(super) fn placed(json: &Value) -> Result<Vec<Placement>, ReadError> {
    let nodes = list(json, "nodes");
    let roots = roots(json)?;
    let mut placements = Vec::new();
    let mut seen = vec![false; nodes.len()];
    // An explicit stack: a chain of nodes may be too long for recursion.
    let mut open: Vec<(usize, Affine)> = roots.into_iter().rev().map(|r| (r, Affine::IDENTITY)).collect();
    while let Some((index, world_from_parent)) = open.pop() {
        let (node, name) = entry(json, "nodes", index, "the scene")?;
        if std::mem::replace(&mut seen[index], true) {
            return Err(ReadError::element(
                name,
                "is met twice: nodes must form a tree, and this one has two parents or is its own ancestor",
            ));
        }
        let world_from_node = world_from_parent.after(&local(node, &name)?);
        if let Some(mesh) = whole(node, "mesh", &name)? {
            let (_, _) = entry(json, "meshes", mesh, &name)?;
            placements.push(Placement { node: Some(index), mesh, world_from_mesh: world_from_node });
        }
        let children = indices(node, "children", &name)?;
        open.extend(children.into_iter().rev().map(|c| (c, world_from_node)));
    }
    Ok(placements)
}

/// Returns the roots of the default scene; all nodes without a parent if there is no scene.
pub(super) fn roots(json: &Value) -> Result<Vec<usize>, ReadError> {
    let nodes = list(json, "nodes");
    let scenes = list(json, "scenes");
    let mut roots = Vec::new();
    if scenes.is_empty() {
        let mut has_parent = vec![false; nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            for child in indices(node, "children", &format!("nodes[{i}]"))? {
                if let Some(flag) = has_parent.get_mut(child) {
                    *flag = true;
                }
            }
        }
        // Lower levels of detail belong to their node and are not roots.
        for level in nodes_of_levels(json) {
            if let Some(flag) = has_parent.get_mut(level) {
                *flag = true;
            }
        }
        roots.extend((0..nodes.len()).filter(|&i| !has_parent[i]));
    } else {
        let default = whole(json, "scene", "scene")?.unwrap_or(0);
        let (scene, name) = entry(json, "scenes", default, "scene")?;
        roots.extend(indices(scene, "nodes", &name)?);
    }
    Ok(roots)
}

/// Returns a list of indices.
fn indices(object: &Value, list_name: &str, at: &str) -> Result<Vec<usize>, ReadError> {
    let number = |v: &Value| {
        let number = v.as_u64().and_then(|n| usize::try_from(n).ok());
        number.ok_or_else(|| ReadError::element(at, format!("{list_name} holds something else than indices")))
    };
    list(object, list_name).iter().map(number).collect()
}

/// Returns the transform of a node relative to its parent: a matrix, or translation, rotation and scale.
fn local(node: &Value, name: &str) -> Result<Affine, ReadError> {
    if let Some(m) = numbers::<16>(node, "matrix", name)? {
        // Column by column; the last row is 0 0 0 1.
        return Ok(Affine([0, 1, 2].map(|r| [0, 1, 2, 3].map(|c| m[4 * c + r]))));
    }
    let t = numbers::<3>(node, "translation", name)?.unwrap_or([0.0; 3]);
    let q = numbers::<4>(node, "rotation", name)?.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let s = numbers::<3>(node, "scale", name)?.unwrap_or([1.0; 3]);
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    // Quaternions should have length one; rounded ones only nearly do.
    let [x, y, z, w] = if length > 0.0 { q.map(|c| c / length) } else { [0.0, 0.0, 0.0, 1.0] };
    let rotation = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ];
    Ok(Affine([0, 1, 2].map(|r| [rotation[r][0] * s[0], rotation[r][1] * s[1], rotation[r][2] * s[2], t[r]])))
}

/// Returns a list of `N` numbers; `None` if it is missing.
pub(super) fn numbers<const N: usize>(
    node: &Value,
    what: &str,
    name: &str,
) -> Result<Option<[f64; N]>, ReadError> {
    if node[what].is_null() {
        return Ok(None);
    }
    let values: Vec<f64> =
        list(node, what).iter().filter_map(Value::as_f64).filter(|x| x.is_finite()).collect();
    let values = <[f64; N]>::try_from(values).ok().filter(|_| list(node, what).len() == N);
    values.map(Some).ok_or_else(|| ReadError::element(name, format!("{what} is not {N} numbers")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn rotation_scale_and_parents() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let json = json!({"scenes": [{"nodes": [0]}], "meshes": [{}], "nodes": [
            {"children": [1], "translation": [10, 0, 0]},
            {"mesh": 0, "rotation": [0, 0, half, half], "scale": [2, 2, -2]},
        ]});
        let got = placements(&json).unwrap();
        assert_eq!(got.len(), 1);
        let m = got[0].world_from_mesh;
        let p = m.point([1.0, 0.0, 0.0]);
        assert!((p[0] - 10.0).abs() < 1e-12 && (p[1] - 2.0).abs() < 1e-12, "{p:?}");
        assert!((m.determinant() + 8.0).abs() < 1e-9);
        // The mirror is along z: a normal along z is reversed.
        assert!(m.normal_matrix()[2][2] < 0.0 && m.normal_matrix()[1][0] > 0.0);
    }

    #[test]
    fn the_largest_scale() {
        let near = |m: [[f64; 4]; 3], wanted: f64| {
            let got = Affine(m).largest_scale();
            assert!((got - wanted).abs() <= 1e-9 * wanted.max(1e-300), "{got} for {wanted}");
        };
        near(Affine::IDENTITY.0, 1.0);
        near([[0.0, -2.0, 0.0, 9.0], [3.0, 0.0, 0.0, 9.0], [0.0, 0.0, -5.0, 9.0]], 5.0);
        near([[1e-200, 0.0, 0.0, 0.0], [0.0, 2e-200, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]], 2e-200);
        near([[0.0; 4]; 3], 0.0);
        // A shear by one: the golden ratio.
        near([[1.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]], (1.0 + 5f64.sqrt()) / 2.0);
    }

    #[test]
    fn a_chain_of_100_000_nodes_is_walked() {
        let nodes: Vec<Value> =
            (0..100_000).map(|i| json!({"children": [i + 1]})).chain([json!({"mesh": 0})]).collect();
        let json = json!({"scenes": [{"nodes": [0]}], "meshes": [{}], "nodes": nodes});
        assert_eq!(placements(&json).unwrap().len(), 1);
    }

    #[test]
    fn nodes_that_form_no_tree_are_named() {
        let twice = json!({"scenes": [{"nodes": [0, 1]}], "nodes": [{"children": [1]}, {}]});
        let cycle = json!({"scenes": [{"nodes": [0]}], "nodes": [{"children": [1]}, {"children": [0]}]});
        assert!(placements(&twice).unwrap_err().to_string().starts_with("nodes[1]: is met twice"));
        assert!(placements(&cycle).unwrap_err().to_string().starts_with("nodes[0]: is met twice"));
        let beyond = json!({"nodes": [{"children": [7]}]});
        assert_eq!(
            placements(&beyond).unwrap_err().to_string(),
            "the scene: names nodes[7], but the file has 1"
        );
    }

    #[test]
    fn meshes_that_no_node_places_are_read() {
        assert_eq!(placements(&json!({"meshes": [{}, {}], "nodes": [{}]})).unwrap().len(), 2);
    }
}
