//! Transforms that undo the quantization of positions: of nodes, skins and instances.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::super::accessors::{Accessor, Component};
use super::super::buffers::Buffers;
use super::super::container::{list, number};
use super::super::encode::NumberType;
use super::super::lists::append;
use super::super::meshopt::Filter;
use super::super::references::{INSTANCING, named_nodes};
use super::super::renumber::Renumbering;
use super::quantize::Grid;
use super::streams::{Output, PackedStream, StreamKind};
use crate::error::ReadError;

/// The nodes of a file with meshes whose positions are integers in a grid.
pub(super) struct GridNodes<'a, 'b> {
    pub(super) source: &'a Value,
    pub(super) buffers: &'a Buffers<'b>,
    /// The grid of each mesh.
    pub(super) grids: &'a [Option<Grid>],
}

/// References to new accessors: pointers into the file, and their indices.
pub(super) type References = Vec<(String, usize)>;

impl GridNodes<'_, '_> {
    /// Changes nodes, skins and instances; appends their data to the output. Returns the references to it,
    /// which are null until all others have been renumbered.
    pub(super) fn apply(
        &self,
        json: &mut Value,
        output: &mut Output,
        changes: &mut Renumbering,
    ) -> Result<References, ReadError> {
        let mut references = References::new();
        let mut of_skins: HashMap<(usize, GridKey), usize> = HashMap::new();
        let mut taken: Vec<bool> = vec![false; list(json, "skins").len()];
        let nodes = list(json, "nodes").len();
        let plain = plain_nodes(json);
        for n in 0..nodes {
            let node = &json["nodes"][n];
            let Some(mesh) = number(&node["mesh"]) else { continue };
            let grid = self.grids.get(mesh).copied().flatten();
            if let Some(skin) = number(&node["skin"]) {
                let key = (skin, key(grid));
                let next = list(json, "skins").len();
                let known = of_skins.get(&key).copied();
                let own = match known {
                    Some(own) => own,
                    None => {
                        let is_first = taken.get_mut(skin).is_some_and(|t| !std::mem::replace(t, true));
                        let own = if is_first { skin } else { next };
                        if own == next {
                            let copy = self.source["skins"][skin].clone();
                            append(json, "skins", copy);
                        }
                        self.skin(json, own, skin, grid, output, &mut references)?;
                        of_skins.insert(key, own);
                        own
                    }
                };
                json["nodes"][n]["skin"] = own.into();
                // A skin ignores the transform of its node; readers without skins need it.
                if let Some(grid) = grid {
                    changes.change([skin]);
                    changes.move_mesh(n, Some(own_node(json, n, grid)));
                }
                continue;
            }
            let Some(grid) = grid else { continue };
            if !node["extensions"][INSTANCING].is_null() {
                self.instances(json, n, grid, output, &mut references)?;
            } else if plain[n] {
                changes.change([n]);
                fold(&mut json["nodes"][n], grid);
            } else {
                changes.move_mesh(n, Some(own_node(json, n, grid)));
            }
        }
        Ok(references)
    }

    /// Gives a skin matrices that start from the grid.
    fn skin(
        &self,
        json: &mut Value,
        own: usize,
        skin: usize,
        grid: Option<Grid>,
        output: &mut Output,
        references: &mut References,
    ) -> Result<(), ReadError> {
        let Some(grid) = grid else { return Ok(()) };
        let source = &self.source["skins"][skin];
        let accessor = number(&source["inverseBindMatrices"]);
        let matrices = match accessor {
            Some(index) => {
                Accessor::of_matrices(self.source, self.buffers, index, &format!("skins[{skin}]"))?
                    .floats::<16>(false)?
            }
            None => {
                let identity = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
                vec![identity; list(source, "joints").len()]
            }
        };
        let mut bytes = Vec::with_capacity(64 * matrices.len());
        for matrix in &matrices {
            transformed(matrix, grid).iter().for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
        }
        let stream = PackedStream {
            kind: StreamKind::Other("matrices"),
            number: NumberType::FLOAT,
            width: 16,
            stride: 64,
            bytes,
            filter: Filter::None,
            has_bounds: false,
        };
        let made = output.stream(accessor.map(|a| &self.source["accessors"][a]), &stream);
        json["skins"][own]["inverseBindMatrices"] = Value::Null;
        references.push((format!("/skins/{own}/inverseBindMatrices"), made));
        Ok(())
    }

