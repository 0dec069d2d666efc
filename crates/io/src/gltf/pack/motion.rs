//! Purposes of the accessors that are not of meshes, and their streams.

use std::collections::HashMap;

use serde_json::Value;

use super::super::accessors::{Accessor, Component};
use super::super::buffers::Buffers;
use super::super::container::{list, number};
use super::options::Packing;
use super::quantize::{Rounding, unchanged};
use super::streams::{PackedStream, StreamKind};
use crate::error::ReadError;

/// Purpose of an accessor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Times,
    /// Rotations that are interpolated between keyframes.
    Rotations,
    Translations,
    Scales,
    MorphWeights,
    /// Keyframes with tangents.
    Splines,
    Matrices,
    Other,
}

impl Role {
    const fn name(self) -> &'static str {
        match self {
            Self::Times => "times",
            Self::Rotations => "rotations",
            Self::Translations => "translations",
            Self::Scales => "scales",
            Self::MorphWeights => "morph weights",
            Self::Splines => "splines",
            Self::Matrices => "matrices",
            Self::Other => "others",
        }
    }
}

/// Returns the purposes of accessors by animations and skins; those used for different purposes are `Other`.
pub(super) fn roles(json: &Value) -> HashMap<usize, Role> {
    let mut roles = HashMap::new();
    let mut add = |value: &Value, role: Role| {
        let Some(accessor) = number(value) else { return };
        let known = roles.entry(accessor).or_insert(role);
        if *known != role {
            *known = Role::Other;
        }
    };
    for animation in list(json, "animations") {
        let samplers = list(animation, "samplers");
        for sampler in samplers {
            add(&sampler["input"], Role::Times);
        }
        for channel in list(animation, "channels") {
            let Some(sampler) = number(&channel["sampler"]).and_then(|s| samplers.get(s)) else { continue };
            let is_spline = sampler["interpolation"] == "CUBICSPLINE";
            let role = match channel["target"]["path"].as_str() {
                Some("rotation" | "translation" | "scale") if is_spline => Role::Splines,
                Some("rotation") => Role::Rotations,
                Some("translation") => Role::Translations,
                Some("scale") => Role::Scales,
                Some("weights") => Role::MorphWeights,
                _ => Role::Other,
            };
            add(&sampler["output"], role);
        }
    }
    for skin in list(json, "skins") {
        add(&skin["inverseBindMatrices"], Role::Matrices);
    }
    roles
}

/// Returns the data of an accessor for its purpose; `None` for a type that is not known.
pub(super) fn stream(
    json: &Value,
    buffers: &Buffers<'_>,
    index: usize,
    role: Role,
    packing: Packing,
    rounding: &mut Rounding,
) -> Result<Option<PackedStream>, ReadError> {
    let object = &json["accessors"][index];
    let kind = StreamKind::Other(role.name());
    let from = "the file";
    let accessor = match object["type"].as_str() {
        Some("SCALAR" | "VEC2" | "VEC3" | "VEC4") => Accessor::new(json, buffers, index, from)?,
        Some("MAT4") => Accessor::of_matrices(json, buffers, index, from)?,
        _ => return Ok(None),
    };
    // Rows of matrices of small integers are padded.
    if accessor.width == 16 && accessor.kind.size() < 4 {
        return Ok(None);
    }
    // Elements that are no multiple of four would be padded, which only views of vertices can have.
    if !(accessor.kind.size() * accessor.width).is_multiple_of(4) {
        return Ok(None);
    }
    if packing.quantize && accessor.kind == Component::F32 {
        let made = match role {
            Role::Rotations if accessor.width == 4 => rounding.rotations(&accessor.floats::<4>(false)?),
            Role::Translations | Role::Scales if accessor.width == 3 => {
                let values = accessor.floats::<3>(false)?;
                rounding.vectors(values.as_flattened(), 3, role == Role::Translations)
            }
            Role::MorphWeights if accessor.width == 1 => {
                let values = accessor.floats::<1>(false)?;
                rounding.vectors(values.as_flattened(), 1, false)
            }
            Role::Splines if accessor.width == 3 => {
                let values = accessor.floats::<3>(false)?;
                rounding.vectors(values.as_flattened(), 3, true)
            }
            _ => None,
        };
        if let Some(stream) = made {
            return Ok(Some(PackedStream { kind, ..stream }));
        }
    }
    let has_bounds = !object["min"].is_null() && accessor.kind != Component::U32;
    unchanged(kind, &accessor, has_bounds).map(Some)
}
