//! Purposes of the accessors that do not belong to meshes, and their streams.

use std::collections::HashMap;

use serde_json::Value;

use super::super::accessors::{Accessor, Component};
use super::super::buffers::Buffers;
use super::super::container::{list, number};
use super::super::encode::NumberType;
use super::super::meshopt::Filter;
use super::nodes::References;
use super::options::Packing;
use super::quantize::{Rounding, unchanged};
use super::streams::{Output, PackedStream, StreamKind};
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

/// Returns the purposes of accessors by animations and skins; accessors used for different purposes are
/// `Other`.
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

/// The tracks of animations.
pub(super) struct Tracks<'a, 'b> {
    pub(super) source: &'a Value,
    pub(super) buffers: &'a Buffers<'b>,
    pub(super) packing: Packing,
}

/// Number of the keyframes of a track, and the first and the last time.
#[derive(Clone, Copy)]
struct Times {
    accessor: usize,
    count: usize,
    first: f32,
    last: f32,
}

/// A track whose values are all the same.
struct ConstantTrack {
    sampler: usize,
    times: Times,
    output: usize,
    /// Its only keyframe.
    value: PackedStream,
}

impl Tracks<'_, '_> {
    /// Gives tracks whose rounded values stay the same a single keyframe, if other tracks of the animation begin no
    /// later and end no earlier, so that its length stays. Returns the references to the new accessors, which are
    /// null until all others have been renumbered.
    pub(super) fn shorten(
        &self,
        json: &mut Value,
        rounding: &mut Rounding,
        output: &mut Output,
    ) -> Result<References, ReadError> {
        let roles = roles(self.source);
        let mut references = References::new();
        let mut known: HashMap<usize, Option<Times>> = HashMap::new();
        for (a, animation) in list(self.source, "animations").iter().enumerate() {
            let mut constant = Vec::new();
            let (mut first, mut last) = (f32::INFINITY, f32::NEG_INFINITY);
            for (s, sampler) in list(animation, "samplers").iter().enumerate() {
                let Some(input) = number(&sampler["input"]) else { continue };
                let times = match known.get(&input) {
                    Some(times) => *times,
                    None => *known.entry(input).or_insert(self.times(input)?),
                };
                let Some(times) = times else { continue };
                match self.constant(s, sampler, times, &roles, rounding)? {
                    Some(track) => constant.push(track),
                    None => (first, last) = (first.min(times.first), last.max(times.last)),
                }
            }
            for track in constant.iter().filter(|t| first <= t.times.first && t.times.last <= last) {
                let time = time_stream(track.times.first);
                for (key, source, stream) in
                    [("input", track.times.accessor, &time), ("output", track.output, &track.value)]
                {
                    json["animations"][a]["samplers"][track.sampler][key] = Value::Null;
                    let new = output.stream(Some(&self.source["accessors"][source]), stream);
                    references.push((format!("/animations/{a}/samplers/{}/{key}", track.sampler), new));
                }
            }
        }
        Ok(references)
    }

    /// Returns the times of an accessor, if it has any.
    fn times(&self, accessor: usize) -> Result<Option<Times>, ReadError> {
        let times = Accessor::new(self.source, self.buffers, accessor, "an animation")?;
        if times.kind != Component::F32 || times.width != 1 {
            return Ok(None);
        }
        let all = times.floats::<1>(false)?;
        let ends = all.first().zip(all.last());
        Ok(ends.map(|([first], [last])| Times { accessor, count: all.len(), first: *first, last: *last }))
    }

    /// Returns a track as a single keyframe, if all of its keyframes are equal.
    fn constant(
        &self,
        sampler: usize,
        object: &Value,
        times: Times,
        roles: &HashMap<usize, Role>,
        rounding: &mut Rounding,
    ) -> Result<Option<ConstantTrack>, ReadError> {
        let is_stepped = object["interpolation"] == "STEP";
        if !is_stepped && !object["interpolation"].is_null() && object["interpolation"] != "LINEAR" {
            return Ok(None);
        }
        let Some(output) = number(&object["output"]).filter(|_| times.count > 1) else { return Ok(None) };
        let role = roles.get(&output).copied().unwrap_or(Role::Other);
        let made = stream(self.source, self.buffers, output, role, self.packing, rounding)?;
        // Weights of morph targets have several numbers for each keyframe.
        let Some(mut value) = made.filter(|made| made.count().is_multiple_of(times.count)) else {
            return Ok(None);
        };
        let length = value.bytes.len() / times.count;
        let mut keyframes = value.bytes.chunks_exact(length.max(1));
        let first = keyframes.next();
        if first.is_none() || !keyframes.all(|keyframe| Some(keyframe) == first) {
            return Ok(None);
        }
        value.bytes.truncate(length);
        Ok(Some(ConstantTrack { sampler, times, output, value }))
    }
}

fn time_stream(time: f32) -> PackedStream {
    let bytes = time.to_le_bytes().to_vec();
    PackedStream {
        kind: StreamKind::Other(Role::Times.name()),
        number: NumberType::FLOAT,
        width: 1,
        stride: 4,
        bytes,
        filter: Filter::None,
        has_bounds: true,
    }
}
