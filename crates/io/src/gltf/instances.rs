//! Copies that a node makes of its mesh: the extension `EXT_mesh_gpu_instancing`.
//!
//! Source: Khronos, "EXT_mesh_gpu_instancing" (extension of glTF 2.0).

use serde_json::Value;

use super::accessors::Accessor;
use super::buffers::Buffers;
use super::container::{list, number, whole};
use super::mesh::Budget;
use super::references::INSTANCING;
use crate::error::ReadError;

/// The attributes that define the placement of a copy.
const PLACING: [&str; 3] = ["TRANSLATION", "ROTATION", "SCALE"];

/// The transforms of the copies of a node's mesh, relative to the node.
pub(super) struct Copies {
    pub(super) count: usize,
    translations: Option<Vec<[f32; 3]>>,
    rotations: Option<Vec<[f32; 4]>>,
    scales: Option<Vec<[f32; 3]>>,
}

/// The accessors of translations, rotations and scales; at least one.
pub(super) type CopyAccessors = [Option<usize>; 3];

/// Returns the accessors of the copies of a node; `None` for a node that places its mesh once.
pub(super) fn accessors(node: &Value) -> Result<Option<CopyAccessors>, ReadError> {
    let attributes = &node["extensions"][INSTANCING]["attributes"];
    let [t, r, s] = PLACING.map(|name| whole(attributes, name, INSTANCING));
    let all = [t?, r?, s?];
    Ok(all.iter().any(Option::is_some).then_some(all))
}

/// Returns the number of copies that a node places of its mesh, by the counts of its accessors.
pub(super) fn count(json: &Value, node: &Value) -> usize {
    let attributes = &node["extensions"][INSTANCING]["attributes"];
    let count = |name: &str| number(&list(json, "accessors").get(number(&attributes[name])?)?["count"]);
    PLACING.into_iter().filter_map(count).min().unwrap_or(1)
}

impl Copies {
    pub(super) fn read(
        json: &Value,
        buffers: &Buffers<'_>,
        [t, r, s]: CopyAccessors,
        budget: &mut Budget,
    ) -> Result<Self, ReadError> {
        let open =
            |index: Option<usize>| index.map(|i| Accessor::new(json, buffers, i, INSTANCING)).transpose();
        let (t, r, s) = (open(t)?, open(r)?, open(s)?);
        let all = [&t, &r, &s];
        let numbers = all.iter().copied().flatten().map(|a| a.count as u64 * 4);
        budget.numbers.take(numbers.fold(0, u64::saturating_add))?;
        Ok(Self {
            count: all.into_iter().flatten().map(|a| a.count).min().unwrap_or(0),
            translations: t.map(|a| a.floats(false)).transpose()?,
            rotations: r.map(|a| a.floats(true)).transpose()?,
            scales: s.map(|a| a.floats(false)).transpose()?,
        })
    }

    /// Returns translation, rotation as a quaternion, and scale of a copy.
    pub(super) fn parts(&self, i: usize) -> ([f64; 3], [f64; 4], [f64; 3]) {
        let three = |all: &Option<Vec<[f32; 3]>>, otherwise: f64| {
            all.as_ref().map_or([otherwise; 3], |all| all[i].map(f64::from))
        };
        let rotation = self.rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |all| all[i].map(f64::from));
        (three(&self.translations, 0.0), rotation, three(&self.scales, 1.0))
    }
}
