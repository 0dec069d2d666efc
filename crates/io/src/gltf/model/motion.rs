//! Skins and animations.

use std::collections::HashMap;

use lodsmith_core::model::{Animation, Channel, Interpolation, ModelMesh, Node, Skin, Track};
use serde_json::Value;

use crate::error::{ReadError, Warning};
use crate::gltf::accessors::Accessor;
use crate::gltf::buffers::Buffers;
use crate::gltf::container::{list, number};
use crate::gltf::mesh::Budget;
use crate::gltf::skins;

/// Skins that could be read.
#[derive(Default)]
pub(super) struct Skins {
    pub(super) all: Vec<Skin>,
    /// Indices into `all`, by index in the file.
    places: Vec<Option<usize>>,
}

impl Skins {
    /// Returns the index in the model of a skin of the file.
    pub(super) fn number(&self, in_file: usize) -> Option<usize> {
        self.places.get(in_file).copied().flatten()
    }
}

pub(super) fn skins(
    json: &Value,
    buffers: &Buffers<'_>,
    budget: &mut Budget,
    warnings: &mut Vec<Warning>,
) -> Skins {
    let mut found = Skins::default();
    for (i, value) in list(json, "skins").iter().enumerate() {
        let name = format!("skins[{i}]");
        let place = match skins::read(json, buffers, value, &name, budget) {
            Ok(skin) => {
                found.all.push(skin);
                Some(found.all.len() - 1)
            }
            Err(e) => {
                let text = format!("{name} is left out, its meshes are shown undeformed: {e}");
                warnings.push(Warning::note(text));
                None
            }
        };
        found.places.push(place);
    }
    found
}

pub(super) fn animations(
    json: &Value,
    buffers: &Buffers<'_>,
    nodes: &[Node],
    meshes: &[ModelMesh],
    budget: &mut Budget,
    warnings: &mut Vec<Warning>,
) -> Vec<Animation> {
    let mut animations = Vec::new();
    // Number of skipped channels for each reason.
    let mut ignored: HashMap<String, usize> = HashMap::new();
    let mut order = Vec::new();
    for (i, value) in list(json, "animations").iter().enumerate() {
        let mut channels = Vec::new();
        for (c, channel) in list(value, "channels").iter().enumerate() {
            let name = format!("animations[{i}].channels[{c}]");
            match read_channel(json, buffers, (value, channel), &name, nodes, meshes, budget) {
                Ok(channel) => channels.extend(channel),
                Err(e) => {
                    let text = e.to_string();
                    let count = ignored.entry(text.clone()).or_insert_with(|| {
                        order.push(text);
                        0
                    });
                    *count += 1;
                }
            }
        }
        let name = value["name"].as_str().unwrap_or_default().to_owned();
        animations.push(Animation { name, channels });
    }
    // Guessed: more warnings would not help.
    const MAX_WARNINGS: usize = 16;
    for text in order.iter().take(MAX_WARNINGS) {
        let count = ignored[text];
        warnings.push(Warning::note(format!("{count} animation channels are ignored: {text}")));
    }
    if order.len() > MAX_WARNINGS {
        let more: usize = order[MAX_WARNINGS..].iter().map(|text| ignored[text]).sum();
        warnings.push(Warning::note(format!("{more} more animation channels are ignored")));
    }
    animations
}

/// Reads a channel; `None` for one without a target node.
fn read_channel(
    json: &Value,
    buffers: &Buffers<'_>,
    (animation, channel): (&Value, &Value),
    name: &str,
    nodes: &[Node],
    meshes: &[ModelMesh],
    budget: &mut Budget,
) -> Result<Option<Channel>, ReadError> {
    let target = &channel["target"];
    let path = target["path"].as_str().unwrap_or_default();
    if path == "pointer" {
        return Err(ReadError::Unsupported("KHR_animation_pointer is not supported".to_owned()));
    }
    // Only extensions have targets without a node.
    let Some(node) = number(&target["node"]) else { return Ok(None) };
    let missing = |what: &str| ReadError::element(name, format!("its {what} is missing"));
    let of = nodes.get(node).ok_or_else(|| missing("node"))?;
    let sampler = number(&channel["sampler"]).and_then(|s| list(animation, "samplers").get(s));
    let sampler = sampler.ok_or_else(|| missing("sampler"))?;
    let interpolation = match sampler["interpolation"].as_str() {
        None | Some("LINEAR") => Interpolation::Linear,
        Some("STEP") => Interpolation::Step,
        Some("CUBICSPLINE") => Interpolation::Cubic,
        Some(_) => return Err(ReadError::element(name, "its interpolation is unknown")),
    };
    let mut accessor = |what: &str| {
        let index = number(&sampler[what]).ok_or_else(|| missing(what))?;
        let accessor = Accessor::new(json, buffers, index, name)?;
        budget.numbers.take((accessor.count as u64).saturating_mul(accessor.width as u64))?;
        Ok::<_, ReadError>(accessor)
    };
    let (input, output) = (accessor("input")?, accessor("output")?);
    let times: Vec<f32> = input.floats::<1>(false)?.into_iter().flatten().collect();
    let is_ascending = times.windows(2).all(|w| w[0] <= w[1]) && times.iter().all(|t| t.is_finite());
    if times.is_empty() || !is_ascending {
        return Err(ReadError::element(name, "its times are not ascending"));
    }
    let (track, each) = match path {
        "translation" => (Track::Translation(output.floats(false)?), 1),
        "scale" => (Track::Scale(output.floats(false)?), 1),
        "rotation" => (Track::Rotation(output.floats(true)?), 1),
        "weights" => {
            let targets = of.mesh.and_then(|m| meshes.get(m)).map_or(0, |m| m.morph_weights.len());
            if targets == 0 {
                return Err(ReadError::element(name, "its node has no morph targets"));
            }
            (Track::MorphWeights(output.floats::<1>(true)?.into_iter().flatten().collect()), targets)
        }
        _ => return Err(ReadError::element(name, "its path is unknown")),
    };
    let for_each_time = if interpolation == Interpolation::Cubic { 3 } else { 1 };
    let wanted = times.len().saturating_mul(for_each_time).saturating_mul(each);
    if track.len() < wanted {
        let text = format!("it has {} values, expected {wanted}", track.len());
        return Err(ReadError::element(name, text));
    }
    Ok(Some(Channel { node, track, times, interpolation }))
}