    /// Gives the instances of a node transforms that start from the grid.
    fn instances(
        &self,
        json: &mut Value,
        n: usize,
        grid: Grid,
        output: &mut Output,
        references: &mut References,
    ) -> Result<(), ReadError> {
        let from = format!("nodes[{n}]");
        let attributes = &self.source["nodes"][n]["extensions"][INSTANCING]["attributes"];
        let read = |name: &str| {
            number(&attributes[name]).map(|a| Accessor::new(self.source, self.buffers, a, &from)).transpose()
        };
        let [translations, rotations, scales] = [read("TRANSLATION")?, read("ROTATION")?, read("SCALE")?];
        let known = [&translations, &rotations, &scales].into_iter().flatten().next();
        let other = attributes.as_object().and_then(|all| all.values().find_map(number));
        let count = match (known, other) {
            (Some(accessor), _) => accessor.count,
            (None, Some(other)) => Accessor::new(self.source, self.buffers, other, &from)?.count,
            (None, None) => return Ok(()),
        };
        let floats = |accessor: &Option<Accessor<'_>>, all: [f32; 4]| -> Result<Vec<[f32; 4]>, ReadError> {
            accessor.as_ref().map_or_else(|| Ok(vec![all; count]), |a| a.floats::<4>(false))
        };
        let translations = floats(&translations, [0.0; 4])?;
        let rotations = floats(&rotations, [0.0, 0.0, 0.0, 1.0])?;
        let scales = floats(&scales, [1.0; 4])?;
        let (mut moved, mut scaled) = (Vec::new(), Vec::new());
        for ((t, r), s) in translations.iter().zip(&rotations).zip(&scales) {
            let offset =
                rotated(r.map(f64::from), [0, 1, 2].map(|k| f64::from(s[k]) * f64::from(grid.offset[k])));
            for k in 0..3 {
                moved.extend_from_slice(&((f64::from(t[k]) + offset[k]) as f32).to_le_bytes());
                scaled.extend_from_slice(&(s[k] * grid.step).to_le_bytes());
            }
        }
        for (name, bytes) in [("TRANSLATION", moved), ("SCALE", scaled)] {
            let stream = PackedStream {
                kind: StreamKind::Other("instances"),
                number: NumberType { component: Component::F32, normalized: false },
                width: 3,
                stride: 12,
                bytes,
                filter: Filter::None,
                has_bounds: false,
            };
            let source = number(&attributes[name]).map(|a| &self.source["accessors"][a]);
            let made = output.stream(source, &stream);
            json["nodes"][n]["extensions"][INSTANCING]["attributes"][name] = Value::Null;
            references.push((format!("/nodes/{n}/extensions/{INSTANCING}/attributes/{name}"), made));
        }
        Ok(())
    }
}

/// A grid by its bits, to be compared.
type GridKey = Option<[u32; 4]>;

fn key(grid: Option<Grid>) -> GridKey {
    let bits = |g: Grid| [g.offset[0], g.offset[1], g.offset[2], g.step].map(f32::to_bits);
    grid.map(bits)
}

/// Returns a matrix, stored column by column, after the transform from the grid.
fn transformed(matrix: &[f32; 16], grid: Grid) -> [f32; 16] {
    let mut out = *matrix;
    for row in 0..4 {
        let mut moved = f64::from(matrix[12 + row]);
        for column in 0..3 {
            let x = f64::from(matrix[4 * column + row]);
            moved += x * f64::from(grid.offset[column]);
            out[4 * column + row] = (x * f64::from(grid.step)) as f32;
        }
        out[12 + row] = moved as f32;
    }
    out
}

/// Rotates a vector by a quaternion.
fn rotated([x, y, z, w]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let t = cross([x, y, z], v).map(|c| 2.0 * c);
    let u = cross([x, y, z], t);
    [0, 1, 2].map(|k| v[k] + w * t[k] + u[k])
}

/// Returns for each node whether only its mesh depends on its transform, and it has no name that a user could
/// look for.
fn plain_nodes(json: &mut Value) -> Vec<bool> {
    let is_plain = |node: &Value| {
        let bare = |key: &str| node[key].is_null();
        ["children", "camera", "extensions", "extras", "name", "skin"].into_iter().all(bare)
    };
    let mut plain: Vec<bool> = list(json, "nodes").iter().map(is_plain).collect();
    for n in named_nodes(json) {
        if let Some(plain) = plain.get_mut(n) {
            *plain = false;
        }
    }
    plain
}

/// Changes the transform of a node, so that its mesh may start from the grid.
fn fold(node: &mut Value, grid: Grid) {
    let floats = |value: &Value, len: usize| -> Option<Vec<f64>> {
        let all: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
        all.filter(|all| all.len() == len)
    };
    if let Some(matrix) = floats(&node["matrix"], 16) {
        let mut out = matrix.clone();
        for row in 0..4 {
            for column in 0..3 {
                out[4 * column + row] *= f64::from(grid.step);
                out[12 + row] += matrix[4 * column + row] * f64::from(grid.offset[column]);
            }
        }
        node["matrix"] = json!(out);
        return;
    }
    let translation = floats(&node["translation"], 3).unwrap_or(vec![0.0; 3]);
    let scale = floats(&node["scale"], 3).unwrap_or(vec![1.0; 3]);
    let rotation =
        floats(&node["rotation"], 4).and_then(|q| q.try_into().ok()).unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let offset = rotated(rotation, [0, 1, 2].map(|k| scale[k] * f64::from(grid.offset[k])));
    node["translation"] = json!([0, 1, 2].map(|k| translation[k] + offset[k]));
    node["scale"] = json!([0, 1, 2].map(|k| scale[k] * f64::from(grid.step)));
}

/// Moves the mesh of a node to a new child with the transform from the grid; returns the index of the child.
fn own_node(json: &mut Value, n: usize, grid: Grid) -> usize {
    let mut child = json!({ "translation": grid.offset, "scale": [grid.step, grid.step, grid.step] });
    if let Some(node) = json["nodes"][n].as_object_mut() {
        for key in ["mesh", "skin", "weights"] {
            if let Some(value) = node.shift_remove(key) {
                child[key] = value;
            }
        }
    }
    let child = append(json, "nodes", child);
    let node = &mut json["nodes"][n];
    match node.get_mut("children").and_then(Value::as_array_mut) {
        Some(children) => children.push(child.into()),
        None => node["children"] = json!([child]),
    }
    child
}
