//! Baked maps in the materials of a glTF scene.

use std::collections::HashSet;
use std::sync::Arc;

use lodsmith::Control;
use lodsmith_core::{Model, TriMesh};
use lodsmith_io::Warning;
use lodsmith_io::gltf::{NewMaterial, Scene, SlotImage, TextureSlot};

use crate::baked::{Baked, BakedSet, bake};
use crate::error::BakeError;
use crate::options::{BakeOptions, MapKind};
use crate::search::Found;

/// The result of a bake whose materials were added to a scene.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct BakedScene {
    /// The meshes of the scene, with texture coordinates and tangents; `None` for meshes that no node places.
    pub meshes: Vec<Option<TriMesh>>,
    /// For each mesh and primitive (one entry for all), its material in the scene.
    pub materials: Vec<Vec<usize>>,
    /// Maps as PNG that a material has no slot for, or all maps, by the suffixes of their names: `_height.png`.
    pub files: Vec<(String, Arc<Vec<u8>>)>,
    /// The maps.
    pub sets: Vec<BakedSet>,
    /// Counts of how source points were found.
    pub found: Found,
    /// Warnings: coordinates that could not be used, models in different places, and lost data of materials.
    pub warnings: Vec<Warning>,
}

/// Share of samples without a counterpart above which there is a note. (Guessed.)
const MAX_UNMATCHED: f64 = 0.2;

/// Bakes maps of a lighter model from a detailed one, and adds their materials to the scene of the lighter one. The
/// caller assigns them to meshes with [`set_materials`]. With `all_files` the files also include the maps of materials.
///
/// Cost: [`bake`], and writing PNG.
///
/// # Errors
/// As [`bake`]; [`BakeError::Picture`] if a map is too large for PNG.
pub fn bake_scene(
    detailed: &Model,
    lighter: &Model,
    scene: &mut Scene,
    options: &BakeOptions,
    all_files: bool,
    control: &mut dyn Control,
) -> Result<BakedScene, BakeError> {
    let Baked { meshes, set_of_region, sets, found, notes } = bake(detailed, lighter, options, control)?;
    let mut warnings: Vec<Warning> = notes.into_iter().map(Warning::note).collect();
    let mut numbers = Vec::with_capacity(sets.len());
    let mut files = Vec::new();
    for (set, own) in sets.iter().zip(name_parts(&sets)) {
        let material = material_of(set, all_files, &own, &mut files)?;
        let lost = scene.further_data(&set.replaced);
        if !lost.is_empty() {
            warnings.push(Warning::lost(format!(
                "the material of the new atlas drops data of the materials that it replaces: {}",
                lost.join(", ")
            )));
        }
        numbers.push(scene.add_material(&material));
    }
    let materials = set_of_region.iter().map(|all| all.iter().map(|s| numbers[*s]).collect()).collect();
    let total = found.by_correspondence + found.by_ray + found.by_distance + found.elsewhere;
    let unmatched = found.elsewhere as f64 / total.max(1) as f64;
    if unmatched > MAX_UNMATCHED {
        warnings.push(Warning::note(format!(
            "{:.0} % of the texels have no counterpart within reach: are both models in the same place?",
            100.0 * unmatched
        )));
    }
    Ok(BakedScene { meshes, materials, files, sets, found, warnings })
}

/// Assigns their baked materials to the meshes of a scene.
pub fn set_materials(scene: &mut Scene, materials: &[Vec<usize>]) {
    for (mesh, own) in materials.iter().enumerate() {
        for (primitive, material) in own.iter().enumerate() {
            scene.set_material(mesh, (own.len() > 1).then_some(primitive), *material);
        }
    }
}

/// Returns a model with some meshes replaced.
pub fn model_with(model: &Model, replaced: &[Option<TriMesh>]) -> Model {
    let meshes = model.meshes.iter().enumerate().map(|(i, old)| match replaced.get(i) {
        Some(Some(mesh)) => Arc::new(mesh.clone()),
        _ => old.mesh.clone(),
    });
    model.with_meshes(meshes.collect())
}

/// Returns the material of a set; maps that are files are added to `files`, with `own` in the suffixes of their names.
fn material_of(
    set: &BakedSet,
    all_files: bool,
    own: &str,
    files: &mut Vec<(String, Arc<Vec<u8>>)>,
) -> Result<NewMaterial, BakeError> {
    let mut images = Vec::new();
    for map in &set.maps {
        let picture = |e: lodsmith_render::file::PictureError| BakeError::Picture {
            map: map.kind.name(),
            problem: e.to_string(),
        };
        let png = Arc::new(map.to_png().map_err(picture)?);
        let end = format!("{own}_{}.png", map.kind.name());
        let packed = images.iter().find(|i: &&SlotImage| i.slot == TextureSlot::MetallicRoughness);
        if let (MapKind::Occlusion, Some(packed)) = (map.kind, packed) {
            // Its red channel holds the same values.
            images.push(SlotImage { slot: TextureSlot::Occlusion, ..packed.clone() });
        } else if let Some(slot) = slot_of(map.kind) {
            let name = format!("{}{}", safe(&set.name), end.trim_end_matches(".png"));
            images.push(SlotImage { slot, name: name.trim_start_matches('_').to_owned(), png: png.clone() });
        }
        if all_files || !map.kind.is_of_material() {
            files.push((end, png));
        }
    }
    Ok(NewMaterial::new(set.look.clone(), set.material, images))
}

fn slot_of(kind: MapKind) -> Option<TextureSlot> {
    match kind {
        MapKind::Color => Some(TextureSlot::BaseColor),
        MapKind::MetallicRoughness => Some(TextureSlot::MetallicRoughness),
        MapKind::Normal => Some(TextureSlot::Normal),
        MapKind::Occlusion => Some(TextureSlot::Occlusion),
        MapKind::Emissive => Some(TextureSlot::Emissive),
        _ => None,
    }
}

/// Returns for each set the part of its file names that distinguishes it from the others: nothing for a single set,
/// else the name of the material, with the number of the set if several share a name.
fn name_parts(sets: &[BakedSet]) -> Vec<String> {
    let mut taken = HashSet::new();
    let part = |(i, set): (usize, &BakedSet)| {
        let name = match set.name.as_str() {
            "" => String::new(),
            _ if sets.len() == 1 => String::new(),
            name => format!("_{}", safe(name)),
        };
        let mut own = name.clone();
        // Some file systems are case-insensitive.
        for number in i + 1.. {
            if taken.insert(own.to_lowercase()) {
                break;
            }
            own = format!("{name}_{number}");
        }
        own
    };
    sets.iter().enumerate().map(part).collect()
}

/// Returns a name that any file system accepts.
fn safe(name: &str) -> String {
    let letter = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' };
    name.chars().take(60).map(letter).collect()
}
